"""Runs of a dissection: logged, measured, written, read and made again to the bit."""

import json
import math
import os
import re
import subprocess
import sys
from dataclasses import astuple
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
import run_bits
from hypothesis import given, settings
from hypothesis import strategies as st
from simulated import bed_session, phantom

from app.anatomy import anatomy_named
from app.command_line.replay import replay
from app.simulation import (
    INSTRUMENTS,
    TICK_SECONDS,
    Replay,
    RunFile,
    RunFileError,
    Session,
    Specimen,
    bed_named,
    exercises_offered,
    preset_named,
    read_run,
    run_json,
    specimen_in_bed,
)

SCATTERED = bed_named("firm")


def bits(session: Session) -> bytes:
    """All that is to be the same: the beam, its strands' damage, the skin and the reading."""
    beam, drawn = session.spatial.beam, session.drawn
    arrays = [beam.places, beam.rotations, beam.damage, drawn.surfaces[0].vertices]
    return b"".join(piece.tobytes() for piece in arrays) + repr(astuple(session.reading())).encode()


def dissected(session: Session, seen: list[bytes] | None = None) -> RunFile:
    """A run with every kind of input of both hands: lifted, spread, swept, let go."""

    def advance(ticks: int) -> None:
        for _ in range(ticks):
            session.advance()
            if seen is not None:
                seen.append(bits(session))

    span = session.tissue.dissection.beam.span
    start = session.grab(0, 0.45 * span)
    assert start is not None
    for tick in range(20):
        session.move_hand(0, start + np.array([0.0, 0.5 * math.sin(tick), 0.3 * tick]))
        advance(1)
    session.choose_instrument(1, "dissector")
    away = session.spatial.hands[1].place.copy()
    session.move_hand(1, away + np.array([0.0, 8.0 - away[1], 0.0]))
    advance(25)
    for tick in range(30):
        session.open_jaws(1, 0.5 * tick)
        advance(1)
    session.release(0)
    advance(5)
    session.choose_instrument(1, "swab")
    session.move_hand(1, np.array([0.3 * span, 0.0, -3.0]))
    advance(12)
    assert session.grab(0, 0.6 * span) is not None
    session.move_hand(0, np.array([0.6 * span, 3.0, 4.0]))
    advance(10)
    session.finish()
    return session.run_file()


def replayed(content: bytes) -> Replay:
    """The replay of a file."""
    read = read_run(content)
    return Replay(read.log, phantom(), vertices=300)


def test_each_turn_of_an_instrument_within_a_tick_is_made_again() -> None:
    """A turn acts at once: which of two is refused, and the work of both, go by the one before."""
    session = bed_session(phantom(), vertices=300)
    session.choose_instrument(1, "dissector")
    session.open_jaws(1, 3.0)
    middle = 0.5 * session.tissue.dissection.beam.span
    for deep in np.linspace(0.0, 7.0, 30):
        session.move_hand(1, np.array([middle, -9.0, -deep]))
        session.advance()
    turns = ((0.3, 0.2, 1.0), (-0.2, 0.4, 1.0), (0.0, 0.1, 1.0))
    for turn in range(12):
        for k, direction in enumerate(turns):
            session.aim(1, direction)
            session.spread(1, turns[(turn + k) % 3])
        session.aim(1, turns[turn % 3])
        session.aim(1, turns[(turn + 1) % 3])
        session.advance()
    run = session.run_file()
    kinds = [each.kind for each in run.log.inputs]
    assert kinds.count("aim") == 12 * 5
    assert Replay(run.log, phantom(), vertices=300).run_file() == run


def replay_end(content: bytes) -> Session:
    """The session of a replay at its end."""
    again = replayed(content)
    again.seek_tick(again.log.ticks)
    return again.session


@pytest.mark.parametrize("preset", ["thesis-bile-duct", "porcine-bile-duct"])
def test_a_dissection_made_again_is_equal_to_the_bit_through_json(preset: str) -> None:
    seen: list[bytes] = []
    session = bed_session(phantom(), preset_named(preset), SCATTERED, bed_seed=7, vertices=300)
    original = dissected(session, seen)
    assert {each.kind for each in original.log.inputs} == {
        "instrument", "grab", "move", "open", "release",
    }  # fmt: skip
    content = run_json(original)
    assert len(content) < 20_000
    assert read_run(content) == original
    again = replayed(content)
    for tick, expected in enumerate(seen, start=1):
        again.seek_tick(tick)
        assert bits(again.session) == expected, f"tick {tick}"
    assert run_json(again.run_file()) == content
    assert again.session.run_file() == original
    again.seek_tick(40)
    assert bits(again.session) == seen[39]


def test_what_was_done_before_a_reset_does_not_show_in_a_dissection() -> None:
    session = bed_session(phantom(), bed=SCATTERED, bed_seed=7, vertices=300)
    session.move_hand(0, np.array([10.0, -5.0, 9.0]))
    session.advance(7)
    session.grab(0, 20.0)
    session.move_hand(0, np.array([20.0, 2.0, 9.0]))
    session.advance(40)
    session.reset()
    fresh = bed_session(phantom(), bed=SCATTERED, bed_seed=7, vertices=300)
    for each in (session, fresh):  # a run begins with the hands where they are
        each.move_hand(1, np.array([30.0, -5.0, 9.0]))
        each.advance(3)
    assert run_json(dissected(session)) == run_json(dissected(fresh))


def test_a_run_goes_on_after_a_tear_until_it_is_ended_and_a_reset_begins_another() -> None:
    """Strands still hold the pieces: a dissector parts some more, and all of it is replayed."""
    session = bed_session(phantom(), vertices=300)
    start = session.grab(0, 25.4)
    assert start is not None
    session.move_hand(0, start + np.array([0.0, 0.0, 40.0]))
    while session.spatial.torn is None:
        session.advance()
    tear, broken = session.metrics()["tear"], session.metrics()["strands_broken"]
    assert tear is not None
    assert tear["normal_stress_MPa"] + tear["bending_stress_MPa"] > tear["threshold_MPa"]
    tore = session.run.ticks
    assert tear["time_s"] == tore * TICK_SECONDS
    assert session.grab(0, 10.0) is None
    session.choose_instrument(1, "dissector")
    for across in (6.0, -6.0):
        session.move_hand(1, np.array([12.0, across, -2.5]))
        session.advance(60)
    assert session.run.going
    after = session.metrics()
    assert after["tear"] == tear
    assert after["time_s"] == (tore + 120) * TICK_SECONDS
    assert after["strands_broken"] > broken
    session.finish()
    original = session.run_file()
    session.advance(40)
    assert session.run_file() == original
    again = Replay(original.log, phantom(), vertices=300)
    assert again.run_file() == original
    assert again.ticks > original.log.ticks
    session.reset()
    assert not session.run.started
    assert session.grab(0, 25.4) is not None
    assert session.run.going


def test_the_measures_are_those_of_the_readings() -> None:
    """Summed here again, tick by tick, from what the instruments showed."""
    session = bed_session(phantom(), bed=SCATTERED, bed_seed=7, vertices=300)
    start = session.grab(0, 20.0)
    assert start is not None
    forces: list[np.ndarray] = []
    fractions: list[float] = []
    parted: list[int] = []
    lean = math.radians(30.0)
    for tick in range(1, 61):
        direction = 0.15 * tick * np.array([0.0, math.sin(lean), math.cos(lean)])
        session.move_hand(0, start + direction)
        session.advance()
        reading = session.reading()
        forces.append(np.array(reading.forces[0]))
        fractions.append(reading.stress_ratio)
        parted.append(reading.broken)
    found, energy = session.metrics(), session.reading().energy
    sizes = np.linalg.norm(forces, axis=1)
    assert found["maximum_force_N"] == [pytest.approx(sizes.max()), 0.0]
    assert found["force_time_product_N_s"][0] == pytest.approx(sizes.sum() / 30.0)
    angles = np.degrees(np.arccos(np.array(forces)[:, 2] / sizes))
    assert found["traction_angle_deg"] == pytest.approx((angles * sizes).sum() / sizes.sum())
    assert 20.0 < np.mean(angles) < 45.0
    assert found["peak_stress_ratio"] == max(fractions) == 1.0 - found["smallest_distance_to_break"]
    assert found["time_above_half_s"] == pytest.approx(
        sum(fraction > 0.5 for fraction in fractions) / 30.0
    )
    left = [
        (1.0 - after) / (10.0 * (after - before))
        for before, after in zip([0.0, 0.0, 0.0, *fractions], fractions, strict=False)
        if after > before
    ]
    assert found["shortest_time_to_break_s"] == pytest.approx(min(left))
    assert found["strands_broken"] == parted[-1] == found["strands_broken_by_hand"][0]
    assert 0 < found["strands_broken_out_of_sight"] < found["strands_broken"]
    assert found["work_mJ"] == [pytest.approx(energy.work), 0.0]
    assert found["strand_energy_mJ"] == energy.dissipated
    assert found["economy_of_work"] == pytest.approx(energy.dissipated / energy.work)
    assert 0.0 < found["duct_energy_mJ"] < energy.work - energy.dissipated
    # A hook pulls no strand against an instrument; jaws behind the duct pull all of theirs so.
    assert found["strands_broken_by_instrument"] == 0


def test_what_is_out_of_sight_depends_on_the_view_which_is_an_input() -> None:
    """Seen from the other side, what was hidden is seen and the rest is hidden."""
    hidden, far = [], 0
    for towards in ((0.0, -0.8, 0.6), (0.0, 1.6, -1.2)):
        session = bed_session(phantom(), bed_seed=3, vertices=300)
        session.look_from(towards)
        start = session.grab(0, 25.4)
        assert start is not None
        session.look_from(np.array(towards) + 0.05)  # a glance aside
        beam, far = session.spatial.beam, 0
        damage = beam.damage
        for tick in range(90):
            session.move_hand(0, start + np.array([0.0, 0.0, 0.1 * tick]))
            session.advance()
            new = np.flatnonzero((beam.damage >= 1.0) & (damage < 1.0))
            damage = beam.damage
            away = np.abs(beam.strand_ends(new)[:, 0] - session.spatial.hands[0].place[0])
            far += int((away > 5.0).sum())
        hidden.append(session.metrics()["strands_broken_out_of_sight"])
    assert sum(hidden) == far > 0
    assert hidden[0] > hidden[1] > 0  # of the strands below the duct most are on the far side
    run = session.run_file()
    views = [each for each in run.log.inputs if each.kind == "view"]
    assert [(each.tick, each.value) for each in views] == [(0, pytest.approx((0.0, 0.8, -0.6)))]
    assert run.log.inputs[0].kind == "view"
    again = replayed(run_json(run)).run_file()
    assert again.log == run.log
    assert again.metrics == run.metrics
    session.reset()
    assert session.spatial.view.tolist() == [0.0, -0.8, 0.6]


def test_a_pose_of_the_viewer_is_logged_and_replayed_to_the_bit() -> None:
    """A direction by itself, as in older runs; a camera's with its place; a scope's."""
    towards = np.array([0.3, -0.7, 0.5])
    unit = towards / math.sqrt(float((towards**2).sum()))
    place, held = (12.5, -61.0, 42.0), (0.1, -0.2, 131.7, 3.1, 0.05, 0.52)
    session = bed_session(phantom(), vertices=300)
    session.look_from(towards)
    place_of_hand = session.grab(0, 25.4)
    assert place_of_hand is not None
    for view in (
        [*towards, *place],
        [*towards, *np.add(place, 1.0)],  # a glance aside
        [*towards, *np.add(place, 9.0)],
        [*towards, *np.add(place, 9.0), *held],
        [*towards, *np.add(place, 9.0), *held[:4], 0.4, held[5]],  # the camera's head is turned
        [0.0, 0.0, 0.0],  # towards nothing
        [*towards, 1.0],  # of no such kind
        towards,
    ):
        session.advance(2)
        session.look_from(view)
    session.move_hand(0, np.add(place_of_hand, (0.0, 0.0, 4.0)))
    session.advance(30)
    run = session.run_file()
    views: list[Any] = [each.value for each in run.log.inputs if each.kind == "view"]
    assert [len(np.atleast_1d(each)) for each in views] == [3, 6, 6, 12, 12, 3]
    np.testing.assert_allclose([each[:3] for each in views], [unit] * 6, rtol=1e-15)
    assert views[1][3:] == place
    assert views[3][6:] == held
    again = replayed(run_json(run)).run_file()
    assert again.log == run.log
    assert again.metrics == run.metrics
    four = msgspec.json.decode(run_json(run))
    four["log"]["inputs"][0][3] = [0.0, 1.0, 0.0, 0.0]
    with pytest.raises(ValueError, match=r"input 0, view, must have a direction, then a camera"):
        read_run(msgspec.json.encode(four))


inputs = st.one_of(
    st.tuples(st.just("choose_instrument"), st.integers(0, 1), st.sampled_from(INSTRUMENTS)),
    st.tuples(st.just("grab"), st.integers(0, 1), st.floats(0.0, 50.0)),
    st.tuples(
        st.just("move_hand"),
        st.integers(0, 1),
        st.tuples(st.floats(0.0, 50.0), st.floats(-12.0, 12.0), st.floats(-7.0, 9.0)),
    ),
    st.tuples(st.just("release"), st.integers(0, 1)),
    st.tuples(st.just("open_jaws"), st.integers(0, 1), st.floats(-1.0, 20.0)),
)


@settings(max_examples=10, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 6), inputs), min_size=1, max_size=12))
def test_any_dissection_made_again_is_equal_to_the_bit(course: list[tuple[int, Any]]) -> None:
    session = bed_session(phantom(), bed=SCATTERED, bed_seed=7, vertices=300)
    for ticks, (name, *values) in course:
        getattr(session, name)(*values)
        session.advance(ticks)
    if session.run.started:
        run = session.run_file()
        assert 0.0 <= run.metrics["time_in_tissue_s"] <= run.metrics["time_s"]
        content = run_json(run)
        assert run_json(replayed(content).run_file()) == content
        if session.run.going:
            assert bits(replay_end(content)) == bits(session)


def test_the_columns_of_a_dissection_are_those_of_its_readings() -> None:
    session = bed_session(phantom(), vertices=300)
    run = dissected(session)
    series = Replay(run.log, phantom(), vertices=300).series()
    lines = series.csv().splitlines()
    assert len(lines) == 1 + run.log.ticks
    last = dict(zip(lines[0].split(","), map(float, lines[-1].split(",")), strict=True))
    reading = session.reading()
    assert last["hand_1_force_z_N"] == reading.forces[0][2]
    assert (last["freed_mm"], last["strands_broken"]) == (reading.freed, reading.broken)
    assert last["dissipated_mJ"] == reading.energy.dissipated
    assert last["hand_2_x_mm"] == session.spatial.hands[1].place[0]


def test_a_free_duct_in_space_is_dissected_without_strands_and_replayed() -> None:
    """Two hands and a dissector at a duct that its clamps alone hold."""
    specimen = Specimen(preset_named("assumed-duct"), phantom())
    session = Session(specimen, vertices=300)
    place = session.grab(0, 25.0)
    assert place is not None
    session.choose_instrument(1, "dissector")
    for tick in range(40):
        session.move_hand(0, np.array(place) + np.array([0.0, 0.0, 0.3 * tick]))
        session.advance()
    reading = session.reading()
    assert (reading.strands, reading.freed, exercises_offered(session)) == (0, 0.0, ())
    session.set_threshold(0.9 * reading.check.total_stress)
    while session.run.going:
        session.advance()
    assert session.reading().torn_at is not None
    content = run_json(session.run_file())
    assert read_run(content).log.start.bed is None
    assert run_json(replayed(content).run_file()) == content


@pytest.fixture(scope="module")
def shortest() -> bytes:
    """A run of one hold."""
    session = bed_session(phantom(), vertices=300)
    session.grab(0, 20.0)
    session.advance(3)
    return run_json(session.run_file())


BAD: dict[str, tuple[dict[str, Any], str]] = {
    "no such hand": ({"inputs": [[0, 2, "grab", [0, 20.0]]]}, "must be of hand 0 or 1, got 2"),
    "no such instrument": (
        {"inputs": [[0, 0, "instrument", "laser"]]},
        "must name one of hook, grasper, dissector, swab, .*suction, got 'laser'",
    ),
    "two numbers": ({"inputs": [[0, 0, "move", [1.0, 2.0]]]}, "must have three numbers"),
    "no number": ({"inputs": [[0, 0, "open", None]]}, "must have a number, got None"),
    "late": ({"inputs": [[9, 0, "release", None]]}, "at a tick from 0 to 3, got 9"),
    "value": ({"inputs": [[0, 0, "release", 1.0]]}, "must have no value, got 1.0"),
    "ticks": ({"ticks": -1}, "ticks must be from 0"),
    "seed": ({"start": {"bed_seed": -1}}, "bed_seed must be from 0"),
    "threshold": ({"start": {"threshold_MPa": -1.0}}, "threshold_MPa must be above 0"),
    "steps": ({"start": {"substeps": 4}}, "40 elements and 4 steps a tick"),
    "bed": ({"start": {"bed": "marsh"}}, "unknown bed 'marsh'"),
    "strands": ({"start": {"strands_sha256": "0"}}, "gives other strands here"),
    "kind": ({"inputs": [[0, 0, "slice", 1.0]]}, "a damaged run"),
}


@pytest.mark.parametrize("name", list(BAD))
def test_a_bad_dissection_is_refused_with_what_is_wrong(name: str, shortest: bytes) -> None:
    changes, words = BAD[name]
    tree = json.loads(shortest)
    for key, value in changes.items():
        if isinstance(value, dict):
            tree["log"][key] |= value
        else:
            tree["log"][key] = value
    with pytest.raises(RunFileError, match=words):
        replayed(json.dumps(tree).encode())


def test_a_dissection_is_played_by_the_command(
    tmp_path: Path, shortest: bytes, capsys: pytest.CaptureFixture[str]
) -> None:
    file, table = tmp_path / "run.json", tmp_path / "run.csv"
    file.write_bytes(shortest)
    replay(file, csv=table, as_json=True)
    found = json.loads(capsys.readouterr().out)
    assert found["as_recorded"] is True
    assert found["metrics"] == json.loads(shortest)["metrics"]
    assert table.read_text().startswith("time_s,hand_1_x_mm,")
    replay(file)
    message = capsys.readouterr().out
    assert re.search(r"strands at the start +600", message)
    assert re.search(r"strands broken +0", message)
    assert re.search(r"as recorded +yes, to 12 digits", message)


def test_a_stored_run_of_version_3_plays_as_it_was_recorded() -> None:
    """Two hands, a dissector behind the duct, a new hold, and a pull that tears it."""
    content = (Path(__file__).parent / "runs" / "version_3_torn.json").read_bytes()
    original = read_run(content)
    found = Replay(original.log, phantom(), vertices=300).run_file()
    assert original.agrees_with(found)
    assert found.log == original.log
    assert original.metrics["tear"] is not None
    assert original.metrics["strands_broken_by_instrument"] > 0
    # It has all metrics of today.
    assert found.metrics.keys() - original.metrics.keys() == {"time_in_tissue_s"}
    assert 0.0 < found.metrics["time_in_tissue_s"] <= found.metrics["time_s"]
    # It was made when strands that an instrument had not met were put down to it as well.
    assert original.metrics["strands_broken_by_hand"] == [146, 236]
    start = msgspec.structs.replace(original.log.start, broken_by_touch=True)
    log = msgspec.structs.replace(original.log, start=start)
    again = Replay(log, phantom(), vertices=300).run_file().metrics
    assert again["strands_broken_by_hand"][1] == again["strands_broken_by_instrument"] == 51
    by_hand = original.metrics["strands_broken_by_hand"]
    assert again | {"strands_broken_by_hand": by_hand} == found.metrics


@pytest.mark.long  # all is compiled for another processor
def test_a_run_is_the_same_on_another_processor() -> None:
    """numba, BLAS, numpy and libm choose code by the processor, with last digits of their own."""
    older = {
        "NUMBA_CPU_NAME": "generic",
        "NUMBA_CACHE_DIR": str(Path(__file__).parents[2] / "build" / "generic"),
        "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX,-AVX2,-AVX512F,-FMA,-FMA4",
        "OPENBLAS_CORETYPE": "Prescott",
        "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL",
        "PYTHONPATH": os.pathsep.join(sys.path),
    }
    done = subprocess.run(
        [sys.executable, run_bits.__file__],
        env=os.environ | older, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == run_bits.digests()


def test_an_idle_instrument_parts_no_strand() -> None:
    session = bed_session(phantom(), bed_seed=3, vertices=300)
    session.choose_instrument(1, "dissector")
    start = session.grab(0, 25.4)
    assert start is not None
    for tick in range(30):
        session.move_hand(0, start + np.array([0.0, 0.0, 0.3 * tick]))
        session.advance()
    held = session.metrics()
    assert held["strands_broken_by_hand"] == [held["strands_broken"], 0]
    assert held["strands_broken"] > 100
    # Jaws that are opened behind the duct, which nobody holds, part theirs.
    session.release(0)
    session.advance(10)
    settled = session.metrics()["strands_broken"]
    session.move_hand(1, session.spatial.hands[1].place + np.array([0.0, 24.0, 0.0]))
    session.advance(60)
    session.open_jaws(1, 9.0)
    session.advance(60)
    swept = session.metrics()
    assert swept["strands_broken"] > settled
    assert sum(swept["strands_broken_by_hand"]) == swept["strands_broken"]
    assert swept["strands_broken_by_hand"][1] >= swept["strands_broken"] - settled
    content = run_json(session.run_file())
    assert run_json(replayed(content).run_file()) == content


def handled(
    specimen: Specimen, tube: int, inside: tuple[float, float, float], wait: int
) -> tuple[Session, int]:
    """Wait for some ticks, hold a tube, let go, open jaws in tissue and draw them out.

    Returns
    -------
    tuple[Session, int]
        The session, and its ticks with a hand in tissue by what its state shows.
    """
    session, ticks = Session(specimen, vertices=300), 0

    def advance(count: int) -> None:
        nonlocal ticks
        for _ in range(count):
            session.advance()
            tissue = session.spatial
            beam = tissue.beam
            rods = [rod for i in (0, 1) for rod in range(2 * i, 2 * i + tissue.rod_counts[i])]
            ticks += (
                any(hand.node is not None for hand in tissue.hands)
                or any(beam.touched_by(rod).any() for rod in rods)
                or bool(beam.state.press[rods, :3].any())
            )

    session.choose_instrument(0, "dissector")
    session.choose_instrument(1, "grasper")
    advance(wait)
    outside = session.spatial.hands[0].place + np.array([0.0, -20.0, 30.0])
    place = session.grab(1, 12.0, tube)
    assert place is not None
    session.move_hand(1, np.array(place) + np.array([0.0, 0.0, 2.0]))
    advance(20)
    session.release(1)
    for to, opening in ((inside, 0.0), (inside, 9.0), (inside, 0.0), (outside, 0.0)):
        session.move_hand(0, to)
        session.open_jaws(0, opening)
        advance(45)
    advance(60)
    assert session.run.going
    return session, ticks


@pytest.mark.parametrize("where", ["bed", "anatomy"])
def test_time_in_tissue_is_that_in_which_a_hand_holds_or_touches_it(where: str) -> None:
    if where == "bed":
        each = specimen_in_bed(phantom(), bed_seed=3), 0, (29.4, 5.7, -5.9)
    else:
        specimen = Specimen.of_anatomy(anatomy_named("normal"))
        each = specimen, 1, (54.0, 8.0, 0.0)
    (quick, ticks), (slow, same) = handled(*each, 0), handled(*each, 90)
    found, waited = quick.metrics(), slow.metrics()
    assert found["time_in_tissue_s"] == ticks * TICK_SECONDS
    # The hold of 20 ticks and most of 135 inside; not the last 60, outside.
    assert 100 < ticks == same < quick.run.ticks - 60
    # A wait before the first touch makes the run longer, and that time not.
    assert slow.run.ticks == quick.run.ticks + 90
    assert waited["time_in_tissue_s"] == found["time_in_tissue_s"]
    assert waited["tear"] is found["tear"] is None
    assert waited["strands_broken"] == found["strands_broken"] > 0
    run = slow.run_file()
    assert Replay(run.log, each[0].organ or phantom()).run_file().metrics == waited


def test_a_run_of_before_laws_plays_by_the_linear_one() -> None:
    linear = msgspec.structs.replace(preset_named("porcine-bile-duct"), law="linear")
    session = bed_session(phantom(), linear, SCATTERED, bed_seed=7, vertices=300)
    tree = json.loads(run_json(dissected(session)))
    start = tree["log"]["start"]
    assert start.pop("law") == "linear"
    start["preset"] = "porcine-bile-duct"
    again = replay_end(json.dumps(tree).encode())
    assert bits(again) == bits(session)
    start["law"] = "neo-hooke"
    assert bits(replay_end(json.dumps(tree).encode())) != bits(session)


@pytest.mark.parametrize("preset", ["assumed-duct", "porcine-bile-duct", "human-ureter"])
@pytest.mark.parametrize("fraction", [0.25, 0.5])
def test_a_duct_of_its_own_sections_is_torn_within_the_hand_s_reach(
    preset: str, fraction: float
) -> None:
    session = bed_session(phantom(), preset_named(preset), vertices=300)
    start = session.grab(0, fraction * session.tissue.dissection.beam.span)
    assert start is not None
    lift, seen = 0.0, 0.0
    while session.spatial.torn is None:
        # Once a part of the wall has torn the stress is that of what is left, and may fall.
        assert any(session.spatial.nicked) or session.spatial.stress_ratio >= 0.999 * seen
        seen, lift = session.spatial.stress_ratio, lift + 0.25
        assert lift < 60.0
        session.move_hand(0, start + np.array([0.0, 0.0, lift]))
        session.advance()
