"""Blunt rods among the strands: the way of a strand round one, and their contact with the beam.

A rod goes from its tip back along u, as far as it reaches, with radius r. A strand that meets it
takes the shortest path round it, straight on the unrolled cylinder, on the side first touched:
length^2 = plane^2 + axial^2, plane = l_a + l_b + r (phi - atan(l_a/r) - atan(l_b/r)), with
l = sqrt(distance^2 - r^2) the tangent from either end and phi the angle between the ends about u.
There is no friction; of two rods it goes round the one that makes it longer (`longest_round`). A
strand is met when the tip has gone past it, and slips off past 3 rad or past an end: these two
jump, so that in a search for equilibrium they stand as they are (`update_rod_contacts`). The duct,
a round bar about the axis, is kept off by a penalty contact.
"""

import math

from physics.bed.kernels.relaxation import LESS
from physics.bed.kernels.state import (
    ARM_X,
    ARM_Y,
    ARM_Z,
    FOOT_X,
    FOOT_Y,
    FOOT_Z,
    IN_USE,
    INCREMENTAL,
    LENGTH,
    PACE,
    RADIUS,
    REACHES,
    SHAFT,
    STIFF,
    TIP,
    State,
)
from physics.bed.kernels.vectors import (
    Bytes,
    Floats,
    Ints,
    Nodes,
    Three,
    added,
    columns,
    cross,
    dot,
    inner,
    outer,
    scaled,
)

# Angle, rad: wrapped by more a strand slips off a rod.
SLIPS = 3.0
NO_CONTACT, SLIPPED = 2, 4
"""In `side`: a strand that is out of a rod's reach, or past its ends; one that has just slipped
off, and is straight until it meets the rod again. Odd ones touch it."""


@inner
def angle(across: float, along: float) -> float:
    """Return the angle of a direction in a plane, from -pi to pi (Cephes' rational function)."""
    size = abs(across)
    x = size / along if along != 0.0 else math.inf
    flip = x < 0.0
    x = abs(x)
    base = 0.0
    if x > 2.414213562373095:
        base, x = 0.5 * math.pi, -1.0 / x
    elif x > 0.66:
        base, x = 0.25 * math.pi, (x - 1.0) / (x + 1.0)
    z = x * x
    top = -8.750608600031904122785e-1
    top = top * z - 1.615753718733365076637e1
    top = top * z - 7.500855792314704667340e1
    top = top * z - 1.228866684490136173410e2
    top = top * z - 6.485021904942025371773e1
    low = z + 2.485846490142306297962e1
    low = low * z + 1.650270098316988542046e2
    low = low * z + 4.328810604912902668951e2
    low = low * z + 4.853903996359136964868e2
    low = low * z + 1.945506571482613964425e2
    turn = base + (x * (z * top / low) + x)
    if flip:
        turn = math.pi - turn
    return turn if across >= 0.0 else -turn


@outer
def path_round(
    a: Three, b: Three, rod: Floats, side: int, live: bool
) -> tuple[int, float, Three, Three, float]:
    """Return side, length, its derivatives by a and b, and its curvature across the rod."""
    # `live`: strands may be met and may slip off. The length is that round the rod also where a
    # strand has just slipped off it, else 0. To a strand with an end inside it the rod is only as
    # thick as leaves that end on its surface: so lengths never jump.
    none = (0.0, 0.0, 0.0)
    if side >= NO_CONTACT and not live:
        return side, 0.0, none, none, 0.0
    bent = side == 1 or side == -1
    u = (rod[SHAFT], rod[SHAFT + 1], rod[SHAFT + 2])
    r = rod[RADIUS]
    a = (a[0] - rod[TIP], a[1] - rod[TIP + 1], a[2] - rod[TIP + 2])
    b = (b[0] - rod[TIP], b[1] - rod[TIP + 1], b[2] - rod[TIP + 2])
    a0, b0 = dot(a, u), dot(b, u)
    a = added(a, scaled(u, -a0))
    b = added(b, scaled(u, -b0))
    ra, rb = math.sqrt(dot(a, a)), math.sqrt(dot(b, b))
    inside_a, inside_b = ra < r and ra <= rb, rb < r and rb < ra
    r = min(r, ra, rb)
    chord = added(b, scaled(a, -1.0))
    square = dot(chord, chord)
    nearest = -dot(a, chord) / square if square > 0.0 else 0.0
    nearest = min(1.0, max(0.0, nearest))
    at = a0 + nearest * (b0 - a0)
    slipped = live and (at < 0.0 or at > rod[REACHES])
    if slipped and not bent:
        return NO_CONTACT, 0.0, none, none, 0.0
    turn = dot(u, cross(a, b))
    axial = b0 - a0
    if not bent:
        side = 1 if turn > 0.0 else -1
        foot = added(a, scaled(chord, nearest))
        bent = dot(foot, foot) < r * r
    la, lb = math.sqrt(ra * ra - r * r), math.sqrt(rb * rb - r * r)
    arc = -1.0
    if bent:
        on_a, on_b = angle(la, r), angle(lb, r)
        arc = angle(side * turn, dot(a, b)) - on_a - on_b
        # Of phi's a whole turn apart the one nearest to the middle of 0, where both ends lie the
        # same way, and the one at which it slips off.
        if arc < 0.5 * (SLIPS - on_a - on_b) - math.pi:
            arc += 2.0 * math.pi
    if arc <= 0.0:
        return 0, 0.0, none, none, 0.0  # straight
    # `arc` is the angle wrapped: phi less the angles from both ends to their points of tangency.
    plane = la + lb + r * arc
    length = math.sqrt(plane * plane + axial * axial)
    if slipped:
        return NO_CONTACT, length, none, none, 0.0
    if live and arc > SLIPS:
        return SLIPPED, length, none, none, 0.0
    f = plane / length
    shift = scaled(u, axial / length)
    da, db = max(ra * ra, 1e-24), max(rb * rb, 1e-24)
    # The end turns about the point of tangency: the second derivative by a, of direction t, is
    # (I - t t^T)/length + bow n n^T, n across the rod and t. Within r/10 of its surface as there.
    # An end inside it makes the rod thicker as it goes out: plane grows by the angle for each mm.
    bow = 0.0 if inside_a else (plane / max(la, 0.1 * rod[RADIUS]) - 1.0) / length
    out_a = arc / math.sqrt(da) if inside_a else la / da
    out_b = arc / math.sqrt(db) if inside_b else lb / db
    by_a = added(scaled(a, f * out_a), scaled(cross(u, a), -f * side * r / da))
    by_b = added(scaled(b, f * out_b), scaled(cross(u, b), f * side * r / db))
    return side, length, added(by_a, scaled(shift, -1.0)), added(by_b, shift), bow


@outer
def group_nodes(pair: Ints, group: int, nodes: int) -> tuple[int, int]:
    """Return the node that a group of strands holds, and the one that its feet are on, or -1."""
    if group < nodes:
        return group, -1
    return pair[group - nodes, 0], pair[group - nodes, 1]


@inner
def strand_foot(x: Floats, q: Floats, strand: Floats, other: int, i: int) -> Three:
    """Return where strand i ends: a place, or an arm of the node `other`."""
    foot = (strand[FOOT_X, i], strand[FOOT_Y, i], strand[FOOT_Z, i])
    if other < 0:
        return foot
    t1, t2, t3 = columns(q[other, 0], q[other, 1], q[other, 2], q[other, 3])
    return (
        x[other, 0] + (t1[0] * foot[0] + t2[0] * foot[1] + t3[0] * foot[2]),
        x[other, 1] + (t1[1] * foot[0] + t2[1] * foot[1] + t3[1] * foot[2]),
        x[other, 2] + (t1[2] * foot[0] + t2[2] * foot[1] + t3[2] * foot[2]),
    )


@outer
def strand_ends(
    x: Floats, q: Floats, strand: Floats, n: int, other: int, i: int
) -> tuple[Three, Three]:
    """Return where strand i of node n holds the beam, and its foot, on the node `other` or -1."""
    t1, t2, t3 = columns(q[n, 0], q[n, 1], q[n, 2], q[n, 3])
    a0, a1, a2 = strand[ARM_X, i], strand[ARM_Y, i], strand[ARM_Z, i]
    end = (
        x[n, 0] + t1[0] * a0 + t2[0] * a1 + t3[0] * a2,
        x[n, 1] + t1[1] * a0 + t2[1] * a1 + t3[1] * a2,
        x[n, 2] + t1[2] * a0 + t2[2] * a1 + t3[2] * a2,
    )
    return end, strand_foot(x, q, strand, other, i)


@outer
def set_arms(x: Floats, q: Floats, nodes: Nodes, ends: Floats, strand: Floats, row: int) -> None:
    """Write into three rows, from `row` on, the arms at which nodes are held at (S, 3) places, mm.

    Of nodes -1, which are the bed's, the rows are the places themselves.
    """
    for i in range(nodes.size):
        n = int(nodes[i])
        if n < 0:
            for r in range(3):
                strand[row + r, i] = ends[i, r]
            continue
        t1, t2, t3 = columns(q[n, 0], q[n, 1], q[n, 2], q[n, 3])
        out = (ends[i, 0] - x[n, 0], ends[i, 1] - x[n, 1], ends[i, 2] - x[n, 2])
        strand[row, i], strand[row + 1, i] = dot(t1, out), dot(t2, out)
        strand[row + 2, i] = dot(t3, out)


@outer
def turn_arms(q: Floats, nodes: Nodes, strand: Floats, which: Ints, out: Floats) -> None:
    """Write the arms of some strands as their nodes turn them now, (S, 3) mm."""
    for k in range(which.size):
        i = int(which[k])
        n = int(nodes[i])
        t1, t2, t3 = columns(q[n, 0], q[n, 1], q[n, 2], q[n, 3])
        for r in range(3):
            out[k, r] = (
                t1[r] * strand[ARM_X, i] + t2[r] * strand[ARM_Y, i] + t3[r] * strand[ARM_Z, i]
            )


@inner
def longest_round(
    rods: Floats, side: Bytes, i: int, a: Three, b: Three, live: bool
) -> tuple[int, float, Three, Three, float, float, int]:
    """Return the rod round which strand i is longest, or -1, its `path_round`, and its jump."""
    # The jump: its length before it met or slipped off rods, 0 if straight, and whether it did (1),
    # or met one again that it had just slipped off (2); only if `live`, when sides are written.
    # Of a strand round two rods, such as both jaws, the longer path is followed: as a path grows
    # out of the chord or ends in it, the longer of both never jumps.
    none = (0.0, 0.0, 0.0)
    rod, longest, by_a, by_b, bow = -1, 0.0, none, none, 0.0
    before, jumped = 0.0, 0
    for m in range(rods.shape[0]):
        if rods[m, IN_USE] == 0.0:
            continue
        was = side[m, i]
        touch, path, to_a, to_b, bows = path_round(a, b, rods[m], was, live)
        bent = touch & 1 == 1
        if bent and path > longest:
            rod, longest, by_a, by_b, bow = m, path, to_a, to_b, bows
        if live:
            if was < NO_CONTACT:
                before = max(before, path)
            if path > 0.0 and (was >= NO_CONTACT or not bent):
                jumped = 2 if was == SLIPPED else max(jumped, 1)
            side[m, i] = touch
    return rod, longest, by_a, by_b, bow, before, jumped


@inner
def energy_between(s: State, i: int, path: float, before: float) -> float:
    """Return by how much more strand i stores along one path than along another, mJ."""
    bent = path - s.strand[LENGTH, i]
    short = before - s.strand[LENGTH, i]
    pace = s.sums[PACE]
    if s.memory.shape[1]:
        less = s.memory[LESS, i]
        bent, short = pace * bent - less, pace * short - less
    bent, short = max(bent, 0.0), max(short, 0.0)
    stiff = (1.0 - s.damage[i]) * s.strand[STIFF, i] / pace
    return 0.5 * stiff * (bent * bent - short * short)


@inner
def any_rod(rods: Floats) -> bool:
    """Return whether any rod is in use."""
    found = False
    for m in range(rods.shape[0]):
        found = found or rods[m, IN_USE] != 0.0
    return found


@inner
def reached(x: Floats, thick: Floats, rods: Floats, n: int, m: int) -> tuple[bool, float, Three]:
    """Return whether node n's strands may touch rod m, how far it is away, and the way to it."""
    u = (rods[m, SHAFT], rods[m, SHAFT + 1], rods[m, SHAFT + 2])
    d = (x[n, 0] - rods[m, 0], x[n, 1] - rods[m, 1], x[n, 2] - rods[m, 2])
    d = added(d, scaled(u, -min(max(0.0, dot(d, u)), rods[m, REACHES])))
    away = math.sqrt(dot(d, d))
    return away < thick[n, 0] + rods[m, RADIUS] + thick[n, 2], away, d


@inner
def press_beam(
    x: Floats,
    thick: Floats,
    rods: Floats,
    g: Floats,
    diagonal: Floats,
    pull: Floats,
    press: Floats,
    n: int,
    m: int,
    away: float,
    d: Three,
    kind: int,
) -> float:
    """Add the contact of node n with rod m, `away` along d from it; return its energy, mJ."""
    # Pressed away from a rod a node is pushed off to its sides as well. That is no part of a tick's
    # tangent, which so stays definite.
    deep = thick[n, 0] + rods[m, RADIUS] - away
    d = scaled(d, 1.0 / away)
    push = thick[n, 1]
    aside = push * deep / away if kind == INCREMENTAL else 0.0
    u = (rods[m, SHAFT], rods[m, SHAFT + 1], rods[m, SHAFT + 2])
    before = x[n, 0] - rods[m, 0], x[n, 1] - rods[m, 1], x[n, 2] - rods[m, 2]
    along = aside if 0.0 < dot(before, u) < rods[m, REACHES] else 0.0  # its ends are round
    for r in range(3):
        g[n, r] -= push * deep * d[r]
        pull[m, r] += push * deep * d[r]
        press[m, r] += push * deep * d[r]
        for col in range(r + 1):
            diagonal[n, r, col] += push * d[r] * d[col]
            if aside > 0.0:
                diagonal[n, r, col] += aside * d[r] * d[col] + along * u[r] * u[col]
        diagonal[n, r, r] -= aside
    press[m, 3] += push
    return 0.5 * push * deep * deep
