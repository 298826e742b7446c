"""A duct in its bed under two hands: what the trainer's dissection steps."""

import numpy as np
import pytest
from simulated import bed_session

from app.simulation import (
    Exercise,
    FreeLength,
    Opening,
    Replay,
    RoundBeam,
    Session,
    Specimen,
    preset_named,
    presets,
)
from assets import BILE_DUCT
from organ_geometry import read_organ
from physics.bed import BeamOnBed

UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture
def session() -> Session:
    """A session on the shipped duct in a normal bed."""
    return bed_session(read_organ(BILE_DUCT))


def lift(session: Session, height: float, *, hand: int = 0, seconds: float = 1.0) -> None:
    """Lift a hand that holds the duct, mm, at an even speed, and wait."""
    start, ticks = session.spatial.hands[hand].place.copy(), round(30 * seconds)
    for tick in range(1, ticks + 1):
        session.move_hand(hand, start + height * tick / ticks * UP)
        session.advance()
    for _ in range(30):
        session.advance()


def test_at_rest_the_skin_is_where_it_was_drawn(session: Session) -> None:
    """To the bit: the transforms of a beam at rest are zero."""
    session.grab(0, 20.0)
    session.release(0)
    session.advance()
    assert np.array_equal(session.drawn.surfaces[0].vertices, session.drawn.skin.vertices)


def test_no_instrument_turns_into_the_duct(session: Session) -> None:
    """With its tip beside the duct a shaft that would go through it stays; others turn at once."""
    session.choose_instrument(1, "dissector")
    radius = session.spatial.radius
    session.spatial.put_hand(1, np.array([25.4, -radius - 2.0, 0.0]))
    session.aim(1, [0.0, -1.0, 0.2])
    before = session.spatial.hands[1].aim
    for through in ([0.0, 1.0, 0.0], [0.3, 0.9, 0.1]):
        session.aim(1, through)
        assert session.spatial.hands[1].aim == before
    session.aim(1, [0.0, 0.1, 1.0])
    assert session.spatial.hands[1].aim == pytest.approx([0.0, 0.0995, 0.995], abs=1e-3)
    session.advance()
    assert session.spatial.beam.energy.rod_work < 1.0


def test_a_lift_parts_strands_about_the_hook_and_the_skin_follows(session: Session) -> None:
    """The skin at the hook is lifted as the hook is, and the clamps stay."""
    session.grab(0, 25.4)
    lift(session, 10.0)
    reading, drawn, dissection = session.reading(), session.drawn, session.tissue.dissection
    assert reading.forces[0][2] == pytest.approx(2.2, abs=0.5)
    assert 200 < reading.broken < 500
    assert 0.5 < reading.stress_ratio < 1.0
    assert reading.freed == pytest.approx(50.8 * reading.broken / reading.strands, rel=0.05)
    assert session.spatial.freed_at(np.array([25.4]))[0] > 0.9
    assert session.spatial.freed_at(np.array([1.0]))[0] < 0.1
    moved = (drawn.surfaces[0].vertices - drawn.skin.vertices) @ dissection.frame
    places = drawn.skin.stations - dissection.clamps[0]
    middle = np.abs(places - 25.4) < 0.5
    assert moved[middle].mean(axis=0) == pytest.approx([0.0, 0.0, 10.0], abs=0.3)
    assert np.abs(moved[places <= 0.0]).max() < 1e-6
    assert np.abs(moved[places >= 50.8]).max() < 1e-6


def test_only_a_dissector_opens(session: Session) -> None:
    """A hook that is told to open sees no farther along the duct than one that is not."""
    session.grab(0, 25.0)
    session.open_jaws(0, 40.0)
    lift(session, 8.0, seconds=3.0)
    assert session.spatial.hands[0].opening == session.spatial.hands[0].target_opening == 0.0
    log = session.run_file().log
    assert {each.kind for each in log.inputs} == {"grab", "move"}
    assert session.metrics()["strands_broken_out_of_sight"] > 0


def test_a_run_begins_with_the_hands_where_they_are(session: Session) -> None:
    """The other hand neither jumps nor forgets where it goes; a replay begins there too."""
    session.move_hand(1, np.array([30.0, 5.0, 20.0]))
    for _ in range(90):
        session.advance()
    session.move_hand(1, np.array([34.0, 5.0, 20.0]))
    session.advance()
    on_its_path = session.spatial.hands[1].place.copy()
    assert 30.0 < on_its_path[0] < 34.0
    session.grab(0, 20.0)
    assert session.spatial.hands[1].place.tolist() == on_its_path.tolist()
    lift(session, 3.0)
    assert session.spatial.hands[1].place.tolist() == [34.0, 5.0, 20.0]
    run = session.run_file()
    replay = Replay(run.log, read_organ(BILE_DUCT))
    assert replay.series()["hand_2_x_mm"][0] != 34.0
    assert replay.run_file() == run
    replay.seek_tick(run.log.ticks)
    places = replay.session.spatial.beam.places
    assert places.tobytes() == session.spatial.beam.places.tobytes()


def test_the_same_inputs_give_the_same_bits(session: Session) -> None:
    """Whatever was done to the session before its reset."""
    runs: list[bytes] = []
    for _ in range(2):
        session.grab(0, 20.0)
        lift(session, 6.0)
        session.grab(1, 35.0)
        lift(session, 4.0, hand=1)
        runs.append(session.spatial.beam.places.tobytes())
        session.reset()
    assert runs[0] == runs[1]


def test_a_grasper_stays_where_it_is_left_and_holds(session: Session) -> None:
    """The second hand's force goes on while the first works; the energies balance."""
    session.grab(1, 32.0)
    lift(session, 3.0, hand=1)
    session.grab(0, 20.0)
    lift(session, 3.0)
    reading = session.reading()
    assert reading.holding == (True, True)
    assert session.spatial.hands[1].place[2] == pytest.approx(3.0)
    assert min(z for _, _, z in reading.forces) > 0.1


def test_a_dissector_behind_the_duct_frees_it_at_a_small_part_of_its_strength(
    session: Session,
) -> None:
    """Closed jaws pass under the duct and part nothing; opening them frees as much as they open."""
    session.choose_instrument(1, "dissector")
    jaws = session.spatial.hands[1]
    session.move_hand(1, jaws.place * (1.0, 0.0, 1.0) + (0.0, 9.0, 0.0))
    for _ in range(60):
        session.advance()
    assert session.reading().broken == 0
    for tick in range(90):
        session.open_jaws(1, 20.0 * tick / 89)
        session.advance()
    reading = session.reading()
    assert reading.freed == pytest.approx(12.0, abs=4.0)
    assert reading.peak_stress_ratio < 0.1


def test_a_pull_too_far_tears_the_duct_into_two_pieces_that_hang_on_their_strands(
    session: Session,
) -> None:
    """Each follows its side of the tear and falls back; energy balances; a reset makes it whole."""
    session.grab(0, 25.4)
    lift(session, 18.0, seconds=2.0)
    reading, duct = session.reading(), session.spatial
    assert reading.torn_at is not None
    assert reading.peak_stress_ratio > 1.0
    assert reading.stress_ratio < 0.2
    assert reading.holding == (False, False)
    assert session.grab(1, 10.0) is None
    first, second = (
        (each.vertices - each.skin.vertices) @ duct.dissection.frame
        for each in session.drawn.surfaces
    )
    assert np.isfinite(first).all()
    assert np.isfinite(second).all()
    assert max(first[:, 2].max(), second[:, 2].max()) < 6.0  # from 14 mm
    energy = reading.energy
    explained = energy.stored + energy.dissipated + energy.snap + energy.drag
    explained += energy.lag + energy.residual
    assert energy.work == pytest.approx(explained, rel=1e-6)
    assert session.run.going
    duct.beam.detach(np.ones(duct.beam.strands.count, np.bool_))
    session.move_hand(0, np.zeros(3))
    session.advance()
    assert session.run.over, "nothing is left whole"
    session.reset()
    assert session.reading().torn_at is None
    assert np.array_equal(session.drawn.surfaces[0].vertices, session.drawn.skin.vertices)


def test_inputs_that_make_no_sense_change_nothing(session: Session) -> None:
    """Numbers from a browser: not finite, behind a clamp, with an instrument that cannot hold."""
    assert session.grab(0, float("nan")) is None
    assert session.grab(0, 0.0) is None
    session.move_hand(0, np.array([np.nan, 0.0, 0.0]))
    session.open_jaws(1, float("inf"))
    session.choose_instrument(1, "swab")
    assert session.grab(1, 20.0) is None
    assert session.grab(0, 20.0) is not None
    session.choose_instrument(1, "grasper")
    assert session.grab(1, 20.0) is None
    session.move_hand(0, np.full(3, 1e9))
    assert np.abs(session.spatial.hands[0].target).max() <= 120.0


def test_strands_are_drawn_from_the_surface_with_their_own_lengths(session: Session) -> None:
    """On a round bar through a curved organ, whose axis the beam's is not."""
    duct = session.spatial
    organ, frame = duct.dissection.organ, duct.dissection.frame
    stations, ends, feet = duct.surface.strands_at_rest()
    strands = duct.beam.strands
    assert feet - ends == pytest.approx((strands.feet - strands.ends) @ frame.T, abs=1e-9)
    out = ends - organ.axis_at(stations)
    assert np.sqrt((out**2).sum(axis=1)) == pytest.approx(organ.mean_radius, rel=0.1)
    wanted = strands.ends - np.stack([strands.stations, *np.zeros((2, strands.count))], axis=1)
    drawn = (out @ frame) / np.sqrt((out**2).sum(axis=1))[:, None]
    wanted /= np.sqrt((wanted**2).sum(axis=1))[:, None]
    assert (drawn * wanted).sum(axis=1).min() > np.cos(np.radians(15.0))


def test_the_skin_bears_the_stress_of_bending_up_and_across(session: Session) -> None:
    """Its highest is that of the beam's wall, on the side and at the place that the beam names."""
    session.grab(0, 25.4)
    start = session.spatial.hands[0].place.copy()
    for tick in range(1, 61):
        session.move_hand(0, start + np.array([0.0, 3.0, 6.0]) * min(1.0, tick / 40))
        session.advance()
    drawn, duct = session.drawn, session.spatial
    stress = session.stress(np.empty(len(drawn.skin.vertices), np.float32))
    worst = duct.beam.worst_stress()
    assert stress.max() == pytest.approx(worst.total, rel=0.05)
    highest = int(np.argmax(stress))
    places = drawn.skin.stations - duct.dissection.clamps[0]
    assert places[highest] == pytest.approx(worst.station, abs=1.5)
    out = drawn.skin.vertices[highest] - duct.dissection.organ.axis_at(
        drawn.skin.stations[highest : highest + 1]
    )
    _, across, up = (out @ duct.dissection.frame)[0]
    assert np.cos(np.arctan2(across, up) - worst.side) > 0.9
    assert abs(np.sin(worst.side)) > 0.2  # else this would say nothing of bending across


def test_a_divided_duct_is_lifted_off_its_bed_by_its_free_end(session: Session) -> None:
    """Its end follows the hook, turned up, for less than the same way takes between clamps."""
    duct = session.spatial
    fractions: list[float] = []
    goal = FreeLength(9.0, 0.0, 44.7)
    for divided in (False, True):
        opening = Opening("normal", 1, (44.7, 50.8), divided=divided)
        duct.prepare(Exercise("front", "Follow the front", goal, opening=opening))
        assert (duct.grab(0, 50.8) is not None) == divided, "a clamp cannot be held"
        start = duct.grab(0, 45.0)
        assert start is not None
        for tick in range(1, 61):
            duct.move_hand(0, start + tick / 10.0 * UP)
            duct.advance()
        fractions.append(duct.reading().peak_stress_ratio)
        moved = duct.beam.places - duct.beam.rest_places
        assert np.abs(moved[0]).max() == 0.0
        assert moved[-1, 2] == pytest.approx(8.0 if divided else 0.0, abs=2.0 * divided)
    assert fractions[1] < 0.5 * fractions[0]
    assert duct.freed_stretches()[-1][1] == pytest.approx(50.8)


@pytest.mark.parametrize("name", [each for each in presets() if "rubber" not in each])
@pytest.mark.parametrize("count", [8, pytest.param(100, marks=pytest.mark.long)])
def test_a_hook_tears_every_preset_s_duct_wherever_it_pulls(name: str, count: int) -> None:
    """Before the duct is twice as long, its distance to break only falling."""
    preset, rng = preset_named(name), np.random.default_rng(5)
    organ = None if isinstance(preset.beam, RoundBeam) else read_organ(BILE_DUCT)
    specimen = Specimen.of_sections(preset, organ)
    rest = specimen.space_beam(elements=40)
    for _ in range(count):
        direction = rng.normal(size=3)
        held = BeamOnBed(rest)
        node = held.take(rest.span * rng.uniform(0.2, 0.8))
        start, ends = held.places[node].copy(), held.places[[0, -1]]
        direction /= np.sqrt(direction @ direction)
        sides = before = np.sqrt(((ends - start) ** 2).sum(axis=1))
        fraction = seen = 0.0
        for tick in range(1, 4000):
            held.lead(node, start + direction * (tick * rest.span / 400.0))
            held.tick(1e-3)
            fraction = held.worst_stress().total / specimen.threshold
            sides = np.sqrt(((ends - held.places[node]) ** 2).sum(axis=1))
            if fraction >= 1.0:
                break
            if np.all(sides >= before):  # a side that is squeezed may buckle
                assert fraction >= seen - 2e-3
                seen = max(seen, fraction)
        assert fraction >= 1.0
        assert sides.sum() < 2.0 * rest.span
