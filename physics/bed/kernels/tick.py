"""The beam in real time, at a fixed cost.

Damage relaxes towards its law with a delay tau, d' = (d_law - d) / tau, then one
Newton step with a small viscous drag. While d stands, every strand's secant stiffness is positive,
so that one factorisation is nearly always enough: a fixed cost.
"""

import math

from physics.bed.kernels.assembly import assemble
from physics.bed.kernels.balance import account
from physics.bed.kernels.core import clear_of_rods, lead_rods, rods_clear_of
from physics.bed.kernels.relaxation import settle
from physics.bed.kernels.state import (
    CLEAR,
    DRAG_NOW,
    FROZEN,
    IN_USE,
    MOVED,
    RADIUS,
    RELAXED,
    TIP,
    TRAVELLED,
    State,
    copy_rows,
)
from physics.bed.kernels.step import TURN_LIMIT, keep_shape, largest, move
from physics.bed.kernels.tangent import add_drag, hold_nodes, solve
from physics.bed.kernels.touch import clear_of_tubes
from physics.bed.kernels.vectors import dot, inlined, outer

# Into how many parts a tick may be divided in which rods move far; those that are not where they
# should be then go on in the next tick.
MOST_SUBSTEPS = 4096


@inlined
def safe_rods_fraction(s: State, fraction: float) -> float:
    """Return the part of the rods' steps, at most `fraction`, to go at once."""
    lead_rods(s, fraction)
    longest, thinnest = 0.0, math.inf
    for m in range(s.rods.shape[0]):
        if s.rods[m, IN_USE] != 0.0:
            path = (s.rods_step[m, 0], s.rods_step[m, 1], s.rods_step[m, 2])
            longest = max(longest, math.sqrt(dot(path, path)))
            thinnest = min(thinnest, s.rods[m, RADIUS])
    if fraction * longest > thinnest:  # it might jump over a strand
        fraction = thinnest / longest
    if fraction * longest > s.sums[CLEAR]:
        fraction = rods_clear_of(s, fraction)
    return fraction


@inlined
def advance(
    s: State,
    fraction: float,
    rods_fraction: float,
    relaxation: float,
    drag: float,
    seconds: float,
) -> bool:
    """Go these fractions of the way to the targets, by one Newton step."""
    for n in range(s.x.shape[0]):
        for r in range(3):
            s.goal[n, r] += fraction * (s.goal_to[n, r] - s.goal[n, r])
            s.load[n, r] += fraction * (s.load_to[n, r] - s.load[n, r])
    for m in range(s.rods.shape[0]):
        for r in range(3):
            s.rods[m, TIP + r] += rods_fraction * s.rods_step[m, r]
    account(s, int(RELAXED), relaxation)
    if s.memory.shape[1] or s.wall_memory.shape[1]:
        settle(s, seconds)
    used = drag
    add_drag(s, used)
    copy_rows(s.step, s.g)
    hold_nodes(s, 1.0)
    # Not definite, which is rare: more and more drag, until it is.
    while not solve(s.first_block, s.blocks, s.product, s.diagonal, s.block, s.step):
        used = 16.0 * used + 1e-3
        if used > 1e9:
            return False
        assemble(s, int(FROZEN), 0.0)
        add_drag(s, used)
        copy_rows(s.step, s.g)
        hold_nodes(s, 1.0)
    keep_shape(s.x_kept, s.x, s.q_kept, s.q)
    turn = largest(s, int(3))
    taken = 1.0 if turn <= TURN_LIMIT else TURN_LIMIT / turn
    farthest = largest(s, int(0))
    if taken * farthest > s.sums[CLEAR]:
        taken = clear_of_rods(s.x, s.ends, s.stiff, s.rods, s.step, taken)
    taken = clear_of_tubes(
        s.x, s.ends, s.girth, s.stiff, s.touch, s.reach, s.sums[TRAVELLED], s.step, farthest, taken
    )
    move(s, taken)
    s.sums[TRAVELLED] += 2.0 * taken * farthest
    dragged = 0.0
    for n in range(s.x.shape[0]):
        size = s.thick[n, 0] * s.thick[n, 0]
        for r in range(6):
            displacement = taken * s.step[n, r]
            s.moved[n, r] = displacement
            if not (s.held[n] >> r) & 1:
                dragged += used * displacement * displacement * (1.0 if r < 3 else size)
    s.sums[DRAG_NOW], s.sums[MOVED] = dragged, taken
    return True


@outer
def tick(s: State, ticks: int, relaxation: float, drag: float, seconds: float) -> bool:
    """Advance to `..._to` in so many real-time ticks; False if no tangent is definite."""
    # A tick of so many `seconds`, dt, lets damage go the fraction `relaxation` = dt / (tau + dt)
    # towards the law (implicit Euler), then takes a Newton step with a drag (N/mm at each node:
    # c / dt) against the motion; strands and walls relax in that time from the next tick on.
    # Energy is accounted for up to the last assembly. Where rods move so far in a tick that they
    # might jump over the beam or a strand, it is divided: as many steps of as much less time.
    for now in range(ticks):
        fraction = 1.0 / (ticks - now)
        done = 0.0
        for _ in range(MOST_SUBSTEPS):
            left = 1.0 - done
            going = left * fraction / (1.0 - done * fraction)
            rods_going = safe_rods_fraction(s, going)
            portion = left * rods_going / going
            # Rods that cannot move on: time goes by all the same.
            if portion == left or portion == 0.0:
                portion = left
            else:
                going = rods_going
            if portion == 1.0:
                relaxing, dragging = relaxation, drag
            else:
                relaxing = portion * relaxation / (1.0 - relaxation + portion * relaxation)
                dragging = drag / portion
            if not advance(s, going, rods_going, relaxing, dragging, portion * seconds):
                return False
            done += portion
            if done >= 1.0 - 1e-12:
                break
    return True
