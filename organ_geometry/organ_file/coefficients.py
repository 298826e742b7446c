"""A section's boundary as sixteen shape coefficients ("signals" along the organ).

    u = (x - e) / a                        place across the boundary, from -1 to 1; u = cos t
    a    WIDTH                             half its width, mm
    e    ASIDE                             its middle in x, mm
    s_k  SYMMETRIC, k = 0 .. 6             (bottom_k - top_k) / 2 - a CIRCLE_k, mm
    d_k  SKEW, k = 0 .. 6                  (bottom_k + top_k) / 2, mm

bottom_k and top_k are coefficients of the two half-curves y(u) in Chebyshev polynomials of the
second kind, U_k(cos t) = sin((k + 1) t) / sin t. On a circle of radius a a change of s_k or d_k by
c moves the boundary along its normal by c sin((k + 1) t): the normal's y component is sin t, which
cancels the denominator. So all coefficients count alike in distance, none disturbs another (the
sines are orthogonal), one step suits all, and a round section has s = 0 and d = (y, 0, ...): next
to nothing to store. An organ's rows of half-curves have Chebyshev polynomials of the first kind T_k
in place of U_k; U_k = 2 (T_k + T_(k-2) + ...), the last T_0 counted once.
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
from organ_geometry.curves.ordered_product import ordered_product

SIGNALS = ROW_SIZE  # 16
WIDTH = 0
ASIDE = 1
SYMMETRIC = slice(2, 2 + COEFFICIENTS)
SKEW = slice(2 + COEFFICIENTS, SIGNALS)

CIRCLE = np.array([0.8551, 0.0, -0.1680, 0.0, -0.0235, 0.0, -0.0079])
"""Coefficients of the half-circle of half width a = 1, by the weighted fit."""


def _second_kind_to_first() -> NDArray[np.float64]:
    """Return (7, 7) Chebyshev coefficients of the first kind, a row for each of the second."""
    # U_k = 2 (T_k + T_(k-2) + ...), down to T_1 or to T_0, which counts once.
    change = np.zeros((COEFFICIENTS, COEFFICIENTS))
    for order in range(COEFFICIENTS):
        change[order, order::-2] = 2.0
    change[:, 0] /= 2.0
    return change


_TO_FIRST = _second_kind_to_first()


def signals_to_rows(signals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the (K, 16) half-curves of (K, 16) shape coefficients, mm."""
    rows = np.empty_like(signals)
    half = signals[:, SYMMETRIC] + signals[:, WIDTH, np.newaxis] * CIRCLE
    rows[:, MIDDLE] = signals[:, ASIDE]
    rows[:, HALF_WIDTH] = signals[:, WIDTH]
    rows[:, TOP] = ordered_product(signals[:, SKEW] - half, _TO_FIRST)
    rows[:, BOTTOM] = ordered_product(signals[:, SKEW] + half, _TO_FIRST)
    return rows


def second_kind(u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (..., 7) Chebyshev polynomials of the second kind, degrees 0 to 6."""
    # U_(k+1) = 2 u U_k - U_(k-1).
    values = np.empty((*u.shape, COEFFICIENTS))
    values[..., 0] = 1.0
    values[..., 1] = 2.0 * u
    for order in range(2, COEFFICIENTS):
        values[..., order] = 2.0 * u * values[..., order - 1] - values[..., order - 2]
    return values
