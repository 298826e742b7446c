"""The compiled part of the geometrically exact beam: Newton's method on its rotations.

Everything here is without units: lengths are parts of the span S, forces parts of E A and moments
parts of E A S (A the mean area), so that one set of tolerances serves every beam.

Symbols: ``h`` and ``p`` the force in the beam along the clamp line and along the pull, constant
over a part between a clamp and the grasp; ``theta`` rotation of the section, ``kappa`` its
derivative along the axis at rest; ``n = h cos + p sin`` tension and ``q = p cos - h sin`` shear;
``lam`` and ``gam`` stretch and shear strain, with x' = lam cos - gam sin and
y' = lam sin + gam cos; ``m`` moment, with m' = -(lam q - gam n).

Method. psi(kappa, n, q) is the energy of a section less n lam + q gam, at the strains that make
that least, so that its derivatives are m, -lam and -gam. The equilibrium makes
sum psi + h X + p Y stationary in the rotations and in h and p, where X and Y are the lengths that
a part has to span. Rotations are quadratic over an element (its two ends and a bubble between)
and psi is summed at its two Gauss points: of fourth order, symmetric, and with forces that are
the derivatives of the summed energy to the last digit. Bubbles are condensed; what is left is
tridiagonal with a border of h and p. By Sylvester's law of inertia the pivots count the ways in
which the energy can fall: an equilibrium is stable when there are as many negative pivots as
unknown forces.

A beam may be grasped at a second place: three parts, each with its p. A grip with compliance c, a
spring between the beam and what leads it, has the term - c (pull)^2 / 2 in the forces.

A section whose centroid lies off the axis by e, towards the pull, has the energy of the same
section on the axis at the stretch lam - e kappa of its centroid: psi gets a term - e n kappa,
whatever the law.

The strains of the neo-Hookean section have no closed form. Each Gauss point keeps them and their
derivatives, brings them up to date by one Newton step whenever the rotations have moved, and what
that step leaves is condensed too: the whole converges as one Newton method.

The whole chain is in one file because cached machine code does not notice a change in another.
Numba compiles a function once more for each constant that it is called with: `int(...)` around
one spares that, and loops are written out because assignments of whole arrays take it seconds.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]
State = tuple[Array, Array, Array, Array, Array]
"""Nodes, elements, points, fibres and line; their rows and entries are named below."""
Five = tuple[float, float, float, float, float]
Six = tuple[float, float, float, float, float, float]

LINEAR, NEO_HOOKE = 0, 1
"""Material laws."""

BY_FORCE, BY_DEFLECTION = 0, 1
"""What is prescribed: the pull, or where its far end is, beyond the grip's compliance."""

FOUND, LOST, UNSTABLE, GIVES_WAY, SQUEEZED, OUT_OF_REACH = 0, 1, 2, 3, 4, 5
"""Outcomes: an equilibrium; Newton's method lost the way; it would not stay; a section has no
stiffness left; a fibre is squeezed to almost nothing; the force is not met within `FARTHEST`."""

# Rows of `nodes`, a column per node: its rotation, then what the elimination needs to go back.
ROTATION, PIVOT, OFF, DOWN_R, DOWN_H, DOWN_P, DOWN_Q, DOWN_S = range(8)
NODE_ROWS = 8

# Rows of `elements`: length, height of the bubble, and the bubble's row divided by its pivot.
LENGTH, BUBBLE, BUBBLE_R, BUBBLE_A, BUBBLE_D, BUBBLE_H, BUBBLE_P = range(7)
ELEMENT_ROWS = 7

# Rows of `points`, two columns per element: rotation, sine, cosine and curvature; moment and the
# derivatives of psi by theta (T), h, p and kappa (K), where X = -psi_h and Y = -psi_p; the section.
ANGLE, SIN, COS, KAPPA = range(4)
MOMENT, T, X, Y, TT, TH, TP, HH, HP, PP, KK, KT, KH, KP = range(4, 18)
OFFSET = 18
BENDING, STRETCHING, SHEARING = range(19, 22)
LINEAR_ROWS = 22
# The same for a neo-Hookean section, and its strains, their derivatives, and what the law makes
# of them.
AREA, REACH, WEIGHT, DEFICIT = range(19, 23)
LAM, GAM, LAM_N, LAM_Q, GAM_Q, LAM_K, GAM_K, LAW_N, LAW_Q, LAW_K, STIFFNESS = range(23, 34)
NEO_HOOKE_ROWS = 34

# Rows of `fibres`: three blocks of as many columns as `points`, the middle and the two outer ones.
STRETCH, SHEAR, VOLUME, PULL, PULL_S, PULL_G, CROSS, CROSS_G = range(8)
FIBRE_ROWS = 8

# Entries of `line`: the unknown forces (of the parts across), loads, negative pivots too many;
# constants of the material; the last equilibrium before a failure; whether a centroid is off axis;
# the compliance of the grips; the node of the second grasp (the last one when there is none), what
# is prescribed there and how much; room for the equations of the forces.
H, P1, P2, P3, FORCE, DEFLECTION, FORCE_2, DEFLECTION_2, NEGATIVE = range(9)
SHEAR_MODULUS, RATIO, SHRINK, POISSON, LAST_FORCE, LAST_DEFLECTION = range(9, 15)
ECCENTRIC, COMPLIANCE, COMPLIANCE_2, SECOND, CONTROL_2, TARGET_2 = range(15, 21)
EQUATIONS = 21
LINE_SIZE = EQUATIONS + 20

GAUSS = 0.5 / math.sqrt(3.0)
"""Distance of a Gauss point from the middle of its element, in lengths of the element."""
SLOPE = 4.0 / math.sqrt(3.0)
"""Slope of a bubble of height 1 at the Gauss points, per length of the element."""
BULGE = 2.0 / 3.0
"""Height of a bubble of height 1 at the Gauss points."""

WARM, TIGHT = 1e-6, 1e-9
"""Updates relative to the rotations and forces; Newton leaves about the square of the last one."""
LARGEST_TURN, FARTHEST_TURN = 1.0, 3.0
"""Update of a rotation, and rotation, beyond which Newton's method has strayed, rad."""
PAST = 1e-2
"""Shear of the wrong sign, relative to the force, that is taken for an error of the mesh."""
FLOOR, FLAT = 1e-5, 1e-4
"""Force, in E A, and rotation, rad, below which updates are held against these: strains are
differences from 1, so that the last digits of what is smaller are rounding."""
LEAST_STRETCH = 0.02
"""Stretch of a fibre of the section below which the neo-Hookean law is not followed."""
MOST_STEPS = 14
"""Newton steps before a shorter move is tried."""
FIRST_STEP = 0.05
"""First deflection of a pull from rest, in lengths of the shorter part."""
LONGEST_MOVE = 0.5
"""Largest change, relative to the last load, that is tried in one go."""
FARTHEST = 1000.0
"""Deflection, in spans, beyond which a force is not sought."""


@njit(cache=True)
def fill_sines(points: Array) -> None:
    """Fill the sines and cosines: Cody and Waite's reduction, Taylor-like minimax polynomials.

    Without branches and calls, so that the compiler makes it eight at a time.
    """
    for i in range(points.shape[1]):
        x = points[ANGLE, i]
        k = math.floor(x * 0.6366197723675814 + 0.5)
        y = (x - k * 1.5707963267341256) - k * 6.077100506506192e-11
        z = y * y
        s = 1.5896909952115501e-10 * z - 2.5050760253406863e-08
        s = (s * z + 2.7557313707070068e-06) * z - 1.984126982985795e-04
        s = (s * z + 8.33333333332249e-03) * z - 1.6666666666666632e-01
        s = s * z * y + y
        c = 2.0875723212981748e-09 - 1.1359647557788195e-11 * z
        c = (c * z - 2.7557314351390663e-07) * z + 2.480158728947673e-05
        c = (c * z - 1.388888888887411e-03) * z + 4.1666666666666602e-02
        c = c * z * z - 0.5 * z + 1.0
        halves = 0.5 * k
        odd = halves - math.floor(halves) > 0.25
        quarter = 0.5 * halves - math.floor(0.5 * halves)
        a = c if odd else s
        b = s if odd else c
        points[SIN, i] = -a if quarter > 0.375 else a
        points[COS, i] = -b if (quarter > 0.125 and quarter < 0.625) else b


@njit(cache=True, error_model="numpy")
def fill_linear(points: Array, first: int, last: int, h: float, p: float) -> None:
    """Fill moment and derivatives of psi of linear sections."""
    for i in range(first, last):
        sin, cos = points[SIN, i], points[COS, i]
        stretching, shearing = points[STRETCHING, i], points[SHEARING, i]
        n, q = h * cos + p * sin, p * cos - h * sin
        lam, gam = 1.0 + stretching * n, shearing * q
        along, across = lam * cos - gam * sin, lam * sin + gam * cos
        lam_t, gam_t = stretching * q, shearing * n  # the second with its sign turned
        cos2, sin2 = cos * cos, sin * sin
        points[MOMENT, i] = points[BENDING, i] * points[KAPPA, i]
        points[T, i] = gam * n - lam * q
        points[X, i] = along
        points[Y, i] = across
        points[TT, i] = lam * n + gam * q - lam_t * q - gam_t * n
        points[TH, i] = across - lam_t * cos - gam_t * sin
        points[TP, i] = gam_t * cos - along - lam_t * sin
        points[HH, i] = -stretching * cos2 - shearing * sin2
        points[HP, i] = (shearing - stretching) * sin * cos
        points[PP, i] = -stretching * sin2 - shearing * cos2


@njit(cache=True, error_model="numpy")
def shrinkage(lam: float, shrink: float, poisson: float) -> tuple[float, float, float]:
    """Return the lateral stretch of a section and its first and second derivative by lam."""
    down = 1.0 / (1.0 + (shrink + poisson) * (lam - 1.0))
    t1 = -poisson * down * down
    return (1.0 + shrink * (lam - 1.0)) * down, t1, -2.0 * (shrink + poisson) * t1 * down


@njit(cache=True, error_model="numpy")
def fibre(
    lam: float, gam: float, j: float, g: float, ratio: float
) -> tuple[float, float, float, float, float, float]:
    """Return j, p, p_lam, p_gam, q and q_gam of a neo-Hookean fibre of shear modulus g."""
    square = ratio * lam * (lam * lam + gam * gam)
    j2 = j * j
    j3 = j2 * j
    slope = 1.0 / (j2 * (lam * j2 * (8.0 * j3 - 5.0) + 3.0 * ratio))
    step = (j3 * (lam * j2 * (j3 - 1.0) + ratio) - square) * slope
    bend = j * (lam * j2 * (28.0 * j3 - 10.0) + 3.0 * ratio) * slope
    # Far from the root the bend is not trusted to more than double the step.
    step /= 1.0 - min(step * bend, 0.5)
    j -= min(max(step, -0.5 * j), 0.5 * j)
    both = 1.0 / (lam * j)
    over, i1 = j * both, lam * both
    i2, o2 = i1 * i1, over * over
    j_lam = ratio * lam * (j * j * j * o2 + 2.0 * lam) * slope
    j_gam = 2.0 * ratio * lam * gam * slope
    gi3 = 2.0 * g * i2 * i1
    p_j = -lam * gi3 - g * o2
    return (
        j,
        g * (lam * i2 - j * o2),
        g * (i2 + 2.0 * j * o2 * over) + p_j * j_lam,
        p_j * j_gam,
        g * gam * i2,
        g * i2 - gam * gi3 * j_gam,
    )


@njit(cache=True, error_model="numpy")
def fill_fibres(fibres: Array, g: float, ratio: float, rounds: int) -> None:
    """Fill volume and stress of fibres from their stretch and shear."""
    for _ in range(rounds):
        for i in range(fibres.shape[1]):
            j, p, p_s, p_g, q, q_g = fibre(
                fibres[STRETCH, i], fibres[SHEAR, i], fibres[VOLUME, i], g, ratio
            )
            fibres[VOLUME, i] = j
            fibres[PULL, i] = p
            fibres[PULL_S, i] = p_s
            fibres[PULL_G, i] = p_g
            fibres[CROSS, i] = q
            fibres[CROSS_G, i] = q_g


@njit(cache=True, error_model="numpy")
def fill_strains(
    points: Array,
    fibres: Array,
    first: int,
    last: int,
    h: float,
    p: float,
    shrink: float,
    poisson: float,
) -> None:
    """Bring the strains of neo-Hookean sections up to date with the rotations and forces.

    The fibres lie at 0 and +-y and stretch by lam -+ kappa y t, t the section's lateral stretch.
    """
    count = points.shape[1]
    for i in range(first, last):
        sin, cos, kappa = points[SIN, i], points[COS, i], points[KAPPA, i]
        dn = h * cos + p * sin - points[LAW_N, i]
        dq = p * cos - h * sin - points[LAW_Q, i]
        dk = kappa - points[LAW_K, i]
        lam_q = points[LAM_Q, i]
        lam = points[LAM, i] + points[LAM_N, i] * dn + lam_q * dq + points[LAM_K, i] * dk
        gam = points[GAM, i] + lam_q * dn + points[GAM_Q, i] * dq + points[GAM_K, i] * dk
        t, _, _ = shrinkage(lam, shrink, poisson)
        kyt = kappa * points[REACH, i] * t
        points[LAM, i] = lam
        points[GAM, i] = gam
        fibres[STRETCH, i] = lam
        fibres[STRETCH, i + count] = lam - kyt
        fibres[STRETCH, i + 2 * count] = lam + kyt
        fibres[SHEAR, i] = gam
        fibres[SHEAR, i + count] = gam
        fibres[SHEAR, i + 2 * count] = gam


@njit(cache=True, error_model="numpy")
def section_law(
    lam: float,
    gam: float,
    kappa: float,
    area: float,
    y: float,
    outer: float,
    deficit: float,
    shrink: float,
    poisson: float,
    middle_fibre: Five,
    near_fibre: Five,
    far_fibre: Five,
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Return n, q, m and n_lam, n_gam, q_gam, n_k, q_k, m_k of a neo-Hookean section."""
    p0, s0, g0, q0, c0 = middle_fibre
    p1, s1, g1, q1, c1 = near_fibre
    p2, s2, g2, q2, c2 = far_fibre
    middle = 1.0 - 2.0 * outer
    t, t1, t2 = shrinkage(lam, shrink, poisson)
    over = 1.0 / lam
    u = t * over
    u1 = (t1 - u) * over
    u2 = (t2 - 2.0 * u1) * over
    warp, warp1 = deficit * u * u, 2.0 * deficit * u * u1
    warp2 = 2.0 * deficit * (u1 * u1 + u * u2)
    # Shear squared, halved, as far as warping follows it, and its derivatives.
    fade = 1.0 / (1.0 + gam * gam)
    v, v1 = 0.5 * gam * gam * fade, gam * fade * fade
    v2 = (1.0 - 3.0 * gam * gam) * fade * fade * fade
    ky, yt = kappa * y, y * t
    a1, a2 = 1.0 - ky * t1, 1.0 + ky * t1
    n = middle * p0 + outer * (p1 * a1 + p2 * a2) - warp1 * v
    q = middle * q0 + outer * (q1 + q2) - warp * v1
    n_lam = middle * s0 - warp2 * v
    n_lam += outer * (s1 * a1 * a1 + s2 * a2 * a2 + (p2 - p1) * ky * t2)
    n_gam = middle * g0 + outer * (g1 * a1 + g2 * a2) - warp1 * v1
    q_gam = middle * c0 + outer * (c1 + c2) - warp * v2
    n_k = outer * ((s2 * a2 - s1 * a1) * yt + (p2 - p1) * y * t1)
    return (
        area * n,
        area * q,
        area * outer * (p2 - p1) * yt,
        area * n_lam,
        area * n_gam,
        area * q_gam,
        area * n_k,
        area * outer * (g2 - g1) * yt,
        area * outer * (s1 + s2) * yt * yt,
    )


@njit(cache=True, error_model="numpy")
def fill_neo_hooke(
    points: Array,
    fibres: Array,
    first: int,
    last: int,
    h: float,
    p: float,
    shrink: float,
    poisson: float,
) -> None:
    """Fill moment and derivatives of psi of neo-Hookean sections from their fibres.

    What n and q still differ from those that the forces ask for is condensed with the strains.
    """
    count = points.shape[1]
    for i in range(first, last):
        j, k = i + count, i + 2 * count
        lam, gam, kappa = points[LAM, i], points[GAM, i], points[KAPPA, i]
        area = points[AREA, i]
        n1, q1, m, n_lam, n_gam, q_gam, n_k, q_k, m_k = section_law(
            lam,
            gam,
            kappa,
            area,
            points[REACH, i],
            points[WEIGHT, i],
            points[DEFICIT, i],
            shrink,
            poisson,
            (
                fibres[PULL, i],
                fibres[PULL_S, i],
                fibres[PULL_G, i],
                fibres[CROSS, i],
                fibres[CROSS_G, i],
            ),
            (
                fibres[PULL, j],
                fibres[PULL_S, j],
                fibres[PULL_G, j],
                fibres[CROSS, j],
                fibres[CROSS_G, j],
            ),
            (
                fibres[PULL, k],
                fibres[PULL_S, k],
                fibres[PULL_G, k],
                fibres[CROSS, k],
                fibres[CROSS_G, k],
            ),
        )
        determinant = n_lam * q_gam - n_gam * n_gam
        over = 1.0 / determinant
        lam_n, lam_q, gam_q = q_gam * over, -n_gam * over, n_lam * over
        lam_k, gam_k = -lam_n * n_k - lam_q * q_k, -lam_q * n_k - gam_q * q_k
        points[LAM_N, i], points[LAM_Q, i], points[GAM_Q, i] = lam_n, lam_q, gam_q
        points[LAM_K, i], points[GAM_K, i] = lam_k, gam_k
        points[LAW_N, i], points[LAW_Q, i], points[LAW_K, i] = n1, q1, kappa
        points[STIFFNESS, i] = min(determinant, n_lam)
        sin, cos = points[SIN, i], points[COS, i]
        n, q = h * cos + p * sin, p * cos - h * sin
        dn, dq = n - n1, q - q1
        lam_d, gam_d = lam_n * dn + lam_q * dq, lam_q * dn + gam_q * dq
        lam += lam_d
        gam += gam_d
        along, across = lam * cos - gam * sin, lam * sin + gam * cos
        lam_t, gam_t = lam_n * q - lam_q * n, lam_q * q - gam_q * n
        lam_h, gam_h = lam_n * cos - lam_q * sin, lam_q * cos - gam_q * sin
        lam_p, gam_p = lam_n * sin + lam_q * cos, lam_q * sin + gam_q * cos
        points[MOMENT, i] = m + n_k * lam_d + q_k * gam_d
        points[T, i] = gam * n - lam * q
        points[X, i] = along
        points[Y, i] = across
        points[TT, i] = lam * n + gam * q - lam_t * q + gam_t * n
        points[TH, i] = across - lam_h * q + gam_h * n
        points[TP, i] = gam_p * n - along - lam_p * q
        points[HH, i] = gam_h * sin - lam_h * cos
        points[HP, i] = gam_p * sin - lam_p * cos
        points[PP, i] = -lam_p * sin - gam_p * cos
        points[KK, i] = m_k + n_k * lam_k + q_k * gam_k
        points[KT, i] = gam_k * n - lam_k * q
        points[KH, i] = gam_k * sin - lam_k * cos
        points[KP, i] = -lam_k * sin - gam_k * cos


@njit(cache=True, error_model="numpy")
def add_offsets(points: Array, first: int, last: int, h: float, p: float) -> None:
    """Add the term - e n kappa of psi, for centroids off the axis."""
    for i in range(first, last):
        offset = points[OFFSET, i]
        sin, cos = points[SIN, i], points[COS, i]
        n, q = h * cos + p * sin, p * cos - h * sin
        stretch = offset * points[KAPPA, i]
        along, across = stretch * cos, stretch * sin
        points[MOMENT, i] -= offset * n
        points[T, i] -= stretch * q
        points[X, i] += along
        points[Y, i] += across
        points[TT, i] += stretch * n
        points[TH, i] += across
        points[TP, i] -= along
        points[KT, i] -= offset * q
        points[KH, i] -= offset * cos
        points[KP, i] -= offset * sin


@njit(cache=True)
def _fill(state: State, law: int, grasp: int, rounds: int) -> None:
    """Fill `points` for the present rotations and forces."""
    nodes, elements, points, fibres, line = state
    for e in range(elements.shape[1]):
        bubble = elements[BUBBLE, e]
        over = 1.0 / elements[LENGTH, e]
        left, right = nodes[ROTATION, e], nodes[ROTATION, e + 1]
        mean, turn = 0.5 * (left + right) + BULGE * bubble, right - left
        points[ANGLE, 2 * e], points[ANGLE, 2 * e + 1] = mean - GAUSS * turn, mean + GAUSS * turn
        points[KAPPA, 2 * e] = (turn + SLOPE * bubble) * over
        points[KAPPA, 2 * e + 1] = (turn - SLOPE * bubble) * over
    fill_sines(points)
    half, rest, count = 2 * grasp, 2 * int(line[SECOND]), points.shape[1]
    h, p1, p2, p3 = line[H], line[P1], line[P2], line[P3]
    if law == LINEAR:
        fill_linear(points, int(0), half, h, p1)
        fill_linear(points, half, rest, h, p2)
        fill_linear(points, rest, count, h, p3)
        if line[ECCENTRIC] != 0.0:
            for i in range(count):
                points[KT, i] = points[KH, i] = points[KP, i] = 0.0
    else:
        shrink, poisson = line[SHRINK], line[POISSON]
        fill_strains(points, fibres, int(0), half, h, p1, shrink, poisson)
        fill_strains(points, fibres, half, rest, h, p2, shrink, poisson)
        fill_strains(points, fibres, rest, count, h, p3, shrink, poisson)
        fill_fibres(fibres, line[SHEAR_MODULUS], line[RATIO], rounds)
        fill_neo_hooke(points, fibres, int(0), half, h, p1, shrink, poisson)
        fill_neo_hooke(points, fibres, half, rest, h, p2, shrink, poisson)
        fill_neo_hooke(points, fibres, rest, count, h, p3, shrink, poisson)
    if line[ECCENTRIC] != 0.0:
        add_offsets(points, int(0), half, h, p1)
        add_offsets(points, half, rest, h, p2)
        add_offsets(points, rest, count, h, p3)


@njit(cache=True)
def _down(
    nodes: Array, elements: Array, points: Array, first: int, last: int, carry: Six
) -> tuple[Six, tuple[float, ...], int]:
    """Sum the equations of a part's elements, eliminating its rotations on the way."""
    d0, r0, h0, p0, q0, s0 = carry
    x_sum = y_sum = 0.0
    s_hh = s_hp = s_pp = s_hq = s_pq = s_qq = s_hr = s_pr = s_qr = 0.0
    s_hs = s_ps = s_qs = s_ss = s_sr = 0.0
    negative = 0
    half_slope = 0.5 * SLOPE
    for e in range(first, last):
        i, j = 2 * e, 2 * e + 1
        w = 0.5 * elements[LENGTH, e]
        wg = w * GAUSS
        over = 0.5 / w
        m1, m2 = points[MOMENT, i], points[MOMENT, j]
        t1, t2 = points[T, i], points[T, j]
        th1, th2 = points[TH, i], points[TH, j]
        tp1, tp2 = points[TP, i], points[TP, j]
        tt1, tt2 = points[TT, i], points[TT, j]
        kk1, kk2 = points[KK, i], points[KK, j]
        kt1, kt2 = points[KT, i], points[KT, j]
        kh1, kh2 = points[KH, i], points[KH, j]
        kp1, kp2 = points[KP, i], points[KP, j]
        # Rows and columns: a the mean of the end rotations, d their difference, b the bubble.
        x_sum += w * (points[X, i] + points[X, j])
        y_sum += w * (points[Y, i] + points[Y, j])
        r_a = w * (t1 + t2)
        r_d = wg * (t2 - t1) + 0.5 * (m1 + m2)
        r_b = BULGE * r_a + half_slope * (m1 - m2)
        h_a = w * (th1 + th2)
        h_d = wg * (th2 - th1) + 0.5 * (kh1 + kh2)
        h_b = BULGE * h_a + half_slope * (kh1 - kh2)
        p_a = w * (tp1 + tp2)
        p_d = wg * (tp2 - tp1) + 0.5 * (kp1 + kp2)
        p_b = BULGE * p_a + half_slope * (kp1 - kp2)
        aa = w * (tt1 + tt2)
        skew = wg * (tt2 - tt1)
        k0 = 0.5 * over * (kk1 + kk2)
        kt = kt2 - kt1
        ad = skew + 0.5 * (kt1 + kt2)
        ab = BULGE * aa - half_slope * kt
        dd = GAUSS * GAUSS * aa + k0 + GAUSS * kt
        db = BULGE * skew + half_slope * over * (kk1 - kk2)
        bb = BULGE * BULGE * aa + SLOPE * SLOPE * k0 - BULGE * SLOPE * kt
        # The bubble out.
        over = 1.0 / bb
        negative += int(bb < 0.0)
        g_r, g_a, g_d, g_h, g_p = r_b * over, ab * over, db * over, h_b * over, p_b * over
        elements[BUBBLE_R, e] = g_r
        elements[BUBBLE_A, e] = g_a
        elements[BUBBLE_D, e] = g_d
        elements[BUBBLE_H, e] = g_h
        elements[BUBBLE_P, e] = g_p
        r_a, r_d = 0.5 * (r_a - ab * g_r), r_d - db * g_r
        h_a, h_d = 0.5 * (h_a - ab * g_h), h_d - db * g_h
        p_a, p_d = 0.5 * (p_a - ab * g_p), p_d - db * g_p
        aa = 0.25 * (aa - ab * g_a)
        ad -= ab * g_d
        dd -= db * g_d
        s_hh += w * (points[HH, i] + points[HH, j]) - h_b * g_h
        s_hp += w * (points[HP, i] + points[HP, j]) - h_b * g_p
        s_pp += w * (points[PP, i] + points[PP, j]) - p_b * g_p
        s_hr -= h_b * g_r
        s_pr -= p_b * g_r
        # The rotation of the first node out, unless it is the clamp's.
        off = inverse = u_r = u_h = u_p = 0.0
        if e > 0:
            pivot = d0 + aa + dd - ad
            inverse = 1.0 / pivot
            negative += int(pivot < 0.0)
            off = aa - dd
            u_r, u_h, u_p = r0 + r_a - r_d, h0 + h_a - h_d, p0 + p_a - p_d
            v_h, v_p, v_q = inverse * u_h, inverse * u_p, inverse * q0
            s_hh -= v_h * u_h
            s_hp -= v_h * u_p
            s_hq -= v_h * q0
            s_pp -= v_p * u_p
            s_pq -= v_p * q0
            s_qq -= v_q * q0
            s_hr -= v_h * u_r
            s_pr -= v_p * u_r
            s_qr -= v_q * u_r
            v_s = inverse * s0
            s_hs -= v_h * s0
            s_ps -= v_p * s0
            s_qs -= v_q * s0
            s_ss -= v_s * s0
            s_sr -= v_s * u_r
        nodes[PIVOT, e] = inverse
        nodes[OFF, e] = off
        nodes[DOWN_R, e] = u_r
        nodes[DOWN_H, e] = u_h
        nodes[DOWN_P, e] = u_p
        nodes[DOWN_Q, e] = q0
        nodes[DOWN_S, e] = s0
        factor = off * inverse
        d0 = aa + dd + ad - factor * off
        r0 = r_a + r_d - factor * u_r
        h0 = h_a + h_d - factor * u_h
        p0 = p_a + p_d - factor * u_p
        q0 *= -factor
        s0 *= -factor
    sums = (x_sum, y_sum, s_hh, s_hp, s_pp, s_hq, s_pq, s_qq, s_hr, s_pr, s_qr)
    return (d0, r0, h0, p0, q0, s0), (*sums, s_hs, s_ps, s_qs, s_ss, s_sr), negative


@njit(cache=True)
def _up(
    nodes: Array,
    elements: Array,
    first: int,
    last: int,
    dh: float,
    dp: float,
    dq: float,
    ds: float,
    beyond: float,
) -> tuple[float, float, float]:
    """Go back through a part; return the first node's change, the largest change and rotation."""
    largest = size = 0.0
    for e in range(last - 1, first - 1, -1):
        change = -nodes[PIVOT, e] * (
            nodes[DOWN_R, e]
            + nodes[DOWN_H, e] * dh
            + nodes[DOWN_P, e] * dp
            + nodes[DOWN_Q, e] * dq
            + nodes[DOWN_S, e] * ds
            + nodes[OFF, e] * beyond
        )
        elements[BUBBLE, e] -= (
            elements[BUBBLE_R, e]
            + elements[BUBBLE_H, e] * dh
            + elements[BUBBLE_P, e] * dp
            + elements[BUBBLE_A, e] * 0.5 * (change + beyond)
            + elements[BUBBLE_D, e] * (beyond - change)
        )
        rotation = nodes[ROTATION, e] + change
        nodes[ROTATION, e] = rotation
        largest = max(largest, abs(change))
        size = max(size, abs(rotation) + 0.5 * abs(elements[BUBBLE, e]))
        beyond = change
    return beyond, largest, size


@njit(cache=True)
def _half_step(
    nodes: Array,
    elements: Array,
    points: Array,
    line: Array,
    grasp: int,
    control: int,
    target: float,
) -> tuple[float, float]:
    """One Newton step of the half of a mirror-symmetric beam; see `_whole_step`."""
    count = elements.shape[1]
    none = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    _, sums, negative = _down(nodes, elements, points, int(0), count, none)
    x_sum, y_sum, hh, hp, pp, _, _, _, hr, pr = sums[:10]
    give = 2.0 * line[COMPLIANCE]
    g_h = 0.5 - x_sum + hr
    if control == BY_FORCE:
        dp = 0.5 * target - line[P1]
        dh = -(g_h + hp * dp) / hh
        negative += int(hh < 0.0)
        line[DEFLECTION] = y_sum - pr - hp * dh - pp * dp
    else:
        g_p = target - give * line[P1] - y_sum + pr
        pp -= give
        over = 1.0 / (hh * pp - hp * hp)
        dh = (g_p * hp - g_h * pp) * over
        dp = (g_h * hp - g_p * hh) * over
        negative += int(hh < 0.0) + int(over * hh < 0.0)
        line[DEFLECTION] = target - give * (line[P1] + dp)
    line[H] += dh
    line[P1] += dp
    line[FORCE] = 2.0 * line[P1]
    line[NEGATIVE] = negative - (1 if control == BY_FORCE else 2)
    _, largest, size = _up(nodes, elements, int(0), count, dh, dp, 0.0, 0.0, 0.0)
    forces = max(abs(dh), abs(dp)) / (abs(line[H]) + abs(line[P1]) + FLOOR)
    return forces, _turn(largest, size)


@njit(cache=True)
def _whole_step(
    nodes: Array,
    elements: Array,
    points: Array,
    line: Array,
    grasp: int,
    control: int,
    target: float,
) -> tuple[float, float]:
    """One Newton step of a beam of two parts; return the updates of forces and rotations."""
    count = elements.shape[1]
    none = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    carry, sums, negative = _down(nodes, elements, points, int(0), grasp, none)
    x1, y1, hh, h1, p11, _, _, _, hr, r1 = sums[:10]
    carry = (carry[0], carry[1], carry[2], 0.0, carry[3], 0.0)
    _, sums, more = _down(nodes, elements, points, grasp, count, carry)
    x2, y2, a_hh, h2, p22, a_h1, p12, a_11, a_hr, r2, a_r1 = sums[:11]
    negative += more
    hh, h1, p11 = hh + a_hh, h1 + a_h1, p11 + a_11
    g_h = 1.0 - x1 - x2 + hr + a_hr
    g_1 = r1 + a_r1 - y1
    g_2 = r2 - y2
    if control == BY_FORCE:
        jump = target - (line[P1] - line[P2])
        hp, pp = h1 + h2, p11 + 2.0 * p12 + p22
        g_h += h1 * jump
        g_p = g_1 + g_2 + (p11 + p12) * jump
        over = 1.0 / (hh * pp - hp * hp)
        dh = (g_p * hp - g_h * pp) * over
        d2 = (g_h * hp - g_p * hh) * over
        d1 = d2 + jump
        negative += int(hh < 0.0) + int(over * hh < 0.0)
        line[DEFLECTION] = -g_1 - h1 * dh - p11 * d1 - p12 * d2
    else:
        give = line[COMPLIANCE]
        place = target - give * (line[P1] - line[P2])
        g_1 += place
        g_2 -= place
        p11, p12, p22 = p11 - give, p12 + give, p22 - give
        # Elimination of h, then of the first p.
        l1, l2 = h1 / hh, h2 / hh
        a11, a12, a22 = p11 - l1 * h1, p12 - l1 * h2, p22 - l2 * h2
        g_1 -= l1 * g_h
        l3 = a12 / a11
        b22 = a22 - l3 * a12
        d2 = -(g_2 - l2 * g_h - l3 * g_1) / b22
        d1 = -(g_1 + a12 * d2) / a11
        dh = -(g_h + h1 * d1 + h2 * d2) / hh
        negative += int(hh < 0.0) + int(a11 < 0.0) + int(b22 < 0.0)
        line[DEFLECTION] = place - give * (d1 - d2)
    line[H] += dh
    line[P1] += d1
    line[P2] += d2
    line[FORCE] = line[P1] - line[P2]
    line[NEGATIVE] = negative - (2 if control == BY_FORCE else 3)
    beyond, largest, size = _up(nodes, elements, grasp, count, dh, d2, d1, 0.0, 0.0)
    _, largest1, size1 = _up(nodes, elements, int(0), grasp, dh, d1, 0.0, 0.0, beyond)
    forces = max(abs(dh), max(abs(d1), abs(d2)))
    forces /= abs(line[H]) + abs(line[P1]) + abs(line[P2]) + FLOOR
    return forces, _turn(max(largest, largest1), max(size, size1))


@njit(cache=True)
def _three_part_step(
    nodes: Array,
    elements: Array,
    points: Array,
    line: Array,
    grasp: int,
    control: int,
    target: float,
) -> tuple[float, float]:
    """One Newton step of a beam with two grasps; see `_whole_step`."""
    count, second = elements.shape[1], int(line[SECOND])
    none = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    carry, sums, negative = _down(nodes, elements, points, int(0), grasp, none)
    x1, y1, hh, h1, p11, _, _, _, hr, r1 = sums[:10]
    carry = (carry[0], carry[1], carry[2], 0.0, carry[3], 0.0)
    carry, sums, more = _down(nodes, elements, points, grasp, second, carry)
    x2, y2, a_hh, h2, p22, a_h1, p12, a_11, a_hr, r2, a_r1 = sums[:11]
    negative += more
    hh, h1, p11, hr, r1 = hh + a_hh, h1 + a_h1, p11 + a_11, hr + a_hr, r1 + a_r1
    carry = (carry[0], carry[1], carry[2], 0.0, carry[3], carry[4])
    _, sums, more = _down(nodes, elements, points, second, count, carry)
    x3, y3, a_hh, h3, p33, a_h2, p23, a_22, a_hr, r3, a_r2, a_h1, p13, a_12, a_11, a_r1 = sums
    negative += more
    hh, h1, h2, hr = hh + a_hh, h1 + a_h1, h2 + a_h2, hr + a_hr
    p11, p12, p22, r1, r2 = p11 + a_11, p12 + a_12, p22 + a_22, r1 + a_r1, r2 + a_r2
    g_1, g_2, g_3 = r1 - y1, r2 - y2, r3 - y3
    pull_1, pull_2 = line[P1] - line[P2], line[P2] - line[P3]
    give_1 = give_2 = place_1 = place_2 = 0.0
    by_force_1, by_force_2 = control == BY_FORCE, line[CONTROL_2] == BY_FORCE
    if not by_force_1:
        give_1 = line[COMPLIANCE]
        place_1 = target - give_1 * pull_1
    if not by_force_2:
        give_2 = line[COMPLIANCE_2]
        place_2 = line[TARGET_2] - give_2 * pull_2
    a = line[EQUATIONS : EQUATIONS + 20].reshape(4, 5)
    a[0, 0], a[0, 1], a[0, 2], a[0, 3] = hh, h1, h2, h3
    a[1, 1], a[1, 2], a[1, 3] = p11 - give_1, p12 + give_1, p13
    a[2, 2], a[2, 3] = p22 - give_1 - give_2, p23 + give_2
    a[3, 3] = p33 - give_2
    for i in range(4):
        for j in range(i):
            a[i, j] = a[j, i]
    a[0, 4] = 1.0 - x1 - x2 - x3 + hr
    a[1, 4] = g_1 + place_1
    a[2, 4] = g_2 - place_1 + place_2
    a[3, 4] = g_3 - place_2
    jump_1 = target - pull_1 if by_force_1 else 0.0
    jump_2 = line[TARGET_2] - pull_2 if by_force_2 else 0.0
    for k, given, jump in ((1, by_force_1, jump_1), (2, by_force_2, jump_2)):
        if given:
            for i in range(4):
                a[i, 4] += a[i, k] * jump
                a[i, k + 1] += a[i, k]
            for j in range(5):
                a[k + 1, j] += a[k, j]
                a[k, j] = 0.0
            for i in range(4):
                a[i, k] = 0.0
            a[k, k] = -1.0  # its change is found from that of the next one
    for k in range(4):
        negative += int(a[k, k] < 0.0)
        for i in range(k + 1, 4):
            factor = a[i, k] / a[k, k]
            for j in range(k + 1, 5):
                a[i, j] -= factor * a[k, j]
    d3 = -a[3, 4] / a[3, 3]
    # With a given pull the column of its p is empty, whatever its change.
    d2 = -(a[2, 4] + a[2, 3] * d3) / a[2, 2]
    if by_force_2:
        d2 = d3 + jump_2
    d1 = -(a[1, 4] + a[1, 2] * d2 + a[1, 3] * d3) / a[1, 1]
    if by_force_1:
        d1 = d2 + jump_1
    dh = -(a[0, 4] + a[0, 1] * d1 + a[0, 2] * d2 + a[0, 3] * d3) / a[0, 0]
    line[DEFLECTION] = place_1 - give_1 * (d1 - d2)
    line[DEFLECTION_2] = place_2 - give_2 * (d2 - d3)
    if by_force_1:
        line[DEFLECTION] = -(g_1 + h1 * dh + p11 * d1 + p12 * d2 + p13 * d3)
    if by_force_2:
        line[DEFLECTION_2] = g_3 + h3 * dh + p13 * d1 + p23 * d2 + p33 * d3
    line[H] += dh
    line[P1] += d1
    line[P2] += d2
    line[P3] += d3
    line[FORCE] = line[P1] - line[P2]
    line[FORCE_2] = line[P2] - line[P3]
    line[NEGATIVE] = negative - 4
    beyond, largest, size = _up(nodes, elements, second, count, dh, d3, d2, d1, 0.0)
    beyond, largest2, size2 = _up(nodes, elements, grasp, second, dh, d2, d1, 0.0, beyond)
    _, largest1, size1 = _up(nodes, elements, int(0), grasp, dh, d1, 0.0, 0.0, beyond)
    forces = max(max(abs(dh), abs(d1)), max(abs(d2), abs(d3)))
    forces /= abs(line[H]) + abs(line[P1]) + abs(line[P2]) + abs(line[P3]) + FLOOR
    return forces, _turn(max(max(largest, largest1), largest2), max(max(size, size1), size2))


@njit(cache=True)
def _turn(largest: float, size: float) -> float:
    # Infinite where Newton's method has strayed.
    if largest > LARGEST_TURN or size > FARTHEST_TURN:
        return math.inf
    return largest / (size + FLAT)


@njit(cache=True)
def newton(state: State, law: int, grasp: int, control: int, target: float, accuracy: float) -> int:
    """Repeat Newton steps until the update is small; return the outcome."""
    nodes, elements, points, fibres, line = state
    rounds = 1 if accuracy == WARM else 4
    for _ in range(MOST_STEPS):
        _fill(state, law, grasp, rounds)
        if grasp == elements.shape[1]:
            forces, turns = _half_step(nodes, elements, points, line, grasp, control, target)
        elif line[SECOND] < elements.shape[1]:
            forces, turns = _three_part_step(nodes, elements, points, line, grasp, control, target)
        else:
            forces, turns = _whole_step(nodes, elements, points, line, grasp, control, target)
        if not (forces + turns < 1e6):
            return LOST
        if forces < accuracy and turns < accuracy:
            return _verdict(points, fibres, line, law, grasp)
    return LOST


@njit(cache=True)
def _verdict(points: Array, fibres: Array, line: Array, law: int, grasp: int) -> int:
    """Return whether converged rotations are an equilibrium that pulling leads to."""
    if law == NEO_HOOKE:
        for i in range(fibres.shape[1]):
            if fibres[STRETCH, i] < LEAST_STRETCH:
                return SQUEEZED
        for i in range(points.shape[1]):
            if points[STIFFNESS, i] <= 0.0:
                return GIVES_WAY
    if line[NEGATIVE] != 0.0:
        return UNSTABLE
    # A section never turns past the force that turns it. The linear law with shear, which softens
    # in tension, has other equilibria where some do: stable, but not to be had by pulling. A
    # centroid off the axis turns sections by itself.
    if law == NEO_HOOKE or points[SHEARING, 0] == 0.0 or line[ECCENTRIC] != 0.0:
        return FOUND
    if line[SECOND] < points.shape[1] // 2:
        return FOUND  # a second pull turns sections against the first
    h = line[H]
    sign = 1.0 if line[FORCE] >= 0.0 else -1.0
    for i in range(points.shape[1]):
        p = line[P1] if i < 2 * grasp else line[P2]
        q = p * points[COS, i] - h * points[SIN, i]
        towards = sign if i < 2 * grasp else -sign
        if towards * q < -PAST * (abs(h) + abs(p)):
            return LOST
    return FOUND


@njit(cache=True)
def rest(state: State, law: int) -> None:
    """Put the beam at rest."""
    nodes, elements, points, fibres, line = state
    for i in range(nodes.shape[1]):
        nodes[ROTATION, i] = 0.0
    for e in range(elements.shape[1]):
        elements[BUBBLE, e] = 0.0
    for entry in range(NEGATIVE + 1):
        line[entry] = 0.0
    if law == NEO_HOOKE:
        for i in range(points.shape[1]):
            for row in range(LAM, NEO_HOOKE_ROWS):
                points[row, i] = 0.0
            points[LAM, i] = 1.0
            points[LAM_N, i] = 1.0 / points[AREA, i]
            points[GAM_Q, i] = 1.0 / (points[AREA, i] * (line[SHEAR_MODULUS] - points[DEFICIT, i]))
        for i in range(fibres.shape[1]):
            fibres[VOLUME, i] = 1.0


@njit(cache=True)
def climb(state: State, law: int, grasp: int, control: int, target: float) -> int:
    """Pull the beam from rest until it meets the target; return the outcome."""
    nodes, elements, points, fibres, line = state
    kept = (nodes.copy(), elements.copy(), points.copy(), fibres.copy(), line.copy())
    rest(state, law)
    goal = abs(target)
    if goal == 0.0:
        return FOUND
    sign = 1.0 if target > 0.0 else -1.0
    first = FIRST_STEP * _shorter_part(elements, grasp)
    here, step = 0.0, first
    while here < FARTHEST:
        _copy(state, kept)
        there = here + step
        if control == BY_DEFLECTION and there > goal:
            there = goal
        outcome = newton(state, law, grasp, int(BY_DEFLECTION), sign * there, TIGHT)
        if outcome == FOUND:
            if control == BY_DEFLECTION and there == goal:
                return FOUND
            if control == BY_DEFLECTION or sign * line[FORCE] < goal:
                step = min(2.0 * step, 0.5 * there + first)
                here = there
                continue
            outcome = newton(state, law, grasp, int(BY_FORCE), target, TIGHT)
            met = sign * (line[DEFLECTION] + line[COMPLIANCE] * line[FORCE])
            if outcome == FOUND and here * (1.0 - 1e-9) <= met <= there * (1.0 + 1e-9):
                return FOUND
        _copy(kept, state)
        step *= 0.25
        if step < 1e-9 * (here + first):
            return outcome if outcome != FOUND else LOST
    return OUT_OF_REACH


@njit(cache=True)
def _copy(given: State, into: State) -> None:
    """Write one state over another."""
    _copy_rows(given[0], into[0])
    _copy_rows(given[1], into[1])
    _copy_rows(given[2], into[2])
    _copy_rows(given[3], into[3])
    for i in range(LINE_SIZE):
        into[4][i] = given[4][i]


@njit(cache=True)
def _copy_rows(given: Array, into: Array) -> None:
    for i in range(given.shape[0]):
        for j in range(given.shape[1]):
            into[i, j] = given[i, j]


@njit(cache=True)
def _shorter_part(elements: Array, grasp: int) -> float:
    first = second = 0.0
    for e in range(elements.shape[1]):
        if e < grasp:
            first += elements[LENGTH, e]
        else:
            second += elements[LENGTH, e]
    return min(first, second) if second > 0.0 else first


@njit(cache=True, nogil=True)
def solve(state: State, law: int, grasp: int, control: int, target: float) -> int:
    """Find the equilibrium at a force or deflection, from the last one if that is near."""
    line = state[4]
    force = line[FORCE]
    deflection = line[DEFLECTION] + line[COMPLIANCE] * force
    here = force if control == BY_FORCE else deflection
    move = target - here
    if here != 0.0 and abs(move) <= LONGEST_MOVE * abs(here):
        outcome = newton(state, law, grasp, control, target, WARM)
        moved = line[FORCE] - force
        if control == BY_FORCE:
            moved = line[DEFLECTION] + line[COMPLIANCE] * line[FORCE] - deflection
        scale = deflection if control == BY_FORCE else force
        if outcome == FOUND and moved * move >= -1e-9 * abs(scale * move):
            return FOUND
    outcome = climb(state, law, grasp, control, target)
    if outcome != FOUND:
        line[LAST_FORCE], line[LAST_DEFLECTION] = line[FORCE], line[DEFLECTION]
        rest(state, law)
    return outcome


@njit(cache=True, nogil=True)
def solve_both(state: State, law: int, grasp: int, control: int, target: float) -> int:
    """Find the equilibrium of a beam with two grasps, from the last one if that leads there."""
    nodes, elements, points, fibres, line = state
    second = line[TARGET_2]
    if line[H] != 0.0:
        outcome = newton(state, law, grasp, control, target, WARM)
        if outcome == FOUND:
            return FOUND
    kept = (nodes.copy(), elements.copy(), points.copy(), fibres.copy(), line.copy())
    rest(state, law)
    here, step = 0.0, 0.25
    while here < 1.0:
        _copy(state, kept)
        there = min(here + step, 1.0)
        line[TARGET_2] = there * second
        outcome = newton(state, law, grasp, control, there * target, TIGHT)
        if outcome == FOUND:
            here, step = there, 2.0 * step
            continue
        _copy(kept, state)
        step *= 0.25
        if step < 1e-6:
            line[LAST_FORCE], line[LAST_DEFLECTION] = line[FORCE], line[DEFLECTION]
            rest(state, law)
            line[TARGET_2] = second
            return outcome
    line[TARGET_2] = second
    return FOUND


# Rows of the samples: position, rotation, forces and moment, strains.
ALONG, ACROSS, TURN, TENSION, TRANSVERSE, BENT, SAMPLE_LAM, SAMPLE_GAM, SAMPLE_KAPPA = range(9)
SAMPLE_ROWS = 9


@njit(cache=True)
def _neo_hooke_strains(
    state: State, i: int, n: float, q: float, kappa: float, moment: float, by_moment: bool
) -> tuple[float, float, float]:
    """Return lam, gam and kappa of a section like that of point i under n and q."""
    _, _, points, fibres, line = state
    count = points.shape[1]
    lam, gam = points[LAM, i], points[GAM, i]
    g, ratio, shrink, poisson = line[SHEAR_MODULUS], line[RATIO], line[SHRINK], line[POISSON]
    y = points[REACH, i]
    j0, j1, j2 = fibres[VOLUME, i], fibres[VOLUME, i + count], fibres[VOLUME, i + 2 * count]
    for _ in range(60):
        kyt = kappa * y * shrinkage(lam, shrink, poisson)[0]
        for _ in range(2):
            j0 = fibre(lam, gam, j0, g, ratio)[0]
            j1 = fibre(lam - kyt, gam, j1, g, ratio)[0]
            j2 = fibre(lam + kyt, gam, j2, g, ratio)[0]
        j0, p0, s0, g0, q0, c0 = fibre(lam, gam, j0, g, ratio)
        j1, p1, s1, g1, q1, c1 = fibre(lam - kyt, gam, j1, g, ratio)
        j2, p2, s2, g2, q2, c2 = fibre(lam + kyt, gam, j2, g, ratio)
        n1, t1, m, n_lam, n_gam, q_gam, n_k, q_k, m_k = section_law(
            lam,
            gam,
            kappa,
            points[AREA, i],
            y,
            points[WEIGHT, i],
            points[DEFICIT, i],
            shrink,
            poisson,
            (p0, s0, g0, q0, c0),
            (p1, s1, g1, q1, c1),
            (p2, s2, g2, q2, c2),
        )
        over = 1.0 / (n_lam * q_gam - n_gam * n_gam)
        dn, dq = n - n1, q - t1
        d_lam, d_gam = (q_gam * dn - n_gam * dq) * over, (n_lam * dq - n_gam * dn) * over
        d_kappa = 0.0
        if by_moment:
            lam_k = (n_gam * q_k - q_gam * n_k) * over
            gam_k = (n_gam * n_k - n_lam * q_k) * over
            d_kappa = (moment - m - n_k * d_lam - q_k * d_gam) / (m_k + n_k * lam_k + q_k * gam_k)
            d_lam += lam_k * d_kappa
            d_gam += gam_k * d_kappa
        lam += d_lam
        gam += d_gam
        kappa += d_kappa
        if abs(d_lam) + abs(d_gam) + abs(d_kappa * y) < 1e-12:
            break
    return lam, gam, kappa


@njit(cache=True)
def _offset(points: Array, e: int, f: float) -> float:
    """Return the centroid's distance from the axis at the part f of element e."""
    b = min(max((f - 0.5 + GAUSS) / (2.0 * GAUSS), 0.0), 1.0)
    return (1.0 - b) * points[OFFSET, 2 * e] + b * points[OFFSET, 2 * e + 1]


@njit(cache=True)
def _strains(
    state: State,
    law: int,
    e: int,
    f: float,
    n: float,
    q: float,
    kappa: float,
    moment: float,
    by_moment: bool,
) -> tuple[float, float, float]:
    """Return the centroid's lam and gam and kappa at the part f of element e."""
    points = state[2]
    i, j = 2 * e, 2 * e + 1
    if by_moment:
        moment += _offset(points, e, f) * n
    if law == NEO_HOOKE:
        return _neo_hooke_strains(state, i if f < 0.5 else j, n, q, kappa, moment, by_moment)
    b = min(max((f - 0.5 + GAUSS) / (2.0 * GAUSS), 0.0), 1.0)
    a = 1.0 - b
    if by_moment:
        kappa = moment / (a * points[BENDING, i] + b * points[BENDING, j])
    lam = 1.0 + (a * points[STRETCHING, i] + b * points[STRETCHING, j]) * n
    return lam, (a * points[SHEARING, i] + b * points[SHEARING, j]) * q, kappa


@njit(cache=True)
def _bend(nodes: Array, elements: Array, e: int, f: float) -> tuple[float, float]:
    """Return rotation and curvature at the part f of element e."""
    left, right, bubble = nodes[ROTATION, e], nodes[ROTATION, e + 1], elements[BUBBLE, e]
    theta = left + f * (right - left) + 4.0 * f * (1.0 - f) * bubble
    return theta, (right - left + 4.0 * (1.0 - 2.0 * f) * bubble) / elements[LENGTH, e]


@njit(cache=True)
def _across(line: Array, grasp: int, e: int) -> float:
    """Return the force across of the part that element e is of."""
    if e < grasp:
        return line[P1]
    return line[P2] if e < line[SECOND] else line[P3]


@njit(cache=True)
def sample(
    state: State, law: int, grasp: int, bounds: Array, stations: Array, samples: Array
) -> None:
    """Sample the equilibrium at stations, parts of the span, in any order.

    Positions are summed by the elements' own rule, so that they end where the equations say. The
    moment is that at the first clamp, which is the residual of its row, plus what the forces turn
    on the way, h y - p x: exact along the beam, where m = E I kappa jumps between elements. At
    the grasp the part under the larger tension is taken.
    """
    nodes, elements, points, _, line = state
    _fill(state, law, grasp, int(4))
    count = elements.shape[1]
    w = 0.5 * elements[LENGTH, 0]
    clamp = w * GAUSS * (points[T, 1] - points[T, 0]) + 0.5 * (
        points[MOMENT, 0] + points[MOMENT, 1]
    )
    clamp -= 0.5 * w * (points[T, 0] + points[T, 1])
    xs, ys = np.zeros(count + 1), np.zeros(count + 1)
    for e in range(count):
        w = 0.5 * elements[LENGTH, e]
        xs[e + 1] = xs[e] + w * (points[X, 2 * e] + points[X, 2 * e + 1])
        ys[e + 1] = ys[e] + w * (points[Y, 2 * e] + points[Y, 2 * e + 1])
    second = int(line[SECOND])
    at_grasp = clamp + line[H] * ys[grasp] - line[P1] * xs[grasp]
    at_second = at_grasp + line[H] * (ys[second] - ys[grasp]) - line[P2] * (xs[second] - xs[grasp])
    more = (line[P2] - line[P1]) * math.sin(nodes[ROTATION, grasp]) > 0.0
    more_2 = (line[P3] - line[P2]) * math.sin(nodes[ROTATION, second]) > 0.0
    for k in range(stations.size):
        s = stations[k]
        e = 0
        while e < count - 1 and bounds[e + 1] <= s:
            e += 1
        if (e == grasp and s == bounds[grasp] and not more) or (
            e == second and s == bounds[second] and not more_2
        ):
            e -= 1
        f = (s - bounds[e]) / (bounds[e + 1] - bounds[e])
        h, p = line[H], _across(line, grasp, e)
        # From both ends of the element, so that a mirrored beam is sampled alike.
        x, y = 0.5 * (xs[e] + xs[e + 1]), 0.5 * (ys[e] + ys[e + 1])
        for from_start in (True, False):
            reach = f if from_start else f - 1.0
            w = 0.25 * reach * elements[LENGTH, e]
            for side in (-1.0, 1.0):
                part = (0.0 if from_start else 1.0) + reach * (0.5 + side * GAUSS)
                theta, kappa = _bend(nodes, elements, e, part)
                sin, cos = math.sin(theta), math.cos(theta)
                n, q = h * cos + p * sin, p * cos - h * sin
                lam, gam, _ = _strains(state, law, e, part, n, q, kappa, 0.0, bool(False))
                lam += _offset(points, e, part) * kappa
                x += w * (lam * cos - gam * sin)
                y += w * (lam * sin + gam * cos)
        if f in (0.0, 1.0):
            x, y = xs[e + int(f)], ys[e + int(f)]
        theta, kappa = _bend(nodes, elements, e, f)
        sin, cos = math.sin(theta), math.cos(theta)
        n, q = h * cos + p * sin, p * cos - h * sin
        moment = clamp + h * y - p * x
        if e >= second:
            moment = at_second + h * (y - ys[second]) - p * (x - xs[second])
        elif e >= grasp:
            moment = at_grasp + h * (y - ys[grasp]) - p * (x - xs[grasp])
        lam, gam, kappa = _strains(state, law, e, f, n, q, kappa, moment, bool(True))
        samples[ALONG, k], samples[ACROSS, k], samples[TURN, k] = x, y, theta
        samples[TENSION, k], samples[TRANSVERSE, k], samples[BENT, k] = n, q, moment
        samples[SAMPLE_LAM, k], samples[SAMPLE_GAM, k], samples[SAMPLE_KAPPA, k] = lam, gam, kappa


@njit(cache=True)
def strain_energy(state: State, law: int, grasp: int) -> float:
    """Return the strain energy, in E A S: that whose derivatives the equations are."""
    _, elements, points, fibres, line = state
    _fill(state, law, grasp, int(4))
    energy = 0.0
    count = points.shape[1]
    for i in range(count):
        sin, cos = points[SIN, i], points[COS, i]
        h, p = line[H], _across(line, grasp, i // 2)
        n, q = h * cos + p * sin, p * cos - h * sin
        if law == LINEAR:
            density = 0.5 * (
                points[BENDING, i] * points[KAPPA, i] * points[KAPPA, i]
                + points[STRETCHING, i] * n * n
                + points[SHEARING, i] * q * q
            )
        else:
            outer = points[WEIGHT, i]
            mean = 0.0
            for k in range(3):
                column = i + k * count
                weight = outer if k > 0 else 1.0 - 2.0 * outer
                mean += weight * _fibre_energy(
                    fibres[STRETCH, column],
                    fibres[SHEAR, column],
                    fibres[VOLUME, column],
                    line[SHEAR_MODULUS],
                    line[RATIO],
                )
            lam, gam = points[LAM, i], points[GAM, i]
            u = shrinkage(lam, line[SHRINK], line[POISSON])[0] / lam
            density = points[AREA, i] * (
                mean - 0.5 * points[DEFICIT, i] * (u * gam) ** 2 / (1.0 + gam * gam)
            )
        energy += 0.5 * elements[LENGTH, i // 2] * density
    return energy


@njit(cache=True)
def _fibre_energy(lam: float, gam: float, j: float, g: float, ratio: float) -> float:
    """Return the energy of a fibre per volume; see `fibre`."""
    volume = j * j * j - 1.0
    shape = (lam * lam + gam * gam) / (j * j) + 2.0 * j / lam - 3.0
    return 0.5 * g * (shape + volume * volume / (3.0 * ratio))


@njit(cache=True)
def fibre_pull(lam: float, gam: float, g: float, ratio: float) -> float:
    """Return the first Piola stress along the axis of a fibre, in E; see `fibre`."""
    j = 1.0
    for _ in range(30):
        j = fibre(lam, gam, j, g, ratio)[0]
    return fibre(lam, gam, j, g, ratio)[1]
