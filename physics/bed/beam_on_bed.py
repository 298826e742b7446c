"""A beam on its bed, held by hands: solved step by step, in equilibrium or in real time.

`kernels` has energy, tangent and solver; docs/theory.md and docs/peel.md have the equations and the
scenes. `layout` makes the arrays, `quasi_static` steps through equilibria, `readings` has all that
there is to read; here are the hands and rods, and the calls that step.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from kernel_cache import SameTypes
from physics.bed import kernels, quasi_static
from physics.bed.layout import Coupling, Rest, state_of
from physics.bed.network import Network
from physics.bed.nick import Nick
from physics.bed.readings import Readings, WorstStress
from physics.bed.relaxation import Relaxation
from physics.bed.space_beam import SpaceBeam
from physics.bed.strands import Strands
from physics.equilibrium import NoEquilibrium
from physics.quantity import finite, positive
from physics.tear_growth import DEEPEST, START

Floats = NDArray[np.float64]

# s, by which damage in real time lags behind its law: pulls are 1.6 % too large at 5 mm/s in a firm
# bed. Drag at each node, N s/mm: 0.03 % of the work at 20 mm/s, enough to turn a jump into a short
# slide.
DELAY, DRAG = 5e-3, 2e-6
EVERYWHERE = (True, True, True)


class BeamOnBed(Readings):
    """A beam in space, or a network of them, on strands, in its last state.

    The next one is found from it.

    Hooks hold nodes: by displacement (`take`, `lead`), through a spring (`take` with a stiffness)
    or by a force (`push`). Rods push strands aside (`set_rod`). These calls set targets; the next
    `advance` reaches them through equilibria, the next `tick` in real time. Not for two threads at
    once; the compiled steps let other threads run meanwhile.

    Parameters
    ----------
    beam
        The beam at rest, or a network of tubes.
    strands
        Strands to the bed and between tubes, if there are any.
    floor
        (N,) stiffness with which the bed pushes back nodes that lie deeper than at rest, N/mm; of a
        network one row for each tube.
    rods
        How many rods there may be.
    plane
        Whether nothing moves along y, nor turns about x and z.
    retrace
        Whether real-time ticks whose energy the trapezoidal rule leaves open are followed along
        their way in shorter parts, some milliseconds in the worst of them. What moves is the same.
    strand_relaxation, wall_relaxation
        How strands and the tubes' walls relax while they are held; at no rate when None.
    coupling
        How strands between tubes are coupled in real time; see `layout.Coupling`.
    out
        Arrays for the state, as `layout.shapes` gives them; new ones when None.
    """

    def __init__(
        self,
        beam: SpaceBeam | Network,
        strands: Strands | None = None,
        *,
        floor: Floats | Sequence[Floats] | None = None,
        rods: int = 0,
        plane: bool = False,
        retrace: bool = False,
        strand_relaxation: Relaxation | None = None,
        wall_relaxation: Relaxation | None = None,
        coupling: Coupling = "exact",
        out: kernels.State | None = None,
    ) -> None:
        network = beam if isinstance(beam, Network) else Network({"beam": beam})
        rest = Rest.of(
            network,
            Strands.none() if strands is None else strands,
            plane=plane,
            coupling=coupling,
        )
        if isinstance(floor, np.ndarray):
            floor = [floor]
        state = state_of(
            rest,
            floor=floor,
            rods=rods,
            retrace=retrace,
            relaxation=(strand_relaxation, wall_relaxation),
            out=out,
        )
        super().__init__(rest, state)
        self._coupling = coupling
        self._gross = 0.0  # sizes of all works, mJ

    # Hands

    def node_at(self, station: float, tube: str | None = None) -> int:
        """Return the node of a tube nearest a station that no other hook holds."""
        which = self._rest.tube(tube)
        s = finite(station, "a hook's place", "mm")
        span = self.network.tubes[which.name].span
        if not 0.0 <= s <= span:
            raise ValueError(
                f"a hook at {s:g} mm is not on the beam, which runs from 0 to {span:g} mm"
            )
        node = int(which.nodes[np.argmin(np.abs(which.stations - s))])
        if self._rest.held[node] & 7 == 7:
            raise ValueError(f"a hook at {s:g} mm is behind a clamp or on a pin: it holds already")
        if self.held[node]:
            raise ValueError(f"two hooks are on top of one another at {s:g} mm")
        return node

    @property
    def held(self) -> NDArray[np.bool_]:
        """(N,) whether a hook holds the node."""
        s = self.state
        return (
            (s.held != self._rest.held)
            | (s.spring != 0.0).any(axis=1)
            | (s.load_to != 0.0).any(axis=1)
        )

    def take(
        self,
        station: float,
        tube: str | None = None,
        *,
        stiffness: float = math.inf,
        along: tuple[bool, bool, bool] = EVERYWHERE,
    ) -> int:
        """Take hold of a tube where it now is, by displacement; return the node that is held."""
        # An inner node that is no joint moves to the station, along the axis as it lies and at
        # rest: a hook inside an element would stiffen the beam, by 2.3 % in force at 40 elements.
        # A finite `stiffness`, N/mm, is that of a spring between hand and beam; the beam slides
        # along the axes not in `along`.
        node, which = self.node_at(station, tube), self._rest.tube(tube)
        if not stiffness > 0.0:
            raise ValueError(f"a hand's spring must be above 0 N/mm, got {stiffness}")
        self._account()
        s = self.state
        k = int(np.flatnonzero(which.nodes == node)[0])
        inner = 0 < k < which.nodes.size - 1 and not self._rest.is_joint(node)
        if inner and abs(which.stations[k] - station) > 1e-9 * self.network.tubes[which.name].span:
            self._rest.move_node(s, which, k, station)
            # The discrete energy changes slightly with the nodes: that is residual, no work.
            self._changed()
        s.goal[node] = s.goal_from[node] = s.goal_to[node] = s.x[node]
        for r in range(3):
            if self._rest.held[node] >> r & 1:
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
        s.held[node] = self._rest.held[node]
        s.spring[node] = s.load[node] = s.load_to[node] = s.load_from[node] = 0.0
        s.sums[kernels.SNAP] -= self._changed()

    def lead(self, node: int, place: Sequence[float] | Floats) -> None:
        """Set the target of a held node, mm."""
        self.state.goal_to[node] = _three(place, "a hand's target", "mm")

    def push(self, node: int, force: Sequence[float] | Floats) -> None:
        """Set the target of the dead force on a node, N."""
        self.state.load_to[node] = _three(force, "a force", "N")

    def set_rod(
        self,
        rod: int,
        tip: Sequence[float] | Floats,
        shaft: Sequence[float],
        radius: float,
        length: float = math.inf,
    ) -> None:
        """Place a rod: its tip, mm, direction back along the shaft, radius and length, mm."""
        row = _rod_row(tip, shaft, radius, length)
        self._account()
        for rods in (self.state.rods, self.state.rods_from, self.state.rods_to):
            rods[rod] = row
        self.state.side[rod] = kernels.NO_CONTACT
        kernels.update_rod_contacts(self.state, True)
        # Should it touch anything already, that is the hand's work.
        work = self._changed()
        self.state.sums[kernels.WORK] += work
        self.state.sums[kernels.ROD_WORK] += work

    def nearness(
        self,
        tip: Sequence[float] | Floats,
        shaft: Sequence[float],
        radius: float,
        length: float = math.inf,
    ) -> float:
        """Return how near a rod's axis would be to a tube's, over half the distance of touch."""
        return float(kernels.nearest_core(self.state, _rod_row(tip, shaft, radius, length)))

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

    def break_between(self, from_mm: float, to_mm: float, tube: str | None = None) -> None:
        """Part the strands that hold a stretch, beforehand, with no work; all is at rest."""
        at, number = self.strands.stations, self._rest.tubes.index(self._rest.tube(tube))
        self.detach((at >= from_mm) & (at <= to_mm) & (self.strands.tubes == number))

    def detach(self, which: NDArray[np.bool_]) -> None:
        """Part some of the (S,) strands at once, with no work; what they store is released."""
        self._account()
        self.state.damage[which[self.order]] = 1.0
        self.state.sums[kernels.SNAP] -= self._changed()

    def tear(self, station: float, tube: str | None = None) -> int:
        """Take all stiffness from a tube's element at a station; return its number, from 0."""
        # At a node, of the two elements the one under the larger stress there. Both pieces go on
        # hanging on their strands and hooks; the element's energy is booked as released.
        which = self._rest.tube(tube)
        s = finite(station, "the place of a tear", "mm")
        span = self.network.tubes[which.name].span
        if not 0.0 <= s <= span:
            raise ValueError(
                f"a tear at {s:g} mm is not on the beam, which runs from 0 to {span:g} mm"
            )
        self._account()
        x, first = which.stations, which.elements.start
        element = min(int(np.searchsorted(x, s, side="right")) - 1, x.size - 2)
        if element > 0 and s == x[element]:
            moment = np.sqrt((self.state.section[:, [4, 5, 7, 8]] ** 2).sum(axis=1))
            if moment[first + element - 1] > moment[first + element]:
                element -= 1
        self._rest.stiffness[first + element] = 0.0
        self.state.wall_memory[:, 6 * (first + element) : 6 * (first + element + 1)] = 0.0
        self._rest.write(self.state)
        self.state.sums[kernels.SNAP] -= self._changed()
        return element

    def nick(self, worst: WorstStress, by: float, tube: str | None = None) -> float:
        """Tear a tube's wall where its stress is worst, part of the way through, or farther.

        Parameters
        ----------
        worst
            Where, and on which side.
        by
            How far a tear that is there goes on, mm; a new one begins with a depth of `START`. One
            that goes on at infinite speed is through at once.
        tube
            Which tube.

        Returns
        -------
        float
            The tear's depth, a part of the section's height. From `DEEPEST` on nothing was done:
            the tube is to be parted there (`tear`).

        Raises
        ------
        ValueError
            If the tube has no wall.
        """
        # What the lost fibres held is dissipated.
        if math.isinf(by):
            return 1.0
        rest, wall = self._rest, self._rest.wall
        which = rest.tube(tube)
        if wall is None:
            raise ValueError("a tube without a wall does not tear")
        element = which.elements.start + self.element_at(worst.station, which.name)
        whole = rest.stiffness[element]
        if whole[0] == 0.0:
            return 1.0
        side = (1.0, 0.0)
        if worst.bending > 0.0:
            side = worst.up / worst.bending, -worst.across / worst.bending
        modulus = float(whole[0]) / float(wall[element].mean(axis=0)[0])
        new = Nick.of(which.name, worst.station, side, START, whole, modulus)
        for k, old in enumerate(rest.nicks):
            near = old.reach + new.reach + float(np.diff(which.stations).max())
            if old.tube == new.tube and abs(old.station - new.station) < near:
                new = replace(old, depth=old.depth + by / old.height)
                if new.depth < DEEPEST:
                    self._weaken(new, k)
                return new.depth
        self._weaken(new, None)
        return new.depth

    def _weaken(self, nick: Nick, number: int | None) -> None:
        """Put a tear in the place of another, or beside the others; account for its energy."""
        rest, s = self._rest, self.state
        self._account()
        relaxes = s.wall_memory.shape[1] > 0
        if relaxes:
            kernels.settle(s, 0.0)
        stiff, off = s.stiff.copy(), s.chord[:, kernels.OFF].copy()
        if number is None:
            rest.nicks.append(nick)
        else:
            rest.nicks[number] = nick
        rest.write(s)
        if relaxes:
            # What stretches its branches is as before, of another section.
            kernels.assemble(s, kernels.FROZEN, 0.0)
            for e, weak in rest.weak(nick):
                rows = slice(6 * e, 6 * e + 6)
                memory = s.wall_memory[:, rows]
                memory[kernels.FORCE_BEFORE] = memory[kernels.FORCE]
                memory[kernels.STRAIN_BEFORE] = memory[kernels.STRAIN]
                for branch in memory[kernels.OVER :]:
                    strain = branch / stiff[e]
                    if number is None:
                        strain[[4, 5]] = nick.turned(strain[4], strain[5])
                        strain[[1, 2]] = nick.turned(strain[1], strain[2])
                    strain[0] += (off[e] - weak.off) * strain[4]
                    branch[:] = strain * s.stiff[e]
            kernels.begin(s, 0.0)
        self.state.sums[kernels.DISSIPATED] -= self._changed()

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

    def advance(self, seconds: float = 0.0) -> None:
        """Advance to the hands' targets through equilibria.

        Parameters
        ----------
        seconds
            Time that goes by meanwhile, in which strands and walls relax; nothing else depends on
            it. In 0 s they answer as at once.

        Raises
        ------
        ValueError
            If the time is no number of 0 or more, or strands between tubes are not coupled exactly.
        NoEquilibrium
            If there is none near the last one.
        """
        if not finite(seconds, "a step", "s") >= 0.0:
            raise ValueError(f"a step must take 0 s or more, got {seconds:g} s")
        if self._coupling != "exact":
            raise ValueError("an equilibrium needs strands between tubes that are coupled exactly")
        self._account()
        span = self.network.span
        self._gross = quasi_static.advance(
            self.state,
            gross=self._gross,
            span=span,
            far=1e3 * span + float(np.abs(self.rest_places).max()),
            rounding=self.rounding,
            seconds=seconds,
        )

    def tick(self, seconds: float, *, ticks: int = 1) -> None:
        """Advance in real time towards the hands' targets, at a fixed cost."""
        if ticks < 1:
            raise ValueError(f"a tick must be divided into 1 part or more, got {ticks}")
        if not 0.0 < seconds < math.inf:
            positive(seconds, "a tick", "s")
        if not _TICK(self.state, ticks, *step_numbers(seconds / ticks)):
            raise NoEquilibrium("the beam is lost: no step makes its energy less")

    def assemble_ahead(self, seconds: float) -> None:
        """Do what the next `tick` of so many seconds does wherever hands lead; the same bits."""
        _AHEAD(self.state, step_numbers(positive(seconds, "a tick", "s"))[0])


def step_numbers(step: float) -> tuple[float, float, float]:
    """Return what `kernels.tick` takes besides the state and a number of steps, each so many s."""
    return step / (DELAY + step), DRAG / step, step


def _rod_row(
    tip: Sequence[float] | Floats, shaft: Sequence[float], radius: float, length: float
) -> Floats:
    """Return a rod as the state has it."""
    direction = np.array(_three(shaft, "a rod's direction", "mm"))
    size = float(np.sqrt((direction**2).sum()))
    if size == 0.0:
        raise ValueError("a rod's direction must not be zero")
    thick = positive(radius, "a rod's radius", "mm")
    if not length > 0.0:
        raise ValueError(f"a rod's length must be above 0 mm, got {length:g} mm")
    return np.array([*_three(tip, "a rod's tip", "mm"), *(direction / size), thick, 1.0, length])


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
