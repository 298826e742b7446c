"""Exercises: a goal, a limit and a result, in numbers that scale with the duct's own break."""

import math
from enum import StrEnum
from typing import ClassVar, NamedTuple

import msgspec

from app.simulation.clock import TICK_SECONDS

__all__ = [
    "ApproachBreak",
    "Exercise",
    "Feedback",
    "Figures",
    "GentleDissection",
    "HoldStretch",
    "Outcome",
    "Trial",
    "feedback_visible",
    "trial_of",
]

LONGEST_SECONDS = 3600.0
"""An exercise is a matter of minutes; a longer one is a slip of the unit."""
FADE_SECONDS = 30.0
"""Time after which fading feedback is gone."""
FADE_PERIOD = 3.0
"""Fading feedback comes once in so many seconds, for ever less of them."""


class Feedback(StrEnum):
    """When a trainee sees the figures: continuous feedback can make dependent on it."""

    CONTINUOUS = "continuous"
    FADING = "fading"
    SUMMARY = "summary"


def feedback_visible(feedback: Feedback, seconds: float, *, over: bool) -> bool:
    """Return whether the figures are to be seen.

    Parameters
    ----------
    feedback
        The mode.
    seconds
        Time since the run has started, s.
    over
        Whether the run is over; then they always are.

    Returns
    -------
    bool
        Continuous: yes. Summary: not before the end. Fading: in each period of 3 s at first
        throughout, then for a part that falls evenly to none at 30 s.

    Examples
    --------
    >>> [feedback_visible(Feedback.FADING, t, over=False) for t in (0.0, 14.0, 15.1, 40.0)]
    [True, False, True, False]
    """
    if over or feedback is Feedback.CONTINUOUS:
        return True
    if feedback is Feedback.SUMMARY:
        return False
    start = seconds - seconds % FADE_PERIOD
    return seconds - start < FADE_PERIOD * max(0.0, 1.0 - start / FADE_SECONDS)


class Figures(NamedTuple):
    """What an exercise is judged by, at one tick.

    Attributes
    ----------
    force
        The grasper's whole force, N.
    deflection
        Displacement of the grasp, mm.
    distance_to_break
        1 at rest, 0 at the break.
    force_time_product
        So far, N s.
    held
        Whether the grasper holds the duct.
    torn
        Whether the duct has just torn.
    """

    force: float
    deflection: float
    distance_to_break: float
    force_time_product: float
    held: bool
    torn: bool


class Outcome(msgspec.Struct, frozen=True):
    """How an exercise has ended.

    Attributes
    ----------
    passed
        Whether its goal was reached within its limit.
    reason
        Why, in one sentence.
    """

    passed: bool
    reason: str


class HoldStretch(msgspec.Struct, frozen=True, tag_field="exercise", tag="hold-stretch"):
    """Hold a given deflection for a time without exceeding a force.

    Attributes
    ----------
    deflection_mm, tolerance_mm
        Where to hold the grasp, and how near.
    seconds
        For how long without leaving, s.
    force_limit_N
        A larger force ends the exercise.
    time_limit_s
        Time for all of it.
    """

    deflection_mm: float
    tolerance_mm: float
    seconds: float
    force_limit_N: float  # noqa: N815
    time_limit_s: float = 60.0
    title: ClassVar[str] = "Hold a stretch"

    def __post_init__(self) -> None:
        _above_zero(self, "deflection_mm", "tolerance_mm", "force_limit_N")
        _in_time(self.seconds, self.time_limit_s)

    @property
    def goal(self) -> str:
        """What to do, in one sentence."""
        return (
            f"Hold the duct {self.deflection_mm:.1f} mm out, within {self.tolerance_mm:.1f} mm, "
            f"for {self.seconds:g} s."
        )

    @property
    def limit(self) -> str:
        """What not to do, in one sentence."""
        return f"Never pull with more than {self.force_limit_N:.3g} N."


class ApproachBreak(msgspec.Struct, frozen=True, tag_field="exercise", tag="approach-break"):
    """Approach the break to a margin, stay there for a time, and do not tear the duct.

    Attributes
    ----------
    margin
        Distance to break to come to, as a part of one.
    seconds
        How long to stay at or below it, s.
    time_limit_s
        Time for all of it.
    """

    margin: float
    seconds: float
    time_limit_s: float = 60.0
    title: ClassVar[str] = "Approach the break"

    def __post_init__(self) -> None:
        if not 0.0 < self.margin < 1.0:
            raise ValueError(f"margin must be above 0 and below 1, got {self.margin}")
        _in_time(self.seconds, self.time_limit_s)

    @property
    def goal(self) -> str:
        """What to do, in one sentence."""
        return (
            f"Bring the distance to break down to {100.0 * self.margin:.0f} % or less and keep it "
            f"there for {self.seconds:g} s."
        )

    @property
    def limit(self) -> str:
        """What not to do, in one sentence."""
        return "Do not tear the duct."


class GentleDissection(msgspec.Struct, frozen=True, tag_field="exercise", tag="gentle-dissection"):
    """Tear the duct with the least force-time product.

    Attributes
    ----------
    product_limit_N_s
        Largest force-time product, N s.
    time_limit_s
        Time for all of it.
    """

    product_limit_N_s: float  # noqa: N815
    time_limit_s: float = 60.0
    title: ClassVar[str] = "Dissect gently"

    def __post_init__(self) -> None:
        _above_zero(self, "product_limit_N_s")
        _in_time(TICK_SECONDS, self.time_limit_s)

    @property
    def goal(self) -> str:
        """What to do, in one sentence."""
        return "Tear the duct with as little force-time product as you can."

    @property
    def limit(self) -> str:
        """What not to do, in one sentence."""
        return f"Spend no more than {self.product_limit_N_s:.3g} N s."


def _above_zero(exercise: msgspec.Struct, *names: str) -> None:
    for name in names:
        value = getattr(exercise, name)
        if not 0.0 < value < math.inf:
            raise ValueError(f"{name} must be above 0 and finite, got {value}")


def _in_time(seconds: float, limit: float) -> None:
    if not 0.0 < seconds <= limit <= LONGEST_SECONDS:
        raise ValueError(
            f"seconds must be above 0 and within time_limit_s, at most {LONGEST_SECONDS:g} s; "
            f"got {seconds} of {limit}"
        )


Exercise = HoldStretch | ApproachBreak | GentleDissection


class Trial:
    """One go at an exercise, judged tick by tick.

    Attributes
    ----------
    outcome
        How it has ended; None while it runs.
    progress
        How far it has come, from 0 to 1.
    """

    def __init__(self, time_limit: float) -> None:
        self._time_limit = time_limit
        self._ticks = 0
        self.outcome: Outcome | None = None
        self.progress = 0.0

    def take(self, figures: Figures) -> None:
        """Judge one tick.

        Parameters
        ----------
        figures
            What the instruments show.
        """
        if self.outcome is not None:
            return
        self._ticks += 1
        self.outcome = self.judge(figures)
        if self.outcome is None and self._ticks * TICK_SECONDS >= self._time_limit:
            self.outcome = Outcome(False, f"The {self._time_limit:g} s were over.")

    def judge(self, figures: Figures) -> Outcome | None:
        """Return how one more tick ends the exercise, or None; set `progress`.

        Parameters
        ----------
        figures
            What the instruments show.

        Returns
        -------
        Outcome | None
            The outcome.
        """
        raise NotImplementedError


class _Hold(Trial):
    def __init__(self, exercise: HoldStretch) -> None:
        super().__init__(exercise.time_limit_s)
        self._exercise = exercise
        self._stay = _Stay(exercise.seconds)

    def judge(self, figures: Figures) -> Outcome | None:
        wanted = self._exercise
        if figures.torn:
            return Outcome(False, f"The duct tore at {figures.force:.3g} N.")
        if figures.force > wanted.force_limit_N:
            return Outcome(
                False,
                f"The force reached {figures.force:.3g} N, past {wanted.force_limit_N:.3g} N.",
            )
        off = abs(figures.deflection - wanted.deflection_mm)
        done = self._stay.take(figures.held and off <= wanted.tolerance_mm)
        self.progress = self._stay.part
        if done:
            return Outcome(
                True,
                f"Held {wanted.deflection_mm:.1f} mm for {wanted.seconds:g} s within "
                f"{wanted.force_limit_N:.3g} N.",
            )
        return None


class _Approach(Trial):
    def __init__(self, exercise: ApproachBreak) -> None:
        super().__init__(exercise.time_limit_s)
        self._exercise = exercise
        self._stay = _Stay(exercise.seconds)
        self._nearest = 1.0

    def judge(self, figures: Figures) -> Outcome | None:
        margin = self._exercise.margin
        if figures.torn:
            return Outcome(False, f"The duct tore at {figures.force:.3g} N.")
        self._nearest = min(self._nearest, figures.distance_to_break)
        done = self._stay.take(figures.held and figures.distance_to_break <= margin)
        # Half for the way there, half for staying.
        way = min(max((1.0 - self._nearest) / (1.0 - margin), 0.0), 1.0)
        self.progress = 0.5 * way + 0.5 * self._stay.part
        if done:
            return Outcome(
                True, f"Came within {100.0 * self._nearest:.1f} % of the break and stayed whole."
            )
        return None


class _Dissection(Trial):
    def __init__(self, exercise: GentleDissection) -> None:
        super().__init__(exercise.time_limit_s)
        self._exercise = exercise

    def judge(self, figures: Figures) -> Outcome | None:
        spent, limit = figures.force_time_product, self._exercise.product_limit_N_s
        self.progress = 1.0 if figures.torn else min(max(1.0 - figures.distance_to_break, 0.0), 1.0)
        if spent > limit:
            return Outcome(False, f"More than {limit:.3g} N s was spent.")
        if figures.torn:
            return Outcome(True, f"Torn with {spent:.3g} N s of {limit:.3g} N s.")
        return None


class _Stay:
    """Counts the time for which something has held without a break."""

    def __init__(self, seconds: float) -> None:
        self._wanted = max(1, round(seconds / TICK_SECONDS))
        self._ticks = 0

    @property
    def part(self) -> float:
        return min(self._ticks / self._wanted, 1.0)

    def take(self, there: bool) -> bool:
        self._ticks = self._ticks + 1 if there else 0
        return self._ticks >= self._wanted


def trial_of(exercise: Exercise) -> Trial:
    """Return a fresh go at an exercise.

    Parameters
    ----------
    exercise
        The exercise.

    Returns
    -------
    Trial
        The trial.
    """
    if isinstance(exercise, HoldStretch):
        return _Hold(exercise)
    if isinstance(exercise, ApproachBreak):
        return _Approach(exercise)
    return _Dissection(exercise)
