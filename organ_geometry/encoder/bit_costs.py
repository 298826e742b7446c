"""What stored numbers take in bits, as the coder's learned odds will have it."""

import math

import numpy as np
from numpy.typing import NDArray

from organ_geometry.curves.axis_curve import key_depth, key_levels
from organ_geometry.organ_file.coefficients import SIGNALS

LARGEST_SIZE = 12
"""Largest size that has a price of its own."""
_POWERS = 6
_BEND_LEVELS = 4


def first_prices() -> NDArray[np.float64]:
    """Return what numbers of which nothing is known take."""
    sizes = np.arange(1.0, LARGEST_SIZE + 1)
    return np.tile(np.concatenate([[0.6], 3.0 + 1.6 * np.log2(sizes)]), (SIGNALS, 1))


def learned_prices(stored: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return what numbers like those that are stored take."""
    sizes = np.abs(stored[1:])
    zeros = ((sizes == 0).sum(axis=0) + 0.5) / (len(sizes) + 1.0)
    bits = np.empty((SIGNALS, LARGEST_SIZE + 1))
    bits[:, 0] = -np.log2(zeros)
    bits[:, 1:] = 1.0 - np.log2(1.0 - zeros)[:, np.newaxis] + _size_bits(sizes)
    return bits


def bend_prices(bends: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return what numbers like an axis's bends take."""
    levels = np.minimum(key_levels(key_depth(len(bends))), _BEND_LEVELS)
    bits = np.full((len(bends), 3, LARGEST_SIZE + 1), np.inf)
    bits[:, :, 0] = 0.0
    for level in range(1, int(levels.max()) + 1):
        here = levels == level
        sizes = np.abs(bends[here])
        of_sizes = _size_bits(sizes)
        for ways in (slice(0, 1), slice(1, 3)):
            zeros = ((sizes[:, ways] == 0).sum() + 0.5) / (sizes[:, ways].size + 1.0)
            bits[here, ways, 0] = -math.log2(zeros)
            bits[here, ways, 1:] = 1.0 - math.log2(1.0 - zeros) + of_sizes
    return bits.reshape(-1, LARGEST_SIZE + 1)


def _size_bits(sizes: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the (12,) bits that sizes from 1 take where others are as these."""
    powers = np.array([(sizes >= 2**power).sum() for power in range(_POWERS)]) + 0.5
    more = np.clip(powers[1:] / powers[:-1], 0.05, 0.9)
    bits = np.zeros(LARGEST_SIZE)
    for size in range(1, LARGEST_SIZE + 1):
        power = size.bit_length() - 1
        bits[size - 1] = power - np.log2(more[:power]).sum() - math.log2(1.0 - more[power])
    return bits
