"""Sections as sixteen signals along an organ, of which little is left where sections are round.

The signals of a boundary are half its width a and its middle e in x, then seven numbers s and
seven numbers d: half the difference and half the sum of the bottom and the top half-curve, as
coefficients of Chebyshev polynomials of the second kind in u = (x - e) / a, s less those of a
circle of that width. A change of a coefficient by c moves a round boundary along its normal by
c sin((k + 1) t) at u = cos t: all s and d count alike, and none disturbs another.
"""

import math

import numba
import numpy as np
from numpy.typing import NDArray

from organ_geometry.curves.half_curves import (
    BOTTOM,
    COEFFICIENTS,
    HALF_WIDTH,
    MIDDLE,
    RANGE_SHARE,
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
_TINY = float(np.finfo(np.float64).tiny)
_LEVEL = np.eye(COEFFICIENTS)[0]
_ROUNDNESS = (1e-4, 1e-2, 1.0)
"""Share of an outline's weight with which a half is held to be round: more where that leaves it."""
_LEAVES = 1.5
"""How far from its middle a half-curve may go, in half the outline's height."""


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


def extents(outlines: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return half width and middle of outlines."""
    low, high = outlines[:, :, 0].min(axis=1), outlines[:, :, 0].max(axis=1)
    return np.stack([0.5 * RANGE_SHARE * (high - low), 0.5 * (high + low)], axis=1)


def fitted_signals(
    outlines: NDArray[np.float64], spans: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the signals of the half-curves over given spans that lie nearest to outlines."""
    x, y = outlines[:, :, 0], outlines[:, :, 1]
    # A span far from its outline would make numbers of no meaning.
    spans = np.maximum(spans, [1e-6 * float(np.ptp(x)), -np.inf])
    systems, all_sums = _normal_equations(np.ascontiguousarray(outlines), spans)
    fits: list[NDArray[np.float64]] = []
    low, high = y.min(axis=1), y.max(axis=1)
    middles, reach = 0.5 * (low + high), _LEAVES * 0.5 * (high - low)
    for system, sums, sign in zip(systems, all_sums, (1.0, -1.0), strict=True):
        trace = np.einsum("sii->s", system)[:, np.newaxis] + np.finfo(np.float64).tiny
        # Where an outline has no points, as of sections that cross, the half is round.
        round_half = sign * spans[:, :1] * CIRCLE + middles[:, np.newaxis] * _LEVEL
        fit = np.zeros((len(outlines), COEFFICIENTS))
        left = np.arange(len(outlines), dtype=np.intp)
        for share in _ROUNDNESS:
            held = share * trace[left]
            fit[left] = np.linalg.solve(
                system[left] + held[:, :, np.newaxis] * np.eye(COEFFICIENTS),
                (sums[left] + held * round_half[left])[:, :, np.newaxis],
            )[:, :, 0]
            away = np.abs(fit[left] @ _SPREAD.T - middles[left, np.newaxis]).max(axis=1)
            left = left[away > reach[left]]
            if not left.size:
                break
        fits.append(fit)
    signals = np.empty((len(outlines), SIGNALS))
    signals[:, :2] = spans
    signals[:, SYMMETRIC] = 0.5 * (fits[0] - fits[1]) - spans[:, :1] * CIRCLE
    signals[:, SKEW] = 0.5 * (fits[0] + fits[1])
    return signals


def second_kind(u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the Chebyshev polynomials of the second kind of degrees 0 to 6."""
    values = np.empty((*u.shape, COEFFICIENTS))
    values[..., 0] = 1.0
    values[..., 1] = 2.0 * u
    for order in range(2, COEFFICIENTS):
        values[..., order] = 2.0 * u * values[..., order - 1] - values[..., order - 2]
    return values


_SPREAD = second_kind(np.linspace(-1.0, 1.0, 33))


@numba.njit(cache=True)
def _normal_equations(
    outlines: NDArray[np.float64], spans: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return (2, S, 7, 7) and (2, S, 7) normal equations of the bottom and the top half-curves."""
    sections, count = outlines.shape[0], outlines.shape[1]
    systems = np.zeros((2, sections, COEFFICIENTS, COEFFICIENTS))
    sums = np.zeros((2, sections, COEFFICIENTS))
    basis = np.empty(COEFFICIENTS)
    for s in range(sections):
        area = 0.0
        left = right = 0
        for p in range(count):
            after = p + 1 if p + 1 < count else 0
            area += outlines[s, p, 0] * outlines[s, after, 1]
            area -= outlines[s, p, 1] * outlines[s, after, 0]
            if outlines[s, p, 0] < outlines[s, left, 0]:
                left = p
            if outlines[s, p, 0] > outlines[s, right, 0]:
                right = p
        way = (right - left) % count
        for p in range(count):
            after = p + 1 if p + 1 < count else 0
            before = p - 1 if p > 0 else count - 1
            chord_x = outlines[s, after, 0] - outlines[s, before, 0]
            chord_y = outlines[s, after, 1] - outlines[s, before, 1]
            weight = chord_x * chord_x / max(math.hypot(chord_x, chord_y), _TINY)
            # The sense of positive area goes from left to right on the side of smaller y.
            half = 1 if ((p - left) % count <= way) == (area >= 0.0) else 0
            u = min(max((outlines[s, p, 0] - spans[s, 1]) / spans[s, 0], -1.02), 1.02)
            basis[0] = 1.0
            basis[1] = 2.0 * u
            for k in range(2, COEFFICIENTS):
                basis[k] = 2.0 * u * basis[k - 1] - basis[k - 2]
            for i in range(COEFFICIENTS):
                weighted = weight * basis[i]
                sums[half, s, i] += weighted * outlines[s, p, 1]
                for j in range(i + 1):
                    systems[half, s, i, j] += weighted * basis[j]
        for half in range(2):
            for i in range(COEFFICIENTS):
                for j in range(i):
                    systems[half, s, j, i] = systems[half, s, i, j]
    return systems, sums
