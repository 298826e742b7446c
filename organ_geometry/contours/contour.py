"""Section contours in space, and the loft through them that can be cut again by other planes.

Images stand where they were taken, seldom square to the axis. Contours are resampled to as many
points each, all in one sense, and each is shifted against the one before so that points of equal
number are nearest: the largest cyclic correlation, by Fourier transform. Lines join these points
along the stack; a plane across the axis cuts each line once near where it is wanted.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kernel_cache import njit

# Points around each contour of a loft.
LOFT_POINTS = 128

_TINY = float(np.finfo(np.float64).tiny)


@dataclass(frozen=True, slots=True, eq=False)
class SectionContour:
    """A traced section where it stands in space."""

    index: int  # Number of the section in its stack
    # (N, 3) edge points of the outer boundary in order, mm; the last joins the first.
    outer: NDArray[np.float64]
    # (M, 3) edge points of the lumen, mm, or None if none was found.
    lumen: NDArray[np.float64] | None
    normal: NDArray[np.float64]  # (3,) unit normal of the section's plane, along the stack
    x_dir: NDArray[np.float64]  # (3,) unit direction of the image's rows, to the right

    def __post_init__(self) -> None:
        for name in ("outer", "lumen"):
            points = getattr(self, name)
            if points is None:
                continue
            locked = np.array(points, dtype=np.float64)
            if locked.ndim != 2 or locked.shape[1] != 3 or len(locked) < 3:
                raise ValueError(
                    f"{name} of section {self.index} must be (N, 3) with three or more points, "
                    f"not {locked.shape}"
                )
            if not np.isfinite(locked).all():
                raise ValueError(f"{name} of section {self.index} must be finite, mm")
            locked.setflags(write=False)
            object.__setattr__(self, name, locked)


@dataclass(frozen=True, slots=True, eq=False)
class ContourLoft:
    """A surface through contours: point j of one contour is joined to point j of the next."""

    rings: NDArray[np.float64]  # (S, P, 3) points at equal distances around each contour, mm

    @classmethod
    def through(
        cls, contours: Sequence[NDArray[np.float64]], normals: NDArray[np.float64]
    ) -> "ContourLoft":
        """Return the loft through contours, each turned to twist least against the one before."""
        # S contours (N, 3), mm, in either sense; they come to run around their (S, 3) normals.
        rings = np.stack([even_points(contour, LOFT_POINTS) for contour in contours])
        centred = rings - rings.mean(axis=1, keepdims=True)
        turns = np.cross(centred, np.roll(centred, -1, axis=1)).sum(axis=1)
        backwards = (turns * normals).sum(axis=1) < 0.0
        rings[backwards] = rings[backwards, ::-1]
        centred[backwards] = centred[backwards, ::-1]
        # The shift of smallest squared distance has the largest cyclic correlation.
        spectra = np.fft.rfft(centred, axis=1)
        products = (np.conj(spectra[:-1]) * spectra[1:]).sum(axis=2)
        shifts = np.fft.irfft(products, LOFT_POINTS, axis=1).argmax(axis=1)
        for place, shift in enumerate(np.cumsum(shifts) % LOFT_POINTS, start=1):
            rings[place] = np.roll(rings[place], -int(shift), axis=0)
        return cls(rings)

    def extended(self, first: NDArray[np.float64], last: NDArray[np.float64]) -> "ContourLoft":
        """Return the loft with its end contours shifted outwards as further ends."""
        # Shifts (3,) in mm; the loft has two more contours then.
        return ContourLoft(
            np.concatenate([self.rings[:1] + first, self.rings, self.rings[-1:] + last])
        )

    def cuts(
        self,
        points: NDArray[np.float64],  # (M, 3) a point of each plane, mm
        normals: NDArray[np.float64],  # (M, 3) their normals, along the loft
        near: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Return the contours in which planes cut the loft."""
        # (M,) near: the contour, with a fraction, near which each cut is wanted. A cut has one
        # point on each of the P lines along the loft, (M, P, 3) in mm; where a plane misses a line
        # it is the line's point nearest to the plane.
        return _loft_cuts(
            np.ascontiguousarray(self.rings),
            np.ascontiguousarray(points),
            np.ascontiguousarray(normals),
            np.ascontiguousarray(near),
        )


@njit(cache=True)
def _loft_cuts(
    rings: NDArray[np.float64],
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    near: NDArray[np.float64],
) -> NDArray[np.float64]:
    count, lines = rings.shape[0], rings.shape[1]
    cuts = np.empty((len(points), lines, 3))
    for m in range(len(points)):
        p0, p1, p2 = points[m, 0], points[m, 1], points[m, 2]
        n0, n1, n2 = normals[m, 0], normals[m, 1], normals[m, 2]
        start = min(max(int(near[m]), 0), count - 2)
        for line in range(lines):
            # Look both ways from the middle for the nearest piece that the plane crosses.
            place = -1
            for step in range(count):
                best = np.inf
                for side in range(-1, 2, 2):
                    piece = start + side * step
                    if piece < 0 or piece > count - 2:
                        continue
                    low = (
                        (rings[piece, line, 0] - p0) * n0
                        + (rings[piece, line, 1] - p1) * n1
                        + (rings[piece, line, 2] - p2) * n2
                    )
                    high = (
                        (rings[piece + 1, line, 0] - p0) * n0
                        + (rings[piece + 1, line, 1] - p1) * n1
                        + (rings[piece + 1, line, 2] - p2) * n2
                    )
                    if low <= 0.0 and high > 0.0 and abs(piece + 0.5 - near[m]) < best:
                        best = abs(piece + 0.5 - near[m])
                        place = piece
                if place >= 0:
                    break
            if place < 0:
                least = np.inf
                for ring in range(count):
                    height = abs(
                        (rings[ring, line, 0] - p0) * n0
                        + (rings[ring, line, 1] - p1) * n1
                        + (rings[ring, line, 2] - p2) * n2
                    )
                    if height < least:
                        least, place = height, ring
                place = min(place, count - 2)
            low = high = 0.0
            for c in range(3):
                low += (rings[place, line, c] - points[m, c]) * normals[m, c]
                high += (rings[place + 1, line, c] - points[m, c]) * normals[m, c]
            rise = high - low
            fraction = min(max(-low / rise, 0.0), 1.0) if rise != 0.0 else 0.0
            for c in range(3):
                cuts[m, line, c] = (
                    rings[place, line, c] * (1.0 - fraction) + rings[place + 1, line, c] * fraction
                )
    return cuts


def even_points(points: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return points at equal distances along a closed polygon, from its first corner on."""
    return _even_points(np.ascontiguousarray(points, dtype=np.float64), count)


@njit(cache=True, nogil=True)
def _even_points(points: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    corners, axes = points.shape
    lengths = np.zeros(corners + 1)
    for corner in range(corners):
        after = corner + 1 if corner + 1 < corners else 0
        squared = 0.0
        for axis in range(axes):
            squared += (points[after, axis] - points[corner, axis]) ** 2
        lengths[corner + 1] = lengths[corner] + math.sqrt(squared)
    even = np.empty((count, axes))
    step = lengths[corners] / count
    corner = 0
    for number in range(count):
        wanted = number * step
        while corner + 1 < corners and lengths[corner + 1] <= wanted:
            corner += 1
        after = corner + 1 if corner + 1 < corners else 0
        length = lengths[corner + 1] - lengths[corner]
        for axis in range(axes):
            start = points[corner, axis]
            slope = (points[after, axis] - start) / length if length > 0.0 else 0.0
            even[number, axis] = slope * (wanted - lengths[corner]) + start
    return even


def centroid_and_radius(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Return the centroid of the area that a closed contour bounds, and its equivalent radius."""
    return _centroid_and_radius(np.ascontiguousarray(points, dtype=np.float64))


@njit(cache=True, nogil=True)
def _centroid_and_radius(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    count = len(points)
    middle = np.zeros(3)
    for axis in range(3):
        for i in range(count):
            middle[axis] += points[i, axis]
        middle[axis] /= count
    crossed = np.empty((count, 3))
    twice = np.zeros(3)
    for i in range(count):
        after = i + 1 if i + 1 < count else 0
        a0, a1, a2 = points[i, 0] - middle[0], points[i, 1] - middle[1], points[i, 2] - middle[2]
        b0, b1 = points[after, 0] - middle[0], points[after, 1] - middle[1]
        b2 = points[after, 2] - middle[2]
        crossed[i, 0] = a1 * b2 - a2 * b1
        crossed[i, 1] = a2 * b0 - a0 * b2
        crossed[i, 2] = a0 * b1 - a1 * b0
        for axis in range(3):
            twice[axis] += crossed[i, axis]
    size = math.sqrt(twice[0] ** 2 + twice[1] ** 2 + twice[2] ** 2)
    total = 0.0
    moment = np.zeros(3)
    for i in range(count):
        after = i + 1 if i + 1 < count else 0
        term = 0.0
        for axis in range(3):
            term += crossed[i, axis] * (twice[axis] / max(size, _TINY))
        total += term
        for axis in range(3):
            moment[axis] += term * (points[i, axis] + points[after, axis] - 2.0 * middle[axis])
    for axis in range(3):
        middle[axis] += moment[axis] / (3.0 * max(total, _TINY))
    return middle, math.sqrt(0.5 * size / math.pi)
