"""The exact beam's limits, balances, symmetries and refusals."""

import math
from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.exact_sweep import random_case, sweep
from physics import Beam, BeyondLaw, Exact, Linear, NeoHooke, TautString, VaryingBeam, theory_named
from physics.exact import fibre_laws, newton
from physics.exact.linear_law import fill_linear
from physics.exact.points import fill_points, fill_sines
from physics.exact.sampling import SAMPLE_ROWS, sample, strain_energy
from physics.exact.symbols import BY_DEFLECTION, BY_FORCE, TIGHT
from physics.section import Ring

THEORIES = {
    "linear": Exact(),
    "shear": Exact(Linear(shear=True)),
    "neo": Exact(NeoHooke()),
}
every = pytest.mark.parametrize("theory", THEORIES.values(), ids=THEORIES)
grasps = pytest.mark.parametrize("grasp", [25.4, 15.0, 40.0])

DUCT = Beam.round(span=50.8, diameter=8.89, modulus=0.310264)
PIPE = Beam(
    span=50.8,
    area=0.25 * math.pi * (8.89**2 - 6.0**2),
    second_moment=math.pi / 64.0 * (8.89**4 - 6.0**4),
    fibre_distance=8.89 / 2.0,
    modulus=0.310264,
)
PULL = 3.5
"""F of figure 6.28, at which the duct breaks, N."""


@pytest.mark.parametrize("beam", [DUCT, PIPE], ids=["solid", "hollow"])
@grasps
@every
def test_small_load_is_the_handbook_beam(theory: Exact, grasp: float, beam: Beam) -> None:
    """Timoshenko's clamped beam, from Castigliano's theorem with its two unknown reactions."""
    ei = beam.modulus * beam.second_moment
    ring, nu = Ring(beam.area, beam.second_moment), beam.poisson_ratio
    coefficient = (
        ring.free_shear_coefficient(nu) if theory.law == NeoHooke() else ring.shear_coefficient(nu)
    )
    ga = beam.modulus / (2.0 * (1.0 + nu)) * coefficient * beam.area
    shear = 1.0 / ga if theory.law.shear else 0.0
    a, s = grasp, beam.span
    b = s - a
    # M = m + r x, less F (x - a) beyond the grasp; no rotation and no shift at the far clamp.
    rows = np.array([[s, s**2 / 2.0], [s**2 / 2.0, s**3 / 3.0 + shear * ei * s]])
    right = np.array([b**2 / 2.0, b**2 * (s / 2.0 - b / 6.0) + shear * ei * b])
    m, r = np.linalg.solve(rows, right)
    linear = (m * a**2 / 2.0 + r * a**3 / 6.0) / ei
    linear = abs(linear) + abs(r) * a * shear
    force = 1e-5
    assert theory.pull(beam, grasp).to_force(force).deflection == pytest.approx(
        force * linear, rel=1e-6
    )


def test_thin_and_far_is_the_string() -> None:
    thin = Beam.round(span=100.0, diameter=0.05, modulus=10.0)
    string = TautString().pull(thin, 50.0).to_deflection(60.0).force
    assert Exact().pull(thin, 50.0).to_deflection(60.0).force == pytest.approx(string, rel=2e-3)


def test_thin_and_far_neo_hooke_is_the_bar_in_tension() -> None:
    thin = Beam.round(span=100.0, diameter=0.5, modulus=10.0, poisson_ratio=0.4)
    deflection = 60.0
    length = math.hypot(50.0, deflection)
    g, k = thin.modulus / 2.8, thin.modulus / 0.6
    stretch = length / 50.0
    low, high = 0.5, 2.0
    for _ in range(80):
        j = 0.5 * (low + high)
        above = k * (j**3 - 1.0) * j**5 > g / 3.0 * (stretch**2 - j**3 / stretch)
        low, high = (low, j) if above else (j, high)
    tension = thin.area * g * (stretch / low**2 - low / stretch**2)
    force = 2.0 * tension * deflection / length
    theory = Exact(NeoHooke())
    assert theory.pull(thin, 50.0).to_deflection(deflection).force == pytest.approx(force, rel=0.02)


@grasps
def test_shear_fades_as_its_stiffness_grows(grasp: float) -> None:
    rigid = replace(VaryingBeam.of(DUCT), shear_areas=np.full(2, 1e9 * DUCT.area))
    unsheared = Exact().pull(DUCT, grasp).to_force(PULL).deflection
    assert Exact(Linear(shear=True)).pull(rigid, grasp).to_force(PULL).deflection == pytest.approx(
        unsheared, rel=1e-7
    )
    assert Exact(Linear(shear=True)).pull(DUCT, grasp).to_force(PULL).deflection > 1.05 * unsheared


@grasps
@every
@pytest.mark.parametrize("beam", [DUCT, PIPE], ids=["solid", "hollow"])
def test_force_is_the_slope_of_the_energy(beam: Beam, theory: Exact, grasp: float) -> None:
    """The discrete equations are the derivatives of the discrete energy: to rounding."""
    solver = theory.pull(beam, grasp)
    at, step = np.array([grasp]), 1e-4
    for deflection in (2.0, 12.0, 20.0):
        energies: list[float] = []
        for side in (-2.0, -1.0, 1.0, 2.0):
            solver.to_deflection(deflection + side * step * deflection)
            energies.append(solver.sample(at).strain_energy)
        slope = (energies[0] - 8.0 * energies[1] + 8.0 * energies[2] - energies[3]) / (
            12.0 * step * deflection
        )
        assert slope == pytest.approx(solver.to_deflection(deflection).force, rel=1e-8)


@grasps
@every
def test_forces_and_moments_balance(theory: Exact, grasp: float) -> None:
    stations = np.linspace(0.0, DUCT.span, 41)
    pulled = theory.pull(DUCT, grasp).to_force(PULL).sample(stations)
    cos, sin = np.cos(pulled.rotation), np.sin(pulled.rotation)
    along = pulled.normal_force * cos + pulled.shear_force * sin
    across = pulled.normal_force * sin - pulled.shear_force * cos
    first, second = stations < grasp, stations > grasp
    assert np.ptp(along) < 1e-12 * PULL
    assert np.ptp(across[first]) < 1e-12 * PULL
    assert np.ptp(across[second]) < 1e-12 * PULL
    assert across[0] - across[-1] == pytest.approx(PULL, rel=1e-12)
    # Moments about the first clamp.
    at = pulled.along[stations == grasp]
    x = float(at[0]) if at.size else float(np.interp(grasp, stations, pulled.along))
    turned = pulled.moment[-1] - pulled.moment[0] + across[-1] * DUCT.span + PULL * x
    assert abs(turned) < (1e-10 if at.size else 1e-2) * PULL * DUCT.span


@every
def test_shear_force_is_the_slope_of_the_moment_at_small_load(theory: Exact) -> None:
    x = np.array([4.0, 5.0, 6.0, 20.0, 30.0, 31.0, 32.0])
    pulled = theory.pull(DUCT, 15.0).to_force(1e-4).sample(x)
    for i in (1, 5):
        slope = (pulled.moment[i + 1] - pulled.moment[i - 1]) / 2.0
        assert pulled.shear_force[i] == pytest.approx(slope, rel=1e-4)
    assert pulled.moment[0] > 0.0 > pulled.moment[3]


@every
def test_axis_moment_and_curvature_belong_together(theory: Exact) -> None:
    """M = E I theta' for the linear law, by differences over a fine mesh."""
    fine = replace(theory, intervals=400)
    x = 20.0 + 1e-2 * np.arange(-1.0, 2.0)
    pulled = fine.pull(DUCT, 15.0).to_force(PULL).sample(x)
    curvature = (pulled.rotation[2] - pulled.rotation[0]) / 2e-2
    ratio = pulled.moment[1] / (DUCT.modulus * DUCT.second_moment * curvature)
    assert ratio == pytest.approx(1.0, rel=0.25 if theory.law == NeoHooke() else 1e-4)
    slope = math.atan2(pulled.across[2] - pulled.across[0], pulled.along[2] - pulled.along[0])
    strain = pulled.normal_force[1] / (DUCT.modulus * DUCT.area)
    if not theory.law.shear:
        assert slope == pytest.approx(pulled.rotation[1], abs=1e-4)
        stretch = math.hypot(pulled.across[2] - pulled.across[0], np.ptp(pulled.along)) / 2e-2
        assert stretch == pytest.approx(1.0 + strain, rel=1e-4)


@grasps
@every
def test_reversed_pull_and_mirrored_grasp(theory: Exact, grasp: float) -> None:
    x = np.linspace(0.0, DUCT.span, 9)
    pulled = theory.pull(DUCT, grasp).to_force(PULL).sample(x)
    pushed = theory.pull(DUCT, grasp).to_force(-PULL).sample(x)
    mirror = theory.pull(DUCT, DUCT.span - grasp).to_force(PULL).sample(DUCT.span - x)
    assert np.array_equal(pushed.across, -pulled.across)
    assert np.array_equal(pushed.moment, -pulled.moment)
    assert np.array_equal(pushed.total_stress, pulled.total_stress)
    assert mirror.across == pytest.approx(pulled.across, abs=1e-10)
    assert mirror.moment == pytest.approx(pulled.moment, abs=1e-10)
    assert mirror.total_stress == pytest.approx(pulled.total_stress, abs=1e-10)
    inner = np.abs(x - grasp) > 1e-9  # at the grasp the shear jumps
    assert mirror.shear_force[inner] == pytest.approx(-pulled.shear_force[inner], abs=1e-10)


@every
def test_half_is_the_whole(theory: Exact) -> None:
    """A central grasp is solved by halves; one beside it, or an uneven beam, is not."""
    half = theory.pull(DUCT, 25.4).to_force(PULL).deflection
    beside = theory.pull(DUCT, 25.4 * (1.0 + 1e-9)).to_force(PULL).deflection
    assert beside == pytest.approx(half, rel=1e-8)


@grasps
@every
def test_varying_beam_with_constant_sections_is_the_constant_beam(
    theory: Exact, grasp: float
) -> None:
    x = np.linspace(0.0, 50.8, 7)
    for beam in (DUCT, PIPE):
        constant = theory.pull(beam, grasp).to_force(PULL).sample(x)
        varying = theory.pull(VaryingBeam.of(beam, 5), grasp).to_force(PULL).sample(x)
        assert varying.across == pytest.approx(constant.across, rel=1e-11, abs=1e-11)
        assert varying.total_stress == pytest.approx(constant.total_stress, rel=1e-9)


@every
def test_varying_beam_is_softer_where_it_is_thin_and_mirrors(theory: Exact) -> None:
    z = np.linspace(0.0, 50.8, 21)
    diameter = 8.89 - 3.0 * z / 50.8
    taper = VaryingBeam(
        stations=z,
        areas=0.25 * math.pi * diameter**2,
        second_moments=math.pi / 64.0 * diameter**4,
        fibre_distances=0.5 * diameter,
        modulus=DUCT.modulus,
    )
    flipped = replace(
        taper,
        areas=taper.areas[::-1],
        second_moments=taper.second_moments[::-1],
        fibre_distances=taper.fibre_distances[::-1],
    )
    x = np.linspace(0.0, 50.8, 6)
    pulled = theory.pull(taper, 20.0).to_force(2.0).sample(x)
    mirror = theory.pull(flipped, 30.8).to_force(2.0).sample(50.8 - x)
    assert mirror.across == pytest.approx(pulled.across, rel=1e-9, abs=1e-9)
    assert mirror.total_stress == pytest.approx(pulled.total_stress, rel=1e-6)
    central = theory.pull(taper, 25.4).to_force(2.0).sample(x)
    assert central.total_stress[-1] > central.total_stress[0]
    thick, thin = (Beam.round(span=50.8, diameter=d, modulus=DUCT.modulus) for d in (8.89, 5.89))
    low, high = (
        theory.pull(thick, 25.4).to_force(2.0).deflection,
        theory.pull(thin, 25.4).to_force(2.0).deflection,
    )
    assert low < central.deflection < high


def test_varying_stiffness_is_integrated() -> None:
    """Small load, stepped beam: m and r from the flexibility integrals of each half."""
    step = VaryingBeam(
        stations=np.array([0.0, 10.0, 10.0, 30.0, 30.0, 40.0]),
        areas=np.full(6, 1.0),
        second_moments=np.array([2.0, 2.0, 1.0, 1.0, 2.0, 2.0]) / 10.0,
        fibre_distances=np.full(6, 0.5),
        modulus=100.0,
    )
    # Half of length 20, M = m + x/2 under a unit force, no rotation at either end.
    x = (np.arange(200000) + 0.5) * 1e-4
    flexibility = np.where(x < 10.0, 5.0, 10.0) / 100.0
    m = -np.sum(flexibility * x / 2.0) / np.sum(flexibility)
    deflection = float(np.sum((m + x / 2.0) * x * flexibility) * 1e-4)
    exact = Exact(intervals=400).pull(step, 20.0).to_force(1e-7).deflection
    assert exact == pytest.approx(1e-7 * deflection, rel=2e-3)


@every
def test_warm_is_cold(theory: Exact) -> None:
    """A solver led through a walk of loads ends where one from rest ends."""
    generator = np.random.default_rng(5)
    for grasp in (25.4, 11.0):
        solver = theory.pull(DUCT, grasp)
        load = 1.0
        for _ in range(60):
            load *= 1.0 + generator.uniform(-0.7, 0.9)
            load = min(max(load, 1e-4), 8.0) * (-1.0 if generator.random() < 0.1 else 1.0)
            warm = solver.to_force(load).deflection
            assert warm == pytest.approx(
                theory.pull(DUCT, grasp).to_force(load).deflection, rel=1e-9
            )
            assert solver.to_deflection(warm).force == pytest.approx(load, rel=1e-9)
            load = abs(load)


@every
@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 2**32 - 1))
def test_any_cold_solve_and_back(theory: Exact, seed: int) -> None:
    generator = np.random.default_rng(seed)
    beam, grasp, deflection = random_case(generator, neo_hooke=theory.law == NeoHooke())
    pulled = (
        theory.pull(beam, grasp).to_deflection(deflection).sample(np.array([0.0, grasp, beam.span]))
    )
    for name in ("along", "across", "rotation", "normal_force", "moment", "total_stress"):
        assert np.all(np.isfinite(getattr(pulled, name)))
    assert pulled.force * deflection > 0.0
    assert pulled.strain_energy > 0.0
    assert pulled.across[1] == pytest.approx(deflection, rel=1e-9)
    assert pulled.along[2] == pytest.approx(beam.span, rel=1e-12)
    assert theory.pull(beam, grasp).to_force(pulled.force).deflection == pytest.approx(
        deflection, rel=1e-9
    )


@pytest.mark.slow
@every
def test_two_thousand_random_cold_solves(theory: Exact) -> None:
    result = sweep(theory, 2000 if theory.law != NeoHooke() else 500, seed=7)
    assert not result.failures


def test_what_a_law_cannot_carry_is_named() -> None:
    """A thin, nearly incompressible tube, pulled a tenth of its diameter from a clamp."""
    tube = Beam(
        span=22.0,
        area=0.25 * math.pi * (10.0**2 - 9.3**2),
        second_moment=math.pi / 64.0 * (10.0**4 - 9.3**4),
        fibre_distance=5.0,
        modulus=1.0,
        poisson_ratio=0.48,
    )
    solver = Exact(NeoHooke()).pull(tube, 1.1)
    with pytest.raises(BeyondLaw, match="neo-hooke law must carry a deflection of 3 mm") as it:
        solver.to_deflection(3.0)
    assert isinstance(it.value, ValueError)
    assert it.value.reason == "gives way"
    assert 1.2 < it.value.deflection < 1.6
    assert it.value.force > 0.0
    # The beam is at rest, and the last equilibrium is one.
    assert solver.force == solver.deflection == 0.0
    before = 0.999 * it.value.deflection
    assert solver.to_deflection(before).force == pytest.approx(it.value.force, rel=0.01)
    with pytest.raises(BeyondLaw, match="beyond a deflection of 1000 spans") as it:
        Exact(Linear(shear=True)).pull(DUCT, 25.4).to_force(1e6)
    assert it.value.reason == "out of reach"


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"intervals": 7}, "intervals must be even"),
        ({"intervals": 2}, "intervals must be even"),
    ],
)
def test_theory_names_what_is_wrong(wrong: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Exact(**wrong)


def test_an_unknown_law_is_named() -> None:
    with pytest.raises(ValueError, match="law must be one of linear, neo-hooke, exponential, got"):
        theory_named("exact", law=cast(Any, "cauchy"))


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"stations": np.array([0.0])}, "stations must be a row of 2"),
        ({"stations": np.array([1.0, 2.0])}, "stations must run from 0 mm"),
        ({"stations": np.array([0.0, -2.0])}, "stations must run from 0 mm"),
        ({"areas": np.array([1.0])}, "areas must have one number of mm\\^2 per station, 2"),
        ({"areas": np.array([1.0, 0.0])}, "every one of areas must be above 0 mm\\^2"),
        ({"shear_areas": np.array([1.0, math.nan])}, "every one of shear_areas"),
        ({"modulus": 0.0}, "modulus must be above 0 MPa"),
        ({"poisson_ratio": 0.5}, "poisson_ratio must be from 0"),
    ],
)
def test_varying_beam_names_what_is_wrong(wrong: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        replace(VaryingBeam.of(DUCT), **wrong)


def test_varying_beam_copies_and_locks_its_rows() -> None:
    areas = np.array([1.0, 2.0])
    beam = replace(VaryingBeam.of(DUCT), areas=areas)
    areas[0] = 5.0
    assert beam.areas[0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        beam.areas[0] = 3.0
    with pytest.raises(ValueError, match="grasp must"):
        Exact().pull(beam, 60.0).to_force(1.0)


def test_rest_is_rest() -> None:
    for theory in THEORIES.values():
        solver = theory.pull(DUCT, 20.0)
        solver.to_force(2.0)
        assert solver.to_force(0.0).deflection == 0.0
        pulled = solver.sample(np.linspace(0.0, DUCT.span, 5))
        assert not pulled.across.any()
        assert not pulled.total_stress.any()
        assert pulled.strain_energy == 0.0


def copied(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.copy()
    if isinstance(value, tuple):
        return tuple(copied(item) for item in value)
    return value


def numbers(*values: Any) -> list[np.ndarray]:
    found: list[np.ndarray] = []
    for value in values:
        if isinstance(value, tuple):
            found += numbers(*value)
        elif value is not None:
            found.append(np.asarray(value, dtype=np.float64))
    return found


@pytest.mark.slow
@every
@grasps
def test_kernels_are_their_python_form(theory: Exact, grasp: float) -> None:
    solver = replace(theory, intervals=8).pull(DUCT, grasp)
    solver.to_force(2.0)
    state, fibres, per_piece, inside = (
        solver._state,
        solver._fibres,
        solver._per_piece,
        solver._grasp,
    )
    points, bounds, x = state[2], solver._bounds, np.linspace(0.0, float(solver._bounds[-1]), 5)
    five = (0.2, 0.9, -0.1, 0.05, 0.3)
    law_of = (1.2, 0.3, 2.0, 1.0, 0.1, 0.25, 0.04, 0.3, 0.3)
    ends, samples = np.zeros((2, bounds.size)), np.zeros((SAMPLE_ROWS, 5))
    calls: list[tuple[Any, ...]] = [
        (fill_sines, points),
        (fibre_laws.shrinkage, 1.4, 0.3, 0.3),
        (fibre_laws.fibre, 1.3, 0.4, 1.1, 0.38, 0.15, -1.0),
        (fibre_laws.fibre, 1.3, 0.4, 1.0, 0.38, 0.15, 3.0),
        (fibre_laws.exponential_fibre, 0.8, 0.7, 0.38, 0.0),
        (fibre_laws.fibre_energy, 1.3, 0.4, 1.0, 0.38, 0.15, 3.0),
        (fibre_laws.fibre_pull, 1.3, 0.4, 0.38, 0.15, -1.0),
        (fibre_laws.section_law, *law_of, -1.0, five, five, five),
        (fibre_laws.section_law, *law_of, 3.0, five, five, five),
        (newton.newton, state, fibres, inside, None, BY_FORCE, 0.11, TIGHT),
        (newton.climb, state, fibres, inside, BY_DEFLECTION, 0.2),
        (newton.solve, state, fibres, inside, BY_DEFLECTION, 0.15),
        (newton.rest, state, fibres),
        (fill_points, state, fibres, per_piece, 2),
        (sample, state, fibres, per_piece, bounds, x, ends, samples),
        (strain_energy, state, fibres, per_piece),
    ]
    if fibres is None:
        calls.append((fill_linear, points, 0, 4, 0.1, 0.2))
    else:
        calls.append((fibre_laws.fill_strains, points, fibres, 0, 4, 0.1, 0.2, 0.3, 0.3))
        calls.append((fibre_laws.fill_fibres, fibres, 0.38, 0.15, -1.0, 2))
        calls.append((fibre_laws.fill_of_fibres, points, fibres, 0, 4, 0.1, 0.2, 0.3, 0.3, -1.0))
    for kernel, *arguments in calls:
        compiled, plain = ([copied(each) for each in arguments] for _ in range(2))
        results = kernel(*compiled), kernel.py_func(*plain)
        for one, other in zip(
            numbers(results[0], *compiled), numbers(results[1], *plain), strict=True
        ):
            assert one == pytest.approx(other, rel=1e-9, abs=1e-11), kernel.__name__
