"""Exercises: goals and limits that scale with the duct's own break, and when figures are seen."""

import math
from enum import StrEnum
from typing import ClassVar, Literal

import msgspec
import numpy as np

from app.simulation.bed_preset import BedPreset
from app.simulation.clock import REACTION_SECONDS, TICK_SECONDS
from app.simulation.errors import ERROR_CLASSES
from app.simulation.grasped_beam import GraspedBeam
from app.simulation.inputs import Instrument

__all__ = [
    "TITLES",
    "ApproachBreak",
    "BedExercise",
    "BedExerciseName",
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


class HoldStretch(msgspec.Struct, frozen=True, tag_field="exercise", tag="hold_stretch"):
    """Hold a given deflection for a time without exceeding a force."""

    deflection_mm: float  # of the grasp
    tolerance_mm: float
    seconds: float  # s within the tolerance without leaving it
    force_limit_N: float  # a larger force fails the exercise  # noqa: N815
    time_limit_s: float = 60.0  # for the whole exercise
    errors: dict[str, int] = {}  # as those of `BedExercise`
    title: ClassVar[str] = "Hold a stretch"

    def __post_init__(self) -> None:
        _known_errors(self.errors)
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
        return f"Never pull with more than {self.force_limit_N:.3g} N.{_titles(self.errors)}"

    @property
    def band(self) -> tuple[float, float] | None:
        """Deflections between which the goal lies, mm."""
        return self.deflection_mm - self.tolerance_mm, self.deflection_mm + self.tolerance_mm

    @property
    def limits(self) -> dict[str, float]:
        """Limits that fail the exercise, by the measure's name."""
        return {"maximum_force_N": self.force_limit_N}


class ApproachBreak(msgspec.Struct, frozen=True, tag_field="exercise", tag="approach_break"):
    """Approach the break to a margin, stay there for a time, and do not tear the duct."""

    margin: float  # distance to break to reach, 0 to 1
    seconds: float  # s to stay at or below the margin
    time_limit_s: float = 60.0
    errors: dict[str, int] = {}  # as those of `BedExercise`
    title: ClassVar[str] = "Approach the break"

    def __post_init__(self) -> None:
        _known_errors(self.errors)
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
        return f"Do not tear the duct.{_titles(self.errors)}"

    @property
    def band(self) -> tuple[float, float] | None:
        """None: the deflection at which the margin is reached differs with the grasp."""
        return None

    @property
    def limits(self) -> dict[str, float]:
        """Empty: only the tear fails it."""
        return {}


class GentleDissection(msgspec.Struct, frozen=True, tag_field="exercise", tag="gentle_lifts"):
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


class LeastImpulse(msgspec.Struct, frozen=True, tag_field="exercise", tag="least_impulse"):
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


BedExerciseName = Literal["window", "follow_front", "free_scar"]
TITLES: dict[BedExerciseName, str] = {
    "window": "Open a window",
    "follow_front": "Follow the front",
    "free_scar": "Free a scar with two hands",
}


class BedExercise(
    msgspec.Struct,
    frozen=True,
    forbid_unknown_fields=True,
    tag_field="exercise",
    tag="free_stretch",
):
    """Free a stretch of duct within limits of what its wall and the tissue behind it bear."""

    name: BedExerciseName
    bed: str | BedPreset
    bed_seed: int
    free_mm: float  # length that is to be free between `from_mm` and `to_mm`
    from_mm: float  # from the first clamp
    to_mm: float
    instruments: tuple[Instrument, ...]
    stress_ratio_limit: float  # largest stress in the wall over its threshold
    time_to_break_limit_s: float  # at the pace at which that share grows
    out_of_sight_limit: int  # strands
    instrument_force_limit_N: float | None = None  # on jaws or a swab  # noqa: N815
    opened_mm: tuple[float, float] | None = None  # free at the start
    divided: bool = False  # the duct ends at its second clamp, which is gone
    time_limit_s: float = 120.0
    one_stretch: bool = False  # whether `free_mm` are of one free stretch, or of all
    # by the key of an error class, the most incidents that do not fail it (docs/errors.md)
    errors: dict[str, int] = {}

    def __post_init__(self) -> None:
        if not 0.0 <= self.from_mm < self.to_mm < math.inf:
            raise ValueError(f"from_mm and to_mm must rise, got {self.from_mm} and {self.to_mm}")
        if not 0.0 < self.free_mm <= self.to_mm - self.from_mm:
            raise ValueError(f"free_mm must be above 0 and within to_mm, got {self.free_mm}")
        if not 0.0 < self.stress_ratio_limit < 1.0:
            raise ValueError(
                f"stress_ratio_limit must be above 0 and below 1, got {self.stress_ratio_limit}"
            )
        if not 0.0 <= self.time_to_break_limit_s < math.inf:
            raise ValueError(
                f"time_to_break_limit_s must be 0 or more, got {self.time_to_break_limit_s}"
            )
        force = self.instrument_force_limit_N
        if force is not None and not 0.0 < force < math.inf:
            raise ValueError(f"instrument_force_limit_N must be above 0 and finite, got {force}")
        if self.opened_mm is not None and not (
            0.0 <= self.opened_mm[0] < self.opened_mm[1] < math.inf
        ):
            raise ValueError(f"opened_mm must rise, got {self.opened_mm}")
        _known_errors(self.errors)
        if self.out_of_sight_limit < 0:
            raise ValueError(f"out_of_sight_limit must be 0 or more, got {self.out_of_sight_limit}")
        if not 0.0 < self.time_limit_s <= LONGEST_SECONDS:
            raise ValueError(
                f"time_limit_s must be above 0 and at most {LONGEST_SECONDS:g} s, "
                f"got {self.time_limit_s}"
            )

    @property
    def title(self) -> str:
        """Its title."""
        return TITLES[self.name]

    @property
    def goal(self) -> str:
        """What to do, in one sentence."""
        if self.name == "window":
            return (
                f"Pass the dissector behind the duct and open it until {self.free_mm:.0f} mm "
                + ("are free in one stretch." if self.one_stretch else "are free.")
            )
        if self.name == "follow_front":
            return (
                f"The duct is divided and its end is free: from there, free {self.free_mm:.0f} mm "
                f"more with the hook: take hold at the front, lift, let go, take hold again."
            )
        return (
            f"Hold the duct up with one hand and open the dissector behind it with the other until "
            f"the scar's {self.free_mm:.0f} mm are free."
        )

    @property
    def limit(self) -> str:
        """What not to do, in one sentence."""
        force, seconds = self.instrument_force_limit_N, self.time_to_break_limit_s
        return (
            f"Never load the wall past {100.0 * self.stress_ratio_limit:.0f} % of its break"
            + (f", nor so fast that it would break within {seconds:g} s" if seconds else "")
            + (f", nor push the instrument with more than {force:.2g} N" if force else "")
            + f"; tear no more than {self.out_of_sight_limit} strands out of sight."
            + _titles(self.errors)
        )

    @property
    def band(self) -> tuple[float, float] | None:
        """None: the goal is a free length."""
        return None

    @property
    def limits(self) -> dict[str, float]:
        """Limits that fail the exercise, by the measure's name."""
        found = {
            "peak_stress_ratio": self.stress_ratio_limit,
            "strands_broken_out_of_sight": float(self.out_of_sight_limit),
        }
        if self.time_to_break_limit_s > 0.0:
            found["shortest_time_to_break_s"] = self.time_to_break_limit_s
        if self.instrument_force_limit_N is not None:
            found["maximum_instrument_force_N"] = self.instrument_force_limit_N
        return found

    def freed(self, stretches: list[tuple[float, float]]) -> float:
        """Return the length that is free within the goal's ends, mm: of all stretches or of one."""
        inside = [min(b, self.to_mm) - max(a, self.from_mm) for a, b in stretches]
        return (max if self.one_stretch else sum)([0.0, *(each for each in inside if each > 0.0)])

    def standing(self, freed: float) -> str:
        """Return how much of what is asked for is free, in words."""
        where = " in one stretch" if self.one_stretch else ""
        return f"{freed:.0f} of {self.free_mm:.0f} mm free{where}"


Exercise = HoldStretch | ApproachBreak | GentleDissection | LeastImpulse | BedExercise

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


def _known_errors(errors: dict[str, int]) -> None:
    for error, most in errors.items():
        if error not in ERROR_CLASSES:
            raise ValueError(
                f"errors has {error!r}, which is no class of errors; there are: "
                f"{', '.join(ERROR_CLASSES)}"
            )
        if most < 0:
            raise ValueError(f"errors.{error} must be 0 or more incidents, got {most}")


def _titles(errors: dict[str, int]) -> str:
    """Return a sentence that names the errors that fail an exercise, after a blank."""
    titles = ", ".join(ERROR_CLASSES[error].title.lower() for error in errors)
    return f" These errors fail it: {titles}." if titles else ""


def _in_time(seconds: float, limit: float) -> None:
    if not 0.0 < seconds <= limit <= LONGEST_SECONDS:
        raise ValueError(
            f"seconds must be above 0 and within time_limit_s, at most {LONGEST_SECONDS:g} s; "
            f"got {seconds} of {limit}"
        )
