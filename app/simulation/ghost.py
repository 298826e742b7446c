"""A ghost: the same duct by another theory, under the same load, to lay over the first."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.simulation.grasped_duct import GraspedDuct, Load
from app.simulation.model import Model
from app.simulation.reading import Surface
from organ_geometry.mesh import Skin
from physics import NoEquilibrium, RuptureCheck

__all__ = ["Ghost", "GhostReading"]


@dataclass(frozen=True, slots=True)
class GhostReading:
    """What the other theory says of the same pull.

    Attributes
    ----------
    force, deflection
        N and mm; one of them is the session's own.
    force_difference, deflection_difference
        The ghost's less the session's, N and mm.
    check
        Highest stress held against the ghost theory's own threshold.
    """

    force: float
    deflection: float
    force_difference: float
    deflection_difference: float
    check: RuptureCheck


class Ghost:
    """A duct of another theory that follows a session's load.

    Parameters
    ----------
    model
        The session's dissection by the other theory.
    skin
        The session's skin.

    Attributes
    ----------
    model
        As given.
    surface
        The skin, named "ghost", where the ghost has it.
    """

    def __init__(self, model: Model, skin: Skin) -> None:
        self.model = model
        self.surface = Surface("ghost", skin, skin.vertices.copy())
        self._bound = skin.bound_to(model.dissection.driving)
        self._transforms = model.dissection.rest_transforms()
        self._axis = model.dissection.driving.positions.copy()
        self._duct: GraspedDuct | None = None
        self._ends = False

    @property
    def axis(self) -> NDArray[np.float64]:
        """(D, 3) the axis at the driving points, mm, where the organ stands; overwritten."""
        return self._axis

    def follow(self, grasp: float, load: Load) -> None:
        """Bear the session's load."""
        if self._duct is None or self._duct.grasp != grasp:
            self._duct = GraspedDuct(self.model, grasp, self.model.threshold)
        try:
            self._duct.bear(load)
        except NoEquilibrium:
            self._ends = True
        else:
            self._ends = False

    def draw(self) -> None:
        """Write the skin's vertices and the axis as they are now."""
        if self._duct is None:
            return
        driven, dissection = self._duct.driven, self.model.dissection
        self._bound.deform(dissection.move(driven, self._transforms), self.surface.vertices)
        frame, positions = dissection.frame, dissection.driving.positions
        moved = np.outer(driven.along - driven.stations, frame[:, 0])
        np.add(positions, moved + np.outer(driven.across, frame[:, 2]), out=self._axis)

    def reading(self, force: float, deflection: float) -> GhostReading | None:
        """Return what the ghost says beside the session."""
        if self._duct is None or self._ends:
            return None
        pulled = self._duct.pulled
        return GhostReading(
            force=pulled.force,
            deflection=pulled.deflection,
            force_difference=pulled.force - force,
            deflection_difference=pulled.deflection - deflection,
            check=self._duct.check,
        )
