"""What is set beside the duct: another theory's ghost, and the chain of masses and springs."""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
import pytest
from simulated import phantom, pull, pull_session, settle, tear

from app.simulation import TICK_SECONDS, Load, Session, SwingingChain, preset_named, presets
from app.simulation.specimen.comparison import SWINGS_PER_SECOND
from physics import (
    Beam,
    Cubic,
    Exact,
    MassSpring,
    NoEquilibrium,
    TautString,
)
from physics.cubic import CubicPull


@pytest.fixture
def session() -> Session:
    return pull_session(phantom(), vertices=600)


def test_a_ghost_bears_the_same_force_and_says_by_how_much_it_differs(session: Session) -> None:
    session.choose_ghost(Exact())
    session.set_grasp(20.0)
    pull(session, 1.5)
    own, ghost = session.reading(), session.ghost_reading()
    assert ghost is not None
    beam = session.tissue.dissection.beam
    exact = Exact().pull(beam, 20.0).to_force(1.5).deflection
    assert ghost.force == pytest.approx(1.5, rel=1e-9)
    assert ghost.force_difference == pytest.approx(0.0, abs=1e-9)
    assert ghost.deflection == pytest.approx(exact, rel=1e-9)
    assert ghost.deflection_difference == pytest.approx(exact - own.deflection, rel=1e-9)
    threshold = session.tissue.dissection.preset.threshold(Exact(), beam)
    assert ghost.check.threshold == pytest.approx(threshold)


def test_a_ghost_in_hand_has_the_same_deflection_and_another_force(session: Session) -> None:
    session.choose_ghost(TautString())
    session.grab(0, 25.4)
    session.lift(6.0)
    settle(session)
    ghost = session.ghost_reading()
    assert ghost is not None
    beam = session.tissue.dissection.beam
    string = TautString().pull(beam, 25.4).to_deflection(6.0).force
    assert ghost.deflection == 6.0
    assert ghost.force == pytest.approx(string)
    assert ghost.force_difference == pytest.approx(
        string - Cubic().pull(beam, 25.4).to_deflection(6.0).force
    )


@dataclass(frozen=True)
class Ending(Cubic):
    """The cubic beam of a law that ends at 13 mm; the duct breaks at 12.8 mm."""

    def pull(self, beam: Beam, grasp: float) -> CubicPull:
        return EndingPull(self, beam, grasp)


class EndingPull(CubicPull):
    def to_deflection(self, deflection: float) -> Self:
        if deflection > 13.0:
            raise NoEquilibrium("this law ends at 13 mm")
        return super().to_deflection(deflection)


def test_a_ghost_whose_theory_ends_says_nothing_and_comes_back(session: Session) -> None:
    session.set_threshold(session.planar.threshold_range[1])
    session.choose_ghost(Ending())
    session.grab(0, 25.4)
    session.lift(14.0)
    settle(session)
    assert session.reading().deflection == 14.0
    assert session.ghost_reading() is None
    session.lift(12.0)
    settle(session)
    ghost = session.ghost_reading()
    assert ghost is not None
    assert ghost.deflection == 12.0


def test_a_ghost_of_the_same_theory_lies_on_the_duct_to_the_bit(session: Session) -> None:
    session.choose_ghost(Cubic())
    pull(session, 2.0)
    assert session.ghost is not None
    drawn = session.ghost.surface
    assert drawn.vertices.tobytes() == session.drawn.surfaces[0].vertices.tobytes()
    assert drawn.name == "ghost"
    axis, driving = session.ghost.axis, session.tissue.dissection.driving
    assert np.abs((axis - driving.positions) @ session.tissue.dissection.frame[:, 1]).max() < 1e-12
    middle = int(np.argmin(np.abs(session.tissue.dissection.beam_stations - 25.4)))
    lifted = (axis - driving.positions)[middle] @ session.tissue.dissection.frame[:, 2]
    assert lifted == pytest.approx(session.reading().deflection, rel=1e-3)


def test_a_ghost_changes_nothing_of_the_run_it_haunts() -> None:
    found = []
    for theory in (None, Exact()):
        session = pull_session(phantom(), vertices=300)
        session.choose_ghost(theory)
        session.grab(0, 20.0)
        session.lift(7.0)
        session.advance(40)
        found.append((session.reading(), session.metrics()))
    assert found[0] == found[1]


def test_a_ghost_goes_with_the_tear_and_follows_to_another_duct(session: Session) -> None:
    session.choose_ghost(Exact())
    tear(session)
    assert session.ghost is None
    assert session.ghost_reading() is None
    session.reset()
    session.choose_preset("thesis-thin-rubber")
    pull(session, 1.0)
    ghost = session.ghost_reading()
    assert ghost is not None
    exact = Exact().pull(session.tissue.dissection.beam, 25.4).to_force(1.0).deflection
    assert ghost.deflection == pytest.approx(exact, rel=1e-9)
    session.choose_ghost(None)
    assert session.ghost is None


@pytest.mark.parametrize("name", list(presets()))
def test_the_chain_swings_and_settles_where_the_theory_of_the_chain_does(name: str) -> None:
    session = pull_session(phantom(), preset_named(name), vertices=300)
    session.show_chain(True)
    event = session.reading().breaks_at
    assert event is not None
    session.set_target_force(0.5 * event.force)
    deflections, ticks = [0.0], 0
    assert session.chain is not None
    stable = session.chain._chain.largest_stable_step
    assert TICK_SECONDS / stable < 360  # steps in a tick, a few microseconds each
    while session.advance():
        deflections.append(session.chain.deflection)
        ticks += 1
        assert ticks < 900
    rest = deflections[-1]
    settled = (
        MassSpring(nodes=21)
        .pull(session.tissue.dissection.beam, 0.5 * session.tissue.dissection.beam.span)
        .to_force(0.5 * event.force)
        .deflection
    )
    assert rest == pytest.approx(settled, rel=5e-3)
    assert max(deflections) > 1.01 * rest  # it overshoots, as the duct does not
    places = session.chain.places
    assert places.shape == (21, 3)
    assert np.all(places[:, 1] == 0.0)
    assert places[0] == pytest.approx(0.0)
    assert places[-1] == pytest.approx([session.tissue.dissection.beam.span, 0.0, 0.0])
    assert places[:, 2].max() == pytest.approx(rest, rel=1e-9)


def test_a_small_swing_has_the_period_that_it_is_slowed_to(session: Session) -> None:
    chain = SwingingChain(session.tissue.dissection.beam, 25.4)
    assert chain.slowed > 10.0
    chain.start_from(0.02)
    deflections = []
    while chain.advance(Load("force", 0.0)):
        deflections.append(chain.deflection)
    crossings = np.flatnonzero(np.diff(np.sign(deflections)) != 0)
    half = float(np.diff(crossings[:2])[0]) / 30.0
    assert half == pytest.approx(0.5 / SWINGS_PER_SECOND, abs=1.5 / 30.0)
    assert abs(deflections[-1]) < 0.2 * 0.02


def test_the_chain_is_led_by_a_hand_and_set_anew_for_another_grasp(session: Session) -> None:
    session.show_chain(True)
    session.grab(0, 15.0)
    session.lift(4.0)
    settle(session)
    assert session.chain is not None
    assert session.chain.grasp == 15.0
    assert session.chain.deflection == pytest.approx(4.0)
    settled = (
        MassSpring(nodes=21).pull(session.tissue.dissection.beam, 15.0).to_deflection(4.0).force
    )
    assert session.chain.force == pytest.approx(settled, rel=0.02)
    session.release()
    settle(session)
    assert session.chain.deflection == pytest.approx(0.0, abs=0.02)
    assert not session.advance(10)
    tear(session)
    assert session.chain is None
    session.show_chain(False)
    session.reset()
    assert session.chain is None


def test_the_chain_never_runs_away(session: Session) -> None:
    session.show_chain(True)
    session.set_threshold(session.planar.threshold_range[1])
    random = np.random.default_rng(3)
    for _ in range(60):
        session.set_target_force(float(random.random()) * session.planar.force_limit)
        session.advance(int(random.integers(1, 6)))
        if session.chain is None:
            return
        assert np.isfinite(session.chain.places).all()
        assert math.fabs(session.chain.deflection) < session.tissue.dissection.beam.span
