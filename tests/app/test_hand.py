"""The hand: it sets the displacement, the beam answers with the force."""

import math
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from simulated import phantom, pull, pull_session, settle, tear

from app.simulation import TICK_SECONDS, Clock, Grasper, Phase, Session, preset_named, presets
from app.simulation.inputs.grasper import HAND_SPEED
from app.trainer.panel.compare_tab import OFFERED_THEORIES
from physics import Cubic, Exact


@pytest.fixture
def session() -> Session:
    return pull_session(phantom(), vertices=300)


def lead(session: Session, deflection: float) -> None:
    session.lift(deflection)
    settle(session)


@pytest.mark.parametrize("label", list(OFFERED_THEORIES))
def test_the_hand_and_the_slider_come_to_the_same_states(label: str) -> None:
    slid, led = pull_session(phantom(), vertices=300), pull_session(phantom(), vertices=300)
    for each in (slid, led):
        each.choose_theory(OFFERED_THEORIES[label])
    slid.set_grasp(20.0)
    led.grab(0, 20.0)
    for force in (0.4, 1.1):
        pull(slid, force)
        lead(led, slid.reading().deflection)
        by_force, by_hand = slid.reading(), led.reading()
        assert by_hand.deflection == pytest.approx(by_force.deflection, rel=1e-9)
        assert by_hand.force == pytest.approx(by_force.force, rel=1e-6)
        assert by_hand.check.total_stress == pytest.approx(by_force.check.total_stress, rel=1e-6)
        assert by_hand.check.station == by_force.check.station
        assert by_hand.hook == pytest.approx(by_force.hook, abs=1e-6)
        assert by_hand.breaks_at == by_force.breaks_at
        assert (by_hand.by_hand, by_force.by_hand) == (True, False)


def test_the_beam_answers_with_the_theory_s_force(session: Session) -> None:
    session.choose_theory(Exact())
    session.grab(0, 18.0)
    lead(session, 5.0)
    reading = session.reading()
    assert reading.deflection == 5.0
    assert reading.force == pytest.approx(
        Exact().pull(session.tissue.dissection.beam, 18.0).to_deflection(5.0).force
    )
    assert session.planar.grasper.slider_force == reading.force
    rest = session.tissue.dissection.axis_point(18.0) - session.tissue.dissection.axis_point(0.0)
    assert reading.hook[2] == pytest.approx(5.0 + rest @ session.tissue.dissection.frame[:, 2])


def test_a_hook_pulls_and_does_not_push(session: Session) -> None:
    session.grab(0, 25.4)
    session.lift(4.0)
    settle(session)
    assert session.reading().deflection == 4.0
    session.lift(-9.0)
    settle(session)
    assert session.reading().deflection == 0.0


def test_the_hand_never_outruns_its_speed_and_arrives_without_a_jolt(session: Session) -> None:
    session.set_threshold(session.planar.threshold_range[1])
    session.grab(0, 25.4)
    session.lift(12.0)
    distances = [0.0]
    while session.advance():
        distances.append(session.reading().deflection)
    speeds = np.diff(distances) / TICK_SECONDS
    assert speeds.max() <= HAND_SPEED * (1.0 + 1e-9)
    assert speeds.max() > 0.9 * HAND_SPEED
    assert speeds.min() > -1e-9  # it does not overshoot
    assert distances[-1] == 12.0
    assert len(distances) < 30  # within a second


def test_a_drag_sent_twenty_times_a_second_moves_evenly_at_thirty() -> None:
    """A hand at 20 mm/s in steps of 50 ms: unfiltered, 0 or 1 mm from tick to tick."""
    grasper = Grasper()
    grasper.grab(0.0)
    moves = []
    for tick in range(90):
        grasper.move_hand(20.0 * 0.05 * math.floor(tick * TICK_SECONDS / 0.05 + 1e-9))
        before = grasper.deflection
        grasper.advance(1.0)
        moves.append(grasper.deflection - before)
    steady = np.array(moves[30:])
    assert steady.mean() == pytest.approx(20.0 * TICK_SECONDS, rel=0.02)
    assert np.ptp(steady) < 0.35 * steady.mean()


def test_the_follower_is_a_critically_damped_spring_in_closed_form() -> None:
    grasper = Grasper()
    grasper.grab(0.0)
    grasper.move_hand(1.0)  # slow enough for the speed never to be limited
    for tick in range(1, 10):
        grasper.advance(1.0)
        t = 30.0 * tick * TICK_SECONDS
        assert grasper.deflection == pytest.approx(1.0 - (1.0 + t) * math.exp(-t), rel=1e-12)


def test_let_go_it_springs_back_quickly_and_damped(session: Session) -> None:
    session.grab(0, 25.4)
    lead(session, 8.0)
    session.release()
    swing = []
    while session.advance():
        reading = session.reading()
        assert reading.force == 0.0
        assert not reading.held
        swing.append(reading.deflection)
    assert len(swing) < 25
    assert swing[-1] == 0.0
    assert -0.25 * 8.0 < min(swing) < -0.05 * 8.0  # once past rest, by exp(-pi z/sqrt(1 - z^2))
    assert (
        session.drawn.surfaces[0].vertices.tobytes()
        == session.drawn.surfaces[0].skin.vertices.tobytes()
    )
    # x = x0 exp(-z w t) (cos + z/sqrt(1 - z^2) sin), to the last digit, tick by tick
    z, w = 0.5, 30.0
    fast = w * math.sqrt(1.0 - z * z)
    for tick, found in enumerate(swing[:8], start=1):
        t = tick * TICK_SECONDS
        shape = math.cos(fast * t) + z * w / fast * math.sin(fast * t)
        assert found == pytest.approx(8.0 * math.exp(-z * w * t) * shape, rel=1e-9)


def test_what_holds_may_change_without_the_duct_moving(session: Session) -> None:
    pull(session, 2.0)
    slid = session.reading()
    session.grab(0, session.planar.grasp)
    settle(session)
    assert session.reading().deflection == slid.deflection
    assert session.reading().force == pytest.approx(2.0, rel=1e-9)
    lead(session, 6.0)
    force = session.reading().force
    session.set_target_force(force)
    settle(session)
    assert session.reading().deflection == pytest.approx(6.0, rel=1e-9)
    session.release()
    session.advance()
    session.advance()
    caught = session.reading().deflection
    session.grab(0, session.planar.grasp)
    settle(session)
    assert session.reading().deflection == max(caught, 0.0)


def test_another_grasp_takes_the_duct_by_hand_as_it_is_there(session: Session) -> None:
    session.grab(0, 25.4)
    lead(session, 8.0)
    session.set_grasp(8.0)
    settle(session)
    reading = session.reading()
    assert reading.phase is Phase.INTACT
    assert 0.0 < reading.deflection < 4.0


def test_what_nobody_holds_tears_nowhere(session: Session) -> None:
    session.grab(0, 25.4)
    lead(session, 12.0)
    session.release()
    session.advance(2)
    session.set_grasp(6.0)
    session.set_threshold(session.planar.threshold_range[0])
    settle(session)
    assert session.reading().deflection == 0.0
    assert session.reading().phase is Phase.INTACT


def test_a_duct_caught_past_rest_is_pulled_and_not_pushed(session: Session) -> None:
    session.grab(0, 25.4)
    lead(session, 8.0)
    session.release()
    while session.reading().deflection >= 0.0:
        session.advance()
    session.set_target_force(0.5)
    assert session.reading().force == 0.0
    session.advance()
    assert 0.0 < session.reading().force <= 0.5
    assert session.reading().deflection > 0.0


def test_a_grab_takes_the_duct_as_far_out_as_it_is_there(session: Session) -> None:
    pull(session, 2.0)
    across = np.interp(
        15.0,
        session.tissue.dissection.beam_stations,
        Cubic()
        .pull(session.tissue.dissection.beam, 25.4)
        .to_force(2.0)
        .sample(session.tissue.dissection.beam_stations)
        .across,
    )
    taken = session.grab(0, 15.0)
    assert taken is not None
    assert taken[2] == pytest.approx(across, rel=1e-9)
    settle(session)
    assert session.reading().deflection == taken[2]
    assert session.planar.grasp == 15.0
    assert session.grab(0, math.nan) is None


@pytest.mark.parametrize("name", list(presets()))
def test_a_hand_tears_every_duct_at_the_deflection_between_two_ticks(name: str) -> None:
    session = pull_session(phantom(), preset_named(name), vertices=300)
    event = session.reading().breaks_at
    assert event is not None
    session.grab(0, session.planar.grasp)
    lead(session, session.planar.deflection_limit)
    reading = session.reading()
    assert reading.phase is Phase.TORN
    assert reading.breaks_at is not None
    assert reading.breaks_at.deflection == event.deflection
    assert reading.breaks_at.force == pytest.approx(event.force, rel=1e-9)
    assert reading.breaks_at.check.station == event.check.station


def test_a_torn_duct_takes_no_hand(session: Session) -> None:
    tear(session)
    before = session.reading()
    session.grab(0, 20.0)
    session.lift(5.0)
    session.release()
    settle(session)
    assert session.reading() == before


def test_a_hand_that_holds_nothing_moves_nothing(session: Session) -> None:
    session.lift(5.0)
    session.release()
    settle(session)
    assert session.reading().deflection == 0.0
    assert session.run.seconds == 0.0


@given(st.floats(allow_nan=True, allow_infinity=True), st.sampled_from(["grab", "lift"]))
@settings(deadline=None, max_examples=30)
def test_any_number_for_the_hand_is_clamped_or_ignored(value: float, name: str) -> None:
    session = pull_session(phantom(), vertices=300)
    session.grab(0, 20.0)
    take = partial(session.grab, 0)
    {"grab": take, "lift": session.lift}[name](value)
    settle(session)
    low, high = session.planar.grasp_range
    assert low <= session.planar.grasp <= high
    reading = session.reading()
    assert math.isfinite(reading.force)
    assert 0.0 <= reading.deflection <= session.planar.deflection_limit


INPUTS = st.lists(
    st.tuples(
        st.sampled_from(
            [
                "set_target_force",
                "grab",
                "lift",
                "release",
                "set_grasp",
                "set_threshold",
                "reset",
            ]
        ),
        st.floats(0.0, 1.0),
        st.integers(0, 6),
    ),
    max_size=25,
)


@pytest.mark.slow
@given(INPUTS)
@settings(deadline=None, max_examples=40)
def test_whatever_is_done_figures_stay_numbers_and_a_duct_tears_once(
    inputs: list[tuple[str, float, int]],
) -> None:
    session = pull_session(phantom(), vertices=300)
    most = 4.0 * session.planar.force_limit  # a hand may pull harder than the slider
    torn = False
    for name, inputs_, ticks in inputs:
        scale = {
            "set_target_force": session.planar.force_limit,
            "grab": session.tissue.dissection.beam.span,
            "lift": session.planar.deflection_limit,
            "set_grasp": session.tissue.dissection.beam.span,
            "set_threshold": session.planar.threshold_range[1],
        }
        if name == "grab":
            session.grab(0, inputs_ * scale[name])
        elif name in scale:
            getattr(session, name)(inputs_ * scale[name])
        else:
            getattr(session, name)()
        torn = torn and name != "reset"
        for _ in range(ticks):
            shape = session.drawn.shape
            session.advance()
            reading = session.reading()
            assert all(map(math.isfinite, (reading.force, reading.deflection, *reading.hook)))
            assert 0.0 <= reading.force <= most
            if reading.phase is Phase.INTACT:
                assert not torn
                assert not (reading.held and reading.check.broken)
            elif not torn:
                torn = True
                assert session.drawn.shape == shape + 1
                assert session.metrics()["tear"] is not None
            else:
                assert session.drawn.shape == shape
    vertices = [surface.vertices for surface in session.drawn.surfaces]
    assert all(np.isfinite(each).all() for each in vertices)
    measures = session.metrics()
    assert measures["maximum_force_N"] <= most
    assert measures["time_over_threshold_s"] <= measures["time_in_tissue_s"] <= measures["time_s"]


def test_idle_ticks_solve_nothing(session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    session.grab(0, 25.4)
    lead(session, 5.0)

    def solve(*_: object) -> None:
        raise AssertionError("an idle tick solves")

    monkeypatch.setattr("app.simulation.specimen.grasped_beam.GraspedBeam.solve", solve)
    for _ in range(100):
        assert not session.advance()


def test_uneven_real_time_comes_to_even_ticks() -> None:
    clock, random = Clock(), np.random.default_rng(5)
    jitter = (random.random(3000) - 0.5) * 0.9 * TICK_SECONDS
    times = TICK_SECONDS * np.arange(1, 3001) + jitter
    ticks = [clock.ticks(float(passed)) for passed in np.diff(times, prepend=0.0)]
    assert set(ticks) == {1}
    assert sum(clock.ticks(0.0123) for _ in range(1000)) == pytest.approx(30 * 12.3, abs=1)
    assert clock.ticks(1e6) == 30
    assert clock.ticks(-1.0) == 0


def test_the_same_inputs_at_the_same_ticks_are_the_same_whatever_the_steps() -> None:
    readings = []
    for most in (1, 2, 7):
        session = pull_session(phantom(), vertices=300)
        session.grab(0, 22.0)
        session.lift(7.0)
        for done in range(0, 42, most):
            session.advance(min(most, 42 - done))
        readings.append((session.reading(), session.metrics()))
    assert readings[0] == readings[1] == readings[2]
