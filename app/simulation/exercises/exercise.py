"""Exercises as data: a goal, limits that fail it, what it starts from; when figures are seen."""

import math
from enum import StrEnum
from typing import Literal

import msgspec

from app.anatomy import Anatomy
from app.bed_preset import BedPreset
from app.simulation.exercises.errors import ERROR_CLASSES
from app.simulation.exercises.exercise_table import EXERCISES
from app.simulation.exercises.goals import (
    CriticalView,
    Goal,
    WhoIsWho,
)
from app.simulation.exercises.metrics import METRIC_OF
from app.simulation.inputs.inputs import INSTRUMENTS, Instrument, Structure

LONGEST_SECONDS = 3600.0
"""Exercises take minutes; a longer time limit is most likely in the wrong unit and is refused."""
FADE_SECONDS = 30.0
"""s after which fading feedback is gone."""
# s. Fading feedback is shown once in each period, for a shorter part each time.
FADE_PERIOD = 3.0
HANDS = 2
MOST_LIFTED_MM = 20.0
FRACTIONS = ("peak_stress_ratio", "smallest_distance_to_break")
"""Metrics from 0 to 1: a limit at either end limits nothing, or all."""


class Limit(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """What fails an exercise: a metric past a value, or more incidents than so many."""

    of: str  # key of a metric, or of a class of errors
    value: float  # the most, or the least of a metric of which more is better
    at_end: bool = False  # judged once the goal is reached only

    def __post_init__(self) -> None:
        # A whole number is written as one, and read as another kind of number.
        msgspec.structs.force_setattr(self, "value", float(self.value))
        if self.of in ERROR_CLASSES:
            if not (self.value >= 0.0 and float(self.value).is_integer()):
                raise ValueError(f"{self.of} must be 0 or more incidents, got {self.value:g}")
        elif self.of not in METRIC_OF:
            raise ValueError(
                f"{self.of!r} is no metric and no class of errors; there are: "
                f"{', '.join((*METRIC_OF, *ERROR_CLASSES))}"
            )
        elif self.of in FRACTIONS and not 0.0 < self.value < 1.0:
            raise ValueError(f"{self.of} must be above 0 and below 1, got {self.value}")
        elif not 0.0 <= self.value < math.inf:
            raise ValueError(f"{self.of} must be 0 or more and finite, got {self.value}")
        elif self.value == 0.0 and METRIC_OF[self.of].unit:
            raise ValueError(f"{self.of} must be above 0 {METRIC_OF[self.of].unit}, got 0")

    def passed_by(self, value: float) -> bool:
        """Return whether a metric's value, or a number of incidents, is past it."""
        metric = METRIC_OF.get(self.of)
        if metric is not None and metric.better == "higher":
            return value < self.value
        return value > self.value


class Opening(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """The bed or the anatomy that an exercise is done in, and what is free of it at the start."""

    bed: str | BedPreset | None = None
    bed_seed: int = 1  # of the bed's scatter
    opened_mm: tuple[float, float] | None = None  # free at the start
    divided: bool = False  # the duct ends at its second clamp, which is gone
    relaxes: bool = False  # whether strands and walls relax while they are held
    anatomy: str | Anatomy | None = None  # name of a shipped one, or another in full
    torn: str | None = None  # tube of it that tears in its middle with the first touch
    soils: bool = True  # whether a scope's lens is soiled by jets of blood and by touch
    # part of what holds its structures that has parted, the nearest to the viewer first, 0 to 1
    exposed: float | None = None
    lifted_mm: float = 0.0  # by a grasper on the gallbladder, off the bed and off the junction

    def __post_init__(self) -> None:
        if (self.bed is None) == (self.anatomy is None):
            raise ValueError("opening must have a bed or an anatomy, one of them")
        if self.torn is not None and self.anatomy is None:
            raise ValueError("opening has a torn tube, which only an anatomy has")
        shown = self.exposed is not None or self.lifted_mm != 0.0
        if shown and self.anatomy is None:
            raise ValueError("opening exposes and lifts at an anatomy only")
        if self.exposed is not None and not 0.0 <= self.exposed <= 1.0:
            raise ValueError(f"exposed must be from 0 to 1, got {self.exposed}")
        if not 0.0 <= self.lifted_mm <= MOST_LIFTED_MM:
            raise ValueError(f"lifted_mm must be 0 to {MOST_LIFTED_MM:g}, got {self.lifted_mm}")
        opened = self.opened_mm
        if opened is not None and not 0.0 <= opened[0] < opened[1] < math.inf:
            raise ValueError(f"opened_mm must rise, got {opened}")


class Exercise(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """A goal, and the limits that fail it; without an `opening` on a free duct in a plane."""

    name: str
    title: str
    goal: Goal
    method: str = ""  # how it is reached, as it follows a colon
    limits: tuple[Limit, ...] = ()  # in the order in which they are looked at
    opening: Opening | None = None
    instruments: tuple[Instrument, ...] = INSTRUMENTS
    in_hand: tuple[Instrument, ...] = ()  # what each hand has at the start, if not the usual
    about: tuple[str, ...] | None = None  # names of the tubes that it is about; None: any
    time_limit_s: float = 60.0

    def __post_init__(self) -> None:
        for each in self.in_hand:
            if each not in self.instruments:
                raise ValueError(f"in_hand has {each!r}, which is none of instruments")
        if len(self.in_hand) > HANDS:
            raise ValueError(f"in_hand must be of {HANDS} hands at most, got {self.in_hand}")
        if not 0.0 < self.goal.least_seconds <= self.time_limit_s <= LONGEST_SECONDS:
            raise ValueError(
                f"time_limit_s must be at most {LONGEST_SECONDS:g} s and long enough for the "
                f"goal's {self.goal.least_seconds:.3g} s, got {self.time_limit_s}"
            )

    @property
    def first_hand(self) -> int:
        """The number of the hand that is led at the start."""
        kind = EXERCISES.get(self.name)
        return 0 if kind is None else kind.first_hand

    @property
    def structures(self) -> tuple[Structure, ...]:
        """What is to be pointed at."""
        goal = self.goal
        return goal.structures if isinstance(goal, CriticalView | WhoIsWho) else ()

    @property
    def looks_only(self) -> bool:
        """Whether no hand moves: it is pointed at, or said that nothing can safely be told."""
        return isinstance(self.goal, WhoIsWho)

    @property
    def shows_view(self) -> bool:
        """Whether it asks for points of the critical view of safety."""
        return isinstance(self.goal, CriticalView)

    @property
    def points_from(self) -> float:
        """The progress, 0 to 1, from which on it is pointed at."""
        return 0.5 if self.shows_view else 0.0

    @property
    def task(self) -> str:
        """What to do, in one sentence."""
        return f"{self.goal.words}: {self.method}." if self.method else f"{self.goal.words}."

    @property
    def caution(self) -> str:
        """What not to do, in one sentence; `failing` names the errors."""
        opening = self.opening
        words = ["do not tear the duct"]
        if opening is not None and opening.anatomy is not None:
            words = ["tear nothing" if opening.torn is None else "tear nothing else"]
        words = words if "tear" in self.limit_of else []
        words += [METRIC_OF[each.of].limit_words(each.value) for each in self.limits
                  if each.of in METRIC_OF]  # fmt: skip
        text = "; ".join(words)
        if not text:
            return "Errors alone limit it." if self.failing else "Nothing but time limits it."
        return f"{text[0].upper()}{text[1:]}."

    @property
    def failing(self) -> list[str]:
        """Titles of the errors that fail it, but a tear."""
        return [ERROR_CLASSES[key].title for key in self.errors if key != "tear"]

    @property
    def full_caution(self) -> str:
        """`caution`, and in a second sentence the errors that fail it."""
        errors = f" These errors fail it: {', '.join(self.failing).lower()}."
        return f"{self.caution}{errors if self.failing else ''}"

    @property
    def limit_of(self) -> dict[str, float]:
        """Its limits by the key of their metric or class of errors."""
        return {each.of: each.value for each in self.limits}

    @property
    def errors(self) -> dict[str, float]:
        """The most incidents of each class that do not fail it."""
        return {each.of: each.value for each in self.limits if each.of in ERROR_CLASSES}

    def by_hands_alone(self) -> "Exercise":
        """Return it without what is pointed at: a critical view is over once it is reached."""
        if not isinstance(self.goal, CriticalView):
            return self
        return msgspec.structs.replace(self, goal=CriticalView(self.goal.points))

    def with_limits(self, values: dict[str, float]) -> "Exercise":
        """Return it with other limits, or with some more."""
        kept = tuple(
            msgspec.structs.replace(each, value=values[each.of]) if each.of in values else each
            for each in self.limits
        )
        more = tuple(Limit(of, value) for of, value in values.items() if of not in self.limit_of)
        return msgspec.structs.replace(self, limits=kept + more)


ExerciseInputs = Literal["hand", "any"]
"""Inputs that count in an exercise: the hand alone, or sliders and keys as well."""


class Outcome(msgspec.Struct, frozen=True):
    """How an exercise has ended: passed or not, and the reason in one sentence."""

    passed: bool
    reason: str


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
