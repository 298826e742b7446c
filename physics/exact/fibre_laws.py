"""Laws of fibres: sections of three fibres, of a solid with free lateral faces or exponential.

A neo-Hookean fibre of stretch ``lam`` and shear ``gam`` has the energy of `fibre_energy` and
changes its volume by ``j``^3 so that its lateral stress is zero; ``j`` is kept and updated by one
of Halley's steps at each call. An exponential one resists its length l = (lam^2 + gam^2)^(1/2)
where that is above 1 by the energy of `exponential_stress` at l - 1, being squeezed by
(1 - lam)^2/2, and shear by that of the matrix about it, G gam^2/2: three convex terms. Three
fibres, at 0 and +-y with weights 1 - 2 w and w, integrate over the section as
`physics.section.Ring.fibres` says. `deficit` lowers the shear stiffness to Hutchinson's at small
strains, for warping.
"""

import math
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from kernel_cache import njit
from physics.beam import Beam, Sections
from physics.exact.state import KERNEL, Array, Five, State, gauss_points
from physics.exact.symbols import *
from physics.exponential import MOST, exponential_stress
from physics.quantity import finite
from physics.section import Ring, lateral_constant

Row = NDArray[np.float64]

# Of a squared length: that of a fibre without any is no divisor.
TINY = 1e-300
MOST_STIFFENING = 200.0
"""Of the exponential law; tissue has some 2 to 40."""


@njit(**KERNEL)
def shrinkage(lam: float, shrink: float, poisson: float) -> tuple[float, float, float]:
    """Return the lateral stretch of a section and its first and second derivative by lam."""
    down = 1.0 / (1.0 + (shrink + poisson) * (lam - 1.0))
    t1 = -poisson * down * down
    return (1.0 + shrink * (lam - 1.0)) * down, t1, -2.0 * (shrink + poisson) * t1 * down


@njit(**KERNEL)
def exponential_fibre(
    lam: float, gam: float, g: float, stiffening: float
) -> tuple[float, float, float, float, float, float]:
    """Return energy, p, p_lam, p_gam, q and q_gam of a fibre that stiffens exponentially."""
    # All three terms of the energy are convex: the length's beyond rest, squeezing, and shear.
    most = MOST / stiffening if stiffening > 0.0 else math.inf
    length = math.sqrt(lam * lam + gam * gam + TINY)
    stress, slope, energy = exponential_stress(max(length - 1.0, 0.0), stiffening, most)
    slope = slope if length >= 1.0 else 0.0
    squeezed = min(lam - 1.0, 0.0)
    over = 1.0 / length
    c, s, per = lam * over, gam * over, stress * over
    return (
        energy + 0.5 * (squeezed * squeezed + g * gam * gam),
        stress * c + squeezed,
        slope * c * c + per * s * s + (1.0 if lam < 1.0 else 0.0),
        (slope - per) * c * s,
        stress * s + g * gam,
        slope * s * s + per * c * c + g,
    )


@njit(**KERNEL)
def fibre(
    lam: float, gam: float, j: float, g: float, ratio: float, stiffening: float
) -> tuple[float, float, float, float, float, float]:
    """Return j, p, p_lam, p_gam, q and q_gam of a fibre of shear modulus g."""
    if stiffening >= 0.0:
        _, p, p_lam, p_gam, q, q_gam = exponential_fibre(lam, gam, g, stiffening)
        return j, p, p_lam, p_gam, q, q_gam
    # Its lateral faces are free: W = (G/2) ((lam^2 + gam^2)/j^2 + 2 j/lam - 3) + (K/2) (j^3 - 1)^2
    # is stationary in j, the cube root of the volume ratio, which gives, with `ratio` = G/3K,
    # j^8 - j^5 + (G/3K) (j^3/lam - lam^2 - gam^2) = 0. One step of Halley's method triples the
    # digits of j, which need not be better than the rotations it goes with. p and q are the
    # derivatives of W by lam and gam.
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


@njit(**KERNEL)
def fill_fibres(fibres: Array, g: float, ratio: float, stiffening: float, rounds: int) -> None:
    """Fill volume and stress of fibres from their stretch and shear."""
    for _ in range(rounds):
        for i in range(fibres.shape[1]):
            j, p, p_s, p_g, q, q_g = fibre(
                fibres[STRETCH, i], fibres[SHEAR, i], fibres[VOLUME, i], g, ratio, stiffening
            )
            fibres[VOLUME, i] = j
            fibres[PULL, i] = p
            fibres[PULL_S, i] = p_s
            fibres[PULL_G, i] = p_g
            fibres[CROSS, i] = q
            fibres[CROSS_G, i] = q_g


@njit(**KERNEL)
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
    """Update the strains of neo-Hookean sections by one Newton step after rotations and forces.

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


@njit(**KERNEL)
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
    stiffening: float,
    middle_fibre: Five,
    near_fibre: Five,
    far_fibre: Five,
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Return n, q, m and n_lam, n_gam, q_gam, n_k, q_k, m_k of a neo-Hookean section."""
    # Energy per length: the area times the mean energy of the fibres at 0 and +-y, of which each
    # outer one stands for the part `outer`, less what warping saves in shear,
    # deficit (t/lam)^2 gam^2 / (2 (1 + gam^2)). Its small-strain part, deficit gam^2 / 2 with
    # deficit = (1 - shear coefficient) G, falls with (t/lam)^2 in a stretched prism, because the
    # volume ties warping to shear by that factor; it fades in large shear, where an estimate of
    # second order would take more than there is and leave hollow sections without stiffness.
    # A fibre is given by p, p_lam, p_gam, q and q_gam.
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
    if stiffening >= 0.0:  # nothing ties warping to the volume
        warp, warp1, warp2 = deficit, 0.0, 0.0
        v, v1, v2 = 0.5 * gam * gam, gam, 1.0
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


@njit(**KERNEL)
def fill_of_fibres(
    points: Array,
    fibres: Array,
    first: int,
    last: int,
    h: float,
    p: float,
    shrink: float,
    poisson: float,
    stiffening: float,
) -> None:
    """Fill moment and derivatives of psi of sections of fibres from their fibres.

    The residuals of n and q that the strains leave are condensed with them.
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
            stiffening,
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


@njit(**KERNEL)
def fibre_energy(
    lam: float, gam: float, j: float, g: float, ratio: float, stiffening: float
) -> float:
    """Return the energy of a fibre per volume; see `fibre`."""
    if stiffening >= 0.0:
        return exponential_fibre(lam, gam, g, stiffening)[0]
    volume = j * j * j - 1.0
    shape = (lam * lam + gam * gam) / (j * j) + 2.0 * j / lam - 3.0
    return 0.5 * g * (shape + volume * volume / (3.0 * ratio))


@njit(**KERNEL)
def fibre_pull(lam: float, gam: float, g: float, ratio: float, stiffening: float) -> float:
    """Return the first Piola stress along the axis of a fibre, in E; see `fibre`."""
    j = 1.0
    for _ in range(30):
        before, j = j, fibre(lam, gam, j, g, ratio, stiffening)[0]
        if j == before:
            break
    return fibre(lam, gam, j, g, ratio, stiffening)[1]


class FibreLaw:
    """A law of a wall whose sections are integrated over fibres; shear is part of it."""

    shear: ClassVar[bool] = True
    point_rows: ClassVar[int] = FIBRE_LAW_ROWS
    fibre_rows: ClassVar[int] = FIBRE_ROWS
    stiffening: float
    """Of the exponential law; -1 by the neo-Hookean one."""

    def fill(self, state: State, beam: Beam, bounds: NDArray[np.float64]) -> None:
        """Write the material and the sections at the Gauss points into the state."""
        _, _, points, line, _, _ = state
        span, nu = beam.span, beam.poisson_ratio
        shear_modulus = 0.5 / (1.0 + nu)
        line[SHEAR_MODULUS] = shear_modulus
        line[RATIO] = (1.0 - 2.0 * nu) * shear_modulus  # G/(3 K)
        line[SHRINK] = lateral_constant(nu)
        line[POISSON], line[STIFFENING] = nu, self.stiffening
        sections = beam.sections_at(gauss_points(bounds) * span, shear_areas=beam.has_shear_areas)
        areas = sections.areas
        points[OFFSET] = sections.offsets / span
        line[ECCENTRIC] = float(np.any(points[OFFSET] != 0.0))
        points[AREA] = areas / beam.mean_section[0]
        for i in range(1 if beam.is_constant else areas.size):
            columns = slice(None) if beam.is_constant else i
            ring = Ring(float(areas[i]), float(sections.second_moments[i]))
            distance, weight = ring.fibres
            coefficient = ring.free_shear_coefficient(nu)
            if beam.has_shear_areas:
                coefficient = float(sections.shear_areas[i] / areas[i])
            points[REACH, columns] = distance / span
            points[WEIGHT, columns] = weight
            points[DEFICIT, columns] = (1.0 - coefficient) * shear_modulus

    def fibres_in_space(
        self,
        modulus: float,
        poisson_ratio: float,
        areas: Row,
        moments: tuple[Row, Row],
        outer: tuple[Row, Row],
        shear_areas: Row | None = None,
    ) -> tuple[NDArray[np.float64], Row]:
        """Return the rows of sections that `physics.bed.kernels.wall` needs, and shear areas.

        Parameters
        ----------
        modulus, poisson_ratio
            Of the material; the modulus in MPa.
        areas
            (S,) mm^2.
        moments, outer
            (S,) second moments, mm^4, and distances of the outermost fibres, mm: of bending up and
            across.
        shear_areas
            (S,) mm^2; None: those of rings.

        Returns
        -------
        rows, shear_areas
            (S, 14) in the order of that module's columns; (S,) at small strains, mm^2.
        """
        nu = poisson_ratio
        shear_modulus = 0.5 / (1.0 + nu)
        rows = np.empty((areas.size, 14))
        for i, area in enumerate(areas.tolist()):
            up, across = float(moments[0][i]), float(moments[1][i])
            ring = Ring(area, 0.5 * (up + across))
            distance, weight = ring.fibres
            coefficient = ring.free_shear_coefficient(nu)
            if shear_areas is not None:
                coefficient = float(shear_areas[i]) / area
            rows[i] = (
                modulus * area,
                distance * math.sqrt(up / ring.second_moment),
                distance * math.sqrt(across / ring.second_moment),
                weight,
                (1.0 - coefficient) * shear_modulus,
                shear_modulus,
                (1.0 - 2.0 * nu) * shear_modulus,
                lateral_constant(nu),
                nu,
                float(outer[0][i]),
                float(outer[1][i]),
                self.stiffening,
                1.0,
                1.0,
            )
        return rows, areas * (1.0 - rows[:, 4] / shear_modulus)

    def bending_stress(
        self,
        beam: Beam,
        sections: Sections,
        tension: NDArray[np.float64],
        moment: NDArray[np.float64],
        strains: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Return what the most stretched fibre has beyond the mean of its section, MPa."""
        nu = beam.poisson_ratio
        shear_modulus, shrink = 0.5 / (1.0 + nu), lateral_constant(nu)
        reaches = sections.fibre_distances / beam.span
        outer = np.empty(reaches.size)
        for i, (lam, gam, kappa) in enumerate(strains.T.tolist()):
            lateral = shrinkage(lam, shrink, nu)[0]
            stretch = lam + abs(kappa) * float(reaches[i]) * lateral
            ratio = (1.0 - 2.0 * nu) * shear_modulus
            outer[i] = fibre_pull(stretch, gam, shear_modulus, ratio, self.stiffening)
        return np.maximum(outer * beam.modulus - tension / sections.areas, 0.0)


@dataclass(frozen=True, slots=True)
class NeoHooke(FibreLaw):
    """Fibres of the solid W = (G/2) (J^(-2/3) I1 - 3) + (K/2) (J - 1)^2, free at their sides.

    See `physics.section.Ring` and `fibre`.
    """

    name: ClassVar[Literal["neo-hooke"]] = "neo-hooke"
    stiffening: ClassVar[float] = -1.0  # pyright: ignore[reportIncompatibleVariableOverride]


@dataclass(frozen=True, slots=True)
class Exponential(FibreLaw):
    """Fibres whose nominal stress is alpha (e^(beta eps) - 1), eps their elongation [Duch 2004].

    It is Fung's form in the energy, (alpha/beta) (e^(beta eps) - beta eps - 1), in compression its
    straight line at rest. The modulus at rest is alpha beta; 0 is a fibre of Hooke's law.
    """

    stiffening: float  # beta
    name: ClassVar[Literal["exponential"]] = "exponential"

    def __post_init__(self) -> None:
        if not 0.0 <= finite(self.stiffening, "stiffening", "(no unit)") <= MOST_STIFFENING:
            raise ValueError(
                f"stiffening must be from 0 to {MOST_STIFFENING:g}, got {self.stiffening:g}"
            )
