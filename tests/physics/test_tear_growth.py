"""A tear through the section: what it leaves, what it weakens, where it runs and where it stops."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from physics import (
    Beam,
    Exact,
    Linear,
    NeoHooke,
    TearPath,
    VaryingBeam,
    break_of,
    calibrated_threshold,
    ligament,
    tear_by_pull,
    tear_under_force,
    tear_under_grip,
    torn_beam,
)
from physics.section import Ring
from physics.tear_growth import DEEPEST, START, weak_length

THEORIES = {
    "linear": Exact(),
    "shear": Exact(Linear(shear=True)),
    "neo": Exact(NeoHooke()),
}
every = pytest.mark.parametrize("theory", THEORIES.values(), ids=THEORIES)
grasps = pytest.mark.parametrize("grasp", [25.4, 12.0])
HELD = 1e-9
"""A root of the criterion: rounding through a solve."""

DUCT = Beam.round(span=50.8, diameter=8.89, modulus=0.310264)
BREAK = 3.558577
"""F of figure 6.28, at which the duct breaks, N."""


def pipe(inner: float) -> Beam:
    return replace(
        DUCT,
        area=0.25 * math.pi * (8.89**2 - inner**2),
        second_moment=math.pi / 64.0 * (8.89**4 - inner**4),
    )


PIPE = pipe(6.0)
beams = pytest.mark.parametrize("beam", [DUCT, PIPE], ids=["solid", "hollow"])


def threshold_of(theory: Exact, beam: Beam = DUCT, grasp: float = 25.4) -> float:
    return calibrated_threshold(theory.pull(beam, grasp), BREAK)


def torn(path: TearPath | None) -> TearPath:
    assert path is not None
    return path


@settings(deadline=None, max_examples=80)
@given(st.floats(0.0, 0.97), st.floats(0.0, 0.95), st.floats(0.1, 20.0))
def test_ligament_is_the_integral_over_what_is_left(
    depth: float, hole: float, radius: float
) -> None:
    lumen = hole * radius
    area = math.pi * (radius**2 - lumen**2)
    left = ligament(Ring(area, 0.25 * math.pi * (radius**4 - lumen**4)), depth)
    front = radius * (1.0 - 2.0 * depth)
    nodes, weights = np.polynomial.legendre.leggauss(60)
    moments = np.zeros(3)
    # Over angles, y = -r cos t, which a Gauss rule integrates to rounding.
    for r, sign in ((radius, 1.0), (lumen, -1.0)):
        if r == 0.0 or front <= -r:
            continue
        end = math.acos(-front / r) if front < r else math.pi
        t = 0.5 * end * (nodes + 1.0)
        y, strip = -r * np.cos(t), 2.0 * (r * np.sin(t)) ** 2 * 0.5 * end * weights
        moments += sign * np.array([strip.sum(), strip @ y, strip @ y**2])
    centroid = moments[1] / moments[0]
    assert left.area == pytest.approx(moments[0], rel=1e-8)
    assert left.shift == pytest.approx(-centroid, abs=1e-8 * radius)
    second = moments[2] - moments[1] * centroid
    assert left.second_moment == pytest.approx(second, rel=1e-5)
    assert left.front_distance == pytest.approx(front - centroid, abs=1e-8 * radius)
    assert left.back_distance == pytest.approx(radius + centroid, abs=1e-8 * radius)


@beams
def test_ligament_of_no_tear_is_the_section(beam: Beam) -> None:
    left = ligament(Ring(beam.area, beam.second_moment), 0.0)
    assert left.area == pytest.approx(beam.area, rel=1e-12)
    assert left.second_moment == pytest.approx(beam.second_moment, rel=1e-12)
    assert left.shift == pytest.approx(0.0, abs=1e-12)
    assert left.front_distance == pytest.approx(beam.fibre_distance)
    assert left.back_distance == pytest.approx(beam.fibre_distance)


def test_half_a_disc_and_half_a_thin_ring_are_the_handbook() -> None:
    half = ligament(Ring(math.pi, 0.25 * math.pi), 0.5)
    assert half.area == pytest.approx(math.pi / 2.0)
    assert half.shift == pytest.approx(4.0 / (3.0 * math.pi))
    assert half.second_moment == pytest.approx(math.pi / 8.0 - 8.0 / (9.0 * math.pi))
    wall = 1e-4
    thin = ligament(Ring(2.0 * math.pi * wall, math.pi * wall), 0.5)
    assert thin.shift == pytest.approx(2.0 / math.pi, rel=1e-3)
    assert thin.second_moment / wall == pytest.approx(math.pi / 2.0 - 4.0 / math.pi, rel=1e-3)


def test_half_an_ellipse_is_half_a_disc_scaled() -> None:
    """Semi-axes 2 across and 1 along the pull."""
    half = ligament(Ring(2.0 * math.pi, 0.5 * math.pi), 0.5)
    assert half.shift == pytest.approx(4.0 / (3.0 * math.pi))
    assert half.second_moment == pytest.approx(2.0 * (math.pi / 8.0 - 8.0 / (9.0 * math.pi)))


@pytest.mark.parametrize("depth", [-0.1, 1.0, 1.5, math.nan])
def test_no_ligament_beyond_the_section(depth: float) -> None:
    with pytest.raises(ValueError, match="depth must be"):
        ligament(Ring(math.pi, 0.25 * math.pi), depth)


@pytest.mark.parametrize("depth", np.linspace(0.05, 0.8, 16))
def test_weak_stretch_of_a_plate_bends_like_a_cracked_one(depth: float) -> None:
    """Rotation by a crack under pure bending, [Tada, Paris and Irwin], 24 V M / (E W^2)."""
    x = float(depth)
    v = 5.93 - 19.69 * x + 37.14 * x**2 - 35.84 * x**3 + 13.12 * x**4
    cracked = 24.0 * (x / (1.0 - x)) ** 2 * v
    weak = 12.0 * weak_length(1.0, x) * ((1.0 - x) ** -3 - 1.0)
    assert weak == pytest.approx(cracked, rel=0.1)


@every
def test_sections_all_off_the_axis_are_the_same_beam_elsewhere(theory: Exact) -> None:
    """Clamps hold every line of the beam; only what they hold it by has moved."""
    moved = replace(VaryingBeam.of(DUCT), offsets=np.full(2, 1.3))
    at = np.array([0.0, 25.4])
    here = theory.pull(DUCT, 25.4).to_deflection(12.0).sample(at)
    there = theory.pull(moved, 25.4).to_deflection(12.0).sample(at)
    assert there.force == pytest.approx(here.force, rel=1e-4)
    assert there.strain_energy == pytest.approx(here.strain_energy, rel=1e-4)
    assert there.total_stress == pytest.approx(here.total_stress, rel=2e-3)
    about_centroid = there.moment + 1.3 * there.normal_force
    assert about_centroid == pytest.approx(here.moment, rel=2e-3)


@grasps
@every
@pytest.mark.parametrize("depth", [0.2, 0.6])
def test_force_of_a_torn_beam_is_the_slope_of_its_energy(
    theory: Exact, grasp: float, depth: float
) -> None:
    event = break_of(theory.pull(DUCT, grasp), threshold_of(theory, grasp=grasp))
    assert event is not None
    beam = torn_beam(DUCT, event.check.station, event.check.tension_side, depth)
    solver = theory.pull(beam, grasp)
    at, step = np.array([grasp]), 1e-3
    energies: list[float] = []
    for side in (-2.0, -1.0, 1.0, 2.0):
        solver.to_deflection((1.0 + side * step) * event.deflection)
        energies.append(solver.sample(at).strain_energy)
    slope = (energies[0] - 8.0 * energies[1] + 8.0 * energies[2] - energies[3]) / (
        12.0 * step * event.deflection
    )
    assert slope == pytest.approx(solver.to_deflection(event.deflection).force, rel=1e-7)


@every
@grasps
@pytest.mark.parametrize("depth", [0.1, 0.4, 0.7])
def test_torn_beam_is_converged(theory: Exact, grasp: float, depth: float) -> None:
    """The steps of the section are bounds of elements: the order of the error stays."""
    beam = torn_beam(DUCT, 0.0 if grasp < 25.0 else grasp, -1 if grasp < 25.0 else 1, depth)
    coarse, fine = theory, replace(theory, intervals=80)
    assert coarse.pull(beam, grasp).to_deflection(9.0).force == pytest.approx(
        fine.pull(beam, grasp).to_deflection(9.0).force, rel=1e-4
    )


@beams
def test_tear_of_no_depth_is_no_tear(beam: Beam) -> None:
    assert torn_beam(beam, 25.4, 1, 0.0) is beam
    whole = Exact().pull(beam, 25.4).to_deflection(11.0).force
    assert Exact().pull(torn_beam(beam, 25.4, 1, 1e-4), 25.4).to_deflection(
        11.0
    ).force == pytest.approx(whole, rel=1e-5)


RUNS = [(theory, DUCT) for theory in THEORIES.values()]
# With linear shear a hollow section shears away before its bending stress gets that far.
RUNS += [(THEORIES["linear"], PIPE), (THEORIES["neo"], PIPE)]


@grasps
@pytest.mark.parametrize(("theory", "beam"), RUNS)
def test_constant_force_runs_through(theory: Exact, beam: Beam, grasp: float) -> None:
    path = torn(tear_under_force(theory, beam, grasp, threshold_of(theory, beam, grasp)))
    assert not path.arrested
    assert path.forces == pytest.approx(BREAK, rel=1e-9)
    assert np.all(np.diff(path.depths) > 0.0)
    assert np.all(np.diff(path.deflections) > 0.0)
    assert path.depths[-1] > 0.6
    # Further on a sheared or squeezed ligament turns instead of bending.
    rising = path.stresses[path.depths <= 0.35]
    assert np.all(np.diff(rising) > 0.0)
    assert np.all(path.stresses[1:] > path.threshold)


@grasps
@beams
@every
def test_growth_under_a_grip_unloads_and_releases_energy(
    theory: Exact, beam: Beam, grasp: float
) -> None:
    threshold = 0.5 * threshold_of(theory, beam, 25.4)
    path = torn(tear_under_grip(theory, beam, grasp, threshold))
    assert np.all(path.deflections == path.deflections[0])
    assert np.all(np.diff(path.forces) < 0.0)
    assert np.all(np.diff(path.energies) < 0.0)
    assert path.arrested == (path.stresses[-1] <= threshold * (1.0 + HELD))


@every
@grasps
def test_energy_released_is_the_area_between_the_force_curves(theory: Exact, grasp: float) -> None:
    path = torn(tear_under_grip(theory, DUCT, grasp, threshold_of(theory, grasp=grasp), start=0.3))
    depth, held = path.depths[1], path.deflections[0]
    beam = torn_beam(DUCT, path.station, path.tension_side, float(depth))
    nodes, weights = np.polynomial.legendre.leggauss(12)
    area = sum(
        0.5
        * held
        * w
        * (
            theory.pull(DUCT, grasp).to_deflection(x).force
            - theory.pull(beam, grasp).to_deflection(x).force
        )
        for x, w in zip(0.5 * held * (nodes + 1.0), weights, strict=True)
    )
    assert path.energies[0] - path.energies[1] == pytest.approx(area, rel=1e-5)


def test_stiff_grip_near_a_clamp_stops_the_tear() -> None:
    """Held a twentieth past the break at 12 mm, the tear stops a fifth into the duct."""
    theory, grasp = Exact(), 12.0
    threshold = threshold_of(theory, grasp=grasp)
    event = break_of(theory.pull(DUCT, grasp), threshold)
    assert event is not None
    held = 1.05 * event.deflection
    path = torn(tear_under_grip(theory, DUCT, grasp, threshold, deflection=held))
    assert path.arrested
    assert path.stresses[-1] == pytest.approx(threshold, rel=HELD)
    assert np.all(path.stresses[1:-1] > threshold)
    assert 0.15 < path.depths[-1] < 0.3
    coarse = torn(tear_under_grip(theory, DUCT, grasp, threshold, deflection=held, steps=10))
    assert coarse.depths[-1] == pytest.approx(path.depths[-1], rel=1e-3)


def test_further_pull_grows_a_standing_tear_until_it_is_through() -> None:
    theory, grasp = Exact(), 12.0
    threshold = threshold_of(theory, grasp=grasp)
    stopped = torn(tear_under_grip(theory, DUCT, grasp, threshold))
    path = torn(tear_by_pull(theory, DUCT, grasp, threshold))
    assert stopped.arrested
    assert not path.arrested
    assert path.depths[1] == stopped.depths[-1] == START
    assert path.forces[1] == pytest.approx(stopped.forces[-1])
    assert np.all(np.diff(path.deflections) >= 0.0)
    assert np.all(np.diff(path.depths) >= 0.0)
    assert path.deflections[-1] > 1.1 * path.deflections[0]
    assert path.depths[-1] == DEEPEST
    grown = np.diff(path.deflections) > 0.0
    assert path.stresses[1:][grown] == pytest.approx(threshold, rel=HELD)
    # Held anywhere on the way the tear stands as deep.
    half = int(np.searchsorted(path.depths, 0.4))
    held = torn(
        tear_under_grip(theory, DUCT, grasp, threshold, deflection=float(path.deflections[half]))
    )
    assert held.arrested
    assert held.depths[-1] == pytest.approx(path.depths[half], rel=1e-6)


@settings(deadline=None, max_examples=15)
@given(st.sampled_from(list(THEORIES)), st.floats(8.0, 42.0), st.floats(0.02, 0.12))
def test_mirrored_grasp_tears_alike(name: str, grasp: float, threshold: float) -> None:
    for tear in (tear_under_grip, tear_by_pull):
        here = torn(tear(THEORIES[name], DUCT, grasp, threshold, steps=8))
        there = torn(tear(THEORIES[name], DUCT, DUCT.span - grasp, threshold, steps=8))
        assert there.tension_side == here.tension_side
        if abs(grasp - 25.4) > 1e-6:
            assert there.station == pytest.approx(DUCT.span - here.station, abs=1e-9)
        assert there.depths == pytest.approx(here.depths, rel=1e-6)
        assert there.forces == pytest.approx(here.forces, rel=1e-6)
        assert there.deflections == pytest.approx(here.deflections, rel=1e-6)


@settings(deadline=None, max_examples=15)
@given(st.floats(8.0, 25.0), st.floats(1.0, 1.2), st.floats(1.0, 1.2))
def test_tougher_never_tears_deeper(grasp: float, past: float, tougher: float) -> None:
    theory = Exact()
    threshold = threshold_of(theory, grasp=grasp)
    event = break_of(theory.pull(DUCT, grasp), threshold)
    assert event is not None
    held = past * event.deflection
    weak = torn(tear_under_grip(theory, DUCT, grasp, threshold, deflection=held, steps=20))
    tough = torn(
        tear_under_grip(theory, DUCT, grasp, tougher * threshold, deflection=held, steps=20)
    )
    assert tough.depths[-1] <= weak.depths[-1] * (1.0 + 1e-9)


def test_below_the_break_nothing_tears() -> None:
    theory = Exact()
    threshold = threshold_of(theory)
    for path in (
        tear_under_force(theory, DUCT, 25.4, threshold, force=0.9 * BREAK),
        tear_under_grip(theory, DUCT, 25.4, threshold, deflection=5.0),
    ):
        assert torn(path).arrested
        assert torn(path).depths.tolist() == [0.0]
        assert torn(path).stresses[0] < threshold


def test_a_threshold_out_of_reach_is_no_tear() -> None:
    assert tear_under_force(Exact(), DUCT, 25.4, 1e9) is None
    assert tear_under_grip(Exact(), DUCT, 25.4, 1e9) is None
    assert tear_by_pull(Exact(), DUCT, 25.4, 1e9) is None


def test_thin_ring_tears_as_well() -> None:
    thin = pipe(8.4)
    theory = Exact()
    path = torn(tear_by_pull(theory, thin, 25.4, 0.05))
    assert not path.arrested
    assert np.all(np.isfinite(path.stresses))
    assert path.forces[-1] < 0.6 * path.forces[0]


def test_paths_are_locked() -> None:
    path = torn(tear_under_grip(Exact(), DUCT, 25.4, 0.1, steps=3))
    with pytest.raises(ValueError, match="read-only"):
        path.depths[0] = 1.0


def test_bad_input_is_named() -> None:
    theory = Exact()
    with pytest.raises(ValueError, match="threshold must be above 0 MPa"):
        tear_under_force(theory, DUCT, 25.4, 0.0)
    with pytest.raises(ValueError, match="grasp must lie between the clamps"):
        tear_under_grip(theory, DUCT, 60.0, 0.2)
    with pytest.raises(ValueError, match="force must be above 0 N"):
        tear_under_force(theory, DUCT, 25.4, 0.2, force=-1.0)
    with pytest.raises(ValueError, match="deflection must be above 0 mm"):
        tear_under_grip(theory, DUCT, 25.4, 0.2, deflection=math.nan)
    with pytest.raises(ValueError, match="start must be above 0"):
        tear_by_pull(theory, DUCT, 25.4, 0.2, start=0.0)
    with pytest.raises(ValueError, match="steps must be 2 or more"):
        tear_by_pull(theory, DUCT, 25.4, 0.2, steps=1)
    with pytest.raises(ValueError, match="station must be from 0"):
        torn_beam(DUCT, 60.0, 1, 0.2)
    with pytest.raises(ValueError, match="tension_side must be 1 or -1"):
        torn_beam(DUCT, 25.4, 0, 0.2)
    with pytest.raises(ValueError, match="one number of mm per station"):
        replace(VaryingBeam.of(DUCT), offsets=np.zeros(3))
    with pytest.raises(ValueError, match="every one of offsets must be a finite"):
        replace(VaryingBeam.of(DUCT), offsets=np.array([0.0, math.inf]))
