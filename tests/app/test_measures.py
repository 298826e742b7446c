"""Measures: what is published under their names, against sums made by hand."""

import math
import re
import statistics

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from simulated import phantom, pull_session, settle

from app.simulation import TICK_SECONDS, Phase, Replay, loading_rates
from app.simulation.exercises.metrics import METRIC_OF, METRICS, Metric
from app.simulation.session.measures import PullMetrics
from physics import BreakEvent, Cubic, RuptureCheck


def taken(forces: list[float], heights: list[float], *, threshold: float = 1.0) -> PullMetrics:
    recorder = PullMetrics(threshold)
    for force, height in zip(forces, heights, strict=True):
        recorder.add(force, (3.0, 0.0, height), 1.0 - force / 4.0, held=force > 0.0)
    return recorder


def test_a_scripted_run_has_the_measures_found_by_hand() -> None:
    # 0.5, 1.5 and 2.5 N while the hook goes 0, 4 and then back to 3 mm; before and after nothing.
    measures = taken([0.0, 0.5, 1.5, 2.5, 0.0], [0.0, 0.0, 4.0, 3.0, 0.0]).measures()
    assert measures.time_s == 5 / 30
    assert measures.time_in_tissue_s == 3 / 30
    assert measures.maximum_force_N == 2.5
    assert measures.mean_absolute_nonzero_force_N == 1.5
    assert measures.force_sd_N == pytest.approx(math.sqrt(2.0 / 3.0), rel=1e-15)
    assert measures.force_time_product_N_s == pytest.approx(4.5 / 30, rel=1e-15)
    assert measures.task_threshold_N == 1.0
    assert measures.time_over_threshold_s == 2 / 30
    assert measures.path_length_mm == 5.0
    assert measures.economy_of_motion == 4.0 / 5.0
    assert measures.smallest_distance_to_break == 1.0 - 2.5 / 4.0
    assert measures.tear is None


def test_a_run_without_a_pull_has_none_of_the_measures_that_need_one() -> None:
    measures = taken([0.0] * 4, [0.0] * 4).measures()
    assert measures.maximum_force_N == measures.force_time_product_N_s == 0.0
    assert measures.time_in_tissue_s == 0.0
    assert measures.mean_absolute_nonzero_force_N is None
    assert measures.force_sd_N is None
    assert measures.economy_of_motion is None
    assert measures.smoothness is None
    assert measures.smallest_distance_to_break == 1.0


def test_a_force_at_the_threshold_is_not_over_it() -> None:
    assert taken([1.0, 1.0 + 1e-12], [0.0, 0.0]).measures().time_over_threshold_s == TICK_SECONDS


def test_smoothness_of_the_minimum_jerk_reach_is_the_published_one() -> None:
    """x = 10 s^3 - 15 s^4 + 6 s^5: T^3/v^2 * integral of jerk^2 = 720 / 1.875^2 = 204.8."""
    ticks = 3000
    s = np.arange(ticks + 1) / ticks
    reach = 40.0 * (10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5)
    measures = taken([1.0] * (ticks + 1), reach.tolist()).measures()
    # The jerk at both ends is the largest and the third difference misses a tick and a half there.
    smoothness = measures.smoothness
    assert smoothness is not None
    assert smoothness == pytest.approx(-math.log(204.8), abs=0.01)
    assert smoothness <= -math.log(204.8)
    assert measures.economy_of_motion == pytest.approx(1.0, rel=1e-12)


def test_smoothness_depends_on_neither_size_nor_speed_and_falls_with_a_tremor() -> None:
    s = np.linspace(0.0, 1.0, 301)
    reach = 10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5
    smooth = taken([1.0] * 301, reach.tolist()).measures().smoothness
    assert smooth is not None
    assert taken([1.0] * 301, (7.0 * reach).tolist()).measures().smoothness == pytest.approx(smooth)
    exact = np.linspace(0.0, 1.0, 601)
    exact = 10.0 * exact**3 - 15.0 * exact**4 + 6.0 * exact**5
    assert taken([1.0] * 601, exact.tolist()).measures().smoothness == pytest.approx(
        smooth, abs=0.05
    )
    tremor = reach + 0.01 * np.sin(40.0 * np.pi * s)
    shaky = taken([1.0] * 301, tremor.tolist()).measures().smoothness
    assert shaky is not None
    assert shaky < smooth - 3.0


@given(
    ticks=st.integers(2, 90),
    cut=st.floats(0.05, 1.0),
    tremor=st.sampled_from([0.0, 0.0, 0.002, 0.02]),
)
@settings(deadline=None)
def test_no_run_that_is_cut_short_is_smoother_than_a_movement_can_be(
    ticks: int, cut: float, tremor: float
) -> None:
    s = np.arange(round(cut * ticks) + 1) / ticks
    reach = 10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5 + tremor * np.sin(0.9 * np.arange(len(s)))
    smoothness = taken([1.0] * len(s), reach.tolist()).measures().smoothness
    assert smoothness is None or smoothness <= -math.log(204.8)
    if len(s) <= 15 or (tremor == 0.0 and cut < 0.9):  # it is still fast, or hardly a movement
        assert smoothness is None


def test_a_yank_to_the_tear_has_no_smoothness_and_a_whole_pull_has_one() -> None:
    session = pull_session(phantom(), vertices=300)
    session.set_target_force(session.planar.force_limit)
    while not session.run.over:
        session.advance()
    assert session.metrics()["tear"] is not None
    assert session.metrics()["smoothness"] is None
    settle(session)
    session.reset()
    session.grab(0, 25.4)
    session.lift(6.0)
    settle(session)
    smoothness = session.metrics()["smoothness"]
    assert smoothness is not None
    assert smoothness < -math.log(204.8)


def test_the_rate_of_loading_is_the_fastest_growth_within_a_tenth_of_a_second_of_a_hold() -> None:
    forces = [0.2, 0.3, 0.5, 0.8, 0.9, 0.9, 0.1]
    assert taken(forces, [0.0] * 7).measures().maximum_loading_rate_N_per_s == pytest.approx(6.0)
    # A hold that starts at a force has not been loaded, and what comes after a new one neither.
    assert taken([3.0, 3.0], [0.0] * 2).measures().maximum_loading_rate_N_per_s == 0.0
    again = taken([1.0, 0.0, 2.0, 2.1], [0.0] * 4)
    assert again.measures().maximum_loading_rate_N_per_s == pytest.approx(1.0)
    again.regrasp()
    again.add(9.0, (3.0, 0.0, 0.0), 0.5, held=True)
    assert again.measures().maximum_loading_rate_N_per_s == pytest.approx(1.0)


def test_the_rates_of_a_series_are_those_that_are_measured() -> None:
    session = pull_session(phantom(), vertices=300)
    session.grab(0, 25.4)
    for lift in (2.0, 7.0, 4.0, 8.0):
        session.lift(lift)
        session.advance(9)
        if lift == 4.0:
            session.release()
            session.advance(4)
            session.grab(0, 25.4)
    run = session.run_file()
    rates = loading_rates(Replay(run.log, phantom(), vertices=300).series())
    assert rates.max() == pytest.approx(run.metrics["maximum_loading_rate_N_per_s"], rel=1e-12)


def test_an_overshoot_is_the_way_past_the_band_by_its_middle() -> None:
    assert PullMetrics(1.0).measures().overshoot is None
    recorder = PullMetrics(1.0, (4.0, 6.0))
    for deflection, held in ((3.0, True), (5.9, True), (7.0, True), (6.5, True), (9.0, False)):
        recorder.add(1.0, (0.0, 0.0, deflection), 0.5, held=held, deflection=deflection)
    assert recorder.measures().overshoot == pytest.approx(1.0 / 5.0)


def test_a_way_too_small_to_be_squared_has_no_smoothness() -> None:
    heights = [step * 1e-170 for step in (0.0, 1.0, 3.0, 7.0, 8.0, 8.0)]
    assert taken([1.0] * 6, heights).measures().smoothness is None


def test_the_way_between_two_holds_is_not_part_of_the_path() -> None:
    recorder = PullMetrics(1.0)
    for height in (0.0, 2.0):
        recorder.add(1.0, (0.0, 0.0, height), 0.9, held=True)
    recorder.add(0.0, (0.0, 0.0, 1.0), 0.9, held=False)
    for height in (7.0, 8.0):
        recorder.add(1.0, (9.0, 0.0, height), 0.9, held=True)
    recorder.regrasp()
    recorder.add(1.0, (20.0, 0.0, 8.5), 0.9, held=True, came_from=(20.0, 0.0, 8.0))
    assert recorder.measures().path_length_mm == 3.5


def test_the_tear_is_told_with_criterion_place_time_and_load() -> None:
    recorder = taken([1.0, 2.0, 3.0], [0.0, 1.0, 2.0])
    recorder.tear(BreakEvent(3.0, 2.0, RuptureCheck(10.0, -1, 0.1, 0.2, 0.25)))
    tear = recorder.measures().tear
    assert tear is not None
    assert (tear.station_mm, tear.side, tear.force_N, tear.deflection_mm) == (
        10.0,
        "away",
        3.0,
        2.0,
    )
    assert (tear.normal_stress_MPa, tear.bending_stress_MPa, tear.threshold_MPa) == (0.1, 0.2, 0.25)
    assert tear.time_s == 0.1
    assert ">" in tear.criterion


@given(st.lists(st.just(0.0) | st.floats(1e-9, 1e3), min_size=1, max_size=60))
def test_running_sums_are_those_of_the_whole_series(forces: list[float]) -> None:
    measures = taken(forces, [0.0] * len(forces)).measures()
    loaded = [force for force in forces if force > 0.0]
    assert measures.maximum_force_N == max(forces)
    assert measures.force_time_product_N_s == pytest.approx(math.fsum(forces) / 30, rel=1e-12)
    if loaded:
        mean = statistics.fmean(loaded)
        assert measures.mean_absolute_nonzero_force_N == pytest.approx(mean, rel=1e-12)
        assert measures.force_sd_N == pytest.approx(
            statistics.pstdev(loaded), rel=1e-6, abs=1e-9 * mean
        )


def test_a_session_s_measures_are_those_of_its_script() -> None:
    """A ramp of load control, by hand: it grows by the same step each tick, then stays."""
    session = pull_session(phantom(), vertices=300)
    breaks = session.reading().breaks_at
    assert breaks is not None
    step = breaks.force / 0.75 / 30.0
    session.set_target_force(1.0)
    session.advance(30)
    forces = [min(step * tick, 1.0) for tick in range(1, 31)]
    deflections = [
        Cubic().pull(session.planar.dissection.beam, 25.4).to_force(force).deflection
        for force in forces
    ]
    measures = session.metrics()
    assert measures["time_s"] == 30 * TICK_SECONDS
    assert measures["maximum_force_N"] == 1.0
    assert measures["mean_absolute_nonzero_force_N"] == pytest.approx(statistics.fmean(forces))
    assert measures["force_sd_N"] == pytest.approx(statistics.pstdev(forces))
    assert measures["force_time_product_N_s"] == pytest.approx(math.fsum(forces) / 30)
    assert measures["task_threshold_N"] == pytest.approx(0.5 * breaks.force)
    assert measures["time_over_threshold_s"] == 0.0
    # Symmetric, so the hook goes straight along the pull from rest.
    assert measures["path_length_mm"] == pytest.approx(deflections[-1], rel=1e-9)
    assert measures["economy_of_motion"] == pytest.approx(1.0, rel=1e-9)
    assert measures["smallest_distance_to_break"] == session.reading().check.distance_to_break


def test_a_run_starts_with_the_first_pull_and_is_over_with_the_tear() -> None:
    session = pull_session(phantom(), vertices=300)
    session.set_grasp(20.0)
    session.advance(50)
    assert session.run.seconds == 0.0
    session.set_target_force(session.planar.force_limit)
    while session.reading().phase is Phase.INTACT:
        assert not session.run.over
        session.advance()
    assert session.run.over
    measures, event = session.metrics(), session.reading().breaks_at
    assert event is not None
    assert measures["tear"] is not None
    assert measures["tear"]["force_N"] == measures["maximum_force_N"] == event.force
    assert measures["tear"]["station_mm"] == event.check.station
    assert measures["tear"]["time_s"] == measures["time_s"]
    assert abs(measures["smallest_distance_to_break"]) < 1e-9
    settle(session)
    assert session.metrics() == measures
    session.reset()
    assert session.metrics()["time_s"] == 0.0


def test_idle_time_under_a_held_force_still_counts() -> None:
    session = pull_session(phantom(), vertices=300)
    session.set_target_force(1.0)
    settle(session)
    before = session.metrics()
    assert not session.advance(30)
    after = session.metrics()
    assert after["time_s"] == pytest.approx(before["time_s"] + 1.0)
    assert after["force_time_product_N_s"] == pytest.approx(before["force_time_product_N_s"] + 1.0)


@given(st.sampled_from([each for each in METRICS if each.passed]), st.floats(0.1, 10.0),
       st.floats(1e-5, 0.5))  # fmt: skip
def test_a_limit_that_is_passed_and_by_how_much_are_told_apart(
    metric: Metric, limit: float, by: float
) -> None:
    value = limit * (1.0 - by if metric.better == "higher" else 1.0 + by)
    words = metric.passed_words(value, limit)
    numbers = re.findall(r"\d+(?:\.\d+)?", words)
    assert numbers[0] != numbers[1], words


def test_a_limit_is_given_with_the_digits_that_it_needs() -> None:
    force = METRIC_OF["maximum_instrument_force_N"]
    assert (
        force.passed_words(1.0312, 1.0204) == "The instrument was pushed with 1.03 N, past 1.02 N"
    )
    assert force.passed_words(1.31, 1.02) == "The instrument was pushed with 1.3 N, past 1 N"
