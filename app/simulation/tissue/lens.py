"""The lens of the laparoscope, which blood and touch soil."""

from collections.abc import Sequence

import numpy as np

from app.simulation.inputs.clock import TICK_SECONDS
from physics.bed import BeamOnBed, Flow

LENS_AT = slice(3, 6)
"""Of a view's numbers: where the camera is."""
SCOPED = 12
"""Least numbers of a view through a scope."""
LENS_RADIUS = 5.0
"""mm of a scope's shaft."""
JET_ML_S, SPRAY_MM, SOILS_PER_ML = 0.5, 30.0, 0.12
"""ml/s from which blood jets, mm at which half as much reaches the lens as close by, and how much
of the lens a millilitre soils there: choices, not measurements."""


class Lens:
    """A lens and how soiled it is; what is not seen through a scope does not `soil` it."""

    def __init__(self, *, soils: bool) -> None:
        self._soils = soils
        self.soil = 0.0
        """0 clean, 1 as soiled as it gets."""

    def touch(self, pose: Sequence[float], beam: BeamOnBed) -> None:
        """Soil it if the scope's tip, as a view has it, touches a tube."""
        if not self._soils or len(pose) < SCOPED:
            return
        for name, tube in beam.network.tubes.items():
            off = beam.places[beam.nodes_of(name)] - np.array(pose[LENS_AT])
            if ((off * off).sum(axis=1) < (tube.radius + LENS_RADIUS) ** 2).any():
                self.soil = 1.0
                return

    def spray(self, pose: Sequence[float], beam: BeamOnBed, blood: Flow) -> None:
        """Let jets of blood soil it for a tick, the more the nearer they are."""
        if not self._soils or len(pose) < SCOPED:
            return
        for hole in blood.holes:
            jet = 1e-3 * hole.flow
            if jet > JET_ML_S:
                off = beam.places[hole.node] - np.array(pose[LENS_AT])
                near = 1.0 + float((off * off).sum()) / SPRAY_MM**2
                self.soil = min(self.soil + SOILS_PER_ML * jet * TICK_SECONDS / near, 1.0)

    def wipe(self) -> bool:
        """Clean it; return whether it was soiled."""
        soiled, self.soil = self.soil > 0.0, 0.0
        return soiled
