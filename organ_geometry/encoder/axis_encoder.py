"""The axis in whole numbers: a few keys near the sections' centroids, in few bits."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from organ_geometry.curves.axis_curve import (
    key_levels,
    natural_cubic,
    natural_cubic_slopes,
    refinement,
)
from organ_geometry.encoder.key_lattice import descend
from organ_geometry.organ_file.organ_code import (
    LARGEST_AXIS_DEPTH,
    axis_keys,
    bend_steps,
    chord_frame,
    scale_of,
)

_LARGEST_SIZE = 12
_SIZES = np.arange(1.0, _LARGEST_SIZE + 1)
# A zero, or a sign and a size: what they take where little is known of them.
_BITS = np.tile(np.concatenate([[0.7], 2.5 + 2.0 * np.log2(_SIZES)]), (2, 1))
_FIT_ROUNDS = 5
_CENTROIDS_A_KEY = 3


@dataclass(frozen=True, slots=True, eq=False)
class CodedAxis:
    """An axis in whole numbers.

    Attributes
    ----------
    ends, bends
        As in `OrganCode`.
    scale
        Its step in tolerances, see `scale_of`.
    step
        The step, mm.
    keys
        (K, 3) the keys that they give, mm.
    cost
        Its squared error and the price of its bits, mm^2.
    """

    ends: NDArray[np.int64]
    bends: NDArray[np.int64]
    scale: int
    step: float
    keys: NDArray[np.float64]
    cost: float

    def bent(self, bends: NDArray[np.int64]) -> "CodedAxis":
        """Return the axis with other bends.

        Parameters
        ----------
        bends
            (K, 3) the bends.

        Returns
        -------
        CodedAxis
            The axis; its cost is not known.
        """
        keys = axis_keys(self.ends, bends, self.step)
        return replace(self, bends=bends, keys=keys, cost=math.nan)


def coded_axis(
    centroids: NDArray[np.float64],
    depth: int,
    scale: int,
    tolerance: float,
    price: float,
    reach: tuple[float, float] = (0.0, 0.0),
) -> CodedAxis:
    """Return an axis of 2^depth + 1 keys."""
    count, step = 2**depth + 1, tolerance * scale_of(scale)
    price *= step * step
    keys, places = _fitted(centroids, count, reach)
    first = np.asarray(np.round(keys[0] / step), dtype=np.int64)
    chord = np.asarray(np.round(keys[-1] / step), dtype=np.int64) - first
    if not chord.any():
        chord[int(np.abs(keys[-1] - keys[0]).argmax())] = 1
    ends = np.stack([first, chord])
    frame = chord_frame(np.asarray(chord * step, dtype=np.float64))
    unit = bend_steps(step)
    weights = natural_cubic(places, count)
    tangents = (natural_cubic_slopes(places, count) @ keys) @ frame.T
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    across = np.eye(3) - tangents[:, :, np.newaxis] * tangents[:, np.newaxis, :]
    straight = np.asarray(
        np.linspace(0.0, 1.0, count)[:, np.newaxis] * chord * step + first * step, dtype=np.float64
    )
    wanted = np.einsum("sij,sj->si", across, (centroids - weights @ straight) @ frame.T).ravel()
    levels = key_levels(depth)
    inner = np.flatnonzero(levels > 0)
    columns = (weights @ refinement(depth))[:, inner]
    # One row for each section and direction, one column for each key and direction.
    design = columns[:, np.newaxis, :, np.newaxis] * (across * unit)[:, :, np.newaxis, :]
    design = design.reshape(3 * len(centroids), -1)
    products, sums = 0.5 * design.T @ design, 0.5 * design.T @ wanted
    numbers = np.zeros(design.shape[1], dtype=np.int64)
    prices, rows = price * _BITS, np.zeros(len(numbers), dtype=np.intp)
    for level in range(1, depth + 1):
        known = np.flatnonzero(np.repeat(levels[inner] <= level, 3))
        chosen = numbers[known]
        descend(
            np.ascontiguousarray(products[np.ix_(known, known)]),
            sums[known], rows[known], prices, chosen, 20,
        )  # fmt: skip
        numbers[known] = chosen
    bends = np.zeros((count, 3), dtype=np.int64)
    bends[inner] = numbers.reshape(-1, 3)
    away = wanted - design @ numbers
    bits = _BITS[0, np.minimum(np.abs(numbers), _LARGEST_SIZE)].sum()
    cost = 0.5 * float(away @ away) + price * float(bits)
    return CodedAxis(ends, bends, scale, step, axis_keys(ends, bends, step), cost)


def most_levels(sections: int) -> int:
    """Return the most levels of keys that sections can fix."""
    return min(max(1, (sections // _CENTROIDS_A_KEY).bit_length() - 1), LARGEST_AXIS_DEPTH)


def _fitted(
    targets: NDArray[np.float64], count: int, reach: tuple[float, float]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the (K, 3) least-squares keys and the (S,) places of the targets along them."""
    steps = np.linalg.norm(np.diff(targets, axis=0), axis=1)
    places = np.concatenate([[0.0], np.cumsum(steps)])
    length = max(float(places[-1]), np.finfo(np.float64).tiny)
    whole = length + reach[0] + reach[1]
    places = (places + reach[0]) / whole
    keys = _least_squares(targets, places, count)
    for _ in range(_FIT_ROUNDS):
        slopes = natural_cubic_slopes(places, count) @ keys
        away = targets - natural_cubic(places, count) @ keys
        squared = np.maximum((slopes * slopes).sum(axis=1), np.finfo(np.float64).tiny)
        places = places + 0.7 * (away * slopes).sum(axis=1) / squared
        places = np.maximum.accumulate(places) + 1e-9 * np.arange(len(places))
        places = (places - places[0]) / (places[-1] - places[0])
        places = (places * length + reach[0]) / whole
        keys = _least_squares(targets, places, count)
    return keys, places


def _least_squares(
    targets: NDArray[np.float64], places: NDArray[np.float64], count: int
) -> NDArray[np.float64]:
    weights = natural_cubic(places, count)
    return np.asarray(np.linalg.lstsq(weights, targets, rcond=1e-6)[0], dtype=np.float64)
