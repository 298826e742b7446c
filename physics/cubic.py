"""The thesis's cubic Rayleigh beam (5.1 to 5.20), for a grasp anywhere between the clamps."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray

from physics.beam import Beam
from physics.cubic_kernels import fill_cubic_deflections
from physics.equilibrium import Equilibrium
from physics.fitted_q import FITTED_Q
from physics.pull import Pull
from physics.quantity import finite, stations_on

MOST_Q = 2.0
"""Twice the whole work of the axial force, which no beam's deflection asks for."""


@dataclass(frozen=True, slots=True)
class Cubic:
    """Rayleigh's energy method with a cubic deflection curve on each side of the grasp.

    For a grasp at a from one clamp and b from the other, S = a + b, the curve is that of the
    linear clamped beam; it stretches by 3 delta^2 S^3 / (20 a^2 b^2) to second order in the slope
    (5.13), and equating work and energy (5.6) gives
    F = 3 E I S^3 / (a^3 b^3) delta + 0.045 q A E S^5 / (a^4 b^4) delta^3.
    With a = b = L and F = 2P that is the thesis's P = 12 E I delta / L^3
    + 0.72 q A E delta^3 / L^3.

    q is the thesis's factor for the work of the axial force (5.9): 1 fits small deflections, 0.4 to
    0.5 large ones. 'fitted' is the law of `physics.fitted_q`, which runs from the one to the other
    as the deflection grows.
    """

    q: float | Literal["fitted"] = 0.5
    name: ClassVar[str] = "cubic"
    takes_all_sections: ClassVar[bool] = False

    def __post_init__(self) -> None:
        if isinstance(self.q, str):
            if self.q != "fitted":
                raise ValueError(f"q must be a number or 'fitted', got {self.q!r}")
        elif not 0.0 <= finite(self.q, "q", "(no unit)") <= MOST_Q:
            raise ValueError(
                f"q must be from 0 to {MOST_Q:g}: 1 fits small deflections, 0.5 large ones; "
                f"got {self.q}"
            )

    @property
    def options(self) -> Mapping[str, object]:
        """What `theory_named` takes beside the name."""
        return {"q": self.q}

    def stiffness(self, beam: Beam, grasp: float, deflection: float = 0.0) -> tuple[float, float]:
        """Return k1, N/mm, and k3, N/mm^3, of F = k1 delta + k3 delta^3."""
        a, b = beam.grasped_at(grasp)
        q = FITTED_Q.at(beam, grasp, deflection)[0] if isinstance(self.q, str) else self.q
        ratio = beam.span / (a * b)
        bending = 3.0 * beam.modulus * beam.second_moment * ratio**3
        stretching = 0.045 * q * beam.area * beam.modulus * beam.span * ratio**4
        return bending, stretching

    def pull(self, beam: Beam, grasp: float) -> "CubicPull":
        """Return a beam at rest, grasped at a distance from the first clamp, mm."""
        return CubicPull(self, beam, grasp)

    def deflections(
        self,
        beam: Beam,
        grasp: float,
        forces: NDArray[np.float64],
        out: NDArray[np.float64] | None = None,
    ) -> NDArray[np.float64]:
        """Return (N,) deflections under many forces, N, each on its own, in nanoseconds a force.

        With q fitted they are found one by one, in microseconds. They are written to `out`, which
        may be `forces`, if it is given.

        Returns
        -------
        NDArray[np.float64]
            (N,) displacements of the grasp along the pull, mm.

        Raises
        ------
        ValueError
            If the forces are not a row of finite numbers, or `out` is no such row of that length.

        Examples
        --------
        >>> duct = Beam.round(span=50.8, diameter=8.89, modulus=0.310264)
        >>> Cubic().deflections(duct, 25.4, np.array([0.0, 3.5, -3.5])).round(2).tolist()
        [0.0, 12.7, -12.7]
        """
        row = np.asarray(forces, dtype=np.float64)
        if row.ndim != 1:
            raise ValueError(f"forces must be a row of forces in N, got shape {row.shape}")
        if not np.isfinite(row).all():
            first = row[~np.isfinite(row)][0]
            raise ValueError(f"forces must be finite numbers of N, got {first}")
        if out is None:
            out = np.empty_like(row)
        elif out.shape != row.shape or out.dtype != np.float64:
            raise ValueError(
                f"out must be {row.size} float64 in a row for as many forces, "
                f"got {out.dtype} of shape {out.shape}"
            )
        if isinstance(self.q, str):
            pull = self.pull(beam, grasp)
            out[:] = [pull.to_force(force).deflection for force in row.tolist()]
        else:
            fill_cubic_deflections(*self.stiffness(beam, grasp), row, out)
        return out


class CubicPull(Pull):
    """A cubic beam that is pulled; see `Cubic`."""

    def __init__(self, theory: Cubic, beam: Beam, grasp: float) -> None:
        super().__init__(beam, grasp)
        self._theory = theory

    def to_deflection(self, deflection: float) -> Self:
        """Find the equilibrium at a displacement of the grasp, mm."""
        deflection = finite(deflection, "deflection", "mm")
        k1, k3 = self._theory.stiffness(self.beam, self.grasp, deflection)
        self.force = (k1 + k3 * deflection**2) * deflection
        self.deflection = deflection
        return self

    def to_force(self, force: float) -> Self:
        """Find the equilibrium under a whole force, N."""
        force = finite(force, "force", "N")
        if isinstance(self._theory.q, str):
            self.deflection = self._root_by_law(force)
        else:
            self.deflection = _root(*self._theory.stiffness(self.beam, self.grasp), force)
        self.force = force
        return self

    def _root_by_law(self, force: float) -> float:
        """Newton's method on ln F over ln delta, whose slope stays between about 1 and 3."""
        pull, beam, grasp = abs(force), self.beam, self.grasp
        if pull == 0.0:
            return 0.0
        delta = _root(*Cubic(q=0.5).stiffness(beam, grasp), pull)
        for _ in range(100):
            k1, k3 = self._theory.stiffness(beam, grasp, delta)
            stretching = k3 * delta**2
            power = FITTED_Q.at(beam, grasp, delta)[1]
            slope = 1.0 + (2.0 + power) * stretching / (k1 + stretching)
            step = math.log(pull / ((k1 + stretching) * delta)) / slope
            delta *= math.exp(step)
            if abs(step) <= 2e-16:
                break
        return math.copysign(delta, force)

    def sample(self, stations: NDArray[np.float64]) -> Equilibrium:
        """Return the present equilibrium at stations, mm from the first clamp."""
        beam, force, deflection = self.beam, self.force, self.deflection
        at = stations_on(beam.span, stations)
        a, b = beam.grasped_at(self.grasp)
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
            theory=Cubic.name,
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


def _root(bending: float, stretching: float, force: float) -> float:
    """Return the one real root of F = k1 delta + k3 delta^3, by sinh."""
    scale = math.sqrt(3.0 * stretching / bending)
    argument = 1.5 * force / bending * scale
    if abs(argument) < 1e-8:
        return force / bending  # sinh(asinh(z)/3) = z/3 here to the last digit
    return 2.0 / scale * math.sinh(math.asinh(argument) / 3.0)
