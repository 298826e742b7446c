"""The line through the middle of a tube of voxels, and the tube's sections across it.

The minimal path along the deepest voxels gives a first line, a radius short of either end. Then, in
a few rounds, planes are laid across the line, each point is moved to the centroid of the tube's
section in its plane, and the line is smoothed (Savitzky-Golay) and spaced evenly again. A section
is the connected part around the point within a few depths of it, and its middle no further
from the minimal path than a share of the depth: where a tube touches itself, a section is of both.
At the end the line is led on straight to the tube's two ends.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from organ_geometry.reslice.curve_frames import (
    evenly_spaced,
    rotation_minimising_frames,
    smooth_points,
    smooth_tangents,
)
from organ_geometry.reslice.minimal_path import MinimalPath, arc_lengths, minimal_path
from organ_geometry.reslice.plane_cut import plane_cut

_ROUNDS = 4
# The line's points are this share of the tube's radius apart while they are moved to the middle,
# and what smooths them and their tangents reaches so many radii to either side.
_POINT_FRACTION = 0.125
SMOOTH_RADII = 1.0
TANGENT_RADII = 1.5
# A tube is at least so many times as long as thick.
_LONG_AND_THIN = 2.0
# How far a section may reach, and its middle be from the minimal path, in depths there.
_REACH_DEPTHS = 3.0
_OFF_FRACTION = 0.7
# A line that has grown by more than this in being moved to the middle has lost its way.
_LONGEST_GROWTH = 1.2

ALONG_ROWS = np.array([1.0, 0.0, 0.0])


class NoTube(ValueError):  # noqa: N818
    """Voxels that are not long and thin."""


@dataclass(frozen=True, slots=True, eq=False)
class Tube:
    """Voxels of a tube."""

    inside: NDArray[np.uint8]  # (K, H, W) 255 inside, else 0
    # (3,) distance between voxels from column to column, row to row and image to image, mm.
    sizes: NDArray[np.float64]

    def section(
        self, point: NDArray[np.float64], frame: NDArray[np.float64], depth: float
    ) -> tuple[NDArray[np.float64], float]:
        """Return the places of a section's pixels, and a pixel's side."""
        # The plane has its middle at the (3,) point; a (3, 3) frame's columns are its two
        # directions and its normal. Looked at is three times the tube's depth there, mm. The (N, 2)
        # places, mm along the two directions, are those of the connected part at the point or
        # nearest to it; none where the plane misses the tube.
        pixel = max(float(self.sizes.min()), depth / 16.0)
        half = int(np.ceil(_REACH_DEPTHS * depth / pixel))
        side = 2 * half + 1
        steps = frame[:, :2].T * pixel / self.sizes
        mask = plane_cut(self.inside, 0.0, point / self.sizes, steps, (side, side)) > 127
        _, labels = cv2.connectedComponents(mask.astype(np.uint8), connectivity=4)
        labels = np.asarray(labels)
        places = np.argwhere(labels > 0)
        if len(places) == 0:
            return np.zeros((0, 2)), pixel
        nearest = places[((places - half) ** 2).sum(axis=1).argmin()]
        mine = np.argwhere(labels == labels[nearest[0], nearest[1]])
        return np.asarray(pixel * (mine[:, ::-1] - half), dtype=np.float64), pixel


@dataclass(frozen=True, slots=True, eq=False)
class Centreline:
    """The line through a tube's middle."""

    # (N, 3) points from end to end, mm along columns, rows and images from the first voxel.
    points: NDArray[np.float64]
    depths: NDArray[np.float64]  # (N,) distance to the tube's surface along them, mm
    radius: float  # The tube's typical one, mm: the median depth along the minimal path


def centreline(tube: Tube) -> Centreline:
    """Return the line through the centroids of a tube's sections perpendicular to it."""
    inside = tube.inside > 0
    if np.count_nonzero(inside) < 2:
        raise NoTube("there are fewer than two voxels of it")
    path = minimal_path(inside, tube.sizes)
    stations, radius = arc_lengths(path.points), float(np.median(path.depths))
    length = float(stations[-1])
    # The path's ends run from the middle to the surface's furthest voxels.
    kept = (stations >= radius) & (stations <= length - radius)
    thick = 2.0 * float(path.depths.max())
    if length < _LONG_AND_THIN * thick or np.count_nonzero(kept) < 5:
        raise NoTube(f"it is {length:.4g} long and {thick:.4g} thick, and must be long and thin")
    gap = max(_POINT_FRACTION * radius, float(tube.sizes.min()))
    start = smooth_points(evenly_spaced(path.points[kept], gap), round(SMOOTH_RADII * radius / gap))
    points = start
    for _ in range(_ROUNDS):
        points = evenly_spaced(_moved_to_middle(tube, path, points, radius, gap), gap)
        points = smooth_points(points, round(SMOOTH_RADII * radius / gap))
    if arc_lengths(points)[-1] > _LONGEST_GROWTH * arc_lengths(start)[-1]:
        points = start
    if points[0, 2] > points[-1, 2]:
        points = points[::-1]
    ends = [
        _to_the_end(inside, tube.sizes, points[::path], gap, radius)[::-path] for path in (1, -1)
    ]
    points = np.concatenate([ends[0], points, ends[1]])
    return Centreline(points, _nearest(path, points)[1], radius)


def _moved_to_middle(
    tube: Tube, path: MinimalPath, points: NDArray[np.float64], radius: float, gap: float
) -> NDArray[np.float64]:
    """Return each point moved to the centroid of the section across the line there."""
    tangents = smooth_tangents(points, round(TANGENT_RADII * radius / gap))
    frames = rotation_minimising_frames(points, tangents, ALONG_ROWS)
    nearest, depths = _nearest(path, points)
    middles = points.copy()
    for index, (point, frame) in enumerate(zip(points, frames, strict=True)):
        section, _ = tube.section(point, frame, float(depths[index]))
        if len(section):
            middles[index] += frame[:, :2] @ section.mean(axis=0)
    # Where tubes touch, a section is of both: the minimal path stays within one.
    off = middles - nearest
    far = np.linalg.norm(off, axis=1) / (_OFF_FRACTION * depths)
    return nearest + off / np.maximum(far, 1.0)[:, np.newaxis]


def _nearest(
    path: MinimalPath, points: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return (N, 3) points of a path nearest to others, and its (N,) depths there, mm."""
    nearest = np.array([((path.points - point) ** 2).sum(axis=1).argmin() for point in points])
    return path.points[nearest], path.depths[nearest]


def _to_the_end(
    inside: NDArray[np.bool_],
    sizes: NDArray[np.float64],
    points: NDArray[np.float64],
    gap: float,
    radius: float,
) -> NDArray[np.float64]:
    """Return points straight on from the first of some, outwards, until the tube ends."""
    tangent = smooth_tangents(points, round(TANGENT_RADII * radius / gap))[0]
    depth, height, width = inside.shape
    added: list[NDArray[np.float64]] = []
    while True:
        point = points[0] - (len(added) + 1) * gap * tangent
        i, j, k = (round(float(place)) for place in point / sizes)
        if not (0 <= i < width and 0 <= j < height and 0 <= k < depth and inside[k, j, i]):
            return np.array(added).reshape(-1, 3)
        added.append(point)
