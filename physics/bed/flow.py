"""Flow of a fluid through a network's tubes, and out of holes in them.

Each element resists by Poiseuille's law with R = 8 mu l/(pi r^4): l its length now, r its bore,
whose volume stays as it was at rest (r^2 l constant). An end that is fed gives the supply's
pressure p_0 less its own resistance. Out of a hole of radius a in a wall of thickness w the flow
meets 3 mu/a^3 (an orifice [Sampson 1891]) and 8 mu w/(pi a^4). A torn element lets out at both its
ends by their bores; a clip closes an element. The pressures follow from one linear system a step,
in the order in which the network's own tangent is eliminated. What is left of the fluid sets the
supply's pressure, p_0 times what is left over what there was. Flow is laminar and steady, nothing
clots.

Units mm, kPa, s: volumes mm^3 (1 ml = 1000 mm^3), viscosity kPa s (1e-6 of mPa s).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kernel_cache import njit
from physics.bed.beam_on_bed import BeamOnBed
from physics.bed.nick import Nick
from physics.quantity import finite, positive

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Fluid:
    """A fluid, and what feeds the ends of its tubes."""

    viscosity: float  # kPa s
    pressure: float  # of the supply, kPa
    supply: float  # what one end gives to the open, mm^3/s: its resistance is pressure/supply
    volume: float  # that there is, mm^3

    def __post_init__(self) -> None:
        positive(self.viscosity, "viscosity of a fluid", "kPa s")
        positive(self.pressure, "pressure of a fluid", "kPa")
        positive(self.supply, "supply of a fluid", "mm^3/s")
        positive(self.volume, "volume of a fluid", "mm^3")


@dataclass(slots=True)
class _Hole:
    """A hole in a tube's wall, or a tube's open end."""

    tube: str
    station: float  # mm
    node: int
    resistance: float  # kPa s/mm^3
    flow: float = 0.0  # mm^3/s
    lost: float = 0.0  # mm^3


class Flow:
    """One fluid in the tubes of a network that have it.

    Parameters
    ----------
    bed
        The network, whose tubes move and tear.
    fluid
        What flows.
    bores
        Inner radii of the tubes that have it, mm, by name: one number, or (n,) at the nodes.
    fed
        The ends that are fed, each a tube and 0 or 1.
    """

    def __init__(
        self,
        bed: BeamOnBed,
        fluid: Fluid,
        bores: Mapping[str, float | Floats],
        fed: Sequence[tuple[str, int]],
    ) -> None:
        self._bed, self.fluid, self._bores = bed, fluid, dict(bores)
        for tube, end in fed:
            if tube not in self._bores or end not in (0, 1):
                raise ValueError(f"end {end} of tube {tube!r} is fed, and has none of the fluid")
        self._fed = [(int(bed.nodes_of(tube)[-end]), tube, end) for tube, end in fed]
        state = bed.state
        self._radius = np.zeros(state.h.size)
        self._tube_of = dict[int, str]()
        for tube, bore in self._bores.items():
            where = bed.elements_of(tube)
            along = np.broadcast_to(np.asarray(bore, dtype=np.float64), bed.nodes_of(tube).shape)
            for each in along:
                positive(float(each), f"bore of tube {tube!r}", "mm")
            self._radius[where] = 0.5 * (along[1:] + along[:-1])
            self._tube_of |= dict.fromkeys(range(where.start, where.stop), tube)
        self._clipped = np.zeros(state.h.size, dtype=np.bool_)
        self._open = set[int]()  # torn elements whose ends are holes already
        self.holes: list[_Hole] = []
        self.left = fluid.volume  # mm^3
        nodes = state.x.shape[0]
        self.pressures = np.zeros(nodes)  # at the nodes, kPa
        self._diagonal, self._off = np.zeros(nodes), np.zeros(state.block.shape[0])

    @property
    def lost(self) -> float:
        """What has flowed out of holes, mm^3."""
        return math.fsum(each.lost for each in self.holes)

    @property
    def rate(self) -> float:
        """What flows out of holes, mm^3/s, at the last step."""
        return math.fsum(each.flow for each in self.holes)

    @property
    def tubes(self) -> tuple[str, ...]:
        """Names of the tubes that have it."""
        return tuple(self._bores)

    def clip(self, station: float, tube: str) -> int:
        """Close a tube at a station, mm; return the number of its element."""
        element = self._bed.element_at(station, tube)
        self._clipped[self._bed.elements_of(tube).start + element] = True
        return element

    def nick(self, station: float, tube: str, radius: float, wall: float) -> None:
        """Make a hole in a tube at a station, or widen it: its radius, the wall's thickness, mm."""
        a, w = positive(radius, "radius of a nick", "mm"), finite(wall, "wall of a nick", "mm")
        if tube not in self._bores:
            raise ValueError(f"tube {tube!r} has none of the fluid")
        stations = self._bed.stations_of(tube)
        node = int(self._bed.nodes_of(tube)[np.argmin(np.abs(stations - station))])
        mu = self.fluid.viscosity
        out = 3.0 * mu / a**3 + 8.0 * mu * w / (math.pi * a**4)
        for hole in self.holes:
            if (hole.tube, hole.station) == (tube, station):
                hole.resistance = min(hole.resistance, out)
                return
        self.holes.append(_Hole(tube, float(station), node, out))

    def open_nick(self, nick: Nick, wall: float) -> None:
        """Make the hole of a tear part of the way, as wide as it is deep beyond the wall, mm."""
        through = nick.depth * nick.height - wall
        if through > 0.0:
            self.nick(nick.station, nick.tube, 0.5 * through, wall)

    def wall_at(self, station: float, tube: str) -> float:
        """Return how much farther out a tube reaches than its bore at a station, mm."""
        beam = self._bed.network.tubes[tube]
        return float(np.interp(station, beam.stations, beam.radius - self._bores[tube]))

    def advance(self, seconds: float) -> float:
        """Let the fluid flow for a time; return what has gone out, mm^3."""
        step = positive(seconds, "a step of a flow", "s")
        self._open_torn()
        if not self.holes:
            return 0.0
        self._solve()
        out = 0.0
        for hole in self.holes:
            hole.flow = self.pressures[hole.node] / hole.resistance
            out += hole.flow * step
        fraction = min(1.0, self.left / out) if out > 0.0 else 0.0
        for hole in self.holes:
            hole.lost += fraction * hole.flow * step
        self.left = self.fluid.volume - self.lost
        return fraction * out

    def _open_torn(self) -> None:
        """Open the ends of elements that have torn."""
        state, mu = self._bed.state, self.fluid.viscosity
        for e in np.flatnonzero(state.stiff[:, 0] == 0.0).tolist():
            if e in self._open or e not in self._tube_of:
                continue
            self._open.add(e)
            tube = self._tube_of[e]
            first = self._bed.elements_of(tube).start
            stations = self._bed.stations_of(tube)
            for end in range(2):
                node, at = int(state.ends[e, end]), float(stations[e - first + end])
                self.holes.append(_Hole(tube, at, node, 3.0 * mu / self._radius[e] ** 3))

    def _solve(self) -> None:
        """Find the pressures at the nodes."""
        state, fluid = self._bed.state, self.fluid
        self._diagonal[:], self._off[:], self.pressures[:] = 0.0, 0.0, 0.0
        whole = (state.stiff[:, 0] > 0.0) & ~self._clipped
        for node, _, _ in self._fed:
            self._diagonal[node] += fluid.supply / fluid.pressure
            self.pressures[node] += fluid.supply * self.left / fluid.volume
        for hole in self.holes:
            self._diagonal[hole.node] += 1.0 / hole.resistance
        conduct(
            state.x, state.ends, state.h, self._radius, whole, fluid.viscosity, self._diagonal,
            self._off,
        )  # fmt: skip
        solve_pressures(
            state.first_block, state.blocks, state.product, self._diagonal, self._off,
            self.pressures,
        )  # fmt: skip


@njit(cache=True, error_model="numpy", nogil=True)
def conduct(
    x: Floats, ends: Ints, h: Floats, radius: Floats, whole: NDArray[np.bool_], viscosity: float,
    diagonal: Floats, off: Floats,
) -> None:  # fmt: skip
    """Add the elements' conductances, mm^3/(kPa s), to the matrix of the pressures."""
    for e in range(h.size):
        if radius[e] == 0.0 or not whole[e]:
            continue
        i, j = ends[e, 0], ends[e, 1]
        square = 0.0
        for r in range(3):
            square += (x[j, r] - x[i, r]) ** 2
        length = math.sqrt(square)
        bore = radius[e] * radius[e] * h[e] / length
        conductance = math.pi * bore * bore / (8.0 * viscosity * length)
        diagonal[i] += conductance
        diagonal[j] += conductance
        off[ends[e, 2]] -= conductance


@njit(cache=True, error_model="numpy", nogil=True)
def solve_pressures(
    first_block: Ints, blocks: Ints, product: Ints, diagonal: Floats, off: Floats, p: Floats
) -> None:
    """Replace the sources `p` by the pressures; 0 in parts that nothing feeds or lets out."""
    # As `tangent.solve`, with a number in the place of each block. A part without a source has no
    # pressure: its right side is 0 throughout, and its last pivot 0 or rounding.
    first, column = first_block[0], blocks[1]
    n, at = diagonal.size, 0
    for i in range(n):
        inverse = 1.0 / diagonal[i] if diagonal[i] != 0.0 else 0.0
        diagonal[i] = inverse
        for m in range(first[i], first[i + 1]):
            factor = off[m] * inverse
            diagonal[column[m]] -= factor * off[m]
            p[column[m]] -= factor * p[i]
            for later in range(m + 1, first[i + 1]):
                off[product[at]] -= factor * off[later]
                at += 1
    for i in range(n - 1, -1, -1):
        for m in range(first[i], first[i + 1]):
            p[i] -= off[m] * p[column[m]]
        p[i] *= diagonal[i]
