"""What is shown beside a session's duct: its ghost by another theory, and a mass-spring chain.

The ghost is the same duct under the same load, in equilibrium by another theory. The chain of
masses and springs follows that load with its own inertia. It is slowed so that its swing can be
seen: frequencies go with 1 / sqrt(density), so with s^2 times the density of tissue it swings s
times slower (`SwingingChain.slowed`).
"""

import math
from dataclasses import dataclass

import numpy as np

from app.simulation.inputs.clock import TICK_SECONDS
from app.simulation.inputs.grasper import Load
from app.simulation.specimen.grasped_beam import BeamModel, GraspedBeam
from organ_geometry.mesh import Skin, Surface
from physics import Beam, MassSpringChain, NoEquilibrium, RuptureCheck

NODES = 21
SWINGS_PER_SECOND = 2.5
"""Hz, lowest frequency of the straight chain. A real duct swings at tens of Hz, which no screen
shows: the density is raised by `slowed` squared."""
DAMPING_RATIO = 0.08  # of critical: low, so that it overshoots visibly as such chains do
# The chain counts as still when its fastest mass is slower than this.
STILL_MM_PER_S = 0.02
# tonne/mm^3.
TISSUE_DENSITY = 1e-9


@dataclass(frozen=True, slots=True)
class GhostReading:
    """What another theory gives for the session's load."""

    force: float  # N
    deflection: float  # mm; the load's own kind, force or deflection, is the session's
    force_difference: float  # ghost less session, N
    deflection_difference: float  # ghost less session, mm
    check: RuptureCheck  # against the ghost theory's own threshold


class Ghost:
    """The session's dissection by another theory, under the session's load.

    `surface` is the session's skin, named "ghost", deformed as the ghost is by `draw`, and `axis`
    the (D, 3) axis at the driving points, mm, in the organ's coordinates; both are overwritten.
    """

    def __init__(self, model: BeamModel, skin: Skin) -> None:
        self.model = model
        self.surface = Surface("ghost", skin, skin.vertices.copy())
        self._bound = skin.bound_to(model.dissection.driving)
        self._transforms = model.dissection.rest_transforms()
        self.axis = model.dissection.driving.positions.copy()
        self._beam: GraspedBeam | None = None
        self._ends = False

    def follow(self, grasp: float, load: Load) -> None:
        """Solve under the session's load; where there is no equilibrium, there is no reading."""
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
        np.add(positions, moved + np.outer(driven.across, frame[:, 2]), out=self.axis)

    def reading(self, force: float, deflection: float) -> GhostReading | None:
        """Return the ghost's reading; None where its theory has no equilibrium."""
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
    """A mass-spring chain for a beam grasped `grasp` mm from the first clamp, with inertia.

    `places` are the (N, 3) masses, mm along the clamps, lateral and along the pull; overwritten.
    """

    def __init__(self, beam: Beam, grasp: float) -> None:
        light = MassSpringChain(beam, grasp, nodes=NODES, density=TISSUE_DENSITY)
        # How many times slower it swings than tissue of its size.
        self.slowed = light.lowest_frequency / (2.0 * math.pi * SWINGS_PER_SECOND)
        self._chain = MassSpringChain(
            beam,
            grasp,
            nodes=NODES,
            density=TISSUE_DENSITY * self.slowed**2,
            damping_ratio=DAMPING_RATIO,
        )
        self._load: Load | None = None
        self._still = True
        self.places = np.zeros((NODES, 3))
        self.places[:, ::2] = self._chain.places

    @property
    def grasp(self) -> float:
        """Distance of the grasp from the first clamp, mm."""
        return self._chain.grasp

    @property
    def force(self) -> float:
        """The grasper's whole force, N."""
        return self._chain.force

    @property
    def deflection(self) -> float:
        """Displacement of the grasp along the pull, mm."""
        return self._chain.deflection

    def start_from(self, deflection: float) -> None:
        """Put the masses at rest on the linear beam's curve for a deflection, mm."""
        self._chain.bend(deflection)
        self._still = False

    def advance(self, load: Load) -> bool:
        """Advance by one tick; return whether the masses move."""
        if load == self._load and self._still:
            return False
        if load != self._load:
            self._load = load
            if load.kind == "force":
                self._chain.pull(load.amount)
            else:
                self._chain.hold(load.amount)
        self._chain.step(TICK_SECONDS)
        before = self.places[:, ::2].copy()
        self.places[:, ::2] = self._chain.places
        moved = float(np.abs(self.places[:, ::2] - before).max())
        speed = float(np.abs(self._chain.velocities).max())
        self._still = max(speed, moved / TICK_SECONDS) < STILL_MM_PER_S
        return True
