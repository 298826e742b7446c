"""The forces of a section whose wall is a solid of fibres, from seven of them.

A fibre of stretch lam and shear gam has the energy of `physics.exact.fibre_laws`, in E: that of
an exponential one, or the neo-Hookean

    psi = (G/2) ((lam^2 + gam^2)/j^2 + 2 j/lam - 3) + (K/2) (j^3 - 1)^2,  stationary in j.

Six fibres lie on a hexagon about the axis and one on it. Bent in a plane through two of the
hexagon's corners or between two, they are the three fibres of the plane law: distance y and weight
w of those are the hexagon's radius 2 y/sqrt(3), a weight w/2 for each corner and 1 - 3 w for the
middle (`physics.section.Ring.fibres`). So the rule is exact to the fifth power of the distance all
round, from a full disc to a thin ring. Of a section that is not equally stiff both ways the hexagon
is stretched likewise. With lam = 1 + Gamma_1, gam^2 = Gamma_2^2 + Gamma_3^2 and
u_i = kappa . r_i the energy of an element for each mm is

    E A (sum w_i psi(lam + t u_i, gam) - deficit (t/lam)^2 gam^2 / (2 (1 + gam^2)))

with the lateral stretch t(lam) of the plane law's `shrinkage`, and deficit what warping takes off
the shear stiffness (by the exponential law deficit gam^2/2). Torsion stays linear. Below the
stretch `LEAST`, where the neo-Hookean volume may jump, a fibre's force goes on in a straight line
with the slope `STIFF`, in E.
"""

import math

import numpy as np

from kernel_cache import kernel
from physics.bed.kernels.vectors import Floats, Ints, Nine, Three, added, inlined, inner, scaled
from physics.exponential import MOST, exponential_stress

# Columns of a table of walls: E A, N; the plane law's outer fibres, their distances, mm, where the
# section bends by kappa_2 and by kappa_3, and their weight; the share of warping, shear modulus and
# G/(3 K) in E; constants of the lateral stretch; distances of the outermost fibres, mm; the
# exponential law's constant, below zero by the neo-Hookean one; and of an
# element the factors of Gamma_2^2 and Gamma_3^2 that leave bending within it out of gam^2.
STRENGTH, REACH_2, REACH_3, WEIGHT, DEFICIT, SHEAR, RATIO, SHRINK, POISSON = range(9)
OUTER_2, OUTER_3, STIFFENING, SOFT_2, SOFT_3 = range(9, 14)
WALL_ROWS = 14
LEAST, STIFF, TINY = 0.5, 3.0, 1e-300
# Of the strains of a section under given forces: most steps, the farthest of them and the last one,
# in its stretch.
MOST_STEPS, FARTHEST, ENOUGH = 30, 0.5, 1e-7
# Rows of a table of fibres, a column each: seven of a section one after the other.
STRETCH, SQUARE, ENERGY, PULL, PULL_S, PULL_G, CROSS, MORE = range(8)
FIBRE_ROWS, FIBRES = 8, 7
HALF_ROOT = 0.8660254037844386
"""Half the square root of 3."""

Section = tuple[
    float, float, float, float, float, float, float, float, float, float, float, float, float,
    float, float,
]  # fmt: skip


@inlined
def lateral(wall: Floats, row: int, lam: float) -> tuple[Three, Three]:
    """Return the lateral stretch t and the warping's (t/lam)^2, each with two derivatives."""
    by, bend = 1.0, 0.0
    if lam < LEAST:
        down = 1.0 / (2.0 * LEAST - lam)
        lam = LEAST * LEAST * down
        by = lam * down
        bend = 2.0 * by * down
    shrink, poisson = wall[row, SHRINK], wall[row, POISSON]
    down = 1.0 / (1.0 + (shrink + poisson) * (lam - 1.0))
    t = (1.0 + shrink * (lam - 1.0)) * down
    t1 = -poisson * down * down
    t2 = -2.0 * (shrink + poisson) * t1 * down
    over = 1.0 / lam
    u = t * over
    u1 = (t1 - u) * over
    u2 = (t2 - 2.0 * u1) * over
    v1, v2 = 2.0 * u * u1, 2.0 * (u1 * u1 + u * u2)
    return (t, t1 * by, t2 * by * by + t1 * bend), (u * u, v1 * by, v2 * by * by + v1 * bend)


@inner
def place_fibres(
    fibres: Floats, first: int, wall: Floats, row: int, lam: float, square: float, k2: float,
    k3: float,
) -> None:  # fmt: skip
    """Write the stretches and gam^2 of a section's seven fibres."""
    t = lateral(wall, row, lam)[0][0]
    one, two = wall[row, REACH_3] * t * k3 / HALF_ROOT, wall[row, REACH_2] * t * k2
    each = (0.0, one, 0.5 * one + two, -0.5 * one + two)
    for i in range(4):
        fibres[STRETCH, first + i] = lam + each[i]
    for i in range(1, 4):
        fibres[STRETCH, first + 3 + i] = lam - each[i]
    for i in range(FIBRES):
        fibres[SQUARE, first + i] = square


@inner
def fill_fibres(
    stretch: Floats, square: Floats, energy: Floats, p: Floats, s: Floats, pg: Floats, qg: Floats,
    more: Floats, g: float, ratio: float,
) -> None:  # fmt: skip
    """Write energy, p and p_lam of fibres; p_gam and q over gam, and what q_gam has beyond q/gam.

    The last is over gam^2. One loop without branches, which the compiler takes several at once.
    """
    for i in range(stretch.size):
        lam, sq = stretch[i], square[i]
        squeezed = min(lam - LEAST, 0.0)
        lam = max(lam, LEAST)
        i1 = lam * lam + sq
        over = 1.0 / lam
        goal = ratio * i1
        # j^8 - j^5 + ratio (j^3/lam - lam^2 - gam^2) = 0 from a rational guess by three of Halley's
        # steps: each triples the digits.
        push = 0.5 * (i1 - over)
        beyond = 2.0 * ratio + 0.6 * push if push > 0.0 else 0.0
        j = 1.0 + 2.0 * ratio * push / (3.0 + 6.0 * ratio + beyond)
        slope = j3 = 0.0
        for _ in range(3):
            j2 = j * j
            j3 = j2 * j
            value = j3 * (j2 * (j3 - 1.0) + ratio * over) - goal
            slope = j2 * (j2 * (8.0 * j3 - 5.0) + 3.0 * ratio * over)
            curve = j * (j2 * (28.0 * j3 - 10.0) + 3.0 * ratio * over)
            j -= value * slope / (slope * slope - value * curve)
        j2 = j * j
        j3 = j2 * j
        in1 = 1.0 / j
        in2, o2 = in1 * in1, over * over
        volume = (i1 - j3 * over) * in2 * in2 * in1
        psi = 0.5 * g * (i1 * in2 + 2.0 * j * over - 3.0 + ratio * volume * volume / 3.0)
        slope = ratio / (j2 * (j2 * (8.0 * j3 - 5.0) + 3.0 * ratio * over))
        gi3 = 2.0 * g * in2 * in1
        p_j = -lam * gi3 - g * o2
        first = g * (lam * in2 - j * o2)
        second = g * (in2 + 2.0 * j * o2 * over) + p_j * (j3 * o2 + 2.0 * lam) * slope
        third = 2.0 * p_j * slope
        energy[i] = psi + squeezed * (first + 0.5 * STIFF * squeezed)
        p[i] = first + STIFF * squeezed
        s[i] = STIFF if squeezed < 0.0 else second
        pg[i] = third
        qg[i] = g * in2 + third * squeezed
        more[i] = -2.0 * gi3 * slope


@inner
def section_forces(
    fibres: Floats, at: int, wall: Floats, row: int, lam: float, square: float, k2: float, k3: float
) -> Section:
    """Return energy, n, q/gam, m_2, m_3 and their derivatives of seven fibres, in E A."""
    # The derivatives: n_lam, n_gam/gam, (q_gam - q/gam)/gam^2, n_k2, n_k3, q_k2/gam, q_k3/gam,
    # m_22, m_23, m_33.
    near, w = wall[row, REACH_2], 0.5 * wall[row, WEIGHT]
    (t, t1, t2), warping = lateral(wall, row, lam)
    deficit = wall[row, DEFICIT]
    warp, warp1, warp2 = deficit * warping[0], deficit * warping[1], deficit * warping[2]
    fade = 1.0 / (1.0 + square)
    half, fade2 = 0.5 * square * fade, fade * fade
    warp_more = 4.0 * warp * fade2 * fade
    if wall[row, STIFFENING] >= 0.0:  # as much in whatever stretch and shear
        warp, warp1, warp2, half, fade2, warp_more = deficit, 0.0, 0.0, 0.5 * square, 1.0, 0.0
    middle = 1.0 - 6.0 * w
    energy = middle * fibres[ENERGY, at] - warp * half
    n = middle * fibres[PULL, at] - warp1 * half
    q = middle * fibres[CROSS, at] - warp * fade2
    n_lam = middle * fibres[PULL_S, at] - warp2 * half
    n_gam = middle * fibres[PULL_G, at] - warp1 * fade2
    q_more = middle * fibres[MORE, at] + warp_more
    m2 = m3 = n2 = n3 = q2 = q3 = m22 = m23 = m33 = 0.0
    far = wall[row, REACH_3] / HALF_ROOT
    corners = ((0.0, far), (near, 0.5 * far), (near, -0.5 * far))
    for corner in range(3):
        a, b = corners[corner]
        bent = k2 * a + k3 * b
        # A pair of opposite fibres, i and k: sums and differences.
        i, k = at + 1 + corner, at + 4 + corner
        up, low = 1.0 + t1 * bent, 1.0 - t1 * bent
        p1, p2 = w * fibres[PULL, i], w * fibres[PULL, k]
        s1, s2 = w * fibres[PULL_S, i], w * fibres[PULL_S, k]
        g1, g2 = w * fibres[PULL_G, i], w * fibres[PULL_G, k]
        energy += w * (fibres[ENERGY, i] + fibres[ENERGY, k])
        n += p1 * up + p2 * low
        q += w * (fibres[CROSS, i] + fibres[CROSS, k])
        n_lam += s1 * up * up + s2 * low * low + (p1 - p2) * t2 * bent
        n_gam += g1 * up + g2 * low
        q_more += w * (fibres[MORE, i] + fibres[MORE, k])
        f = (p1 - p2) * t
        m2 += f * a
        m3 += f * b
        f = (s1 * up - s2 * low) * t + (p1 - p2) * t1
        n2 += f * a
        n3 += f * b
        f = (g1 - g2) * t
        q2 += f * a
        q3 += f * b
        f = (s1 + s2) * t * t
        m22 += f * a * a
        m23 += f * a * b
        m33 += f * b * b
    return energy, n, q, m2, m3, n_lam, n_gam, q_more, n2, n3, q2, q3, m22, m23, m33


@inner
def congruent(m: Nine, t1: Three, t2: Three, t3: Three) -> Nine:
    """Return R m R^T, R of the columns t1, t2, t3."""
    a = added(added(scaled(t1, m[0]), scaled(t2, m[1])), scaled(t3, m[2]))
    b = added(added(scaled(t1, m[3]), scaled(t2, m[4])), scaled(t3, m[5]))
    c = added(added(scaled(t1, m[6]), scaled(t2, m[7])), scaled(t3, m[8]))
    return (
        t1[0] * a[0] + t2[0] * b[0] + t3[0] * c[0],
        t1[0] * a[1] + t2[0] * b[1] + t3[0] * c[1],
        t1[0] * a[2] + t2[0] * b[2] + t3[0] * c[2],
        t1[1] * a[0] + t2[1] * b[0] + t3[1] * c[0],
        t1[1] * a[1] + t2[1] * b[1] + t3[1] * c[1],
        t1[1] * a[2] + t2[1] * b[2] + t3[1] * c[2],
        t1[2] * a[0] + t2[2] * b[0] + t3[2] * c[0],
        t1[2] * a[1] + t2[2] * b[1] + t3[2] * c[1],
        t1[2] * a[2] + t2[2] * b[2] + t3[2] * c[2],
    )


@inner
def fill_exponential(
    stretch: Floats, square: Floats, energy: Floats, p: Floats, s: Floats, pg: Floats, qg: Floats,
    more: Floats, g: float, stiffening: float,
) -> None:  # fmt: skip
    """Write the same of fibres that stiffen exponentially."""
    most = MOST / stiffening if stiffening > 0.0 else 1e300
    for i in range(stretch.size):
        lam, sq = stretch[i], square[i]
        length = math.sqrt(lam * lam + sq + TINY)
        stress, slope, stored = exponential_stress(max(length - 1.0, 0.0), stiffening, most)
        slope = slope if length >= 1.0 else 0.0
        squeezed = min(lam - 1.0, 0.0)
        over = 1.0 / length
        per = stress * over
        cross = (slope - per) * over * over
        energy[i] = stored + 0.5 * (squeezed * squeezed + g * sq)
        p[i] = lam * per + squeezed
        s[i] = per + lam * lam * cross + (1.0 if lam < 1.0 else 0.0)
        pg[i] = lam * cross
        qg[i] = per + g
        more[i] = cross


@inner
def fill_all(fibres: Floats, wall: Floats, row: int) -> None:
    """Write what the fibres of a table do, of the material of a row of `wall`."""
    if wall[row, STIFFENING] >= 0.0:
        fill_exponential(
            fibres[STRETCH], fibres[SQUARE], fibres[ENERGY], fibres[PULL], fibres[PULL_S],
            fibres[PULL_G], fibres[CROSS], fibres[MORE], wall[row, SHEAR], wall[row, STIFFENING],
        )  # fmt: skip
    else:
        fill_fibres(
            fibres[STRETCH], fibres[SQUARE], fibres[ENERGY], fibres[PULL], fibres[PULL_S],
            fibres[PULL_G], fibres[CROSS], fibres[MORE], wall[row, SHEAR], wall[row, RATIO],
        )  # fmt: skip


@inner
def node_stress(
    fibres: Floats, wall: Floats, row: int, n: float, m2: float, m3: float, lam: float,
    square: float, k2: float, k3: float,
) -> Three:  # fmt: skip
    """Return the outermost fibre's stress, in E, and the part of each curvature in the bending."""
    # The strains at which the section has the forces n, m_2 and m_3, in E A, by Newton's method
    # from those in the middle of the element; no fibre is stretched by more than half at once.
    outer2, outer3 = wall[row, OUTER_2], wall[row, OUTER_3]
    for _ in range(MOST_STEPS):
        place_fibres(fibres, 0, wall, row, lam, square, k2, k3)
        fill_all(fibres, wall, row)
        found = section_forces(fibres, 0, wall, row, lam, square, k2, k3)
        r1, r2, r3 = n - found[1], m2 - found[3], m3 - found[4]
        a, b, c, d, e, f = found[5], found[8], found[9], found[12], found[13], found[14]
        c11, c12, c13 = d * f - e * e, c * e - b * f, b * e - c * d
        c22, c23, c33 = a * f - c * c, b * c - a * e, a * d - b * b
        over = 1.0 / (a * c11 + b * c12 + c * c13)
        d1 = over * (c11 * r1 + c12 * r2 + c13 * r3)
        d2 = over * (c12 * r1 + c22 * r2 + c23 * r3)
        d3 = over * (c13 * r1 + c23 * r2 + c33 * r3)
        far = abs(d1) + outer2 * abs(d2) + outer3 * abs(d3)
        fraction = min(1.0, FARTHEST * lam / far) if far > 0.0 else 1.0
        lam += fraction * d1
        k2 += fraction * d2
        k3 += fraction * d3
        if far < ENOUGH * lam:
            break
    b2, b3 = outer2 * k2, outer3 * k3
    bent = math.sqrt(b2 * b2 + b3 * b3)
    fibres[STRETCH, 0] = lam + lateral(wall, row, lam)[0][0] * bent
    fill_all(fibres, wall, row)
    over = 1.0 / bent if bent > 0.0 else 0.0
    return fibres[PULL, 0], over * b2, over * b3


@kernel(error_model="numpy", nogil=True, _nrt=True)  # it makes an array
def end_stresses(
    section: Floats, strained: Floats, wall: Floats, sections: Floats, out: Floats
) -> None:
    """Write the (N - 1, 2, 3) nominal normal stress and both of bending at elements' ends, MPa.

    `wall` and `sections` are (N - 1, 2, ...) at those ends; bending is what the outermost fibre
    has beyond the mean.
    """
    fibres = np.empty((FIBRE_ROWS, FIBRES))
    for e in range(section.shape[0]):
        for end in range(2):
            n, area = section[e, 9 + end], sections[e, end, 0]
            force = wall[e, end, STRENGTH]
            out[e, end, 0] = n / area
            out[e, end, 1] = out[e, end, 2] = 0.0
            if section[e, 0] == 0.0 and section[e, 4 + 3 * end] == 0.0:
                continue  # at rest, or torn
            most, up, across = node_stress(
                fibres, wall[e], end, n / force, section[e, 4 + 3 * end] / force,
                section[e, 5 + 3 * end] / force, strained[e, 0], strained[e, 1], strained[e, 2],
                strained[e, 3],
            )  # fmt: skip
            bending = max(most * force / area - n / area, 0.0)
            out[e, end, 1], out[e, end, 2] = bending * up, bending * across


@kernel(error_model="numpy")
def nominal_stresses(section: Floats, wall: Floats, out: Floats) -> None:
    """Write the same as forces and moments over what the wall has for them at rest."""
    for e in range(section.shape[0]):
        for end in range(2):
            out[e, end, 0] = section[e, 9 + end] / wall[e, end, 0]
            out[e, end, 1] = section[e, 4 + 3 * end] / wall[e, end, 1]
            out[e, end, 2] = section[e, 5 + 3 * end] / wall[e, end, 2]


@kernel(error_model="numpy")
def worst_stresses(stresses: Floats, firsts: Ints, found: Floats) -> None:
    """Write the node of each tube under the largest of these stresses, and its three."""
    for tube in range(found.shape[0]):
        largest, first = 0.0, firsts[tube]
        found[tube] = 0.0
        for element in range(first, firsts[tube + 1]):
            for end in range(2):
                normal = stresses[element, end, 0]
                up, across = stresses[element, end, 1], stresses[element, end, 2]
                total = normal + math.sqrt(up * up + across * across)
                if total > largest:
                    largest, found[tube, 0] = total, element - first + end
                    found[tube, 1], found[tube, 2], found[tube, 3] = normal, up, across
