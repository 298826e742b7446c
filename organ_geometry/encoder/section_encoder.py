"""Sections in whole numbers: key sections and what is stored of them, for the fewest bits."""

import math
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from organ_geometry.curves.half_curves import COEFFICIENTS, RANGE_SHARE
from organ_geometry.curves.key_blend import KeyBlend
from organ_geometry.encoder.bit_costs import LARGEST_SIZE, first_prices, learned_prices
from organ_geometry.encoder.key_lattice import best_breaks, descend, nearest_differences
from organ_geometry.organ_file.coefficients import ASIDE, CIRCLE, SIGNALS, SKEW, SYMMETRIC, WIDTH
from organ_geometry.organ_file.key_order import differences_to_values
from organ_geometry.organ_file.organ_code import signal_steps

KEY_BITS = 16.0
"""What a key section takes where little is known of it."""

_LONGEST_GAP = 256
_ROUNDS = 3
_SWEEPS = 20
_DEAD_ZONE = 0.6
_SPAN = slice(WIDTH, ASIDE + 1)
_CURVES = slice(ASIDE + 1, SIGNALS)
# Of a round boundary's mean squared distance; half-curves take up most of a change of width.
_WEIGHTS = np.full(SIGNALS, 0.5)
_WEIGHTS[WIDTH] = 0.25


@dataclass(frozen=True, slots=True, eq=False)
class Outlines:
    """An organ's outlines at equal distances along its axis.

    Attributes
    ----------
    outer
        (M, P, 2) points around the outer boundary, mm.
    lumen
        (M, P, 2) points around the lumen, mm, or None.
    """

    outer: NDArray[np.float64]
    lumen: NDArray[np.float64] | None


@dataclass(frozen=True, slots=True, eq=False)
class CodedSections:
    """Key sections in whole numbers, as in `OrganCode`.

    Attributes
    ----------
    keys
        (K,) key sections.
    stored
        (W, K, 16) stored numbers, of the outer boundary and then of the lumen if it counts.
    """

    keys: NDArray[np.intp]
    stored: NDArray[np.int64]


class SectionEncoder:
    """Codes an organ's outlines in steps of any size.

    Parameters
    ----------
    outlines
        The outlines, at the candidates for key sections and as often between as is wanted.
    candidates
        Number of pieces between candidates.
    """

    def __init__(self, outlines: Outlines, candidates: int) -> None:
        self._walls = [outlines.outer]
        if outlines.lumen is not None:
            self._walls.append(outlines.lumen)
        self._fits = [fitted_signals(wall, extents(wall)) for wall in self._walls]
        self._candidates = candidates
        self._finer = (len(outlines.outer) - 1) // candidates
        self._places = np.arange(len(outlines.outer)) / self._finer

    @property
    def fits(self) -> list[NDArray[np.float64]]:
        """(M, 16) signals of each boundary's own half-curves."""
        return self._fits

    def coded(
        self,
        step: float,
        price: float,
        weights: NDArray[np.float64],
        keys: NDArray[np.intp] | None = None,
    ) -> CodedSections:
        """Return the key sections of least error and price.

        Parameters
        ----------
        step
            Step of half-curves' coefficients, mm.
        price
            Squared error, mm^2, that a bit is worth; 0 to come as near as the steps allow.
        weights
            (M,) weight of each outline's squared error.
        keys
            (K,) the key sections, if they are chosen already.

        Returns
        -------
        CodedSections
            The key sections.
        """
        chosen = self._breaks(price, weights) if keys is None else keys
        steps = signal_steps(step)
        prices = [first_prices() for _ in self._walls]
        stored: list[NDArray[np.int64]] = []
        for round_ in range(_ROUNDS):
            solver = _Solver(self._places, chosen, weights, price)
            stored, base = [], np.zeros_like(self._fits[0])
            for wall, fit, bits in zip(self._walls, self._fits, prices, strict=True):
                numbers, base = _stored(wall, fit, base, solver, steps, bits)
                stored.append(numbers)
            if round_ == _ROUNDS - 1 or price == 0.0:
                break
            prices = [learned_prices(numbers) for numbers in stored]
            if keys is None:
                used = np.any([(numbers != 0).any(axis=1) for numbers in stored], axis=0)
                used[[0, -1]] = True
                chosen = chosen[used]
        return CodedSections(chosen, np.stack(stored))

    def _breaks(self, price: float, weights: NDArray[np.float64]) -> NDArray[np.intp]:
        """Return the candidates between which the signals are nearly straight."""
        signals = np.concatenate(self._fits, axis=1)[:: self._finer]
        importance = np.tile(_WEIGHTS, len(self._fits)) * weights[:: self._finer, np.newaxis]
        return best_breaks(
            np.arange(len(signals), dtype=np.float64),
            np.ascontiguousarray(signals),
            np.ascontiguousarray(importance * self._finer),
            price * KEY_BITS * len(self._fits),
            _LONGEST_GAP,
        )


class _Solver:
    """Chooses the stored numbers of one signal after the other."""

    def __init__(
        self,
        places: NDArray[np.float64],
        keys: NDArray[np.intp],
        weights: NDArray[np.float64],
        price: float,
    ) -> None:
        nodes = KeyBlend.at(places, keys).matrix(len(keys))
        self.design = nodes @ differences_to_values(keys)
        self._weighted = self.design.T * weights
        self._products = self._weighted @ self.design
        self._price = price
        # The first key comes without a price: it is never left out.
        self._rows = np.ones(len(keys), dtype=np.intp)
        self._rows[0] = 0
        self._keys = keys
        self._node_sums = nodes.T * weights
        self._node_products = self._node_sums @ nodes
        trace = float(np.trace(self._node_products))
        self._node_products += 1e-9 * trace * np.eye(len(keys))

    def __call__(
        self,
        wanted: NDArray[np.float64],
        steps: NDArray[np.float64],
        weights: NDArray[np.float64],
        bits: NDArray[np.float64],
    ) -> NDArray[np.int64]:
        """Return the (K, J) numbers of J signals (M, J)."""
        starts = self._rounded(wanted / steps)
        if self._price == 0.0:
            return starts
        chosen = np.empty_like(starts)
        for signal, (step, weight) in enumerate(zip(steps, weights, strict=True)):
            prices = np.stack([np.zeros_like(bits[signal]), bits[signal] * self._price])
            products = self._products * (weight * step * step)
            sums = (self._weighted @ wanted[:, signal]) * (weight * step)
            best = math.inf
            for numbers in (starts[:, signal].copy(), np.zeros(len(starts), dtype=np.int64)):
                descend(products, sums, self._rows, prices, numbers, _SWEEPS)
                sizes = np.minimum(np.abs(numbers), LARGEST_SIZE)
                cost = float(numbers @ products @ numbers - 2.0 * numbers @ sums)
                cost += float(prices[self._rows, sizes].sum())
                if cost < best:
                    best = cost
                    chosen[:, signal] = numbers
        return chosen

    def _rounded(self, wanted: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the numbers nearest to the least-squares values at the keys."""
        values = np.asarray(
            np.linalg.solve(self._node_products, self._node_sums @ wanted), dtype=np.float64
        )
        dead = _DEAD_ZONE if self._price > 0.0 else 0.5
        return nearest_differences(values, self._keys, dead)


def _stored(
    outlines: NDArray[np.float64],
    fit: NDArray[np.float64],
    base: NDArray[np.float64],
    solver: _Solver,
    steps: NDArray[np.float64],
    bits: NDArray[np.float64],
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the stored numbers of a boundary, and the signals that they and a base give."""
    stored = np.zeros((solver.design.shape[1], SIGNALS), dtype=np.int64)
    decoded = base.copy()

    def store(signals: slice, wanted: NDArray[np.float64]) -> None:
        rest = wanted - base[:, signals]
        numbers = solver(rest, steps[signals], _WEIGHTS[signals], bits[signals])
        stored[:, signals] = numbers
        decoded[:, signals] += solver.design @ numbers * steps[signals]

    store(_SPAN, fit[:, _SPAN])
    # The half-curves are fitted again over the spans that a reader will know.
    spans = decoded[:, _SPAN].copy()
    spans[:, WIDTH] = np.maximum(spans[:, WIDTH], np.finfo(np.float64).tiny)
    store(_CURVES, fitted_signals(outlines, spans)[:, _CURVES])
    return stored, decoded


_TINY = float(np.finfo(np.float64).tiny)
_LEVEL = np.eye(COEFFICIENTS)[0]
_ROUNDNESS = (1e-4, 1e-2, 1.0)
"""Share of an outline's weight with which a half is held to be round: more where that leaves it."""
_LEAVES = 1.5
"""How far from its middle a half-curve may go, in half the outline's height."""


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
