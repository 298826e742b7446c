"""The general Rayleigh method against textbook beams, and chapter 5 as one case of it."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial import Polynomial

from physics import Beam, BentBeam, Cubic, RayleighBeam, Support

LENGTH, EI = 80.0, 500.0
CLAMP, FAR_CLAMP = Support(0.0), Support(LENGTH)
PIN, FAR_PIN = Support(0.0, slope=False), Support(LENGTH, slope=False)
GUIDE = Support(LENGTH, deflection=False)
X = np.linspace(0.0, LENGTH, 33)
EXACT = 1e-9
"""Relative: the curve is a polynomial of no higher degree, what is left is rounding."""


def beam(*supports: Support, degree: int = 4) -> RayleighBeam:
    return RayleighBeam(LENGTH, EI, supports, degree)


def balanced(bent: BentBeam) -> None:
    """(4.6) with (4.7): work = bending energy + coupling energy (4.8)."""
    coupling_energy = bent.axial_force * bent.shortening
    assert bent.work == pytest.approx(bent.bending_energy + coupling_energy, rel=1e-9)


def test_cantilever_under_an_end_load() -> None:
    """P L^3 / (3 E I), slope P L^2 / (2 E I), moment P L at the clamp."""
    bent = beam(CLAMP, degree=3).bend(forces=[(LENGTH, 0.2)])
    assert bent.deflection(X) == pytest.approx(
        0.2 * X**2 * (3.0 * LENGTH - X) / (6.0 * EI), rel=EXACT, abs=1e-9
    )
    assert bent.slope(np.array([LENGTH])) == pytest.approx(0.2 * LENGTH**2 / (2.0 * EI), rel=EXACT)
    assert bent.moment(X) == pytest.approx(0.2 * (LENGTH - X), abs=1e-9)
    assert bent.shear_force(X) == pytest.approx(np.full_like(X, -0.2), rel=1e-7)
    balanced(bent)


def test_cantilever_under_an_end_moment() -> None:
    """A parabola: M x^2 / (2 E I)."""
    bent = beam(CLAMP).bend(moments=[(LENGTH, 3.0)])
    assert bent.deflection(X) == pytest.approx(3.0 * X**2 / (2.0 * EI), rel=EXACT, abs=1e-9)
    assert bent.coefficients == pytest.approx([0.0, 0.0, 3.0 / (2.0 * EI), 0.0, 0.0], abs=1e-9)
    balanced(bent)


def test_cantilever_under_a_uniform_load() -> None:
    bent = beam(CLAMP).bend(distributed=0.01)
    curve = 0.01 * X**2 * (6.0 * LENGTH**2 - 4.0 * LENGTH * X + X**2) / (24.0 * EI)
    assert bent.deflection(X) == pytest.approx(curve, rel=EXACT, abs=1e-8)
    balanced(bent)


def test_simply_supported_under_a_uniform_load() -> None:
    """5 q L^4 / (384 E I)."""
    bent = beam(PIN, FAR_PIN).bend(distributed=0.01)
    middle = bent.deflection(np.array([0.5 * LENGTH]))
    assert middle == pytest.approx(5.0 * 0.01 * LENGTH**4 / (384.0 * EI), rel=EXACT)
    assert bent.moment(X) == pytest.approx(-0.005 * X * (LENGTH - X), abs=1e-8)
    balanced(bent)


def test_clamped_under_a_uniform_load() -> None:
    """Q L^4 / (384 E I); moment q L^2 / 12 at the clamps, half of it in the middle."""
    bent = beam(CLAMP, FAR_CLAMP).bend(distributed=0.01)
    curve = 0.01 * X**2 * (LENGTH - X) ** 2 / (24.0 * EI)
    assert bent.deflection(X) == pytest.approx(curve, rel=EXACT, abs=1e-9)
    moments = bent.moment(np.array([0.0, 0.5 * LENGTH, LENGTH]))
    assert moments == pytest.approx(0.01 * LENGTH**2 / np.array([12.0, -24.0, 12.0]), rel=1e-8)
    balanced(bent)


def test_propped_cantilever_under_a_growing_load() -> None:
    """Q = q1 x / L: a polynomial load, as a callable; v = q1 (x^5/L - 3 L x^3 + 2 L^2 x^2)/120."""
    load = Polynomial([0.0, 0.02 / LENGTH])
    bent = beam(Support(LENGTH), PIN, degree=5).bend(distributed=load)
    curve = 0.02 * X * (X**4 / LENGTH - 2.0 * LENGTH * X**2 + LENGTH**3) / (120.0 * EI)
    assert bent.deflection(X) == pytest.approx(curve, rel=1e-8, abs=1e-8)
    balanced(bent)


@pytest.mark.parametrize("place", [0.5, 0.3])
def test_a_kink_in_the_shear_is_neared_from_the_stiff_side(place: float) -> None:
    """A load between the supports: v = F a^2 b^2 / (3 E I L), and no polynomial has its kink."""
    a, b = place * LENGTH, (1.0 - place) * LENGTH
    known = 0.1 * a**2 * b**2 / (3.0 * EI * LENGTH)
    at = np.array([a])
    found = [
        float(beam(PIN, FAR_PIN, degree=degree).bend(forces=[(a, 0.1)]).deflection(at)[0])
        for degree in (2, 4, 6, 8, 12)
    ]
    assert found == sorted(found)
    assert found[-1] < known
    assert found[-1] == pytest.approx(known, rel=1e-3)


def test_loads_add_up() -> None:
    held = beam(CLAMP, FAR_PIN, degree=6)
    forces, moments = [(30.0, 0.4), (55.0, -0.1)], [(20.0, 2.0)]
    alone = (
        held.bend(distributed=0.01, axial_force=0.3),
        held.bend(forces=forces, axial_force=0.3),
        held.bend(moments=moments, axial_force=0.3),
    )
    together = held.bend(distributed=0.01, forces=forces, moments=moments, axial_force=0.3)
    added = sum(bent.deflection(X) for bent in alone)
    assert together.deflection(X) == pytest.approx(added, rel=1e-9, abs=1e-9)
    balanced(together)


@pytest.mark.parametrize(
    ("supports", "factor"),
    [
        ((CLAMP,), 0.25),
        ((PIN, FAR_PIN), 1.0),
        ((CLAMP, FAR_PIN), 2.045748),
        ((CLAMP, FAR_CLAMP), 4.0),
        ((CLAMP, GUIDE), 1.0),
    ],
    ids=["clamped-free", "pinned", "clamped-pinned", "clamped", "clamped-guided"],
)
def test_euler_buckling(supports: tuple[Support, ...], factor: float) -> None:
    euler = factor * math.pi**2 * EI / LENGTH**2
    loads = [-beam(*supports, degree=degree).buckling_force() for degree in (4, 6, 8, 10)]
    assert loads == sorted(loads, reverse=True)
    assert loads[-1] == pytest.approx(euler, rel=1e-5)
    with pytest.raises(ValueError, match="axial_force must be above the buckling load"):
        beam(*supports, degree=8).bend(axial_force=-1.01 * euler)


def test_compression_amplifies_until_it_buckles() -> None:
    """A pinned strut in a half sine: 1 / (1 - N/N_E), from one load to the next."""
    held = beam(PIN, FAR_PIN, degree=10)
    euler = math.pi**2 * EI / LENGTH**2

    def sine(x: np.ndarray) -> np.ndarray:
        return 0.01 * np.sin(math.pi * x / LENGTH)

    middle = np.array([0.5 * LENGTH])
    alone = held.bend(distributed=sine).deflection(middle)
    for fraction in (0.2, 0.5, 0.9, 0.99):
        pressed = held.bend(distributed=sine, axial_force=-fraction * euler)
        assert pressed.deflection(middle) / alone == pytest.approx(1.0 / (1.0 - fraction), rel=1e-4)
        balanced(pressed)


def test_tension_leaves_the_string() -> None:
    """Under large tension the uniform load hangs as a parabola, q L^2 / (8 N)."""
    bent = RayleighBeam(LENGTH, 1e-2, (PIN, FAR_PIN), 12).bend(distributed=0.01, axial_force=5.0)
    middle = bent.deflection(np.array([0.5 * LENGTH]))
    assert middle == pytest.approx(0.01 * LENGTH**2 / (8.0 * 5.0), rel=1e-3)


def test_chapter_5_in_figures() -> None:
    """V = a2 (x^2 - 2 x^3 / (3 L)): (5.5), U_B = 2 a2^2 E I L / 3 (5.20), dl = a2^2 L^3/15."""
    bent = beam(CLAMP, GUIDE, degree=3).bend(forces=[(LENGTH, 0.3)])
    a2 = float(bent.coefficients[2])
    assert bent.coefficients == pytest.approx(
        [0.0, 0.0, a2, -2.0 * a2 / (3.0 * LENGTH)], rel=1e-9, abs=1e-12
    )
    assert bent.bending_energy == pytest.approx(2.0 * a2**2 * EI * LENGTH / 3.0, rel=1e-9)
    assert bent.shortening == pytest.approx(a2**2 * LENGTH**3 / 15.0, rel=1e-9)
    assert bent.work == pytest.approx(LENGTH**2 * 0.3 * a2 / 6.0, rel=1e-9)


@settings(deadline=None, max_examples=50)
@given(
    st.floats(10.0, 200.0),
    st.floats(0.5, 10.0),
    st.floats(1e-3, 10.0),
    st.floats(0.0, 1.0),
    st.floats(1e-3, 1.5),
)
def test_chapter_5_is_a_case_of_chapter_4(
    half: float, diameter: float, modulus: float, q: float, relative: float
) -> None:
    """The half beam with N = q E A dl / L (5.10), (5.16) bends as the cubic theory says."""
    duct = Beam.round(span=2.0 * half, diameter=diameter, modulus=modulus)
    ea, ei = duct.modulus * duct.area, duct.modulus * duct.second_moment
    held = RayleighBeam(half, ei, (Support(0.0), Support(half, deflection=False)), 3)
    tip = np.array([half])
    # k1 is its stiffness, and k3 comes of its stretch, which grows with the square.
    unit = held.bend(forces=[(half, 1.0)])
    flexibility = float(unit.deflection(tip)[0])
    stretch = unit.shortening / flexibility**2
    k1, k3 = Cubic(q=q).stiffness(duct, half)
    assert 2.0 / flexibility == pytest.approx(k1, rel=1e-9)
    assert 4.0 * q * ea * stretch**2 / half == pytest.approx(k3, rel=1e-9, abs=1e-300)
    # And under the tension of its own deflection it comes to that deflection.
    delta = relative * half
    force = Cubic(q=q).pull(duct, half).to_deflection(delta).force
    tension = q * ea * stretch * delta**2 / half
    bent = held.bend(forces=[(half, 0.5 * force)], axial_force=tension)
    assert float(bent.deflection(tip)[0]) == pytest.approx(delta, rel=1e-9)


def test_a_guide_in_the_middle_and_supports_that_repeat() -> None:
    """Supports anywhere: two spans over a middle pin, and a clamp named twice."""
    middle = Support(0.5 * LENGTH, slope=False)
    bent = beam(PIN, middle, FAR_PIN, degree=12).bend(distributed=0.01)
    assert bent.deflection(X[[0, 16, 32]]) == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)
    # Half way each span is a propped cantilever's, q l^4 / (192 E I); a polynomial rounds the
    # kink of the moment over the middle.
    known = 0.01 * (0.5 * LENGTH) ** 4 / (192.0 * EI)
    assert bent.deflection(X[[8, 24]]) == pytest.approx([known, known], rel=0.1)
    once = beam(CLAMP, FAR_PIN).bend(distributed=0.01).deflection(X)
    assert beam(CLAMP, CLAMP, FAR_PIN).bend(distributed=0.01).deflection(X) == pytest.approx(once)


@pytest.mark.parametrize(
    ("supports", "degree", "message"),
    [
        ((), 4, "supports must hold the beam"),
        ((PIN,), 4, "supports must hold the beam"),
        ((GUIDE,), 4, "supports must hold the beam"),
        ((GUIDE, Support(0.0, deflection=False)), 4, "supports must hold the beam"),
        ((CLAMP, FAR_CLAMP), 3, "degree must leave the supports a free coefficient: above 3"),
        ((CLAMP,), 1, "degree must be a whole number from 2"),
        ((Support(90.0),), 4, "place of a support must be on the beam, from 0 to 80 mm"),
    ],
)
def test_what_is_no_beam_is_named(supports: tuple[Support, ...], degree: int, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        beam(*supports, degree=degree)


def test_what_is_no_load_is_named() -> None:
    held = beam(CLAMP)
    with pytest.raises(ValueError, match="place of a force must be on the beam"):
        held.bend(forces=[(-1.0, 0.1)])
    with pytest.raises(ValueError, match="moment must be a finite number of N mm"):
        held.bend(moments=[(1.0, math.inf)])
    with pytest.raises(ValueError, match="distributed must be finite all along the beam"):
        held.bend(distributed=math.nan)
