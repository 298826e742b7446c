"""The mass-spring chain at rest, called as the other theories are."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from physics.beam import Beam
from physics.cubic import Cubic
from physics.equilibrium import Equilibrium
from physics.mass_spring_chain import Integrator, MassSpringChain
from physics.pull import Pull
from physics.quantity import finite, positive


@dataclass(frozen=True, slots=True)
class MassSpring:
    """The thesis's chapter 2, settled by damping: what its chain comes to in the end.

    Where it settles depends on the springs and not on the integrator, the density or the damping;
    those are for `chain`, which swings.
    """

    nodes: int = 41  # masses, both clamped ones included: odd, 9 or more
    integrator: Integrator = "leapfrog"
    density: float = 1e-9  # mass over volume, tonne/mm^3
    damping_ratio: float = 0.2  # damping over the critical one of the slowest mode
    # force left on a free mass, relative to the largest that holds the chain, when it counts as
    # settled; 1e-9 settles the deflection to 2e-7 of itself
    tolerance: float = 1e-9
    name: ClassVar[str] = "mass-spring"
    takes_all_sections: ClassVar[bool] = False

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

    @property
    def options(self) -> Mapping[str, object]:
        """Nothing: `theory_named` takes it by its name alone."""
        return {}

    def pull(self, beam: Beam, grasp: float) -> "MassSpringPull":
        """Return a beam at rest, grasped at a distance from the first clamp, mm."""
        return MassSpringPull(self, beam, grasp)


class MassSpringPull(Pull):
    """A chain that is settled anew under each load; see `MassSpring`."""

    def __init__(self, theory: MassSpring, beam: Beam, grasp: float) -> None:
        super().__init__(beam, grasp)
        self._theory = theory
        self._chain = theory.chain(beam, grasp)

    def to_force(self, force: float) -> Self:
        """Find the equilibrium under a whole force, N."""
        chain = self._theory.chain(self.beam, self.grasp)
        chain.pull(force)
        # The cubic's deflection is near enough to start from.
        chain.bend(Cubic().pull(self.beam, self.grasp).to_force(force).deflection)
        return self._settled(chain)

    def to_deflection(self, deflection: float) -> Self:
        """Find the equilibrium at a displacement of the grasp, mm."""
        chain = self._theory.chain(self.beam, self.grasp)
        chain.hold(finite(deflection, "deflection", "mm"))
        chain.bend(deflection)
        return self._settled(chain)

    def _settled(self, chain: MassSpringChain) -> Self:
        chain.settle(self._theory.tolerance)
        self._chain = chain
        self.force, self.deflection = chain.force, chain.deflection
        return self

    def sample(self, stations: NDArray[np.float64]) -> Equilibrium:
        """Return the present equilibrium at stations, mm from the first clamp."""
        return self._chain.sampled(stations)
