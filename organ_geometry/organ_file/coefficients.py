"""Sections as sixteen signals along an organ, of which little is left where sections are round.

The signals of a boundary are half its width a and its middle e in x, then seven numbers s and
seven numbers d: half the difference and half the sum of the bottom and the top half-curve, as
coefficients of Chebyshev polynomials of the second kind in u = (x - e) / a, s less those of a
circle of that width. A change of a coefficient by c moves a round boundary along its normal by
c sin((k + 1) t) at u = cos t: all s and d count alike, and none disturbs another.
"""

import numpy as np
from numpy.typing import NDArray

from organ_geometry.curves.half_curves import (
    BOTTOM,
    COEFFICIENTS,
    HALF_WIDTH,
    MIDDLE,
    ROW_SIZE,
    TOP,
)

SIGNALS = ROW_SIZE
WIDTH = 0
ASIDE = 1
SYMMETRIC = slice(2, 2 + COEFFICIENTS)
SKEW = slice(2 + COEFFICIENTS, SIGNALS)

CIRCLE = np.array([0.8551, 0.0, -0.1680, 0.0, -0.0235, 0.0, -0.0079])
"""Coefficients of the half-circle of half width a = 1, by the weighted fit."""


def _second_kind_to_first() -> NDArray[np.float64]:
    """Return (7, 7) Chebyshev coefficients of the first kind, a row for each of the second."""
    change = np.zeros((COEFFICIENTS, COEFFICIENTS))
    for order in range(COEFFICIENTS):
        change[order, order::-2] = 2.0
    change[:, 0] /= 2.0
    return change


_TO_FIRST = _second_kind_to_first()


def signals_to_rows(signals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the half-curves of signals."""
    rows = np.empty_like(signals)
    half = signals[:, SYMMETRIC] + signals[:, WIDTH, np.newaxis] * CIRCLE
    rows[:, MIDDLE] = signals[:, ASIDE]
    rows[:, HALF_WIDTH] = signals[:, WIDTH]
    rows[:, TOP] = (signals[:, SKEW] - half) @ _TO_FIRST
    rows[:, BOTTOM] = (signals[:, SKEW] + half) @ _TO_FIRST
    return rows


def second_kind(u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the Chebyshev polynomials of the second kind of degrees 0 to 6."""
    values = np.empty((*u.shape, COEFFICIENTS))
    values[..., 0] = 1.0
    values[..., 1] = 2.0 * u
    for order in range(2, COEFFICIENTS):
        values[..., order] = 2.0 * u * values[..., order - 1] - values[..., order - 2]
    return values
