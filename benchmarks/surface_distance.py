"""Distances of points to a triangle mesh, and points spread over a mesh."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from trimesh.remesh import subdivide_to_size

__all__ = ["TriangleSurface", "spread_points", "triangle_distances"]

Points = NDArray[np.float64]
Faces = NDArray[np.int64]

PARTS = 40_000
NEIGHBOURS = 8

# Fractional parts of the plastic number's powers: the R2 sequence (Roberts 2018).
_R2 = np.array([0.7548776662466927, 0.5698402909980532])


class TriangleSurface:
    """A triangle mesh that distances are measured to.

    Its triangles are cut into small ones for the search. A point's distance is the least to the
    triangles of its nearest few, and more of them are taken until no other can be nearer.

    Parameters
    ----------
    vertices
        (V, 3) vertices.
    faces
        (F, 3) triangles.
    parts
        About how many small triangles it is cut into.
    """

    def __init__(self, vertices: Points, faces: Faces, parts: int = PARTS) -> None:
        vertices = np.asarray(vertices, dtype=np.float64)
        self._corners = vertices[faces]
        areas = np.linalg.norm(_normals(self._corners), axis=1) / 2.0
        edge = float(np.sqrt(4.0 * areas.sum() / parts))
        small, triangles, self._owners = subdivide_to_size(
            vertices, faces, edge, max_iter=30, return_index=True
        )
        cut = small[triangles]
        middles = cut.mean(axis=1)
        self._reach = float(np.linalg.norm(cut - middles[:, np.newaxis], axis=2).max())
        self._tree = cKDTree(middles)

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
        found = np.full(len(points), np.inf)
        left = np.arange(len(points))
        count = NEIGHBOURS
        while len(left):
            count = min(count, self._tree.n)
            away, nearest = self._tree.query(points[left], k=count)
            corners = self._corners[self._owners[nearest]]
            found[left] = triangle_distances(points[left, np.newaxis], corners).min(axis=1)
            if count == self._tree.n:
                break
            left = left[away[:, -1] - self._reach < found[left]]
            count *= 4
        return found


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
    normal = _normals(corners)
    squared = np.einsum("...i,...i->...", normal, normal)
    height = np.einsum("...i,...i->...", points - first, normal)
    inside = np.broadcast_to(squared > 0.0, height.shape).copy()
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
    ends = np.cumsum(np.linalg.norm(_normals(corners), axis=1))
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


def _normals(corners: Points) -> Points:
    """Return the (..., 3) normals of triangles, as long as twice their areas."""
    first, second, third = (corners[..., row, :] for row in range(3))
    return np.cross(second - first, third - first)
