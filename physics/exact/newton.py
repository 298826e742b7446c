"""Newton's method on the rotations and forces of the exact beam, and the continuation to a load.

One step solves the linear equations of the changes of all unknowns: rotations of nodes, heights of
bubbles, and the forces h, p (p1, p2, p3 of up to three parts). `_down` eliminates bubbles and
rotations from the first clamp to the last and leaves the few equations of the forces, in which a
step prescribes the pull or the grasp's place; `_up` substitutes back. `newton` repeats steps;
`climb` pulls from rest in growing steps, `solve` starts from the last equilibrium if that is near.
Symbols are in `symbols`.
"""

import math

from kernel_cache import njit
from physics.exact.points import fill_points
from physics.exact.state import KERNEL, Array, Six, State
from physics.exact.symbols import *


@njit(**KERNEL)
def _down(
    nodes: Array, elements: Array, points: Array, first: int, last: int, carry: Six
) -> tuple[Six, tuple[float, ...], int]:
    """Sum the equations of a part's elements, eliminating its rotations on the way."""
    # `carry` is what the elements before have left in the row of the first node; returned are that
    # of the last node, the sums of x, y and of the border (`s_hh` to `s_sr`: r residual, h and p
    # the part's own forces, q the p of the part before, s that of the one before that), and the
    # number of negative pivots.
    #
    # An element's equations. psi is summed at its two Gauss points of weight w, half its length.
    # Rotations there are a -+ GAUSS d + BULGE b and curvatures (d +- SLOPE b) / length, with a the
    # mean of the end rotations, d their difference and b the bubble:
    #
    #           a    d    b  |  h    p  |  1            r_   derivatives of the sum: T, MOMENT
    #     a  [ aa   ad   ab  | h_a  p_a | r_a ]         aa.. its second derivatives: TT, KT, KK
    #     d  [      dd   db  | h_d  p_d | r_d ]         h_   those also by h: TH, KH
    #     b  [           bb  | h_b  p_b | r_b ]         p_   those also by p: TP, KP
    #
    # (db has no KT: GAUSS SLOPE = BULGE.) Eliminating b subtracts row b times g = (row b) / bb; g
    # is kept for `_up`. From a, d to the end rotations i, j: a = (i + j)/2 and d = j - i, so
    #
    #     ii = aa/4 - ad + dd,   jj = aa/4 + ad + dd,   ij = aa/4 - dd,   r_i, r_j = r_a/2 -+ r_d.
    #
    # What is left of the beam is tridiagonal with a border. Eliminated from the first node on, each
    # has the row (d0, r0, ... are what the elements and eliminations before it left on it)
    #
    #     [ pivot   off |  u_h   u_p   q0   s0 | u_r ]
    #
    # where q and s are the p of the part before and of the one before that: they act through the
    # nodes' coupling only. Of the border's own block each elimination leaves the Schur complement,
    # s_xy -= u_x u_y / pivot, and of the next node's row the same.
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
        # Eliminate the bubble; then halve a's row and column, for a is half the sum of i and j.
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
        # Eliminate the rotation of the element's first node, unless a clamp holds it.
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


@njit(**KERNEL)
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
    """Substitute back through a part; return the first node's change, the largest, and rotation."""
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


@njit(**KERNEL)
def _half_step(
    nodes: Array,
    elements: Array,
    points: Array,
    line: Array,
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


@njit(**KERNEL)
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
    # The parts share the rotation of node `grasp` and the force h; the forces across differ by the
    # pull. Unknown forces: h and both p; under a given pull its row is added to the other one's.
    # Returned are the relative sizes of the updates.
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


@njit(**KERNEL)
def _three_piece_step(
    nodes: Array,
    elements: Array,
    points: Array,
    line: Array,
    grasp: int,
    second: int,
    control: int,
    target: float,
) -> tuple[float, float]:
    """One Newton step of a beam with two grasps; see `_whole_step`."""
    # The unknown forces are h and three p. Where a pull is given, the row of the p before it is
    # added to that of the p after it; what is left is factored as L D L^T.
    count = elements.shape[1]
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


@njit(**KERNEL)
def _turn(largest: float, size: float) -> float:
    # The update relative to the rotations; infinite where Newton's method diverges.
    if largest > LARGEST_TURN or size > FARTHEST_TURN:
        return math.inf
    return largest / (size + FLAT)


@njit(**KERNEL)
def newton(
    state: State,
    fibres: Array | None,
    grasp: int | None,
    second: int | None,
    control: int,
    target: float,
    accuracy: float,
) -> int:
    """Repeat Newton steps until the update is small; return the outcome."""
    # Halley's steps on the fibres' volumes: one near the last solution, four where it is farther.
    nodes, elements, points, line, _, _ = state
    rounds = 1 if accuracy == WARM else 4
    grasp_node = elements.shape[1] if grasp is None else grasp
    for _ in range(MOST_STEPS):
        fill_points(state, fibres, grasp_node, rounds)
        if grasp is None:
            forces, turns = _half_step(nodes, elements, points, line, control, target)
        elif second is None:
            forces, turns = _whole_step(nodes, elements, points, line, grasp, control, target)
        else:
            forces, turns = _three_piece_step(
                nodes, elements, points, line, grasp, second, control, target
            )
        if not (forces + turns < 1e6):
            return LOST
        if forces < accuracy and turns < accuracy:
            return _verdict(points, fibres, line, grasp_node)
    return LOST


@njit(**KERNEL)
def _verdict(points: Array, fibres: Array | None, line: Array, grasp: int) -> int:
    """Return whether converged rotations are an equilibrium that pulling leads to."""
    if fibres is not None and line[STIFFENING] < 0.0:
        for i in range(fibres.shape[1]):
            if fibres[STRETCH, i] < LEAST_STRETCH:
                return SQUEEZED
        for i in range(points.shape[1]):
            if points[STIFFNESS, i] <= 0.0:
                return NO_STIFFNESS
    if line[NEGATIVE] != 0.0:
        return UNSTABLE
    # Pulling never turns a section past the direction of the force in the beam. The linear law
    # with shear, which softens in tension, has other equilibria where some are: stable, but no pull
    # leads to them. Off-axis centroids turn sections by themselves.
    if fibres is not None:
        return FOUND
    if points[SHEARING, 0] == 0.0 or line[ECCENTRIC] != 0.0:
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


@njit(**KERNEL)
def rest(state: State, fibres: Array | None) -> None:
    """Put the beam at rest."""
    nodes, elements, points, line, _, _ = state
    for i in range(nodes.shape[1]):
        nodes[ROTATION, i] = 0.0
    for e in range(elements.shape[1]):
        elements[BUBBLE, e] = 0.0
    for entry in range(NEGATIVE + 1):
        line[entry] = 0.0
    if fibres is not None:
        for i in range(points.shape[1]):
            for row in range(LAM, FIBRE_LAW_ROWS):
                points[row, i] = 0.0
            points[LAM, i] = 1.0
            points[LAM_N, i] = 1.0 / points[AREA, i]
            points[GAM_Q, i] = 1.0 / (points[AREA, i] * (line[SHEAR_MODULUS] - points[DEFICIT, i]))
        for i in range(fibres.shape[1]):
            fibres[VOLUME, i] = 1.0


@njit(**KERNEL, inline="always")
def climb(
    state: State, fibres: Array | None, grasp: int | None, control: int, target: float
) -> int:
    """Pull the beam from rest until it meets the target; return the outcome."""
    _, _, _, line, memory, kept = state
    rest(state, fibres)
    goal = abs(target)
    if goal == 0.0:
        return FOUND
    # By deflection, which stays well-posed where a force would lose its equilibrium, in steps that
    # at most double. A force is solved for on the first step that reaches it, so that no other
    # branch can be taken for it. A step that fails is tried again at a quarter of its length.
    sign = 1.0 if target > 0.0 else -1.0
    first = FIRST_STEP * line[SHORTER_PIECE]
    here, step = 0.0, first
    while here < FARTHEST:
        _copy(memory, kept)
        there = here + step
        if control == BY_DEFLECTION and there > goal:
            there = goal
        outcome = newton(state, fibres, grasp, None, int(BY_DEFLECTION), sign * there, TIGHT)
        if outcome == FOUND:
            if control == BY_DEFLECTION and there == goal:
                return FOUND
            if control == BY_DEFLECTION or sign * line[FORCE] < goal:
                step = min(2.0 * step, 0.5 * there + first)
                here = there
                continue
            outcome = newton(state, fibres, grasp, None, int(BY_FORCE), target, TIGHT)
            met = sign * (line[DEFLECTION] + line[COMPLIANCE] * line[FORCE])
            if outcome == FOUND and here * (1.0 - 1e-9) <= met <= there * (1.0 + 1e-9):
                return FOUND
        _copy(kept, memory)
        step *= 0.25
        if step < 1e-9 * (here + first):
            return outcome if outcome != FOUND else LOST
    return OUT_OF_REACH


@njit(**KERNEL)
def _copy(given: Array, into: Array) -> None:
    for i in range(given.size):
        into[i] = given[i]


@njit(nogil=True, **KERNEL)
def solve(
    state: State, fibres: Array | None, grasp: int | None, control: int, target: float
) -> int:
    """Find the equilibrium at a force or deflection, from the last one if that is near."""
    # The solution from the last one is rejected when it fails, when the move is long, or when force
    # and deflection did not move the same way; then the beam is pulled again from rest.
    _, _, _, line, _, _ = state
    force = line[FORCE]
    deflection = line[DEFLECTION] + line[COMPLIANCE] * force
    here = force if control == BY_FORCE else deflection
    move = target - here
    if here != 0.0 and abs(move) <= LONGEST_MOVE * abs(here):
        outcome = newton(state, fibres, grasp, None, control, target, WARM)
        moved = line[FORCE] - force
        if control == BY_FORCE:
            moved = line[DEFLECTION] + line[COMPLIANCE] * line[FORCE] - deflection
        scale = deflection if control == BY_FORCE else force
        if outcome == FOUND and moved * move >= -1e-9 * abs(scale * move):
            return FOUND
    outcome = climb(state, fibres, grasp, control, target)
    if outcome != FOUND:
        line[LAST_FORCE], line[LAST_DEFLECTION] = line[FORCE], line[DEFLECTION]
        rest(state, fibres)
    return outcome


@njit(nogil=True, **KERNEL)
def solve_both(
    state: State, fibres: Array | None, grasp: int, second: int, control: int, target: float
) -> int:
    """Find the equilibrium of a beam with two grasps, from the last one if that leads there."""
    _, _, _, line, memory, kept = state
    second_target = line[TARGET_2]
    if line[H] != 0.0:
        outcome = newton(state, fibres, grasp, second, control, target, WARM)
        if outcome == FOUND:
            return FOUND
    # From rest both loads grow in proportion, in steps that shrink where they fail.
    rest(state, fibres)
    here, step = 0.0, 0.25
    while here < 1.0:
        _copy(memory, kept)
        there = min(here + step, 1.0)
        line[TARGET_2] = there * second_target
        outcome = newton(state, fibres, grasp, second, control, there * target, TIGHT)
        if outcome == FOUND:
            here, step = there, 2.0 * step
            continue
        _copy(kept, memory)
        step *= 0.25
        if step < 1e-6:
            line[LAST_FORCE], line[LAST_DEFLECTION] = line[FORCE], line[DEFLECTION]
            rest(state, fibres)
            line[TARGET_2] = second_target
            return outcome
    line[TARGET_2] = second_target
    return FOUND
