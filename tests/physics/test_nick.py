"""A tear part of the way through a wall, against `physics.tear_growth` and the energy."""

import math
from dataclasses import replace

import numpy as np
import pytest

from physics import Beam, Exact, Exponential, Law, Linear, NeoHooke
from physics.bed import BeamOnBed, Relaxation, SpaceBeam
from physics.bed.readings import WorstStress
from physics.ligament_section import ligament
from physics.section import Ring
from physics.tear_growth import DEEPEST, START, torn_beam
from tests.physics.derivatives import assert_derivatives

BAR = Beam.round(span=50.8, diameter=8.89, modulus=0.31, poisson_ratio=0.3)
LAWS = [Linear(shear=True), NeoHooke(), Exponential(4.0)]


def worst_at(station: float, up: float, across: float = 0.0) -> WorstStress:
    return WorstStress(station, 0.1, up, across)


def deepened(held: BeamOnBed, worst: WorstStress, depth: float) -> None:
    found = held.nick(worst, 0.0)
    left = depth - START
    for _ in range(3):
        found = held.nick(worst, left / 3.0 * held.nicks_of()[0].height)
    assert found == pytest.approx(depth, rel=1e-12)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("at", "side"), [(20.0, 1), (0.0, -1)])
def test_force_and_stress_are_those_of_the_library_s_tear(law: Law, at: float, side: int) -> None:
    # Both spread the crack's compliance along the beam, over lengths that differ: to 1 and 2 %,
    # where the tear takes up to half of the force.
    depth, grasp = 0.5, 20.0
    for deflection in (0.5, 8.0):
        pull = Exact(law).pull(torn_beam(BAR, at, side, depth), grasp).to_deflection(deflection)
        there = pull.sample(np.array([at]))
        left = ligament(Ring(BAR.area, BAR.second_moment), depth)
        assert side * (there.moment[0] - side * left.shift * there.normal_force[0]) < 0.0  # opens
        stress = float(there.normal_stress[0] + there.bending_stress[0])
        held = BeamOnBed(SpaceBeam.of(BAR, law=law, elements=60, nodes_at=[grasp]))
        node = held.take(grasp, along=(False, False, True))
        deepened(held, worst_at(at, 0.1 * side), depth)
        for fraction in (0.25, 0.5, 0.75, 1.0):
            held.lead(node, held.rest_place(node) + np.array([0.0, 0.0, fraction * deflection]))
            held.advance()
        assert held.hand_force(node)[2] == pytest.approx(pull.force, rel=1e-2)
        assert held.worst_stress().total == pytest.approx(stress, rel=2e-2)
        assert held.worst_stress().station == at


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("span", [50.8, 200.0])  # elements that are thick, and thin
def test_the_tangent_is_the_energy_s_second_derivative(law: Law, span: float) -> None:
    random = np.random.default_rng(1)
    beam = SpaceBeam.of(replace(BAR, span=span), law=law, elements=4, nodes_at=[20.0])
    held = BeamOnBed(beam)
    s = held.state
    s.x[:] += 0.1 * random.standard_normal(s.x.shape)
    if isinstance(law, Exponential):
        s.x[:] *= 1.5  # where it begins to be pulled, its tangent jumps
    s.q[:, 1:] += 0.05 * random.standard_normal((5, 3))
    s.q[:] /= np.sqrt((s.q**2).sum(axis=1))[:, None]
    held.nick(worst_at(20.0, 0.06, 0.08), 0.0)
    held.nick(worst_at(20.0, 0.06, 0.08), 2.0)
    assert_derivatives(s, 0)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("relaxes", [False, True])
def test_what_the_lost_fibres_held_is_dissipated(law: Law, *, relaxes: bool) -> None:
    held = BeamOnBed(
        SpaceBeam.of(BAR, law=law, elements=20, nodes_at=[20.0]),
        wall_relaxation=Relaxation((0.3,), (0.05,)) if relaxes else None,
    )
    node = held.take(20.0)
    goal = held.rest_place(node) + np.array([1.0, 5.0, 8.0])
    held.lead(node, goal)
    held.tick(0.5, ticks=250)
    deep, force, lost, worst = 0.0, math.inf, 0.0, held.worst_stress()
    while deep < 0.6:
        worst = held.worst_stress()
        deep = held.nick(worst, 0.5)
        energy = held.energy
        assert energy.dissipated > lost
        lost = energy.dissipated
        held.tick(0.2, ticks=100)
        now = float(np.sqrt((held.hand_force(node) ** 2).sum()))
        assert now < force
        force = now
    # The side is where bending stretched most: obliquely upwards at the hook, else downwards.
    cos, sin = held.nicks_of()[0].side
    assert cos * cos + sin * sin == pytest.approx(1.0, rel=1e-12)
    assert cos * sin > 0.0
    held.lead(node, held.rest_place(node))
    held.tick(1.0, ticks=500)
    end = held.energy
    assert abs(end.residual) < 2e-3 * end.work
    assert end.dissipated == lost
    # And parted in the end: nothing holds the second piece.
    assert held.nick(worst, (DEEPEST - deep) * held.nicks_of()[0].height + 1e-9) >= DEEPEST
    held.tear(worst.station)
    assert np.isfinite(held.state.x).all()


def test_another_depth_of_a_round_section_is_as_stiff_all_round() -> None:
    # A tear's frame is turned: forces must turn with the side on which it begins.
    forces = []
    for angle in (0.0, 0.7, 2.0, 3.1, 4.0, 5.5):
        c, s = math.cos(angle), math.sin(angle)
        held = BeamOnBed(SpaceBeam.of(BAR, elements=20, nodes_at=[20.0]))
        node = held.take(20.0)
        deepened(held, worst_at(20.0, c, -s), 0.4)
        held.lead(node, held.rest_place(node) + np.array([0.0, 4.0 * s, 4.0 * c]))
        held.advance()
        x, y, z = held.hand_force(node)
        forces.append((x, c * z + s * y, c * y - s * z, held.worst_stress().total))
    assert np.array(forces) == pytest.approx(np.tile(forces[0], (6, 1)), rel=1e-6, abs=1e-8)
