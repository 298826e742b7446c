"""Kernels of a chain of masses: the forces of its springs, three integrators, and settling.

Arrays over masses are (N, 2): along the line between the clamps and along the pull. Where a mass
is held its inverse mass is zero: there its velocity stays as it is, damping included, so that a
held mass with a velocity is one that is led.

Symbols. `rest` (N - 1,) rest lengths l0, mm; `axial` (N - 1,) stiffnesses E A / l0, N/mm, of the
springs along the segments; `angular` (N,) stiffnesses, N mm, of springs at the masses, between one
segment and the next (at the ends: the clamp); `moved` (N, 2) displacements u, mm; `velocity` (N, 2)
v, mm/s; `inverse_mass` (N, 2) 1/m, mm/(N s^2); `damping` lambda/m, 1/s; `pull` a force, N, on the
mass `grasp`; `step` h, s, taken `count` times. The equation of motion is the thesis's (2.1),
m u'' + lambda u' = F(u).
"""

import math

import numpy as np
from numpy.typing import NDArray

from kernel_cache import njit


@njit(cache=True, nogil=True)
def spring_forces(
    rest: NDArray[np.float64],
    axial: NDArray[np.float64],
    angular: NDArray[np.float64],
    moved: NDArray[np.float64],
    forces: NDArray[np.float64],
) -> None:
    """Fill the forces (N, 2), N, with which the springs act on the masses."""
    # A segment at the angle alpha carries its tension and the moments of the angular springs at its
    # two ends; an angular spring of bend alpha_next - alpha turns each of its segments by a pair of
    # forces across it, (difference of the moments at its ends) / length.
    count = rest.shape[0]
    forces[:] = 0.0
    # The clamp in front of the first segment and behind the last one lies along the line.
    c, s = 1.0, 0.0
    length, tension, moment = 1.0, 0.0, 0.0
    for e in range(count + 1):
        if e < count:
            du = moved[e + 1, 0] - moved[e, 0]
            dv = moved[e + 1, 1] - moved[e, 1]
            next_length = math.sqrt((rest[e] + du) ** 2 + dv * dv)
            # l - l0 without the cancellation that it has as written.
            stretch = (2.0 * rest[e] * du + du * du + dv * dv) / (next_length + rest[e])
            next_c = (rest[e] + du) / next_length
            next_s = dv / next_length
            next_tension = axial[e] * stretch
        else:
            next_length, next_c, next_s, next_tension = 1.0, 1.0, 0.0, 0.0
        bend = math.atan2(c * next_s - s * next_c, c * next_c + s * next_s)
        next_moment = angular[e] * bend
        if e > 0:
            shear = (next_moment - moment) / length
            fx = tension * c + shear * s
            fy = tension * s - shear * c
            forces[e - 1, 0] += fx
            forces[e - 1, 1] += fy
            forces[e, 0] -= fx
            forces[e, 1] -= fy
        c, s, length = next_c, next_s, next_length
        tension, moment = next_tension, next_moment


@njit(cache=True, nogil=True)
def euler(
    rest: NDArray[np.float64],
    axial: NDArray[np.float64],
    angular: NDArray[np.float64],
    inverse_mass: NDArray[np.float64],
    damping: float,
    grasp: int,
    pull: float,
    step: float,
    count: int,
    moved: NDArray[np.float64],
    velocity: NDArray[np.float64],
) -> None:
    """Advance the masses by explicit Euler steps (2.4), (2.5)."""
    forces = np.empty_like(moved)
    for _ in range(count):
        spring_forces(rest, axial, angular, moved, forces)
        forces[grasp, 1] += pull
        for n in range(moved.shape[0]):
            for i in range(2):
                before = velocity[n, i]
                if inverse_mass[n, i] > 0.0:
                    velocity[n, i] += step * (inverse_mass[n, i] * forces[n, i] - damping * before)
                moved[n, i] += step * before


@njit(cache=True, nogil=True)
def leapfrog(
    rest: NDArray[np.float64],
    axial: NDArray[np.float64],
    angular: NDArray[np.float64],
    inverse_mass: NDArray[np.float64],
    damping: float,
    grasp: int,
    pull: float,
    step: float,
    count: int,
    moved: NDArray[np.float64],
    velocity: NDArray[np.float64],
) -> None:
    """Advance the masses by leapfrog steps (2.6), (2.7), velocities brought up to the same time."""
    # The damping in (2.6) takes the mean of the velocities half a step before and after, so that it
    # costs no stability.
    half = 0.5 * step
    slower = 1.0 / (1.0 + half * damping)
    forces = np.empty_like(moved)
    spring_forces(rest, axial, angular, moved, forces)
    forces[grasp, 1] += pull
    for _ in range(count):
        for n in range(moved.shape[0]):
            for i in range(2):
                if inverse_mass[n, i] > 0.0:
                    velocity[n, i] += half * (
                        inverse_mass[n, i] * forces[n, i] - damping * velocity[n, i]
                    )
                moved[n, i] += step * velocity[n, i]
        spring_forces(rest, axial, angular, moved, forces)
        forces[grasp, 1] += pull
        for n in range(moved.shape[0]):
            for i in range(2):
                if inverse_mass[n, i] > 0.0:
                    velocity[n, i] = slower * (
                        velocity[n, i] + half * inverse_mass[n, i] * forces[n, i]
                    )


@njit(cache=True, nogil=True)
def runge_kutta(
    rest: NDArray[np.float64],
    axial: NDArray[np.float64],
    angular: NDArray[np.float64],
    inverse_mass: NDArray[np.float64],
    damping: float,
    grasp: int,
    pull: float,
    step: float,
    count: int,
    moved: NDArray[np.float64],
    velocity: NDArray[np.float64],
) -> None:
    """Advance the masses by steps of the classical Runge-Kutta rule of fourth order."""
    forces = np.empty_like(moved)
    start, start_velocity = np.empty_like(moved), np.empty_like(moved)
    sum_moved, sum_velocity = np.empty_like(moved), np.empty_like(moved)
    for _ in range(count):
        start[:] = moved
        start_velocity[:] = velocity
        sum_moved[:] = 0.0
        sum_velocity[:] = 0.0
        for stage in range(4):
            weight = 1.0 / 3.0 if stage == 1 or stage == 2 else 1.0 / 6.0
            ahead = step if stage == 2 else 0.5 * step
            spring_forces(rest, axial, angular, moved, forces)
            forces[grasp, 1] += pull
            for n in range(moved.shape[0]):
                for i in range(2):
                    rate = velocity[n, i]
                    gain = 0.0
                    if inverse_mass[n, i] > 0.0:
                        gain = inverse_mass[n, i] * forces[n, i] - damping * rate
                    sum_moved[n, i] += weight * rate
                    sum_velocity[n, i] += weight * gain
                    moved[n, i] = start[n, i] + ahead * rate
                    velocity[n, i] = start_velocity[n, i] + ahead * gain
        moved[:] = start + step * sum_moved
        velocity[:] = start_velocity + step * sum_velocity


@njit(cache=True, nogil=True)
def settle(
    rest: NDArray[np.float64],
    axial: NDArray[np.float64],
    angular: NDArray[np.float64],
    inverse_mass: NDArray[np.float64],
    grasp: int,
    pull: float,
    step: float,
    tolerance: float,
    most: int,
    moved: NDArray[np.float64],
    velocity: NDArray[np.float64],
) -> int:
    """Return the number of steps in which the masses came to rest; -1 if not in `most` steps."""
    # Leapfrog with critical damping, 2 omega, for the frequency at which the masses now swing:
    # omega^2 = -v.dF / (h v.M v), Rayleigh's quotient of the last step (dynamic relaxation).
    # At rest no free mass is left with a force above the tolerance times the largest force that
    # holds the chain, or times a thousandth of the largest force at the start: a chain that nothing
    # holds bent has no other measure.
    count = moved.shape[0]
    forces = np.empty_like(moved)
    before = np.zeros_like(moved)
    velocity[:] = 0.0
    damping = 0.0
    at_start = 0.0
    for done in range(most):
        spring_forces(rest, axial, angular, moved, forces)
        forces[grasp, 1] += pull
        left = 0.0
        holding = abs(pull)
        stiffness = 0.0
        mass = 0.0
        for n in range(count):
            for i in range(2):
                size = abs(forces[n, i])
                if inverse_mass[n, i] > 0.0:
                    left = max(left, size)
                    change = velocity[n, i]
                    stiffness += change * (before[n, i] - forces[n, i])
                    mass += change * change / inverse_mass[n, i]
                else:
                    holding = max(holding, size)
                before[n, i] = forces[n, i]
        if done == 0:
            at_start = left
        if left <= tolerance * max(holding, 1e-3 * at_start):
            velocity[:] = 0.0
            return done
        if not math.isfinite(left):
            return -1
        if mass > 0.0:
            damping = 2.0 * math.sqrt(max(stiffness, 0.0) / (mass * step))
        keep = (1.0 - 0.5 * step * damping) / (1.0 + 0.5 * step * damping)
        gain = step / (1.0 + 0.5 * step * damping)
        for n in range(count):
            for i in range(2):
                if inverse_mass[n, i] > 0.0:
                    velocity[n, i] = (
                        keep * velocity[n, i] + gain * inverse_mass[n, i] * forces[n, i]
                    )
                    moved[n, i] += step * velocity[n, i]
    return -1
