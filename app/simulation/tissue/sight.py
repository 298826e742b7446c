"""From where a duct or an anatomy is seen, and what of it."""

import math

import numpy as np
from numpy.typing import NDArray

from kernel_cache import kernel

TOWARDS_VIEWER = np.array([0.0, -0.8, 0.6])
"""(3,) in the duct's frame, towards the camera of the standard view, as long as nobody moves it."""
STEADY = math.cos(math.radians(5.0))
"""Cosine of the angle by which a view must turn before it counts as another."""
STEADY_MM = 5.0
"""mm by which a camera must move before its view counts as another."""
WORKING_DISTANCE = 5.0
"""mm along the duct from an instrument within which strands are seen, on whichever side."""
FIELD_OF_VIEW = math.radians(60.0)
"""From edge to edge of a scope's round picture, rad."""
_EDGE = math.cos(0.5 * FIELD_OF_VIEW)
LINE_OF_SIGHT = 6
"""Numbers of a view by which it is known what is in the picture."""


@kernel()
def in_picture(pose: tuple[float, ...], place: NDArray[np.float64]) -> bool:
    """Return whether a place, (3,) mm, is in the picture of a scope with this line of sight."""
    x, y, z = place[0] - pose[3], place[1] - pose[4], place[2] - pose[5]
    deep = -(x * pose[0] + y * pose[1] + z * pose[2])
    return deep >= _EDGE * math.sqrt(x * x + y * y + z * z)
