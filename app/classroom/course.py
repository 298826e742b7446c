"""A course: levels by proficiency, what each asks for, and the benchmarks it is held against.

A course is a TOML file. Where a person stands in it follows from the course and the runs that are
kept (`app.classroom.progress`): nothing of it is stored. A level is passed by so many passes in a
row, each on a bed that was not seen before. Progression by proficiency made 60 % fewer errors in 12
randomised trials (Mazzone et al. 2021, Ann Surg 274:281).
"""

import math
import re
from collections.abc import Iterable
from functools import lru_cache
from importlib.resources import files
from typing import Literal

import msgspec
import tomli_w

from app.bounded_file import decoded
from app.classroom.exercise_file import (
    DRAWN,
    PULLS,
    AssignedExercise,
    DuctChoice,
    ExerciseFile,
    Goal,
)
from app.simulation import AT_ANATOMY, ERROR_CLASSES, METRICS, Feedback, Preset
from organ_geometry import Organ

INCIDENTS = "incidents"
"""A benchmark's metric that is not in `METRICS`: how many incidents of errors a run has."""
SAFE_FRACTION = 0.95
"""Least share of a run's time in tissue without an incident of a level's safety items: in use for
those of a laparoscopic curriculum (LAP Mentor)."""
LONGEST_FILE, MOST_LEVELS, MOST_SEEDS, MOST_PASSES = 50_000, 40, 200, 20
LONGEST_ID, LONGEST_TITLE, LONGEST_STEP = 40, 60, 300
LOWER = {each.key: each.better == "lower" for each in METRICS if each.better} | {INCIDENTS: True}
"""Metrics that a benchmark may be of, and whether less is better."""

Source = Literal["experts", "scripted"]


def _check_id(name: str) -> None:
    if not re.fullmatch(r"[a-z0-9_-]+", name) or len(name) > LONGEST_ID:
        raise ValueError(f"id must have 1 to {LONGEST_ID} of a-z, 0-9, _ and -, got {name!r}")


class Benchmark(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What a metric of a level is held against, and whose runs it is from.

    Of experts it is their mean (Mazzone 2021); of scripted hands the value that 95 % of their runs
    keep.
    """

    level: str
    metric: str
    value: float
    mean: float
    sd: float
    n: int  # experts, or runs of scripted hands
    source: Source
    date: str
    left_out: int = 0  # experts whose mean lies far from the others'
    margin: float = 1.0  # times its value is the mark: scripted hands may know what people look for

    def __post_init__(self) -> None:
        if self.metric not in LOWER:
            raise ValueError(
                f"metric {self.metric!r} is none of a benchmark's; there are: {', '.join(LOWER)}"
            )
        for name in ("value", "mean", "sd"):
            if not math.isfinite(getattr(self, name)):
                raise ValueError(f"{name} must be finite, got {getattr(self, name)}")
        if self.sd < 0.0 or self.n < 1 or self.left_out < 0:
            raise ValueError("sd and left_out must be 0 or more, and n 1 or more")
        if not 0.0 < self.margin < math.inf:
            raise ValueError(f"margin must be above 0 and finite, got {self.margin}")

    @property
    def mark(self) -> float:
        """What a level's passes are held against, before the level's own factor."""
        return self.margin * self.value

    @property
    def origin(self) -> str:
        """Whose it is, in words."""
        times = "" if self.margin == 1.0 else f"{self.margin:g} times that of "
        if self.source == "scripted":
            return f"{times}{self.n} runs of scripted hands, {self.date}: no surgeon has set it"
        out = f", {self.left_out} left out" if self.left_out else ""
        return f"{times}{self.n} experts, {self.date}{out}"


class Level(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A level: an exercise, what comes before it, and what passes it."""

    id: str
    title: str
    step: str  # the one thing to do, in a sentence
    goal: Goal
    needs: tuple[str, ...] = ()  # levels to be mastered before
    passes: int = 3  # in a row, each on a bed that was not seen before
    beds: tuple[str, ...] = ()  # one after the other, with each pass in a row
    # of the beds, or of the anatomies that are drawn
    seeds: tuple[int, ...] = tuple(range(1, 21))
    feedback: tuple[Feedback, ...] = (Feedback.CONTINUOUS,)  # with each pass in a row
    limits: dict[str, int | float] = {}  # of the exercise, as in an exercise file
    errors: dict[str, int] = {}  # the same
    safety: tuple[str, ...] = ()  # error classes, without which `SAFE_FRACTION` of the time must be
    benchmarks: dict[str, float] = {}  # metric: what its benchmark is multiplied by

    def __post_init__(self) -> None:
        _check_id(self.id)
        if not 0 < len(self.title.strip()) <= LONGEST_TITLE or not self.title.isprintable():
            raise ValueError(f"title must have 1 to {LONGEST_TITLE} characters")
        if not 0 < len(self.step.strip()) <= LONGEST_STEP:
            raise ValueError(f"step must have 1 to {LONGEST_STEP} characters")
        if not 1 <= self.passes <= MOST_PASSES:
            raise ValueError(f"passes must be from 1 to {MOST_PASSES}, got {self.passes}")
        if self.goal in (*PULLS, *AT_ANATOMY) and self.beds:
            raise ValueError(f"beds do not go with {self.goal}, which has no bed")
        seeds = set(self.seeds)
        if not 0 < len(seeds) <= MOST_SEEDS or len(seeds) < len(self.seeds) or min(seeds) < 0:
            raise ValueError(f"seeds must be 1 to {MOST_SEEDS} different numbers from 0 on")
        if self.goal not in PULLS and len(seeds) < self.passes:
            raise ValueError(f"seeds must be as many as passes, {self.passes}, got {len(seeds)}")
        if not self.feedback:
            raise ValueError("feedback must have one or more of continuous, fading, summary")
        for error in self.safety:
            if error not in ERROR_CLASSES:
                raise ValueError(
                    f"safety has {error!r}, which is no class of errors; there are: "
                    f"{', '.join(ERROR_CLASSES)}"
                )
        for metric, factor in self.benchmarks.items():
            if metric not in LOWER:
                raise ValueError(f"benchmarks has {metric!r}; there are: {', '.join(LOWER)}")
            if not 0.0 < factor < math.inf:
                raise ValueError(f"benchmarks.{metric} must be above 0 and finite, got {factor}")
        self._file(None, Feedback.CONTINUOUS)  # refuses wrong limits, beds and errors

    @property
    def seeded(self) -> bool:
        """Whether there is a bed or an anatomy, so that every try can be another."""
        return self.goal not in PULLS

    def try_on(
        self, organ: Organ, preset: Preset | None, *, row: int, seed: int | None
    ) -> AssignedExercise:
        """Return the next try's exercise after `row` passes; seconds the first time."""
        # The limits are those of the bed, of which only the scatter is the seed's, or those of the
        # seed's anatomy.
        bed = self.beds[row % len(self.beds)] if self.beds else None
        feedback = self.feedback[min(row, len(self.feedback) - 1)]
        asked = _asked(msgspec.json.encode(self._file(bed, feedback, seed)), organ, preset)
        opening = asked.exercise.opening
        if seed is None or opening is None or opening.anatomy is not None:
            return asked
        opening = msgspec.structs.replace(opening, bed_seed=seed)
        exercise = msgspec.structs.replace(asked.exercise, opening=opening)
        return msgspec.structs.replace(asked, exercise=exercise)

    def _file(self, bed: str | None, feedback: Feedback, seed: int | None = None) -> ExerciseFile:
        duct = DuctChoice(bed=bed)
        if self.goal in AT_ANATOMY:
            duct = DuctChoice(anatomy=DRAWN, seed=1 if seed is None else seed)
        return ExerciseFile(
            self.title, self.goal, self.step, feedback, duct, self.limits, self.errors
        )


@lru_cache(maxsize=64)
def _asked(file: bytes, organ: Organ, preset: Preset | None) -> AssignedExercise:
    # As JSON, which can be a cache's key.
    return msgspec.json.decode(file, type=ExerciseFile).on(organ, preset)


class Retention(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Days after which a level that was mastered is tried once more."""

    days: tuple[int, ...] = (14, 90)

    def __post_init__(self) -> None:
        if list(self.days) != sorted(set(self.days)) or any(each < 1 for each in self.days):
            raise ValueError(f"days must rise from 1 on, got {list(self.days)}")


class Course(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Levels, each of which may need others."""

    id: str
    title: str
    version: int
    level: tuple[Level, ...]
    benchmark: tuple[Benchmark, ...] = ()
    retention: Retention = Retention()

    def __post_init__(self) -> None:
        _check_id(self.id)
        if not 0 < len(self.title.strip()) <= LONGEST_TITLE or not self.title.isprintable():
            raise ValueError(f"title must have 1 to {LONGEST_TITLE} characters")
        if not 0 < len(self.level) <= MOST_LEVELS:
            raise ValueError(f"a course has 1 to {MOST_LEVELS} levels, not {len(self.level)}")
        before: set[str] = set()
        for number, each in enumerate(self.level):
            where = f"$.level[{number}]"
            if each.id in before:
                raise ValueError(f"there are two levels {each.id!r} - at `{where}.id`")
            for need in each.needs:
                if need not in before:
                    raise ValueError(
                        f"level {each.id} needs {need!r}, which is no level before it - at "
                        f"`{where}.needs`"
                    )
            before.add(each.id)
            for metric in each.benchmarks:
                if self.benchmark_of(each.id, metric) is None:
                    raise ValueError(
                        f"level {each.id} has no [[benchmark]] of {metric} - at "
                        f"`{where}.benchmarks`"
                    )
        found: set[tuple[str, str]] = set()
        for number, each in enumerate(self.benchmark):
            if each.level not in before:
                raise ValueError(
                    f"a benchmark is of level {each.level!r}, which there is not - at "
                    f"`$.benchmark[{number}].level`"
                )
            if (each.level, each.metric) in found:
                raise ValueError(
                    f"there are two benchmarks of {each.metric} in level {each.level} - at "
                    f"`$.benchmark[{number}].metric`"
                )
            found.add((each.level, each.metric))

    def benchmark_of(self, level: str, metric: str) -> Benchmark | None:
        """Return the benchmark of a level's metric."""
        return next(
            (each for each in self.benchmark if (each.level, each.metric) == (level, metric)), None
        )

    def marks(self, level: Level) -> dict[str, float]:
        """Return what a level's passes are held against, by metric."""
        return {
            metric: factor * benchmark.mark
            for metric, factor in level.benchmarks.items()
            if (benchmark := self.benchmark_of(level.id, metric)) is not None
        }

    def level_of(self, name: str) -> Level:
        """Return a level by its id; a `ValueError` names those there are."""
        for each in self.level:
            if each.id == name:
                return each
        known = ", ".join(each.id for each in self.level)
        raise ValueError(f"there is no level {name!r}; there are: {known}")


def read_course(content: str) -> Course:
    """Return the course in a TOML file; a `ValueError` says in a sentence what is wrong, where."""
    if len(content) > LONGEST_FILE:
        raise ValueError(f"a course has at most {LONGEST_FILE:,} characters")
    return decoded(msgspec.toml.decode, content, Course, "this is no course", lines=True)


def with_benchmarks(content: str, benchmarks: Iterable[Benchmark]) -> str:
    """Return a course's file with benchmarks in place of those of the same level and metric."""
    kept = {(each.level, each.metric): each for each in read_course(content).benchmark}
    kept |= {(each.level, each.metric): each for each in benchmarks}
    lines: list[str] = []
    cut = False
    for line in content.splitlines():
        if line.lstrip().startswith("["):
            cut = line.strip().startswith("[[benchmark]]")
        if not cut:
            lines.append(line)
    tables = tomli_w.dumps({"benchmark": [msgspec.to_builtins(each) for each in kept.values()]})
    return "\n".join(lines).rstrip() + "\n\n" + tables


@lru_cache(maxsize=1)
def default_course() -> str:
    """Return the file of the course that comes with the program."""
    return files("assets").joinpath("course.toml").read_text(encoding="utf-8")
