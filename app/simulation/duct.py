"""A session's duct: what is solved, how it answers a grasper from tick to tick, and its tear."""

import math
from dataclasses import dataclass

from app.simulation.dissection import Dissection
from app.simulation.grasped_beam import BeamModel, GraspedBeam
from app.simulation.grasper import Grasper
from app.simulation.tear import Phase, Tear
from physics import BreakEvent, NoEquilibrium, RuptureCheck, Theory

__all__ = ["Duct", "Reading"]

# Part of the span next to each clamp that the clamp's jaws keep from the grasper.
GRASP_MARGIN = 0.1
# Smallest and largest threshold, in thresholds of the preset.
THRESHOLD_RANGE = (0.25, 2.0)


@dataclass(frozen=True, slots=True)
class Reading:
    """What the instruments show after a tick."""

    phase: Phase
    force: float  # whole force of the grasper, N; 0 while a released duct springs back
    deflection: float  # displacement of the grasp, mm; 0 once the duct is in two
    check: RuptureCheck  # highest stress against the threshold; once torn, as at the break
    breaks_at: BreakEvent | None  # load at which the duct would break, or broke; None if it cannot
    deepest: float  # largest deflection of this pull, mm
    # axis at the grasp, mm from the first clamp: along the clamps, lateral, along the pull
    hook: tuple[float, float, float]
    held: bool = False  # by a force or by hand
    by_hand: bool = False  # a hand prescribes the deflection and the beam answers with the force


class Duct:
    """A duct that a grasper pulls, and that tears where the criterion is met.

    `grasp` (mm from the first clamp), `threshold` (MPa) and `model` may be set at any time;
    `grasped`, the beam in equilibrium, takes them over with the next tick.
    """

    def __init__(self, model: BeamModel) -> None:
        self.model = model
        self.grasp = 0.5 * model.dissection.beam.span
        self.threshold = model.threshold
        self.grasped = GraspedBeam(model, self.grasp, self.threshold)
        self.tear: Tear | None = None  # None while the duct is whole
        self.deepest = 0.0  # largest deflection of this pull, mm
        self.came_from = self.grasped.hook()  # the axis at the grasp before the last tick, mm
        self._stale = True

    @property
    def dissection(self) -> Dissection:
        """The organ between its clamps."""
        return self.model.dissection

    @property
    def theory(self) -> Theory:
        """The theory that solves it."""
        return self.model.theory

    @property
    def force_limit(self) -> float:
        """Largest force that the grasper exerts, N."""
        return self.model.force_limit

    @property
    def deflection_limit(self) -> float:
        """Largest deflection that a hand can prescribe, mm."""
        return self.grasped.deflection_limit

    @property
    def grasp_range(self) -> tuple[float, float]:
        """Smallest and largest grasp, mm from the first clamp."""
        span = self.dissection.beam.span
        return GRASP_MARGIN * span, (1.0 - GRASP_MARGIN) * span

    @property
    def threshold_range(self) -> tuple[float, float]:
        """Smallest and largest threshold, MPa."""
        low, high = THRESHOLD_RANGE
        return low * self.model.threshold, high * self.model.threshold

    def accepts(self, value: float) -> bool:
        """Return whether a number can be an input now: a torn duct takes none."""
        return self.tear is None and math.isfinite(value)

    def moves_under(self, grasper: Grasper) -> bool:
        """Return whether the next tick will change something."""
        if self.tear is not None:
            return not self.tear.settled
        return self._stale or not grasper.at_rest or self._settings_changed

    def solve_by(self, model: BeamModel, grasper: Grasper) -> None:
        """Go on by another theory with its threshold, under what it carries of the load."""
        self.model, self.threshold = model, model.threshold
        grasper.target_force = min(grasper.target_force, model.force_limit)
        if grasper.mode == "force":
            grasper.force = min(grasper.force, model.force_limit)
        self.deepest = 0.0
        self._take_settings(grasper)

    def reset(self) -> None:
        """Make the duct whole."""
        self.tear, self.deepest = None, 0.0
        self._stale = True

    def renew(self) -> None:
        """Make a duct at rest solve from the start again.

        A solver starts from its last solution, which shows in the last bits of the next one. A run
        must depend on its inputs alone, so it begins with a beam that has solved nothing.
        """
        if self._settings_changed:
            self.grasped = GraspedBeam(self.model, self.grasp, self.threshold)
        else:
            self.grasped = self.grasped.renewed()
        self._stale = True

    def touch(self) -> None:
        """Have the next tick solve and draw even without a new input."""
        self._stale = True

    def advance(self, grasper: Grasper) -> bool:
        """Advance by one tick under a grasper; return whether anything has changed."""
        if self.tear is not None:
            if self.tear.settled:
                return False
            self.tear.advance()
            if self.tear.phase is Phase.TORN:
                grasper.reset()
            return True
        if self._settings_changed:
            if self.grasp != self.grasped.grasp:
                self.deepest = 0.0
            self._take_settings(grasper)
        self.came_from = self.grasped.hook()
        if grasper.at_rest and not self._stale:
            return False
        self._stale = False
        deepest, before = self.deepest, (grasper.force, grasper.deflection)
        try:
            self.grasped.solve(grasper.advance(self.model.force_per_second))
        except NoEquilibrium:  # beyond the theory's range: stay at the last equilibrium
            grasper.stop_at(*before)
            return True
        self._respond(grasper)
        if self.grasped.check.broken and grasper.mode != "free":  # a released duct cannot tear
            self._tear(grasper, before, deepest)
        return True

    def reading(self, grasper: Grasper) -> Reading:
        """Return what the instruments show now."""
        tear, beam = self.tear, self.grasped
        phase, shown = Phase.INTACT, 1.0
        force, breaks_at = grasper.grip_force, beam.breaks_at
        if tear is not None:
            phase, breaks_at = tear.phase, tear.event
            shown = 1.0 if phase is Phase.TEARING else 0.0
            force = shown * tear.event.force
        return Reading(
            phase=phase,
            force=force,
            deflection=shown * beam.pulled.deflection,
            check=beam.check,
            breaks_at=breaks_at,
            deepest=self.deepest,
            hook=beam.hook(shown),
            held=grasper.holds,
            by_hand=grasper.mode == "hand",
        )

    @property
    def _settings_changed(self) -> bool:
        return self.grasp != self.grasped.grasp or self.threshold != self.grasped.threshold

    def _take_settings(self, grasper: Grasper) -> None:
        """Solve at the present settings; without an equilibrium, ease the load."""
        self.grasped = GraspedBeam(self.model, self.grasp, self.threshold)
        self._stale = True
        load = grasper.load
        while True:
            try:
                self.grasped.solve(load)
            except NoEquilibrium:
                load = grasper.ease()
            else:
                self._respond(grasper)
                return

    def _respond(self, grasper: Grasper) -> None:
        pulled = self.grasped.pulled
        grasper.update_response(pulled.force, pulled.deflection)
        self.deepest = max(self.deepest, pulled.deflection)

    def _tear(self, grasper: Grasper, before: tuple[float, float], deepest: float) -> None:
        """Tear at the load that met the criterion, between the last tick's and this one's."""
        beam, event = self.grasped, self.grasped.breaks_at
        if event is not None:
            force, deflection = before
            grasper.force = min(max(event.force, force), grasper.force)
            grasper.deflection = min(max(event.deflection, deflection), grasper.deflection)
        beam.solve(grasper.load)
        self.deepest = deepest
        self._respond(grasper)
        self.tear = Tear(BreakEvent(grasper.force, beam.pulled.deflection, beam.check))
