"""A straight beam whose section varies along the axis."""

import math
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from physics.beam import Beam, Sections, Stations
from physics.quantity import finite, positive
from physics.section import Ring


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class VaryingBeam(Beam):
    """A straight beam given by K sections, held by a clamp at each end.

    Between two sections every property varies linearly; two sections at the same station make a
    step. The arrays are copied and locked. The exact beam takes all sections; a theory that knows
    one section takes that of `weakest`, whose area, second moment and fibre distance are this
    beam's own.
    """

    span: float = field(init=False)
    area: float = field(init=False)
    second_moment: float = field(init=False)
    fibre_distance: float = field(init=False)
    stations: NDArray[np.float64]  # (K,) mm from the first clamp, 0 to the span, in order
    areas: NDArray[np.float64]  # (K,) mm^2
    second_moments: NDArray[np.float64]  # (K,) of area about the axis the beam bends around, mm^4
    fibre_distances: NDArray[np.float64]  # (K,) of the outermost fibre from that axis, mm
    # (K,) areas times shear coefficients, mm^2; None: of rings of the same area and second moment
    shear_areas: NDArray[np.float64] | None = None
    # (K,) of the centroids from the straight axis between the clamps, mm, positive towards the
    # pull; None: 0
    offsets: NDArray[np.float64] | None = None
    # stands for this one where one section must do; None: the one of least second moment over fibre
    # distance
    weakest: Beam | None = None
    _mean_section: tuple[float, float] = field(init=False, repr=False)

    def __eq__(self, other: object) -> bool:
        """Return whether it is this very beam: one section does not say it."""
        return self is other

    __hash__ = object.__hash__

    def __post_init__(self) -> None:
        stations = _locked(self.stations)
        if stations.ndim != 1 or stations.size < 2:
            raise ValueError(
                f"stations must be a row of 2 or more distances in mm, got shape {stations.shape}"
            )
        rising = np.all(np.isfinite(stations)) and np.all(np.diff(stations) >= 0.0)
        if not (rising and stations[0] == 0.0 and stations[-1] > 0.0):
            raise ValueError(
                f"stations must run from 0 mm to the span in order, got {stations[0]} to "
                f"{stations[-1]} mm"
            )
        object.__setattr__(self, "stations", stations)
        for name, unit in (
            ("areas", "mm^2"),
            ("second_moments", "mm^4"),
            ("fibre_distances", "mm"),
            ("shear_areas", "mm^2"),
            ("offsets", "mm"),
        ):
            value = getattr(self, name)
            if value is None:
                continue
            row = _locked(value)
            if row.shape != stations.shape:
                raise ValueError(
                    f"{name} must have one number of {unit} per station, {stations.size}, "
                    f"got shape {row.shape}"
                )
            check = finite if name == "offsets" else positive
            check(float(row.min()), f"every one of {name}", unit)
            check(float(row.max()), f"every one of {name}", unit)
            object.__setattr__(self, name, row)
        object.__setattr__(self, "span", float(stations[-1]))
        means = (float(np.trapezoid(row, stations)) for row in (self.areas, self.second_moments))
        object.__setattr__(self, "_mean_section", tuple(mean / self.span for mean in means))
        one = self.weakest
        if one is not None and (one.span, one.modulus) != (self.span, self.modulus):
            raise ValueError(
                f"the beam of one section must have the span and modulus of all, {self.span:g} mm "
                f"and {self.modulus:g} MPa, got {one.span:g} mm and {one.modulus:g} MPa"
            )
        place = int(np.argmin(self.second_moments / self.fibre_distances))
        for name, rows in (
            ("area", self.areas),
            ("second_moment", self.second_moments),
            ("fibre_distance", self.fibre_distances),
        ):
            value = float(rows[place]) if one is None else getattr(one, name)
            object.__setattr__(self, name, value)
        Beam.__post_init__(self)

    def of_material(self, modulus: float, poisson_ratio: float) -> Self:
        """Return the same beam of another material; the modulus in MPa."""
        one = self.weakest
        one = None if one is None else one.of_material(modulus, poisson_ratio)
        return replace(self, modulus=modulus, poisson_ratio=poisson_ratio, weakest=one)

    @property
    def key_stations(self) -> Stations:
        """(K,) places of the sections that the beam is given by, mm."""
        return self.stations

    @property
    def is_constant(self) -> bool:
        """Whether the section is constant."""
        return False

    @property
    def has_shear_areas(self) -> bool:
        """Whether the beam is given shear areas; if not, they are those of rings."""
        return self.shear_areas is not None

    @property
    def is_symmetric(self) -> bool:
        """Whether the beam is its own mirror image."""
        tolerance = 1e-12 * self.span
        rows = (
            self.areas,
            self.second_moments,
            self.fibre_distances,
            self.shear_areas,
            self.offsets,
        )
        return bool(
            np.allclose(self.stations, self.span - self.stations[::-1], rtol=0, atol=tolerance)
            and all(row is None or np.allclose(row, row[::-1], rtol=1e-12, atol=0) for row in rows)
        )

    @property
    def mean_section(self) -> tuple[float, float]:
        """Mean area, mm^2, and mean second moment, mm^4."""
        return self._mean_section

    def sections_at(self, at: Stations, *, shear_areas: bool = True) -> Sections:
        """Return the sections at stations, linear between those that are given."""
        areas = np.interp(at, self.stations, self.areas)
        second_moments = np.interp(at, self.stations, self.second_moments)
        if not shear_areas:
            shear = np.full(at.shape, math.nan)
        elif self.shear_areas is not None:
            shear = np.interp(at, self.stations, self.shear_areas)
        else:
            shear = np.array(
                [
                    a * Ring(float(a), float(i)).shear_coefficient(self.poisson_ratio)
                    for a, i in zip(areas, second_moments, strict=True)
                ]
            )
        return Sections(
            areas,
            second_moments,
            np.interp(at, self.stations, self.fibre_distances),
            shear,
            np.zeros(at.shape)
            if self.offsets is None
            else np.interp(at, self.stations, self.offsets),
        )

    @classmethod
    def of(cls, beam: Beam, count: int = 2) -> "VaryingBeam":
        """Return a constant beam as one of `count` equal sections."""
        return cls(
            stations=np.linspace(0.0, beam.span, count),
            areas=np.full(count, beam.area),
            second_moments=np.full(count, beam.second_moment),
            fibre_distances=np.full(count, beam.fibre_distance),
            modulus=beam.modulus,
            poisson_ratio=beam.poisson_ratio,
        )


def _locked(row: NDArray[np.float64]) -> NDArray[np.float64]:
    copy = np.array(row, dtype=np.float64)
    copy.setflags(write=False)
    return copy
