"""Where places of the stage are in the picture."""

import numpy as np
from numpy.typing import NDArray

from app.trainer.stage.camera import Viewpoint


def picture_points(
    view: Viewpoint, points: NDArray[np.float64], aspect: float
) -> NDArray[np.float64]:
    """(N, 2) places in the picture, right and up, -1 to 1 from edge to edge."""
    forward = (view.look_at - view.position) / view.distance
    right = np.cross(forward, view.up)
    right /= np.linalg.norm(right)
    above = np.cross(right, forward)
    relative = points - view.position
    scale = np.tan(view.fov / 2.0) * (relative @ forward)
    return np.stack([relative @ right / (scale * aspect), relative @ above / scale], axis=-1)
