"""The geometrically exact beam: large rotations, true stretch, shear, two material laws."""

import itertools
import math
from dataclasses import dataclass
from typing import ClassVar, Literal, Self, get_args

import numpy as np
from numpy.typing import NDArray

from physics import exact_kernels as kernels
from physics.beam import Beam
from physics.equilibrium import Equilibrium, NoEquilibrium
from physics.pull import Pull
from physics.quantity import finite, stations_on
from physics.section import Ring, lateral_constant

__all__ = ["BeyondLaw", "Exact", "ExactPull", "Hold", "Law", "Reason"]

Law = Literal["linear", "neo-hooke"]
"""`linear`: tension, shear and moment proportional to engineering strains and curvature.
`neo-hooke`: fibres of a compressible neo-Hookean solid."""

Reason = Literal["lost", "unstable", "gives way", "squeezed", "out of reach"]
"""Why there is no equilibrium; see `BeyondLaw`."""

REASONS: dict[int, tuple[Reason, str]] = {
    kernels.LOST: ("lost", "no equilibrium was found near the last one, however small the step"),
    kernels.UNSTABLE: ("unstable", "the equilibrium there would not stay, its energy can fall"),
    kernels.GIVES_WAY: ("gives way", "a section has no stiffness left in stretch and shear"),
    kernels.SQUEEZED: (
        "squeezed",
        f"a fibre would be squeezed to less than {kernels.LEAST_STRETCH:g} of its length",
    ),
    kernels.OUT_OF_REACH: (
        "out of reach",
        f"it lies beyond a deflection of {kernels.FARTHEST:g} spans",
    ),
}

NEAREST = 1e-3
"""Distance of two grasps, in spans, below which they count as one."""
LAYER = 3.0
"""End spacing of the mesh in radii of gyration, times the number of elements of a part.

A taut beam bends in layers at its clamps and its grasp that are as long as its radius of gyration
over the root of its strain."""


@dataclass(frozen=True, slots=True)
class Hold:
    """What a grasper imposes where it holds the beam.

    Attributes
    ----------
    kind
        "force", the grasper's whole force, or "deflection", the place that it is led to.
    amount
        N or mm.
    compliance
        Of the grip, for a deflection, mm/N: the beam gives way to the force by as much. 0 is rigid.
    """

    kind: Literal["force", "deflection"]
    amount: float
    compliance: float = 0.0

    def __post_init__(self) -> None:
        finite(self.amount, "amount of a hold", "N or mm")
        if not 0.0 <= self.compliance < math.inf:
            raise ValueError(f"compliance must be 0 mm/N or more, got {self.compliance:g} mm/N")
        if self.kind == "force" and self.compliance:
            raise ValueError("compliance belongs to a hold by deflection, not by force")


class BeyondLaw(NoEquilibrium):
    """A load beyond what the law can carry.

    Attributes
    ----------
    reason
        What stopped the pull: `lost`, no equilibrium near the last one; `unstable`, the
        equilibrium would not stay; `gives way`, a section lost its stiffness; `squeezed`, a fibre
        lost its length; `out of reach`, no deflection meets the force.
    force
        The grasper's force at the last equilibrium on the way, N.
    deflection
        Displacement of the grasp there, mm.
    """

    def __init__(self, message: str, reason: Reason, force: float, deflection: float) -> None:
        super().__init__(message)
        self.reason: Reason = reason
        self.force = force
        self.deflection = deflection


@dataclass(frozen=True, slots=True)
class Exact:
    """Reissner's geometrically exact planar beam, as converged as its intervals make it.

    With H and P the force in the beam along the clamp line and along the pull, constant over each
    part, N = H cos theta + P sin theta and Q = P cos theta - H sin theta, stretch lambda and shear
    gamma of the section: x' = lambda cos theta - gamma sin theta, y' = lambda sin theta
    + gamma cos theta, M' = -(lambda Q - gamma N). The grasp may move along the axis and carries no
    moment; the rotation and the moment go through it, P drops by the pull F.

    Law `linear`: N = E A (lambda - 1), Q = G A_s gamma (gamma = 0 without shear), M = E I theta'.
    Law `neo-hooke`: the section is three fibres of the solid with the energy
    W = (G/2) (J^(-2/3) I1 - 3) + (K/2) (J - 1)^2 whose lateral faces are free (`section.Ring`,
    `exact_kernels.fibre`), and shear is part of it.

    Range, for half spans of one diameter and more and grasps from 5 to 95 % of the span, with 40
    intervals (benchmarks/exact_sweep.py): every load that stretches the whole beam up to 2.5 times
    its length. `neo-hooke`, for Poisson's ratios from 0.2: where the grasp is less than half a
    diameter from a clamp, deflections up to 1.1 times that distance (a hollow section gives way
    beyond). `linear` with shear softens beyond a tension of about 0.5 E A and then shears
    sideways instead of turning; that is the law's doing. What a law cannot carry is a
    `BeyondLaw`.

    Attributes
    ----------
    shear
        Whether sections shear; the law `neo-hooke` asks for it.
    law
        Material law.
    intervals
        Intervals between the rotations sought, on each side of the grasp: an even number, 4 or
        more. The error falls with their fourth power.

    Raises
    ------
    ValueError
        If the law is unknown, `neo-hooke` is asked for without shear, or the intervals are odd
        or too few.
    """

    shear: bool = False
    law: Law = "linear"
    intervals: int = 40
    name: ClassVar[str] = "exact"

    def __post_init__(self) -> None:
        if self.law not in get_args(Law):
            raise ValueError(f"law must be one of {', '.join(get_args(Law))}, got {self.law!r}")
        if self.law == "neo-hooke" and not self.shear:
            raise ValueError("shear must be True for the law neo-hooke, of which it is a part")
        if self.intervals < 4 or self.intervals % 2:
            raise ValueError(f"intervals must be even and 4 or more, got {self.intervals}")

    def pull(self, beam: Beam, grasp: float, second: float | None = None) -> "ExactPull":
        """Return a beam at rest, grasped at one or two distances from the first clamp, mm."""
        return ExactPull(self, beam, grasp, second)


class ExactPull(Pull):
    """A beam held in its last equilibrium, from which the next one is found in microseconds.

    A load near the last one is solved from it; one that is far, or that this fails for, by pulling
    the beam up from rest in steps. After a load that it cannot carry the beam is at rest.

    Parameters
    ----------
    theory
        Law and intervals; a second grasp adds half of the intervals.
    beam
        The beam.
    grasp
        Distance of the grasp from the first clamp, mm.
    second
        Distance of a second grasp, farther from that clamp, mm; none when None.

    Attributes
    ----------
    beam, grasp, force, deflection
        As of each `Pull`.

    Raises
    ------
    ValueError
        If a grasp is not between the clamps, or the second not beyond the first.
    """

    def __init__(
        self, theory: Exact, beam: Beam, grasp: float, second: float | None = None
    ) -> None:
        super().__init__(beam, grasp)
        law, intervals = theory.law, theory.intervals
        self._theory = theory
        self._span = beam.span
        self._second = None if second is None else beam.grasped_at(second)[0]
        if self._second is not None and self._second - self.grasp < NEAREST * self._span:
            raise ValueError(
                f"the second grasp must be {NEAREST * self._span:g} mm or more beyond the first, "
                f"at {self.grasp:g} mm, got {self._second:g} mm; two at one place are one"
            )
        central = abs(self.grasp - 0.5 * beam.span) <= 1e-12 * beam.span
        self._half = self._second is None and central and beam.is_symmetric
        self._law = kernels.NEO_HOOKE if law == "neo-hooke" else kernels.LINEAR
        self._part = intervals // 2
        area, second_moment = beam.mean_section
        self._force_unit = beam.modulus * area
        gyration = math.sqrt(second_moment / area) / self._span
        ends = [0.0, 0.5] if self._half else [0.0, self.grasp / self._span, 1.0]
        if self._second is not None:
            ends.insert(2, self._second / self._span)
        self._bounds = np.zeros(1)
        for first, last in itertools.pairwise(ends):
            part = first + _bounds(self._part, last - first, gyration)
            if last == 1.0:  # measured from its clamp, as the first part from its own
                part = 1.0 - _bounds(self._part, last - first, gyration)[::-1]
            self._bounds = np.concatenate([self._bounds, part[1:]])
        self._bounds = _at_steps(self._bounds, self._part, beam)
        count = self._bounds.size - 1
        nodes = np.zeros((kernels.NODE_ROWS, count + 1))
        elements = np.zeros((kernels.ELEMENT_ROWS, count))
        elements[kernels.LENGTH] = np.diff(self._bounds)
        self._line = np.zeros(kernels.LINE_SIZE)
        self._line[kernels.SECOND] = count if self._second is None else 2 * self._part
        points, fibres = self._sections(area)
        self._state = (nodes, elements, points, fibres, self._line)
        self.rest()

    def _sections(self, mean_area: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the kernels' `points` and `fibres` with the sections filled in."""
        lengths = np.diff(self._bounds)
        middles = self._bounds[:-1] + 0.5 * lengths
        at = np.empty(2 * lengths.size)
        at[0::2] = middles - kernels.GAUSS * lengths
        at[1::2] = middles + kernels.GAUSS * lengths
        areas, second_moments, _, shear_areas, offsets = self.beam.sections_at(at * self._span)
        offsets = offsets / self._span
        self._line[kernels.ECCENTRIC] = float(np.any(offsets != 0.0))
        nu = self.beam.poisson_ratio
        if self._law == kernels.LINEAR:
            points = np.zeros((kernels.LINEAR_ROWS, at.size))
            points[kernels.OFFSET] = offsets
            points[kernels.BENDING] = second_moments / (mean_area * self._span**2)
            points[kernels.KK] = points[kernels.BENDING]
            points[kernels.STRETCHING] = mean_area / areas
            if self._theory.shear:
                points[kernels.SHEARING] = 2.0 * (1.0 + nu) * mean_area / shear_areas
            return points, np.zeros((kernels.FIBRE_ROWS, 0))
        shear_modulus = 0.5 / (1.0 + nu)
        self._line[kernels.SHEAR_MODULUS] = shear_modulus
        self._line[kernels.RATIO] = (1.0 - 2.0 * nu) * shear_modulus  # G/(3 K)
        self._line[kernels.SHRINK] = lateral_constant(nu)
        self._line[kernels.POISSON] = nu
        points = np.zeros((kernels.NEO_HOOKE_ROWS, at.size))
        points[kernels.OFFSET] = offsets
        points[kernels.AREA] = areas / mean_area
        constant = self.beam.is_constant
        for i in range(1 if constant else at.size):
            columns = slice(None) if constant else i
            ring = Ring(float(areas[i]), float(second_moments[i]))
            distance, weight = ring.fibres
            coefficient = ring.free_shear_coefficient(nu)
            if self.beam.has_shear_areas:
                coefficient = float(shear_areas[i] / areas[i])
            points[kernels.REACH, columns] = distance / self._span
            points[kernels.WEIGHT, columns] = weight
            points[kernels.DEFICIT, columns] = (1.0 - coefficient) * shear_modulus
        return points, np.zeros((kernels.FIBRE_ROWS, 3 * at.size))

    def rest(self) -> None:
        """Let go of the beam."""
        kernels.rest(self._state, self._law)
        self._read()

    def _read(self) -> None:
        self.force = float(self._line[kernels.FORCE]) * self._force_unit
        self.deflection = float(self._line[kernels.DEFLECTION]) * self._span

    def to_force(self, force: float) -> Self:
        """Find the equilibrium under a whole force of the (first) grasper, N."""
        force = finite(force, "force", "N")
        self._line[kernels.COMPLIANCE] = 0.0
        load = force / self._force_unit
        outcome = kernels.solve(self._state, self._law, self._part, kernels.BY_FORCE, load)
        self._read()
        if outcome != kernels.FOUND:
            raise self._no_equilibrium(outcome, f"force of {force:g} N")
        return self

    def to_deflection(self, deflection: float) -> Self:
        """Find the equilibrium at a displacement of the (first) grasp, mm."""
        deflection = finite(deflection, "deflection", "mm")
        self._line[kernels.COMPLIANCE] = 0.0
        load = deflection / self._span
        outcome = kernels.solve(self._state, self._law, self._part, kernels.BY_DEFLECTION, load)
        self._read()
        if outcome != kernels.FOUND:
            raise self._no_equilibrium(outcome, f"deflection of {deflection:g} mm")
        return self

    def hold(self, first: Hold, second: Hold | None = None) -> Self:
        """Find the equilibrium of a beam that is held at its grasps, one hold for each."""
        if (second is None) != (self._second is None):
            raise ValueError("give one hold for each grasp")
        load, control = self._set(first, kernels.COMPLIANCE)
        if second is None:
            outcome = kernels.solve(self._state, self._law, self._part, control, load)
            words = _words(first)
        else:
            line = self._line
            line[kernels.TARGET_2], line[kernels.CONTROL_2] = self._set(
                second, kernels.COMPLIANCE_2
            )
            outcome = kernels.solve_both(self._state, self._law, self._part, control, load)
            words = f"{_words(first)} with a {_words(second)} at the second grasp"
        self._read()
        if outcome != kernels.FOUND:
            raise self._no_equilibrium(outcome, words)
        return self

    def _set(self, hold: Hold, compliance: int) -> tuple[float, int]:
        """Set the compliance of a grip; return what is prescribed and of which kind."""
        self._line[compliance] = hold.compliance * self._force_unit / self._span
        if hold.kind == "force":
            return hold.amount / self._force_unit, kernels.BY_FORCE
        return hold.amount / self._span, kernels.BY_DEFLECTION

    @property
    def second_force(self) -> float:
        """The second grasper's whole force, N."""
        return float(self._line[kernels.FORCE_2]) * self._force_unit

    @property
    def second_deflection(self) -> float:
        """Displacement of the second grasp along the pull, mm."""
        return float(self._line[kernels.DEFLECTION_2]) * self._span

    @property
    def strain_energy(self) -> float:
        """Strain energy of the beam, N mm."""
        energy = kernels.strain_energy(self._state, self._law, self._part)
        return energy * self._force_unit * self._span * (2.0 if self._half else 1.0)

    def _no_equilibrium(self, outcome: int, load: str) -> BeyondLaw:
        reason, words = REASONS[outcome]
        force = float(self._line[kernels.LAST_FORCE]) * self._force_unit
        deflection = float(self._line[kernels.LAST_DEFLECTION]) * self._span
        return BeyondLaw(
            f"the {self._theory.law} law must carry a {load}: {words}; "
            f"the last equilibrium on the way is at {force:g} N and {deflection:g} mm",
            reason,
            force,
            deflection,
        )

    def sample(self, stations: NDArray[np.float64]) -> Equilibrium:
        """Return the present equilibrium at stations.

        Stresses are nominal, force over area at rest. `linear`: N/A and |M| c/I. `neo-hooke`:
        `normal_stress` is N/A, the mean over the section, and `bending_stress` what the outermost
        fibre has beyond it; their sum is that fibre's first Piola stress along the axis.
        `shear_force` is the force across the turned section. At the grasp the part under the
        larger tension is reported. Where the centroid lies off the axis, `moment` is that about
        the axis and the stresses are those of the moment about the centroid.

        Parameters
        ----------
        stations
            (N,) where to sample it, mm from the first clamp.

        Returns
        -------
        Equilibrium
            The equilibrium.

        Raises
        ------
        BeyondLaw
            If a section between those that the solution is found at gives way.
        """
        at = stations_on(self._span, stations)
        parts = at / self._span
        far = parts > 0.5 if self._half else np.zeros(at.shape, dtype=np.bool_)
        samples = np.zeros((kernels.SAMPLE_ROWS, at.size))
        try:
            kernels.sample(
                self._state,
                self._law,
                self._part,
                self._bounds,
                np.where(far, 1.0 - parts, parts),
                samples,
            )
        except ZeroDivisionError:
            # Between the points that the solution is found at, a section may bear no more strain.
            raise self._no_equilibrium(
                kernels.GIVES_WAY, f"deflection of {self.deflection:g} mm"
            ) from None
        along: NDArray[np.float64] = samples[kernels.ALONG]
        side = np.where(far, -1.0, 1.0)
        areas, second_moments, fibre_distances, _, offsets = self.beam.sections_at(at)
        tension = samples[kernels.TENSION] * self._force_unit
        moment = samples[kernels.BENT] * self._force_unit * self._span
        normal_stress = tension / areas
        if self._law == kernels.LINEAR:
            about_centroid = moment + offsets * tension
            bending_stress = np.abs(about_centroid) * fibre_distances / second_moments
        else:
            outer = self._outer_stress(samples, fibre_distances / self._span)
            bending_stress = np.maximum(outer - normal_stress, 0.0)
        return Equilibrium(
            theory=self._theory.name,
            grasp=self.grasp,
            force=self.force,
            deflection=self.deflection,
            stations=at.copy(),
            along=np.where(far, 1.0 - along, along) * self._span,
            across=samples[kernels.ACROSS] * self._span,
            rotation=samples[kernels.TURN] * side,
            normal_force=tension,
            moment=moment,
            normal_stress=normal_stress,
            bending_stress=bending_stress,
            shear_force=-samples[kernels.TRANSVERSE] * side * self._force_unit,
            strain_energy=self.strain_energy,
        )

    def _outer_stress(
        self, samples: NDArray[np.float64], fibre_distances: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the nominal stress along the axis of the most stretched fibre, MPa."""
        line = self._line
        stresses = np.empty(samples.shape[1])
        for i in range(stresses.size):
            lam, gam = float(samples[kernels.SAMPLE_LAM, i]), float(samples[kernels.SAMPLE_GAM, i])
            lateral = kernels.shrinkage(
                lam, float(line[kernels.SHRINK]), float(line[kernels.POISSON])
            )[0]
            kappa = abs(float(samples[kernels.SAMPLE_KAPPA, i]))
            stretch = lam + kappa * float(fibre_distances[i]) * lateral
            stresses[i] = kernels.fibre_pull(
                stretch, gam, float(line[kernels.SHEAR_MODULUS]), float(line[kernels.RATIO])
            )
        return stresses * self.beam.modulus


def _words(hold: Hold) -> str:
    unit = "N" if hold.kind == "force" else "mm"
    return f"{hold.kind} of {hold.amount:g} {unit}"


def _at_steps(bounds: NDArray[np.float64], count: int, beam: Beam) -> NDArray[np.float64]:
    """Return the bounds drawn so that one of them lies at each step of the sections."""
    # Across a step the curvature jumps, which an element's curve cannot follow. The bounds at the
    # clamps and the grasps, every `count`-th, stay; a part with more steps than bounds is left.
    if beam.is_constant:
        return bounds
    steps = np.unique(beam.key_stations[1:][np.diff(beam.key_stations) == 0.0]) / beam.span
    anchors: list[int] = [0]
    places: list[float] = [0.0]
    for first in range(0, bounds.size - 1, count):
        last = first + count
        inside = steps[(steps > bounds[first]) & (steps < bounds[last])]
        if inside.size < last - first:
            for k, step in enumerate(inside):
                nearest = int(np.argmin(np.abs(bounds - step)))
                anchors.append(min(max(nearest, anchors[-1] + 1), last - inside.size + k))
                places.append(float(step))
        anchors.append(last)
        places.append(float(bounds[last]))
    return np.interp(bounds, bounds[anchors], places)


def _bounds(count: int, length: float, gyration: float) -> NDArray[np.float64]:
    """Return the (count + 1,) ends of the elements of a part, graded towards both its ends."""
    # Graded by tanh, a smooth map of an even mesh, so that the order of the error stays.
    even = np.linspace(-1.0, 1.0, count + 1)
    end_slope = min(LAYER * gyration / length, 1.0)
    steepness = _steepness(end_slope)
    graded = np.tanh(steepness * even) / math.tanh(steepness) if steepness > 0.0 else even
    bounds = 0.5 * length * (1.0 + graded)
    bounds[0], bounds[-1] = 0.0, length
    return bounds


def _steepness(end_slope: float) -> float:
    """Return the b for which tanh(b u)/tanh(b) has that slope at its ends, at most 1."""
    low, high = 0.0, 6.0
    if end_slope >= 1.0:
        return 0.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        slope = 2.0 * middle / math.sinh(2.0 * middle) if middle > 0.0 else 1.0
        low, high = (middle, high) if slope > end_slope else (low, middle)
    return low
