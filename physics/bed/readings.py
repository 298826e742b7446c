"""What there is to read of a network on its bed: energies, strands, and stresses of the walls."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kernel_cache import SameTypes
from physics.bed import kernels
from physics.bed.layout import Rest, times
from physics.bed.nick import Nick
from physics.quantity import finite

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class EnergyBalance:
    """The energy balance, mJ: the work, and all that it has become.

    work = stored + dissipated + viscous + snap + drag + lag + residual.

    In real time it stands at the beginning of the last tick.
    """

    work: float  # of all hands on the beam and on rods
    stored: float  # in beam, strands, floor, contact and hands' springs
    dissipated: float  # in strands that yielded and parted, by their law
    snap: float  # released in jumps while the hands stand still, by letting go and by tearing
    drag: float  # taken by the drag in real time
    # what free nodes lose besides in real time, one Newton step a tick behind the hands: of either
    # sign, and small unless hands tremble or leap
    lag: float
    residual: float  # what the trapezoidal rule leaves unexplained
    # dissipated by strands and walls that relax; of walls of another law than the linear one once
    # nothing relaxes any more, and meanwhile less what their branches store beyond small strains'
    viscous: float
    rod_work: float  # the part of the work that was done on rods
    rod_dissipated: float  # the part dissipated in strands that lay against a rod


class WorstStress(NamedTuple):
    """The largest normal plus bending stress in the beam's wall."""

    station: float  # mm from the first end
    normal: float  # MPa
    up: float  # of the bending stress, the part of bending up, MPa, and across
    across: float

    @property
    def bending(self) -> float:
        """Bending stress, MPa."""
        return math.sqrt(self.up * self.up + self.across * self.across)

    @property
    def side(self) -> float:
        """Angle at which bending stretches most: rad from up about the axis, positive towards y."""
        return math.atan2(-self.across, self.up)

    @property
    def total(self) -> float:
        """Normal plus bending stress, MPa."""
        return self.normal + self.bending


class Readings:
    """A network on its bed in its last state, to be read.

    A `tube` is named where there are several; the first one is meant by None.

    Attributes
    ----------
    network, beam, strands
        At rest; the beam is the first tube.
    state
        The arrays that the kernels share.
    """

    def __init__(self, rest: Rest, state: kernels.State) -> None:
        self._rest, self.state = rest, state
        self.network, self.strands = rest.network, rest.strands
        self.beam = next(iter(rest.network.tubes.values()))

    @property
    def stations(self) -> Floats:
        """(N,) the nodes' distances from the first end along the axis at rest, mm."""
        return self._rest.stations

    def nodes_of(self, tube: str | None = None) -> NDArray[np.int64]:
        """Return the (n,) numbers of a tube's nodes, along it; tubes that join share one."""
        return self._rest.tube(tube).nodes

    def elements_of(self, tube: str | None = None) -> slice:
        """Return which elements, along the rows of `stresses`, are a tube's."""
        return self._rest.tube(tube).elements

    def element_at(self, station: float, tube: str | None = None) -> int:
        """Return the number of a tube's element at a station, mm, from 0."""
        x, span = self.stations_of(tube), self.network.tubes[self._rest.tube(tube).name].span
        s = finite(station, "a place on a tube", "mm")
        if not 0.0 <= s <= span:
            raise ValueError(f"{s:g} mm is not on the tube, which runs from 0 to {span:g} mm")
        return min(int(np.searchsorted(x, s, side="right")) - 1, x.size - 2)

    def stations_of(self, tube: str | None = None) -> Floats:
        """Return the (n,) stations of a tube's nodes, mm from its first end."""
        return self._rest.tube(tube).stations

    def shape_of(self, tube: str | None = None) -> tuple[Floats, Floats, Floats, Floats]:
        """Return a tube's (n, 3) places and (n, 4) rotations now, and both at rest."""
        # A joined end has the rotation of the node that it shares, turned to the tube's own.
        which, rest = self._rest.tube(tube), self._rest
        x, q, rest_x, rest_q = (
            each[which.nodes] for each in (self.state.x, self.state.q, rest.x, rest.q)
        )
        for end, element in ((0, which.elements.start), (1, which.elements.stop - 1)):
            if which.joined[end]:
                for each in (q, rest_q):
                    each[-end] = times(each[-end], rest.turn[element, end])
        return x, q, rest_x, rest_q

    def section_side(
        self, station: float, direction: Floats, tube: str | None = None
    ) -> tuple[float, float]:
        """Return a direction, (3,), in the section of a tube at a station, mm: up, and along y."""
        q = self.shape_of(tube)[1][np.abs(self.stations_of(tube) - station).argmin()]
        turned = times(times(q * [1.0, -1.0, -1.0, -1.0], np.array([0.0, *direction])), q)
        return float(turned[3]), float(turned[2])

    @property
    def places(self) -> Floats:
        """(N, 3) where the nodes are, mm; a view that the next step changes."""
        return self.state.x

    def places_at(self, stations: Floats, tube: str | None = None) -> Floats:
        """Return (n, 3) where places of a tube are now, straight between its nodes, mm."""
        x, out = self.state.x[self._rest.tube(tube).nodes], np.empty((stations.size, 3))
        for axis in range(3):
            out[:, axis] = np.interp(stations, self.stations_of(tube), x[:, axis])
        return out

    def rest_place(self, node: int) -> Floats:
        """(3,) where a node is at rest, mm."""
        return self._rest.x[node]

    @property
    def rotations(self) -> Floats:
        """(N, 4) the nodes' rotations; a view that the next step changes."""
        return self.state.q

    @property
    def rest_places(self) -> Floats:
        """(N, 3) where the nodes are at rest, mm; not to be written to."""
        return self._rest.x

    @property
    def order(self) -> NDArray[np.intp]:
        """(S,) numbers in `strands` of the strands as they are stored in `state`."""
        return self._rest.order

    @property
    def damage(self) -> Floats:
        """(S,) from 0, whole, to 1, parted, in the order of `strands`."""
        out = np.empty(self.strands.count)
        out[self.order] = self.state.damage
        return out

    @property
    def broken(self) -> int:
        """How many strands have parted."""
        return int((self.state.damage >= 1.0).sum())

    @property
    def broken_by_rods(self) -> int:
        """How many of them lay against a rod when they parted."""
        return int(self.state.sums[kernels.ROD_BROKEN])

    @property
    def freed(self) -> float:
        """Length of beam whose strands have parted, mm: the sum of their tributary lengths."""
        parted = self.order[self.state.damage >= 1.0]
        return float(self.strands.tributary_lengths[parted].sum())

    def freed_of(self, tube: str | None = None) -> float:
        """Return the length of a tube whose strands have parted, mm."""
        number = self._rest.tubes.index(self._rest.tube(tube))
        parted = self.order[self.state.damage >= 1.0]
        mine = parted[self.strands.tubes[parted] == number]
        return float(self.strands.tributary_lengths[mine].sum())

    @cached_property
    def _stored_at(self) -> NDArray[np.int64]:
        """(S,) the columns of `state.strand` of all strands."""
        out = np.empty(self.strands.count, dtype=np.int64)
        out[self.order] = np.arange(self.strands.count)
        return out

    def strand_arms(self, which: NDArray[np.intp] | None = None) -> Floats:
        """(S, 3) from the nodes on the axis to the ends of all strands, or of some, mm."""
        at = self._stored_at if which is None else self._stored_at[which]
        out = np.empty((at.size, 3))
        kernels.turn_arms(self.state.q, self._rest.nodes, self.state.strand, at, out)
        return out

    def strand_ends(self, which: NDArray[np.intp] | None = None) -> Floats:
        """(S, 3) where all strands, or some, hold the beam now, mm."""
        at = self._stored_at if which is None else self._stored_at[which]
        return self.state.x[self._rest.nodes[at]] + self.strand_arms(which)

    def strand_feet(self, which: NDArray[np.intp] | None = None) -> Floats:
        """(S, 3) where the feet of all strands, or of some, are now, mm: on the bed or on tubes."""
        at = self._stored_at if which is None else self._stored_at[which]
        s, others = self.state, self._rest.others
        feet = s.strand[kernels.FOOT_X : kernels.FOOT_Z + 1]
        out = feet[:, at].T.copy()
        on_tubes = np.flatnonzero(others[at] >= 0)
        arms, rows = np.empty((on_tubes.size, 3)), np.zeros_like(s.strand)
        rows[kernels.ARM_X : kernels.ARM_X + 3] = feet
        kernels.turn_arms(s.q, others, rows, at[on_tubes], arms)
        out[on_tubes] = s.x[others[at[on_tubes]]] + arms
        return out

    def sides_of(self, rod: int) -> NDArray[np.int8]:
        """(S,) on which side each strand goes round a rod, or did when it parted, 0 if on neither.

        Returns
        -------
        NDArray[np.int8]
            1 where u . (a x b) > 0 as they met, of the rod's direction u, and a and b from its axis
            to the strand's end and foot; -1 on the other side.
        """
        sides, out = self.state.side[rod], np.zeros(self.strands.count, dtype=np.int8)
        out[self.order] = np.where(np.abs(sides) == 1, sides, 0)
        return out

    def touched_by(self, rod: int) -> NDArray[np.bool_]:
        """(S,) whether each strand touches a rod, or did so when it parted."""
        return self.sides_of(rod) != 0

    def hand_force(self, node: int) -> Floats:
        """(3,) force of the hand on a node, N."""
        return self.state.react[node] + self.state.load[node]

    def rod_force(self, rod: int) -> Floats:
        """(3,) force of the hand on a rod, N."""
        return self.state.pull[rod].copy()

    def nicks_of(self, tube: str | None = None) -> tuple[Nick, ...]:
        """Return the tears that go part of the way through a tube."""
        name = self._rest.tube(tube).name
        return tuple(each for each in self._rest.nicks if each.tube == name)

    @property
    def energy(self) -> EnergyBalance:
        """The energy balance."""
        sums: list[float] = self.state.sums.tolist()
        work, stored = sums[kernels.WORK], sums[kernels.STORED]
        dissipated, snap, drag = sums[kernels.DISSIPATED], sums[kernels.SNAP], sums[kernels.DRAG]
        lag, viscous = sums[kernels.LAG], sums[kernels.VISCOUS]
        return EnergyBalance(
            work,
            stored,
            dissipated,
            snap,
            drag,
            lag,
            residual=work - (stored + dissipated + viscous + snap + drag + lag),
            viscous=viscous,
            rod_work=sums[kernels.ROD_WORK],
            rod_dissipated=sums[kernels.ROD_DISSIPATED],
        )

    def stresses(self) -> Floats:
        """Return the (N - 1, 2, 3) stresses of the wall at both ends of each element, MPa."""
        # Nominal, forces over areas at rest: normal, and of bending at the outermost fibres up and
        # across the beam. Above zero, bending stretches the side up and the one away from y.
        wall, section = self.walls, self.state.section
        rows = None if self._rest.fibres is None else self._rest.fibres[1]
        if self._rest.nicks:
            section, wall = section.copy(), wall.copy()
            rows = None if rows is None else rows.copy()
            for nick in self._rest.nicks:
                self._take_ligament(nick, section, wall, rows)
        out = np.empty((section.shape[0], 2, 3))
        if rows is not None:
            kernels.end_stresses(section, self.state.strained, rows, wall, out)
        else:
            _NOMINAL(section, wall, out)
        for nick in self._rest.nicks:
            for e, end, _ in self._at_nick(nick):
                out[e, end, 1], out[e, end, 2] = nick.back(out[e, end, 1], out[e, end, 2])
        return out

    def _at_nick(self, nick: Nick) -> list[tuple[int, int, float]]:
        """Return elements at a tear, their ends nearest to it, and where it is on them, 0 to 1."""
        x, first = self.stations_of(nick.tube), self.elements_of(nick.tube).start
        e = self.element_at(nick.station, nick.tube)
        u = (nick.station - float(x[e])) / float(x[e + 1] - x[e])
        found = [(first + e, int(u > 0.5), u)]
        if e > 0 and nick.station == x[e]:
            found.append((first + e - 1, 1, 1.0))
        return found

    def _take_ligament(
        self, nick: Nick, section: Floats, wall: Floats, rows: Floats | None
    ) -> None:
        """Let elements at a tear have the moments, moduli and fibres of what bears there."""
        # Away from it, what the tube's own section would have.
        left, ring = nick.left, nick.section
        here = {e: (end, u) for e, end, u in self._at_nick(nick)}
        for e, _ in self._rest.weak(nick):
            moments = section[e, [4, 7]], section[e, [5, 8]]
            section[e, [4, 7]], section[e, [5, 8]] = nick.back(*moments)
            if e not in here:
                continue
            end, u = here[e]
            opening, sideways = ((1.0 - u) * each[0] + u * each[1] for each in moments)
            opening += left.shift * section[e, 9 + end]
            section[e, 4 + 3 * end], section[e, 5 + 3 * end] = opening, sideways
            # Distances of the front, or of the fibre opposite where the tear closes, and of the
            # ligament's widest fibre, in those of the whole section.
            edge = left.front_distance if opening >= 0.0 else left.back_distance
            edges = [2.0 * each / ring.height for each in (edge, left.half_width)]
            area, up, across = (
                each / whole
                for each, whole in (
                    (left.area, ring.area),
                    (left.second_moment, ring.second_moment),
                    (left.across, ring.second_moment),
                )
            )
            whole = nick.whole(float(wall[e, end, 1]), float(wall[e, end, 2]))
            wall[e, end] = (
                area * wall[e, end, 0], whole[0] * up / edges[0], whole[1] * across / edges[1],
            )  # fmt: skip
            if rows is not None:
                row = rows[e, end]
                row[kernels.STRENGTH] *= area
                row[kernels.REACH_2] *= math.sqrt(up / area)
                row[kernels.REACH_3] *= math.sqrt(across / area)
                row[kernels.OUTER_2] *= edges[0]
                row[kernels.OUTER_3] *= edges[1]

    @property
    def nominal(self) -> bool:
        """Whether all stresses are forces over areas: of linear walls none of which is nicked."""
        return not self._rest.nicks and self._rest.fibres is None

    def worst_stresses(self) -> list[WorstStress]:
        """Return the largest stress over the nodes of each tube's wall, in order."""
        tubes = self._rest.tubes
        found = np.empty((len(tubes), 4))
        _WORST(self.stresses(), self.first_elements, found)
        return [
            WorstStress(float(tube.stations[int(node)]), normal, up, across)
            for tube, (node, normal, up, across) in zip(tubes, found.tolist(), strict=True)
        ]

    @cached_property
    def first_elements(self) -> NDArray[np.int64]:
        """(T + 1,) the first element of each tube, and where the last one's end."""
        return np.array([0, *(each.elements.stop for each in self._rest.tubes)])

    def worst_stress(self, tube: str | None = None) -> WorstStress:
        """Return the largest stress of a tube's wall over its nodes."""
        return self.worst_stresses()[self._rest.tubes.index(self._rest.tube(tube))]

    @property
    def walls(self) -> Floats:
        """(E, 2, 3) what forces and moments at the elements' ends are divided by: mm^2, mm^3."""
        if self._rest.wall is None:
            raise ValueError("the beam has no wall from which stresses could be read")
        return self._rest.wall

    @cached_property
    def _tightest(self) -> float:
        """The largest stiffness of the strands at one node, N/mm."""
        stiffness, rest = self.state.strand[kernels.STIFF], self._rest
        ends = np.bincount(rest.nodes, stiffness, self.stations.size)
        feet = np.bincount(rest.others + 1, stiffness, self.stations.size + 1)[1:]
        return float((ends + feet).max(initial=0.0))

    @property
    def rounding(self) -> float:
        """Error of forces from places rounded to their last digit, N."""
        s = self.state
        beam = float(s.stiff[:, :3].max()) / float(s.h.min())
        return 1e-15 * max(beam, self._tightest) * self.network.span


_NOMINAL, _WORST = SameTypes(kernels.nominal_stresses), SameTypes(kernels.worst_stresses)
