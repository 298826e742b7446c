"""Scripted hands at an anatomy: what ships, clips and divisions, and scripts that cannot be."""

import json
import math
from functools import cache
from pathlib import Path

import msgspec
import numpy as np
import pytest
from program import refused, run

from app.anatomy import anatomy_named
from app.simulation import (
    FEW,
    METRIC_OF,
    TICK_SECONDS,
    Performance,
    Replay,
    Safety,
    Script,
    Session,
    Specimen,
    careful_run,
    exercises_offered,
    has_careful_run,
    performed,
    read_run,
    read_script,
    run_json,
)
from app.simulation.tissue.suction import REACH_MM
from assets import SCRIPTS
from physics.bed.kernels import RETRACED

TAKE = """
[[step]]
do = "take"
hand = {hand}
instrument = "{instrument}"

[[step]]
do = "aim"
hand = {hand}
direction = [0, 0, 1]
"""
CLOSE = """
[[step]]
do = "spread"
hand = {hand}
tube = "cystic"
at_mm = {at}
direction = [0, 1, 0]

[[step]]
do = "lead"
hand = {hand}
tube = "cystic"
at_mm = {at}
off_mm = [0, 0, 14]

[[step]]
do = "open"
hand = {hand}
opening_mm = 5

[[step]]
do = "lead"
hand = {hand}
tube = "cystic"
at_mm = {at}
off_mm = [0, 0, {deep}]

[[step]]
do = "{what}"
hand = {hand}

[[step]]
do = "lead"
hand = {hand}
tube = "cystic"
at_mm = {at}
off_mm = [0, 0, 14]
"""


def done(script: str) -> tuple[Session, Performance]:
    """Return what came of a script, given as TOML, at the normal anatomy."""
    session = Session(Specimen.of_anatomy(anatomy_named("normal")), vertices=FEW)
    return session, performed(msgspec.toml.decode(script, type=Script), session)


@pytest.mark.long  # a minute of computing
def test_careful_hands_pass_the_critical_view_and_close_both_structures() -> None:
    """Five of six with nothing torn; then marked, two clips to stay, one to go, and divided."""
    session = Session(Specimen.of_anatomy(anatomy_named("normal")), vertices=FEW)
    exercise = next(each for each in exercises_offered(session) if each.name == "critical_view")
    session.start_exercise(exercise)
    found = performed(read_script(SCRIPTS / "careful.toml"), session)
    view = found.view
    assert view is not None
    assert (view.two_structures, view.triangle_cleared, view.plate_freed) == (1, 2, 2)
    assert view.torn == ()
    assert session.spatial.events == []
    assert not found.refused
    assert session.reading().peak_stress_ratio < 1.0
    assert view.structures["cystic"] > 0.9 > view.structures["artery"]
    assert found.seconds < 600.0
    assert not found.trap
    assert session.run.standing.startswith("the view reached; mark the cystic")
    assert session.run.progress == 0.5
    found = performed(read_script(SCRIPTS / "clip-and-divide.toml"), session)
    assert not found.refused
    outcome = session.run.outcome
    assert outcome is not None
    assert outcome.passed, outcome
    assert "marked both structures and divided them between clips" in outcome.reason
    assert kinds(session) == [
        (kind, tube)
        for kind, count in (("clip", 3), ("division", 1))
        for tube in ("cystic", "artery")
        for _ in range(count)
    ]
    assert session.reading().fluids[0].lost_ml < 1e-3


@pytest.mark.parametrize(
    ("name", "points"),
    [("first_view", 3), pytest.param("critical_view", 5, marks=pytest.mark.long)],
    ids=["first view", "critical view"],
)
def test_the_recorded_careful_run_is_replayed_to_its_result(name: str, points: int) -> None:
    """What *Show me* plays at once comes out again: measures, errors, and the view reached."""
    session = Session(Specimen.of_anatomy(anatomy_named("normal")), vertices=FEW)
    exercise = next(each for each in exercises_offered(session) if each.name == name)
    session.start_exercise(exercise)
    recorded = careful_run(session)
    replay = Replay(recorded.run.log, session.tissue.dissection.organ, tore=False)
    assert replay.ticks == recorded.run.log.ticks
    assert replay.run_file() == recorded.run
    assert replay.incidents() == recorded.incidents
    assert recorded.run.outcome is not None
    assert recorded.run.outcome.passed
    assert recorded.run.log.exercise == exercise
    assert recorded.run.metrics["critical_view_points"] == points
    assert recorded.run.metrics["tear"] is None
    assert not recorded.incidents, "it is what to imitate"


@pytest.mark.parametrize("name", ["short-cystic", "parallel-low"])
def test_a_recorded_run_is_shown_at_its_own_anatomy_only(name: str) -> None:
    session = Session(Specimen.of_anatomy(anatomy_named(name)), vertices=FEW)
    offered = {each.name: each for each in exercises_offered(session)}
    for each in ("critical_view", "first_view", "who_is_who"):
        assert not has_careful_run(offered[each])


def test_the_recorded_first_view_is_of_the_exercise_that_is_offered() -> None:
    """`test_first_view.py` does it again, and replays it."""
    session = Session(Specimen.of_anatomy(anatomy_named("normal")), vertices=FEW)
    exercise = next(each for each in exercises_offered(session) if each.name == "first_view")
    session.start_exercise(exercise)
    recorded = careful_run(session)
    assert recorded.run.log.exercise == exercise
    assert recorded.run.outcome is not None
    assert recorded.run.outcome.passed
    assert recorded.run.metrics["critical_view_points"] == 3


@cache
def shipped(name: str) -> tuple[Session, Performance]:
    """Return what came of a shipped script."""
    session = Session(Specimen.of_anatomy(anatomy_named("normal")), vertices=FEW)
    return session, performed(read_script(SCRIPTS / f"{name}.toml"), session)


def kinds(session: Session) -> list[tuple[str, str]]:
    """Return the events' kinds and tubes."""
    return [(each.kind, each.tube) for each in session.spatial.events]


def test_hasty_jaws_make_the_artery_bleed() -> None:
    """The cystic artery tears by the second hand's jaws, blood is lost, and nothing is safe."""
    session, found = shipped("hasty")
    tear = session.spatial.events[0]
    assert (tear.kind, tear.tube, tear.hand) == ("tear", "artery", 1)
    metrics = session.metrics()
    assert metrics["tear"]["time_s"] == pytest.approx(tear.tick * TICK_SECONDS, abs=1e-9)
    assert metrics["time_s"] > metrics["tear"]["time_s"] + 1.0  # it goes on after that
    assert metrics["tear"]["tube"] == metrics["peak_stress_tube"] == "artery"
    assert metrics["tear"]["station_mm"] == tear.station
    place = METRIC_OF["peak_stress_station_mm"].name(metrics)
    assert place == "Place of the peak stress, cystic artery"
    run = session.run_file()
    without = {key: value for key, value in metrics["tear"].items() if key != "tube"}
    older = msgspec.structs.replace(run, metrics=metrics | {"tear": without})
    assert older.agrees_with(run), "as files of before are read"
    assert not run.agrees_with(older)
    assert ("bleeding", "artery") in kinds(session)
    blood = session.reading().fluids[0]
    assert blood.lost_ml > 5.0
    assert blood.lost_ml + blood.left_ml == pytest.approx(5000.0, rel=1e-12)
    assert found.view is not None
    assert found.view.torn == ("artery",)
    assert found.view.triangle > 0.1  # parted, and worth nothing
    assert found.view.total == 0


def test_a_tented_common_duct_is_seen_and_tears() -> None:
    """Held at the junction it stands in line with the cystic duct, tears and leaks bile."""
    session, found = shipped("tented")
    assert found.trap
    assert found.tenting is not None
    assert found.tenting.diameters > 1.0
    assert kinds(session)[:2] == [("tear", "common"), ("leak", "common")]
    assert session.spatial.events[0].hand == 0


@pytest.mark.parametrize("name", ["hasty", "tented"])
def test_a_performance_is_replayed_to_the_bit(name: str) -> None:
    """Its run is a run like any other: file, measures and events come out again."""
    session, _ = shipped(name)
    run = session.run_file()
    again = Replay(read_run(run_json(run)).log, session.specimen.organ)  # pyright: ignore[reportArgumentType]
    again.seek_tick(run.log.ticks)
    assert run_json(again.run_file()) == run_json(run)
    assert again.session.spatial.events == session.spatial.events


def test_a_balance_that_is_retraced_closes_where_a_tube_tears_against_jaws() -> None:
    """By the trapezoidal rule 2e-3 of the work is left open, most of it in the tick of the tear."""
    session, _ = shipped("hasty")
    assert session.specimen.organ is not None
    again = Replay(session.run_file().log, session.specimen.organ)
    again.seek_tick(1)
    again.session.spatial.beam.state.sums[RETRACED] = 1.0
    again.seek_tick(session.run_file().log.ticks)
    beam, energy = again.session.spatial.beam, again.session.spatial.beam.energy
    assert (beam.places == session.spatial.beam.places).all()
    assert energy.rod_work > 5.0
    assert abs(energy.residual) < 1e-5 * energy.work


def test_the_command_replays_a_performance(tmp_path: Path) -> None:
    """Its incidents come as JSON, and it plays in a page."""
    session, _ = shipped("hasty")
    file = tmp_path / "run.json"
    file.write_bytes(run_json(session.run_file()))
    made = run("replay", file, "--json")
    assert made.returncode == 0, made.stderr
    done = json.loads(made.stdout)
    assert done["as_recorded"] is True
    assert {"tear", "bleeding"} <= {each["error"] for each in done["incidents"]}
    page = tmp_path / "run.html"
    made = run("replay", file, "-o", page, "--frames", 5)
    assert made.returncode == 0, made.stderr
    assert "the run in 5 keys" in made.stdout
    assert "s triangle, anatomy normal</h1>" in page.read_text()


def clipped(*, clips: bool) -> Session:
    """Return a session in which the cystic duct was divided, between two clips or without."""
    script = TAKE.format(hand=1, instrument="clip applier")
    if clips:
        script += CLOSE.format(hand=1, at=8, deep=-3, what="clip")
        script += CLOSE.format(hand=1, at=16, deep=-3, what="clip")
    script += TAKE.format(hand=2, instrument="scissors")
    script += CLOSE.format(hand=2, at=12, deep=-3, what="divide")
    session, found = done(script + '\n[[step]]\ndo = "wait"\nseconds = 2\n')
    assert found.refused == []
    assert found.view_at_first_clip is not None or not clips
    return session


def test_a_duct_divided_between_clips_leaks_nothing() -> None:
    """Two clips hold what scissors open; without them bile flows out of both ends."""
    dry, wet = clipped(clips=True), clipped(clips=False)
    assert kinds(dry) == [("clip", "cystic"), ("clip", "cystic"), ("division", "cystic")]
    assert dry.reading().fluids[1].lost_ml == 0.0
    assert kinds(wet) == [("division", "cystic"), ("leak", "cystic")]
    assert wet.reading().fluids[1].lost_ml > 0.1
    at = [each.station for each in dry.spatial.events]
    assert at == pytest.approx([8.0, 16.0, 12.0], abs=1.0)
    assert dry.spatial.tear_of(1) is None  # divided, not torn
    dry.choose_instrument(0, "grasper")
    assert dry.grab(0, 18.0, 1) is not None  # and its pieces can be held


def test_suction_takes_up_what_lies_within_its_reach_and_no_more() -> None:
    """About each end of a divided duct lies a puddle of what it has lost, 1 mm deep."""
    session = clipped(clips=False)
    tissue, bed = session.spatial, session.spatial.beam
    suction, bile = tissue.suction, tissue.fluids["bile"]
    lost = sum(each.lost_ml for each in session.reading().fluids)
    assert suction.pooled_ml() == pytest.approx(lost, rel=1e-12)
    assert suction.pooled_ml("bile") == pytest.approx(1e-3 * bile.lost, rel=1e-12)
    less, more = sorted(bile.holes, key=lambda hole: hole.lost)
    at, rim = bed.places[more.node], REACH_MM + math.sqrt(more.lost / math.pi)
    away = (at - bed.places[less.node]) * [1.0, 1.0, 0.0]
    out = rim * away / math.hypot(*away[:2])
    assert suction.reaches(at + 0.999 * out, bed)
    assert not suction.reaches(at + 1.001 * out, bed)
    high = max(bed.places[hole.node][2] for hole in bile.holes) - at[2] + REACH_MM
    up = np.array([0.0, 0.0, 1.0])
    assert suction.reaches(at + (high - 1e-6) * up, bed)
    assert not suction.reaches(at + (high + 1e-6) * up, bed)
    session.choose_instrument(0, "suction")
    session.suck(0, 30.0)
    session.advance(60)  # where it comes in
    assert suction.taken_ml == 0.0
    session.move_hand(0, bed.places[bile.holes[0].node])
    session.advance(120)
    assert suction.pooled_ml() < 0.05 * lost
    assert suction.taken_ml <= sum(each.lost_ml for each in session.reading().fluids) + 1e-9


def test_jaws_that_are_not_past_a_tube_close_nothing() -> None:
    """A clip and scissors need the whole width between their jaws."""
    script = TAKE.format(hand=1, instrument="clip applier")
    session, found = done(script + CLOSE.format(hand=1, at=8, deep=1.0, what="clip"))
    assert kinds(session) == []
    assert found.refused == ["step 7: hand 1 could not clip"]


def test_nothing_is_cleared_at_rest_and_all_once_all_has_parted() -> None:
    """The critical view is 0 at rest, and 6 with every strand of the three parts parted."""
    session = Session(Specimen.of_anatomy(anatomy_named("accessory-artery")), vertices=FEW)
    safety = Safety(session.spatial)
    rest = safety.critical_view()
    assert (rest.total, rest.triangle, rest.plate) == (0, 0.0, 0.0)
    assert set(rest.structures) == {"cystic", "artery", "artery2"}
    assert not safety.tenting().trap
    beam, names = session.spatial.beam, session.spatial.tubes.names
    for name in names:
        if name != "common":
            beam.break_between(0.0, beam.network.tubes[name].span, name)
    view = safety.critical_view()
    assert view.total == 6
    freed = safety.freed_all_round()
    spans = {name: beam.network.tubes[name].span for name in freed}
    assert freed == pytest.approx(spans)
    session.spatial.tears[names.index("artery")] = session.reading().check
    assert safety.critical_view().total == 0


def test_the_triangle_leaves_the_duct_beside_the_common_duct_covered() -> None:
    """What holds that third of the cystic duct counts for nothing, and what holds the rest does."""
    session = Session(Specimen.of_anatomy(anatomy_named("normal")), vertices=FEW)
    safety, beam = Safety(session.spatial), session.spatial.beam
    span = beam.network.tubes["cystic"].span
    beam.break_between(0.0, span / 3.0, "cystic")
    assert beam.broken > 50
    assert safety.critical_view().triangle == 0.0
    assert (beam.damage[safety.lacking("triangle")] < 1.0).all()
    beam.break_between(span / 3.0, span, "cystic")
    assert safety.critical_view().triangle > 0.5


BAD = {
    "no step": ("", "needs a \\[\\[step\\]\\]|`step`"),
    "unknown field": ('[[step]]\ndo = "wait"\nsecond = 1', "second"),
    "unknown do": ('[[step]]\ndo = "dance"', "dance"),
    "wait without seconds": ('[[step]]\ndo = "wait"', "step 1, wait, needs seconds"),
    "wait backwards": ('[[step]]\ndo = "wait"\nseconds = -1', "seconds must be from"),
    "too long": ('[[step]]\ndo = "wait"\nseconds = 1e5', "seconds must be from"),
    "third hand": ('[[step]]\ndo = "release"\nhand = 3', "3"),
    "unknown tube": ('[[step]]\ndo = "grab"\ntube = "ureter"\nat_mm = 1', "no tube 'ureter'"),
    "beyond a tube": ('[[step]]\ndo = "grab"\ntube = "cystic"\nat_mm = 99', "at_mm on 'cystic'"),
    "grab nowhere": ('[[step]]\ndo = "grab"\ntube = "cystic"', "needs at_mm"),
    "lead nowhere": ('[[step]]\ndo = "lead"', "needs one of to_mm, by_mm and tube"),
    "lead twice": ('[[step]]\ndo = "lead"\nto_mm = [0,0,0]\nby_mm = [0,0,0]', "needs one of"),
    "lead to nan": ('[[step]]\ndo = "lead"\nto_mm = [nan, 0, 0]', "three finite numbers"),
    "two numbers": ('[[step]]\ndo = "lead"\nto_mm = [0, 0]', "to_mm|length 3"),
    "no speed": (
        '[[step]]\ndo = "lead"\nto_mm = [0,0,0]\nspeed_mm_per_s = 0',
        "speed_mm_per_s must be",
    ),
    "no instrument": ('[[step]]\ndo = "take"', "needs instrument"),
    "unknown instrument": ('[[step]]\ndo = "take"\ninstrument = "laser"', "laser"),
    "no direction": ('[[step]]\ndo = "aim"', "needs direction"),
    "zero direction": ('[[step]]\ndo = "aim"\ndirection = [0,0,0]', "must not be 0, 0, 0"),
    "jaws shut too far": ('[[step]]\ndo = "open"\nopening_mm = -1', "opening_mm must be"),
    "blowing": ('[[step]]\ndo = "suck"\nrate_ml_per_s = -1', "rate_ml_per_s must be"),
    "empty step": ("[[step]]\nhand = 1", "needs either do"),
    "repeated nowhere": ('[[step]]\n[[step.step]]\ndo = "release"', "needs each_mm"),
    "far away": ('[[step]]\ndo = "lead"\nto_mm = [1e300, 0, 0]', "step 1: to_mm must be"),
    "as good as no direction": (
        '[[step]]\ndo = "aim"\ndirection = [1e-300, 0, 0]',
        "must not be 0, 0, 0",
    ),
    "without end": (
        f"[[step]]\neach_mm = {[1] * 200}\n[[step.step]]\neach_mm = {[1] * 200}\n"
        '[[step.step.step]]\ndo = "release"',
        "at most 20,000 steps",
    ),
    "a word for a number": (
        '[[step]]\ndo = "release"\n[[step]]\ndo = "wait"\nseconds = "1"',
        "script.toml: step 2: .* in seconds",
    ),
    "a word deeper": (
        '[[step]]\neach_mm = [1]\n[[step.step]]\ndo = "wait"\nseconds = "1"',
        "step 1.1: .*seconds",
    ),
    "no TOML": ("[[step]", "script.toml: "),
    "repeated beyond": (
        '[[step]]\neach_mm = [1, 99]\n[[step.step]]\ndo = "grab"\ntube = "cystic"',
        "step 1.1: at_mm on 'cystic'",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_script_is_refused_in_one_sentence(name: str, tmp_path: Path) -> None:
    """Before anything is done, with the step and what would be right."""
    content, words = BAD[name]
    path = tmp_path / "script.toml"
    path.write_text(content)
    with pytest.raises(ValueError, match=words) as raised:
        performed(read_script(path), _untouched())
    assert "\n" not in str(raised.value)
    assert not _untouched().run.started


def test_older_keys_of_a_script_are_read(tmp_path: Path) -> None:
    present = SCRIPTS / "clip-and-divide.toml"
    older = tmp_path / "older.toml"
    suck = '[[step]]\ndo = "suck"\nrate_ml_per_s = 10\n'
    content = present.read_text() + suck
    older.write_text(content.replace("_per_s", "_s"))
    script = read_script(older)
    assert script.step[:-1] == read_script(present).step
    assert script.step[-1].rate_ml_per_s == 10
    assert {each.speed_mm_per_s for step in script.step for each in step.step} >= {15, 30, 60}


def test_the_command_refuses_a_bad_script_and_a_bad_anatomy(tmp_path: Path) -> None:
    """One line with the file and the place, and no run is left."""
    script, anatomy = tmp_path / "script.toml", tmp_path / "anatomy.toml"
    script.write_text('[[step]]\ndo = "grab"\ntube = "ureter"\nat_mm = 1')
    words = refused(["perform", script, "-o", tmp_path / "run.json"])
    assert f"{script}: step 1: there is no tube 'ureter'" in words
    anatomy.write_text('name = "x"\n[[tube]]\nname = 3')
    words = refused(["perform", SCRIPTS / "hasty.toml", "--anatomy", anatomy])
    assert f"{anatomy}, line 3: tube" in words
    assert not (tmp_path / "run.json").exists()


@cache
def _untouched() -> Session:
    return Session(Specimen.of_anatomy(anatomy_named("normal")), vertices=FEW)


def test_a_volume_of_tissue_is_not_asked_of_a_single_duct() -> None:
    """Only an anatomy with a gallbladder and two ducts has a critical view."""
    arteries = anatomy_named("normal")
    bare = msgspec.structs.replace(
        arteries, tube=arteries.tube[:1], join=[], layer=[arteries.layer[7]]
    )
    session = Session(Specimen.of_anatomy(bare), vertices=FEW)
    with pytest.raises(ValueError, match="no gallbladder"):
        Safety(session.spatial)
    assert np.isfinite(session.spatial.beam.places).all()
