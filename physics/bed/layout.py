"""The arrays of a network on its bed: how large they are, where they are made, what they hold.

`state_of(..., out=)` writes into arrays that are there already, such as the rows of a batch of
beds, each array of which has one axis more; `shapes` says how large they must be.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from physics.bed import kernels
from physics.bed.network import Elimination, Network
from physics.bed.nick import Nick, Weak
from physics.bed.relaxation import Relaxation
from physics.bed.space_beam import HELD, tangents
from physics.bed.strands import Strands
from physics.bed.touching import Touching

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Shapes = dict[str, tuple[tuple[int, ...], type[np.generic]]]
Coupling = Literal["exact", "lagged"]
"""How strands between tubes are coupled in real time: by a block for each pair of nodes, or not
at all, so that either node moves as if the other stood still."""

Relaxing = tuple[Relaxation | None, Relaxation | None]
"""How strands and walls relax; what is None does not."""
AT_ONCE: Relaxing = (None, None)

REACH_OF_RODS = 12.0
"""How far from the beam's surface and the rod's a strand may still touch the rod, mm."""
# Bits of what is held in the plane of x and z: y, and turning about x and z.
IN_PLANE = 2 + 8 + 32
# Part of an element's shear flexibility that stands for bending within it, from which on it is
# stretched along its chord.
THIN = 0.5
WHOLE_NUMBERS = (
    "held",
    "first_block",
    "blocks",
    "product",
    "ends",
    "first",
    "pair",
    "touch",
    "which",
)
SMALL_NUMBERS = ("side", "side_before")
"""Names of a state's arrays of whole numbers, and of those that fit a byte."""


@dataclass(slots=True, eq=False)
class Tube:
    """A tube of a network as the state has it."""

    name: str
    nodes: Ints  # (n,) numbers of its nodes, along it
    stations: Floats  # (n,) where they are on it, mm; hooks move inner ones
    elements: slice  # of all elements, along it
    joined: tuple[bool, bool]  # whether its ends join another tube


@dataclass(slots=True, eq=False)
class Rest:
    """A network at rest as its state has it: hooks move nodes along tubes, tears soften elements.

    Strands are sorted by their nodes, those between two tubes after all others.
    """

    network: Network
    strands: Strands
    tubes: list[Tube]
    elimination: Elimination
    stations: Floats  # (N,) of the nodes on the first tube that has them, mm
    x: Floats  # (N, 3) mm
    q: Floats  # (N, 4)
    radius: Floats  # (N,) mm
    stiffness: Floats  # (E, 6) of the elements' sections, N and N mm^2
    wall: Floats | None  # (E, 2, 3) areas, mm^2, and section moduli, mm^3, at the elements' ends
    # (E, WALL_ROWS), (E, 2, WALL_ROWS) what `kernels.wall` needs of the elements and of their ends
    fibres: tuple[Floats, Floats] | None
    ends: Ints  # (E, 2) nodes of the elements
    turn: Floats  # (E, 2, 4) from the nodes' frames to the elements' at their ends
    held: Ints  # (N,) bits of what ends and the plane hold
    nodes: NDArray[np.int32]  # (S,) the strands' nodes, in order
    others: NDArray[np.int32]  # (S,) the nodes that their feet are on, -1 for the bed
    pairs: Ints  # (G, 4) as in the state
    order: NDArray[np.intp]  # (S,) their numbers in `strands`
    touching: Touching
    nicks: list[Nick] = field(default_factory=list[Nick])  # tears part of the way through tubes

    @classmethod
    def of(
        cls,
        network: Network,
        strands: Strands,
        *,
        plane: bool = False,
        coupling: Coupling = "exact",
    ) -> "Rest":
        """Return a network and its strands at rest."""
        numbered = network.numbered()
        beams = list(network.tubes.values())
        count = max(int(each.max()) for each in numbered) + 1
        ends = np.concatenate([np.stack([each[:-1], each[1:]], axis=1) for each in numbered])
        if len({tuple(sorted(each)) for each in ends.tolist()}) < len(ends):
            raise ValueError("two tubes join the same two neighbouring nodes: give more elements")
        node, other = _strand_nodes(network, numbered, strands)
        apart = other >= 0
        if np.any(node[apart] == other[apart]):
            raise ValueError("a strand must join two nodes, got one with both ends at a joint")
        between = {
            (min(i, j), max(i, j))
            for i, j in zip(node[apart].tolist(), other[apart].tolist(), strict=True)
        }
        near = {(min(i, j), max(i, j)) for i, j in ends.tolist()}
        touching = Touching.of(network, numbered)
        between |= touching.coupled
        order = Elimination.of(count, frozenset(near | between if coupling == "exact" else near))
        at = np.empty(count, dtype=np.int64)
        at[order.order] = np.arange(count)
        node, other = at[node], np.where(apart, at[other], -1)
        nodes = [at[each] for each in numbered]
        x, q = np.empty((count, 3)), np.empty((count, 4))
        stations, radius = np.empty(count), np.empty(count)
        held = np.zeros(count, dtype=np.int64)
        tubes: list[Tube] = []
        turns: list[Floats] = []
        stiffness: list[Floats] = []
        first = 0
        joined = {(join.tube, join.end): join for join in network.joins}
        for name, beam, mine in zip(network.tubes, beams, nodes, strict=True):
            joins = joined.get((name, 0)), joined.get((name, 1))
            own = slice(int(joins[0] is not None), mine.size - int(joins[1] is not None))
            x[mine[own]], q[mine[own]] = beam.places[own], beam.rotations[own]
            stations[mine[own]], radius[mine[own]] = beam.stations[own], beam.radius[own]
            elements = mine.size - 1
            turn = np.zeros((elements, 2, 4))
            turn[..., 0] = 1.0
            stiff = beam.stiffness.copy()
            for end, join in enumerate(joins):
                if join is None:
                    held[mine[-end]] = HELD[beam.ends[end]]
                else:
                    turn[-end, end] = _relative(q[mine[-end]], beam.rotations[-end])
                    stiff[-end] *= join.stiffness
            along = stations if len(beams) == 1 else beam.stations.copy()
            tubes.append(
                Tube(
                    name,
                    mine,
                    along,
                    slice(first, first + elements),
                    (joins[0] is not None, joins[1] is not None),
                )
            )
            turns.append(turn)
            stiffness.append(stiff)
            first += elements
        if plane:
            held |= IN_PLANE
        # A tube without a wall has no stress.
        walls = [
            np.full((each.stations.size - 1, 2, 3), np.inf)
            if each.wall is None
            else _at_ends(each.wall)
            for each in beams
        ]
        names = list(network.tubes)
        for join in network.joins:
            # Elements that lie within the other tube have no wall of their own.
            number = names.index(join.tube)
            apart = np.abs(beams[number].stations - beams[number].stations[-join.end])
            walls[number][np.maximum(apart[:-1], apart[1:]) <= join.face] = np.inf
        fibres = [each.fibres for each in beams if each.fibres is not None]
        touching.which[:, 0] = at[touching.which[:, 0]]
        group, pairs = _pairs(node, other, order)
        sort = np.argsort(group, kind="stable")
        return cls(
            network,
            strands,
            tubes,
            order,
            stations,
            x,
            q,
            radius,
            np.concatenate(stiffness),
            None if all(each.wall is None for each in beams) else np.concatenate(walls),
            (
                np.concatenate([each[0] for each in fibres]),
                np.concatenate([_at_ends(each[1]) for each in fibres]),
            )
            if fibres
            else None,
            np.concatenate([np.stack([each[:-1], each[1:]], axis=1) for each in nodes]),
            np.concatenate(turns),
            held,
            node[sort].astype(np.int32),
            other[sort].astype(np.int32),
            pairs,
            sort,
            touching,
        )

    def tube(self, name: str | None) -> Tube:
        """Return a tube by its name, the first one if None."""
        for each in self.tubes:
            if name is None or each.name == name:
                return each
        names = ", ".join(each.name for each in self.tubes)
        raise ValueError(f"there is no tube {name!r}: {names}")

    @property
    def most_at_a_node(self) -> int:
        """The largest number of strands at a node, or between two."""
        ties = self.nodes * (self.stations.size + 1) + self.others
        return int(np.unique(ties, return_counts=True)[1].max(initial=0))

    def is_joint(self, node: int) -> bool:
        """Return whether tubes join at a node."""
        return sum(int((each.nodes == node).any()) for each in self.tubes) > 1

    def write(self, s: kernels.State) -> None:
        """Write what follows from the nodes' places at rest: strains, stiffnesses, arms."""
        for tube in self.tubes:
            s.h[tube.elements] = np.diff(tube.stations)
        s.chord[:] = 0.0
        stiffness = self._weakened(s) if self.nicks else self.stiffness
        kernels.set_rest(self.x, self.q, s.ends, s.turn, s.h, s.strain)
        s.floor[:, 1] = self.x[:, 2]
        s.stiff[:] = stiffness
        # One shear strain an element leaves bending out, h^2/(12 E I), which is added to its shear
        # flexibility [MacNeal 1978]: under forces at the nodes a straight element is then exact at
        # small loads.
        whole = stiffness[:, 0] > 0.0
        for shear, bending in ((1, 5), (2, 4)):
            within = s.h[whole] ** 2 / (12.0 * stiffness[whole, bending])
            s.stiff[whole, shear] = 1.0 / (1.0 / stiffness[whole, shear] + within)
            inner = s.stiff[whole, shear] * within
            s.chord[whole, shear - 1] = np.where(inner > THIN, inner * inner, 0.0)
        if self.fibres is not None:
            # Their length is the chord's in all elements: else stiffening fibres would gain by what
            # is left out of their shear.
            for column, shear in ((kernels.SOFT_2, 1), (kernels.SOFT_3, 2)):
                soft = s.stiff[whole, shear] / stiffness[whole, shear]
                s.wall[:, column] = 0.0
                s.wall[whole, column], s.chord[whole, shear - 1] = soft, 1.0 - soft
            s.wall[~whole, kernels.STRENGTH] = 0.0
        strands = self.strands
        kernels.set_arms(
            self.x, self.q, self.nodes, strands.ends[self.order], s.strand, kernels.ARM_X
        )
        kernels.set_arms(
            self.x, self.q, self.others, strands.feet[self.order], s.strand, kernels.FOOT_X
        )

    def weak(self, nick: Nick) -> Iterator[tuple[int, Weak]]:
        """Return the elements that a tear weakens, and what is left of them."""
        tube = self.tube(nick.tube)
        first = tube.elements.start
        for e, (low, high) in enumerate(zip(tube.stations[:-1], tube.stations[1:], strict=True)):
            if self.stiffness[first + e, 0] > 0.0:
                weak = nick.weak(self.stiffness[first + e], float(low), float(high))
                if weak is not None:
                    yield first + e, weak

    def _weakened(self, s: kernels.State) -> Floats:
        """Write the frames and fibres of elements with a tear; return all stiffnesses."""
        stiffness = self.stiffness.copy()
        for nick in self.nicks:
            for e, weak in self.weak(nick):
                stiffness[e], s.chord[e, kernels.OFF] = weak.stiffness, weak.off
                s.turn[e] = [times(each, nick.spin) for each in self.turn[e]]
                if self.fibres is not None:
                    s.wall[e, kernels.STRENGTH] = weak.stiffness[0]
                    for reach, factor in zip(
                        (kernels.REACH_2, kernels.REACH_3), weak.reaches, strict=True
                    ):
                        s.wall[e, reach] = factor * self.fibres[0][e, reach]
        return stiffness

    def move_node(self, s: kernels.State, tube: Tube, k: int, station: float) -> None:
        """Move an inner node of a tube, the k-th, to a station, along the axis at rest and now."""
        old, node = tube.stations, tube.nodes[k]
        after = k + 1 if station > old[k] else k - 1
        neighbour = tube.nodes[after]
        distance = abs(old[after] - old[k])
        fraction = (station - old[k]) / (old[after] - old[k])
        sign = 1.0 if after > k else -1.0
        for x, q in ((s.x, s.q), (self.x, self.q)):
            near = self._rotations(q, tube, k, after)
            x[node] = _between(x[[node, neighbour]], sign * distance * tangents(near), fraction)
            turned = near[1] if (near[1] * q[node]).sum() >= 0.0 else -near[1]
            q[node] += fraction * (turned - q[node])
            q[node] /= np.sqrt((q[node] ** 2).sum())
        self.stations[node] = old[k] = station
        self.write(s)

    def _rotations(self, q: Floats, tube: Tube, k: int, after: int) -> Floats:
        """Return the (2, 4) rotations of a tube's k-th node and of a neighbour, as the tube's."""
        element, end = tube.elements.start + min(k, after), int(after > k)
        return np.stack([q[tube.nodes[k]], times(q[tube.nodes[after]], self.turn[element, end])])


def shapes(rest: Rest, rods: int = 0, relaxation: Relaxing = AT_ONCE) -> Shapes:
    """Return shape and type of each of a state's arrays, by its name."""
    branches = max(0 if each is None else len(each.times) for each in relaxation)
    strands, walls = (int(each is not None) for each in relaxation)
    nodes, count, elements = rest.stations.size, rest.strands.count, len(rest.ends)
    solid = 0 if rest.fibres is None else elements
    three, six, diagonal, most = (nodes, 3), (nodes, 6), (nodes, 6, 6), rest.most_at_a_node
    block = (rest.elimination.columns.size, 6, 6)
    swept, touched, at_rods = (rods, kernels.ROD_ROWS), (rods, count), (rods, 3)
    sizes: dict[str, tuple[int, ...]] = {
        "x": three, "q": (nodes, 4), "goal": three, "held": (nodes,), "load": three,
        "spring": three, "first_block": (2, nodes + 1), "blocks": (3, block[0]),
        "product": rest.elimination.products.shape, "ends": (elements, 4),
        "turn": (elements, 2, 4), "h": (elements,), "stiff": (elements, 6), "strain": (elements, 6),
        "chord": (elements, 3), "wall": (solid, kernels.WALL_ROWS), "strained": (solid, 4),
        "first": (nodes + len(rest.pairs) + 1,), "pair": rest.pairs.shape,
        "strand": (kernels.STRAND_ROWS, count), "damage": (count,),
        "floor": (nodes, 2), "touch": rest.touching.which.shape,
        "reach": (len(rest.touching.which), kernels.REACH_COLUMNS), "girth": (elements, 2),
        "thick": three, "rods": swept, "side": touched, "pull": at_rods,
        "press": (rods, 4), "section": (elements, 11),
        "fibres": (kernels.FIBRE_ROWS, kernels.FIBRES * solid), "g": six, "step": six,
        "diagonal": diagonal, "block": block, "diagonal_kept": diagonal, "block_kept": block,
        "x_kept": three, "q_kept": (nodes, 4), "goal_from": three, "goal_to": three,
        "load_from": three, "load_to": three, "rods_from": swept, "rods_to": swept,
        "rods_step": at_rods, "hold": six, "cross": (6, 6),
        "react": three, "damage_correction": six, "rods_damage_correction": at_rods, "moved": six,
        "g_before": six, "load_before": three, "pull_before": at_rods, "g_middle": six,
        "pull_middle": at_rods, "damage_before": (count,), "side_before": touched,
        "damage_ahead": (count,), "branch": (2, branches, 5),
        "memory": (kernels.SPRING + branches, strands * count),
        "wall_memory": (kernels.OVER + branches, walls * 6 * elements), "sums": (kernels.SUM_ROWS,),
        "pulling": (2 * most, 12), "which": (most,),
    }  # fmt: skip
    types: dict[str, Any] = dict.fromkeys(WHOLE_NUMBERS, np.int64)
    types |= dict.fromkeys(SMALL_NUMBERS, np.int8)
    return {name: (sizes[name], types.get(name, np.float64)) for name in kernels.State._fields}


def state_of(
    rest: Rest,
    *,
    floor: Sequence[Floats] | None = None,
    rods: int = 0,
    retrace: bool = False,
    relaxation: Relaxing = AT_ONCE,
    out: kernels.State | None = None,
) -> kernels.State:
    """Return the state of a network at rest on its bed.

    Parameters
    ----------
    rest
        The network and its strands.
    floor
        Of each tube the (n,) stiffnesses with which the bed pushes back nodes that lie deeper than
        at rest, N/mm.
    rods
        How many rods there may be.
    retrace
        As of `BeamOnBed`.
    relaxation
        Of strands and of walls.
    out
        Arrays of the `shapes`, which are overwritten; new ones when None.

    Returns
    -------
    State
        `out`, or a new state.
    """
    if out is None:
        made: list[Any] = [np.zeros(*each) for each in shapes(rest, rods, relaxation).values()]
        s = kernels.State(*made)
    else:
        s = out
        for each in s:
            each[...] = 0
    for each in (s.x, s.goal, s.goal_from, s.goal_to):
        each[:] = rest.x
    s.q[:] = rest.q
    s.held[:] = rest.held
    order = rest.elimination
    s.first_block[0], s.blocks[1], s.product[:] = order.first, order.columns, order.products
    s.blocks[0] = np.repeat(np.arange(rest.stations.size), np.diff(order.first))
    s.blocks[2] = np.argsort(order.columns, kind="stable")
    s.first_block[1] = np.searchsorted(np.sort(order.columns), np.arange(order.first.size))
    s.ends[:, :2], s.turn[:], s.pair[:] = rest.ends, rest.turn, rest.pairs
    s.ends[:, 2:] = [[order.block(i, j), i > j] for i, j in rest.ends.tolist()]
    if rest.fibres is not None:
        s.wall[:] = rest.fibres[0]
    s.fibres[:] = 1.0
    nodes, strands = rest.stations.size, rest.strands
    bed = rest.others < 0
    s.first[: nodes + 1] = np.searchsorted(rest.nodes[bed], np.arange(nodes + 1))
    ties = np.stack([rest.nodes[~bed], rest.others[~bed]], axis=1)
    for g, pair in enumerate(rest.pairs[:, :2]):
        s.first[nodes + g + 1] = s.first[nodes + g] + int((ties == pair).all(axis=1).sum())
    for row, values in (
        (kernels.STIFF, strands.stiffness),
        (kernels.LENGTH, strands.length),
        (kernels.YIELD, strands.yield_elongation),
        (kernels.FAILURE, strands.failure_elongation),
        (kernels.BILATERAL, strands.bilateral),
    ):
        s.strand[row] = values[rest.order]
    if floor is not None:
        for tube, each in zip(rest.tubes, floor, strict=True):
            s.floor[tube.nodes, 0] += each
    s.thick[:, 0], s.thick[:, 2] = rest.radius, REACH_OF_RODS
    for tube in rest.tubes:
        widths = np.zeros(tube.nodes.size)
        widths[:-1] += 0.5 * np.diff(tube.stations)
        widths[1:] += 0.5 * np.diff(tube.stations)
        s.thick[tube.nodes, 1] += kernels.CONTACT_STIFFNESS * widths
        radius = rest.network.tubes[tube.name].radius
        s.girth[tube.elements, 0], s.girth[tube.elements, 1] = radius[:-1], radius[1:]
    s.touch[:] = rest.touching.which
    s.reach[:, [kernels.OWN, kernels.STIFFNESS]] = rest.touching.reach
    s.side[:] = kernels.NO_CONTACT
    s.sums[kernels.RETRACED] = retrace
    s.branch[:, :, kernels.TIME] = np.inf
    s.branch[:, :, kernels.STEP] = np.nan  # none yet
    for rows, each in zip(s.branch, relaxation, strict=True):
        if each is not None:
            rows[: len(each.times), kernels.FRACTION] = each.fractions
            rows[: len(each.times), kernels.TIME] = each.times
    kernels.begin(s, 0.0)
    rest.write(s)
    kernels.rest_gaps(s.x, s.ends, s.girth, s.stiff, s.touch, s.reach)
    return s


def _strand_nodes(network: Network, numbered: list[Ints], strands: Strands) -> tuple[Ints, Ints]:
    """Return the nodes that strands hold, and those that their feet are on, -1 for the bed."""
    node, other = np.zeros(strands.count, np.int64), np.full(strands.count, -1)
    for each, name in ((strands.tubes, "tubes"), (strands.to, "to")):
        if each.size and each.max() >= len(numbered):
            raise ValueError(
                f"{name} of strands must be below {len(numbered)}, the tubes there are"
            )
    for number, (beam, nodes) in enumerate(zip(network.tubes.values(), numbered, strict=True)):
        middles = 0.5 * (beam.stations[1:] + beam.stations[:-1])
        for out, tubes, stations in (
            (node, strands.tubes, strands.stations),
            (other, strands.to, strands.to_stations),
        ):
            here = tubes == number
            at = stations[here]
            if at.size and not (at.min() >= -1e-9 and at.max() <= beam.span * (1 + 1e-9)):
                raise ValueError(
                    f"strands must hold the beam from 0 to {beam.span:g} mm, got "
                    f"{at.min():g} to {at.max():g} mm"
                )
            # Half-way between two nodes the even one has it, whose arms are then alike on both
            # sides.
            found = np.searchsorted(middles, at)
            after = np.searchsorted(middles, at + 1e-9 * beam.span)
            before = np.searchsorted(middles, at - 1e-9 * beam.span)
            out[here] = nodes[np.where(after == before, found, after - after % 2)]
    return node, other


def _pairs(node: Ints, other: Ints, order: Elimination) -> tuple[Ints, Ints]:
    """Return the group of each strand, and (G, 4) pairs of nodes between which strands are."""
    count = order.order.size
    ties = other >= 0
    key = node * count + other
    found, number = np.unique(key[ties], return_inverse=True)
    group = node.copy()
    group[ties] = count + number
    pairs = np.stack([found // count, found % count], axis=1)
    blocks = [[order.block(i, j), i > j] for i, j in pairs.tolist()]
    return group, np.concatenate([pairs, np.array(blocks, np.int64).reshape(-1, 2)], axis=1)


def _at_ends(rows: Floats) -> Floats:
    """Return (n - 1, 2, ...) rows at the ends of elements from (n, ...) rows at the nodes."""
    return np.stack([rows[:-1], rows[1:]], axis=1)


def times(a: Floats, b: Floats) -> Floats:
    """Return the product of two quaternions."""
    w, x, y, z = a
    p, q, r, s = b
    return np.array(
        [
            w * p - x * q - y * r - z * s,
            w * q + x * p + y * s - z * r,
            w * r + y * p + z * q - x * s,
            w * s + z * p + x * r - y * q,
        ]
    )


def _relative(of: Floats, to: Floats) -> Floats:
    """Return the quaternion that leads from one rotation to another."""
    return times(of * np.array([1.0, -1.0, -1.0, -1.0]), to)


def _between(x: Floats, slopes: Floats, u: float) -> Floats:
    """Return a place between two on the cubic curve with slopes at both, u from 0 to 1."""
    return (
        x[0] * (1 + 2 * u) * (1 - u) ** 2
        + slopes[0] * u * (1 - u) ** 2
        + x[1] * u * u * (3 - 2 * u)
        - slopes[1] * u * u * (1 - u)
    )
