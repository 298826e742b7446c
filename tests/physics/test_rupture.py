"""Where a beam tears, how far it is from it, and at which load."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from theory_limits import ROUND_TRIP, TESTED

from app.validation.thesis_tables import LBF, PSI
from physics import (
    Beam,
    Cubic,
    Exact,
    NeoHooke,
    VaryingBeam,
    break_of,
    calibrated_threshold,
    check_rupture,
    critical_stations,
    theory_named,
)

DUCT = Beam.round(span=50.8, diameter=8.89, modulus=45.0 * PSI)
BREAK = 0.8 * LBF
"""P = 0.4 lbf of figure 6.28 on the half, F = 2P on the whole."""


def test_thesis_duct_at_the_break() -> None:
    """6.858 + 23.813 = 30.672 psi by (5.26) to (5.28) at P = 0.4 lbf."""
    pulled = Cubic().pull(DUCT, 25.4).to_force(BREAK).sample(critical_stations(DUCT, 25.4))
    check = check_rupture(pulled, threshold=30.672 * PSI)
    assert check.normal_stress / PSI == pytest.approx(6.858, abs=5e-4)
    assert check.bending_stress / PSI == pytest.approx(23.813, abs=5e-4)
    assert check.distance_to_break == pytest.approx(0.0, abs=2e-5)


def test_central_pull_stresses_clamps_and_grasp_alike_and_tears_at_the_grasp() -> None:
    stations = critical_stations(DUCT, 25.4)
    pulled = Cubic().pull(DUCT, 25.4).to_force(2.0).sample(stations)
    at_grasp = pulled.total_stress[stations == 25.4]
    assert pulled.total_stress[[0, -1]] == pytest.approx(np.repeat(at_grasp, 2), rel=1e-12)
    check = check_rupture(pulled, 0.2)
    assert check.station == 25.4
    assert check.tension_side == 1  # an arch stretches its outer side, that of the pull


@pytest.mark.parametrize(("grasp", "clamp"), [(10.0, 0.0), (40.0, 50.8)])
def test_off_centre_pull_tears_at_the_near_clamp_on_the_far_side(
    grasp: float, clamp: float
) -> None:
    pulled = Cubic().pull(DUCT, grasp).to_force(2.0).sample(critical_stations(DUCT, grasp))
    check = check_rupture(pulled, 0.2)
    assert check.station == clamp
    assert check.tension_side == -1


def test_a_pull_the_other_way_tears_the_other_side() -> None:
    stations = critical_stations(DUCT, 25.4)
    assert (
        check_rupture(Cubic().pull(DUCT, 25.4).to_force(-2.0).sample(stations), 0.2).tension_side
        == 1
    )
    assert (
        check_rupture(Cubic().pull(DUCT, 10.0).to_force(-2.0).sample(stations), 0.2).tension_side
        == -1
    )


def test_string_has_no_side_to_tear_first() -> None:
    pulled = (
        theory_named("string").pull(DUCT, 25.4).to_force(2.0).sample(critical_stations(DUCT, 25.4))
    )
    check = check_rupture(pulled, 0.2)
    assert check.tension_side == 0
    assert check.station == 25.4


@pytest.mark.slow
@settings(deadline=None, max_examples=40)
@given(
    st.sampled_from(TESTED),
    st.floats(2.0, 48.0),
    st.floats(0.01, 2.0),
)
def test_break_event_is_the_root_of_the_criterion(
    name: str, grasp: float, threshold: float
) -> None:
    theory = theory_named(name)
    event = break_of(theory.pull(DUCT, grasp), threshold)
    assert event is not None
    stations = critical_stations(DUCT, grasp)

    def broken(factor: float) -> bool:
        pulled = theory.pull(DUCT, grasp).to_force(factor * event.force).sample(stations)
        return check_rupture(pulled, threshold).broken

    # Closed forms and elements could do better still; masses settle no better.
    near = max(1e-9, ROUND_TRIP[name])
    assert broken(1.0 + near)
    assert not broken(1.0 - near)
    assert event.check.margin == pytest.approx(0.0, abs=1e-3 * near)
    assert theory.pull(DUCT, grasp).to_force(event.force).sample(
        stations
    ).deflection == pytest.approx(event.deflection, rel=near)


@pytest.mark.slow
@settings(deadline=None, max_examples=40)
@given(st.sampled_from(TESTED), st.floats(2.0, 48.0), st.floats(0.01, 50.0))
def test_calibrated_threshold_breaks_at_its_force(name: str, grasp: float, force: float) -> None:
    theory = theory_named(name)
    event = break_of(
        theory.pull(DUCT, grasp), calibrated_threshold(theory.pull(DUCT, grasp), force)
    )
    assert event is not None
    assert event.force == pytest.approx(force, rel=max(1e-9, ROUND_TRIP[name]))


def test_distance_to_break_runs_from_one_to_zero() -> None:
    threshold = calibrated_threshold(Cubic().pull(DUCT, 25.4), BREAK)
    stations = critical_stations(DUCT, 25.4)
    distances = [
        check_rupture(
            Cubic().pull(DUCT, 25.4).to_force(fraction * BREAK).sample(stations), threshold
        ).distance_to_break
        for fraction in (0.0, 0.25, 0.5, 0.75, 1.0, 1.1)
    ]
    assert distances[0] == 1.0
    assert distances[4] == pytest.approx(0.0, abs=1e-12)
    assert distances == sorted(distances, reverse=True)
    assert distances[5] < 0.0


def test_a_threshold_out_of_reach_is_no_event() -> None:
    assert break_of(Cubic().pull(DUCT, 25.4), 1e12) is None


def test_a_narrow_place_between_the_even_stations_is_where_it_breaks() -> None:
    """A waist of 0.2 mm at 30.3 mm, which no fortieth of the span meets."""
    area, moment = DUCT.area, DUCT.second_moment
    waist = VaryingBeam(
        stations=np.array([0.0, 30.2, 30.3, 30.4, 50.8]),
        areas=area * np.array([1.0, 1.0, 0.25, 1.0, 1.0]),
        second_moments=moment * np.array([1.0, 1.0, 0.0625, 1.0, 1.0]),
        fibre_distances=DUCT.fibre_distance * np.array([1.0, 1.0, 0.5, 1.0, 1.0]),
        modulus=DUCT.modulus,
    )
    assert 30.3 not in critical_stations(DUCT, 25.4)
    assert 30.3 in critical_stations(waist, 25.4)
    event = break_of(Exact().pull(waist, 25.4), 0.2)
    assert event is not None
    assert event.check.station == 30.3
    even = break_of(Exact().pull(DUCT, 25.4), 0.2)
    assert even is not None
    assert event.force < even.force
    threshold = calibrated_threshold(Exact().pull(waist, 25.4), event.force)
    assert threshold == pytest.approx(0.2, rel=1e-6)


@pytest.mark.parametrize("grasp", [20.0, 25.4])
@pytest.mark.parametrize("force", [0.0, 1e-299, 1e-30, 1e-18])
def test_a_slack_beam_has_a_highest_stress_although_rounding_squeezes_it(
    grasp: float, force: float
) -> None:
    beam = Beam.round(span=50.8, diameter=8.89, modulus=0.310264)
    pulled = Exact().pull(beam, grasp).to_force(force).sample(critical_stations(beam, grasp))
    check = check_rupture(pulled, 0.2)
    assert check.distance_to_break == pytest.approx(1.0)
    assert not check.broken


def test_a_break_is_found_where_a_section_gives_way_between_two_solved_ones() -> None:
    """Of this thick rod, at deflections of many spans past the break."""
    rod = Beam.round(span=50.8, diameter=10.16, modulus=10.3421)
    threshold = 43.37024023882904
    event = break_of(Exact(NeoHooke()).pull(rod, 37.47519041930161), threshold)
    assert event is not None
    assert event.check.total_stress == pytest.approx(threshold, rel=1e-6)
