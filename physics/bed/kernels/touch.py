"""Tubes touch and slide on each other: nodes of one are kept off the surface of another.

A tube's axis is smooth here: it leads from the middle of one element to that of the next as a
parabola c(u) = sum w_a(u) x_a of three neighbouring nodes (a quadratic B-spline), and straight on
to its ends, or where it is torn; its radius r(u) is taken alike. With p a node of another tube, of
radius r_p, the gap is the least

    gap = min_u |p - c(u)| - r(u) - r_p

of all pieces of the tube, which is smooth as p slides along it; with n from c to p its derivatives
are n by p and -w_a n by x_a. A gap that is `deep` below that of `REST` costs

    k deep^2/(2 (1 - y)),   y = deep/limit,

without bound as y goes to 1, `limit` being `CORE` of the least distance at which they touch: axes
never pass each other, and no step brings them nearer to that by more than `NEARER` of what is left
(`clear_of_tubes`). There is no friction, and all is pressed along one line. Each tube's nodes press
with half of `CONTACT_STIFFNESS` for each mm, as both do. With W = (1, -w), d = |p - c|, f'' the
second derivative of the gap by u and c* the part of c' across n, that of the gap by all places is

    W W^T (I - n n^T)/d - q q^T/f'',   q_p = -c*/d,   q_a = w_a c*/d - w_a' n.

What the tangent has no block for is left out there, and `MAJORANT` of its size is added to both
nodes' own blocks: each then moves as if the other stood still, and no step makes the energy grow.
"""

import math

from physics.bed.kernels.core import CORE, NEARER
from physics.bed.kernels.state import INCREMENTAL, RELAXED
from physics.bed.kernels.vectors import Floats, Ints, Three, added, dot, inner, outer, scaled

# Columns of `reach`: radius of the node, mm; the gap from which on it is pressed, at most 0, mm;
# stiffness, N/mm; what it can be pressed in at most, mm; how far nodes must have gone before there
# can be contact, mm.
OWN, REST, STIFFNESS, LIMIT, WAKE = range(5)
REACH_COLUMNS = 5
MAJORANT = 0.5
CLEAR_AT_REST = 1e-9
"""mm by which what touches at rest is off each other, lest it be pressed by rounding."""
MOST_TRIES = 20
DEEPEST = 0.999
"""y from which on a search turns back; in a tick, where a hook was put so deep in, k stays."""


@inner
def weights(u: float, before: bool, after: bool) -> tuple[Three, Three, Three]:
    """Return those of three nodes on a piece of an axis, and how they change with u, twice."""
    if before and after:
        w = 0.5 * (1.0 - u) * (1.0 - u), 0.5 + u * (1.0 - u), 0.5 * u * u
        return w, (u - 1.0, 1.0 - 2.0 * u, u), (1.0, -2.0, 1.0)
    if after:
        return (0.0, 1.0 - 0.5 * u, 0.5 * u), (0.0, -0.5, 0.5), (0.0, 0.0, 0.0)
    return (0.5 - 0.5 * u, 0.5 + 0.5 * u, 0.0), (-0.5, 0.5, 0.0), (0.0, 0.0, 0.0)


@inner
def along(x: Floats, nodes: tuple[int, int, int], w: Three) -> Three:
    """Return a sum of three nodes' places."""
    a, b, c = nodes
    return (
        w[0] * x[a, 0] + w[1] * x[b, 0] + w[2] * x[c, 0],
        w[0] * x[a, 1] + w[1] * x[b, 1] + w[2] * x[c, 1],
        w[0] * x[a, 2] + w[1] * x[b, 2] + w[2] * x[c, 2],
    )


@inner
def piece(
    ends: Ints, girth: Floats, stiff: Floats, k: int, first: int, last: int
) -> tuple[tuple[int, int, int], Three, bool, bool]:
    """Return nodes and radii of the piece at the start of element k, and what it leads to."""
    before = k > first and stiff[k - 1, 0] > 0.0
    after = k < last and stiff[k, 0] > 0.0
    left, right = max(k - 1, first), min(k, last - 1)
    nodes = ends[left, 0], ends[left, 1] if k > first else ends[k, 0], ends[right, 1]
    middle = girth[left, 1] if k > first else girth[k, 0]
    return nodes, (girth[left, 0], middle, girth[right, 1]), before, after


@inner
def nearest(
    x: Floats, p: Three, nodes: tuple[int, int, int], radii: Three, before: bool, after: bool
) -> tuple[float, float, float, float, Three]:
    """Return the gap to a piece, where, f'' there or 0 at its ends, distance and offset."""
    u, bend, gap, away, d = 0.5, 0.0, 0.0, 0.0, (0.0, 0.0, 0.0)
    for _ in range(MOST_TRIES):
        w, slope, curve = weights(u, before, after)
        d = added(p, scaled(along(x, nodes, w), -1.0))
        away = max(math.sqrt(dot(d, d)), 1e-12)
        gap = away - dot(w, radii)
        to, turn = along(x, nodes, slope), along(x, nodes, curve)
        ahead = dot(d, to) / away
        rise = -ahead - dot(slope, radii)
        bend = (dot(to, to) - ahead * ahead) / away - dot(d, turn) / away - dot(curve, radii)
        steep = bend if bend > 0.0 else dot(to, to) / away
        then = min(1.0, max(0.0, u - rise / max(steep, 1e-12)))
        if abs(then - u) < 1e-15:
            break
        u = then
    return gap, u, bend if 0.0 < u < 1.0 and bend > 0.0 else 0.0, away, d


@inner
def tube_gap(
    x: Floats, ends: Ints, girth: Floats, stiff: Floats, n: int, first: int, last: int
) -> tuple[int, float, float, float, float, Three]:
    """Return the piece of a tube that is nearest to node n, -1 if none is left, and `nearest`."""
    # The piece with the nearest node comes first: with its gap hardly any other is looked at.
    p = x[n, 0], x[n, 1], x[n, 2]
    start, least = first, math.inf
    for k in range(first, last + 1):
        m, radius = (ends[k, 0], girth[k, 0]) if k < last else (ends[k - 1, 1], girth[k - 1, 1])
        e = added(p, (-x[m, 0], -x[m, 1], -x[m, 2]))
        gap = math.sqrt(dot(e, e)) - radius
        if gap < least:
            start, least = k, gap
    found, least, at, bend, distance, offset = -1, math.inf, 0.0, 0.0, 0.0, (0.0, 0.0, 0.0)
    for number in range(first - 1, last + 1):
        k = start if number < first else number
        if number == start:
            continue
        nodes, radii, before, after = piece(ends, girth, stiff, k, first, last)
        if not (before or after):
            continue
        # No place of a piece is farther from its middle node than half the longer side.
        at_b = x[nodes[1], 0], x[nodes[1], 1], x[nodes[1], 2]
        half = 0.0
        for end in (nodes[0], nodes[2]):
            e = added(at_b, (-x[end, 0], -x[end, 1], -x[end, 2]))
            half = max(half, dot(e, e))
        to_b = added(p, scaled(at_b, -1.0))
        if math.sqrt(dot(to_b, to_b)) - 0.5 * math.sqrt(half) - max(radii) > least:
            continue
        gap, u, bends, away, d = nearest(x, p, nodes, radii, before, after)
        if gap < least:
            found, least, at, bend, distance, offset = k, gap, u, bends, away, d
    return found, least, at, bend, distance, offset


@outer
def rest_gaps(
    x: Floats, ends: Ints, girth: Floats, stiff: Floats, touch: Ints, reach: Floats
) -> None:
    """Write gaps from which on nodes are pressed, those at rest if below 0, and their limits."""
    for c in range(touch.shape[0]):
        gap = tube_gap(x, ends, girth, stiff, touch[c, 0], touch[c, 1], touch[c, 2])[1]
        reach[c, REST] = min(gap - reach[c, OWN] - CLEAR_AT_REST, 0.0)
        thinnest = math.inf
        for e in range(touch[c, 1], touch[c, 2]):
            thinnest = min(thinnest, girth[e, 0], girth[e, 1])
        apart = reach[c, OWN] + thinnest
        reach[c, LIMIT] = CORE * max(apart + reach[c, REST], CORE * apart)


@inner
def block_at(first_block: Ints, blocks: Ints, a: int, b: int) -> int:
    """Return the number of the tangent's block of two nodes, -1 where it has none."""
    row, column = min(a, b), max(a, b)
    for k in range(first_block[0, row], first_block[0, row + 1]):
        if blocks[1, k] == column:
            return k
    return -1


@inner
def touch_pass(
    x: Floats,
    ends: Ints,
    girth: Floats,
    stiff: Floats,
    touch: Ints,
    reach: Floats,
    travelled: float,
    first_block: Ints,
    blocks: Ints,
    g: Floats,
    diagonal: Floats,
    block: Floats,
    kind: int,
) -> float:
    """Add the energy of tubes that touch, its gradient and tangent; return it, mJ."""
    energy = 0.0
    for c in range(touch.shape[0]):
        if kind == RELAXED:
            if travelled < reach[c, WAKE]:
                continue
        else:
            reach[c, WAKE] = 0.0
        n, first, last = touch[c, 0], touch[c, 1], touch[c, 2]
        found, gap, u, bend, away, d = tube_gap(x, ends, girth, stiff, n, first, last)
        if found < 0:
            continue
        gap -= reach[c, OWN] + reach[c, REST]
        if gap >= 0.0:
            if kind == RELAXED:
                reach[c, WAKE] = travelled + gap
            continue
        three, _, before, after = piece(ends, girth, stiff, found, first, last)
        w, slope, _ = weights(u, before, after)
        nodes = (n, three[0], three[1], three[2])
        weight, turning = (1.0, -w[0], -w[1], -w[2]), (0.0, -slope[0], -slope[1], -slope[2])
        limit = reach[c, LIMIT]
        y = -gap / limit
        if y >= DEEPEST:
            if kind == INCREMENTAL:
                return math.inf
            y = DEEPEST
        left = 1.0 / (1.0 - y)
        force = -reach[c, STIFFNESS] * gap * (1.0 - 0.5 * y) * left * left
        k = reach[c, STIFFNESS] * left * left * left
        energy += 0.5 * reach[c, STIFFNESS] * gap * gap * left
        normal = scaled(d, 1.0 / away)
        aside = turn = 0.0
        across = (0.0, 0.0, 0.0)
        if kind == INCREMENTAL:
            aside = force / away
            to = along(x, three, slope)
            across = scaled(added(to, scaled(normal, -dot(to, normal))), 1.0 / away)
            turn = force / bend if bend > 0.0 else 0.0
        for a in range(4):
            if weight[a] == 0.0 and turning[a] == 0.0:
                continue
            for r in range(3):
                g[nodes[a], r] -= force * weight[a] * normal[r]
            for b in range(a, 4):
                both = weight[a] * weight[b]
                if both == 0.0 and turning[a] * turning[b] == 0.0:
                    continue
                to_block = -1
                if a != b:
                    to_block = block_at(first_block, blocks, nodes[a], nodes[b])
                for r in range(3):
                    for s in range(3):
                        v = both * (k + aside) * normal[r] * normal[s]
                        if r == s:
                            v -= both * aside
                        qa = -weight[a] * across[r] + turning[a] * normal[r]
                        qb = -weight[b] * across[s] + turning[b] * normal[s]
                        v += turn * qa * qb
                        if a == b:
                            if s <= r:
                                diagonal[nodes[a], r, s] += v
                        elif to_block < 0:
                            if s <= r:
                                v = MAJORANT * abs(both) * k * normal[r] * normal[s]
                                diagonal[nodes[a], r, s] += v
                                diagonal[nodes[b], r, s] += v
                        elif nodes[a] < nodes[b]:
                            block[to_block, r, s] += v
                        else:
                            block[to_block, s, r] += v
    return energy


@inner
def clear_of_tubes(
    x: Floats,
    ends: Ints,
    girth: Floats,
    stiff: Floats,
    touch: Ints,
    reach: Floats,
    travelled: float,
    step: Floats,
    farthest: float,
    fraction: float,
) -> float:
    """Return the part of a step, at most `fraction`, that brings no tube too near to another."""
    # `farthest`: how far the step moves a node at most.
    for c in range(touch.shape[0]):
        if travelled + 2.0 * fraction * farthest < reach[c, WAKE]:
            continue
        n, first, last = touch[c, 0], touch[c, 1], touch[c, 2]
        found, gap, u, _, away, d = tube_gap(x, ends, girth, stiff, n, first, last)
        if found < 0:
            continue
        gap -= reach[c, OWN] + reach[c, REST]
        three, _, before, after = piece(ends, girth, stiff, found, first, last)
        w, _, _ = weights(u, before, after)
        to = added((step[n, 0], step[n, 1], step[n, 2]), scaled(along(step, three, w), -1.0))
        nearer = -dot(d, to) / away
        left = max(gap + reach[c, LIMIT], 0.0)
        if fraction * nearer > NEARER * left:
            fraction = NEARER * left / nearer
    return fraction
