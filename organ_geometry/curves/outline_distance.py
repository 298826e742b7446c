"""How far points are from an outline whose two halves have corners at the same places in x."""

import math

import numba
import numpy as np
from numpy.typing import NDArray

FURTHER = 1.0 + 1e-6
"""How much further away, squared, what is left out must be, for rounding."""


@numba.njit(cache=True, nogil=True)
def outline_distances(
    points: NDArray[np.float64], corners: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the distance of each point to an outline."""
    last = len(corners) - 1
    columns = len(corners) // 2 - 1
    right, left = corners[0, 0], corners[columns, 0]
    distances = np.empty(len(points))
    for i in range(len(points)):
        x, y = points[i, 0], points[i, 1]
        best = np.inf
        # From the point's column to both sides, until one is further away than what was found.
        start = nearest_column(x, right, left, columns)
        for way in range(-1, 2, 2):
            column = start if way > 0 else start - 1
            while 0 <= column < columns:
                off = way * (x - corners[column if way > 0 else column + 1, 0])
                if off > 0.0 and off * off > FURTHER * best:
                    break
                one = _squared_distance(corners, column, column + 1, x, y)
                other = _squared_distance(corners, last - column - 1, last - column, x, y)
                best = min(best, one, other)
                column += way
        if (x - right) ** 2 <= FURTHER * best:
            # Not `_squared_distance`: a constant corner would be one more compilation of it.
            x1, y1 = corners[last, 0], corners[last, 1]
            best = min(best, foot_on_side(x1, y1, corners[0, 0], corners[0, 1], x, y)[0])
        if (x - left) ** 2 <= FURTHER * best:
            best = min(best, _squared_distance(corners, columns, columns + 1, x, y))
        distances[i] = math.sqrt(best)
    return distances


@numba.njit(cache=True, nogil=True)
def nearest_column(x: float, right: float, left: float, columns: int) -> int:
    """Return the column of an outline in which a place lies, or about that."""
    width = right - left
    u = (2.0 * x - right - left) / width if width > 0.0 else 0.0
    column = int(math.acos(min(max(u, -1.0), 1.0)) / math.pi * columns)
    return min(max(column, 0), columns - 1)


@numba.njit(cache=True, nogil=True)
def _squared_distance(
    corners: NDArray[np.float64], first: int, second: int, x: float, y: float
) -> float:
    """Return the squared distance of a point to the side between two corners."""
    return foot_on_side(
        corners[first, 0], corners[first, 1], corners[second, 0], corners[second, 1], x, y
    )[0]


@numba.njit(cache=True, nogil=True)
def foot_on_side(
    x0: float, y0: float, x1: float, y1: float, x: float, y: float
) -> tuple[float, float]:
    """Return where a point's foot on a side is, the nearest place of the side to it."""
    sx, sy, tx, ty = x1 - x0, y1 - y0, x - x0, y - y0
    squared = sx * sx + sy * sy
    share = 0.0
    if squared > 0.0:
        share = min(max((tx * sx + ty * sy) / squared, 0.0), 1.0)
    tx -= share * sx
    ty -= share * sy
    return tx * tx + ty * ty, share
