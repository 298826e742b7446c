"""Distances along the normal and in y are what their definitions say."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from organ_geometry.curves.half_curves import HalfCurves, fit_half_curves

# A boundary is measured as a polygon of 256 corners.
POLYGON = 1e-3


def slanted(slope: float) -> HalfCurves:
    """A band between two parallel lines of a slope, 10 mm apart in y, for x from -20 to 20 mm."""
    top, bottom = np.zeros(7), np.zeros(7)
    top[:2] = -5.0, 20.0 * slope
    bottom[:2] = 5.0, 20.0 * slope
    return HalfCurves(0.0, 20.0, top, bottom)


@settings(deadline=None, max_examples=40)
@given(slope=st.floats(-2.0, 2.0), off=st.floats(-1.0, 1.0), side=st.sampled_from([-5.0, 5.0]))
def test_on_a_slope_the_distance_in_y_is_longer_by_its_secant(
    slope: float, off: float, side: float
) -> None:
    x = np.linspace(-10.0, 10.0, 21)
    points = np.stack([x, side + slope * x + off], axis=1)
    curves = slanted(slope)
    np.testing.assert_allclose(curves.algebraic_distances(points), abs(off), atol=1e-12)
    expected = abs(off) / np.hypot(1.0, slope)
    np.testing.assert_allclose(curves.distances(points), expected, atol=1e-12)


def test_the_polynomial_is_the_thesis_s() -> None:
    # y = a0 + a1 x + ... + a6 x^6, with the powers written out.
    rng = np.random.default_rng(6)
    powers = rng.normal(size=7)
    x = np.linspace(-1.0, 1.0, 50)
    chebyshev = np.asarray(np.polynomial.chebyshev.poly2cheb(powers), dtype=np.float64)
    curves = HalfCurves(3.0, 2.0, chebyshev, chebyshev + 50.0 * (np.arange(7) == 0))
    points = np.stack([3.0 + 2.0 * x, rng.normal(size=50)], axis=1)
    expected = np.abs(points[:, 1] - sum(a * x**n for n, a in enumerate(powers)))
    np.testing.assert_allclose(curves.algebraic_distances(points), expected, atol=1e-12)


def test_on_a_circle_the_ends_make_nearly_all_of_the_distance_in_y() -> None:
    angles = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
    circle = 10.0 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    curves = fit_half_curves(circle)
    normal, algebraic = curves.distances(circle), curves.algebraic_distances(circle)
    # The known floor of degree six on a circle, 0.3 % of its radius.
    assert np.sqrt(np.mean(normal**2)) == pytest.approx(0.030, abs=0.002)
    # No point of a curve is nearer than its nearest, and the short ends only bring it nearer.
    assert (normal <= algebraic + POLYGON).all()
    steep = np.abs(np.cos(angles)) > 0.95
    assert (algebraic[steep] ** 2).sum() > 0.9 * (algebraic**2).sum()
    assert np.sqrt(np.mean(algebraic**2)) > 3.0 * np.sqrt(np.mean(normal**2))
