"""Surfaces that the stage is made of: grids and swept sections; and their GLB files."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from organ_geometry.mesh import Finish, GltfFile, VectorKind, vertex_normals


@dataclass(frozen=True, slots=True, eq=False)
class Solid:
    """A triangle surface."""

    vertices: NDArray[np.float64]  # (V, 3) mm
    faces: NDArray[np.int64]  # (F, 3) vertex indices, counter-clockwise from outside
    normals: NDArray[np.float64]  # (V, 3) unit vectors, outward
    uv: NDArray[np.float64] | None = None  # (V, 2) texture coordinates, v upward


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """A solid and its finish."""

    solid: Solid
    finish: Finish


def solids_glb(pieces: Sequence[Piece]) -> bytes:
    """Return one GLB file with every part, in the solids' own frame."""
    file = GltfFile()
    for number, piece in enumerate(pieces):
        solid = piece.solid
        count = len(solid.vertices)

        def vectors(array: NDArray[np.float64], kind: VectorKind, *, bounded: bool = False) -> int:
            return file.accessor(array.astype(np.float32), kind, target="vertices", bounded=bounded)

        attributes = {
            "POSITION": vectors(solid.vertices, "VEC3", bounded=True),
            "NORMAL": vectors(solid.normals, "VEC3"),
        }
        if solid.uv is not None:  # glTF's v goes downwards
            attributes["TEXCOORD_0"] = vectors(solid.uv * (1.0, -1.0) + (0.0, 1.0), "VEC2")
        item = {
            "attributes": attributes,
            "indices": file.indices(solid.faces, count),
            "material": file.material(piece.finish),
        }
        name = str(number)
        mesh = file.add("meshes", {"name": name, "primitives": [item]})
        file.add_root({"name": name, "mesh": mesh})
    return file.content()


def grid_faces(rows: int, columns: int, *, closed: bool = False) -> NDArray[np.int64]:
    """Return (F, 3) triangles of a grid stored row by row; the normal is row x column."""
    row = np.arange(rows - 1)[:, None] * columns
    column = np.arange(columns if closed else columns - 1)[None, :]
    here, right = row + column, row + (column + 1) % columns
    below, opposite = here + columns, right + columns
    return np.concatenate(
        [
            np.stack([here, right, below], axis=-1).reshape(-1, 3),
            np.stack([right, opposite, below], axis=-1).reshape(-1, 3),
        ]
    )


def swept_solid(
    path: ArrayLike,
    half_widths: ArrayLike,
    half_heights: ArrayLike | None = None,
    *,
    side: Sequence[float] = (0.0, 1.0, 0.0),
    squareness: float = 0.0,
    corners: int = 20,
    cap_rings: int = 5,
) -> Solid:
    """Return a bar with rounded ends whose section is swept along a path."""
    points = np.asarray(path, np.float64)
    widths = np.broadcast_to(np.asarray(half_widths, np.float64), len(points))
    heights = (
        widths
        if half_heights is None
        else np.broadcast_to(np.asarray(half_heights, np.float64), len(points))
    )
    tangents = np.gradient(points, axis=0)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    sides = np.empty_like(points)
    carried = np.asarray(side, np.float64)
    for index, tangent in enumerate(tangents):
        carried = carried - tangent * (carried @ tangent)
        carried = carried / np.linalg.norm(carried)
        sides[index] = carried

    # Rounded ends: the end sections repeated outwards, shrinking along a quarter of an ellipse.
    angles = np.linspace(0.0, np.pi / 2.0, cap_rings + 1)[1:]
    reach = [min(widths[end], heights[end]) * (1.0 - 0.5 * squareness) for end in (0, -1)]
    start = points[0] - tangents[0] * (reach[0] * np.sin(angles[::-1]))[:, None]
    stop = points[-1] + tangents[-1] * (reach[1] * np.sin(angles))[:, None]
    shrink = np.concatenate([np.cos(angles[::-1]), np.ones(len(points)), np.cos(angles)])
    points = np.concatenate([start, points, stop])
    repeated = np.r_[np.zeros(cap_rings, int), np.arange(len(tangents)), np.full(cap_rings, -1)]
    tangents, sides = tangents[repeated], sides[repeated]
    widths, heights = widths[repeated] * shrink, heights[repeated] * shrink

    angle = np.linspace(0.0, 2.0 * np.pi, corners, endpoint=False)
    power = 1.0 - squareness
    across = np.sign(np.cos(angle)) * np.abs(np.cos(angle)) ** power
    upward = np.sign(np.sin(angle)) * np.abs(np.sin(angle)) ** power
    ups = np.cross(tangents, sides)
    vertices = (
        points[:, None]
        + (widths[:, None] * across)[..., None] * sides[:, None]
        + (heights[:, None] * upward)[..., None] * ups[:, None]
    ).reshape(-1, 3)
    faces = grid_faces(len(points), corners, closed=True)
    return Solid(vertices, faces, vertex_normals(vertices, faces, welded=True))


def joined_solid(solids: Sequence[Solid]) -> Solid:
    """Return several solids as one, without texture coordinates."""
    offsets = np.cumsum([0, *(len(solid.vertices) for solid in solids)])
    return Solid(
        np.concatenate([solid.vertices for solid in solids]),
        np.concatenate(
            [solid.faces + offset for solid, offset in zip(solids, offsets, strict=False)]
        ),
        np.concatenate([solid.normals for solid in solids]),
    )


def smooth_path(knots: ArrayLike, count: int) -> NDArray[np.float64]:
    """Return points evenly along a Catmull-Rom curve through the knots."""
    given = np.asarray(knots, np.float64)
    padded = np.concatenate([2.0 * given[:1] - given[1:2], given, 2.0 * given[-1:] - given[-2:-1]])
    place = np.linspace(0.0, len(given) - 1.0, 24 * len(given))
    segment = np.minimum(place.astype(int), len(given) - 2)
    t = (place - segment)[:, None]
    before, here, after, beyond = (padded[segment + step] for step in range(4))
    dense = 0.5 * (
        2.0 * here
        + (after - before) * t
        + (2.0 * before - 5.0 * here + 4.0 * after - beyond) * t**2
        + (3.0 * here - before - 3.0 * after + beyond) * t**3
    )
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(dense, axis=0), axis=1))])
    even = np.linspace(0.0, float(arc[-1]), count)
    return np.stack([np.interp(even, arc, dense[:, axis]) for axis in range(3)], axis=-1)
