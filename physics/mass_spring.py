"""The mass-spring chain at rest, called as the other theories are."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from physics.beam import Beam
from physics.cubic import Cubic
from physics.equilibrium import Equilibrium
from physics.mass_spring_chain import Integrator, MassSpringChain
from physics.quantity import finite, positive

__all__ = ["MassSpring"]

NOWHERE = np.empty(0)


@dataclass(frozen=True, slots=True)
class MassSpring:
    """The thesis's chapter 2, settled by damping: what its chain comes to in the end.

    Where it settles depends on the springs and not on the integrator, the density or the damping;
    those are for `chain`, which swings.

    Attributes
    ----------
    nodes
        Number of masses, both clamped ones included: odd, 9 or more.
    integrator
        'euler', 'leapfrog' or 'runge-kutta'.
    density
        Mass over volume, tonne/mm^3.
    damping_ratio
        Damping over the critical damping of the slowest swing, no unit.
    tolerance
        Force left on a free mass when the chain counts as settled, as a part of the largest force
        that holds it. At 1e-9 the deflection is settled to 2e-7 of itself.

    Raises
    ------
    ValueError
        If one of them is not what is said above.
    """

    nodes: int = 41
    integrator: Integrator = "leapfrog"
    density: float = 1e-9
    damping_ratio: float = 0.2
    tolerance: float = 1e-9
    name: ClassVar[str] = "mass-spring"

    def __post_init__(self) -> None:
        positive(self.tolerance, "tolerance", "(no unit)")
        # The chain knows best what it can be built of.
        self.chain(Beam.round(span=1.0, diameter=0.1, modulus=1.0), 0.5)

    def chain(self, beam: Beam, grasp: float) -> MassSpringChain:
        """Return the chain, straight and still."""
        return MassSpringChain(
            beam,
            grasp,
            nodes=self.nodes,
            integrator=self.integrator,
            density=self.density,
            damping_ratio=self.damping_ratio,
        )

    def deflection(self, beam: Beam, grasp: float, force: float) -> float:
        """Return the deflection under a force."""
        return self.under_force(beam, grasp, force, NOWHERE).deflection

    def force(self, beam: Beam, grasp: float, deflection: float) -> float:
        """Return the grasper's whole force at a deflection."""
        return self.under_deflection(beam, grasp, deflection, NOWHERE).force

    def under_force(
        self, beam: Beam, grasp: float, force: float, stations: NDArray[np.float64]
    ) -> Equilibrium:
        """Return the equilibrium under a force; see `Theory`."""
        chain = self.chain(beam, grasp)
        chain.pull(force)
        # The cubic's deflection is near enough to start from.
        chain.bend(Cubic().deflection(beam, grasp, force))
        chain.settle(self.tolerance)
        return chain.sampled(stations)

    def under_deflection(
        self, beam: Beam, grasp: float, deflection: float, stations: NDArray[np.float64]
    ) -> Equilibrium:
        """Return the equilibrium at a deflection of the grasp; see `Theory`."""
        chain = self.chain(beam, grasp)
        chain.hold(finite(deflection, "deflection", "mm"))
        chain.bend(deflection)
        chain.settle(self.tolerance)
        return chain.sampled(stations)
