"""The exercise that a teacher sets: a small TOML file, and what it asks on the class's duct.

A limit that the file does not name follows from the duct, as in the trainer's own exercises.
"""

import textwrap
from typing import Any, Literal

import msgspec

from app.bounded_file import decoded
from app.simulation import (
    TITLES,
    ApproachBreak,
    BedExercise,
    Exercise,
    Feedback,
    GentleDissection,
    HoldStretch,
    Preset,
    Session,
    bed_named,
    free_specimen,
    preset_named,
    renamed_exercise,
    specimen_in_bed,
)
from organ_geometry import Organ

__all__ = ["GOALS", "ExerciseFile", "Goal", "SetExercise", "read_exercise", "template"]

Goal = Literal[
    "window", "follow_front", "free_scar", "hold_stretch", "approach_break", "gentle_lifts"
]
PULLS: dict[Goal, type[HoldStretch | ApproachBreak | GentleDissection]] = {
    "hold_stretch": HoldStretch,
    "approach_break": ApproachBreak,
    "gentle_lifts": GentleDissection,
}
GOALS: dict[Goal, str] = {**TITLES, **{goal: kind.title for goal, kind in PULLS.items()}}
# Fields of an exercise that are no limits.
FIXED = {"name", "bed", "bed_seed", "instruments", "opened_mm", "divided", "one_stretch", "errors"}
LONGEST_TITLE, LONGEST_TEXT, LONGEST_FILE = 60, 1000, 20_000
FEW = 300
"""Vertices of a duct that nobody sees."""


class DuctChoice(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The duct and its bed; those of the class where nothing is named."""

    preset: str | None = None
    bed: str | None = None
    seed: int = 1  # of the bed's scatter


class SetExercise(msgspec.Struct, frozen=True):
    """What an exercise file asks on a duct."""

    title: str
    text: str
    mode: Literal["dissect", "pull"]
    preset: str | None
    exercise: Exercise
    feedback: Feedback

    @property
    def json(self) -> str:
        """It as JSON."""
        return msgspec.json.encode(self).decode()

    @classmethod
    def of_json(cls, content: str) -> "SetExercise":
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
        if self.goal in PULLS and self.duct.bed is not None:
            raise ValueError(f"duct.bed does not go with {self.goal}, which has no bed")
        if self.errors and self.goal == "gentle_lifts":
            raise ValueError("errors do not go with gentle_lifts, which has limits only")
        if unknown := sorted(set(self.limits) - set(_limits(self.goal))):
            raise ValueError(
                f"limits.{unknown[0]} is none of {self.goal}; there are: "
                f"{', '.join(_limits(self.goal))}"
            )

    def on(self, organ: Organ, preset: Preset | None) -> SetExercise:
        """Return what it asks on the class's organ; this takes seconds the first time."""
        chosen = preset if self.duct.preset is None else preset_named(self.duct.preset)
        if self.goal in PULLS:
            specimen = free_specimen(organ, chosen)
        else:
            bed = None if self.duct.bed is None else bed_named(self.duct.bed)
            specimen = specimen_in_bed(organ, chosen, bed, bed_seed=self.duct.seed)
        span = specimen.beam.span
        named = {each.title: each for each in Session(specimen, vertices=FEW).exercises_offered()}
        found = named.get(GOALS[self.goal])
        if found is None:
            raise ValueError(f"goal {self.goal} cannot be reached on this duct in this bed")
        if isinstance(found, BedExercise) and self.duct.bed not in (None, found.bed):
            raise ValueError(f"goal {self.goal} is not done in duct.bed {self.duct.bed!r}")
        try:
            plain = msgspec.to_builtins(found) | self.limits
            if self.errors:
                plain["errors"] |= self.errors
            asked = msgspec.convert(plain, type(found))
        except msgspec.ValidationError as error:
            raise ValueError(f"limits or errors: {error}") from None
        if isinstance(asked, BedExercise) and asked.to_mm > span + 1e-9:
            raise ValueError(f"limits.to_mm must be at most the duct's {span:.1f} mm")
        return SetExercise(
            title=self.title.strip(),
            text=self.text.strip(),
            mode="pull" if self.goal in PULLS else "dissect",
            preset=self.duct.preset,
            exercise=asked,
            feedback=self.feedback,
        )


def read_exercise(content: str) -> ExerciseFile:
    """Return the exercise in a TOML file."""
    if len(content) > LONGEST_FILE:
        raise ValueError(f"an exercise file has at most {LONGEST_FILE:,} characters")
    return decoded(_decoded, content, ExerciseFile, "this is no exercise file")


def _decoded(content: str, *, type: type[ExerciseFile]) -> ExerciseFile:  # noqa: A002
    """Return an exercise file, in which older names of goals and limits stand for the present."""
    plain: Any = msgspec.toml.decode(content)
    if isinstance(goal := plain.get("goal"), str):
        plain["goal"] = goal.replace("-", "_")
    limits: Any = plain.get("limits")
    if isinstance(limits, dict) and "share_limit" in limits:
        plain["limits"] = limits | {"stress_ratio_limit": limits["share_limit"]}
        del plain["limits"]["share_limit"]
    return msgspec.convert(plain, type)


def template(goal: Goal) -> str:
    """Return an exercise file with a goal, in which everything else follows from the duct."""
    bed = (
        ""
        if goal in PULLS
        else f"""\
bed = "{"scar" if goal == "free_scar" else "normal"}"   # see: bluntdissect info --beds
seed = 1         # of the bed's scatter
"""
    )
    limits = textwrap.indent(textwrap.fill(", ".join(_limits(goal)), 70), "# ")
    errors = (
        ""
        if goal == "gentle_lifts"
        else """
[errors]   # most incidents of a class that do not fail it, docs/errors.md; of some it is 0 already
# repeated_holds = 3
"""
    )
    return f"""\
title = "{GOALS[goal]}"
text = ""  # what you tell the trainees, in a sentence or two
goal = "{goal}"
feedback = "continuous"   # or "fading", or "summary": figures only in the result

[duct]
# preset = "thesis-bile-duct"
{bed}
[limits]   # what is not named here follows from the duct; there are:
{limits}
time_limit_s = 120
{errors}"""


def _limits(goal: Goal) -> tuple[str, ...]:
    """Return the names of the numbers that an exercise file may give for a goal."""
    kind = PULLS.get(goal, BedExercise)
    return tuple(name for name in kind.__struct_fields__ if name not in FIXED)
