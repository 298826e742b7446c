"""A course: its file, where people stand in it, who needs help, and its benchmarks."""

import math
import re
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import msgspec
import numpy as np
import pytest
from class_runs import record
from hypothesis import given, settings
from hypothesis import strategies as st
from program import refused, run
from simulated import bed_session, phantom

from app.anatomy import drawn_anatomy
from app.classroom.benchmarks import PACES, expert_benchmarks, near_others, scripted_try
from app.classroom.class_course import ClassCourse
from app.classroom.course import (
    Course,
    default_course,
    read_course,
    with_benchmarks,
)
from app.classroom.progress import (
    LevelStanding,
    Try,
    learning_curve,
    needs,
    next_level,
    sequential_test,
    standings,
    unmet,
)
from app.classroom.store import ClassStore, RunRecord
from app.simulation import ERROR_CLASSES, Incident, Session, run_json

START = datetime(2026, 3, 1, 9, 0, tzinfo=UTC)
SMALL = """
id = "small"
title = "Small"
version = 1
[[level]]
id = "window"
title = "Open"
step = "Open a window."
goal = "window"
seeds = [1, 2, 3, 4, 5]
safety = ["jumping_jaws"]
benchmarks = { incidents = 1.0, time_s = 1.5 }
[[level]]
id = "front"
title = "The front"
step = "Follow it."
goal = "follow_front"
needs = ["window"]
[[benchmark]]
level = "window"
metric = "incidents"
value = 1.0
mean = 0.5
sd = 0.2
n = 9
source = "experts"
date = "2027-03-01"
[[benchmark]]
level = "window"
metric = "time_s"
value = 20.0
mean = 18.0
sd = 2.0
n = 9
source = "experts"
date = "2027-03-01"
"""


def incident(error: str, start: float, end: float, consequence: str = "none") -> Incident:
    plain = {
        "error": error, "start_s": start, "end_s": end, "hand": 0, "tube": 0, "station_mm": None,
        "consequence": consequence, "values": {},
    }  # fmt: skip
    return msgspec.convert(plain, Incident)


def tried(
    passed: bool = True,
    seed: int | None = 1,
    day: float = 0.0,
    level: str = "window",
    incidents: tuple[Incident, ...] = (),
    seconds: float = 20.0,
) -> Try:
    return Try(
        f"{level}-{seed}-{day}", level, seed, START + timedelta(days=day), passed, "Too far.",
        seconds, incidents, {"time_s": seconds, "tear": None},
    )  # fmt: skip


def with_level(made: RunRecord, level: str, seed: int | None) -> RunRecord:
    return replace(made, level=level, seed=seed, incidents="[]")


def small() -> Course:
    return read_course(SMALL)


def first(tries: list[Try], day: float = 0.0) -> LevelStanding:
    return standings(small(), tries, START + timedelta(days=day))[0]


def test_the_default_course_is_whole_and_says_whose_its_benchmarks_are() -> None:
    course = read_course(default_course())
    assert [each.goal for each in course.level] == [
        "approach_break", "hold_stretch", "gentle_lifts", "window", "follow_front", "free_scar",
        "stop_bleeding", "critical_view",
    ]  # fmt: skip
    assert {each.source for each in course.benchmark} == {"scripted"}
    assert all("no surgeon has set it" in each.origin for each in course.benchmark)
    assert course.retention.days == (14, 90)
    for each in course.level:
        asked = each.try_on(phantom(), None, row=1, seed=each.seeds[1])
        assert asked.text == each.step
        opening = asked.exercise.opening
        if opening is not None and opening.anatomy is not None:
            assert opening.anatomy == drawn_anatomy(each.seeds[1])
            assert asked.mode == "anatomy"
        elif opening is not None:
            assert opening.bed_seed == each.seeds[1]
            assert not each.beds or opening.bed == each.beds[1]


@pytest.mark.parametrize(
    ("old", "new", "why", "line"),
    [
        ("passes = 3", "pases = 3", "unknown field `pases`", 9),
        ("passes = 3", "passes = 99", "passes must be from 1 to 20, got 99", 9),
        ('goal = "window"', 'goal = "windows"', "Invalid enum value 'windows'", 10),
        ('needs = ["window"]', 'needs = ["scar"]', "needs 'scar', which is no level before it", 19),
        ("time_s = 1.5 }", "time = 1.5 }", "benchmarks has 'time'; there are: time_s", 13),
        ("time_s = 1.5 }", "freed_mm = 1.5 }", "no [[benchmark]] of freed_mm", 13),
        ('["jumping_jaws"]', '["jumping"]', "safety has 'jumping', which is no class", 12),
        ("seeds = [1, 2, 3, 4, 5]", "seeds = [1, 1]", "1 to 200 different numbers", 11),
        ("seeds = [1, 2, 3, 4, 5]", "seeds = [1, 2]", "as many as passes, 3, got 2", 11),
        ("sd = 0.2", "sd = -0.2", "sd and left_out must be 0 or more", 25),
        ("sd = 0.2", 'sd = "x"', "Expected `float`, got `str`", 25),
        ('id = "front"', 'id = "window"', "two levels 'window'", 15),
        ("version = 1", "version = ", "", 4),
        ("version = 1", "version = 1\n[retention]\ndays = [90, 14]", "days must rise", 6),
    ],
)  # fmt: skip
def test_a_wrong_course_is_refused_by_its_line(old: str, new: str, why: str, line: int) -> None:
    content = SMALL.replace('step = "Open a window."', 'step = "Open a window."\npasses = 3')
    with pytest.raises(ValueError, match="this is no course") as fault:
        read_course(content.replace(old, new, 1))
    message = str(fault.value)
    assert why in message
    assert "\n" not in message
    number = re.search(r"line (\d+)", message)
    assert number is not None, message
    assert int(number[1]) == line, message


def test_two_benchmarks_of_one_metric_are_refused() -> None:
    twice = SMALL + SMALL[SMALL.rindex("[[benchmark]]") :]
    with pytest.raises(ValueError, match=r"two benchmarks of time_s in level window \(line 39\)"):
        read_course(twice)


def test_a_benchmark_of_what_a_run_has_not_is_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """And of hands that one counts which has more."""
    done = tried()
    monkeypatch.setattr(Course, "marks", lambda *_: {"maximum_force_N": 3.0})
    assert "measures no maximum force" in unmet(small(), small().level[0], done)
    for forces, kept in (((1.0, 3.0), True), ((3.1, 0.0), False)):
        each = msgspec.structs.replace(done, metrics={"maximum_force_N": forces})
        assert (unmet(small(), small().level[0], each) == "") == kept


def test_three_passes_in_a_row_on_beds_not_seen_before_master_a_level() -> None:
    one, two, three = (tried(seed=seed, day=seed) for seed in (1, 2, 3))
    assert (first([]).state, first([]).row, first([]).seed) == ("open", 0, 1)
    assert (first([one]).row, first([one]).seed) == (1, 2)
    again = tried(seed=1, day=1.5)
    assert first([one, again]).row == 1  # a path learnt by heart
    assert "seen before" in first([one, again]).last
    failed = tried(False, 2, 2)
    assert first([one, failed]).row == 0
    assert first([one, failed]).last == "Too far."
    found = standings(small(), [one, two, three], START + timedelta(days=4))
    assert [each.state for each in found] == ["mastered", "open"]
    assert found[0].mastered_at == three.at
    assert next_level(found) is found[1]
    assert standings(small(), [one, two], START)[1].state == "locked"


def test_trying_again_is_practice_which_leaves_the_row_as_it_is() -> None:
    some = [tried(False, 1, 1), tried(True, 2, 2)]
    every = [tried(False, 4, -1), tried(False, 5, 0), *some, tried(True, 3, 3)]
    for tries, row in ((some, 1), (every, 2)):
        assert first(tries).row == row
        for passed in (False, True):
            found = first([*tries, tried(passed, tries[-1].seed, 9)])
            assert found.row == row
            assert found.last.endswith("Practice: on a bed that was seen before.")
    assert first([*some, tried(False, 1, 9)]).row == 1
    assert first([*every, tried(False, 1, 9)]).row == 0  # all were used: they begin again


def test_all_beds_are_used_before_one_comes_again() -> None:
    tries: list[Try] = []
    for number in range(10):
        seed = first(tries).seed
        tries.append(tried(False, seed, number))
    assert [each.seed for each in tries] == [1, 2, 3, 4, 5] * 2
    tries += [tried(True, seed, 10 + seed) for seed in (1, 2, 3)]
    assert first(tries).state == "mastered"


def test_what_was_mastered_is_tried_again_after_14_and_90_days() -> None:
    tries = [tried(seed=seed) for seed in (1, 2, 3)]
    assert first(tries, 13.9).state == "mastered"
    assert (first(tries, 14).state, first(tries, 14).row) == ("due", 2)
    early = [*tries, tried(seed=4, day=5)]
    assert first(early, 14).state == "due"  # practice before does not count
    failed = [*tries, tried(False, 4, 15)]
    assert first(failed, 15).state == "due"
    kept = [*failed, tried(True, 5, 16)]  # one pass brings it back, not three
    assert first(kept, 17).state == "mastered"
    assert first(kept, 89.9).state == "mastered"
    assert first(kept, 90).state == "due"
    seen = [*kept, tried(False, 1, 92), tried(True, 1, 93)]
    assert first(seen, 400).state == "due"
    assert first([*seen, tried(True, 2, 94)], 400).state == "mastered"
    late = [*tries, tried(seed=4, day=100)]  # one try after both
    assert first(late, 400).state == "mastered"
    # What needs a level stays open while it is due.
    assert standings(small(), tries, START + timedelta(days=20))[1].state == "open"


def test_a_pass_counts_within_the_benchmarks_and_with_95_percent_without_safety_errors() -> None:
    course = small()
    level = course.level[0]
    jaws = incident("jumping_jaws", 2.0, 2.5)  # goes on for 0.4 s more: 0.9 of 20 s
    assert unmet(course, level, tried(incidents=(jaws,))) == ""
    longer = incident("jumping_jaws", 2.0, 2.7)
    assert "only 94 % of the time" in unmet(course, level, tried(incidents=(longer,)))
    # Overlapping incidents are not counted twice.
    twice = tried(incidents=(longer, longer), seconds=40.0)
    assert math.isclose(twice.safe_fraction(level.safety), 1.0 - 1.1 / 40.0)
    leant = incident("leaning", 2.0, 9.0)
    assert unmet(course, level, tried(incidents=(leant,))) == ""
    assert "incidents of errors: 2, at most 1 by" in unmet(
        course, level, tried(incidents=(leant, leant))
    )
    assert unmet(course, level, tried(seconds=30.0)) == ""
    assert "time: 30.5 s, at most 30 s by" in unmet(course, level, tried(seconds=30.5))
    hurt = incident("leaning", 2.0, 3.0, "injury")
    assert "injury" in unmet(course, level, tried(incidents=(hurt,)))


def kept(session: Session) -> Try:
    """A session's run as a try at the first level."""
    file = session.run_file()
    made = RunRecord(
        "1", "2", None, "dissect", "Open a window", START.isoformat(), True, True, "",
        msgspec.json.encode(file.metrics).decode(), run_json(file),
        "window", 1, msgspec.json.encode(session.run.incidents()).decode(),
    )  # fmt: skip
    return Try.of(made)


def test_a_wait_before_the_first_touch_does_not_make_a_run_safer() -> None:
    tries: list[Try] = []
    for wait in (0, 300):
        session = bed_session(phantom(), bed_seed=3, vertices=300)
        session.choose_instrument(0, "dissector")
        session.advance(wait)
        outside = session.spatial.hands[0].place.copy()
        for aside, opening in ((0.0, 0.0), (24.0, 0.0), (24.0, 9.0), (24.0, 9.0), (24.0, 9.0)):
            session.move_hand(0, outside + np.array([4.0, aside, 0.0]))
            session.open_jaws(0, opening)
            session.advance(40)
        tries.append(kept(session))
    quick, slow = tries
    assert slow.seconds - quick.seconds == pytest.approx(10.0)
    assert {each.error for each in quick.incidents} >= {"jumping_jaws"}
    for errors in (["jumping_jaws"], ["jumping_jaws", "blind_stab"], list(ERROR_CLASSES)):
        assert slow.safe_fraction(errors) == pytest.approx(quick.safe_fraction(errors), rel=1e-12)
    level = small().level[0]
    assert quick.safe_fraction(level.safety) < 0.95
    for each in tries:
        assert "of the time in tissue was without errors" in unmet(small(), level, each)
    # A run of before this metric counts by its whole time, as it did.
    plain = {key: value for key, value in slow.metrics.items() if key != "time_in_tissue_s"}
    older = msgspec.structs.replace(slow, metrics=plain)
    lost = (1.0 - slow.safe_fraction(level.safety)) * slow.seconds_in_tissue
    assert older.safe_fraction(level.safety) == pytest.approx(1.0 - lost / slow.seconds)
    assert older.safe_fraction(level.safety) > 0.95
    assert unmet(small(), level, older) != unmet(small(), level, slow)


def test_errors_that_go_on_longer_than_a_hand_is_in_tissue_leave_no_safe_share() -> None:
    bleeds = tried(incidents=(incident("bleeding", 2.0, 12.0),))
    for seconds, fraction in ((20.0, 1.0 - 10.4 / 20.0), (5.0, 0.0), (0.0, 0.0)):
        metrics = bleeds.metrics | {"time_in_tissue_s": seconds}
        each = msgspec.structs.replace(bleeds, metrics=metrics)
        assert each.safe_fraction(["bleeding"]) == pytest.approx(fraction)
        assert each.safe_fraction(["jumping_jaws"]) == 1.0


@given(
    st.lists(st.tuples(st.booleans(), st.integers(1, 5), st.booleans()), max_size=40),
    st.integers(0, 40),
)
@settings(deadline=None, max_examples=60)
def test_standing_follows_from_the_tries_alone(
    drawn: list[tuple[bool, int, bool]], cut: int
) -> None:
    tries = [
        tried(passed, seed, 3.0 * number, "front" if other else "window")
        for number, (passed, seed, other) in enumerate(drawn)
    ]
    today = START + timedelta(days=130)
    found = standings(small(), tries, today)
    assert found == standings(small(), list(tries), today)
    # Tries at another level change nothing in the first.
    own = [each for each in tries if each.level == "window"]
    assert standings(small(), own, today)[0] == found[0]
    # A level that was mastered once stays so, whatever follows.
    early = standings(small(), tries[:cut], today)[0]
    if early.mastered_at is not None:
        assert found[0].mastered_at == early.mastered_at
    # By hand: mastered with the first three in a row, each on a bed seen least and not just now;
    # others are left out.
    row, seen, at, before = 0, dict.fromkeys(range(1, 6), 0), None, None
    for each in own:
        assert each.seed is not None
        fresh = seen[each.seed] == min(seen.values()) and each.seed != before
        seen[each.seed] += 1
        before = each.seed
        if fresh:
            row = row + 1 if each.passed else 0
        at = each.at if row == 3 and at is None else at
    assert found[0].mastered_at == at


def test_who_needs_help_is_told_with_the_reasons() -> None:
    cut = incident("ahead_of_front", 19.0, 19.5)
    stuck = [tried(False, seed, seed, incidents=(cut,)) for seed in (1, 2, 3, 4)]
    other = [tried(True, seed, seed) for seed in (1, 2)]
    gone = [tried(True, 1, -20)]
    ahead = [tried(False, seed, seed, "front", (cut,)) for seed in (1, 2, 3)]  # by the teacher
    found = needs(
        small(),
        {"gone": gone, "fine": other, "stuck": stuck, "new": [], "ahead": ahead},
        START + timedelta(days=5),
    )
    assert next(iter(found)) == "stuck"
    assert found["stuck"][0] == "4 tries in a row failed for one cause: held ahead of the front."
    assert "4 of 4 tries at 'Open' did not pass" in found["stuck"][1]
    assert found["ahead"][0] == "3 tries in a row failed for one cause: held ahead of the front."
    assert found["gone"] == ["No try for 25 days."]
    assert found["fine"] == found["new"] == []
    many = [tried(number % 2 == 0, 1 + number % 5, 4) for number in range(7)]
    found = needs(small(), {"a": other, "b": other, "c": many}, START + timedelta(days=5))
    assert "7 tries at 'Open'; half of the class needs 2." in found["c"]


def test_the_sequential_test_decides_as_wald_has_it() -> None:
    assert sequential_test([True] * 17) == "open"
    assert sequential_test([True] * 18) == "good"
    assert sequential_test([False] * 2) == "open"
    assert sequential_test([False, False, True, False]) == "bad"
    # Its errors are at most about 5 % each.
    rng = np.random.default_rng(1)
    for fraction, wrong in ((0.05, "bad"), (0.2, "good")):
        decided = [sequential_test(rng.random(400) >= fraction) for _ in range(400)]
        assert decided.count(wrong) <= 0.05 * 400 + 3 * math.sqrt(400 * 0.05 * 0.95)


def test_a_learning_curve_is_found_again_and_none_in_noise() -> None:
    t = np.arange(15)
    found = learning_curve(list(3.0 + 6.0 * np.exp(-t / 3.0)))
    assert found is not None
    # The grid's steps are 9 % apart.
    assert math.isclose(found.tries, 3.0, rel_tol=0.09)
    assert math.isclose(found.level, 3.0, abs_tol=0.1)
    assert math.isclose(found.first, 9.0, abs_tol=0.1)
    assert math.isclose(found.plateau, 1.0 + found.tries * math.log(10.0))
    rest = found.at(found.plateau) - found.level
    assert math.isclose(rest, 0.1 * (found.first - found.level))
    rng = np.random.default_rng(1)
    flat = [learning_curve(list(rng.normal(5.0, 1.0, 12))) for _ in range(100)]
    assert sum(each is not None for each in flat) <= 10
    assert learning_curve([9, 6, 4, 3, 3]) is None


def test_experts_set_a_benchmark_and_who_is_far_off_is_left_out() -> None:
    times = [20.0, 21.0, 19.0, 20.5, 19.5, 20.0, 60.0]
    tries = {
        str(who): [tried(seed=seed, seconds=time) for seed in (1, 2)] + [tried(False, seconds=99.0)]
        for who, time in enumerate(times)
    }
    found = {each.metric: each for each in expert_benchmarks(small(), tries)}
    time = found["time_s"]
    assert (time.source, time.n, time.left_out) == ("experts", 6, 1)
    assert time.value == time.mean == 20.0
    assert time.sd == pytest.approx(np.std(times[:6], ddof=1), abs=1e-4)
    assert found["incidents"].value == 0.0
    few = {**dict(list(tries.items())[:3]), "far": tries["6"]}
    found_of_few = {each.metric: each for each in expert_benchmarks(small(), few)}
    assert (found_of_few["time_s"].n, found_of_few["time_s"].left_out) == (3, 1)
    with pytest.raises(ValueError, match="needs passes of 3 people"):
        expert_benchmarks(small(), dict(list(tries.items())[:2]))
    again = read_course(with_benchmarks("# mine\n" + SMALL, found.values()))
    assert again.benchmark_of("window", "time_s") == time
    assert again.level == small().level
    assert with_benchmarks("# mine\n" + SMALL, found.values()).startswith("# mine")


def test_an_expert_is_left_out_among_few_and_seldom_by_chance() -> None:
    rng = np.random.default_rng(1)
    for n in (4, 5, 7, 10, 20):
        drawn = rng.normal(10.0, 1.0, (4000, n))
        by_chance = 1.0 - np.mean([near_others(each) for each in drawn])
        assert by_chance < 0.06, n
        drawn[:, 0] = 16.0
        found = np.mean([not near_others(each)[0] for each in drawn])
        assert found > 0.65, n
    assert near_others(np.array([1.0, 1.1, 90.0])).all()  # of three nobody
    assert near_others(np.array([0.0, 0.0, 0.0, 1.0])).all()  # no spread among the others


def test_a_margin_is_of_scripted_hands_and_goes_with_their_benchmark() -> None:
    course = read_course(default_course())
    level, scripted = course.level_of("bleeding"), course.benchmark_of("bleeding", "blood_lost_ml")
    assert scripted is not None
    assert course.marks(level) == {"blood_lost_ml": 3.0 * scripted.value}
    assert scripted.origin.startswith("3 times that of 19 runs of scripted hands")
    tries = {
        str(who): [msgspec.structs.replace(
            tried(level="bleeding"), metrics={"time_s": 20.0, "blood_lost_ml": lost})]
        for who, lost in enumerate((20.0, 30.0, 40.0))
    }  # fmt: skip
    again = read_course(with_benchmarks(default_course(), expert_benchmarks(course, tries)))
    assert again.marks(again.level_of("bleeding")) == {"blood_lost_ml": 30.0}


def test_the_shipped_benchmarks_are_what_scripted_hands_do() -> None:
    course = read_course(default_course())
    level = course.level_of("front")
    benchmark = course.benchmark_of("front", "incidents")
    assert benchmark is not None
    numbers: list[int] = []
    for number, seed in list(enumerate(level.seeds))[8:15:3]:  # one of each pace
        session = scripted_try(level, phantom(), row=number, seed=seed, pace=PACES[number // 3 % 3])
        assert session.run.outcome is not None
        assert session.run.outcome.passed, session.run.outcome.reason
        numbers.append(len(session.run.incidents()))
    assert max(numbers) <= benchmark.value
    assert benchmark.n == 15
    level, blood = course.level_of("bleeding"), course.benchmark_of("bleeding", "blood_lost_ml")
    assert blood is not None
    session = scripted_try(level, phantom(), row=3, seed=level.seeds[3], pace=PACES[1])
    assert session.run.outcome is not None
    assert session.run.outcome.passed, session.run.outcome.reason
    assert session.metrics()["blood_lost_ml"] <= blood.value  # without its margin
    level = course.level_of("view")
    assert len(level.seeds) >= level.passes
    assert course.marks(level).keys() == {"peak_stress_ratio"}
    assert course.marks(level)["peak_stress_ratio"] < 0.9


def test_a_class_has_a_course_and_a_teacher_sets_levels(store: ClassStore) -> None:
    ann, ben = store.name_person("a", "Ann"), store.name_person("b", "Ben")
    book = ClassCourse(store)
    with pytest.raises(ValueError, match="no course"):
        book.set_level("window")
    book.choose(SMALL)
    book.set_level("front", ann.id)
    with pytest.raises(ValueError, match="no level 'x'; there are: window, front"):
        book.set_level("x")
    with pytest.raises(ValueError, match="nobody"):
        book.set_level("window", "x")
    store.save(with_level(record(ann.id, passed=True), "window", 1))
    store.save(with_level(record(ben.id, passed=None), "window", 1))
    again = ClassCourse(store)
    tries = again.tries()
    assert [each.passed for each in tries[ann.id] + tries[ben.id]] == [True, False]
    people = {each.id: each for each in store.people()}
    found = again.next_try(people[ann.id], tries[ann.id], phantom(), None)
    assert found is not None
    assert (found[0].level, found[1].title) == ("front", "The front")
    found = again.next_try(people[ben.id], tries[ben.id], phantom(), None)
    assert found is not None
    opening = found[1].exercise.opening
    assert opening is not None
    assert (found[0].level, opening.bed_seed) == ("window", 2)
    # What was cut short has failed and its bed is seen; while it goes on it is no try yet.
    cut = replace(with_level(record(ann.id, finished=False), "window", 2), incidents=None)
    store.save(cut)
    (passed,) = tries[ann.id]
    assert again.standing([passed])[0].row == 1
    where = again.standing(again.tries()[ann.id])[0]
    assert (where.row, where.seed, where.last) == (0, 3, "It was cut short.")
    still = ClassCourse(store, lambda: {cut.id})
    assert still.tries()[ann.id] == [passed]
    store.save(replace(cut, finished=True, passed=True, incidents="[]"))  # it has gone on
    for book in (again, still):
        assert book.standing(book.tries()[ann.id])[0].row == 2
    again.choose(SMALL.replace('"front"', '"other"'))
    assert {each.level for each in store.people()} == {None}
    again.choose(None)
    assert ClassCourse(store).course is None
    assert again.next_try(people[ann.id], tries[ann.id], phantom(), None) is None


def test_a_class_of_version_1_is_read_and_gains_a_course(tmp_path: Path) -> None:
    path = tmp_path / "old.sqlite"
    store = ClassStore.new(path, "Old")
    ann = store.name_person("browser", "Ann")
    store.save(record(ann.id, run_id="x", passed=True))
    with store._writing() as db:
        db.execute("DROP INDEX run_of_level")
        db.execute("DROP TABLE statement")
        for table, columns in (("class", ("course", "uuid", "learning_record_store")),
                               ("person", ("level",)),
                               ("run", ("level", "seed", "incidents"))):  # fmt: skip
            for column in columns:
                db.execute(f"ALTER TABLE {table} DROP COLUMN {column}")
        db.execute("PRAGMA user_version=1")
    store.close()
    again = ClassStore(path)
    assert again.people() == [ann]
    assert [(each.id, each.level) for each in again.runs()] == [("x", None)]
    assert again.course is None
    again.course = SMALL
    again.close()


def test_the_commands_set_course_and_benchmarks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    path = tmp_path / "c.sqlite"
    store = ClassStore.new(path, "C")
    people = [store.name_person(name, name) for name in ("Ann", "Ben", "Cas")]
    for person in people:
        store.save(with_level(record(person.id, passed=True), "window", 1))
    store.close()
    assert "has no course" in run("class", "course", path).stdout
    assert "no course; set one" in refused(["class", "benchmark", path, "--expert", "Ann"])
    shown = run("class", "course", path, "--default").stdout
    assert "no surgeon has set it" in shown
    file = tmp_path / "course.toml"
    file.write_text(SMALL.replace('goal = "window"', 'goal = "x"'))
    assert "(line 9)" in refused(["class", "course", path, file])
    file.write_text(SMALL)
    run("class", "course", path, file)
    assert "nobody called 'Dan'" in refused(["class", "benchmark", path, "--expert", "Dan"])
    assert "--expert" in refused(["class", "benchmark", path])
    done = run("class", "benchmark", path, *[f"--expert={each.name}" for each in people])
    assert re.search(r"window, incidents: 0 \(3 experts, [0-9-]+\)", done.stdout)
    assert re.search(r"window, time_s: .* of which the level asks for 1.5 times\)", done.stdout)
    assert "Of fewer than 4 experts none can be found to be far off." in done.stdout
    run("class", "course", path, "-o", file)
    assert read_course(file.read_text()).benchmark[0].source == "experts"
    run("class", "course", path, "--off")
    assert "has no course" in run("class", "course", path).stdout
