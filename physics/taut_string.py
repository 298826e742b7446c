"""The thesis's string for very large deflections of thin beams (5.21 to 5.25)."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from physics.beam import Beam
from physics.equilibrium import Equilibrium
from physics.pull import Pull
from physics.quantity import finite, stations_on


@dataclass(frozen=True, slots=True)
class TautString:
    """A beam that only stretches: two straight lines under one tension.

    For a grasp at a from one clamp and b from the other, S = a + b, the lines are
    l_a = sqrt(a^2 + delta^2) and l_b alike, the tension E A (l_a + l_b - S) / S is the same in
    both, as it is in the cubic, and F = tension x delta (1/l_a + 1/l_b). With a = b = L and F = 2P
    that is (5.25): P = k delta (1 - L / sqrt(L^2 + delta^2)), k = A E / L.
    """

    name: ClassVar[str] = "string"
    takes_all_sections: ClassVar[bool] = False

    @property
    def options(self) -> Mapping[str, object]:
        """Nothing: `theory_named` takes it by its name alone."""
        return {}

    def pull(self, beam: Beam, grasp: float) -> "StringPull":
        """Return a beam at rest, grasped at a distance from the first clamp, mm."""
        return StringPull(beam, grasp)


class StringPull(Pull):
    """A string that is pulled; see `TautString`."""

    def to_deflection(self, deflection: float) -> Self:
        """Find the equilibrium at a displacement of the grasp, mm."""
        deflection = finite(deflection, "deflection", "mm")
        a, b = self.beam.grasped_at(self.grasp)
        self.force = _force_and_slope(self.beam, a, b, deflection)[0]
        self.deflection = deflection
        return self

    def to_force(self, force: float) -> Self:
        """Find the equilibrium under a whole force, N, by Newton's method from below."""
        force = finite(force, "force", "N")
        self.deflection = math.copysign(self._root(abs(force)), force) if force else 0.0
        self.force = force
        return self

    def _root(self, pull: float) -> float:
        beam = self.beam
        a, b = beam.grasped_at(self.grasp)
        # The small-slope law F = E A S delta^3 / (2 a^2 b^2) overrates the force: a start below.
        cube = 2.0 * (a * b) ** 2 * pull / (beam.modulus * beam.area * beam.span)
        delta = cube ** (1.0 / 3.0)
        for _ in range(100):
            value, slope = _force_and_slope(beam, a, b, delta)
            step = (pull - value) / slope
            delta += step
            if abs(step) <= 2e-16 * delta:
                break
        return delta

    def sample(self, stations: NDArray[np.float64]) -> Equilibrium:
        """Return the present equilibrium at stations, mm from the first clamp."""
        beam, force, deflection = self.beam, self.force, self.deflection
        at = stations_on(beam.span, stations)
        a, b = beam.grasped_at(self.grasp)
        first, second = math.atan2(deflection, a), -math.atan2(deflection, b)
        # The lines have kinks, sections that follow them would cut through each other: they turn
        # over one fibre distance, from standing still in the clamp and halving the kink at the
        # grasp. No stress or force follows from it.
        from_clamp = np.minimum(at, beam.span - at) / beam.fibre_distance
        from_grasp = np.abs(at - a) / beam.fibre_distance
        side, halved = np.where(at < a, first, second), 0.5 * (first + second)
        rotation = _eased(from_clamp) * (halved + _eased(from_grasp) * (side - halved))
        stretch = _stretch(a, b, deflection)
        strain = stretch / beam.span
        normal_stress = np.full_like(at, beam.modulus * strain)
        return Equilibrium(
            theory=TautString.name,
            grasp=a,
            force=force,
            deflection=deflection,
            stations=at.copy(),
            along=at.copy(),
            across=deflection * np.minimum(at / a, (beam.span - at) / b),
            rotation=rotation,
            normal_force=normal_stress * beam.area,
            moment=np.zeros_like(at),
            normal_stress=normal_stress,
            bending_stress=np.zeros_like(at),
            shear_force=np.zeros_like(at),
            strain_energy=0.5 * beam.modulus * beam.area * strain * stretch,
        )


def _eased(progress: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return 0 to 1, level at both ends, while `progress` grows from 0 to 1 and beyond."""
    held: NDArray[np.float64] = np.minimum(progress, 1.0)
    return held * held * (3.0 - 2.0 * held)


def _stretch(a: float, b: float, delta: float) -> float:
    """Return l_a + l_b - a - b without the cancellation that it has as written."""
    square = delta * delta
    return square / (math.hypot(a, delta) + a) + square / (math.hypot(b, delta) + b)


def _force_and_slope(beam: Beam, a: float, b: float, delta: float) -> tuple[float, float]:
    """Return the force, N, and its derivative by the deflection, N/mm."""
    la, lb = math.hypot(a, delta), math.hypot(b, delta)
    stiffness = beam.modulus * beam.area / beam.span
    stretch = _stretch(a, b, delta)
    sines = delta / la + delta / lb
    slope = stiffness * (sines * sines + stretch * (a * a / la**3 + b * b / lb**3))
    return stiffness * stretch * sines, slope
