"""Rods against the beam itself: closed forms, and that neither passes the other at any speed."""

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from physics import Beam
from physics.bed import BeamOnBed, Bed, SpaceBeam, kernels

FAR = -40.0  # y of a rod's tip, past which nothing slips
ACROSS, UP = (0.0, 1.0, 0.0), np.array([0.0, 0.0, 1.0])


def root(of: Callable[[float], float], low: float, high: float) -> float:
    return float(brentq(of, low, high))  # type: ignore[arg-type]


def made(span: float, elements: int, stiffness: list[float], **options: object) -> SpaceBeam:
    axial, shear, bending = stiffness
    rows = np.array([axial, shear, shear, bending, bending, bending])
    return SpaceBeam.from_axis(span=span, elements=elements, stiffness=rows, **options)  # type: ignore[arg-type]


def on_rod(beam: SpaceBeam, x: float, z: float, radius: float) -> BeamOnBed:
    live = BeamOnBed(beam, rods=1)
    live.set_rod(0, (x, FAR, z), ACROSS, radius)
    return live


def pressing(live: BeamOnBed) -> np.ndarray:
    """(3,) the part of the hand's force that presses the rod against the beam itself, N."""
    return live.state.press[0, :3]


def indentation_force(depth: float, apart: float) -> float:
    """Force of a rod across a straight rigid duct, `depth` beyond the distance of touch."""
    # The integral of K (D - s) (D - depth)/s along the duct, s^2 = x^2 + (D - depth)^2.
    near = apart - depth
    half = math.sqrt(apart * apart - near * near)
    stiffness = kernels.CONTACT_STIFFNESS
    return 2.0 * stiffness * near * (apart * math.asinh(half / near) - half)


@pytest.mark.slow
@pytest.mark.parametrize("depth", [0.1, 0.3, 0.6, 1.0, 1.4])
def test_a_rod_pressed_on_a_rigid_duct(depth: float) -> None:
    live = on_rod(made(40.0, 400, [1e6, 1e6, 1e8], radius=2.0), 20.0, 3.1, 1.0)
    live.lead_rod(0, (20.0, FAR, 3.0 - depth))
    live.advance()
    # An element is a twentieth of the length in touch at least, which begins or ends within one.
    assert live.rod_force(0)[2] == pytest.approx(-indentation_force(depth, 3.0), rel=3e-3)
    assert pressing(live) == pytest.approx(live.rod_force(0), abs=1e-12)


@pytest.mark.parametrize("force", [0.02, 0.1])
def test_a_rod_pressed_on_a_clamped_duct(force: float) -> None:
    """It goes down by the duct's deflection, F L^3/(192 E I) + F L/(4 G A), and its dent."""
    span, bending, shear, apart = 60.0, 400.0, 200.0, 3.0
    live = on_rod(made(span, 600, [2e2, shear, bending], radius=2.0), 0.5 * span, apart, 1.0)
    sag = force * (span**3 / (192.0 * bending) + span / (4.0 * shear))
    dent = root(lambda d: indentation_force(d, apart) - force, 1e-6, 1.0)
    live.lead_rod(0, (0.5 * span, FAR, apart - sag - dent))
    live.advance()
    # The tension that the deflection raises is left out: a thousandth.
    assert live.rod_force(0)[2] == pytest.approx(-force, rel=6e-3)


@pytest.mark.slow
def test_a_beam_over_a_round_post() -> None:
    """Two tangents and an arc, frictionless: the tension is even, T/a = K (D - a) on the arc."""
    span, axial, high, apart = 80.0, 5.0, 25.0, 5.0
    beam = made(span, 200, [axial, 100.0, 2e-3], radius=0.5, ends=("pinned", "pinned"))
    live = on_rod(beam, 0.5 * span, -apart, apart - 0.5)
    for z in np.linspace(-apart, high - apart, 40).tolist():
        live.lead_rod(0, (0.5 * span, FAR, z))
        live.advance()
    height = high - apart

    def shape(tension: float) -> tuple[float, float, float]:
        """Length that is missing, radius of the axis' arc and half the angle of wrap."""
        stretch = 1.0 + tension / axial
        stiffness = kernels.CONTACT_STIFFNESS / stretch
        arc = root(lambda a: tension / a - stiffness * (apart - a), 0.6 * apart, apart)
        away = math.hypot(0.5 * span, height)
        half = math.atan2(height, 0.5 * span) + math.asin(arc / away)
        length = 2.0 * (math.sqrt(away * away - arc * arc) + arc * half)
        return length - span * stretch, arc, half

    tension = root(lambda t: shape(t)[0], 0.1, 2.0)
    _, _, half = shape(tension)
    # What bending rounds off where the arc begins: sqrt(E I/T) = 0.05 mm of 5.6 mm.
    assert live.rod_force(0)[2] == pytest.approx(2.0 * tension * math.sin(half), rel=4e-3)
    direction = np.diff(live.places[:, [0, 2]], axis=0)
    angles = np.arctan2(direction[:, 1], direction[:, 0])
    assert angles[0] - angles[-1] == pytest.approx(2.0 * half, rel=4e-3)


def turns(live: BeamOnBed, x: float, z: float) -> int:
    """How often the duct, closed far below, goes round a place in the plane of x and z.

    The sides that close it go apart: a duct that is dragged down may bulge out beyond its ends.
    """
    far, span = 900.0, live.beam.span
    ring = np.vstack([live.places[:, [0, 2]], [[span + far, -far], [-far, -far]]]) - [x, z]
    after = np.roll(ring, -1, axis=0)
    turn = np.arctan2(
        ring[:, 0] * after[:, 1] - ring[:, 1] * after[:, 0], (ring * after).sum(axis=1)
    )
    return round(float(turn.sum()) / (2.0 * math.pi))


DUCT = Beam.round(span=50.8, diameter=8.89, modulus=0.310264)
THIN = Beam.round(span=40.0, diameter=1.2, modulus=1.0)
LAYER = Bed(strands=100, stiffness=0.09, toughness=0.27, floor=0.3, slack=1.0, seed=7)


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(
    st.sampled_from([DUCT, THIN]),
    st.sampled_from([8, 20, 40]),
    st.floats(0.2, 3.0),
    st.lists(st.tuples(st.floats(0.1, 0.9), st.floats(-25.0, 25.0)), min_size=1, max_size=4),
    st.sampled_from([1, 2, 7, 40]),
    st.booleans(),
    st.booleans(),
)
@example(
    duct=THIN, elements=20, radius=2.0, goes=[(0.234375, -4.0), (0.5, 0.0)], ticks=1,
    hooked=False, bedded=True,
)  # fmt: skip
@example(
    duct=THIN, elements=8, radius=0.5, goes=[(0.1015625, -21.0)], ticks=1, hooked=False,
    bedded=False,
)  # fmt: skip
def test_no_rod_passes_the_duct_at_any_speed(
    duct: Beam,
    elements: int,
    radius: float,
    goes: list[tuple[float, float]],
    ticks: int,
    hooked: bool,
    bedded: bool,
) -> None:
    """Led through it up and down, within some ticks or in one, while a hook pulls or not."""
    beam = SpaceBeam.of(duct, elements=elements)
    layer = LAYER.strands_under(beam) if bedded else None
    live = BeamOnBed(beam, layer, rods=1, retrace=True)
    span = duct.span
    x, z = 0.4 * span, 9.0
    live.set_rod(0, (x, FAR, z), ACROSS, radius)
    node = live.take(0.7 * span) if hooked else None
    place = None if node is None else live.places[node].copy()
    gross = 0.0
    for fraction, height in goes:
        before, after = np.array([x, FAR, z]), np.array([fraction * span, FAR, height])
        for now in range(1, ticks + 1):
            live.lead_rod(0, before + now / ticks * (after - before))
            if node is not None and place is not None:
                live.lead(node, place + 0.3 * height * now / ticks * UP)
            was = live.energy.work
            live.tick(1e-3)
            gross += abs(live.energy.work - was)
            at = live.state.rods[0, [0, 2]]
            assert turns(live, float(at[0]), float(at[1])) == 0
        x, z = after[0], after[2]
    assert np.isfinite(live.places).all()
    live.tick(1e-3)
    # At metres a second one Newton step a part is far from the way: what it leaves open is said.
    # The most that was found is the example's 5.04 %; of 1,211 cases drawn at random, 2.9 %.
    assert abs(live.energy.residual) <= 0.055 * gross + 1e-9


@pytest.mark.long  # many rods
@settings(max_examples=10, deadline=None)
@given(
    st.sampled_from([DUCT, THIN]),
    st.floats(0.3, 3.0),
    st.floats(0.2, 0.8),
    st.floats(-20.0, -8.0),
)
def test_no_rod_is_pushed_through_a_duct_in_equilibrium(
    duct: Beam, radius: float, fraction: float, height: float
) -> None:
    live = BeamOnBed(SpaceBeam.of(duct, elements=40), rods=1)
    x = fraction * duct.span
    live.set_rod(0, (x, FAR, 8.0), ACROSS, radius)
    forces = []
    for z in np.linspace(8.0, height, 8).tolist():
        live.lead_rod(0, (x, FAR, z))
        live.advance()
        assert turns(live, x, z) == 0
        forces.append(-float(live.rod_force(0)[2]))
    energy = live.energy
    assert forces[-1] == max(forces) > 0.0
    assert energy.work == pytest.approx(energy.stored + energy.snap, rel=1e-4)


@pytest.mark.parametrize("ticks", [1, 5, 30])
@pytest.mark.parametrize(("begin", "direction"), [(8.0, -25.0), (-7.0, 45.0)])
def test_a_rod_is_held_back_where_no_hand_could_press_so_hard(
    ticks: int, begin: float, direction: float
) -> None:
    """Led by 25 and 45 mm in some ticks into a duct on a bed: it goes on as the duct gives way."""
    beam = SpaceBeam.of(DUCT, elements=40)
    live = BeamOnBed(beam, LAYER.strands_under(beam), floor=LAYER.floor_under(beam), rods=1)
    live.set_rod(0, (25.4, FAR, begin), ACROSS, 1.2)
    side = turns(live, 25.4, begin)
    for now in range(1, ticks + 1):
        live.lead_rod(0, (25.4, FAR, begin + direction * now / ticks))
        live.tick(1e-3)
        # What a hand can, and by how much more the last part of a way presses.
        assert np.abs(pressing(live)).max() < 300.0
    live.tick(0.2, ticks=200)
    x, _, z = live.state.rods[0, :3].tolist()
    # The bed below it would answer with 60 N.
    pressed = float(np.sqrt((pressing(live) ** 2).sum()))
    assert pressed < 1.1 * kernels.HELD_BACK
    assert z == pytest.approx(begin + direction, abs=1e-12) or pressed > 0.9 * kernels.HELD_BACK
    assert turns(live, x, z) == side
    energy = live.energy
    # Without `retrace` up to 0.21 % is open.
    assert abs(energy.residual) < 3e-3 * energy.work
    assert energy.snap >= 0.0 <= energy.drag


def test_a_rod_that_jumps_over_the_duct_and_its_strands_in_one_tick_meets_both() -> None:
    beam = SpaceBeam.of(DUCT, elements=40)
    live = BeamOnBed(beam, LAYER.strands_under(beam), rods=1)
    live.set_rod(0, (25.4, FAR, 8.0), ACROSS, 1.2)
    live.lead_rod(0, (25.4, FAR, -17.0))
    live.tick(1e-3)
    # Held back within the tick it has not come all the way yet; the duct is still below it.
    assert live.places[20, 2] < live.state.rods[0, 2] < 0.0
    for _ in range(200):
        live.tick(1e-3)
    assert live.state.rods[0, 2] == -17.0
    assert live.places[20, 2] < -17.0
    slow = BeamOnBed(beam, LAYER.strands_under(beam), rods=1)
    slow.set_rod(0, (25.4, FAR, 8.0), ACROSS, 1.2)
    for z in np.linspace(8.0, -17.0, 40).tolist():
        slow.lead_rod(0, (25.4, FAR, z))
        slow.advance()
    # It comes to rest where equilibria come to; the hand has done more work, and got none.
    assert live.rod_force(0)[2] == pytest.approx(slow.rod_force(0)[2], rel=0.05)
    assert live.energy.work > slow.energy.work > 0.0


@pytest.mark.parametrize("direction", [lambda b: b.advance(), lambda b: b.tick(1.0, ticks=1000)])
def test_contact_within_the_penalty_is_as_it_was(direction: Callable[[BeamOnBed], None]) -> None:
    """The core is reached past half of R + r: until then nothing of it enters."""
    live = on_rod(SpaceBeam.of(DUCT, elements=40), 25.4, 6.0, 1.2)
    live.lead_rod(0, (25.4, FAR, 4.0))
    direction(live)
    assert pressing(live)[2] < -0.1
    assert live.state.sums[kernels.CLEAR] == pytest.approx(
        0.4 * 0.5 * (0.5 * 8.89 + 1.2), rel=1e-12
    )


@pytest.mark.parametrize("millimetres", [0.005, 0.1, 30.0])
def test_hands_that_tremble_or_leap_make_no_snap_below_zero(millimetres: float) -> None:
    beam = SpaceBeam.of(DUCT, elements=40)
    live = BeamOnBed(beam, LAYER.strands_under(beam), floor=LAYER.floor_under(beam))
    node = live.take(25.4)
    place, before = live.places[node].copy(), 0.0
    for now in range(200):
        live.lead(node, place + (millimetres if now % 2 else 0.0) * UP)
        live.tick(1e-3)
        energy = live.energy
        assert energy.snap >= before
        assert energy.drag >= 0.0
        before = energy.snap
    energy = live.energy
    energies = energy.stored + energy.dissipated + energy.snap + energy.drag + energy.lag
    assert energy.work == pytest.approx(energies + energy.residual, rel=1e-12)


@pytest.mark.parametrize("length", [6.0, 14.0, 60.0])
def test_a_short_rod_is_the_same_from_both_ends_and_nothing_past_them(length: float) -> None:
    """Led under a duct, up, and out on its other side, through strands that go round it."""
    beam = SpaceBeam.of(DUCT, elements=40)
    layer = replace(LAYER, around=0.5)
    u = np.array([0.1, 0.9, 0.2]) / math.sqrt(0.86)
    path = np.array(
        [[20.0, 19.0, -6.0], [24.0, -5.0, -6.0], [28.0, -4.0, -2.0], [29.0, -30.0, -4.0]]
    )
    lives = [
        BeamOnBed(beam, layer.strands_under(beam), floor=layer.floor_under(beam), rods=1)
        for _ in range(2)
    ]
    ends = ((np.zeros(3), u), (length * u, -u))
    for live, (offset, direction) in zip(lives, ends, strict=True):
        live.set_rod(0, path[0] + offset, direction.tolist(), 0.6, length)
    touched = 0
    for before, after in pairwise(path):
        for fraction in np.linspace(0.0, 1.0, 60)[1:]:
            for live, (offset, _) in zip(lives, ends, strict=True):
                live.lead_rod(0, before + fraction * (after - before) + offset)
                live.tick(1e-3)
            one, other = lives
            touched += int(one.touched_by(0).sum())
            assert (one.touched_by(0) == other.touched_by(0)).all()
            np.testing.assert_allclose(one.places, other.places, atol=1e-9)
            np.testing.assert_allclose(one.rod_force(0), other.rod_force(0), atol=1e-9)
    assert touched > 0
    assert lives[0].rod_force(0).any() == (length > 30.0)  # a short one is through


def test_a_rod_too_long_to_end_near_tissue_is_an_endless_one() -> None:
    beam = SpaceBeam.of(DUCT, elements=40)
    ends = []
    for length in (math.inf, 200.0):
        live = BeamOnBed(beam, LAYER.strands_under(beam), rods=1)
        live.set_rod(0, (25.4, -6.0, 8.0), ACROSS, 1.2, length)
        live.lead_rod(0, (25.4, -6.0, -9.0))
        live.tick(0.1, ticks=100)
        ends.append((live.places.tobytes(), live.rod_force(0).tobytes()))
    assert ends[0] == ends[1]


def test_strands_round_both_jaws_are_counted_once() -> None:
    """Two rods side by side drag strands along, part, and slip out: no energy is left over."""
    beam = SpaceBeam.of(DUCT, elements=40)
    layer = replace(LAYER, around=0.0)
    floor = layer.floor_under(beam)
    live = BeamOnBed(beam, layer.strands_under(beam), floor=floor, rods=2, retrace=True)
    tips = np.array([[20.0, 20.0, -5.5], [21.0, 20.0, -5.5]])
    for rod, tip in enumerate(tips):
        live.set_rod(rod, tip, ACROSS, 0.5)
    for (x, y, apart), ticks in (
        ((20.5, -14.0, 0.5), 60),  # in under the duct
        ((24.5, -14.0, 0.5), 30),  # along it: strands wind round both
        ((24.25, -14.0, 1.25), 20),  # opened
        ((24.25, 20.0, 1.25), 25),  # and drawn out
    ):
        target = np.array([[x - apart, y, -5.5], [x + apart, y, -5.5]])
        for fraction in np.linspace(0.0, 1.0, ticks + 1)[1:]:
            for rod in range(2):
                live.lead_rod(rod, tips[rod] + fraction * (target[rod] - tips[rod]))
            live.tick(1.0 / 240.0)
        tips = target
        both = (live.touched_by(0) & live.touched_by(1)).sum()
        assert both >= 5 or y > 0.0 or x < 24.0
    energy = live.energy
    assert energy.snap > 0.0 < energy.dissipated
    assert abs(energy.residual) < 1e-4 * (energy.stored + energy.dissipated + energy.snap)
