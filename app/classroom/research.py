"""A class as data for research: tables without names, their dictionary, statements and runs.

Who has not consented is left out. A person is a pseudonym, the keyed digest of the identity; times
are counted from each person's first try, and what somebody typed is in no file but the course's.
"""

import csv
import hashlib
import hmac
import io
import json
import secrets
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from importlib import import_module
from pathlib import Path
from typing import Any, Literal, NamedTuple

import msgspec

from app.anatomy import Anatomy
from app.bounded_file import read_bounded
from app.classroom.class_course import ClassCourse
from app.classroom.exercise_file import GOALS
from app.classroom.photograph import kind_of
from app.classroom.results import Result, cell, flat_measures, results, shown_names
from app.classroom.store import ClassStore, RunRecord
from app.classroom.xapi import run_statements
from app.simulation import ERROR_CLASSES, METRICS, MODES, read_incidents, read_run, run_json
from app.versions import versions
from organ_geometry import make_folder, write_atomic

LEAST_GROUP = 5
"""People that a group must have to be named: of a smaller one the group could be the person."""
LONGEST_LIST = 100_000
DIGITS, KEY_BYTES = 10, 32
START = datetime(2000, 1, 1, tzinfo=UTC)
"""When each person's first try is said to have been."""
ASKED = ("name", "consent", "group")
OF_EXPORT = ("runs/*.json", "photographs/*", "*.parquet")
"""Files of an export that a later one to the same folder does not always replace."""

Row = dict[str, Any]
Kind = Literal["text", "integer", "number"]


class Column(NamedTuple):
    """A column of a table."""

    name: str
    kind: Kind
    unit: str
    meaning: str
    values: Mapping[str, str] | None = None  # what the texts of it mean, if they are a list


class Written(NamedTuple):
    """What an export has."""

    people: int
    attempts: int
    left_out: int  # people without consent
    small: tuple[str, ...]  # groups that are not named, as they have too few people
    older: tuple[str, ...]  # files in the folder that are of an earlier export


OUTCOMES = {
    "passed": "The goal was reached within all limits.",
    "failed": "A limit was passed, or the time was over.",
    "given up": "It was stopped before its end.",
}
CONSEQUENCES = {
    "none": "Nothing followed within a second.",
    "near miss": "The stress passed the exercise's limit, or the break was nearer than 0.25 s.",
    "minor": "Strands broke out of sight, a wall tore in part, or up to 2 ml of blood were lost.",
    "injury": "A tube tore, a nick in its wall leaked, or more blood was lost.",
}
ERRORS = {each.key: each.title for each in ERROR_CLASSES.values()}
PERSON = Column("person", "text", "", "Pseudonym: the same in all tables, other in each export.")
ATTEMPT = Column("attempt", "text", "", "Of the attempt, and the name of its run's file.")

PEOPLE = (
    PERSON,
    Column("group", "text", "", "As the list of people has it; empty if fewer than five have it."),
    Column("attempts", "integer", "", "Rows of this person in attempts."),
    Column("practice_runs", "integer", "", "Runs without an exercise, which are not in attempts."),
    Column("practice_s", "number", "s", "Their length together."),
)
MEASURED = (
    Column("incidents", "integer", "", "Errors made, of all classes (table incidents)."),
    Column("consequential", "integer", "", "Those with a consequence from near miss on."),
    Column("torn", "integer", "", "Whether a tube tore: 0 or 1."),
)
ABOUT = (
    PERSON,
    ATTEMPT,
    Column("task", "text", "", "Level of the course, or exercise-N: the Nth that was set."),
    Column("goal", "text", "", "Its goal.", {**GOALS}),
    Column("seed", "integer", "", "Of the bed or the anatomy; empty without one."),
    Column("number", "integer", "", "Which try of this person at this task it is, from 1."),
    Column("day", "integer", "d", "Whole days since this person's first try."),
    Column("outcome", "text", "", "How it ended.", OUTCOMES),
    Column(
        "critical_view_by_teacher",
        "integer",
        "",
        "Points of 6 that the teacher has given for its photographs; empty if none.",
    ),
    Column("cause", "text", "", "Class of errors that a failure is put down to.", ERRORS),
)
INCIDENTS = (
    ATTEMPT,
    Column("number", "integer", "", "Which incident of the attempt it is, from 1."),
    Column("error", "text", "", "Its class (docs/errors.md).", ERRORS),
    Column(
        "mode", "integer", "", "External error mode of OCHRA.",
        {str(key): words for key, words in MODES.items()},
    ),
    Column("start_s", "number", "s", "From the start of the run."),
    Column("end_s", "number", "s", "From the start of the run."),
    Column("hand", "integer", "", "0 left, 1 right; empty of no single hand."),
    Column("tube", "integer", "", "Number of the tube; 0 of a duct alone."),
    Column("station_mm", "number", "mm", "On the tube, from its first clamp or end."),
    Column("consequence", "text", "", "What followed, measured.", CONSEQUENCES),
)  # fmt: skip
FIELDS = ("error", "start_s", "end_s", "hand", "tube", "station_mm", "consequence")
"""Of an incident, as it is kept."""
TEAR = (
    Column("tear_time_s", "number", "s", "When it tore, from the start of the run."),
    Column("tear_station_mm", "number", "mm", "Where it tore, from the first clamp or end."),
)
TUBES = (
    Column("peak_stress_tube", "text", "", "Tube of the peak stress; empty of a duct alone."),
    Column("tear_tube", "text", "", "Tube that tore first; empty of a duct alone."),
)


def consent_list(store: ClassStore) -> bytes:
    """Return a list of a class's people to fill in: consent (yes or no) and group."""
    out = io.StringIO()
    table = csv.writer(out, lineterminator="\r\n")
    table.writerow(ASKED)
    table.writerows([cell(name), "", ""] for name in shown_names(store.people()).values())
    return out.getvalue().encode("utf-8-sig")


def read_consents(path: Path, store: ClassStore) -> dict[str, str]:
    """Return the group of each person who has consented, by id, from a list that was filled in."""
    names = {name: who for who, name in shown_names(store.people()).items()}
    known = {str(cell(name)): who for name, who in names.items()} | names  # as listed, or as typed
    try:
        text = read_bounded(path, LONGEST_LIST, "list of people").decode("utf-8-sig")
    except UnicodeDecodeError:
        raise ValueError(f"{path} is no list of people: it is not text in UTF-8") from None
    table = csv.DictReader(io.StringIO(text))
    if set(table.fieldnames or ()) != set(ASKED):
        raise ValueError(f"{path}: its first line must be {','.join(ASKED)}")
    found: dict[str, str] = {}
    seen = set[str]()
    for number, row in enumerate(table, 2):
        name, consent = (row["name"] or "").strip(), (row["consent"] or "").strip().casefold()
        where = f"{path}, line {number}"
        if name not in known:
            raise ValueError(f"{where}: there is nobody called {name!r} in {store.title}")
        if known[name] in seen:
            raise ValueError(f"{where}: {name!r} is there twice")
        if consent not in ("yes", "no", ""):
            raise ValueError(f"{where}: consent must be yes or no, got {row['consent']!r}")
        seen.add(known[name])
        if consent == "yes":
            found[known[name]] = (row["group"] or "").strip()
    if not found:
        raise ValueError(f"{path}: nobody has consented, so there is nothing to write")
    return found


def pseudonym_key(path: Path | None) -> bytes:
    """Return the key in a file, which is made if it is not there; without a file a new one."""
    if path is None:
        return secrets.token_bytes(KEY_BYTES)
    if not path.exists():
        write_atomic(path, secrets.token_hex(KEY_BYTES).encode())
        path.chmod(0o600)
    text = read_bounded(path, 4 * KEY_BYTES, "key")
    try:
        key = bytes.fromhex(text.decode())
    except ValueError:
        key = b""
    if len(key) != KEY_BYTES:
        raise ValueError(f"{path} is no key: it must have {2 * KEY_BYTES} hexadecimal digits")
    return key


def write_research(
    store: ClassStore, groups: Mapping[str, str], folder: Path, key: bytes, *, parquet: bool = False
) -> Written:
    """Write the attempts of those who have consented, with all that a study of them needs.

    Parameters
    ----------
    store
        The class.
    groups
        The group of each person who has consented, by id.
    folder
        Where to: tables as CSV, `dictionary.json`, `statements.jsonl`, `course.toml`, `runs/`.
    key
        Secret that pseudonyms are made with. Who keeps it can find a person again, and add later
        tries; without it nobody can.
    parquet
        Whether to write the tables as Parquet too; this needs pyarrow.

    Returns
    -------
    Written

    Raises
    ------
    ValueError
        If it cannot be written, or pyarrow is wanted and not there.
    """
    if parquet:
        _arrow()
    counts = Counter(groups.values())
    small = tuple(sorted(name for name, count in counts.items() if name and count < LEAST_GROUP))
    named = {who: "" if group in small else group for who, group in groups.items()}
    book, found = ClassCourse(store), results(store)
    own = {who: [each for each in found if each.run.person_id == who] for who in named}
    people: list[Row] = []
    attempts: list[Row] = []
    incidents: list[Row] = []
    statements: list[str] = []
    written = set[Path]()

    def write(name: str, content: bytes) -> None:
        path = folder / name
        make_folder(path.parent, f"cannot write {path.parent}")
        write_atomic(path, content)
        written.add(path)

    make_folder(folder / "runs", f"cannot write {folder / 'runs'}")
    # Not in the order in which they joined.
    for who in sorted(named, key=lambda who: _digest(key, who)):
        kept = [each for each in own[who] if each.run.finished]
        tries = [each for each in kept if _is_try(each.run)]
        free = [each for each in kept if not _is_try(each.run)]
        people.append(
            {
                "person": _digest(key, who),
                "group": named[who],
                "attempts": len(tries),
                "practice_runs": len(free),
                "practice_s": sum((each.seconds for each in free), 0.0),
            }
        )
        for each in _attempts(store, book, key, tries):
            attempts.append(each.row)
            incidents += each.incidents
            statements += each.statements
            write(f"runs/{each.row['attempt']}.json", each.file)
            for number, picture in enumerate(each.photographs, 1):
                kind = (kind_of(picture) or "image/webp").partition("/")[2]
                write(f"photographs/{each.row['attempt']}-{number}.{kind}", picture)
    measured = _measured(attempts)
    tables = {
        "people": (PEOPLE, people),
        "attempts": ((*ABOUT, *MEASURED, *measured), attempts),
        "incidents": (INCIDENTS, incidents),
    }
    for name, (columns, rows) in tables.items():
        write(f"{name}.csv", _csv(columns, rows))
        if parquet:
            _write_parquet(folder / f"{name}.parquet", columns, rows)
            written.add(folder / f"{name}.parquet")
    write("dictionary.json", _dictionary(tables))
    write("statements.jsonl", "".join(f"{each}\n" for each in statements).encode())
    if store.course is not None:
        write("course.toml", store.course.encode())
    there = {path for kind in OF_EXPORT for path in folder.glob(kind)}
    older = tuple(path.relative_to(folder).as_posix() for path in sorted(there - written))
    return Written(len(people), len(attempts), len(store.people()) - len(people), small, older)


class _Attempt(NamedTuple):
    row: Row
    incidents: list[Row]
    statements: list[str]
    file: bytes
    photographs: list[bytes]


def _attempts(
    store: ClassStore, book: ClassCourse, key: bytes, tries: Sequence[Result]
) -> Iterator[_Attempt]:
    """Give the attempts of one person, without who it is."""
    if not tries:
        return
    who = tries[0].run.person_id
    person = _digest(key, who)
    first = datetime.fromisoformat(tries[0].run.started_at)
    standing = [
        msgspec.structs.replace(each, mastered_by=_digest(key, each.mastered_by or ""))
        for each in book.standing(book.tries(who).get(who, []))
    ]
    numbers, ratings = Counter[str](), store.ratings()
    for each in tries:
        kept = store.run(each.run.id)
        if kept is None:  # deleted meanwhile
            continue
        since = datetime.fromisoformat(kept.started_at) - first
        whole = read_run(kept.file)
        organ = msgspec.structs.replace(whole.log.organ, name="")
        log = msgspec.structs.replace(whole.log, organ=organ)
        goal: Any = "" if log.exercise is None else log.exercise.name
        run = replace(
            kept,
            id=_digest(key, kept.id),
            person_id=person,
            file=run_json(msgspec.structs.replace(whole, log=log)),
            title=GOALS.get(goal, goal),
            started_at=(START + since).isoformat(),
        )
        task = run.level or (f"exercise-{run.assignment_id}" if run.assignment_id else goal)
        numbers[task] += 1
        found = read_incidents(run.incidents)
        start = log.start
        seed = start.anatomy.seed if isinstance(start.anatomy, Anatomy) else start.bed_seed
        row: Row = {
            "person": person,
            "attempt": run.id,
            "task": task,
            "goal": goal,
            "seed": seed if run.seed is None else run.seed,
            "number": numbers[task],
            "day": since.days,
            "outcome": {True: "passed", False: "failed", None: "given up"}[run.passed],
            "critical_view_by_teacher": ratings.get(each.run.id),
            "cause": each.cause,
            "incidents": len(found),
            "consequential": sum(one.consequence != "none" for one in found),
            "torn": int(each.measures.get("tear") is not None),
            **flat_measures(each.measures),
        }
        incidents: list[Row] = [
            {
                "attempt": run.id,
                "number": number,
                "mode": ERROR_CLASSES[one.error].mode,
                **{name: getattr(one, name) for name in FIELDS},
            }
            for number, one in enumerate(found, 1)
        ]
        taken = store.photographs(each.run.id)
        statements = run_statements(
            _digest(key, "export"), "1.0.3", run, book.course, standing, actor=person
        )
        yield _Attempt(
            row, incidents, [one.content.decode() for one in statements], run.file, taken
        )


def _is_try(run: RunRecord) -> bool:
    return not (run.passed is None and run.level is None and run.assignment_id is None)


def _digest(key: bytes, text: str) -> str:
    return hmac.new(key, text.encode(), hashlib.sha256).hexdigest()[:DIGITS]


def _measured(attempts: Sequence[Row]) -> list[Column]:
    """Return the columns of the measures that attempts have, from the measures' own table."""
    there = {key for row in attempts for key in row}
    columns: list[Column] = []
    for each in METRICS:
        hands = {f"{each.key}_left": " Left hand.", f"{each.key}_right": " Right hand."}
        for name, which in {each.key: "", **hands}.items():
            if name in there:
                kind: Kind = "integer" if each.key.startswith("strands") else "number"
                # Shares are kept as such; per cent are of what people are shown.
                unit = "1" if each.factor != 1.0 else each.unit
                columns.append(Column(name, kind, unit, f"{each.meaning}{which}"))
    return [*columns, *TEAR, *(each for each in TUBES if each.name in there)]


def _csv(columns: Sequence[Column], rows: Sequence[Row]) -> bytes:
    out = io.StringIO()
    table = csv.DictWriter(
        out, [each.name for each in columns], extrasaction="ignore", lineterminator="\r\n"
    )
    table.writeheader()
    table.writerows(rows)
    return out.getvalue().encode()


def _write_parquet(path: Path, columns: Sequence[Column], rows: Sequence[Row]) -> None:
    pa, pq = _arrow()
    types = {"text": pa.string(), "integer": pa.int64(), "number": pa.float64()}
    arrays = [pa.array([row.get(each.name) for row in rows], types[each.kind]) for each in columns]
    fields = [
        pa.field(each.name, types[each.kind], metadata={"unit": each.unit, "meaning": each.meaning})
        for each in columns
    ]
    pq.write_table(pa.Table.from_arrays(arrays, schema=pa.schema(fields)), path)


def _arrow() -> tuple[Any, Any]:
    try:
        return import_module("pyarrow"), import_module("pyarrow.parquet")
    except ImportError:
        raise ValueError("Parquet needs pyarrow: pip install 'bluntdissect[study]'") from None


def _dictionary(tables: Mapping[str, tuple[Sequence[Column], Sequence[Row]]]) -> bytes:
    whole = {
        "format": "bluntdissect-research",
        "version": 1,
        "versions": versions(),
        "note": "Not clinically validated, not a medical device. No score of OSATS or GOALS.",
        "tables": {
            name: [
                {"name": each.name, "type": each.kind, "unit": each.unit, "meaning": each.meaning}
                | ({} if each.values is None else {"values": dict(each.values)})
                for each in columns
            ]
            for name, (columns, _) in tables.items()
        },
    }
    return json.dumps(whole, indent=1).encode()
