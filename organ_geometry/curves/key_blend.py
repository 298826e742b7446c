"""Interpolation between key sections by piecewise cubics (cubic Bessel interpolation).

Each piece between two keys is a cubic with the keys' values and slopes at its ends. A key's slope
is that of the parabola through it and its two neighbours; at the first and the last key the second
derivative vanishes. So a value influences two pieces to either side of its key, and straight
lines are reproduced.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# The slope of the straight line between the two keys of a piece, times its gap.
CHORD = np.array([0.0, -1.0, 1.0, 0.0])


@dataclass(frozen=True, slots=True, eq=False)
class KeyBlend:
    """Weights of keys at places between them."""

    before: NDArray[np.intp]  # (N,) the key before each place
    # (N, 4) weights of the key before that, that key and the two after it; zero where there is no
    # such key.
    weights: NDArray[np.float64]

    @classmethod
    def at(
        cls,
        places: NDArray[np.float64] | NDArray[np.intp],
        keys: NDArray[np.float64] | NDArray[np.intp],
    ) -> "KeyBlend":
        """Return the weights at (N,) places among (K,) growing keys, at an end beyond it."""
        # Cubic Hermite pieces, Catmull-Rom where keys are even: C. de Boor, A Practical Guide to
        # Splines, chapter IV, "cubic Bessel interpolation", with the free end.
        known = np.asarray(keys, dtype=np.float64)
        gaps = np.diff(known)
        before = np.clip(np.searchsorted(known, places, side="right") - 1, 0, len(gaps) - 1)
        slopes = _slopes(gaps)[before]
        t = np.clip((places - known[before]) / gaps[before], 0.0, 1.0)[:, np.newaxis]
        weights = t * (1.0 - t) ** 2 * slopes[:, 0] - t * t * (1.0 - t) * slopes[:, 1]
        rise = t * t * (3.0 - 2.0 * t)
        weights[:, 1:2] += 1.0 - rise
        weights[:, 2:3] += rise
        return cls(before, weights)

    def of(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return (N, J) values at the places, of (K, J) values at the keys."""
        found = np.zeros((len(self.before), values.shape[1]))
        for column in range(4):
            key = np.clip(self.before + (column - 1), 0, len(values) - 1)
            found += self.weights[:, column, np.newaxis] * values[key]
        return found

    def matrix(self, count: int) -> NDArray[np.float64]:
        """Return the (N, K) weights of all K keys."""
        return self.of(np.eye(count))


def _slopes(gaps: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (K - 1, 2, 4) slopes at both ends of pieces, times their gap, by four keys' values."""
    piece, last = np.arange(len(gaps)), len(gaps)
    slopes = np.zeros((last, 2, 4))
    for end in (0, 1):
        key = piece + end
        inner = (key > 0) & (key < last)
        left, right = gaps[np.maximum(key - 1, 0)], gaps[np.minimum(key, last - 1)]
        both = (left + right) * left * right / gaps
        slopes[inner, end, end] = (-right * right / both)[inner]
        slopes[inner, end, end + 1] = ((right * right - left * left) / both)[inner]
        slopes[inner, end, end + 2] = (left * left / both)[inner]
    if last == 1:
        slopes[0] = CHORD
        return slopes
    slopes[0, 0] = 1.5 * CHORD - 0.5 * slopes[0, 1]
    slopes[-1, 1] = 1.5 * CHORD - 0.5 * slopes[-1, 0]
    return slopes
