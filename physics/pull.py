"""A pull: one beam grasped at one place, solved for one load after the other; where it breaks."""

from abc import ABC, abstractmethod
from typing import Self

import numpy as np
from numpy.typing import NDArray

from physics.beam import Beam
from physics.equilibrium import Equilibrium, NoEquilibrium
from physics.quantity import positive
from physics.rupture import BreakEvent, check_rupture, critical_stations


class Pull(ABC):
    """A beam grasped at one place, in the equilibrium that was last solved; at first at rest.

    Each load is solved by `to_force` or `to_deflection`, which return the pull itself, as in
    `pull.to_force(2.0).sample(stations)`. A load that the theory cannot carry is a
    `NoEquilibrium`. Not for use by two threads at once.

    Attributes
    ----------
    beam, grasp
        As given; the grasp is mm from the first clamp.
    force
        The grasper's whole force, N.
    deflection
        Displacement of the grasp along the pull, mm.
    softens
        Whether the stress may fall where the deflection grows; `first_break` then finds the break.
    """

    softens = False

    def __init__(self, beam: Beam, grasp: float) -> None:
        self.beam = beam
        self.grasp = beam.grasped_at(grasp)[0]
        self.force = 0.0
        self.deflection = 0.0

    def __repr__(self) -> str:
        return (
            f"{type(self).__name__}(grasp={self.grasp:g} mm, force={self.force:g} N, "
            f"deflection={self.deflection:g} mm)"
        )

    @abstractmethod
    def to_force(self, force: float) -> Self:
        """Find the equilibrium under a whole force of the grasper, N."""

    @abstractmethod
    def to_deflection(self, deflection: float) -> Self:
        """Find the equilibrium at a displacement of the grasp along the pull, mm."""

    def first_break(self, threshold: float) -> BreakEvent | None:
        """Find the first load at which the stress reaches a threshold, MPa; None if none does."""
        raise NotImplementedError

    @abstractmethod
    def sample(self, stations: NDArray[np.float64]) -> Equilibrium:
        """Return the present equilibrium at (N,) stations, mm from the first clamp."""


def calibrated_threshold(pull: Pull, force: float) -> float:
    """Return the threshold, MPa, at which a pulled beam breaks under a known force, N."""
    # A threshold belongs to its theory: two theories that see the same break read other stresses.
    positive(force, "force at the break", "N")
    stations = critical_stations(pull.beam, pull.grasp)
    return float(pull.to_force(force).sample(stations).total_stress.max())


def break_of(pull: Pull, threshold: float) -> BreakEvent | None:
    """Pull a beam until it reaches its threshold, MPa; return where, None if it never does."""
    # The stress grows with the deflection, so the root is bracketed by doubling and bisected down
    # to neighbouring numbers; the upper one is returned, at which the criterion is met or touched.
    # None: the beam bears deflections of a thousand spans, or all that its theory can follow.
    positive(threshold, "threshold", "MPa")
    if pull.softens:
        return pull.first_break(threshold)
    span, stations = pull.beam.span, critical_stations(pull.beam, pull.grasp)

    def reaches(deflection: float) -> bool:
        try:
            pulled = pull.to_deflection(deflection).sample(stations)
        except NoEquilibrium:
            return True
        return float(pulled.total_stress.max()) >= threshold

    low, high = 0.0, 1e-3 * span
    while not reaches(high):
        low, high = high, 2.0 * high
        if high > 1e3 * span:
            return None
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (low, middle) if reaches(middle) else (middle, high)
    try:
        pulled = pull.to_deflection(high).sample(stations)
    except NoEquilibrium:
        return None
    return BreakEvent(pulled.force, high, check_rupture(pulled, threshold))
