"""A beam on its bed, held by hands: solved step by step, in equilibrium or in real time.

`kernels` has energy, tangent and solver; docs/theory.md and docs/peel.md have the equations and the
scenes. Here a step towards the hands' targets is divided into substeps whose energy is accounted
for (`BeamOnBed.advance`):

    W = sum (f_0 + f_1)/2 . dx      trapezoidal rule, over all hands on the beam and on rods
    W - (U_1 - U_0) - D             missing: U stored energy, D dissipated by the strands' law
    sum |f_1 - f_0| |dx| / 2        what W is unsure by, if a force jumped in between

A substep is accepted if what is missing is within `OPEN` of its work, or if a jump of the force
could change no more than `OPEN` / 100 of all work so far: what is missing was then released in a
jump (`snap`). Otherwise it is repeated at `SHORTER` of its length, and at half where no equilibrium
was found, down to `SHORTEST` of the step.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kernel_cache import SameTypes, njit
from physics.bed import kernels
from physics.bed.space_beam import HELD, SpaceBeam
from physics.bed.strands import Strands
from physics.equilibrium import NoEquilibrium
from physics.quantity import finite, positive

__all__ = ["BeamOnBed", "EnergyBalance", "WorstStress"]

Floats = NDArray[np.float64]

CONTACT = 1.6
"""Stiffness with which a rod is kept off the beam, N/mm for each mm of beam."""
# How far from the beam's surface and the rod's a strand may still touch the rod, mm.
REACH_OF_RODS = 12.0
# How often strands may slip off rods in one substep, each time with another equilibrium.
MOST_SLIPS = 50
# Bits of what is held in the plane of x and z: y, and turning about x and z.
IN_PLANE = 2 + 8 + 32
# Part of an element's shear flexibility that stands for bending within it, from which on it is
# stretched along its chord.
THIN = 0.5
# Largest force out of balance over the largest in the beam; part of the work that may stay
# unexplained.
TOLERANCE, OPEN = 1e-9, 1e-5
# Factors of a substep whose energy does not balance, and of one after an eighth of that error.
SHORTER, LONGER = 0.2, 3.0
SHORTEST = 0.5**24
# Rounding over E I / span^2, a force that bends the beam, from which on searches may fail.
TOO_STIFF = 1e-4
# s, by which damage in real time lags behind its law: pulls are 1.6 % too large at 5 mm/s in a firm
# bed. Drag at each node, N s/mm: 0.03 % of the work at 20 mm/s, enough to turn a jump into a short
# slide.
DELAY, DRAG = 5e-3, 2e-6
EVERYWHERE = (True, True, True)


@dataclass(frozen=True, slots=True)
class EnergyBalance:
    """The energy balance, mJ: work = stored + dissipated + snap + drag + residual.

    In real time it stands at the beginning of the last tick.
    """

    work: float  # of all hands on the beam and on rods
    stored: float  # in beam, strands, floor, contact and hands' springs
    dissipated: float  # in strands that yielded and parted, by their law
    snap: float  # released in jumps while the hands stand still, by letting go and by tearing
    drag: float  # taken by the drag in real time
    residual: float  # what the trapezoidal rule leaves unexplained
    rod_work: float  # the part of the work that was done on rods
    rod_dissipated: float  # the part dissipated in strands that lay against a rod


@dataclass(frozen=True, slots=True)
class WorstStress:
    """The largest normal plus bending stress in the beam's wall."""

    station: float  # mm from the first end
    normal: float  # MPa
    bending: float  # MPa
    # angle about the axis at which bending stretches most: rad from up, positive towards y
    side: float

    @property
    def total(self) -> float:
        """Normal plus bending stress, MPa."""
        return self.normal + self.bending


class _Balance(NamedTuple):
    """Forces of hands on what they hold, push and sweep, where these are, and stored energy."""

    holds: Floats
    loads: Floats
    pulls: Floats
    goals: Floats
    places: Floats
    tips: Floats
    stored: float


class BeamOnBed:
    """A beam in space on strands, in its last state, from which the next one is found.

    Hooks hold nodes: by displacement (`take`, `lead`), through a spring (`take` with a stiffness)
    or by a force (`push`). Rods push strands aside (`set_rod`). These calls set targets; the next
    `advance` reaches them through equilibria, the next `tick` in real time. Not for two threads at
    once; the compiled steps let other threads run meanwhile.

    Parameters
    ----------
    beam
        The beam at rest.
    strands
        Its strands, if it has any.
    floor
        (N,) stiffness with which the bed pushes back nodes that lie deeper than at rest, N/mm.
    rods
        How many rods there may be.
    plane
        Whether nothing moves along y, nor turns about x and z.
    retrace
        Whether real-time ticks whose energy the trapezoidal rule leaves open are followed along
        their way in shorter parts, some milliseconds in the worst of them. What moves is the same.
    """

    def __init__(
        self,
        beam: SpaceBeam,
        strands: Strands | None = None,
        *,
        floor: Floats | None = None,
        rods: int = 0,
        plane: bool = False,
        retrace: bool = False,
    ) -> None:
        strands = Strands.none() if strands is None else strands
        nodes, elements = beam.stations.size, beam.stations.size - 1
        if strands.count and not (
            strands.stations.min() >= -1e-9 and strands.stations.max() <= beam.span * (1 + 1e-9)
        ):
            raise ValueError(
                f"strands must hold the beam from 0 to {beam.span:g} mm, got "
                f"{strands.stations.min():g} to {strands.stations.max():g} mm"
            )
        self.beam = beam
        self._stations = beam.stations.copy()
        self._rest_x = beam.places.copy()
        self._rest_q = beam.rotations.copy()
        self._elastic = beam.stiffness.copy()
        x = self._stations
        middles = 0.5 * (x[1:] + x[:-1])
        node = np.searchsorted(middles, strands.stations)
        # Half-way between two nodes the even one has it, whose arms are then alike on both sides.
        after = np.searchsorted(middles, strands.stations + 1e-9 * beam.span)
        before = np.searchsorted(middles, strands.stations - 1e-9 * beam.span)
        node = np.where(after == before, node, after - after % 2)
        order = np.argsort(node, kind="stable")
        self._order = order
        self.strands = strands
        self._node, self._strand_nodes = node[order], node
        blank = np.zeros
        table = blank((kernels.STRAND_ROWS, strands.count))
        for row, values in (
            (kernels.STIFF, strands.stiffness),
            (kernels.LENGTH, strands.length),
            (kernels.YIELD, strands.yield_elongation),
            (kernels.FAILURE, strands.failure_elongation),
            (kernels.BILATERAL, strands.bilateral),
        ):
            table[row] = values[order]
        table[kernels.FOOT_X : kernels.FOOT_Z + 1] = strands.feet[order].T
        thick = blank((nodes, 3))
        widths = np.zeros(nodes)
        widths[:-1] += 0.5 * np.diff(x)
        widths[1:] += 0.5 * np.diff(x)
        thick[:, 0], thick[:, 1], thick[:, 2] = beam.radius, CONTACT * widths, REACH_OF_RODS
        ground = blank((nodes, 2))
        if floor is not None:
            ground[:, 0] = floor
        held = blank(nodes, np.int64)
        held[0], held[-1] = HELD[beam.ends[0]], HELD[beam.ends[1]]
        if plane:
            held |= IN_PLANE
        self._ends = held.copy()
        three, six, chain = (nodes, 3), (nodes, 6), np.arange(nodes)
        self.state = kernels.State(
            x=self._rest_x.copy(),
            q=self._rest_q.copy(),
            goal=self._rest_x.copy(),
            held=held,
            load=blank(three),
            spring=blank(three),
            # One branch: each node's parent is the next one.
            parent=np.append(chain[1:], -1),
            child=chain - 1,
            sibling=np.full(nodes, -1),
            ends=np.stack([chain[:-1], chain[1:]], axis=1),
            h=np.diff(x),
            stiff=blank((elements, 6)),
            strain=blank((elements, 6)),
            chord=blank((elements, 2)),
            wall=blank((0, kernels.WALL_ROWS)) if beam.fibres is None else beam.fibres[0].copy(),
            strained=blank((0 if beam.fibres is None else elements, 4)),
            fibres=np.ones(
                (kernels.FIBRE_ROWS, 0 if beam.fibres is None else kernels.FIBRES * elements)
            ),
            first=np.searchsorted(self._node, np.arange(nodes + 1)).astype(np.int64),
            strand=table,
            damage=blank(strands.count),
            floor=ground,
            thick=thick,
            rods=blank((rods, kernels.ROD_ROWS)),
            side=np.full((rods, strands.count), kernels.NO_CONTACT, dtype=np.int64),
            pull=blank((rods, 3)),
            section=blank((elements, 11)),
            g=blank(six),
            step=blank(six),
            diagonal=blank((nodes, 6, 6)),
            upper=blank((nodes, 6, 6)),
            diagonal_kept=blank((nodes, 6, 6)),
            upper_kept=blank((nodes, 6, 6)),
            x_kept=blank(three),
            q_kept=blank((nodes, 4)),
            goal_from=self._rest_x.copy(),
            goal_to=self._rest_x.copy(),
            load_from=blank(three),
            load_to=blank(three),
            rods_from=blank((rods, kernels.ROD_ROWS)),
            rods_to=blank((rods, kernels.ROD_ROWS)),
            hold=blank(six),
            react=blank(three),
            press=blank((rods, 3)),
            damage_correction=blank(six),
            rods_damage_correction=blank((rods, 3)),
            moved=blank(six),
            g_before=blank(six),
            load_before=blank(three),
            pull_before=blank((rods, 3)),
            g_middle=blank(six),
            pull_middle=blank((rods, 3)),
            damage_before=blank(strands.count),
            side_before=blank((rods, strands.count), np.int64),
            damage_ahead=blank(strands.count),
            sums=blank(kernels.SUM_ROWS),
        )
        self.state.sums[kernels.RETRACED] = retrace
        self._gross = 0.0
        # The largest stiffness of the strands at one node, N/mm.
        self._tightest = float(
            np.bincount(self._node, table[kernels.STIFF], minlength=nodes).max(initial=0.0)
        )
        self._measure_rest()

    def _measure_rest(self) -> None:
        """Write what follows from the nodes' places at rest: strains, stiffnesses, arms."""
        s = self.state
        s.h[:] = np.diff(self._stations)
        kernels.set_rest(self._rest_x, self._rest_q, s.ends, s.h, s.strain)
        s.floor[:, 1] = self._rest_x[:, 2]
        s.stiff[:] = self._elastic
        s.chord[:] = 0.0
        # One shear strain an element leaves bending out, h^2/(12 E I), which is added to its shear
        # flexibility [MacNeal 1978]: under forces at the nodes a straight element is then exact at
        # small loads.
        whole = self._elastic[:, 0] > 0.0
        for shear, bending in ((1, 5), (2, 4)):
            within = s.h[whole] ** 2 / (12.0 * self._elastic[whole, bending])
            s.stiff[whole, shear] = 1.0 / (1.0 / self._elastic[whole, shear] + within)
            inner = s.stiff[whole, shear] * within
            s.chord[whole, shear - 1] = np.where(inner > THIN, inner * inner, 0.0)
        if self.beam.fibres is not None:
            if s.chord.any():
                longest = float(s.h[s.chord.any(axis=1)].max())
                raise ValueError(
                    f"elements of {longest:g} mm are too long for fibres in so thin a beam: give "
                    "more elements, or the linear law"
                )
            s.wall[:, kernels.SOFT] = 0.0
            s.wall[whole, kernels.SOFT] = s.stiff[whole, 1] / self._elastic[whole, 1]
            s.wall[~whole, kernels.STRENGTH] = 0.0
        ends = self.strands.ends[self._order] - self._rest_x[self._node]
        w, x, y, z = self._rest_q[self._node].T
        turn = np.stack(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
        s.strand[kernels.ARM_X : kernels.ARM_Z + 1] = np.einsum("kri,ik->ri", turn, ends)

    # Hands

    def node_at(self, station: float) -> int:
        """Return the node nearest a station that no other hook holds."""
        s = finite(station, "a hook's place", "mm")
        if not 0.0 <= s <= self.beam.span:
            raise ValueError(
                f"a hook at {s:g} mm is not on the beam, which runs from 0 to {self.beam.span:g} mm"
            )
        node = int(np.argmin(np.abs(self._stations - s)))
        if self._ends[node] & 7 == 7:
            raise ValueError(f"a hook at {s:g} mm is behind a clamp or on a pin: it holds already")
        if self.held[node]:
            raise ValueError(f"two hooks are on top of one another at {s:g} mm")
        return node

    @property
    def held(self) -> NDArray[np.bool_]:
        """(N,) whether a hook holds the node."""
        s = self.state
        return (
            (s.held != self._ends) | (s.spring != 0.0).any(axis=1) | (s.load_to != 0.0).any(axis=1)
        )

    def take(
        self,
        station: float,
        *,
        stiffness: float = math.inf,
        along: tuple[bool, bool, bool] = EVERYWHERE,
    ) -> int:
        """Take hold of the beam where it now is, by displacement."""
        # An inner node moves to the station, along the axis as it lies and at rest: a hook inside
        # an element would stiffen the beam, by 2.3 % in force at 40 elements. A finite `stiffness`,
        # N/mm, is that of a spring between hand and beam; the beam slides along the axes not in
        # `along`.
        node = self.node_at(station)
        if not stiffness > 0.0:
            raise ValueError(f"a hand's spring must be above 0 N/mm, got {stiffness}")
        self._account()
        if abs(self._stations[node] - station) > 1e-9 * self.beam.span:
            self._move_node(node, station)
        s = self.state
        s.goal[node] = s.goal_from[node] = s.goal_to[node] = s.x[node]
        for r in range(3):
            if self._ends[node] >> r & 1:
                continue
            if along[r] and math.isinf(stiffness):
                s.held[node] |= 1 << r
            elif along[r]:
                s.spring[node, r] = stiffness
        return node

    def let_go(self, node: int) -> None:
        """Let go of a node that is held or pushed; a hand's spring loses its energy."""
        s = self.state
        self._account()
        s.held[node] = self._ends[node]
        s.spring[node] = s.load[node] = s.load_to[node] = s.load_from[node] = 0.0
        self.state.sums[kernels.SNAP] -= self._changed()

    def lead(self, node: int, place: Sequence[float] | Floats) -> None:
        """Set the target of a held node, mm."""
        self.state.goal_to[node] = _three(place, "a hand's target", "mm")

    def push(self, node: int, force: Sequence[float] | Floats) -> None:
        """Set the target of the dead force on a node, N."""
        self.state.load_to[node] = _three(force, "a force", "N")

    def hand_force(self, node: int) -> Floats:
        """(3,) force of the hand on a node, N."""
        return self.state.react[node] + self.state.load[node]

    def set_rod(
        self, rod: int, tip: Sequence[float] | Floats, shaft: Sequence[float], radius: float
    ) -> None:
        """Place a rod: its tip, mm, direction back along the shaft, radius, mm."""
        direction = np.array(_three(shaft, "a rod's direction", "mm"))
        length = float(np.sqrt((direction**2).sum()))
        if length == 0.0:
            raise ValueError("a rod's direction must not be zero")
        thick = positive(radius, "a rod's radius", "mm")
        row = np.array([*_three(tip, "a rod's tip", "mm"), *(direction / length), thick, 1.0])
        self._account()
        for rods in (self.state.rods, self.state.rods_from, self.state.rods_to):
            rods[rod] = row
        self.state.side[rod] = kernels.NO_CONTACT
        kernels.update_rod_contacts(self.state, True)
        # Should it touch anything already, that is the hand's work.
        work = self._changed()
        self.state.sums[kernels.WORK] += work
        self.state.sums[kernels.ROD_WORK] += work

    def lead_rod(self, rod: int, tip: Sequence[float] | Floats) -> None:
        """Set the target of a rod's tip, mm."""
        self.state.rods_to[rod, :3] = _three(tip, "a rod's tip", "mm")

    def withdraw_rod(self, rod: int) -> None:
        """Remove a rod at once."""
        self._account()
        for rods in (self.state.rods, self.state.rods_from, self.state.rods_to):
            rods[rod, kernels.IN_USE] = 0.0
        self.state.side[rod] = kernels.NO_CONTACT
        self.state.sums[kernels.SNAP] -= self._changed()

    def rod_force(self, rod: int) -> Floats:
        """(3,) force of the hand on a rod, N."""
        return self.state.pull[rod].copy()

    def touched_by(self, rod: int, *, including_no_contact: bool = False) -> NDArray[np.bool_]:
        """(S,) whether each strand touches a rod, or did so when it parted."""
        # `including_no_contact`: also those that it has not met, or that have slipped off.
        out = np.empty(self.strands.count, dtype=np.bool_)
        side = self.state.side[rod]
        out[self._order] = side != 0 if including_no_contact else np.abs(side) == 1
        return out

    def break_between(self, from_mm: float, to_mm: float) -> None:
        """Part the strands of a stretch beforehand, with no work; its beam is at rest."""
        at = self.strands.stations[self._order]
        self.state.damage[(at >= from_mm) & (at <= to_mm)] = 1.0
        self.state.sums[kernels.AHEAD] = 0.0

    def rod_contact(self, rod: int) -> Floats:
        """(3,) the part of that force that presses the rod against the beam itself, N."""
        return self.state.press[rod].copy()

    def tear(self, station: float) -> int:
        """Take all stiffness from the element at a station; return its number, from 0."""
        # At a node, of the two elements the one under the larger stress there. Both pieces go on
        # hanging on their strands and hooks; the element's energy is booked as released.
        s = finite(station, "the place of a tear", "mm")
        if not 0.0 <= s <= self.beam.span:
            raise ValueError(
                f"a tear at {s:g} mm is not on the beam, which runs from 0 to {self.beam.span:g} mm"
            )
        self._account()
        x = self._stations
        element = min(int(np.searchsorted(x, s, side="right")) - 1, x.size - 2)
        if element > 0 and s == x[element]:
            moment = np.sqrt((self.state.section[:, [4, 5, 7, 8]] ** 2).sum(axis=1))
            if moment[element - 1] > moment[element]:
                element -= 1
        self._elastic[element] = 0.0
        self._measure_rest()
        self.state.sums[kernels.SNAP] -= self._changed()
        return element

    def _account(self) -> None:
        """Bring the energy balance up to now, before hands or the beam change."""
        kernels.account(self.state, kernels.FROZEN, 0.0)

    def _changed(self) -> float:
        """Account for a change without motion; return the energy that it has added, mJ."""
        sums = self.state.sums
        before = float(sums[kernels.STORED])
        self._account()
        return float(sums[kernels.STORED]) - before

    # Steps

    def advance(self) -> None:
        """Advance to the hands' targets through equilibria, independent of any rate."""
        s = self.state
        self._account()
        s.goal_from[:], s.load_from[:], s.rods_from[:] = s.goal, s.load, s.rods
        far = 1e3 * self.beam.span + float(np.abs(self._rest_x).max())
        # Forces are known only to the tolerance of the equilibrium.
        noise = 2.0 * self.rounding
        before = self._balance()
        done, size, largest = 0.0, 1.0, 1.0
        # A rod goes no farther at once than half its radius, lest it should jump over a strand.
        for a, b in zip(s.rods_from, s.rods_to, strict=True):
            if b[kernels.IN_USE]:
                distance = float(np.sqrt(((b[:3] - a[:3]) ** 2).sum()))
                if distance > 0.0:
                    largest = min(largest, 0.5 * b[kernels.RADIUS] / distance)
        while done < 1.0:
            size = min(size, largest, 1.0 - done)
            back = tuple(each.copy() for each in (s.x, s.q, s.damage, s.side, s.sums))
            self._set_goals(done + size)
            settled = self._settle()
            if settled is None:
                s.x[:], s.q[:], s.damage[:], s.side[:], s.sums[:] = back
                if size > SHORTEST:
                    size *= 0.5
                    continue
                self._set_goals(done)
                kernels.assemble(s, kernels.FROZEN, 0.0)
                doubt = ""
                lost = self.rounding / (float(s.stiff[:, 4:].max()) / self.beam.span**2)
                if lost > TOO_STIFF:
                    enough = float(s.stiff[:, :3].max()) * TOO_STIFF / lost
                    doubt = (
                        f": the beam is so stiff that forces below {self.rounding:.1g} N are "
                        f"rounding; {enough:.1g} N along it and in shear are as good as rigid"
                    )
                elif s.load_to.any():
                    doubt = ": does anything hold the beam against its force?"
                raise NoEquilibrium(
                    f"no equilibrium was found near the last one, however small the step{doubt}"
                )
            lost, entered, slipped = settled
            after = self._balance()
            # The trapezoidal rule and its uncertainty, if the forces jumped in between.
            moved = (
                after.goals - before.goals,
                after.places - before.places,
                after.tips - before.tips,
            )
            sides = (
                (before.holds, after.holds, moved[0]),
                (before.loads, after.loads, moved[1]),
                (before.pulls, after.pulls, moved[2]),
            )
            each = [0.5 * (a + b) * w for a, b, w in sides]
            work = sum(float(term.sum()) for term in each) + entered
            gross = entered + sum(float(np.abs(term).sum()) for term in each)
            unsure = sum(0.5 * float(np.abs((b - a) * w).sum()) for a, b, w in sides)
            missing = work - (after.stored - before.stored) - lost - slipped
            total = self._gross + gross
            # Noise of forces works where hands lead: free nodes stay where they balance.
            led = (moved[0], moved[1][after.loads != 0.0], moved[2])
            far_each = sum(float(np.abs(w).sum()) for w in led)
            least = 0.01 * OPEN * OPEN * total + noise * far_each + 1e-14 * after.stored
            close = abs(missing) <= OPEN * gross + least
            # A jump releases energy. Where some came from nowhere, another equilibrium than the one
            # that the beam would have moved to was found.
            sure = unsure <= 0.01 * OPEN * total + noise * far_each
            jump = sure and missing > -OPEN * total
            if not (close or jump) and size > SHORTEST:
                s.x[:], s.q[:], s.damage[:], s.side[:], s.sums[:] = back
                size *= SHORTER
                continue
            done += size
            self._gross = total
            s.sums[kernels.WORK] += work
            s.sums[kernels.ROD_WORK] += float(each[2].sum()) + entered
            s.sums[kernels.STORED] = after.stored
            s.sums[kernels.DISSIPATED] += lost
            s.sums[kernels.SNAP] += slipped + (missing if not close and missing > 0.0 else 0.0)
            before = after
            s.react[:] = after.holds
            if np.abs(s.x).max() > far:
                raise NoEquilibrium("the forces carry the beam away: nothing holds it any more")
            if abs(missing) <= 0.125 * OPEN * gross + least:
                size *= LONGER
        s.moved[:] = 0.0
        s.goal_from[:], s.rods_from[:], s.pull_before[:] = s.goal, s.rods, s.pull

    def _set_goals(self, fraction: float) -> None:
        """Interpolate goals, dead forces and rods towards their targets."""
        s = self.state
        s.goal[:] = s.goal_from + fraction * (s.goal_to - s.goal_from)
        s.load[:] = s.load_from + fraction * (s.load_to - s.load_from)
        s.rods[:] = s.rods_from + fraction * (s.rods_to - s.rods_from)

    def _settle(self) -> tuple[float, float, float] | None:
        """Find equilibrium and damage at the goals, None if lost."""
        # The energies, mJ, that strands dissipate, that rods put into strands which their tips
        # come upon, and that strands which slip off release.
        lost = 0.0
        entered, slipped = self._meet(first=True)
        for _ in range(MOST_SLIPS):
            more = self._balanced()
            if more is None:
                return None
            lost += more
            put, released = self._meet(first=False)
            if put == released == 0.0:
                return lost, entered, slipped
            entered, slipped = entered + put, slipped + released
        return None

    def _meet(self, *, first: bool) -> tuple[float, float]:
        """Let strands meet rods or slip off; return the energies put in and released, mJ."""
        s = self.state
        if not s.rods[:, kernels.IN_USE].any():
            return 0.0, 0.0
        before = kernels.assemble(s, kernels.INCREMENTAL, 0.0)
        if kernels.update_rod_contacts(s, first) == 0:
            return 0.0, 0.0
        change = kernels.assemble(s, kernels.INCREMENTAL, 0.0) - before
        return max(change, 0.0), max(-change, 0.0)

    def _balanced(self) -> float | None:
        """Find equilibrium and damage with strands on rods as they are; the energy dissipated."""
        s = self.state
        # The tangent of strands that end near a rod is not exact: the last digits come slowly.
        floor = self.rounding + (1e-9 if s.rods[:, kernels.IN_USE].any() else 0.0)
        if kernels.equilibrium(s, kernels.INCREMENTAL, TOLERANCE, floor, 2000) >= 0:
            return kernels.yielded(s)
        # Slower and more robust: equilibrium under fixed damage, then damage by its law, in turn.
        lost = 0.0
        for _ in range(4000):
            if kernels.equilibrium(s, kernels.FROZEN, TOLERANCE, floor, 2000) < 0:
                return None
            more = kernels.yielded(s)
            lost += more
            if more <= 1e-12 * lost:
                return lost
        return None

    def _balance(self) -> "_Balance":
        """Return forces, places and stored energy at the present state, with damage fixed."""
        s = self.state
        kernels.assemble(s, kernels.FROZEN, 0.0)
        stored = s.sums[kernels.BEAM] + s.sums[kernels.STRANDS] + s.sums[kernels.CONTACT]
        bits = (s.held[:, None] >> np.arange(3)) & 1
        holds = np.where(bits, s.g[:, :3], s.spring * (s.goal - s.x))
        return _Balance(
            holds,
            s.load.copy(),
            s.pull.copy(),
            s.goal.copy(),
            s.x.copy(),
            s.rods[:, :3].copy(),
            float(stored),
        )

    @property
    def rounding(self) -> float:
        """Error of forces from places rounded to their last digit, N."""
        s = self.state
        beam = float(s.stiff[:, :3].max()) / float(s.h.min())
        return 1e-15 * max(beam, self._tightest) * self.beam.span

    def tick(self, seconds: float, *, ticks: int = 1) -> None:
        """Advance in real time towards the hands' targets, at a fixed cost."""
        if ticks < 1:
            raise ValueError(f"a tick must be divided into 1 part or more, got {ticks}")
        step = positive(seconds, "a tick", "s") / ticks
        if not _TICK(self.state, ticks, step / (DELAY + step), DRAG / step):
            raise NoEquilibrium("the beam is lost: no step makes its energy less")

    def assemble_ahead(self, seconds: float) -> None:
        """Do what the next `tick` of so many seconds does wherever hands lead; the same bits."""
        step = positive(seconds, "a tick", "s")
        _AHEAD(self.state, step / (DELAY + step))

    # What there is to read

    @property
    def stations(self) -> Floats:
        """(N,) the nodes' distances from the first end along the axis at rest, mm."""
        return self._stations

    @property
    def places(self) -> Floats:
        """(N, 3) where the nodes are, mm; a view that the next step changes."""
        return self.state.x

    def rest_place(self, node: int) -> Floats:
        """(3,) where a node is at rest, mm."""
        return self._rest_x[node]

    @property
    def rotations(self) -> Floats:
        """(N, 4) the nodes' rotations; a view that the next step changes."""
        return self.state.q

    @property
    def rest_places(self) -> Floats:
        """(N, 3) where the nodes are at rest, mm; not to be written to."""
        return self._rest_x

    @property
    def rest_rotations(self) -> Floats:
        """(N, 4) the nodes' rotations at rest; not to be written to."""
        return self._rest_q

    @property
    def order(self) -> NDArray[np.intp]:
        """(S,) numbers in `strands` of the strands as they are stored in `state`."""
        return self._order

    @property
    def damage(self) -> Floats:
        """(S,) from 0, whole, to 1, parted, in the order of `strands`."""
        out = np.empty(self.strands.count)
        out[self._order] = self.state.damage
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
        if not hasattr(self, "_tributary"):
            self._tributary = self.strands.tributary_lengths[self._order]
        return float(self._tributary[self.state.damage >= 1.0].sum())

    def strand_ends(self) -> Floats:
        """(S, 3) where strands hold the beam now, mm, in the order of `strands`."""
        return self.state.x[self._strand_nodes] + self.strand_arms()

    def strand_arms(self) -> Floats:
        """(S, 3) from the nodes on the axis to the strands' ends, mm, in the order of `strands`."""
        s = self.state
        w, x, y, z = s.q[self._node].T
        a, b, c = s.strand[kernels.ARM_X : kernels.ARM_Z + 1]
        out = np.empty((self.strands.count, 3))
        out[self._order] = np.stack(
            [
                (1 - 2 * (y * y + z * z)) * a + 2 * (x * y - w * z) * b + 2 * (x * z + w * y) * c,
                2 * (x * y + w * z) * a + (1 - 2 * (x * x + z * z)) * b + 2 * (y * z - w * x) * c,
                2 * (x * z - w * y) * a + 2 * (y * z + w * x) * b + (1 - 2 * (x * x + y * y)) * c,
            ],
            axis=1,
        )
        return out

    @property
    def stored_in_beam(self) -> float:
        """Elastic energy of the beam alone, mJ."""
        return float(self.state.sums[kernels.BEAM])

    @property
    def energy(self) -> EnergyBalance:
        """The energy balance."""
        sums: list[float] = self.state.sums.tolist()
        work, stored = sums[kernels.WORK], sums[kernels.STORED]
        dissipated, snap, drag = sums[kernels.DISSIPATED], sums[kernels.SNAP], sums[kernels.DRAG]
        return EnergyBalance(
            work,
            stored,
            dissipated,
            snap,
            drag,
            residual=work - (stored + dissipated + snap + drag),
            rod_work=sums[kernels.ROD_WORK],
            rod_dissipated=sums[kernels.ROD_DISSIPATED],
        )

    def stresses(self) -> Floats:
        """Return the (N - 1, 2, 3) stresses of the wall at both ends of each element, MPa."""
        # Normal, and of bending at the outermost fibres up and across the beam: above zero, bending
        # stretches the side up and the one away from y.
        wall, section = self.beam.wall, self.state.section
        if wall is None:
            raise ValueError("the beam has no wall from which stresses could be read")
        if self.beam.fibres is not None:
            out = np.empty((section.shape[0], 2, 3))
            s, radius = self.state, self.beam.radius
            kernels.end_stresses(
                s.ends, section, s.strained, self.beam.fibres[1], wall, radius, out
            )
            return out
        loads = np.stack([section[:, [9, 4, 5]], section[:, [10, 7, 8]]], axis=1)
        return loads / np.stack([wall[:-1], wall[1:]], axis=1)

    def worst_stress(self) -> WorstStress:
        """Return the largest stress of the wall, over the nodes."""
        if self.beam.wall is None:
            raise ValueError("the beam has no wall from which stresses could be read")
        node, normal, up, across = _worst(self.stresses(), self.state.ends)
        if node < 0:
            return WorstStress(0.0, 0.0, 0.0, 0.0)
        return WorstStress(
            float(self._stations[node]),
            normal,
            float(np.hypot(up, across)),
            math.atan2(-across, up),
        )

    def _move_node(self, node: int, station: float) -> None:
        """Move an inner node to a station, along the axis as it lies and at rest."""
        old = self._stations
        if not 0 < node < old.size - 1:
            return
        neighbour = node + 1 if station > old[node] else node - 1
        fraction = (station - old[node]) / (old[neighbour] - old[node])
        for x, q in ((self.state.x, self.state.q), (self._rest_x, self._rest_q)):
            x[node] = _between(x, q, old, node, neighbour, fraction)
            turned = q[neighbour] if (q[neighbour] * q[node]).sum() >= 0.0 else -q[neighbour]
            q[node] += fraction * (turned - q[node])
            q[node] /= np.sqrt((q[node] ** 2).sum())
        self._stations[node] = station
        self._measure_rest()
        # The discrete energy changes slightly with the nodes: that is residual, no work.
        self._changed()


def _three(values: Sequence[float] | Floats, name: str, unit: str) -> tuple[float, float, float]:
    """Return three finite numbers, or raise a `ValueError` that names them."""
    x, y, z = values
    if not (math.isfinite(x) and math.isfinite(y) and math.isfinite(z)):
        raise ValueError(
            f"{name} must be three finite numbers of {unit}, got "
            f"{', '.join(f'{each:g}' for each in (x, y, z))}"
        )
    return x, y, z


_TICK, _AHEAD = SameTypes(kernels.tick), SameTypes(kernels.assemble_ahead)


@njit(cache=True, nogil=True)
def _worst(stresses: Floats, ends: NDArray[np.int64]) -> tuple[int, float, float, float]:
    """Return the node with the largest stress, and its stresses; node -1 where none is pulled."""
    largest, found = 0.0, (-1, 0.0, 0.0, 0.0)
    for element in range(stresses.shape[0]):
        for end in range(2):
            normal = stresses[element, end, 0]
            up, across = stresses[element, end, 1], stresses[element, end, 2]
            total = normal + np.sqrt(up * up + across * across)
            if total > largest:
                largest, found = total, (ends[element, end], normal, up, across)
    return found


def _between(
    x: Floats, q: Floats, stations: Floats, node: int, neighbour: int, fraction: float
) -> Floats:
    """Return a place between two nodes on the cubic curve along both their frames."""
    distance = abs(stations[neighbour] - stations[node])
    sign = 1.0 if neighbour > node else -1.0
    ends: list[Floats] = []
    for n in (node, neighbour):
        w, a, b, c = q[n]
        ends.append(
            sign
            * distance
            * np.array([1 - 2 * (b * b + c * c), 2 * (a * b + w * c), 2 * (a * c - w * b)])
        )
    u = fraction
    return (
        x[node] * (1 + 2 * u) * (1 - u) ** 2
        + ends[0] * u * (1 - u) ** 2
        + x[neighbour] * u * u * (3 - 2 * u)
        - ends[1] * u * u * (1 - u)
    )
