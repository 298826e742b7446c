"""What is set beside a session's duct: its ghost by another theory, and a swinging chain.

The ghost is the same duct under the same load, in equilibrium. The chain of masses and springs
follows that load with its own inertia, slowed so that its swing can be seen.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.simulation.clock import TICK_SECONDS
from app.simulation.grasped_beam import BeamModel, GraspedBeam
from app.simulation.grasper import Load
from organ_geometry.mesh import Skin, Surface
from physics import Beam, MassSpringChain, NoEquilibrium, RuptureCheck

__all__ = ["SWINGS_PER_SECOND", "Ghost", "GhostReading", "SwingingChain"]

NODES = 21
SWINGS_PER_SECOND = 2.5
"""Of its slowest swing when straight. A real duct's swing, tens a second, no screen shows: the
masses are made larger, by what `slowed` says."""
DAMPING_RATIO = 0.08
STILL_MM_PER_S = 0.02
"""Speed of its fastest mass below which nothing is seen to move."""
TISSUE_DENSITY = 1e-9
"""tonne/mm^3."""


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

    def __init__(self, model: BeamModel, skin: Skin) -> None:
        self.model = model
        self.surface = Surface("ghost", skin, skin.vertices.copy())
        self._bound = skin.bound_to(model.dissection.driving)
        self._transforms = model.dissection.rest_transforms()
        self._axis = model.dissection.driving.positions.copy()
        self._beam: GraspedBeam | None = None
        self._ends = False

    @property
    def axis(self) -> NDArray[np.float64]:
        """(D, 3) the axis at the driving points, mm, where the organ stands; overwritten."""
        return self._axis

    def follow(self, grasp: float, load: Load) -> None:
        """Solve under the session's load."""
        if self._beam is None or self._beam.grasp != grasp:
            self._beam = GraspedBeam(self.model, grasp, self.model.threshold)
        try:
            self._beam.solve(load)
        except NoEquilibrium:
            self._ends = True
        else:
            self._ends = False

    def draw(self) -> None:
        """Write the skin's vertices and the axis as they are now."""
        if self._beam is None:
            return
        driven, dissection = self._beam.driven, self.model.dissection
        self._bound.deform(dissection.move(driven, self._transforms), self.surface.vertices)
        frame, positions = dissection.frame, dissection.driving.positions
        moved = np.outer(driven.along - driven.stations, frame[:, 0])
        np.add(positions, moved + np.outer(driven.across, frame[:, 2]), out=self._axis)

    def reading(self, force: float, deflection: float) -> GhostReading | None:
        """Return what the ghost says beside the session."""
        if self._beam is None or self._ends:
            return None
        pulled = self._beam.pulled
        return GhostReading(
            force=pulled.force,
            deflection=pulled.deflection,
            force_difference=pulled.force - force,
            deflection_difference=pulled.deflection - deflection,
            check=self._beam.check,
        )


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
