"""The results of a class: rows for tables, files for other programs, and where each stands."""

import csv
import io
import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, cast

import msgspec

from app.classroom.exercise_file import AssignedExercise
from app.classroom.store import ClassStore, Person, RunRecord
from app.simulation import ERROR_CLASSES, cause_of, read_incidents, renamed_metrics

Word = Literal["passed", "failed", "given up", "not finished", "free", "torn"]

IDENTITY = (
    "name", "exercise", "set_by_teacher", "try", "mode", "started_at", "outcome", "reason",
)  # fmt: skip
"""Columns before those of the measures."""


@dataclass(frozen=True, slots=True)
class Result:
    """One run of one person, for a table; `number` counts the person's tries at it."""

    run: RunRecord
    name: str  # of the person, told apart from others of the same name
    number: int
    limit: float | None  # of the peak's share of the break
    measures: Mapping[str, Any]

    @property
    def word(self) -> Word:
        """How it ended."""
        if not self.run.finished:
            return "not finished"
        if self.run.passed is not None:
            return "passed" if self.run.passed else "failed"
        if self.measures.get("tear") is not None:
            return "torn"
        in_class = self.run.assignment_id is not None or self.run.level is not None
        return "given up" if in_class else "free"

    @property
    def cause(self) -> str:
        """The error class that a try which was not passed is put down to, or nothing."""
        incidents = read_incidents(self.run.incidents)
        cause = None if self.run.passed else cause_of(incidents, self.seconds)
        return "" if cause is None else cause.error

    @property
    def why(self) -> str:
        """What a try failed by, in a few words: an error, a limit, the time."""
        if cause := self.cause:
            return ERROR_CLASSES[cause].title.lower()
        return "time" if " were over" in self.run.reason else "a limit"

    @property
    def seconds(self) -> float:
        """Its length, s."""
        return float(self.measures["time_s"])

    @property
    def peak(self) -> float:
        """The highest stress over the threshold: 1 tears."""
        return 1.0 - float(self.measures["smallest_distance_to_break"])

    @property
    def force(self) -> float:
        """The largest force, N, of whichever hand."""
        force: float | list[float] = self.measures["maximum_force_N"]
        return max(force) if isinstance(force, list) else force


@dataclass(frozen=True, slots=True)
class Standing:
    """Where one person stands among those who have finished an exercise; others without names."""

    tried: int
    passed: int
    own: float | None  # peak's share of the break in the best try
    own_passed: bool
    others: tuple[tuple[float, bool], ...]  # the same of each of the others, lowest first


def shown_names(people: Iterable[Person]) -> dict[str, str]:
    """Return each person's name by id; those of the same name get numbers."""
    seen, names = Counter[str](), dict[str, str]()
    for person in people:
        seen[person.name.casefold()] += 1
        count = seen[person.name.casefold()]
        names[person.id] = person.name if count == 1 else f"{person.name} ({count})"
    return names


def results(store: ClassStore, person_id: str | None = None) -> list[Result]:
    """Return the runs of a class, or of one person, oldest first."""
    names = shown_names(store.people())
    limits = {
        each.id: AssignedExercise.of_json(each.exercise).exercise.limit_of.get("peak_stress_ratio")
        for each in store.assignments()
    }
    tries = Counter[tuple[str, object]]()
    found: list[Result] = []
    for run in store.runs(person_id):
        what = run.person_id, run.assignment_id or run.title
        tries[what] += 1
        limit = None if run.assignment_id is None else limits.get(run.assignment_id)
        name = names.get(run.person_id, "")
        found.append(
            Result(
                run, name, tries[what], limit, renamed_metrics(msgspec.json.decode(run.measures))
            )
        )
    return found


def best(tries: Iterable[Result]) -> Result | None:
    """Return the best of some tries: one that passed, with the lowest peak."""
    ended = [each for each in tries if each.run.passed is not None]
    return min(ended, key=lambda each: (not each.run.passed, each.peak), default=None)


def bests(tries: Iterable[Result]) -> dict[str, Result]:
    """Return everybody's best of some tries, by person."""
    by_person: dict[str, list[Result]] = {}
    for each in tries:
        by_person.setdefault(each.run.person_id, []).append(each)
    return {who: top for who, own in by_person.items() if (top := best(own)) is not None}


def standing(found: Sequence[Result], person_id: str, assignment_id: int) -> Standing:
    """Return where a person stands in an exercise."""
    tops = bests(each for each in found if each.run.assignment_id == assignment_id)
    own = tops.pop(person_id, None)
    others = sorted((each.peak, each.run.passed is True) for each in tops.values())
    own_passed = own is not None and own.run.passed is True
    return Standing(
        tried=len(others) + (own is not None),
        passed=sum(passed for _, passed in others) + own_passed,
        own=None if own is None else own.peak,
        own_passed=own_passed,
        others=tuple(others),
    )


def results_csv(found: Sequence[Result]) -> bytes:
    """Return runs as comma-separated values; a spreadsheet takes no text of them for a formula."""
    rows: list[dict[str, object]] = []
    for each in found:
        run = each.run
        identity = (
            each.name, run.title, "yes" if run.assignment_id else "no", each.number, run.mode,
            run.started_at, each.word, run.reason,
        )  # fmt: skip
        rows.append(dict(zip(IDENTITY, identity, strict=True)) | flat_measures(each.measures))
    out = io.StringIO()
    columns = dict.fromkeys([*IDENTITY, *(key for row in rows for key in row)])
    table = csv.DictWriter(out, list(columns), lineterminator="\r\n")
    table.writeheader()
    table.writerows({key: cell(value) for key, value in row.items()} for row in rows)
    return out.getvalue().encode("utf-8-sig")


def results_json(store: ClassStore) -> bytes:
    """Return all of a class as JSON, with the run files in full."""
    found = results(store)
    names = shown_names(store.people())
    runs: list[dict[str, Any]] = []
    for each in found:
        kept = store.run(each.run.id)
        if kept is not None:
            runs.append(
                {
                    "id": each.run.id, "name": each.name, "exercise": each.run.title,
                    "assignment": each.run.assignment_id, "try": each.number,
                    "started_at": each.run.started_at, "outcome": each.word,
                    "reason": each.run.reason, "run": json.loads(kept.file),
                }
            )  # fmt: skip
    whole = {
        "format": "bluntdissect-class",
        "version": 1,
        "title": store.title,
        "made_at": store.made_at,
        "people": [
            {"name": names[each.id], "joined_at": each.joined_at}
            for each in store.people()
        ],
        "assignments": [
            {
                "id": each.id, "file": each.text, "set_at": each.set_at,
                "started_at": each.started_at, "stopped_at": each.stopped_at,
            }
            for each in store.assignments()
        ],
        "runs": runs,
    }  # fmt: skip
    return json.dumps(whole, ensure_ascii=False, indent=1).encode()


def flat_measures(measures: Mapping[str, Any]) -> dict[str, object]:
    """Return measures by column: those of both hands and of a tear apart."""
    flat: dict[str, object] = {}
    for key, value in measures.items():
        if isinstance(value, list):
            flat |= zip((f"{key}_left", f"{key}_right"), cast(list[object], value), strict=True)
        elif isinstance(value, dict):
            tear = cast(dict[str, object], value)
            flat |= {f"{key}_{field}": inner for field, inner in tear.items()}
        elif key != "tear":
            flat[key] = value
    return flat


def cell(value: object) -> object:
    """Return a cell's value; text that a spreadsheet would compute is marked as text."""
    return f"'{value}" if isinstance(value, str) and value[:1] in tuple("=+-@\t\r") else value
