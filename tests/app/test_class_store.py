"""What is kept of a class: on the disk once it is acknowledged, bounded, and deletable."""

import csv
import io
import json
import random
import re
import socket
import sqlite3
import stat
import threading
from functools import partial
from pathlib import Path
from queue import Queue

import pytest
from class_runs import asked, dissection, record
from class_saver import check_killed, killed_while_saving
from hypothesis import given, settings
from hypothesis import strategies as st
from program import LONGEST, refused, run
from simulated import phantom

from app.classroom import store as store_module
from app.classroom.exercise_file import (
    GOALS,
    AssignedExercise,
    Goal,
    read_exercise,
    template,
)
from app.classroom.recorder import Recorder
from app.classroom.report import report_page, results_html
from app.classroom.results import results, results_csv, results_json, shown_names, standing
from app.classroom.store import ClassFileError, ClassFullError, ClassStore, class_path
from app.classroom.xapi import voiding
from app.simulation import read_run

KILLS = 5
HOSTILE = "<img src=x onerror=alert(1)>&\"'"


def test_a_class_is_found_again_as_it_was_left(store: ClassStore) -> None:
    ann = store.name_person("browser-a", "  Ann   Bo ")
    store.save(record(ann.id, passed=True, reason="Freed 13 mm."))
    store.assign("text", "{}")
    store.start_assignment()
    store.shows_standing = True
    store.close()
    again = ClassStore(store.path)
    assert again.title == "Surgery 3A"
    assert (again.teacher_token, again.trainee_token) == (store.teacher_token, store.trainee_token)
    assert again.person_of("browser-a") == ann
    assert ann.name == "Ann Bo"
    assert again.person_of("browser-b") is None
    assert again.shows_standing
    assignment = again.assignment()
    assert assignment is not None
    assert assignment.goes_on
    (kept,) = again.runs()
    whole = again.run(kept.id)
    assert whole is not None
    assert whole.file == dissection()[0]
    assert read_run(whole.file).log.ticks == 20
    again.close()


def test_only_its_owner_reads_a_class(store: ClassStore) -> None:
    store.name_person("browser", "Ann")
    for file in store.path.parent.iterdir():
        assert stat.S_IMODE(file.stat().st_mode) == 0o600, file
    ids = {store.name_person(f"b{i}", "Same").id for i in range(50)}
    assert len(ids) == 50
    assert all(len(each) == 16 for each in ids)  # 96 random bits


def test_a_finished_run_stays_and_an_unfinished_one_is_replaced(store: ClassStore) -> None:
    ann = store.name_person("browser", "Ann").id
    first = record(ann, finished=False)
    store.save(first)
    store.save(record(ann, run_id=first.id, passed=True))
    store.save(record(ann, run_id=first.id, passed=False))
    (kept,) = store.runs()
    assert (kept.finished, kept.passed) == (True, True)


def test_bounds_are_kept(store: ClassStore, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("", "   ", "x" * 41, "a\x00b", "a\u202eb"):
        with pytest.raises(ValueError, match="1 to 40 characters"):
            store.name_person("browser", name)
    monkeypatch.setattr(store_module, "MOST_PEOPLE", 1)
    ann = store.name_person("browser", "Ann")
    with pytest.raises(ClassFullError):
        store.name_person("other", "Ben")
    assert store.name_person("browser", "Anna").id == ann.id
    monkeypatch.setattr(store_module, "MOST_RUNS", 1)
    kept = record(ann.id, finished=False)
    store.save(kept)
    store.save(kept)
    with pytest.raises(ClassFullError):
        store.save(record(ann.id))
    monkeypatch.setattr(store_module, "MOST_RUN_BYTES", 10)
    with pytest.raises(ClassFullError, match="too long"):
        store.save(kept)


def test_who_is_deleted_is_in_none_of_the_files(store: ClassStore) -> None:
    ann, ben = (store.name_person(name, f"{name} Unmistakable") for name in ("Annegret", "Benno"))
    for person in (ann, ben):
        store.save(record(person.id, reason=f"reason of {person.name}"))
    void = partial(voiding, store.id)
    assert store.delete_person(ann.id, void)
    assert not store.delete_person(ann.id, void)
    everything = b"".join(file.read_bytes() for file in store.path.parent.iterdir())
    assert b"Annegret" not in everything
    assert b"Benno Unmistakable" in everything
    assert {each.person_id for each in store.runs()} == {ben.id}
    with pytest.raises(sqlite3.IntegrityError):  # what was on its way when it was deleted
        store.save(record(ann.id))


def test_a_backup_of_an_open_class_is_a_class(store: ClassStore, tmp_path: Path) -> None:
    ann = store.name_person("browser", "Ann")
    store.save(record(ann.id))
    backup = tmp_path / "backup.sqlite"
    store.back_up(backup)
    assert stat.S_IMODE(backup.stat().st_mode) == 0o600
    with pytest.raises(ClassFileError, match="replaces nothing"):
        store.back_up(backup)
    copy = ClassStore(backup)
    assert (copy.people(), copy.runs()) == (store.people(), store.runs())
    # It is not deleted while another has it open.
    other = ClassStore(backup)
    with pytest.raises(ClassFileError, match="Surgery 3A is open: end that with Ctrl"):
        copy.delete()
    assert other.people() == store.people()
    other.delete()
    assert not list(tmp_path.glob("backup*"))
    assert store.people() == [ann]


def test_what_is_no_class_is_refused(tmp_path: Path) -> None:
    other = tmp_path / "other.sqlite"
    sqlite3.connect(other).executescript("CREATE TABLE class (id)").close()
    text = tmp_path / "text.sqlite"
    text.write_text("no database" * 100)
    for path in (other, text, tmp_path, tmp_path / "none.sqlite"):
        with pytest.raises(ClassFileError):
            ClassStore(path)
    for title in ("", "  ", "x" * 81, "a\nb"):
        with pytest.raises(ClassFileError):
            ClassStore.new(tmp_path / "new.sqlite", title)
    assert not (tmp_path / "new.sqlite").exists()


@settings(deadline=None, max_examples=50)
@given(title=st.text(max_size=120))
def test_a_title_gives_a_file_in_the_folder_of_classes_only(title: str) -> None:
    if "/" in title or title.endswith(".sqlite"):
        return
    try:
        path = class_path(title)
    except ClassFileError:
        return
    assert path.parent.name == "classes"
    assert ".." not in path.parts


@pytest.mark.long  # processes are killed
def test_what_was_acknowledged_survives_kills(tmp_path: Path) -> None:
    path = tmp_path / "class.sqlite"
    ClassStore.new(path, "Killed").close()
    chance, acknowledged = random.Random(15), set[str]()
    for _ in range(KILLS):
        message = killed_while_saving(path, chance.uniform(0.0, 0.15))
        assert message
        acknowledged |= message
        check_killed(path, acknowledged)


def test_a_full_disk_is_told_and_what_waits_is_saved_later(
    store: ClassStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.classroom.recorder.RETRY_SECONDS", 0.05)
    ann = store.name_person("browser", "Ann")
    save, full = store.save, threading.Event()
    full.set()

    def write(run: object, _: object) -> None:
        if full.is_set():
            raise sqlite3.OperationalError("database or disk is full")
        save(run)  # pyright: ignore[reportArgumentType]

    monkeypatch.setattr(store, "save", write)
    recorder, reported = Recorder(store, lambda _: ()), Queue[str | None]()
    kept = record(ann.id)
    recorder.save(kept.id, lambda: kept, reported.put)
    trouble = reported.get(timeout=LONGEST)
    assert trouble is not None
    assert "full" in trouble
    assert store.runs() == []
    full.clear()
    while reported.get(timeout=LONGEST) is not None:
        pass
    recorder.stop()
    assert [each.id for each in store.runs()] == [kept.id]


def test_cells_are_no_formulas_and_names_no_markup(store: ClassStore) -> None:
    names = ["=1+1", "+1", "-1", "@x", "Ann", HOSTILE]
    number = store.assign("", asked().json).id
    for name in names:
        person = store.name_person(name, name)
        store.save(record(person.id, passed=False, reason=f"={HOSTILE}", assignment=number))
    found = results(store)
    table = list(csv.DictReader(io.StringIO(results_csv(found).decode("utf-8-sig"))))
    assert [row["name"] for row in table] == ["'=1+1", "'+1", "'-1", "'@x", "Ann", HOSTILE]
    assert all(row["reason"].startswith("'=<img") for row in table)
    assert float(table[0]["traction_angle_deg"]) >= 0.0
    assert "tear_station_mm" not in table[0]
    for page in (results_html(store), report_page(store)):
        assert "<img" not in page
        assert "&lt;img src=x onerror=alert(1)&gt;&amp;&quot;&#x27;" in page
    whole = json.loads(results_json(store))
    assert [each["name"] for each in whole["runs"]] == names
    assert read_run(json.dumps(whole["runs"][0]["run"]).encode())


def test_each_sees_where_they_stand_and_no_names(store: ClassStore) -> None:
    number = store.assign("", asked().json).id
    people = [store.name_person(str(i), "Ann") for i in range(4)]
    assert list(shown_names(people).values()) == ["Ann", "Ann (2)", "Ann (3)", "Ann (4)"]
    for person, tries in zip(people, ([(0.9, True), (0.3, False), (0.4, True)], [(0.2, False)],
                                      [(0.1, True)], []), strict=True):  # fmt: skip
        for peak, passed in tries:
            store.save(record(person.id, passed=passed, peak=peak, assignment=number))
    found = results(store)
    where = standing(found, people[0].id, number)
    assert (where.tried, where.passed, where.own_passed) == (3, 2, True)
    assert where.own == pytest.approx(0.4)
    assert [passed for _, passed in where.others] == [True, False]
    assert standing(found, people[3].id, number).own is None


@pytest.mark.parametrize("goal", GOALS)
def test_an_exercise_file_asks_what_the_trainer_would(goal: Goal) -> None:
    text = template(goal).replace("time_limit_s = 120", "time_limit_s = 77")
    found = read_exercise(text).on(phantom(), None)
    assert found.exercise.time_limit_s == 77.0
    assert found.exercise.title == GOALS[goal]
    opening = found.exercise.opening
    where = "pull" if opening is None else "dissect" if opening.bed else "anatomy"
    assert found.mode == where
    assert AssignedExercise.of_json(found.json) == found


def test_an_exercise_file_may_let_tissue_relax_with_limits_found_so() -> None:
    plain, relaxing = (
        read_exercise(template("window").replace("seed = 1 ", f"relaxes = {each}\nseed = 1 ")).on(
            phantom(), None
        )
        for each in ("false", "true")
    )
    for found, relaxes in ((plain, False), (relaxing, True)):
        assert found.exercise.opening is not None
        assert found.exercise.opening.relaxes is relaxes
    ratio = "peak_stress_ratio"
    assert relaxing.exercise.limit_of[ratio] < plain.exercise.limit_of[ratio]
    assert AssignedExercise.of_json(relaxing.json) == relaxing
    with pytest.raises(ValueError, match=r"duct\.relaxes does not go with hold_stretch"):
        read_exercise(template("hold_stretch").replace("[duct]", "[duct]\nrelaxes = true"))


def test_an_exercise_file_may_change_which_errors_fail_it() -> None:
    text = template("window").replace("# repeated_holds = 3", "repeated_holds = 3\nstirring = 2")
    plain, changed = (
        read_exercise(each).on(phantom(), None) for each in (template("window"), text)
    )
    assert plain.exercise.errors["stirring"] == 0
    assert changed.exercise.errors == plain.exercise.errors | {"stirring": 2, "repeated_holds": 3}
    assert "stirred with the jaws" in changed.exercise.full_caution


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ('title = "Open a window"', "", "title"),
        ('"window"', '"windows"', "windows"),
        ("Open a window", "x" * 61, "60 characters"),
        ('text = ""', f'text = "{"x" * 1001}"', "1000 characters"),
        ("time_limit_s = 120", "name = 120", "limits.name is none of window; there are: length_mm"),
        ("= 120", "= nan", "time_limit_s"),
        ("= 120", "= -1", "time_limit_s"),
        ("= 120", '= "long"', "limits"),
        ("= 120", "= 120\nto_mm = 90.0", "at most the duct's 50.8 mm"),
        ('"normal"', '"cloud"', "unknown bed 'cloud'"),
        ("# repeated_holds", "haste", "'haste' is no metric and no class of errors; there are"),
        ("# repeated_holds = 3", "leaning = -1", "leaning must be 0 or more incidents"),
        ('"normal"', '"scar"', "not done in duct.bed 'scar'"),
        ("# preset", "preset", ""),
        ('# preset = "thesis-bile-duct"', 'preset = "steel"', "unknown preset 'steel'"),
        ("[duct]", "[duct", "no exercise file"),
        ("# preset", "#" * 20_000, "at most 20,000 characters"),
    ],
)
def test_a_wrong_exercise_file_is_told_why(old: str, new: str, why: str) -> None:
    text = template("window")
    assert old in text
    text = text.replace(old, new, 1)
    if not why:
        assert read_exercise(text).on(phantom(), None).preset == "thesis-bile-duct"
        return
    with pytest.raises(ValueError, match=re.escape(why)):
        read_exercise(text).on(phantom(), None)


def test_the_commands_keep_a_class(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    assert "There is no class yet" in run("class", "list").stdout
    assert "no class 'surgery-3a'" in refused(["class", "open", "Surgery 3A"])
    store = ClassStore.new(class_path("Surgery 3A"), "Surgery 3A")
    ann = store.name_person("browser", "Ann")
    store.save(record(ann.id, passed=True))
    assert "there is a class" in refused(["class", "new", "Surgery 3A"])
    assert "1 people, 1 runs" in run("class", "list").stdout
    folder, copy = tmp_path / "out", tmp_path / "copy.sqlite"
    assert run("class", "export", "Surgery 3A", "-o", folder).returncode == 0
    assert {each.name for each in folder.iterdir()} == {
        "results.csv", "results.json", "report.html", "runs",
    }  # fmt: skip
    (file,) = (folder / "runs").iterdir()
    assert "as recorded                  yes" in run("replay", file).stdout
    assert run("class", "backup", "Surgery 3A", copy).returncode == 0
    assert run("class", "export", copy, "-o", tmp_path / "again").returncode == 0
    tokens = store.teacher_token, store.trainee_token
    store.close()
    assert run("class", "delete", "Surgery 3A", "--yes").returncode == 0
    assert list((tmp_path / "data" / "bluntdissect" / "classes").iterdir()) == []
    assert tokens[0] != tokens[1]
    for wrong in (["--port", "-1"], ["--look", "x"], ["--trust-proxy", "127.0.0.1"]):
        refused(["class", "new", "Other", *wrong])
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert f"port {port}" in refused(["class", "new", "Other", "--port", port])
    assert not class_path("Other").exists()
