"""The scope and the instruments in their trocars, the assistant, and what a frame holds."""

import math
import re
from functools import cache, partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast
from unittest.mock import MagicMock, patch

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace
from numpy.typing import NDArray

from app.anatomy import (
    AnatomyNetwork,
    anatomy_named,
    anatomy_network,
    shipped_anatomies,
    tube_title,
)
from app.simulation import (
    FIELD_OF_VIEW,
    GRIP_N,
    IN_RING_MM,
    TICK_SECONDS,
    TROCARS,
    Dissection,
    Exercise,
    Feedback,
    NextStep,
    Phase,
    Replay,
    Safety,
    Session,
    Sights,
    Specimen,
    Trocar,
    exercise_at,
    exercises_offered,
    near_place,
    performed,
    read_run,
    read_script,
    run_json,
    seen_beside,
)
from app.simulation.exercises.critical_view import Part
from app.simulation.exercises.next_step import (
    BACK,
    BACK_ALONG,
    CLOSE,
    CLOSE_FEW,
    FIRM,
    GENTLE,
    LEAVE,
    OUT_AS,
    PRESSES,
    WITHDRAW,
    WITHDRAW_ALONG,
)
from app.simulation.inputs.trocar import DEEPEST, LENGTH
from app.simulation.tissue.guidance import Guidance
from app.simulation.tissue.hold_steps import (
    NEARLY_TORN,
    OFF_THE_LIVER,
    STAGE_MM,
    STAGES,
    TO_COMMON,
    HoldSteps,
    _Pulling,
)
from app.simulation.tissue.jaw_steps import (
    DEEPER_MM,
    DIRECTIONS,
    LEAVES_FOR,
    LEFT_MM,
    MOST_STRAINED,
    JawSteps,
)
from app.simulation.tissue.parting import PartingPlaces
from app.simulation.tissue.reached_tube import MISSED, pointed_at
from app.simulation.tissue.spatial_tissue import SpatialTissue
from app.trainer.client.asked_step import JUDGED_TICKS, USED_TICKS, AskedStep
from app.trainer.client.page_state import PageState
from app.trainer.client.scope_lead import (
    AHEAD_TICKS,
    BENT_STEADY,
    CLOSED_ON,
    CLOSES_MM_S,
    DO_NEXT,
    DRAGGED_MM,
    DRAWS_MM_S,
    GRIPS_AT,
    HOLDS_MM_S,
    INSISTS,
    LEAST_PUSH_N,
    LEAST_SPEED,
    MM_DIGITS,
    NEXT_SLACKENS,
    NO_RING,
    NOT_IN_RING,
    NOTCH_MM,
    NOTHING_LIES,
    OFF_MM,
    PARTS_MM_S,
    PRESSED_MM,
    PUSHED,
    QUICK_MOVES,
    RISES,
    SPREAD,
    STEADY,
    THERE_MM,
    ScopeLead,
    Stop,
)
from app.trainer.client.structure_pointer import StructurePointer
from app.trainer.client.workers import Workers
from app.trainer.panel.scope_panel import KEYS, _moves
from app.trainer.scope.assistant import INNER, SPEED, Assistant
from app.trainer.scope.held_scope import (
    DIRECTION,
    HOME,
    OUTSIDE,
    RETURNS_MM_S,
    RETURNS_RAD_S,
    UP,
    HeldScope,
)
from app.trainer.scope.packing import HEADER, NODE_NUMBERS, DrawnHand, Frame, Packing, Well
from app.trainer.scope.pose import OBLIQUE, Laparoscope, Pose
from app.trainer.scope.surroundings import film_runs, floor_under, strand_table, working_place
from app.trainer.scope.tube_walls import SIDES, tube_wall
from app.trainer.view.scope_scene import ScopeScene
from organ_geometry import DrivingPoints, Organ
from organ_geometry.curves.half_curves import fit_half_curves
from physics.bed import SpaceBeam

SCRIPTS = Path(__file__).parents[2] / "assets" / "scripts"
TARGET = np.array([44.0, 8.0, 0.0])
ROUNDED_MM = math.sqrt(3.0) * 10.0**-MM_DIGITS
"""By which a step of a led hand may be longer: where to it is led is rounded."""
angles = st.floats(-1.0, 1.0)
directions = st.floats(-math.pi, math.pi)


def scope(angle: float = 0.0) -> Laparoscope:
    """Return a scope before the triangle."""
    straight = Laparoscope.towards(TARGET, DIRECTION, UP, outside=OUTSIDE)
    return Laparoscope(straight.pivot, straight.base, angle)


@given(
    angles, angles, st.floats(20.0, 200.0), directions, directions, st.sampled_from([0.0, OBLIQUE])
)
@settings(deadline=None, max_examples=200)
def test_the_shaft_passes_the_trocar(
    pan: float, tilt: float, depth: float, cable: float, head: float, angle: float
) -> None:
    """Found from the camera alone, the shaft passes its pivot (0.01 mm is asked)."""
    held = scope(angle)
    camera = held.camera(Pose(pan, tilt, depth, cable, head))
    assert camera.axes.T @ camera.axes == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(camera.axes) == pytest.approx(1.0, abs=1e-12)
    seen = np.array([math.sin(cable - head), math.cos(cable - head), 0.0])
    turned = np.cross([0.0, 0.0, -1.0], seen)
    # The shaft is the optical axis turned back about an axis that the camera's own frame knows.
    back = np.array([0.0, 0.0, -1.0]) * math.cos(angle)
    back -= np.cross(turned, [0.0, 0.0, -1.0]) * math.sin(angle)
    shaft = camera.axes @ back
    off = held.pivot - camera.tip
    assert np.linalg.norm(off - (off @ shaft) * shaft) < 1e-9
    assert math.acos(min(1.0, -camera.axes[:, 2] @ camera.shaft)) == pytest.approx(angle, abs=1e-7)


def test_turning_the_cable_swings_the_view_and_leaves_the_horizon() -> None:
    """Of an oblique scope: by 4.1 degrees at most of apparent roll; the head alone rolls it."""
    held = scope(OBLIQUE)
    rolls = [abs(held.roll(Pose(cable=math.radians(c)))) for c in range(0, 360, 15)]
    assert max(rolls) == pytest.approx(math.radians(4.11), abs=math.radians(0.05))
    assert rolls[0] == pytest.approx(0.0, abs=1e-12)
    assert held.roll(Pose(head=0.3)) == pytest.approx(-0.3, abs=1e-12)


@given(st.floats(-14, 14), st.floats(-14, 14), st.floats(-8, 8), st.floats(45, 90), directions)
@settings(deadline=None, max_examples=40)
def test_look_has_the_target_in_the_middle(
    x: float, y: float, z: float, distance: float, cable: float
) -> None:
    """At its distance, with a level horizon, for either scope."""
    for angle in (0.0, OBLIQUE):
        held, target = scope(angle), TARGET + np.array([x, y, z])
        pose = held.look(target, distance, Pose(depth=150.0, cable=cable))
        camera = held.camera(pose)
        assert camera.tip - distance * camera.axes[:, 2] == pytest.approx(target, abs=1e-9)
        assert held.roll(pose) == pytest.approx(0.0, abs=1e-9)
        assert camera.seen(target) == pytest.approx((0.0, distance), abs=1e-9)


def test_the_assistant_follows_tips_and_never_jumps() -> None:
    """Both tips come into the picture's inner part; no tick moves what is seen by much."""
    held = scope()
    assistant = Assistant(held, Pose(depth=OUTSIDE - HOME), TARGET, HOME)
    tips = [TARGET + np.array([4.0, 45.0, 6.0]), TARGET + np.array([-10.0, 25.0, 0.0])]
    before = held.camera(assistant.pose)
    assert max(before.seen(tip)[0] for tip in tips) > 1.0
    for _ in range(600):
        pose = assistant.follow(tips, 1 / 30)
        camera = held.camera(pose)
        # Where the optical axis was, HOME mm away, moves no faster than the assistant may.
        moved = (camera.tip - HOME * camera.axes[:, 2]) - (before.tip - HOME * before.axes[:, 2])
        assert np.linalg.norm(moved) < 2.5 * SPEED / 30
        assert held.roll(pose) == pytest.approx(0.0, abs=1e-9)
        before = camera
    assert max(before.seen(tip)[0] for tip in tips) == pytest.approx(INNER, abs=1e-3)


@given(
    st.floats(-0.9, 0.9), st.floats(-0.7, 0.7), st.floats(-120.0, 50.0),
    st.floats(-3.1, 3.1), st.floats(-3.1, 3.1), st.booleans(),
)  # fmt: skip
@settings(deadline=None, max_examples=30)
def test_a_scope_that_is_given_back_returns_without_a_jump(
    pan: float, tilt: float, depth: float, cable: float, head: float, oblique: bool
) -> None:
    """All its turns and its slide arrive together, the slowest of them at its most speed."""
    held = HeldScope(anatomy_network(anatomy_named("normal")))
    if oblique:
        held.change()
    home = held.pose
    held.move(pan, tilt, depth, cable, head)
    far, before = path(held.pose, home), held.pose
    turn, slide = RETURNS_RAD_S * TICK_SECONDS, RETURNS_MM_S * TICK_SECONDS
    least = max(np.abs(far) / [turn, turn, slide, turn, turn])
    held.give_back()
    assert held.assisted
    assert held.pose == before
    ticks = 0
    while held.advance([]):
        step = path(before, held.pose)
        assert (np.abs(step) <= np.array([turn, turn, slide, turn, turn]) + 1e-9).all()
        assert np.abs(np.outer(step, far) - np.outer(far, step)).max() < 1e-6  # straight
        before, ticks = held.pose, ticks + 1
    assert held.pose == home
    assert math.ceil(least - 1e-6) <= ticks <= math.ceil(least)


def path(start: Pose, end: Pose) -> NDArray[np.float64]:
    """Return the shorter way from one pose to another, (5,) rad, and mm of its depth."""
    pan, tilt, depth, cable, head = np.subtract(end.numbers, start.numbers).tolist()
    whole = 2.0 * math.pi
    return np.array([pan, tilt, depth, math.remainder(cable, whole), math.remainder(head, whole)])


@given(st.floats(0.0, 0.99 * INNER), st.floats(0.0, 2.0 * math.pi), st.floats(-9.0, 9.0))
@settings(deadline=None, max_examples=50)
def test_the_picture_stands_still_under_a_drag_in_its_inner_part(
    off: float, angle: float, deeper: float
) -> None:
    """Wherever both tips are there, deeper or nearer, the assistant does not move."""
    held, wide = scope(), math.tan(0.5 * FIELD_OF_VIEW)
    assistant = Assistant(held, Pose(depth=OUTSIDE - HOME), TARGET, HOME)
    still, camera = assistant.pose, held.camera(assistant.pose)
    out = off * wide * np.array([math.cos(angle), math.sin(angle), 0.0])
    tips = [
        camera.tip + (HOME + far) * (camera.axes @ (side * out - [0.0, 0.0, 1.0]))
        for side, far in ((1.0, deeper), (-1.0, 0.0))
    ]
    assert assistant.follow(tips, 1 / 30) == still


def test_tips_at_opposite_edges_are_both_kept_in_view() -> None:
    """The scope is drawn back, no more than they need, and rests."""
    held = scope()
    assistant = Assistant(held, Pose(depth=OUTSIDE - HOME), TARGET, HOME)
    right = held.camera(assistant.pose).axes[:, 0]
    tips = [TARGET + 36.0 * right, TARGET - 36.0 * right]
    cameras = [held.camera(assistant.follow(tips, 1 / 30)) for _ in range(1500)]
    seen = [max(each.seen(tip)[0] for tip in tips) for each in cameras]
    assert seen == sorted(seen, reverse=True), "never to and fro"
    assert seen[-1] == pytest.approx(INNER, abs=1e-3)
    assert cameras[-1].seen(TARGET)[0] == pytest.approx(0.0, abs=1e-6)


@given(st.floats(-60, 60), st.floats(-60, 60), st.floats(-20, 40), st.sampled_from(TROCARS))
@settings(deadline=None, max_examples=100)
def test_handle_and_tip_lead_to_each_other(x: float, y: float, z: float, trocar: Trocar) -> None:
    """Tip, trocar and handle are on one line; across the shaft the fulcrum reverses."""
    tip = trocar.within(TARGET + np.array([x, y, z]))
    handle = trocar.handle(tip)
    assert np.linalg.norm(tip - handle) == pytest.approx(LENGTH, rel=1e-12)
    assert trocar.tip(handle) == pytest.approx(tip, abs=1e-9)
    off = trocar.place - tip
    shaft = trocar.shaft(tip)
    assert np.linalg.norm(off - (off @ shaft) * shaft) < 1e-9
    across = np.cross(shaft, [0.0, 0.0, 1.0])
    across *= 1e-3 / np.linalg.norm(across)
    moved = trocar.led_by_handle(tip, across) - tip
    assert moved == pytest.approx(-across, abs=2e-8)  # of the first order in the move
    into = trocar.led_by_handle(tip, -1e-3 * shaft) - tip
    assert into == pytest.approx(-1e-3 * shaft, abs=1e-9) or np.linalg.norm(off) > DEEPEST - 1


@pytest.fixture(scope="module")
def made() -> AnatomyNetwork:
    """The usual anatomy as a network."""
    return anatomy_network(anatomy_named("normal"))


def test_a_frame_is_small_and_says_what_is_known(made: AnatomyNetwork) -> None:
    """At most 6 kB; places to float32, tautness to a thousandth, and what has parted."""
    bed = made.on_bed()
    packing = Packing(bed)
    with pytest.raises(ValueError, match="another network"):
        packing.write(anatomy_network(anatomy_named("short-cystic")).on_bed(), Frame(Pose()), 0.0)
    parted = np.arange(0, made.strands.count, 7)
    bed.state.damage[parted] = 1.0
    hands = [DrawnHand(2, (1.0, 2.0, 3.0), 4.0, 0.5, holds=True)]
    packing.write(bed, Frame(Pose(0.1, 0.2, 90.0), hands, [Well((7.0, 8.0, 9.0), 5.0)]), OBLIQUE)
    assert packing.numbers.nbytes <= 6000
    flat = packing.numbers.reshape(-1)
    assert flat[:3].tolist() == np.array([0.1, 0.2, 90.0], np.float32).tolist()
    assert flat[8:15].tolist() == [1.0, 2.0, 3.0, 4.0, 0.5, 2.0, 1.0]
    assert flat[21] == -1.0  # there is no second hand
    assert flat[24:29].tolist() == [7.0, 8.0, 9.0, 5.0, 1.0]
    count, nodes = made.strands.count, bed.places.shape[0]
    rows = flat[HEADER : HEADER + NODE_NUMBERS * nodes].reshape(nodes, NODE_NUMBERS)
    assert rows[:, :3] == pytest.approx(bed.places, rel=1e-6)
    pairs = flat[HEADER + NODE_NUMBERS * nodes :][: -(-count // 2)].astype(np.int64)
    codes = np.stack([pairs // 2048, pairs % 2048], axis=1).reshape(-1)[:count]
    assert np.flatnonzero(codes == 0).tolist() == parted.tolist()
    strands, order = made.strands, bed.order
    length = np.linalg.norm(strands.ends - strands.feet, axis=1)
    longer = length - strands.length
    scale = np.where(longer > 0.0, strands.failure_elongation, strands.length)
    taut = np.clip(longer / scale, -0.5, 1.0)[order]
    whole = codes > 0
    assert ((codes - 1) / 1000 * 1.5 - 0.5)[whole] == pytest.approx(taut[whole], abs=8e-4)


def test_a_tube_is_drawn_by_its_sections() -> None:
    """Of a straight tube of ellipses the page's distances are the ellipse's; of a round one r."""
    axis = np.linspace((0.0, 0.0, 0.0), (40.0, 0.0, 0.0), 21)
    outline = np.linspace(0.0, 2.0 * np.pi, 256, endpoint=False)
    frames = np.tile(np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), (21, 1, 1))
    for wide, high in ((3.0, 2.0), (2.5, 2.5)):
        ellipse = np.stack([wide * np.cos(outline), high * np.sin(outline)], axis=1)
        rows = np.tile(fit_half_curves(ellipse).as_row(), (2, 1))
        organ = Organ(axis=axis, frames=frames, keys=np.array([0, 20]), outer=rows)
        specimen = Specimen.of_anatomy(anatomy_named("normal"))
        driving = DrivingPoints.of(organ, spacing=1.0)
        dissection = Dissection(
            organ, specimen.preset, specimen.beam, (0.0, 40.0), driving, np.eye(3), np.zeros(3)
        )
        rest = SpaceBeam.round_tube(
            axis, radius=np.array([2.5]), wall=0.5, modulus=0.1, poisson_ratio=0.5, elements=10
        )
        wall = tube_wall(dissection, rest, (False, False))
        assert wall.shape == (3 * 10 + 1, SIDES)
        # From up, which is z, towards the side, y the other way round: both are symmetric.
        angle = np.linspace(0.0, 2.0 * np.pi, SIDES, endpoint=False)
        wanted = 1.0 / np.hypot(np.sin(angle) / wide, np.cos(angle) / high)
        # Half-curves of degree 6 miss a circle by up to a hundredth of its radius.
        np.testing.assert_allclose(wall, np.tile(wanted, (31, 1)), rtol=0.012)


@pytest.mark.parametrize("name", shipped_anatomies())
def test_what_lies_about_the_tubes(name: str) -> None:
    """The floor is below all tubes but the gallbladder; films join strands in order."""
    made = anatomy_network(anatomy_named(name))
    bed, floor = made.on_bed(), floor_under(made)
    for tube in made.anatomy.tube:
        beam = made.network.tubes[tube.name]
        if tube.kind == "organ":
            continue
        for place in beam.places:
            column = round((place[0] - floor.x0) / floor.cell)
            row = round((place[1] - floor.y0) / floor.cell)
            assert floor.heights[row, column] < place[2]
    table = strand_table(made, bed)
    ends = bed.strand_ends()[bed.order]
    at_rest = bed.places[table[:, 0].astype(int)]
    assert np.linalg.norm(ends - at_rest, axis=1) == pytest.approx(
        np.linalg.norm(table[:, 1:4], axis=1), abs=1e-9
    )
    to_bed = table[:, 4] < 0
    assert table[to_bed, 5:8] == pytest.approx(made.strands.feet[bed.order][to_bed], abs=1e-9)
    runs, films = film_runs(made, bed)
    assert np.unique(runs).size == runs.size <= made.strands.count
    assert films.size
    assert films.max() < runs.size
    assert (films[:, 0] < films[:, 1]).all()
    held = HeldScope(made)
    assert held.camera.seen(working_place(made)) == pytest.approx((0.0, HOME), abs=1e-8)


@pytest.mark.parametrize("drop", [(), ("artery",), ("artery", "gallbladder")])
def test_a_scope_looks_at_any_anatomy_s_triangle(drop: tuple[str, ...]) -> None:
    """By kinds and joins, whatever the tubes' names; else at the middle of all tubes."""
    usual = anatomy_named("normal")
    renamed = {tube.name: f"t{number}" for number, tube in enumerate(usual.tube)}
    anatomy = replace(
        usual,
        tube=[replace(one, name=renamed[one.name]) for one in usual.tube if one.name not in drop],
        join=[
            replace(one, tube=renamed[one.tube], to=renamed[one.to])
            for one in usual.join
            if not {one.tube, one.to} & set(drop)
        ],
        layer=[],
        touch=[],
    )
    anatomy = replace(
        anatomy,
        tube=[replace(one, ends=tuple("clamped" if each == "joined" and not any(
            join.tube == one.name and join.end == end for join in anatomy.join
        ) else each for end, each in enumerate(one.ends))) for one in anatomy.tube],
    )  # fmt: skip
    made = anatomy_network(anatomy)
    tubes = {name: made.network.tubes[new] for name, new in renamed.items() if name not in drop}
    target = working_place(made)
    if "gallbladder" in drop:
        every = np.concatenate([beam.places for beam in tubes.values()])
        assert target == pytest.approx(every.mean(axis=0))
        return
    neck, junction = tubes["gallbladder"].places[0], tubes["cystic"].places[0]
    origin = tubes["artery"].places[0] if "artery" in tubes else junction
    expected = 0.45 * neck + 0.25 * junction + 0.3 * origin + [1.5, 0.0, 0.0]
    assert target == pytest.approx(expected, abs=1e-9)


def test_jaws_close_on_the_nearest_tube(made: AnatomyNetwork) -> None:
    """At its station; on none where no wall is near."""
    bed = made.on_bed()
    for number, (name, tube) in enumerate(made.network.tubes.items()):
        nodes, stations = bed.nodes_of(name), bed.stations_of(name)
        k = nodes.size // 2
        place = bed.places[nodes[k]] + np.array([0.0, 0.0, tube.radius[k]])
        found = near_place(bed, place)
        assert found is not None
        assert found[0] == number
        assert found[1] == pytest.approx(stations[k], abs=tube.radius[k])
    assert near_place(bed, np.array([20.0, -40.0, 30.0])) is None


def test_a_tip_is_on_a_side_of_the_nearest_tube(made: AnatomyNetwork) -> None:
    """In front of it, behind it or beside it, as it is seen."""
    bed, axes = made.on_bed(), np.eye(3)[:, [1, 0, 2]]
    tubes = list(made.network.tubes)
    middle, radius = bed.places_at(np.array([12.0]), "cystic")[0], 2.0
    for along, side in ((axes[:, 2], "in front of"), (-axes[:, 2], "behind")):
        far, number, found = seen_beside(bed, middle + (radius + 0.4) * along, axes)
        assert (tubes[number], found) == ("cystic", side)
        assert far == pytest.approx(0.4, abs=0.7)
    chord = np.diff(bed.places_at(np.array([11.0, 13.0]), "cystic"), axis=0)[0]
    across = np.cross(chord, axes[:, 2])
    tip = middle + (radius + 0.4) * across / np.linalg.norm(across)
    assert seen_beside(bed, tip, axes)[1:] == (tubes.index("cystic"), "beside")


@pytest.fixture
def lead() -> ScopeLead:
    """Return what mouse and keys lead at the usual anatomy."""
    anatomy = anatomy_named("normal")
    session = Session(Specimen.of_anatomy(anatomy), vertices=300)
    state = PageState(MagicMock(), session, cast(Workers, None))
    return ScopeLead(state, HeldScope(anatomy_network(anatomy)))


def pass_time(lead: ScopeLead, session: Session, seconds: float) -> None:
    """Let hands go where they are led."""
    for _ in range(round(seconds / TICK_SECONDS)):
        lead.advance(1)
        session.advance()


def test_a_flick_of_the_mouse_tears_nothing(lead: ScopeLead) -> None:
    """A hand that holds goes at most 8 mm/s, and stops where its pointer lets go."""
    session = lead.session
    tissue = session.spatial
    lead.lead_hand(tissue.beam.places_at(np.array([14.0]), "gallbladder")[0] + [0.0, 0.0, 6.0])
    pass_time(lead, session, 1.5)
    lead.use_instrument()
    hand = tissue.hands[0]  # the run has begun
    assert hand.node is not None
    assert tissue.tubes.names[hand.tube] == "gallbladder"
    start = hand.place.copy()
    lead.lead_hand(start + np.array([0.0, 30.0, 60.0]))
    before = start
    for _ in range(15):
        pass_time(lead, session, TICK_SECONDS)
        # It follows its target as a damped mass, without running ahead of it.
        assert np.linalg.norm(hand.target - before) <= HOLDS_MM_S * TICK_SECONDS + ROUNDED_MM
        before = hand.target.copy()
    lead.stop()
    pass_time(lead, session, 1.0)
    assert np.linalg.norm(hand.place - start) <= HOLDS_MM_S * 0.5 + 15 * ROUNDED_MM
    assert not tissue.events
    lead.use_instrument()
    assert hand.node is None


def test_wheel_and_pointer_go_on_from_where_a_tip_is_led(lead: ScopeLead) -> None:
    """Pictures may come late: what is led goes to the end, whatever is drawn meanwhile."""
    session, camera = lead.session, lead.held.camera
    hand = session.spatial.hands[0]
    right, up, back = camera.axes.T

    def ray(place: np.ndarray) -> np.ndarray:
        return np.array([*camera.tip, *0.1 * (place - camera.tip)])

    def under(pointer: np.ndarray, tip: np.ndarray, shaft: np.ndarray) -> np.ndarray:
        """Where a pointer is in the plane half-way between the picture's and across a shaft."""
        way, normal = pointer[3:], back + shaft
        return camera.tip + way * (((tip - camera.tip) @ normal) / (way @ normal))

    def deeper(place: np.ndarray, notches: float) -> np.ndarray:
        return place - NOTCH_MM * notches * TROCARS[0].shaft(place)

    # Notches add up to a press on the picture, before the tip is there and after the button is up.
    start = hand.place.copy()
    pointer = ray(start + 6.0 * right + 4.0 * up)
    pressed = under(pointer, start, TROCARS[0].shaft(start))
    lead.press(*pointer)
    lead.stop()
    lead.wheel(1.0)
    lead.wheel(2.0)
    pass_time(lead, session, 3.0)
    there = deeper(pressed, 3.0)
    assert hand.place == pytest.approx(there, abs=0.02)
    # A press takes it aside from where it is led, and a drag goes on from there.
    lead.wheel(-2.0)
    led = deeper(there, -2.0)
    shaft = TROCARS[0].shaft(led)
    lead.press(*ray(led - 3.0 * right))
    lead.drag(*ray(led - 8.0 * right))
    dragged = under(ray(led - 8.0 * right), led, shaft)
    lead.wheel(1.0)
    lead.drag(*ray(led - 10.0 * right))
    pass_time(lead, session, 3.0)
    further = under(ray(led - 10.0 * right), dragged, shaft) - dragged
    assert hand.place == pytest.approx(deeper(dragged, 1.0) + further, abs=0.1)
    # By its handle it goes the other way, and a notch is one all the same.
    lead.by_handle = True
    before, shaft = hand.place.copy(), TROCARS[0].shaft(hand.place)
    lead.press(*ray(before))
    lead.drag(*ray(before + 2.0 * up))
    lead.stop()
    lead.wheel(1.0)
    pass_time(lead, session, 2.0)
    moved = hand.place - before
    assert moved @ up < -0.5
    assert moved @ shaft == pytest.approx(-NOTCH_MM, abs=0.1)
    lead.drag(*ray(before))  # no pointer is pressed any more
    pass_time(lead, session, 1.0)
    assert hand.place == pytest.approx(before + moved, abs=0.02)


def test_half_of_a_pinch_is_taken_back_and_a_stick_that_rests_leads_no_further(
    lead: ScopeLead,
) -> None:
    session, camera = lead.session, lead.held.camera
    hand, right = session.spatial.hands[0], camera.axes[:, 0]

    def ray(place: np.ndarray) -> np.ndarray:
        return np.array([*camera.tip, *0.1 * (place - camera.tip)])

    start = hand.place.copy()
    there = start - 2.0 * NOTCH_MM * TROCARS[0].shaft(start)
    lead.press(*ray(start + 6.0 * right))
    pass_time(lead, session, 0.2)
    lead.drag(*ray(start + 12.0 * right))
    pass_time(lead, session, 0.2)
    assert (hand.place - start) @ right > 3.0
    lead.take_back()
    lead.wheel(2.0)
    lead.drag(*ray(start + 12.0 * right))  # no pointer is pressed any more
    pass_time(lead, session, 3.0)
    assert hand.place == pytest.approx(there, abs=0.02)
    # A stick asks for more than a hand may go: as it rests the hand stops, but not after a click.
    for act, leads_on in ((lead.rest, False), (lead.stop, True)):
        for _ in range(20):
            lead.nudge(3.0, 0.0, 0.0)
            pass_time(lead, session, TICK_SECONDS)
        now = hand.target.copy()
        act()
        pass_time(lead, session, 1.0)
        if leads_on:
            assert (hand.place - now) @ right > 3.0
        else:
            assert hand.place == pytest.approx(now, abs=0.02)


def test_what_is_held_is_led_from_where_it_is(lead: ScopeLead) -> None:
    """A press beside it does not pull, and a drag pulls by as much as the pointer goes."""
    session, tissue, camera = lead.session, lead.session.spatial, lead.held.camera
    session.grab(0, 14.0, tissue.tubes.names.index("gallbladder"))
    hand = tissue.hands[0]
    start, aside = hand.target.copy(), 7.0 * camera.axes[:, 0]

    def ray(place: np.ndarray) -> list[float]:
        return [*camera.tip, *(place - camera.tip)]

    lead.press(*ray(hand.tip + aside))
    pass_time(lead, session, 0.5)
    assert hand.target == pytest.approx(start)
    lead.drag(*ray(hand.tip + aside + 2.0 * camera.axes[:, 1]))
    pass_time(lead, session, 1.0)
    assert hand.target - start == pytest.approx(2.0 * camera.axes[:, 1], abs=0.2)


def test_a_hold_that_is_lost_is_told(lead: ScopeLead) -> None:
    session, state = lead.session, lead._state
    lead.lead_hand(
        session.spatial.beam.places_at(np.array([14.0]), "gallbladder")[0] + [0.0, 0.0, 6.0]
    )
    pass_time(lead, session, 1.5)
    lead.use_instrument()
    session.spatial._grip = 0.05  # N
    session.move_hand(0, session.spatial.hands[0].place + np.array([0.0, 0.0, 5.0]))
    for _ in range(60):
        state.advance(1)
    assert session.spatial.hands[0].slips == 1
    title, words = cast(MagicMock, state.client.add_notification).call_args.args
    assert title == "The hold is lost"
    assert words.startswith("The gallbladder slid out of the grasper, which holds 11.3 N.")


def test_jaws_part_at_once_but_are_not_thrown_open(lead: ScopeLead) -> None:
    """Whoever has a mouse has one button for it: it does as the errors' advice says."""
    session = lead.session
    lead.choose(1)
    artery, duct = (session.spatial.beam.places_at(np.array([12.0]), each)[0]
                    for each in ("artery", "cystic"))  # fmt: skip
    lead.lead_hand(0.5 * (artery + duct))
    pass_time(lead, session, 4.0)
    hand = session.spatial.hands[1]

    def quickest(ticks: int) -> float:
        """Return how fast the jaws go at most, mm/s."""
        most, before = 0.0, hand.opening
        for _ in range(ticks):
            pass_time(lead, session, TICK_SECONDS)
            most, before = max(most, abs(hand.opening - before) / TICK_SECONDS), hand.opening
        return most

    lead.use_instrument()
    assert quickest(60) < session.run._recorder.errors.limits["jumping_jaws"]["speed"]
    assert 0.0 < hand.opening <= SPREAD
    lead.use_instrument()  # before they are wide apart
    assert quickest(60) <= CLOSES_MM_S * (1 + 1e-9)
    assert hand.opening == 0.0


def test_jaws_slow_down_before_a_wall_comes_to_the_stop(lead: ScopeLead) -> None:
    """What slips off them goes from the stop to its break within a few ticks."""
    tissue, steps = lead.session.spatial, list[float]()
    lead.choose(1)
    lead.use_instrument()
    hand = tissue.hands[1]
    for stress in (0.1, 0.5, 0.69, 0.69):
        tissue.stress_ratio, before = stress, hand.target_opening
        lead.advance(1)
        steps.append((hand.target_opening - before) / (PARTS_MM_S * TICK_SECONDS))
    assert steps == pytest.approx([1.0, 0.2 / (AHEAD_TICKS * 0.4), LEAST_SPEED, 1.0])


def test_jaws_that_close_on_a_wall_wait_until_they_are_off_it(lead: ScopeLead) -> None:
    """They crush nothing, come off it by the key that closed them, and close further from it."""
    session, tissue = lead.session, lead.session.spatial
    lead.choose(1)
    duct, next_to = tissue.beam.places_at(np.array([12.0, 13.0]), "cystic")
    shaft = TROCARS[1].shaft(duct)
    lead.lead_hand(duct + 12.0 * shaft)
    pass_time(lead, session, 3.0)
    session.spread(1, np.cross(shaft, next_to - duct).tolist())
    lead.open_more(9.0)
    pass_time(lead, session, 2.5)
    lead.lead_hand(duct - 3.0 * shaft)
    pass_time(lead, session, 4.0)
    hand = tissue.hands[1]
    lead.use_instrument()
    pass_time(lead, session, 3.0)
    assert hand.opening > 0.0
    assert FIRM.stops_at < tissue.stress_ratio < 0.9
    advice, title = cast(MagicMock, lead._state.client.add_notification).call_args.args[::-1]
    assert advice == CLOSED_ON
    assert re.fullmatch(r"Stopped: the cystic duct is at 7\d % of its break", title)
    closed = hand.opening
    assert lead.use == "Part"
    lead.use_instrument()
    pass_time(lead, session, 2.0)
    assert hand.opening == pytest.approx(closed + OFF_MM)
    assert tissue.stress_ratio < FIRM.stops_at
    lead.lead_hand(hand.place + 12.0 * shaft)
    pass_time(lead, session, 3.0)
    lead.use_instrument()
    pass_time(lead, session, 2.0)
    assert hand.opening == 0.0
    assert tissue.events == []


def test_jaws_that_touch_nothing_close_while_a_pull_strains_a_wall(lead: ScopeLead) -> None:
    """Else they wait until the other hand slackens it, wherever they are drawn."""
    session, tissue = lead.session, lead.session.spatial
    lead.choose_instrument(1, "dissector")
    session.open_jaws(1, 6.0)
    taut(lead)
    lead.choose(1)
    pass_time(lead, session, 0.5)
    hand, before = tissue.hands[1], tissue.stress_ratio
    session.move_hand(0, tissue.hands[0].place + np.array([0.0, 0.0, 0.3]))
    lead.use_instrument()
    pass_time(lead, session, 2.0)
    assert FIRM.stops_at < before + 0.01 < tissue.stress_ratio < 1.0
    assert hand.opening == 0.0


@pytest.mark.parametrize(("asked", "wanted"), [(False, PUSHED), (True, DO_NEXT)])
def test_jaws_push_no_harder_than_a_grasper_holds(
    lead: ScopeLead, asked: bool, wanted: str
) -> None:
    """Else what still holds the gallbladder gives way at once, and its artery takes the pull.

    Where a next step is asked for, the notice asks for nothing else.
    """
    session = lead.session
    if asked:
        session.start_exercise(critical_view("first_view"))
    tissue = session.spatial
    session.grab(0, 14.0, tissue.tubes.names.index("gallbladder"))
    here, next_to = tissue.beam.places_at(np.array([14.0, 16.0]), "gallbladder")
    lead.choose(1)
    place = here + np.array([9.7, 2.6, 3.9])  # between it and the liver
    lead.lead_hand(place + 15.0 * TROCARS[1].shaft(place))
    pass_time(lead, session, 4.0)
    lead.lead_hand(place)
    pass_time(lead, session, 4.0)
    session.spread(1, (next_to - here).tolist())
    lead.use_instrument()
    most = 0.0
    for _ in range(200):
        pass_time(lead, session, TICK_SECONDS)
        most = max(most, math.hypot(*tissue.forces[1]))
    assert GRIPS_AT * GRIP_N < most < GRIP_N
    assert 0.0 < tissue.hands[1].opening < 0.5 * SPREAD
    title, advice = cast(MagicMock, lead._state.client.add_notification).call_args.args
    assert re.fullmatch(r"Stopped: the jaws push with 1[01] N", title)
    assert advice == wanted


def asked_jaws(lead: ScopeLead, part: Part) -> tuple[JawSteps, np.ndarray]:
    """Give the right hand what parts some part of a view; its steps, and (3,) mm where it opens."""
    tissue = lead.session.spatial
    lead.session.start_exercise(critical_view())
    safety = Safety(tissue)
    places = PartingPlaces(safety)
    site = places.best(part)
    assert site is not None
    lead.choose_instrument(1, site.tool)
    return JawSteps(tissue, places, site, GENTLE), places.place_of(site)


def straining_jaws(lead: ScopeLead) -> tuple[JawSteps, np.ndarray]:
    """Put the right hand there in the triangle, while a wall is near its break."""
    jaws, place = asked_jaws(lead, "triangle")
    taut(lead)
    lead.session.spatial.hands[1].put(place)
    return jaws, place


def test_jaws_that_press_too_hard_to_part_are_drawn_out(lead: ScopeLead) -> None:
    """Else opening them is asked for again and again, which the trainer stops each time."""
    tissue = lead.session.spatial
    jaws, place = asked_jaws(lead, "plate")
    hand, site = tissue.hands[1], jaws.site
    hand.put(place)
    shaft = TROCARS[1].shaft(hand.place)
    across = site.along - float(site.along @ shaft) * shaft
    hand.aim, hand.spread = tuple(shaft.tolist()), tuple(across.tolist())
    jaws.follow()
    assert jaws.next_step().words.startswith("Next: open the right hand's dissector (G)")
    tissue._forces = [[0.0] * 3, [GRIPS_AT * GRIP_N + 0.1, 0.0, 0.0]]
    jaws.follow()
    step = jaws.next_step()
    assert step.words == OUT_AS.format("dissector", PRESSES)
    assert len(step.words.split()) <= 25
    assert not jaws.is_over
    hand.put(hand.place + (LEFT_MM + 0.1) * shaft)
    assert jaws.is_over
    assert jaws.tried  # so that it is asked for less


def test_jaws_that_stand_open_off_their_place_are_closed_first(lead: ScopeLead) -> None:
    """They strain what they are led past."""
    jaws, place = asked_jaws(lead, "triangle")
    hand = lead.session.spatial.hands[1]
    hand.put(place + (LEFT_MM + 10.0) * TROCARS[1].shaft(place))
    jaws.follow()
    assert "lead the right hand's right angle into the ring" in jaws.next_step().words
    hand.opening = 6.0
    jaws.follow()
    assert jaws.next_step().words == CLOSE.format("right angle")


@pytest.mark.parametrize("strained", [False, True])
def test_a_bent_tip_that_cannot_part_where_it_has_passed_goes_back_as_it_came(
    lead: ScopeLead, *, strained: bool
) -> None:
    """It presses too hard there, or has strained a wall too often; then the place is left."""
    tissue = lead.session.spatial
    jaws, place = asked_jaws(lead, "triangle")
    hand, site = tissue.hands[1], jaws.site
    assert site.beside is not None
    hand.aim = tuple(site.along.tolist())
    for at, words in ((place + site.beside, "into the ring"), (place, "Next: open the right")):
        hand.put(at)
        jaws.follow()
        assert words in jaws.next_step().words
    if strained:
        jaws.strained = MOST_STRAINED + 1
    else:
        tissue._forces = [[0.0] * 3, [GRIPS_AT * GRIP_N + 0.1, 0.0, 0.0]]
    jaws.follow()
    step = jaws.next_step()
    assert step.words == BACK_ALONG.format("right angle")
    assert step.place == pytest.approx(place + site.beside)
    hand.put(place + site.beside)
    jaws.follow()
    step = jaws.next_step()
    assert step.words == BACK.format("right angle")
    assert not jaws.is_over
    hand.put(np.array(step.place))
    jaws.follow()
    assert jaws.is_over
    assert jaws.tried


def test_a_tip_that_strains_a_wall_where_it_comes_to_is_drawn_out_and_led_off(
    lead: ScopeLead,
) -> None:
    """Back a little at first; who is still strained by it is led off the wall; a place is left."""
    tissue = lead.session.spatial
    jaws, _ = straining_jaws(lead)
    wall = tube_title(tissue.most_stressed)
    asked = [jaws.withdrawn() for _ in range(LEAVES_FOR)]
    assert {each.words for each in asked[:-1]} == {WITHDRAW.format("right angle", wall)}
    assert asked[-1].words == LEAVE.format("right angle", wall)
    assert asked[-1].place is not None
    jaws.strained = MOST_STRAINED + 1
    assert jaws.next_step().words == BACK.format("right angle")


def test_what_still_strains_a_wall_is_asked_for_by_the_same_steps(
    lead: ScopeLead, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However far a tip is off its place, until the wall is slack."""
    session = lead.session
    exercise = critical_view()
    session.start_exercise(exercise)
    tissue = session.spatial
    guidance = Guidance(Safety(tissue))
    guidance.next_step(exercise, viewed=False)
    jaws = guidance._jaws
    monkeypatch.setattr(JawSteps, "is_over", property(lambda _: True))
    for stress, stays in ((GENTLE.taut + 0.01, True), (GENTLE.taut - 0.01, False)):
        tissue.stress_ratio = stress
        guidance._follow()
        assert (guidance._jaws is jaws) == stays


def critical_view(name: str = "critical_view") -> Exercise:
    """Return an exercise at the usual anatomy."""
    exercise = exercise_at(anatomy_named("normal"), name)
    assert exercise is not None
    return exercise


def test_a_bent_tip_that_lifts_a_wall_is_led_deeper_and_past_it(lead: ScopeLead) -> None:
    """Drawn out as it lies, it would take the wall along and strain it more and more."""
    tissue = lead.session.spatial
    jaws, _ = asked_jaws(lead, "triangle")
    taut(lead)
    hand = tissue.hands[1]
    wall = tissue.most_stressed
    axis = tissue.beam.places_at(np.arange(8.0, 14.0, 0.5), wall)
    radius = float(tissue.tubes.network.tubes[wall].radius.max())
    shaft = TROCARS[1].shaft(axis[6])
    aim = np.cross(shaft, axis[7] - axis[5])
    aim /= math.sqrt(float(aim @ aim))
    # The tip lies behind the wall, which crosses it 5 mm from its end.
    hand.put(axis[6] - (radius + 1.0) * shaft - 5.0 * aim)
    hand.aim = tuple(aim.tolist())
    hand.opening = 10.0
    jaws.follow()
    hand.opening = 0.0
    jaws._state = "to withdraw"
    step = jaws.withdrawn()
    assert step.words == WITHDRAW_ALONG.format("right angle", tube_title(wall))
    assert len(step.words.split()) <= 25
    move = np.array(step.place) - hand.place
    assert move @ shaft == pytest.approx(-DEEPER_MM, abs=0.1)
    assert ((axis - hand.place - move) @ aim).max() < -radius
    jaws.follow()
    assert "back along its tip" in jaws.next_step().words
    hand.put(hand.place + move)
    jaws.follow()
    assert "out of the tissue" in jaws.next_step().words


def taut(lead: ScopeLead) -> None:
    """Hold the cystic duct so taut that its wall is near its break."""
    session, tissue = lead.session, lead.session.spatial
    session.grab(0, 12.0, tissue.tubes.names.index("cystic"))
    session.move_hand(0, tissue.hands[0].place + np.array([0.0, 0.0, 60.0]))
    for _ in range(400):
        session.advance()
        if tissue.stress_ratio > FIRM.stops_at:
            break
    session.move_hand(0, tissue.hands[0].place - [0.0, 0.0, 0.1])
    pass_time(lead, session, 1.0)
    assert FIRM.stops_at < tissue.stress_ratio < 1.0


def test_what_is_stopped_in_an_exercise_is_slackened_by_what_comes_next(lead: ScopeLead) -> None:
    """The notice names the sentence in the panel, which asks for that within a few ticks."""
    session, tissue = lead.session, lead.session.spatial
    session.start_exercise(critical_view("first_view"))
    taut(lead)
    lead.choose(0)
    lead.lead_hand(tissue.hands[0].tip + np.array([0.0, 0.0, 20.0]))
    pass_time(lead, session, 0.5)
    title, advice = cast(MagicMock, lead._state.client.add_notification).call_args.args
    assert re.fullmatch(r"Stopped: the cystic duct is at 7\d % of its break", title)
    assert advice == NEXT_SLACKENS
    step = lead.asked.step
    assert step is not None
    assert "is strained" in step.words
    # What is let back may bend, and strain a wall more: near its break it is let go.
    tissue.stress_ratio = 0.5 * (NEARLY_TORN + 1.0)
    tissue.ticks += JUDGED_TICKS
    step = lead.asked.step
    assert step is not None
    assert step.words.startswith("Next: let go of the cystic duct")


def test_jaws_that_cannot_leave_a_wall_along_their_tip_leave_it_otherwise(lead: ScopeLead) -> None:
    """What they take along is strained on each way but some: these are asked for in turn."""
    tissue = lead.session.spatial
    jaws, _ = straining_jaws(lead)
    tissue.hands[1].opening = 10.0
    jaws.follow()
    asked = [np.array(jaws.withdrawn().place) for _ in range(3 * LEAVES_FOR)]
    rings = [asked[LEAVES_FOR * number] for number in range(3)]
    for number, ring in enumerate(rings):
        assert all((each == ring).all() for each in asked[LEAVES_FOR * number :][: LEAVES_FOR - 1])
    assert math.dist(rings[0], rings[1]) > 1.0
    assert math.dist(rings[1], rings[2]) > 1.0
    # Once it is slack, they go back along their tip again.
    tissue.stress_ratio = 0.0
    jaws.follow()
    assert (np.array(jaws.withdrawn().place) == rings[0]).all()


def test_where_open_jaws_leave_a_wall_stays_asked_for_until_they_have_gone_there(
    lead: ScopeLead,
) -> None:
    """While a tip lies still nothing else is asked for; who goes there in vain is led elsewhere."""
    tissue = lead.session.spatial
    jaws, place = straining_jaws(lead)
    hand = tissue.hands[1]
    hand.opening = 10.0
    jaws.follow()
    jaws._state, jaws._wall = "to leave", "cystic"
    jaws._leave()
    rings = [jaws.next_step().place]
    for _ in range(4 * LEAVES_FOR):
        jaws.follow()
        assert jaws.next_step().place == rings[0]
    for number in range(4 * LEAVES_FOR):
        hand.put(place + np.array([0.01 * number, 0.0, 0.0]))
        jaws.follow()
        ring = jaws.next_step().place
        rings += [ring] if ring not in rings else []
    assert len(rings) > 3
    # Where no direction is off it, they are closed.
    for number in range(DIRECTIONS * LEAVES_FOR):
        hand.put(place - np.array([0.01 * number, 0.0, 0.0]))
        jaws.follow()
        if "close the right hand's" in jaws.next_step().words:
            break
    else:
        raise AssertionError(jaws.next_step().words)


def test_jaws_are_led_off_a_tube_that_runs_through_between_them_before_they_close(
    lead: ScopeLead,
) -> None:
    tissue = lead.session.spatial
    jaws, _ = asked_jaws(lead, "triangle")
    near, middle, far = tissue.beam.places_at(np.array([9.5, 10.0, 10.5]), "cystic")
    along = (far - near) / np.linalg.norm(far - near)
    aim = np.cross(along, UP)
    aim /= np.linalg.norm(aim)
    hand = tissue.hands[1]
    hand.aim, hand.spread = tuple(aim.tolist()), tuple(np.cross(along, aim).tolist())
    hand.put(middle - 7.0 * aim)
    hand.opening, jaws._opening, jaws._state = 12.0, 12.0, "opening"
    jaws.follow()
    step = jaws.next_step()
    assert step.words.startswith("Next: lead the right hand's open right angle off the cystic duct")
    hand.put(np.array(step.place))
    off = tissue.beam.places_at(np.arange(0.0, 30.0, 0.1), "cystic") - hand.place
    off -= np.clip(off @ aim, 0.0, 14.0)[:, None] * aim
    off -= np.clip(off @ hand.spread, -6.0, 6.0)[:, None] * np.array(hand.spread)
    radius = tissue.tubes.network.tubes["cystic"].radius.min()
    assert np.linalg.norm(off, axis=1).min() > radius
    jaws.follow()
    assert jaws.next_step().words.startswith("Next: close the right hand's right angle (G)")


def test_a_pull_ends_where_it_would_have_to_be_slackened_again(lead: ScopeLead) -> None:
    """Jaws come to what a pull strains by less."""
    session = lead.session
    session.start_exercise(critical_view("first_view"))
    session.grab(0, 8.0, session.spatial.tubes.names.index("gallbladder"))
    tissue = session.spatial
    for pull in (OFF_THE_LIVER, TO_COMMON):
        for stress in (GENTLE.eased - 0.01, GENTLE.eased + 0.01):
            hold = HoldSteps(Safety(tissue))
            hold._pulling = pulling = _Pulling(pull, 8.0)
            tissue.stress_ratio = stress
            hold.next_step(GENTLE.eased)
            assert pulling.drawn == (stress > GENTLE.eased), (pull, stress)


def test_what_is_held_is_let_go_where_jaws_stay_strained_once_the_view_is_reached(
    lead: ScopeLead, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As before that: they could not be drawn out."""
    session = lead.session
    exercise = critical_view()
    session.start_exercise(exercise)
    session.grab(0, 8.0, session.spatial.tubes.names.index("gallbladder"))
    guidance = Guidance(Safety(session.spatial))
    guidance.next_step(exercise, viewed=False)
    jaws = guidance._jaws
    assert jaws is not None
    lead.choose_instrument(1, jaws.site.tool)
    session.spatial.hands[1].put(jaws._place)
    jaws._state = "to withdraw"
    for strained, words in (
        (False, "out of the tissue"),
        (True, "Next: let go of the gallbladder"),
    ):
        monkeypatch.setattr(JawSteps, "stays_strained", property(lambda _, s=strained: s))
        step = guidance.next_step(exercise, viewed=True)
        assert step is not None
        assert words in step.words


def test_a_wall_that_no_hand_strains_is_not_slackened(lead: ScopeLead) -> None:
    """Held again and let go again, it would stay as it is, and nothing else be asked for."""
    session, tissue = lead.session, lead.session.spatial
    exercise = critical_view("first_view")
    session.start_exercise(exercise)
    taut(lead)
    guidance = Guidance(Safety(tissue))
    step = guidance.next_step(exercise, viewed=False)
    assert step is not None
    assert "is strained" in step.words
    tissue._forces = [[0.0] * 3, [0.0] * 3]
    step = guidance.next_step(exercise, viewed=False)
    assert step is not None
    assert "is strained" not in step.words


def test_what_strains_stops_before_a_wall_breaks(lead: ScopeLead) -> None:
    """Whoever has a mouse feels no force: a drag is led no further, each click or key a little."""
    taut(lead)
    session, tissue = lead.session, lead.session.spatial
    start = tissue.hands[0].place.copy()
    lead.choose(0)
    lead.lead_hand(start + tissue.hands[0].jaws + [0.0, 0.0, 20.0])
    pass_time(lead, session, 2.0)
    assert np.linalg.norm(tissue.hands[0].place - start) < 0.2
    title = cast(MagicMock, lead._state.client).add_notification.call_args.args[0]
    assert re.fullmatch(r"Stopped: the cystic duct is at 7\d % of its break", title)
    # Keys that were pressed before the stop was seen do nothing; then each goes on a little.
    lead.lead_hand(start + tissue.hands[0].jaws + [0.0, 0.0, 20.0])
    pass_time(lead, session, 0.1)
    for _ in range(14):
        lead.nudge(0.0, 0.5, 0.0)  # towards the liver and out of the bed
        pass_time(lead, session, 2 * TICK_SECONDS)
    assert np.linalg.norm(tissue.hands[0].place - start) < 0.3
    pass_time(lead, session, 1.0)
    for _ in range(100):
        if tissue.stress_ratio > FIRM.stops_at:
            break
        session.move_hand(0, tissue.hands[0].place + np.array([0.0, 0.0, 0.02]))
        pass_time(lead, session, 0.1)
    before = tissue.stress_ratio
    lead.nudge(0.0, 0.5, 0.0)
    pass_time(lead, session, 0.5)
    assert before < tissue.stress_ratio < before + 2.0 * INSISTS
    lead.lead_hand(start + tissue.hands[0].jaws - [0.0, 0.0, 4.0])  # it gives way at any time
    pass_time(lead, session, 2.0)
    assert tissue.stress_ratio < FIRM.stops_at
    # Nobody who is not to see figures is helped by them.
    session.start_exercise(critical_view(), Feedback.SUMMARY)
    taut(lead)
    start = tissue.hands[0].place.copy()
    lead.lead_hand(start + tissue.hands[0].jaws + [0.0, 0.0, 3.0])
    pass_time(lead, session, 1.0)
    assert np.linalg.norm(tissue.hands[0].place - start) > 1.0


def test_a_key_that_is_held_tears_nothing(lead: ScopeLead) -> None:
    """It goes past a stop once for each, and not on and on."""
    session, tissue = lead.session, lead.session.spatial
    lead.choose(0)
    session.grab(0, 8.0, tissue.tubes.names.index("gallbladder"))
    for _ in range(90):
        lead.nudge(0.0, 2.0, 0.0)
        pass_time(lead, session, TICK_SECONDS)
    assert tissue.events == []
    assert FIRM.stops_at < tissue.peak_stress_ratio < 0.95
    title = cast(MagicMock, lead._state.client).add_notification.call_args.args[0]
    assert title.startswith("Stopped: ")


def test_what_slackens_a_wall_goes_on_while_its_stress_still_rises(lead: ScopeLead) -> None:
    """A tip follows its hand late: what was pulled a moment ago goes on rising."""
    taut(lead)
    session, hand = lead.session, lead.session.spatial.hands[0]
    lead.choose(0)
    lead.advance(1)
    start, before = hand.tip.copy(), session.spatial.stress_ratio
    session.move_hand(0, hand.place + np.array([0.0, 0.0, 0.5]))
    session.advance()
    assert session.spatial.stress_ratio > before + RISES
    lead.lead_hand(start - [0.0, 0.0, 3.0])
    pass_time(lead, session, 1.0)
    assert hand.tip == pytest.approx(start - [0.0, 0.0, 3.0], abs=0.05)


@pytest.mark.parametrize(("other", "goes_on"), [(0.0, True), (1.5, False)])
def test_what_is_let_back_onto_the_other_instrument_stops(
    lead: ScopeLead, other: float, goes_on: bool
) -> None:
    """It slackens its own pull, and strains the wall more and more all the same."""
    session, forces = lead.session, [[0.0, 0.0, -5.0], [0.0, other, 0.0]]
    assert session.grab(0, 12.0, session.spatial.tubes.names.index("gallbladder")) is not None
    goal = session.spatial.hands[0].tip + np.array([0.0, 0.0, 8.0])
    lead.choose(0)
    lead.advance(1)
    lead.lead_hand(goal)
    with patch.object(type(session.spatial), "forces", forces):
        for stress in (0.66, 0.71, 0.74, 0.77, 0.8):
            session.spatial.stress_ratio = stress
            lead.advance(1)
    assert (lead._goals[0] is not None) is goes_on


def test_what_slackens_a_wall_goes_on_where_it_was_stopped_before(lead: ScopeLead) -> None:
    """As where one hand was stopped the same way before the other one strained the wall."""
    taut(lead)
    hand = lead.session.spatial.hands[0]
    lead.choose(0)
    lead.advance(1)
    start, back = hand.tip.copy(), np.array([0.0, 0.0, -3.0])
    lead._stopped[0] = Stop(back, lead.session.spatial.stress_ratio)
    lead.lead_hand(start + back)
    pass_time(lead, lead.session, 1.0)
    assert hand.tip == pytest.approx(start + back, abs=0.05)


@pytest.mark.parametrize(("degrees", "goes_on"), [(30.0, False), (75.0, True)])
def test_a_move_is_stopped_again_only_where_it_goes_the_same_way(
    lead: ScopeLead, degrees: float, goes_on: bool
) -> None:
    """As where a tip that was stopped on its way in is drawn out along its shaft."""
    taut(lead)
    lead.choose(1)
    lead.advance(1)
    turn = math.radians(degrees)
    lead._stopped[1] = Stop(np.array([3.0, 0.0, 0.0]), lead.session.spatial.stress_ratio)
    way = 3.0 * np.array([math.cos(turn), math.sin(turn), 0.0])
    lead.lead_hand(lead.session.spatial.hands[1].tip + way)
    lead.advance(1)
    assert (lead._goals[1] is not None) is goes_on


def test_a_stopped_move_goes_on_if_to_give_way_strains_the_wall_more(lead: ScopeLead) -> None:
    """Else each key against it would bring the wall nearer to its break."""
    taut(lead)
    session, hand = lead.session, lead.session.spatial.hands[0]
    lead.choose(0)
    lead.advance(1)
    start, on = hand.tip.copy(), np.array([0.0, 0.0, 0.2])
    force = float(on @ session.spatial.forces[0])
    assert force / 0.2 > LEAST_PUSH_N, "it pulls, and would be stopped"
    lead._stopped[0] = Stop(on, session.spatial.stress_ratio - 2.0 * RISES)
    lead.lead_hand(start + on)
    lead.advance(1)
    assert lead._stopped[0] is not None
    assert lead._stopped[0].eases
    assert hand.target[2] > start[2] - hand.jaws[2], "it was led on"


def test_jaws_close_by_a_key_however_near_a_break_is(lead: ScopeLead) -> None:
    session = lead.session
    lead.choose_instrument(1, "dissector")
    session.open_jaws(1, 6.0)
    taut(lead)
    lead.choose(1)
    pass_time(lead, session, 0.5)
    assert session.spatial.stress_ratio > FIRM.stops_at
    lead.open_more(-1.0)
    pass_time(lead, session, 0.5)
    assert session.spatial.hands[1].target_opening == 5.0


def test_a_tip_that_meets_a_wall_goes_slowly(lead: ScopeLead) -> None:
    """Pressed on the artery a dissector lifts no wall to its break, however far it is led."""
    session, tissue = lead.session, lead.session.spatial
    lead.choose(1)
    artery = tissue.beam.places_at(np.array([10.0]), "artery")[0]
    above = np.array([0.0, 0.0, 12.0])
    lead.lead_hand(artery + above)
    pass_time(lead, session, 2.0)
    lead.lead_hand(artery - above)
    hand, steps = session.spatial.hands[1], list[tuple[bool, float]]()
    for _ in range(120):
        before, pressed = hand.target[2], tissue.forces[1][2] < -0.15
        pass_time(lead, session, TICK_SECONDS)
        steps.append((pressed, (before - hand.target[2]) / TICK_SECONDS))
    assert max(step for _, step in steps) > 2.0 * HOLDS_MM_S
    assert any(pressed for pressed, _ in steps)
    most = HOLDS_MM_S + ROUNDED_MM / TICK_SECONDS
    assert max(step for pressed, step in steps if pressed) <= most
    assert FIRM.stops_at <= session.spatial.peak_stress_ratio < 0.8


def begun_at_plate(lead: ScopeLead) -> SpatialTissue:
    """Begin *First view* and part its triangle, so that the gallbladder is drawn next."""
    session = lead.session
    session.start_exercise(critical_view("first_view"))
    session.open_jaws(1, 0.1)
    session.open_jaws(1, 0.0)
    tissue = session.spatial  # made whole, as a run begins
    strands = Safety(tissue).lacking("triangle")
    tissue.beam.detach(strands & (np.cumsum(strands) <= 0.85 * strands.sum()))
    pass_time(lead, session, 1.0)
    return tissue


def test_what_comes_next_is_asked_for_and_marked(lead: ScopeLead) -> None:
    """In the exercise alone, by the page's numbers of strands, and as long as it is wanted."""
    session, state = lead.session, lead._state

    def asked() -> NextStep:
        """What is asked for, whose strands are those that are marked, and whose ring is shown."""
        pass_time(lead, session, JUDGED_TICKS * TICK_SECONDS)
        step = lead.asked.step
        assert step is not None, session.run.outcome
        assert sorted(tissue.beam.order[list(lead.asked.to_part)]) == sorted(step.strands)
        assert (lead.asked.ring is None) == (step.place is None)
        if lead.asked.ring is not None:
            assert lead.asked.ring[:3] == pytest.approx(step.place, abs=0.01)
            assert step.hand is not None
            assert lead.asked.ring[3:6] == pytest.approx(step.along or (0.0, 0.0, 0.0), abs=0.01)
            # Its line is a shaft that comes there; what is held is led along none.
            assert step.hand == lead.asked.ring[9]
            holds = tissue.hands[step.hand].node is not None
            shaft = np.zeros(3) if holds else TROCARS[step.hand].shaft(np.array(step.place))
            assert lead.asked.ring[6:9] == pytest.approx(shaft, abs=0.01)
        return step

    def part(strands: np.ndarray) -> None:
        tissue.beam.detach(np.isin(np.arange(tissue.beam.order.size), strands))
        session.advance()

    assert lead.asked.step is None
    assert lead.asked.to_part == ()
    # Each turn is shown as it is to be made.
    session.start_exercise(critical_view("first_view"))
    tissue = session.spatial
    assert asked().tool == "right angle"
    assert lead.asked.turn is None  # of a grasper
    assert lead.to_ring is None
    lead.choose_instrument(1, "right angle")
    tissue = session.spatial  # made whole, as a run begins
    lead.advance(1)  # what was led before the run goes on no more
    lead.nudge(0.0, 0.0, 1.0)  # which bends it across its shaft
    pass_time(lead, session, 3.0)  # so near the ring it turns along the bar
    for by in (0.0, 0.5, 1.0, -2.0):
        lead.turn(by)
        off = lead.asked.turn
        assert off is not None
        assert abs(off) <= math.pi
        presses = 0
        while abs(off := lead.asked.turn or 0.0) > 0.01:
            lead.turn(math.copysign(0.15, off))
            presses += 1
            assert presses <= 7  # half a turn in steps of 26 degrees
        assert lead.asked.turn == pytest.approx(0.0, abs=0.01)
    # Right and up under the pointer, and then in by the wheel, it comes into the ring, and its jaws
    # turn along the bar.
    lead.turn(1.0)
    assert abs(lead.asked.turn or 0.0) == pytest.approx(1.0, abs=0.01)
    to_ring = lead.to_ring
    assert to_ring is not None
    lead.nudge(to_ring[0] + 0.6, to_ring[1] - 0.6, 0.0)  # near enough to be led onto the path
    lead.turn(-2.0)  # meanwhile keys do nothing
    pass_time(lead, session, 2.0)
    left = lead.to_ring
    assert left is not None
    assert left == pytest.approx((0.0, 0.0, to_ring[2]), abs=0.1)
    assert lead.asked.turn == pytest.approx(0.0, abs=0.02)
    assert not lead.asked.in_ring
    assert left[2] > 5.0
    lead.nudge(0.0, 0.0, left[2] - 0.6)
    for _ in range(150):
        pass_time(lead, session, TICK_SECONDS)
        if lead.asked.in_ring:
            break
    # In it the tip is turned once more, and goes on along itself.
    lead.turn(1.0)
    assert asked().words.startswith("Next: turn the right hand's right angle")
    lead.turn(-1.0)
    assert asked().words.startswith("Next: lead the right hand's right angle along its tip")
    # What is held is drawn, opened beside, closed and withdrawn.
    tissue = begun_at_plate(lead)
    lead.choose(0)
    hold = "Next: take hold of the gallbladder in the ring with the left hand's grasper (G)."
    assert asked().words == hold
    # Beside the ring, nothing is said of how deep one is to go.
    lead.use_instrument()
    refused = cast(MagicMock, state.client.add_notification).call_args.args
    assert refused == ("Not possible", NOT_IN_RING)
    assert session.grab(0, 20.0, tissue.tubes.names.index("gallbladder")) is not None
    # Held it is drawn, by stages, each of which is asked for by a ring and its distance.
    off = "Next: draw the gallbladder off the liver with the left hand's grasper: drag it slowly"
    far = list[float]()
    while (step := asked()).words.startswith(off):
        to_ring = lead.to_ring
        assert to_ring is not None
        place = np.array(step.place)
        far.append(math.dist(tissue.hands[0].tip, place))
        lead.lead_hand(place)
        pass_time(lead, session, 1.0)
    assert 1 < len(far) <= STAGES
    assert far == pytest.approx([STAGE_MM] * len(far), rel=0.25)
    # What is taut is let back.
    while (step := asked()).words.startswith("Next: let the gallbladder back towards"):
        lead.lead_hand(tissue.hands[0].tip - [0.0, 0.7, 0.7])
        pass_time(lead, session, 1.0)
    assert tissue.stress_ratio < GENTLE.eased
    plate = "Next: part the gallbladder from the liver: lead the right hand's dissector"
    assert asked().words.startswith(f"{plate} into the ring")
    lead.choose_instrument(1, "dissector")
    lead.seek_ring()
    pass_time(lead, session, 6.0)
    assert asked().words.startswith("Next: open the right hand's dissector (G)")
    lead.use_instrument()
    pass_time(lead, session, 1.0)
    opens = list[float]()
    while (step := asked()).words.startswith("Next: the right hand's dissector opens; wait"):
        opens.append(tissue.hands[1].opening)
    assert opens == sorted(opens)
    assert len(opens) > 1
    assert step.words == CLOSE_FEW.format("dissector")
    lead.use_instrument()
    pass_time(lead, session, 2.0)
    assert asked().words.startswith("Next: draw the right hand's dissector out of the tissue")
    state.show(marks_next=False)
    assert lead.asked.step is None
    assert lead.asked.to_part == ()


def test_what_comes_next_is_taken_by_a_key_and_drawn_while_all_rests(lead: ScopeLead) -> None:
    """To its ring counts from where a tip is led; once an instrument is used, it is found anew."""
    session = lead.session
    session.start_exercise(critical_view())
    scene = SimpleNamespace(
        _led=lead, _session=session, _held=lead.held, _marks=((), None), _free=False
    )
    advance = partial(ScopeScene.advance, cast(Any, scene))
    for _ in range(100):  # until the assistant has led the scope to both tips
        advance(1)
        scene._marks = lead.asked.to_part, lead.asked.ring
        session.advance()
    assert not session.tissue.moving
    assert not advance(1)
    scene._marks = (), None
    assert advance(1)
    lead.choose(1)
    assert session.spatial.hands[1].instrument == "right angle", "what is asked for first"
    lead.choose_instrument(1, "swab")
    lead.choose_next_instrument()
    assert session.spatial.hands[1].instrument == "right angle"
    pass_time(lead, session, 0.5)
    before = lead.to_ring
    assert before is not None
    lead.nudge(0.0, 0.0, -6.0)
    after = lead.to_ring
    assert after is not None
    assert after[2] - before[2] == pytest.approx(6.0, abs=0.5)
    pass_time(lead, session, 2.0)
    assert lead.to_ring == pytest.approx(after, abs=0.1)
    lead.step(0.0, 0.0, -0.5)  # away from the ring, and then by keys to it and no further
    pass_time(lead, session, 0.5)
    left = lead.to_ring
    assert left is not None
    assert left[2] == pytest.approx(after[2] + 0.5, abs=0.1)
    for _ in range(math.ceil(left[2] / (0.5 * QUICK_MOVES)) + 2):
        lead.step(0.0, 0.0, 0.5)
        pass_time(lead, session, 0.5)
    left = lead.to_ring
    assert left is not None
    assert left[2] == pytest.approx(0.0, abs=0.1)
    # So does the wheel, whose notches count for more where they follow quickly, until it is there.
    lead.wheel(-10.0)
    pass_time(lead, session, 2.0)
    assert lead.asked.ring is not None
    ring = np.array(lead.asked.ring[:3])
    lead.lead_hand(ring + 15.0 * TROCARS[1].shaft(ring))
    pass_time(lead, session, 2.0)
    for _ in range(8):
        lead.wheel(3.0)
    pass_time(lead, session, 2.0)
    hand = session.spatial.hands[1]
    assert hand.tip == pytest.approx(ring, abs=0.5)
    before = lead.to_ring
    assert before is not None
    lead.wheel(-2.0)
    after = lead.to_ring
    assert after is not None
    assert after[2] - before[2] == pytest.approx(2.0 * NOTCH_MM, abs=0.5)
    pass_time(lead, session, 1.0)
    lead.choose_next_instrument()
    assert session.spatial.hands[1].instrument != "right angle", "which it has"
    begun_at_plate(lead)
    lead.choose(0)
    step = lead.asked.step
    assert step is not None
    assert "take hold" in step.words
    assert step.place is not None
    session.spatial.hands[0].put(np.array(step.place))
    lead.use_instrument()
    pass_time(lead, session, USED_TICKS * TICK_SECONDS)
    step = lead.asked.step
    assert step is not None
    assert "draw the gallbladder off the liver" in step.words


def test_a_press_on_the_ring_leads_the_tip_there(lead: ScopeLead) -> None:
    """Out of the tissue, aside in front of it and in; anything else that is done ends it."""
    session = lead.session

    def press(place: np.ndarray, word: str = "press") -> None:
        eye = lead.held.camera.tip
        ray = " ".join(f"{each:.4f}" for each in (*eye, *(place - eye)))
        ScopeScene.take(cast(Any, SimpleNamespace(_led=lead)), f"1 {word} {ray}")

    def ring() -> np.ndarray:
        assert lead.asked.ring is not None
        return np.array(lead.asked.ring[:3])

    refused = cast(MagicMock, lead._state.client.add_notification)
    lead.seek_ring()
    assert refused.call_args.args == ("Not possible", NO_RING)
    hand = begun_at_plate(lead).hands[0]
    lead.choose(0)
    aside = np.array([0.0, 0.5 * PRESSED_MM, 0.0])
    press(ring() + aside)
    pass_time(lead, session, 6.0)
    assert hand.tip == pytest.approx(ring(), abs=THERE_MM)
    # What is held goes there straight, as long as it is pressed.
    lead.use_instrument()
    pass_time(lead, session, 0.5)
    assert hand.node is not None
    start, held_to = hand.tip, ring()
    press(held_to)
    pass_time(lead, session, 0.1)
    assert math.dist(start, hand.tip) < DRAWS_MM_S * 0.2
    pass_time(lead, session, 0.2)
    ScopeScene.take(cast(Any, SimpleNamespace(_led=lead)), "2 stop")
    pass_time(lead, session, 0.5)
    path, gone = held_to - start, hand.tip - start
    assert 0.1 < np.linalg.norm(gone) < 0.9 * np.linalg.norm(path)
    assert gone @ path == pytest.approx(np.linalg.norm(gone) * np.linalg.norm(path), rel=0.01)
    press(held_to)
    press(held_to + 0.3 * DRAGGED_MM * lead.held.camera.axes[:, 0], "drag")  # a tremor
    pass_time(lead, session, 1.0)
    assert math.dist(hand.tip, held_to) < IN_RING_MM
    lead.use_instrument()
    # Jaws among strands come out of them before they go aside, and turn to the bar before they go
    # in.
    session.start_exercise(critical_view())
    lead.choose(1)
    lead.choose_instrument(1, "right angle")
    pass_time(lead, session, 1.0)
    shaft = TROCARS[1].shaft(ring())
    lead.lead_hand(ring() - 4.0 * shaft + 20.0 * lead.held.camera.axes[:, 0])
    pass_time(lead, session, 8.0)
    hand, goes_to = session.spatial.hands[1], ring()
    lead.turn(1.0)
    press(goes_to)
    tips = [hand.tip]
    while math.dist(hand.tip, goes_to) > THERE_MM and len(tips) < 1000:
        pass_time(lead, session, TICK_SECONDS)
        tips.append(hand.tip)
    off = np.array(tips) - goes_to
    before = off @ shaft
    aside = np.linalg.norm(off - before[:, None] * shaft, axis=1)
    assert len(tips) < 1000
    assert before[aside < 0.5 * aside[0]].min() > -0.5
    assert (before[1:50] >= before[:49] - 1e-6).all()
    assert lead.asked.turn == pytest.approx(0.0, abs=0.03)
    # By a key, and by a gamepad; a notch of the wheel ends it.
    page = cast(Any, SimpleNamespace(_led=lead))
    for act in (lead.seek_ring, partial(ScopeScene.take, page, "3 ring")):
        lead.wheel(-8.0)
        pass_time(lead, session, 2.0)
        goes_to = ring()
        act()
        pass_time(lead, session, 0.1)
        lead.wheel(-1.0)
        pass_time(lead, session, 2.0)
        assert math.dist(hand.tip, goes_to) > 5.0
        act()
        pass_time(lead, session, 3.0)
        assert math.dist(hand.tip, goes_to) < 2.0 * IN_RING_MM  # it goes after one that moves
    # Keys lead out of a ring that the tip is in, on whichever side of its middle.
    for by in (0.05, -0.1):
        lead.lead_hand(ring() + by * TROCARS[1].shaft(ring()))
        pass_time(lead, session, 1.0)
        before = hand.tip
        for _ in range(4):
            lead.step(0.0, 0.0, -0.5)
            pass_time(lead, session, 0.3)
        assert math.dist(hand.tip, before) > 1.0


def test_any_tube_s_tear_ends_and_is_told(lead: ScopeLead) -> None:
    """How a tear runs is drawn of the first tube only: another's has happened at once."""
    session = lead.session
    artery = session.spatial.tubes.names.index("artery")
    session.grab(0, 10.0, artery)
    for _ in range(400):
        session.move_hand(0, session.spatial.hands[0].place + np.array([0.0, 0.0, 2.0]))
        session.advance()
        if session.spatial.events:
            break
    assert "tear" in {each.kind for each in session.spatial.events}
    assert session.spatial.tears[0] is None
    assert session.reading().phase is Phase.TORN


@pytest.mark.parametrize(
    ("to_ring", "holds", "in_tissue", "words"),
    [
        ((-4.0, 2.0, 18.0), False, False, "4 mm left, 2 mm up, 12 notches in"),
        ((4.0, 2.0, -3.0), False, False, "4 mm right, 2 mm up, 2 notches out"),
        ((4.0, 2.0, -9.0), False, False, "6 notches out"),
        ((4.0, 2.0, -3.0), False, True, "4 mm right, 2 mm up, 2 notches out"),
        ((14.0, -2.0, 1.5), False, True, "out of the tissue first (wheel back)"),
        ((14.0, -2.0, 1.5), False, False, "14 mm right, 2 mm down, 1 notch in"),
        ((0.3, 0.2, 1.5), False, True, "1 notch in"),
        ((14.0, -2.0, 1.5), True, False, "drag 14 mm right, 2 mm down, then 1 notch in"),
    ],
)
def test_how_a_tip_comes_to_its_ring_is_said_in_order(
    to_ring: tuple[float, float, float], holds: bool, in_tissue: bool, words: str
) -> None:
    """Far out comes first, then aside in front of the tissue, and in last."""
    assert _moves(to_ring, holds=holds, in_tissue=in_tissue) == words


def test_a_tip_beside_a_duct_is_not_sent_through_it_to_its_ring(
    lead: ScopeLead, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It comes out first, as from among strands."""
    tissue = lead.session.spatial
    lead.choose(1)
    axes = lead.held.camera.axes
    right = axes[:, 0]
    hand = tissue.hands[1]
    wall = tissue.beam.places_at(np.array([30.0]), "common")[0]
    for side, meets in ((1.0, True), (-1.0, False)):  # left of the duct, and going right or left
        hand.put(wall - 10.0 * right)
        monkeypatch.setattr(ScopeLead, "to_ring", property(lambda _, s=side: (20.0 * s, 0.0, 1.0)))
        assert lead.meets_wall == meets, side
    hand.put(wall - 10.0 * right + 60.0 * axes[:, 2])  # far in front of all
    monkeypatch.setattr(ScopeLead, "to_ring", property(lambda _: (20.0, 0.0, 40.0)))
    assert not lead.meets_wall
    monkeypatch.setattr(ScopeLead, "to_ring", property(lambda _: None))
    assert not lead.meets_wall


def test_led_by_its_handle_the_tip_goes_the_other_way(lead: ScopeLead) -> None:
    """Across its shaft it goes against the handle, and along it with the handle."""
    hand = lead.session.spatial.hands[0]
    lead.by_handle = True
    for right, up, into in ((6.0, 0.0, 0.0), (0.0, -4.0, 0.0), (0.0, 0.0, 5.0), (3.0, 2.0, 1.0)):
        start, shaft = hand.place.copy(), TROCARS[0].shaft(hand.place)
        across = lead.held.camera.axes @ np.array([right, up, 0.0])
        across -= float(across @ shaft) * shaft
        lead.nudge(0.5 * right, 0.5 * up, 0.5 * into)
        lead.nudge(0.5 * right, 0.5 * up, 0.5 * into)
        pass_time(lead, lead.session, 1.0)
        # The shaft turns meanwhile by the move over its length behind the trocar.
        assert hand.place - start == pytest.approx(-across - into * shaft, abs=0.3)


def test_instruments_lie_along_their_shafts_and_turn_about_them(lead: ScopeLead) -> None:
    """Keys turn each; a right angle's tip is bent off its shaft wherever it is led."""
    session = lead.session
    lead.choose(1)
    for name in ("dissector", "clip applier", "scissors", "right angle"):
        lead.choose_instrument(1, name)
        lead.lead_hand(np.array([40.0, 12.0, 20.0]))
        pass_time(lead, session, 1.5)
        hand = session.spatial.hands[1]
        shaft = TROCARS[1].shaft(hand.place)
        along = float(shaft @ np.array(hand.aim))
        if name == "right angle":
            assert abs(along) <= BENT_STEADY + 1e-9
        else:
            assert along >= STEADY - 1e-9
        before = np.array(hand.spread)
        lead.turn(0.3)
        after = np.array(hand.spread)
        across = [each - float(each @ shaft) * shaft for each in (before, after)]
        cosine = float(across[0] @ across[1]) / np.prod([np.linalg.norm(each) for each in across])
        assert math.acos(cosine) == pytest.approx(0.3, abs=0.01)
        assert float(after @ np.array(hand.aim)) == pytest.approx(0.0)
    # Its tip is turned by the same, and its jaws part across the plane in which it is bent.
    assert float(np.array(hand.aim) @ shaft) == pytest.approx(0.0, abs=1e-6)  # it is led by those
    assert abs(float(np.cross(shaft, hand.aim) @ after)) == pytest.approx(1.0)


def test_clips_scissors_and_suction(lead: ScopeLead) -> None:
    """Of a freed artery: clipped twice it is divided without blood; unclipped it bleeds."""
    session = lead.session
    tissue = session.spatial
    lead.choose(1)
    lead.choose_instrument(1, "clip applier")
    tissue.beam.state.damage[:] = 1.0

    def bring(station: float) -> None:
        place = tissue.beam.places_at(np.array([station]), "artery")[0]
        shaft = TROCARS[1].shaft(place)
        lead.lead_hand(place + 12.0 * shaft)
        pass_time(lead, session, 2.0)
        lead.lead_hand(place - 3.0 * shaft)
        pass_time(lead, session, 2.0)

    lead.use_instrument()  # nothing is between its jaws
    assert not tissue.events
    for station in (13.0, 19.0):
        bring(station)
        lead.use_instrument()
    assert [(each.kind, each.tube) for each in tissue.events] == [("clip", "artery")] * 2
    lead.choose_instrument(1, "scissors")
    bring(16.0)
    lead.use_instrument()
    pass_time(lead, session, 1.0)
    assert [each.kind for each in tissue.events] == ["clip", "clip", "division"]
    assert tissue.fluids["blood"].lost == pytest.approx(0.0, abs=1e-6)
    bring(10.0)  # before both clips
    lead.use_instrument()
    pass_time(lead, session, 2.0)
    assert tissue.fluids["blood"].lost > 100.0
    lead.choose_instrument(1, "suction")
    lead.use_instrument()  # far off, as it comes in
    notice = cast(MagicMock, lead._state.client.add_notification).call_args.args
    assert notice == ("It takes up nothing here", NOTHING_LIES)
    assert tissue.suction.on(1)
    pass_time(lead, session, 1.0)
    assert tissue.suction.taken_ml == 0.0
    bring(10.0)
    pooled = tissue.suction.pooled_ml()
    pass_time(lead, session, 1.0)
    assert tissue.suction.pooled_ml() < pooled  # more is taken up than flows out


def test_the_lens_is_soiled_by_touch_and_jets_and_a_replay_has_it() -> None:
    """A scope at a wall is soiled at once, blood that jets soils it slowly, a wipe cleans it."""
    session = Session(Specimen.of_anatomy(anatomy_named("normal")), vertices=300)
    tissue, held = session.spatial, HeldScope(anatomy_network(anatomy_named("normal")))

    def look() -> None:
        camera = held.camera
        numbers = *held.pose.numbers, held.scope.angle
        session.look_from([*camera.axes[:, 2], *camera.tip, *numbers])

    look()
    assert tissue.lens.soil == 0.0
    performed(read_script(SCRIPTS / "hasty.toml"), session)
    soiled = tissue.lens.soil
    assert 0.2 < soiled < 1.0
    log = session.run_file().log
    again = Replay(log, tissue.dissection.organ)
    again.seek_tick(log.ticks)
    assert again.session.spatial.lens.soil == soiled
    session.wipe_lens()
    assert tissue.lens.soil == 0.0
    session.reset()
    session.open_jaws(1, 2.0)
    session.advance(5)
    duct = tissue.beam.places_at(np.array([5.0]), "cystic")[0]
    held.pose = held.scope.look(duct, 2.0, held.pose)
    look()
    assert tissue.lens.soil == 1.0
    session.advance(5)
    log = session.run_file().log
    again = Replay(log, tissue.dissection.organ)
    again.seek_tick(log.ticks)
    assert again.session.spatial.lens.soil == 1.0


def test_a_scope_is_held_as_a_run_has_logged_it() -> None:
    """Pose and optics of a logged view, to the bit; not where a trainee holds it, nor without."""
    held = HeldScope(anatomy_network(anatomy_named("normal")))
    home, straight = held.pose, held.scope.angle
    pose = home.moved(pan=0.2, tilt=-0.1, depth=9.0, cable=0.4, head=0.3)
    logged = (0.0, 0.0, 1.0, 1.0, 2.0, 3.0, *pose.numbers, OBLIQUE)
    assert held.show(logged)
    assert (held.pose, held.scope.angle) == (pose, OBLIQUE)
    assert not held.show(logged[:6])
    assert held.advance([])  # left alone, the assistant holds it as before
    assert (held.pose, held.scope.angle) == (home, straight)
    held.move(pan=0.01)
    assert not held.show(logged)


def test_what_was_seen_of_a_run_and_its_replay_in_the_page() -> None:
    """The hasty script's tear and bleeding are told; only the page of its anatomy replays it."""
    session = Session(Specimen.of_anatomy(anatomy_named("normal")), vertices=300)
    exercise = next(each for each in exercises_offered(session) if each.name == "critical_view")
    session.start_exercise(exercise, Feedback.CONTINUOUS)
    performed(read_script(SCRIPTS / "hasty.toml"), session)
    run = session.run_file()
    assert run.outcome is not None
    assert not run.outcome.passed
    state = PageState(MagicMock(), session, cast(Workers, None))
    replay = state.replay_of(run, vertices=300)
    sights, ticks = Sights(replay.session, run.log.ticks), 0

    def look(tick: int) -> None:
        nonlocal ticks
        ticks += 1
        sights.look(tick)

    replay.series(look)
    with patch.object(replay.session, "advance", side_effect=AssertionError("computed again")):
        assert replay.incidents() == session.run.incidents()
        assert run.agrees_with(replay.run_file())
    assert ticks == run.log.ticks
    seen = sights.seen
    assert [each.seconds for each in seen] == sorted(each.seconds for each in seen)
    torn = [event for event in session.spatial.events if event.kind == "tear"]
    assert [(each.seconds, each.what) for each in seen if "tears" in each.what] == [
        (event.tick * TICK_SECONDS, f"{tube_title(event.tube)} tears") for event in torn
    ]
    assert "cystic artery bleeds" in [each.what for each in seen]
    state.start_replay(run)
    assert state.playback is not None
    assert state.shown.specimen.anatomy == anatomy_named("normal")
    other = Session(Specimen.of_anatomy(anatomy_named("short-cystic")), vertices=300)
    with pytest.raises(ValueError, match="the anatomy 'normal'"):
        PageState(MagicMock(), other, cast(Workers, None)).start_replay(run)


def test_the_scope_has_measures_of_its_own() -> None:
    """A tip that the scope leaves behind is unseen from then on; a tilted scope has no horizon."""
    session = Session(Specimen.of_anatomy(anatomy_named("normal")), vertices=300)
    held = HeldScope(anatomy_network(anatomy_named("normal")))

    def look_on(seconds: int) -> None:
        for _ in range(30 * seconds):
            session.look_from(held.view)
            session.advance()

    session.open_jaws(1, 2.0)
    look_on(1)
    found = session.metrics()
    assert found["time_out_of_picture_s"] == found["scope_path_mm"] == 0.0
    assert found["horizon_deg"] == pytest.approx(0.0, abs=1e-6)
    tip = held.camera.tip
    held.move(pan=0.6)
    look_on(1)
    found, moved = session.metrics(), held.camera.tip - tip
    assert found["time_out_of_picture_s"] == pytest.approx(1.0)
    assert found["scope_path_mm"] == pytest.approx(float(np.sqrt((moved**2).sum())))
    assert found["horizon_deg"] == pytest.approx(
        0.5 * abs(math.degrees(held.scope.roll(held.pose))), rel=1e-6
    )
    kept = read_run(run_json(session.run_file()))
    assert kept.agrees_with(Replay(kept.log, session.spatial.dissection.organ).run_file())


def test_no_key_does_two_things_where_a_haptic_device_has_a_hook(lead: ScopeLead) -> None:
    lead._state.give_hook("a device")
    gui = cast(MagicMock, lead._state.client.gui)
    given = [(call.kwargs["hotkey"], None) for call in gui.add_command.call_args_list]
    assert given
    keys = given + [(key.hotkey, key.modifier) for key in KEYS]
    assert sorted(set(keys), key=str) == sorted(keys, key=str)


@pytest.mark.parametrize(
    "words",
    ["press 0 0 0 0 0 0", "press 1e300 0 0 0 0 -1", "press nan 0 0 0 0 -1", "press 1 2", "drag 0",
     "wheel inf", "wheel 1e9", "drag 0 0 0 0 0 -1", "move 1 2 3", ""],
)  # fmt: skip
def test_what_a_page_makes_up_leads_nothing_away(lead: ScopeLead, words: str) -> None:
    """What is malformed is ignored, and a ray that leads nowhere leads a tip within its reach."""
    session, hand = lead.session, lead.session.spatial.hands[0]
    ScopeScene.take(cast(ScopeScene, SimpleNamespace(_led=lead)), f"1 {words}")
    pass_time(lead, session, 1.0)
    assert np.isfinite(hand.place).all()
    assert np.linalg.norm(hand.place) < 500.0


def test_jaws_whose_shaft_lies_along_the_bar_need_no_turn(
    lead: ScopeLead, monkeypatch: pytest.MonkeyPatch
) -> None:
    lead.choose(1)
    x, y, z = TROCARS[1].shaft(lead.session.spatial.hands[1].place).tolist()
    step = NextStep("", np.zeros(0, np.int64), along=(x, y, z), hand=1)
    monkeypatch.setattr(AskedStep, "step", step)
    assert lead.asked.turn == 0.0


@given(st.floats(-0.7, 0.7), st.floats(-0.7, 0.7))
@settings(deadline=None, max_examples=100)
def test_what_is_met_is_pointed_at_before_what_is_missed_by_little(right: float, up: float) -> None:
    """Also where that lies before it: the gallbladder's edge before the cystic artery."""
    tissue, held = pointed_tissue()
    wide, bed, camera = math.tan(0.5 * FIELD_OF_VIEW), tissue.beam, held.camera
    ray = camera.axes @ np.array([wide * right, wide * up, -1.0])
    ray /= np.linalg.norm(ray)
    missed: list[float] = []
    for name, tube in bed.network.tubes.items():
        stations = bed.stations_of(name)
        fine = np.linspace(0.0, float(stations[-1]), 4 * len(stations))
        off = np.linalg.norm(np.cross(bed.places_at(fine, name) - camera.tip, ray), axis=1)
        missed.append(float((off - np.interp(fine, tube.stations, tube.radius)).min()))
    found = pointed_at(bed, camera.tip, ray)
    least = min(missed)
    if least > MISSED:
        assert found is None
    else:
        assert found is not None
        assert missed[found[0]] <= max(least, 0.0) + 1e-12


@cache
def pointed_tissue() -> tuple[SpatialTissue, HeldScope]:
    """Return an anatomy's tissue, and a scope that looks at it."""
    anatomy = anatomy_named("normal")
    session = Session(Specimen.of_anatomy(anatomy), vertices=300)
    return session.spatial, HeldScope(anatomy_network(anatomy))


def test_the_wheel_leads_the_scope_while_structures_are_pointed_at(
    lead: ScopeLead, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No hand moves then: one looks closer."""
    monkeypatch.setattr(StructurePointer, "structure", "cystic duct")
    depth, tip = lead.held.pose.depth, lead.session.spatial.hands[0].place.copy()
    lead.wheel(2.0)
    pass_time(lead, lead.session, 0.5)
    assert lead.held.pose.depth == pytest.approx(depth + 2.0 * NOTCH_MM)
    assert lead.session.spatial.hands[0].place == pytest.approx(tip)
