"""First integers of the key sections: where they are, and their shape coefficients quantised.

Along the axis the contours are outlines at even places, and each outline's half-curves sixteen
shape coefficients (`organ_file.coefficients`).

    f_m    (16,) coefficients fitted to outline m of M
    N      (M, K) blend: values at the outlines, of values at the K key sections
    M_ij   values at key i of what is stored of key j (`key_order`); N M is `design`
    g_j    mean squared distance that a coefficient j of one makes on a round boundary

Breakpoints of the coefficients' best piecewise straight fit become the key
sections (`optimal_breakpoints`); what is stored of them, differences from what is foretold by other
keys, comes of coordinate descent on squared error and bits, one coefficient after the other. The
middle and width of the half-curves come first and the curves are fitted again over them, because a
change of width moves everything between. Refinement then goes on from these integers.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kernel_cache import njit
from organ_geometry.curves.half_curves import COEFFICIENTS, RANGE_FRACTION
from organ_geometry.curves.key_blend import KeyBlend
from organ_geometry.encoder.coordinate_descent import (
    ANYWHERE,
    Coordinates,
    Residuals,
    dense_bands,
    descend,
    penalty_row,
)
from organ_geometry.encoder.costs import first_bits, learned_bits, total_bits
from organ_geometry.encoder.settings import EncoderSettings, Penalty
from organ_geometry.organ_file.coefficients import (
    ASIDE,
    CIRCLE,
    SIGNALS,
    SKEW,
    SYMMETRIC,
    WIDTH,
    second_kind,
)
from organ_geometry.organ_file.key_order import differences_to_values, known_order
from organ_geometry.organ_file.organ_code import signal_steps


@dataclass(frozen=True, slots=True, eq=False)
class Outlines:
    """An organ's outlines at equal distances along its axis."""

    outer: NDArray[np.float64]  # (M, P, 2) points around the outer boundary, mm
    lumen: NDArray[np.float64] | None  # (M, P, 2) points around the lumen, mm, or None


@dataclass(frozen=True, slots=True, eq=False)
class KeySections:
    """Key sections in integers, as in `OrganCode`."""

    keys: NDArray[np.intp]  # (K,) numbers of candidates, growing, both ends included
    # (W, K, 16) stored differences, of the outer boundary and then of the lumen if it counts.
    stored: NDArray[np.int64]


class SectionEncoder:
    """Quantises an organ's outlines in steps of any size."""

    def __init__(self, outlines: Outlines, candidates: int, settings: EncoderSettings) -> None:
        # The outlines stand at the candidates for key sections, and `finer` - 1 between each two.
        self._walls = [outlines.outer]
        if outlines.lumen is not None:
            self._walls.append(outlines.lumen)
        self._settings = settings
        self.fits = [fitted_signals(wall, extents(wall)) for wall in self._walls]
        """(M, 16) coefficients of each boundary's own half-curves."""
        self._finer = (len(outlines.outer) - 1) // candidates
        self._places = np.arange(len(outlines.outer)) / self._finer

    def encode(
        self,
        step: float,
        bit_worth: float,
        weights: NDArray[np.float64],
        keys: NDArray[np.intp] | None = None,
    ) -> KeySections:
        """Return key sections of little error and few bits."""
        # A bit is worth a squared error, mm^2; with 0 the nearest integers are taken. (M,) weights
        # are those of the outlines' squared errors. (K,) keys are taken if given, else chosen.
        chosen = self._breakpoints(bit_worth, weights) if keys is None else keys
        steps = signal_steps(step)
        bits = [first_bits() for _ in self._walls]
        stored: list[NDArray[np.int64]] = []
        # Tables of bits are learned from the integers, and lead to other integers: three iterations
        # settle them.
        for last in (False, False, True):
            quantiser = _Quantiser(self._places, chosen, weights, bit_worth, self._settings)
            stored, base = [], np.zeros_like(self.fits[0])
            for wall, fit, table in zip(self._walls, self.fits, bits, strict=True):
                integers, base = _stored(wall, fit, base, quantiser, steps, table)
                stored.append(integers)
            if last or bit_worth == 0.0:
                break
            bits = [learned_bits(integers) for integers in stored]
            if keys is None:
                # A key of zeros lies on the line between its neighbours: it is not needed.
                used = np.any([(integers != 0).any(axis=1) for integers in stored], axis=0)
                used[[0, -1]] = True
                chosen = chosen[used]
        return KeySections(chosen, np.stack(stored))

    def _breakpoints(self, bit_worth: float, weights: NDArray[np.float64]) -> NDArray[np.intp]:
        """Return the candidates between which the coefficients are nearly straight."""
        signals = np.concatenate(self.fits, axis=1)[:: self._finer]
        # Of places between candidates, one stands for all of them.
        importance = np.tile(_importance(), len(self.fits)) * weights[:: self._finer, np.newaxis]
        return optimal_breakpoints(
            np.arange(len(signals), dtype=np.float64),
            np.ascontiguousarray(signals),
            np.ascontiguousarray(importance * self._finer),
            bit_worth * self._settings.key_bits * len(self.fits),
            256,
        )


def _importance() -> NDArray[np.float64]:
    """Return (16,) mean squared distances that coefficients of one make on a round boundary."""
    # Half, the mean of a squared sine; half of that for the width, as half-curves fitted again take
    # up most of what it changes.
    importance = np.full(SIGNALS, 0.5)
    importance[WIDTH] = 0.25
    return importance


class _Quantiser:
    """Chooses the stored integers of one coefficient after the other."""

    def __init__(
        self,
        places: NDArray[np.float64],
        keys: NDArray[np.intp],
        weights: NDArray[np.float64],
        bit_worth: float,
        settings: EncoderSettings,
    ) -> None:
        nodes = KeyBlend.at(places, keys).matrix(len(keys))
        # (M, K): what a stored difference of one gives along the axis.
        self.design = nodes @ differences_to_values(keys)
        self._bands = dense_bands(self.design)
        self._weights, self._bit_worth, self._settings = weights, bit_worth, settings
        self._keys = keys
        # Normal equations N' w N v = N' w f of the values v at the keys, held a little where no
        # outline fixes them.
        self._node_sums = nodes.T * weights
        self._node_products = self._node_sums @ nodes
        trace = float(np.trace(self._node_products))
        self._node_products += 1e-9 * trace * np.eye(len(keys))

    def __call__(
        self,
        wanted: NDArray[np.float64],
        steps: NDArray[np.float64],
        importance: NDArray[np.float64],
        bits: NDArray[np.float64],
    ) -> NDArray[np.int64]:
        """Return the (K, J) integers of J coefficients (M, J), each with its table of bits."""
        starts = self._rounded(wanted / steps)
        if self._bit_worth == 0.0:
            return starts
        chosen = np.empty_like(starts)
        count = len(starts)
        section = np.zeros(len(wanted), dtype=np.intp)
        ones = np.ones((1, len(wanted)))
        # All outlines are one section, and an error of a bit's worth costs a bit.
        penalty = Penalty(1.0 / self._bit_worth, 0.0, 0.0)
        row = penalty_row(penalty)
        everything = np.array([[0, count]])
        for signal, (step, weight) in enumerate(zip(steps, importance, strict=True)):
            tables = np.tile(bits[signal], (count, 1))
            # The first key comes without a price: it is never left out.
            tables[0] = 0.0
            coordinates = Coordinates(
                row=np.arange(count),
                change=np.zeros(count, dtype=np.intp),
                step=np.full(count, step),
                bits=tables,
            )
            best = math.inf
            # Descent ends where no single change pays: from rounded integers that is often another
            # place than from zeros, and the cheaper of both is taken.
            for integers in (starts[:, signal].copy(), np.zeros(count, dtype=np.int64)):
                rest = self.design @ integers * step - wanted[:, signal]
                weights = self._weights * weight
                errors = np.array([weights @ (rest * rest)])
                points = Residuals(section, weights, rest, errors)
                descend(
                    integers, coordinates, self._bands, ones, points, row, everything, ANYWHERE, 20
                )  # fmt: skip
                cost = penalty.slope * float(errors[0]) + total_bits(tables, integers)
                if cost < best:
                    best = cost
                    chosen[:, signal] = integers
        return chosen

    def _rounded(self, wanted: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the integers nearest to the least-squares values at the keys."""
        values = np.asarray(
            np.linalg.solve(self._node_products, self._node_sums @ wanted), dtype=np.float64
        )
        dead = self._settings.dead_zone if self._bit_worth > 0.0 else 0.5
        return nearest_differences(values, self._keys, dead)


def _stored(
    outlines: NDArray[np.float64],
    fit: NDArray[np.float64],
    base: NDArray[np.float64],
    quantiser: _Quantiser,
    steps: NDArray[np.float64],
    bits: NDArray[np.float64],
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the stored integers of a boundary, and the coefficients that they and a base give."""
    stored = np.zeros((quantiser.design.shape[1], SIGNALS), dtype=np.int64)
    decoded, importance = base.copy(), _importance()

    def store(signals: slice, wanted: NDArray[np.float64]) -> None:
        rest = wanted - base[:, signals]
        integers = quantiser(rest, steps[signals], importance[signals], bits[signals])
        stored[:, signals] = integers
        decoded[:, signals] += quantiser.design @ integers * steps[signals]

    span, curves = slice(WIDTH, ASIDE + 1), slice(ASIDE + 1, SIGNALS)
    store(span, fit[:, span])
    # The half-curves are fitted again over the spans that a reader will know.
    spans = decoded[:, span].copy()
    spans[:, WIDTH] = np.maximum(spans[:, WIDTH], np.finfo(np.float64).tiny)
    store(curves, fitted_signals(outlines, spans)[:, curves])
    return stored, decoded


def nearest_differences(
    values: NDArray[np.float64], keys: NDArray[np.intp], dead: float = 0.5
) -> NDArray[np.int64]:
    """Return the (K, J) stored differences nearest to J coefficients at keys, in steps."""
    # One key after the other, so that each makes good what those before it were rounded by. But for
    # the first key's, differences below the dead zone are left out.
    integers = np.zeros(values.shape, dtype=np.int64)
    decoded = np.zeros(values.shape)
    integers[0] = np.round(values[0])
    decoded[0] = integers[0]
    integers[-1] = _rounded(values[-1] - decoded[0], dead)
    decoded[-1] = decoded[0] + integers[-1]
    for key, low, high, _ in known_order(keys):
        fraction = float(keys[key] - keys[low]) / float(keys[high] - keys[low])
        line = (1.0 - fraction) * decoded[low] + fraction * decoded[high]
        integers[key] = _rounded(values[key] - line, dead)
        decoded[key] = line + integers[key]
    return integers


def _rounded(values: NDArray[np.float64], dead: float) -> NDArray[np.int64]:
    """Return the integers nearest to values, but zero for one below the dead zone."""
    return np.where(np.abs(values) < dead, 0.0, np.round(values)).astype(np.int64)


def extents(outlines: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return half width and middle of outlines."""
    # The half-curves span a share of the width: a polynomial cannot stand upright at its end.
    low, high = outlines[:, :, 0].min(axis=1), outlines[:, :, 0].max(axis=1)
    return np.stack([0.5 * RANGE_FRACTION * (high - low), 0.5 * (high + low)], axis=1)


def fitted_signals(
    outlines: NDArray[np.float64], spans: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the coefficients of the half-curves over given spans that lie nearest to outlines."""
    x, y = outlines[:, :, 0], outlines[:, :, 1]
    # A span far from its outline would make coefficients of no meaning.
    spans = np.maximum(spans, [1e-6 * float(np.ptp(x)), -np.inf])
    systems, all_sums = _normal_equations(outlines, spans)
    fits: list[NDArray[np.float64]] = []
    low, high = y.min(axis=1), y.max(axis=1)
    # A half-curve that goes farther from the middle than 1.5 times the outline has run away.
    middles, reach = 0.5 * (low + high), 1.5 * 0.5 * (high - low)
    everywhere = second_kind(np.linspace(-1.0, 1.0, 33))
    level = np.eye(COEFFICIENTS)[0]
    for system, sums, sign in zip(systems, all_sums, (1.0, -1.0), strict=True):
        trace = np.einsum("sii->s", system)[:, np.newaxis] + np.finfo(np.float64).tiny
        # Where an outline has no points, as of sections that cross, the half is round.
        round_half = sign * spans[:, :1] * CIRCLE + middles[:, np.newaxis] * level
        fit = np.zeros((len(outlines), COEFFICIENTS))
        left = np.arange(len(outlines), dtype=np.intp)
        # Held to the round half with this share of its weight: more where it runs away with less.
        for fraction in (1e-4, 1e-2, 1.0):
            held = fraction * trace[left]
            fit[left] = np.linalg.solve(
                system[left] + held[:, :, np.newaxis] * np.eye(COEFFICIENTS),
                (sums[left] + held * round_half[left])[:, :, np.newaxis],
            )[:, :, 0]
            away = np.abs(fit[left] @ everywhere.T - middles[left, np.newaxis]).max(axis=1)
            left = left[away > reach[left]]
            if not left.size:
                break
        fits.append(fit)
    signals = np.empty((len(outlines), SIGNALS))
    signals[:, :2] = spans
    signals[:, SYMMETRIC] = 0.5 * (fits[0] - fits[1]) - spans[:, :1] * CIRCLE
    signals[:, SKEW] = 0.5 * (fits[0] + fits[1])
    return signals


def _normal_equations(
    outlines: NDArray[np.float64], spans: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return (2, S, 7, 7) and (2, S, 7) normal equations of the bottom and the top half-curves."""
    count = outlines.shape[1]
    x, y = outlines[:, :, 0], outlines[:, :, 1]
    after, before = np.roll(outlines, -1, axis=1), np.roll(outlines, 1, axis=1)
    area = (x * after[:, :, 1] - y * after[:, :, 0]).sum(axis=1, keepdims=True)
    left = np.asarray(x.argmin(axis=1), dtype=np.intp)[:, np.newaxis]
    right = np.asarray(x.argmax(axis=1), dtype=np.intp)[:, np.newaxis]
    # Errors in y, weighted by how level the boundary is there, are errors along its normal.
    chord_x, chord_y = np.moveaxis(after - before, 2, 0)
    weights = chord_x * chord_x / np.maximum(np.hypot(chord_x, chord_y), np.finfo(np.float64).tiny)
    # The sense of positive area goes from left to right on the side of smaller y.
    onwards = (np.arange(count, dtype=np.intp) - left) % count <= (right - left) % count
    top = onwards == (area >= 0.0)
    # A little beyond the span the half-curves may still be fitted; farther out they are of no use.
    u = np.clip((x - spans[:, 1:]) / spans[:, :1], -1.02, 1.02)
    basis = second_kind(u)
    weighted = np.stack([weights * ~top, weights * top])[:, :, :, np.newaxis] * basis
    return np.swapaxes(weighted, 2, 3) @ basis, np.einsum("hspk,sp->hsk", weighted, y)


@njit(cache=True)
def optimal_breakpoints(
    places: NDArray[np.float64],
    signals: NDArray[np.float64],
    weights: NDArray[np.float64],
    price: float,
    longest: int,
) -> NDArray[np.intp]:
    """Return the breakpoints of least squared error and price."""
    # (M, J) signals, with as many weights, are fitted by a straight line of their own between each
    # two breakpoints, at most `longest` apart. Dynamic programming: best[i] = min over k of best[k]
    # + price + error of the lines from k to i, which six running sums give in a few operations.
    count, kinds = signals.shape
    sums = np.zeros((count + 1, kinds, 6))
    for i in range(count):
        x = places[i]
        for j in range(kinds):
            y, w = signals[i, j], weights[i, j]
            sums[i + 1, j, 0] = sums[i, j, 0] + w
            sums[i + 1, j, 1] = sums[i, j, 1] + w * x
            sums[i + 1, j, 2] = sums[i, j, 2] + w * x * x
            sums[i + 1, j, 3] = sums[i, j, 3] + w * y
            sums[i + 1, j, 4] = sums[i, j, 4] + w * x * y
            sums[i + 1, j, 5] = sums[i, j, 5] + w * y * y
    best = np.full(count, np.inf)  # least cost of everything up to a place
    come = np.zeros(count, np.intp)  # the breakpoint before it
    best[0] = 0.0
    for last in range(1, count):
        for first in range(max(0, last - longest), last):
            total = best[first] + price
            # Errors only add: most pieces are given up after a few signals.
            if total >= best[last]:
                continue
            for j in range(kinds):
                n = sums[last + 1, j, 0] - sums[first, j, 0]
                x = sums[last + 1, j, 1] - sums[first, j, 1]
                xx = sums[last + 1, j, 2] - sums[first, j, 2]
                y = sums[last + 1, j, 3] - sums[first, j, 3]
                xy = sums[last + 1, j, 4] - sums[first, j, 4]
                yy = sums[last + 1, j, 5] - sums[first, j, 5]
                if n <= 0.0:
                    continue
                # Squares about the means; what the line does not explain is the error.
                spread = xx - x * x / n
                both = xy - x * y / n
                rest = yy - y * y / n
                if spread > 1e-12:
                    rest -= both * both / spread
                total += max(rest, 0.0)
                if total >= best[last]:
                    break
            if total < best[last]:
                best[last] = total
                come[last] = first
    number, place = 1, count - 1
    while place > 0:
        place = come[place]
        number += 1
    breaks = np.empty(number, np.intp)
    place = count - 1
    for k in range(number - 1, -1, -1):
        breaks[k] = place
        place = come[place]
    return breaks
