"""The linear law: tension, shear and moment proportional to stretch, shear strain and curvature."""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from kernel_cache import njit
from physics.beam import Beam, Sections
from physics.exact.state import KERNEL, Array, State, gauss_points
from physics.exact.symbols import *


@njit(**KERNEL)
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


@dataclass(frozen=True, slots=True)
class Linear:
    """Engineering strains: N = E A (lambda - 1), Q = G A_s gamma, M = E I theta'."""

    shear: bool = False  # whether sections shear; gamma is 0 without
    name: ClassVar[Literal["linear"]] = "linear"
    point_rows: ClassVar[int] = LINEAR_ROWS
    fibre_rows: ClassVar[int] = 0

    def fill(self, state: State, beam: Beam, bounds: NDArray[np.float64]) -> None:
        """Write the sections at the Gauss points into the state."""
        _, _, points, line, _, _ = state
        area = beam.mean_section[0]
        sections = beam.sections_at(gauss_points(bounds) * beam.span, shear_areas=self.shear)
        points[OFFSET] = sections.offsets / beam.span
        line[ECCENTRIC] = float(np.any(points[OFFSET] != 0.0))
        points[BENDING] = sections.second_moments / (area * beam.span**2)
        points[KK] = points[BENDING]
        points[STRETCHING] = area / sections.areas
        if self.shear:
            points[SHEARING] = 2.0 * (1.0 + beam.poisson_ratio) * area / sections.shear_areas

    def bending_stress(
        self,
        beam: Beam,
        sections: Sections,
        tension: NDArray[np.float64],
        moment: NDArray[np.float64],
        strains: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Return |M| c/I at the sections, MPa, of the moment about the centroid."""
        about_centroid = moment + sections.offsets * tension
        return np.abs(about_centroid) * sections.fibre_distances / sections.second_moments
