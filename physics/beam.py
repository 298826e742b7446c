"""A straight beam between two clamps: its length, its section and its material."""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from physics.quantity import finite, positive
from physics.section import Ring

Stations = NDArray[np.float64]
"""(N,) distances from the first clamp at rest, mm."""


class Sections(NamedTuple):
    """Sections of a beam at N stations: one number each, in powers of mm."""

    areas: NDArray[np.float64]
    second_moments: NDArray[np.float64]
    fibre_distances: NDArray[np.float64]
    shear_areas: NDArray[np.float64]  # Cowper's, where the beam has none of its own
    offsets: NDArray[np.float64]  # of the centroid from the axis, above zero towards the pull


@dataclass(frozen=True, slots=True)
class Beam:
    """A straight beam of constant section, held by a clamp at each end."""

    span: float  # length between the clamps, 2L of the thesis, mm
    area: float  # mm^2
    second_moment: float  # of area about the axis the beam bends around, mm^4
    fibre_distance: float  # of the outermost fibre from that axis, c of the thesis, mm
    modulus: float  # Young's modulus, MPa
    poisson_ratio: float = 0.3  # 0 to below 0.5

    def __post_init__(self) -> None:
        positive(self.span, "span", "mm")
        positive(self.area, "area", "mm^2")
        positive(self.second_moment, "second_moment", "mm^4")
        positive(self.fibre_distance, "fibre_distance", "mm")
        positive(self.modulus, "modulus", "MPa")
        if not 0.0 <= finite(self.poisson_ratio, "poisson_ratio", "(no unit)") < 0.5:
            raise ValueError(f"poisson_ratio must be from 0 to below 0.5, got {self.poisson_ratio}")

    @classmethod
    def round(
        cls,
        *,
        span: float,
        diameter: float,
        modulus: float,
        poisson_ratio: float = 0.3,
        wall: float | None = None,
    ) -> Self:
        """Return a round beam, full or a tube.

        Parameters
        ----------
        span, diameter, wall
            Length between the clamps, outer diameter, and a tube's wall (None: full), mm.
        modulus, poisson_ratio
            Of the material; the modulus in MPa.

        Returns
        -------
        Self
            The beam, with A = pi d^2/4, I = pi d^4/64 and c = d/2; a tube's A and I less those of
            its bore.

        Examples
        --------
        >>> duct = Beam.round(span=50.8, diameter=8.89, modulus=0.310264)
        >>> round(duct.area, 3), round(duct.second_moment, 2)
        (62.072, 306.6)
        """
        positive(diameter, "diameter", "mm")
        area, second_moment = math.pi * diameter**2 / 4.0, math.pi * diameter**4 / 64.0
        if wall is not None:
            bore = positive(diameter - 2.0 * positive(wall, "wall", "mm"), "bore of the tube", "mm")
            area -= math.pi * bore**2 / 4.0
            second_moment -= math.pi * bore**4 / 64.0
        return cls(
            span=span,
            area=area,
            second_moment=second_moment,
            fibre_distance=diameter / 2.0,
            modulus=modulus,
            poisson_ratio=poisson_ratio,
        )

    def of_material(self, modulus: float, poisson_ratio: float) -> Self:
        """Return the same beam of another material; the modulus in MPa."""
        return replace(self, modulus=modulus, poisson_ratio=poisson_ratio)

    @property
    def key_stations(self) -> Stations:
        """(K,) places of the sections that the beam is given by, mm: here both clamps."""
        return np.array([0.0, self.span])

    @property
    def is_constant(self) -> bool:
        """Whether the section is constant."""
        return True

    @property
    def has_shear_areas(self) -> bool:
        """Whether the beam is given shear areas; if not, they are those of rings."""
        return False

    @property
    def is_symmetric(self) -> bool:
        """Whether the beam is its own mirror image."""
        return True

    @property
    def mean_section(self) -> tuple[float, float]:
        """Mean area, mm^2, and mean second moment, mm^4."""
        return self.area, self.second_moment

    def sections_at(self, at: Stations, *, shear_areas: bool = True) -> Sections:
        """Return the sections at stations; nan for the shear areas where they are not wanted."""
        shear = (
            math.nan
            if not shear_areas
            else self.area
            * Ring(self.area, self.second_moment).shear_coefficient(self.poisson_ratio)
        )
        values = (self.area, self.second_moment, self.fibre_distance, shear, 0.0)
        return Sections(*(np.full(at.shape, value) for value in values))

    def grasped_at(self, grasp: float) -> tuple[float, float]:
        """Return the lengths of the two pieces that a grasp divides the span into."""
        return pieces(self.span, grasp)


def pieces(span: float, grasp: float) -> tuple[float, float]:
    """Return the lengths of the two pieces that a grasp divides a span into."""
    if not 0.0 < finite(grasp, "grasp", "mm") < span:
        raise ValueError(
            f"grasp must lie between the clamps, above 0 and below {span:g} mm, got {grasp:g} mm"
        )
    return float(grasp), span - float(grasp)
