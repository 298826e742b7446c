"""Strands: their law, energy, gradient and tangent, and their damage.

A strand is a central spring from r = R_n rho of the nearest node n to a foot b: l = x_n + r - b,
elongation u = |l| - L, force f(u) along l: zero while slack, (1 - d) k u, and past the yield
elongation u_0 down a straight line to zero at u_f, where it has parted: a bilinear cohesive law
with the damage d = u_f (u - u_0) / (u (u_f - u_0)), which never heals. Dissipated is
G (u - u_0)/(u_f - u_0) for the largest u so far, with G = k u_0 u_f / 2. With t = l/|l|, b = f/|l|,
a = f'(u) - b, v = r x t and e = l - r the second derivatives are

    x x   a t t^T + b I     x w   a t v^T - b [r]     w w   a v v^T + b (sym(e r^T) - (e.r) I)

They touch the block of the strand's node only, so that they add no blocks (6 x 6) to the tangent.
Between two tubes b is s = R_m sigma from a second node m: with u = s x t its own blocks are those
of a strand the other way round, and

    x_n x_m  -(a t t^T + b I)    x_n w_m  -(a t u^T - b [s])
    w_n x_m  -(a v t^T + b [r])  w_n w_m  -(a v u^T + b ((r.s) I - s r^T))

one block for each pair of nodes that strands join (`hold_other`).
A strand that also pushes pulls along its way round a rod, u of that way, but pushes back straight,
u of |l|: pushed along the way, whose slope falls where its end leaves the rod, it would come to
rest in that kink, where no forces balance.
"""

import math

from kernel_cache import side_by_side
from physics.bed.kernels.relaxation import LESS, NOW, strand_branches
from physics.bed.kernels.rods import (
    NO_CONTACT,
    SLIPPED,
    any_rod,
    energy_between,
    group_nodes,
    longest_round,
    path_round,
    press_beam,
    reached,
    strand_ends,
    strand_foot,
)
from physics.bed.kernels.state import (
    ARM_X,
    ARM_Y,
    ARM_Z,
    BENT_NOW,
    BILATERAL,
    CONTACT,
    FAILURE,
    FOOT_X,
    FOOT_Y,
    FOOT_Z,
    FROZEN,
    IN_USE,
    LENGTH,
    LOST_NOW,
    MOST,
    PACE,
    PENDING,
    PUSHED,
    RADIUS,
    RELAXED,
    ROD_BROKEN,
    ROD_DISSIPATED,
    SHAFT,
    SLIPPED_NOW,
    STIFF,
    STRANDS,
    WHOLE,
    YIELD,
    State,
)
from physics.bed.kernels.vectors import (
    Floats,
    Ints,
    Three,
    added,
    columns,
    cross,
    dot,
    inlined,
    inner,
    outer,
    scaled,
)

NEARLY = 1.0 - 1e-12


@inner
def push_straight(
    g: Floats,
    diagonal: Floats,
    n: int,
    chord: Three,
    arm: Three,
    stiff: float,
    u: float,
    kind: int,
) -> float:
    """Add the push of a strand of node n that lies round a rod; return its energy, mJ."""
    length = math.sqrt(dot(chord, chord))
    t = scaled(chord, 1.0 / length)
    v = cross(arm, t)
    e = added(chord, scaled(arm, -1.0))
    f = stiff * u
    b = max(f / length, 0.0) if kind == RELAXED else f / length
    a = stiff - b
    both = (t[0], t[1], t[2], v[0], v[1], v[2])
    c = diagonal[n]
    for r in range(6):
        g[n, r] += f * both[r]
        for col in range(r + 1):
            c[r, col] += a * both[r] * both[col]
    c[3, 1] -= b * arm[2]
    c[3, 2] += b * arm[1]
    c[4, 0] += b * arm[2]
    c[4, 2] -= b * arm[0]
    c[5, 0] -= b * arm[1]
    c[5, 1] += b * arm[0]
    for r in range(3):
        c[r, r] += b
        c[3 + r, 3 + r] -= b * dot(e, arm)
        for col in range(r + 1):
            c[3 + r, 3 + col] += 0.5 * b * (e[r] * arm[col] + e[col] * arm[r])
    return 0.5 * f * u


@inner
def turned_foot(strand: Floats, i: int, o1: Three, o2: Three, o3: Three) -> Three:
    """Return the arm of strand i's foot at its other node, whose rotation has these columns."""
    x, y, z = strand[FOOT_X, i], strand[FOOT_Y, i], strand[FOOT_Z, i]
    return added(added(scaled(o1, x), scaled(o2, y)), scaled(o3, z))


@inner
def hold_other(
    g: Floats,
    diagonal: Floats,
    cross_block: Floats,
    other: int,
    t: Three,
    arm: Three,
    away: Three,
    foot: Three,
    length: float,
    f: float,
    a: float,
    b: float,
    bent: bool,
) -> None:
    """Add a strand's force and stiffness at its other node, and the block of both nodes."""
    # `away` is the direction of the strand at its foot, t where it is straight.
    u, v = cross(foot, away), cross(arm, t)
    near, far = (t[0], t[1], t[2], v[0], v[1], v[2]), (away[0], away[1], away[2], u[0], u[1], u[2])
    c = diagonal[other]
    for r in range(6):
        g[other, r] -= f * far[r]
        for col in range(r + 1):
            c[r, col] += a * far[r] * far[col]
    e = added(scaled(away, -length), scaled(foot, -1.0))
    c[3, 1] -= b * foot[2]
    c[3, 2] += b * foot[1]
    c[4, 0] += b * foot[2]
    c[4, 2] -= b * foot[0]
    c[5, 0] -= b * foot[1]
    c[5, 1] += b * foot[0]
    around = dot(e, foot)
    for r in range(3):
        c[r, r] += b
        c[3 + r, 3 + r] -= b * around
        for col in range(r + 1):
            c[3 + r, 3 + col] += 0.5 * b * (e[r] * foot[col] + e[col] * foot[r])
    # Round a rod the ends turn about different points: what couples them is the length alone.
    slope, b = (a + b, 0.0) if bent else (a, b)
    for r in range(6):
        for col in range(6):
            cross_block[r, col] -= slope * near[r] * far[col]
    if bent:
        return
    for r in range(3):
        cross_block[r, r] -= b
        cross_block[3 + r, 3 + r] -= b * dot(arm, foot)
        for col in range(3):
            cross_block[3 + r, 3 + col] += b * foot[r] * arm[col]
    # b [s] above and -b [r] below.
    cross_block[0, 4] -= b * foot[2]
    cross_block[0, 5] += b * foot[1]
    cross_block[1, 3] += b * foot[2]
    cross_block[1, 5] -= b * foot[0]
    cross_block[2, 3] -= b * foot[1]
    cross_block[2, 4] += b * foot[0]
    cross_block[3, 1] += b * arm[2]
    cross_block[3, 2] -= b * arm[1]
    cross_block[4, 0] -= b * arm[2]
    cross_block[4, 2] += b * arm[0]
    cross_block[5, 0] += b * arm[1]
    cross_block[5, 1] -= b * arm[0]


@inner
def add_cross(block: Floats, cross_block: Floats, pair: Ints) -> None:
    """Add the block of a pair of nodes to the tangent, if that has one."""
    if pair[2] < 0:
        return
    b = block[pair[2]]
    for r in range(6):
        for col in range(6):
            b[r, col] += cross_block[col, r] if pair[3] else cross_block[r, col]


@inner
def whole_strands(
    strand: Floats,
    damage: Floats,
    first: int,
    last: int,
    every: bool,
    x0: float,
    x1: float,
    x2: float,
    t1: Three,
    t2: Three,
    t3: Three,
    out: Ints,
) -> tuple[int, int]:
    """Return how many strands were written, all whole ones or what may pull; how many are whole."""
    count = whole = 0
    for i in range(first, last):
        if damage[i] >= 1.0:
            continue
        whole += 1
        a0, a1, a2 = strand[ARM_X, i], strand[ARM_Y, i], strand[ARM_Z, i]
        lx = x0 + (t1[0] * a0 + t2[0] * a1 + t3[0] * a2) - strand[FOOT_X, i]
        ly = x1 + (t1[1] * a0 + t2[1] * a1 + t3[1] * a2) - strand[FOOT_Y, i]
        lz = x2 + (t1[2] * a0 + t2[2] * a1 + t3[2] * a2) - strand[FOOT_Z, i]
        # Of slack ones, which are most, a square tells: what is near the border is looked at.
        slack = lx * lx + ly * ly + lz * lz < NEARLY * strand[LENGTH, i] * strand[LENGTH, i]
        if every or not slack or strand[BILATERAL, i] != 0.0:
            out[count] = i
            count += 1
    return count, whole


@inner
def put(
    rows: Floats, row: int, t: Three, arm: Three, away: Three, f: float, a: float, b: float
) -> None:
    """Keep what `add_strands` needs of a strand."""
    rows[row, 0], rows[row, 1], rows[row, 2] = t
    rows[row, 3], rows[row, 4], rows[row, 5] = arm
    rows[row, 6], rows[row, 7], rows[row, 8] = away
    rows[row, 9], rows[row, 10], rows[row, 11] = f, a, b


@side_by_side
@inner
def add_strands(rows: Floats, count: int, g: Floats, c: Floats) -> None:
    """Add the forces and stiffnesses of a node's strands, each from `put`."""
    # By itself: thirty sums in the middle of what a strand may do leave it no registers.
    # The second derivative by the end of a strand is a t t^T + b I; with v = r x t and e = l - r
    # its blocks are a t v^T - b [r] and a v v^T + b (sym(e r^T) - (e.r) I).
    fx = fy = fz = gx = gy = gz = 0.0
    h00 = h11 = h22 = h01 = h02 = h12 = 0.0
    p00 = p01 = p02 = p10 = p11 = p12 = p20 = p21 = p22 = 0.0
    w00 = w11 = w22 = w01 = w02 = w12 = bs = bx = by = bz = 0.0
    for k in range(count):
        row = rows[k]
        tx, ty, tz, rx, ry, rz = row[0], row[1], row[2], row[3], row[4], row[5]
        f, a, b = row[9], row[10], row[11]
        vx, vy, vz = ry * tz - rz * ty, rz * tx - rx * tz, rx * ty - ry * tx
        fx += f * tx
        fy += f * ty
        fz += f * tz
        gx += f * vx
        gy += f * vy
        gz += f * vz
        ax, ay, az = a * tx, a * ty, a * tz
        h00 += ax * tx
        h11 += ay * ty
        h22 += az * tz
        h01 += ax * ty
        h02 += ax * tz
        h12 += ay * tz
        p00 += ax * vx
        p01 += ax * vy
        p02 += ax * vz
        p10 += ay * vx
        p11 += ay * vy
        p12 += ay * vz
        p20 += az * vx
        p21 += az * vy
        p22 += az * vz
        bs += b
        bx += b * rx
        by += b * ry
        bz += b * rz
        ux, uy, uz = b * row[6], b * row[7], b * row[8]
        ex, ey, ez = ux * rx, uy * ry, uz * rz
        w00 += a * vx * vx - ey - ez
        w11 += a * vy * vy - ex - ez
        w22 += a * vz * vz - ex - ey
        w01 += a * vx * vy + 0.5 * (ux * ry + uy * rx)
        w02 += a * vx * vz + 0.5 * (ux * rz + uz * rx)
        w12 += a * vy * vz + 0.5 * (uy * rz + uz * ry)
    g[0] += fx
    g[1] += fy
    g[2] += fz
    g[3] += gx
    g[4] += gy
    g[5] += gz
    c[0, 0] += h00 + bs
    c[1, 0] += h01
    c[1, 1] += h11 + bs
    c[2, 0] += h02
    c[2, 1] += h12
    c[2, 2] += h22 + bs
    c[3, 0] += p00
    c[3, 1] += p10 - bz
    c[3, 2] += p20 + by
    c[4, 0] += p01 + bz
    c[4, 1] += p11
    c[4, 2] += p21 - bx
    c[5, 0] += p02 - by
    c[5, 1] += p12 + bx
    c[5, 2] += p22
    c[3, 3] += w00
    c[4, 3] += w01
    c[4, 4] += w11
    c[5, 3] += w02
    c[5, 4] += w12
    c[5, 5] += w22


@inlined
def strand_pass(s: State, kind: int, relaxation: float) -> None:
    """Add the strands' energy, gradient and tangent; damage goes by `relaxation` if RELAXED."""
    strand, damage, side = s.strand, s.damage, s.side
    energy = lost = most = 0.0
    whole = 0
    # Of strands that relax eps = pace u - less stands for u in all that follows.
    relaxes = s.memory.shape[1] > 0
    pace = s.sums[PACE]
    per_pace = 1.0 / pace
    none = (0.0, 0.0, 0.0)
    pulling, which = s.pulling, s.which
    for group in range(s.first.size - 1):
        n, other = group_nodes(s.pair, group, s.x.shape[0])
        near = False
        for m in range(s.rods.shape[0]):
            if s.rods[m, IN_USE] == 0.0:
                continue
            close, away, d = reached(s.x, s.thick, s.rods, n, m)
            if other >= 0:
                close = close or reached(s.x, s.thick, s.rods, other, m)[0]
            elif away < s.thick[n, 0] + s.rods[m, RADIUS] and away > 1e-9:
                s.sums[CONTACT] += press_beam(
                    s.x, s.thick, s.rods, s.g, s.diagonal, s.pull, s.press, n, m, away, d, kind
                )
            if close or kind != RELAXED:
                near = True
                continue
            # Out of reach strands forget on which side they touched it.
            for i in range(s.first[group], s.first[group + 1]):
                if side[m, i] & 1 and damage[i] < 1.0:
                    end, foot = strand_ends(s.x, s.q, strand, n, other, i)
                    path = longest_round(s.rods, side, i, end, foot, False)[1]
                    side[m, i] = NO_CONTACT
                    if path > 0.0:
                        d = added(end, scaled(foot, -1.0))
                        after = longest_round(s.rods, side, i, end, foot, False)[1]
                        after = after if after > 0.0 else math.sqrt(dot(d, d))
                        s.sums[SLIPPED_NOW] += energy_between(s, i, path, after)
                side[m, i] = NO_CONTACT
        if s.first[group] == s.first[group + 1]:
            continue
        t1, t2, t3 = columns(s.q[n, 0], s.q[n, 1], s.q[n, 2], s.q[n, 3])
        o1, o2, o3 = t1, t2, t3
        if other >= 0:
            o1, o2, o3 = columns(s.q[other, 0], s.q[other, 1], s.q[other, 2], s.q[other, 3])
            s.cross[:] = 0.0
        x0, x1, x2 = s.x[n, 0], s.x[n, 1], s.x[n, 2]
        correction = s.damage_correction[n]
        taut = 0
        every = near or relaxes or other >= 0
        count, held = whole_strands(
            strand, damage, s.first[group], s.first[group + 1], every, x0, x1, x2, t1, t2, t3, which
        )
        whole += held
        for j in range(count):
            i = which[j]
            a0, a1, a2 = strand[ARM_X, i], strand[ARM_Y, i], strand[ARM_Z, i]
            rx = t1[0] * a0 + t2[0] * a1 + t3[0] * a2
            ry = t1[1] * a0 + t2[1] * a1 + t3[1] * a2
            rz = t1[2] * a0 + t2[2] * a1 + t3[2] * a2
            if other < 0:
                lx = x0 + rx - strand[FOOT_X, i]
                ly = x1 + ry - strand[FOOT_Y, i]
                lz = x2 + rz - strand[FOOT_Z, i]
            else:
                arm = turned_foot(strand, i, o1, o2, o3)
                lx = x0 + rx - (s.x[other, 0] + arm[0])
                ly = x1 + ry - (s.x[other, 1] + arm[1])
                lz = x2 + rz - (s.x[other, 2] + arm[2])
            rod = -1
            pull = by_a = by_b = none
            path = bow = short = 0.0
            if near:
                end = (x0 + rx, x1 + ry, x2 + rz)
                foot = strand_foot(s.x, s.q, strand, other, i)
                rod, path, by_a, by_b, bow, before, jumped = longest_round(
                    s.rods, side, i, end, foot, kind == RELAXED
                )
                pull = added(by_a, by_b)
                if jumped > 0:
                    # Nothing along the shaft resists a tip that comes upon a strand, or that a
                    # strand slips off: the energy by which it jumps is booked.
                    straight = math.sqrt(lx * lx + ly * ly + lz * lz)
                    before = before if before > 0.0 else straight
                    jump = energy_between(s, i, path if rod >= 0 else straight, before)
                    if jump < 0.0 or jumped == 2:  # 2: it meets the rod's other side
                        s.sums[SLIPPED_NOW] -= jump
                    else:
                        s.sums[BENT_NOW] += jump
            length = math.sqrt(lx * lx + ly * ly + lz * lz)
            if rod >= 0:
                if strand[BILATERAL, i] != 0.0:
                    short = min(length - strand[LENGTH, i], 0.0)
                length = path
            u = length - strand[LENGTH, i]
            if relaxes:
                less = s.memory[LESS, i]
                s.memory[NOW, i] = u
                u = pace * u - less
                if u <= 0.0 and (rod >= 0 or strand[BILATERAL, i] == 0.0):
                    s.memory[NOW, i] = less * per_pace
            k, u0, uf = strand[STIFF, i], strand[YIELD, i], strand[FAILURE, i]
            d = damage[i]
            if short < 0.0:
                stiff, straight, out = (1.0 - d) * k, (lx, ly, lz), (rx, ry, rz)
                pushed = push_straight(s.g, s.diagonal, n, straight, out, stiff, short, kind)
                energy += pushed
                s.sums[PUSHED] += pushed
                if other >= 0:
                    straight, out = (-lx, -ly, -lz), turned_foot(strand, i, o1, o2, o3)
                    push_straight(s.g, s.diagonal, other, straight, out, stiff, short, kind)
            if u <= 0.0 and (rod >= 0 or strand[BILATERAL, i] == 0.0):
                continue
            il = 1.0 / length
            if rod >= 0:
                tx, ty, tz = by_a
                il /= dot(by_a, by_a)  # of an end inside the rod it is no unit vector
                ux, uy, uz = tx * length - rx, ty * length - ry, tz * length - rz
            else:
                tx, ty, tz = lx * il, ly * il, lz * il
                ux, uy, uz = lx - rx, ly - ry, lz - rz
            f = (1.0 - d) * k * u
            slope = (1.0 - d) * k * pace
            stored = 0.5 * f * u * per_pace
            if u > u0 and kind != FROZEN:
                goal = 1.0 if u >= uf else uf * (u - u0) / (u * (uf - u0))
                if goal > d:
                    if kind == RELAXED:
                        new = d + relaxation * (goal - d)
                        if goal >= 1.0 and new > 0.98:  # else it would only ever come near 1
                            new = 1.0
                        gone = 0.5 * k * u * u * (new - d)
                        if relaxes:
                            unit, viscous = strand_branches(s, i, s.memory[NOW, i])
                            s.sums[PENDING] += 0.5 * k * viscous * (new - d)
                            gone = 0.5 * k * unit * (new - d)
                        if short < 0.0:
                            less, straight, out = (d - new) * k, (lx, ly, lz), (rx, ry, rz)
                            change = push_straight(
                                s.g, s.diagonal, n, straight, out, less, short, kind
                            )
                            energy += change
                            s.sums[PUSHED] += change
                            gone -= change
                            if other >= 0:
                                straight, out = (-lx, -ly, -lz), turned_foot(strand, i, o1, o2, o3)
                                push_straight(
                                    s.g, s.diagonal, other, straight, out, less, short, kind
                                )
                        lost += gone
                        damage[i] = new
                        fall = k * u * (new - d)
                        correction[0] += fall * tx
                        correction[1] += fall * ty
                        correction[2] += fall * tz
                        correction[3] += fall * (ry * tz - rz * ty)
                        correction[4] += fall * (rz * tx - rx * tz)
                        correction[5] += fall * (rx * ty - ry * tx)
                        if other >= 0:
                            away = scaled(by_b, -1.0) if rod >= 0 else (tx, ty, tz)
                            turned = cross(turned_foot(strand, i, o1, o2, o3), away)
                            for r in range(3):
                                s.damage_correction[other, r] -= fall * away[r]
                                s.damage_correction[other, 3 + r] -= fall * turned[r]
                        if rod >= 0:
                            s.sums[ROD_DISSIPATED] += gone
                            s.rods_damage_correction[rod, 0] -= fall * pull[0]
                            s.rods_damage_correction[rod, 1] -= fall * pull[1]
                            s.rods_damage_correction[rod, 2] -= fall * pull[2]
                        if new >= 1.0:
                            whole -= 1
                            if rod >= 0:
                                s.sums[ROD_BROKEN] += 1.0
                            continue
                        slope = (1.0 - new) * k
                        f = slope * u
                        stored = 0.5 * f * u * per_pace
                        slope *= pace
                    else:
                        full = 0.5 * k * u0 * uf / (uf - u0)  # dissipated for each mm beyond u0
                        # The largest elongation so far, less u0: the law solved for u at d.
                        before = u0 * uf / (uf - d * (uf - u0)) - u0
                        if u >= uf:
                            energy += full * (uf - u0 - before) * per_pace
                            continue
                        energy += full * (u - u0 - before) * per_pace
                        slope = -k * u0 / (uf - u0)
                        f = slope * (u - uf)
                        stored = 0.5 * f * u * per_pace
                        slope *= pace
            energy += stored
            most = max(most, abs(f))
            if rod >= 0:
                s.pull[rod, 0] -= f * pull[0]
                s.pull[rod, 1] -= f * pull[1]
                s.pull[rod, 2] -= f * pull[2]
            b = f * il
            # A pushing strand's geometric stiffness is negative: left out in a tick, so that the
            # tangent stays definite. The gradient stays exact.
            if kind == RELAXED and b < 0.0:
                b = 0.0
            a = slope - b
            put(pulling, int(taut), (tx, ty, tz), (rx, ry, rz), (ux, uy, uz), f, a, b)
            taut += 1
            if other >= 0:
                hold_other(
                    s.g, s.diagonal, s.cross, other, (tx, ty, tz), (rx, ry, rz),
                    scaled(by_b, -1.0) if rod >= 0 else (tx, ty, tz),
                    turned_foot(strand, i, o1, o2, o3), length, f, a, b, rod >= 0,
                )  # fmt: skip
            if rod >= 0 and bow > 0.0 and f > 0.0:
                shaft = (s.rods[rod, SHAFT], s.rods[rod, SHAFT + 1], s.rods[rod, SHAFT + 2])
                t = cross(shaft, by_a)
                put(pulling, int(taut), t, (rx, ry, rz), none, 0.0, f * bow / dot(t, t), 0.0)
                taut += 1
        add_strands(pulling, int(taut), s.g[n], s.diagonal[n])
        if other >= 0:
            add_cross(s.block, s.cross, s.pair[group - s.x.shape[0]])
    s.sums[STRANDS] = energy
    s.sums[LOST_NOW] = lost
    s.sums[WHOLE] = whole
    s.sums[MOST] = most


@outer
def update_rod_contacts(s: State, meet: bool) -> int:
    """Let strands slip off rods, and be met by them if `meet`; return how many have jumped."""
    jumps = 0
    for group in range(s.first.size - 1):
        n, other = group_nodes(s.pair, group, s.x.shape[0])
        for m in range(s.rods.shape[0]):
            if s.rods[m, IN_USE] == 0.0:
                continue
            near = reached(s.x, s.thick, s.rods, n, m)[0]
            if other >= 0:
                near = near or reached(s.x, s.thick, s.rods, other, m)[0]
            for i in range(s.first[group], s.first[group + 1]):
                was = s.side[m, i]
                if not near or (was == NO_CONTACT and not meet):
                    s.side[m, i] = NO_CONTACT
                    continue
                end, foot = strand_ends(s.x, s.q, s.strand, n, other, i)
                before = path_round(end, foot, s.rods[m], was, False)[0]
                now = path_round(end, foot, s.rods[m], was, True)[0]
                s.side[m, i] = 0 if now == SLIPPED else now  # it may meet the other side at once
                if (before ^ now) & 1 and s.damage[i] < 1.0:
                    jumps += 1
    return jumps


@outer
def yielded(s: State) -> float:
    """Update damage by the law at the present elongations; return the energy dissipated, mJ."""
    lost = 0.0
    rods = any_rod(s.rods)
    for group in range(s.first.size - 1):
        n, other = group_nodes(s.pair, group, s.x.shape[0])
        for i in range(s.first[group], s.first[group + 1]):
            d = s.damage[i]
            if d >= 1.0:
                continue
            end, foot = strand_ends(s.x, s.q, s.strand, n, other, i)
            chord = added(end, scaled(foot, -1.0))
            length = math.sqrt(dot(chord, chord))
            on_rod = False
            if rods:
                rod, path, _, _, _, _, _ = longest_round(s.rods, s.side, i, end, foot, False)
                if rod >= 0:
                    length, on_rod = path, True
            now = length - s.strand[LENGTH, i]
            u = now
            if s.memory.shape[1]:
                u = s.sums[PACE] * now - s.memory[LESS, i]
            u0, uf = s.strand[YIELD, i], s.strand[FAILURE, i]
            if u <= u0:
                continue
            goal = 1.0 if u >= uf else uf * (u - u0) / (u * (uf - u0))
            if goal > d:
                full = 0.5 * s.strand[STIFF, i] * u0 * uf / (uf - u0)
                before = u0 * uf / (uf - d * (uf - u0))
                gone = full * (min(u, uf) - before)
                if s.memory.shape[1]:
                    # The branches of what parts store more than one spring of their force.
                    unit, viscous = strand_branches(s, i, now)
                    gone += 0.5 * s.strand[STIFF, i] * (unit - u * u + viscous) * (goal - d)
                if on_rod and s.strand[BILATERAL, i] != 0.0:
                    short = min(math.sqrt(dot(chord, chord)) - s.strand[LENGTH, i], 0.0)
                    gone += 0.5 * s.strand[STIFF, i] * short * short * (goal - d)
                lost += gone
                s.damage[i] = goal
                if on_rod:
                    s.sums[ROD_DISSIPATED] += gone
                    s.sums[ROD_BROKEN] += goal >= 1.0
    return lost
