"""Tubes that touch and slide on each other: against closed forms, differences and balances."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.anatomy import anatomy_named, anatomy_network, drawn_anatomy
from app.validation.network_checks import crossed_tubes
from physics.bed import BeamOnBed, Network, SpaceBeam, Strands
from physics.bed import kernels as k
from tests.physics.derivatives import assert_derivatives

Floats = np.ndarray[Any, np.dtype[np.float64]]

ANATOMIES = ("normal", "accessory-artery", "artery-outside", "parallel-low", "short-cystic")
RADIUS = 2.0
STIFF = np.array([50.0, 400.0, 400.0, 60.0, 80.0, 80.0])


def tube(
    begin: Any,
    end: Any,
    elements: int,
    *,
    factor: float = 1.0,
    ends: Any = ("pinned", "pinned"),
    radius: Any = RADIUS,
) -> SpaceBeam:
    return SpaceBeam.from_axis(
        elements=elements,
        stiffness=factor * STIFF,
        axis=np.array([begin, end], float),
        ends=ends,
        radius=radius,
    )


def cross(gap: float = 0.0, factor: float = 1.0, elements: int = 20) -> Network:
    """One tube of 40 mm lies across another, `gap` above it."""
    low = tube([0, -20, 0], [0, 20, 0], elements, factor=factor)
    high = tube([-20, 0, 2 * RADIUS + gap], [20, 0, 2 * RADIUS + gap], elements)
    return Network({"low": low, "high": high}, touching=math.inf)


@pytest.mark.parametrize("factor", [0.3, 1.0, 4.0])
def test_tubes_across_each_other_bear_a_load_by_their_stiffness(factor: float) -> None:
    check = crossed_tubes(factor)
    assert check.found == pytest.approx(check.expected, rel=2e-4)


@pytest.mark.parametrize(("elements", "error"), [(20, 5e-3), (40, 2e-3)])
def test_a_tube_laid_on_another_presses_it_as_winkler_s_foundation(
    elements: int, error: float
) -> None:
    """Under half a wave of load both give a half wave, by 1/k of each and of the contact."""
    span, force = 20.0, 1e-4
    low = tube([0, 0, 0], [span, 0, 0], elements)
    high = tube([0, 0, 2 * RADIUS], [span, 0, 2 * RADIUS], elements)
    made = BeamOnBed(Network({"low": low, "high": high}, touching=math.inf))
    nodes = {name: made.nodes_of(name)[1:-1] for name in ("low", "high")}
    wave = np.sin(math.pi / span * high.stations[1:-1])
    for node, part in zip(nodes["high"].tolist(), wave.tolist(), strict=True):
        made.push(node, (0.0, 0.0, -force * span / elements * part))
    made.advance()
    down = {name: (made.rest_places - made.places)[each, 2] for name, each in nodes.items()}
    number = math.pi / span
    own = 1.0 / (1.0 / (STIFF[4] * number**4) + 1.0 / (STIFF[2] * number**2))
    assert down["high"] + down["low"] == pytest.approx(force / own * wave, rel=error)
    differ = force / (own + 2.0 * k.CONTACT_STIFFNESS)
    assert down["high"] - down["low"] == pytest.approx(differ * wave, rel=error)


def pressed(seed: int, *, tied: bool) -> BeamOnBed:
    """Curved tubes of uneven radii pressed into each other, by nodes that strands tie or not."""
    rng = np.random.default_rng(seed)
    a = SpaceBeam.from_axis(
        elements=3, stiffness=rng.random(6) + 1, ends=("free", "free"),
        axis=np.array([[0, 0, 0], [2, 0.3, 0.2], [4.0, 0, 0.5]]), radius=np.array([0.5, 0.9]),
    )  # fmt: skip
    b = SpaceBeam.from_axis(
        elements=2, stiffness=rng.random(6) + 1, ends=("free", "free"),
        axis=np.array([[1.0, -1.5, 1.9], [2.2, 0.2, 2.0], [3.0, 1.4, 2.2]]),
        radius=np.array([0.7, 0.4]),
    )  # fmt: skip
    strands = Strands.none()
    if tied:
        pairs = [(x, y) for x in a.stations for y in b.stations]
        at, to = np.array(pairs).T
        some, far = np.ones(len(pairs)), np.full(len(pairs), 9.0)
        zero = np.zeros(len(pairs), np.int64)
        ends = rng.normal(size=(len(pairs), 3))
        strands = Strands(
            at, ends, ends + 1.0, 0.1 * some, some, far, 2 * far, some, zero, zero + 1, to
        )  # fmt: skip
    made = BeamOnBed(Network({"a": a, "b": b}, touching=math.inf), strands)
    state = made.state
    state.x[made.nodes_of("b")] -= np.array([0.0, 0.0, 0.7])
    state.x[:] += rng.normal(size=state.x.shape) * 0.05
    return made


@pytest.mark.slow
@pytest.mark.parametrize("kind", [k.FROZEN, k.INCREMENTAL])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_gradient_and_tangent_are_the_energy_s_differences(kind: int, seed: int) -> None:
    made = pressed(seed, tied=True)
    k.assemble(made.state, kind, 0.0)
    assert made.state.sums[k.CONTACT] > 0.01
    assert_derivatives(made.state, k.INCREMENTAL)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_tubes_press_each_other_with_equal_forces_on_one_line(seed: int) -> None:
    made = pressed(seed, tied=False)
    state = made.state
    k.assemble(state, k.FROZEN, 0.0)
    touching = state.g.copy()
    state.reach[:, k.STIFFNESS] = 0.0
    k.assemble(state, k.FROZEN, 0.0)
    force = (touching - state.g)[:, :3]
    most = np.abs(force).max()
    assert most > 0.1
    assert np.abs((touching - state.g)[:, 3:]).max() == 0.0
    assert np.abs(force.sum(axis=0)).max() < 1e-9 * most
    assert np.abs(np.cross(state.x, force).sum(axis=0)).max() < 1e-9 * most


@pytest.mark.slow
def test_tubes_that_press_each_other_are_in_balance_and_mirror_each_other() -> None:
    """Off their middles, and the mirror image across x: the same, and pins bear the whole load."""
    made: list[BeamOnBed] = []
    for side in (-1.0, 1.0):
        low = tube([3 * side, -20, 0], [5 * side, 20, 1], 20, factor=0.5)
        high = tube([-20 * side, 4, 4.6], [20 * side, -2, 4.6], 20)
        beds = BeamOnBed(Network({"low": low, "high": high}, touching=math.inf))
        beds.push(int(beds.nodes_of("high")[11]), (0.02 * side, 0.01, -0.3))
        beds.advance()
        made.append(beds)
    mirror = made[0].places * np.array([-1.0, 1.0, 1.0])
    assert made[1].places == pytest.approx(mirror, abs=1e-9)
    state = made[1].state
    k.assemble(state, k.FROZEN, 0.0)
    assert state.sums[k.CONTACT] > 1e-3
    free = state.held & 7 == 0
    assert np.abs(state.g[free, :3]).max() < 1e-9
    held = state.g[~free, :3].sum(axis=0)
    assert held == pytest.approx([-0.02, -0.01, 0.3], abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", [*ANATOMIES, 1, 2, 3, 4, 5, 6, 7])
def test_nothing_touches_at_rest(name: str | int) -> None:
    """Shipped anatomies and drawn cases stand as they do where tubes pass through each other."""
    anatomy = drawn_anatomy(name) if isinstance(name, int) else anatomy_named(name)
    state = anatomy_network(anatomy).on_bed().state
    assert len(state.touch) > 200
    k.assemble(state, k.FROZEN, 0.0)
    apart = anatomy_network(anatomy, touching=False).on_bed().state
    k.assemble(apart, k.FROZEN, 0.0)
    assert state.sums[k.CONTACT] == apart.sums[k.CONTACT]
    assert np.abs(state.g).max() == pytest.approx(np.abs(apart.g).max(), rel=1e-12)


@pytest.mark.long  # many speeds
@settings(max_examples=40, deadline=None)
@given(
    st.floats(10.0, 500.0),
    st.tuples(st.floats(-0.6, 0.6), st.floats(-0.6, 0.6)),
    st.floats(-3.0, 3.0),
    st.sampled_from([1.0, 30.0]),
    st.sampled_from([None, 0.0, math.inf]),
)
def test_no_tube_passes_another_at_any_speed(
    speed: float,
    aside: tuple[float, float],
    off: float,
    factor: float,
    within: float | None,
) -> None:
    """Led down on a tube that lies across and up again; without contact it goes through."""
    low = tube([0, -20, 0], [0, 20, 0], 20, factor=factor, ends=("clamped", "clamped"))
    high = tube([-20, off, 5], [20, off, 5], 17, ends=("clamped", "clamped"))
    made = BeamOnBed(Network({"low": low, "high": high}, touching=within))
    node = made.take(20.0, "high")
    place = made.places[node].copy()
    seconds = 1.0 / 240.0
    through = False
    for sign in (-1.0, 1.0):
        goal = place + 16.0 * np.array([*aside, -1.0]) * (sign < 0.0)
        start = made.state.goal[node].copy()
        ticks = math.ceil(float(np.linalg.norm(goal - start)) / (speed * seconds))
        for now in range(1, ticks + 1):
            made.lead(node, start + now / ticks * (goal - start))
            made.tick(seconds)
            through |= linked(made)
    assert np.isfinite(made.places).all()
    assert through == (within is None)
    for _ in range(600):
        made.tick(seconds)
    # It is clear again, and all is at rest as it was.
    if within is not None:
        assert made.places[node] == pytest.approx(place, abs=1e-6)
        assert np.abs(made.places - made.rest_places).max() < 1e-3


@pytest.mark.parametrize("within", [0.0, math.inf])
@pytest.mark.parametrize(("speed", "open_"), [(8.0, 1e-4), (60.0, 1e-2)])
def test_the_energy_of_tubes_that_press_and_slide_is_kept(
    speed: float, open_: float, within: float
) -> None:
    """Pressed 4 mm down, drawn 12 mm along the other and up again: all work is given back."""
    made = BeamOnBed(replace(cross(1.0), touching=within))
    node = made.take(20.0, "high")
    place, seconds = made.places[node].copy(), 1.0 / 240.0
    gross, before = 0.0, place
    for goal in ([0, 0, -5], [0, 8, -5], [0, -4, -5], [0, 0, 1], [0, 0, 0]):
        after = place + np.array(goal, float)
        ticks = math.ceil(float(np.linalg.norm(after - before)) / (speed * seconds))
        for now in range(1, ticks + 1):
            made.lead(node, before + now / ticks * (after - before))
            was = made.energy.work
            made.tick(seconds)
            gross += abs(made.energy.work - was)
        before = after
    for _ in range(600):
        made.tick(seconds)
    energy = made.energy
    assert energy.stored < 1e-9
    assert abs(energy.residual) <= open_ * gross


def linked(made: BeamOnBed) -> bool:
    """Whether the high tube is through the low one: both, closed far away, are linked (Gauss)."""
    high, low = (made.places[made.nodes_of(name)] for name in ("high", "low"))
    high = np.vstack([high, [[900, 0, 900], [-900, 0, 900]]])[:, None]
    low = np.vstack([low, [[0, 20, -900], [0, -20, -900]]])
    after, then = np.roll(high, -1, axis=0), np.roll(low, -1, axis=0)
    corners = [low - high, then - high, then - after, low - after]
    normals = [np.cross(corners[i], corners[(i + 1) % 4]) for i in range(4)]
    sizes = [np.linalg.norm(each, axis=2, keepdims=True) for each in normals]
    # Edges in one plane add nothing.
    normals = [each / np.maximum(size, 1e-300) for each, size in zip(normals, sizes, strict=True)]
    area = sum(
        np.arcsin(np.clip((normals[i] * normals[(i + 1) % 4]).sum(axis=2), -1.0, 1.0))
        for i in range(4)
    )
    sign = np.sign((np.cross(then - low, after - high) * (low - high)).sum(axis=2))
    return abs(float((sign * area).sum())) > 2.0 * math.pi
