"""Normals of a mesh's vertices."""

from typing import Any

import numpy as np
from numpy.typing import NDArray


def vertex_normals(
    vertices: NDArray[np.floating[Any]], faces: NDArray[np.integer[Any]], *, welded: bool = False
) -> NDArray[np.float64]:
    """Return (V, 3) unit normals of vertices: the mean of their faces' by area."""
    places = vertices.astype(np.float64)
    shared = np.arange(len(places))
    if welded:  # vertices at one place share their normal: a seam or a pole is shaded round
        shared = np.unique(places.round(9), axis=0, return_inverse=True)[1].reshape(-1)
    corners = places[faces]
    of_faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    used = shared[faces].ravel()
    sums = np.stack(
        [np.bincount(used, np.repeat(of_faces[:, axis], 3), len(places)) for axis in range(3)],
        axis=1,
    )[shared]
    # At a point where no face has an area any direction is as good.
    lengths = np.linalg.norm(sums, axis=1, keepdims=True)
    return np.where(lengths > 0.0, sums / np.maximum(lengths, 1e-300), (0.0, 0.0, 1.0))
