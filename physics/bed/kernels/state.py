"""The state that all kernels share: a beam on its bed and room to work in."""

from typing import NamedTuple

from physics.bed.kernels.vectors import Bytes, Floats, Ints, inner

# Rows of `strand`.
ARM_X, ARM_Y, ARM_Z, FOOT_X, FOOT_Y, FOOT_Z, STIFF, LENGTH, YIELD, FAILURE, BILATERAL = range(11)


STRAND_ROWS = 11


# Entries of `sums`. Of the last assembly: energies of beam, strands, contacts and dead loads, mJ;
# energy dissipated now, mJ; strands not parted; largest strand force and force scale, N. Since the
# beginning: the energy balance of `EnergyBalance`, mJ; and how many strands parted that lay on a
# rod. Since the last assembly: the drag's share, and the
# energy of strands that a rod's tip has come upon, or that have slipped off one, mJ; and the part
# of `step` by which nodes have moved. Whether the balance follows the way of a tick that is open;
# `relaxation` of the tick that is assembled ahead, or 0.
BEAM, STRANDS, CONTACT, LOADS, LOST_NOW, WHOLE, MOST, FORCE_SCALE = range(8)


WORK, STORED, DISSIPATED, SNAP, DRAG, ROD_WORK, ROD_DISSIPATED, ROD_BROKEN, DRAG_NOW = range(8, 17)


BENT_NOW, SLIPPED_NOW, MOVED, RETRACED, AHEAD = range(17, 22)


# How far a rod may move at once lest it pass the beam, mm, no limit without rods; and since the
# beginning what free nodes have lost in ticks besides the drag, mJ.
CLEAR, LAG = 22, 23


# Of strands and walls that relax (`relaxation`): by how much less than at once both give in to a
# step, 1 where nothing relaxes; what viscosity has dissipated since the beginning, before this step
# and in it, mJ; and of strands that push the push round rods, mJ.
PACE, WALL_PACE, VISCOUS, SETTLED, PENDING, PUSHED = range(24, 30)


TRAVELLED = 30
"""How far nodes may have come nearer to each other in ticks since the beginning, mm."""


SUM_ROWS = 31


CONTACT_STIFFNESS = 1.6
"""Stiffness with which a rod is kept off the beam, N/mm for each mm of beam."""


# Entries of a row of `rods`: tip, direction from the tip back along the shaft, radius, in use, and
# how far it goes back.
TIP, SHAFT, RADIUS, IN_USE, REACHES = 0, 3, 6, 7, 8


ROD_ROWS = 9


# The column of `chord` with how far below its axis what is left of an element's section lies, mm.
OFF = 2


# What damage does in an assembly: it stays; the incremental potential counts it; it relaxes.
FROZEN, INCREMENTAL, RELAXED = 0, 1, 2


class State(NamedTuple):
    """A network of beams on its bed, and room to work in.

    N nodes, E elements, S strands, M rods, B blocks of the tangent above its diagonal. One beam is
    a network of one branch: E = B = N - 1.

    `held` are bits of what is held at a node (1 2 4 along x y z, 8 16 32 turning about them),
    `goal` where, `load` dead forces, `spring` what draws a node to its goal. Nodes are numbered in
    the order in which they are eliminated (`network.Elimination`), which makes fill: row n's blocks
    are `first_block[0, n]` to `first_block[0, n + 1]`, with columns above n. `stiff` and `strain`
    are rows of normal, two shear, torsion and two bending terms. The strands of node n to the bed
    are `first[n]` to `first[n + 1]`; after all nodes come pairs of nodes, `pair`, with the strands
    between them, whose feet are arms of the second node. `section` has an element's normal and
    shear forces, its moments at both ends (torsion, bending up, bending across) and the normal
    forces there.
    """

    x: Floats  # (N, 3) mm
    q: Floats  # (N, 4) unit quaternions, scalar first
    goal: Floats  # (N, 3) mm
    held: Ints  # (N,)
    load: Floats  # (N, 3) N
    spring: Floats  # (N, 3) N/mm
    first_block: Ints  # (2, N + 1) of rows, and of columns among `blocks[2]`
    blocks: Ints  # (3, B) rows and columns of the blocks; their numbers, sorted by columns
    product: Ints  # (P,) block from which the product of each pair of a row's blocks is taken
    # (E, 4) the elements' nodes, their blocks, and 1 where the second node's row is first, else 0
    ends: Ints
    turn: Floats  # (E, 2, 4) from the nodes' frames to the elements' own at their ends
    h: Floats  # (E,) lengths at rest, mm
    stiff: Floats  # (E, 6) N, N mm^2
    strain: Floats  # (E, 6) Gamma_0 and kappa_0, 1/mm
    # (E, 3) squares of the parts of both shears that are bending within an element, if thin; `OFF`
    chord: Floats
    wall: Floats  # (E, WALL_ROWS) what `kernels.wall` needs; (0, WALL_ROWS) of a linear wall
    strained: Floats  # (E, 4) or (0, 4) stretch, gam^2 and both curvatures of its sections
    first: Ints  # (N + G + 1,)
    pair: Ints  # (G, 4) two nodes, their block, -1 for none, and 1 where the second's row is first
    strand: Floats  # (STRAND_ROWS, S)
    damage: Floats  # (S,) 0 whole to 1 parted
    floor: Floats  # (N, 2) stiffness, N/mm, and height at rest, mm
    # (C, 3) of each node that may touch another tube its number, that tube's elements from and to
    touch: Ints
    reach: Floats  # (C, REACH_COLUMNS) of the same, see `touch`
    girth: Floats  # (E, 2) radii of the tube at the elements' ends, mm
    thick: Floats  # (N, 3) radius, mm, contact stiffness, N/mm, and reach of rods, mm
    rods: Floats  # (M, ROD_ROWS) mm
    # (M, S) side on which a strand goes round a rod, 1 or -1; 0: it does not touch; `NO_CONTACT`
    side: Bytes
    pull: Floats  # (M, 3) forces of hands on rods, N
    # (M, 4) their part against the beam itself, N, and its stiffness while no node moves, N/mm
    press: Floats
    section: Floats  # (E, 11)
    fibres: Floats  # (FIBRE_ROWS, 7 E) or (FIBRE_ROWS, 0) what they do
    g: Floats  # (N, 6) gradient, N and N mm
    step: Floats  # (N, 6) mm and rad
    diagonal: Floats  # (N, 6, 6) the tangent's diagonal blocks, lower triangles
    block: Floats  # (B, 6, 6) its blocks above the diagonal
    diagonal_kept: Floats
    block_kept: Floats
    x_kept: Floats
    q_kept: Floats
    goal_from: Floats
    goal_to: Floats
    load_from: Floats
    load_to: Floats
    rods_from: Floats
    rods_to: Floats
    rods_step: Floats  # (M, 3) of rods to there, mm, less what their hands have not the force for
    hold: Floats
    cross: Floats  # (6, 6) the block of the pair of nodes that is summed
    react: Floats  # (N, 3) forces of hands that hold, N
    damage_correction: Floats  # (N, 6) what damage has taken off the gradient in the last assembly
    rods_damage_correction: Floats  # (M, 3) and off the hands' forces on rods, N
    moved: Floats  # (N, 6) displacements since the assembly before, mm and rad
    g_before: Floats  # (N, 6) its gradient
    load_before: Floats  # (N, 3) its dead forces, N
    pull_before: Floats  # (M, 3) its forces on rods, N
    g_middle: Floats  # (N, 6) both half-way
    pull_middle: Floats
    damage_before: Floats  # (S,)
    side_before: Bytes  # (M, S)
    damage_ahead: Floats  # (S,) of the tick that is assembled ahead
    branch: Floats  # (2, R, 5) of strands and walls the branches by which they relax
    # What these remember, see `relaxation`; no columns and no elements where nothing relaxes.
    memory: Floats  # (SPRING + R, S)
    wall_memory: Floats  # (OVER + R, 6 E)
    sums: Floats
    # Room for the strands at one node: what each gives that is taut, and its bow round a rod; which
    pulling: Floats
    which: Ints


# Numba compiles loops far sooner than an assignment of arrays.
@inner
def copy_values(to: Floats, of: Floats) -> None:
    """Copy a vector."""
    for i in range(of.shape[0]):
        to[i] = of[i]


@inner
def copy_rows(to: Floats | Bytes, of: Floats | Bytes) -> None:
    """Copy a table."""
    for n in range(of.shape[0]):
        for r in range(of.shape[1]):
            to[n, r] = of[n, r]
