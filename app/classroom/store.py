"""The file of a class: an SQLite database of its people, exercises and runs.

A write has returned only when it is on the disk: write-ahead log, synchronous=FULL. What is deleted
is overwritten (secure_delete). A backup is a file of the same kind and is opened like any other.
"""

import contextlib
import hashlib
import json
import os
import re
import secrets
import sqlite3
import threading
from collections.abc import Callable, Generator, Iterable, Sequence
from dataclasses import astuple, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import platformdirs

from app.classroom.photograph import MOST_BYTES, kind_of
from app.simulation import MOST_POINTS

APPLICATION, VERSION = 0x62_64_63_6C, 2  # "bdcl"
SUFFIX = ".sqlite"
TOKEN_BYTES, ID_BYTES = 24, 12
LONGEST_TITLE, LONGEST_NAME = 80, 40
MOST_PEOPLE, MOST_RUNS, MOST_ASSIGNMENTS = 200, 500, 500
"""People of a class, runs of one of them, exercises set."""
MOST_RUN_BYTES = 16_000_000
MOST_PHOTOGRAPHS = 2
BUSY_SECONDS = 10.0

_TABLES = """
CREATE TABLE class (
    id INTEGER PRIMARY KEY CHECK (id = 1), title TEXT NOT NULL, made_at TEXT NOT NULL,
    teacher_token TEXT NOT NULL, trainee_token TEXT NOT NULL, shows_standing INTEGER NOT NULL
) STRICT;
CREATE TABLE person (
    id TEXT PRIMARY KEY, browser_sha256 TEXT NOT NULL UNIQUE, name TEXT NOT NULL,
    joined_at TEXT NOT NULL
) STRICT;
CREATE TABLE assignment (
    id INTEGER PRIMARY KEY AUTOINCREMENT, text TEXT NOT NULL, exercise TEXT NOT NULL,
    set_at TEXT NOT NULL, started_at TEXT, stopped_at TEXT
) STRICT;
CREATE TABLE run (
    id TEXT PRIMARY KEY, person_id TEXT NOT NULL REFERENCES person ON DELETE CASCADE,
    assignment_id INTEGER REFERENCES assignment, mode TEXT NOT NULL, title TEXT NOT NULL,
    started_at TEXT NOT NULL, finished INTEGER NOT NULL, passed INTEGER, reason TEXT NOT NULL,
    measures TEXT NOT NULL, file BLOB NOT NULL
) STRICT;
CREATE INDEX run_of_person ON run (person_id, started_at);
"""
# What version 2 adds.
_COURSE = """
ALTER TABLE class ADD COLUMN course TEXT;
ALTER TABLE class ADD COLUMN uuid TEXT;
ALTER TABLE class ADD COLUMN learning_record_store TEXT;
UPDATE class SET uuid = lower(hex(randomblob(16)));
ALTER TABLE person ADD COLUMN level TEXT;
ALTER TABLE run ADD COLUMN level TEXT;
ALTER TABLE run ADD COLUMN seed INTEGER;
ALTER TABLE run ADD COLUMN incidents TEXT;
CREATE TABLE statement (
    id TEXT PRIMARY KEY, person_id TEXT, content BLOB NOT NULL, tries INTEGER NOT NULL DEFAULT 0,
    sent_at TEXT, refused TEXT
) STRICT;
CREATE INDEX statement_waiting ON statement (id) WHERE sent_at IS NULL AND refused IS NULL;
CREATE INDEX run_of_level ON run (person_id, started_at) WHERE level IS NOT NULL;
"""
# Tables beside those of version 2, which other programs of that version do not read.
_RECORDS = """
CREATE TABLE IF NOT EXISTS photograph (
    run_id TEXT NOT NULL REFERENCES run ON DELETE CASCADE, number INTEGER NOT NULL,
    content BLOB NOT NULL, PRIMARY KEY (run_id, number)
) STRICT;
CREATE TABLE IF NOT EXISTS rating (
    run_id TEXT PRIMARY KEY REFERENCES run ON DELETE CASCADE, points INTEGER NOT NULL
) STRICT;
CREATE TABLE IF NOT EXISTS statement_elsewhere (
    url TEXT NOT NULL, id TEXT NOT NULL, person_id TEXT, content BLOB NOT NULL,
    tries INTEGER NOT NULL, sent_at TEXT, refused TEXT, PRIMARY KEY (url, id)
) STRICT;
"""
_STATEMENT = "id, person_id, content, tries, sent_at, refused"
_IS_SENT_TO = " AND (SELECT learning_record_store FROM class) = ?"
_RUN = (
    "id, person_id, assignment_id, mode, title, started_at, finished, passed, reason, measures,"
    " file, level, seed, incidents"
)
_RUN_WITHOUT_FILE = _RUN.replace("file", "x''")


class ClassFileError(ValueError):
    """A file that is not a class, or a class that is not there."""


class ClassFullError(ValueError):
    """The class, or a person in it, has as much as it may have."""


@dataclass(frozen=True, slots=True)
class Person:
    """Someone who has typed a name; `id` is secret to others."""

    id: str
    name: str
    joined_at: str
    level: str | None = None  # of the course, that the teacher has set


@dataclass(frozen=True, slots=True)
class Assignment:
    """An exercise that the teacher has set: its file, and the exercise that came of it as JSON."""

    id: int
    text: str
    exercise: str
    set_at: str
    started_at: str | None
    stopped_at: str | None

    @property
    def goes_on(self) -> bool:
        """Whether it is started and not stopped."""
        return self.started_at is not None and self.stopped_at is None


@dataclass(frozen=True, slots=True)
class RunRecord:
    """A run as it is kept, in its table's order: `measures`, `file` and `incidents` are JSON.

    It is unfinished while more may come. `incidents` is None in runs of before they were kept.
    """

    id: str
    person_id: str
    assignment_id: int | None
    mode: str
    title: str
    started_at: str
    finished: bool
    passed: bool | None
    reason: str
    measures: str
    file: bytes
    level: str | None = None  # of the course, that it is a try at
    seed: int | None = None  # of its bed
    incidents: str | None = None


@dataclass(frozen=True, slots=True)
class Statement:
    """An xAPI statement that is to be sent: `content` is JSON, `person_id` of whom it tells."""

    id: str
    person_id: str | None
    content: bytes


def now() -> str:
    """Return the time as text, to the second, with the zone."""
    return datetime.now(UTC).astimezone().isoformat(timespec="seconds")


def class_path(name: str) -> Path:
    """Return the file of a class by its title, or the file itself if a file is named."""
    if name.endswith(SUFFIX) or os.sep in name:
        return Path(name)
    stem = re.sub(r"[^\w]+", "-", name.lower()).strip("-_")
    if not stem or len(name) > LONGEST_TITLE:
        raise ClassFileError(
            f"a class needs a title of 1 to {LONGEST_TITLE} characters with letters, not {name!r}"
        )
    return _folder() / f"{stem}{SUFFIX}"


def class_files() -> list[Path]:
    """Return the files of all classes in the user's data folder."""
    return sorted(_folder().glob(f"*{SUFFIX}"))


def _folder() -> Path:
    return Path(platformdirs.user_data_dir("bluntdissect", appauthor=False)) / "classes"


class ClassStore:
    """An open class. Safe to use from several threads; a second process may read and write too."""

    def __init__(self, path: Path) -> None:
        if not path.is_file():
            raise ClassFileError(
                f"there is no class {path.stem!r} ({path}); make it with bluntdissect class new, "
                "or see bluntdissect class list"
            )
        self.path, self._lock = path, threading.RLock()
        try:
            self._db = sqlite3.connect(
                path, timeout=BUSY_SECONDS, isolation_level=None, check_same_thread=False
            )
            self._db.row_factory = sqlite3.Row
            kind, version = self._value("PRAGMA application_id"), self._value("PRAGMA user_version")
            if kind != APPLICATION or version not in (1, VERSION):
                raise ClassFileError(f"{path} is not a class of this version of bluntdissect")
            for pragma in ("journal_mode=WAL", "synchronous=FULL", "foreign_keys=ON",
                           "secure_delete=ON"):  # fmt: skip
                self._db.execute(f"PRAGMA {pragma}")
            if version == 1:
                self._db.executescript(
                    f"BEGIN IMMEDIATE; {_COURSE} PRAGMA user_version={VERSION}; COMMIT;"
                )
            self._db.executescript(_RECORDS)
            row = self._db.execute("SELECT * FROM class").fetchone()
        except sqlite3.DatabaseError as error:
            raise ClassFileError(f"cannot read {path} as a class: {error}") from error
        self.title: str = row["title"]
        self.made_at: str = row["made_at"]
        self.teacher_token: str = row["teacher_token"]
        self.trainee_token: str = row["trainee_token"]
        self._shows_standing = bool(row["shows_standing"])
        self.id: str = row["uuid"]
        self._course: str | None = row["course"]
        self._learning_record_store: str | None = row["learning_record_store"]
        self._data_version: object = self._value("PRAGMA data_version")

    @classmethod
    def new(cls, path: Path, title: str) -> "ClassStore":
        """Make a class that can be read by its maker only, and open it."""
        title = title.strip()
        if not 0 < len(title) <= LONGEST_TITLE or not title.isprintable():
            raise ClassFileError(f"a class needs a title of 1 to {LONGEST_TITLE} characters")
        try:
            path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            os.close(os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600))
        except FileExistsError as error:
            raise ClassFileError(
                f"there is a class {path.stem!r} already; open it with bluntdissect class open"
            ) from error
        try:
            db = sqlite3.connect(path)
            db.executescript(
                f"BEGIN; PRAGMA application_id={APPLICATION}; PRAGMA user_version={VERSION};"
                f"{_TABLES} {_COURSE} COMMIT;"
            )
            tokens = [secrets.token_urlsafe(TOKEN_BYTES) for _ in range(2)]
            with db:
                db.execute(
                    "INSERT INTO class (id, title, made_at, teacher_token, trainee_token,"
                    " shows_standing, uuid) VALUES (1, ?, ?, ?, ?, 0, ?)",
                    (title, now(), *tokens, secrets.token_hex(16)),
                )
            db.close()
        except BaseException:
            path.unlink()
            raise
        return cls(path)

    def close(self) -> None:
        """Close it; what was deleted is then gone from its files."""
        with self._lock:
            self._forget()
            self._db.close()

    def delete(self) -> None:
        """Close it and remove all of it; `ClassFileError` where it is open elsewhere."""
        try:  # which needs the file for itself alone
            self._db.execute("PRAGMA journal_mode=DELETE")
        except sqlite3.OperationalError as error:
            raise ClassFileError(
                f"{self.title} is open: end that with Ctrl+C first, in its terminal"
            ) from error
        finally:
            self.close()
        for suffix in ("", "-wal", "-shm"):
            self.path.with_name(self.path.name + suffix).unlink(missing_ok=True)

    def back_up(self, path: Path) -> None:
        """Write the class as it is now to a new file, readable by its maker only."""
        try:
            os.close(os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600))
        except FileExistsError as error:
            raise ClassFileError(f"{path} is there already; a backup replaces nothing") from error
        try:
            with contextlib.closing(sqlite3.connect(path)) as target, self._lock:
                self._db.backup(target)
        except BaseException:
            path.unlink()
            raise

    def renew_links(self) -> None:
        """Make new links; who came by the old ones is out."""
        tokens = [secrets.token_urlsafe(TOKEN_BYTES) for _ in range(2)]
        with self._writing() as db:
            db.execute("UPDATE class SET teacher_token = ?, trainee_token = ?", tokens)
        self.teacher_token, self.trainee_token = tokens

    @property
    def shows_standing(self) -> bool:
        """Whether trainees see where they stand, without names."""
        return self._shows_standing

    @shows_standing.setter
    def shows_standing(self, shown: bool) -> None:
        with self._writing() as db:
            db.execute("UPDATE class SET shows_standing = ?", (int(shown),))
        self._shows_standing = shown

    @property
    def course(self) -> str | None:
        """The file of the class's course, if it has one."""
        return self._course

    @course.setter
    def course(self, content: str | None) -> None:
        with self._writing() as db:
            db.execute("UPDATE class SET course = ?", (content,))
        self._course = content

    @property
    def learning_record_store(self) -> str | None:
        """Where xAPI statements of results are sent to, as JSON, or None."""
        return self._learning_record_store

    @learning_record_store.setter
    def learning_record_store(self, content: str | None) -> None:
        with self._writing() as db:
            # Another process may have set one meanwhile.
            (before,) = db.execute("SELECT learning_record_store FROM class").fetchone()
            db.execute("UPDATE class SET learning_record_store = ?", (content,))
            old, url = (each and json.loads(each)["url"] for each in (before, content))
            if url != old:
                _change_queue(db, old, url)
        self._learning_record_store = content

    def changed_elsewhere(self) -> bool:
        """Read what another process has set since the last call; return whether it differs."""
        version = self._value("PRAGMA data_version")
        if version == self._data_version:
            return False
        (row,) = self._rows("SELECT course, learning_record_store, shows_standing FROM class")
        before = self._course, self._learning_record_store, self._shows_standing
        self._course, self._learning_record_store = row[0], row[1]
        self._shows_standing, self._data_version = bool(row[2]), version
        return (self._course, self._learning_record_store, self._shows_standing) != before

    # People

    def person_of(self, browser: str) -> Person | None:
        """Return who uses a browser, if the name was typed."""
        found = self._rows(
            "SELECT id, name, joined_at, level FROM person WHERE browser_sha256 = ?",
            _digest(browser),
        )
        return Person(*found[0]) if found else None

    def people(self) -> list[Person]:
        """Return all, in the order in which they came."""
        return [
            Person(*row)
            for row in self._rows(
                "SELECT id, name, joined_at, level FROM person ORDER BY joined_at, rowid"
            )
        ]

    def name_person(self, browser: str, name: str) -> Person:
        """Give who uses a browser a name, which others may have too."""
        name = " ".join(name.split())
        if not 0 < len(name) <= LONGEST_NAME or not name.isprintable():
            raise ValueError(f"A name has 1 to {LONGEST_NAME} characters.")
        with self._writing() as db:
            (count,) = db.execute("SELECT count(*) FROM person").fetchone()
            known = self.person_of(browser)
            if known is None and count >= MOST_PEOPLE:
                raise ClassFullError(f"This class has {MOST_PEOPLE} people already.")
            db.execute(
                "INSERT INTO person (id, browser_sha256, name, joined_at) VALUES (?, ?, ?, ?)"
                " ON CONFLICT (browser_sha256) DO UPDATE SET name = excluded.name",
                (secrets.token_urlsafe(ID_BYTES), _digest(browser), name, now()),
            )
        found = self.person_of(browser)
        assert found is not None  # noqa: S101 (just written)
        return found

    def delete_person(self, person_id: str, void: Callable[[Statement], Statement]) -> bool:
        """Delete a person with all runs, overwritten in the file; return whether there was one."""
        # What waits to be sent goes too; what may have been sent is voided, by what `void` makes,
        # in each store, once results are sent there.
        maybe_sent = "FROM {} WHERE person_id = ? AND tries > 0 AND refused IS NULL"
        with self._writing() as db:
            gone = db.execute("DELETE FROM person WHERE id = ?", (person_id,)).rowcount > 0
            sent, elsewhere = (
                db.execute(
                    f"SELECT {url}, id, person_id, content {maybe_sent.format(table)}",
                    (person_id,),
                ).fetchall()
                for table, url in (("statement", "''"), ("statement_elsewhere", "url"))
            )
            for table in ("statement", "statement_elsewhere"):
                db.execute(f"DELETE FROM {table} WHERE person_id = ?", (person_id,))  # noqa: S608
            _queue(db, [void(Statement(*each)) for _, *each in sent])
            db.executemany(
                "INSERT INTO statement_elsewhere (url, id, person_id, content, tries)"
                " VALUES (?, ?, ?, ?, 0)",
                [(url, *astuple(void(Statement(*each)))) for url, *each in elsewhere],
            )
        with self._lock:
            self._forget()
        return gone

    def set_level(self, level: str | None, person_id: str | None = None) -> None:
        """Set a level of the course for a person or for all; None leaves it to the course."""
        with self._writing() as db:
            db.execute(
                "UPDATE person SET level = ?1 WHERE ?2 IS NULL OR id = ?2", (level, person_id)
            )

    # Exercises

    def assign(self, text: str, exercise: str) -> Assignment:
        """Set an exercise in place of the one before."""
        with self._writing() as db:
            (count,) = db.execute("SELECT count(*) FROM assignment").fetchone()
            if count >= MOST_ASSIGNMENTS:
                raise ClassFullError(
                    f"This class has had {MOST_ASSIGNMENTS} exercises: make a new one."
                )
            at = now()
            db.execute(
                "UPDATE assignment SET stopped_at = ?"
                " WHERE started_at IS NOT NULL AND stopped_at IS NULL",
                (at,),
            )
            db.execute(
                "INSERT INTO assignment (text, exercise, set_at) VALUES (?, ?, ?)",
                (text, exercise, at),
            )
        found = self.assignment()
        assert found is not None  # noqa: S101 (just written)
        return found

    def start_assignment(self) -> Assignment | None:
        """Start the exercise that is set, or start it again."""
        return self._mark("started_at = ?, stopped_at = NULL")

    def stop_assignment(self) -> Assignment | None:
        """Stop it."""
        return self._mark("stopped_at = ?")

    def _mark(self, change: str) -> Assignment | None:
        with self._writing() as db:
            db.execute(
                f"UPDATE assignment SET {change} WHERE id = (SELECT max(id) FROM assignment)",  # noqa: S608
                (now(),),
            )
        return self.assignment()

    def assignment(self) -> Assignment | None:
        """Return the exercise that is set, if any."""
        found = self.assignments()
        return found[-1] if found else None

    def assignments(self) -> list[Assignment]:
        """Return all exercises that were set, oldest first."""
        return [Assignment(*row) for row in self._rows("SELECT * FROM assignment ORDER BY id")]

    # Runs

    def save(self, run: RunRecord, statements: Sequence[Statement] = ()) -> None:
        """Write a run, in place of what was kept of it; a finished one stays as it is."""
        # In one transaction with its statements: a kill leaves both or neither.
        if len(run.file) > MOST_RUN_BYTES:
            raise ClassFullError("This run is too long to be kept.")
        with self._writing() as db:
            (count,) = db.execute(
                "SELECT count(*) FROM run WHERE person_id = ? AND id <> ?", (run.person_id, run.id)
            ).fetchone()
            if count >= MOST_RUNS:
                raise ClassFullError(f"{MOST_RUNS} runs of yours are kept already.")
            db.execute(
                f"INSERT INTO run ({_RUN}) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)"  # noqa: S608
                " ON CONFLICT (id) DO UPDATE SET finished = excluded.finished,"
                " passed = excluded.passed, reason = excluded.reason,"
                " measures = excluded.measures, file = excluded.file,"
                " incidents = excluded.incidents"
                " WHERE finished = 0",
                astuple(run),
            )
            _queue(db, statements)

    def runs(self, person_id: str | None = None) -> list[RunRecord]:
        """Return runs, oldest first, of all or one person, without their files."""
        rows = self._rows(
            f"SELECT {_RUN_WITHOUT_FILE} FROM run WHERE ?1 IS NULL OR person_id = ?1"  # noqa: S608
            " ORDER BY started_at, rowid",
            person_id,
        )
        return [_record(row) for row in rows]

    def level_runs(self, person_id: str | None = None) -> list[RunRecord]:
        """Return the runs of levels of a course, oldest first, without their files."""
        rows = self._rows(
            f"SELECT {_RUN_WITHOUT_FILE} FROM run WHERE level IS NOT NULL"  # noqa: S608
            " AND (?1 IS NULL OR person_id = ?1) ORDER BY started_at, rowid",
            person_id,
        )
        return [_record(row) for row in rows]

    def run(self, run_id: str) -> RunRecord | None:
        """Return a run with its file."""
        found = self._rows(f"SELECT {_RUN} FROM run WHERE id = ?", run_id)  # noqa: S608
        return _record(found[0]) if found else None

    # Photographs of runs, and what a teacher gives for them

    def keep_photographs(self, run_id: str, taken: Sequence[bytes]) -> None:
        """Keep the photographs of a run that is kept."""
        if len(taken) > MOST_PHOTOGRAPHS:
            raise ClassFullError(f"A run has at most {MOST_PHOTOGRAPHS} photographs.")
        if any(len(each) > MOST_BYTES or kind_of(each) is None for each in taken):
            raise ValueError("That is no photograph, or too large a one.")
        with self._writing() as db:
            db.executemany(
                "INSERT OR REPLACE INTO photograph (run_id, number, content) VALUES (?, ?, ?)",
                [(run_id, number, each) for number, each in enumerate(taken)],
            )

    def photographs(self, run_id: str) -> list[bytes]:
        """Return the photographs of a run, the front first."""
        rows = self._rows("SELECT content FROM photograph WHERE run_id = ? ORDER BY number", run_id)
        return [row["content"] for row in rows]

    def photographed(self) -> dict[str, int]:
        """Return how many photographs each run has that has some."""
        rows = self._rows("SELECT run_id, count(*) FROM photograph GROUP BY run_id")
        return {row[0]: row[1] for row in rows}

    def rate(self, run_id: str, points: int | None) -> None:
        """Keep the points of 6 that a teacher gives for a run's view, or none."""
        if points is not None and not 0 <= points <= MOST_POINTS:
            raise ValueError(f"A critical view has 0 to {MOST_POINTS} points, not {points}.")
        if self.run(run_id) is None:
            raise ValueError("There is no such run.")
        with self._writing() as db:
            db.execute("DELETE FROM rating WHERE run_id = ?", (run_id,))
            if points is not None:
                db.execute("INSERT INTO rating (run_id, points) VALUES (?, ?)", (run_id, points))

    def ratings(self) -> dict[str, int]:
        """Return the points of 6 that a teacher has given, by run."""
        return dict(map(tuple, self._rows("SELECT run_id, points FROM rating")))

    # Statements for a learning record store

    def queue(self, statements: Iterable[Statement]) -> None:
        """Queue statements that are not there yet."""
        with self._writing() as db:
            _queue(db, statements)

    def statements_to_send(self, receiver: str, most: int) -> list[Statement]:
        """Return some that wait for a learning record store, each marked as tried before."""
        with self._writing() as db:
            rows = db.execute(
                "SELECT id, person_id, content FROM statement WHERE sent_at IS NULL"  # noqa: S608
                f" AND refused IS NULL{_IS_SENT_TO} ORDER BY rowid LIMIT ?",
                (receiver, most),
            ).fetchall()
            db.executemany(
                "UPDATE statement SET tries = tries + 1 WHERE id = ?",
                [(row["id"],) for row in rows],
            )
        return [Statement(*row) for row in rows]

    def statements_sent(self, receiver: str, ids: Iterable[str]) -> None:
        """Mark statements as sent to a learning record store, unless it is another one now."""
        with self._writing() as db:
            db.executemany(
                f"UPDATE statement SET sent_at = ? WHERE id = ?{_IS_SENT_TO}",  # noqa: S608
                [(now(), each, receiver) for each in ids],
            )

    def statement_refused(self, receiver: str, statement_id: str, reason: str) -> None:
        """Mark a statement as refused by a store, which is not sent there again."""
        with self._writing() as db:
            db.execute(
                f"UPDATE statement SET refused = ? WHERE id = ?{_IS_SENT_TO}",  # noqa: S608
                (reason, statement_id, receiver),
            )

    def statement_counts(self) -> tuple[int, int, int, str]:
        """Return how many statements wait, were sent, were refused, and the last refusal's why."""
        (row,) = self._rows(
            "SELECT count(*) FILTER (WHERE sent_at IS NULL AND refused IS NULL),"
            " count(sent_at), count(refused), coalesce(max(refused), '') FROM statement"
        )
        return tuple(row)

    def _rows(self, query: str, *values: object) -> list[Any]:
        with self._lock:
            return self._db.execute(query, values).fetchall()

    def _value(self, query: str) -> object:
        return self._rows(query)[0][0]

    @contextlib.contextmanager
    def _writing(self) -> Generator[sqlite3.Connection]:
        """Give the database in a transaction, which is on the disk afterwards or not at all."""
        with self._lock:
            self._db.execute("BEGIN IMMEDIATE")
            try:
                yield self._db
                self._db.execute("COMMIT")
            except BaseException:
                if self._db.in_transaction:
                    self._db.execute("ROLLBACK")
                raise

    def _forget(self) -> None:
        """Move the write-ahead log into the file, so that it holds nothing that was deleted."""
        # Another process reads it now, or it is closed already.
        with contextlib.suppress(sqlite3.OperationalError, sqlite3.ProgrammingError):
            self._db.execute("PRAGMA wal_checkpoint(TRUNCATE)")


def _queue(db: sqlite3.Connection, statements: Iterable[Statement]) -> None:
    db.executemany(
        "INSERT OR IGNORE INTO statement (id, person_id, content) VALUES (?, ?, ?)",
        [astuple(each) for each in statements],
    )


def _change_queue(db: sqlite3.Connection, before: str | None, url: str | None) -> None:
    """Put away what was for one learning record store, and bring back what is for another."""
    # What a store may have, and what tells it of deletions, is kept; what else waits is made again.
    # Of what an earlier version left, it is not known which store has it: it is sent again.
    db.execute("DELETE FROM statement WHERE tries = 0 AND person_id IS NOT NULL")
    if before is None:
        db.execute("UPDATE statement SET sent_at = NULL, refused = NULL")
    else:
        db.execute(
            f"INSERT INTO statement_elsewhere (url, {_STATEMENT})"  # noqa: S608
            f" SELECT ?, {_STATEMENT} FROM statement",
            (before,),
        )
        db.execute("DELETE FROM statement")
    db.execute(
        f"INSERT OR REPLACE INTO statement ({_STATEMENT})"  # noqa: S608
        f" SELECT {_STATEMENT} FROM statement_elsewhere WHERE url = ?",
        (url,),
    )
    db.execute("DELETE FROM statement_elsewhere WHERE url = ?", (url,))


def _record(row: Any) -> RunRecord:
    values = list(row)
    values[6] = bool(values[6])
    values[7] = None if values[7] is None else bool(values[7])
    return RunRecord(*values)


def _digest(browser: str) -> str:
    return hashlib.sha256(browser.encode()).hexdigest()
