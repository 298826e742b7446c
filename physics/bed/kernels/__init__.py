"""The compiled part of a beam in space on a bed of strands: energy, gradient, tangent, Newton.

Units mm, N, MPa, rad. Only + - * / and square roots, in a fixed order and without fast-math: a
run gives the same bits on every machine that computes by IEEE 754. Indices: e elements; n, i and j
nodes; r and c (or `col`) the freedoms of a node (x, y, z, then the spin about them); m rods.
Constants are passed as int(constant): else numba compiles a kernel anew for each.

Read in this order: `vectors`, `state`, `wall`, `beam`, `rods`, `core`, `strands`, `assembly`,
`tangent`, `step`, `newton`, `balance`, `tick`.
"""

from physics.bed.kernels.assembly import assemble, assemble_ahead
from physics.bed.kernels.balance import account
from physics.bed.kernels.beam import set_rest
from physics.bed.kernels.core import rods_clear_of
from physics.bed.kernels.newton import equilibrium
from physics.bed.kernels.rods import (
    NO_CONTACT,
    group_nodes,
    path_round,
    set_arms,
    strand_ends,
    turn_arms,
)
from physics.bed.kernels.state import (
    AHEAD,
    ARM_X,
    ARM_Z,
    BEAM,
    BILATERAL,
    CLEAR,
    CONTACT,
    CONTACT_STIFFNESS,
    DISSIPATED,
    DRAG,
    FAILURE,
    FOOT_X,
    FOOT_Z,
    FROZEN,
    IN_USE,
    INCREMENTAL,
    LAG,
    LENGTH,
    RADIUS,
    RETRACED,
    ROD_BROKEN,
    ROD_DISSIPATED,
    ROD_ROWS,
    ROD_WORK,
    SHAFT,
    SNAP,
    STIFF,
    STORED,
    STRAND_ROWS,
    STRANDS,
    SUM_ROWS,
    TIP,
    WORK,
    YIELD,
    State,
)
from physics.bed.kernels.strands import update_rod_contacts, yielded
from physics.bed.kernels.tick import tick
from physics.bed.kernels.wall import (
    FIBRE_ROWS,
    FIBRES,
    SOFT_2,
    SOFT_3,
    STRENGTH,
    WALL_ROWS,
    end_stresses,
)

__all__ = [
    "AHEAD",
    "ARM_X",
    "ARM_Z",
    "BEAM",
    "BILATERAL",
    "CLEAR",
    "CONTACT",
    "CONTACT_STIFFNESS",
    "DISSIPATED",
    "DRAG",
    "FAILURE",
    "FIBRES",
    "FIBRE_ROWS",
    "FOOT_X",
    "FOOT_Z",
    "FROZEN",
    "INCREMENTAL",
    "IN_USE",
    "LAG",
    "LENGTH",
    "NO_CONTACT",
    "RADIUS",
    "RETRACED",
    "ROD_BROKEN",
    "ROD_DISSIPATED",
    "ROD_ROWS",
    "ROD_WORK",
    "SHAFT",
    "SNAP",
    "SOFT_2",
    "SOFT_3",
    "STIFF",
    "STORED",
    "STRANDS",
    "STRAND_ROWS",
    "STRENGTH",
    "SUM_ROWS",
    "TIP",
    "WALL_ROWS",
    "WORK",
    "YIELD",
    "State",
    "account",
    "assemble",
    "assemble_ahead",
    "end_stresses",
    "equilibrium",
    "group_nodes",
    "path_round",
    "rods_clear_of",
    "set_arms",
    "set_rest",
    "strand_ends",
    "tick",
    "turn_arms",
    "update_rod_contacts",
    "yielded",
]
