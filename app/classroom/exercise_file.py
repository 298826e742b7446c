"""The exercise that a teacher sets: a small TOML file, and what it asks on a duct or an anatomy.

A limit that the file does not name follows from the duct, as in the trainer's own exercises.
"""

import textwrap
from typing import Any, Literal, get_args

import msgspec

from app.anatomy import anatomy_named, drawn_anatomy, shipped_anatomies
from app.bounded_file import decoded
from app.simulation import (
    AT_ANATOMY,
    EXERCISES,
    FEW,
    Exercise,
    Feedback,
    Limit,
    Preset,
    Session,
    Specimen,
    bed_named,
    exercises_offered,
    free_specimen,
    preset_named,
    renamed_exercise,
    renamed_goal,
    renamed_numbers,
    specimen_in_bed,
)
from organ_geometry import Organ

Goal = Literal[
    "window", "follow_front", "free_scar", "hold_stretch", "approach_break", "gentle_lifts",
    "stop_bleeding", "first_view", "critical_view", "who_is_who",
]  # fmt: skip
PULLS: tuple[Goal, ...] = ("hold_stretch", "approach_break", "gentle_lifts")
"""Those of a free duct."""
DRAWN = "drawn"
"""In the place of an anatomy's name: one that is drawn by published frequencies and a seed."""
GOALS: dict[Goal, str] = {goal: EXERCISES[goal].title for goal in get_args(Goal)}
TIME_LIMIT = "time_limit_s"
FREED = (
    "length_mm", "from_mm", "to_mm", "peak_stress_ratio", "strands_broken_out_of_sight",
    "shortest_time_to_break_s", "maximum_instrument_force_N", TIME_LIMIT,
)  # fmt: skip
HELD = (
    "low", "high", "seconds", "maximum_force_N", "mean_absolute_nonzero_force_N",
    "maximum_loading_rate_N_per_s", "overshoot", "smallest_distance_to_break", TIME_LIMIT,
)  # fmt: skip
AT_ANATOMY_LIMITS = (
    "blood_lost_ml", "peak_stress_ratio", "time_out_of_picture_s", TIME_LIMIT,
)  # fmt: skip
NUMBERS: dict[Goal, tuple[str, ...]] = {
    "window": FREED,
    "follow_front": FREED,
    "free_scar": FREED,
    "hold_stretch": ("deflection_mm", "tolerance_mm", *HELD[2:]),
    "approach_break": ("high", "seconds", "maximum_force_N", "maximum_loading_rate_N_per_s",
                       TIME_LIMIT),
    "gentle_lifts": ("repeats", "return_below", *HELD),
    "stop_bleeding": ("seconds", *AT_ANATOMY_LIMITS),
    "who_is_who": ("points", TIME_LIMIT),
    "first_view": ("points", "stay", "go", *AT_ANATOMY_LIMITS),
    "critical_view": ("points", "stay", "go", *AT_ANATOMY_LIMITS),
}  # fmt: skip
"""What an exercise file may give for a goal: fields of it, metrics that are limited, the time."""
USUAL = "normal"
LONGEST_TITLE, LONGEST_TEXT, LONGEST_FILE = 60, 1000, 20_000


class DuctChoice(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The duct and its bed; those of the class where nothing is named."""

    preset: str | None = None
    bed: str | None = None
    seed: int = 1  # of the bed's scatter, or of an anatomy that is drawn
    anatomy: str | None = None  # name of a shipped one, or "drawn"; the usual one if not named
    relaxes: bool = False  # while it is held, in a bed


class AssignedExercise(msgspec.Struct, frozen=True):
    """What an exercise file asks on a duct."""

    title: str
    text: str
    mode: Literal["dissect", "pull", "anatomy"]
    preset: str | None
    exercise: Exercise
    feedback: Feedback

    @property
    def json(self) -> str:
        """It as JSON."""
        return msgspec.json.encode(self).decode()

    @classmethod
    def of_json(cls, content: str) -> "AssignedExercise":
        """Return it from JSON."""
        plain = msgspec.json.decode(content)
        plain["exercise"] = msgspec.convert(renamed_exercise(plain["exercise"]), Exercise)
        plain["feedback"] = Feedback(plain["feedback"])
        return cls(**plain)


class ExerciseFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """An exercise as it stands in its file."""

    title: str
    goal: Goal
    text: str = ""
    feedback: Feedback = Feedback.CONTINUOUS
    duct: DuctChoice = DuctChoice()
    limits: dict[str, int | float] = {}
    errors: dict[str, int] = {}  # most incidents of a class that do not fail it

    def __post_init__(self) -> None:
        if not 0 < len(self.title.strip()) <= LONGEST_TITLE or not self.title.isprintable():
            raise ValueError(f"title must have 1 to {LONGEST_TITLE} characters")
        if len(self.text) > LONGEST_TEXT:
            raise ValueError(f"text must have at most {LONGEST_TEXT} characters")
        bedless = (*PULLS, *AT_ANATOMY)
        if self.goal in bedless and self.duct.bed is not None:
            raise ValueError(f"duct.bed does not go with {self.goal}, which has no bed")
        if self.goal in bedless and self.duct.relaxes:
            raise ValueError(f"duct.relaxes does not go with {self.goal}, which has no bed")
        if self.goal in AT_ANATOMY and self.duct.preset is not None:
            raise ValueError(f"duct.preset does not go with {self.goal}, which has an anatomy")
        anatomies = (*shipped_anatomies(), DRAWN)
        if self.duct.anatomy is not None and self.goal not in AT_ANATOMY:
            raise ValueError(f"duct.anatomy does not go with {self.goal}, which has one duct")
        if self.duct.anatomy not in (None, *anatomies):
            raise ValueError(
                f"duct.anatomy {self.duct.anatomy!r} is not there: {', '.join(anatomies)}"
            )
        numbers = NUMBERS[self.goal]
        if unknown := sorted(set(renamed_numbers(self.limits)) - set(numbers)):
            raise ValueError(
                f"limits.{unknown[0]} is none of {self.goal}; there are: {', '.join(numbers)}"
            )
        for error, most in self.errors.items():
            Limit(error, most)

    def on(self, organ: Organ, preset: Preset | None) -> AssignedExercise:
        """Return what it asks on the class's organ; this takes seconds the first time."""
        chosen = preset if self.duct.preset is None else preset_named(self.duct.preset)
        if self.goal in PULLS:
            specimen = free_specimen(organ, chosen)
        elif self.goal in AT_ANATOMY:
            drawn, name = self.duct.anatomy == DRAWN, self.duct.anatomy or USUAL
            anatomy = drawn_anatomy(self.duct.seed) if drawn else anatomy_named(name)
            specimen = Specimen.of_anatomy(anatomy)
        else:
            bed = None if self.duct.bed is None else bed_named(self.duct.bed)
            specimen = specimen_in_bed(organ, chosen, bed, bed_seed=self.duct.seed)
        span = specimen.beam.span
        offered = exercises_offered(Session(specimen, vertices=FEW), relaxes=self.duct.relaxes)
        found = next((each for each in offered if each.name == self.goal), None)
        if found is None:
            where = "at this anatomy" if self.goal in AT_ANATOMY else "on this duct in this bed"
            raise ValueError(f"goal {self.goal} cannot be reached {where}")
        opening = found.opening
        if opening is not None and self.duct.bed not in (None, opening.bed):
            raise ValueError(f"goal {self.goal} is not done in duct.bed {self.duct.bed!r}")
        try:
            asked = _limited(found, self.limits, self.errors)
        except msgspec.ValidationError as error:
            raise ValueError(f"limits or errors: {error}") from None
        if self.limits.get("to_mm", 0.0) > span + 1e-9:
            raise ValueError(f"limits.to_mm must be at most the duct's {span:.1f} mm")
        return AssignedExercise(
            title=self.title.strip(),
            text=self.text.strip(),
            mode=mode_of(found),
            preset=self.duct.preset,
            exercise=asked,
            feedback=self.feedback,
        )


def mode_of(exercise: Exercise) -> Literal["dissect", "pull", "anatomy"]:
    """Return what an exercise is done on: a duct in a bed, a free one, or an anatomy."""
    if exercise.opening is None:
        return "pull"
    return "dissect" if exercise.opening.anatomy is None else "anatomy"


def read_exercise(content: str) -> ExerciseFile:
    """Return the exercise in a TOML file."""
    if len(content) > LONGEST_FILE:
        raise ValueError(f"an exercise file has at most {LONGEST_FILE:,} characters")
    return decoded(_decoded, content, ExerciseFile, "this is no exercise file", lines=True)


def _decoded(content: str) -> Any:
    """Return what an exercise file holds, with the present name of its goal."""
    plain: Any = msgspec.toml.decode(content)
    if isinstance(goal := plain.get("goal"), str):
        plain["goal"] = goal.replace("-", "_")
    return plain


def _limited(
    exercise: Exercise, numbers: dict[str, int | float], errors: dict[str, int]
) -> Exercise:
    """Return an exercise with other numbers of its goal, limits, errors and time."""
    plain = msgspec.to_builtins(exercise.goal)
    fields = {*exercise.goal.__struct_fields__, "deflection_mm", "tolerance_mm"}
    numbers = renamed_numbers(numbers)
    goal = renamed_goal(plain | {key: each for key, each in numbers.items() if key in fields})
    limits = {key: each for key, each in numbers.items() if key not in {*fields, TIME_LIMIT}}
    changed = {"goal": goal, TIME_LIMIT: numbers.get(TIME_LIMIT, exercise.time_limit_s)}
    return msgspec.convert(
        msgspec.to_builtins(exercise.with_limits(limits | errors)) | changed, Exercise
    )


def template(goal: Goal) -> str:
    """Return an exercise file with a goal, in which everything else follows from the duct."""
    bed = f"""\
# preset = "thesis-bile-duct"
bed = "{"scar" if goal == "free_scar" else "normal"}"   # see: bluntdissect info --beds
seed = 1         # of the bed's scatter
"""
    if goal in PULLS:
        bed = '# preset = "thesis-bile-duct"\n'
    elif goal in AT_ANATOMY:
        bed = f"""\
anatomy = "{USUAL}"   # or {", ".join(each for each in shipped_anatomies() if each != USUAL)}
# anatomy = "drawn"   # by published frequencies, and a seed
# seed = 1
"""
    limits = textwrap.indent(textwrap.fill(", ".join(NUMBERS[goal]), 70), "# ")
    return f"""\
title = "{GOALS[goal]}"
text = ""  # what you tell the trainees, in a sentence or two
goal = "{goal}"
feedback = "continuous"   # or "fading", or "summary": figures only in the result

[duct]
{bed}
[limits]   # what is not named here follows from the duct; there are:
{limits}
time_limit_s = 120

[errors]   # most incidents of a class that do not fail it, docs/errors.md; of some it is 0 already
# repeated_holds = 3
"""
