"""The thesis's mass-spring model (chapter 2): a duct as a chain that swings, step by step."""

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from physics.beam import Beam
from physics.cubic import Cubic
from physics.equilibrium import Equilibrium, NoEquilibrium
from physics.quantity import finite, positive, stations_on
from physics.spring_chain import euler, leapfrog, runge_kutta, settle, spring_forces

Integrator = Literal["euler", "leapfrog", "runge-kutta"]

INTEGRATORS = {"euler": euler, "leapfrog": leapfrog, "runge-kutta": runge_kutta}
"""The integrators of 2.2 by name: explicit Euler, leapfrog, and Runge-Kutta of fourth order."""

# Fewest segments on the short side of the grasp: with two a chain would be 14 % too soft.
LEAST_SEGMENTS = 4

# Part of the largest stable step that is taken: bending stiffens a little where it squeezes.
STEP_MARGIN = 0.9

MOST_STEPS = 1_000_000
"""Steps in which a chain must settle."""


def largest_stable_step(integrator: Integrator, frequency: float, damping: float) -> float:
    """Return the longest step with which an integrator keeps a swinging mass from running away.

    Parameters
    ----------
    integrator, frequency, damping
        Highest angular frequency of the masses without damping, rad/s, and damping coefficient
        over mass, lambda/m of (2.1), 1/s.

    Returns
    -------
    float
        Step, s. It is 0 for explicit Euler without damping, which always runs away.

    Notes
    -----
    A mode x'' + d x' + w^2 x = 0 has the rates s with s^2 + d s + w^2 = 0, |s| at most the larger
    of w and d. Explicit Euler needs |1 + h s| <= 1: h <= d / w^2 where the mode swings, h <= 2 / d
    where it creeps. Leapfrog with the mean of the velocities in the damping has h <= 2 / w for any
    d. The region of the classical Runge-Kutta rule reaches 2 sqrt(2) along the imaginary axis and
    2.785 along the negative one, and no less than that between them but for 1 %.

    Examples
    --------
    >>> largest_stable_step("leapfrog", 100.0, 5.0)
    0.02
    """
    if integrator == "euler":
        return min(damping / frequency**2, 2.0 / damping) if damping > 0.0 else 0.0
    if integrator == "leapfrog":
        return 2.0 / frequency
    if damping < 0.5 * frequency:
        return 2.0 * math.sqrt(2.0) / frequency
    return 2.6 / max(frequency, damping)


class MassSpringChain:
    """Masses in a row between two clamps, with springs between them and at their joints.

    Along each segment a spring of stiffness E A / l0, at each mass an angular spring of
    E I over the length that belongs to it, at each mass a damper to the ground (2.1). As the
    segments become short its equilibrium converges to the geometrically exact beam without shear.
    The chain starts straight and still.

    Parameters
    ----------
    beam, grasp
        The beam that it stands for; a mass is at the grasp, mm from the first clamp.
    nodes, integrator
        Number of masses, both clamped ones included: odd, 9 or more; one of `INTEGRATORS`.
    density
        Mass over volume, tonne/mm^3 (N s^2/mm^4); water and flesh 1e-9.
    damping_ratio
        Damping over the critical damping of the slowest mode, no unit.
    """

    def __init__(
        self,
        beam: Beam,
        grasp: float,
        *,
        nodes: int = 41,
        integrator: Integrator = "leapfrog",
        density: float = 1e-9,
        damping_ratio: float = 0.2,
    ) -> None:
        if int(nodes) != nodes or nodes < 2 * LEAST_SEGMENTS + 1 or nodes % 2 == 0:
            raise ValueError(
                f"nodes must be an odd number from {2 * LEAST_SEGMENTS + 1}, so that a central "
                f"grasp has as many on either side, got {nodes}"
            )
        if integrator not in INTEGRATORS:
            raise ValueError(
                f"unknown integrator {integrator!r}; there are: {', '.join(INTEGRATORS)}"
            )
        positive(density, "density", "tonne/mm^3")
        if finite(damping_ratio, "damping_ratio", "(no unit)") < 0.0:
            raise ValueError(f"damping_ratio must be 0 or above, got {damping_ratio}")
        a, b = beam.grasped_at(grasp)
        segments = int(nodes) - 1
        short = max(LEAST_SEGMENTS, math.floor(segments * min(a, b) / beam.span + 0.5))
        before = short if a <= b else segments - short
        self._beam = beam
        self._integrator: Integrator = integrator
        self._grasp = a
        self._grasped = before
        self._rest = np.repeat([a / before, b / (segments - before)], [before, segments - before])
        self._stations = np.concatenate(
            [
                np.linspace(0.0, a, before + 1),
                np.linspace(a, beam.span, segments - before + 1)[1:],
            ]
        )
        tributary = np.zeros(int(nodes))
        tributary[:-1] += 0.5 * self._rest
        tributary[1:] += 0.5 * self._rest
        self._mass = density * beam.area * tributary
        self._axial = beam.modulus * beam.area / self._rest
        self._angular = beam.modulus * beam.second_moment / tributary
        axial, bending = self._frequencies_at_rest()
        self._axial_frequency = float(axial[-1])
        self._bending_frequency = float(bending[-1])
        self._lowest_frequency = float(bending[0])
        self._damping = 2.0 * float(damping_ratio) * self._lowest_frequency
        self._inverse_mass = np.repeat(1.0 / self._mass, 2).reshape(-1, 2)
        self._inverse_mass[[0, -1]] = 0.0
        self._moved = np.zeros((int(nodes), 2))
        self._velocity = np.zeros((int(nodes), 2))
        self._forces = np.zeros((int(nodes), 2))
        self._pull = 0.0
        self._goal: float | None = None

    @property
    def grasp(self) -> float:
        """Distance of the grasp from the first clamp, mm."""
        return self._grasp

    @property
    def places(self) -> NDArray[np.float64]:
        """(N, 2) where the masses are now, mm along the line between the clamps and the pull."""
        places = self._moved.copy()
        places[:, 0] += self._stations
        return places

    @property
    def velocities(self) -> NDArray[np.float64]:
        """(N, 2) velocities of the masses, mm/s."""
        return self._velocity.copy()

    @property
    def deflection(self) -> float:
        """Displacement of the grasp along the pull now, mm."""
        return float(self._moved[self._grasped, 1])

    @property
    def force(self) -> float:
        """The grasper's whole force, N: the one that pulls, or the springs' where it holds."""
        if self._goal is None:
            return self._pull
        spring_forces(self._rest, self._axial, self._angular, self._moved, self._forces)
        return -float(self._forces[self._grasped, 1])

    @property
    def strain_energy(self) -> float:
        """Energy stored in the springs, N mm."""
        _, tension, moment, _ = self._carried()
        return 0.5 * float((tension**2 / self._axial).sum() + (moment**2 / self._angular).sum())

    @property
    def damping(self) -> float:
        """Damping coefficient over mass, 1/s."""
        return self._damping

    @property
    def lowest_frequency(self) -> float:
        """Angular frequency of the slowest swing across at rest, rad/s."""
        return self._lowest_frequency

    @property
    def highest_frequency(self) -> float:
        """Angular frequency, rad/s, that no swing of the chain exceeds, at rest or stretched.

        At rest the fastest swings are those along and those across, of masses in opposite phase;
        a stretched chain stiffens across by no more than its stiffness along.
        """
        return math.hypot(self._axial_frequency, self._bending_frequency)

    @property
    def largest_stable_step(self) -> float:
        """Longest step with which the integrator is stable, s."""
        return largest_stable_step(self._integrator, self.highest_frequency, self._damping)

    def pull(self, force: float) -> None:
        """Pull at the grasp with a force from now on."""
        self._pull = finite(force, "force", "N")
        self._goal = None
        self._inverse_mass[self._grasped, 1] = 1.0 / self._mass[self._grasped]

    def hold(self, deflection: float) -> None:
        """Hold the grasp; the next step leads it evenly to a deflection, where it stays."""
        self._goal = finite(deflection, "deflection", "mm")
        self._pull = 0.0
        self._inverse_mass[self._grasped, 1] = 0.0
        self._velocity[self._grasped, 1] = 0.0

    def bend(self, deflection: float) -> None:
        """Put the masses, still, on the curve of the linear clamped beam."""
        curve = (
            Cubic().pull(self._beam, self._grasp).to_deflection(deflection).sample(self._stations)
        )
        self._moved[:, 0] = 0.0
        self._moved[:, 1] = curve.across
        self._moved[[0, -1]] = 0.0
        self._velocity[:] = 0.0

    def step(self, seconds: float) -> int:
        """Advance in time, in as many equal steps as stability asks for."""
        positive(seconds, "seconds", "s")
        longest = STEP_MARGIN * self.largest_stable_step
        if longest == 0.0:
            raise ValueError(
                "damping_ratio must be above 0 for explicit Euler, which is unstable at any step "
                "without damping, got 0"
            )
        count = math.ceil(seconds / longest)
        self.advance(seconds / count, count)
        return count

    def advance(self, step: float, count: int) -> None:
        """Advance by steps of a given length, stable or not."""
        positive(step, "step", "s")
        if self._goal is not None:
            displacement = self._goal - self._moved[self._grasped, 1]
            self._velocity[self._grasped, 1] = displacement / (step * count)
        INTEGRATORS[self._integrator](
            self._rest,
            self._axial,
            self._angular,
            self._inverse_mass,
            self._damping,
            self._grasped,
            self._pull,
            step,
            count,
            self._moved,
            self._velocity,
        )
        if self._goal is not None:
            self._moved[self._grasped, 1] = self._goal
            self._velocity[self._grasped, 1] = 0.0

    def settle(self, tolerance: float = 1e-9) -> int:
        """Let the chain come to rest whatever its integrator or damping; return the steps taken."""
        # No free mass is left with a force above the tolerance times the largest force that holds
        # the chain (the pull, or what a clamp or the grasper bears); see `spring_chain.settle`.
        if self._goal is not None:
            self._moved[self._grasped, 1] = self._goal
        steps = settle(
            self._rest,
            self._axial,
            self._angular,
            self._inverse_mass,
            self._grasped,
            self._pull,
            STEP_MARGIN * largest_stable_step("leapfrog", self.highest_frequency, 0.0),
            positive(tolerance, "tolerance", "(no unit)"),
            MOST_STEPS,
            self._moved,
            self._velocity,
        )
        if steps < 0:
            raise NoEquilibrium(
                f"the chain must settle in {MOST_STEPS} steps, but is still moving under "
                f"{self._pull:g} N at {self.deflection:g} mm"
            )
        return int(steps)

    def sampled(self, stations: NDArray[np.float64]) -> Equilibrium:
        """Return the chain as it is, at rest or not, at (N,) stations, mm from the first clamp."""
        # Between masses places, rotations and moments are linear; a mass has the mean rotation of
        # its two segments.
        beam, last = self._beam, self._rest.size - 1
        at = stations_on(beam.span, stations)
        angle, tension, moment, shear = self._carried()
        turned = np.zeros(last + 2)
        turned[1:-1] = 0.5 * (angle[1:] + angle[:-1])
        places = self.places
        rotation = np.interp(at, self._stations, turned)
        # A mass belongs to the segment that ends there.
        e = np.maximum(np.searchsorted(self._stations, at) - 1, 0)
        length = np.hypot(*np.diff(places, axis=0).T)
        across = shear * self._rest / length

        def normal_force(segment: NDArray[np.intp]) -> NDArray[np.float64]:
            lean = rotation - angle[segment]
            return tension[segment] * np.cos(lean) - across[segment] * np.sin(lean)

        # The pull has a part along a section that is turned where it is grasped: half of it counts.
        other = np.where(at == self._grasp, np.minimum(e + 1, last), e)
        normal = 0.5 * (normal_force(e) + normal_force(other))
        moments = np.interp(at, self._stations, moment)
        return Equilibrium(
            theory="mass-spring",
            grasp=self._grasp,
            force=self.force,
            deflection=self.deflection,
            stations=at.copy(),
            along=np.interp(at, self._stations, places[:, 0]),
            across=np.interp(at, self._stations, places[:, 1]),
            rotation=rotation,
            normal_force=normal,
            moment=moments,
            normal_stress=normal / beam.area,
            bending_stress=np.abs(moments) * beam.fibre_distance / beam.second_moment,
            shear_force=shear[e],
            strain_energy=self.strain_energy,
        )

    def _carried(self) -> tuple[NDArray[np.float64], ...]:
        """Return the segments' angles and tensions, the masses' moments, the segments' shears."""
        du, dv = np.diff(self._moved, axis=0).T
        along = self._rest + du
        stretch = (2.0 * self._rest * du + du**2 + dv**2) / (np.hypot(along, dv) + self._rest)
        angle = np.arctan2(dv, along)
        bend = np.diff(angle, prepend=0.0, append=0.0)
        moment = self._angular * (bend - 2.0 * math.pi * np.round(bend / (2.0 * math.pi)))
        return angle, self._axial * stretch, moment, np.diff(moment) / self._rest

    def _frequencies_at_rest(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the straight chain's angular frequencies along and across, rad/s, rising."""
        count = self._rest.size
        stretch = np.eye(count, count + 1, 1) - np.eye(count, count + 1)
        bend = np.diff(
            stretch / self._rest[:, None], axis=0, prepend=np.zeros((1, count + 1)), append=0.0
        )
        root = np.sqrt(self._mass)

        def frequencies(
            change: NDArray[np.float64], stiffness: NDArray[np.float64]
        ) -> NDArray[np.float64]:
            scaled = np.sqrt(stiffness)[:, None] * change / root
            # The clamped masses do not swing.
            rising = np.linalg.svd(scaled[:, 1:-1], compute_uv=False)[::-1]
            return np.asarray(rising, dtype=np.float64)

        return frequencies(stretch, self._axial), frequencies(bend, self._angular)
