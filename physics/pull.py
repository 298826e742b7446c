"""A pull: one beam grasped at one place, solved for one load after the other."""

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import NDArray

from physics.beam import Beam
from physics.equilibrium import Equilibrium

if TYPE_CHECKING:
    from physics.rupture import BreakEvent

__all__ = ["Pull"]


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

    @abstractmethod
    def to_force(self, force: float) -> Self:
        """Find the equilibrium under a whole force of the grasper, N."""

    @abstractmethod
    def to_deflection(self, deflection: float) -> Self:
        """Find the equilibrium at a displacement of the grasp along the pull, mm."""

    def first_break(self, threshold: float) -> "BreakEvent | None":
        """Find the first load at which the stress reaches a threshold, MPa; None if none does."""
        raise NotImplementedError

    @abstractmethod
    def sample(self, stations: NDArray[np.float64]) -> Equilibrium:
        """Return the present equilibrium at (N,) stations, mm from the first clamp."""
