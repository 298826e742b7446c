"""Section contours in space, and the loft through them that can be cut again by other planes."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

LOFT_POINTS = 128
"""Points around each contour of a loft."""


@dataclass(frozen=True, slots=True, eq=False)
class SectionContour:
    """A traced section where it stands in space.

    Attributes
    ----------
    index
        Number of the section in its stack.
    outer
        (N, 3) edge points of the outer boundary in order, mm; the last joins the first.
    lumen
        (M, 3) edge points of the lumen, mm, or None if none was found.
    normal
        (3,) unit normal of the section's plane, along the stack.
    x_dir
        (3,) unit direction of the image's rows, to the right.
    """

    index: int
    outer: NDArray[np.float64]
    lumen: NDArray[np.float64] | None
    normal: NDArray[np.float64]
    x_dir: NDArray[np.float64]

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
    """A surface through contours: point j of one contour is joined to point j of the next.

    Attributes
    ----------
    rings
        (S, P, 3) points at equal distances around each contour, mm.
    """

    rings: NDArray[np.float64]

    @classmethod
    def through(
        cls, contours: Sequence[NDArray[np.float64]], normals: NDArray[np.float64]
    ) -> "ContourLoft":
        """Return the loft through contours, each turned to twist least against the one before.

        Parameters
        ----------
        contours
            S contours (N, 3) in either sense, mm.
        normals
            (S, 3) directions that the contours run around.

        Returns
        -------
        ContourLoft
            The loft.
        """
        rings = np.empty((len(contours), LOFT_POINTS, 3))
        before: NDArray[np.complex128] | None = None
        for place, (contour, normal) in enumerate(zip(contours, normals, strict=True)):
            ring = even_points(contour, LOFT_POINTS)
            centred = ring - ring.mean(axis=0)
            turn = np.cross(centred, np.roll(centred, -1, axis=0)).sum(axis=0)
            if float(turn @ normal) < 0.0:
                ring, centred = ring[::-1], centred[::-1]
            if before is not None:
                # The shift of smallest squared distance has the largest cyclic correlation.
                spectrum = (np.conj(before) * np.fft.rfft(centred, axis=0)).sum(axis=1)
                shift = int(np.fft.irfft(spectrum, LOFT_POINTS).argmax())
                ring, centred = np.roll(ring, -shift, axis=0), np.roll(centred, -shift, axis=0)
            rings[place] = ring
            before = np.fft.rfft(centred, axis=0)
        return cls(rings)

    def extended(self, first: NDArray[np.float64], last: NDArray[np.float64]) -> "ContourLoft":
        """Return the loft with its end contours shifted outwards as further ends.

        Parameters
        ----------
        first, last
            (3,) shifts of the first and the last contour, mm.

        Returns
        -------
        ContourLoft
            The longer loft, of two more contours.
        """
        return ContourLoft(
            np.concatenate([self.rings[:1] + first, self.rings, self.rings[-1:] + last])
        )

    def cuts(
        self,
        points: NDArray[np.float64],
        normals: NDArray[np.float64],
        near: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Return the contours in which planes cut the loft.

        Parameters
        ----------
        points
            (M, 3) a point of each plane, mm.
        normals
            (M, 3) their normals, along the loft.
        near
            (M,) number of the contour, with a fraction, near which each cut is wanted.

        Returns
        -------
        NDArray[np.float64]
            (M, P, 3) one point on each line along the loft, mm; on a line that the plane misses,
            the point nearest to it.
        """
        return _loft_cuts(
            np.ascontiguousarray(self.rings),
            np.ascontiguousarray(points),
            np.ascontiguousarray(normals),
            np.ascontiguousarray(near),
        )


@numba.njit(cache=True)
def _loft_cuts(
    rings: NDArray[np.float64],
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    near: NDArray[np.float64],
) -> NDArray[np.float64]:
    count, lines = rings.shape[0], rings.shape[1]
    cuts = np.empty((len(points), lines, 3))
    heights = np.empty(count)
    for m in range(len(points)):
        p0, p1, p2 = points[m, 0], points[m, 1], points[m, 2]
        n0, n1, n2 = normals[m, 0], normals[m, 1], normals[m, 2]
        start = min(max(int(near[m]), 0), count - 2)
        for line in range(lines):
            # Look both ways from the middle for the nearest piece that the plane crosses.
            place = -1
            for way in range(count):
                best = np.inf
                for side in range(-1, 2, 2):
                    piece = start + side * way
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
                for ring in range(count):
                    heights[ring] = abs(
                        (rings[ring, line, 0] - p0) * n0
                        + (rings[ring, line, 1] - p1) * n1
                        + (rings[ring, line, 2] - p2) * n2
                    )
                place = min(int(heights.argmin()), count - 2)
            low = high = 0.0
            for c in range(3):
                low += (rings[place, line, c] - points[m, c]) * normals[m, c]
                high += (rings[place + 1, line, c] - points[m, c]) * normals[m, c]
            rise = high - low
            share = min(max(-low / rise, 0.0), 1.0) if rise != 0.0 else 0.0
            for c in range(3):
                cuts[m, line, c] = (
                    rings[place, line, c] * (1.0 - share) + rings[place + 1, line, c] * share
                )
    return cuts


def even_points(points: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return points at equal distances along a closed polygon.

    Parameters
    ----------
    points
        (N, D) corners in order, mm; the last joins the first.
    count
        Number of points wanted.

    Returns
    -------
    NDArray[np.float64]
        (count, D) points, the first at the first corner.
    """
    closed = np.concatenate([points, points[:1]])
    steps = np.diff(closed, axis=0)
    lengths = np.zeros(len(closed))
    np.cumsum(np.sqrt(np.einsum("ij,ij->i", steps, steps)), out=lengths[1:])
    wanted = np.arange(count, dtype=np.float64) * (float(lengths[-1]) / count)
    columns: list[NDArray[np.float64]] = [
        np.interp(wanted, lengths, closed[:, axis]) for axis in range(closed.shape[1])
    ]
    return np.stack(columns, axis=1)


def centroid_and_radius(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Return the centroid of the area that a closed contour bounds, and its equivalent radius.

    Parameters
    ----------
    points
        (N, 3) corners in order, nearly in a plane, mm.

    Returns
    -------
    tuple[NDArray[np.float64], float]
        (3,) centroid, mm, and the radius of the circle of the same area, mm.
    """
    middle = points.mean(axis=0)
    here = points - middle
    after = np.roll(here, -1, axis=0)
    crossed = np.cross(here, after)
    twice = crossed.sum(axis=0)
    size = float(np.linalg.norm(twice))
    parts = crossed @ (twice / max(size, np.finfo(np.float64).tiny))
    total = max(float(parts.sum()), np.finfo(np.float64).tiny)
    return middle + parts @ (here + after) / (3.0 * total), math.sqrt(0.5 * size / math.pi)
