"""The energy balance: the hands' work, and what was stored, dissipated, released and dragged."""

from kernel_cache import njit
from physics.bed.kernels.state import (
    BEAM,
    BENT_NOW,
    CONTACT,
    DISSIPATED,
    DRAG,
    DRAG_NOW,
    LOST_NOW,
    ROD_WORK,
    SLIPPED_NOW,
    SNAP,
    STORED,
    STRANDS,
    WORK,
    State,
)


@njit(cache=True, error_model="numpy", nogil=True)
def account(s: State) -> None:
    """Account for the motion from the assembly before to the last one."""
    # Trapezoidal rule in all that moved: nodes, springs' goals, rods. Held freedoms, springs, dead
    # forces and rods take the hands' work; what free nodes lose goes to the drag and the rest is
    # released (`SNAP`). Damage comes after the motion, so its end counts with what damage has taken
    # off since (`shed`).
    sums = s.sums
    work = lost = swept = unsure = 0.0
    for n in range(s.x.shape[0]):
        mask = s.held[n]
        for r in range(6):
            f = s.g[n, r]
            part = 0.5 * (s.g_before[n, r] + f + s.shed[n, r]) * s.moved[n, r]
            change = 0.5 * abs((f + s.shed[n, r] - s.g_before[n, r]) * s.moved[n, r])
            s.g_before[n, r] = f
            if (mask >> r) & 1:
                work += part
            else:
                lost -= part
                unsure += change
            if r < 3:
                work += 0.5 * (s.load_before[n, r] + s.load[n, r]) * s.moved[n, r]
                s.load_before[n, r] = s.load[n, r]
                if not (mask >> r) & 1:
                    f = s.spring[n, r] * (s.goal[n, r] - s.x[n, r])
                    work += 0.5 * (s.react[n, r] + f) * (s.goal[n, r] - s.goal_from[n, r])
                s.react[n, r] = f
                s.goal_from[n, r] = s.goal[n, r]
            s.moved[n, r] = 0.0
    for m in range(s.rods.shape[0]):
        for r in range(3):
            way = s.rods[m, r] - s.rods_from[m, r]
            swept += 0.5 * (s.pull_before[m, r] + s.pull[m, r] + s.rods_shed[m, r]) * way
            s.pull_before[m, r] = s.pull[m, r]
            s.rods_from[m, r] = s.rods[m, r]
    swept += sums[BENT_NOW]
    drag, lost = sums[DRAG_NOW], lost + sums[SLIPPED_NOW]
    stored = sums[BEAM] + sums[STRANDS] + sums[CONTACT]
    # A jump, in which forces are anything but linear, takes all that is missing: where much is
    # lost, or where forces on free nodes change so much that the rule cannot tell what they lose.
    missing = work + swept - (stored - sums[STORED]) - sums[LOST_NOW]
    much = 1e-4 * (stored + sums[STORED] + sums[DISSIPATED])
    if lost - drag > much or (unsure > much and 0.0 < missing - lost <= unsure):
        lost = missing
    sums[WORK] += work + swept
    sums[ROD_WORK] += swept
    sums[DRAG] += drag
    sums[SNAP] += lost - drag
    sums[DISSIPATED] += sums[LOST_NOW]
    sums[STORED] = stored
    sums[DRAG_NOW] = 0.0
