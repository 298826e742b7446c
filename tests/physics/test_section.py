"""Rings: fibres, shear coefficients, lateral stretch."""

import math

import numpy as np
import pytest

from physics.section import Ring, lateral_constant

RADII = [(1.0, 0.0), (2.0, 0.4), (1.0, 0.9), (3.0, 2.999)]


def ring(outer: float, inner: float) -> Ring:
    area = math.pi * (outer**2 - inner**2)
    return Ring(area, 0.25 * math.pi * (outer**4 - inner**4))


def moment(outer: float, inner: float, power: int) -> float:
    """Mean of the power of the distance from the axis, by polar integration."""
    around = {2: 0.5, 4: 0.375}[power]
    radial = (outer ** (power + 2) - inner ** (power + 2)) / (power + 2)
    return around * radial / (0.5 * (outer**2 - inner**2))


@pytest.mark.parametrize(("outer", "inner"), RADII)
def test_hole_is_found_back(outer: float, inner: float) -> None:
    assert ring(outer, inner).hole == pytest.approx((inner / outer) ** 2, abs=1e-12)


@pytest.mark.parametrize(("outer", "inner"), RADII)
def test_fibres_integrate_the_section_to_the_fourth_power(outer: float, inner: float) -> None:
    distance, weight = ring(outer, inner).fibres
    for power in (2, 4):
        assert 2.0 * weight * distance**power == pytest.approx(moment(outer, inner, power))
    assert 0.0 < weight < 0.5
    assert distance < outer


def test_fibres_of_disc_and_thin_ring() -> None:
    assert ring(1.0, 0.0).fibres == pytest.approx((math.sqrt(0.5), 0.25))
    assert ring(1.0, 1.0 - 1e-7).fibres == pytest.approx((math.sqrt(0.75), 1.0 / 3.0))


def test_soft_section_is_a_solid_ellipse() -> None:
    """Semi-axes 2 across and 1 along the pull: fibres at b/sqrt(2) with a quarter each."""
    ellipse = Ring(math.pi * 2.0, 0.25 * math.pi * 2.0)
    assert ellipse.hole == 0.0
    assert ellipse.fibres == pytest.approx((math.sqrt(0.5), 0.25))


def test_shear_coefficients_between_disc_and_thin_ring() -> None:
    nu = 0.3
    disc, thin = ring(1.0, 0.0), ring(1.0, 1.0 - 1e-9)
    assert disc.shear_coefficient(nu) == pytest.approx(6.0 * 1.3 / 8.8)
    assert thin.shear_coefficient(nu) == pytest.approx(2.0 * 1.3 / 4.9)
    assert disc.free_shear_coefficient(nu) == pytest.approx(6.0 * 1.69 / (7.0 + 3.6 + 0.36))
    assert thin.free_shear_coefficient(nu) == pytest.approx(1.3 / 2.3)
    # Without Poisson's ratio nothing shrinks sideways and the two are one.
    middle = ring(1.0, 0.6)
    assert middle.shear_coefficient(0.0) == pytest.approx(middle.free_shear_coefficient(0.0))


@pytest.mark.parametrize(("nu", "error"), [(0.25, 0.036), (0.3, 0.016), (0.4, 0.002), (0.49, 0.01)])
def test_lateral_constant_fits_the_bar(nu: float, error: float) -> None:
    """The bar's own equation, solved here by bisection: G/3 (l^2 - j^3/l) = K (j^3-1) j^5."""
    constant = lateral_constant(nu)
    ratio = (1.0 - 2.0 * nu) / (2.0 * (1.0 + nu))
    for stretch in np.linspace(0.6, 3.5, 30):
        low, high = 0.1, 3.0
        for _ in range(80):
            j = 0.5 * (low + high)
            above = j**8 - j**5 > ratio * (stretch**2 - j**3 / stretch)
            low, high = (low, j) if above else (j, high)
        lateral = math.sqrt(low**3 / stretch)
        excess = stretch - 1.0
        fitted = (1.0 + constant * excess) / (1.0 + (constant + nu) * excess)
        assert fitted == pytest.approx(lateral, rel=error)
