"""Exercises: goals and limits that scale with the duct's own break, and when figures are seen."""

import math
from enum import StrEnum
from typing import ClassVar, Literal, Protocol

import msgspec
import numpy as np
from numpy.typing import NDArray

from app.simulation.clock import TICK_SECONDS
from physics import BreakEvent

__all__ = [
    "ApproachBreak",
    "Exercise",
    "ExerciseInputs",
    "Feedback",
    "GentleDissection",
    "HoldStretch",
    "LeastImpulse",
    "Outcome",
    "exercises_for",
    "feedback_visible",
    "goal_band",
]

LONGEST_SECONDS = 3600.0
"""An exercise is a matter of minutes; a longer one is a slip of the unit."""
MOST_LIFTS = 100
FADE_SECONDS = 30.0
"""Time after which fading feedback is gone."""
FADE_PERIOD = 3.0
"""Fading feedback comes once in so many seconds, for ever less of them."""

HOLD_PART, HOLD_TOLERANCE = 0.6, 0.05
"""Deflection to hold and how near, in deflections at break."""
HOLD_SECONDS = 3.0
SPARE_FORCE = 1.1
"""Limit of force over the largest that the hold needs."""
MARGIN = 0.15
STAY_SECONDS = 1.0
WORKING_SAFETY, LEAST_SAFETY = 2.0, 1.5
"""Strength over stress, the factor of safety, to work at and never to go below."""
BAND_PART = 0.08
"""Half of the working band, in deflections at its middle."""
SLACK_PART = 0.25
"""A duct that is led back, in deflections at the band's middle."""
LIFTS, LIFT_SECONDS = 3, 1.0
REACTION_SECONDS = 0.25
"""After which a hand answers to what its owner has seen (docs/measures.md, source 11)."""


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

    @property
    def band(self) -> tuple[float, float] | None:
        """Deflections between which the goal lies, mm."""
        return self.deflection_mm - self.tolerance_mm, self.deflection_mm + self.tolerance_mm

    @property
    def limits(self) -> dict[str, float]:
        """What is not to be passed, by the measure's name."""
        return {"maximum_force_N": self.force_limit_N}


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

    @property
    def band(self) -> tuple[float, float] | None:
        """None: the margin is at other deflections for each grasp."""
        return None

    @property
    def limits(self) -> dict[str, float]:
        """None but the tear itself."""
        return {}


class GentleDissection(msgspec.Struct, frozen=True, tag_field="exercise", tag="gentle-lifts"):
    """Lift the duct to a working height, keep it there and lead it back, several times, gently.

    Gentle is what is published as such: little force at its peak and on average, loaded slowly, not
    past the goal, with strength in reserve (docs/measures.md).

    Attributes
    ----------
    low_mm, high_mm
        Ends of the goal's band of deflections.
    slack_mm
        Deflection at or below which the duct is led back.
    seconds
        How long to stay in the band each time, s.
    lifts
        How many times.
    force_limit_N, mean_force_limit_N
        Largest force, and largest mean absolute non-zero force.
    loading_rate_limit_N_per_s
        Largest rate of loading.
    overshoot_limit
        Farthest way past the band, as a part of the deflection in its middle.
    reserve_limit
        Smallest distance to break, as a part of one.
    time_limit_s
        Time for all of it.
    """

    low_mm: float
    high_mm: float
    slack_mm: float
    seconds: float
    lifts: int
    force_limit_N: float  # noqa: N815
    mean_force_limit_N: float  # noqa: N815
    loading_rate_limit_N_per_s: float  # noqa: N815
    overshoot_limit: float
    reserve_limit: float
    time_limit_s: float = 90.0
    title: ClassVar[str] = "Dissect gently"

    def __post_init__(self) -> None:
        _above_zero(
            self, "slack_mm", "low_mm", "high_mm", "force_limit_N", "mean_force_limit_N",
            "loading_rate_limit_N_per_s", "overshoot_limit",
        )  # fmt: skip
        if not self.slack_mm < self.low_mm < self.high_mm:
            raise ValueError(
                f"slack_mm, low_mm and high_mm must rise, got {self.slack_mm}, {self.low_mm} and "
                f"{self.high_mm}"
            )
        if not 0.0 < self.reserve_limit < 1.0:
            raise ValueError(f"reserve_limit must be above 0 and below 1, got {self.reserve_limit}")
        if not 1 <= self.lifts <= MOST_LIFTS:
            raise ValueError(f"lifts must be from 1 to {MOST_LIFTS}, got {self.lifts}")
        _in_time(self.seconds, self.time_limit_s)

    @property
    def goal(self) -> str:
        """What to do, in one sentence."""
        return (
            f"Lift the duct {self.lifts} times to {self.low_mm:.1f} to {self.high_mm:.1f} mm, keep "
            f"it there for {self.seconds:g} s, and lead it back by hand."
        )

    @property
    def limit(self) -> str:
        """What not to do, in one sentence."""
        return (
            f"At most {self.force_limit_N:.3g} N, on average {self.mean_force_limit_N:.3g} N, "
            f"loaded by at most {self.loading_rate_limit_N_per_s:.3g} N/s, no more than "
            f"{100.0 * self.overshoot_limit:.0f} % past the goal, with "
            f"{100.0 * self.reserve_limit:.0f} % left to the break."
        )

    @property
    def band(self) -> tuple[float, float] | None:
        """Deflections between which the goal lies, mm."""
        return self.low_mm, self.high_mm

    @property
    def limits(self) -> dict[str, float]:
        """What is not to be passed, by the measure's name."""
        return {
            "maximum_force_N": self.force_limit_N,
            "mean_absolute_nonzero_force_N": self.mean_force_limit_N,
            "maximum_loading_rate_N_per_s": self.loading_rate_limit_N_per_s,
            "overshoot": self.overshoot_limit,
            "smallest_distance_to_break": self.reserve_limit,
        }


class LeastImpulse(msgspec.Struct, frozen=True, tag_field="exercise", tag="gentle-dissection"):
    """Tear the duct with the least force-time product: an exercise of run files of version 1 only.

    It rewards the quickest pull, so it is not offered any more.

    Attributes
    ----------
    product_limit_N_s
        Largest force-time product, N s.
    time_limit_s
        Time for all of it.
    """

    product_limit_N_s: float  # noqa: N815
    time_limit_s: float = 60.0
    title: ClassVar[str] = "Least force-time product"

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

    @property
    def band(self) -> tuple[float, float] | None:
        """None: the goal is a tear."""
        return None

    @property
    def limits(self) -> dict[str, float]:
        """What is not to be passed, by the measure's name."""
        return {"force_time_product_N_s": self.product_limit_N_s}


Exercise = HoldStretch | ApproachBreak | GentleDissection | LeastImpulse

ExerciseInputs = Literal["hand", "any"]
"""What an exercise is done with: the hand alone, or sliders and keys as well."""


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


class DuctLimits(Protocol):
    """What exercises are set by: where a grasped duct breaks, and its curve on the way there."""

    @property
    def breaks_at(self) -> BreakEvent | None:
        """Load at which it breaks; None if it cannot."""
        ...

    def load_at(self, part: float) -> BreakEvent | None:
        """Return the load under which the highest stress is a part of the threshold."""
        ...

    def curve(self, count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return deflections and forces, mm and N."""
        ...


def exercises_for(duct: DuctLimits) -> tuple[Exercise, ...]:
    """Return the exercises for a duct."""
    event = duct.breaks_at
    working, most = (duct.load_at(1.0 / each) for each in (WORKING_SAFETY, LEAST_SAFETY))
    if event is None or working is None or most is None:
        return ()
    deflections, forces = duct.curve(60)
    band = (HOLD_PART + HOLD_TOLERANCE) * event.deflection
    needed = float(np.interp(band, deflections, forces))
    middle = working.deflection
    high = (1.0 + BAND_PART) * middle
    return (
        HoldStretch(
            deflection_mm=HOLD_PART * event.deflection,
            tolerance_mm=HOLD_TOLERANCE * event.deflection,
            seconds=HOLD_SECONDS,
            force_limit_N=SPARE_FORCE * needed,
        ),
        ApproachBreak(margin=MARGIN, seconds=STAY_SECONDS),
        GentleDissection(
            low_mm=(1.0 - BAND_PART) * middle,
            high_mm=high,
            slack_mm=SLACK_PART * middle,
            seconds=LIFT_SECONDS,
            lifts=LIFTS,
            force_limit_N=most.force,
            mean_force_limit_N=working.force,
            # From the largest force that is allowed it would reach the break in a reaction time.
            loading_rate_limit_N_per_s=(event.force - most.force) / REACTION_SECONDS,
            overshoot_limit=(most.deflection - high) / middle,
            reserve_limit=1.0 - 1.0 / LEAST_SAFETY,
        ),
    )


def goal_band(exercise: Exercise, duct: DuctLimits) -> tuple[float, float] | None:
    """Return the deflections between which an exercise's goal lies."""
    event = duct.breaks_at
    if not isinstance(exercise, ApproachBreak) or event is None:
        return exercise.band
    near = duct.load_at(1.0 - exercise.margin)
    return None if near is None else (near.deflection, event.deflection)


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
