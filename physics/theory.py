"""The one way to call a theory of a pulled beam, whichever it is."""

from collections.abc import Callable
from typing import ClassVar, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from physics.beam import Beam
from physics.cubic import Cubic
from physics.equilibrium import Equilibrium
from physics.exact import Exact, Law
from physics.fem import Fem
from physics.mass_spring import MassSpring
from physics.taut_string import TautString

__all__ = ["THEORIES", "Theory", "theory_named"]


class Theory(Protocol):
    """A way to find the equilibrium of a beam pulled across its axis at one place.

    Attributes
    ----------
    name
        Name of the theory, as on the command line.
    """

    name: ClassVar[str]

    def under_force(
        self, beam: Beam, grasp: float, force: float, stations: NDArray[np.float64]
    ) -> Equilibrium:
        """Return the equilibrium under a force.

        Parameters
        ----------
        beam
            The beam.
        grasp
            Distance of the grasp from the first clamp, mm.
        force
            The grasper's whole force, N.
        stations
            (N,) where to sample it, mm from the first clamp.

        Returns
        -------
        Equilibrium
            The equilibrium.

        Raises
        ------
        ValueError
            If the grasp is not between the clamps, the force is not finite or a station is not on
            the span; as `NoEquilibrium` if the theory ends before the force.
        """
        ...

    def under_deflection(
        self, beam: Beam, grasp: float, deflection: float, stations: NDArray[np.float64]
    ) -> Equilibrium:
        """Return the equilibrium at a deflection of the grasp.

        Parameters
        ----------
        beam
            The beam.
        grasp
            Distance of the grasp from the first clamp, mm.
        deflection
            Displacement of the grasp along the pull, mm.
        stations
            (N,) where to sample it, mm from the first clamp.

        Returns
        -------
        Equilibrium
            The equilibrium.

        Raises
        ------
        ValueError
            If the grasp is not between the clamps, the deflection is not finite or a station is
            not on the span; as `NoEquilibrium` if the theory ends before the deflection.
        """
        ...


THEORIES: dict[str, Callable[[], Theory]] = {
    "cubic": Cubic,
    "string": TautString,
    "exact": Exact,
    "fem": Fem,
    "mass-spring": MassSpring,
}
"""The theories by name, each with its own defaults."""


def theory_named(
    name: str,
    *,
    q: float | Literal["fitted"] | None = None,
    shear: bool = False,
    law: Law | None = None,
) -> Theory:
    """Return the theory of that name."""
    if name not in THEORIES:
        raise ValueError(f"unknown theory {name!r}; there are: {', '.join(THEORIES)}")
    if q is not None and name != "cubic":
        raise ValueError(f"q belongs to the cubic theory, the {name} theory has none")
    if (shear or law is not None) and name != "exact":
        raise ValueError(f"shear and law belong to the exact theory, the {name} theory has none")
    if name == "cubic" and q is not None:
        return Cubic(q=q)
    if name == "exact":
        return Exact(shear=shear or law == "neo-hooke", law=law or "linear")
    return THEORIES[name]()
