"""A run in progress: its inputs, its measures and its exercise, tick by tick."""

from array import array
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar, get_args

from app.simulation.clock import TICK_SECONDS
from app.simulation.exercise import (
    Exercise,
    ExerciseInputs,
    Feedback,
    Outcome,
    feedback_visible,
)
from app.simulation.measures import Measures, MeasureTaker, Place
from app.simulation.preset import Preset
from app.simulation.run_log import (
    MOST_INPUTS,
    MOST_TICKS,
    InputKind,
    OrganIdentity,
    RunInput,
    RunLog,
    RunStart,
    TheoryChoice,
)
from app.simulation.trial import Figures, Trial, trial_of
from app.versions import versions
from physics import BreakEvent, Theory

__all__ = ["BaseRun", "Run", "StartingPoint", "Taken"]

KINDS: tuple[InputKind, ...] = get_args(InputKind)
LAST_COUNTS = frozenset({"hand", "threshold"})
"""Inputs of which only the last between two ticks has an effect: it replaces the one before."""


@dataclass(frozen=True, slots=True)
class StartingPoint:
    """The settings that a run starts from."""

    preset: Preset
    theory: Theory
    grasp: float  # mm from the first clamp
    threshold: float  # MPa


class Taken(Protocol):
    """What takes a run's measures."""

    ticks: int


ExerciseT = TypeVar("ExerciseT")
StartT = TypeVar("StartT")
TakerT = TypeVar("TakerT", bound=Taken)


class BaseRun(Generic[ExerciseT, StartT, TakerT]):
    """What the runs of a pull and of a dissection have in common.

    A run starts with the first input and is over with the tear or the exercise. `exercise` is
    judged by `trial`, if there is one. Inputs are logged as rows of bare numbers: half an hour of
    dragging is a few megabytes.
    """

    def __init__(
        self,
        taker: TakerT,
        exercise: ExerciseT | None,
        feedback: Feedback,
        trial: Trial[Any] | None,
    ) -> None:
        self.exercise, self.feedback = exercise, feedback
        self._taker, self._trial = taker, trial
        self._start: StartT | None = None
        self._over = False
        self._ticks, self._kinds, self._values = array("L"), array("B"), array("d")

    @property
    def started(self) -> bool:
        """Whether the duct has been pulled."""
        return self._start is not None

    @property
    def over(self) -> bool:
        """Whether no more ticks and inputs are taken."""
        return self._over

    @property
    def going(self) -> bool:
        """Whether it has started and is not over."""
        return self._start is not None and not self._over

    @property
    def ticks(self) -> int:
        """Ticks so far."""
        return self._taker.ticks

    @property
    def inputs(self) -> int:
        """How many inputs are logged; at most `MOST_INPUTS`."""
        return len(self._ticks)

    @property
    def seconds(self) -> float:
        """Time so far, s."""
        return self.ticks * TICK_SECONDS

    @property
    def progress(self) -> float:
        """Progress of the exercise, 0 to 1; 0 without one."""
        return 0.0 if self._trial is None else self._trial.progress

    @property
    def standing(self) -> str:
        """What to do now in the exercise, in a few words; empty without one, or once it is over."""
        return "" if self._trial is None or self._over else self._trial.standing

    @property
    def outcome(self) -> Outcome | None:
        """How the exercise has ended, or None."""
        return None if self._trial is None else self._trial.outcome

    @property
    def feedback_visible(self) -> bool:
        """Whether the figures are shown now."""
        return feedback_visible(self.feedback, self.seconds, over=self._over)

    def start(self, point: StartT) -> None:
        """Start the clock, with the first input."""
        self._start = point

    def finish(self) -> None:
        """End the run as it stands."""
        self._over = True

    def _note(self, kind: int, *values: float, replaces: bool) -> None:
        """Log an input; it replaces one of its kind just before it in the same tick, if it may."""
        if not self.going:
            return
        again = self._ticks and (self._ticks[-1], self._kinds[-1]) == (self.ticks, kind)
        if again and replaces:
            self._values[-len(values) :] = array("d", values)
            return
        if len(self._ticks) >= MOST_INPUTS:
            self.finish()
            return
        self._ticks.append(self.ticks)
        self._kinds.append(kind)
        self._values.extend(values)

    def _end(self, *, torn: bool) -> None:
        """End the run after a tick in which the duct tore, the exercise ended or time is up."""
        if torn or self.outcome is not None or self.ticks >= MOST_TICKS:
            self._over = True


class Run(BaseRun[Exercise, StartingPoint, MeasureTaker]):
    """One run: it starts with the first pull and is over with the tear or the exercise.

    Times above a force of `task_threshold`, N, are counted; `exercise` is judged, if there is one.
    """

    def __init__(
        self,
        task_threshold: float,
        exercise: Exercise | None = None,
        feedback: Feedback = Feedback.CONTINUOUS,
        exercise_inputs: ExerciseInputs = "any",
    ) -> None:
        super().__init__(
            MeasureTaker(task_threshold, exercise and exercise.band),
            exercise,
            feedback,
            None if exercise is None else trial_of(exercise),
        )
        self.exercise_inputs: ExerciseInputs = exercise_inputs
        self._theories: list[Theory] = []

    @property
    def hand_only(self) -> bool:
        """Whether an exercise that counts the hand only waits or goes on."""
        return self.exercise is not None and self.exercise_inputs == "hand" and not self._over

    def note(self, kind: InputKind, value: float | Theory | None = None) -> None:
        """Log an input; ignored before the start and once the run is over."""
        if not self.going:
            return
        if value is None:
            figure = 0.0
        elif isinstance(value, int | float):
            figure = float(value)
        else:
            figure = float(len(self._theories))
            self._theories.append(value)
        self._note(KINDS.index(kind), figure, replaces=kind in LAST_COUNTS)

    def take(
        self,
        force: float,
        deflection: float,
        hook: Place,
        distance_to_break: float,
        *,
        came_from: Place,
        held: bool,
        torn: BreakEvent | None,
    ) -> None:
        """Take one tick; ignored before the start and once the run is over."""
        if not self.going:
            return
        taker = self._taker
        taker.take(
            force, hook, distance_to_break, held=held, deflection=deflection, came_from=came_from
        )
        if torn is not None:
            taker.tear(torn)
        if self._trial is not None:
            self._trial.take(
                Figures(force, deflection, distance_to_break, taker, held, torn is not None)
            )
        self._end(torn=torn is not None)

    def regrasp(self) -> None:
        """Start a new hold in the measures: the grasper holds another place."""
        self._taker.regrasp()

    def measures(self) -> Measures:
        """Return the measures so far."""
        return self._taker.measures()

    def log(self, organ: OrganIdentity, seed: int) -> RunLog:
        """Return the log so far."""
        start = self._start
        if start is None:
            raise ValueError("a run starts with the first pull; there has been none")
        return RunLog(
            versions=versions(),
            organ=organ,
            start=RunStart(
                start.preset.name if start.preset.ships else start.preset,
                TheoryChoice.of(start.theory),
                start.grasp,
                start.threshold,
            ),
            seed=seed,
            tick_seconds=TICK_SECONDS,
            ticks=self.ticks,
            inputs=[
                RunInput(tick, KINDS[kind], self._value(KINDS[kind], value))
                for tick, kind, value in zip(self._ticks, self._kinds, self._values, strict=True)
            ],
            exercise=self.exercise,
            feedback=self.feedback,
            exercise_inputs=self.exercise_inputs,
        )

    def _value(self, kind: InputKind, value: float) -> float | TheoryChoice | None:
        if kind == "let-go":
            return None
        return TheoryChoice.of(self._theories[int(value)]) if kind == "theory" else value
