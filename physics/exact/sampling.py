"""The equilibrium between the points that it is found at, and its energy."""

import math

from kernel_cache import njit
from physics.exact.fibre_laws import fibre, fibre_energy, section_law, shrinkage
from physics.exact.state import KERNEL, Array, State
from physics.exact.symbols import *

# Rows of the samples: position, rotation, forces and moment, strains.
ALONG, ACROSS, TURN, TENSION, TRANSVERSE, BENT, SAMPLE_LAM, SAMPLE_GAM, SAMPLE_KAPPA = range(9)
SAMPLE_ROWS = 9


@njit(**KERNEL)
def _fibre_strains(
    points: Array,
    fibres: Array,
    line: Array,
    i: int,
    n: float,
    q: float,
    kappa: float,
    moment: float,
    by_moment: bool,
) -> tuple[float, float, float]:
    """Return lam, gam and kappa of a section like that of point i under n and q."""
    # The curvature is given, or found from the moment; started from the strains at the point.
    count = points.shape[1]
    lam, gam = points[LAM, i], points[GAM, i]
    g, ratio, b = line[SHEAR_MODULUS], line[RATIO], line[STIFFENING]
    shrink, poisson = line[SHRINK], line[POISSON]
    y = points[REACH, i]
    j0, j1, j2 = fibres[VOLUME, i], fibres[VOLUME, i + count], fibres[VOLUME, i + 2 * count]
    for _ in range(60):
        kyt = kappa * y * shrinkage(lam, shrink, poisson)[0]
        for _ in range(2):
            j0 = fibre(lam, gam, j0, g, ratio, b)[0]
            j1 = fibre(lam - kyt, gam, j1, g, ratio, b)[0]
            j2 = fibre(lam + kyt, gam, j2, g, ratio, b)[0]
        j0, p0, s0, g0, q0, c0 = fibre(lam, gam, j0, g, ratio, b)
        j1, p1, s1, g1, q1, c1 = fibre(lam - kyt, gam, j1, g, ratio, b)
        j2, p2, s2, g2, q2, c2 = fibre(lam + kyt, gam, j2, g, ratio, b)
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
            b,
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
        # Not so far in a step that fibres turn inside out: from there other roots are found.
        size = max(abs(d_lam), abs(d_kappa * y))
        shorter = 0.3 * lam / size if size > 0.3 * lam else 1.0
        lam += shorter * d_lam
        gam += shorter * d_gam
        kappa += shorter * d_kappa
        if abs(d_lam) + abs(d_gam) + abs(d_kappa * y) < 1e-12:
            break
    return lam, gam, kappa


@njit(**KERNEL, inline="always")
def _across(line: Array, grasp: int, e: int) -> float:
    """Return the force across of the part that element e is of."""
    if e < grasp:
        return line[P1]
    return line[P2] if e < line[SECOND] else line[P3]


@njit(**KERNEL)
def sample(
    state: State,
    fibres: Array | None,
    grasp: int,
    bounds: Array,
    stations: Array,
    ends: Array,
    samples: Array,
) -> bool:
    """Sample at stations, parts of the span in any order; return whether sections bear it."""
    # `points` are filled, and `ends`, (2, nodes), zeros: room for where the nodes are.
    # Positions are summed by the elements' own rule, so that they end where the equations say. The
    # moment is that at the first clamp, which is the residual of its row, plus what the forces turn
    # on the way, h y - p x: exact along the beam, where m = E I kappa jumps between elements. At
    # the grasp the part under the larger tension is taken. Between the points that the solution is
    # found at, a section may bear no more strain.
    nodes, elements, points, line, _, _ = state
    count = elements.shape[1]
    w = 0.5 * elements[LENGTH, 0]
    clamp = w * GAUSS * (points[T, 1] - points[T, 0]) + 0.5 * (
        points[MOMENT, 0] + points[MOMENT, 1]
    )
    clamp -= 0.5 * w * (points[T, 0] + points[T, 1])
    xs, ys = ends[0], ends[1]
    for e in range(count):
        w = 0.5 * elements[LENGTH, e]
        xs[e + 1] = xs[e] + w * (points[X, 2 * e] + points[X, 2 * e + 1])
        ys[e + 1] = ys[e] + w * (points[Y, 2 * e] + points[Y, 2 * e + 1])
    second = int(line[SECOND])
    h = line[H]
    at_grasp = clamp + h * ys[grasp] - line[P1] * xs[grasp]
    at_second = at_grasp + h * (ys[second] - ys[grasp]) - line[P2] * (xs[second] - xs[grasp])
    more = (line[P2] - line[P1]) * math.sin(nodes[ROTATION, grasp]) > 0.0
    more_2 = (line[P3] - line[P2]) * math.sin(nodes[ROTATION, second]) > 0.0
    sound = True
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
        i, j, p = 2 * e, 2 * e + 1, _across(line, grasp, e)
        left, right, bubble = nodes[ROTATION, e], nodes[ROTATION, e + 1], elements[BUBBLE, e]
        # From both ends of the element, so that a mirrored beam is sampled alike: two points
        # between each end and the station, then the station itself.
        x, y = 0.5 * (xs[e] + xs[e + 1]), 0.5 * (ys[e] + ys[e + 1])
        moment = 0.0
        for place in range(5):
            end, side = place // 2, 2 * (place % 2) - 1
            here = place == 4
            reach = f - end
            u = f if here else end + reach * (0.5 + side * GAUSS)
            theta = left + u * (right - left) + 4.0 * u * (1.0 - u) * bubble
            kappa = (right - left + 4.0 * (1.0 - 2.0 * u) * bubble) / elements[LENGTH, e]
            sin, cos = math.sin(theta), math.cos(theta)
            n, q = h * cos + p * sin, p * cos - h * sin
            b = (u - 0.5 + GAUSS) / (2.0 * GAUSS)
            if b < 0.0:
                b = 0.0
            elif b > 1.0:
                b = 1.0
            a = 1.0 - b
            offset = a * points[OFFSET, i] + b * points[OFFSET, j]
            if here:
                if f == 0.0 or f == 1.0:
                    x, y = xs[e + int(f)], ys[e + int(f)]
                moment = clamp + h * y - p * x
                if e >= second:
                    moment = at_second + h * (y - ys[second]) - p * (x - xs[second])
                elif e >= grasp:
                    moment = at_grasp + h * (y - ys[grasp]) - p * (x - xs[grasp])
            if fibres is None:
                lam = 1.0 + (a * points[STRETCHING, i] + b * points[STRETCHING, j]) * n
                gam = (a * points[SHEARING, i] + b * points[SHEARING, j]) * q
                if here:
                    bending = a * points[BENDING, i] + b * points[BENDING, j]
                    kappa = (moment + offset * n) / bending
            else:
                nearer = i if u < 0.5 else j
                lam, gam, kappa = _fibre_strains(
                    points, fibres, line, nearer, n, q, kappa, moment + offset * n, here
                )
            if here:
                samples[ALONG, k], samples[ACROSS, k], samples[TURN, k] = x, y, theta
                samples[TENSION, k], samples[TRANSVERSE, k], samples[BENT, k] = n, q, moment
                samples[SAMPLE_LAM, k], samples[SAMPLE_GAM, k] = lam, gam
                samples[SAMPLE_KAPPA, k] = kappa
                sound = sound and math.isfinite(x) and math.isfinite(lam)
            else:
                lam += offset * kappa
                w = 0.25 * reach * elements[LENGTH, e]
                x += w * (lam * cos - gam * sin)
                y += w * (lam * sin + gam * cos)
    return sound


@njit(**KERNEL)
def strain_energy(state: State, fibres: Array | None, grasp: int) -> float:
    """Return the strain energy, in E A S, of filled points: its derivatives are the equations."""
    _, elements, points, line, _, _ = state
    energy = 0.0
    count = points.shape[1]
    for i in range(count):
        sin, cos = points[SIN, i], points[COS, i]
        h, p = line[H], _across(line, grasp, i // 2)
        n, q = h * cos + p * sin, p * cos - h * sin
        if fibres is None:
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
                mean += weight * fibre_energy(
                    fibres[STRETCH, column],
                    fibres[SHEAR, column],
                    fibres[VOLUME, column],
                    line[SHEAR_MODULUS],
                    line[RATIO],
                    line[STIFFENING],
                )
            lam, gam = points[LAM, i], points[GAM, i]
            u = shrinkage(lam, line[SHRINK], line[POISSON])[0] / lam
            warping = gam * gam
            if line[STIFFENING] < 0.0:
                warping *= u * u / (1.0 + gam * gam)
            density = points[AREA, i] * (mean - 0.5 * points[DEFICIT, i] * warping)
        energy += 0.5 * elements[LENGTH, i // 2] * density
    return energy
