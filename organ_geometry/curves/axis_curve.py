"""The axis as a curve: natural cubic splines over even keys, arc length, and frames along it.

Between keys i and i + 1, at right = t and left = 1 - t, the spline through values k with second
derivatives b is  left k_i + right k_(i+1) + ((left^3 - left) b_i + (right^3 - right) b_(i+1)) / 6,
and b solves  b_(i-1) + 4 b_i + b_(i+1) = 6 (k_(i-1) - 2 k_i + k_(i+1)),  0 at both ends. All of it
is linear in k, so that functions here return weights of the keys.
"""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from kernel_cache import njit
from organ_geometry.curves.ordered_product import ordered_product

_TINY = float(np.finfo(np.float64).tiny)


def natural_cubic(places: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return (N, K) weights of K even keys in the natural cubic spline, at places 0 to 1."""
    bends, unit = _bends(count), np.eye(count)
    before, left, right = _pieces(places, count)
    return (
        left * unit[before]
        + right * unit[before + 1]
        + (left * left * left - left) / 6.0 * bends[before]
        + (right * right * right - right) / 6.0 * bends[before + 1]
    )


def natural_cubic_slopes(places: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return (N, K) weights of K even keys in the natural cubic spline's slopes, at 0 to 1."""
    bends, unit = _bends(count), np.eye(count)
    before, left, right = _pieces(places, count)
    return (count - 1) * (
        unit[before + 1]
        - unit[before]
        - (3.0 * left**2 - 1.0) / 6.0 * bends[before]
        + (3.0 * right**2 - 1.0) / 6.0 * bends[before + 1]
    )


def _pieces(
    places: NDArray[np.float64], count: int
) -> tuple[NDArray[np.intp], NDArray[np.float64], NDArray[np.float64]]:
    """Return the key before each place, and the (N, 1) shares `left` and `right` between keys."""
    scaled = np.asarray(places, dtype=np.float64) * (count - 1)
    before = np.clip(scaled.astype(np.intp), 0, count - 2)
    right = (scaled - before)[:, np.newaxis]
    return before, 1.0 - right, right


@lru_cache(maxsize=16)
def _bends(count: int) -> NDArray[np.float64]:
    """Return (K, K) weights of the keys in the second derivatives at the keys."""
    bends = np.zeros((count, count))
    inner = count - 2
    if inner > 0:
        second = np.eye(inner, count) - 2.0 * np.eye(inner, count, k=1) + np.eye(inner, count, k=2)
        bends[1:-1] = 6.0 * _solved(second)
    bends.setflags(write=False)
    return bends


def _solved(right: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the solution of the system whose rows are 1, 4, 1 about the diagonal."""
    # Not LAPACK's, whose last digits differ between processors.
    solution, pivots = right.copy(), np.full(len(right), 4.0)
    for i in range(1, len(right)):
        pivots[i] -= 1.0 / pivots[i - 1]
        solution[i] -= solution[i - 1] / pivots[i - 1]
    solution[-1] /= pivots[-1]
    for i in range(len(right) - 2, -1, -1):
        solution[i] = (solution[i] - solution[i + 1]) / pivots[i]
    return solution


@lru_cache(maxsize=16)
def refinement(depth: int) -> NDArray[np.float64]:
    """Return the (K, K) matrix that makes the keys of an axis of its stored bends."""
    # Keys half way between those of all coarser levels are predicted by the natural cubic spline
    # through these; a bend is the difference.
    values = np.eye(2)
    for level in range(1, depth + 1):
        count = 2**level + 1
        finer = np.zeros((count, count))
        coarse = np.zeros((len(values), count))
        coarse[:, ::2] = values
        middles = np.arange(1, count, 2, dtype=np.intp)
        finer[::2] = coarse
        finer[middles] = ordered_product(natural_cubic(middles / (count - 1), len(values)), coarse)
        finer[middles, middles] += 1.0
        values = finer
    values.setflags(write=False)
    return values


def key_depth(count: int) -> int:
    """Return the levels of so many keys, 2^levels + 1, the ends not counted."""
    return (count - 1).bit_length() - 1


def key_levels(depth: int) -> NDArray[np.intp]:
    """Return the level of each of 2^depth + 1 keys: 0 at the ends, then by halving."""
    levels = np.zeros(2**depth + 1, dtype=np.intp)
    for level in range(1, depth + 1):
        levels[2 ** (depth - level) :: 2 ** (depth - level + 1)] = level
    levels[[0, -1]] = 0
    return levels


def even_axis(
    keys: NDArray[np.float64], intervals: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return (N + 1, 3) points at equal arc length along an axis, and unit tangents."""
    wanted = even_places(keys, intervals)
    points = ordered_product(natural_cubic(wanted, len(keys)), keys)
    tangents = ordered_product(natural_cubic_slopes(wanted, len(keys)), keys)
    sizes = np.sqrt((tangents * tangents).sum(axis=1, keepdims=True))
    return points, tangents / np.maximum(sizes, np.finfo(np.float64).tiny)


def even_places(keys: NDArray[np.float64], intervals: int) -> NDArray[np.float64]:
    """Return (N + 1,) places, 0 to 1, at equal arc length along an axis of (K, 3) keys."""
    places = np.linspace(0.0, 1.0, 4 * intervals + 1)
    fine = ordered_product(natural_cubic(places, len(keys)), keys)
    steps = np.diff(fine, axis=0)
    lengths = np.zeros(len(fine))
    np.cumsum(np.sqrt((steps * steps).sum(axis=1)), out=lengths[1:])
    even = np.linspace(0.0, float(lengths[-1]), intervals + 1)
    return np.asarray(np.interp(even, lengths, places), dtype=np.float64)


def least_turning(
    points: NDArray[np.float64], tangents: NDArray[np.float64], start: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return (N, 3) unit directions across a curve that turn about it as little as possible."""
    # Double reflection [Wang 2008]: W. Wang, B. Juettler, D. Zheng, Y. Liu, Computation of rotation
    # minimizing frames, ACM Transactions on Graphics 27, 2:1-2:18, table I.
    return _least_turning(
        np.ascontiguousarray(points), np.ascontiguousarray(tangents), np.ascontiguousarray(start)
    )


# Scalar loops: whole-array expressions take numba ten times as long to compile.
@njit(cache=True)
def _least_turning(
    points: NDArray[np.float64], tangents: NDArray[np.float64], start: NDArray[np.float64]
) -> NDArray[np.float64]:
    across = np.empty((len(points), 3))
    step, along, turn = np.empty(3), np.empty(3), np.empty(3)
    for c in range(3):
        across[0, c] = start[c]
    _make_perpendicular(across[0], tangents[0])
    for place in range(len(points) - 1):
        now, tangent = across[place + 1], tangents[place + 1]
        for c in range(3):
            step[c] = points[place + 1, c] - points[place, c]
            now[c], along[c] = across[place, c], tangents[place, c]
        # In the plane half way between both points, then in the one between both tangents.
        if step[0] * step[0] + step[1] * step[1] + step[2] * step[2] > 0.0:
            _reflect(now, step)
            _reflect(along, step)
            for c in range(3):
                turn[c] = tangent[c] - along[c]
            if turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2] > 0.0:
                _reflect(now, turn)
        _make_perpendicular(now, tangent)
    return across


@njit(cache=True)
def _reflect(vector: NDArray[np.float64], normal: NDArray[np.float64]) -> None:
    """Reflect a vector in the plane with a normal of any length, in place."""
    squared = normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]
    height = normal[0] * vector[0] + normal[1] * vector[1] + normal[2] * vector[2]
    twice = 2.0 / squared * height
    for c in range(3):
        vector[c] -= twice * normal[c]


@njit(cache=True)
def _make_perpendicular(vector: NDArray[np.float64], tangent: NDArray[np.float64]) -> None:
    """Make a vector a unit vector across a unit tangent, in place."""
    along = vector[0] * tangent[0] + vector[1] * tangent[1] + vector[2] * tangent[2]
    for c in range(3):
        vector[c] -= along * tangent[c]
    squared = vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2]
    size = max(math.sqrt(squared), _TINY)
    for c in range(3):
        vector[c] /= size
