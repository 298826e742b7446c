"""A straight beam whose section varies along the axis."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from physics.beam import Beam, parts
from physics.quantity import finite, positive

__all__ = ["VaryingBeam"]


@dataclass(frozen=True, slots=True, eq=False)
class VaryingBeam:
    """A straight beam given by K sections, held by a clamp at each end.

    Between two sections every property varies linearly; two sections at the same station make a
    step. The arrays are copied and locked.

    Attributes
    ----------
    stations
        (K,) distances of the sections from the first clamp, mm: from 0 to the span, in order.
    areas
        (K,) areas, mm^2.
    second_moments
        (K,) second moments of area about the axis the beam bends around, mm^4.
    fibre_distances
        (K,) distances of the outermost fibre from that axis, mm.
    modulus
        Young's modulus, MPa.
    poisson_ratio
        Poisson's ratio, from 0 to below 0.5.
    shear_areas
        (K,) areas times shear coefficients, mm^2; those of rings of the same area and second
        moment when None.
    offsets
        (K,) distances of the sections' centroids from the straight axis that the clamps hold,
        mm, above zero towards the pull; all on the axis when None.

    Raises
    ------
    ValueError
        If a row is not one number per section, or one of them is not above zero (an offset:
        not finite), the stations do not run from 0 upwards,
        the modulus is not above zero, or Poisson's ratio is out of range.
    """

    stations: NDArray[np.float64]
    areas: NDArray[np.float64]
    second_moments: NDArray[np.float64]
    fibre_distances: NDArray[np.float64]
    modulus: float
    poisson_ratio: float = 0.3
    shear_areas: NDArray[np.float64] | None = None
    offsets: NDArray[np.float64] | None = None

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
        positive(self.modulus, "modulus", "MPa")
        if not 0.0 <= finite(self.poisson_ratio, "poisson_ratio", "(no unit)") < 0.5:
            raise ValueError(f"poisson_ratio must be from 0 to below 0.5, got {self.poisson_ratio}")

    @classmethod
    def of(cls, beam: Beam, count: int = 2) -> "VaryingBeam":
        """Return a constant beam as one of `count` equal sections.

        Parameters
        ----------
        beam
            The constant beam.
        count
            Number of sections, 2 or more.

        Returns
        -------
        VaryingBeam
            The same beam.
        """
        return cls(
            stations=np.linspace(0.0, beam.span, count),
            areas=np.full(count, beam.area),
            second_moments=np.full(count, beam.second_moment),
            fibre_distances=np.full(count, beam.fibre_distance),
            modulus=beam.modulus,
            poisson_ratio=beam.poisson_ratio,
        )

    @property
    def span(self) -> float:
        """Length between the clamps, mm."""
        return float(self.stations[-1])

    def grasped_at(self, grasp: float) -> tuple[float, float]:
        """Return the lengths of the two parts that a grasp divides the span into.

        Parameters
        ----------
        grasp
            Distance of the grasp from the first clamp, mm.

        Returns
        -------
        tuple[float, float]
            Lengths from the first clamp to the grasp and from there to the second, mm.
        """
        return parts(self.span, grasp)


def _locked(row: NDArray[np.float64]) -> NDArray[np.float64]:
    copy = np.array(row, dtype=np.float64)
    copy.setflags(write=False)
    return copy
