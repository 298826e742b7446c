"""Sections in whole numbers: key sections and what is stored of them, for the fewest bits."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from organ_geometry.coding.key_lattice import (
    best_breaks,
    descend,
    differences_to_values,
    nearest_differences,
)
from organ_geometry.coding.number_prices import LARGEST_SIZE, first_prices, learned_prices
from organ_geometry.coding.organ_code import signal_steps
from organ_geometry.coding.section_signals import ASIDE, SIGNALS, WIDTH, extents, fitted_signals
from organ_geometry.curves.key_blend import KeyBlend

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
