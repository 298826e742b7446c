"""Whole numbers at key sections: which keys, and which steps at each, for the fewest bits."""

import numba
import numpy as np
from numpy.typing import NDArray

from organ_geometry.organ_file.key_order import known_order

# A number that moves so much less than others, in squares, moves nothing: the rest is rounding.
_LEAST_STIFF = 1e-12


def nearest_differences(
    values: NDArray[np.float64], keys: NDArray[np.intp], dead: float = 0.5
) -> NDArray[np.int64]:
    """Return the stored differences that come nearest to values at keys, one key after the other.

    Parameters
    ----------
    values
        (K, J) values of J signals at the keys, in steps.
    keys
        (K,) places of the keys, growing.
    dead
        Differences smaller than this are left out, but for the first key's.

    Returns
    -------
    NDArray[np.int64]
        (K, J) differences.
    """
    numbers = np.zeros(values.shape, dtype=np.int64)
    decoded = np.zeros(values.shape)
    numbers[0] = np.round(values[0])
    decoded[0] = numbers[0]
    numbers[-1] = _with_dead_zone(values[-1] - decoded[0], dead)
    decoded[-1] = decoded[0] + numbers[-1]
    for key, low, high, _ in known_order(keys):
        share = float(keys[key] - keys[low]) / float(keys[high] - keys[low])
        line = (1.0 - share) * decoded[low] + share * decoded[high]
        numbers[key] = _with_dead_zone(values[key] - line, dead)
        decoded[key] = line + numbers[key]
    return numbers


def _with_dead_zone(values: NDArray[np.float64], dead: float) -> NDArray[np.int64]:
    """Return whole numbers nearest to values, but zero for one up to where it pays little."""
    return np.where(np.abs(values) < dead, 0.0, np.round(values)).astype(np.int64)


@numba.njit(cache=True)
def best_breaks(
    places: NDArray[np.float64],
    signals: NDArray[np.float64],
    weights: NDArray[np.float64],
    price: float,
    longest: int,
) -> NDArray[np.intp]:
    """Return the breaks of the piecewise straight signals of least error and price."""
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
    best = np.full(count, np.inf)
    come = np.zeros(count, np.intp)
    best[0] = 0.0
    for last in range(1, count):
        for first in range(max(0, last - longest), last):
            total = best[first] + price
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


@numba.njit(cache=True)
def descend(
    products: NDArray[np.float64],
    sums: NDArray[np.float64],
    levels: NDArray[np.intp],
    prices: NDArray[np.float64],
    steps: NDArray[np.int64],
    passes: int,
) -> None:
    """Lower squared error and price of whole numbers, one number after the other."""
    count = len(steps)
    most = prices.shape[1] - 1
    pull = sums.copy()
    least = 0.0
    for k in range(count):
        least = max(least, _LEAST_STIFF * products[k, k])
    for k in range(count):
        if steps[k] != 0:
            for i in range(count):
                pull[i] -= products[i, k] * steps[k]
    for _ in range(passes):
        changed = False
        for k in range(count):
            stiff = products[k, k]
            if stiff <= least:
                continue
            wanted = steps[k] + pull[k] / stiff
            floor = int(np.floor(wanted))
            best, choice = np.inf, 0
            for option in range(5):
                number = 0 if option == 0 else floor + option - 2
                size = abs(number)
                price = prices[levels[k], min(size, most)]
                if size > most:
                    price += (prices[levels[k], most] - prices[levels[k], 0]) * (
                        np.log2(1.0 + size - most) / (1.0 + most)
                    )
                cost = stiff * (number - wanted) ** 2 + price
                if cost < best:
                    best, choice = cost, number
            if choice != steps[k]:
                changed = True
                for i in range(count):
                    pull[i] -= products[i, k] * (choice - steps[k])
                steps[k] = choice
        if not changed:
            return
