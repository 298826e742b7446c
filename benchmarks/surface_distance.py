"""Distances of points to a triangle mesh, and points spread over a mesh."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

__all__ = ["TriangleSurface", "spread_points", "triangle_distances"]

Points = NDArray[np.float64]
Faces = NDArray[np.int64]

DENSE_POINTS = 200_000
NEIGHBOURS = 6

# Fractional parts of the plastic number's powers: the R2 sequence (Roberts 2018).
_R2 = np.array([0.7548776662466927, 0.5698402909980532])


class TriangleSurface:
    """A triangle mesh that distances are measured to.

    Points are spread over the mesh densely; a point's distance is the exact one to the triangles
    that its nearest few belong to.

    Parameters
    ----------
    vertices
        (V, 3) vertices.
    faces
        (F, 3) triangles.
    dense
        Number of points spread over the mesh.
    """

    def __init__(self, vertices: Points, faces: Faces, dense: int = DENSE_POINTS) -> None:
        spread, owners = spread_points(vertices, faces, dense)
        self._corners = np.asarray(vertices, dtype=np.float64)[faces]
        self._owners = owners
        self._tree = cKDTree(spread)

    def distances(self, points: Points) -> Points:
        """Return the distance of each point to the mesh.

        Parameters
        ----------
        points
            (N, 3) points.

        Returns
        -------
        NDArray[np.float64]
            (N,) distances, 0 or more.
        """
        _, nearest = self._tree.query(points, k=NEIGHBOURS)
        corners = self._corners[self._owners[nearest]]
        return triangle_distances(points[:, np.newaxis], corners).min(axis=1)


def triangle_distances(points: Points, corners: Points) -> Points:
    """Return distances of points to triangles, pair by pair.

    Parameters
    ----------
    points
        (..., 3) points.
    corners
        (..., 3, 3) corners of the triangles, one a row.

    Returns
    -------
    NDArray[np.float64]
        (...) distances.
    """
    first, second, third = (corners[..., row, :] for row in range(3))
    normal = np.cross(second - first, third - first)
    squared = np.einsum("...i,...i->...", normal, normal)
    height = np.einsum("...i,...i->...", points - first, normal)
    inside = squared > 0.0
    rim = np.full(height.shape, np.inf)
    for start, end in ((first, second), (second, third), (third, first)):
        edge, away = end - start, points - start
        inside &= np.einsum("...i,...i->...", np.cross(edge, away), normal) >= 0.0
        length = np.maximum(np.einsum("...i,...i->...", edge, edge), np.finfo(np.float64).tiny)
        share = np.clip(np.einsum("...i,...i->...", away, edge) / length, 0.0, 1.0)
        left = away - share[..., np.newaxis] * edge
        np.minimum(rim, np.einsum("...i,...i->...", left, left), out=rim)
    plane = np.abs(height) / np.sqrt(np.where(inside, squared, 1.0))
    return np.where(inside, plane, np.sqrt(rim))


def spread_points(vertices: Points, faces: Faces, count: int) -> tuple[Points, NDArray[np.intp]]:
    """Return points spread evenly over a mesh's area, always the same ones.

    Parameters
    ----------
    vertices
        (V, 3) vertices.
    faces
        (F, 3) triangles.
    count
        Number of points N.

    Returns
    -------
    tuple[NDArray[np.float64], NDArray[np.intp]]
        (N, 3) points, and the (N,) triangle of each.
    """
    corners = np.asarray(vertices, dtype=np.float64)[faces]
    first, second, third = (corners[:, row] for row in range(3))
    areas = np.linalg.norm(np.cross(second - first, third - first), axis=1)
    ends = np.cumsum(areas)
    wanted = (np.arange(count) + 0.5) * (ends[-1] / count)
    owners = np.minimum(np.searchsorted(ends, wanted, side="right"), len(faces) - 1)
    across = np.modf(np.outer(np.arange(count) + 1.0, _R2))[0]
    beyond = across.sum(axis=1) > 1.0
    across[beyond] = 1.0 - across[beyond]
    points = (
        first[owners]
        + across[:, :1] * (second - first)[owners]
        + across[:, 1:] * (third - first)[owners]
    )
    return points, owners
