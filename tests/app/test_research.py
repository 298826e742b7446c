"""A class as data for research: without names, described, and what a study makes of it."""

import csv
import json
import re
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import msgspec
import numpy as np
import pytest
from class_runs import asked, record
from hypothesis import given, settings
from hypothesis import strategies as st
from other_programs import statement_faults
from program import refused, run
from statement_sender import INCIDENTS

from app.anatomy import drawn_anatomy
from app.classroom.course import default_course
from app.classroom.evidence import (
    Evidence,
    Plan,
    area_under_curve,
    cronbach_alpha,
    evidence_of,
    hedges_g,
    holm,
    intraclass_correlation,
    measurement_error,
    pass_mark,
)
from app.classroom.research import (
    consent_list,
    pseudonym_key,
    read_consents,
    write_research,
)
from app.classroom.store import ClassStore, RunRecord
from app.simulation import CONSEQUENCES, Session, Specimen, exercise_at, read_run, run_json

NOVICES, EXPERTS = [6, 4, 9, 7, 5, 8, 3, 7, 6, 5], [2, 4, 1, 3, 3, 5, 0, 2]
SESSIONS = [[5, 6], [3, 2], [8, 7], [4, 6], [9, 8], [2, 3], [6, 6], [7, 5], [1, 3], [5, 4]]
KEY = b"k" * 32


def tried(person: str, day: float, *, passed: bool | None, level: str | None) -> RunRecord:
    at = datetime(2026, 11, 2, 9, 17, tzinfo=UTC) + timedelta(days=day)
    return replace(
        record(person, passed=passed, reason="Reached." if passed else "Too far."),
        level=level, seed=3, title="Dr Who's own title", incidents="[]" if passed else INCIDENTS,
        started_at=at.isoformat(timespec="seconds"),
    )  # fmt: skip


@pytest.fixture
def store(tmp_path: Path) -> Iterator[ClassStore]:
    made = ClassStore.new(tmp_path / "class.sqlite", "Surgery 3A")
    made.course = default_course()
    made.assign("title = 'Dr Who'", asked().json)
    for name in ("Ann", "Ben", "Cas", "Dee", "Eve", "Fay", "Gus", "Ann"):
        person = made.name_person(f"browser {name} {len(made.people())}", name)
        for day in (0, 0.5, 8):
            made.save(tried(person.id, day, passed=day > 0, level="approach"))
        made.save(tried(person.id, 9, passed=False, level=None))
        made.save(replace(tried(person.id, 9.5, passed=True, level=None), assignment_id=1))
        made.save(tried(person.id, 10, passed=None, level=None))  # practice
    yield made
    made.close()


def consents(store: ClassStore, path: Path, groups: dict[str, str]) -> Path:
    path.write_text(
        "name,consent,group\n"
        + "".join(f"{name},{'yes' if group else 'no'},{group}\n" for name, group in groups.items())
    )
    return path


GROUPS = {
    "Ann": "novice", "Ben": "novice", "Cas": "novice", "Dee": "novice", "Eve": "novice",
    "Ann (2)": "expert", "Gus": "",
}  # fmt: skip
"""Fay is not asked, and Gus refuses; there is one expert."""


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_a_drawn_anatomy_s_seed_is_in_the_export(store: ClassStore, tmp_path: Path) -> None:
    """Of a run that no course has set; the run itself has all of what was drawn."""
    anatomy = drawn_anatomy(5)
    session = Session(Specimen.of_anatomy(anatomy), vertices=300)
    exercise = exercise_at(anatomy, "who_is_who")
    assert exercise is not None
    session.start_exercise(exercise)
    session.call_unsafe()
    session.advance()
    person = store.name_person("browser Hal", "Hal")
    kept = replace(record(person.id, passed=False), file=run_json(session.run_file()))
    store.save(kept)
    write_research(store, {person.id: "expert"}, tmp_path / "study", KEY)
    (attempt,) = rows(tmp_path / "study" / "attempts.csv")
    assert attempt["seed"] == "5"
    (written,) = (tmp_path / "study" / "runs").iterdir()
    assert read_run(written.read_bytes()).log.start.anatomy == anatomy


def test_an_export_has_who_consented_and_nothing_that_says_who(
    store: ClassStore, tmp_path: Path
) -> None:
    groups = read_consents(consents(store, tmp_path / "people.csv", GROUPS), store)
    done = write_research(store, groups, tmp_path / "study", KEY, parquet=True)
    assert done == (6, 30, 2, ("expert",), ())
    folder = tmp_path / "study"
    people = rows(folder / "people.csv")
    assert [each["group"] for each in people].count("novice") == 5
    assert [each["group"] for each in people].count("") == 1
    assert all(each["attempts"] == "5" and each["practice_runs"] == "1" for each in people)
    attempts = rows(folder / "attempts.csv")
    first = [each for each in attempts if each["person"] == people[0]["person"]]
    assert [(each["task"], each["number"], each["day"], each["outcome"]) for each in first] == [
        ("approach", "1", "0", "failed"), ("approach", "2", "0", "passed"),
        ("approach", "3", "8", "passed"), ("", "1", "9", "failed"),
        ("exercise-1", "1", "9", "passed"),
    ]  # fmt: skip
    assert len(rows(folder / "incidents.csv")) == sum(int(each["incidents"]) for each in attempts)
    # No name, identity, clock time or text of anybody is in any file.
    secret = ["Ann", "Gus", "Surgery", "Dr Who", "2026-11-", "browser", "bile_duct_phantom"]
    secret += [each.id for each in store.people()] + [each.id for each in store.runs()]
    files = [each for each in folder.rglob("*") if each.is_file()]
    assert len(files) == 30 + 9
    benchmarks = re.compile(rb'date = "[0-9-]+"')  # of the course
    for each in files:
        content = benchmarks.sub(b"", each.read_bytes())
        assert not [word for word in secret if word.encode() in content], each
    # Runs are read as ever, and each attempt has one.
    for each in attempts:
        assert read_run((folder / "runs" / f"{each['attempt']}.json").read_bytes()).metrics
    # The same key gives the same pseudonyms, another others.
    for key, same in ((KEY, True), (b"x" * 32, False)):
        write_research(store, groups, tmp_path / "again", key)
        again = {each["person"] for each in rows(tmp_path / "again" / "people.csv")}
        assert (again == {each["person"] for each in people}) is same
        assert same or not again & {each["person"] for each in people}


def test_who_has_withdrawn_is_named_in_files_of_an_earlier_export(
    store: ClassStore, tmp_path: Path
) -> None:
    study, key, asks = tmp_path / "study", tmp_path / "key", tmp_path / "people.csv"
    command = ["class", "research-export", store.path, "--people", asks, "-o", study, "--key", key]
    consents(store, asks, GROUPS)
    assert "earlier export:" not in run(*command, "--parquet").stdout
    before = {each["attempt"]: each["person"] for each in rows(study / "attempts.csv")}
    consents(store, asks, GROUPS | {"Ben": ""})
    out = " ".join(run(*command).stdout.split())
    assert "Left out: 3 without consent." in out
    assert "files that were handed out cannot be recalled" in out
    after = {each["attempt"] for each in rows(study / "attempts.csv")}
    gone = sorted(f"runs/{each}.json" for each in before.keys() - after)
    assert len(gone) == 5
    tables = ", ".join(f"{each}.parquet" for each in ("attempts", "incidents", "people"))
    assert f"files of an earlier export: {tables}, {', '.join(gone)}." in out


def test_each_column_is_in_the_dictionary_and_parquet_has_the_same(
    store: ClassStore, tmp_path: Path
) -> None:
    import pyarrow.parquet as pq

    groups = read_consents(consents(store, tmp_path / "people.csv", GROUPS), store)
    write_research(store, groups, tmp_path, KEY, parquet=True)
    tables = json.loads((tmp_path / "dictionary.json").read_bytes())["tables"]
    assert set(tables) == {"people", "attempts", "incidents"}
    for name, columns in tables.items():
        found = rows(tmp_path / f"{name}.csv")
        assert list(found[0]) == [each["name"] for each in columns]
        assert all(each["meaning"].endswith(".") for each in columns)
        table = pq.read_table(tmp_path / f"{name}.parquet")
        assert table.schema.names == list(found[0])
        for each in columns:
            texts = [row[each["name"]] for row in found]
            values = table.column(each["name"]).to_pylist()
            if each["type"] == "text":
                assert values == texts
            else:
                assert values == [float(text) if text else None for text in texts]
            if "values" in each:
                assert set(filter(None, texts)) <= set(each["values"])
            assert table.schema.field(each["name"]).metadata[b"unit"].decode() == each["unit"]
    # What counts as a consequence is told in full.
    told = next(each for each in tables["incidents"] if each["name"] == "consequence")["values"]
    assert set(told) == set(CONSEQUENCES)
    assert "wall tore in part" in told["minor"]
    assert "leaked" in told["injury"]
    # Every measure of a run is there.
    measures = msgspec.json.decode(record("x").measures)
    for key in measures:
        assert any(each["name"].startswith(key) for each in tables["attempts"]), key


def test_its_statements_are_valid_and_of_its_people(store: ClassStore, tmp_path: Path) -> None:
    groups = read_consents(consents(store, tmp_path / "people.csv", GROUPS), store)
    write_research(store, groups, tmp_path, KEY)
    found = [json.loads(line) for line in (tmp_path / "statements.jsonl").read_text().splitlines()]
    verbs = [each["verb"]["id"].rpartition("/")[2] for each in found]
    assert {verb: verbs.count(verb) for verb in verbs} == {
        "passed": 18, "failed": 12, "erred": 12, "mastered": 6,
    }  # fmt: skip
    people = {each["person"] for each in rows(tmp_path / "people.csv")}
    assert {each["actor"]["account"]["name"] for each in found} == people
    assert len({each["id"] for each in found}) == len(found)
    assert {each["timestamp"][:7] for each in found} == {"2000-01"}
    assert statement_faults(found, tmp_path / "all.json") == [0] * len(found)


def test_a_list_of_people_is_read_or_refused_by_its_line(store: ClassStore, tmp_path: Path) -> None:
    path = tmp_path / "people.csv"
    formula = store.name_person("formula", "=1+1")
    path.write_bytes(consent_list(store))
    assert "\r\n'=1+1,,\r\n" in path.read_text("utf-8-sig").replace("\n", "\r\n")
    for name in ("'=1+1", "=1+1"):  # as it was listed, or as a spreadsheet shows it
        path.write_text(f"name,consent,group\n{name},yes,novice")
        assert read_consents(path, store) == {formula.id: "novice"}
    path.write_text("name,consent,group\n'=1+1,yes,\n=1+1,no,")
    with pytest.raises(ValueError, match="line 3: '=1\\+1' is there twice"):
        read_consents(path, store)
    path.write_bytes(consent_list(store))
    with pytest.raises(ValueError, match="nobody has consented"):
        read_consents(path, store)
    for text, words in {
        "name,group\nAnn,novice": "first line must be name,consent,group",
        "name,consent,group\nZoe,yes,novice": r"line 2: there is nobody called 'Zoe'",
        "name,consent,group\nAnn,yes,\nAnn,yes,": r"line 3: 'Ann' is there twice",
        "name,consent,group\nAnn,maybe,": r"line 2: consent must be yes or no, got 'maybe'",
    }.items():
        path.write_text(text)
        with pytest.raises(ValueError, match=words):
            read_consents(path, store)
    key = tmp_path / "key"
    assert pseudonym_key(key) == pseudonym_key(key)
    assert key.stat().st_mode & 0o777 == 0o600
    assert pseudonym_key(None) != pseudonym_key(None)
    key.write_text("short")
    with pytest.raises(ValueError, match="64 hexadecimal digits"):
        pseudonym_key(key)


def test_from_a_class_to_its_evidence_by_commands(store: ClassStore, tmp_path: Path) -> None:
    held = str(store.path)
    asks = tmp_path / "people.csv"
    assert "consent" in run("class", "research-export", held, "--ask", asks).stdout
    lines = asks.read_text("utf-8-sig").splitlines()
    assert lines[0] == "name,consent,group"
    lines[1:] = [
        f"{line.split(',')[0]},yes,{'expert' if place % 2 else 'novice'}"
        for place, line in enumerate(lines[1:])
    ]
    asks.write_text("\n".join(lines))
    study = str(tmp_path / "study")
    out = run("class", "research-export", held, "--people", asks, "-o", study).stdout
    assert "40 attempts of 8 people" in out
    assert "fewer than five people" in out
    assert "there is no group 'novice'" in refused(["class", "evidence", study])
    assert "give --ask" in refused(["class", "research-export", held])
    assert "class research-export" in refused(["class", "evidence", tmp_path / "nowhere"])


def test_statistics_are_those_of_pingouin_and_scikit_learn() -> None:
    """Values by pingouin 0.7.0 and scikit-learn 1.9.1 of the same data."""
    assert area_under_curve(NOVICES, EXPERTS).value == 0.93125
    assert hedges_g(NOVICES, EXPERTS) == pytest.approx(1.9245008972987525, rel=1e-14)
    found = intraclass_correlation(SESSIONS)
    assert found.value == pytest.approx(0.824295010845987, rel=1e-14)
    assert (round(found.low, 2), round(found.high, 2)) == (0.43, 0.95)
    assert cronbach_alpha(SESSIONS) == pytest.approx(0.8941176470588237, rel=1e-14)
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])


@pytest.mark.long
@pytest.mark.filterwarnings("ignore")  # theirs, of one another
def test_statistics_are_those_of_pingouin_and_scikit_learn_in_the_same_run() -> None:
    """Where they are installed, of data that nobody has chosen."""
    pingouin = pytest.importorskip("pingouin")
    metrics = pytest.importorskip("sklearn.metrics")
    pandas = pytest.importorskip("pandas")
    rng = np.random.default_rng(7)
    for _ in range(20):
        novices = rng.poisson(6.0, int(rng.integers(5, 30))).tolist()
        experts = rng.poisson(2.5, int(rng.integers(5, 30))).tolist()
        said = [1] * len(novices) + [0] * len(experts)
        area = float(metrics.roc_auc_score(said, [*novices, *experts]))
        assert area_under_curve(novices, experts).value == pytest.approx(area, rel=1e-12)
        theirs = pingouin.compute_effsize(novices, experts, eftype="hedges")
        assert hedges_g(novices, experts) == pytest.approx(theirs, rel=1e-12)
        people = int(rng.integers(8, 40))
        scores = rng.normal(0.0, 2.0, (people, 1)) + rng.normal(0.0, 1.0, (people, 2))
        table = pandas.DataFrame(
            [
                (who, when, score)
                for who, row in enumerate(scores)
                for when, score in enumerate(row)
            ],
            columns=["who", "when", "score"],
        )
        icc = pingouin.intraclass_corr(table, targets="who", raters="when", ratings="score")
        single = icc[icc["Type"].isin(["ICC2", "ICC(A,1)"])].iloc[0]
        found = intraclass_correlation(scores)
        assert found.value == pytest.approx(float(single["ICC"]), rel=1e-9)
        interval = next(single[name] for name in single.index if str(name).startswith("CI95"))
        assert [found.low, found.high] == pytest.approx(list(interval), abs=0.0051)  # 2 digits
        alpha, _ = pingouin.cronbach_alpha(pandas.DataFrame(scores))
        assert cronbach_alpha(scores) == pytest.approx(float(alpha), rel=1e-9)
        p = rng.random(5).tolist()
        assert holm(p) == pytest.approx(list(pingouin.multicomp(p, method="holm")[1]), rel=1e-12)


@settings(deadline=None, max_examples=40)
@given(
    st.lists(st.integers(0, 20), min_size=2, max_size=12),
    st.lists(st.integers(0, 20), min_size=2, max_size=12),
)
def test_groups_are_told_apart_alike_from_either_side(one: list[int], other: list[int]) -> None:
    there, back = area_under_curve(one, other), area_under_curve(other, one)
    assert there.value == pytest.approx(1.0 - back.value)
    assert there.low == pytest.approx(1.0 - back.high)
    assert 0.0 <= there.low <= there.value <= there.high <= 1.0
    pairs = sum((a > b) + (a == b) / 2 for a in one for b in other)
    assert there.value == pytest.approx(pairs / (len(one) * len(other)))
    assert hedges_g(one, other) == pytest.approx(-hedges_g(other, one), nan_ok=True)


def test_intervals_hold_the_truth_as_often_as_they_say() -> None:
    rng = np.random.default_rng(5)
    scores = np.zeros((30, 2))
    of_area = of_icc = 0
    truth = 0.8556  # P(N(1.5, 1) > N(0, 1)) = Phi(1.5 / sqrt 2)
    for _ in range(400):
        found = area_under_curve(rng.normal(1.5, 1.0, 20), rng.normal(0.0, 1.0, 10))
        of_area += found.low <= truth <= found.high
        own = rng.normal(0.0, np.sqrt(0.7), (30, 1))
        scores = own + rng.normal(0.0, np.sqrt(0.3), (30, 2))
        found = intraclass_correlation(scores)
        of_icc += found.low <= 0.7 <= found.high
    assert 0.92 <= of_area / 400 <= 0.98
    assert 0.92 <= of_icc / 400 <= 0.98
    assert measurement_error(scores)[1] == pytest.approx(
        2.7718 * measurement_error(scores)[0], rel=1e-4
    )
    mark, false_pass, false_fail = pass_mark(rng.normal(6, 1, 4000), rng.normal(2, 1, 4000))
    assert (mark, false_pass, false_fail) == pytest.approx((4.0, 0.0228, 0.0228), abs=0.06)


TAU, SPREAD = 2.5, 0.8


def simulated(folder: Path, seed: int, people: int) -> Evidence:
    """What an export of people shows who learn by a known curve, and differ by a known spread."""
    rng = np.random.default_rng(seed)
    groups = {"novice": (9.0, 4.0), "expert": (1.5, 1.5)}  # errors at first and in the end
    with (folder / "people.csv").open("w") as who, (folder / "attempts.csv").open("w") as what:
        print("person,group", file=who)
        print("person,task,day,outcome,consequential,incidents,time_s,peak_stress_ratio", file=what)
        for group, (first, last) in groups.items():
            for number in range(people):
                print(f"{group}{number},{group}", file=who)
                own = rng.normal(0.0, SPREAD)
                for attempt in range(12):
                    errors = last + (first - last) * np.exp(-attempt / TAU) + own
                    errors += rng.normal(0.0, 0.5)
                    day = 0 if attempt < 9 else 9
                    print(
                        f"{group}{number},window,{day},passed,{errors},{errors},"
                        f"{20 + 2 * errors + rng.normal()},0.5", file=what,
                    )  # fmt: skip
    return evidence_of(folder, Plan("novice", "expert"))


def test_what_is_true_of_simulated_people_is_found(tmp_path: Path) -> None:
    found = simulated(tmp_path, 3, 60)
    (known,) = [each for each in found.known_groups if each.measure == "consequential"]
    # Mean of the first three attempts of both groups.
    curve = np.exp(-np.arange(3) / TAU).mean()
    noise = np.sqrt(SPREAD**2 + 0.25 / 3)
    assert known.novice_mean == pytest.approx(4.0 + 5.0 * curve, abs=4 * noise / np.sqrt(60))
    assert known.expert_mean == pytest.approx(1.5, abs=4 * noise / np.sqrt(60))
    truth = (2.5 + 5.0 * curve) / noise
    assert known.hedges_g == pytest.approx(truth, rel=0.2)
    assert known.area_under_curve.value == 1.0
    assert known.holm_p < 1e-10
    (learnt, *_) = found.learning
    assert learnt.people == 120
    assert learnt.learnt >= 60
    assert learnt.plateau == pytest.approx(1.0 + TAU * np.log(10.0), rel=0.15)
    # A measure that is the same in everybody shows nothing.
    (same,) = [each for each in found.known_groups if each.measure == "peak_stress_ratio"]
    assert same.area_under_curve.value == 0.5
    assert np.isnan(same.hedges_g)
    assert same.holm_p == 1.0
    with pytest.raises(ValueError, match="there is no group 'surgeon'"):
        evidence_of(tmp_path, Plan("novice", "surgeon"))
    text = msgspec.json.encode(found).decode()
    assert re.search(r"\bNaN\b", text) is None
