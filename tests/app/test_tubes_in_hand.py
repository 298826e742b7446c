"""Several tubes under two hands in one session: tears, flows, replays to the bit."""

from functools import cache

import numpy as np
import pytest

from app.anatomy import anatomy_named, drawn_anatomy, shipped_anatomies
from app.simulation import (
    TICK_SECONDS,
    Replay,
    RunFileError,
    Session,
    Specimen,
    read_run,
    run_json,
)
from app.simulation.tissue.spatial_tissue import SpatialTissue

NORMAL = "normal"


def session(name: str = NORMAL) -> Session:
    """Return a session at a shipped anatomy."""
    return Session(Specimen.of_anatomy(anatomy_named(name)), vertices=300)


def draw(at: Session, hand: int, direction: np.ndarray, seconds: float) -> None:
    """Lead a hand along a way, mm, at one speed."""
    first, ticks = at.spatial.hands[hand].place.copy(), round(seconds / TICK_SECONDS)
    for tick in range(ticks):
        at.move_hand(hand, first + direction * (tick + 1) / ticks)
        at.advance()


@cache
def torn_artery() -> Session:
    """Return a session in which the cystic artery was pulled until it tore, and bled for 2 s."""
    at = session()
    tube = at.spatial.tubes.names.index("artery")
    assert at.grab(0, 10.0, tube) is not None
    for _ in range(40):
        draw(at, 0, np.array([0.0, 0.0, 1.0]), 0.1)
        if at.spatial.events:
            break
    at.advance(60)
    return at


@pytest.mark.parametrize("name", shipped_anatomies())
def test_an_anatomy_stands_still_at_rest(name: str) -> None:
    """Nothing moves, tears, parts or leaks where no hand acts."""
    at = session(name)
    rest = at.spatial.beam.rest_places.copy()
    at.advance(30)
    assert np.abs(at.spatial.beam.places - rest).max() < 1e-9
    assert at.spatial.events == []
    assert at.reading().broken == 0
    assert at.reading().stress_ratio < 1e-6


def test_a_tear_is_an_event_that_ends_no_session() -> None:
    """The artery tears by the hand that pulls it, bleeds, and the rest goes on."""
    at = torn_artery()
    tear, bleeding = at.spatial.events[:2]
    assert (tear.kind, tear.tube, tear.hand) == ("tear", "artery", 0)
    assert (bleeding.kind, bleeding.tube, bleeding.tick) == ("bleeding", "artery", tear.tick)
    assert at.spatial.torn is at.spatial.tear_of(at.spatial.tubes.names.index("artery"))
    assert not at.run.over
    assert at.spatial.hands[0].node is None  # slipped off
    assert at.grab(0, 8.0, at.spatial.tubes.names.index("gallbladder")) is not None


def test_what_is_lost_and_left_is_what_there_was() -> None:
    """Volumes balance, and blood flows at the rate that the reading gives."""
    at = torn_artery()
    blood, bile = at.reading().fluids
    assert blood.lost_ml > 1.0
    assert blood.lost_ml + blood.left_ml == pytest.approx(5000.0, rel=1e-12)
    assert (bile.lost_ml, bile.rate_ml_s) == (0.0, 0.0)
    at.advance(30)
    after = at.reading().fluids[0]
    assert after.lost_ml - blood.lost_ml == pytest.approx(blood.rate_ml_s, rel=1e-2)


def test_a_run_is_replayed_to_the_bit() -> None:
    """Inputs at several tubes give the same file again, from its JSON and no organ of its own."""
    at = torn_artery()
    run = at.run_file()
    assert run.log.start.anatomy == NORMAL
    read = read_run(run_json(run))
    replay = Replay(read.log, at.specimen.organ)  # pyright: ignore[reportArgumentType]
    replay.seek_tick(read.log.ticks)
    assert run_json(replay.run_file()) == run_json(run)
    found, made = replay.session.spatial, at.spatial
    assert found.events == made.events
    assert (found.beam.places == made.beam.places).all()
    assert replay.session.reading().fluids == at.reading().fluids
    columns = replay.series().columns
    assert {"artery_stress_ratio", "artery_torn", "gallbladder_freed_mm", "blood_lost_ml"} <= {
        *columns
    }


def test_a_drawn_anatomy_is_kept_whole_in_its_run() -> None:
    """A case that does not ship stands in the run's file; broken, it is refused in one sentence."""
    made = drawn_anatomy(3)
    at = Session(Specimen.of_anatomy(made), vertices=300)
    assert at.grab(0, 6.0, 2) is not None
    at.advance(5)
    content = run_json(at.run_file())
    read = read_run(content)
    assert read.log.start.anatomy == made
    assert run_json(Replay(read.log, at.specimen.organ).run_file()) == content  # pyright: ignore[reportArgumentType]
    broken = content.replace(b'"wall_mm":1.0', b'"wall_mm":-1.0', 1)
    assert broken != content
    with pytest.raises(RunFileError, match="wall_mm"):
        Replay(read_run(broken).log, at.specimen.organ)  # pyright: ignore[reportArgumentType]


def test_a_tube_that_is_not_there_cannot_be_held() -> None:
    """An input of a page is ignored where it names no tube, and a file's is refused."""
    at = session()
    assert at.grab(0, 3.0, 5) is None
    assert at.grab(0, 3.0, -1) is None
    with pytest.raises(ValueError, match="has its own tissue"):
        at.choose_bed("firm")


@pytest.mark.parametrize(
    ("stress", "strengths", "torn"),
    [
        (0.5, (0.3,), False),
        (0.5, (0.3, 0.3), True),
        (0.75, (0.7,), False),  # by 0.32 at once
        (0.75, (0.7, 0.7), True),
        (0.5, (0.72, 0.47), True),  # by 0.2 and then by 0.37
    ],
)
def test_a_stress_that_leaps_tears_a_wall_if_the_next_tick_has_it_too(
    monkeypatch: pytest.MonkeyPatch, stress: float, strengths: tuple[float, ...], torn: bool
) -> None:
    """One Newton step a ms overshoots; here it is the strength that falls for so long."""
    at = session()
    tissue, tube = at.spatial, at.spatial.tubes.names.index("artery")
    assert at.grab(0, 10.0, tube) is not None
    while tissue.stress_ratio < stress:
        draw(at, 0, np.array([0.0, 0.0, 0.2]), 0.1)
    strong = tissue.strengths
    for part in (*strengths, 1.0):
        monkeypatch.setattr(SpatialTissue, "strengths", tuple(part * each for each in strong))
        tissue._arguments = None
        draw(at, 0, np.array([0.0, 0.0, 0.001]), TICK_SECONDS)
    assert bool(tissue.events) == torn
    assert (tissue.peak_stress_ratio < stress + 0.2) != torn
