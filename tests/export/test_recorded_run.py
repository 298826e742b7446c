"""Recorded runs: what a viewer plays is what the session drew, tick by tick, and its tear."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from gltf_reader import Gltf
from other_programs import validated
from program import refused
from rigged import walls
from simulated import bed_session, phantom, pull_session
from test_bed_export import vtp
from vtkmodules.util.numpy_support import vtk_to_numpy

from app.command_line.replay import replay
from app.export.motion import WHOLE
from app.export.recorded_run import RUN, RecordedRun, rigged_runs, run_snapshots
from app.simulation import (
    AFTER_TEAR,
    SETTLED_SECONDS,
    TICK_SECONDS,
    Phase,
    Replay,
    RunFile,
    bed_named,
    run_json,
)
from app.simulation.specimen.drawn_duct import DrawnDuct
from organ_geometry.mesh import organ_skin
from physics import Exact

OF_RADIUS = 1e-4
"""How near a viewer's vertices must be to what the session drew, in parts of the radius."""
VERTICES = 1200
SEED = 7


@cache
def recorded(*, torn: bool) -> RunFile:
    """A run by hand and by the slider, with another grasp and theory on the way."""
    session = pull_session(phantom(), vertices=300, seed=SEED)
    session.grab(0, 20.0)
    for drag in (3.0, 5.0, 2.0, 6.0):
        session.lift(drag)
        session.advance(6)
    session.release()
    session.advance(8)
    session.set_target_force(1.5)
    session.advance(12)
    session.set_grasp(28.0)
    session.choose_theory(Exact())
    session.advance(10)
    if torn:
        session.set_target_force(session.planar.force_limit)
        while not session.run.over:
            session.advance()
    return session.run_file()


@cache
def again(*, torn: bool) -> Replay:
    """The run in a session of its own."""
    return Replay(recorded(torn=torn).log, phantom(), vertices=VERTICES)


@cache
def played(*, torn: bool, frames: int = 2000) -> RecordedRun:
    return RecordedRun.of_log(recorded(torn=torn).log, phantom(), frames=frames)


@pytest.mark.parametrize("torn", [False, True])
def test_a_viewer_shows_the_vertices_that_the_session_drew(torn: bool) -> None:
    run, session = played(torn=torn), again(torn=torn).session
    edge_length = DrawnDuct(phantom(), VERTICES).edge_length
    gltf = Gltf(rigged_runs([run], edge_length=edge_length))
    ticks = recorded(torn=torn).log.ticks
    radius = 1e-3 * phantom().mean_radius
    seen: set[str] = set()
    for tick in (0, 5, 17, 29, 45, 60, ticks - 1, ticks, ticks + 9, ticks + 25, ticks + 80):
        if tick > ticks and not torn:
            continue
        again(torn=torn).seek_tick(tick)
        for surface in session.drawn.surfaces:
            name = "organ" if surface.name == "skin" else surface.name
            shown = gltf.vertices(name, RUN, float(np.float32(tick * TICK_SECONDS)))
            drawn = walls(surface.skin, surface.vertices)
            for got, wanted in zip(shown, drawn, strict=True):
                assert np.abs(got - wanted).max() <= OF_RADIUS * radius, (tick, name)
            seen.add(name)
    assert seen == ({"organ", "first_piece", "second_piece"} if torn else {"organ"})
    assert gltf.duration(RUN) == pytest.approx((ticks + torn * (AFTER_TEAR - 1)) * TICK_SECONDS)
    assert AFTER_TEAR * TICK_SECONDS > SETTLED_SECONDS


def test_a_run_of_every_tick_comes_apart_where_it_tore() -> None:
    run, log = played(torn=True), recorded(torn=True).log
    motion = run.motion
    assert run.torn
    assert motion.whole.sum() == log.ticks + 1
    assert (~motion.whole).sum() == AFTER_TEAR
    last = int(np.flatnonzero(motion.whole)[-1])
    assert motion.times[last] == motion.times[last + 1] == log.ticks * TICK_SECONDS
    assert np.array_equal(motion.transforms[last], motion.transforms[last + 1])
    assert motion.fronts[[last, last + 1, -1]].tolist() == [WHOLE, 0.0, 2.0]
    assert not motion.transforms[0].any()  # rest, to the bit
    assert not motion.transforms[-1].any()
    tear = recorded(torn=True).metrics["tear"]
    assert tear is not None
    assert run.motion.readings[last].force == tear["force_N"]
    assert [reading.phase is Phase.INTACT for reading in run.motion.readings[: last + 1]] == [
        *([True] * last),
        False,
    ]


def test_fewer_frames_are_even_and_keep_both_ends_and_the_tear() -> None:
    log = recorded(torn=True).log
    motion = played(torn=True, frames=5).motion
    ticks = motion.times[motion.whole] / TICK_SECONDS
    assert ticks == pytest.approx(np.linspace(0.0, log.ticks, 5), abs=0.5 + 1e-9)
    assert (~motion.whole).sum() == AFTER_TEAR
    every = played(torn=True).motion
    at = np.searchsorted(every.times, motion.times[1])
    assert np.array_equal(motion.transforms[1], every.transforms[at])


def test_a_run_without_a_tear_has_no_pieces() -> None:
    run = played(torn=False)
    assert not run.torn
    assert run.pieces(edge_length=1.0) is None
    assert run.motion.whole.all()


def test_pieces_have_the_rim_that_was_seen() -> None:
    again(torn=True).seek_tick(10**6)
    edge_length = DrawnDuct(phantom(), VERTICES).edge_length
    pieces = played(torn=True).pieces(edge_length=edge_length)
    assert pieces is not None
    for surface, piece in zip(again(torn=True).session.drawn.surfaces, pieces, strict=True):
        assert surface.skin.vertices.tobytes() == piece.skin.vertices.tobytes()


@pytest.mark.parametrize("frames", [1, 2001])
def test_too_few_or_too_many_frames_are_refused(frames: int) -> None:
    with pytest.raises(ValueError, match=r"frames must be 2 .* to 2,000"):
        RecordedRun.of_log(recorded(torn=False).log, phantom(), frames=frames)


def test_a_run_of_no_ticks_is_refused() -> None:
    session = pull_session(phantom(), vertices=300)
    session.set_target_force(1.0)
    with pytest.raises(ValueError, match="no ticks has nothing to play"):
        RecordedRun.of_log(session.run_file().log, phantom(), frames=10)


def test_the_command_writes_what_other_programs_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, output = tmp_path / "run.json", tmp_path / "run.GLB"
    path.write_bytes(run_json(recorded(torn=True)))
    replay(path, output=output, frames=20, edge_length=1.0, as_json=True)
    printed = json.loads(capsys.readouterr().out)
    assert printed["as_recorded"] is True
    assert printed["file"] == str(output)
    assert printed["bytes"] == output.stat().st_size
    assert printed["keys"] == 20 + AFTER_TEAR
    (report,) = validated(output)
    assert report["issues"]["numErrors"] == 0, report
    assert report["issues"]["numWarnings"] == 0, report


def test_the_command_refuses_in_one_line_and_leaves_nothing(tmp_path: Path) -> None:
    path = tmp_path / "run.json"
    path.write_bytes(run_json(recorded(torn=False)))
    words = refused(("replay", path, "-o", tmp_path / "run.stl"))
    assert "of a pull without a bed a run is a .glb or an .html" in words
    assert "frames must be" in refused(("replay", path, "-o", tmp_path / "a.glb", "--frames", 1))
    (tmp_path / "folder.glb").mkdir()
    for output, frames, edge_length, words in (
        ("no/run.glb", None, None, "there is no folder"),
        ("folder.glb", None, None, "it is a folder"),
        ("run.glb", 5000, None, "frames must be 2"),
        ("run.glb", None, 0.001, "edge_length"),
        ("run.html", None, 0.3, "a page holds at most"),
        ("run.html", 2000, -1.0, "edge_length"),
        (None, 10, None, "give -o"),
    ):
        target = None if output is None else tmp_path / output
        with pytest.raises(ValueError, match=words):
            replay(path, output=target, frames=frames, edge_length=edge_length)
        assert sorted(tmp_path.iterdir()) == [tmp_path / "folder.glb", path]


@cache
def freed() -> RunFile:
    """A dissection with a hook and a grasper."""
    session = bed_session(phantom(), vertices=300, seed=SEED)
    start = session.grab(0, 22.0)
    assert start is not None
    for tick in range(30):
        session.move_hand(0, start + np.array([0.0, 0.1 * tick, 0.3 * tick]))
        session.advance()
    assert session.grab(1, 34.0) is not None
    session.move_hand(1, np.array([34.0, 0.0, 5.0]))
    session.advance(15)
    return session.run_file()


def test_a_dissection_is_played_as_it_was_drawn(tmp_path: Path) -> None:
    """Its duct to the vertices that the session drew, and strands as they were then."""
    source, path = tmp_path / "run.json", tmp_path / "run.glb"
    source.write_bytes(run_json(freed()))
    replay(source, output=path, edge_length=1.2)
    (report,) = validated(path)
    assert report["issues"]["messages"] == []
    gltf = Gltf(path.read_bytes())
    shown = Replay(freed().log, phantom(), vertices=300)
    skin = organ_skin(phantom(), edge_length=1.2)
    for tick in (0, 12, 30, 45):
        shown.seek_tick(tick)
        session = shown.session
        bound = skin.bound_to(session.tissue.dissection.driving)
        wanted = bound.deform(session.drawn.transforms, np.empty_like(skin.vertices))
        found = gltf.vertices("organ", RUN, tick * TICK_SECONDS)
        for places, wall in zip(found, walls(skin, wanted), strict=True):
            assert np.abs(places - wall).max() < OF_RADIUS * 1e-3 * phantom().mean_radius
    run = RecordedRun.of_log(freed().log, phantom(), frames=46)
    bed = run.motion.bed
    assert bed is not None
    assert (bed.damage[-1] >= 1.0).sum() == session.reading().broken > 30
    assert run.motion.readings[-1].check.distance_to_break == pytest.approx(
        1.0 - session.reading().stress_ratio
    )


def test_a_dissection_is_written_for_paraview(tmp_path: Path) -> None:
    """Its end, with the strands beside it, is what the run's last key has."""
    path = tmp_path / "run.json"
    path.write_bytes(run_json(freed()))
    replay(path, output=tmp_path / "run.vtp", edge_length=1.2)
    assert (tmp_path / "run_strands.vtp").stat().st_size > 1000
    surface = vtp(tmp_path / "run.vtp")
    run = RecordedRun.of_log(freed().log, phantom(), frames=2)
    *_, (_, moment) = run_snapshots([run], edge_length=1.2)
    places = vtk_to_numpy(surface.GetPoints().GetData())
    assert (places == moment.surfaces[0].vertices).all()
    assert np.abs(places - moment.surfaces[0].skin.vertices).max() > 3.0
    words = refused(("replay", path, "-o", tmp_path / "run.vtp", "--frames", 9))
    assert "--frames is of a file that plays the run" in words


@pytest.mark.parametrize("goes_on", [0, 60])
def test_a_dissection_that_tears_is_played_until_both_pieces_hang(goes_on: int) -> None:
    """Also where the run goes on meanwhile, and a dissector parts strands of a piece."""
    session = bed_session(phantom(), bed=bed_named("inflamed"), vertices=300)
    start = session.grab(0, 25.0)
    assert start is not None
    tick = 0
    while session.spatial.torn is None:
        session.move_hand(0, start + np.array([0.0, 0.0, 0.5 * tick]))
        session.advance()
        tick += 1
    broken = session.reading().broken
    session.choose_instrument(1, "dissector")
    for across in (6.0, -6.0):
        session.move_hand(1, np.array([12.0, across, -2.5]))
        session.advance(goes_on)
    assert (session.reading().broken > broken) == (goes_on > 0)
    session.finish()
    last = max(tick + AFTER_TEAR - 1, session.run.ticks)
    again = Replay(session.run_file().log, phantom(), vertices=300)
    run = RecordedRun.of_log(session.run_file().log, phantom(), frames=200)
    motion, whole = run.motion, run.motion.whole
    assert run.torn
    assert run.seconds == session.run.ticks * TICK_SECONDS
    apart = int(whole.sum())
    assert motion.times[[apart - 1, apart, -1]] == pytest.approx(
        np.array([tick - 1, tick - 1, last]) * TICK_SECONDS
    )
    assert np.abs(motion.transforms[apart - 1] - motion.transforms[apart]).max() < 1e-12
    assert 0.0 < motion.readings[int(whole.sum()) - 1].check.distance_to_break < 0.2
    assert motion.readings[-1].check.station == session.spatial.torn.station
    for at in (apart, apart + 17):  # the pull is shown until the front is through
        assert motion.readings[at].phase is Phase.TEARING
        assert motion.readings[at].force == motion.readings[apart - 1].force > 1.0
    # At the end each piece is where the trainer draws it.
    again.seek_tick(10**6)
    bed = motion.bed
    assert bed is not None
    assert (bed.damage[-1] >= 1.0).sum() == again.session.reading().broken
    surfaces = again.session.drawn.surfaces
    pieces = run.pieces(edge_length=again.session.drawn.edge_length)
    assert pieces is not None
    for number, (piece, drawn) in enumerate(zip(pieces, surfaces, strict=True)):
        out = np.empty_like(piece.skin.vertices)
        pose = motion.of_piece(number).transforms[-1]
        piece.skin.bound_to(run.dissection.driving).deform(pose, out)
        assert np.abs(piece.open(2.0, out) - drawn.vertices).max() < 0.02
    assert rigged_runs([run], edge_length=1.2)
