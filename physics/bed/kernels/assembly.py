"""Energy, gradient and tangent of all: the beam, its strands, the floor, forces and springs."""

import math

from physics.bed.kernels.beam import beam_pass
from physics.bed.kernels.core import core_pass
from physics.bed.kernels.rods import any_rod
from physics.bed.kernels.state import (
    AHEAD,
    BEAM,
    BENT_NOW,
    CLEAR,
    CONTACT,
    LOADS,
    PENDING,
    PUSHED,
    RELAXED,
    RETRACED,
    SLIPPED_NOW,
    STRANDS,
    TRAVELLED,
    WALL_PACE,
    State,
    copy_values,
)
from physics.bed.kernels.strands import strand_pass
from physics.bed.kernels.touch import touch_pass
from physics.bed.kernels.vectors import inlined, inner, outer


@inner
def node_pass(s: State) -> None:
    """Add the floor under the nodes, dead forces and springs to their goals."""
    contact = loads = 0.0
    for n in range(s.x.shape[0]):
        deep = s.floor[n, 1] - s.x[n, 2]
        if deep > 0.0 and s.floor[n, 0] > 0.0:
            s.g[n, 2] -= s.floor[n, 0] * deep
            s.diagonal[n, 2, 2] += s.floor[n, 0]
            contact += 0.5 * s.floor[n, 0] * deep * deep
        for r in range(3):
            if s.load[n, r] != 0.0:
                s.g[n, r] -= s.load[n, r]
                loads -= s.load[n, r] * s.x[n, r]
            if s.spring[n, r] != 0.0:
                d = s.x[n, r] - s.goal[n, r]
                s.g[n, r] += s.spring[n, r] * d
                s.diagonal[n, r, r] += s.spring[n, r]
                contact += 0.5 * s.spring[n, r] * d * d
    s.sums[CONTACT] += contact
    s.sums[LOADS] = loads


@inlined
def shape_pass(s: State, kind: int, relaxation: float) -> None:
    """Write all that follows from the shape alone, wherever forces and springs go."""
    s.g[:] = 0.0
    s.diagonal[:] = 0.0
    s.block[:] = 0.0
    s.pull[:] = 0.0
    s.press[:] = 0.0
    s.damage_correction[:] = 0.0
    s.rods_damage_correction[:] = 0.0
    s.sums[CONTACT] = s.sums[BENT_NOW] = s.sums[SLIPPED_NOW] = 0.0
    s.sums[PENDING] = s.sums[PUSHED] = 0.0
    s.sums[BEAM] = beam_pass(
        s.x,
        s.q,
        s.ends,
        s.turn,
        s.h,
        s.stiff,
        s.strain,
        s.chord,
        s.wall,
        s.strained,
        s.fibres,
        s.wall_memory,
        s.sums[WALL_PACE],
        s.g,
        s.diagonal,
        s.block,
        s.section,
    )
    strand_pass(s, kind, relaxation)
    s.sums[CONTACT] += touch_pass(
        s.x,
        s.ends,
        s.girth,
        s.stiff,
        s.touch,
        s.reach,
        s.sums[TRAVELLED],
        s.first_block,
        s.blocks,
        s.g,
        s.diagonal,
        s.block,
        kind,
    )
    s.sums[CLEAR] = math.inf
    if any_rod(s.rods):
        energy, clear = core_pass(
            s.x,
            s.ends,
            s.h,
            s.stiff,
            s.thick,
            s.rods,
            s.g,
            s.diagonal,
            s.block,
            s.pull,
            s.press,
            kind,
        )
        s.sums[CONTACT] += energy
        s.sums[CLEAR] = clear


@outer
def assemble(s: State, kind: int, relaxation: float) -> float:
    """Write all energies, the gradient and the tangent; return the energy to minimise."""
    if kind == RELAXED and relaxation > 0.0 and s.sums[AHEAD] == relaxation:
        copy_values(s.damage, s.damage_ahead)
    else:
        shape_pass(s, kind, relaxation)
    s.sums[AHEAD] = 0.0
    node_pass(s)
    return s.sums[BEAM] + s.sums[STRANDS] + s.sums[CONTACT] + s.sums[LOADS]


@outer
def assemble_ahead(s: State, relaxation: float) -> None:
    """Assemble the next real-time tick with this `relaxation` as far as its hands do not matter."""
    # Damage stands until that tick, and any other assembly before it begins anew. Rods change what
    # the strands do, and a tick that is retraced needs its damage of before.
    if any_rod(s.rods) or s.sums[RETRACED] != 0.0 or s.sums[AHEAD] == relaxation:
        return
    copy_values(s.damage_before, s.damage)
    shape_pass(s, int(RELAXED), relaxation)
    copy_values(s.damage_ahead, s.damage)
    copy_values(s.damage, s.damage_before)
    s.sums[AHEAD] = relaxation
