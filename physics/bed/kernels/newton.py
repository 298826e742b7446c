"""The search for an equilibrium: Newton's method on the energy, with line search and shift.

An equilibrium is a minimum of the beam's energy plus the strands' incremental potential (elastic
energy plus what is dissipated from the last accepted state on), held at the nodes that hooks hold:
Newton's method with a line search on that energy (Armijo's rule) and a shift of the tangent where
it is not positive definite (`equilibrium`; `yielded` then updates the damage).
"""

import math

from physics.bed.kernels.assembly import assemble
from physics.bed.kernels.core import clear_of_rods
from physics.bed.kernels.rods import any_rod
from physics.bed.kernels.state import BEAM, FORCE_SCALE, LOADS, MOST, STRANDS, State, copy_rows
from physics.bed.kernels.step import (
    TURN_LIMIT,
    keep_shape,
    largest,
    move,
    slope_along,
)
from physics.bed.kernels.tangent import copy_blocks, hold_nodes, shift_tangent, solve
from physics.bed.kernels.touch import clear_of_tubes
from physics.bed.kernels.vectors import inner, outer
from physics.bed.kernels.wall import STRENGTH

# How many times as far as the hands a node may go in one Newton step without being looked at.
FAR_BEYOND_HANDS = 4.0
# After how many Newton steps that lower no energy a beam on rods is at a minimum.
STALLED = 30
# How often an unstable equilibrium is left by a nudge. Nudges grow fourfold, from 4e-6 of an
# element's length to some 17 lengths: beyond those nothing near the last shape is left to find.
UNSTABLE_TRIES = 12


@inner
def nudge(s: State, size: float) -> None:
    """Write into `step` a small displacement of every free node, the same in every run."""
    seed = 1
    for n in range(s.x.shape[0]):
        for r in range(6):
            seed = (seed * 16807) % 2147483647
            free = not (s.held[n] >> r) & 1
            s.step[n, r] = size * (seed / 2147483647.0 - 0.5) if free and r < 3 else 0.0


@inner
def distance_to_goals(s: State) -> float:
    """Return the largest distance of a held freedom to its goal, mm."""
    most = 0.0
    for n in range(s.x.shape[0]):
        for r in range(3):
            if (s.held[n] >> r) & 1:
                most = max(most, abs(s.goal[n, r] - s.x[n, r]))
    return most


@inner
def residual(s: State, length: float) -> float:
    """Return the largest force out of balance, N; moments over a length. Sets the force scale."""
    most = scale = 0.0
    for n in range(s.x.shape[0]):
        for r in range(6):
            f = abs(s.g[n, r]) if r < 3 else abs(s.g[n, r]) / length
            if (s.held[n] >> r) & 1:
                scale = max(scale, f)
            else:
                most = max(most, f)
            if r < 3:
                scale = max(scale, abs(s.load[n, r]))
    for e in range(s.h.size):
        for r in range(3):
            scale = max(scale, abs(s.section[e, r]))
        for r in range(3, 9):
            scale = max(scale, abs(s.section[e, r]) / length)
    s.sums[FORCE_SCALE] = max(scale, s.sums[MOST])
    return most


@outer
def equilibrium(s: State, kind: int, tolerance: float, floor: float, most: int) -> int:
    """Find a minimum of the energy near this shape, the held nodes at goals; iterations, or -1."""
    # `tolerance` is the largest force out of balance as a part of the largest one, `floor` in N.
    # Moments count as forces over the longest element. `least_shift` is 1e-11 of the largest shear
    # stiffness of an element: next to nothing beside what holds, yet above the rounding.
    length = s.h[0]
    for e in range(s.h.size):
        length = max(length, s.h[e])
    span = 0.0
    for e in range(s.h.size):
        span += s.h[e]
    least_shift = 0.0
    for e in range(s.h.size):
        least_shift = max(least_shift, s.stiff[e, 1] / s.h[e])
    least_shift *= 1e-11
    # Energies of fibres are differences of numbers near 1 E A.
    fibres_rounding = 0.0
    for e in range(s.wall.shape[0]):
        fibres_rounding += 1e-16 * s.wall[e, STRENGTH] * s.h[e]
    shift = 0.0
    left = stalled = 0
    rods = any_rod(s.rods)
    energy = assemble(s, kind, 0.0)
    for it in range(most):
        if not math.isfinite(energy):
            return -1
        going = distance_to_goals(s)
        arrived = going <= 1e-13 * span
        out_of_balance = residual(s, length)
        # Balanced once held places are where they should be and free forces are small; the tangent
        # without any shift then says whether the equilibrium is stable.
        balanced = arrived and out_of_balance <= tolerance * s.sums[FORCE_SCALE] + floor
        if balanced:
            shift = 0.0
        copy_blocks(s.diagonal_kept, s.diagonal)
        copy_blocks(s.block_kept, s.block)
        found = False
        for _ in range(40):
            copy_rows(s.step, s.g)
            if shift > 0.0:
                shift_tangent(s, shift, length)
            hold_nodes(s, 1.0)
            found = solve(s.first_block, s.blocks, s.product, s.diagonal, s.block, s.step)
            if found or balanced:
                break
            shift = max(16.0 * shift, least_shift)
            copy_blocks(s.diagonal, s.diagonal_kept)
            copy_blocks(s.block, s.block_kept)
        if balanced and not found:
            # A mode along which the energy does not change at all (neutral) is not unstable.
            copy_blocks(s.diagonal, s.diagonal_kept)
            copy_blocks(s.block, s.block_kept)
            copy_rows(s.step, s.g)
            shift_tangent(s, 1e-2 * least_shift, length)
            hold_nodes(s, 1.0)
            found = solve(s.first_block, s.blocks, s.product, s.diagonal, s.block, s.step)
        if balanced and found:
            return it
        keep_shape(s.x_kept, s.x, s.q_kept, s.q)
        if balanced:
            # Unstable. A nudge with a part along every mode is enough: from there the energy falls
            # along the softest one.
            left += 1
            if left > UNSTABLE_TRIES:
                return -1
            nudge(s, 1e-6 * 4.0**left * length)
            move(s, clear_of_rods(s.x, s.ends, s.stiff, s.rods, s.step, 1.0))
            energy = assemble(s, kind, 0.0)
            continue
        if not found:
            return -1
        fraction = 1.0
        turn = largest(s, int(3))
        if turn > TURN_LIMIT:
            fraction = TURN_LIMIT / turn
        far = largest(s, int(0))
        if rods:
            fraction = clear_of_rods(s.x, s.ends, s.stiff, s.rods, s.step, fraction)
        fraction = clear_of_tubes(
            s.x, s.ends, s.girth, s.stiff, s.touch, s.reach, 0.0, s.step, far, fraction
        )
        # Nor does any node go farther in one step than a quarter of the beam.
        if fraction * far > 0.25 * span:
            fraction = 0.25 * span / far
        if not arrived:  # held places still move: their work is no part of the energy searched
            move(s, fraction)
            energy = assemble(s, kind, 0.0)
            if fraction * far > FAR_BEYOND_HANDS * going:
                # Nearly unstable: it may have left for a far shape of more energy. Then they alone
                # move, and the rest follows downhill.
                taken = energy
                for n in range(s.x.shape[0]):
                    for r in range(6):
                        s.hold[n, r] = s.step[n, r]
                        if not (s.held[n] >> r) & 1:
                            s.step[n, r] = 0.0
                alone = 1.0
                if rods:
                    alone = clear_of_rods(s.x_kept, s.ends, s.stiff, s.rods, s.step, alone)
                move(s, alone)
                energy = assemble(s, kind, 0.0)
                if not energy < taken:
                    copy_rows(s.step, s.hold)
                    move(s, fraction)
                    energy = assemble(s, kind, 0.0)
            continue
        slope = slope_along(s)
        before = energy
        # Of the energies, and of the lengths that they follow from.
        rounding = 1e-13 * (abs(s.sums[BEAM]) + abs(s.sums[STRANDS]) + abs(s.sums[LOADS]))
        rounding += 1e-15 * span * s.sums[FORCE_SCALE] + fibres_rounding + 1e-300
        # Armijo's rule: at least 1e-4 of the fall that the slope promises. 0.4^30 is no step.
        accepted = False
        for _ in range(30):
            move(s, fraction)
            energy = assemble(s, kind, 0.0)
            if energy <= before + 1e-4 * fraction * slope + rounding:
                accepted = True
                if energy <= before - rounding:
                    break
                # Where rounding hides what the energy does, forces along the step must not grow.
                beyond = slope_along(s)
                if beyond <= -slope:
                    break
                fraction *= max(0.01, slope / (slope - beyond))
                continue
            accepted = False
            fraction *= 0.4
        # Where the energy falls as steeply as it began, as along a mode that is not stable, a step
        # four times as long is tried, and so on: by the shift alone it would take thousands.
        while accepted and shift > 0.0 and before - energy > -0.75 * fraction * slope:
            if 4.0 * fraction * turn > TURN_LIMIT or 4.0 * fraction * far > 0.25 * span:
                break
            if rods:
                clear = clear_of_rods(s.x_kept, s.ends, s.stiff, s.rods, s.step, 4.0 * fraction)
                if clear < 4.0 * fraction:
                    break
            lowest = energy
            move(s, 4.0 * fraction)
            energy = assemble(s, kind, 0.0)
            if not energy < lowest:
                move(s, fraction)
                energy = assemble(s, kind, 0.0)
                break
            fraction *= 4.0
        # The shift fades while full steps are taken, and grows steeply where none is.
        if accepted:
            shift = 0.0 if fraction >= 1.0 and shift < 16.0 * least_shift else 0.0625 * shift
            if fraction < 0.1:
                shift = max(shift, least_shift)
        else:
            copy_rows(s.x, s.x_kept)
            copy_rows(s.q, s.q_kept)
            energy = assemble(s, kind, 0.0)
            shift = max(64.0 * shift, least_shift)
            if shift > 1e18 * least_shift:
                return it if rods else -1
        # Where a strand's end goes into a rod its length has a kink: at a minimum there no forces
        # balance, and the energy falls no more, by however short a step.
        stalled = stalled + 1 if rods and energy > before - 10.0 * rounding else 0
        if stalled == STALLED:
            return it
    return -1
