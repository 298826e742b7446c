"""A session: one trainee's duct, the inputs to it, its settings and its runs, without a viewer.

The same action has one name from the page down: `set_target_force`, `set_grasp`, `set_threshold`,
`grab`, `move_hand`, `release`. An input is clamped to its range here, set on the grasper or the
duct, logged with the value applied after clamping, and solved with the next tick by `advance`.
"""

import contextlib
from collections import deque
from collections.abc import Callable
from threading import RLock
from typing import Self

import numpy as np
from numpy.typing import NDArray

from app.simulation.comparison import Ghost, GhostReading, SwingingChain
from app.simulation.dissection import Dissection, default_preset, fits
from app.simulation.drawn_duct import DrawnDuct
from app.simulation.duct import Duct, Reading
from app.simulation.exercise import (
    Exercise,
    ExerciseInputs,
    Feedback,
    exercises_for,
    goal_band,
)
from app.simulation.grasped_beam import BeamModel, GraspedBeam
from app.simulation.grasper import Grasper, Load
from app.simulation.inputs import Input, TheoryChoice
from app.simulation.measures import Measures, MeasureTaker
from app.simulation.preset import OrganBeam, Preset, preset_named, presets
from app.simulation.run import Run
from app.simulation.run_file import OrganIdentity, RunFile, RunFileError, RunLog, RunStart
from app.simulation.trial import trial_of
from organ_geometry import Organ
from physics import Cubic, NoEquilibrium, Theory

__all__ = ["VERTICES", "Session"]

VERTICES = 5000
"""Vertices of the skin, about: as many as a browser without a graphics card draws smoothly."""
# Force above which a run's time is counted, over the force at break at mid-span.
TASK_THRESHOLD = 0.5
MOST_TRIES = 20
# A free duct has one hand at one tube.
HAND = TUBE = 0
"""Most finished exercises kept for comparison."""


class Session:
    """One duct under one grasper, stepped in time. Safe to call from several threads.

    Inputs come from a browser: out of range they are clamped, and those that are not numbers are
    ignored. Time advances in ticks of `TICK_SECONDS`; to the bit, the course of a session is a
    function of the inputs and of the ticks at which they come.

    It opens on `preset`, or on `default_preset` when that is None; its skin has about `vertices`
    vertices, and `seed` chooses the raggedness of the torn rim. `duct`, `grasper`, `drawn` and
    `run` are public for reading; `duct` is another object after a choice of organ or preset, `run`
    after a reset.
    """

    def __init__(
        self,
        organ: Organ,
        preset: Preset | None = None,
        *,
        vertices: int = VERTICES,
        seed: int = 1,
    ) -> None:
        self.seed = seed
        self.grasper = Grasper()
        self.drawn = DrawnDuct(organ, vertices, seed)
        self._taker = MeasureTaker(0.0)
        self.run = Run(self._taker)
        self._lock = RLock()
        self._organ, self._vertices = organ, vertices
        self._ghost: Ghost | None = None
        self._chain: SwingingChain | None = None
        self._tries: deque[Run] = deque(maxlen=MOST_TRIES)
        self._task_grasp: float | None = None
        self._goal: tuple[Exercise, GraspedBeam, tuple[float, float] | None] | None = None
        self._start(BeamModel.of(Dissection.of(organ, preset or default_preset(organ)), Cubic()))

    # What the trainee does.

    def set_target_force(self, force: float) -> None:
        """Pull with a force, N, reached over the next ticks."""
        with self._lock:
            if self._accepts_slider(force):
                if force > 0.0:
                    self._begin_run()
                target = _within(force, (0.0, self.duct.force_limit))
                if self.grasper.set_target_force(target):
                    self.run.note(HAND, "force", target)

    def grab(self, station: float) -> float | None:
        """Take the duct by hand at a station; return its deflection there, mm, or None if torn."""
        with self._lock:
            duct = self.duct
            if not duct.accepts(station):
                return None
            self._begin_run()
            duct.grasp = _within(station, duct.grasp_range)
            self.grasper.grab(max(0.0, duct.grasped.deflection_at(duct.grasp)))
            self.run.note(HAND, "grab", TUBE, duct.grasp)
            return self.grasper.deflection

    def move_hand(self, deflection: float) -> None:
        """Move the hand that holds the duct, mm along the pull; the grasp follows.

        A hook pulls and does not push: below zero the duct lies where it is at rest.
        """
        with self._lock:
            if self.duct.accepts(deflection):
                target = _within(deflection, (0.0, self.duct.deflection_limit))
                if self.grasper.move_hand(target):
                    self.run.note(HAND, "lift", target)

    def release(self) -> None:
        """Let the duct spring back."""
        with self._lock:
            if self.duct.tear is None and self.grasper.release():
                self.run.note(HAND, "release")

    def set_grasp(self, grasp: float) -> None:
        """Hold the duct elsewhere, mm from the first clamp; keep the force or the deflection."""
        with self._lock:
            if not self._accepts_slider(grasp):
                return
            if self.run.over:
                self._task_grasp = None
            if self._hold_at(_within(grasp, self.duct.grasp_range)):
                self.run.note(HAND, "grasp", self.duct.grasp)

    def set_threshold(self, threshold: float) -> None:
        """Let the duct tear at another stress, MPa."""
        with self._lock:
            if self._accepts_slider(threshold):
                duct, threshold = self.duct, _within(threshold, self.duct.threshold_range)
                if threshold != duct.threshold:
                    duct.threshold = threshold
                    self.run.note(HAND, "threshold", threshold)

    def reset(self) -> None:
        """Release the duct and make it whole; the next pull starts a run without an exercise.

        The grasp goes back to where the last exercise was started.
        """
        with self._lock:
            torn = self.duct.tear is not None
            self.duct.reset()
            self.grasper.reset()
            if torn:
                self.drawn.show_whole()
            if self._task_grasp is not None:
                self._hold_at(self._task_grasp)
                self._task_grasp = None
            self._new_run()

    # Time and readings.

    def advance(self, ticks: int = 1) -> bool:
        """Advance by some ticks and draw; return whether anything has moved or is going to."""
        with self._lock:
            duct, changed = self.duct, False
            for _ in range(ticks):
                was_whole, grasp = duct.tear is None, duct.grasped.grasp
                moved = duct.advance(self.grasper)
                changed |= moved
                if was_whole:
                    changed |= self._follow(moved, regrasped=duct.grasped.grasp != grasp)
            if changed:
                self.drawn.draw(duct.grasped.driven, duct.tear)
                if self.ghost is not None:
                    self.ghost.draw()
            return changed or duct.moves_under(self.grasper)

    def reading(self) -> Reading:
        """Return what the instruments show now."""
        with self._lock:
            return self.duct.reading(self.grasper)

    def stress(self, out: NDArray[np.float32], surface: int = 0) -> NDArray[np.float32]:
        """Write the stress along the organ, MPa, at each vertex of a surface."""
        with self._lock:
            return self.drawn.write_stress(self.duct.grasped.pulled, self.duct.tear, out, surface)

    def curve(self, count: int = 80) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return (count,) deflections, mm, and forces, N, past the break and past this pull."""
        # Fewer than `count` where the theory ends.
        with self._lock:
            beam, deepest = self.duct.grasped, self.duct.deepest
        return beam.curve(count, deepest=deepest)

    # Comparisons beside the duct.

    @property
    def ghost(self) -> Ghost | None:
        """The other theory's duct, while this one is whole."""
        return self._ghost if self.duct.tear is None else None

    @property
    def ghost_theory(self) -> Theory | None:
        """The theory that was chosen for the ghost, or None."""
        return None if self._ghost is None else self._ghost.model.theory

    @property
    def chain(self) -> SwingingChain | None:
        """The chain of masses and springs beside the duct, while this one is whole."""
        return self._chain if self.duct.tear is None else None

    def ghost_reading(self) -> GhostReading | None:
        """Return the ghost's reading; None without a ghost or an equilibrium of it."""
        with self._lock:
            if self.ghost is None:
                return None
            deflection = self.duct.grasped.pulled.deflection
            return self.ghost.reading(self.grasper.grip_force, deflection)

    def choose_ghost(self, theory: Theory | None) -> None:
        """Show a ghost by another theory under the same load, or none.

        A `ValueError` if the theory ends before the preset's break; then nothing changes.
        """
        dissection = self.duct.dissection
        model = None if theory is None else BeamModel.of(dissection, theory)
        with self._lock:
            if model is not None and model.dissection is not self.duct.dissection:
                model = BeamModel.of(self.duct.dissection, model.theory)
            self._ghost = None if model is None else Ghost(model, self.drawn.skin)
            self.duct.touch()

    def show_chain(self, shown: bool) -> None:
        """Show or hide the mass-spring chain."""
        with self._lock:
            if shown != (self._chain is not None):
                self._chain = self._new_chain() if shown else None
                self.duct.touch()

    # Organ, preset and theory; each choice but the theory starts anew.

    def presets_offered(self) -> list[Preset]:
        """Return the presets that fit this organ, with the user's own one in use."""
        shipped = [preset for preset in presets().values() if fits(self._organ, preset)]
        own = self.duct.dissection.preset
        return shipped if own.ships else [*shipped, own]

    def choose_preset(self, preset: Preset | str) -> None:
        """Start anew with a preset, or a shipped one's name; a torn duct stays as it is."""
        chosen = preset_named(preset) if isinstance(preset, str) else preset
        model = BeamModel.of(Dissection.of(self._organ, chosen), self.duct.theory)
        with self._lock:
            if self.duct.tear is None:
                self._start(model)

    def prepare_organ(self, organ: Organ) -> Callable[[], None]:
        """Prepare another organ, solved by its own sections; return what starts anew with it."""
        # To be called by the thread that draws, since the surfaces change. The material stays where
        # this preset already takes the organ's own sections as drawn; else it is
        # `default_preset`'s.
        drawn = DrawnDuct(organ, self._vertices, self.seed)
        preset = self.duct.dissection.preset
        if preset.beam != OrganBeam():  # a bar, or a wall and clamps of the organ before
            preset = default_preset(organ)
        dissection = Dissection.of(organ, preset)
        model = BeamModel.of(dissection, self.duct.theory)

        def start() -> None:
            with self._lock:
                drawn.shape = self.drawn.shape
                self._organ, self.drawn = organ, drawn
                # The theory may have been changed meanwhile.
                theory = self.duct.theory
                self._start(model if model.theory == theory else BeamModel.of(dissection, theory))
                self._tries.clear()

        return start

    def choose_theory(self, theory: Theory) -> None:
        """Solve the duct by another theory, with that theory's own threshold.

        A `ValueError` if the theory ends before the preset's break; then nothing changes.
        """
        # Outside the lock: a theory's first solution may have to be compiled.
        model = BeamModel.of(self.duct.dissection, theory)
        with self._lock:
            if model.dissection is not self.duct.dissection:  # another was chosen meanwhile
                model = BeamModel.of(self.duct.dissection, theory)
            if self.duct.tear is None:
                self.duct.solve_by(model, self.grasper)
                if self.run.started:
                    self.run.note(HAND, "theory", theory)
                else:
                    self._new_run(self.run.exercise, self.run.feedback, self.run.exercise_inputs)

    # Exercises and runs.

    @property
    def task_grasp(self) -> float:
        """Grasp that exercises are scaled for, mm from the first clamp.

        An exercise that was started keeps its own, wherever the hand takes hold, until the duct is
        reset or, once the exercise is over, another grasp is set.
        """
        return self.duct.grasp if self._task_grasp is None else self._task_grasp

    @property
    def goal(self) -> tuple[float, float] | None:
        """Deflections between which the exercise's goal lies with the present grasp, mm.

        None without an exercise that waits or goes on, and for one that has no such goal.
        """
        with self._lock:
            run, beam = self.run, self.duct.grasped
            if run.exercise is None or run.over:
                return None
            if self._goal is None or self._goal[:2] != (run.exercise, beam):
                self._goal = run.exercise, beam, goal_band(run.exercise, beam)
            return self._goal[2]

    def exercises_offered(self) -> tuple[Exercise, ...]:
        """Return the exercises for this duct, with `task_grasp` and the present threshold."""
        with self._lock:
            beam = GraspedBeam(self.duct.model, self.task_grasp, self.duct.threshold)
        return exercises_for(beam)

    def start_exercise(
        self,
        exercise: Exercise,
        feedback: Feedback = Feedback.CONTINUOUS,
        grasp: float | None = None,
        inputs: ExerciseInputs = "hand",
    ) -> None:
        """Start anew with an exercise, at `task_grasp` if no grasp is given.

        Its time runs from the first pull. With inputs "hand", a force, another grasp or another
        threshold is ignored until it is over.
        """
        with self._lock:
            self.reset()
            if grasp is not None:
                self.set_grasp(grasp)
            self._new_run(exercise, feedback, inputs)
            self._task_grasp = self.duct.grasp

    def finish(self) -> None:
        """End the run as it stands; the duct stays as it is."""
        with self._lock:
            self.run.finish()

    def measures(self) -> Measures:
        """Return the measures of this run so far."""
        with self._lock:
            return self._taker.measures()

    def run_file(self) -> RunFile:
        """Return this run so far, to keep, download and replay."""
        with self._lock:
            return self._file(self.run)

    def earlier_tries(self, run: RunFile) -> list[RunFile]:
        """Return the earlier judged runs of the same exercise and start, oldest first."""
        with self._lock:
            tries = [self._file(each) for each in self._tries if each.exercise == run.log.exercise]
        return [each for each in tries if each.log.start == run.log.start and each != run]

    def _start(self, model: BeamModel) -> None:
        self._task_grasp = None
        self.duct = Duct(model)
        self.grasper.reset()
        self.drawn.follow(model.dissection)
        if self._ghost is not None:
            theory, self._ghost = self._ghost.model.theory, None
            # A theory that ends before this duct's break has no ghost of it.
            with contextlib.suppress(NoEquilibrium):
                self._ghost = Ghost(BeamModel.of(model.dissection, theory), self.drawn.skin)
        if self._chain is not None:
            self._chain = self._new_chain()
        self._new_run()

    @property
    def torn(self) -> bool:
        """Whether the duct tears or is torn."""
        return self.duct.tear is not None

    # Replays.

    @classmethod
    def of_log(cls, log: RunLog, organ: Organ, vertices: int) -> Self:
        """Return a session for a run; a `RunFileError` where it cannot be replayed here."""
        log.organ.check(organ)
        preset = log.start.preset
        try:
            if isinstance(preset, str):
                preset = preset_named(preset)
            return cls(organ, preset, vertices=vertices, seed=log.seed)
        except ValueError as error:
            raise RunFileError(f"the run's preset: {error}") from None

    def restart(self, log: RunLog) -> None:
        """Go to where a run starts."""
        start = log.start
        self.reset()
        try:
            theory = Cubic() if start.theory is None else start.theory.theory()
            if self.duct.theory != theory:
                self.choose_theory(theory)
        except ValueError as error:
            raise RunFileError(f"the run's theory: {error}") from None
        grasp = self.duct.grasp if start.grasp_mm is None else start.grasp_mm
        self.set_grasp(grasp)
        self.set_threshold(start.threshold_MPa)
        if (self.duct.grasp, self.duct.threshold) != (grasp, start.threshold_MPa):
            raise RunFileError(
                f"the run's grasp of {grasp:g} mm or threshold of {start.threshold_MPa:g} MPa is "
                "out of this duct's range"
            )
        if log.exercise is not None:
            self.start_exercise(log.exercise, log.feedback, inputs=log.exercise_inputs)
        self.advance()  # settle first: the run starts from a duct at rest, already drawn

    def apply(self, each: Input) -> None:
        """Apply an input; one that a free duct does not take is ignored."""
        value = each.value
        if each.kind == "release":
            self.release()
        elif isinstance(value, TheoryChoice):
            self.choose_theory(value.theory())
        elif isinstance(value, tuple):
            if each.kind == "grab":
                self.grab(value[1])
        elif isinstance(value, float | int):
            action = {
                "force": self.set_target_force,
                "lift": self.move_hand,
                "grasp": self.set_grasp,
                "threshold": self.set_threshold,
            }.get(each.kind)
            if action is not None:
                action(value)

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the figures of `row`."""
        return (
            "force_N", "deflection_mm", "stress_MPa", "distance_to_break",
            "hook_x_mm", "hook_y_mm", "hook_z_mm", "held", "torn",
        )  # fmt: skip

    def row(self) -> tuple[float, ...]:
        """Return what the instruments show now."""
        reading = self.reading()
        check = reading.check
        return (
            reading.force,
            reading.deflection,
            check.total_stress,
            check.distance_to_break,
            *reading.hook,
            int(reading.held),
            int(self.torn),
        )

    def _new_run(
        self,
        exercise: Exercise | None = None,
        feedback: Feedback = Feedback.CONTINUOUS,
        inputs: ExerciseInputs = "any",
    ) -> None:
        task_threshold = TASK_THRESHOLD * self.duct.model.break_force
        if exercise is not None:
            task_threshold = exercise.limits.get("maximum_force_N", task_threshold)
        if self.run.started:
            self.run.finish()
            if self.run.outcome is not None:
                self._tries.append(self.run)
        taker = MeasureTaker(task_threshold, exercise and exercise.band)
        trial = None if exercise is None else trial_of(exercise, taker)
        self._taker, self.run = taker, Run(taker, exercise, feedback, inputs, trial)

    def _new_chain(self) -> SwingingChain:
        beam = self.duct.grasped
        chain = SwingingChain(self.duct.dissection.beam, beam.grasp)
        chain.start_from(beam.pulled.deflection)
        return chain

    def _accepts_slider(self, value: float) -> bool:
        """Return whether a slider's or key's value counts now; some exercises want the hand."""
        return not self.run.hand_only and self.duct.accepts(value)

    def _hold_at(self, grasp: float) -> bool:
        """Move the grasp to a place, mm; return whether it is another."""
        if grasp == self.duct.grasp:
            return False
        self.duct.grasp = grasp
        self.grasper.regrasp(self.duct.grasped.deflection_at(grasp))
        return True

    def _begin_run(self) -> None:
        """Start the run with the first pull, on a beam that has solved nothing before."""
        if self.run.started or self.run.over:
            return
        duct = self.duct
        preset, theory = duct.dissection.preset, duct.theory
        grasp, threshold = duct.grasp, duct.threshold
        self.run.start(
            lambda: RunStart(
                preset.name if preset.ships else preset,
                threshold,
                theory=TheoryChoice.of(theory),
                grasp_mm=grasp,
            )
        )
        duct.renew()

    def _follow(self, moved: bool, *, regrasped: bool) -> bool:
        """Let the run, the ghost and the chain of a whole duct follow a tick."""
        duct, grasper, changed = self.duct, self.grasper, False
        beam, tear = duct.grasped, duct.tear
        if self._ghost is not None and moved:
            self._ghost.follow(beam.grasp, grasper.load)
        if self._chain is not None:
            if self._chain.grasp != beam.grasp:
                self._chain = self._new_chain()
            free = grasper.mode == "free"
            changed = self._chain.advance(Load("force", 0.0) if free else grasper.load)
        if regrasped:
            self._taker.regrasp()
        if self.run.going:
            self._taker.take(
                grasper.grip_force if tear is None else tear.event.force,
                beam.hook(),
                beam.check.distance_to_break,
                held=grasper.holds,
                deflection=beam.pulled.deflection,
                came_from=duct.came_from,
            )
            if tear is not None:
                self._taker.tear(tear.event)
            self.run.end_tick(torn=tear is not None)
        if tear is not None:
            self.drawn.show_pieces(tear.event.check)
        return changed

    def _file(self, run: Run) -> RunFile:
        return run.file(OrganIdentity.of(self._organ), self.seed)


def _within(value: float, ends: tuple[float, float]) -> float:
    return min(max(float(value), ends[0]), ends[1])
