"""Tubes that join and hold each other, against frames, peels and the full matrix."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba.core.errors import TypingError

from app.validation.network_checks import t_peel, two_beams
from kernel_cache import njit
from physics.bed import BeamOnBed, End, Join, Network, SpaceBeam, Strands
from physics.bed import kernels as k
from physics.bed.kernels.tangent import hold_nodes, solve
from physics.bed.network import Elimination
from tests.physics.derivatives import assert_derivatives, full_tangent, turn_whole

Floats = np.ndarray[Any, np.dtype[np.float64]]

RADIUS, WALL = 2.0, 0.6
AREA = math.pi * (RADIUS**2 - (RADIUS - WALL) ** 2)
MOMENT = math.pi / 4 * (RADIUS**4 - (RADIUS - WALL) ** 4)
SHEAR = 0.5 / 1.49
# Of a tube of modulus 1 MPa.
TUBE = np.array([AREA, SHEAR * AREA / 2, SHEAR * AREA / 2, 2 * SHEAR * MOMENT, MOMENT, MOMENT])


def straight(
    begin: Any, end: Any, elements: int, stiffness: Floats, ends: tuple[End, End],
    nodes_at: tuple[float, ...] = (),
) -> SpaceBeam:  # fmt: skip
    begin, end = np.array(begin, float), np.array(end, float)
    return SpaceBeam.from_axis(
        elements=elements, stiffness=stiffness, axis=np.stack([begin, end]), ends=ends,
        radius=1.0, nodes_at=nodes_at,
    )  # fmt: skip


def t_frame() -> Network:
    a = straight([0, 0, 0], [40, 0, 0], 10, TUBE, ("clamped", "clamped"), (20.0,))
    b = straight([20, 0, 0], [20, 25, 0], 7, 0.4 * TUBE, ("free", "clamped"))
    return Network({"a": a, "b": b}, [Join("b", 0, "a", 20.0)])


def y_frame() -> Network:
    a = straight([0, 0, 0], [20, 0, 0], 6, TUBE, ("clamped", "free"))
    b = straight([20, 0, 0], [36, 13, 5], 6, 0.5 * TUBE, ("free", "clamped"))
    c = straight([20, 0, 0], [39, -13, 9], 7, 0.2 * TUBE, ("free", "clamped"))
    return Network({"a": a, "b": b, "c": c}, [Join("b", 0, "a", a.span), Join("c", 0, "a", a.span)])


def loop() -> Network:
    """A triangle on a beam: both ends of its last side join."""
    a = straight([0, 0, 0], [60, 0, 0], 15, TUBE, ("clamped", "clamped"), (20.0, 52.0))
    b = straight([20, 0, 0], [36, 14, 0], 6, 0.5 * TUBE, ("free", "free"))
    c = straight([36, 14, 0], [52, 0, 0], 6, 0.3 * TUBE, ("free", "free"))
    return Network(
        {"a": a, "b": b, "c": c},
        [Join("b", 0, "a", 20.0), Join("c", 0, "b", b.span), Join("c", 1, "a", 52.0)],
    )


def portal(ratio: float = 0.6) -> Network:
    """Columns of 30 mm and a beam of 24 mm that bend and do not stretch or shear."""
    column = TUBE * np.array([1e6, 1e6, 1e6, 1, 1, 1])
    across = column * np.array([1, 1, 1, 1, ratio, ratio])
    a = straight([0, 0, 0], [0, 30, 0], 10, column, ("clamped", "free"))
    b = straight([0, 30, 0], [24, 30, 0], 10, across, ("free", "free"))
    c = straight([24, 0, 0], [24, 30, 0], 10, column, ("clamped", "free"))
    return Network({"a": a, "b": b, "c": c}, [Join("b", 0, "a", 30.0), Join("c", 1, "b", 24.0)])


def element_stiffness(length: float, stiffness: Floats) -> Floats:
    """(12, 12) of a Timoshenko element in its own axes [Przemieniecki 1968]."""
    out = np.zeros((12, 12))
    for r, value in ((0, stiffness[0]), (3, stiffness[3])):
        out[np.ix_([r, r + 6], [r, r + 6])] = value / length * np.array([[1, -1], [-1, 1]])
    for move, turn, sign, ei, ga in (
        (1, 5, 1.0, stiffness[5], stiffness[1]), (2, 4, -1.0, stiffness[4], stiffness[2]),
    ):  # fmt: skip
        phi, a = 12 * ei / (ga * length**2), length
        near, far = (4 + phi) * a * a, (2 - phi) * a * a
        rows = np.array(
            [[12, 6 * a, -12, 6 * a], [6 * a, near, -6 * a, far],
             [-12, -6 * a, 12, -6 * a], [6 * a, far, -6 * a, near]]
        )  # fmt: skip
        signs = np.array([1, sign, 1, sign])
        at = [move, turn, move + 6, turn + 6]
        out[np.ix_(at, at)] += ei / (a**3 * (1 + phi)) * rows * np.outer(signs, signs)
    return out


def frame_matrix(made: BeamOnBed) -> Floats:
    """(6 N, 6 N) the direct stiffness matrix of straight tubes that join."""
    count = len(made.places)
    full = np.zeros((6 * count, 6 * count))
    for name, beam in made.network.tubes.items():
        nodes = made.nodes_of(name)
        for e in range(nodes.size - 1):
            i, j = int(nodes[e]), int(nodes[e + 1])
            direction = made.rest_places[j] - made.rest_places[i]
            length = float(np.linalg.norm(direction))
            along = direction / length
            up = np.array([0, 0, 1.0]) - along[2] * along
            up /= np.linalg.norm(up)
            frame = np.kron(np.eye(4), np.stack([along, np.cross(up, along), up]))
            at = np.r_[6 * i : 6 * i + 6, 6 * j : 6 * j + 6]
            own = frame.T @ element_stiffness(length, beam.stiffness[e]) @ frame
            full[np.ix_(at, at)] += own
    return full


@pytest.mark.parametrize("frame", [t_frame, y_frame, loop])
def test_frames_move_as_the_direct_stiffness_matrix_says(frame: Any) -> None:
    made = BeamOnBed(frame())
    matrix, state = frame_matrix(made), made.state
    held = (state.held[:, None] >> np.arange(6) & 1 == 1).ravel()
    rng = np.random.default_rng(1)
    force = np.zeros((len(made.places), 6))
    for name in ("a", "b", "c"):
        if name in made.network.tubes:
            node = made.nodes_of(name)[5]
            force[node, :3] = 1e-9 * rng.normal(size=3)
            made.push(int(node), force[node, :3])
    expected = np.zeros(force.size)
    expected[~held] = np.linalg.solve(matrix[np.ix_(~held, ~held)], force.ravel()[~held])
    made.advance()
    moved = made.places - made.rest_places
    expected = expected.reshape(-1, 6)[:, :3]
    assert moved == pytest.approx(expected, abs=2e-7 * np.abs(expected).max())


def test_a_portal_sways_as_the_closed_form() -> None:
    """P h^3 (2 + 3 k)/(12 E I (1 + 6 k)), k = I_b h/(I_c b) [Kleinlogel]."""
    made = BeamOnBed(portal())
    node = int(made.nodes_of("a")[-1])
    made.push(node, (1e-6, 0.0, 0.0))
    made.advance()
    ratio = 0.6 * 30.0 / 24.0
    sway = 1e-6 * 30.0**3 * (2 + 3 * ratio) / (12 * MOMENT * (1 + 6 * ratio))
    assert made.places[node, 0] == pytest.approx(sway, rel=1e-6)


def joined_cantilever(factor: float, elements: int) -> float:
    """Return how far the end of a cantilever of 20 mm goes under 1 N, mm, at small deflections."""
    wall = straight([0, 0, 0], [10, 0, 0], 2, TUBE, ("clamped", "clamped"))
    arm = straight([10, 0, 0], [10, 20, 0], elements, TUBE, ("free", "free"))
    made = BeamOnBed(Network({"a": wall, "b": arm}, [Join("b", 0, "a", wall.span, factor)]))
    node, force = int(made.nodes_of("b")[-1]), 1e-7
    made.push(node, (0.0, 0.0, force))
    made.advance()
    return float(made.places[node, 2] - made.rest_place(node)[2]) / force


@pytest.mark.parametrize("factor", [0.01, 0.3, 1.0, 1e4])
@pytest.mark.parametrize("elements", [5, 40])
def test_an_elastic_joint_gives_as_much_as_its_element_is_softer(
    factor: float, elements: int
) -> None:
    """L^3/3EI + L/GA of the cantilever, and (1/f - 1) times its first element's own part."""
    bending, shear, span, h = TUBE[4], TUBE[2], 20.0, 20.0 / elements
    rigid = span**3 / (3 * bending) + span / shear
    own = (span**3 - (span - h) ** 3) / (3 * bending) + h / shear
    found = joined_cantilever(factor, elements)
    assert found == pytest.approx(rigid + (1 / factor - 1) * own, rel=1e-8)


@pytest.mark.parametrize("spring", [0.2, 2.0, 20.0])  # of 3 E I / L
def test_a_short_elastic_joint_is_a_rotational_spring(spring: float) -> None:
    """F L^3/3EI + F L^2/k, k = E I/(h (1/f - 1)): the shorter its element h, the nearer."""
    bending, shear, span = TUBE[4], TUBE[2], 20.0
    k = spring * 3 * bending / span
    rigid = span**3 / (3 * bending) + span / shear
    off: list[float] = []
    for elements in (50, 100, 200):
        h = span / elements
        factor = 1 / (1 + bending / (h * k))
        more = joined_cantilever(factor, elements) - rigid
        off.append(more / (span**2 / k) - 1.0)
        # The spring lies along the element, not at its end, and shears.
        along = (1 - (1 - h / span) ** 3) * span / (3 * h) - 1 + bending / (shear * span**2)
        assert off[-1] == pytest.approx(along, abs=1e-7)
    assert abs(off[-1]) < 0.003 + bending / (shear * span**2)


def test_a_joint_that_grows_stiff_is_a_rigid_one() -> None:
    """By the cantilever's first element, which a rigid joint has, too."""
    rigid = joined_cantilever(1.0, 40)
    softer = [joined_cantilever(1.0 - part, 40) - rigid for part in (1e-1, 1e-2, 1e-3)]
    assert all(each > 0.0 for each in softer)
    assert softer[1] / softer[2] == pytest.approx(10.0, rel=0.01)
    assert softer[2] < 1e-4 * rigid


def test_a_tube_in_two_that_join_is_one() -> None:
    """Pulled far: forces and energy to rounding, wherever the joint is."""
    one = straight([0, 0, 0], [40, 0, 0], 24, TUBE, ("clamped", "clamped"), (10.0, 25.0))
    first = straight([0, 0, 0], [25, 0, 0], 15, TUBE, ("clamped", "free"), (10.0,))
    second = straight([25, 0, 0], [40, 0, 0], 9, TUBE, ("free", "clamped"))
    two = Network({"a": first, "b": second}, [Join("b", 0, "a", 25.0)])
    found: list[tuple[Floats, float]] = []
    for made in (BeamOnBed(one), BeamOnBed(two)):
        node = made.take(10.0)
        for step in range(1, 6):
            made.lead(node, made.rest_place(node) + 0.2 * step * np.array([1.0, 3.0, 8.0]))
            made.advance()
        assert abs(made.energy.residual) < 1e-4 * made.energy.work
        found.append((made.hand_force(node).copy(), float(made.state.sums[k.BEAM])))
    assert found[1][0] == pytest.approx(found[0][0], abs=1e-9)
    assert found[1][1] == pytest.approx(found[0][1], rel=1e-9)


def test_stress_is_judged_from_a_joint_s_face_on() -> None:
    """As of a frame at the face of a support: before it a tube lies within the other."""
    a = straight([0, 0, 0], [40, 0, 0], 20, TUBE, ("clamped", "clamped"), (20.0,))
    wall = np.tile([AREA, MOMENT, MOMENT], (11, 1))
    b = replace(straight([20, 0, 0], [20, 20, 0], 10, TUBE, ("free", "free")), wall=wall)
    a = replace(a, wall=np.full((21, 3), np.inf))

    def loaded(face: float) -> BeamOnBed:
        made = BeamOnBed(Network({"a": a, "b": b}, [Join("b", 0, "a", 20.0, face=face)]))
        node = made.take(20.0, "b")
        made.lead(node, made.rest_place(node) + np.array([1e-4, 0.0, 0.0]))
        made.advance()
        return made

    at_axis = loaded(0.0)
    assert at_axis.worst_stress("b").station == 0.0
    # Elements that end at the face, too, lie within the other; the moment falls to the tip.
    for face, judged in ((1.9, 0.0), (2.0, 2.0), (5.0, 4.0)):
        made = loaded(face)
        worst = made.worst_stress("b")
        assert worst.station == pytest.approx(judged)
        assert worst.total == pytest.approx(
            at_axis.worst_stress("b").total * (1.0 - judged / 20.0), rel=1e-5
        )
        assert made.places.tobytes() == at_axis.places.tobytes(), "nothing moves otherwise"


def symmetric_y() -> BeamOnBed:
    a = straight([0, 0, 0], [20, 0, 0], 8, TUBE, ("clamped", "free"))
    arms = [
        straight([20, 0, 0], [40, side * 15, 0], 8, 0.5 * TUBE, ("free", "clamped"))
        for side in (1, -1)
    ]
    joins = [Join("b", 0, "a", a.span), Join("c", 0, "a", a.span)]
    return BeamOnBed(Network({"a": a, "b": arms[0], "c": arms[1]}, joins))


def test_a_symmetric_y_stays_so_and_its_joint_is_in_balance() -> None:
    made = symmetric_y()
    node = made.take(20.0)
    assert made._rest.is_joint(node)
    for step in range(1, 6):
        made.lead(node, made.rest_place(node) + 0.2 * step * np.array([-2.0, 0.0, 5.0]))
        made.advance()
    force = made.hand_force(node)
    mirrored = made.places[made.nodes_of("c")] * [1, -1, 1]
    assert made.places[made.nodes_of("b")] == pytest.approx(mirrored, abs=1e-9)
    assert abs(force[1]) < 1e-9 * np.linalg.norm(force)
    k.assemble(made.state, k.FROZEN, 0.0)
    free = made.state.held == 0
    assert np.abs(made.state.g[free]).max() < 1e-9 * np.linalg.norm(force)
    held = made.state.g[made.state.held & 7 == 7, :3]
    assert np.abs(held.sum(axis=0)).max() < 1e-9 * np.linalg.norm(force)


def crossed(seed: int) -> BeamOnBed:
    """Three curved tubes, the last a loop, strands between them and to the bed, all deformed."""
    rng = np.random.default_rng(seed)
    stiff = [rng.random(6) * 5 + 1 for _ in range(3)]
    a = SpaceBeam.from_axis(
        elements=4, stiffness=stiff[0], ends=("free", "free"),
        axis=np.array([[0, 0, 0], [2, 0.3, 0.2], [4.0, 0, 0.5]]), nodes_at=(1.0,),
    )  # fmt: skip
    joint = a.places[int(np.argmin(np.abs(a.stations - 1.0)))]
    course = np.array([[0, 0, 0], [0.5, 1, 0.3], [1.2, 2, 0.2]])
    b = SpaceBeam.from_axis(
        elements=3, stiffness=stiff[1], ends=("free", "free"),
        axis=joint + course,
    )  # fmt: skip
    c = SpaceBeam.from_axis(
        elements=3, stiffness=stiff[2], ends=("free", "free"),
        axis=np.stack([b.places[-1], 0.5 * (b.places[-1] + a.places[-1]), a.places[-1]]),
    )  # fmt: skip
    network = Network(
        {"a": a, "b": b, "c": c},
        [Join("b", 0, "a", 1.0), Join("c", 0, "b", b.span), Join("c", 1, "a", a.span)],
    )
    count = 12
    elongations = np.array([0.1, 0.5, 9, 9, 0.5, 0.2, 9, 1, 1, 9, 9, 9])
    tubes = np.array([0, 1, 2, 0, 0, 0, 1, 1, 1, 0, 1, 1])
    strands = Strands(
        rng.random(count) * 0.9 + 0.45,
        rng.normal(size=(count, 3)),
        rng.normal(size=(count, 3)),
        rng.random(count) + 1,
        rng.random(count) + 0.1,
        elongations,
        2 * elongations,
        np.array([0.0, 1] * 6),
        tubes,
        np.array([-1, -1, -1, 1, 1, 2, 2, 2, 2, 1, 0, 0]),
        rng.random(count) * 0.9 + 1.2,
    )
    made = BeamOnBed(network, strands)
    state = made.state
    nodes = len(state.x)
    state.x[:] += rng.normal(size=(nodes, 3)) * 0.3
    state.q[:] += rng.normal(size=(nodes, 4)) * 0.3
    state.q[:] /= np.sqrt((state.q**2).sum(axis=1))[:, None]
    state.strain[:] += rng.normal(size=(len(state.h), 6)) * 0.2
    state.damage[::3] = 0.3
    return made


@pytest.mark.slow
@pytest.mark.parametrize("kind", [k.FROZEN, k.INCREMENTAL])
@pytest.mark.parametrize("seed", [2, 3])
def test_gradient_and_tangent_are_the_energy_s_differences(kind: int, seed: int) -> None:
    made = crossed(seed)
    assert made.state.pair.size
    assert_derivatives(made.state, kind)


@njit
def solved(s: k.State) -> bool:
    hold_nodes(s, 1.0)
    return solve(s.first_block, s.blocks, s.product, s.diagonal, s.block, s.step)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_a_network_is_solved_as_the_full_matrix(seed: int) -> None:
    rng = np.random.default_rng(seed)
    state = crossed(seed).state
    nodes = len(state.x)
    state.held[[0, 2]], state.held[[4, 6]] = 63, (5, 9)
    state.goal[:] = state.x + rng.normal(size=(nodes, 3)) * 0.05
    k.assemble(state, k.FROZEN, 0.0)
    for r in range(6):
        state.diagonal[:, r, r] += 40.0
    full = full_tangent(state)
    held = (state.held[:, None] >> np.arange(6) & 1 == 1).ravel()
    expected = np.concatenate([state.goal - state.x, np.zeros((nodes, 3))], axis=1).ravel()
    right = -state.g.ravel() - full[:, held] @ expected[held]
    expected[~held] = np.linalg.solve(full[np.ix_(~held, ~held)], right[~held])
    state.step[:] = state.g
    assert solved(state)
    assert state.step.ravel() == pytest.approx(expected, abs=1e-11)


@settings(deadline=None)
@given(st.integers(1, 12), st.data())
def test_elimination_has_a_block_for_every_fill(rows: int, data: Any) -> None:
    """The factor of a matrix that is zero elsewhere is zero where there is no block."""
    every = [(i, j) for i in range(rows) for j in range(i + 1, rows)]
    pairs = set(data.draw(st.lists(st.sampled_from(every), unique=True)) if every else [])
    made = Elimination.of(rows, frozenset(pairs))
    assert sorted(made.order) == list(range(rows))
    matrix = rows * np.eye(rows)
    place = np.argsort(made.order)
    for i, j in pairs:
        matrix[place[i], place[j]] = matrix[place[j], place[i]] = -0.7
    factor = np.linalg.cholesky(matrix)
    for i in range(rows):
        row = made.columns[made.first[i] : made.first[i + 1]].tolist()
        assert row == sorted(row)
        assert np.all(np.delete(factor[i + 1 :, i], [j - i - 1 for j in row]) == 0.0)
        assert [made.block(i, j) >= 0 for j in range(i + 1, rows)] == [
            j in row for j in range(i + 1, rows)
        ]


def test_one_branch_is_eliminated_from_end_to_end_and_a_tree_fills_nothing() -> None:
    chain = Elimination.of(9, frozenset((i, i + 1) for i in range(8)))
    assert chain.order.tolist() == list(range(9))
    assert chain.columns.tolist() == list(range(1, 9))
    state = BeamOnBed(y_frame()).state
    assert state.block.shape[0] == state.h.size
    assert state.product.size == 0


@pytest.mark.parametrize(("elements", "error"), [(64, 4e-3), (128, 1.1e-3), (256, 3.5e-4)])
def test_two_beams_joined_by_strands_open_as_kanninen_s(elements: int, error: float) -> None:
    """Each is a beam on a bed twice as stiff; the error falls with the square of the element."""
    check = two_beams(elements)
    assert check.found == pytest.approx(check.expected, rel=error)


@pytest.mark.slow
@pytest.mark.parametrize("stretching", [1.0, 8.0])
def test_two_arms_peel_apart_at_a_t(stretching: float) -> None:
    """G = 2 F + F^2 / EA, the work of both arms less what they store."""
    check = t_peel(stretching)
    assert check.found == pytest.approx(check.expected, rel=1e-4)
    assert check.unexplained < 1e-4


@pytest.mark.parametrize("seed", [2, 3])
def test_turning_a_network_as_a_whole_changes_nothing(seed: int) -> None:
    """Joints of tubes with other frames and strands between them know of no direction."""
    state = crossed(seed).state
    state.damage[: state.first[len(state.x)]] = 1.0  # those to the bed
    before, section = k.assemble(state, k.FROZEN, 0.0), state.section.copy()
    turn_whole(state)
    assert k.assemble(state, k.FROZEN, 0.0) == pytest.approx(before, rel=1e-12)
    assert state.section == pytest.approx(section, abs=1e-10)
    assert np.abs(state.g[:, :3].sum(axis=0)).max() < 1e-12 * np.abs(state.g).max()


def test_a_tube_tears_by_its_own_wall_and_frees_its_own_length() -> None:
    made = BeamOnBed(t_frame())
    with pytest.raises(ValueError, match="there is no tube 'c': a, b"):
        made.take(3.0, "c")
    node = made.take(12.5, "b")
    assert node in made.nodes_of("b")
    made.lead(node, made.rest_place(node) + np.array([0.0, 0.0, 3.0]))
    made.advance()
    before = made.energy
    element = made.tear(15.0, "b")
    assert made.stations_of("b")[element] <= 15.0 <= made.stations_of("b")[element + 1]
    assert made.energy.snap > before.snap
    made.advance()
    # What is left is the piece that still hangs on the hook and on tube a.
    sections = made.state.section[10 + element]
    assert np.all(sections == 0.0)


@pytest.mark.parametrize(
    ("joins", "message"),
    [
        ([Join("b", 0, "d", 20.0)], "there is no tube 'd': a, b"),
        ([Join("a", 0, "b", 20.0)], "tube a joins b, which must stand before it"),
        ([Join("b", 2, "a", 20.0)], "end of tube b must be 0 or 1, got 2"),
        ([Join("b", 0, "a", 20.0)] * 2, "end 0 of tube b joins twice"),
        ([Join("b", 0, "a", 19.0)], "tube b joins a at 19 mm, where that has no node"),
        ([Join("b", 0, "a", 24.0)], r"end 0 of tube b is 4 mm away from a at 24 mm"),
        ([Join("b", 1, "a", 20.0)], "end 1 of tube b joins a and is clamped as well"),
        ([Join("b", 0, "a", 20.0, 0.0)], "stiffness where b joins a must be above 0"),
        (
            [Join("b", 0, "a", 20.0, face=25.0)],
            "tube b joins must be from 0 to 25 mm along it",
        ),
    ],
)
def test_joins_that_cannot_be_are_refused(joins: list[Join], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Network(t_frame().tubes, joins)


def test_kernels_that_are_public_can_be_called_from_plain_python() -> None:
    """Without a wrapper a call would end the process."""
    pair = np.array([[1, 4, 0, 0], [2, 7, 0, 0]])
    assert k.group_nodes(pair, 3, 9) == (3, -1)
    assert k.group_nodes(pair, 10, 9) == (2, 7)
    with pytest.raises(TypingError):
        k.group_nodes(None, 3, 9)  # type: ignore[arg-type]
    for name in k.__all__:
        options = getattr(getattr(k, name), "targetoptions", {})
        assert not options.get("no_cpython_wrapper"), name
