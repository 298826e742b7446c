"""Attempts: how one go at an exercise is judged, tick by tick, by its measures and errors."""

from app.simulation.exercises.errors import ERROR_CLASSES
from app.simulation.exercises.exercise import Exercise, Outcome
from app.simulation.exercises.metrics import METRIC_OF, metrics_of
from app.simulation.exercises.metrics_recorder import MetricsRecorder
from app.simulation.inputs.clock import TICK_SECONDS


class Attempt:
    """One go at an exercise; `outcome` is None while it goes on."""

    def __init__(self, exercise: Exercise, recorder: MetricsRecorder) -> None:
        self._exercise, self._recorder = exercise, recorder
        self._followed = exercise.goal.follow()
        self._ticks = self._errors = 0
        # Each limit: whether it is of a number of errors; and those that are not.
        self._limits = [(limit, limit.of in ERROR_CLASSES) for limit in exercise.limits]
        self._measured = [each for each in self._limits if not each[1]]
        self.outcome: Outcome | None = None

    @property
    def progress(self) -> float:
        """From 0 to 1."""
        return self._followed.progress

    @property
    def standing(self) -> str:
        """What to do now, in a few words."""
        return self._followed.standing

    @property
    def failing(self) -> list[str]:
        """The classes of errors made so far that fail it once all else is done."""
        number = self._recorder.errors.number
        return [
            limit.of
            for limit, of_errors in self._limits
            if of_errors and limit.at_end and limit.passed_by(number.get(limit.of, 0))
        ]

    def take(self) -> None:
        """Judge one tick whose measures are taken."""
        if self.outcome is not None:
            return
        self._ticks += 1
        limit = self._exercise.time_limit_s
        reached = self._followed.take(self._recorder)
        failure = self._failure(reached=reached)
        if failure is not None:
            self.outcome = Outcome(False, failure)
        elif reached:
            metrics = metrics_of(self._recorder.measures())
            self.outcome = Outcome(True, self._exercise.goal.reached(metrics))
        elif self._ticks * TICK_SECONDS >= limit:
            self.outcome = Outcome(
                False, f"The {limit:g} s were over with {self._followed.so_far}."
            )

    def _failure(self, *, reached: bool) -> str | None:
        """Return why this tick fails it, or None."""
        errors = self._recorder.errors
        # A number of errors is past its limit with a new one, or at the end.
        new, self._errors = errors.total != self._errors, errors.total
        for limit, of_errors in self._limits if new or reached else self._measured:
            number = errors.number.get(limit.of, 0) if of_errors else None
            if number == 0 or (limit.at_end and not reached):
                continue
            if number is not None:
                if limit.passed_by(number):
                    last = errors.last_of(limit.of)
                    return self._reason(last.happened if limit.of == "tear" else "", last.sentence)
                continue
            value = self._recorder.measure(limit.of)
            largest = max(value) if isinstance(value, tuple) else value
            if largest is not None and limit.passed_by(largest):
                words = METRIC_OF[limit.of].passed_words(largest, limit.value)
                return self._reason(words, f"{words}.")
        return None

    def _reason(self, words: str, alone: str) -> str:
        """Put what is passed down to an error of the last second; `alone` where there is none."""
        cause = self._recorder.errors.cause()
        if cause is None:
            return alone
        if not words or cause.error in ("over_lifted", "tear"):  # which say it themselves
            return cause.sentence
        return f"{words[0].upper()}{words[1:]}: {cause.advice}"
