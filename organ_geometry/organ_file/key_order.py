"""The order in which key sections are stored, and how each is foretold by those before it.

What is stored of a key is its difference from the line between keys known before it, in steps; the
first key is stored as it is, the last as its difference from the first, and then always the middle
one of the keys between two known ones.
"""

from bisect import bisect_left

import numpy as np
from numpy.typing import NDArray


def known_order(keys: NDArray[np.intp]) -> list[tuple[int, int, int, int]]:
    """Return the order in which keys between the two ends become known."""
    places = [int(place) for place in keys]
    known, levels = [0, len(places) - 1], {0: 0, len(places) - 1: 0}
    order: list[tuple[int, int, int, int]] = []
    inner = range(1, len(places) - 1)
    for key in sorted(inner, key=lambda number: (-(places[number] & -places[number]), number)):
        after = bisect_left(known, key)
        low, high = known[after - 1], known[after]
        levels[key] = 1 + max(levels[low], levels[high])
        known.insert(after, key)
        order.append((key, low, high, levels[key]))
    return order


def differences_to_values(keys: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return how the values at keys follow from what is stored of them."""
    count = len(keys)
    values = np.zeros((count, count))
    values[:, 0][[0, -1]] = 1.0
    values[-1, -1] = 1.0
    for key, low, high, _ in known_order(keys):
        share = float(keys[key] - keys[low]) / float(keys[high] - keys[low])
        values[key] = (1.0 - share) * values[low] + share * values[high]
        values[key, key] = 1.0
    return values
