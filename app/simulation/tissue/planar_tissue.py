"""A free duct in the plane of its pull: solved by a theory under one grasper, tick by tick."""

import contextlib
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from app.simulation.exercises.exercise import Exercise
from app.simulation.inputs.grasper import Grasper, Load
from app.simulation.inputs.hand import Hand
from app.simulation.inputs.inputs import Applied, InputKind, Instrument, TheoryChoice
from app.simulation.runs.run_file import RunStart
from app.simulation.specimen.comparison import Ghost, GhostReading, SwingingChain
from app.simulation.specimen.dissection import Dissection
from app.simulation.specimen.drawn_duct import DrawnDuct
from app.simulation.specimen.grasped_beam import BeamModel, GraspedBeam
from app.simulation.specimen.specimen import THRESHOLD_RANGE, Specimen
from app.simulation.specimen.tear import Phase, Tear
from app.simulation.tissue.reading import Reading, Vector
from organ_geometry.mesh import Skin
from physics import BreakEvent, Cubic, NoEquilibrium, RuptureCheck, Theory

# There is one hand, at one tube.
HAND = TUBE = 0
# Part of the span next to each clamp that the clamp's jaws keep from the grasper.
GRASP_MARGIN = 0.1


class PlanarTissue:
    """A duct that a grasper pulls, and that tears where the criterion is met.

    `grasp` (mm from the first clamp), `threshold` (MPa) and `model` may be set at any time;
    `grasped`, the beam in equilibrium, takes them over with the next tick. Beside it there may be
    the `ghost` of another theory and a `chain` of masses and springs.
    """

    def __init__(self, specimen: Specimen, model: BeamModel | None = None) -> None:
        theory = Cubic() if specimen.theory is None else specimen.theory
        model = model or BeamModel.of(specimen.dissection, theory)
        self._specimen, self.model = specimen, model
        self.grasper = Grasper()
        self.grasp = 0.5 * model.dissection.beam.span
        self.threshold = model.threshold
        self.grasped = GraspedBeam(model, self.grasp, self.threshold)
        self.tear: Tear | None = None  # None while the duct is whole
        self.deepest = 0.0  # largest deflection of this pull, mm
        self.came_from = self.grasped.hook()  # the axis at the grasp before the last tick, mm
        self.regrasped = False  # whether the last tick took another place
        self._stale = True
        self._ghost: Ghost | None = None
        self._chain: SwingingChain | None = None
        self._task_grasp: float | None = None
        self._goal: tuple[Exercise, GraspedBeam, tuple[float, float] | None] | None = None
        if specimen.threshold_MPa is not None:
            self.threshold = specimen.threshold_MPa
            self.grasped = GraspedBeam(model, self.grasp, self.threshold)

    @property
    def specimen(self) -> Specimen:
        """What it is, with the present theory."""
        if self._specimen.theory is not self.model.theory:
            self._specimen = replace(self._specimen, theory=self.model.theory)
        return self._specimen

    @property
    def torn(self) -> RuptureCheck | None:
        """Where and under what the wall has torn, or None."""
        return None if self.tear is None else self.tear.event.check

    @property
    def instruments(self) -> tuple[Instrument, ...]:
        """What its hand has."""
        return ("hook",)

    @property
    def over(self) -> bool:
        """Whether it has torn."""
        return self.tear is not None

    def tear_of(self, tube: int) -> RuptureCheck | None:
        """Return where and under what it has torn, or None."""
        return self.torn

    @property
    def dissection(self) -> Dissection:
        """The organ between its clamps."""
        return self.model.dissection

    @property
    def in_plane(self) -> Self:
        """Itself, solved by its theory."""
        return self

    @property
    def in_space(self) -> None:
        """Nothing: a theory of the plane has no beam in space."""

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
    def own_threshold(self) -> float:
        """The threshold of the preset by the theory, MPa."""
        return self.model.threshold

    @property
    def threshold_range(self) -> tuple[float, float]:
        """Smallest and largest threshold, MPa."""
        low, high = THRESHOLD_RANGE
        return low * self.model.threshold, high * self.model.threshold

    @property
    def hands(self) -> tuple[Hand, ...]:
        """The one hand, whose hook is around the duct at the grasp until it is in two."""
        whole = self.tear is None or self.tear.phase is Phase.TEARING
        hand = Hand("hook", np.array(self.grasped.hook(float(whole))))
        hand.node = 0 if whole else None
        return (hand,)

    @property
    def moving(self) -> bool:
        """Whether the next tick will change something."""
        if self.tear is not None:
            return not self.tear.settled
        return self._stale or not self.grasper.at_rest or self._settings_changed

    # Inputs

    def apply(
        self, hand: int, kind: InputKind, values: tuple[float, ...], begin: Callable[[], bool]
    ) -> Applied | None:
        """Apply an input of the one hand; return it as it has acted, or None."""
        if hand != HAND or not all(map(math.isfinite, values)):
            return None
        if kind == "release":
            return ("release", ()) if self.tear is None and self.grasper.release() else None
        if self.tear is not None:
            return None
        if kind == "move":  # what holds the duct moves in the plane of the pull
            kind, values = "lift", (values[2] - self.grasped.rest_height,)
        value = values[-1] if values else 0.0
        if kind == "grab":
            begin()
            self.grasp = _within(value, self.grasp_range)
            self.grasper.grab(max(0.0, self.grasped.deflection_at(self.grasp)))
            return "grab", (TUBE, self.grasp)
        if kind == "lift":
            value = _within(value, (0.0, self.deflection_limit))
            return ("lift", (value,)) if self.grasper.move_hand(value) else None
        if kind == "force":
            if value > 0.0:
                begin()
            value = _within(value, (0.0, self.force_limit))
            return ("force", (value,)) if self.grasper.set_target_force(value) else None
        if kind == "grasp":
            value = _within(value, self.grasp_range)
            return ("grasp", (value,)) if self.hold_at(value) else None
        if kind == "threshold":
            value = _within(value, self.threshold_range)
            if value != self.threshold:
                self.threshold = value
                return "threshold", (value,)
        return None

    def hold_at(self, grasp: float) -> bool:
        """Move the grasp to a place, mm; return whether it is another."""
        if grasp == self.grasp:
            return False
        self.grasp = grasp
        self.grasper.regrasp(self.grasped.deflection_at(grasp))
        return True

    def solve_by(self, model: BeamModel) -> None:
        """Go on by another theory with its threshold, under what it carries of the load."""
        self.model, self.threshold = model, model.threshold
        grasper = self.grasper
        grasper.target_force = min(grasper.target_force, model.force_limit)
        if grasper.mode == "force":
            grasper.force = min(grasper.force, model.force_limit)
        self.deepest = 0.0
        self._take_settings()

    def prepare(self, exercise: Exercise | None) -> None:
        """Make the duct whole and release it; the grasp goes back to the last exercise's."""
        self.tear, self.deepest = None, 0.0
        self._stale = True
        self.grasper.reset()
        if self._task_grasp is not None:
            self.hold_at(self._task_grasp)
            self._task_grasp = None
        if exercise is not None:
            self._task_grasp = self.grasp

    def renew(self) -> list[tuple[int, Applied]]:
        """Make a duct at rest solve from the start again."""
        # A solver starts from its last solution, which shows in the last bits of the next one.
        if self._settings_changed:
            self.grasped = GraspedBeam(self.model, self.grasp, self.threshold)
        else:
            self.grasped = self.grasped.renewed()
        self._stale = True
        return []

    def held_place(self, hand: int) -> Vector | None:
        """Return where the hand holds the duct, mm, or None."""
        if hand != HAND or self.grasper.mode != "hand":
            return None
        x, y, _ = self.grasped.hook()
        return x, y, self.grasped.rest_height + self.grasper.deflection

    def stop(self) -> None:
        """Leave the hand where it is."""
        if self.tear is None and self.grasper.holds:
            self.grasper.stop_at(self.grasper.force, self.grasper.deflection)

    def advance(self) -> bool:
        """Advance by one tick; return whether anything has changed."""
        whole, grasp = self.tear is None, self.grasped.grasp
        moved = self._advance()
        changed = moved
        if whole:
            self.regrasped = self.grasped.grasp != grasp
            if self._ghost is not None and moved:
                self._ghost.follow(self.grasped.grasp, self.grasper.load)
            if self._chain is not None:
                if self._chain.grasp != self.grasped.grasp:
                    self._chain = self._new_chain()
                free = self.grasper.mode == "free"
                changed |= self._chain.advance(Load("force", 0.0) if free else self.grasper.load)
        return changed

    def _advance(self) -> bool:
        grasper = self.grasper
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
            self._take_settings()
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
        self._respond()
        if self.grasped.check.broken and grasper.mode != "free":  # a released duct cannot tear
            self._tear(before, deepest)
        return True

    # What is shown

    def reading(self) -> Reading:
        """Return what the instruments show now."""
        tear, beam, grasper = self.tear, self.grasped, self.grasper
        phase, shown = Phase.INTACT, 1.0
        force, breaks_at = grasper.grip_force, beam.breaks_at
        if tear is not None:
            phase, breaks_at = tear.phase, tear.event
            shown = 1.0 if phase is Phase.TEARING else 0.0
            force = shown * tear.event.force
        check = beam.check
        return Reading(
            phase=phase,
            check=check,
            stress_ratio=check.total_stress / check.threshold,
            forces=((0.0, 0.0, force),),
            places=(beam.hook(shown),),
            holding=(grasper.holds,),
            pulling=HAND,
            force=force,
            deflection=shown * beam.pulled.deflection,
            deepest=self.deepest,
            breaks_at=breaks_at,
            by_hand=grasper.mode == "hand",
        )

    columns = (
        "force_N", "deflection_mm", "stress_MPa", "distance_to_break",
        "hook_x_mm", "hook_y_mm", "hook_z_mm", "held", "torn",
    )  # fmt: skip

    def row(self) -> tuple[float, ...]:
        """Return what the instruments show now, for a table by tick."""
        reading = self.reading()
        check = reading.check
        return (
            reading.force,
            reading.deflection,
            check.total_stress,
            check.distance_to_break,
            *reading.hook,
            int(reading.held),
            int(self.tear is not None),
        )

    def draw(self, drawn: DrawnDuct) -> None:
        """Move the drawn surfaces, and the ghost."""
        drawn.draw(self.grasped.driven, self.tear)
        if self.ghost is not None:
            self.ghost.draw()

    def write_stress(
        self, drawn: DrawnDuct, out: NDArray[np.float32], surface: int
    ) -> NDArray[np.float32]:
        """Write the stress along the organ at each vertex of a drawn surface, MPa."""
        return drawn.write_stress(self.grasped.pulled, self.tear, out, surface)

    # What is beside it

    @property
    def ghost(self) -> Ghost | None:
        """The other theory's duct, while this one is whole."""
        return self._ghost if self.tear is None else None

    @property
    def ghost_theory(self) -> Theory | None:
        """The theory that was chosen for the ghost, or None."""
        return None if self._ghost is None else self._ghost.model.theory

    @property
    def chain(self) -> SwingingChain | None:
        """The chain of masses and springs beside the duct, while this one is whole."""
        return self._chain if self.tear is None else None

    @property
    def has_chain(self) -> bool:
        """Whether a chain was chosen."""
        return self._chain is not None

    def compare_as(self, other: "PlanarTissue", skin: Skin) -> None:
        """Show beside this what is shown beside another: a ghost of its theory, a chain."""
        if (theory := other.ghost_theory) is not None:
            # A theory that ends before this duct's break has no ghost of it.
            with contextlib.suppress(NoEquilibrium):
                self.show_ghost(BeamModel.of(self.dissection, theory), skin)
        self.show_chain(other.has_chain)

    def ghost_reading(self) -> GhostReading | None:
        """Return the ghost's reading; None without a ghost or an equilibrium of it."""
        if self.ghost is None:
            return None
        return self.ghost.reading(self.grasper.grip_force, self.grasped.pulled.deflection)

    def show_ghost(self, model: BeamModel | None, skin: Skin) -> None:
        """Show a ghost by another model under the same load, or none."""
        self._ghost = None if model is None else Ghost(model, skin)
        self._stale = True

    def show_chain(self, shown: bool) -> None:
        """Show or hide the mass-spring chain."""
        if shown != self.has_chain:
            self._chain = self._new_chain() if shown else None
            self._stale = True

    def _new_chain(self) -> SwingingChain:
        chain = SwingingChain(self.dissection.beam, self.grasped.grasp)
        chain.start_from(self.grasped.pulled.deflection)
        return chain

    # Exercises and runs

    @property
    def task_grasp(self) -> float:
        """Grasp that exercises are scaled for, mm from the first clamp.

        An exercise that was started keeps its own, wherever the hand takes hold, until the duct is
        reset or, once the exercise is over, another grasp is set.
        """
        return self.grasp if self._task_grasp is None else self._task_grasp

    def forget_task(self) -> None:
        """Scale exercises for the present grasp again."""
        self._task_grasp = None

    def goal_of(self, exercise: Exercise) -> tuple[float, float] | None:
        """Return the deflections between which an exercise's goal lies with the present grasp."""
        if exercise.opening is not None:  # it is done in a bed
            return None
        if self._goal is None or self._goal[:2] != (exercise, self.grasped):
            self._goal = exercise, self.grasped, exercise.goal.band_on(self.grasped)
        return self._goal[2]

    def task_beam(self) -> GraspedBeam:
        """Return the beam that exercises are scaled for."""
        return GraspedBeam(self.model, self.task_grasp, self.threshold)

    def start(self) -> Callable[[], RunStart]:
        """Return what makes the start of a run that begins now."""
        preset, theory = self.dissection.preset, self.theory
        grasp, threshold = self.grasp, self.threshold
        return lambda: RunStart(
            preset.name if preset.ships else preset,
            threshold,
            theory=TheoryChoice.of(theory),
            grasp_mm=grasp,
        )

    @property
    def _settings_changed(self) -> bool:
        return self.grasp != self.grasped.grasp or self.threshold != self.grasped.threshold

    def _take_settings(self) -> None:
        """Solve at the present settings; without an equilibrium, ease the load."""
        self.grasped = GraspedBeam(self.model, self.grasp, self.threshold)
        self._stale = True
        grasper = self.grasper
        load = grasper.load
        while True:
            try:
                self.grasped.solve(load)
            except NoEquilibrium:
                load = grasper.ease()
            else:
                self._respond()
                return

    def _respond(self) -> None:
        grasper = self.grasper
        pulled = self.grasped.pulled
        grasper.update_response(pulled.force, pulled.deflection)
        self.deepest = max(self.deepest, pulled.deflection)

    def _tear(self, before: tuple[float, float], deepest: float) -> None:
        """Tear at the load that met the criterion, between the last tick's and this one's."""
        grasper = self.grasper
        beam, event = self.grasped, self.grasped.breaks_at
        if event is not None:
            force, deflection = before
            grasper.force = min(max(event.force, force), grasper.force)
            grasper.deflection = min(max(event.deflection, deflection), grasper.deflection)
        beam.solve(grasper.load)
        self.deepest = deepest
        self._respond()
        self.tear = Tear(BreakEvent(grasper.force, beam.pulled.deflection, beam.check))


def _within(value: float, ends: tuple[float, float]) -> float:
    return min(max(float(value), ends[0]), ends[1])
