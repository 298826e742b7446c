"""Numbers that are no beam, no grasp and no load are named, with their unit."""

import math

import numpy as np
import pytest

from physics import THEORIES, Beam, Cubic, Exact, check_rupture, theory_named

DUCT = Beam.round(span=50.8, diameter=8.89, modulus=0.310264)
MIDDLE = np.array([25.4])


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
@pytest.mark.parametrize("name", ["span", "area", "second_moment", "fibre_distance", "modulus"])
def test_beam_names_what_is_wrong(name: str, value: float) -> None:
    good = dict.fromkeys(("span", "area", "second_moment", "fibre_distance", "modulus"), 1.0)
    with pytest.raises(ValueError, match=rf"^{name} must be above 0 "):
        Beam(**{**good, name: value})


@pytest.mark.parametrize("value", [-0.1, 0.5, math.nan])
def test_poisson_ratio_has_a_range(value: float) -> None:
    with pytest.raises(ValueError, match="poisson_ratio"):
        Beam.round(span=1.0, diameter=1.0, modulus=1.0, poisson_ratio=value)


@pytest.mark.parametrize("grasp", [0.0, 50.8, -3.0, 60.0, math.nan])
@pytest.mark.parametrize("name", sorted(THEORIES))
def test_grasp_lies_between_the_clamps(name: str, grasp: float) -> None:
    with pytest.raises(ValueError, match="grasp must"):
        theory_named(name).pull(DUCT, grasp).to_force(1.0).sample(MIDDLE)


@pytest.mark.parametrize("load", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("name", sorted(THEORIES))
def test_loads_are_finite(name: str, load: float) -> None:
    theory = theory_named(name)
    with pytest.raises(ValueError, match="force must be a finite number of N"):
        theory.pull(DUCT, 25.4).to_force(load).sample(MIDDLE)
    with pytest.raises(ValueError, match="deflection must be a finite number of mm"):
        theory.pull(DUCT, 25.4).to_deflection(load).sample(MIDDLE)


def test_stations_lie_on_the_span() -> None:
    for stations in (np.array([-0.1]), np.array([50.9]), np.array([math.nan])):
        with pytest.raises(ValueError, match="stations must lie"):
            Cubic().pull(DUCT, 25.4).to_force(1.0).sample(stations)
    with pytest.raises(ValueError, match="row"):
        Cubic().pull(DUCT, 25.4).to_force(1.0).sample(np.zeros((2, 2)))


def test_inputs_stay_and_results_are_locked() -> None:
    stations = np.linspace(0.0, 50.8, 5)
    before = stations.copy()
    pulled = Cubic().pull(DUCT, 25.4).to_force(1.0).sample(stations)
    assert np.array_equal(stations, before)
    assert stations.flags.writeable
    with pytest.raises(ValueError, match="read-only"):
        pulled.across[0] = 1.0


@pytest.mark.parametrize("threshold", [0.0, -1.0, math.nan])
def test_threshold_is_above_zero(threshold: float) -> None:
    with pytest.raises(ValueError, match="threshold must be above 0 MPa"):
        check_rupture(Cubic().pull(DUCT, 25.4).to_force(1.0).sample(MIDDLE), threshold)


def test_unknown_theory_names_those_there_are() -> None:
    with pytest.raises(ValueError, match="cubic, string"):
        theory_named("spline")
    with pytest.raises(ValueError, match="q belongs to the cubic"):
        theory_named("string", q=0.5)
    with pytest.raises(ValueError, match="q must be from 0 to 2"):
        theory_named("cubic", q=-0.5)


def test_text_is_no_number_and_a_pull_says_where_it_is() -> None:
    for wrong in ("50", b"50"):
        with pytest.raises(ValueError, match="span must be a number of mm, got the text"):
            Beam.round(span=wrong, diameter=8.0, modulus=0.3)  # pyright: ignore[reportArgumentType]
    beam = Beam.round(span=50.8, diameter=8.89, modulus=0.310264)
    for theory in (Cubic(), Exact()):
        pull = theory.pull(beam, 25.4).to_deflection(2.0)
        message = repr(pull)
        assert message.startswith(f"{type(pull).__name__}(grasp=25.4 mm, force=")
        assert message.endswith(", deflection=2 mm)")
