"""The exact beam with two grasps, each by force or by displacement, and grips that give way."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from physics import Beam, BeyondLaw, Exact, ExactPull, Hold, Linear, NeoHooke, VaryingBeam
from physics.exact import Law

DUCT = Beam.round(span=50.8, diameter=8.89, modulus=0.310264, poisson_ratio=0.3)
LAWS: list[Law] = [Linear(), Linear(shear=True), NeoHooke()]


def duct(first: float, second: float | None = None, law: Law = LAWS[0],
         beam: Beam | VaryingBeam = DUCT) -> ExactPull:  # fmt: skip
    return Exact(law).pull(beam, first, second)


def to(deflection: float, compliance: float = 0.0) -> Hold:
    return Hold("deflection", deflection, compliance)


def pull(force: float) -> Hold:
    return Hold("force", force)


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("place", [5.0, 19.0, 25.4])
def test_a_slack_second_hook_is_none(law: Law, place: float) -> None:
    one, two = duct(place, None, law), duct(place, 37.0, law)
    swapped = duct(50.8 - 37.0, 50.8 - place, law)
    for deflection in (0.2, 3.0, 0.4 * place):
        force = one.to_deflection(deflection).force
        two.hold(to(deflection), pull(0.0))
        assert two.force == pytest.approx(force, rel=3e-6)  # another mesh
        assert two.second_force == pytest.approx(0.0, abs=1e-12)
        along = np.array([37.0])
        assert two.second_deflection == pytest.approx(one.sample(along).across[0], rel=2e-5)
        swapped.hold(pull(0.0), to(deflection))
        assert swapped.second_force == pytest.approx(two.force, rel=1e-9)


@pytest.mark.parametrize("law", LAWS)
def test_two_hooks_at_one_place_are_one(law: Law) -> None:
    place, force = 20.0, 1.6
    deflection = duct(place, None, law).to_force(force).deflection
    missed: list[float] = []
    for apart in (0.8, 0.4, 0.2):
        two = duct(place - 0.75 * apart, place + 0.25 * apart, law)
        two.hold(pull(0.25 * force), pull(0.75 * force))
        mean = 0.25 * two.deflection + 0.75 * two.second_deflection
        missed.append(abs(mean - deflection))
    assert missed[-1] < 2e-3 * deflection
    # A shearing beam has a kink at each hook: of first order, not of second.
    assert all(after < (0.52 if law.shear else 0.32) * before for before, after in pairwise(missed))
    with pytest.raises(ValueError, match="two at one place are one"):
        duct(place, place + 1e-6)


@pytest.mark.parametrize("law", LAWS)
def test_symmetric_hooks_share_alike_and_small_pulls_superpose(law: Law) -> None:
    both = duct(15.0, 50.8 - 15.0, law)
    both.hold(to(8.0), to(8.0))
    assert both.second_force == pytest.approx(both.force, rel=1e-12)
    across = both.sample(np.linspace(0.0, 50.8, 21)).across
    assert np.allclose(across, across[::-1], rtol=0, atol=1e-9)
    # Maxwell and Betti: of small pulls the deflections add up and those at the other hook agree.
    tiny = duct(14.0, 33.0, law)
    forces = 1e-5, 2e-5
    tiny.hold(pull(forces[0]), pull(0.0))
    first = np.array([tiny.deflection, tiny.second_deflection])
    tiny.hold(pull(0.0), pull(forces[1]))
    second = np.array([tiny.deflection, tiny.second_deflection])
    tiny.hold(pull(forces[0]), pull(forces[1]))
    assert [tiny.deflection, tiny.second_deflection] == pytest.approx(first + second, rel=1e-6)
    assert first[1] / forces[0] == pytest.approx(second[0] / forces[1], rel=1e-6)


@settings(deadline=None, max_examples=25)
@given(
    places=st.tuples(st.floats(6.0, 22.0), st.floats(27.0, 45.0)),
    deflections=st.tuples(st.floats(-3.0, 9.0), st.floats(-3.0, 9.0)),
    law=st.sampled_from(LAWS),
)
def test_force_and_displacement_are_each_others_inverse(
    places: tuple[float, float], deflections: tuple[float, float], law: Law
) -> None:
    two = duct(*places, law)
    two.hold(to(deflections[0]), to(deflections[1]))
    forces = two.force, two.second_force
    for holds in (
        (pull(forces[0]), to(deflections[1])),
        (to(deflections[0]), pull(forces[1])),
        (pull(forces[0]), pull(forces[1])),
        (to(deflections[0] + 0.7 * forces[0], 0.7), to(deflections[1] + 2.0 * forces[1], 2.0)),
    ):
        two.hold(*holds)
        assert (two.force, two.second_force) == pytest.approx(forces, rel=1e-8, abs=1e-9)
        assert (two.deflection, two.second_deflection) == pytest.approx(
            deflections, rel=1e-8, abs=1e-8
        )


@pytest.mark.parametrize("law", LAWS)
def test_the_work_of_both_hands_is_stored(law: Law) -> None:
    two = duct(15.0, 35.0, law)
    held: list[tuple[float, float, float, float]] = []
    for fraction in np.linspace(0.0, 1.0, 801).tolist():
        two.hold(to(10.0 * fraction), to(7.0 * math.sin(2.0 * fraction)))
        held.append((two.deflection, two.second_deflection, two.force, two.second_force))
    at = np.array(held)
    work = float(np.sum(0.5 * (at[1:, 2:] + at[:-1, 2:]) * np.diff(at[:, :2], axis=0)))
    assert work == pytest.approx(two.strain_energy, rel=2e-6)


@pytest.mark.parametrize("place", [17.0, 25.4])
def test_a_grip_that_gives_way_is_a_spring_before_the_beam(place: float) -> None:
    stiff, soft = duct(place), duct(place)
    for deflection in (0.05, 4.0, 4.02, 11.0, 2.0):
        force = stiff.to_deflection(deflection).force
        soft.hold(to(deflection + 1.3 * force, 1.3))
        assert soft.force == pytest.approx(force, rel=1e-9)
        assert soft.deflection == pytest.approx(deflection, rel=1e-9)
    assert soft.to_deflection(3.0).force == pytest.approx(stiff.to_deflection(3.0).force, rel=1e-12)


def test_sections_that_vary_are_held_twice_as_well() -> None:
    stations = np.array([0.0, 20.0, 20.0, 50.8])
    row = np.array([60.0, 60.0, 40.0, 40.0])
    beam = VaryingBeam(
        stations=stations, areas=row, second_moments=5.0 * row,
        fibre_distances=np.full(4, 4.0), modulus=0.3, poisson_ratio=0.3,
    )  # fmt: skip
    one, two = duct(12.0, beam=beam), duct(12.0, 31.0, beam=beam)
    force = one.to_deflection(5.0).force
    two.hold(to(5.0), pull(0.0))
    assert two.force == pytest.approx(force, rel=2e-5)


def test_bad_holds_are_refused() -> None:
    with pytest.raises(ValueError, match="grasp"):
        duct(10.0, 60.0)
    with pytest.raises(ValueError, match="one hold for each grasp"):
        duct(10.0).hold(to(1.0), to(1.0))
    with pytest.raises(ValueError, match="compliance"):
        Hold("force", 1.0, 1.0)
    with pytest.raises(ValueError, match="finite"):
        Hold("force", math.nan)
    with pytest.raises(BeyondLaw, match="second grasp"):
        duct(2.0, 25.0, NeoHooke()).hold(pull(1e5), pull(-1e5))
