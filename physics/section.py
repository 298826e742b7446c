"""Cross-sections of a beam: what the theories need besides area and second moment."""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Ring:
    """The ring of a given area and second moment; the disc when it has no hole.

    A section stiffer in bending than a disc of its area has the hole that
    R_o^2 - R_i^2 = A/pi and R_o^2 + R_i^2 = 4 I/A ask for. A softer one, such as an ellipse pulled
    along its short axis, has none; its `fibres` are then those of a solid ellipse of that area
    and second moment.
    """

    area: float  # mm^2
    second_moment: float  # of area about the axis the beam bends around, mm^4

    @property
    def hole(self) -> float:
        """(R_i/R_o)^2, from 0 to below 1."""
        squares, difference = 4.0 * self.second_moment / self.area, self.area / math.pi
        return max(squares - difference, 0.0) / (squares + difference)

    @property
    def height(self) -> float:
        """Extent across the axis it bends around, mm: the outer diameter; an ellipse's axis."""
        return 4.0 * math.sqrt(self.second_moment / self.area / (1.0 + self.hole))

    @property
    def fibres(self) -> tuple[float, float]:
        """Distance of two outer fibres, mm, and the part of the area each of them stands for."""
        # With a third fibre in the middle they have the area, the second and the fourth moment of
        # the section: y^2 = m4/m2, w = m2^2 / (2 m4), with m2 = I/A = (R_o^2 + R_i^2)/4 and
        # m4 = (R_o^4 + R_o^2 R_i^2 + R_i^4)/8. This is Gauss's rule for the width of the section as
        # a weight, exact to the fifth power of the distance: R/sqrt(2) and 1/4 for a disc,
        # sqrt(3)/2 R and 1/3 for a thin ring.
        m2 = self.second_moment / self.area
        hole = self.hole
        # m4/m2^2, from 2 (disc) to 3/2 (thin ring).
        kurtosis = 2.0 * (1.0 + hole + hole * hole) / (1.0 + hole) ** 2
        return math.sqrt(kurtosis * m2), 0.5 / kurtosis

    def shear_coefficient(self, poisson_ratio: float) -> float:
        """Return Cowper's shear coefficient.

        Returns
        -------
        float
            6 (1+nu) (1+m^2)^2 / ((7+6 nu) (1+m^2)^2 + (20+12 nu) m^2), m = R_i/R_o; for a disc
            6 (1+nu) / (7+6 nu). [Cowper 1966], hollow circle.

        Examples
        --------
        >>> disc = Ring(area=math.pi, second_moment=math.pi / 4)
        >>> round(disc.shear_coefficient(0.3), 4)
        0.8864
        """
        nu, square = poisson_ratio, (1.0 + self.hole) ** 2
        return (
            6.0 * (1.0 + nu) * square / ((7.0 + 6.0 * nu) * square + (20.0 + 12.0 * nu) * self.hole)
        )

    def free_shear_coefficient(self, poisson_ratio: float) -> float:
        """Return Hutchinson's shear coefficient, which lets the section shrink sideways.

        Returns
        -------
        float
            6 (1+nu)^2 (1+m^2)^2 over 7+34 m^2+7 m^4 + nu (12+48 m^2+12 m^4)
            + nu^2 (4+16 m^2+4 m^4), m = R_i/R_o; for a disc 6 (1+nu)^2 / (7+12 nu+4 nu^2), for a
            thin ring (1+nu)/(2+nu). [Hutchinson 2001], hollow circle.
        """
        nu, m2 = poisson_ratio, self.hole
        m4 = m2 * m2
        return (
            6.0
            * ((1.0 + nu) * (1.0 + m2)) ** 2
            / (7.0 + 34.0 * m2 + 7.0 * m4 + (12.0 * nu + 4.0 * nu * nu) * (1.0 + 4.0 * m2 + m4))
        )


@lru_cache(maxsize=64)
def lateral_constant(poisson_ratio: float) -> float:
    """Return the constant a of the lateral stretch (1 + a e) / (1 + (a + nu) e), e = stretch - 1.

    It is fitted, by least squares of the relative error over stretches from 0.6 to 3.5, to the
    lateral stretch sqrt(J/stretch) of a compressible neo-Hookean bar under tension, whose slope
    -nu at rest it has by its form.

    Returns
    -------
    float
        The constant, never below 0. Largest error of the stretch: 0.5 % for nu from 0.35 to 0.45,
        1.5 % at 0.3 and towards 0.5, 7 % at 0.2; smaller nu do not fit the form.

    Examples
    --------
    >>> round(lateral_constant(0.3), 3)
    0.308
    """
    stretch = np.linspace(0.6, 3.5, 300)
    lateral = _lateral_stretch(stretch, poisson_ratio)
    excess = stretch - 1.0
    constant = 0.3
    for _ in range(30):
        bottom = 1.0 + (constant + poisson_ratio) * excess
        error = (1.0 + constant * excess) / (bottom * lateral) - 1.0
        # Neither BLAS's products nor powers, whose last digits differ between processors.
        slope = poisson_ratio * excess * excess / (bottom * bottom * lateral)
        square = float((slope * slope).sum())
        if square == 0.0:
            return 0.0
        constant = max(constant - float((slope * error).sum()) / square, 0.0)
    return constant


def _lateral_stretch(stretch: NDArray[np.float64], poisson_ratio: float) -> NDArray[np.float64]:
    """Return the lateral stretch of a neo-Hookean bar; see `fibre_laws.fibre`."""
    ratio = (1.0 - 2.0 * poisson_ratio) / (2.0 * (1.0 + poisson_ratio))
    j = np.ones_like(stretch)
    for _ in range(60):
        j2 = j * j
        j3 = j2 * j
        value = j2 * j3 * (j3 - 1.0) + ratio * (j3 / stretch - stretch * stretch)
        slope = j2 * (j2 * (8.0 * j3 - 5.0) + 3.0 * ratio / stretch)
        j -= np.clip(value / slope, -0.5 * j, 0.5 * j)
    return np.sqrt(j * j * j / stretch)
