"""The exact beam along an organ's own sections, called as any other theory."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from physics.beam import Beam
from physics.equilibrium import Equilibrium
from physics.exact import Exact
from physics.varying_beam import VaryingBeam

__all__ = ["ExactAlong"]


@dataclass(frozen=True, slots=True, eq=False)
class ExactAlong:
    """The exact beam whose section varies, in the place of a constant beam of the same span.

    Attributes
    ----------
    exact
        Shear, law and intervals.
    sections
        The beam that is solved, whatever constant beam the caller holds.
    """

    exact: Exact
    sections: VaryingBeam
    name: ClassVar[str] = "exact"

    def under_force(
        self, beam: Beam, grasp: float, force: float, stations: NDArray[np.float64]
    ) -> Equilibrium:
        """Return the equilibrium under a force; see `Theory`."""
        self._check_span(beam)
        return self.exact.under_force(self.sections, grasp, force, stations)

    def under_deflection(
        self, beam: Beam, grasp: float, deflection: float, stations: NDArray[np.float64]
    ) -> Equilibrium:
        """Return the equilibrium at a deflection of the grasp; see `Theory`."""
        self._check_span(beam)
        return self.exact.under_deflection(self.sections, grasp, deflection, stations)

    def _check_span(self, beam: Beam) -> None:
        if beam.span != self.sections.span:
            raise ValueError(
                f"span of the beam must be that of the sections, {self.sections.span:g} mm, "
                f"got {beam.span:g} mm"
            )
