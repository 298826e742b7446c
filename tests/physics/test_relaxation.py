"""Relaxation of strands and walls, against closed forms of Maxwell branches beside a spring."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from physics import Beam
from physics.bed import (
    BeamOnBed,
    Bed,
    Join,
    Network,
    Relaxation,
    SpaceBeam,
    Strands,
    kernels,
)
from physics.exact import Exponential, Law, Linear, NeoHooke

K, TWO = 0.1, Relaxation((0.2, 0.225), (3.83, 30.15))
ONE = Relaxation((0.4,), (5.0,))
DUCT = Beam.round(span=50.8, diameter=8.89, modulus=0.310264)
LAYER = Bed(
    strands=200, stiffness=0.09, toughness=0.27, softening=8 / 3, floor=0.3, around=1.2, fan=0.4,
    slack=1.0, scatter=0.3, jitter=1.0,
)  # fmt: skip


def one_strand(relaxation: Relaxation | None, *, bilateral: bool = False) -> BeamOnBed:
    """A strand straight down from the middle of a short bar that nothing else holds."""
    row = np.array([1.0])
    strand = Strands(
        5.0 * row, np.array([[5.0, 0, 0]]), np.array([[5.0, 0, -3.0]]), K * row, 3.0 * row,
        50.0 * row, 90.0 * row, float(bilateral) * row,
    )  # fmt: skip
    bar = SpaceBeam.from_axis(
        elements=2, span=10.0, stiffness=np.full(6, 1e4), ends=("free", "free")
    )
    return BeamOnBed(bar, strand, strand_relaxation=relaxation)


def lifted(held: BeamOnBed, node: int, far: float, seconds: float) -> float:
    """Lead a node so far up, in a time; return the hand's force up."""
    held.lead(node, held.rest_place(node) + np.array([0.0, 0.0, far]))
    held.advance(seconds)
    return float(held.hand_force(node)[2])


@pytest.mark.parametrize("step", [0.01, 1.0, 100.0])
def test_a_held_strand_relaxes_by_its_prony_series(step: float) -> None:
    """Exactly, however long a step is; what its branches stored is dissipated."""
    held = one_strand(TWO)
    node = held.take(5.0)
    assert lifted(held, node, 2.0, 0.0) == pytest.approx(2.0 * K, rel=1e-8)
    for after in range(1, 4):
        force = lifted(held, node, 2.0, step)
        assert force == pytest.approx(2.0 * K * TWO.stiffness(after * step), rel=1e-8)
    gone = sum(
        0.5 * K * 2.0**2 * g * -math.expm1(-6 * step / tau)
        for g, tau in zip(TWO.fractions, TWO.times, strict=True)
    )
    assert held.energy.viscous == pytest.approx(gone, rel=1e-7)
    assert held.energy.residual == pytest.approx(0.0, abs=1e-9)


def test_a_strand_creeps_under_a_dead_force() -> None:
    held = one_strand(ONE)
    node = held.take(5.0, along=(True, True, False))
    held.push(node, [0.0, 0.0, K])
    held.advance()
    (g,), (tau,) = ONE.fractions, ONE.times
    for after in range(1, 5):
        held.advance(5.0)
        crept = (1.0 - g * math.exp(-5.0 * after * (1.0 - g) / tau)) / (1.0 - g)
        rise = held.places[node, 2] - held.rest_place(node)[2]
        assert rise == pytest.approx(crept, rel=1e-4)
    energy = held.energy
    assert energy.work == pytest.approx(energy.stored + energy.viscous, rel=1e-7)


@pytest.mark.parametrize("omega", [0.05, 0.4, 3.0])
def test_a_strand_answers_a_frequency_by_its_complex_stiffness(omega: float) -> None:
    """k* = k (1 - sum g/(1 + i omega tau)); each cycle dissipates pi Im(k*) a^2."""
    held, count = one_strand(TWO, bilateral=True), 400
    node = held.take(5.0)
    step = 2.0 * math.pi / omega / count
    phases = 2.0 * math.pi * np.arange(1, count + 1) / count
    # As its branches are when the motion has gone on for ever; one cycle for what is left.
    for branch, tau in enumerate(TWO.times):
        turn = 1j * omega * tau
        held.state.memory[kernels.SPRING + branch] = (turn / (1.0 + turn)).imag
    for phase in phases:
        lifted(held, node, math.sin(phase), step)
    before = held.energy.viscous
    forces = np.array([lifted(held, node, math.sin(phase), step) for phase in phases])
    found = 2.0 * complex(
        float(np.mean(forces * np.sin(phases))), float(np.mean(forces * np.cos(phases)))
    )
    exact = K * (
        1.0
        - sum(g / (1.0 + 1j * omega * tau) for g, tau in zip(TWO.fractions, TWO.times, strict=True))
    )
    assert abs(found - exact) < 1e-4 * abs(exact)
    gone = held.energy.viscous - before
    assert gone == pytest.approx(math.pi * exact.imag, abs=1e-4 * K)
    assert gone == pytest.approx(math.pi * exact.imag, rel=2e-3)


def test_a_strand_that_has_relaxed_is_slack_on_the_way_back_and_never_pushes() -> None:
    held = one_strand(ONE)
    node = held.take(5.0)
    lifted(held, node, 2.0, 0.0)
    lifted(held, node, 2.0, 500.0)
    back = [lifted(held, node, far, 0.0) for far in (1.0, 0.9, 0.7, 0.5)]
    # At once it follows k from 0.6 k u at 2 mm: f = k (u - 0.8).
    assert back == pytest.approx([0.2 * K, 0.1 * K, 0.0, 0.0], abs=1e-9)
    # Slack, it recovers at the pace of creep: after a long time nothing is left of the hold.
    assert lifted(held, node, 0.5, 500.0) == pytest.approx(0.5 * 0.6 * K, rel=1e-6)


@pytest.mark.parametrize("law", [Linear(shear=True), NeoHooke(), Exponential(4.0)], ids=str)
def test_a_wall_that_is_stretched_straight_relaxes_by_its_series(law: Law) -> None:
    """The force at once is the law's without relaxation, and falls as the series does."""
    beam = SpaceBeam.of(DUCT, law=law, elements=8, ends=("clamped", "free"))
    forces = []
    for relaxation in (None, TWO):
        held = BeamOnBed(beam, wall_relaxation=relaxation)
        node = held.take(beam.span)
        held.lead(node, held.rest_place(node) + np.array([10.0, 0.0, 0.0]))
        held.advance()
        forces.append(float(held.hand_force(node)[0]))
        stress = held.worst_stress().total
        held.advance(10.0)
        fall = 1.0 if relaxation is None else relaxation.stiffness(10.0)
        assert held.hand_force(node)[0] == pytest.approx(fall * forces[0], rel=1e-8)
        if relaxation is None:
            assert held.worst_stress().total == stress
        else:
            assert held.worst_stress().total < 0.9 * stress
            assert held.energy.viscous > 0.0
        assert abs(held.energy.residual) < 2e-5 * held.energy.work
    assert forces[0] == pytest.approx(forces[1], rel=1e-9)


@pytest.mark.parametrize("law", [Linear(shear=True), NeoHooke(), Exponential(4.0)], ids=str)
def test_what_a_wall_loses_until_it_has_relaxed_is_viscous_by_any_law(law: Law) -> None:
    """Stretched at once and held for ever it keeps what does not relax of the law's energy."""
    beam = SpaceBeam.of(DUCT, law=law, elements=8, ends=("clamped", "free"))
    held = BeamOnBed(beam, wall_relaxation=TWO)
    node = held.take(beam.span)
    held.lead(node, held.rest_place(node) + np.array([0.2 * beam.span, 0.0, 0.0]))
    held.advance()
    work = held.energy.work
    held.advance(1e4)
    energy, lost = held.energy, sum(TWO.fractions)
    assert energy.work == work
    assert energy.viscous == pytest.approx(lost * work, rel=1e-4)
    assert energy.stored == pytest.approx((1.0 - lost) * work, rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("law", [Linear(shear=True), Exponential(4.0)], ids=str)
def test_a_duct_pulled_off_its_bed_while_all_relaxes_keeps_its_energy_balance(law: Law) -> None:
    """In equilibria to 2e-5 and in real time to 1e-4 of the work; both find the same forces."""
    beam = SpaceBeam.of(DUCT, law=law, elements=16)
    at_hold = []
    for real_time in (False, True):
        held = BeamOnBed(
            beam, LAYER.strands_under(beam), floor=LAYER.floor_under(beam),
            strand_relaxation=TWO, wall_relaxation=ONE,
        )  # fmt: skip
        node = held.take(beam.span / 2)
        direction = np.array([1.0, 2.0, 7.0])
        for step in range(1, 21):
            held.lead(node, held.rest_place(node) + direction * step / 20)
            if real_time:
                held.tick(0.1, ticks=50)
            else:
                held.advance(0.1)
        pulled, stress = held.hand_force(node).copy(), held.worst_stress().total
        if real_time:
            held.tick(10.0, ticks=2000)
        else:
            held.advance(10.0)
        energy = held.energy
        assert held.broken > 10
        assert energy.viscous > 0.05 * energy.work
        assert energy.dissipated > 0.05 * energy.work
        assert abs(energy.residual) < (1e-4 if real_time else 2e-5) * energy.work
        assert held.hand_force(node)[2] < 0.9 * pulled[2]
        assert held.worst_stress().total < 0.9 * stress
        at_hold.append((held.hand_force(node).copy(), energy.viscous / energy.work))
    np.testing.assert_allclose(at_hold[1][0], at_hold[0][0], rtol=0.01, atol=2e-3)
    assert at_hold[1][1] == pytest.approx(at_hold[0][1], rel=0.02)


@pytest.mark.parametrize("step", [0.01, 1.0, 100.0])
def test_a_strand_between_two_tubes_relaxes_by_its_prony_series(step: float) -> None:
    """Held at both tubes by as much as either is led; each feels the other's hand."""
    bars = {
        name: SpaceBeam.from_axis(
            elements=2, axis=np.array([[0.0, 0.0, z], [10.0, 0.0, z]]), ends=("free", "free"),
            stiffness=np.full(6, 1e4), radius=0.5,
        )
        for name, z in (("upper", 0.0), ("lower", -3.0))
    }  # fmt: skip
    row = np.array([1.0])
    strand = Strands(
        5.0 * row, np.array([[5.0, 0, 0]]), np.array([[5.0, 0, -3.0]]), K * row, 3.0 * row,
        50.0 * row, 90.0 * row, 0.0 * row, to=np.array([1]), to_stations=5.0 * row,
    )  # fmt: skip
    held = BeamOnBed(Network(bars), strand, strand_relaxation=TWO)
    upper, lower = held.take(5.0, "upper"), held.take(5.0, "lower")
    held.lead(lower, held.rest_place(lower) - np.array([0.0, 0.0, 0.5]))
    assert lifted(held, upper, 1.5, 0.0) == pytest.approx(2.0 * K, rel=1e-8)
    for after in range(1, 4):
        force = lifted(held, upper, 1.5, step)
        assert force == pytest.approx(2.0 * K * TWO.stiffness(after * step), rel=1e-8)
        assert held.hand_force(lower)[2] == pytest.approx(-force, rel=1e-8)
    gone = sum(
        0.5 * K * 2.0**2 * g * -math.expm1(-6 * step / tau)
        for g, tau in zip(TWO.fractions, TWO.times, strict=True)
    )
    assert held.energy.viscous == pytest.approx(gone, rel=1e-7)
    assert held.energy.residual == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("law", [Linear(shear=True), Exponential(4.0)], ids=str)
def test_a_pull_of_two_tubes_that_join_relaxes_as_that_of_one(law: Law) -> None:
    """Straight, by the series; aside, with the forces and the viscous energy of the one tube."""
    long, middle, short = (
        Beam.round(span=span, diameter=8.89, modulus=0.310264, wall=1.5)
        for span in (40.0, 25.0, 15.0)
    )
    one = SpaceBeam.of(long, law=law, elements=24, ends=("clamped", "clamped"), nodes_at=[10.0])
    first = SpaceBeam.of(middle, law=law, elements=15, ends=("clamped", "free"), nodes_at=[10.0])
    beyond = np.array([[25.0, 0.0, 0.0], [40.0, 0.0, 0.0]])
    second = SpaceBeam.of(short, law=law, elements=9, ends=("free", "clamped"), axis=beyond)
    two = Network({"a": first, "b": second}, [Join("b", 0, "a", 25.0)])
    for direction in (np.array([2.0, 0.0, 0.0]), np.array([0.5, 1.5, 4.0])):
        found: list[list[float]] = []
        for made in (BeamOnBed(one, wall_relaxation=TWO), BeamOnBed(two, wall_relaxation=TWO)):
            node = made.take(10.0)
            made.lead(node, made.rest_place(node) + direction)
            made.advance()
            at_once = made.hand_force(node).copy()
            made.advance(7.0)
            after = made.hand_force(node)
            if not direction[1:].any():
                assert after[0] == pytest.approx(TWO.stiffness(7.0) * at_once[0], rel=1e-6)
            assert abs(made.energy.residual) < 1e-4 * made.energy.work
            assert made.energy.viscous > 0.0
            found.append([*at_once, *after, made.energy.viscous])
        assert found[1] == pytest.approx(found[0], rel=1e-7, abs=1e-7)


def test_a_tick_assembled_ahead_gives_the_same_bits_while_all_relaxes() -> None:
    beam = SpaceBeam.of(DUCT, elements=12)
    beds = [
        BeamOnBed(beam, LAYER.strands_under(beam), strand_relaxation=TWO, wall_relaxation=ONE)
        for _ in range(2)
    ]
    nodes = [held.take(20.0) for held in beds]
    for tick in range(1, 200):
        for ahead, (held, node) in enumerate(zip(beds, nodes, strict=True)):
            held.lead(node, held.rest_place(node) + tick * np.array([0.0, 0.01, 0.03]))
            held.tick(2e-3)
            if ahead:
                held.assemble_ahead(2e-3)
    assert beds[0].broken > 0
    assert beds[0].energy.viscous > 0.0
    assert beds[0].energy == beds[1].energy
    np.testing.assert_array_equal(beds[0].places, beds[1].places)
    kept = slice(kernels.SPRING, None)
    np.testing.assert_array_equal(beds[0].state.memory[kept], beds[1].state.memory[kept])


def test_time_changes_nothing_where_nothing_relaxes() -> None:
    held, timed = one_strand(None), one_strand(None)
    for each, seconds in ((held, 0.0), (timed, 30.0)):
        node = each.take(5.0)
        lifted(each, node, 2.0, seconds)
        lifted(each, node, 2.0, seconds)
    np.testing.assert_array_equal(held.places, timed.places)
    assert held.energy == timed.energy
    assert held.energy.viscous == 0.0


def test_a_torn_element_forgets() -> None:
    beam = SpaceBeam.of(DUCT, elements=8)
    held = BeamOnBed(beam, wall_relaxation=ONE)
    node = held.take(beam.span / 2)
    held.lead(node, held.rest_place(node) + np.array([0.0, 0.0, 8.0]))
    held.advance(1.0)
    element = held.tear(beam.span / 4)
    held.advance(1.0)
    over = held.state.wall_memory[kernels.OVER :].reshape(-1, 8, 6)
    assert over[:, element - 1].any()
    assert not over[:, element].any()
    assert abs(held.energy.residual) < 1e-4 * held.energy.work


@given(st.floats(0.0, 1e4, allow_subnormal=False))
@settings(deadline=None, max_examples=200)
def test_factors_are_those_of_the_exponential(ratio: float) -> None:
    """Made of + - * / alone, to 1e-14: E = exp(-t/tau) and b = (1 - E) tau/t."""
    kernels.begin(FACTORS.state, ratio * ONE.times[0])
    _, _, kept, rate, _ = FACTORS.state.branch[0, 0]
    ratio = ratio * ONE.times[0] / ONE.times[0]
    assert kept == pytest.approx(math.exp(-ratio), abs=1e-14)
    assert rate == pytest.approx(-math.expm1(-ratio) / ratio if ratio else 1.0, abs=1e-14)


FACTORS = one_strand(ONE)


@pytest.mark.parametrize(
    ("fractions", "times", "message"),
    [
        ((0.4,), (0.0,), "a time of a relaxation must be above 0 s, got 0"),
        ((0.4,), (-1.0,), "a time of a relaxation must be above 0 s"),
        ((0.0,), (1.0,), "a fraction of a relaxation must be above 0"),
        ((0.6, 0.5), (1.0, 2.0), "fractions of a relaxation must sum to less than 1, got 1.1"),
        ((0.6,), (1.0, 2.0), "a time for each fraction, got 1 fractions and 2 times"),
        ((), (), "a time for each fraction"),
        ((0.5,), (math.nan,), "a time of a relaxation must be"),
    ],
)
def test_an_impossible_relaxation_is_one_sentence(
    fractions: tuple[float, ...], times: tuple[float, ...], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        Relaxation(fractions, times)


def test_a_time_that_no_run_would_show_and_a_step_back_in_time_are_told() -> None:
    with pytest.raises(ValueError, match=r"a relaxation of 30.15 s is longer than the run of 20 s"):
        TWO.within(20.0)
    TWO.within(31.0)
    with pytest.raises(ValueError, match="a step must take 0 s or more"):
        one_strand(ONE).advance(-1.0)
