"""What stored numbers take in bits, as the coder's learned odds will have it."""

import math

import numpy as np
from numpy.typing import NDArray

from organ_geometry.coding.section_signals import SIGNALS

LARGEST_SIZE = 12
"""Largest size that has a price of its own."""
_POWERS = 6


def first_prices() -> NDArray[np.float64]:
    """Return what numbers of which nothing is known take.

    Returns
    -------
    NDArray[np.float64]
        (16, 13) bits of each signal's number, by its size.
    """
    sizes = np.arange(1.0, LARGEST_SIZE + 1)
    return np.tile(np.concatenate([[0.6], 3.0 + 1.6 * np.log2(sizes)]), (SIGNALS, 1))


def learned_prices(stored: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return what numbers like those that are stored take.

    Parameters
    ----------
    stored
        (K, 16) stored numbers of a boundary; the first key's do not count.

    Returns
    -------
    NDArray[np.float64]
        (16, 13) bits of each signal's number, by its size.
    """
    sizes = np.abs(stored[1:])
    powers = np.array([(sizes >= 2**power).sum() for power in range(_POWERS)]) + 0.5
    more = np.clip(powers[1:] / powers[:-1], 0.05, 0.9)
    size_bits = np.zeros(LARGEST_SIZE)
    for size in range(1, LARGEST_SIZE + 1):
        power = size.bit_length() - 1
        size_bits[size - 1] = power - np.log2(more[:power]).sum() - math.log2(1.0 - more[power])
    zeros = ((sizes == 0).sum(axis=0) + 0.5) / (len(sizes) + 1.0)
    bits = np.empty((SIGNALS, LARGEST_SIZE + 1))
    bits[:, 0] = -np.log2(zeros)
    bits[:, 1:] = 1.0 - np.log2(1.0 - zeros)[:, np.newaxis] + size_bits
    return bits
