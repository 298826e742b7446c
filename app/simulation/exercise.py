"""Exercises: goals and limits that scale with the duct's own break, and when figures are seen."""

import math
from enum import StrEnum
from typing import ClassVar, Literal

import msgspec
import numpy as np

from app.simulation.clock import TICK_SECONDS
from app.simulation.grasped_beam import GraspedBeam

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
"""Exercises take minutes; a longer time limit is most likely in the wrong unit and is refused."""
MOST_LIFTS = 100
FADE_SECONDS = 30.0
"""s after which fading feedback is gone."""
# s. Fading feedback is shown once in each period, for a shorter part each time.
FADE_PERIOD = 3.0

# Deflection to hold, and its tolerance, over the deflection at break.
HOLD_PART, HOLD_TOLERANCE = 0.6, 0.05
HOLD_SECONDS = 3.0
SPARE_FORCE = 1.1
"""Force limit over the largest that the hold needs."""
MARGIN = 0.15  # distance to break to approach, the same as the read-out's "Stop"
STAY_SECONDS = 1.0
# Factors of safety, strength over stress: to work at, and never to go below.
WORKING_SAFETY, LEAST_SAFETY = 2.0, 1.5
# Half width of the working band, over the deflection at its middle.
BAND_PART = 0.08
# Deflection at which the duct counts as led back, over that at the band's middle.
SLACK_PART = 0.25
LIFTS, LIFT_SECONDS = 3, 1.0
REACTION_SECONDS = 0.25
"""s, a visual reaction time (docs/measures.md, source 11)."""


class HoldStretch(msgspec.Struct, frozen=True, tag_field="exercise", tag="hold-stretch"):
    """Hold a given deflection for a time without exceeding a force."""

    deflection_mm: float  # of the grasp
    tolerance_mm: float
    seconds: float  # s within the tolerance without leaving it
    force_limit_N: float  # a larger force fails the exercise  # noqa: N815
    time_limit_s: float = 60.0  # for the whole exercise
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
        """Limits that fail the exercise, by the measure's name."""
        return {"maximum_force_N": self.force_limit_N}


class ApproachBreak(msgspec.Struct, frozen=True, tag_field="exercise", tag="approach-break"):
    """Approach the break to a margin, stay there for a time, and do not tear the duct."""

    margin: float  # distance to break to reach, 0 to 1
    seconds: float  # s to stay at or below the margin
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
        """None: the deflection at which the margin is reached differs with the grasp."""
        return None

    @property
    def limits(self) -> dict[str, float]:
        """Empty: only the tear fails it."""
        return {}


class GentleDissection(msgspec.Struct, frozen=True, tag_field="exercise", tag="gentle-lifts"):
    """Lift the duct to a working height, keep it there and lead it back, several times, gently.

    Gentle is meant as in the literature: low peak and mean force, slow loading, no overshoot, and
    strength in reserve (docs/measures.md has the sources).
    """

    low_mm: float  # lower end of the goal's band of deflections
    high_mm: float  # upper end
    slack_mm: float  # led back is at or below this deflection
    seconds: float  # s to stay in the band at each lift
    lifts: int
    force_limit_N: float  # noqa: N815
    mean_force_limit_N: float  # of the mean absolute non-zero force  # noqa: N815
    loading_rate_limit_N_per_s: float  # noqa: N815
    overshoot_limit: float  # above the band, over the deflection at its middle
    reserve_limit: float  # smallest distance to break, 0 to 1
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
        """Limits that fail the exercise, by the measure's name."""
        return {
            "maximum_force_N": self.force_limit_N,
            "mean_absolute_nonzero_force_N": self.mean_force_limit_N,
            "maximum_loading_rate_N_per_s": self.loading_rate_limit_N_per_s,
            "overshoot": self.overshoot_limit,
            "smallest_distance_to_break": self.reserve_limit,
        }


class LeastImpulse(msgspec.Struct, frozen=True, tag_field="exercise", tag="gentle-dissection"):
    """Tear the duct with the least force-time product: only in run files of version 1.

    It rewards the quickest pull, so it is not offered any more.
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
        """Limits that fail the exercise, by the measure's name."""
        return {"force_time_product_N_s": self.product_limit_N_s}


Exercise = HoldStretch | ApproachBreak | GentleDissection | LeastImpulse

ExerciseInputs = Literal["hand", "any"]
"""Inputs that count in an exercise: the hand alone, or sliders and keys as well."""


class Outcome(msgspec.Struct, frozen=True):
    """How an exercise has ended: passed or not, and the reason in one sentence."""

    passed: bool
    reason: str


def exercises_for(duct: GraspedBeam) -> tuple[Exercise, ...]:
    """Return the exercises for a duct, scaled by its break; none if it cannot break."""
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
            # At this rate the largest allowed force would grow to the break within a reaction time.
            loading_rate_limit_N_per_s=(event.force - most.force) / REACTION_SECONDS,
            overshoot_limit=(most.deflection - high) / middle,
            reserve_limit=1.0 - 1.0 / LEAST_SAFETY,
        ),
    )


def goal_band(exercise: Exercise, duct: GraspedBeam) -> tuple[float, float] | None:
    """Return the deflections between which the goal lies, mm; None without such a goal."""
    event = duct.breaks_at
    if not isinstance(exercise, ApproachBreak) or event is None:
        return exercise.band
    near = duct.load_at(1.0 - exercise.margin)
    return None if near is None else (near.deflection, event.deflection)


class Feedback(StrEnum):
    """When the trainee sees the figures. Continuous feedback can make a learner dependent on it."""

    CONTINUOUS = "continuous"
    FADING = "fading"
    SUMMARY = "summary"


def feedback_visible(feedback: Feedback, seconds: float, *, over: bool) -> bool:
    """Return whether the figures are shown.

    Parameters
    ----------
    feedback
        Continuous: always shown. Summary: never before the end. Fading: in each period of 3 s, at
        first all the time, then for a part that falls linearly to none at 30 s.
    seconds
        Time since the start of the run, s.
    over
        Whether the run is over; then they are always shown.

    Returns
    -------
    bool

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
