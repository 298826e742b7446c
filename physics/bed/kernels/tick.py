"""The beam in real time, at a fixed cost.

Damage relaxes towards its law with a delay tau, d' = (d_law - d) / tau, then one
Newton step with a small viscous drag. While d stands, every strand's secant stiffness is positive,
so that one factorisation is nearly always enough: a fixed cost.
"""

from kernel_cache import njit
from physics.bed.kernels.assembly import assemble
from physics.bed.kernels.balance import account
from physics.bed.kernels.state import (
    DRAG_NOW,
    FROZEN,
    MOVED,
    RELAXED,
    ROD_ROWS,
    State,
    copy_rows,
)
from physics.bed.kernels.step import TURN_LIMIT, keep_shape, largest, move
from physics.bed.kernels.tangent import add_drag, hold_nodes, solve


@njit(cache=True, error_model="numpy", nogil=True)
def tick(s: State, ticks: int, relaxation: float, drag: float) -> bool:
    """Advance to `..._to` in so many real-time ticks; False if no tangent is definite."""
    # A tick lets damage go the fraction `relaxation` = dt / (tau + dt) towards the law (implicit
    # Euler), then takes a Newton step with a drag (N/mm at each node: c / dt) against the motion.
    # Energy is accounted for up to the last assembly.
    for now in range(ticks):
        fraction = 1.0 / (ticks - now)
        for n in range(s.x.shape[0]):
            for r in range(3):
                s.goal[n, r] += fraction * (s.goal_to[n, r] - s.goal[n, r])
                s.load[n, r] += fraction * (s.load_to[n, r] - s.load[n, r])
        for m in range(s.rods.shape[0]):
            for r in range(ROD_ROWS):
                s.rods[m, r] += fraction * (s.rods_to[m, r] - s.rods[m, r])
        account(s, int(RELAXED), relaxation)
        used = drag
        add_drag(s, used)
        copy_rows(s.step, s.g)
        hold_nodes(s, 1.0)
        # Not definite, which is rare: more and more drag, until it is.
        while not solve(s.parent, s.diagonal, s.upper, s.step):
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
        move(s, taken)
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
