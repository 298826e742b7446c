"""Closed forms against numerical integration of the same energy, round trips and symmetry."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from physics import THEORIES, Beam, Cubic, TautString, Theory, theory_named

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


def in_range(name: str, beam: Beam) -> bool:
    """The exact beam answers for half spans of one diameter and more."""
    return name != "exact" or beam.span >= 4.0 * beam.fibre_distance


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
        return theory.under_deflection(beam, grasp, deflection, x)

    sides = ((0.0, grasp), (grasp, beam.span))
    bending = sum(gauss(lambda x: sampled(x).moment ** 2, *side) for side in sides) / (
        2.0 * beam.modulus * beam.second_moment
    )
    stretch = sum(gauss(lambda x: 0.5 * np.tan(sampled(x).rotation) ** 2, *side) for side in sides)
    tension = beam.modulus * beam.area * stretch / beam.span
    force = 2.0 * (bending + q * tension * stretch) / deflection
    assert theory.force(beam, grasp, deflection) == pytest.approx(force, rel=1e-10)
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
        near = Cubic().under_deflection(beam, grasp, deflection, x + step * np.arange(-1.0, 2.0))
        slope = (near.across[2] - near.across[0]) / (2.0 * step)
        curvature = (near.across[2] - 2.0 * near.across[1] + near.across[0]) / step**2
        scale = deflection / min(grasp, beam.span - grasp)
        assert math.tan(near.rotation[1]) == pytest.approx(slope, abs=1e-5 * scale)
        assert near.moment[1] / (beam.modulus * beam.second_moment) == pytest.approx(
            curvature, abs=1e-5 * scale / min(grasp, beam.span - grasp)
        )


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
        np.vectorize(lambda d: TautString().force(beam, grasp, d)), 0.5 * deflection, deflection
    )
    stored = energy(deflection) - energy(0.5 * deflection)
    # The energy as written cancels where l_a + l_b is nearly the span.
    assert work == pytest.approx(stored, rel=1e-6, abs=1e-12 * beam.modulus * beam.area * beam.span)


@settings(deadline=None)
@given(beams, fractions, deflections, st.sampled_from(sorted(THEORIES)))
def test_force_and_back(beam: Beam, fraction: float, relative: float, name: str) -> None:
    assume(in_range(name, beam))
    theory, grasp, there = theory_named(name), fraction * beam.span, relative * beam.span
    at = np.array([grasp])
    force = theory.under_deflection(beam, grasp, there, at).force
    back = theory.under_force(beam, grasp, force, at)
    assert back.deflection == pytest.approx(there, rel=ROUNDING)
    assert back.across[0] == pytest.approx(there, rel=ROUNDING)


@settings(deadline=None)
@given(beams, fractions, deflections, st.sampled_from(sorted(THEORIES)))
def test_mirrored_and_reversed_pulls(
    beam: Beam, fraction: float, relative: float, name: str
) -> None:
    assume(in_range(name, beam))
    theory, grasp, there = theory_named(name), fraction * beam.span, relative * beam.span
    x = np.linspace(0.0, beam.span, 17)
    pulled = theory.under_deflection(beam, grasp, there, x)
    mirror = theory.under_deflection(
        beam, beam.span - grasp, there, np.clip(beam.span - x, 0, None)
    )
    pushed = theory.under_deflection(beam, grasp, -there, x)
    assert mirror.force == pytest.approx(pulled.force, rel=1e-9)
    assert pushed.force == -pulled.force
    assert mirror.across == pytest.approx(pulled.across, rel=1e-9, abs=1e-9 * there)
    assert pushed.across == pytest.approx(-pulled.across, rel=1e-9, abs=1e-9 * there)
    assert mirror.rotation == pytest.approx(-pulled.rotation, rel=1e-9, abs=1e-9)
    assert mirror.total_stress == pytest.approx(pulled.total_stress, rel=1e-6)


@pytest.mark.parametrize("name", sorted(THEORIES))
@pytest.mark.parametrize("grasp", [7.0, 25.4, 40.0])
def test_axis_starts_and_ends_at_the_clamps_and_passes_the_grasp(name: str, grasp: float) -> None:
    beam = Beam.round(span=50.8, diameter=8.89, modulus=0.310264)
    pulled = theory_named(name).under_force(beam, grasp, 3.0, np.array([0.0, grasp, 50.8]))
    # The exact beam's grasp is free to slide towards the longer part's middle.
    there = pulled.along[1] if name == "exact" else grasp
    assert pulled.along == pytest.approx([0.0, there, 50.8], rel=1e-14, abs=0.0)
    assert pulled.across == pytest.approx([0.0, pulled.deflection, 0.0], abs=1e-12)
    assert pulled.rotation[[0, 2]] == pytest.approx([0.0, 0.0], abs=1e-12)


def test_central_grasp_is_the_thesis() -> None:
    """a = b = L turns the off-centre laws into (5.6) and (5.25), with F = 2P."""
    beam = Beam.round(span=50.8, diameter=8.89, modulus=0.310264)
    half, delta, q = 25.4, 12.8, 0.45
    ei, ea = beam.modulus * beam.second_moment, beam.modulus * beam.area
    cubic = 12.0 * ei * delta / half**3 + 0.72 * q * ea * delta**3 / half**3
    string = ea / half * delta * (1.0 - half / math.hypot(half, delta))
    assert Cubic(q=q).force(beam, half, delta) == pytest.approx(2.0 * cubic, rel=ROUNDING)
    assert TautString().force(beam, half, delta) == pytest.approx(2.0 * string, rel=ROUNDING)


def test_cubic_is_the_linear_clamped_beam_at_small_load() -> None:
    """Delta = F a^3 b^3 / (3 E I S^3), any handbook of beams."""
    beam = Beam.round(span=60.0, diameter=3.0, modulus=2.0)
    linear = 1e-9 * 15.0**3 * 45.0**3 / (3.0 * beam.modulus * beam.second_moment * 60.0**3)
    assert Cubic().deflection(beam, 15.0, 1e-9) == pytest.approx(linear, rel=ROUNDING)


def test_force_of_nothing_bends_nothing() -> None:
    beam = Beam.round(span=50.8, diameter=8.89, modulus=0.310264)
    for name in THEORIES:
        rest: Theory = theory_named(name)
        pulled = rest.under_force(beam, 20.0, 0.0, np.linspace(0.0, 50.8, 9))
        assert not pulled.across.any()
        assert not pulled.rotation.any()
        assert not pulled.total_stress.any()
