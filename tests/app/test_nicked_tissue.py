"""Walls that tear in time: a duct of a preset and tubes of an anatomy, in a session and its run."""

import msgspec
import numpy as np
from msgspec.structs import replace
from simulated import bed_session, phantom

from app.anatomy import anatomy_named
from app.haptics.duct_choice import DuctChoice
from app.haptics.haptic_bed import HapticBed
from app.simulation import Replay, Specimen, bed_named, preset_named, run_json
from app.simulation.run_file import RunFile
from app.simulation.spatial_tissue import SpatialTissue
from physics import DEEPEST


def test_a_ureter_is_nicked_before_it_parts_and_so_in_its_replay() -> None:
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
    # An older run of the same preset has no such speed: its duct is through at once.
    start = replace(again.log.start, tear_mm_per_s=None)
    old = Replay(replace(again.log, start=start), organ)
    old.seek_tick(run.log.ticks)
    assert [event.kind for event in old.session.spatial.events] == ["tear"]


def test_a_nicked_artery_bleeds_before_it_parts() -> None:
    whole = anatomy_named("normal")
    tubes = [
        replace(each, tear_mm_per_s=5.0, strength_MPa=0.02 * each.strength_MPa)
        if each.name == "artery"
        else each
        for each in whole.tube
    ]
    tissue = SpatialTissue(Specimen.of_anatomy(replace(whole, name="frail", tube=tubes)))
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
