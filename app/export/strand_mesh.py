"""Strands as a mesh for a rigged organ: thin tubes that shrink to stubs where they part.

A tube reaches from its foot, which stays with the bed, to its end, which follows the organ's
joints, so that skinning alone draws a whole strand. Two stubs lie in it, cones without thickness.
What parts together is one morph target: it takes the tubes' thickness and gives it to the stubs.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.export.strands import BedTrack

RADIUS = 0.07
"""mm."""
SIDES = 3
# Most morph targets, which viewers keep in one texture; with more partings neighbours join.
MOST_SHAPES = 64


@dataclass(frozen=True, slots=True, eq=False)
class StrandMesh:
    """Tubes and stubs of S strands, V vertices."""

    vertices: NDArray[np.float32]  # (V, 3) at rest, mm
    normals: NDArray[np.float32]  # (V, 3)
    faces: NDArray[np.int32]  # (F, 3)
    stations: NDArray[np.float64]  # (V,) along the organ's axis, mm
    on_bed: NDArray[np.bool_]  # (V,) what stays with the bed
    shapes: NDArray[np.float32]  # (M, V, 3) displacements where strands part, mm
    weights: NDArray[np.float32]  # (T, M) at the keys of the motion


def strand_mesh(bed: BedTrack) -> StrandMesh:
    """Return the strands of a bed as a mesh."""
    count = len(bed.feet)
    direction = bed.ends[:, 0] - bed.feet[:, 0]
    direction /= np.sqrt((direction**2).sum(axis=1, keepdims=True))
    # Two directions across each strand, from the coordinate axis least along it.
    helper = np.eye(3)[np.argmin(np.abs(direction), axis=1)]
    across = np.cross(direction, helper)
    across /= np.sqrt((across**2).sum(axis=1, keepdims=True))
    other = np.cross(direction, across)
    angles = 2.0 * np.pi * np.arange(SIDES) / SIDES
    outward = (
        np.cos(angles)[:, None] * across[:, None] + np.sin(angles)[:, None] * other[:, None]
    )  # (S, SIDES, 3)
    foot, foot_tip = bed.feet[:, :1], bed.feet[:, 1:]
    end, end_tip = bed.ends[:, :1], bed.ends[:, 1:]
    tube = RADIUS * outward
    # Of each strand: the tube's rings at the foot and the end, then ring and tip of both stubs.
    nothing = np.zeros_like(outward)
    vertices = [foot + tube, end + tube, foot + nothing, foot_tip, end + nothing, end_tip]
    normals = [outward, outward, outward, direction[:, None], outward, -direction[:, None]]
    parting = [-tube, -tube, tube, nothing[:, :1], tube, nothing[:, :1]]
    size = sum(piece.shape[1] for piece in vertices)
    on_bed = np.repeat([True, False, True, True, False, False], [SIDES, SIDES, SIDES, 1, SIDES, 1])
    ring = np.arange(SIDES)
    after = np.roll(ring, -1)
    low, high = 2 * SIDES, 3 * SIDES + 1
    faces = np.concatenate(
        [
            np.stack([ring, after, SIDES + after], axis=1),
            np.stack([ring, SIDES + after, SIDES + ring], axis=1),
            np.stack([low + ring, low + after, np.full(SIDES, low + SIDES)], axis=1),
            np.stack([high + after, high + ring, np.full(SIDES, high + SIDES)], axis=1),
        ]
    )
    first = size * np.arange(count)[:, None, None]
    shapes, weights = _partings(bed.damage >= 1.0, np.concatenate(parting, axis=1))
    return StrandMesh(
        np.concatenate(vertices, axis=1).reshape(-1, 3).astype(np.float32),
        np.concatenate(normals, axis=1).reshape(-1, 3).astype(np.float32),
        (first + faces).reshape(-1, 3).astype(np.int32),
        np.repeat(bed.strand_stations, size),
        np.tile(on_bed, count),
        shapes,
        weights,
    )


def _partings(
    parted: NDArray[np.bool_], moved: NDArray[np.float64]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return a shape and a column of weights for the strands of each key at which some part."""
    # (T, S) whether each has parted, and (S, W, 3) displacements of its vertices, mm.
    keys = np.where(parted.any(axis=0), parted.argmax(axis=0), -1)
    partings = np.unique(keys[keys >= 0])
    groups = np.array_split(partings, min(len(partings), MOST_SHAPES)) if len(partings) else []
    shapes = np.zeros((len(groups), *moved.shape), np.float32)
    weights = np.zeros((len(parted), len(groups)), np.float32)
    for number, group in enumerate(groups):
        among = np.isin(keys, group)
        shapes[number, among] = moved[among]
        weights[group[len(group) // 2] :, number] = 1.0
    return shapes.reshape(len(groups), moved.size // 3, 3), weights
