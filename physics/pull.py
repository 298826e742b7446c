"""A pull: equilibria of one beam at one grasp, one after the other."""

import numpy as np
from numpy.typing import NDArray

from physics.beam import Beam
from physics.equilibrium import Equilibrium
from physics.exact import Exact, ExactSolver
from physics.theory import Theory

__all__ = ["Pull"]


class Pull:
    """A beam that is pulled at one place, step by step.

    The exact beam starts each solution from the last one, some ten times faster than from rest; the
    other theories solve each load by itself.

    Parameters
    ----------
    theory
        The theory.
    beam
        The beam.
    grasp
        Distance of the grasp from the first clamp, mm.

    Raises
    ------
    ValueError
        If the grasp is not between the clamps.
    """

    def __init__(self, theory: Theory, beam: Beam, grasp: float) -> None:
        beam.grasped_at(grasp)
        self._theory, self._beam, self._grasp = theory, beam, grasp
        self._solver: ExactSolver | None = None
        if isinstance(theory, Exact):
            self._solver = theory.solver(beam, grasp)

    def to_force(self, force: float, stations: NDArray[np.float64]) -> Equilibrium:
        """Return the equilibrium under a force.

        Parameters
        ----------
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
        NoEquilibrium
            If the theory ends before.
        """
        if self._solver is None:
            return self._theory.under_force(self._beam, self._grasp, force, stations)
        self._solver.solve_force(force)
        return self._solver.sample(stations)

    def to_deflection(self, deflection: float, stations: NDArray[np.float64]) -> Equilibrium:
        """Return the equilibrium at a deflection of the grasp.

        Parameters
        ----------
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
        NoEquilibrium
            If the theory ends before.
        """
        if self._solver is None:
            return self._theory.under_deflection(self._beam, self._grasp, deflection, stations)
        self._solver.solve_deflection(deflection)
        return self._solver.sample(stations)
