"""The core of the contact of beam and rods: axes that never pass each other.

Nodes are kept off a rod by a penalty (`rods.press_beam`), whose force has a summit where both axes
meet, and none between nodes that are far apart. So the axes themselves, an element's straight line
and a rod's, resist from `CORE` of the distance R + r at which surfaces touch, without
bound as their distance d goes to 0: for each mm of element the energy

    (K/2) rho^2 (1 - y)^2 / y,   y = d/rho < 1,   rho = CORE (R + r)

with K = STIFFER CONTACT_STIFFNESS, of force f = (K/2) rho (1/y^2 - 1) and stiffness K/y^3. With n
from rod to beam, w = (1 - t, t) the weights of an element's nodes at its nearest place, P the
projection across the rod (past its ends, which are round, the identity), e the element and
q = w P e + (-d, d) the second derivative is

    (K/y^3 + f/d) w w^T n n^T - (f/d) (w w^T P - q q^T / |P e|^2).

No step may bring an element nearer to a rod by more than `NEARER` of their distance
(`clear_of_rods`, `rods_clear_of`): every place of the element keeps on its side of a plane between
them, so that nothing is jumped over.
"""

import math

from physics.bed.kernels.state import (
    CONTACT_STIFFNESS,
    IN_USE,
    RADIUS,
    REACHES,
    RELAXED,
    SHAFT,
    TIP,
    State,
)
from physics.bed.kernels.vectors import Floats, Ints, Three, added, dot, inner, outer, scaled

CORE, STIFFER = 0.5, 10.0
HELD_BACK = 50.0
"""N with which an instrument presses on tubes at most: surgeons who draw gallbladders aside peak at
50.7 (3.8) N at the handle (Barrie 2016, Surg Innov 23:463). In real time a rod that presses harder
than `HELD_FROM` of it goes only so far on that it would reach it if nothing gave way, is pressed
back by what is more, and slides along what it presses."""
HELD_FROM = 0.5
# Part of its distance, or of the core's radius, by which an element may come nearer to a rod at
# once, and the rod to where the element was before; part of the core's radius at which a rod comes
# no nearer, some kilonewtons.
NEARER, NEAREST = 0.4, 0.05


@inner
def approach(x: Floats, i: int, j: int, rod: Floats) -> tuple[float, bool, Three]:
    """Return where from node i (0) to j (1) a rod is nearest, whether past an end, its path."""
    tip = (rod[TIP], rod[TIP + 1], rod[TIP + 2])
    u = (rod[SHAFT], rod[SHAFT + 1], rod[SHAFT + 2])
    w = (x[i, 0] - tip[0], x[i, 1] - tip[1], x[i, 2] - tip[2])
    e = (x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2])
    ahead, turned = dot(w, u), dot(e, u)
    across, outward = added(w, scaled(u, -ahead)), added(e, scaled(u, -turned))
    size = dot(outward, outward)
    t = 0.5 if size < 1e-24 else min(1.0, max(0.0, -dot(across, outward) / size))
    at, reaches = ahead + t * turned, rod[REACHES]
    if 0.0 < at < reaches:
        return t, False, added(across, scaled(outward, t))
    if at > 0.0:
        w = added(w, scaled(u, -reaches))
    size = dot(e, e)
    t = min(1.0, max(0.0, -dot(w, e) / size)) if size > 0.0 else 0.0
    return t, True, added(w, scaled(e, t))


@inner
def core_pass(
    x: Floats,
    ends: Ints,
    h: Floats,
    stiff: Floats,
    thick: Floats,
    rods: Floats,
    g: Floats,
    diagonal: Floats,
    block: Floats,
    pull: Floats,
    press: Floats,
    kind: int,
) -> tuple[float, float]:
    """Add the cores' energy, gradient and tangent; return the energy and the way that is clear."""
    energy, clear = 0.0, math.inf
    for m in range(rods.shape[0]):
        if rods[m, IN_USE] == 0.0:
            continue
        u = (rods[m, SHAFT], rods[m, SHAFT + 1], rods[m, SHAFT + 2])
        for element in range(h.size):
            if stiff[element, 0] == 0.0:
                continue  # torn
            i, j = ends[element, 0], ends[element, 1]
            rho = CORE * (0.5 * (thick[i, 0] + thick[j, 0]) + rods[m, RADIUS])
            clear = min(clear, NEARER * rho)
            # Farther from the rod than the element is long, from a node, there is no contact.
            w = (x[i, 0] - rods[m, TIP], x[i, 1] - rods[m, TIP + 1], x[i, 2] - rods[m, TIP + 2])
            far = rho + 2.0 * h[element]
            ahead = max(dot(w, u), 0.0)
            if dot(w, w) - ahead * ahead > far * far:
                e = (x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2])
                if dot(e, e) < 4.0 * h[element] * h[element]:
                    continue
            t, past, d = approach(x, i, j, rods[m])
            away = math.sqrt(dot(d, d))
            if away >= rho or away < 1e-12:
                continue
            clear = min(clear, NEARER * away)
            y = away / rho
            stiffness = STIFFER * CONTACT_STIFFNESS * h[element]
            force = 0.5 * stiffness * rho * (1.0 / (y * y) - 1.0)
            energy += 0.5 * stiffness * rho * rho * (1.0 - y) * (1.0 - y) / y
            slope = stiffness / (y * y * y)
            n = scaled(d, 1.0 / away)
            e = (x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2])
            if not past:
                e = added(e, scaled(u, -dot(e, u)))
            for r in range(3):
                g[i, r] -= (1.0 - t) * force * n[r]
                g[j, r] -= t * force * n[r]
                pull[m, r] += force * n[r]
                press[m, r] += force * n[r]
            press[m, 3] += slope
            geometric = 0.0
            if kind != RELAXED:
                geometric = force / away
            inner_place = 0.0 < t < 1.0
            size = dot(e, e)
            turn = geometric / size if inner_place and size > 1e-24 else 0.0
            a, b = 1.0 - t, t
            for r in range(3):
                qi, qj = a * e[r] - d[r], b * e[r] + d[r]
                for c in range(3):
                    k = (slope + geometric) * n[r] * n[c]
                    across = (1.0 if r == c else 0.0) - (0.0 if past else u[r] * u[c])
                    k -= geometric * across
                    pi, pj = a * e[c] - d[c], b * e[c] + d[c]
                    if c <= r:
                        diagonal[i, r, c] += a * a * k + turn * qi * pi
                        diagonal[j, r, c] += b * b * k + turn * qj * pj
                    if ends[element, 3]:
                        block[ends[element, 2], c, r] += a * b * k + turn * qi * pj
                    else:
                        block[ends[element, 2], r, c] += a * b * k + turn * qi * pj
    return energy, clear


@inner
def clear_of_rods(
    x: Floats, ends: Ints, stiff: Floats, rods: Floats, step: Floats, fraction: float
) -> float:
    """Return the part of a step, at most `fraction`, that brings no element too near to a rod."""
    for m in range(rods.shape[0]):
        if rods[m, IN_USE] == 0.0:
            continue
        for element in range(ends.shape[0]):
            if stiff[element, 0] == 0.0:
                continue
            i, j = ends[element, 0], ends[element, 1]
            _, _, d = approach(x, i, j, rods[m])
            away = math.sqrt(dot(d, d))
            nearer = 0.0
            for n in (i, j):
                to = (step[n, 0], step[n, 1], step[n, 2])
                nearer = max(nearer, -dot(d, to) / away)
            if fraction * nearer > NEARER * away:
                fraction = NEARER * away / nearer
    return fraction


@inner
def lead_rods(s: State, fraction: float) -> None:
    """Write the rods' steps to their targets, of which they are to go a fraction."""
    for m in range(s.rods.shape[0]):
        for r in range(3):
            s.rods_step[m, r] = s.rods_to[m, TIP + r] - s.rods[m, TIP + r]
        p = (s.press[m, 0], s.press[m, 1], s.press[m, 2])
        size = math.sqrt(dot(p, p))
        if size <= HELD_FROM * HELD_BACK:
            continue
        most = (HELD_BACK - size) / (fraction * s.press[m, 3])
        too_far = dot(p, (s.rods_step[m, 0], s.rods_step[m, 1], s.rods_step[m, 2])) / size - most
        if too_far > 0.0:
            for r in range(3):
                s.rods_step[m, r] -= too_far / size * p[r]


@outer
def nearest_core(s: State, rod: Floats) -> float:
    """Return how near a rod's axis would be to a tube's, over the radius of the core, at most 1."""
    least = 1.0
    for element in range(s.h.size):
        if s.stiff[element, 0] == 0.0:
            continue
        i, j = s.ends[element, 0], s.ends[element, 1]
        _, _, d = approach(s.x, i, j, rod)
        rho = CORE * (0.5 * (s.thick[i, 0] + s.thick[j, 0]) + rod[RADIUS])
        least = min(least, math.sqrt(dot(d, d)) / rho)
    return least


@outer
def rods_clear_of(s: State, fraction: float) -> float:
    """Return the part of the rods' steps, at most `fraction`, that is clear."""
    # 0 where a rod is as near to an element as it can come and would have to go nearer.
    for m in range(s.rods.shape[0]):
        if s.rods[m, IN_USE] == 0.0:
            continue
        to = (s.rods_step[m, 0], s.rods_step[m, 1], s.rods_step[m, 2])
        for element in range(s.h.size):
            if s.stiff[element, 0] == 0.0:
                continue
            i, j = s.ends[element, 0], s.ends[element, 1]
            _, _, d = approach(s.x, i, j, s.rods[m])
            away = math.sqrt(dot(d, d))
            nearer = dot(d, to) / away
            if fraction * nearer > NEARER * away:
                rho = CORE * (0.5 * (s.thick[i, 0] + s.thick[j, 0]) + s.rods[m, RADIUS])
                fraction = NEARER * away / nearer if away > NEAREST * rho else 0.0
    return fraction
