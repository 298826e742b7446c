"""The energy balance: the hands' work, and what was stored, dissipated, released and dragged.

From one assembly to the next nodes, springs' goals, dead forces and rods move along straight ways,
x = x_0 + s dx (rotations by Cayley's map of s w), 0 <= s <= 1, at the damage and on the sides of
rods that there were. Along it the energy U changes by the work of all forces,

    U_1 - U_0 = int g . dx - int p . dr - int f . dl ...      (g gradient, p forces on rods)

The part of held freedoms, of springs' goals, of dead forces and of rods is the hands' work; what
free nodes lose goes to the drag, and the rest is the `LAG` of one Newton step a tick, of either
sign: at hands that tremble or leap nodes are dragged back and forth about an equilibrium that they
do not reach. What is released in jumps is `SNAP`. Each integral is taken by the
trapezoidal rule; where U_1 - U_0 says that together they are off, as where a strand's end comes out
of a rod and its force jumps, by Simpson's over shorter and shorter parts (`retrace`). Then
strands jump on or off rods and damage grows, at places that stand still: what these change is the
difference of two energies.
"""

from kernel_cache import kernel
from physics.bed.kernels.assembly import assemble
from physics.bed.kernels.relaxation import remember
from physics.bed.kernels.state import (
    BEAM,
    BENT_NOW,
    CONTACT,
    DISSIPATED,
    DRAG,
    DRAG_NOW,
    FROZEN,
    LAG,
    LOST_NOW,
    MOVED,
    PENDING,
    RETRACED,
    ROD_BROKEN,
    ROD_DISSIPATED,
    ROD_WORK,
    SETTLED,
    SLIPPED_NOW,
    SNAP,
    STORED,
    STRANDS,
    VISCOUS,
    WORK,
    State,
    copy_rows,
    copy_values,
)
from physics.bed.kernels.step import move
from physics.bed.kernels.vectors import inner, outer

# Part of the energies that move in a tick by which its balance may be off.
CLOSED = 1e-5
# And part of all that is stored and dissipated.
CLOSED_OF_ALL = 1e-8
ROUNDING = 1e-13
"""And by rounding, mJ."""
SHORTEST, MOST_TRIES, LONG = 2.0**-14, 100, 2.0**-5
"""Shortest part of the way between two assemblies over which forces are integrated; how many parts
are tried before all are `LONG` at least, whether they close or not: a bound of the cost."""


@inner
def account_motion(s: State, size: float, first: float, middle: float, least: bool) -> bool:
    """Account for the motion since the assembly before if it closes, or is the `least` part."""
    # Weights of the forces at both ends and in the middle: the trapezoidal rule's, or Simpson's.
    sums = s.sums
    work = lost = swept = gross = unsure = 0.0
    for n in range(s.x.shape[0]):
        mask = s.held[n]
        for r in range(6):
            correction = s.damage_correction[n, r]
            f = first * (s.g_before[n, r] + s.g[n, r] + correction) + middle * s.g_middle[n, r]
            term = f * s.moved[n, r]
            gross += abs(term)
            if (mask >> r) & 1:
                work += term
            else:
                lost -= term
                change = s.g[n, r] + correction - s.g_before[n, r]
                unsure += 0.5 * abs(change * s.moved[n, r])
            if r < 3:
                work += 0.5 * (s.load_before[n, r] + s.load[n, r]) * s.moved[n, r]
                if not (mask >> r) & 1:
                    f = s.spring[n, r] * (s.goal[n, r] - s.x[n, r])
                    work += 0.5 * (s.react[n, r] + f) * (s.goal[n, r] - s.goal_from[n, r])
    for m in range(s.rods.shape[0]):
        for r in range(3):
            displacement = s.rods[m, r] - s.rods_from[m, r]
            f = s.pull_before[m, r] + s.pull[m, r] + s.rods_damage_correction[m, r]
            term = (first * f + middle * s.pull_middle[m, r]) * displacement
            gross += abs(term)
            swept += term
    swept += sums[BENT_NOW]
    lost += sums[SLIPPED_NOW]
    stored = sums[BEAM] + sums[STRANDS] + sums[CONTACT]
    viscous = sums[SETTLED] + sums[PENDING]
    missing = work + swept - (stored - sums[STORED]) - sums[LOST_NOW]
    missing -= viscous - sums[VISCOUS]
    jumped = False
    if sums[RETRACED] == 0.0:
        # A jump, in which forces are anything but linear, takes all that is missing: where much is
        # lost, or where the rule cannot tell what free nodes lose, so much do their forces change.
        much = 1e-4 * (stored + sums[STORED] + sums[DISSIPATED])
        if lost - sums[DRAG_NOW] > much or (unsure > much and 0.0 < missing - lost <= unsure):
            lost = missing
            jumped = lost > sums[DRAG_NOW]
    missing -= lost
    close = CLOSED_OF_ALL * size * (stored + sums[STORED] + sums[DISSIPATED])
    close += CLOSED * gross + ROUNDING
    if abs(missing) > close and not least:
        return False
    for n in range(s.x.shape[0]):
        for r in range(6):
            s.g_before[n, r] = s.g[n, r]
            s.moved[n, r] = 0.0
        for r in range(3):
            s.load_before[n, r] = s.load[n, r]
            if (s.held[n] >> r) & 1:
                s.react[n, r] = s.g[n, r]
            else:
                s.react[n, r] = s.spring[n, r] * (s.goal[n, r] - s.x[n, r])
            s.goal_from[n, r] = s.goal[n, r]
    for m in range(s.rods.shape[0]):
        for r in range(3):
            s.pull_before[m, r] = s.pull[m, r]
            s.rods_from[m, r] = s.rods[m, r]
    sums[WORK] += work + swept
    sums[ROD_WORK] += swept
    sums[DRAG] += sums[DRAG_NOW]
    slipped = max(sums[SLIPPED_NOW], 0.0)
    beyond = lost - sums[DRAG_NOW]
    if not jumped:
        sums[LAG] += beyond - slipped
        beyond = slipped
    sums[SNAP] += beyond
    sums[DISSIPATED] += sums[LOST_NOW]
    sums[VISCOUS] = viscous
    sums[STORED] = stored
    sums[DRAG_NOW] = sums[MOVED] = 0.0
    return True


@kernel(error_model="numpy", _nrt=True)  # it makes arrays
def retrace(s: State) -> None:
    """Account for the motion in as many parts as it takes, by Simpson's rule."""
    turned = s.sums[MOVED]
    x, q, moved, goal, load = s.x.copy(), s.q.copy(), s.moved.copy(), s.goal.copy(), s.load.copy()
    goal_0, load_0 = s.goal_from.copy(), s.load_before.copy()
    rods, rods_0 = s.rods.copy(), s.rods_from.copy()
    done, size, tries = 0.0, 0.5, 0
    while done < 1.0:
        tries += 1
        if tries > MOST_TRIES:
            size = max(size, LONG)
        size = min(size, 1.0 - done)
        middle = done + 0.5 * size
        for half in range(2):
            fraction = done + size if half else middle
            if turned > 0.0:
                move(s, fraction * turned)
            for n in range(s.x.shape[0]):
                for r in range(3):
                    s.goal[n, r] = goal_0[n, r] + fraction * (goal[n, r] - goal_0[n, r])
                    s.load[n, r] = load_0[n, r] + fraction * (load[n, r] - load_0[n, r])
            for m in range(rods.shape[0]):
                for r in range(3):
                    s.rods[m, r] = rods_0[m, r] + fraction * (rods[m, r] - rods_0[m, r])
            assemble(s, int(FROZEN), 0.0)
            remember(s)
            if not half:
                copy_rows(s.g_middle, s.g)
                copy_rows(s.pull_middle, s.pull)
        for n in range(s.x.shape[0]):
            square = moved[n, 3] ** 2 + moved[n, 4] ** 2 + moved[n, 5] ** 2
            slower = 1.0 / (1.0 + 0.25 * middle * middle * square)  # spin of Cayley's map of s w
            for r in range(3):
                s.moved[n, r] = size * moved[n, r]
                s.moved[n, 3 + r] = size * slower * moved[n, 3 + r]
        least = size <= SHORTEST or tries > MOST_TRIES
        if account_motion(s, size, 1.0 / 6.0, 2.0 / 3.0, least):
            done += size
            size *= 2.0
        else:
            size *= 0.5
    copy_rows(s.x, x)
    copy_rows(s.q, q)
    copy_rows(s.goal, goal)
    copy_rows(s.load, load)
    copy_rows(s.rods, rods)


@outer
def account(s: State, kind: int, relaxation: float) -> None:
    """Assemble, and account for all since the assembly before."""
    sums = s.sums
    retraced = sums[RETRACED] != 0.0
    dissipated, broken = sums[ROD_DISSIPATED], sums[ROD_BROKEN]
    if retraced:
        copy_values(s.damage_before, s.damage)
        copy_rows(s.side_before, s.side)
    assemble(s, kind, relaxation)
    remember(s)
    if account_motion(s, 1.0, 0.5, 0.0, not retraced):
        return
    sums[ROD_DISSIPATED], sums[ROD_BROKEN] = dissipated, broken
    copy_values(s.damage, s.damage_before)
    copy_rows(s.side, s.side_before)
    retrace(s)
    assemble(s, kind, relaxation)
    remember(s)
    account_motion(s, 0.0, 0.5, 0.0, retraced)
