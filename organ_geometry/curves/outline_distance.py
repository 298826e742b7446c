"""Distances of points to outlines, and the feet of the perpendiculars.

An outline is a closed polygon of 2 H corners as `half_curves.closed_outlines` makes it: its two
halves have corners at the same x, the places u_c = cos(pi c / (H - 1)), so that corner c of the
one lies above corner 2 H - 1 - c of the other. A point's nearest side is searched from its own
column in both directions, until a column is further away in x alone than the nearest side found:
a few columns in place of all of them. The foot is the nearest place of a side.
"""

import math

import numpy as np
from numpy.typing import NDArray

from kernel_cache import njit

# Factor by which a squared distance must exceed the best before its column is left out.
_FURTHER = 1.0 + 1e-6


def outline_distances(
    points: NDArray[np.float64], corners: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the (N,) distances of (N, 2) points to one outline (2 H, 2)."""
    count = len(points)
    squared, _, _ = outline_feet(
        np.zeros(count, dtype=np.intp), np.zeros(count), points, corners[np.newaxis]
    )
    return np.sqrt(squared)


@njit(cache=True, nogil=True)
def outline_feet(
    pieces: NDArray[np.intp],
    fractions: NDArray[np.float64],
    points: NDArray[np.float64],
    outlines: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.intp], NDArray[np.float64]]:
    """Return where points' feet are on outlines, each between two of (S, 2 H, 2)."""
    # Point i belongs to the outline that lies the share shares[i] of the way from outline pieces[i]
    # to the next. Returned are squared distances, the corners at which the feet's sides end, and
    # the feet's shares of the way along them.
    last = outlines.shape[1] - 1
    columns = outlines.shape[1] // 2 - 1
    squared = np.empty(len(pieces))
    ends = np.empty(len(pieces), np.intp)
    positions = np.empty(len(pieces))
    for i in range(len(pieces)):
        k, fraction, x, y = pieces[i], fractions[i], points[i, 0], points[i, 1]
        after = min(k + 1, len(outlines) - 1)
        right = _between(outlines, k, after, fraction, 0, 0)
        left = _between(outlines, k, after, fraction, columns, 0)
        best, end, position = np.inf, 0, 0.0
        # The column in which the point lies, or about that: u = cos(pi column / columns).
        width = right - left
        u = (2.0 * x - right - left) / width if width > 0.0 else 0.0
        start = int(math.acos(min(max(u, -1.0), 1.0)) / math.pi * columns)
        start = min(max(start, 0), columns - 1)
        # To both ways from there, the bottom and the top side of each column; then the two upright
        # sides that close the outline at its right and left end.
        for direction in range(-1, 2, 2):
            column = start if direction > 0 else start - 1
            while 0 <= column < columns:
                near = column if direction > 0 else column + 1
                off = direction * (x - _between(outlines, k, after, fraction, near, 0))
                if off > 0.0 and off * off > _FURTHER * best:
                    break
                for half in range(2):
                    corner = column + 1 if half == 0 else last - column
                    away, along = _foot(outlines, k, after, fraction, corner, x, y)
                    if away < best:
                        best, end, position = away, corner, along
                column += direction
        for half in range(2):
            corner = 0 if half == 0 else columns + 1
            off = x - (right if half == 0 else left)
            if off * off <= _FURTHER * best:
                away, along = _foot(outlines, k, after, fraction, corner, x, y)
                if away < best:
                    best, end, position = away, corner, along
        squared[i], ends[i], positions[i] = best, end, position
    return squared, ends, positions


def polygon_distances(
    points: NDArray[np.float64], corners: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the distance of each point to any closed polygon."""
    squared, _ = polygon_sides(
        np.ascontiguousarray(points, dtype=np.float64),
        np.ascontiguousarray(corners, dtype=np.float64),
    )
    return np.sqrt(squared)


@njit(cache=True, nogil=True)
def polygon_sides(
    points: NDArray[np.float64], corners: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return squared distances of points to any closed polygon, and which points lie inside it."""
    # Plain loops: slices and array expressions take seconds to compile.
    count, last = len(points), len(corners) - 1
    squared, inside = np.empty(count), np.empty(count, np.bool_)
    for i in range(count):
        squared[i] = np.inf
        inside[i] = False
    x0, y0 = corners[last, 0], corners[last, 1]
    for c in range(len(corners)):
        x1, y1 = corners[c, 0], corners[c, 1]
        for i in range(count):
            x, y = points[i, 0], points[i, 1]
            squared[i] = min(squared[i], foot_on_side(x0, y0, x1, y1, x, y)[0])
            # A point is inside if a ray to its right crosses an odd number of sides.
            if (y0 > y) != (y1 > y) and x < x0 + (y - y0) / (y1 - y0) * (x1 - x0):
                inside[i] = not inside[i]
        x0, y0 = x1, y1
    return squared, inside


@njit(cache=True, nogil=True)
def _between(
    outlines: NDArray[np.float64], k: int, after: int, fraction: float, corner: int, axis: int
) -> float:
    """Return a coordinate of a corner of the outline between two."""
    return outlines[k, corner, axis] * (1.0 - fraction) + outlines[after, corner, axis] * fraction


@njit(cache=True, nogil=True)
def _foot(
    outlines: NDArray[np.float64],
    k: int,
    after: int,
    fraction: float,
    corner: int,
    x: float,
    y: float,
) -> tuple[float, float]:
    """Return a point's foot on the side that ends at a corner of the outline between two."""
    before = corner - 1 if corner > 0 else outlines.shape[1] - 1
    return foot_on_side(
        _between(outlines, k, after, fraction, before, 0),
        _between(outlines, k, after, fraction, before, 1),
        _between(outlines, k, after, fraction, corner, 0),
        _between(outlines, k, after, fraction, corner, 1),
        x,
        y,
    )


@njit(cache=True, nogil=True)
def foot_on_side(
    x0: float, y0: float, x1: float, y1: float, x: float, y: float
) -> tuple[float, float]:
    """Return a point's squared distance to a side, and its foot's share of the way along it."""
    sx, sy, tx, ty = x1 - x0, y1 - y0, x - x0, y - y0
    squared = sx * sx + sy * sy
    fraction = 0.0
    if squared > 0.0:
        fraction = min(max((tx * sx + ty * sy) / squared, 0.0), 1.0)
    tx -= fraction * sx
    ty -= fraction * sy
    return tx * tx + ty * ty, fraction
