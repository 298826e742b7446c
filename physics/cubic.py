"""The thesis's cubic Rayleigh beam (5.1 to 5.20), for a grasp anywhere between the clamps."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from physics.beam import Beam
from physics.equilibrium import Equilibrium
from physics.quantity import finite, stations_on

__all__ = ["Cubic"]


@dataclass(frozen=True, slots=True)
class Cubic:
    """Rayleigh's energy method with a cubic deflection curve on each side of the grasp.

    For a grasp at a from one clamp and b from the other, S = a + b, the curve is that of the
    linear clamped beam; it stretches by 3 delta^2 S^3 / (20 a^2 b^2) to second order in the slope
    (5.13), and equating work and energy (5.6) gives
    F = 3 E I S^3 / (a^3 b^3) delta + 0.045 q A E S^5 / (a^4 b^4) delta^3.
    With a = b = L and F = 2P that is the thesis's P = 12 E I delta / L^3
    + 0.72 q A E delta^3 / L^3.

    Attributes
    ----------
    q
        The thesis's factor for the work of the axial force (5.9): 1 fits small deflections,
        0.4 to 0.5 large ones.

    Raises
    ------
    ValueError
        If q is negative or not finite.
    """

    q: float = 0.5
    name: ClassVar[str] = "cubic"

    def __post_init__(self) -> None:
        if finite(self.q, "q", "(no unit)") < 0.0:
            raise ValueError(f"q must be 0 or above, got {self.q}")

    def stiffness(self, beam: Beam, grasp: float) -> tuple[float, float]:
        """Return k1, N/mm, and k3, N/mm^3, of F = k1 delta + k3 delta^3.

        Parameters
        ----------
        beam
            The beam.
        grasp
            Distance of the grasp from the first clamp, mm.

        Returns
        -------
        tuple[float, float]
            k1 from bending, k3 from stretching.
        """
        a, b = beam.grasped_at(grasp)
        ratio = beam.span / (a * b)
        bending = 3.0 * beam.modulus * beam.second_moment * ratio**3
        stretching = 0.045 * self.q * beam.area * beam.modulus * beam.span * ratio**4
        return bending, stretching

    def deflection(self, beam: Beam, grasp: float, force: float) -> float:
        """Return the deflection under a force: the one real root of the cubic, by sinh.

        Parameters
        ----------
        beam
            The beam.
        grasp
            Distance of the grasp from the first clamp, mm.
        force
            The grasper's whole force, N.

        Returns
        -------
        float
            Displacement of the grasp along the pull, mm.
        """
        k1, k3 = self.stiffness(beam, grasp)
        force = finite(force, "force", "N")
        scale = math.sqrt(3.0 * k3 / k1)
        argument = 1.5 * force / k1 * scale
        if abs(argument) < 1e-8:
            return force / k1  # sinh(asinh(z)/3) = z/3 here to the last digit
        return 2.0 / scale * math.sinh(math.asinh(argument) / 3.0)

    def force(self, beam: Beam, grasp: float, deflection: float) -> float:
        """Return the grasper's whole force at a deflection.

        Parameters
        ----------
        beam
            The beam.
        grasp
            Distance of the grasp from the first clamp, mm.
        deflection
            Displacement of the grasp along the pull, mm.

        Returns
        -------
        float
            Force, N.
        """
        k1, k3 = self.stiffness(beam, grasp)
        deflection = finite(deflection, "deflection", "mm")
        return (k1 + k3 * deflection**2) * deflection

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
        """
        return self._bent(beam, grasp, force, self.deflection(beam, grasp, force), stations)

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
        """
        return self._bent(beam, grasp, self.force(beam, grasp, deflection), deflection, stations)

    def _bent(
        self,
        beam: Beam,
        grasp: float,
        force: float,
        deflection: float,
        stations: NDArray[np.float64],
    ) -> Equilibrium:
        at = stations_on(beam.span, stations)
        a, b = beam.grasped_at(grasp)
        span = beam.span
        # Each side is measured from its own clamp: near is that side's length, far the other's.
        first = at <= a
        x = np.where(first, at, span - at)
        near, far = np.where(first, a, b), np.where(first, b, a)
        unit = deflection / (2.0 * near**3 * far)
        across = unit * x**2 * (3.0 * near * span - (3.0 * near + far) * x)
        slope = unit * x * (6.0 * near * span - 3.0 * (3.0 * near + far) * x)
        curvature = unit * (6.0 * near * span - 6.0 * (3.0 * near + far) * x)
        third = -6.0 * unit * (3.0 * near + far) * np.where(first, 1.0, -1.0)
        strain = 3.0 * deflection**2 * span**2 / (20.0 * a**2 * b**2)  # (5.15), (5.26)
        normal_stress = np.full_like(at, beam.modulus * strain)  # (5.27)
        stiffness = beam.modulus * beam.second_moment
        moment = stiffness * curvature
        bending_energy = 1.5 * stiffness * deflection**2 * (span / (a * b)) ** 3  # (5.20)
        stretching_energy = 0.5 * beam.modulus * beam.area * strain**2 * span
        return Equilibrium(
            theory=self.name,
            grasp=a,
            force=force,
            deflection=deflection,
            stations=at.copy(),
            along=at.copy(),
            across=across,
            rotation=np.arctan(np.where(first, slope, -slope)),
            normal_force=normal_stress * beam.area,
            moment=moment,
            normal_stress=normal_stress,
            bending_stress=np.abs(moment) * beam.fibre_distance / beam.second_moment,  # (5.28)
            shear_force=stiffness * third,
            strain_energy=bending_energy + stretching_energy,
        )
