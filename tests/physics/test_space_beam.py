"""The beam in space: its derivatives, the exact beam, published bends and buckling."""

import math
from decimal import Decimal, localcontext

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from physics import Beam, Exact, Exponential, Law, Linear, NeoHooke, law_named
from physics.bed import BeamOnBed, Hand, SpaceBeam, Strands, pull
from physics.bed import kernels as k
from physics.exponential import MOST, exponential_stress
from physics.many import Ducts, solve_many
from tests.physics.derivatives import assert_derivatives, turn_whole

DUCT = Beam.round(span=50.8, diameter=8.89, modulus=0.310264)


def deformed(seed: int, law: NeoHooke | Exponential | None = None) -> BeamOnBed:
    """A beam of three elements and nine strands, turned and stretched every way."""
    rng = np.random.default_rng(seed)
    tube = Beam.round(span=3.0, diameter=0.6, modulus=3.0, wall=0.1)
    area, inertia = np.array([tube.area]), tube.second_moment * np.array([[1.0], [1.3]])
    rows = None
    if law is not None:
        rows, _ = law.fibres_in_space(3.0, 0.3, area, (*inertia,), (area, area))
    beam = SpaceBeam.from_axis(
        span=3.0,
        elements=3,
        stiffness=rng.random(6) * 5 + 1,
        ends=("free", "free"),
        fibres=rows,
    )
    count = 9
    elongations = np.array([0.1, 0.5, 9, 9, 0.5, 0.2, 9, 1, 1])
    strands = Strands(
        rng.random(count) * 3,
        rng.normal(size=(count, 3)),
        rng.normal(size=(count, 3)),
        rng.random(count) + 1,
        rng.random(count) + 0.1,
        elongations,
        2 * elongations,
        np.array([0.0, 1, 0, 1, 0, 1, 0, 1, 0]),
    )
    made = BeamOnBed(beam, strands, floor=np.full(4, 0.7), rods=3)
    state = made.state
    size = 0.3 if law is None else 0.1
    state.x[:] += rng.normal(size=(4, 3)) * size
    if isinstance(law, Exponential):
        state.x[:] *= 1.5  # where it begins to be pulled, its tangent jumps
    state.q[:] += rng.normal(size=(4, 4)) * size
    state.q[:] /= np.sqrt((state.q**2).sum(axis=1))[:, None]
    state.strain[:] += rng.normal(size=(3, 6)) * 0.2
    state.damage[::3] = 0.3
    return made


@pytest.mark.slow
@pytest.mark.parametrize("kind", [k.FROZEN, k.INCREMENTAL])
@pytest.mark.parametrize(
    ("seed", "thin", "law"),
    [
        (1, 0.0, None),
        (2, 0.0, None),
        (2, 0.6, None),
        (1, 0.0, NeoHooke()),
        (2, 0.6, NeoHooke()),
        (1, 0.0, Exponential(0.0)),
        (1, 0.6, Exponential(5.0)),
    ],
)
def test_gradient_and_tangent_are_the_energy_s_differences(
    kind: int, seed: int, thin: float, law: NeoHooke | Exponential | None
) -> None:
    state = deformed(seed, law).state
    state.chord[1:, :2] = thin, 0.5 * thin
    if kind == k.INCREMENTAL and thin:
        # Rods pressed into the first node beside the shaft, into the last past the tip, and into
        # another past the other end.
        along, thick, in_use, short = np.array([0.0, 0.6, 0.8]), 0.5, 1.0, 1.0
        end = state.x[1] - [0.0, 0.3, 0.6]
        for rod, (tip, length) in enumerate(
            (
                (state.x[0] - [0.0, 0.8, 0.3], math.inf),
                (state.x[3] + [0.0, 0.8, 0.3], math.inf),
                (end - short * along, short),
            )
        ):
            state.rods[rod] = *tip, *along, thick, in_use, length
    k.assemble(state, kind, 0.0)
    assert state.pull.any(axis=1).all() == state.rods.any()
    if law == NeoHooke():
        assert state.fibres[0].min() > 0.5  # below, the tangent is not exact
    assert_derivatives(state, kind)


@pytest.mark.parametrize("law", [None, NeoHooke(), Exponential(5.0)])
def test_turning_the_whole_changes_nothing(law: NeoHooke | Exponential | None) -> None:
    made = deformed(3, law)
    state = made.state
    state.damage[:] = 1.0
    state.floor[:] = 0.0
    before = k.assemble(state, k.FROZEN, 0.0)
    section = state.section.copy()
    turn_whole(state)
    assert k.assemble(state, k.FROZEN, 0.0) == pytest.approx(before, rel=1e-12)
    assert state.section == pytest.approx(section, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("grasp", [25.4, 15.24])
def test_without_strands_it_is_the_exact_beam(grasp: float) -> None:
    errors = []
    for elements in (40, 80, 160):
        beam = SpaceBeam.of(DUCT, elements=elements, nodes_at=[grasp])
        hand = Hand(at=grasp, path=((0, 0, 10.0),), steps=5, along=(False, True, True))
        history = pull(beam, None, [hand])
        solver = Exact(Linear(shear=True), intervals=80).pull(DUCT, grasp)
        force = [solver.to_deflection(float(z)).force for z in history.hands[:, 0, 2]]
        sampled = solver.sample(np.array([0.0, grasp, DUCT.span]))
        stress = (sampled.normal_stress + sampled.bending_stress).max()
        assert history.stress is not None
        # Nothing is dissipated, and the hand's work is what the exact beam stores.
        assert history.stored[-1] == pytest.approx(sampled.strain_energy, rel=6e-2 / elements)
        assert history.dissipated[-1] == history.snap[-1] == 0.0
        errors.append([*(history.forces[:, 0, 2] / force - 1.0), history.stress[-1] / stress - 1.0])
    size = np.abs(errors)
    assert size[1].max() < 1e-3
    assert np.log2(size[:-1] / size[1:]).min() > 1.8  # second order


def test_bathe_s_bend() -> None:
    """A quarter of a right angle of radius 100, under a force out of its plane."""
    angles = np.linspace(0, math.pi / 4, 33)
    axis = 100.0 * np.stack([np.sin(angles), 1 - np.cos(angles), 0 * angles], axis=1)
    stiffness = np.array([1e7, 5e6, 5e6, 1e7 / 12, 1e7 / 12, 1e7 / 12])
    path = ((0, 0, 300.0), (0, 0, 600.0))
    tips = []
    for elements in (8, 16, 32):
        beam = SpaceBeam.from_axis(
            axis=axis, elements=elements, ends=("clamped", "free"), stiffness=stiffness
        )
        hand = Hand(at=beam.span, path=path, by="force", steps=2)
        tips.append(beam.places[-1] + pull(beam, None, [hand]).hands[:, 0])
    # [Bathe and Bolourchi 1979], eight straight beams; [Simo and Vu-Quoc 1986], eight linear ones.
    bathe = np.array([[59.2, 22.5, 39.5], [47.2, 15.9, 53.4]])
    simo = np.array([[58.84, 22.33, 40.08], [47.23, 15.79, 53.37]])
    assert np.abs(tips[2] - bathe).max() < 0.7
    assert np.abs(tips[2] - simo).max() < 0.13
    orders = np.log2(np.abs(tips[0] - tips[1]).max(axis=1) / np.abs(tips[1] - tips[2]).max(axis=1))
    assert orders.min() > 1.8


@pytest.mark.parametrize("direction", [0, 1, 2])
def test_a_quarter_circle_bends_and_twists_as_castigliano_says(direction: int) -> None:
    radius, bending, twisting, size = 40.0, 100.0, 70.0, 1e-5
    angles = np.linspace(0.0, math.pi / 2.0, 25)
    axis = radius * np.stack([np.sin(angles), 0.0 * angles, 1.0 - np.cos(angles)], axis=1)
    rows = np.array([1e4, 1e5, 1e5, twisting, bending, bending])
    beam = SpaceBeam.from_axis(axis=axis, elements=100, ends=("clamped", "free"), stiffness=rows)
    force = [0.0, 0.0, 0.0]
    force[direction] = size
    history = pull(beam, None, [Hand(at=beam.span, path=(tuple(force),), by="force", steps=1)])  # type: ignore[arg-type]
    far = 0.75 * math.pi - 2.0
    expected = (math.pi / 4 / bending, math.pi / 4 / bending + far / twisting, far / bending)[
        direction
    ]
    assert history.hands[-1, 0, direction] == pytest.approx(size * radius**3 * expected, rel=5e-4)
    # Its arc is not straight to the end of the step: half the force times the way is off by more.
    assert history.residual_ratio < 1e-4


def test_euler_s_column_and_the_elastica_beyond_it() -> None:
    span, bending = 100.0, 10.0
    critical = math.pi**2 * bending / (4 * span**2)
    beam = SpaceBeam.from_axis(
        span=span,
        elements=40,
        ends=("clamped", "free"),
        stiffness=np.array([1e3, 1e3, 1e3, bending, bending, bending]),
    )

    def pushed(factor: float) -> np.ndarray:
        hand = Hand(at=span, path=((-factor * critical, 0, 0),), by="force", steps=3)
        return pull(beam, None, [hand], plane=True).hands[-1, 0]

    assert abs(pushed(0.995)[2]) < 1e-9
    for half in (math.radians(20.0), math.radians(40.0)):
        # The elastica whose end turns by 2 half: P/P_crit = (2 K / pi)^2, y/L = 2 sin(half) / K.
        modulus = math.sin(half)
        a, b = 1.0, math.cos(half)
        for _ in range(20):
            a, b = 0.5 * (a + b), math.sqrt(a * b)
        complete = math.pi / (2 * a)
        found = pushed((2 * complete / math.pi) ** 2)
        assert abs(found[2]) / span == pytest.approx(2 * modulus / complete, rel=3e-3)


TUBE = Beam.round(span=40.0, diameter=6.0, modulus=0.31, wall=0.8)


def space_break(
    beam: Beam, law: Law, grasp: float, threshold: float, elements: int
) -> tuple[float, float]:
    """Return force and deflection at which a hook that may slide along the axis tears a beam."""
    held = BeamOnBed(SpaceBeam.of(beam, law=law, elements=elements))
    node = held.take(grasp, along=(False, True, True))
    start = held.places[node].copy()

    def stress_at(deflection: float) -> float:
        held.lead(node, start + np.array([0.0, 0.0, deflection]))
        held.advance()
        return held.worst_stress().total

    low, high = 0.0, beam.span / 20
    while stress_at(high) < threshold:
        low, high = high, high + beam.span / 20
    while high - low > 1e-6 * high:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if stress_at(middle) >= threshold else (middle, high)
    return float(held.hand_force(node)[2]), high


@pytest.mark.slow
@pytest.mark.parametrize("beam", [DUCT, TUBE])
@pytest.mark.parametrize("place", [0.5, 0.3])
@pytest.mark.parametrize(
    ("law", "fraction"),
    [
        (NeoHooke(), 0.3),
        (NeoHooke(), 0.68),
        (Linear(shear=True), 0.35),
        (Exponential(0.0), 0.68),
        (Exponential(4.0), 1.0),
    ],
)
def test_a_wall_breaks_in_space_as_in_the_plane_and_in_the_library(
    beam: Beam, place: float, law: Law, fraction: float
) -> None:
    threshold, grasp = fraction * beam.modulus, place * beam.span
    plane = Exact(law).pull(beam, grasp=grasp).first_break(threshold)
    assert plane is not None
    names = ("span", "area", "second_moment", "fibre_distance", "modulus", "poisson_ratio")
    row = {name: np.array([getattr(beam, name)]) for name in names}
    many = solve_many(Exact(law), Ducts(**row, grasp=np.array([grasp])), np.array([threshold]))
    assert many.break_force[0] == pytest.approx(plane.force, rel=1e-4)
    space = space_break(beam, law, grasp, threshold, 160)
    assert space == pytest.approx((plane.force, plane.deflection), rel=3e-3)


@given(
    stiffening=st.floats(1e-6, 200.0),
    piece=st.floats(1e-9, MOST),
)
def test_the_exponential_of_kernels_is_the_exponential(stiffening: float, piece: float) -> None:
    strain = piece / stiffening
    found = exponential_stress(strain, stiffening, MOST / stiffening)
    with localcontext() as context:
        context.prec = 60
        b, e = Decimal(stiffening), Decimal(strain)
        slope = (b * e).exp()
        stress = (slope - 1) / b
        for one, true in zip(found, (stress, slope, (stress - e) / b), strict=True):
            assert abs(Decimal(one) / true - 1) < Decimal("1e-14")


@pytest.mark.parametrize("stiffening", [0.0, 0.3, 8.0])
def test_a_straight_pull_follows_the_published_law(stiffening: float) -> None:
    """sigma = alpha (e^(beta eps) - 1), nominal; and half of Hooke's energy where beta is 0."""
    beam = SpaceBeam.of(TUBE, law=Exponential(stiffening), elements=8, ends=("clamped", "free"))
    path = tuple((x * TUBE.span, 0.0, 0.0) for x in (0.1, 0.4, 0.7))
    history = pull(beam, None, [Hand(at=TUBE.span, path=path, steps=(4, 4, 4))])
    strain = history.hands[:, 0, 0] / TUBE.span
    stress, stored = TUBE.modulus * strain, 0.5 * TUBE.modulus * strain**2
    if stiffening:
        alpha = TUBE.modulus / stiffening
        stress = alpha * np.expm1(stiffening * strain)
        stored = (stress - TUBE.modulus * strain) / stiffening
    assert history.stress == pytest.approx(stress, rel=1e-9)
    assert history.forces[:, 0, 0] == pytest.approx(stress * TUBE.area, rel=1e-9)
    assert history.stored == pytest.approx(stored * TUBE.area * TUBE.span, rel=1e-9)


def test_a_law_without_its_constant_or_with_an_impossible_one_is_refused() -> None:
    for name, stiffening in (("exponential", None), ("neo-hooke", 3.0), ("linear", 3.0)):
        with pytest.raises(ValueError, match="the exponential law has a stiffening"):
            law_named(name, stiffening=stiffening)
    for stiffening in (-1.0, math.nan, 1e3):
        with pytest.raises(ValueError, match="stiffening must be"):
            Exponential(stiffening)
