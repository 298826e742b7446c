"""The compiled cubic against the closed form by sinh, one force at a time and in arrays."""

import math
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from physics import Beam, Cubic
from physics.cubic_kernels import cubic_deflection, fill_cubic_deflections

ROUNDING = 1e-12
"""Relative: asinh of a large number has the rounding of its logarithm."""
DUCT = Beam.round(span=50.8, diameter=8.89, modulus=0.310264)

beams = st.builds(
    Beam.round,
    span=st.floats(5.0, 200.0),
    diameter=st.floats(0.05, 30.0),
    modulus=st.floats(1e-3, 1e3),
)
fractions = st.floats(0.05, 0.95)
factors = st.one_of(st.just(0.0), st.floats(1e-9, 1.0))
magnitudes = st.floats(-250.0, 250.0).map(lambda power: 10.0**power)
loads = st.one_of(st.just(0.0), st.floats(-1e3, 1e3), magnitudes, magnitudes.map(lambda f: -f))


@settings(deadline=None)
@given(beams, fractions, factors, st.lists(loads, max_size=20))
def test_array_is_the_closed_form_force_by_force(
    beam: Beam, fraction: float, q: float, forces: list[float]
) -> None:
    cubic, grasp = Cubic(q=q), fraction * beam.span
    row = np.array(forces, dtype=np.float64)
    before = row.copy()
    got = cubic.deflections(beam, grasp, row)
    want = [cubic.pull(beam, grasp).to_force(force).deflection for force in forces]
    assert got == pytest.approx(np.array(want), rel=ROUNDING, abs=0.0)
    assert got.dtype == np.float64
    assert (row == before).all()


@settings(deadline=None)
@given(st.floats(1e-6, 1e6), st.one_of(st.just(0.0), st.floats(1e-12, 1e6)), loads)
def test_kernel_solves_the_cubic_and_is_odd(k1: float, k3: float, force: float) -> None:
    delta = cubic_deflection(k1, k3, force)
    assert cubic_deflection(k1, k3, -force) == -delta
    if abs(force) < 1e90:  # delta^3 overflows beyond
        # Below the smallest normal number a float has fewer digits.
        least = sys.float_info.min
        assert k1 * delta + k3 * delta**3 == pytest.approx(force, rel=ROUNDING, abs=least)


@settings(deadline=None)
@given(loads)
def test_kernel_is_its_python_form(force: float) -> None:
    """The compiler may fuse a product and a sum: a few last digits."""
    k1, k3 = Cubic().stiffness(DUCT, 25.4)
    python = getattr(cubic_deflection, "py_func", cubic_deflection)
    compiled = cubic_deflection(k1, k3, force)
    assert compiled == pytest.approx(python(k1, k3, force), rel=1e-14, abs=0.0)


def test_cube_root_is_exact_over_the_whole_range() -> None:
    """Far beyond bending delta is the cube root of F/k3, near rest F/k1, for every exponent."""
    forces = 10.0 ** np.arange(-300.0, 300.0, 0.37)
    deflections = np.empty_like(forces)
    fill_cubic_deflections(1.0, 1.0, forces, deflections)
    far, near = forces > 1e24, forces < 1e-8
    assert deflections[far] == pytest.approx(np.cbrt(forces[far]), rel=1e-14, abs=0.0)
    assert deflections[near] == pytest.approx(forces[near], rel=1e-14, abs=0.0)
    assert (np.diff(deflections) > 0.0).all()


def test_out_is_filled_and_returned() -> None:
    forces = np.linspace(-4.0, 4.0, 17)
    want = Cubic().deflections(DUCT, 20.0, forces)
    out = np.empty(34)[::2]
    assert Cubic().deflections(DUCT, 20.0, forces, out=out) is out
    assert (out == want).all()
    in_place = forces.copy()
    assert Cubic().deflections(DUCT, 20.0, in_place, out=in_place) is in_place
    assert (in_place == want).all()
    reversed_row = Cubic().deflections(DUCT, 20.0, forces[::-1])
    assert reversed_row == pytest.approx(want[::-1], rel=1e-15, abs=0.0)
    assert want == pytest.approx(-want[::-1], rel=0.0, abs=0.0)


def test_fitted_q_goes_force_by_force() -> None:
    forces = np.array([-3.0, 0.0, 1e-6, 0.5, 3.5])
    cubic = Cubic(q="fitted")
    want = [cubic.pull(DUCT, 20.0).to_force(force).deflection for force in forces.tolist()]
    assert cubic.deflections(DUCT, 20.0, forces).tolist() == want
    assert cubic.deflections(DUCT, 20.0, np.empty(0)).shape == (0,)


@pytest.mark.parametrize("q", [0.5, "fitted"])
def test_bad_input_is_named(q) -> None:
    cubic, forces = Cubic(q=q), np.array([1.0, 2.0])
    with pytest.raises(ValueError, match=r"forces must be a row .* in N, got shape \(2, 1\)"):
        cubic.deflections(DUCT, 20.0, forces[:, None])
    for wrong in (math.nan, math.inf):
        with pytest.raises(ValueError, match=rf"forces must be finite numbers of N, got {wrong}"):
            cubic.deflections(DUCT, 20.0, np.array([1.0, wrong]))
    with pytest.raises(ValueError, match=r"out must be 2 float64 in a row.*shape \(3,\)"):
        cubic.deflections(DUCT, 20.0, forces, out=np.empty(3))
    with pytest.raises(ValueError, match=r"out must be 2 float64 in a row.*float32"):
        cubic.deflections(DUCT, 20.0, forces, out=np.empty(2, "f4"))  # pyright: ignore[reportArgumentType]
    with pytest.raises(ValueError, match="grasp must lie between the clamps"):
        cubic.deflections(DUCT, 60.0, forces)
