"""Rate and distortion in one unit, the bit: what integers cost, and what errors cost.

The rate of an integer q is read from a table r[|q|] of 13 sizes; a larger one costs two bits more
each time its size doubles. Tables are either first guesses or learned from integers stored so far,
as the file's adaptive coder learns its odds: P(0) from the share of zeros, and for the others a
sign (one bit), the power of two below the size in unary with learned odds, and the rest of the size
plainly (`symbol_coder`): r(0) = -log2 P(0), r(s) = 1 - log2(1 - P(0)) + bits of the size s.

Errors cost what `Penalty` says; `PenaltyController` learns how much that must be.
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from organ_geometry.encoder.settings import Penalty
from organ_geometry.organ_file.coefficients import SIGNALS

# Largest size with a column of its own in a table of bits.
LARGEST_SIZE = 12


def first_bits() -> NDArray[np.float64]:
    """Return the (16, 13) bits of coefficients before any are known."""
    # A zero, and a sign with a size: fitted by eye to what the coder took on tubes; only the very
    # first choice of integers is made by them.
    sizes = np.arange(1.0, LARGEST_SIZE + 1)
    return np.tile(np.concatenate([[0.6], 3.0 + 1.6 * np.log2(sizes)]), (SIGNALS, 1))


def learned_bits(stored: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the (16, 13) bits of coefficients like those that are stored."""
    # The first key section has contexts of its own in the file: it says nothing of the others.
    sizes = np.abs(stored[1:])
    # Half a count more of each keeps the logarithms finite (Krichevsky and Trofimov).
    zeros = ((sizes == 0).sum(axis=0) + 0.5) / (len(sizes) + 1.0)
    bits = np.empty((SIGNALS, LARGEST_SIZE + 1))
    bits[:, 0] = -np.log2(zeros)
    bits[:, 1:] = 1.0 - np.log2(1.0 - zeros)[:, np.newaxis] + _size_bits(sizes)
    return bits


def first_axis_bits() -> NDArray[np.float64]:
    """Return the (13,) bits of an axis's bend before any are known."""
    # Bends are larger and less often zero than coefficients; by eye as well, and used for the first
    # choice of an axis only.
    sizes = np.arange(1.0, LARGEST_SIZE + 1)
    return np.concatenate([[0.7], 2.5 + 2.0 * np.log2(sizes)])


def _size_bits(sizes: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the (12,) bits of sizes from 1 on where others are as these."""
    # powers[e]: how many sizes reach 2^e; their ratios are the odds of the unary exponent.
    powers = np.array([(sizes >= 2**power).sum() for power in range(6)]) + 0.5
    # Bounded, because a few integers say nothing certain of the next.
    more = np.clip(powers[1:] / powers[:-1], 0.05, 0.9)
    bits = np.zeros(LARGEST_SIZE)
    for size in range(1, LARGEST_SIZE + 1):
        power = size.bit_length() - 1
        # The exponent's yeses and its no, then its plain digits.
        bits[size - 1] = power - np.log2(more[:power]).sum() - math.log2(1.0 - more[power])
    return bits


def total_bits(tables: NDArray[np.float64], integers: NDArray[np.int64]) -> float:
    """Return the rate of integers, each by its row of the tables."""
    sizes = np.abs(integers)
    bits = tables[np.arange(len(sizes)), np.minimum(sizes, LARGEST_SIZE)]
    return float((bits + 2.0 * np.log2(np.maximum(sizes / LARGEST_SIZE, 1.0))).sum())


def total_penalty(penalty: Penalty, errors: NDArray[np.float64]) -> float:
    """Return the bits that the mean squared errors D of sections cost."""
    over = np.maximum(errors - penalty.margin, 0.0)
    return float((penalty.slope * errors + penalty.wall * over * over).sum())


class PenaltyController:
    """Learns from encodings what errors must cost."""

    def __init__(self, penalty: Penalty, *, together: bool = False) -> None:
        # Where all sections together have a limit, the slope is sought, by bisection, at which it
        # is just kept: the least bits for a total error are at one price for all (Lagrange).
        self.penalty = penalty
        self._together = together
        # The slope sought lies between one that missed the limit and one that kept it.
        self._low = self._high = math.nan

    @property
    def settled(self) -> bool:
        """Whether the slope sought is known to 3 %, which is less than a byte."""
        return self._high < 1.03 * self._low

    def learn(self, worst: float, overall: float) -> None:
        """Learn from an encoding: its worst section's RMS in limits, and that of all in theirs."""
        penalty = self.penalty
        if worst > 1.0:
            margin = penalty.margin
            # A section just missed was missed by what linearisation leaves out: stay clear by that.
            # One missed by far says nothing of it.
            if worst < 1.1:
                margin = max(margin - (worst**2 - 1.0), 0.6)
            # Steeper walls than 5000 let no integer move any more.
            self.penalty = replace(penalty, wall=min(2.0 * penalty.wall, 5000.0), margin=margin)
        if not self._together:
            return
        slope = penalty.slope
        if overall > 1.0:
            self._low = slope
        else:
            self._high = slope
        if math.isnan(self._low) or math.isnan(self._high):
            # An error changes with about the eighth root of its price; a tenth more or less brings
            # the slope sought between two that were tried.
            off = min(max(overall, 1.0 / 1.25), 1.25)
            slope *= (1.1 if overall > 1.0 else 1.0 / 1.1) * off**8.0
        else:
            # Bisection in the logarithm, as prices differ by factors.
            slope = math.sqrt(self._low * self._high)
        self.penalty = replace(self.penalty, slope=slope)
