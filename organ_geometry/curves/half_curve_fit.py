"""Two polynomials y(u) of degree six through the two halves of a closed boundary.

    u_i   (x_i - middle) / half_width of point i
    w_i   |n_y| sqrt(l_i): the normal's y component, which makes a distance in y one along it to
          first order, and the root of the length of boundary l_i that the point stands for
    a     seven Chebyshev coefficients, minimising sum of w_i^2 (y_i - sum a_k T_k(u_i))^2

Solved by modified Gram-Schmidt (QR) on the columns w T_k(u), the right-hand side as an eighth one,
which is backward stable (A. Bjorck, Numerical Methods for Least Squares Problems, 1996, section
2.4); R a = Q'y by back substitution. Normal equations would square a condition number that is
large where points are few; where even R is nearly singular, the caller solves by singular values.
"""

import math

import numpy as np
from numpy.typing import NDArray

from kernel_cache import njit

COEFFICIENTS = 7

# Share of the width by which points of an upright end may differ in x: rounding.
_UPRIGHT = 1e-9
# Coefficients that the points of a half do not tell apart better than this stay small instead.
_CONDITION = 1e-10


@njit(cache=True, nogil=True)
def boundary_halves(
    boundary: NDArray[np.float64],
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Return the two halves of a boundary between its extreme x, and its points' weights."""
    total = len(boundary)
    weights = np.empty(total)
    for i in range(total):
        before, after = i - 1 if i > 0 else total - 1, i + 1 if i + 1 < total else 0
        ahead = math.hypot(boundary[after, 0] - boundary[i, 0], boundary[after, 1] - boundary[i, 1])
        back = math.hypot(
            boundary[i, 0] - boundary[before, 0], boundary[i, 1] - boundary[before, 1]
        )
        chord_x = boundary[after, 0] - boundary[before, 0]
        chord = math.hypot(chord_x, boundary[after, 1] - boundary[before, 1])
        # |n_y|, by the chord of both neighbours.
        along = abs(chord_x) / chord if chord > 0.0 else 0.0
        weights[i] = along * math.sqrt(0.5 * (ahead + back))
    left = right = 0
    for i in range(total):
        if boundary[i, 0] < boundary[left, 0]:
            left = i
        if boundary[i, 0] > boundary[right, 0]:
            right = i
    near = _UPRIGHT * (boundary[right, 0] - boundary[left, 0])
    ends = np.empty((2, 2), np.intp)
    # Points of an upright end belong to neither half, only its two ends do.
    for side in range(2):
        extreme = left if side == 0 else right
        first = last = extreme
        while abs(boundary[extreme, 0] - boundary[(first - 1) % total, 0]) <= near:
            first = (first - 1) % total
        while abs(boundary[extreme, 0] - boundary[(last + 1) % total, 0]) <= near:
            last = (last + 1) % total
        ends[side, 0], ends[side, 1] = first, last
    halves = np.empty((2, 2), np.intp)
    for half in range(2):
        start, stop = ends[half, 1], ends[1 - half, 0]
        halves[half, 0], halves[half, 1] = start, (stop - start) % total + 1
    return halves, weights


@njit(cache=True, nogil=True)
def fitted_half(
    boundary: NDArray[np.float64],
    weights: NDArray[np.float64],
    first: int,
    count: int,
    middle: float,
    half_width: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64], bool]:
    """Return the weighted least-squares polynomial through one half of a boundary."""
    system = np.empty((COEFFICIENTS + 1, count))
    for row in range(count):
        point = (first + row) % len(boundary)
        weight = weights[point]
        u = (boundary[point, 0] - middle) / half_width
        system[0, row] = weight
        system[1, row] = u * weight
        for order in range(2, COEFFICIENTS):
            system[order, row] = 2.0 * u * system[order - 1, row] - system[order - 2, row]
        system[COEFFICIENTS, row] = boundary[point, 1] * weight
    # Orthogonalisation destroys the columns: a copy for the caller's other solver.
    given = np.empty((count, COEFFICIENTS + 1))
    for row in range(count):
        for order in range(COEFFICIENTS + 1):
            given[row, order] = system[order, row]
    upper = np.zeros((COEFFICIENTS, COEFFICIENTS + 1))
    for order in range(COEFFICIENTS):
        size = 0.0
        for row in range(count):
            size += system[order, row] * system[order, row]
        upper[order, order] = math.sqrt(size)
        if size <= 0.0:
            break
        for later in range(order + 1, COEFFICIENTS + 1):
            product = 0.0
            for row in range(count):
                product += system[order, row] * system[later, row]
            upper[order, later] = product / upper[order, order]
            product /= size
            for row in range(count):
                system[later, row] -= product * system[order, row]
    # The diagonal of R spreads about as the singular values do.
    least = most = upper[0, 0]
    for order in range(COEFFICIENTS):
        least, most = min(least, upper[order, order]), max(most, upper[order, order])
    coefficients = np.zeros(COEFFICIENTS)
    if least <= _CONDITION * most:
        return coefficients, given, False
    for order in range(COEFFICIENTS - 1, -1, -1):
        rest = upper[order, COEFFICIENTS]
        for later in range(order + 1, COEFFICIENTS):
            rest -= upper[order, later] * coefficients[later]
        coefficients[order] = rest / upper[order, order]
    return coefficients, given, True
