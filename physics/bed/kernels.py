"""The compiled part of a beam in space on a bed of strands: energy, gradient, tangent, Newton.

Units mm, N, MPa, rad. Only + - * / and square roots, in a fixed order and without fast-math: a
run gives the same bits on every machine that computes by IEEE 754. Indices: e elements; n, i and j
nodes; r and c (or `col`) the freedoms of a node (x, y, z, then the spin about them); m rods.

**Beam** [Simo 1985, Reissner 1981]. Nodes have a place x and a unit quaternion q; their
rotations change by a spin w through Cayley's map, q <- (1, w/2) q / |.|, so that no trigonometry is
needed. An element of length h at rest has the mid rotation R = R(q_i + q_j) with columns t_a, the
half Gibbs vector c = vec(q_j q_i*) / scal = tan(phi/2) e of its nodes' relative rotation, t =
tan(phi/4) e and d = (x_j - x_i)/h.
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

**Strand.** A central spring from r = R_n rho of the nearest node n to a foot b: l = x_n + r - b,
elongation u = |l| - L, force f(u) along l: zero while slack, (1 - d) k u, and past the yield
elongation u_0 down a straight line to zero at u_f, where it has parted: a bilinear cohesive law
with the damage d = u_f (u - u_0) / (u (u_f - u_0)), which never heals. Dissipated is
G (u - u_0)/(u_f - u_0) for the largest u so far, with G = k u_0 u_f / 2. With t = l/|l|, b = f/|l|,
a = f'(u) - b, v = r x t and e = l - r the second derivatives are

    x x   a t t^T + b I     x w   a t v^T - b [r]     w w   a v v^T + b (sym(e r^T) - (e.r) I)

They touch the block of the strand's node only, so the tangent stays block-tridiagonal (6 x 6).

**Rod.** A half-line from its tip, with direction u and radius r. A strand that meets it takes the
shortest path round it, straight on the unrolled cylinder, on the side where it was first touched:
length^2 = plane^2 + axial^2, plane = l_a + l_b + r (phi - atan(l_a/r) - atan(l_b/r)), with
l = sqrt(distance^2 - r^2) the tangent from either end and phi the angle between the ends about u.
There is no friction. A strand is met when the tip has gone past it, and slips off past 3 rad or
past the tip: these two jump, so that in a search for equilibrium they stand as they are
(`meet_rods`). The duct, a round bar about the axis, is kept off by a penalty contact.

**Equilibrium** is a minimum of the beam's energy plus the strands' incremental potential (elastic
energy plus what is dissipated from the last accepted state on), held at the nodes that hooks hold:
Newton's method with a line search on that energy (Armijo's rule) and a shift of the tangent where
it is not positive definite (`equilibrium`; `yielded` then updates the damage). **Tick** is the same
beam in real time: damage relaxes towards its law with a delay tau, d' = (d_law - d) / tau, then one
Newton step with a small viscous drag. While d stands, every strand's secant stiffness is positive,
so that one factorisation is nearly always enough: a fixed cost.
"""

import math
from collections.abc import Callable
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from kernel_cache import njit

F = TypeVar("F", bound=Callable[..., object])


def inner(function: F) -> F:
    """Return a function compiled for other compiled ones alone: no wrapper, less to compile."""
    options = {"cache": True, "error_model": "numpy"}
    compiled = njit(no_cpython_wrapper=True, no_cfunc_wrapper=True, **options)  # pyright: ignore
    return compiled(function)  # pyright: ignore


Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Three = tuple[float, float, float]
Nine = tuple[float, float, float, float, float, float, float, float, float]

# Rows of `strand`.
ARM_X, ARM_Y, ARM_Z, FOOT_X, FOOT_Y, FOOT_Z, STIFF, LENGTH, YIELD, PART, PUSHES = range(11)
STRAND_ROWS = 11

# Entries of `sums`. Of the last assembly: energies of beam, strands, contacts and dead loads, mJ;
# energy dissipated now, mJ; strands not parted; largest strand force and force scale, N. Since the
# beginning: the energy balance of `Books`, mJ; and how many strands parted that lay on a
# rod. Since the last assembly: the drag's share, and the
# energy of strands that a rod's tip has come upon, or that have slipped off one, mJ.
BEAM, STRANDS, CONTACT, LOADS, LOST_NOW, WHOLE, MOST, FORCE_SCALE = range(8)
WORK, STORED, DISSIPATED, SNAP, DRAG, ROD_WORK, ROD_DISSIPATED, ROD_PARTED, DRAG_NOW = range(8, 17)
BENT_NOW, SLIPPED_NOW = range(17, 19)
SUM_ROWS = 19

# Entries of a row of `rods`: tip, direction from the tip back along the shaft, radius, in use.
TIP, SHAFT, RADIUS, IN_USE = 0, 3, 6, 7
ROD_ROWS = 8

SLIPS, MOST_WRAP = 3.0, 3.2
"""Angles, rad: wrapped by more a strand slips off a rod; and none is wrapped by more."""
UNMET = 2
"""In `side`: a strand that is out of a rod's reach, or past its tip. Odd ones touch it."""

# What damage does in an assembly: it stays; the incremental potential counts it; it relaxes.
STANDING, POTENTIAL, DELAYED = 0, 1, 2


class State(NamedTuple):
    """A beam on its bed, and room to work in; N nodes, S strands, M rods.

    `held` are bits of what is held at a node (1 2 4 along x y z, 8 16 32 turning about them),
    `goal` where, `load` dead forces, `spring` what draws a node to its goal. `stiff` and
    `strain` are rows of normal, two shear, torsion and two bending terms. `first[n]` is node n's
    first strand. `section` has an element's normal and shear forces, its moments at both ends
    (torsion, bending up, bending across) and the normal forces there.
    """

    x: Floats  # (N, 3) mm
    q: Floats  # (N, 4) unit quaternions, scalar first
    goal: Floats  # (N, 3) mm
    held: Ints  # (N,)
    load: Floats  # (N, 3) N
    spring: Floats  # (N, 3) N/mm
    h: Floats  # (N - 1,) lengths at rest, mm
    stiff: Floats  # (N - 1, 6) N, N mm^2
    strain: Floats  # (N - 1, 6) Gamma_0 and kappa_0, 1/mm
    first: Ints  # (N + 1,)
    strand: Floats  # (STRAND_ROWS, S)
    damage: Floats  # (S,) 0 whole to 1 parted
    floor: Floats  # (N, 2) stiffness, N/mm, and height at rest, mm
    thick: Floats  # (N, 3) radius, mm, contact stiffness, N/mm, and reach of rods, mm
    rods: Floats  # (M, ROD_ROWS) mm
    # (M, S) side on which a strand goes round a rod, 1 or -1; 0: it does not touch; `UNMET`
    side: Ints
    pull: Floats  # (M, 3) forces of hands on rods, N
    press: Floats  # (M, 3) their part against the beam itself, N
    section: Floats  # (N - 1, 11)
    g: Floats  # (N, 6) gradient, N and N mm
    step: Floats  # (N, 6) mm and rad
    diagonal: Floats  # (N, 6, 6) the tangent's diagonal blocks, lower triangles
    upper: Floats  # (N - 1, 6, 6) its blocks of one node and the next
    diagonal_kept: Floats
    upper_kept: Floats
    x_kept: Floats
    q_kept: Floats
    goal_from: Floats
    goal_to: Floats
    load_from: Floats
    load_to: Floats
    rods_from: Floats
    rods_to: Floats
    hold: Floats
    react: Floats  # (N, 3) forces of hands that hold, N
    shed: Floats  # (N, 6) what damage has taken off the gradient in the last assembly
    rods_shed: Floats  # (M, 3) and off the hands' forces on rods, N
    moved: Floats  # (N, 6) displacements since the assembly before, mm and rad
    g_before: Floats  # (N, 6) its gradient
    load_before: Floats  # (N, 3) its dead forces, N
    pull_before: Floats  # (M, 3) its forces on rods, N
    sums: Floats


@inner
def cross(a: Three, b: Three) -> Three:
    """Return a x b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@inner
def dot(a: Three, b: Three) -> float:
    """Return a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inner
def scaled(a: Three, s: float) -> Three:
    """Return s a."""
    return (s * a[0], s * a[1], s * a[2])


@inner
def added(a: Three, b: Three) -> Three:
    """Return a + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@inner
def times_cross(m: Nine, v: Three) -> Nine:
    """Return the matrix m [v], rows after one another."""
    return (
        m[1] * v[2] - m[2] * v[1],
        m[2] * v[0] - m[0] * v[2],
        m[0] * v[1] - m[1] * v[0],
        m[4] * v[2] - m[5] * v[1],
        m[5] * v[0] - m[3] * v[2],
        m[3] * v[1] - m[4] * v[0],
        m[7] * v[2] - m[8] * v[1],
        m[8] * v[0] - m[6] * v[2],
        m[6] * v[1] - m[7] * v[0],
    )


@inner
def cross_times(v: Three, m: Nine) -> Nine:
    """Return the matrix [v] m, rows after one another."""
    return (
        v[1] * m[6] - v[2] * m[3],
        v[1] * m[7] - v[2] * m[4],
        v[1] * m[8] - v[2] * m[5],
        v[2] * m[0] - v[0] * m[6],
        v[2] * m[1] - v[0] * m[7],
        v[2] * m[2] - v[0] * m[8],
        v[0] * m[3] - v[1] * m[0],
        v[0] * m[4] - v[1] * m[1],
        v[0] * m[5] - v[1] * m[2],
    )


@inner
def turned(stiff: Floats, e: int, at: int, t1: Three, t2: Three, t3: Three) -> Nine:
    """Return the diagonal stiffnesses from column `at` on, turned by the columns t1, t2, t3."""
    a, b, c = stiff[e, at], stiff[e, at + 1], stiff[e, at + 2]
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
def columns(w: float, x: float, y: float, z: float) -> tuple[Three, Three, Three]:
    """Return the columns of a unit quaternion's rotation."""
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)),
        (2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)),
        (2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)),
    )


@inner
def element_frame(q: Floats, e: int) -> tuple[Three, Three, Three, Three]:
    """Return the columns of an element's mid rotation and its half Gibbs vector c."""
    w0, x0, y0, z0 = q[e, 0], q[e, 1], q[e, 2], q[e, 3]
    w1, x1, y1, z1 = q[e + 1, 0], q[e + 1, 1], q[e + 1, 2], q[e + 1, 3]
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


@njit(cache=True, error_model="numpy", nogil=True)
def set_rest(x: Floats, q: Floats, h: Floats, strain: Floats) -> None:
    """Write the strains of this shape into `strain`: it is then the beam's shape at rest."""
    for e in range(h.size):
        t1, t2, t3, c = element_frame(q, e)
        d = (
            (x[e + 1, 0] - x[e, 0]) / h[e],
            (x[e + 1, 1] - x[e, 1]) / h[e],
            (x[e + 1, 2] - x[e, 2]) / h[e],
        )
        f = 2.0 / h[e]
        strain[e, 0], strain[e, 1], strain[e, 2] = dot(t1, d), dot(t2, d), dot(t3, d)
        strain[e, 3], strain[e, 4], strain[e, 5] = f * dot(t1, c), f * dot(t2, c), f * dot(t3, c)


@inner
def beam_pass(s: State) -> None:
    """Add the beam's energy, gradient and tangent; write its section forces."""
    x, h, stiff, strain, g = s.x, s.h, s.stiff, s.strain, s.g
    energy = 0.0
    for e in range(h.size):
        i, j = e, e + 1
        t1, t2, t3, c = element_frame(s.q, e)
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
        n1, n2, n3 = stiff[e, 0] * g1, stiff[e, 1] * g2, stiff[e, 2] * g3
        m1, m2, m3 = stiff[e, 3] * k1, stiff[e, 4] * k2, stiff[e, 5] * k3
        # n and m in space, y = B m with B = (1 + t.c) I + (c - t) c^T; t = tau c, since
        # tan(phi/4) = tan(phi/2) / (1 + sqrt(1 + tan^2(phi/2))).
        energy += 0.5 * h[e] * (n1 * g1 + n2 * g2 + n3 * g3 + m1 * k1 + m2 * k2 + m3 * k3)
        n = added(added(scaled(t1, n1), scaled(t2, n2)), scaled(t3, n3))
        m = added(added(scaled(t1, m1), scaled(t2, m2)), scaled(t3, m3))
        tau = 1.0 / (1.0 + math.sqrt(1.0 + dot(c, c)))
        t = scaled(c, tau)
        b1 = 1.0 + dot(t, c)
        y = added(scaled(m, b1), scaled(c, (1.0 - tau) * dot(c, m)))
        dn = cross(d, n)
        gs = scaled(dn, -h[e])
        tg = cross(t, gs)
        s.section[e, 0], s.section[e, 1], s.section[e, 2] = n1, n2, n3
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
            p1, p2, p3 = columns(
                s.q[i + node, 0], s.q[i + node, 1], s.q[i + node, 2], s.q[i + node, 3]
            )
            end = ej if node else (-ei[0], -ei[1], -ei[2])
            s.section[e, 3 + 3 * node] = dot(end, p1)
            s.section[e, 4 + 3 * node] = dot(end, p2)
            s.section[e, 5 + 3 * node] = dot(end, p3)
            s.section[e, 9 + node] = dot(n, p1)
        for r in range(3):
            g[i, r] -= n[r]
            g[j, r] += n[r]
            g[i, 3 + r] += ei[r]
            g[j, 3 + r] += ej[r]

        # The tangent in (u', sigma, D), 3 x 3 blocks by rows: p for u' sigma (over h), w for
        # sigma sigma, v for sigma D, z for D D; C and C_m in space are `big_c` and `big_m`.
        big_c = turned(stiff, e, 0, t1, t2, t3)
        big_m = turned(stiff, e, 3, t1, t2, t3)
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
            b = s.diagonal[i + node]
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
        b = s.upper[e]
        for r in range(3):
            for col in range(3):
                b[r, col] -= f * big_c[3 * r + col]
                b[r, 3 + col] -= 0.5 * (p[3 * r + col] - pt[3 * r + col])
                b[3 + col, r] += 0.5 * (p[3 * r + col] + pt[3 * r + col])
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
    s.sums[BEAM] = energy


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


@inner
def way_round(
    a: Three, b: Three, rod: Floats, side: int, live: bool
) -> tuple[int, float, Three, Three, float]:
    """Return side, length, its derivatives by a and b, and its curvature across the rod."""
    # `live`: strands may be met and may slip off. The length is that round the rod also where a
    # strand has just slipped off it, else 0. To a strand with an end inside it the rod is only as
    # thick as leaves that end on its surface: so lengths never jump.
    none = (0.0, 0.0, 0.0)
    if side == UNMET and not live:
        return UNMET, 0.0, none, none, 0.0
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
    way = added(b, scaled(a, -1.0))
    square = dot(way, way)
    nearest = -dot(a, way) / square if square > 0.0 else 0.0
    nearest = min(1.0, max(0.0, nearest))
    slipped = live and a0 + nearest * (b0 - a0) < 0.0  # past the tip
    if slipped and not bent:
        return UNMET, 0.0, none, none, 0.0
    turn = dot(u, cross(a, b))
    axial = b0 - a0
    if not bent:
        side = 1 if turn > 0.0 else -1
        foot = added(a, scaled(way, nearest))
        bent = dot(foot, foot) < r * r
    la, lb = math.sqrt(ra * ra - r * r), math.sqrt(rb * rb - r * r)
    arc = -1.0
    if bent:
        arc = angle(side * turn, dot(a, b)) - angle(la, r) - angle(lb, r)
        if arc < MOST_WRAP - 2.0 * math.pi:
            arc += 2.0 * math.pi
    if arc <= 0.0:
        return 0, 0.0, none, none, 0.0  # straight
    # `arc` is the angle wrapped: phi less the angles from both ends to their points of tangency.
    plane = la + lb + r * arc
    length = math.sqrt(plane * plane + axial * axial)
    if slipped:
        return UNMET, length, none, none, 0.0
    if live and arc > SLIPS:
        return 0, length, none, none, 0.0
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


@inner
def any_rod(s: State) -> bool:
    """Return whether any rod is in use."""
    found = False
    for m in range(s.rods.shape[0]):
        found = found or s.rods[m, IN_USE] != 0.0
    return found


@inner
def strand_ends(s: State, n: int, i: int) -> tuple[Three, Three]:
    """Return where strand i of node n holds the beam, and its foot."""
    t1, t2, t3 = columns(s.q[n, 0], s.q[n, 1], s.q[n, 2], s.q[n, 3])
    a0, a1, a2 = s.strand[ARM_X, i], s.strand[ARM_Y, i], s.strand[ARM_Z, i]
    end = (
        s.x[n, 0] + t1[0] * a0 + t2[0] * a1 + t3[0] * a2,
        s.x[n, 1] + t1[1] * a0 + t2[1] * a1 + t3[1] * a2,
        s.x[n, 2] + t1[2] * a0 + t2[2] * a1 + t3[2] * a2,
    )
    return end, (s.strand[FOOT_X, i], s.strand[FOOT_Y, i], s.strand[FOOT_Z, i])


@inner
def reached(s: State, n: int, m: int) -> tuple[bool, float, Three]:
    """Return whether node n's strands may touch rod m, how far it is away, and the way to it."""
    u = (s.rods[m, SHAFT], s.rods[m, SHAFT + 1], s.rods[m, SHAFT + 2])
    d = (s.x[n, 0] - s.rods[m, 0], s.x[n, 1] - s.rods[m, 1], s.x[n, 2] - s.rods[m, 2])
    d = added(d, scaled(u, -max(0.0, dot(d, u))))
    away = math.sqrt(dot(d, d))
    return away < s.thick[n, 0] + s.rods[m, RADIUS] + s.thick[n, 2], away, d


@inner
def rods_near(s: State, n: int, live: bool) -> bool:
    """Add the contact of node n with the rods; return whether its strands may touch one."""
    any_near = False
    for m in range(s.rods.shape[0]):
        if s.rods[m, IN_USE] == 0.0:
            continue
        near, away, d = reached(s, n, m)
        deep = s.thick[n, 0] + s.rods[m, RADIUS] - away
        if deep > 0.0 and away > 1e-9:
            d = scaled(d, 1.0 / away)
            push = s.thick[n, 1]
            b = s.diagonal[n]
            for r in range(3):
                s.g[n, r] -= push * deep * d[r]
                s.pull[m, r] += push * deep * d[r]
                s.press[m, r] += push * deep * d[r]
                for col in range(r + 1):
                    b[r, col] += push * d[r] * d[col]
            s.sums[CONTACT] += 0.5 * push * deep * deep
        if near or not live:
            any_near = True
        else:  # out of reach: strands forget on which side they touched it
            for i in range(s.first[n], s.first[n + 1]):
                s.side[m, i] = UNMET
    return any_near


@inner
def strand_pass(s: State, kind: int, mix: float) -> None:
    """Add the strands' energy, gradient and tangent; damage goes by `mix` where it is DELAYED."""
    strand, damage, side = s.strand, s.damage, s.side
    energy = lost = most = 0.0
    whole = 0
    rods = any_rod(s)
    for n in range(s.x.shape[0]):
        near = rods and rods_near(s, n, kind == DELAYED)
        if s.first[n] == s.first[n + 1]:
            continue
        t1, t2, t3 = columns(s.q[n, 0], s.q[n, 1], s.q[n, 2], s.q[n, 3])
        x0, x1, x2 = s.x[n, 0], s.x[n, 1], s.x[n, 2]
        shed = s.shed[n]
        fx = fy = fz = gx = gy = gz = 0.0
        h00 = h11 = h22 = h01 = h02 = h12 = 0.0
        p00 = p01 = p02 = p10 = p11 = p12 = p20 = p21 = p22 = 0.0
        w00 = w11 = w22 = w01 = w02 = w12 = bs = bx = by = bz = 0.0
        for i in range(s.first[n], s.first[n + 1]):
            if damage[i] >= 1.0:
                continue
            whole += 1
            a0, a1, a2 = strand[ARM_X, i], strand[ARM_Y, i], strand[ARM_Z, i]
            rx = t1[0] * a0 + t2[0] * a1 + t3[0] * a2
            ry = t1[1] * a0 + t2[1] * a1 + t3[1] * a2
            rz = t1[2] * a0 + t2[2] * a1 + t3[2] * a2
            lx = x0 + rx - strand[FOOT_X, i]
            ly = x1 + ry - strand[FOOT_Y, i]
            lz = x2 + rz - strand[FOOT_Z, i]
            rod = -1
            pull = by_a = (0.0, 0.0, 0.0)
            way = bow = 0.0
            if near:
                foot = (strand[FOOT_X, i], strand[FOOT_Y, i], strand[FOOT_Z, i])
                for m in range(s.rods.shape[0]):
                    if s.rods[m, IN_USE] == 0.0:
                        continue
                    was = side[m, i]
                    touch, way, by_a, by_b, bow = way_round(
                        (x0 + rx, x1 + ry, x2 + rz), foot, s.rods[m], was, kind == DELAYED
                    )
                    bent = touch & 1 == 1
                    if kind == DELAYED and way > 0.0 and (was == UNMET or not bent):
                        # Nothing along the shaft resists a tip that comes upon a strand, or that a
                        # strand slips off: the energy by which it jumps is booked.
                        straight_u = math.sqrt(lx * lx + ly * ly + lz * lz) - strand[LENGTH, i]
                        stiff = 0.5 * (1.0 - damage[i]) * strand[STIFF, i]
                        bent_u = way - strand[LENGTH, i]
                        if strand[PUSHES, i] == 0.0:
                            straight_u, bent_u = max(straight_u, 0.0), max(bent_u, 0.0)
                        jump = stiff * (bent_u * bent_u - straight_u * straight_u)
                        s.sums[BENT_NOW if bent else SLIPPED_NOW] += jump
                    if kind == DELAYED:
                        side[m, i] = touch
                    if bent:
                        rod = m
                        pull = added(by_a, by_b)
                        break
            if rod >= 0:
                length = way
                il = 1.0 / length
                tx, ty, tz = by_a
                il /= dot(by_a, by_a)  # of an end inside the rod it is no unit vector
                ux, uy, uz = tx * length - rx, ty * length - ry, tz * length - rz
            else:
                length = math.sqrt(lx * lx + ly * ly + lz * lz)
                il = 1.0 / length
                tx, ty, tz = lx * il, ly * il, lz * il
                ux, uy, uz = lx - rx, ly - ry, lz - rz
            u = length - strand[LENGTH, i]
            if u <= 0.0 and strand[PUSHES, i] == 0.0:
                continue
            k, u0, uf = strand[STIFF, i], strand[YIELD, i], strand[PART, i]
            d = damage[i]
            f = (1.0 - d) * k * u
            slope = (1.0 - d) * k
            stored = 0.5 * f * u
            if u > u0 and kind != STANDING:
                goal = 1.0 if u >= uf else uf * (u - u0) / (u * (uf - u0))
                if goal > d:
                    if kind == DELAYED:
                        new = d + mix * (goal - d)
                        if goal >= 1.0 and new > 0.98:  # else it would only ever come near 1
                            new = 1.0
                        gone = 0.5 * k * u * u * (new - d)
                        lost += gone
                        damage[i] = new
                        fall = k * u * (new - d)
                        shed[0] += fall * tx
                        shed[1] += fall * ty
                        shed[2] += fall * tz
                        shed[3] += fall * (ry * tz - rz * ty)
                        shed[4] += fall * (rz * tx - rx * tz)
                        shed[5] += fall * (rx * ty - ry * tx)
                        if rod >= 0:
                            s.sums[ROD_DISSIPATED] += gone
                            s.rods_shed[rod, 0] -= fall * pull[0]
                            s.rods_shed[rod, 1] -= fall * pull[1]
                            s.rods_shed[rod, 2] -= fall * pull[2]
                        if new >= 1.0:
                            whole -= 1
                            if rod >= 0:
                                s.sums[ROD_PARTED] += 1.0
                            continue
                        slope = (1.0 - new) * k
                        f = slope * u
                        stored = 0.5 * f * u
                    else:
                        full = 0.5 * k * u0 * uf / (uf - u0)  # dissipated for each mm beyond u0
                        # The largest elongation so far, less u0: the law solved for u at d.
                        before = u0 * uf / (uf - d * (uf - u0)) - u0
                        if u >= uf:
                            energy += full * (uf - u0 - before)
                            continue
                        energy += full * (u - u0 - before)
                        slope = -k * u0 / (uf - u0)
                        f = slope * (u - uf)
                        stored = 0.5 * f * u
            energy += stored
            most = max(most, abs(f))
            if rod >= 0:
                s.pull[rod, 0] -= f * pull[0]
                s.pull[rod, 1] -= f * pull[1]
                s.pull[rod, 2] -= f * pull[2]
            b = f * il
            # A pushing strand's geometric stiffness is negative: left out in a tick, so that the
            # tangent stays definite. The gradient stays exact.
            if kind == DELAYED and b < 0.0:
                b = 0.0
            a = slope - b
            # The second derivative by the end of the strand is a t t^T + b I; with v = r x t and
            # e = l - r its blocks are a t v^T - b [r] and a v v^T + b (sym(e r^T) - (e.r) I).
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
            ux, uy, uz = b * ux, b * uy, b * uz
            ex, ey, ez = ux * rx, uy * ry, uz * rz
            w00 += a * vx * vx - ey - ez
            w11 += a * vy * vy - ex - ez
            w22 += a * vz * vz - ex - ey
            w01 += a * vx * vy + 0.5 * (ux * ry + uy * rx)
            w02 += a * vx * vz + 0.5 * (ux * rz + uz * rx)
            w12 += a * vy * vz + 0.5 * (uy * rz + uz * ry)
            if rod >= 0 and bow > 0.0 and f > 0.0:
                shaft = (s.rods[rod, SHAFT], s.rods[rod, SHAFT + 1], s.rods[rod, SHAFT + 2])
                t = cross(shaft, by_a)
                a = f * bow / dot(t, t)
                v = cross((rx, ry, rz), t)
                ax, ay, az = a * t[0], a * t[1], a * t[2]
                h00 += ax * t[0]
                h11 += ay * t[1]
                h22 += az * t[2]
                h01 += ax * t[1]
                h02 += ax * t[2]
                h12 += ay * t[2]
                p00 += ax * v[0]
                p01 += ax * v[1]
                p02 += ax * v[2]
                p10 += ay * v[0]
                p11 += ay * v[1]
                p12 += ay * v[2]
                p20 += az * v[0]
                p21 += az * v[1]
                p22 += az * v[2]
                w00 += a * v[0] * v[0]
                w11 += a * v[1] * v[1]
                w22 += a * v[2] * v[2]
                w01 += a * v[0] * v[1]
                w02 += a * v[0] * v[2]
                w12 += a * v[1] * v[2]
        c = s.diagonal[n]
        g = s.g[n]
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
    s.sums[STRANDS] = energy
    s.sums[LOST_NOW] = lost
    s.sums[WHOLE] = whole
    s.sums[MOST] = most


@inner
def node_pass(s: State) -> None:
    """Add the floor under the nodes, dead forces and springs to their goals."""
    contact = loads = 0.0
    for n in range(s.x.shape[0]):
        deep = s.floor[n, 1] - s.x[n, 2]
        if deep > 0.0 and s.floor[n, 0] > 0.0:
            s.g[n, 2] -= s.floor[n, 0] * deep
            s.diagonal[n, 2, 2] += s.floor[n, 0]
            contact += 0.5 * s.floor[n, 0] * deep * deep
        for r in range(3):
            if s.load[n, r] != 0.0:
                s.g[n, r] -= s.load[n, r]
                loads -= s.load[n, r] * s.x[n, r]
            if s.spring[n, r] != 0.0:
                d = s.x[n, r] - s.goal[n, r]
                s.g[n, r] += s.spring[n, r] * d
                s.diagonal[n, r, r] += s.spring[n, r]
                contact += 0.5 * s.spring[n, r] * d * d
    s.sums[CONTACT] += contact
    s.sums[LOADS] = loads


@njit(cache=True, error_model="numpy", nogil=True)
def assemble(s: State, kind: int, mix: float) -> float:
    """Write all energies, the gradient and the tangent; return the energy to minimise."""
    s.g[:] = 0.0
    s.diagonal[:] = 0.0
    s.upper[:] = 0.0
    s.pull[:] = 0.0
    s.press[:] = 0.0
    s.shed[:] = 0.0
    s.rods_shed[:] = 0.0
    s.sums[CONTACT] = s.sums[BENT_NOW] = s.sums[SLIPPED_NOW] = 0.0
    beam_pass(s)
    strand_pass(s, kind, mix)
    node_pass(s)
    return s.sums[BEAM] + s.sums[STRANDS] + s.sums[CONTACT] + s.sums[LOADS]


@inner
def hold_nodes(s: State, part: float) -> None:
    """Constrain held freedoms: `step` gets minus their distance to the goal, times `part`."""
    n = s.x.shape[0]
    for i in range(n):
        mask = s.held[i]
        if mask == 0:
            continue
        b = s.diagonal[i]
        for r in range(6):
            if not (mask >> r) & 1:
                continue
            way = part * (s.goal[i, r] - s.x[i, r]) if r < 3 else 0.0
            if way != 0.0:
                for c in range(6):
                    s.step[i, c] += way * (b[r, c] if c <= r else b[c, r])
                if i + 1 < n:
                    for c in range(6):
                        s.step[i + 1, c] += way * s.upper[i, r, c]
                if i > 0:
                    for c in range(6):
                        s.step[i - 1, c] += way * s.upper[i - 1, c, r]
            for c in range(6):
                if c < r:
                    b[r, c] = 0.0
                elif c > r:
                    b[c, r] = 0.0
                if i + 1 < n:
                    s.upper[i, r, c] = 0.0
                if i > 0:
                    s.upper[i - 1, c, r] = 0.0
            b[r, r] = 1.0
            s.hold[i, r] = -way
    for i in range(n):
        mask = s.held[i]
        for r in range(6):
            if (mask >> r) & 1:
                s.step[i, r] = s.hold[i, r]


@inner
def solve(s: State) -> bool:
    """Replace `step` by -K^-1 step, by block Cholesky; False if K is not positive definite."""
    # K = L L^T with K_ii in the lower triangles of `diagonal` and K_i,i+1 in the full blocks of
    # `upper`, both overwritten: L_ii L_ii^T = K_ii - Y^T Y with Y = L_i-1,i-1^-1 K_i-1,i. The
    # diagonal of L_ii keeps the inverse, so that there is one division for each freedom.
    # A pivot that falls below 1e-14 of its entry is rounding: K is singular or worse.
    n = s.x.shape[0]
    for i in range(n):
        low = s.diagonal[i]
        b = s.step[i]
        for c in range(6):
            v = low[c, c]
            was = v
            for k in range(c):
                v -= low[c, k] * low[c, k]
            if not v > 1e-14 * was:
                return False
            v = math.sqrt(v)
            inverse = 1.0 / v
            low[c, c] = inverse
            for r in range(c + 1, 6):
                v = low[r, c]
                for k in range(c):
                    v -= low[r, k] * low[c, k]
                low[r, c] = v * inverse
        for r in range(6):
            v = b[r]
            for k in range(r):
                v -= low[r, k] * b[k]
            b[r] = v * low[r, r]
        if i + 1 < n:
            y = s.upper[i]
            for r in range(6):
                for k in range(r):
                    v = low[r, k]
                    for c in range(6):
                        y[r, c] -= v * y[k, c]
                v = low[r, r]
                for c in range(6):
                    y[r, c] *= v
            after = s.diagonal[i + 1]
            b2 = s.step[i + 1]
            for k in range(6):
                for r in range(6):
                    v = y[k, r]
                    for c in range(r + 1):
                        after[r, c] -= v * y[k, c]
                    b2[r] -= v * b[k]
    for i in range(n - 1, -1, -1):
        low = s.diagonal[i]
        b = s.step[i]
        if i + 1 < n:
            b2 = s.step[i + 1]
            for r in range(6):
                v = 0.0
                for c in range(6):
                    v += s.upper[i, r, c] * b2[c]
                b[r] -= v
        for r in range(5, -1, -1):
            v = b[r]
            for k in range(r + 1, 6):
                v -= low[k, r] * b[k]
            b[r] = v * low[r, r]
    for i in range(n):
        for r in range(6):
            s.step[i, r] = -s.step[i, r]
    return True


@inner
def move(s: State, part: float) -> None:
    """Move from the saved places and rotations by a part of the step."""
    for n in range(s.x.shape[0]):
        for r in range(3):
            s.x[n, r] = s.x_kept[n, r] + part * s.step[n, r]
        a = 0.5 * part * s.step[n, 3]
        b = 0.5 * part * s.step[n, 4]
        c = 0.5 * part * s.step[n, 5]
        w, x, y, z = s.q_kept[n, 0], s.q_kept[n, 1], s.q_kept[n, 2], s.q_kept[n, 3]
        q0 = w - a * x - b * y - c * z
        q1 = x + a * w + b * z - c * y
        q2 = y + b * w + c * x - a * z
        q3 = z + c * w + a * y - b * x
        f = 1.0 / math.sqrt(q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3)
        s.q[n, 0], s.q[n, 1], s.q[n, 2], s.q[n, 3] = f * q0, f * q1, f * q2, f * q3


@inner
def copy_rows(to: Floats, of: Floats) -> None:
    """Copy a table. Numba compiles loops far sooner than an assignment of arrays."""
    for n in range(of.shape[0]):
        for r in range(of.shape[1]):
            to[n, r] = of[n, r]


@inner
def copy_blocks(to: Floats, of: Floats) -> None:
    """Copy blocks of a matrix."""
    for n in range(of.shape[0]):
        for r in range(6):
            for c in range(6):
                to[n, r, c] = of[n, r, c]


@inner
def keep_shape(s: State) -> None:
    """Save places and rotations for `move`."""
    copy_rows(s.x_kept, s.x)
    copy_rows(s.q_kept, s.q)


@inner
def shift_tangent(s: State, shift: float, length: float) -> None:
    """Add `shift` to the tangent's displacements and length^2 as much to its rotations."""
    turning = shift * length * length
    for n in range(s.x.shape[0]):
        for r in range(3):
            s.diagonal[n, r, r] += shift
            s.diagonal[n, 3 + r, 3 + r] += turning


@inner
def way_to_goal(s: State) -> float:
    """Return the largest distance of a held freedom to its goal, mm."""
    most = 0.0
    for n in range(s.x.shape[0]):
        for r in range(3):
            if (s.held[n] >> r) & 1:
                most = max(most, abs(s.goal[n, r] - s.x[n, r]))
    return most


@inner
def residual(s: State, length: float) -> float:
    """Return the largest force out of balance, N; moments over a length. Sets the force scale."""
    most = scale = 0.0
    for n in range(s.x.shape[0]):
        for r in range(6):
            f = abs(s.g[n, r]) if r < 3 else abs(s.g[n, r]) / length
            if (s.held[n] >> r) & 1:
                scale = max(scale, f)
            else:
                most = max(most, f)
            if r < 3:
                scale = max(scale, abs(s.load[n, r]))
    for e in range(s.h.size):
        for r in range(3):
            scale = max(scale, abs(s.section[e, r]))
        for r in range(3, 9):
            scale = max(scale, abs(s.section[e, r]) / length)
    s.sums[FORCE_SCALE] = max(scale, s.sums[MOST])
    return most


@inner
def largest_turn(s: State) -> float:
    """Return the largest rotation of a node in the step, rad."""
    most = 0.0
    for n in range(s.x.shape[0]):
        v = s.step[n, 3] ** 2 + s.step[n, 4] ** 2 + s.step[n, 5] ** 2
        most = max(most, v)
    return math.sqrt(most)


@inner
def largest_way(s: State) -> float:
    """Return the largest displacement of a node in the step, mm."""
    most = 0.0
    for n in range(s.x.shape[0]):
        v = s.step[n, 0] ** 2 + s.step[n, 1] ** 2 + s.step[n, 2] ** 2
        most = max(most, v)
    return math.sqrt(most)


TURN_LIMIT = 0.5
"""Largest rotation of a node in one Newton step, rad: beyond it the quadratic model of the energy
is far off, and Gibbs vectors grow without bound as neighbours come to be half a turn apart."""
STALLED = 30
"""After how many Newton steps that lower no energy a beam on rods is at a minimum."""
UNSTABLE_TRIES = 12
"""How often an unstable equilibrium is left by a nudge. Nudges grow fourfold, from 4e-6 of an
element's length to some 17 lengths: beyond those nothing near the last shape is left to find."""


@inner
def nudge(s: State, size: float) -> None:
    """Write into `step` a small displacement of every free node, the same in every run."""
    seed = 1
    for n in range(s.x.shape[0]):
        for r in range(6):
            seed = (seed * 16807) % 2147483647
            free = not (s.held[n] >> r) & 1
            s.step[n, r] = size * (seed / 2147483647.0 - 0.5) if free and r < 3 else 0.0


@njit(cache=True, error_model="numpy", nogil=True)
def equilibrium(s: State, kind: int, tolerance: float, floor: float, most: int) -> int:
    """Find a minimum of the energy near this shape, the held nodes at goals; iterations, or -1."""
    # `tolerance` is the largest force out of balance as a part of the largest one, `floor` in N.
    # Moments count as forces over the longest element. `least_shift` is 1e-11 of the largest shear
    # stiffness of an element: next to nothing beside what holds, yet above the rounding.
    length = s.h[0]
    for e in range(s.h.size):
        length = max(length, s.h[e])
    span = 0.0
    for e in range(s.h.size):
        span += s.h[e]
    least_shift = 0.0
    for e in range(s.h.size):
        least_shift = max(least_shift, s.stiff[e, 1] / s.h[e])
    least_shift *= 1e-11
    shift = 0.0
    left = stalled = 0
    rods = any_rod(s)
    energy = assemble(s, kind, 0.0)
    for it in range(most):
        if not math.isfinite(energy):
            return -1
        going = way_to_goal(s)
        arrived = going <= 1e-13 * span
        out_of_balance = residual(s, length)
        # Balanced once held places are where they should be and free forces are small; the tangent
        # without any shift then says whether the equilibrium is stable.
        balanced = arrived and out_of_balance <= tolerance * s.sums[FORCE_SCALE] + floor
        if balanced:
            shift = 0.0
        copy_blocks(s.diagonal_kept, s.diagonal)
        copy_blocks(s.upper_kept, s.upper)
        found = False
        for _ in range(40):
            copy_rows(s.step, s.g)
            if shift > 0.0:
                shift_tangent(s, shift, length)
            hold_nodes(s, 1.0)
            found = solve(s)
            if found or balanced:
                break
            shift = max(16.0 * shift, least_shift)
            copy_blocks(s.diagonal, s.diagonal_kept)
            copy_blocks(s.upper, s.upper_kept)
        if balanced and not found:
            # A mode along which the energy does not change at all (neutral) is not unstable.
            copy_blocks(s.diagonal, s.diagonal_kept)
            copy_blocks(s.upper, s.upper_kept)
            copy_rows(s.step, s.g)
            shift_tangent(s, 1e-2 * least_shift, length)
            hold_nodes(s, 1.0)
            found = solve(s)
        if balanced and found:
            return it
        keep_shape(s)
        if balanced:
            # Unstable. A nudge with a part along every mode is enough: from there the energy falls
            # along the softest one.
            left += 1
            if left > UNSTABLE_TRIES:
                return -1
            nudge(s, 1e-6 * 4.0**left * length)
            move(s, 1.0)
            energy = assemble(s, kind, 0.0)
            continue
        if not found:
            return -1
        part = 1.0
        turn = largest_turn(s)
        if turn > TURN_LIMIT:
            part = TURN_LIMIT / turn
        far = largest_way(s)
        # Nor does any node go farther in one step than a quarter of the beam.
        if part * far > 0.25 * span:
            part = 0.25 * span / far
        if not arrived:  # held places still move: their work is no part of the energy searched
            move(s, part)
            energy = assemble(s, kind, 0.0)
            continue
        slope = 0.0
        for n in range(s.x.shape[0]):
            for r in range(6):
                if not (s.held[n] >> r) & 1:
                    slope += s.g[n, r] * s.step[n, r]
        before = energy
        rounding = 1e-13 * (abs(s.sums[BEAM]) + abs(s.sums[STRANDS]) + abs(s.sums[LOADS])) + 1e-300
        # Armijo's rule: at least 1e-4 of the fall that the slope promises. 0.4^30 is no step.
        accepted = False
        for _ in range(30):
            move(s, part)
            energy = assemble(s, kind, 0.0)
            if energy <= before + 1e-4 * part * slope + rounding:
                accepted = True
                break
            part *= 0.4
        # Where the energy falls as steeply as it began, as along a mode that is not stable, a step
        # four times as long is tried, and so on: by the shift alone it would take thousands.
        while accepted and shift > 0.0 and before - energy > -0.75 * part * slope:
            if 4.0 * part * turn > TURN_LIMIT or 4.0 * part * far > 0.25 * span:
                break
            lowest = energy
            move(s, 4.0 * part)
            energy = assemble(s, kind, 0.0)
            if not energy < lowest:
                move(s, part)
                energy = assemble(s, kind, 0.0)
                break
            part *= 4.0
        # The shift fades while full steps are taken, and grows steeply where none is.
        if accepted:
            shift = 0.0 if part >= 1.0 and shift < 16.0 * least_shift else 0.0625 * shift
            if part < 0.1:
                shift = max(shift, least_shift)
        else:
            copy_rows(s.x, s.x_kept)
            copy_rows(s.q, s.q_kept)
            energy = assemble(s, kind, 0.0)
            shift = max(64.0 * shift, least_shift)
            if shift > 1e18 * least_shift:
                return it if rods else -1
        # Where a strand's end goes into a rod its length has a kink: at a minimum there no forces
        # balance, and the energy falls no more, by however short a step.
        stalled = stalled + 1 if rods and energy > before - 10.0 * rounding else 0
        if stalled == STALLED:
            return it
    return -1


@njit(cache=True, error_model="numpy", nogil=True)
def meet_rods(s: State, meet: bool) -> int:
    """Let strands slip off rods, and be met by them if `meet`; return how many have jumped."""
    jumps = 0
    for n in range(s.x.shape[0]):
        for m in range(s.rods.shape[0]):
            if s.rods[m, IN_USE] == 0.0:
                continue
            near = reached(s, n, m)[0]
            for i in range(s.first[n], s.first[n + 1]):
                was = s.side[m, i]
                if not near or (was == UNMET and not meet):
                    s.side[m, i] = UNMET
                    continue
                end, foot = strand_ends(s, n, i)
                before = way_round(end, foot, s.rods[m], was, False)[0]
                now = way_round(end, foot, s.rods[m], was, True)[0]
                s.side[m, i] = now
                if (before ^ now) & 1 and s.damage[i] < 1.0:
                    jumps += 1
    return jumps


@njit(cache=True, error_model="numpy", nogil=True)
def yielded(s: State) -> float:
    """Update damage by the law at the present elongations; return the energy dissipated, mJ."""
    lost = 0.0
    rods = any_rod(s)
    for n in range(s.x.shape[0]):
        for i in range(s.first[n], s.first[n + 1]):
            d = s.damage[i]
            if d >= 1.0:
                continue
            end, foot = strand_ends(s, n, i)
            way = added(end, scaled(foot, -1.0))
            length = math.sqrt(dot(way, way))
            on_rod = False
            if rods:
                for m in range(s.rods.shape[0]):
                    if s.rods[m, IN_USE] != 0.0:
                        touch, bent, _, _, _ = way_round(end, foot, s.rods[m], s.side[m, i], False)
                        if touch & 1 == 1:
                            length, on_rod = bent, True
                            break
            u = length - s.strand[LENGTH, i]
            u0, uf = s.strand[YIELD, i], s.strand[PART, i]
            if u <= u0:
                continue
            goal = 1.0 if u >= uf else uf * (u - u0) / (u * (uf - u0))
            if goal > d:
                full = 0.5 * s.strand[STIFF, i] * u0 * uf / (uf - u0)
                before = u0 * uf / (uf - d * (uf - u0))
                gone = full * (min(u, uf) - before)
                lost += gone
                s.damage[i] = goal
                if on_rod:
                    s.sums[ROD_DISSIPATED] += gone
                    s.sums[ROD_PARTED] += goal >= 1.0
    return lost


@njit(cache=True, error_model="numpy", nogil=True)
def account(s: State) -> None:
    """Account for the motion from the assembly before to the last one."""
    # Trapezoidal rule in all that moved: nodes, springs' goals, rods. Held freedoms, springs, dead
    # forces and rods take the hands' work; what free nodes lose goes to the drag and the rest is
    # released (`SNAP`). Damage comes after the motion, so its end counts with what damage has taken
    # off since (`shed`).
    sums = s.sums
    work = lost = swept = 0.0
    for n in range(s.x.shape[0]):
        mask = s.held[n]
        for r in range(6):
            f = s.g[n, r]
            part = 0.5 * (s.g_before[n, r] + f + s.shed[n, r]) * s.moved[n, r]
            s.g_before[n, r] = f
            if (mask >> r) & 1:
                work += part
            else:
                lost -= part
            if r < 3:
                work += 0.5 * (s.load_before[n, r] + s.load[n, r]) * s.moved[n, r]
                s.load_before[n, r] = s.load[n, r]
                if not (mask >> r) & 1:
                    f = s.spring[n, r] * (s.goal[n, r] - s.x[n, r])
                    work += 0.5 * (s.react[n, r] + f) * (s.goal[n, r] - s.goal_from[n, r])
                s.react[n, r] = f
                s.goal_from[n, r] = s.goal[n, r]
            s.moved[n, r] = 0.0
    for m in range(s.rods.shape[0]):
        for r in range(3):
            way = s.rods[m, r] - s.rods_from[m, r]
            swept += 0.5 * (s.pull_before[m, r] + s.pull[m, r] + s.rods_shed[m, r]) * way
            s.pull_before[m, r] = s.pull[m, r]
            s.rods_from[m, r] = s.rods[m, r]
    swept += sums[BENT_NOW]
    drag, lost = sums[DRAG_NOW], lost + sums[SLIPPED_NOW]
    stored = sums[BEAM] + sums[STRANDS] + sums[CONTACT]
    if lost - drag > 1e-4 * (stored + sums[STORED] + sums[DISSIPATED]):
        # A jump, in which forces are anything but linear: it takes all that is missing.
        lost = work + swept - (stored - sums[STORED]) - sums[LOST_NOW]
    sums[WORK] += work + swept
    sums[ROD_WORK] += swept
    sums[DRAG] += drag
    sums[SNAP] += lost - drag
    sums[DISSIPATED] += sums[LOST_NOW]
    sums[STORED] = stored
    sums[DRAG_NOW] = 0.0


@inner
def add_drag(s: State, drag: float) -> None:
    """Add a drag, N/mm of a node's displacement, as of a bar that turns as well."""
    for n in range(s.x.shape[0]):
        turning = drag * s.thick[n, 0] * s.thick[n, 0]
        for r in range(3):
            s.diagonal[n, r, r] += drag
            s.diagonal[n, 3 + r, 3 + r] += turning


@njit(cache=True, error_model="numpy", nogil=True)
def tick(s: State, ticks: int, mix: float, drag: float, newton: int) -> bool:
    """Advance to `..._to` in so many real-time ticks; False if no tangent is definite."""
    # A tick lets damage go the part `mix` = dt / (tau + dt) of its way to the law (implicit Euler),
    # then takes `newton` Newton steps with a drag (N/mm at each node: c / dt) against the motion: a
    # fixed cost. Energy is accounted for up to the last assembly.
    for now in range(ticks):
        part = 1.0 / (ticks - now)
        for n in range(s.x.shape[0]):
            for r in range(3):
                s.goal[n, r] += part * (s.goal_to[n, r] - s.goal[n, r])
                s.load[n, r] += part * (s.load_to[n, r] - s.load[n, r])
        for m in range(s.rods.shape[0]):
            for r in range(ROD_ROWS):
                s.rods[m, r] += part * (s.rods_to[m, r] - s.rods[m, r])
        for round_ in range(newton):
            assemble(s, DELAYED if round_ == 0 else STANDING, mix)
            account(s)
            used = drag
            add_drag(s, used)
            copy_rows(s.step, s.g)
            hold_nodes(s, 1.0)
            # Not definite, which is rare: more and more drag, until it is.
            while not solve(s):
                used = 16.0 * used + 1e-3
                if used > 1e9:
                    return False
                assemble(s, STANDING, 0.0)
                add_drag(s, used)
                copy_rows(s.step, s.g)
                hold_nodes(s, 1.0)
            keep_shape(s)
            turn = largest_turn(s)
            part_ = 1.0 if turn <= TURN_LIMIT else TURN_LIMIT / turn
            move(s, part_)
            dragged = 0.0
            for n in range(s.x.shape[0]):
                size = s.thick[n, 0] * s.thick[n, 0]
                for r in range(6):
                    way = part_ * s.step[n, r]
                    s.moved[n, r] = way
                    if not (s.held[n] >> r) & 1:
                        dragged += used * way * way * (1.0 if r < 3 else size)
            s.sums[DRAG_NOW] = dragged
    return True
