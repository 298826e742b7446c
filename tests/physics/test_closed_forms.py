"""Closed forms against numerical integration of the same energy, round trips and symmetry."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from theory_limits import ROUND_TRIP, SLIDING, SYMMETRY, TESTED, within_reach

from physics import Beam, Cubic, TautString, Theory, theory_named

ROUNDING = 1e-12
"""Relative: some hundred operations in double precision."""

beams = st.builds(
    Beam.round,
    span=st.floats(5.0, 200.0),
    diameter=st.floats(0.5, 30.0),
    modulus=st.floats(1e-3, 1e3),
    poisson_ratio=st.floats(0.0, 0.49),
)
fractions = st.floats(0.05, 0.95)
deflections = st.floats(1e-6, 2.0)
"""As a part of the span."""


def gauss(function, low: float, high: float) -> float:
    """Integral by 12 Gauss points: exact for the polynomials here."""
    nodes, weights = np.polynomial.legendre.leggauss(12)
    x = 0.5 * (high - low) * nodes + 0.5 * (high + low)
    return float(0.5 * (high - low) * np.sum(weights * function(x)))


@settings(deadline=None)
@given(beams, fractions, deflections, st.floats(0.0, 1.0))
def test_cubic_force_balances_the_energy_of_its_own_shape(
    beam: Beam, fraction: float, relative: float, q: float
) -> None:
    """(5.6): F delta / 2 = U_B + q N dl, integrated over the sampled axis, not the formula."""
    grasp, deflection = fraction * beam.span, relative * beam.span
    theory = Cubic(q=q)

    def sampled(x: np.ndarray):
        return theory.pull(beam, grasp).to_deflection(deflection).sample(x)

    sides = ((0.0, grasp), (grasp, beam.span))
    bending = sum(gauss(lambda x: sampled(x).moment ** 2, *side) for side in sides) / (
        2.0 * beam.modulus * beam.second_moment
    )
    stretch = sum(gauss(lambda x: 0.5 * np.tan(sampled(x).rotation) ** 2, *side) for side in sides)
    tension = beam.modulus * beam.area * stretch / beam.span
    force = 2.0 * (bending + q * tension * stretch) / deflection
    assert theory.pull(beam, grasp).to_deflection(deflection).force == pytest.approx(
        force, rel=1e-10
    )
    pulled = sampled(np.array([0.3 * beam.span]))
    assert pulled.normal_force[0] == pytest.approx(tension, rel=1e-10)


@settings(deadline=None)
@given(beams, fractions, deflections)
def test_cubic_axis_moment_and_slope_belong_together(
    beam: Beam, fraction: float, relative: float
) -> None:
    """Slope and curvature are the derivatives of the axis, by differences."""
    grasp, deflection = fraction * beam.span, relative * beam.span
    step = 1e-4 * beam.span
    for x in (0.21 * beam.span, 0.83 * beam.span):
        if abs(x - grasp) < 2.0 * step:
            continue
        near = (
            Cubic()
            .pull(beam, grasp)
            .to_deflection(deflection)
            .sample(x + step * np.arange(-1.0, 2.0))
        )
        slope = (near.across[2] - near.across[0]) / (2.0 * step)
        curvature = (near.across[2] - 2.0 * near.across[1] + near.across[0]) / step**2
        scale = deflection / min(grasp, beam.span - grasp)
        assert math.tan(near.rotation[1]) == pytest.approx(slope, abs=1e-5 * scale)
        assert near.moment[1] / (beam.modulus * beam.second_moment) == pytest.approx(
            curvature, abs=1e-5 * scale / min(grasp, beam.span - grasp)
        )


@settings(deadline=None)
@given(beams, fractions, deflections)
def test_cubic_shear_and_energy_are_those_of_its_shape(
    beam: Beam, fraction: float, relative: float
) -> None:
    """Shear is the slope of the moment and jumps by k1 delta; energy by (5.18) and stretching."""
    grasp, deflection = fraction * beam.span, relative * beam.span
    x = np.array([0.0, grasp, np.nextafter(grasp, np.inf), beam.span])
    pulled = Cubic().pull(beam, grasp).to_deflection(deflection).sample(x)
    slopes = np.diff(pulled.moment)[[0, 2]] / [grasp, beam.span - grasp]
    assert pulled.shear_force == pytest.approx(np.repeat(slopes, 2), rel=1e-9)
    k1, k3 = Cubic(q=1.0).stiffness(beam, grasp)
    assert pulled.shear_force[2] - pulled.shear_force[1] == pytest.approx(k1 * deflection, rel=1e-9)
    energy = 0.5 * k1 * deflection**2 + 0.25 * k3 * deflection**4
    assert pulled.strain_energy == pytest.approx(energy, rel=1e-9)


@settings(deadline=None)
@given(beams, fractions, deflections)
def test_string_force_is_the_slope_of_its_energy(
    beam: Beam, fraction: float, relative: float
) -> None:
    grasp, deflection = fraction * beam.span, relative * beam.span

    def energy(delta: float) -> float:
        lengths = math.hypot(grasp, delta) + math.hypot(beam.span - grasp, delta)
        return beam.modulus * beam.area * (lengths - beam.span) ** 2 / (2.0 * beam.span)

    # The exact force integrated over the deflection is the stored energy.
    work = gauss(
        np.vectorize(lambda d: TautString().pull(beam, grasp).to_deflection(d).force),
        0.5 * deflection,
        deflection,
    )
    stored = energy(deflection) - energy(0.5 * deflection)
    at = np.array([grasp])
    pulled = TautString().pull(beam, grasp).to_deflection(deflection).sample(at)
    assert not pulled.shear_force.any()
    scale = 1e-12 * beam.modulus * beam.area * beam.span
    assert pulled.strain_energy == pytest.approx(energy(deflection), rel=1e-6, abs=scale)
    # The energy as written cancels where l_a + l_b is nearly the span.
    assert work == pytest.approx(stored, rel=1e-6, abs=1e-12 * beam.modulus * beam.area * beam.span)


@settings(deadline=None)
@given(beams, fractions, deflections, st.sampled_from(TESTED))
def test_force_and_back(beam: Beam, fraction: float, relative: float, name: str) -> None:
    assume(within_reach(name, beam, relative))
    theory, grasp, there = theory_named(name), fraction * beam.span, relative * beam.span
    at = np.array([grasp])
    force = theory.pull(beam, grasp).to_deflection(there).sample(at).force
    back = theory.pull(beam, grasp).to_force(force).sample(at)
    assert back.deflection == pytest.approx(there, rel=ROUND_TRIP[name])
    assert back.across[0] == pytest.approx(there, rel=ROUND_TRIP[name])


@settings(deadline=None)
@given(beams, fractions, deflections, st.sampled_from(TESTED))
def test_mirrored_and_reversed_pulls(
    beam: Beam, fraction: float, relative: float, name: str
) -> None:
    assume(within_reach(name, beam, relative))
    theory, grasp, there = theory_named(name), fraction * beam.span, relative * beam.span
    rel = SYMMETRY[name]
    x = np.linspace(0.0, beam.span, 17)
    pulled = theory.pull(beam, grasp).to_deflection(there).sample(x)
    mirror = (
        theory.pull(beam, beam.span - grasp)
        .to_deflection(there)
        .sample(np.clip(beam.span - x, 0, None))
    )
    pushed = theory.pull(beam, grasp).to_deflection(-there).sample(x)
    assert mirror.force == pytest.approx(pulled.force, rel=rel)
    assert pushed.force == -pulled.force
    assert mirror.across == pytest.approx(pulled.across, rel=rel, abs=rel * there)
    assert pushed.across == pytest.approx(-pulled.across, rel=rel, abs=rel * there)
    assert mirror.rotation == pytest.approx(-pulled.rotation, rel=rel, abs=rel)
    assert mirror.total_stress == pytest.approx(
        pulled.total_stress, rel=1e3 * rel, abs=rel * pulled.total_stress.max()
    )


@pytest.mark.parametrize("name", TESTED)
@pytest.mark.parametrize("grasp", [7.0, 25.4, 40.0])
def test_axis_starts_and_ends_at_the_clamps_and_passes_the_grasp(name: str, grasp: float) -> None:
    beam = Beam.round(span=50.8, diameter=8.89, modulus=0.310264)
    pulled = theory_named(name).pull(beam, grasp).to_force(3.0).sample(np.array([0.0, grasp, 50.8]))
    # A beam that can stretch unevenly slides along the line between the clamps at the grasp.
    slide = 0.02 * 50.8 if name in SLIDING and grasp != 25.4 else 1e-9
    assert pulled.along == pytest.approx([0.0, grasp, 50.8], rel=0.0, abs=slide)
    assert pulled.along[[0, 2]] == pytest.approx([0.0, 50.8], rel=1e-14, abs=0.0)
    assert pulled.across == pytest.approx([0.0, pulled.deflection, 0.0], abs=1e-12)
    assert pulled.rotation[[0, 2]] == pytest.approx([0.0, 0.0], abs=1e-12)


def test_central_grasp_is_the_thesis() -> None:
    """a = b = L turns the off-centre laws into (5.6) and (5.25), with F = 2P."""
    beam = Beam.round(span=50.8, diameter=8.89, modulus=0.310264)
    half, delta, q = 25.4, 12.8, 0.45
    ei, ea = beam.modulus * beam.second_moment, beam.modulus * beam.area
    cubic = 12.0 * ei * delta / half**3 + 0.72 * q * ea * delta**3 / half**3
    string = ea / half * delta * (1.0 - half / math.hypot(half, delta))
    assert Cubic(q=q).pull(beam, half).to_deflection(delta).force == pytest.approx(
        2.0 * cubic, rel=ROUNDING
    )
    assert TautString().pull(beam, half).to_deflection(delta).force == pytest.approx(
        2.0 * string, rel=ROUNDING
    )


def test_cubic_is_the_linear_clamped_beam_at_small_load() -> None:
    """Delta = F a^3 b^3 / (3 E I S^3), any handbook of beams."""
    beam = Beam.round(span=60.0, diameter=3.0, modulus=2.0)
    linear = 1e-9 * 15.0**3 * 45.0**3 / (3.0 * beam.modulus * beam.second_moment * 60.0**3)
    assert Cubic().pull(beam, 15.0).to_force(1e-9).deflection == pytest.approx(linear, rel=ROUNDING)


def test_string_s_sections_stand_in_the_clamps_and_follow_the_lines() -> None:
    beam = Beam.round(span=50.8, diameter=8.89, modulus=0.310264)
    pulled = (
        TautString()
        .pull(beam, 20.0)
        .to_deflection(10.0)
        .sample(np.array([0.0, 1.0, 10.0, 20.0, 35.0, 50.8]))
    )
    lines = math.atan2(10.0, 20.0), -math.atan2(10.0, 30.8)
    assert pulled.rotation[[0, 5]] == pytest.approx([0.0, 0.0], abs=1e-15)
    assert pulled.rotation[[2, 4]] == pytest.approx(lines)
    assert pulled.rotation[3] == pytest.approx(0.5 * sum(lines))
    assert 0.0 < pulled.rotation[1] < lines[0]


def test_force_of_nothing_bends_nothing() -> None:
    beam = Beam.round(span=50.8, diameter=8.89, modulus=0.310264)
    for name in TESTED:
        rest: Theory = theory_named(name)
        pulled = rest.pull(beam, 20.0).to_force(0.0).sample(np.linspace(0.0, 50.8, 9))
        assert not pulled.across.any()
        assert not pulled.rotation.any()
        assert not pulled.total_stress.any()
