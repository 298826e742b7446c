"""What the sections at the Gauss points contribute: their strains, and psi's derivatives."""

import math

from kernel_cache import njit
from physics.exact.fibre_laws import fill_fibres, fill_of_fibres, fill_strains
from physics.exact.linear_law import fill_linear
from physics.exact.state import KERNEL, Array, State
from physics.exact.symbols import *


@njit(**KERNEL)
def fill_sines(points: Array) -> None:
    """Fill the sines and cosines: Cody and Waite's reduction, Taylor-like minimax polynomials.

    Without branches and calls, so that the compiler makes it eight at a time.
    """
    for i in range(points.shape[1]):
        x = points[ANGLE, i]
        k = math.floor(x * 0.6366197723675814 + 0.5)
        y = (x - k * 1.5707963267341256) - k * 6.077100506506192e-11
        z = y * y
        s = 1.5896909952115501e-10 * z - 2.5050760253406863e-08
        s = (s * z + 2.7557313707070068e-06) * z - 1.984126982985795e-04
        s = (s * z + 8.33333333332249e-03) * z - 1.6666666666666632e-01
        s = s * z * y + y
        c = 2.0875723212981748e-09 - 1.1359647557788195e-11 * z
        c = (c * z - 2.7557314351390663e-07) * z + 2.480158728947673e-05
        c = (c * z - 1.388888888887411e-03) * z + 4.1666666666666602e-02
        c = c * z * z - 0.5 * z + 1.0
        halves = 0.5 * k
        odd = halves - math.floor(halves) > 0.25
        quarter = 0.5 * halves - math.floor(0.5 * halves)
        a = c if odd else s
        b = s if odd else c
        points[SIN, i] = -a if quarter > 0.375 else a
        points[COS, i] = -b if (quarter > 0.125 and quarter < 0.625) else b


@njit(**KERNEL)
def add_offsets(points: Array, first: int, last: int, h: float, p: float) -> None:
    """Add the term - e n kappa of psi, for centroids off the axis."""
    for i in range(first, last):
        offset = points[OFFSET, i]
        sin, cos = points[SIN, i], points[COS, i]
        n, q = h * cos + p * sin, p * cos - h * sin
        stretch = offset * points[KAPPA, i]
        along, across = stretch * cos, stretch * sin
        points[MOMENT, i] -= offset * n
        points[T, i] -= stretch * q
        points[X, i] += along
        points[Y, i] += across
        points[TT, i] += stretch * n
        points[TH, i] += across
        points[TP, i] -= along
        points[KT, i] -= offset * q
        points[KH, i] -= offset * cos
        points[KP, i] -= offset * sin


@njit(**KERNEL)
def fill_points(state: State, fibres: Array | None, grasp: int, rounds: int) -> None:
    """Fill `points` for the present rotations and forces."""
    nodes, elements, points, line, _, _ = state
    for e in range(elements.shape[1]):
        bubble = elements[BUBBLE, e]
        over = 1.0 / elements[LENGTH, e]
        left, right = nodes[ROTATION, e], nodes[ROTATION, e + 1]
        mean, turn = 0.5 * (left + right) + BULGE * bubble, right - left
        points[ANGLE, 2 * e], points[ANGLE, 2 * e + 1] = mean - GAUSS * turn, mean + GAUSS * turn
        points[KAPPA, 2 * e] = (turn + SLOPE * bubble) * over
        points[KAPPA, 2 * e + 1] = (turn - SLOPE * bubble) * over
    fill_sines(points)
    count = points.shape[1]
    h, shrink, poisson = line[H], line[SHRINK], line[POISSON]
    eccentric = line[ECCENTRIC] != 0.0
    if fibres is None:
        if eccentric:
            for i in range(count):
                points[KT, i] = points[KH, i] = points[KP, i] = 0.0
    else:
        last = int(0)
        for piece in range(3):
            first, last = last, _end(line, grasp, count, piece)
            fill_strains(points, fibres, first, last, h, line[P1 + piece], shrink, poisson)
        fill_fibres(fibres, line[SHEAR_MODULUS], line[RATIO], line[STIFFENING], rounds)
    last = int(0)
    for piece in range(3):
        first, last = last, _end(line, grasp, count, piece)
        p = line[P1 + piece]
        if fibres is None:
            fill_linear(points, first, last, h, p)
        else:
            fill_of_fibres(points, fibres, first, last, h, p, shrink, poisson, line[STIFFENING])
        if eccentric:
            add_offsets(points, first, last, h, p)


@njit(**KERNEL, inline="always")
def _end(line: Array, grasp: int, count: int, piece: int) -> int:
    """Return the first point behind a piece of the beam."""
    if piece == 0:
        return 2 * grasp
    return 2 * int(line[SECOND]) if piece == 1 else count
