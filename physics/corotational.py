"""Kernels of a chain of corotational beam elements: its forces, their tangent and its equilibrium.

A node has three freedoms: displacement along the line between the clamps, displacement along the
pull, and rotation. Node 0 is clamped, and of the last node the freedoms in `LAST_OF_SPAN` or
`LAST_OF_HALF` are. Arrays over nodes are (N, 3) with N = elements + 1; for each node the tangent
holds the three 3 x 3 blocks by which its forces depend on the node before, itself and the node
after: (N, 3, 3, 3).

Symbols. E A and E I axial and bending stiffness (`ea`, `ei`); L0 (`rest`) and l lengths of an
element at rest and of its chord, from node to node; beta angle of the chord; t1 and t2 rotations of
its nodes relative to the chord, theta - beta; N tension, V shear, M1 and M2 moments at the ends:

    N = E A (l - L0) / L0,  M1 = E I / L0 (4 t1 + 2 t2),  M2 = E I / L0 (2 t1 + 4 t2)

and, as ANSYS's beam has it, V = (M1 + M2) / L0. That shear is the linear element's; what balances
the moments of a stretched chord, and what the derivative of the energy

    U = E A (l - L0)^2 / (2 L0) + 2 E I (t1^2 + t1 t2 + t2^2) / L0

gives, is (M1 + M2) / l (`energetic`).

Method. Newton's method with the consistent tangent, solved by block Gauss elimination with row
pivoting in each block: the tangent of the first law is not symmetric. A load is reached from rest
by increments that double after each success and halve after each failure.
"""

import math

import numpy as np
from numpy.typing import NDArray

from kernel_cache import njit

LAST_OF_SPAN = np.array([True, True, True])
"""The last node is in the second clamp."""
LAST_OF_HALF = np.array([True, False, True])
"""The last node is in the plane of symmetry, free along the pull only."""

# Newton iterations in which an increment must converge; what needs more is halved instead.
ITERATIONS = 12
# Part of the load so far below which the search for the next equilibrium is given up.
SMALLEST_INCREMENT = 1e-4
# The same from rest, as a part of the goal: the thinnest beams soon carry a load as strings.
SMALLEST_START = 1e-12
# Newton step, relative to the largest displacement, after which one more, of the order of its
# square, is exact to rounding.
CONVERGED = 1e-9


@njit(cache=True, nogil=True)
def element_state(
    rest: NDArray[np.float64], moved: NDArray[np.float64], ea: float, ei: float, energetic: bool
) -> NDArray[np.float64]:
    """Return l, beta, t1, t2, N, V and the energy of each element, (elements, 7)."""
    count = rest.shape[0]
    state = np.empty((count, 7))
    for e in range(count):
        du = moved[e + 1, 0] - moved[e, 0]
        dv = moved[e + 1, 1] - moved[e, 1]
        along = rest[e] + du
        length = math.sqrt(along * along + dv * dv)
        # l - L0 without the cancellation that it has as written.
        stretch = (2.0 * rest[e] * du + du * du + dv * dv) / (length + rest[e])
        chord = math.atan2(dv, along)
        t1 = moved[e, 2] - chord
        t2 = moved[e + 1, 2] - chord
        shear_length = length if energetic else rest[e]
        state[e, 0] = length
        state[e, 1] = chord
        state[e, 2] = t1
        state[e, 3] = t2
        state[e, 4] = ea * stretch / rest[e]
        state[e, 5] = 6.0 * ei / rest[e] * (t1 + t2) / shear_length
        state[e, 6] = (
            0.5 * ea * stretch * stretch + 2.0 * ei * (t1 * t1 + t1 * t2 + t2 * t2)
        ) / rest[e]
    return state


@njit(cache=True, nogil=True)
def _balance(
    rest: NDArray[np.float64],
    moved: NDArray[np.float64],
    ea: float,
    ei: float,
    energetic: bool,
    state: NDArray[np.float64],
    carried: NDArray[np.float64],
    forces: NDArray[np.float64],
    tangent: NDArray[np.float64],
) -> None:
    """Fill the forces (N, 3) that hold the nodes where they are and the tangent (N, 3, 3, 3)."""
    # The tangent's geometric part takes tension and shear from `carried` (elements, 2), see
    # `_newton`. `row` is the element's tangent: the derivatives of its six nodal forces by its six
    # freedoms.
    forces[:] = 0.0
    tangent[:] = 0.0
    # Derivatives of chord length, chord angle and the two local rotations by the six freedoms.
    d_length = np.zeros(6)
    d_chord = np.zeros(6)
    row = np.empty((6, 6))
    for e in range(rest.shape[0]):
        length, chord, t1, t2, tension, shear = state[e, :6]
        c = math.cos(chord)
        s = math.sin(chord)
        k = ei / rest[e]
        m1 = k * (4.0 * t1 + 2.0 * t2)
        m2 = k * (2.0 * t1 + 4.0 * t2)
        fx = tension * c + shear * s
        fy = tension * s - shear * c
        forces[e, 0] -= fx
        forces[e, 1] -= fy
        forces[e, 2] += m1
        forces[e + 1, 0] += fx
        forces[e + 1, 1] += fy
        forces[e + 1, 2] += m2
        turned_x = carried[e, 0] * c + carried[e, 1] * s
        turned_y = carried[e, 0] * s - carried[e, 1] * c
        d_length[0], d_length[1], d_length[3], d_length[4] = -c, -s, c, s
        turn = 1.0 / length
        d_chord[0], d_chord[1], d_chord[3], d_chord[4] = s * turn, -c * turn, -s * turn, c * turn
        shear_length = length if energetic else rest[e]
        for j in range(6):
            d1 = (1.0 if j == 2 else 0.0) - d_chord[j]
            d2 = (1.0 if j == 5 else 0.0) - d_chord[j]
            d_tension = ea / rest[e] * d_length[j]
            d_shear = 6.0 * k * (d1 + d2) / shear_length
            if energetic:
                d_shear -= carried[e, 1] / length * d_length[j]
            row[3, j] = d_tension * c + d_shear * s - turned_y * d_chord[j]
            row[4, j] = d_tension * s - d_shear * c + turned_x * d_chord[j]
            row[0, j] = -row[3, j]
            row[1, j] = -row[4, j]
            row[2, j] = k * (4.0 * d1 + 2.0 * d2)
            row[5, j] = k * (2.0 * d1 + 4.0 * d2)
        for i in range(3):
            for j in range(3):
                tangent[e, 1, i, j] += row[i, j]
                tangent[e, 2, i, j] += row[i, j + 3]
                tangent[e + 1, 0, i, j] += row[i + 3, j]
                tangent[e + 1, 1, i, j] += row[i + 3, j + 3]


@njit(cache=True, nogil=True)
def _copy(to: NDArray[np.float64], of: NDArray[np.float64]) -> None:
    """Copy a table. Numba compiles loops far sooner than an assignment of arrays."""
    for row in range(of.shape[0]):
        for column in range(of.shape[1]):
            to[row, column] = of[row, column]


@njit(cache=True, nogil=True)
def _hold(
    tangent: NDArray[np.float64],
    right: NDArray[np.float64],
    node: int,
    freedom: int,
    change: float,
) -> None:
    """Replace one equation by a given change of its freedom."""
    tangent[node, :, freedom, :] = 0.0
    tangent[node, 1, freedom, freedom] = 1.0
    right[node, freedom] = change


@njit(cache=True, nogil=True)
def _eliminate(tangent: NDArray[np.float64], right: NDArray[np.float64]) -> bool:
    """Replace the right side by the solution of the tangent's equations; False if singular."""
    # The blocks after the diagonal are overwritten by the diagonal's inverse times them.
    count = right.shape[0]
    block = np.empty((3, 7))
    for n in range(count):
        for i in range(3):
            for j in range(3):
                block[i, j] = tangent[n, 1, i, j]
                block[i, j + 3] = tangent[n, 2, i, j]
            block[i, 6] = right[n, i]
            if n > 0:
                for m in range(3):
                    factor = tangent[n, 0, i, m]
                    for j in range(3):
                        block[i, j] -= factor * tangent[n - 1, 2, m, j]
                    block[i, 6] -= factor * right[n - 1, m]
        for p in range(3):
            best = p
            for i in range(p + 1, 3):
                if abs(block[i, p]) > abs(block[best, p]):
                    best = i
            pivot = block[best, p]
            if pivot == 0.0 or not math.isfinite(pivot):
                return False
            for j in range(p, 7):
                upper = block[best, j]
                block[best, j] = block[p, j]
                block[p, j] = upper / pivot
            for i in range(3):
                if i != p:
                    factor = block[i, p]
                    for j in range(p, 7):
                        block[i, j] -= factor * block[p, j]
        for i in range(3):
            for j in range(3):
                tangent[n, 2, i, j] = block[i, j + 3]
            right[n, i] = block[i, 6]
    for n in range(count - 2, -1, -1):
        for i in range(3):
            for j in range(3):
                right[n, i] -= tangent[n, 2, i, j] * right[n + 1, j]
    return True


@njit(cache=True, nogil=True)
def _carry(
    rest: NDArray[np.float64],
    ea: float,
    ei: float,
    energetic: bool,
    state: NDArray[np.float64],
    change: NDArray[np.float64],
    carried: NDArray[np.float64],
) -> None:
    """Fill the tension and shear (elements, 2) after a linear change of the nodes (N, 3)."""
    for e in range(rest.shape[0]):
        c = math.cos(state[e, 1])
        s = math.sin(state[e, 1])
        length = state[e, 0]
        du = change[e + 1, 0] - change[e, 0]
        dv = change[e + 1, 1] - change[e, 1]
        d_length = c * du + s * dv
        d_chord = (c * dv - s * du) / length
        d_turns = change[e, 2] + change[e + 1, 2] - 2.0 * d_chord
        shear_length = length if energetic else rest[e]
        d_shear = 6.0 * ei / rest[e] * d_turns / shear_length
        if energetic:
            d_shear -= carried[e, 1] / length * d_length
        carried[e, 0] = state[e, 4] + ea / rest[e] * d_length
        carried[e, 1] = state[e, 5] + d_shear


@njit(cache=True, nogil=True)
def _newton(
    rest: NDArray[np.float64],
    moved: NDArray[np.float64],
    ea: float,
    ei: float,
    energetic: bool,
    held: NDArray[np.bool_],
    grasp: int,
    load: float,
    by_force: bool,
    forces: NDArray[np.float64],
    tangent: NDArray[np.float64],
) -> bool:
    """Move the nodes to equilibrium, the grasp by force or by deflection; False if not found."""
    # Newton's method on displacements and element forces together. A step that only bends also
    # stretches the elements, to second order; the geometric stiffness of this spurious tension
    # spoils the next step. It takes the tension that the last step predicted linearly instead
    # (`_carry`); the residual is the true one, and at the solution the two agree.
    last = rest.shape[0]
    right = np.empty_like(moved)
    span = 0.0
    for length in rest:
        span += length
    done = False
    carried = np.empty((last, 2))
    for iteration in range(ITERATIONS):
        state = element_state(rest, moved, ea, ei, energetic)
        if iteration == 0:
            _copy(carried, state[:, 4:6])
        _balance(rest, moved, ea, ei, energetic, state, carried, forces, tangent)
        for n in range(last + 1):
            for freedom in range(3):
                right[n, freedom] = -forces[n, freedom]
        if by_force:
            right[grasp, 1] += load
        for freedom in range(3):
            _hold(tangent, right, int(0), freedom, 0.0)
            if held[freedom]:
                _hold(tangent, right, last, freedom, 0.0)
        if not by_force:
            _hold(tangent, right, grasp, int(1), load - moved[grasp, 1])
        if not _eliminate(tangent, right):
            return False
        _carry(rest, ea, ei, energetic, state, right, carried)
        step = 0.0
        size = 0.0
        for n in range(last + 1):
            for freedom in range(3):
                # A rotation counts by how far it would swing a tenth of the span.
                weight = 0.1 * span if freedom == 2 else 1.0
                step = max(step, weight * abs(right[n, freedom]))
                moved[n, freedom] += right[n, freedom]
                size = max(size, weight * abs(moved[n, freedom]))
        if not math.isfinite(step) or (iteration > 0 and step > span):
            return False
        if done:
            return True
        done = step <= CONVERGED * size
    return False


@njit(cache=True, nogil=True)
def pull_from_rest(
    rest: NDArray[np.float64],
    ea: float,
    ei: float,
    energetic: bool,
    held: NDArray[np.bool_],
    grasp: int,
    goal: float,
    by_force: bool,
    moved: NDArray[np.float64],
) -> float:
    """Return the force, N, that pulls the grasp from rest to a goal; NaN if none was found."""
    # `rest` (elements,) mm, `ea` N, `ei` N mm^2; `held` are the last node's freedoms that are
    # held, `grasp` the node that is pulled, `goal` a force, N, or a deflection, mm. `moved` (N, 3)
    # receives displacements, mm, and rotations, rad.
    forces = np.empty_like(moved)
    tangent = np.empty((moved.shape[0], 3, 3, 3))
    now = np.zeros_like(moved)
    at = 0.0
    increment = 1.0
    moved[:] = 0.0
    while at < 1.0 and goal != 0.0:
        reach = min(at + increment, 1.0)
        _copy(moved, now)
        if _newton(
            rest, moved, ea, ei, energetic, held, grasp, reach * goal, by_force, forces, tangent
        ):
            _copy(now, moved)
            at = reach
            increment *= 2.0
        else:
            increment *= 0.5
            if increment < max(SMALLEST_INCREMENT * at, SMALLEST_START):
                return math.nan
    if by_force:
        return goal
    state = element_state(rest, moved, ea, ei, energetic)
    carried = np.empty((rest.shape[0], 2))
    _copy(carried, state[:, 4:6])
    _balance(rest, moved, ea, ei, energetic, state, carried, forces, tangent)
    return forces[grasp, 1]
