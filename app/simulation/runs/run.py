"""A run in progress: its inputs, its measures and its exercise, tick by tick."""

from collections.abc import Callable, Sequence

from app.simulation.exercises.attempt import Attempt, MetricsRecorder
from app.simulation.exercises.errors import Incident
from app.simulation.exercises.exercise import (
    Exercise,
    ExerciseInputs,
    Feedback,
    Outcome,
    feedback_visible,
)
from app.simulation.exercises.metrics import Metrics, metrics_of
from app.simulation.inputs.clock import TICK_SECONDS
from app.simulation.inputs.inputs import MOST_INPUTS, MOST_TICKS, InputKind, InputLog
from app.simulation.runs.run_file import OrganIdentity, RunFile, RunLog, RunStart
from app.versions import versions
from physics import Theory


class Run:
    """A run: from the first input until its exercise is over or nothing is left whole to act on.

    `recorder` has taken a tick's measures before the tick is counted here; `attempt` judges the
    exercise, if there is one.
    """

    def __init__(
        self,
        recorder: MetricsRecorder,
        exercise: Exercise | None = None,
        feedback: Feedback = Feedback.CONTINUOUS,
        exercise_inputs: ExerciseInputs = "any",
        attempt: Attempt | None = None,
    ) -> None:
        self.exercise, self.feedback = exercise, feedback
        self.exercise_inputs: ExerciseInputs = exercise_inputs
        self._recorder, self._attempt = recorder, attempt
        self._start: Callable[[], RunStart] | None = None
        self._over = False
        self._log = InputLog()

    @property
    def started(self) -> bool:
        """Whether there has been an input."""
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
    def closed(self) -> bool:
        """Whether an exercise is over, so that no hand moves the tissue until all is made whole."""
        return self.exercise is not None and self._over

    @property
    def ticks(self) -> int:
        """Ticks so far."""
        return self._recorder.ticks

    @property
    def seconds(self) -> float:
        """Time so far, s."""
        return self.ticks * TICK_SECONDS

    @property
    def progress(self) -> float:
        """Progress of the exercise, 0 to 1; 0 without one."""
        return 0.0 if self._attempt is None else self._attempt.progress

    @property
    def standing(self) -> str:
        """What to do now in the exercise, or was at its end, in a few words; empty without one."""
        return "" if self._attempt is None else self._attempt.standing

    @property
    def standings(self) -> list[str]:
        """The parts of `standing`: first how far the exercise has come."""
        return self.standing.split("; ")

    @property
    def failing(self) -> list[str]:
        """The classes of errors made so far that fail the exercise once all else is done."""
        return self._attempt.failing if self._attempt is not None and self.started else []

    @property
    def outcome(self) -> Outcome | None:
        """How the exercise has ended, or None."""
        return None if self._attempt is None else self._attempt.outcome

    @property
    def feedback_visible(self) -> bool:
        """Whether the figures are shown now."""
        return feedback_visible(self.feedback, self.seconds, over=self._over)

    @property
    def hand_only(self) -> bool:
        """Whether an exercise that counts the hand only waits or goes on."""
        return self.exercise is not None and self.exercise_inputs == "hand" and not self._over

    def start(self, start: Callable[[], RunStart]) -> None:
        """Start the clock with the first input; `start` returns what the run starts from."""
        self._start = start

    def finish(self) -> None:
        """End the run as it stands."""
        self._over = True

    def note(self, hand: int, kind: InputKind, values: Sequence[float | Theory]) -> None:
        """Log an input; ignored before the start and once the run is over."""
        if self._start is None or self._over:
            return
        if self._log.count >= MOST_INPUTS:
            self.finish()
            return
        self._log.note(self._recorder.ticks, hand, kind, values)

    def end_tick(self, *, over: bool) -> None:
        """Judge a tick whose measures are taken; the exercise's end or time end the run too."""
        if self._attempt is not None:
            self._attempt.take()
        if over or self.outcome is not None or self.ticks >= MOST_TICKS:
            self._over = True

    def metrics(self) -> Metrics:
        """Return the measures so far, by key."""
        return metrics_of(self._recorder.measures())

    def incidents(self) -> list[Incident]:
        """Return the errors that were made so far, in order; none before the start."""
        return self._recorder.errors.all() if self.started else []

    @property
    def errors(self) -> int:
        """How many there are."""
        return self._recorder.errors.total if self.started else 0

    def file(self, organ: OrganIdentity, seed: int) -> RunFile:
        """Return the run so far; a `ValueError` before the start."""
        start = self._started_from()
        log = RunLog(
            versions=versions(),
            organ=organ,
            start=start(),
            seed=seed,
            tick_seconds=TICK_SECONDS,
            ticks=self.ticks,
            inputs=self._log.inputs(),
            exercise=self.exercise,
            feedback=self.feedback,
            exercise_inputs=self.exercise_inputs,
        )
        return RunFile.of(log, self.metrics(), self.outcome)

    def _started_from(self) -> Callable[[], RunStart]:
        if self._start is None:
            raise ValueError("a run starts with the first input; there has been none")
        return self._start
