"""The mass-spring chain beside the beam, swinging as it does, slowly enough to be seen."""

import math

import numpy as np
from numpy.typing import NDArray

from app.simulation.clock import TICK_SECONDS
from app.simulation.grasped_duct import Load
from physics import Beam, MassSpringChain

__all__ = ["SwingingChain"]

NODES = 21
SWINGS_PER_SECOND = 2.5
"""Of its slowest swing when straight. A real duct's swing, tens a second, no screen shows: the
masses are made larger, by what `slowed` says."""
DAMPING_RATIO = 0.08
STILL_MM_PER_S = 0.02
"""Speed of its fastest mass below which nothing is seen to move."""
TISSUE_DENSITY = 1e-9
"""tonne/mm^3."""


class SwingingChain:
    """A chain of masses and springs that follows the session's load with its own inertia.

    Parameters
    ----------
    beam
        The beam that it stands for.
    grasp
        Distance of the grasp from the first clamp, mm.
    """

    def __init__(self, beam: Beam, grasp: float) -> None:
        light = MassSpringChain(beam, grasp, nodes=NODES, density=TISSUE_DENSITY)
        slower = light.lowest_frequency / (2.0 * math.pi * SWINGS_PER_SECOND)
        self._slowed = slower
        self._chain = MassSpringChain(
            beam,
            grasp,
            nodes=NODES,
            density=TISSUE_DENSITY * slower**2,
            damping_ratio=DAMPING_RATIO,
        )
        self._load: Load | None = None
        self._still = True
        self._places = np.zeros((NODES, 3))
        self._places[:, ::2] = self._chain.places

    @property
    def grasp(self) -> float:
        """Distance of the grasp from the first clamp, mm."""
        return self._chain.grasp

    @property
    def slowed(self) -> float:
        """How many times slower than flesh of its size it swings."""
        return self._slowed

    @property
    def places(self) -> NDArray[np.float64]:
        """(N, 3) the masses: mm along the clamps, sideways and along the pull; overwritten."""
        return self._places

    @property
    def force(self) -> float:
        """The grasper's whole force, N."""
        return self._chain.force

    @property
    def deflection(self) -> float:
        """Displacement of the grasp along the pull, mm."""
        return self._chain.deflection

    @property
    def steps_per_tick(self) -> int:
        """How many stable steps the integrator takes in a tick."""
        return math.ceil(TICK_SECONDS / (0.9 * self._chain.largest_stable_step))

    def start_from(self, deflection: float) -> None:
        """Put the masses, still, on the linear beam's curve."""
        self._chain.bend(deflection)
        self._still = False

    def advance(self, load: Load) -> bool:
        """Advance by one tick."""
        if load == self._load and self._still:
            return False
        if load != self._load:
            self._load = load
            if load.kind == "force":
                self._chain.pull(load.amount)
            else:
                self._chain.hold(load.amount)
        self._chain.step(TICK_SECONDS)
        before = self._places[:, ::2].copy()
        self._places[:, ::2] = self._chain.places
        moved = float(np.abs(self._places[:, ::2] - before).max())
        speed = float(np.abs(self._chain.velocities).max())
        self._still = max(speed, moved / TICK_SECONDS) < STILL_MM_PER_S
        return True
