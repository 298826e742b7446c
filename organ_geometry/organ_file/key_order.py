"""The order in which key sections are stored, and how each is predicted from those before it.

Keys lie at places k of a grid of 2^L pieces. The first is stored as it is, the last as its
difference from the first. The others follow in bisection order: by the largest power of two that
divides their place, so that coarse places come first. Each is predicted on the straight line
between its nearest known neighbours before and after it, and the residual is stored, in steps. Its
level, one more than the higher of its neighbours' (0 at both ends), chooses its contexts: residuals
shrink as keys come closer. (This is linear interpolation in hierarchical order, as of a wavelet
lifting scheme.) Values at keys are linear in what is stored, by the matrix `differences_to_values`.
"""

from bisect import bisect_left

import numpy as np
from numpy.typing import NDArray


def known_order(keys: NDArray[np.intp]) -> list[tuple[int, int, int, int]]:
    """Return (key, neighbour before, neighbour after, level) of the keys between the ends."""
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
    """Return the (K, K) matrix that makes values at keys of what is stored of them."""
    count = len(keys)
    values = np.zeros((count, count))
    values[:, 0][[0, -1]] = 1.0
    values[-1, -1] = 1.0
    for key, low, high, _ in known_order(keys):
        fraction = float(keys[key] - keys[low]) / float(keys[high] - keys[low])
        values[key] = (1.0 - fraction) * values[low] + fraction * values[high]
        values[key, key] = 1.0
    return values
