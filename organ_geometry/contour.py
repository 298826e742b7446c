"""Section contours in space, and the loft through them that can be cut again by other planes."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

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

    def cut(
        self, point: NDArray[np.float64], normal: NDArray[np.float64], near: float
    ) -> NDArray[np.float64]:
        """Return the contour in which a plane cuts the loft.

        Parameters
        ----------
        point
            (3,) a point of the plane, mm.
        normal
            (3,) its normal, along the loft.
        near
            Number of the contour, with a fraction, near which the cut is wanted.

        Returns
        -------
        NDArray[np.float64]
            (P, 3) one point on each line along the loft, mm; on a line that the plane misses, the
            point nearest to it.
        """
        heights = (self.rings - point) @ normal
        crossed = (heights[:-1] <= 0.0) & (heights[1:] > 0.0)
        away = np.abs(np.arange(len(crossed))[:, np.newaxis] + 0.5 - near)
        place = np.where(crossed, away, np.inf).argmin(axis=0)
        lines = np.arange(self.rings.shape[1], dtype=np.intp)
        missed = ~crossed[place, lines]
        if missed.any():
            place[missed] = np.minimum(
                np.abs(heights[:, missed]).argmin(axis=0), len(self.rings) - 2
            )
        low, high = heights[place, lines], heights[place + 1, lines]
        rise = high - low
        share = np.clip(-low / np.where(rise == 0.0, 1.0, rise), 0.0, 1.0)[:, np.newaxis]
        return self.rings[place, lines] * (1.0 - share) + self.rings[place + 1, lines] * share


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
