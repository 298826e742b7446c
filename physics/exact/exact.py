"""The geometrically exact beam: large rotations, true stretch, shear, two material laws."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray

from kernel_cache import njit
from physics.beam import Beam
from physics.equilibrium import Equilibrium, NoEquilibrium
from physics.exact import many, newton, sampling
from physics.exact import symbols as at
from physics.exact.fibre_laws import Exponential, NeoHooke
from physics.exact.linear_law import Linear
from physics.exact.mesh import element_bounds
from physics.exact.points import fill_points
from physics.exact.state import KERNEL, Array, State, new_state
from physics.pull import Pull
from physics.quantity import finite, stations_on
from physics.rupture import BreakEvent, check_rupture, critical_stations

Law = Linear | NeoHooke | Exponential
"""What a section's forces are at its strains."""

Reason = Literal["lost", "unstable", "gives way", "squeezed", "out of reach"]
"""Why there is no equilibrium; see `BeyondLaw`."""

REASONS: dict[int, tuple[Reason, str]] = {
    at.LOST: ("lost", "no equilibrium was found near the last one, however small the step"),
    at.UNSTABLE: ("unstable", "the equilibrium there would not stay, its energy can fall"),
    at.NO_STIFFNESS: ("gives way", "a section has no stiffness left in stretch and shear"),
    at.SQUEEZED: (
        "squeezed",
        f"a fibre would be squeezed to less than {at.LEAST_STRETCH:g} of its length",
    ),
    at.OUT_OF_REACH: (
        "out of reach",
        f"it lies beyond a deflection of {at.FARTHEST:g} spans",
    ),
}

# Distance of two grasps, in spans, below which they count as one.
NEAREST = 1e-3


@dataclass(frozen=True, slots=True)
class Hold:
    """What a grasper imposes where it holds the beam."""

    # the grasper's whole force, or the place that it is led to
    kind: Literal["force", "deflection"]
    amount: float  # N or mm
    compliance: float = 0.0  # of the grip, for a deflection, mm/N; 0 is rigid

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
        `lost`: no equilibrium near the last one; `unstable`: its energy can fall; `gives way`: a
        section has no stiffness left; `squeezed`: a fibre has no length left; `out of reach`: no
        deflection meets the force.
    force, deflection
        The grasper's force, N, and the grasp's displacement, mm, at the last equilibrium.
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

    Range, for half spans of one diameter and more and grasps from 5 to 95 % of the span, with 40
    intervals (benchmarks/exact_sweep.py): every load that stretches the whole beam up to 2.5 times
    its length. `NeoHooke`, for Poisson's ratios from 0.2: where the grasp is less than half a
    diameter from a clamp, deflections up to 1.1 times that distance (a hollow section gives way
    beyond). `Linear` with shear softens beyond a tension of about 0.5 E A and then shears
    sideways instead of turning; that is the law's doing. Its highest stress may fall on the way
    from some 0.7 E on: a break is where a threshold is first reached. What a law cannot carry is
    a `BeyondLaw`.

    `intervals` lie between the rotations sought on each side of the grasp, an even number from 4;
    the error falls with their fourth power.

    Examples
    --------
    >>> duct = Beam.round(span=50.8, diameter=8.89, modulus=0.310264)
    >>> round(Exact().pull(duct, grasp=25.4).to_force(3.0).deflection, 2)
    10.8
    """

    law: Law = field(default_factory=Linear)
    intervals: int = 40
    name: ClassVar[str] = "exact"
    takes_all_sections: ClassVar[bool] = True

    def __post_init__(self) -> None:
        if self.intervals < 4 or self.intervals % 2:
            raise ValueError(f"intervals must be even and 4 or more, got {self.intervals}")

    @property
    def options(self) -> Mapping[str, object]:
        """What `theory_named` takes beside the name."""
        return {"shear": self.law.shear, "law": self.law.name, **asdict(self.law)}

    def pull(self, beam: Beam, grasp: float, second: float | None = None) -> "ExactPull":
        """Return a beam at rest, grasped at one or two distances from the first clamp, mm."""
        return ExactPull(self, beam, grasp, second)


class ExactPull(Pull):
    """A beam held in its last equilibrium, from which the next one is found in microseconds.

    A load near the last one is solved from it; one that is far, or that this fails for, by pulling
    the beam up from rest in steps. After a load that it cannot carry the beam is at rest. A
    `second` grasp, mm from the first clamp, lies beyond the first and adds half of the intervals.
    """

    def __init__(
        self, theory: Exact, beam: Beam, grasp: float, second: float | None = None
    ) -> None:
        super().__init__(beam, grasp)
        self._theory = theory
        self.softens = theory.law.shear and second is None
        self._span = beam.span
        self._second = None if second is None else beam.grasped_at(second)[0]
        if self._second is not None and self._second - self.grasp < NEAREST * self._span:
            raise ValueError(
                f"the second grasp must be {NEAREST * self._span:g} mm or more beyond the first, "
                f"at {self.grasp:g} mm, got {self._second:g} mm; two at one place are one"
            )
        central = abs(self.grasp - 0.5 * beam.span) <= 1e-12 * beam.span
        self._half = self._second is None and central and beam.is_symmetric
        self._per_piece = theory.intervals // 2
        area, _ = beam.mean_section
        self._force_unit = beam.modulus * area
        ends = [0.0, 0.5] if self._half else [0.0, self.grasp / self._span, 1.0]
        if self._second is not None:
            ends.insert(2, self._second / self._span)
        self._bounds = element_bounds(beam, ends, self._per_piece)
        lengths = np.diff(self._bounds)
        count = lengths.size
        law = theory.law
        self._state, self._fibres = new_state(count, law.point_rows, law.fibre_rows)
        # Half a symmetric beam has no grasp inside it.
        self._grasp = None if self._half else self._per_piece
        _, elements, _, self._line, _, _ = self._state
        elements[at.LENGTH] = lengths
        line = self._line
        line[at.SECOND] = count if self._second is None else 2 * self._per_piece
        pieces = lengths[: self._per_piece], lengths[self._per_piece :]
        # One after the other, as each piece is as long as its elements to the last digit.
        line[at.SHORTER_PIECE] = min(float(np.cumsum(piece)[-1]) for piece in pieces if piece.size)
        law.fill(self._state, beam, self._bounds)
        self.rest()

    def rest(self) -> None:
        """Let go of the beam."""
        newton.rest(self._state, self._fibres)
        self._read()

    def _read(self) -> None:
        self.force = float(self._line[at.FORCE]) * self._force_unit
        self.deflection = float(self._line[at.DEFLECTION]) * self._span

    def to_force(self, force: float) -> Self:
        """Find the equilibrium under a whole force of the (first) grasper, N."""
        force = finite(force, "force", "N")
        if self._second is not None:
            return self.hold(Hold("force", force), Hold("force", 0.0))
        self._line[at.COMPLIANCE] = 0.0
        load = force / self._force_unit
        outcome = newton.solve(self._state, self._fibres, self._grasp, at.BY_FORCE, load)
        self._read()
        if outcome != at.FOUND:
            raise self._no_equilibrium(outcome, f"force of {force:g} N")
        return self

    def to_deflection(self, deflection: float) -> Self:
        """Find the equilibrium at a displacement of the (first) grasp, mm."""
        deflection = finite(deflection, "deflection", "mm")
        if self._second is not None:
            return self.hold(Hold("deflection", deflection), Hold("force", 0.0))
        self._line[at.COMPLIANCE] = 0.0
        load = deflection / self._span
        outcome = newton.solve(self._state, self._fibres, self._grasp, at.BY_DEFLECTION, load)
        self._read()
        if outcome != at.FOUND:
            raise self._no_equilibrium(outcome, f"deflection of {deflection:g} mm")
        return self

    def hold(self, first: Hold, second: Hold | None = None) -> Self:
        """Find the equilibrium of a beam that is held at its grasps, one hold for each."""
        if (second is None) != (self._second is None):
            raise ValueError("give one hold for each grasp")
        load, control = self._set(first, at.COMPLIANCE)
        if second is None:
            outcome = newton.solve(self._state, self._fibres, self._grasp, control, load)
            words = _words(first)
        else:
            line = self._line
            line[at.TARGET_2], line[at.CONTROL_2] = self._set(second, at.COMPLIANCE_2)
            outcome = newton.solve_both(
                self._state, self._fibres, self._per_piece, 2 * self._per_piece, control, load
            )
            words = f"{_words(first)} with a {_words(second)} at the second grasp"
        self._read()
        if outcome != at.FOUND:
            raise self._no_equilibrium(outcome, words)
        return self

    def lift(self, deflection: float, compliance: float) -> tuple[float, float, float]:
        """Hold by one grip in one compiled call; return force, deflection and strain energy."""
        # `deflection`, mm, is that of the grip, of a `compliance`, mm/N.
        self._line[at.COMPLIANCE] = compliance * self._force_unit / self._span
        outcome, energy = _lift(
            self._state, self._fibres, self._grasp, self._per_piece, deflection / self._span
        )
        self._read()
        if outcome != at.FOUND:
            raise self._no_equilibrium(outcome, f"deflection of {deflection:g} mm")
        return self.force, self.deflection, self._energy(energy)

    def solve_loads(
        self, limits: NDArray[np.float64], loads: NDArray[np.float64], *, by_force: bool
    ) -> NDArray[np.float64]:
        """Return (SOLVED_ROWS, N) breaks and loads of beams like this one, as `many` has them."""
        # `limits` are thresholds over the modulus, `loads` forces over modulus and mean area or
        # deflections over the span; nan: none. Each beam starts from rest.
        # Of equal stresses the last one counts, that nearest the grasp.
        stations = critical_stations(self.beam, self.grasp)
        stations = stations[np.argsort(-np.abs(stations - self.grasp), kind="stable")]
        if self._half:
            stations = stations[stations <= 0.5 * self._span]
        sections = self.beam.sections_at(stations, shear_areas=False)
        area = self.beam.mean_section[0]
        rows = np.zeros((many.SECTION_ROWS, stations.size))
        rows[many.OVER_AREA] = area / sections.areas
        rows[many.OUTER] = sections.fibre_distances / self._span
        rows[many.SECOND_MOMENT] = sections.second_moments / (area * self._span**2)
        rows[many.OFF_AXIS] = sections.offsets / self._span
        ducts = np.zeros((many.DUCT_ROWS, limits.size))
        ducts[many.GRASP] = self.grasp / self._span
        ducts[many.REACH_OUT] = self.beam.fibre_distance / self._span
        ducts[many.LIMIT], ducts[many.LOAD] = limits, loads
        self._line[at.COMPLIANCE] = 0.0
        return many.solve_exact_beam(
            self._state,
            self._fibres,
            self._grasp,
            self._bounds,
            stations / self._span,
            rows,
            ducts,
            by_force=by_force,
        )

    def first_break(self, threshold: float) -> BreakEvent | None:
        """Find the first load at which the stress reaches a threshold, MPa; None if none does."""
        limits = np.array([threshold / self.beam.modulus])
        solved = self.solve_loads(limits, np.array([np.nan]), by_force=False)[:, 0]
        force, deflection = (solved[:2] * [self._force_unit, self._span]).tolist()
        if math.isnan(force):
            self.rest()
            return None
        pulled = self.to_deflection(deflection).sample(critical_stations(self.beam, self.grasp))
        return BreakEvent(force, deflection, check_rupture(pulled, threshold))

    def _set(self, hold: Hold, compliance: int) -> tuple[float, int]:
        """Set the compliance of a grip; return what is prescribed and of which kind."""
        self._line[compliance] = hold.compliance * self._force_unit / self._span
        if hold.kind == "force":
            return hold.amount / self._force_unit, at.BY_FORCE
        return hold.amount / self._span, at.BY_DEFLECTION

    @property
    def second_force(self) -> float:
        """The second grasper's whole force, N."""
        return float(self._line[at.FORCE_2]) * self._force_unit

    @property
    def second_deflection(self) -> float:
        """Displacement of the second grasp along the pull, mm."""
        return float(self._line[at.DEFLECTION_2]) * self._span

    @property
    def strain_energy(self) -> float:
        """Strain energy of the beam, N mm."""
        self._fill_points()
        return self._energy(sampling.strain_energy(self._state, self._fibres, self._per_piece))

    def _energy(self, energy: float) -> float:
        return energy * self._force_unit * self._span * (2.0 if self._half else 1.0)

    def _fill_points(self) -> None:
        fill_points(self._state, self._fibres, self._per_piece, 4)

    def _no_equilibrium(self, outcome: int, load: str) -> BeyondLaw:
        reason, words = REASONS[outcome]
        force = float(self._line[at.LAST_FORCE]) * self._force_unit
        deflection = float(self._line[at.LAST_DEFLECTION]) * self._span
        return BeyondLaw(
            f"the {self._theory.law.name} law must carry a {load}: {words}; "
            f"the last equilibrium on the way is at {force:g} N and {deflection:g} mm",
            reason,
            force,
            deflection,
        )

    def sample(self, stations: NDArray[np.float64]) -> Equilibrium:
        """Return the present equilibrium at (N,) stations, mm from the first clamp.

        Stresses are nominal, force over area at rest. `Linear`: N/A and |M| c/I. `NeoHooke`:
        `normal_stress` is N/A, the mean over the section, and `bending_stress` what the outermost
        fibre has beyond it; their sum is that fibre's first Piola stress along the axis.
        `shear_force` is the force across the turned section. At the grasp the part under the
        larger tension is reported. Where the centroid lies off the axis, `moment` is that about
        the axis and the stresses are those of the moment about the centroid.

        Returns
        -------
        Equilibrium
            (N,) each.

        Raises
        ------
        BeyondLaw
            If a section between those that the solution is found at gives way.
        """
        places = stations_on(self._span, stations)
        fractions = places / self._span
        far = fractions > 0.5 if self._half else np.zeros(places.shape, dtype=np.bool_)
        folded = np.where(far, 1.0 - fractions, fractions)
        samples = np.zeros((sampling.SAMPLE_ROWS, places.size))
        self._fill_points()
        ends = np.zeros((2, self._bounds.size))
        if not sampling.sample(
            self._state, self._fibres, self._per_piece, self._bounds, folded, ends, samples
        ):
            raise self._no_equilibrium(at.NO_STIFFNESS, f"deflection of {self.deflection:g} mm")
        along: NDArray[np.float64] = samples[sampling.ALONG]
        side = np.where(far, -1.0, 1.0)
        sections = self.beam.sections_at(places, shear_areas=False)
        tension = samples[sampling.TENSION] * self._force_unit
        moment = samples[sampling.BENT] * self._force_unit * self._span
        bending_stress = self._theory.law.bending_stress(
            self.beam, sections, tension, moment, samples[sampling.SAMPLE_LAM :]
        )
        return Equilibrium(
            theory=self._theory.name,
            grasp=self.grasp,
            force=self.force,
            deflection=self.deflection,
            stations=places.copy(),
            along=np.where(far, 1.0 - along, along) * self._span,
            across=samples[sampling.ACROSS] * self._span,
            rotation=samples[sampling.TURN] * side,
            normal_force=tension,
            moment=moment,
            normal_stress=tension / sections.areas,
            bending_stress=bending_stress,
            shear_force=-samples[sampling.TRANSVERSE] * side * self._force_unit,
            strain_energy=self.strain_energy,
        )


@njit(nogil=True, **KERNEL)
def _lift(
    state: State, fibres: Array | None, grasp: int | None, grasp_node: int, target: float
) -> tuple[int, float]:
    """Solve for a deflection; return the outcome and the strain energy."""
    outcome = newton.solve(state, fibres, grasp, at.BY_DEFLECTION, target)
    if outcome != at.FOUND:
        return outcome, 0.0
    fill_points(state, fibres, grasp_node, int(4))
    return outcome, sampling.strain_energy(state, fibres, grasp_node)


def _words(hold: Hold) -> str:
    unit = "N" if hold.kind == "force" else "mm"
    return f"{hold.kind} of {hold.amount:g} {unit}"
