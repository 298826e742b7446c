"""Walls that tear in time: a duct of a preset and tubes of an anatomy, in a session and its run."""

from pathlib import Path

import msgspec
import numpy as np
import pytest
from gltf_reader import Gltf
from msgspec.structs import replace
from simulated import bed_session, phantom
from test_bed_export import vtp
from vtkmodules.util.numpy_support import vtk_to_numpy

from app.anatomy import Anatomy, anatomy_named
from app.export.recorded_run import rigged_runs, run_snapshots
from app.export.recorded_tubes import recorded_runs
from app.export.vtk_series import snapshot_contents
from app.haptics.duct_choice import DuctChoice
from app.haptics.haptic_bed import HapticBed
from app.simulation import TICKS_PER_SECOND, Replay, Specimen, bed_named, preset_named, run_json
from app.simulation.runs.run_file import RunFile
from app.simulation.tissue.spatial_tissue import SpatialTissue
from physics import DEEPEST


def test_a_ureter_is_nicked_before_it_parts_and_so_in_its_replay(tmp_path: Path) -> None:
    organ = phantom()
    ureter, bed = preset_named("human-ureter"), bed_named("loose")
    session = bed_session(organ, ureter, bed, vertices=300)
    tissue = session.spatial
    session.set_threshold(0.3 * tissue.own_threshold)
    place = session.grab(0, 0.5 * tissue.dissection.beam.span)
    assert place is not None
    forces, depths = list[float](), list[float]()
    for tick in range(1500):
        session.move_hand(0, np.array(place) + np.array([0.0, 0.0, 0.03 * tick]))
        session.advance()
        forces.append(tissue.reading().force)
        depths.append(tissue.nicked[0])
        if tissue.torn is not None:
            break
    kinds = [event.kind for event in tissue.events]
    assert kinds[0] == "nick"
    assert kinds[-1] == "tear"
    nicked = next(i for i, each in enumerate(depths) if each > 0.0)
    assert np.all(np.diff(depths) >= 0.0)
    assert any(0.0 < each < DEEPEST for each in depths)
    assert depths[-1] == 1.0
    assert min(forces[nicked:-1]) < forces[nicked - 1]  # it falls while the hand goes on
    energy = tissue.beam.energy
    assert abs(energy.residual) < 1e-3 * energy.work
    run = session.run_file()
    assert run.log.start.tear_mm_per_s == 20.0
    again = msgspec.json.decode(run_json(run), type=RunFile)
    replay = Replay(again.log, organ)
    assert replay.run_file().agrees_with(run)
    series = replay.series()
    assert series["duct_nicked"][-1] == 1.0
    partly = (series["duct_nicked"] > 0.0) & (series["duct_nicked"] < 1.0)
    height = series["duct_nick_mm"][partly] / series["duct_nicked"][partly]
    assert np.allclose(height, height[0], rtol=1e-12)
    assert height[0] == pytest.approx(tissue.beam.nicks_of()[0].height, rel=1e-12)
    # The errors name it, and the exports have its depth at the same times.
    nick = next(each for each in session.run.incidents() if each.error == "nick")
    assert nick.hand == 0
    assert nick.station_mm == tissue.beam.nicks_of()[0].station / tissue.surface.scale
    assert nick.consequence == "injury", "it tears within a second"
    assert f"tore to {max(d for d in depths if d < 1.0):.2g} of its section" in nick.sentence
    assert "Ease the pull" in nick.sentence
    runs = recorded_runs(again.log, organ, frames=100)
    gltf = Gltf(rigged_runs(runs, edge_length=3.0))
    (extra,) = gltf.tree["animations"][0]["extras"]["nicks"]
    assert extra["mesh"] == "organ"
    ticks = np.rint(np.array(extra["time_s"]) * TICKS_PER_SECOND).astype(int)
    assert extra["depth_mm"] == pytest.approx(series["duct_nick_mm"][ticks - 1], rel=1e-12)
    before = None
    for time, snapshot in run_snapshots(runs, edge_length=3.0):
        if len(snapshot.surfaces) == 2:
            assert not np.concatenate(snapshot.nicked).any()
            break
        before = time, snapshot
    assert before is not None
    (tmp_path / "a.vtp").write_bytes(snapshot_contents(before[1])[""])
    data = vtp(tmp_path / "a.vtp").GetPointData().GetArray("nick_depth_mm")
    deep = vtk_to_numpy(data)
    tick = round(before[0] * TICKS_PER_SECOND)
    assert deep.max() == pytest.approx(series["duct_nick_mm"][tick - 1], rel=1e-6)
    assert 0.0 < (deep > 0.0).mean() < 0.3
    # An older run of the same preset has no such speed: its duct is through at once.
    start = replace(again.log.start, tear_mm_per_s=None)
    old = Replay(replace(again.log, start=start), organ)
    old.seek_tick(run.log.ticks)
    assert [event.kind for event in old.session.spatial.events] == ["tear"]
    assert "nick" not in {each.error for each in old.incidents()}


def with_frail_artery(tear_mm_per_s: float, strength: float) -> Anatomy:
    """The usual anatomy, whose artery tears in time at a fraction of its strength."""
    whole = anatomy_named("normal")
    tubes = [
        replace(each, tear_mm_per_s=tear_mm_per_s, strength_MPa=strength * each.strength_MPa)
        if each.name == "artery"
        else each
        for each in whole.tube
    ]
    return replace(whole, name="frail", tube=tubes)


def test_a_nicked_artery_bleeds_before_it_parts() -> None:
    tissue = SpatialTissue(Specimen.of_anatomy(with_frail_artery(5.0, 0.02)))
    number = tissue.tubes.names.index("artery")
    place = tissue.grab(0, 0.5 * tissue.tubes.dissections[number].beam.span, number)
    assert place is not None
    tissue.move_hand(0, place + np.array([0.0, 0.0, 15.0]))
    for _ in range(200):
        tissue.advance()
        if any(event.kind == "bleeding" for event in tissue.events):
            break
    mine = [event.kind for event in tissue.events if event.tube == "artery"]
    assert mine[:2] == ["nick", "bleeding"]
    assert tissue.tears[number] is None
    assert 0.0 < tissue.nicked[number] < DEEPEST
    assert tissue.reading().fluids[0].lost_ml > 0.0
    (nick,) = tissue.reading().nicks
    assert (nick.tube, nick.leaks) == (number, True)
    assert nick.words("Artery").endswith(f" of its section at {nick.station:.1f} mm; leaks")


def test_a_device_feels_a_nick_of_one_tube_of_an_anatomy() -> None:
    whole = anatomy_named("normal")
    forces = list[list[float]]()
    held, begun = np.ones(1, np.bool_), 0
    for anatomy in (with_frail_artery(10.0, 0.1), whole):
        choice = DuctChoice.of(Specimen.of_anatomy(anatomy), tube="artery")
        model = choice.haptic_model(1.0)
        assert isinstance(model, HapticBed)
        hand, mine = np.zeros((1, 3)), list[float]()
        while not model.torn and not (forces and len(mine) == len(forces[0])):
            assert len(mine) < 4000
            hand[0, 2] += 0.01
            model.step(hand, held)
            mine.append(float(np.sqrt((model.forces**2).sum())))
            if not forces and not begun and model.beam.nicks_of("artery"):
                begun = len(mine)
        forces.append(mine)
        nicked = [name for name in model.beam.network.tubes if model.beam.nicks_of(name)]
        assert nicked == ([] if begun == 0 or len(forces) == 2 else ["artery"])
    frail, firm = np.array(forces)
    assert 0 < begun < frail.size - 20
    assert np.array_equal(frail[: begun - 1], firm[: begun - 1])
    assert frail[-2] < 0.98 * firm[-2]
    assert frail[-1] == 0.0 < firm[-1]


def test_a_device_feels_a_nick_as_a_loss_of_force_before_the_duct_parts() -> None:
    frail = replace(preset_named("porcine-cystic-duct"), tear_mm_per_s=5.0)
    at_once = replace(frail, tear_mm_per_s=None)
    depths = dict[bool, list[float]]()
    parted = dict[bool, int]()
    held = np.ones(1, np.bool_)
    for nicks, preset in ((True, frail), (False, at_once)):
        model = DuctChoice.of(Specimen(preset)).haptic_model(5.0)
        assert isinstance(model, HapticBed)
        depths[nicks] = []
        forces, hand, period = list[float](), np.zeros((1, 3)), 0
        while not model.torn:
            assert period < 4000
            hand[0, 2] += 0.004
            model.step(hand, held)
            period += 1
            forces.append(float(np.sqrt((model.forces**2).sum())))
            mine = model.beam.nicks_of()
            depths[nicks].append(max((each.depth for each in mine), default=0.0))
        parted[nicks] = period
        if nicks:
            begun = next(i for i, each in enumerate(depths[nicks]) if each > 0.0)
            assert min(forces[begun:-1]) < 0.95 * forces[begun]
            assert forces[-1] == 0.0
    assert max(depths[True]) < DEEPEST
    assert max(depths[False]) == 0.0
    assert parted[True] > parted[False]
