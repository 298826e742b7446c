"""Half-curves: one closed boundary as two polynomials y(x) of degree six.

Coordinates are a section's own: mm, x along the image's columns, y along its rows (down), from
the section's axis point. A boundary is stored as a row of sixteen numbers: the middle and half
the width of its range in x, then seven Chebyshev coefficients in u = (x - middle) / half_width of
the top half-curve (smaller y) and seven of the bottom one.

An edge point's *normal distance* is its distance to the curve, along the curve's normal where it is
nearest. Its *algebraic distance* is y - p(x), what is left when it is put into the equation of its
half-curve y = p(x) = a0 + a1 x + ... + a6 x^6. The thesis's least squares (chapter 7) make the
algebraic ones small, which are cheap, but say nothing where a boundary is steep: near the two ends
of a section they grow beyond all bounds while the curve is near. The fit made here is for the
normal ones: a point weighs by the length of boundary around it and by how flat it is there.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from organ_geometry.contours.contour import even_points
from organ_geometry.curves.half_curve_fit import COEFFICIENTS, boundary_halves, fitted_half
from organ_geometry.curves.ordered_product import ordered_product
from organ_geometry.curves.outline_distance import outline_distances

DEGREE = COEFFICIENTS - 1
ROW_SIZE = 2 + 2 * COEFFICIENTS

MIDDLE = 0
HALF_WIDTH = 1
TOP = slice(2, 2 + COEFFICIENTS)
BOTTOM = slice(2 + COEFFICIENTS, ROW_SIZE)

# A polynomial cannot stand upright as a round boundary does at its two ends. Ending the range a
# little inside and closing it by a short vertical segment gives the smallest distance.
RANGE_FRACTION = 0.995

# A half-curve that leaves the box around its points by more than this share of the box's longer
# side has run away where it has no points. Round and oval sections stay below 0.03.
LARGEST_OVERSHOOT = 0.1

# Fewer points than this on a half leave seven coefficients badly determined.
_ENOUGH_POINTS = 2 * COEFFICIENTS
_RESAMPLED_POINTS = 128


class NotSingleValued(ValueError):  # noqa: N818
    """A boundary that two half-curves cannot follow."""


@dataclass(frozen=True, slots=True, eq=False)
class HalfCurves:
    """The two half-curves of one boundary."""

    middle: float  # Middle of the range in x, mm
    half_width: float  # Half the width of the range in x, mm
    top: NDArray[np.float64]  # (7,) Chebyshev coefficients of the half with smaller y, mm
    bottom: NDArray[np.float64]  # (7,) Chebyshev coefficients of the half with larger y, mm

    def __post_init__(self) -> None:
        if not (np.isfinite(self.middle) and np.isfinite(self.half_width) and self.half_width > 0):
            raise ValueError(
                f"half-curves need a finite middle and a half width above 0 mm, "
                f"not {self.middle:g} mm and {self.half_width:g} mm"
            )
        for field in ("top", "bottom"):
            locked = np.array(getattr(self, field), dtype=np.float64)
            if locked.shape != (COEFFICIENTS,) or not np.isfinite(locked).all():
                raise ValueError(f"{field} must be {COEFFICIENTS} finite coefficients, mm")
            locked.setflags(write=False)
            object.__setattr__(self, field, locked)

    def as_row(self) -> NDArray[np.float64]:
        """Return the boundary as its row of sixteen numbers."""
        return np.concatenate([[self.middle, self.half_width], self.top, self.bottom])

    def distances(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the distance, mm, of each point to the boundary, its upright ends included."""
        corners = closed_outlines(self.as_row()[np.newaxis])[0]
        return outline_distances(np.ascontiguousarray(points, dtype=np.float64), corners)

    def algebraic_distances(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return |y - p(x)|, mm, of each point to the half-curve that is nearer in y."""
        # Points beyond the range in x, by a four-hundredth of the width at most where the curves
        # were fitted to them, are put into the same polynomials.
        u = (points[:, 0] - self.middle) / self.half_width
        halves = chebyshev.chebval(u, np.stack([self.top, self.bottom], axis=1))
        return np.abs(points[:, 1] - halves).min(axis=0)


def fit_half_curves(points: NDArray[np.float64]) -> HalfCurves:
    """Return the two half-curves that lie nearest to a closed boundary."""
    # (N, 2) points, mm, in either sense, are cut at the leftmost and the rightmost one. The ends of
    # both halves stay free: forcing them to meet costs a factor of four in distance. A boundary
    # that doubles back in x makes a half-curve run away: `NotSingleValued`.
    boundary = np.asarray(points, dtype=np.float64)
    if boundary.ndim != 2 or boundary.shape[1] != 2 or len(boundary) < 3:
        raise ValueError(
            f"points must have shape (N, 2) with three or more points, not {boundary.shape}"
        )
    if not np.isfinite(boundary).all():
        raise ValueError("points must be finite, mm")
    left, right = float(boundary[:, 0].min()), float(boundary[:, 0].max())
    width = right - left
    if not width > 0.0:
        raise ValueError(f"the boundary must have a width above 0 mm, not {width:g} mm")

    curve = np.ascontiguousarray(boundary)
    halves, weights = boundary_halves(curve)
    if halves[:, 1].min() < _ENOUGH_POINTS:
        curve = even_points(boundary, _RESAMPLED_POINTS)
        halves, weights = boundary_halves(curve)
    middle = 0.5 * (left + right)
    half_width = 0.5 * width * RANGE_FRACTION
    first, second = (
        _fit_half(curve, weights, int(start), int(count), middle, half_width)
        for start, count in halves
    )
    # The sense of positive area goes from left to right on the side of smaller y.
    after = np.roll(boundary, -1, axis=0)
    area = float((boundary[:, 0] * after[:, 1] - boundary[:, 1] * after[:, 0]).sum())
    top, bottom = (first, second) if area >= 0.0 else (second, first)
    curves = HalfCurves(middle, half_width, top, bottom)
    _check_overshoot(curves, boundary)
    return curves


def outline_points(rows: NDArray[np.float64], angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return one boundary point for each row and angle."""
    u = np.cos(angles)
    on_bottom = np.sin(angles) >= 0.0
    coefficients = np.where(on_bottom[:, np.newaxis], rows[:, BOTTOM], rows[:, TOP])
    # Clenshaw's recurrence, one row of coefficients for each point.
    doubled = 2.0 * u
    previous = np.zeros_like(u)
    current = coefficients[:, DEGREE].copy()
    for order in range(DEGREE - 1, 0, -1):
        current, previous = coefficients[:, order] + doubled * current - previous, current
    y = coefficients[:, 0] + u * current - previous
    x = rows[:, MIDDLE] + rows[:, HALF_WIDTH] * u
    return np.stack([x, y], axis=1)


def closed_outlines(rows: NDArray[np.float64], count: int = 256) -> NDArray[np.float64]:
    """Return each boundary as a closed polygon that includes the ends of both halves."""
    # (K, count, 2) mm: the first half of the corners on the bottom half-curve from right to left,
    # the others on the top one from left to right.
    half = count // 2
    u, basis = _corner_places(half)
    corners = np.empty((len(rows), 2 * half, 2))
    corners[:, :half, 0] = rows[:, MIDDLE, np.newaxis] + rows[:, HALF_WIDTH, np.newaxis] * u
    corners[:, half:, 0] = corners[:, half - 1 :: -1, 0]
    corners[:, :half, 1] = ordered_product(rows[:, BOTTOM], basis)
    corners[:, half:, 1] = ordered_product(rows[:, TOP], basis)[:, ::-1]
    return corners


@lru_cache(maxsize=16)
def _corner_places(count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return (C,) u of a half's corners from right to left, and (7, C) its polynomials there."""
    u = np.cos(np.linspace(0.0, np.pi, count))
    basis = np.asarray(chebyshev.chebvander(u, DEGREE).T, dtype=np.float64)
    for array in (u, basis):
        array.setflags(write=False)
    return u, basis


def _check_overshoot(curves: HalfCurves, boundary: NDArray[np.float64]) -> None:
    """Check that the curves stay near the box around the boundary they were fitted to."""
    lowest, highest = boundary.min(axis=0), boundary.max(axis=0)
    corners = closed_outlines(curves.as_row()[np.newaxis])[0]
    beyond = float(np.maximum(lowest - corners, corners - highest).max())
    if not beyond <= LARGEST_OVERSHOOT * float((highest - lowest).max()):
        raise NotSingleValued(
            f"the edge is not single-valued, one top and one bottom over x: a curve fitted to it "
            f"leaves it by more than {LARGEST_OVERSHOOT:.0%} of its size"
        )


def _fit_half(
    boundary: NDArray[np.float64],
    weights: NDArray[np.float64],
    first: int,
    count: int,
    middle: float,
    half_width: float,
) -> NDArray[np.float64]:
    """Return the (7,) Chebyshev coefficients of the weighted least-squares fit."""
    fit, system, apart = fitted_half(boundary, weights, first, count, middle, half_width)
    if not apart:
        fit = np.linalg.lstsq(system[:, :COEFFICIENTS], system[:, COEFFICIENTS])[0]
    return np.asarray(fit, dtype=np.float64)
