"""The beam of a dissection by one theory, and its equilibria with the grasper at one place."""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from app.simulation.inputs.grasper import Load
from app.simulation.specimen.dissection import Dissection
from physics import (
    Beam,
    BreakEvent,
    NoEquilibrium,
    Theory,
    break_of,
    check_rupture,
    critical_stations,
)

# Largest force over the force at break at mid-span: off-centre a duct takes more to tear.
FORCE_RANGE = 1.5
# s in which the grasper's force can grow from zero to the force at break.
RAMP_SECONDS = 0.75
# For a duct that cannot break, the range of forces ends at this deflection over the span.
BOUNDLESS_DEFLECTION = 1.0
PAST_BREAK = 1.15
"""A hand, or a curve, goes up to this deflection over the deflection at break."""


@dataclass(frozen=True, slots=True, eq=False)
class BeamModel:
    """A dissection, its theory and its threshold: built whole before a session switches to it.

    So a theory or preset that is refused leaves the session as it was.
    """

    dissection: Dissection
    theory: Theory
    threshold: float  # the preset's for this theory, MPa
    break_force: float  # N, at mid-span; the largest force of the range if the duct cannot break

    @classmethod
    def of(cls, dissection: Dissection, theory: Theory) -> Self:
        """Return the model, or raise `NoEquilibrium` where the theory ends before the break."""
        beam = dissection.beam
        threshold = dissection.preset.threshold(theory, beam)
        middle = 0.5 * beam.span
        event = break_of(theory.pull(beam, middle), threshold)
        force = (
            _farthest_force(theory, beam, middle) / FORCE_RANGE if event is None else event.force
        )
        return cls(dissection, theory, threshold, force)

    @property
    def force_limit(self) -> float:
        """Largest force that the grasper exerts, N."""
        return _rounded_up(FORCE_RANGE * self.break_force)

    @property
    def force_per_second(self) -> float:
        """Rate at which the grasper's force grows, N/s."""
        return self.break_force / RAMP_SECONDS


class GraspedBeam:
    """A model's beam grasped at one place, in its last equilibrium.

    To the bit, the equilibrium is a function of the constructor's arguments and of the loads solved
    so far: a solver may start from its last solution. `grasp` is in mm from the first clamp,
    `threshold` in MPa. `pulled` is the last equilibrium sampled at all `stations`, `driven` the
    same at the driving points only, `check` the highest stress against the threshold.
    """

    def __init__(self, model: BeamModel, grasp: float, threshold: float) -> None:
        self.model, self.grasp, self.threshold = model, grasp, threshold
        dissection = model.dissection
        driving = dissection.beam_stations
        critical = critical_stations(dissection.beam, grasp)
        self._driving, self._critical = slice(0, driving.size), slice(driving.size, None)
        # (N,) mm: the driving points, then wherever the stress can be highest
        self.stations = np.concatenate([driving, critical])
        self._grasped = driving.size + int(np.searchsorted(critical, grasp))
        along, sideways, up = dissection.in_frame(dissection.axis_point(grasp)).tolist()
        self._rest = float(along), float(sideways), float(up)
        self._breaks_at: BreakEvent | None = None
        self._break_known = False
        self._pull = model.theory.pull(dissection.beam, grasp)
        self.solve(Load("force", 0.0))

    def renewed(self) -> "GraspedBeam":
        """Return the same beam at rest, as if never pulled; its break is not solved again."""
        beam = GraspedBeam(self.model, self.grasp, self.threshold)
        beam._breaks_at, beam._break_known = self._breaks_at, self._break_known
        return beam

    def solve(self, load: Load) -> None:
        """Find the equilibrium under a load; keep the last one on a `NoEquilibrium`."""
        if load.kind == "force":
            pulled = self._pull.to_force(load.amount).sample(self.stations)
        else:
            pulled = self._pull.to_deflection(load.amount).sample(self.stations)
        self.pulled = pulled
        self.driven = pulled.subset(self._driving)
        self.check = check_rupture(pulled.subset(self._critical), self.threshold)

    @property
    def breaks_at(self) -> BreakEvent | None:
        """Load at which the duct would break; None if it cannot."""
        if not self._break_known:
            self._breaks_at, self._break_known = self.load_at(1.0), True
        return self._breaks_at

    def load_at(self, fraction: float) -> BreakEvent | None:
        """Return the load at a stress of `part` thresholds; None where the theory ends before."""
        beam = self.model.dissection.beam
        return break_of(self.model.theory.pull(beam, self.grasp), fraction * self.threshold)

    @property
    def deflection_limit(self) -> float:
        """Largest deflection that a hand can prescribe, mm."""
        event = self.breaks_at
        if event is None:
            return BOUNDLESS_DEFLECTION * self.model.dissection.beam.span
        return PAST_BREAK * event.deflection

    @property
    def rest_height(self) -> float:
        """Height of the axis at the grasp at rest, mm along the pull."""
        return self._rest[2]

    def hook(self, fraction: float = 1.0) -> tuple[float, float, float]:
        """Return where the axis at the grasp is, by a part of the way (`Reading.hook`)."""
        x, y, z = self._rest
        slide = float(self.pulled.along[self._grasped]) - self.grasp
        return x + fraction * slide, y, z + fraction * self.pulled.deflection

    def deflection_at(self, station: float) -> float:
        """Return the displacement of the axis along the pull at a station, both in mm."""
        if station == self.grasp:
            return self.pulled.deflection
        return float(np.interp(station, self.driven.stations, self.driven.across))

    def curve(
        self, count: int, *, deepest: float = 0.0
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return (count,) deflections, mm, and forces, N, past the break and past `deepest`, mm."""
        # Fewer than `count` where the theory ends.
        last = max(self.deflection_limit, PAST_BREAK * deepest)
        deflections = np.linspace(0.0, last, count)
        pull = self.model.theory.pull(self.model.dissection.beam, self.grasp)
        forces: list[float] = []
        try:
            forces.extend(pull.to_deflection(each).force for each in deflections.tolist())
        except NoEquilibrium:
            deflections = deflections[: len(forces)]
        return deflections, np.array(forces)


def _farthest_force(theory: Theory, beam: Beam, grasp: float) -> float:
    """Return the force at a deflection that no duct needs, or where the theory ends, N."""
    deflection = BOUNDLESS_DEFLECTION * beam.span
    while True:
        try:
            return theory.pull(beam, grasp).to_deflection(deflection).force
        except NoEquilibrium:
            deflection *= 0.8


def _rounded_up(value: float) -> float:
    """Return the value rounded up to two digits, for the end of a scale."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return math.ceil(value / unit) * unit
