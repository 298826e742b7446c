"""Distances of points to a triangle mesh, and points spread over a mesh."""

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree
from trimesh.remesh import subdivide_to_size

Points = NDArray[np.float64]
Faces = NDArray[np.int64]

PIECES = 20_000
NEIGHBOURS = 12

# Fractional parts of the plastic number's powers: the R2 sequence (Roberts 2018).
_R2 = np.array([0.7548776662466927, 0.5698402909980532])


class TriangleSurface:
    """A triangle mesh that distances are measured to.

    Its triangles are cut into small ones for the search. A point's distance is the least to the
    triangles of its nearest few, and more of them are taken until no other can be nearer.
    """

    def __init__(self, vertices: Points, faces: Faces, pieces: int = PIECES) -> None:
        # (V, 3) vertices and (F, 3) triangles, cut into about so many small ones: the nearest of
        # their middles says which few triangles to measure to.
        vertices = np.asarray(vertices, dtype=np.float64)
        self._corners = vertices[faces]
        areas = np.linalg.norm(_normals(self._corners), axis=1) / 2.0
        edge = float(np.sqrt(4.0 * areas.sum() / pieces))
        small, triangles, *owners = subdivide_to_size(
            vertices, faces, edge, max_iter=30, return_index=True
        )
        self._owners = np.concatenate(owners)
        cut = small[triangles]
        middles = cut.mean(axis=1)
        self._reach = float(np.linalg.norm(cut - middles[:, np.newaxis], axis=2).max())
        self._tree = KDTree(middles)

    def distances(self, points: Points) -> Points:
        """Return the distance of each point to the mesh."""
        found = np.full(len(points), np.inf)
        left = np.arange(len(points))
        count = NEIGHBOURS
        while len(left):
            count = min(count, self._tree.n)
            away, nearest = self._tree.query(points[left], k=count)
            _walk(points, left, self._owners[nearest], away - self._reach, self._corners, found)
            if count == self._tree.n:
                break
            left = left[away[:, -1] - self._reach < found[left]]
            count *= 4
        return found


def triangle_distances(points: Points, corners: Points) -> Points:
    """Return the distance of each point to the nearest of some triangles, tried one by one."""
    found = np.full(len(points), np.inf)
    every = np.broadcast_to(np.arange(len(corners)), (len(points), len(corners)))
    _walk(points, np.arange(len(points)), every, np.zeros(every.shape), corners, found)
    return found


@numba.njit(cache=True)
def _walk(points, left, triangles, least, corners, found):  # pragma: no cover
    """Lower the distances found for some points, until none of their triangles can be nearer."""
    for place in range(len(left)):
        point = points[left[place]]
        best = found[left[place]]
        for near in range(triangles.shape[1]):
            if least[place, near] >= best:
                break
            best = min(best, _triangle_distance(point, corners[triangles[place, near]]))
        found[left[place]] = best


@numba.njit(cache=True)
def _triangle_distance(point, corners):  # pragma: no cover
    """Return the distance of a point (3,) to a triangle with corners (3, 3)."""
    one, two = corners[1] - corners[0], corners[2] - corners[0]
    n0 = one[1] * two[2] - one[2] * two[1]
    n1 = one[2] * two[0] - one[0] * two[2]
    n2 = one[0] * two[1] - one[1] * two[0]
    squared = n0 * n0 + n1 * n1 + n2 * n2
    inside = squared > 0.0
    rim = np.inf
    for start in range(3):
        first, second = corners[start], corners[(start + 1) % 3]
        e0, e1, e2 = second[0] - first[0], second[1] - first[1], second[2] - first[2]
        a0, a1, a2 = point[0] - first[0], point[1] - first[1], point[2] - first[2]
        turn = n0 * (e1 * a2 - e2 * a1) + n1 * (e2 * a0 - e0 * a2) + n2 * (e0 * a1 - e1 * a0)
        if turn < 0.0:
            inside = False
        length = e0 * e0 + e1 * e1 + e2 * e2
        fraction = 0.0
        if length > 0.0:
            fraction = min(1.0, max(0.0, (a0 * e0 + a1 * e1 + a2 * e2) / length))
        rim = min(
            rim, (a0 - fraction * e0) ** 2 + (a1 - fraction * e1) ** 2 + (a2 - fraction * e2) ** 2
        )
    if not inside:
        return np.sqrt(rim)
    away = point - corners[0]
    return abs(n0 * away[0] + n1 * away[1] + n2 * away[2]) / np.sqrt(squared)


def spread_points(vertices: Points, faces: Faces, count: int) -> tuple[Points, NDArray[np.intp]]:
    """Return points spread evenly over a mesh's area, always the same ones."""
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
