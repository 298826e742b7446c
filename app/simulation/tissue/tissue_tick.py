"""One tick of tubes in space: kernels that lead hands, step the beams and read what is found."""

import math

import numpy as np
from numpy.typing import NDArray

from app.simulation.inputs.clock import TICK_SECONDS
from app.simulation.inputs.hand import follow
from app.simulation.runs.run_file import HANDS, SUBSTEPS
from app.simulation.tissue.reading import Vector
from kernel_cache import SameTypes, kernel
from physics.bed import kernels, step_numbers
from physics.bed.kernels.state import copy_rows

Floats = NDArray[np.float64]
Both = tuple[Floats, Floats]
WORST, RATIO = 1 + HANDS, 4
"""Of what a tick finds: the first row with a tube's worst stress, as `kernels.worst_stresses` has
it, and the column of that stress over the strength. Row 0 has the farthest that a node moved, mm,
and how many strands have parted; between are the hands' forces, N."""


@kernel()
def _lead(
    place: Both, speed: Both, target: Both, node: tuple[int, int], rods: tuple[int, int],
    apart: tuple[float, float], spread: tuple[Vector, Vector], goal: Floats, rods_to: Floats,
) -> None:  # fmt: skip
    """Move both tips for a tick, and what they lead: a node that is held, rods so far off."""
    for hand in range(HANDS):
        follow(place[hand], speed[hand], target[hand])
        for r in range(3):
            if node[hand] >= 0:
                goal[node[hand], r] = place[hand][r]
            offset = apart[hand] * spread[hand][r]
            if rods[hand] > 0:
                rods_to[2 * hand, r] = place[hand][r] - offset
            if rods[hand] > 1:
                rods_to[2 * hand + 1, r] = place[hand][r] + offset


@kernel()
def _sum_forces(
    node: tuple[int, int], rods: tuple[int, int], react: Floats, load: Floats, pull: Floats,
    out: Floats,
) -> None:  # fmt: skip
    """Write the force of each hand, N: on the node that it holds, and on its rods."""
    for hand in range(HANDS):
        for r in range(3):
            out[hand, r] = react[node[hand], r] + load[node[hand], r] if node[hand] >= 0 else 0.0
            for rod in range(2 * hand, 2 * hand + rods[hand]):
                out[hand, r] += pull[rod, r]


@kernel(error_model="numpy", nogil=True)
def _tick(
    apart: tuple[float, float], s: kernels.State, place: Both, speed: Both, target: Both,
    node: tuple[int, int], rods: tuple[int, int], spread: tuple[Vector, Vector], before: Floats,
    numbers: Vector, walls: Floats, firsts: NDArray[np.int64], strengths: Floats,
    stresses: Floats, found: Floats,
) -> bool:  # fmt: skip
    """Do a tick, and write what it finds; False if no tangent is definite."""
    # All in one call: between two of them Python does little else than to hand arrays over.
    _lead(place, speed, target, node, rods, apart, spread, s.goal_to, s.rods_to)
    copy_rows(before, s.x)
    if not kernels.tick(s, int(SUBSTEPS), numbers[0], numbers[1], numbers[2]):
        return False
    farthest, parted = 0.0, 0
    for n in range(s.x.shape[0]):
        for r in range(3):
            farthest = max(farthest, abs(s.x[n, r] - before[n, r]))
    for i in range(s.damage.shape[0]):
        parted += s.damage[i] >= 1.0
    found[0, 0], found[0, 1] = farthest, parted
    _sum_forces(node, rods, s.react, s.load, s.pull, found[1:WORST])
    kernels.nominal_stresses(s.section, walls, stresses)
    kernels.worst_stresses(stresses, firsts, found[WORST:])
    for tube in range(strengths.size):
        row = found[WORST + tube]
        bending = math.sqrt(row[2] * row[2] + row[3] * row[3])
        row[RATIO] = (row[1] + bending) / strengths[tube]
    return True


TISSUE_TICK, SUM_FORCES = SameTypes(_tick), SameTypes(_sum_forces)
STEP_NUMBERS = step_numbers(TICK_SECONDS / SUBSTEPS)
"""The numbers of a step as `kernels.tick` takes them."""
