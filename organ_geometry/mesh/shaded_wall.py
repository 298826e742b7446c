"""Shaded walls: a skin's outer wall and its inside as meshes of their own, with normals.

Where two walls meet, at an end or a torn rim, the surface has an edge. A shared vertex would carry
one normal for both sides of it and shade it round; here each side has a vertex of its own, at the
same place to the bit.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["ShadedWall", "shaded_walls", "vertex_normals"]


@dataclass(frozen=True, slots=True, eq=False)
class ShadedWall:
    """Triangles of one colour.

    Attributes
    ----------
    name
        "outer wall" or "inside".
    source
        (W,) number of the surface's vertex that each vertex stands at.
    faces
        (F, 3) numbers of the wall's own vertices.
    """

    name: str
    source: NDArray[np.intp]
    faces: NDArray[np.int32]


def shaded_walls(faces: NDArray[np.int32], outer_faces: int) -> tuple[ShadedWall, ShadedWall]:
    """Return the outer wall of a skin, and its inside: the lumen and what closes the rims.

    Parameters
    ----------
    faces
        (F, 3) vertex numbers of a skin, in the order of `Skin.faces`.
    outer_faces
        How many of them are the outer wall's.

    Returns
    -------
    tuple[ShadedWall, ShadedWall]
        Outer wall and inside.
    """
    rest = faces[outer_faces:]
    # A hollow skin's lumen has as many faces as its outer wall, and its rims come on top.
    lumen = outer_faces if len(rest) > outer_faces else 0
    return (
        _wall("outer wall", [faces[:outer_faces]]),
        _wall("inside", [rest[:lumen], rest[lumen:]]),
    )


def _wall(name: str, sides: list[NDArray[np.int32]]) -> ShadedWall:
    sources: list[NDArray[np.intp]] = []
    numbered: list[NDArray[np.int32]] = []
    before = 0
    for faces in sides:
        used, places = np.unique(faces, return_inverse=True)
        sources.append(used.astype(np.intp))
        numbered.append((places.reshape(faces.shape) + before).astype(np.int32))
        before += len(used)
    return ShadedWall(name, np.concatenate(sources), np.concatenate(numbered))


def vertex_normals(vertices: NDArray[np.float32], faces: NDArray[np.int32]) -> NDArray[np.float64]:
    """Return unit normals of a mesh's vertices: the mean of their faces' by area.

    Parameters
    ----------
    vertices
        (V, 3) places.
    faces
        (F, 3) vertex numbers.

    Returns
    -------
    NDArray[np.float64]
        (V, 3) normals, outwards.
    """
    corners = vertices.astype(np.float64)[faces]
    of_faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sums = np.stack(
        [
            np.bincount(faces.ravel(), np.repeat(of_faces[:, axis], 3), len(vertices))
            for axis in range(3)
        ],
        axis=1,
    )
    return sums / np.linalg.norm(sums, axis=1, keepdims=True)
