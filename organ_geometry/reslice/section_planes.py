"""The planes of sections along a centreline: across it, and not through each other.

Planes stand across the line's smoothed tangents, with directions in them that turn about the line
as little as possible (rotation-minimising frames). In a bend tighter than the tube is wide two
neighbours would cross inside it; then tangents are fitted over longer pieces, which turns planes
towards their neighbours, and of all that was tried the one with fewest crossings is taken.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from organ_geometry.reslice.centreline import ALONG_ROWS, TANGENT_RADII, Tube
from organ_geometry.reslice.curve_frames import rotation_minimising_frames, smooth_tangents

# Planes are turned towards their neighbours, by fitting tangents over so many times the usual
# length, until they do not cross inside the organ.
_TURN_FACTORS = (1.0, 1.5, 2.0, 3.0)

# A voxel belongs to the nearest section if it is no further off than so many times the radius of
# a disc of the section's area: ovals three times as long as wide are just inside.
_BESIDE_RADII = 1.8
_MOST_VOXELS = 5000


@dataclass(frozen=True, slots=True, eq=False)
class SectionPlanes:
    """Planes along a centreline."""

    frames: NDArray[np.float64]  # (S, 3, 3) two directions in each plane and its normal, as columns
    reach: float  # How far sections reach from the centreline along either direction, mm
    crossing: int  # Number of planes that cross the next one inside the tube
    beside: float  # Share of the tube that is in none of the sections' reach
    # First and last image of the tube with that, a tenth of it left out at either end.
    beside_images: tuple[int, int]


def section_planes(
    tube: Tube, points: NDArray[np.float64], depths: NDArray[np.float64], radius: float
) -> SectionPlanes:
    """Return planes through points of a centreline."""
    tried: list[SectionPlanes] = []
    for factor in _TURN_FACTORS:
        tangents = smooth_tangents(points, round(factor * TANGENT_RADII * radius))
        frames = rotation_minimising_frames(points, tangents, ALONG_ROWS)
        tried.append(_measured(tube, points, frames, depths))
        if tried[-1].crossing == 0:
            break
    return min(tried, key=lambda planes: planes.crossing)


def _measured(
    tube: Tube,
    points: NDArray[np.float64],
    frames: NDArray[np.float64],
    depths: NDArray[np.float64],
) -> SectionPlanes:
    """Return planes, with their crossings and the share of the tube beside them."""
    reach, crossing = 0.0, 0
    radii = np.zeros(len(points))
    for index, (point, frame) in enumerate(zip(points, frames, strict=True)):
        section, pixel = tube.section(point, frame, float(depths[index]))
        if len(section) == 0:
            continue
        reach = max(reach, float(np.abs(section).max()))
        radii[index] = pixel * (len(section) / np.pi) ** 0.5
        if index + 1 < len(points):
            # Every place of a section must lie before the next plane.
            places = point + section @ frame[:, :2].T
            crossing += bool(((points[index + 1] - places) @ frames[index + 1][:, 2] < 0.0).any())
    return SectionPlanes(frames, reach, crossing, *_beside(tube, points, radii))


def _beside(
    tube: Tube, points: NDArray[np.float64], radii: NDArray[np.float64]
) -> tuple[float, tuple[int, int]]:
    """Return the share of a tube that is too far from its sections to be in them, and where."""
    inside = np.flatnonzero(tube.inside)
    some = inside[:: max(1, len(inside) // _MOST_VOXELS)]
    voxels = np.stack(np.unravel_index(some, tube.inside.shape)[::-1], axis=1)
    off = np.linalg.norm((voxels * tube.sizes)[:, np.newaxis] - points, axis=2)
    beside = (off > _BESIDE_RADII * radii).all(axis=1)
    if not beside.any():
        return 0.0, (0, 0)
    first, last = np.quantile(voxels[beside, 2], [0.1, 0.9]).round().astype(int)
    return float(beside.mean()), (int(first), int(last))
