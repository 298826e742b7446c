"""Energy, gradient and tangent of a geometrically exact beam [Simo 1985, Reissner 1981].

Nodes have a place x and a unit quaternion q; their
rotations change by a spin w through Cayley's map, q <- (1, w/2) q / |.|, so that no trigonometry is
needed. Where an element joins a node that has another tube's frame, its own is turned from that by
a constant (`turn`), of which spins, and so gradient and tangent, know nothing. An element of length
h at rest has the mid rotation R = R(q_i + q_j) with columns t_a, the half Gibbs vector
c = vec(q_j q_i*) / scal = tan(phi/2) e of its ends' relative rotation, t = tan(phi/4) e and
d = (x_j - x_i)/h.
Strains Gamma = R^T d - Gamma_0 and kappa = (2/h) R^T c - kappa_0, energy
U = h/2 (Gamma.C.Gamma + kappa.C_m.kappa), forces n = R C Gamma and m = R C_m kappa.

With sigma = (w_i + w_j)/2 + D x t and D = (w_j - w_i)/2 a change of the nodes changes the strains
(turned back with the element) by u' - sigma x d and (2/h) B D, B = (1 + t.c) I + (c - t) c^T, u' =
(u_j - u_i)/h. So the gradient is h n for u', h n x d for sigma and 2 y for D, y = B m; and the
second derivative in these coordinates is exactly, [v] the matrix of v x,

    u' u'        h C                          sigma sigma  h ([d]^T C [d] + sym(n d^T) - (n.d) I)
    u' sigma     h (C [d] - [n])              sigma D      h/2 (n.(t x d) I - (d x n) t^T) + [y]
    D D          4/h B C_m B + (2c - t) y^T + y (2c - t)^T + 2 (y.t) I

with C and C_m turned by R. It is symmetric everywhere, at rest or not: Newton converges
quadratically and Cholesky's factors tell a stable equilibrium from one that would not stay.

An element's shear also stands for bending within it [MacNeal 1978]. In a thin beam that is nearly
all of its shear, f_2 and f_3 of it, and by Gamma_1 alone such an element would lengthen by shear,
where in truth it is stretched along its chord. Then (`chord` has f^2, else 0)

    L = sqrt((1 + Gamma_1)^2 + f_2^2 Gamma_2^2 + f_3^2 Gamma_3^2),  N = EA (L - 1) for EA Gamma_1,

and with e = dL/dGamma the force is N e + (0, G_2 Gamma_2, G_3 Gamma_3), its tangent

    C = (EA - N/L) e e^T + diag(N/L, G_2 + f_2^2 N/L, G_3 + f_3^2 N/L).

What a nick leaves of a section lies `off` below its axis, in a frame whose up is the torn side
(`nick`): its own stretch is that of the axis less off kappa_2, and the moment about the axis is its
own less off N.
"""

import math

from physics.bed.kernels.relaxation import ENERGY, FORCE, STRAIN, WALL_LESS
from physics.bed.kernels.state import OFF
from physics.bed.kernels.vectors import (
    Floats,
    Four,
    Ints,
    Nine,
    Three,
    added,
    columns,
    cross,
    cross_times,
    dot,
    inner,
    outer,
    scaled,
    times_cross,
)
from physics.bed.kernels.wall import (
    FIBRES,
    SOFT_2,
    SOFT_3,
    STRENGTH,
    congruent,
    fill_all,
    place_fibres,
    section_forces,
)


@inner
def turned(a: float, b: float, c: float, t1: Three, t2: Three, t3: Three) -> Nine:
    """Return three diagonal stiffnesses, turned by the columns t1, t2, t3."""
    # Less the last one, which multiplies the identity: two dyads instead of three.
    a -= c
    b -= c
    m01 = a * t1[0] * t1[1] + b * t2[0] * t2[1]
    m02 = a * t1[0] * t1[2] + b * t2[0] * t2[2]
    m12 = a * t1[1] * t1[2] + b * t2[1] * t2[2]
    return (
        c + a * t1[0] * t1[0] + b * t2[0] * t2[0],
        m01,
        m02,
        m01,
        c + a * t1[1] * t1[1] + b * t2[1] * t2[1],
        m12,
        m02,
        m12,
        c + a * t1[2] * t1[2] + b * t2[2] * t2[2],
    )


@inner
def with_dyad(m: Nine, s: float, v: Three) -> Nine:
    """Return m + s v v^T."""
    m01, m02, m12 = m[1] + s * v[0] * v[1], m[2] + s * v[0] * v[2], m[5] + s * v[1] * v[2]
    return (
        m[0] + s * v[0] * v[0],
        m01,
        m02,
        m01,
        m[4] + s * v[1] * v[1],
        m12,
        m02,
        m12,
        m[8] + s * v[2] * v[2],
    )


@inner
def end_rotation(q: Floats, turn: Floats, n: int, e: int, end: int) -> Four:
    """Return the quaternion of element e at an end, whose node is n."""
    w, x, y, z = q[n, 0], q[n, 1], q[n, 2], q[n, 3]
    if turn[e, end, 0] == 1.0:
        return w, x, y, z
    a, b, c, d = turn[e, end, 0], turn[e, end, 1], turn[e, end, 2], turn[e, end, 3]
    return (
        w * a - x * b - y * c - z * d,
        w * b + x * a + y * d - z * c,
        w * c + y * a + z * b - x * d,
        w * d + z * a + x * c - y * b,
    )


@inner
def element_frame(first: Four, second: Four) -> tuple[Three, Three, Three, Three]:
    """Return the columns of the mid rotation of an element's ends and their half Gibbs vector c."""
    w0, x0, y0, z0 = first
    w1, x1, y1, z1 = second
    scal = w0 * w1 + x0 * x1 + y0 * y1 + z0 * z1
    if scal < 0.0:  # q and -q are one rotation
        w1, x1, y1, z1, scal = -w1, -x1, -y1, -z1, -scal
    f = 1.0 / scal
    c = (
        f * (w0 * x1 - w1 * x0 - (y1 * z0 - z1 * y0)),
        f * (w0 * y1 - w1 * y0 - (z1 * x0 - x1 * z0)),
        f * (w0 * z1 - w1 * z0 - (x1 * y0 - y1 * x0)),
    )
    w, x, y, z = w0 + w1, x0 + x1, y0 + y1, z0 + z1
    f = 1.0 / math.sqrt(w * w + x * x + y * y + z * z)
    t1, t2, t3 = columns(f * w, f * x, f * y, f * z)
    return t1, t2, t3, c


@outer
def set_rest(x: Floats, q: Floats, ends: Ints, turn: Floats, h: Floats, strain: Floats) -> None:
    """Write the strains of this shape into `strain`: it is then the beam's shape at rest."""
    for e in range(h.size):
        i, j = ends[e, 0], ends[e, 1]
        q0, q1 = end_rotation(q, turn, i, e, int(0)), end_rotation(q, turn, j, e, int(1))
        t1, t2, t3, c = element_frame(q0, q1)
        d = (
            (x[j, 0] - x[i, 0]) / h[e],
            (x[j, 1] - x[i, 1]) / h[e],
            (x[j, 2] - x[i, 2]) / h[e],
        )
        f = 2.0 / h[e]
        strain[e, 0], strain[e, 1], strain[e, 2] = dot(t1, d), dot(t2, d), dot(t3, d)
        strain[e, 3], strain[e, 4], strain[e, 5] = f * dot(t1, c), f * dot(t2, c), f * dot(t3, c)


@inner
def strain_fibres(
    x: Floats,
    q: Floats,
    ends: Ints,
    turn: Floats,
    h: Floats,
    strain: Floats,
    chord: Floats,
    wall: Floats,
    strained: Floats,
    fibres: Floats,
) -> None:
    """Write stretch, gam^2 and curvatures of all sections, and what their fibres do."""
    for e in range(h.size):
        i, j = ends[e, 0], ends[e, 1]
        q0, q1 = end_rotation(q, turn, i, e, int(0)), end_rotation(q, turn, j, e, int(1))
        t1, t2, t3, c = element_frame(q0, q1)
        f = 1.0 / h[e]
        d = (f * (x[j, 0] - x[i, 0]), f * (x[j, 1] - x[i, 1]), f * (x[j, 2] - x[i, 2]))
        g2, g3 = dot(t2, d) - strain[e, 1], dot(t3, d) - strain[e, 2]
        f += f
        lam = 1.0 + (dot(t1, d) - strain[e, 0])
        square = wall[e, SOFT_2] * g2 * g2 + wall[e, SOFT_3] * g3 * g3
        if chord[e, 0] > 0.0 or chord[e, 1] > 0.0:
            lam = math.sqrt(lam * lam + chord[e, 0] * g2 * g2 + chord[e, 1] * g3 * g3)
        k2, k3 = f * dot(t2, c) - strain[e, 4], f * dot(t3, c) - strain[e, 5]
        lam -= chord[e, OFF] * k2
        strained[e, 0], strained[e, 1], strained[e, 2], strained[e, 3] = lam, square, k2, k3
        place_fibres(fibres, FIBRES * e, wall, e, lam, square, k2, k3)
    fill_all(fibres, wall, int(0))


@inner
def beam_pass(
    x: Floats,
    q: Floats,
    ends: Ints,
    turn: Floats,
    h: Floats,
    stiff: Floats,
    strain: Floats,
    chord: Floats,
    wall: Floats,
    strained: Floats,
    fibres: Floats,
    memory: Floats,
    pace: float,
    g: Floats,
    diagonal: Floats,
    block: Floats,
    section: Floats,
) -> float:
    """Add the beam's gradient and tangent, write its section forces; return its energy, mJ."""
    # Of a wall that relaxes resultants F are pace F_e less what its branches had: `relaxation`.
    energy = 0.0
    relaxes = memory.shape[1] > 0
    less = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    if wall.size:
        strain_fibres(x, q, ends, turn, h, strain, chord, wall, strained, fibres)
    for e in range(h.size):
        i, j = ends[e, 0], ends[e, 1]
        q0, q1 = end_rotation(q, turn, i, e, int(0)), end_rotation(q, turn, j, e, int(1))
        t1, t2, t3, c = element_frame(q0, q1)
        f = 1.0 / h[e]
        d = (f * (x[j, 0] - x[i, 0]), f * (x[j, 1] - x[i, 1]), f * (x[j, 2] - x[i, 2]))
        g1, g2, g3 = (
            dot(t1, d) - strain[e, 0],
            dot(t2, d) - strain[e, 1],
            dot(t3, d) - strain[e, 2],
        )
        f += f
        k1 = f * dot(t1, c) - strain[e, 3]
        k2 = f * dot(t2, c) - strain[e, 4]
        k3 = f * dot(t3, c) - strain[e, 5]
        c1, c2, c3 = pace * stiff[e, 0], pace * stiff[e, 1], pace * stiff[e, 2]
        bend1, bend2, bend3 = pace * stiff[e, 3], pace * stiff[e, 4], pace * stiff[e, 5]
        if relaxes:
            row = memory[WALL_LESS, 6 * e : 6 * e + 6]
            less = (row[0], row[1], row[2], row[3], row[4], row[5])
        off = chord[e, OFF]
        along, lower = c1, off * k2
        n1, n2, n3 = c1 * (g1 - lower) - less[0], c2 * g2 - less[1], c3 * g3 - less[2]
        m1, m2, m3 = bend1 * k1 - less[3], bend2 * k2 - less[4], bend3 * k3 - less[5]
        # n and m in space, y = B m with B = (1 + t.c) I + (c - t) c^T; t = tau c, since
        # tan(phi/4) = tan(phi/2) / (1 + sqrt(1 + tan^2(phi/2))).
        f2, f3 = chord[e, 0], chord[e, 1]
        thin = f2 > 0.0 or f3 > 0.0
        e1, e2, e3, length = 1.0, 0.0, 0.0, 1.0
        direction, dyad = t1, 0.0  # e in space, and EA - N/L
        if thin:
            length = math.sqrt((1.0 + g1) ** 2 + f2 * g2**2 + f3 * g3**2)
            e1, e2, e3 = (1.0 + g1) / length, f2 * g2 / length, f3 * g3 / length
            direction = added(added(scaled(t1, e1), scaled(t2, e2)), scaled(t3, e3))
            g1 = length - 1.0
            n1 = c1 * (g1 - lower) - less[0]
            tight = n1 / length
            dyad = c1 - tight
            c1, c2, c3 = tight, c2 + f2 * tight, c3 + f3 * tight
        g1 -= lower
        law = e < wall.shape[0]
        coupled = law or off != 0.0
        in_c = in_m = in_x = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        if law:
            ea, soft2, soft3 = wall[e, STRENGTH], wall[e, SOFT_2], wall[e, SOFT_3]
            square = strained[e, 1]
            psi, n1, per, m2, m3, c11, c12, c22, x2, x3, y2, y3, z22, z23, z33 = section_forces(
                fibres, FIBRES * e, wall, e, strained[e, 0], square, k2, k3
            )
            if off != 0.0:
                z22, z23 = z22 + off * (off * c11 - 2.0 * x2), z23 - off * x3
                x2, y2 = x2 - off * c11, y2 - off * c12
            if relaxes:
                force = memory[FORCE, 6 * e : 6 * e + 6]
                memory[ENERGY, e] = ea * psi + 0.5 * stiff[e, 3] * k1 * k1
                force[0], force[4], force[5] = ea * n1, ea * m2, ea * m3
                force[1], force[2] = ea * per * soft2 * g2, ea * per * soft3 * g3
                energy -= h[e] * (
                    less[0] * g1 + less[1] * g2 + less[2] * g3
                    + 0.5 * less[3] * k1 + less[4] * k2 + less[5] * k3
                )  # fmt: skip
            ea *= pace
            energy += h[e] * (ea * psi + 0.5 * m1 * k1)
            n1, m2, m3 = ea * n1 - less[0], ea * m2 - less[4], ea * m3 - less[5]
            # Half the derivatives of gam^2, and the force's by the stretch and by those.
            v2, v3 = soft2 * g2, soft3 * g3
            n2, n3, per = ea * per * v2 - less[1], ea * per * v3 - less[2], ea * per
            c11, c12, c22 = ea * c11, ea * c12, ea * c22
            in_c = (
                c11, c12 * v2, c12 * v3,
                c12 * v2, per * soft2 + c22 * v2 * v2, c22 * v2 * v3,
                c12 * v3, c22 * v2 * v3, per * soft3 + c22 * v3 * v3,
            )  # fmt: skip
            x2, x3, y2, y3 = ea * x2, ea * x3, ea * y2, ea * y3
            in_x = (0.0, x2, x3, 0.0, y2 * v2, y3 * v2, 0.0, y2 * v3, y3 * v3)
            if thin:
                # The stretch is the chord's: its gradient is e, its second (diag(1, f^2) - e e)/L.
                tight = n1 / length
                c11 -= tight
                w2, w3 = c12 * v2, c12 * v3
                a12 = c11 * e1 * e2 + e1 * w2
                a13 = c11 * e1 * e3 + e1 * w3
                a23 = c11 * e2 * e3 + e2 * w3 + w2 * e3 + c22 * v2 * v3
                in_c = (
                    tight + c11 * e1 * e1, a12, a13,
                    a12, f2 * tight + c11 * e2 * e2 + 2.0 * e2 * w2 + per * soft2 + c22 * v2 * v2,
                    a23, a13, a23,
                    f3 * tight + c11 * e3 * e3 + 2.0 * e3 * w3 + per * soft3 + c22 * v3 * v3,
                )  # fmt: skip
                in_x = (
                    0.0, e1 * x2, e1 * x3, 0.0, e2 * x2 + y2 * v2, e2 * x3 + y3 * v2,
                    0.0, e3 * x2 + y2 * v3, e3 * x3 + y3 * v3,
                )  # fmt: skip
            in_m = (bend1, 0.0, 0.0, 0.0, ea * z22, ea * z23, 0.0, ea * z23, ea * z33)
        else:
            energy += 0.5 * h[e] * (
                (n1 - less[0]) * g1 + (n2 - less[1]) * g2 + (n3 - less[2]) * g3
                + (m1 - less[3]) * k1 + (m2 - less[4]) * k2 + (m3 - less[5]) * k3
            )  # fmt: skip
            if relaxes:
                force = memory[FORCE, 6 * e : 6 * e + 6]
                force[0], force[1], force[2] = stiff[e, 0] * g1, stiff[e, 1] * g2, stiff[e, 2] * g3
                force[4], force[5] = stiff[e, 4] * k2, stiff[e, 5] * k3
                memory[ENERGY, e] = 0.5 * (
                    force[0] * g1 + force[1] * g2 + force[2] * g3
                    + stiff[e, 3] * k1 * k1 + force[4] * k2 + force[5] * k3
                )  # fmt: skip
            if coupled:
                a12, a13, a23 = dyad * e1 * e2, dyad * e1 * e3, dyad * e2 * e3
                in_c = (
                    c1 + dyad * e1 * e1, a12, a13,
                    a12, c2 + dyad * e2 * e2, a23, a13, a23, c3 + dyad * e3 * e3,
                )  # fmt: skip
                f = -off * along
                in_x = (0.0, f * e1, 0.0, 0.0, f * e2, 0.0, 0.0, f * e3, 0.0)
                in_m = (bend1, 0.0, 0.0, 0.0, bend2 - f * off, 0.0, 0.0, 0.0, bend3)
        if relaxes:
            row = memory[STRAIN, 6 * e : 6 * e + 6]
            row[0], row[1], row[2], row[3], row[4], row[5] = g1, g2, g3, k1, k2, k3
            memory[FORCE, 6 * e + 3] = stiff[e, 3] * k1
        m2 -= off * n1
        if thin:
            n1, n2, n3 = n1 * e1, n2 + n1 * e2, n3 + n1 * e3
        n = added(added(scaled(t1, n1), scaled(t2, n2)), scaled(t3, n3))
        m = added(added(scaled(t1, m1), scaled(t2, m2)), scaled(t3, m3))
        tau = 1.0 / (1.0 + math.sqrt(1.0 + dot(c, c)))
        t = scaled(c, tau)
        b1 = 1.0 + dot(t, c)
        y = added(scaled(m, b1), scaled(c, (1.0 - tau) * dot(c, m)))
        dn = cross(d, n)
        gs = scaled(dn, -h[e])
        tg = cross(t, gs)
        section[e, 0], section[e, 1], section[e, 2] = n1, n2, n3
        # Moments on the two nodes: (I - [t])/2 and (I + [t])/2 times the gradient by sigma, -+ y.
        ei = (
            0.5 * (gs[0] - tg[0]) - y[0],
            0.5 * (gs[1] - tg[1]) - y[1],
            0.5 * (gs[2] - tg[2]) - y[2],
        )
        ej = (
            0.5 * (gs[0] + tg[0]) + y[0],
            0.5 * (gs[1] + tg[1]) + y[1],
            0.5 * (gs[2] + tg[2]) + y[2],
        )
        # At the ends by the nodes' own frames: the force is constant along the element.
        for node in range(2):
            qk = q1 if node else q0
            p1, p2, p3 = columns(qk[0], qk[1], qk[2], qk[3])
            end = ej if node else (-ei[0], -ei[1], -ei[2])
            section[e, 3 + 3 * node] = dot(end, p1)
            section[e, 4 + 3 * node] = dot(end, p2)
            section[e, 5 + 3 * node] = dot(end, p3)
            section[e, 9 + node] = dot(n, p1)
        for r in range(3):
            g[i, r] -= n[r]
            g[j, r] += n[r]
            g[i, 3 + r] += ei[r]
            g[j, 3 + r] += ej[r]

        # The tangent in (u', sigma, D), 3 x 3 blocks by rows: p for u' sigma (over h), w for
        # sigma sigma, v for sigma D, z for D D; C and C_m in space are `big_c` and `big_m`.
        if coupled:
            big_c, big_m = congruent(in_c, t1, t2, t3), congruent(in_m, t1, t2, t3)
        else:
            big_c = turned(c1, c2, c3, t1, t2, t3)
            if thin:
                big_c = with_dyad(big_c, dyad, direction)
            big_m = turned(bend1, bend2, bend3, t1, t2, t3)
        cd = times_cross(big_c, d)  # C [d]
        p = (
            cd[0],
            cd[1] + n[2],
            cd[2] - n[1],
            cd[3] - n[2],
            cd[4],
            cd[5] + n[0],
            cd[6] + n[1],
            cd[7] - n[0],
            cd[8],
        )
        dcd = cross_times(d, cd)  # [d] C [d] = -[d]^T C [d]
        nd = dot(n, d)
        hh = h[e]
        w00 = hh * (n[0] * d[0] - nd - dcd[0])
        w11 = hh * (n[1] * d[1] - nd - dcd[4])
        w22 = hh * (n[2] * d[2] - nd - dcd[8])
        w01 = hh * (0.5 * (n[0] * d[1] + n[1] * d[0]) - dcd[1])
        w02 = hh * (0.5 * (n[0] * d[2] + n[2] * d[0]) - dcd[2])
        w12 = hh * (0.5 * (n[1] * d[2] + n[2] * d[1]) - dcd[5])
        w = (w00, w01, w02, w01, w11, w12, w02, w12, w22)
        # n.(t x d) = t.(d x n)
        diag = 0.5 * hh * dot(t, dn)
        u = scaled(dn, -0.5 * hh)
        v = (
            diag + u[0] * t[0],
            u[0] * t[1] - y[2],
            u[0] * t[2] + y[1],
            u[1] * t[0] + y[2],
            diag + u[1] * t[1],
            u[1] * t[2] - y[0],
            u[2] * t[0] - y[1],
            u[2] * t[1] + y[0],
            diag + u[2] * t[2],
        )
        xd = in_x
        if coupled:
            # Where stretch and bending go together, u' D: 2 C_x B, and sigma D: -[d] 2 C_x B.
            cx = congruent(in_x, t1, t2, t3)
            b2 = 2.0 * (1.0 - tau)
            xc = (
                b2 * (cx[0] * c[0] + cx[1] * c[1] + cx[2] * c[2]),
                b2 * (cx[3] * c[0] + cx[4] * c[1] + cx[5] * c[2]),
                b2 * (cx[6] * c[0] + cx[7] * c[1] + cx[8] * c[2]),
            )
            b2 = 2.0 * b1
            xd = (
                b2 * cx[0] + xc[0] * c[0], b2 * cx[1] + xc[0] * c[1], b2 * cx[2] + xc[0] * c[2],
                b2 * cx[3] + xc[1] * c[0], b2 * cx[4] + xc[1] * c[1], b2 * cx[5] + xc[1] * c[2],
                b2 * cx[6] + xc[2] * c[0], b2 * cx[7] + xc[2] * c[1], b2 * cx[8] + xc[2] * c[2],
            )  # fmt: skip
            dx = cross_times(d, xd)
            v = (
                v[0] - dx[0], v[1] - dx[1], v[2] - dx[2],
                v[3] - dx[3], v[4] - dx[4], v[5] - dx[5],
                v[6] - dx[6], v[7] - dx[7], v[8] - dx[8],
            )  # fmt: skip
        # B C_m B with B = b1 I + b2 c c^T: C_m c once, then dyads.
        b2 = 1.0 - tau
        mc = (
            big_m[0] * c[0] + big_m[1] * c[1] + big_m[2] * c[2],
            big_m[3] * c[0] + big_m[4] * c[1] + big_m[5] * c[2],
            big_m[6] * c[0] + big_m[7] * c[1] + big_m[8] * c[2],
        )
        f = 4.0 / hh
        b11 = f * b1 * b1
        # sym part: f b1 b2 (c mc^T + mc c^T) + f b2^2 (c.mc) c c^T  =  c a^T + a c^T
        half = 0.5 * f * b2 * b2 * dot(c, mc)
        a = added(scaled(mc, f * b1 * b2), scaled(c, half))
        k = (2.0 - tau) * c[0], (2.0 - tau) * c[1], (2.0 - tau) * c[2]
        yt = 2.0 * dot(y, t)
        z00 = b11 * big_m[0] + 2.0 * (c[0] * a[0] + k[0] * y[0]) + yt
        z11 = b11 * big_m[4] + 2.0 * (c[1] * a[1] + k[1] * y[1]) + yt
        z22 = b11 * big_m[8] + 2.0 * (c[2] * a[2] + k[2] * y[2]) + yt
        z01 = b11 * big_m[1] + c[0] * a[1] + a[0] * c[1] + k[0] * y[1] + y[0] * k[1]
        z02 = b11 * big_m[2] + c[0] * a[2] + a[0] * c[2] + k[0] * y[2] + y[0] * k[2]
        z12 = b11 * big_m[5] + c[1] * a[2] + a[1] * c[2] + k[1] * y[2] + y[1] * k[2]

        # From (u', sigma, D) to the nodes: u' = (u_j - u_i)/h, D = (w_j - w_i)/2, and sigma has w_i
        # by (I + [t])/2 and w_j by (I - [t])/2. So the blocks of w are, with Y = [t] v + ([t] v)^T,
        #   w_j w_j, w_i w_i   (w -+ (w [t] + (w [t])^T) - [t] w [t] +- (v + v^T) + Y + z) / 4
        #   w_i w_j            (w + [t] w [t] - Y - z - (w [t] + [t] w) + (v - v^T)) / 4
        pt = times_cross(p, t)
        wt = times_cross(w, t)  # its transpose is -[t] w
        twt = cross_times(t, wt)
        tv = cross_times(t, v)
        sy00, sy11, sy22 = 2.0 * wt[0], 2.0 * wt[4], 2.0 * wt[8]
        sy01, sy02, sy12 = wt[1] + wt[3], wt[2] + wt[6], wt[5] + wt[7]
        # The transpose of v [t] is -[t] v^T, so tv - v^T t = tv + (tv)^T.
        y00, y11, y22 = 2.0 * tv[0], 2.0 * tv[4], 2.0 * tv[8]
        y01, y02, y12 = tv[1] + tv[3], tv[2] + tv[6], tv[5] + tv[7]
        v00, v11, v22 = 2.0 * v[0], 2.0 * v[4], 2.0 * v[8]
        v01, v02, v12 = v[1] + v[3], v[2] + v[6], v[5] + v[7]
        f = 1.0 / hh
        for node in range(2):
            b = diagonal[j if node else i]
            sign = 1.0 if node else -1.0
            b[0, 0] += f * big_c[0]
            b[1, 0] += f * big_c[3]
            b[1, 1] += f * big_c[4]
            b[2, 0] += f * big_c[6]
            b[2, 1] += f * big_c[7]
            b[2, 2] += f * big_c[8]
            for r in range(3):
                for col in range(3):
                    # (sign p (I - sign [t])/2)^T
                    b[3 + col, r] += 0.5 * (sign * p[3 * r + col] - pt[3 * r + col])
            b[3, 3] += 0.25 * (w00 - sign * sy00 - twt[0] + sign * v00 + y00 + z00)
            b[4, 4] += 0.25 * (w11 - sign * sy11 - twt[4] + sign * v11 + y11 + z11)
            b[5, 5] += 0.25 * (w22 - sign * sy22 - twt[8] + sign * v22 + y22 + z22)
            b[4, 3] += 0.25 * (w01 - sign * sy01 - twt[1] + sign * v01 + y01 + z01)
            b[5, 3] += 0.25 * (w02 - sign * sy02 - twt[2] + sign * v02 + y02 + z02)
            b[5, 4] += 0.25 * (w12 - sign * sy12 - twt[5] + sign * v12 + y12 + z12)
        b = block[ends[e, 2]]
        for r in range(3):
            for col in range(3):
                b[r, col] -= f * big_c[3 * r + col]
                b[r, 3 + col] -= 0.5 * (p[3 * r + col] - pt[3 * r + col])
                b[3 + col, r] += 0.5 * (p[3 * r + col] + pt[3 * r + col])
        if coupled:
            for r in range(3):
                for col in range(3):
                    term = 0.5 * f * xd[3 * r + col]
                    diagonal[i, 3 + col, r] += term
                    diagonal[j, 3 + col, r] += term
                    b[r, 3 + col] -= term
                    b[3 + col, r] -= term
        # Skew parts: w [t] + [t] w = wt - wt^T, and v - v^T.
        q00 = w00 + twt[0] - y00 - z00
        q11 = w11 + twt[4] - y11 - z11
        q22 = w22 + twt[8] - y22 - z22
        q01 = w01 + twt[1] - y01 - z01
        q02 = w02 + twt[2] - y02 - z02
        q12 = w12 + twt[5] - y12 - z12
        a01 = (v[1] - v[3]) - (wt[1] - wt[3])
        a02 = (v[2] - v[6]) - (wt[2] - wt[6])
        a12 = (v[5] - v[7]) - (wt[5] - wt[7])
        b[3, 3] += 0.25 * q00
        b[4, 4] += 0.25 * q11
        b[5, 5] += 0.25 * q22
        b[3, 4] += 0.25 * (q01 + a01)
        b[4, 3] += 0.25 * (q01 - a01)
        b[3, 5] += 0.25 * (q02 + a02)
        b[5, 3] += 0.25 * (q02 - a02)
        b[4, 5] += 0.25 * (q12 + a12)
        b[5, 4] += 0.25 * (q12 - a12)
        if ends[e, 3]:
            for r in range(6):
                for col in range(r):
                    b[r, col], b[col, r] = b[col, r], b[r, col]
    return energy
