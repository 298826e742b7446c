"""Errors: scripted faults are named and fail, good hands make none and pass."""

import itertools
import json
import math
import re
from collections import Counter
from pathlib import Path

import msgspec
import numpy as np
import pytest
from errors_page import page
from program import run
from simulated import phantom, pull_session

from app.anatomy import anatomy_named
from app.simulation import (
    ERROR_CLASSES,
    FEW,
    MODES,
    Exercise,
    FreeLength,
    Limit,
    Replay,
    Session,
    Specimen,
    bed_named,
    read_incidents,
    read_run,
    specimen_in_bed,
)
from app.simulation.exercises.attempt import Attempt
from app.simulation.exercises.errors import CLOSED_AFTER, Conditions, Incidents, cause_of
from app.simulation.inputs.clock import TICK_SECONDS
from app.simulation.session.dissection_measures import DissectionRecorder
from benchmarks.cheat_scripts import CHEATS, Cheat
from benchmarks.faults import FAULTS, Fault, done, exercises, good, patient_plough

BEDS = ("normal", "loose", "firm", "inflamed")
TISSUE = Conditions(1.5, 4.0, 4.445, 0.5, 36)


@pytest.mark.parametrize(
    ("each", "bed"),
    [(each, bed) for each, bed in zip(FAULTS, itertools.cycle(BEDS), strict=False)],
    ids=lambda each: each if isinstance(each, str) else f"{each.exercise} {each.name}",
)
@pytest.mark.parametrize(
    "number", [1, *(pytest.param(each, marks=pytest.mark.long) for each in (0, 2))]
)
def test_a_fault_is_named_at_any_speed_and_fails(each: Fault, bed: str, number: int) -> None:
    speed, seed = each.speeds[number], (each.anatomies or (21, 22, 23))[number]
    outcome, incidents = done(
        each.exercise, each.bed or bed, seed, each.make, speed, tremor=0.15, walls=each.walls
    )
    assert each.named & {incident.error for incident in incidents}, outcome
    assert not outcome.passed, outcome


@pytest.mark.parametrize("each", CHEATS, ids=lambda each: f"{each.exercise} {each.name}")
def test_no_cheat_passes(each: Cheat) -> None:
    for speed in each.speeds:
        outcome, incidents = done(each.exercise, "normal", each.seed, each.make, speed)
        assert not outcome.passed, (speed, incidents)
        if each.make is patient_plough:
            assert [incident.error for incident in incidents] == ["ploughing"]


@pytest.mark.parametrize(
    "bed", ["normal", *(pytest.param(each, marks=pytest.mark.long) for each in BEDS[1:])]
)
def test_good_hands_make_no_errors_and_few_where_they_tremble(bed: str) -> None:
    seeds = range(21, 25)
    for name in exercises(bed):
        for seed in seeds:
            outcome, incidents = done(name, bed, seed, good)
            assert outcome.passed, (name, seed, outcome)
            assert len(incidents) <= 1
        ends = [done(name, bed, seed, good, tremor=0.15) for seed in seeds]
        assert all(outcome.passed for outcome, _ in ends), (name, ends)
        assert sum(len(incidents) for _, incidents in ends) <= 1


def test_sentences_say_what_where_and_what_instead() -> None:
    sentences: dict[str, str] = {}
    for each in FAULTS:
        at = (*each.anatomies, 24)[0]
        _, incidents = done(
            each.exercise, each.bed or "normal", at, each.make, each.speeds[1], walls=each.walls
        )
        for incident in incidents:
            sentences[incident.error] = incident.sentence
            assert 0.0 < incident.start_s <= incident.end_s
            assert incident.tube == 0 or each.anatomies
    for error, sentence in sentences.items():
        assert re.match(r"(At|From) \d+\.\d s ", sentence), sentence
        assert sentence.endswith(".")
        assert sentence.count(". ") == 1, sentence
        assert "{" not in sentence
        assert not re.search(r"\b0\.000 s|\binf\b|\b0 mm/s", sentence), sentence
        assert sentence == sentence.strip()
        assert error in ERROR_CLASSES
    assert len(sentences) >= 28, sorted(sentences)


@pytest.mark.parametrize(("bed", "part"), [("loose", 0.077), ("normal", 0.09), ("firm", 0.107)])
def test_a_press_is_judged_by_what_it_does_to_the_wall(bed: str, part: float) -> None:
    """The closed form's tenth of the break, where strands part and the duct is finite."""
    tissue = Session(specimen_in_bed(phantom(), bed=bed_named(bed)), vertices=FEW).spatial
    beam, (stresses,) = tissue.beam, tissue.tubes.press_stresses
    middle = len(stresses) // 2
    assert stresses == pytest.approx(np.full_like(stresses, stresses[middle]), rel=0.03)
    beam.take(middle)
    beam.push(middle, [0.0, 0.0, 0.1 * tissue.threshold / float(stresses[middle])])
    beam.tick(0.01, ticks=400)
    assert beam.worst_stress().total / tissue.threshold == pytest.approx(part, rel=0.03)


def test_an_incident_is_one_opening_and_one_closing() -> None:
    incidents = Incidents(TISSUE, {})
    for tick in range(1, 100):
        incidents.tick = tick
        if tick in (10, 11, 20, 40):  # 20 is within the time after which it is closed, 40 is not
            incidents.note("leaning", 0, 12.0, severity=-tick, angle_deg=float(tick))
        incidents.end_tick("near miss" if tick == 55 else "none")
    first, second = incidents.all()
    assert (first.start_s, first.end_s) == pytest.approx((10 / 30, 20 / 30))
    assert first.values == {"angle_deg": 10.0}, "those of its worst tick"
    assert second.start_s - first.end_s > CLOSED_AFTER
    assert (first.consequence, second.consequence) == ("none", "near miss")
    assert incidents.number == Counter(leaning=2)
    assert incidents.cause() is None, "none in the last second"


def test_a_stab_past_several_tubes_is_one_and_names_the_first() -> None:
    incidents = Incidents(TISSUE, {})
    for tube, speed in ((4, 90.0), (0, 120.0), (1, 100.0)):
        incidents.tick += 1
        incidents.note(
            "blind_stab", 1, 8.0, speed, tube=tube, speed_mm_per_s=speed, what=f"tube {tube}"
        )
    (stab,) = incidents.all()
    assert (stab.tube, stab.values) == (4, {"speed_mm_per_s": 120.0, "what": "tube 4"})
    incidents.note("instrument_on_wall", 1, 8.0, tube=0)
    incidents.note("instrument_on_wall", 1, 8.0, tube=1)
    assert incidents.number == {"blind_stab": 1, "instrument_on_wall": 2}


def test_the_cause_is_the_first_of_the_table_in_the_last_second() -> None:
    incidents = Incidents(TISSUE, {})
    incidents.tick = 60
    incidents.note("tear", None, 3.0, at_mm=3.0, name="duct")
    assert incidents.cause() is None, "a tear is not its own cause"
    incidents.note(
        "over_lifted", 0, 12.0, stress_percent=60.0, lifted_mm=4.0, stress_limit_percent=50.0
    )
    incidents.note("ahead_of_front", 0, 12.0, at_mm=12.0, distance_mm=9.0, front_mm=21.0)
    cause = incidents.cause()
    assert cause is not None
    assert cause.error == "ahead_of_front"
    assert cause.sentence.startswith("At 2.0 s you took hold at 12 mm, 9 mm ahead of the free")
    assert cause.sentence.endswith("Take hold at the front, at 21 mm.")
    incidents.tick = 91
    assert incidents.cause() is None


@pytest.mark.parametrize("result", ["hold_slipped", "nick"])
def test_what_comes_of_an_error_is_not_its_cause(result: str) -> None:
    """A slip stands before a fast pull in the table, and is named where nothing led to it."""
    assert ERROR_CLASSES[result].is_result
    for first, later, named in (
        ("fast_pull", result, "fast_pull"),
        (result, "fast_pull", min(result, "fast_pull", key=list(ERROR_CLASSES).index)),
        (result, None, result),
    ):
        incidents = Incidents(TISSUE, {})
        for tick, error in ((60, first), (70, later)):
            incidents.tick = tick
            if error is not None:
                incidents.note(error, 0, 12.0)
        cause = incidents.cause()
        assert cause is not None
        assert cause.error == named
        assert cause_of(incidents.all(), 70 * TICK_SECONDS) == cause, "a class's page takes this"
    incidents = Incidents(TISSUE, {})
    incidents.note("fast_pull", 0, 12.0)
    incidents.note(result, 0, 12.0)
    cause = incidents.cause()
    assert cause is not None
    assert cause.error == "fast_pull", "both in one tick"


def test_a_class_that_only_an_exercise_makes_an_error_is_named_by_it() -> None:
    for named, number in (({}, {}), ({"no_traction": 2}, {"no_traction": 1})):
        incidents = Incidents(TISSUE, named)
        incidents.note("no_traction", 0, 1.0)
        assert incidents.number == number


def test_incidents_with_older_names_of_values_say_the_same() -> None:
    kept = [
        {"error": "ahead_of_front", "hand": 0, "values": {"x": 12.0, "d": 9.0, "front": 21.0}},
        {"error": "fast_in_tissue", "hand": 1,
         "values": {"tool": "swab", "v": 14.0, "n": 3, "speed": 10.0}},
        {"error": "repeated_holds", "hand": 0, "values": {"n": 4.0, "x": 8.0}},
        {"error": "nick", "hand": None, "values":
         {"name": "duct", "s": 0.25, "x": 7.0, "leak": "", "by": "", "instead": ""}},
        {"error": "over_lifted", "hand": 0, "values": {"p": 60.0, "m": 4.0, "most": 50.0}},
    ]  # fmt: skip
    common = {"start_s": 2.0, "end_s": 2.5, "tube": 0, "station_mm": None, "consequence": "none"}
    read = read_incidents(json.dumps([each | common for each in kept]))
    front, fast, holds, nick, lifted = (each.sentence for each in read)
    assert front.startswith("At 2.0 s you took hold at 12 mm, 9 mm ahead of the free stretch")
    assert fast.startswith("At 2.0 s you swept the swab through strands at 14 mm/s, and 3 parted")
    assert holds.startswith("At 2.0 s you took hold 4 times in a second at 8 mm")
    assert nick.startswith("At 2.0 s the wall of the duct tore to 0.25 of its section at 7 mm")
    assert lifted.startswith("At 2.0 s the wall was at 60 % of its break, lifted 4 mm, and 50 %")
    assert read_incidents(msgspec.json.encode(read).decode()) == read, "present names stay"
    assert read_incidents(None) == []


def test_parameters_follow_from_tissue_duct_and_reaction_time() -> None:
    limits = Incidents(TISSUE, {}).limits
    assert limits["fast_in_tissue"]["speed"] == pytest.approx((4.0 - 1.5) / 0.25)
    assert limits["jumping_jaws"]["speed"] == pytest.approx(20.0)
    assert limits["blind_stab"]["speed"] == pytest.approx(2 * 4.445 / 0.25)
    assert limits["over_lifted"]["most"] == 0.5
    assert limits["unseen"]["strands"] == 5
    for each in ERROR_CLASSES.values():
        assert each.mode in MODES
        assert all(parameter.why for parameter in each.parameters)
        for parameter in each.parameters:
            assert f"`{parameter.key}`" in each.begins, (each.key, parameter.key)


def test_the_page_of_errors_is_made_from_their_table() -> None:
    root = Path(__file__).parents[2]
    assert (root / "docs" / "errors.md").read_text("utf-8") == page(), (
        "make it anew: python tests/app/errors_page.py docs/errors.md"
    )


def test_a_run_recorded_before_there_were_errors_has_them_when_it_is_replayed() -> None:
    path = Path(__file__).parent / "runs" / "version_3_torn.json"
    plain = json.loads(run("replay", path, "--json").stdout)
    tear = plain["incidents"][-1]
    assert plain["as_recorded"]
    assert tear["error"] == "tear"
    assert tear["consequence"] == "injury"
    assert tear["start_s"] == pytest.approx(plain["metrics"]["tear"]["time_s"])
    assert tear["station_mm"] == pytest.approx(plain["metrics"]["tear"]["station_mm"])
    assert tear["sentence"].startswith(f"At {tear['start_s']:.1f} s the duct tore at ")
    log = read_run(path.read_bytes()).log
    hands = [each.hand for each in Replay(log, phantom(), vertices=300).incidents()]
    assert hands[0] == 0
    assert [each["hand"] for each in plain["incidents"]] == [
        None if hand is None else hand + 1 for hand in hands
    ]
    lines = run("replay", path).stdout
    for each in plain["incidents"]:
        assert each["sentence"] in " ".join(lines.split())
        assert each["title"] == ERROR_CLASSES[each["error"]].title


def lift_until(session: Session, hand: int, error: str, step: tuple[float, float, float]) -> None:
    """Lead a hand by steps of a tick until there is an incident of a class."""
    for _ in range(900):
        session.move_hand(hand, session.spatial.hands[hand].target + np.array(step))
        session.advance()
        if error in {each.error for each in session.run.incidents()}:
            return
    raise AssertionError(f"no {error}")


def test_errors_at_several_tubes_name_the_tube_and_what_it_lost() -> None:
    session = Session(Specimen.of_anatomy(anatomy_named("normal")), vertices=FEW)
    names = session.spatial.tubes.names
    artery = names.index("artery")
    assert session.grab(0, 10.0, artery) is not None
    session.spatial._note("clip", artery, 20.0, 1)  # the other hand's, which opens nothing
    lift_until(session, 0, "bleeding", (0.0, 0.0, 0.3))
    session.choose_instrument(1, "grasper")
    assert session.grab(1, 30.0, names.index("gallbladder")) is not None
    lift_until(session, 1, "unattended_bleeding", (0.0, 0.02, 0.05))
    found = {each.error: each for each in session.run.incidents()}
    (tear,) = [event for event in session.spatial.events if event.kind == "tear"]
    assert (found["tear"].tube, found["tear"].station_mm) == (artery, tear.station)
    assert f"the cystic artery tore at {tear.station:.0f} mm" in found["tear"].sentence
    tension, bleeding = found["tension_on_vessel"], found["bleeding"]
    assert tension.tube == bleeding.tube == artery
    assert bleeding.hand == 0
    assert tension.start_s < found["tear"].start_s <= bleeding.start_s
    assert 50.0 < float(tension.values["stress_percent"]) <= 100.0
    lost = 1e-3 * session.spatial.fluids["blood"].lost
    assert bleeding.values["lost_ml"] == pytest.approx(lost)
    assert bleeding.consequence == ("injury" if lost > 2.0 else "minor")
    went_on = found["unattended_bleeding"]
    assert went_on.hand == 1
    assert went_on.start_s - bleeding.start_s > 5.0
    assert "ahead_of_front" not in found
    assert "leaning" not in found


@pytest.mark.parametrize("mover", [0, 1])
def test_the_hand_that_pulls_fast_is_named_and_not_one_that_holds_still(mover: int) -> None:
    session = Session(Specimen.of_anatomy(anatomy_named("normal")), vertices=FEW)
    still, tube = 1 - mover, session.spatial.tubes.names.index("common")
    for hand in range(2):
        session.choose_instrument(hand, "grasper")
        assert session.grab(hand, 20.0 + 8.0 * hand, tube) is not None
    for _ in range(60):
        for hand in range(2):
            session.move_hand(hand, session.spatial.hands[hand].target + np.array([0, 0, 0.1]))
        session.advance()
    session.advance(30)
    held = session.spatial.hands[still].place.copy()
    assert math.hypot(*session.spatial.forces[still]) > 0.2, "it pulls"
    before = len(session.run.incidents())
    lift_until(session, mover, "fast_pull", (0.0, 0.0, 2.0))
    assert session.spatial.hands[still].place == pytest.approx(held, abs=0.0)
    found = [each for each in session.run.incidents()[before:] if "fast" in each.error]
    assert {each.hand for each in found} == {mover}
    (fast,) = [each for each in found if each.error == "fast_pull"]
    assert float(fast.values["speed_mm_per_s"]) > 10.0


def test_no_hand_that_holds_still_is_blamed_for_a_wall_that_weakens() -> None:
    session = pull_session(phantom(), vertices=FEW)
    assert session.grab(0, session.task_grasp) is not None
    for tick in range(1, 181):
        session.lift(0.03 * tick)
        session.advance()
    session.advance(60)
    before = 1.0 - session.reading().distance_to_break
    assert 0.3 < before < 0.4
    session.set_threshold(0.4 * session.tissue.threshold)
    session.advance(30)
    assert 1.0 - session.reading().distance_to_break > 1.5 * before
    assert session.run.incidents() == []


def test_a_structure_that_an_exercise_is_not_about_is_a_wrong_one() -> None:
    specimen = Specimen.of_anatomy(anatomy_named("normal"))
    limits = (Limit("wrong_structure", 0),)
    ends: list[str] = []
    for tube in ("cystic", "common"):
        session = Session(specimen, vertices=FEW)
        tissue = session.spatial
        exercise = Exercise("own", "Own", FreeLength(40.0, 0.0, 58.0), limits=limits,
                            about=("cystic", "gallbladder"))  # fmt: skip
        recorder = DissectionRecorder(tissue, exercise)
        recorder.start()
        attempt = Attempt(exercise, recorder)
        assert tissue.grab(0, 10.0, tissue.tubes.names.index(tube)) is not None
        for _ in range(20):
            tissue.move_hand(0, tissue.hands[0].target + np.array([0.0, 0.0, 0.15]))
            recorder.take(moved=tissue.advance())
            attempt.take()
        ends.append("" if attempt.outcome is None else attempt.outcome.reason)
    assert ends[0] == ""
    assert "you pulled on the common duct with" in ends[1]
