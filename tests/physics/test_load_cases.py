"""Pulls along, out of the root, and pressure: closed forms."""

import math

import numpy as np
import pytest

from physics import Beam, Exponential, Law, Linear, NeoHooke, NoEquilibrium
from physics.bed.avulsion import avulse
from physics.load_cases import inflate, nominal_stress, pull_along, rupture_along

TUBE = Beam.round(span=30.0, diameter=8.0, wall=0.2, modulus=0.4, poisson_ratio=0.3)


def sheared(law: Law) -> Law:
    return Linear(shear=True) if isinstance(law, Linear) else law


LAWS: list[Law] = [Linear(), NeoHooke(), Exponential(6.0)]


def test_a_straight_pull_by_each_law() -> None:
    strain, area = 0.3, TUBE.area
    found = pull_along(TUBE, Linear(), elongation=strain * 30.0)
    assert found.force == pytest.approx(0.4 * area * strain, rel=1e-12)
    found = pull_along(TUBE, Exponential(6.0), elongation=strain * 30.0)
    assert found.force == pytest.approx(0.4 / 6.0 * math.expm1(6.0 * strain) * area, rel=1e-10)
    # Incompressible: P = G (stretch - 1/stretch^2).
    soft = TUBE.of_material(0.4, 0.499999)
    found = pull_along(soft, NeoHooke(), elongation=strain * 30.0)
    assert found.force == pytest.approx(0.4 / 3.0 * (1.3 - 1.3**-2) * area, rel=1e-5)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_force_elongation_and_rupture_are_one_curve(law: Law) -> None:
    by_length = pull_along(TUBE, law, elongation=7.0)
    by_force = pull_along(TUBE, law, force=by_length.force)
    assert by_force.elongation == pytest.approx(7.0, rel=1e-9)
    torn = rupture_along(TUBE, law, by_length.stress)
    assert (torn.force, torn.elongation) == pytest.approx((by_length.force, 7.0), rel=1e-9)
    assert nominal_stress(law, TUBE, 1.0 + 7.0 / 30.0) == pytest.approx(by_length.stress, rel=1e-9)


def test_a_thin_tube_under_little_pressure_is_laplace_s() -> None:
    """Hoop strain p r/(E t) (1 - nu/2), lengthwise p r/(E t) (1/2 - nu), nu 1/2."""
    thin = Beam.round(span=30.0, diameter=8.0, wall=0.02, modulus=0.4)
    found = inflate(thin, 1e-8)
    hoop = 1e-8 * 3.99 / 0.02
    assert found.hoop_stress == pytest.approx(hoop, rel=1e-4)
    assert found.axial_stress == pytest.approx(0.5 * hoop, rel=1e-4)
    assert found.diameter / 8.0 - 1.0 == pytest.approx(0.75 * hoop / 0.4, rel=6e-3)
    assert found.length == pytest.approx(30.0, rel=1e-9)


def test_a_tube_bears_a_largest_pressure() -> None:
    found = inflate(TUBE, 0.004)
    # Balance of the cut tube and of its closed end, by true stresses.
    middle, wall = 3.9, 0.2
    along = found.length / 30.0
    # From 2 r_0 h + t_0/(h z) the hoop stretch h.
    hoop = np.roots([2.0 * middle, -found.diameter, wall / along]).max()
    thin = 1.0 / (hoop * along)
    assert found.hoop_stress * hoop == pytest.approx(
        0.004 * middle * hoop / (wall * thin), rel=1e-9
    )
    assert 2.0 * found.axial_stress * along == pytest.approx(found.hoop_stress * hoop, rel=1e-9)
    with pytest.raises(NoEquilibrium, match=r"bears 0.0.* MPa at most"):
        inflate(TUBE, 0.05)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_an_avulsion_along_the_axis_is_a_straight_pull(law: Law) -> None:
    straight, torn = rupture_along(TUBE, law, 0.1), avulse(TUBE, sheared(law), 0.1)
    assert (torn.force, torn.moved) == (straight.force, straight.elongation)
    nearly = avulse(TUBE, sheared(law), 0.1, 1e-6)
    assert nearly.force == pytest.approx(straight.force, rel=1e-5)
    assert nearly.moved == pytest.approx(straight.elongation, rel=1e-4)


def test_an_avulsion_aside_bends_the_root_of_a_stretched_cantilever() -> None:
    """At small angles, with k^2 = N/(E I): v = (P L/N) (1 - tanh(k L)/(k L)), M = P tanh(k L)/k."""
    bar = Beam.round(span=60.0, diameter=4.0, modulus=1000.0)
    angle, threshold = 0.005, 1.0
    torn = avulse(bar, Linear(shear=True), threshold, angle, elements=80)
    tension = bar.modulus * bar.area * torn.moved * math.cos(angle) / 60.0
    k = math.sqrt(tension / (bar.modulus * bar.second_moment))
    slack = 60.0 / tension * (1.0 - math.tanh(60.0 * k) / (60.0 * k))
    moment = torn.moved * math.sin(angle) / slack * math.tanh(60.0 * k) / k
    stress = tension / bar.area + moment * 2.0 / bar.second_moment
    assert stress == pytest.approx(threshold, rel=2e-3)
    assert torn.force == pytest.approx(tension, rel=1e-3)
    assert torn.station == 0.0
    assert avulse(bar, Linear(shear=True), threshold, 0.5).moved < 60.0


def test_what_cannot_be_is_named() -> None:
    with pytest.raises(ValueError, match="give either the force"):
        pull_along(TUBE, Linear())
    with pytest.raises(ValueError, match="a pull along must be 0 or more"):
        pull_along(TUBE, Linear(), force=-1.0)
    with pytest.raises(ValueError, match="a full bar cannot be blown up"):
        inflate(Beam.round(span=30.0, diameter=8.0, modulus=0.4), 0.01)
    with pytest.raises(ValueError, match="pressure must be 0 MPa or more"):
        inflate(TUBE, -0.01)
    with pytest.raises(ValueError, match="angle of an avulsion must be from 0"):
        avulse(TUBE, Linear(), 0.1, 2.0)
