"""The rupture criterion (5.26 to 5.29): where a pulled beam tears, when, and how far it is off."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from physics.beam import Beam
from physics.equilibrium import Equilibrium
from physics.quantity import positive

# Stresses nearer than this part of the larger count as equal: rounding, not physics.
EQUAL_STRESSES = 1e-9


@dataclass(frozen=True, slots=True)
class RuptureCheck:
    """The place of the highest stress, held against the threshold."""

    # where normal plus bending stress is highest, mm from the first clamp; of equals the nearest to
    # the grasp
    station: float
    # side that bending stretches there: 1 that of the pull, -1 the one away from it, 0 none
    tension_side: int
    normal_stress: float  # there, MPa
    bending_stress: float  # there, MPa
    threshold: float  # stress T that the beam bears, MPa

    @property
    def total_stress(self) -> float:
        """Normal plus bending stress, MPa."""
        return self.normal_stress + self.bending_stress

    @property
    def margin(self) -> float:
        """Stress left to the threshold, MPa; below zero past it."""
        return self.threshold - self.total_stress

    @property
    def distance_to_break(self) -> float:
        """1 at rest, 0 at the threshold, below zero past it."""
        return 1.0 - self.total_stress / self.threshold

    @property
    def broken(self) -> bool:
        """Whether the criterion (5.29) is met."""
        return self.total_stress > self.threshold


@dataclass(frozen=True, slots=True)
class BreakEvent:
    """The load at which a beam reaches its threshold."""

    force: float  # the grasper's whole force, N
    deflection: float  # of the grasp, mm
    check: RuptureCheck


def critical_stations(beam: Beam, grasp: float, count: int = 41) -> NDArray[np.float64]:
    """Return the (M,) stations, growing, mm, among which the stress is highest."""
    # On a beam of constant section it is highest at a clamp or at the grasp. A varying beam may
    # have it at a narrow place: `count` even stations and its key sections are added.
    beam.grasped_at(grasp)
    stations = np.union1d(np.linspace(0.0, beam.span, count), [grasp])
    return np.union1d(stations, beam.key_stations)


def check_rupture(equilibrium: Equilibrium, threshold: float) -> RuptureCheck:
    """Return the place of the highest stress among the stations, held against the threshold."""
    positive(threshold, "threshold", "MPa")
    total = equilibrium.total_stress
    if not total.size:
        raise ValueError("the equilibrium must be sampled at one station or more, got none")
    # Less a part of its size, whatever its sign: a slack beam's rounding is below zero all along.
    most = float(total.max())
    highest = np.flatnonzero(total >= most - EQUAL_STRESSES * abs(most))
    away = np.abs(equilibrium.stations[highest] - equilibrium.grasp)
    place = highest[np.argmin(away)]
    # Bending stretches the side away from the pull where the moment has the deflection's sign.
    turn = float(equilibrium.moment[place]) * (1.0 if equilibrium.deflection >= 0.0 else -1.0)
    return RuptureCheck(
        station=float(equilibrium.stations[place]),
        tension_side=int(-np.sign(turn)),
        normal_stress=float(equilibrium.normal_stress[place]),
        bending_stress=float(equilibrium.bending_stress[place]),
        threshold=float(threshold),
    )
