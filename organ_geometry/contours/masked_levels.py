"""Medians and other quantiles of the levels that an image has within a mask."""

from typing import TypeAlias

import numba
import numpy as np
from numpy.typing import NDArray

Levels: TypeAlias = NDArray[np.float32]
Mask: TypeAlias = NDArray[np.uint8]

MANY_PIXELS = 2048
"""Of more pixels, every third, fifth ... is taken: the median of so many is within a thirtieth of
their noise of that of all."""


@numba.njit(cache=True, nogil=True)
def median_where(levels: Levels, mask: Mask) -> tuple[float, int]:
    """Return the median level in a mask, and of how many pixels it is.

    Parameters
    ----------
    levels
        (H, W) levels.
    mask
        (H, W) not 0 where they count.

    Returns
    -------
    tuple[float, int]
        Median, NaN of no pixel, and number of pixels in the mask.
    """
    values, count = _values_where(levels, mask)
    return (float(np.median(values)) if count else np.nan), count


@numba.njit(cache=True, nogil=True)
def level_exceeded(levels: Levels, mask: Mask, share: float) -> float:
    """Return the level that a share of a mask's pixels exceed.

    Parameters
    ----------
    levels
        (H, W) levels.
    mask
        (H, W) not 0 where they count, somewhere.
    share
        From 0, the highest level, to 1, the lowest.

    Returns
    -------
    float
        The level.
    """
    return float(np.quantile(_values_where(levels, mask)[0], 1.0 - share))


@numba.njit(cache=True, nogil=True)
def median_change(levels: Levels, others: Levels) -> float:
    """Return the median of how far the levels of two images are apart.

    Parameters
    ----------
    levels, others
        (H, W) levels.

    Returns
    -------
    float
        The median, of enough of the pixels.
    """
    rows, columns = levels.shape
    step = _stride(rows * columns)
    values = np.empty((rows * columns + step - 1) // step, dtype=np.float32)
    for place in range(len(values)):
        row, column = divmod(place * step, columns)
        values[place] = abs(levels[row, column] - others[row, column])
    return float(np.median(values))


@numba.njit(cache=True, nogil=True)
def border_median(levels: Levels) -> float:
    """Return the median level of an image's outermost pixels, those in its corners twice.

    Parameters
    ----------
    levels
        (H, W) levels.

    Returns
    -------
    float
        The median.
    """
    rows, columns = levels.shape
    border = np.empty(2 * (rows + columns), dtype=np.float32)
    border[:columns], border[columns : 2 * columns] = levels[0], levels[-1]
    border[2 * columns : 2 * columns + rows] = levels[:, 0]
    border[2 * columns + rows :] = levels[:, -1]
    return float(np.median(border))


@numba.njit(cache=True, nogil=True)
def _stride(count: int) -> int:
    # An odd step meets both fields of a chequered pattern.
    return 1 + 2 * (count // (2 * MANY_PIXELS))


@numba.njit(cache=True, nogil=True)
def _values_where(levels: Levels, mask: Mask) -> tuple[Levels, int]:
    """Return levels (N,) in a mask, thinned out where there are many, and how many there are."""
    rows, columns = mask.shape
    count = 0
    for row in range(rows):
        here = 0
        for column in range(columns):
            here += mask[row, column] != 0
        count += here
    step = _stride(count)
    values = np.empty((count + step - 1) // step, dtype=np.float32)
    place = left = 0
    for row in range(rows):
        for column in range(columns):
            if mask[row, column]:
                if left == 0:
                    values[place] = levels[row, column]
                    place += 1
                    left = step
                left -= 1
    return values, count
