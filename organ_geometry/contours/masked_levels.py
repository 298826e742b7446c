"""Medians and other quantiles of the levels that an image has within a mask."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Levels: TypeAlias = NDArray[np.float32]
Mask: TypeAlias = NDArray[np.uint8]

MANY_PIXELS = 2048
"""Of more pixels, every third, fifth ... is taken: the median of so many is within a thirtieth of
their noise of that of all."""


def median_where(levels: Levels, mask: Mask) -> tuple[float, int]:
    """Return the median level in a mask, NaN of no pixel, and the number of pixels in the mask."""
    values, count = _values_where(levels, mask)
    return (float(np.median(values)) if count else np.nan), count


def level_exceeded(levels: Levels, mask: Mask, fraction: float) -> float:
    """Return the level that a share of a mask's pixels exceed."""
    return float(np.quantile(_values_where(levels, mask)[0], 1.0 - fraction))


def median_change(levels: Levels, others: Levels) -> float:
    """Return the median difference, not signed, of two images' (H, W) levels."""
    step = _stride(levels.size)
    return float(np.median(np.abs(levels.ravel()[::step] - others.ravel()[::step])))


def border_median(levels: Levels) -> float:
    """Return the median of the outermost pixels of (H, W) levels, those in corners twice."""
    border = np.concatenate([levels[0], levels[-1], levels[:, 0], levels[:, -1]])
    return float(np.median(border))


def _stride(count: int) -> int:
    # An odd step meets both fields of a chequered pattern.
    return 1 + 2 * (count // (2 * MANY_PIXELS))


def _values_where(levels: Levels, mask: Mask) -> tuple[Levels, int]:
    """Return levels (N,) in a mask, thinned out where there are many, and how many there are."""
    inside = np.flatnonzero(mask != 0)
    return levels.ravel()[inside[:: _stride(len(inside))]], len(inside)
