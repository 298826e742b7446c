"""A beam on its bed: closed forms of peeling, energy of energy, meshes, replays and bad input."""

import math
import sys
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba.core.dispatcher import Dispatcher

from benchmarks.random_pulls import OPEN, pulled_in_real_time, pulled_through_equilibria
from kernel_cache import njit
from physics import Beam, NeoHooke
from physics.bed import (
    BeamOnBed,
    Bed,
    Hand,
    History,
    Network,
    Patch,
    Rod,
    SpaceBeam,
    Strands,
    kernels,
    pull,
)
from physics.bed.kernels import State
from physics.bed.layout import Rest, shapes
from physics.bed.peel_theory import (
    cantilever_compliance,
    end_deflection,
)

DUCT = Beam.round(span=50.8, diameter=8.89, modulus=0.310264)
LAYER = Bed(
    strands=300,
    stiffness=0.09,
    toughness=0.27,
    softening=8 / 3,
    floor=0.3,
    around=1.2,
    fan=0.4,
    slack=1.0,
    scatter=0.3,
    jitter=1.0,
    seed=7,
)


def made(span: float, elements: int, stiffness: list[float], **options: object) -> SpaceBeam:
    axial, shear, bending = stiffness
    rows = np.array([axial, shear, shear, bending, bending, bending])
    return SpaceBeam.from_axis(span=span, elements=elements, stiffness=rows, **options)  # type: ignore[arg-type]


def balanced(history: History) -> None:
    """The energy close at each step, and nothing that is gone comes back."""
    assert history.residual_ratio < 1e-4
    assert np.all(np.diff(history.dissipated) >= 0.0)
    assert np.all(np.diff(history.snap) >= 0.0)
    assert np.all(np.diff(history.broken) >= 0)
    assert np.all(np.isfinite(history.shape))


@pytest.mark.parametrize(("shear", "largest"), [(1e5, 2e-4), (6.85, 6e-5)])
def test_hetenyi_s_beam(shear: float, largest: float) -> None:
    errors = []
    for elements in (120, 240):
        beam = made(120.0, elements, [1e3, shear, 100.0], ends=("free", "clamped"))
        bed = Bed(stiffness=0.05, toughness=1e6, strands=4 * elements, bilateral=True, gap=1e3)
        hand = Hand(at=0.0, path=((0, 0, 1e-3),), by="force", steps=1)
        lifted = pull(beam, bed, [hand], plane=True).hands[-1, 0, 2]
        errors.append(lifted / end_deflection(1e-3, 0.05, 100.0, shear) - 1.0)
    assert abs(errors[1]) < largest
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)


def crack_force(crack: float, toughness: float, stiffness: float, bending: float) -> float:
    """The force at which the bed of a beam that sticks out of it parts further, N."""
    # [Kanninen 1973]: half the square of the force times the change of compliance with a is G, so
    # P = sqrt(2 EI G) / (a + 1/lambda).
    reach = (4.0 * bending / stiffness) ** 0.25
    return math.sqrt(2.0 * bending * toughness) / (crack + reach)


@pytest.mark.slow
def test_kanninen_s_double_cantilever() -> None:
    k, g, bending, crack = 0.05, 1e-4, 100.0, 20.0
    beam = made(150.0, 240, [1e3, 1e5, bending], ends=("free", "clamped"))
    bed = Bed(
        from_mm=crack,
        stiffness=k,
        toughness=g,
        strands=800,
        softening=1.02,
        bilateral=True,
        gap=1e3,
    )
    deepest = cantilever_compliance(45.0, k, bending) * crack_force(45.0, g, k, bending)
    hand = Hand(at=0.0, path=((0, 0, deepest),), steps=60, along=(False, False, True))
    history = pull(beam, bed, [hand], plane=True)
    balanced(history)
    force, opened = history.forces[:, 0, 2], history.hands[:, 0, 2]
    assert force[0] / opened[0] * cantilever_compliance(crack, k, bending) == pytest.approx(
        1.0, rel=3e-4
    )
    running = history.freed > 2.0
    assert running.sum() > 20
    expected = [crack_force(crack + freed, g, k, bending) for freed in history.freed[running]]
    # Brittle strands hold a front a little longer than a smooth bed: lattice trapping.
    assert force[running] / expected == pytest.approx(1.0, abs=0.012)
    assert np.mean(force[running] / expected) == pytest.approx(1.0, abs=4e-3)


def issue(elements: int, strands: int, steps: int) -> History:
    beam = made(160.0, elements, [8.0, 50.0, 1.5], ends=("clamped", "free"))
    bed = Bed(to_mm=130.0, strands=strands, stiffness=0.3, toughness=0.12)
    return pull(beam, bed, [Hand(at=160.0, path=((0, 0, 30.0),), steps=steps)])


@pytest.mark.long  # meshes up to four times as fine
def test_neither_mesh_nor_strands_nor_steps_matter() -> None:
    fine = issue(180, 360, 30)
    balanced(fine)
    for other in (issue(120, 360, 30), issue(180, 720, 30), issue(180, 360, 8)):
        balanced(other)
        assert other.forces[-1, 0] == pytest.approx(fine.forces[-1, 0], rel=1.5e-2, abs=1e-6)
        assert other.work[-1] == pytest.approx(fine.work[-1], rel=2e-3)
        assert other.dissipated[-1] == pytest.approx(fine.dissipated[-1], rel=1e-2)
        assert other.freed[-1] == pytest.approx(fine.freed[-1], abs=0.5)


def test_a_strand_that_is_alone_follows_its_law() -> None:
    """A stiff beam lifted off one strand: slack, elastic, softening, parted, and never healed."""
    beam = made(2.0, 2, [1e6, 1e6, 1e6], ends=("free", "free"))
    one = np.ones(1)
    strand = Strands(
        one,
        np.array([[1.0, 0, 0]]),
        np.array([[1.0, 0, -3]]),
        2.0 * one,
        3.5 * one,
        one,
        3.0 * one,
        0.0 * one,
    )
    hand = Hand(
        at=1.0,
        path=(
            (0, 0, 0.5),
            (0, 0, 1.5),
            (0, 0, 2.5),
            (0, 0, 0.5),
            (0, 0, 2.5),
            (0, 0, 4.0),
            (0, 0, 1),
        ),
        steps=(2, 4, 4, 4, 4, 6, 2),
    )
    found = pull(beam, strand, [hand])
    force = dict(zip(np.round(found.hands[:, 0, 2], 3), found.forces[:, 0, 2], strict=True))
    assert np.abs(found.forces[:2, 0, 2]).max() < 1e-12  # slack
    assert found.forces[5, 0, 2] == pytest.approx(2.0, rel=1e-6)  # at its strength
    assert found.forces[9, 0, 2] == pytest.approx(1.0, rel=1e-6)  # half-way down
    assert found.forces[11, 0, 2] == pytest.approx(0.5, rel=1e-6)  # back along its secant
    assert found.forces[17, 0, 2] == pytest.approx(1.0, rel=1e-6)  # and up again
    assert [force[4.0], force[1.0]] == pytest.approx([0.0, 0.0], abs=1e-8)
    assert found.broken[-1] == 1
    assert found.dissipated[-1] == pytest.approx(3.0, rel=1e-9)  # k u0 uf / 2
    balanced(found)


def test_a_pull_is_watched_step_by_step() -> None:
    """From rest on; the strands' forces and the hand's balance, and the worst stress is one."""
    beam = made(40.0, 40, [1e6, 1e6, 1e6], ends=("free", "free"), wall=[2.0, 3.0, 4.0])
    bed = Bed(stiffness=0.09, toughness=0.27, strands=100, around=1.2, fan=0.2, slack=0.5, seed=3)
    places: list[np.ndarray] = []
    forces: list[np.ndarray] = []

    def watch(held: BeamOnBed) -> bool:
        places.append(held.places.copy())
        direction = held.strand_ends() - held.strands.feet
        size = np.sqrt((direction**2).sum(axis=1))
        force = held.strands.forces(held.strand_ends(), held.strand_feet(), held.damage)
        forces.append((force / size) @ direction)
        stresses, worst = held.stresses(), held.worst_stress()
        bending = np.hypot(stresses[..., 1], stresses[..., 2])
        assert (stresses[..., 0] + bending).max() == pytest.approx(worst.total, rel=1e-12)
        return False

    history = pull(beam, bed, [Hand(at=20.0, path=((0, 1, 4),), steps=6)], watch=watch)
    assert np.array_equal(places[0], beam.places)
    assert len(places) == 7
    assert np.array_equal(places[-1], history.shape)
    assert forces[1:] == pytest.approx(history.forces[:, 0], rel=1e-6, abs=1e-7)
    assert history.broken[-1] > 10


def test_a_bed_pulls_only_or_pushes_too() -> None:
    beam = made(50.0, 50, [8.0, 50.0, 1.5], nodes_at=[25.0])
    down = Hand(at=25.0, path=((0, 0, -0.5),), steps=2)
    bed = Bed(stiffness=0.3, toughness=1.0, strands=100)
    forces = [
        pull(beam, each, [down], plane=True).forces[-1, 0, 2]
        for each in (None, bed, replace(bed, bilateral=True), replace(bed, floor=0.3))
    ]
    assert forces[1] == pytest.approx(forces[0], rel=1e-9)
    assert forces[2] < 2 * forces[0]
    assert forces[3] == pytest.approx(forces[2], rel=2e-2)


def test_the_same_to_the_bit_in_each_run_and_sides_alike() -> None:
    beam = SpaceBeam.of(DUCT, elements=40, nodes_at=[31.0])
    hand = Hand(at=31.0, path=((0, 3, 9),), steps=10)
    one, two = (pull(beam, LAYER, [hand]) for _ in range(2))
    balanced(one)
    assert one.broken[-1] > 30
    assert one.shape.tobytes() == two.shape.tobytes()
    assert one.damage.tobytes() == two.damage.tobytes()
    strands = LAYER.strands_under(beam)
    mirrored = replace(strands, ends=strands.ends * [1, -1, 1], feet=strands.feet * [1, -1, 1])
    floor = LAYER.floor_under(beam)
    other = pull(beam, mirrored, [replace(hand, path=((0, -3, 9),))], floor=floor)
    assert other.forces[-1, 0] == pytest.approx(one.forces[-1, 0] * [1, -1, 1], rel=1e-6)
    assert other.broken[-1] == one.broken[-1]


def test_a_bed_s_strands_are_what_it_says() -> None:
    beam = SpaceBeam.of(DUCT, elements=40)
    strands = LAYER.strands_under(beam)
    assert strands.toughness.sum() == pytest.approx(0.27 * 50.8, rel=1e-6)
    assert strands.stiffness.sum() == pytest.approx(0.09 * 50.8, rel=1e-6)
    cv = strands.toughness.std() / strands.toughness.mean()
    assert cv == pytest.approx(0.3, abs=0.05)
    assert strands.tributary_lengths.sum() == pytest.approx(50.8, rel=0.02)
    out = np.hypot(strands.ends[:, 1], strands.ends[:, 2])
    assert out == pytest.approx(4.445, rel=1e-6)
    assert np.abs(np.arctan2(strands.ends[:, 1], -strands.ends[:, 2])).max() <= 1.2
    slack = strands.length - np.sqrt(((strands.ends - strands.feet) ** 2).sum(axis=1))
    assert slack.min() >= -1e-9
    assert slack.max() <= 1.0
    again = replace(LAYER, seed=8).strands_under(beam)
    assert not np.array_equal(again.feet, strands.feet)
    tough = LAYER.with_patch(Patch(20.0, 31.0, 8.0)).strands_under(beam)
    inside = (tough.stations >= 20.0) & (tough.stations <= 31.0)
    factor = tough.toughness.sum() / strands.toughness.sum()
    assert factor == pytest.approx(1.0, rel=1e-6) or factor > 2.0
    assert tough.toughness[inside].mean() > 6 * tough.toughness[~inside].mean()


def test_a_curved_duct_lies_at_rest_in_its_bed() -> None:
    axis = np.array([[0.0, 0, 0], [15, 2, 0], [30, 3, 1], [45, 2, 0], [60, 0, 0]])
    beam = SpaceBeam.from_axis(axis=axis, elements=40, stiffness=np.array([6.0, 2, 2, 20, 30, 40]))
    bed = replace(LAYER, around=0.8, strands=200)
    strands = bed.strands_under(beam)
    held = BeamOnBed(beam, strands, floor=bed.floor_under(beam))
    assert held.strand_ends() == pytest.approx(strands.ends, abs=1e-9)
    node = held.take(22.2)
    assert held.strand_ends() == pytest.approx(strands.ends, abs=1e-9)
    held.advance()
    assert held.energy.stored == pytest.approx(0.0, abs=1e-12)
    assert held.hand_force(node) == pytest.approx([0, 0, 0], abs=1e-9)


def test_real_time_is_the_equilibrium_when_it_is_slow() -> None:
    beam = SpaceBeam.of(DUCT, elements=40, nodes_at=[25.4])
    strands, floor = LAYER.strands_under(beam), LAYER.floor_under(beam)
    still = pull(beam, strands, [Hand(at=25.4, path=((0, 0, 5.0),), steps=20)], floor=floor)
    live = BeamOnBed(beam, strands, floor=floor)
    node = live.take(25.4)
    start = live.places[node].copy()
    for step in range(1, 251):
        live.lead(node, start + np.array([0, 0, 0.02 * step]))
        live.tick(1e-3)
    # On the way damage lags behind its strands, which then pull harder.
    assert live.hand_force(node)[2] == pytest.approx(1.03 * still.forces[-1, 0, 2], rel=0.05)
    for _ in range(100):
        live.tick(1e-3)
    assert live.hand_force(node) == pytest.approx(still.forces[-1, 0], rel=1e-4, abs=1e-5)
    energy = live.energy
    assert still.dissipated[-1] < energy.dissipated < 1.12 * still.dissipated[-1]
    assert abs(energy.residual) < 1e-5 * energy.work
    assert 0.0 < energy.drag < 1e-3 * energy.work
    assert energy.stored + energy.dissipated == pytest.approx(energy.work, rel=5e-3)


def in_bed(rods: int = 0) -> BeamOnBed:
    beam = SpaceBeam.of(DUCT, elements=40)
    return BeamOnBed(beam, LAYER.strands_under(beam), floor=LAYER.floor_under(beam), rods=rods)


def test_the_energy_balance_holds_in_real_time() -> None:
    """Through springs, forces, letting go, rods and a return to equilibrium steps."""
    live = in_bed(rods=1)

    def balanced_now() -> None:
        energy = live.energy
        assert abs(energy.residual) < 1e-4 * energy.work
        assert min(energy.drag, energy.snap, energy.dissipated) >= 0.0

    hook, other = live.take(31.0, stiffness=3.0), live.take(14.0, along=(False, False, False))
    start = live.places[hook].copy()
    for step in range(1, 201):
        live.lead(hook, start + np.array([0.0, 0.01, 0.06]) * step)
        live.push(other, np.array([0.0, 0.0, 0.008]) * step)
        live.tick(2e-3, ticks=2)
    balanced_now()
    assert live.broken > 30
    stored = live.energy.stored
    live.let_go(hook)
    # The spring of the hand that let go had f^2 / (2 K).
    assert live.energy.stored < stored - 0.3
    assert live.energy.rod_work == 0.0
    for _ in range(50):
        live.tick(1e-3)
    balanced_now()
    broken = live.broken
    live.set_rod(0, (8.0, 9.5, -6.0), (0, 1, 0), 1.0)
    for step in range(1, 301):
        live.lead_rod(0, (8.0, 9.5 - 0.12 * min(step, 150), -6.0 + 0.03 * max(0, step - 150)))
        live.tick(1e-3)
    balanced_now()
    energy = live.energy
    assert live.broken_by_rods > 0
    assert live.broken_by_rods <= live.broken - broken
    assert 0.0 < energy.rod_dissipated < energy.rod_work < energy.work
    assert np.abs(live.state.press[0, :3]).max() > 0.0
    live.withdraw_rod(0)
    live.advance()
    balanced_now()


def test_a_tick_that_is_assembled_ahead_is_the_same_to_the_bit() -> None:
    """Whatever hands, rods and tears do before it comes."""
    plain, ahead = beams = in_bed(rods=1), in_bed(rods=1)
    events: dict[int, Callable[[BeamOnBed], object]] = {
        1: lambda beam: beam.take(31.0, stiffness=3.0),
        200: lambda beam: beam.take(14.0),
        300: lambda beam: beam.let_go(hook),
        320: lambda beam: beam.take(22.3, stiffness=3.0),
        400: lambda beam: beam.break_between(30.0, 34.0),
        450: lambda beam: beam.set_rod(0, (8.0, 9.5, -6.0), (0, 1, 0), 1.0),
        500: lambda beam: beam.withdraw_rod(0),
        550: lambda beam: beam.tear(40.0),
        600: lambda beam: beam.advance(),
    }
    hook, start = 0, np.zeros(3)
    for step in range(700):
        for beam in beams:
            held = events.get(step, lambda _: None)(beam)
            if isinstance(held, int) and step in (1, 320):
                hook, start = held, beam.places[held].copy()
            if beam.held[hook]:
                beam.lead(hook, start + np.array([0.0, 0.01, 0.03]) * (step % 320))
            beam.tick(2e-3 if step % 7 == 0 else 1e-3)
        for name, one, other in zip(plain.state._fields, plain.state, ahead.state, strict=True):
            if name not in ("damage_before", "damage_ahead"):
                assert np.array_equal(one, other), (step, name)
        damage = ahead.damage
        ahead.assemble_ahead(1e-3)
        assert np.array_equal(damage, ahead.damage)
        assert (ahead.state.sums[kernels.AHEAD] > 0.0) == (not 450 <= step < 500)
    assert 50 < plain.broken < plain.strands.count


def test_a_torn_duct_hangs_on_in_two_pieces() -> None:
    live = in_bed()
    hook = live.take(25.4)
    start = live.places[hook].copy()
    for step in range(1, 501):
        live.lead(hook, start + np.array([0.0, 0.0, 0.02]) * step)
        live.tick(1e-3)
    force, broken = live.hand_force(hook)[2], live.broken
    torn = live.tear(live.worst_stress().station)
    assert abs(torn - hook) <= 1
    for _ in range(300):
        live.tick(1e-3)
    # The hook still lifts one piece; the other lies in its bed again, as no hook holds it.
    assert 0.0 < live.hand_force(hook)[2] < 0.8 * force
    left = np.arange(41) <= torn
    lifted, dropped = (left, ~left) if left[hook] else (~left, left)
    assert live.places[lifted, 2].max() == pytest.approx(10.0, abs=0.5)
    assert np.abs(live.places[dropped, 2]).max() < 0.5
    assert np.all(live.state.section[torn] == 0.0)
    energy = live.energy
    assert abs(energy.residual) < 1e-5 * energy.work
    assert energy.snap > 1.0
    # Pulled on, the piece still parts its strands; a second tear frees it, and nothing is lost.
    for step in range(1, 501):
        live.lead(hook, start + np.array([0.0, 0.0, 10.0 + 0.02 * step]))
        live.tick(1e-3)
    assert live.broken > broken
    live.tear(12.0)
    for step in range(1, 201):
        live.lead(hook, start + np.array([0.02 * step, 0.05 * step, 20.0 + 0.1 * step]))
        live.tick(1e-3)
    assert np.all(np.isfinite(live.places))
    energy = live.energy
    assert abs(energy.residual) < 1e-4 * energy.work
    with pytest.raises(ValueError, match="a tear at 60 mm is not on the beam"):
        live.tear(60.0)


def test_a_hook_takes_hold_anywhere_and_lets_go() -> None:
    beam = SpaceBeam.of(DUCT, elements=40)
    live = BeamOnBed(beam)
    node = live.take(31.7)
    assert live.stations[node] == 31.7
    live.lead(node, live.places[node] + [0, 0, 6.0])
    live.advance()
    force = live.hand_force(node)[2]
    expected = pull(
        SpaceBeam.of(DUCT, elements=40, nodes_at=[31.7]),
        None,
        [Hand(at=31.7, path=((0, 0, 6.0),), steps=1)],
    )
    assert force == pytest.approx(expected.forces[-1, 0, 2], rel=2e-3)
    # A second hand takes the pulled duct elsewhere, and nothing moves by that.
    shape = live.places.copy()
    other = live.take(14.3)
    live.advance()
    assert np.abs(live.places - shape)[np.arange(41) != other].max() < 2e-2
    live.let_go(node)
    live.advance()
    assert live.energy.stored < expected.stored[-1]
    live.let_go(other)
    live.advance()
    assert live.places == pytest.approx(
        beam.places + (live.stations - beam.stations)[:, None] * [1, 0, 0], abs=1e-6
    )


def test_two_jaws_that_open_part_strands_and_spare_the_duct() -> None:
    beam = SpaceBeam.of(DUCT, elements=40)
    bed = replace(LAYER, around=0.0)
    height = -4.445 - 1.5
    jaws = [
        Rod(
            path=(
                (25.4 + s * 1.25, 9.5, height),
                (25.4 + s * 1.25, -9.5, height),
                (25.4 + s * 9, -9.5, height),
            ),
            shaft=(0, 1, 0),
            radius=1.2,
            steps=(12, 24),
        )
        for s in (-1, 1)
    ]
    history = pull(beam, bed, [], rods=jaws)
    assert history.broken[-1] > 30
    gone = beam_stations_parted(beam, bed, history)
    assert gone.min() > 10.0
    assert gone.max() < 41.0
    assert history.stress is not None
    assert history.residual_ratio < 1e-4
    # The jaws push apart, alike but for the scatter of the strands.
    assert history.rods[-1, 0, 0] < 0.0 < history.rods[-1, 1, 0]


def beam_stations_parted(beam: SpaceBeam, bed: Bed, history: History) -> np.ndarray:
    return bed.strands_under(beam).stations[history.damage >= 1.0]


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(
    st.integers(0, 10**6),
    st.floats(2.0, 48.0),
    st.tuples(st.floats(-12, 12), st.floats(-12, 12), st.floats(-6, 18)),
)
def test_no_pull_is_lost(seed: int, at: float, direction: tuple[float, float, float]) -> None:
    beam = SpaceBeam.of(DUCT, elements=24, nodes_at=[at])
    history = pull(
        beam, replace(LAYER, seed=seed, strands=120), [Hand(at=at, path=(direction,), steps=4)]
    )
    balanced(history)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [26, 56, 113, 327, 569, 814])
def test_rods_among_strands_lose_no_pull(seed: int) -> None:
    """Ends inside rods, a slow way off a saddle, strands that push, a leap; one that hangs free."""
    assert pulled_through_equilibria(seed) < OPEN


@pytest.mark.parametrize("seed", [5, 26, 33, 53, 76, 97, 141, 192])
def test_a_tick_in_which_forces_jump_is_followed_along_its_way(seed: int) -> None:
    """Strands that wind round a rod within a tick, meet its other side or are left behind."""
    assert pulled_in_real_time(seed) < OPEN


@njit
def path_round(
    end: tuple[float, float, float], foot: tuple[float, float, float], rod: np.ndarray, side: int
) -> tuple[int, float, tuple[float, float, float]]:
    found = kernels.path_round(end, foot, rod, side, False)
    return found[0], found[1], found[2]


def test_a_strand_s_length_round_a_rod_never_jumps() -> None:
    """An end moved through a rod: the length changes by no more than the end has moved."""
    random = np.random.default_rng(2)
    rod = np.array([0.0, 0, 0, 0, 1, 0, 1, 1])
    touched = 0
    for _ in range(60):
        start, direction = random.normal(size=3) * 1.5 + [0, 6, 0], random.normal(size=3)
        foot = tuple(random.normal(size=3) * 2.0 + [0, 6, 0])
        before = None
        for fraction in np.linspace(-3.0, 3.0, 300):
            end = start + fraction * direction
            side, length, by_end = path_round(tuple(end), foot, rod, 0)
            if not side & 1:
                length = float(np.sqrt(((end - foot) ** 2).sum()))
            if before is not None:
                # Beyond 1 where an end inside makes the rod thicker as it goes out.
                most = 3.4 * 6.0 / 299 * float(np.sqrt(direction @ direction))
                assert abs(length - before) <= most
            touched += side & 1
            before = length
            if side & 1 and fraction > 0.0:
                ahead = path_round(tuple(end + 1e-6 * direction), foot, rod, side)[1]
                behind = path_round(tuple(end - 1e-6 * direction), foot, rod, side)[1]
                slope = (ahead - behind) / 2e-6
                assert slope == pytest.approx(float(np.dot(by_end, direction)), abs=1e-4)
    assert touched > 1000


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6))
def test_no_pull_is_lost_in_real_time(seed: int) -> None:
    """By hooks, springs and rods, with tears; `benchmarks.random_pulls` plays thousands."""
    pulled_in_real_time(seed)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (lambda: Bed(stiffness=0.0, toughness=1.0), "stiffness of a bed must be above 0"),
        (lambda: Bed(stiffness=1.0, toughness=0.0), "toughness of a bed must be above 0"),
        (lambda: Bed(stiffness=1.0, toughness=1.0, scatter=-0.1), "scatter of a bed must be"),
        (lambda: Bed(stiffness=1.0, toughness=1.0, softening=0.5), "softening of a bed must be"),
        (lambda: Bed(stiffness=1.0, toughness=1.0, bilateral=True, slack=1.0), "cannot be slack"),
        (lambda: Hand(at=1.0, path=((0, 0, math.nan),)), "a hand's path must be finite"),
        (lambda: Hand(at=1.0, path=((0, 0, 1.0),), steps=0), "needs as many steps"),
        (lambda: Patch(5.0, 4.0, 2.0), "a patch must end after it begins"),
        (lambda: SpaceBeam.of(DUCT, elements=1), "elements must be 2 or more"),
        (lambda: SpaceBeam.of(DUCT, nodes_at=[60.0]), "is not on the beam"),
        (lambda: SpaceBeam.of(DUCT, nodes_at=[0.0]), "behind a clamp"),
        (lambda: SpaceBeam.of(DUCT, nodes_at=[9.0, 9.0]), "on top of one another"),
    ],
)
def test_what_is_wrong_is_named(wrong: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        wrong()  # type: ignore[operator]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (lambda b, _: b.tick(math.nan), "a tick must be above 0 s, got nan"),
        (lambda b, _: b.tick(math.inf), "a tick must be above 0 s, got inf"),
        (lambda b, _: b.tick(0.0), "a tick must be above 0 s, got 0"),
        (lambda b, _: b.tick(-1e-3), "a tick must be above 0 s, got -0.001"),
        (lambda b, _: b.tick(1e-3, ticks=0), "divided into 1 part or more, got 0"),
        (lambda b, _: b.assemble_ahead(-1e-3), "a tick must be above 0 s"),
        (lambda b, n: b.lead(n, (0.0, math.nan, 0.0)), "a hand's target must be three finite"),
        (lambda b, n: b.push(n, (math.inf, 0.0, 0.0)), "a force must be three finite"),
        (lambda b, _: b.lead_rod(0, (math.nan,) * 3), "a rod's tip must be three finite"),
        (lambda b, _: b.set_rod(0, (0, 0, -9), (0, 0, 0), 1.0), "direction must not be zero"),
        (lambda b, _: b.set_rod(0, (0, 0, -9), (0, 1, 0), -1.0), "a rod's radius must be above"),
        (lambda b, _: b.take(30.0, stiffness=math.nan), "a hand's spring must be above 0"),
    ],
)
def test_what_is_wrong_in_real_time_leaves_the_state_as_it_was(
    wrong: Callable[[BeamOnBed, int], object], message: str
) -> None:
    beam = SpaceBeam.of(DUCT)
    live, same = (BeamOnBed(beam, LAYER.strands_under(beam), rods=1) for _ in range(2))
    for each in (live, same):
        node = each.take(20.0)
        each.lead(node, each.places[node] + [0.0, 0.0, 4.0])
        each.tick(0.2, ticks=200)
        if each is live:
            with pytest.raises(ValueError, match=message):
                wrong(each, node)
        each.lead(node, each.places[node] + [0.0, 0.0, 1.0])
        each.tick(0.1, ticks=100)
    assert np.isfinite(live.places).all()
    assert live.energy.dissipated > 0.0
    for before, after in zip(same.state, live.state, strict=True):
        assert np.array_equal(before, after)


def test_a_bed_outside_the_duct_is_named() -> None:
    beam = SpaceBeam.of(DUCT)
    with pytest.raises(ValueError, match="from 0 to 60 mm lies outside the beam"):
        Bed(stiffness=1.0, toughness=1.0, to_mm=60.0).strands_under(beam)


def test_no_kernel_is_compiled_anew_for_a_constant() -> None:
    """It took a third of a bed's compilation: a constant is handed over as int(constant)."""
    by_fibres = SpaceBeam.of(DUCT, law=NeoHooke(), elements=8)
    for tube in (SpaceBeam.of(DUCT, elements=8), by_fibres):
        beam = BeamOnBed(tube)
        beam.tick(1e-3)
        beam.assemble_ahead(1e-3)
        beam.advance()
    modules = [module for name, module in sys.modules.items() if name.startswith(kernels.__name__)]
    compiled = {
        str(signature)
        for module in modules
        for each in vars(module).values()
        if isinstance(each, Dispatcher)
        for signature in each.signatures
    }
    assert compiled
    assert not [signature for signature in compiled if "Literal[int]" in signature]


def test_a_bed_in_rows_of_a_batch_moves_as_one_of_its_own() -> None:
    """The arrays are made in a given place: a row of a table of beds, used before."""
    beam = SpaceBeam.of(DUCT, elements=16)
    strands, floor = LAYER.strands_under(beam), LAYER.floor_under(beam)
    rest = Rest.of(Network({"beam": beam}), strands)
    batch = [np.full((3, *size), 7, dtype=kind) for size, kind in shapes(rest, 1).values()]
    row: list[Any] = [each[1] for each in batch]
    beds = [
        BeamOnBed(beam, strands, floor=floor, rods=1),
        BeamOnBed(beam, strands, floor=floor, rods=1, out=State(*row)),
    ]
    for bed in beds:
        node = bed.take(0.4 * beam.span)
        bed.set_rod(0, (0.6 * beam.span, -8.0, -3.0), (0.0, -1.0, 0.0), 1.2)
        for step in range(40):
            bed.lead(node, bed.rest_place(node) + np.array([0.0, 0.0, 0.2 * step]))
            bed.lead_rod(0, (0.6 * beam.span, -8.0 + 0.2 * step, -3.0))
            bed.tick(1 / 240, ticks=2)
    assert beds[0].broken > 0
    for name, one, other in zip(State._fields, beds[0].state, beds[1].state, strict=True):
        np.testing.assert_array_equal(one, other, name)
    for each in batch:
        assert np.all(each[[0, 2]] == 7)
