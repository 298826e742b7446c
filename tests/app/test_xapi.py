"""xAPI statements: what others' programs say of them, and that none is lost or doubled."""

import json
import os
import random
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from datetime import datetime, timedelta, timezone
from functools import partial
from pathlib import Path
from string import Formatter

import msgspec
import pytest
from class_runs import record
from other_programs import missing, statement_faults
from program import LONGEST, refused, run
from record_store import KEY, SECRET, RecordStore
from simulated import phantom
from statement_sender import INCIDENTS

from app.classroom.class_course import ClassCourse
from app.classroom.course import default_course, read_course
from app.classroom.store import ClassStore, RunRecord, Statement
from app.classroom.xapi import VERSIONS, pseudonym, voiding
from app.classroom.xapi_sender import (
    LearningRecordStore,
    Sender,
    checked_url,
    class_statements,
    connect,
    disconnect,
    keep_key,
)
from app.simulation import ERROR_CLASSES, Incident
from app.trainer.classroom.lesson import Lesson

HERE = Path(__file__).parent
KILLS = 4
CONSEQUENCES = ("none", "near miss", "minor", "injury")


@pytest.fixture(autouse=True)
def config(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    return tmp_path / "config"


@pytest.fixture
def records(tmp_path: Path) -> Iterator[RecordStore]:
    made = RecordStore(tmp_path / "records.sqlite")
    thread = threading.Thread(target=made.serve_forever)
    thread.start()
    yield made
    made.shutdown()
    made.server_close()
    thread.join()


def to(
    store: ClassStore, url: str = "https://lrs.example.org/xapi", version: str = "1.0.3"
) -> None:
    found = LearningRecordStore.of(url, version)
    store.learning_record_store = msgspec.json.encode(found).decode()


def mastering(store: ClassStore, number: int) -> RunRecord:
    """A try that passes the first level of the course, with an error in it."""
    run = record(store.name_person("b", "Ann Smith").id, run_id=f"run-{number}", passed=True)
    return replace(
        run, reason="Reached.", level="approach", incidents=INCIDENTS,
        started_at=f"2026-11-25T10:0{number}:00+01:00",
    )  # fmt: skip


def every_kind(store: ClassStore, version: str) -> list[Statement]:
    """Statements of every kind."""
    store.course = default_course()
    book = ClassCourse(store)
    to(store, version=version)
    found: list[Statement] = []
    for number in range(2):
        run = mastering(store, number)
        found += class_statements(store, book, run)
        store.save(run)
    person = store.people()[0]
    failed = record(person.id, run_id="f", passed=False, reason="Too far.")
    given_up = replace(record(person.id, run_id="g"), level="window", seed=3)
    found += class_statements(store, book, failed) + class_statements(store, book, given_up)
    return [*found, voiding(store.id, found[0])]


def test_every_kind_of_statement_is_valid_to_learning_locker(
    store: ClassStore, tmp_path: Path
) -> None:
    found = every_kind(store, "1.0.3")
    verbs = [json.loads(each.content)["verb"]["id"].rpartition("/")[2] for each in found]
    assert verbs == [
        "passed", "erred", "passed", "erred", "mastered", "failed", "failed", "voided",
    ]  # fmt: skip
    spoilt = json.loads(found[0].content)
    spoilt["result"]["duration"], spoilt["timestamp"] = "19 s", "yesterday"
    all_of_them = [*(json.loads(each.content) for each in found), spoilt]
    assert statement_faults(all_of_them, tmp_path / "statements.json") == [0] * len(found) + [2]


def extensions_of(words: str, rng: random.Random) -> dict[str, float | str]:
    """Values for the fields of an error's sentence."""
    fields = [(name, spec) for _, name, spec, _ in Formatter().parse(words) if name and name != "t"]
    return {name: rng.uniform(0, 99) if spec else "artery" for name, spec in fields}


def random_run(person: str, number: int, rng: random.Random) -> RunRecord:
    """A try with any errors, of any outcome, at any time in any zone."""
    zone = timezone(timedelta(minutes=15 * rng.randint(-48, 56)))
    seconds = rng.choice([0.03, 1.0, 19.033333, 3600.0])
    incidents: list[Incident] = []
    for each in rng.sample(list(ERROR_CLASSES.values()), rng.randint(0, 8)):
        start = rng.uniform(0.0, seconds)
        incidents += [
            Incident(
                each.key, start, start + rng.random(), rng.choice([None, 0, 1]), rng.randint(0, 4),
                rng.choice([None, rng.uniform(0.0, 90.0)]), rng.choice(CONSEQUENCES),
                extensions_of(each.happened + each.instead, rng),
            )
        ] * rng.choice([1, 1, 1, 60])  # fmt: skip
    base = record(person, run_id=f"{number}", passed=rng.choice([True, False, None]))
    measures = msgspec.json.decode(base.measures) | {"time_s": seconds}
    for key in rng.sample(sorted(measures.keys() - {"time_s", "tear"}), 6):
        measures[key] = rng.choice([None, 0, 1e-12, -1.5, 1e9])
    began = datetime(2026, 1, 1, tzinfo=zone) + timedelta(seconds=rng.randint(0, 3 * 10**7))
    return replace(
        base, title=rng.choice(["Open a window", "Öffnen <b>", "窓", "a" * 60]),
        reason=rng.choice(["", "Too far.", "Zu weit: 3 % «mehr»", "🙂"]),
        level=rng.choice([None, "approach", "window", "front"]), seed=rng.choice([None, 7]),
        incidents=msgspec.json.encode(incidents).decode(),
        measures=msgspec.json.encode(measures).decode(),
        started_at=began.isoformat(timespec="seconds"),
    )  # fmt: skip


@pytest.mark.parametrize(
    "runs", [60, pytest.param(1000, marks=pytest.mark.long)], ids=["few", "many"]
)
def test_statements_of_random_runs_are_valid_and_each_has_its_own_id(
    store: ClassStore, tmp_path: Path, runs: int
) -> None:
    store.course = default_course()
    book, rng = ClassCourse(store), random.Random(31)
    to(store)
    people = [store.name_person(f"browser {number}", name).id for number, name in enumerate("ABC")]
    found: list[Statement] = []
    for number in range(runs):
        run = random_run(people[number % 3], number, rng)
        found += class_statements(store, book, run)
        if number % 50 == 0:  # so that some are mastered
            store.save(run)
    assert len({each.id for each in found if b"/mastered" not in each.content}) > runs / 2
    repeated = [each.id for each in found if b"verbs/mastered" not in each.content]
    assert len(repeated) == len(set(repeated))
    faults = statement_faults(
        [json.loads(each.content) for each in found], tmp_path / "statements.json"
    )
    assert faults == [0] * len(found)


@pytest.mark.parametrize("version", VERSIONS)
def test_statements_made_again_are_the_same_and_have_no_name(
    store: ClassStore, version: str
) -> None:
    found = every_kind(store, version)
    book = ClassCourse(store)
    runs = [mastering(store, number) for number in range(2)]
    again = [each for run in runs for each in class_statements(store, book, run)]
    assert again == found[: len(again)]
    assert len({each.id for each in found}) == len(found)
    person = store.people()[0]
    for each in found:
        plain = json.loads(each.content)
        assert plain["version"] == version
        for secret in ("Ann", "Smith", person.id, "Surgery"):
            assert secret not in each.content.decode()
    assert json.loads(found[0].content)["actor"]["account"]["name"] == pseudonym(
        store.id, person.id
    )
    assert class_statements(store, book, record(person.id)) == []  # practice on his own


def test_nothing_is_made_or_sent_until_a_teacher_names_a_store(store: ClassStore) -> None:
    run = mastering(store, 0)
    assert class_statements(store, ClassCourse(store), run) == []
    store.save(run)
    assert store.statement_counts() == (0, 0, 0, "")


def test_what_is_kept_is_sent_and_who_is_deleted_is_voided(
    store: ClassStore, records: RecordStore, config: Path
) -> None:
    store.course = default_course()
    book = ClassCourse(store)
    for number in range(2):
        store.save(mastering(store, number))
    connect(store, book, records.url, "1.0.3", KEY, SECRET)
    (key,) = config.rglob("*.json")
    assert key.stat().st_mode & 0o777 == 0o600
    assert SECRET.encode() not in store.path.read_bytes()
    sender = Sender(store, first_wait=0.01)
    try:
        until(lambda: store.statement_counts()[:2] == (0, 5))
        kept = records.kept()
        assert sum(each["verb"]["id"].endswith("mastered") for each in kept.values()) == 1  # type: ignore[index]
        (person,) = store.people()
        store.delete_person(person.id, partial(voiding, store.id))
        sender.wake()
        # The store has them a moment before they are noted as sent.
        until(lambda: store.statement_counts()[:2] == (0, 5))
        assert len(records.kept()) == 10
        disconnect(store)
        assert not list(config.rglob("*.json"))
    finally:
        sender.stop()


def test_another_store_gets_all_and_a_deletion_reaches_each_store(
    store: ClassStore, records: RecordStore, tmp_path: Path
) -> None:
    """Also one while results are sent to none: once they are sent there again."""
    others = RecordStore(tmp_path / "others.sqlite")
    thread = threading.Thread(target=others.serve_forever)
    thread.start()
    store.course = default_course()
    book, void = ClassCourse(store), partial(voiding, store.id)
    for number in range(2):
        store.save(mastering(store, number))
    sender = Sender(store, first_wait=0.01)

    def sent_to(receiver: RecordStore, count: int, version: str = "1.0.3") -> dict[str, int]:
        connect(store, book, receiver.url, version, KEY, SECRET)
        sender.wake()
        until(lambda: store.statement_counts()[:2] == (0, count))
        verbs = [str(each["verb"]["id"]).rpartition("/")[2] for each in receiver.kept().values()]  # type: ignore[index]
        return {verb: verbs.count(verb) for verb in verbs}

    try:
        whole = {"passed": 2, "erred": 2, "mastered": 1}
        assert sent_to(records, 5) == whole
        assert sent_to(others, 5) == whole
        asked = records.asked
        assert sent_to(records, 5) == whole
        assert records.asked == asked  # it has them
        disconnect(store)
        assert store.statement_counts() == (0, 0, 0, "")
        (person,) = store.people()
        assert store.delete_person(person.id, void)
        sender.wake()
        assert (len(records.kept()), len(others.kept())) == (5, 5)  # nothing is sent to nobody
        assert sent_to(others, 5, "2.0.0") == whole | {"voided": 5}
        assert sent_to(records, 5) == whole | {"voided": 5}
        kept = records.kept().values()
        voids = [each for each in kept if each["verb"]["id"].endswith("voided")]  # type: ignore[index]
        others_of_it = {each["id"] for each in kept if each not in voids}
        assert {each["object"]["id"] for each in voids} == others_of_it  # type: ignore[index]
    finally:
        sender.stop()
        others.shutdown()
        others.server_close()
        thread.join()


def test_an_open_class_takes_what_a_command_sets(store: ClassStore, records: RecordStore) -> None:
    """A store, to which goes what has ended meanwhile too; a course; and none of them any more."""
    person = store.name_person("b", "Ann Smith")
    lesson = Lesson(store, phantom())
    command = ClassStore(store.path)
    try:
        book = ClassCourse(command)
        book.choose(default_course())
        until(lambda: lesson.course.course == read_course(default_course()))
        version = lesson.version
        store.save(replace(mastering(store, 0), person_id=person.id))  # of which it knows nothing
        keep_key(store.id, KEY, SECRET)
        to(command, records.url)
        until(lambda: len(records.kept()) == 2)
        assert lesson.version > version
        disconnect(command)
        until(lambda: store.learning_record_store is None)
        book.choose(None)
        until(lambda: lesson.course.course is None)
    finally:
        command.close()
        lesson.stop()


def test_an_open_class_looks_no_further_once_its_file_is_closed(tmp_path: Path) -> None:
    store = ClassStore.new(tmp_path / "class.sqlite", "Surgery 3A")
    lesson = Lesson(store, phantom())
    store.close()
    until(lambda: not lesson._thread.is_alive())
    lesson._recorder.stop()
    lesson.sender.stop()


def test_what_a_store_refuses_is_kept_with_its_reason_and_the_rest_is_sent(
    store: ClassStore, records: RecordStore
) -> None:
    book = ClassCourse(store)
    connect(store, book, records.url, "2.0.0", KEY, SECRET)
    run = replace(mastering(store, 0), level=None)
    statements = class_statements(store, book, run)
    store.save(run, [Statement("bad", run.person_id, b'{"id": "bad"}'), *statements])
    # Another statement under an id that the store has already.
    records.keep([json.loads(statements[0].content) | {"other": 1}])
    sender = Sender(store, first_wait=0.01)
    try:
        until(lambda: store.statement_counts()[0] == 0)
        assert store.statement_counts()[1:] == (2, 1, "The learning record store answers 400: no")
    finally:
        sender.stop()


def test_a_store_that_does_not_let_in_is_told_and_asked_again_only_later(
    store: ClassStore, records: RecordStore
) -> None:
    book = ClassCourse(store)
    connect(store, book, records.url, "1.0.3", KEY, "wrong")
    kinds = every_kind(store, "1.0.3")
    to(store, records.url)
    store.queue(kinds)
    records.retry_after = "3600"
    sender = Sender(store, first_wait=0.01)
    try:
        until(lambda: "answers 401" in sender.problem)
        for _ in range(20):
            sender.wake()
        assert records.asked == 1
        assert store.statement_counts()[1] == 0
    finally:
        sender.stop()


def test_a_failing_store_and_kills_lose_and_double_nothing(tmp_path: Path) -> None:
    killed_before_a_failing_store(tmp_path, KILLS)


@pytest.mark.long
def test_a_hundred_kills_lose_and_double_nothing(tmp_path: Path) -> None:
    killed_before_a_failing_store(tmp_path, 100)


@pytest.mark.long
@pytest.mark.parametrize("version", VERSIONS)
def test_a_hundred_kills_before_ralph_lose_and_double_nothing(tmp_path: Path, version: str) -> None:
    if (python := os.environ.get("RALPH_PYTHON")) is None:
        missing("no Python with Ralph: run `make test-all`, or set RALPH_PYTHON to one")
    server = [python, HERE / "ralph_server.py", tmp_path / "ralph", KEY, SECRET]
    with subprocess.Popen(server, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            killed(tmp_path, 100, process.stdout.readline().strip(), version)
        finally:
            process.terminate()
    files = sorted((tmp_path / "ralph" / "lrs").iterdir())
    kept = [json.loads(line) for each in files for line in each.read_text().splitlines()]
    assert len({each["id"] for each in kept}) == len(kept)
    with closing(ClassStore(tmp_path / "class.sqlite")) as store:
        assert len(kept) == 2 * len(store.runs())


def killed_before_a_failing_store(folder: Path, kills: int) -> None:
    """Kill a sender to a store that fails a fifth of the time, before and after it stores."""
    records = RecordStore(folder / "records.sqlite", failing=0.2)
    thread = threading.Thread(target=records.serve_forever)
    thread.start()
    try:
        runs = killed(folder, kills, records.url, "1.0.3")
        kept = records.kept()
        assert len(kept) == 2 * runs
        passed = [each["verb"]["id"].endswith("passed") for each in kept.values()]  # type: ignore[index]
        assert sum(passed) == runs
        print(f"{kills} kills, {runs} runs, {len(kept)} statements, {records.asked} requests")
    finally:
        records.shutdown()
        records.server_close()
        thread.join()


def killed(folder: Path, kills: int, url: str, version: str) -> int:
    """Kill a process that saves and sends, again and again; return how many runs were saved.

    The result and the error of each run are sent, once each as far as the class knows.
    """
    path, rng = folder / "class.sqlite", random.Random(1)
    store = ClassStore.new(path, "Surgery 3A")
    connect(store, ClassCourse(store), url, version, KEY, SECRET)
    acknowledged: set[str] = set()
    root = HERE.parents[1]
    try:
        for _ in range(kills):
            with subprocess.Popen(
                [sys.executable, HERE / "statement_sender.py", path], stdout=subprocess.PIPE,
                text=True, env=os.environ | {"PYTHONPATH": f"{root}:{HERE}:{root}/tests/export"},
            ) as process:  # fmt: skip
                assert process.stdout is not None
                # After some runs, at no moment in particular.
                for _ in range(rng.randint(2, 12)):
                    line = process.stdout.readline()
                    acknowledged.add(line.strip())
                process.send_signal(signal.SIGKILL)
                acknowledged |= {line.strip() for line in process.stdout if line.endswith("\n")}
        sender = Sender(store, first_wait=0.01)
        until(lambda: store.statement_counts()[0] == 0)
        sender.stop()
        runs = {each.id for each in store.runs()}
        assert "" not in acknowledged
        assert acknowledged <= runs
        assert store.statement_counts()[1:3] == (2 * len(runs), 0)
        return len(runs)
    finally:
        store.close()


def until(condition: Callable[[], bool]) -> None:
    """Wait for a condition."""
    waited = threading.Event()
    for _ in range(int(LONGEST / 0.02)):
        if condition():
            return
        waited.wait(0.02)
    pytest.fail("it never came")


@pytest.mark.parametrize(
    ("url", "why"),
    [
        ("http://lrs.example.org/xapi", "must begin with https"),
        ("ftp://127.0.0.1/x", "must begin with https"),
        ("lrs.example.org", "is no address"),
        ("https://u:p@lrs.example.org/", "is no address"),
        ("https://lrs.example.org/?a=1", "is no address"),
        ("https://lrs.example.org:x/", "is no address"),
    ],
)
def test_a_wrong_address_is_refused(url: str, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        checked_url(url)
    assert checked_url("http://localhost:8080/xapi/") == "http://localhost:8080/xapi"


def test_the_command_says_what_is_sent(tmp_path: Path, store: ClassStore) -> None:
    assert "sends nothing" in run("class", "xapi", store.path).stdout
    assert "must begin with https" in refused(["class", "xapi", store.path, "http://a.example/"])
    assert "version must be one of" in refused(
        ["class", "xapi", store.path, "https://a.example/", "--version", "0.9"]
    )
    sent = Statement("x", None, b'{"version": "2.0.0"}')
    assert voiding("c", sent).id == voiding("c", sent).id
    assert json.loads(voiding("c", sent).content)["version"] == "2.0.0"
