"""Replays: a run made again from its log has the same readings and measures, to the bit."""

import json
import lzma
import math
import re
import threading
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from program import LONGEST, refused, run
from simulated import phantom, pull_session, replayed, settle

from app.anatomy import anatomy_named, first_edition
from app.command_line.replay import replay
from app.simulation import (
    CAREFUL,
    TICK_SECONDS,
    Feedback,
    OrganIdentity,
    Phase,
    Reading,
    Replay,
    RunFile,
    RunFileError,
    Session,
    Specimen,
    TheoryChoice,
    exercises_offered,
    perform,
    preset_named,
    presets,
    read_run,
    run_json,
)
from app.trainer.panel.compare_tab import OFFERED_THEORIES
from assets import BILE_DUCT_PHANTOM
from organ_geometry import Promise
from organ_geometry.images.stack_reader import read_image_stack
from organ_geometry.organ import Organ
from organ_geometry.organ_builder import build_organ
from organ_geometry.organ_file import read_organ, write_organ
from physics import Cubic, Exact, Fem, MassSpring, NeoHooke, TautString

RUNS = Path(__file__).parent / "runs"


def dragged(session: Session, readings: list[Reading] | None = None) -> RunFile:
    """A run with every kind of input: dragged, let go, pulled, regrasped, torn."""

    def advance(ticks: int) -> None:
        for _ in range(ticks):
            session.advance()
            if readings is not None:
                readings.append(session.reading())

    limit = session.planar.deflection_limit / 1.15
    session.grab(0, 0.4 * session.tissue.dissection.beam.span)
    for drag in range(12):
        session.lift(limit * (0.3 + 0.2 * math.sin(0.7 * drag)))
        advance(1 + drag % 3)
    session.release()
    advance(4)
    session.set_target_force(0.2 * session.planar.force_limit)
    advance(9)
    session.set_grasp(0.55 * session.tissue.dissection.beam.span)
    session.set_threshold(0.9 * session.tissue.threshold)
    advance(3)
    session.choose_theory(Exact())
    advance(5)
    session.grab(0, 0.5 * session.tissue.dissection.beam.span)
    session.lift(2.0 * limit)
    while not session.run.over:
        advance(1)
    return session.run_file()


@pytest.mark.parametrize("name", list(presets()))
def test_a_run_made_again_is_equal_to_the_bit_through_json(name: str) -> None:
    readings: list[Reading] = []
    original = dragged(pull_session(phantom(), preset_named(name), vertices=300), readings)
    assert original.metrics["tear"] is not None
    content = run_json(original)
    assert len(content) < 4000
    log = read_run(content).log
    assert read_run(content) == original
    again = Replay(log, phantom(), vertices=300)
    for tick, reading in enumerate(readings, start=1):
        again.seek_tick(tick)
        assert again.session.reading() == reading
    assert again.run_file() == original
    assert run_json(again.run_file()) == content
    # The replay's own session has logged the same run.
    assert again.session.run_file() == original


@pytest.mark.parametrize("label", list(OFFERED_THEORIES))
def test_what_was_done_before_a_run_does_not_show_in_it(label: str) -> None:
    session = pull_session(phantom(), vertices=300)
    session.choose_theory(OFFERED_THEORIES[label])
    session.set_target_force(0.5 * session.planar.force_limit)
    session.advance(40)
    session.reset()
    session.set_grasp(20.0)
    session.advance(3)
    session.set_grasp(22.0)
    session.grab(0, 21.0)
    session.lift(6.3)
    session.advance(17)
    session.set_target_force(1.1)
    session.advance(12)
    session.finish()
    session.set_target_force(0.0)
    session.advance(5)
    original = session.run_file()
    assert original.log.ticks == 29
    assert [each.kind for each in original.log.inputs] == ["grab", "lift", "force"]
    assert replayed(original, phantom()) == original


@pytest.mark.parametrize("label", list(OFFERED_THEORIES))
def test_a_pull_right_after_a_reset_starts_from_a_duct_never_pulled(label: str) -> None:
    session = pull_session(phantom(), vertices=300)
    session.choose_theory(OFFERED_THEORIES[label])
    session.set_target_force(0.5 * session.planar.force_limit)
    session.advance(40)
    session.reset()
    assert session.grab(0, session.planar.grasp) == (session.planar.grasp, 0.0, 0.0)
    session.lift(4.7)
    session.advance(9)
    original = session.run_file()
    assert replayed(original, phantom()) == original


def test_a_run_is_made_again_after_a_reset_and_another_preset() -> None:
    session = pull_session(phantom(), vertices=300)
    first = dragged(session)
    session.reset()
    session.reset()
    assert replayed(first, phantom()) == first
    session.set_target_force(1.0)
    session.advance(7)
    second = session.run_file()
    session.choose_preset("thesis-rubber")
    session.advance(3)
    assert replayed(second, phantom()) == second


def test_an_unfinished_run_is_made_again_as_far_as_it_went() -> None:
    session = pull_session(phantom(), vertices=300)
    session.set_target_force(2.0)
    session.advance(11)
    first = session.run_file()
    session.set_target_force(0.5)
    session.advance(5)
    assert replayed(first, phantom()) == first
    assert replayed(session.run_file(), phantom()) == session.run_file()


@given(
    st.lists(
        st.tuples(
            st.sampled_from(["force", "grab", "lift", "release", "grasp", "threshold", "theory"]),
            st.floats(0.0, 1.0),
            st.integers(0, 4),
        ),
        min_size=1,
        max_size=20,
    )
)
@settings(deadline=None, max_examples=25)
def test_any_run_is_made_again_to_the_bit(inputs: list[tuple[str, float, int]]) -> None:
    session = pull_session(phantom(), vertices=300)
    theories = (Cubic(), Exact(), TautString())
    for kind, data, ticks in inputs:
        if kind == "force":
            session.set_target_force(data * session.planar.force_limit)
        elif kind == "grab":
            session.grab(0, data * 50.8)
        elif kind == "lift":
            session.lift(data * session.planar.deflection_limit)
        elif kind == "release":
            session.release()
        elif kind == "grasp":
            session.set_grasp(data * 50.8)
        elif kind == "threshold":
            session.set_threshold(data * session.planar.threshold_range[1])
        else:
            session.choose_theory(theories[min(int(3 * data), 2)])
        session.advance(ticks)
    if session.run.seconds == 0.0 and not session.reading().held:
        return
    original = session.run_file()
    assert replayed(read_run(run_json(original)), phantom()) == original


def test_a_run_that_several_threads_wrote_into_is_made_again_to_the_bit() -> None:
    session = pull_session(phantom(), vertices=300)
    session.set_threshold(session.planar.threshold_range[1])
    over, turns, wrote = threading.Event(), threading.Semaphore(0), threading.Semaphore(0)

    def write(seed: int) -> None:
        random = np.random.default_rng(seed)
        while not over.is_set():
            session.lift(0.5 * float(random.random()))
            session.set_target_force(float(random.random()))
            session.grab(0, 50.8 * float(random.random()))
            session.set_grasp(50.8 * float(random.random()))
            wrote.release()
            turns.acquire()

    threads = [threading.Thread(target=write, args=(seed,)) for seed in range(3)]
    for thread in threads:
        thread.start()
    for _ in range(30):
        turns.release(6)
        session.advance()
        for _ in range(6):
            assert wrote.acquire(timeout=LONGEST)
    over.set()
    turns.release(len(threads))
    for thread in threads:
        thread.join()
    session.advance()  # the last of them may have begun another run
    original = session.run_file()
    assert original.log.ticks > 0
    assert len(original.log.inputs) > 30
    assert replayed(original, phantom()) == original


def test_an_exercise_is_judged_again_the_same() -> None:
    session = pull_session(phantom(), vertices=300)
    approach = exercises_offered(session)[1]
    session.start_exercise(approach, Feedback.FADING)
    perform(session, CAREFUL)
    original = session.run_file()
    assert original.outcome is not None
    assert original.outcome.passed
    assert original.log.exercise == approach
    again = replayed(read_run(run_json(original)), phantom())
    assert again == original
    assert again.log.feedback is Feedback.FADING


def test_a_run_at_an_anatomy_s_first_edition_plays_as_it_was_recorded() -> None:
    """It names a shipped anatomy, whose joints have had faces and soft roots since."""
    path = Path(__file__).parent / "older_runs" / "first_edition.json.xz"
    careful: Any = msgspec.json.decode(lzma.decompress(path.read_bytes()))
    assert careful["run"]["log"]["start"]["anatomy"] == "normal"
    original = read_run(msgspec.json.encode(careful["run"]))
    edition, today = first_edition("normal"), anatomy_named("normal")
    assert original.log.start.anatomy == edition
    assert edition != today
    assert [each.face_mm for each in edition.join] == [0.0] * len(edition.join)
    assert {each.stiff for each in edition.join if each.to == "rha"} == {2.0}
    assert {each.stiff for each in today.join if each.to == "rha"} == {0.57}
    assert original.agrees_with(replayed(original, phantom()))


@pytest.mark.parametrize("name", ["impulse", "hold"])
def test_runs_of_version_1_play_as_they_were_recorded(name: str) -> None:
    """Recorded before only the hand counted: one by force, judged by its impulse; one by hand."""
    original = read_run((RUNS / f"version_1_{name}.json").read_bytes())
    found = replayed(original, phantom())
    assert found.outcome is not None
    assert original.outcome is not None
    assert found.outcome.passed == original.outcome.passed
    assert found.log.exercise_inputs == "any"
    assert original.agrees_with(found)
    for other in (
        msgspec.structs.replace(found, outcome=None),
        msgspec.structs.replace(found, metrics=found.metrics | {"path_length_mm": 1.0}),
    ):
        assert not original.agrees_with(other)


def test_any_moment_can_be_gone_to_forwards_and_back() -> None:
    readings: list[Reading] = []
    original = dragged(pull_session(phantom(), vertices=300), readings)
    again = Replay(original.log, phantom(), vertices=300)
    ticks = len(readings)
    assert again.duration == pytest.approx(ticks * TICK_SECONDS + 2.8, abs=0.1)
    for tick in (ticks, 3, 40, 39, 41, 1):
        again.seek(tick * TICK_SECONDS)
        assert again.time == pytest.approx(tick * TICK_SECONDS)
        assert again.session.reading() == readings[tick - 1]
    again.seek(1e12)
    assert again.time == again.duration
    assert again.session.reading().phase is Phase.TORN
    assert not again.session.advance(5)  # at rest
    again.seek(-5.0)
    assert again.session.reading().deflection == 0.0
    assert again.session.reading().phase is Phase.INTACT


def test_torn_pieces_go_on_tick_by_tick_and_a_jump_back_shows_the_duct_at_rest() -> None:
    log = dragged(pull_session(phantom(), vertices=300)).log
    stepped, jumped = (Replay(log, phantom(), vertices=300) for _ in range(2))
    rest = [surface.vertices.copy() for surface in stepped.session.drawn.surfaces]
    fronts: list[float] = []
    for tick in range(log.ticks, log.ticks + 60):
        stepped.seek_tick(tick)
        tear = stepped.session.planar.tear
        assert tear is not None
        fronts.append(tear.front)
    assert fronts[0] == 0.0
    assert fronts[-1] == 2.0
    assert all(np.diff(fronts) >= 0.0)
    jumped.seek_tick(log.ticks + 59)
    for ours, other in zip(
        stepped.session.drawn.surfaces, jumped.session.drawn.surfaces, strict=True
    ):
        assert ours.vertices.tobytes() == other.vertices.tobytes()
    stepped.seek_tick(0)
    assert stepped.session.planar.tear is None
    (whole,) = stepped.session.drawn.surfaces
    assert whole.vertices.tobytes() == rest[0].tobytes()


def test_the_torn_rim_is_the_one_that_was_seen() -> None:
    found = []
    for seed in (1, 7):
        session = pull_session(phantom(), vertices=600, seed=seed)
        session.set_target_force(session.planar.force_limit)
        settle(session)
        again = Replay(session.run_file().log, phantom(), vertices=600)
        again.seek(1e9)
        for own, other in zip(session.drawn.surfaces, again.session.drawn.surfaces, strict=True):
            assert own.vertices.tobytes() == other.vertices.tobytes()
        found.append(session.drawn.surfaces[0].vertices.copy())
    assert found[0].shape != found[1].shape or not np.array_equal(found[0], found[1])


def test_the_series_is_what_was_read_and_sums_to_the_measures() -> None:
    readings: list[Reading] = []
    original = dragged(pull_session(phantom(), vertices=300), readings)
    series = Replay(original.log, phantom(), vertices=300).series()
    assert series["force_N"].tolist() == [reading.force for reading in readings]
    assert series["deflection_mm"].tolist() == [reading.deflection for reading in readings]
    assert series["stress_MPa"].tolist() == [reading.check.total_stress for reading in readings]
    hook = [series[f"hook_{axis}_mm"] for axis in "xyz"]
    assert np.array(hook).T.tolist() == [list(reading.hook) for reading in readings]
    torn = [float(reading.phase is not Phase.INTACT) for reading in readings]
    assert series["torn"].tolist() == torn
    metrics = original.metrics
    assert series["force_N"].max() == metrics["maximum_force_N"]
    product = series["force_N"].sum() * TICK_SECONDS
    assert product == pytest.approx(metrics["force_time_product_N_s"])
    assert series["distance_to_break"].min() == metrics["smallest_distance_to_break"]
    assert series["time_s"][-1] == pytest.approx(metrics["time_s"])
    header, *rows = series.csv().splitlines()
    assert header.split(",")[:3] == ["time_s", "force_N", "deflection_mm"]
    assert len(rows) == len(readings)
    cells = rows[17].split(",")
    assert float(cells[1]) == readings[17].force  # to the last bit
    assert cells[-1] == "0"
    assert rows[-1].endswith(",1,1")


def test_a_run_of_another_organ_is_refused() -> None:
    original = dragged(pull_session(phantom(), vertices=300))
    organ = phantom()
    other = Organ(organ.axis * 1.001, organ.frames, organ.keys, organ.outer, organ.lumen)
    with pytest.raises(RunFileError, match="another organ"):
        Replay(original.log, other)
    renamed = Organ(
        organ.axis, organ.frames, organ.keys, organ.outer, organ.lumen, name="a new name"
    )
    assert OrganIdentity.of(renamed).sha256 == original.log.organ.sha256


@pytest.mark.parametrize(
    "theory",
    [Cubic(), Cubic(0.3), Cubic("fitted"), Exact(), Exact(NeoHooke()), Fem()],
)
def test_theories_are_written_by_name_and_options(theory: object) -> None:
    choice = TheoryChoice.of(theory)  # pyright: ignore[reportArgumentType]
    again = msgspec.json.decode(msgspec.json.encode(choice), type=TheoryChoice)
    assert again.theory() == theory


def test_a_theory_that_no_name_gives_cannot_be_written() -> None:
    with pytest.raises(ValueError, match="cannot be written"):
        TheoryChoice.of(Exact(intervals=80))
    with pytest.raises(ValueError, match="cannot be written"):
        TheoryChoice.of(MassSpring(nodes=21))


def test_a_run_without_a_pull_cannot_be_written() -> None:
    with pytest.raises(ValueError, match="first input"):
        pull_session(phantom(), vertices=300).run_file()


def test_a_long_drag_is_a_small_file_and_repeated_wishes_are_not_in_it() -> None:
    session = pull_session(phantom(), vertices=300)
    session.grab(0, 25.4)
    for _ in range(100):
        for data in (0.1, 0.2, 0.3):  # between two ticks only the last one counts
            session.lift(data * session.planar.deflection_limit)
        session.set_grasp(25.4)
        session.advance()
    inputs = session.run_file().log.inputs
    assert len(inputs) <= 1 + 100
    for _ in range(100):
        session.lift(1.0)
        session.advance()
    assert len(session.run_file().log.inputs) == len(inputs) + 1


# Files from elsewhere: one line that says what is wrong.


def good() -> dict[str, Any]:
    session = pull_session(phantom(), vertices=300)
    session.grab(0, 20.0)
    session.lift(5.0)
    session.advance(6)
    return json.loads(run_json(session.run_file()))


BAD: dict[str, tuple[dict[str, object], str]] = {
    "format": ({"format": "other"}, "not a run"),
    "version": ({"version": 5}, "a run of version 5; this program reads 1 to 4"),
    "log": ({"log": 3}, "damaged"),
    "ticks": ({"log.ticks": 10**9}, "ticks must be"),
    "ticks type": ({"log.ticks": "many"}, "damaged"),
    "seed": ({"log.seed": -1}, "seed must be"),
    "tick": ({"log.tick_seconds": 0.01}, "tick_seconds must be"),
    "order": (
        {"log.inputs": [[3, 0, "lift", 1.0], [2, 0, "lift", 1.0]]},
        "input 1 must be at a tick",
    ),
    "late": ({"log.inputs": [[7, 0, "lift", 1.0]]}, "input 0 must be at a tick"),
    "kind": ({"log.inputs": [[0, 0, "push", 1.0]]}, "damaged"),
    "number": ({"log.inputs": [[0, 0, "lift", None]]}, "must have a number"),
    "release": ({"log.inputs": [[0, 0, "release", 1.0]]}, "must have no value"),
    "theory": ({"log.inputs": [[0, 0, "theory", 1.0]]}, "must name a theory"),
    "no theory": ({"log.inputs": [[0, 0, "theory", {"name": "x"}]]}, "unknown theory 'x'"),
    "start": ({"log.start.theory": {"name": "string", "q": 1.0}}, "start: q belongs"),
    "preset": ({"log.start.preset": "x"}, "run's preset, bed or theory: unknown preset 'x'"),
    "grasp": ({"log.start.grasp_mm": 1000.0}, "out of this duct's range"),
    "exercise": (
        {"log.exercise": {"exercise": "approach_break", "margin": 1.0, "seconds": 1.0}},
        "low and high of distance_to_break must rise from 0 and be below 1",
    ),
    "organ": ({"log.organ.sha256": "0"}, "another organ"),
}


@pytest.mark.parametrize("name", list(BAD))
def test_a_bad_run_is_refused_with_what_is_wrong(name: str) -> None:
    changes, words = BAD[name]
    tree = good()
    for path, value in changes.items():
        *folders, last = path.split(".")
        node = tree
        for folder in folders:
            node = node[folder]
        node[last] = value
    with pytest.raises(RunFileError, match=words):
        Replay(read_run(json.dumps(tree).encode()).log, phantom(), vertices=300)


@given(st.binary(max_size=200))
@settings(deadline=None)
def test_bytes_that_are_no_run_are_refused(content: bytes) -> None:
    with pytest.raises(RunFileError):
        read_run(content)


def test_a_file_too_long_is_refused_before_it_is_read() -> None:
    with pytest.raises(RunFileError, match="at most"):
        read_run(b" " * 16_000_001)


# The command.


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, RunFile]:
    original = dragged(pull_session(phantom(), vertices=300))
    path = tmp_path_factory.mktemp("runs") / "run.json"
    path.write_bytes(run_json(original))
    return path, original


def test_the_command_prints_the_same_measures(
    recorded: tuple[Path, RunFile], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, original = recorded
    done = run("replay", path, "--json", "--csv", tmp_path / "run.csv")
    assert done.returncode == 0, done.stderr
    printed = json.loads(done.stdout)
    assert printed["as_recorded"] is True
    assert printed["metrics"] == original.metrics
    assert len((tmp_path / "run.csv").read_text().splitlines()) == original.log.ticks + 1
    replay(path)
    message = capsys.readouterr().out
    assert f"{original.metrics['maximum_force_N']:.6g} N" in message
    assert f"{original.metrics['force_time_product_N_s']:.6g} N s" in message
    assert "yes, to 12 digits" in message


def test_the_command_says_what_an_exercise_was_done_with(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    replay(RUNS / "version_1_impulse.json")
    message = capsys.readouterr().out
    assert "sliders and keys allowed" in message
    assert re.search(r"smoothness +too short", message)
    assert "yes, to 12 digits" in message
    session = pull_session(phantom(), vertices=300)
    session.start_exercise(exercises_offered(session)[0])
    perform(session, CAREFUL)
    path = tmp_path / "run.json"
    path.write_bytes(run_json(session.run_file()))
    replay(path)
    assert re.search(r"done with +the hand alone", capsys.readouterr().out)
    replay(path, as_json=True)
    assert json.loads(capsys.readouterr().out)["exercise_inputs"] == "hand"


def test_the_command_takes_the_organ_s_own_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    coarser = build_organ(
        read_image_stack(BILE_DUCT_PHANTOM), promise=Promise(tolerance_mm=0.3)
    ).organ
    write_organ(coarser, tmp_path / "own.organ")
    session = pull_session(read_organ(tmp_path / "own.organ"), vertices=300)
    session.set_target_force(1.0)
    session.advance(20)
    path = tmp_path / "run.json"
    path.write_bytes(run_json(session.run_file()))
    replay(path, organ=tmp_path / "own.organ", as_json=True)
    assert json.loads(capsys.readouterr().out)["as_recorded"] is True
    assert "another organ" in refused(("replay", path))


def test_the_command_says_when_the_measures_are_others(
    recorded: tuple[Path, RunFile], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, original = recorded
    forged = msgspec.structs.replace(original, metrics=original.metrics | {"maximum_force_N": 0.1})
    (tmp_path / "forged.json").write_bytes(run_json(forged))
    replay(tmp_path / "forged.json")
    message = capsys.readouterr().out
    assert f"{original.metrics['maximum_force_N']:.6g} N" in message
    assert "yes" not in message.splitlines()[-1]
    assert path.exists()


def test_the_command_refuses_what_is_no_run(tmp_path: Path) -> None:
    for content in ("{}", '{"format":' + 100_000 * "["):
        (tmp_path / "no.json").write_text(content)
        assert "not a run" in refused(("replay", tmp_path / "no.json"))
    assert "no-such" in refused(("replay", tmp_path / "no-such.json"))


def test_the_trainer_opens_on_no_run_that_it_cannot_play(
    tmp_path: Path, tube_file: Path, recorded: tuple[Path, RunFile]
) -> None:
    file, _ = recorded
    options = ("trainer", "--port", 0, "--replay")
    message = refused((*options, file, "--organ", tube_file))
    assert f"--replay {file}: " in message
    assert "organ" in message
    (tmp_path / "no.json").write_text("{}")
    assert "not a run" in refused((*options, tmp_path / "no.json"))
    session = Session(Specimen.of_anatomy(anatomy_named("normal")))
    session.grab(0, 10.0)
    (tmp_path / "tubes.json").write_bytes(run_json(session.run_file()))
    message = refused((*options, tmp_path / "tubes.json", "--scene", "bed"))
    assert "this run needs --scene calot" in message
