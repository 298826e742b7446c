"""Sections as sixteen signals along an organ, of which little is left where sections are round.

The signals of a boundary are half its width a and its middle e in x, then seven numbers s and
seven numbers d: half the difference and half the sum of the bottom and the top half-curve, as
coefficients of Chebyshev polynomials of the second kind in u = (x - e) / a, s less those of a
circle of that width. A change of a coefficient by c moves a round boundary along its normal by
c sin((k + 1) t) at u = cos t: all s and d count alike, and none disturbs another.
"""

import numpy as np
from numpy.typing import NDArray

from organ_geometry.half_curves import (
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
    """Return the half-curves of signals.

    Parameters
    ----------
    signals
        (K, 16) signals, mm.

    Returns
    -------
    NDArray[np.float64]
        (K, 16) half-curves, mm.
    """
    rows = np.empty_like(signals)
    half = signals[:, SYMMETRIC] + signals[:, WIDTH, np.newaxis] * CIRCLE
    rows[:, MIDDLE] = signals[:, ASIDE]
    rows[:, HALF_WIDTH] = signals[:, WIDTH]
    rows[:, TOP] = (signals[:, SKEW] - half) @ _TO_FIRST
    rows[:, BOTTOM] = (signals[:, SKEW] + half) @ _TO_FIRST
    return rows


def extents(outlines: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return half width and middle of outlines.

    Parameters
    ----------
    outlines
        (S, P, 2) points around each section, mm.

    Returns
    -------
    NDArray[np.float64]
        (S, 2) half width, by its share that half-curves span, and middle, mm.
    """
    low, high = outlines[:, :, 0].min(axis=1), outlines[:, :, 0].max(axis=1)
    return np.stack([0.5 * RANGE_SHARE * (high - low), 0.5 * (high + low)], axis=1)


def fitted_signals(
    outlines: NDArray[np.float64], spans: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the signals of the half-curves over given spans that lie nearest to outlines.

    Squared distances in y are weighted by the squared y component of the normal, which makes them
    distances along the normal, and by the length of outline that each point stands for.

    Parameters
    ----------
    outlines
        (S, P, 2) points around each section, in either sense, mm.
    spans
        (S, 2) half width and middle of the range in x, mm.

    Returns
    -------
    NDArray[np.float64]
        (S, 16) signals, mm.
    """
    x, y = outlines[:, :, 0], outlines[:, :, 1]
    after, before = np.roll(outlines, -1, axis=1), np.roll(outlines, 1, axis=1)
    chords = after - before
    lengths = np.hypot(chords[:, :, 0], chords[:, :, 1])
    weights = chords[:, :, 0] ** 2 / np.maximum(lengths, np.finfo(np.float64).tiny)
    # A span far from its outline would make numbers of no meaning.
    spans = np.maximum(spans, [1e-6 * float(np.ptp(x)), -np.inf])
    u = (x - spans[:, 1:]) / spans[:, :1]
    basis = second_kind(np.clip(u, -1.02, 1.02))
    bottom = _bottom_half(outlines)
    fits: list[NDArray[np.float64]] = []
    low, high = y.min(axis=1), y.max(axis=1)
    middles, reach = 0.5 * (low + high), _LEAVES * 0.5 * (high - low)
    for half, sign in ((bottom, 1.0), (~bottom, -1.0)):
        weighted = basis * (weights * half)[:, :, np.newaxis]
        system = weighted.transpose(0, 2, 1) @ basis
        sums = np.asarray((weighted * y[:, :, np.newaxis]).sum(axis=1), dtype=np.float64)
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
    """Return the Chebyshev polynomials of the second kind of degrees 0 to 6.

    Parameters
    ----------
    u
        (...) places.

    Returns
    -------
    NDArray[np.float64]
        (..., 7) values.
    """
    values = np.empty((*u.shape, COEFFICIENTS))
    values[..., 0] = 1.0
    values[..., 1] = 2.0 * u
    for order in range(2, COEFFICIENTS):
        values[..., order] = 2.0 * u * values[..., order - 1] - values[..., order - 2]
    return values


_SPREAD = second_kind(np.linspace(-1.0, 1.0, 33))


def _bottom_half(outlines: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return (S, P) which points lie on the half of larger y, between the extremes in x."""
    x, y = outlines[:, :, 0], outlines[:, :, 1]
    after = np.roll(outlines, -1, axis=1)
    area = (x * after[:, :, 1] - y * after[:, :, 0]).sum(axis=1)
    count = x.shape[1]
    left, right = x.argmin(axis=1)[:, np.newaxis], x.argmax(axis=1)[:, np.newaxis]
    onwards = (np.arange(count, dtype=np.intp) - left) % count <= (right - left) % count
    # The sense of positive area goes from left to right on the side of smaller y.
    return onwards != (area >= 0.0)[:, np.newaxis]
