"""The arrays of a beam on its bed: how large they are, where they are made, what they hold at rest.

`state_of(..., out=)` writes into arrays that are there already, such as the rows of a batch of
beds, each array of which has one axis more; `shapes` says how large they must be.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from physics.bed import kernels
from physics.bed.space_beam import HELD, SpaceBeam, tangents
from physics.bed.strands import Strands

__all__ = ["REACH_OF_RODS", "Rest", "shapes", "state_of"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Shapes = dict[str, tuple[tuple[int, ...], type[np.generic]]]

REACH_OF_RODS = 12.0
"""How far from the beam's surface and the rod's a strand may still touch the rod, mm."""
# Bits of what is held in the plane of x and z: y, and turning about x and z.
IN_PLANE = 2 + 8 + 32
# Part of an element's shear flexibility that stands for bending within it, from which on it is
# stretched along its chord.
THIN = 0.5
WHOLE_NUMBERS = ("held", "parent", "child", "sibling", "ends", "first", "side", "side_before")
"""Names of a state's arrays of whole numbers."""


@dataclass(slots=True, eq=False)
class Rest:
    """A beam at rest as its state has it: hooks move inner nodes along it, tears soften elements.

    Strands are sorted by their nodes.
    """

    beam: SpaceBeam
    strands: Strands
    stations: Floats  # (N,) of the nodes, mm
    x: Floats  # (N, 3) mm
    q: Floats  # (N, 4)
    stiffness: Floats  # (N - 1, 6) of the elements' sections, N and N mm^2
    held: Ints  # (N,) bits of what ends and the plane hold
    nodes: NDArray[np.intp]  # (S,) the strands' nodes, in order
    order: NDArray[np.intp]  # (S,) their numbers in `strands`

    @classmethod
    def of(cls, beam: SpaceBeam, strands: Strands, *, plane: bool = False) -> "Rest":
        """Return a beam and its strands at rest."""
        if strands.count and not (
            strands.stations.min() >= -1e-9 and strands.stations.max() <= beam.span * (1 + 1e-9)
        ):
            raise ValueError(
                f"strands must hold the beam from 0 to {beam.span:g} mm, got "
                f"{strands.stations.min():g} to {strands.stations.max():g} mm"
            )
        stations = beam.stations.copy()
        middles = 0.5 * (stations[1:] + stations[:-1])
        node = np.searchsorted(middles, strands.stations)
        # Half-way between two nodes the even one has it, whose arms are then alike on both sides.
        after = np.searchsorted(middles, strands.stations + 1e-9 * beam.span)
        before = np.searchsorted(middles, strands.stations - 1e-9 * beam.span)
        node = np.where(after == before, node, after - after % 2)
        order = np.argsort(node, kind="stable")
        held = np.zeros(stations.size, dtype=np.int64)
        held[0], held[-1] = HELD[beam.ends[0]], HELD[beam.ends[1]]
        if plane:
            held |= IN_PLANE
        return cls(
            beam,
            strands,
            stations,
            beam.places.copy(),
            beam.rotations.copy(),
            beam.stiffness.copy(),
            held,
            node[order],
            order,
        )

    def write(self, s: kernels.State) -> None:
        """Write what follows from the nodes' places at rest: strains, stiffnesses, arms."""
        s.h[:] = np.diff(self.stations)
        kernels.set_rest(self.x, self.q, s.ends, s.h, s.strain)
        s.floor[:, 1] = self.x[:, 2]
        s.stiff[:] = self.stiffness
        s.chord[:] = 0.0
        # One shear strain an element leaves bending out, h^2/(12 E I), which is added to its shear
        # flexibility [MacNeal 1978]: under forces at the nodes a straight element is then exact at
        # small loads.
        whole = self.stiffness[:, 0] > 0.0
        for shear, bending in ((1, 5), (2, 4)):
            within = s.h[whole] ** 2 / (12.0 * self.stiffness[whole, bending])
            s.stiff[whole, shear] = 1.0 / (1.0 / self.stiffness[whole, shear] + within)
            inner = s.stiff[whole, shear] * within
            s.chord[whole, shear - 1] = np.where(inner > THIN, inner * inner, 0.0)
        if self.beam.fibres is not None:
            # Their length is the chord's in all elements: else stiffening fibres would gain by what
            # is left out of their shear.
            for column, shear in ((kernels.SOFT_2, 1), (kernels.SOFT_3, 2)):
                soft = s.stiff[whole, shear] / self.stiffness[whole, shear]
                s.wall[:, column] = 0.0
                s.wall[whole, column], s.chord[whole, shear - 1] = soft, 1.0 - soft
            s.wall[~whole, kernels.STRENGTH] = 0.0
        kernels.set_arms(self.x, self.q, self.nodes, self.strands.ends[self.order], s.strand)

    def move_node(self, s: kernels.State, node: int, station: float) -> None:
        """Move an inner node to a station, along the axis as it lies and at rest."""
        old = self.stations
        neighbour = node + 1 if station > old[node] else node - 1
        fraction = (station - old[node]) / (old[neighbour] - old[node])
        for x, q in ((s.x, s.q), (self.x, self.q)):
            x[node] = _between(x, q, old, node, neighbour, fraction)
            turned = q[neighbour] if (q[neighbour] * q[node]).sum() >= 0.0 else -q[neighbour]
            q[node] += fraction * (turned - q[node])
            q[node] /= np.sqrt((q[node] ** 2).sum())
        old[node] = station
        self.write(s)


def shapes(rest: Rest, rods: int = 0) -> Shapes:
    """Return shape and type of each of a state's arrays, by its name."""
    nodes, count = rest.stations.size, rest.strands.count
    elements = nodes - 1
    solid = 0 if rest.beam.fibres is None else elements
    three, six, blocks = (nodes, 3), (nodes, 6), (nodes, 6, 6)
    swept, touched, at_rods = (rods, kernels.ROD_ROWS), (rods, count), (rods, 3)
    sizes: dict[str, tuple[int, ...]] = {
        "x": three, "q": (nodes, 4), "goal": three, "held": (nodes,), "load": three,
        "spring": three, "parent": (nodes,), "child": (nodes,), "sibling": (nodes,),
        "ends": (elements, 2), "h": (elements,), "stiff": (elements, 6), "strain": (elements, 6),
        "chord": (elements, 2), "wall": (solid, kernels.WALL_ROWS), "strained": (solid, 4),
        "first": (nodes + 1,), "strand": (kernels.STRAND_ROWS, count), "damage": (count,),
        "floor": (nodes, 2), "thick": three, "rods": swept, "side": touched, "pull": at_rods,
        "press": at_rods, "section": (elements, 11),
        "fibres": (kernels.FIBRE_ROWS, kernels.FIBRES * solid), "g": six, "step": six,
        "diagonal": blocks, "upper": blocks, "diagonal_kept": blocks, "upper_kept": blocks,
        "x_kept": three, "q_kept": (nodes, 4), "goal_from": three, "goal_to": three,
        "load_from": three, "load_to": three, "rods_from": swept, "rods_to": swept, "hold": six,
        "react": three, "damage_correction": six, "rods_damage_correction": at_rods, "moved": six,
        "g_before": six, "load_before": three, "pull_before": at_rods, "g_middle": six,
        "pull_middle": at_rods, "damage_before": (count,), "side_before": touched,
        "damage_ahead": (count,), "sums": (kernels.SUM_ROWS,),
    }  # fmt: skip
    return {
        name: (sizes[name], np.int64 if name in WHOLE_NUMBERS else np.float64)
        for name in kernels.State._fields
    }


def state_of(
    rest: Rest,
    *,
    floor: Floats | None = None,
    rods: int = 0,
    retrace: bool = False,
    out: kernels.State | None = None,
) -> kernels.State:
    """Return the state of a beam at rest on its bed.

    Parameters
    ----------
    rest
        The beam and its strands.
    floor
        (N,) stiffness with which the bed pushes back nodes that lie deeper than at rest, N/mm.
    rods
        How many rods there may be.
    retrace
        As of `BeamOnBed`.
    out
        Arrays of the `shapes`, which are overwritten; new ones when None.

    Returns
    -------
    State
        `out`, or a new state.
    """
    if out is None:
        made: list[Any] = [np.zeros(*each) for each in shapes(rest, rods).values()]
        s = kernels.State(*made)
    else:
        s = out
        for each in s:
            each[...] = 0
    nodes, beam = np.arange(rest.stations.size), rest.beam
    for each in (s.x, s.goal, s.goal_from, s.goal_to):
        each[:] = rest.x
    s.q[:] = rest.q
    s.held[:] = rest.held
    # One branch: each node's parent is the next one.
    s.parent[:-1], s.parent[-1] = nodes[1:], -1
    s.child[:] = nodes - 1
    s.sibling[:] = -1
    s.ends[:, 0], s.ends[:, 1] = nodes[:-1], nodes[1:]
    if beam.fibres is not None:
        s.wall[:] = beam.fibres[0]
    s.fibres[:] = 1.0
    s.first[:] = np.searchsorted(rest.nodes, np.arange(nodes.size + 1))
    strands, order = rest.strands, rest.order
    for row, values in (
        (kernels.STIFF, strands.stiffness),
        (kernels.LENGTH, strands.length),
        (kernels.YIELD, strands.yield_elongation),
        (kernels.FAILURE, strands.failure_elongation),
        (kernels.BILATERAL, strands.bilateral),
    ):
        s.strand[row] = values[order]
    s.strand[kernels.FOOT_X : kernels.FOOT_Z + 1] = strands.feet[order].T
    if floor is not None:
        s.floor[:, 0] = floor
    widths = np.zeros(nodes.size)
    widths[:-1] += 0.5 * np.diff(rest.stations)
    widths[1:] += 0.5 * np.diff(rest.stations)
    s.thick[:, 0], s.thick[:, 1], s.thick[:, 2] = (
        beam.radius,
        kernels.CONTACT_STIFFNESS * widths,
        REACH_OF_RODS,
    )
    s.side[:] = kernels.NO_CONTACT
    s.sums[kernels.RETRACED] = retrace
    rest.write(s)
    return s


def _between(
    x: Floats, q: Floats, stations: Floats, node: int, neighbour: int, fraction: float
) -> Floats:
    """Return a place between two nodes on the cubic curve along both their frames."""
    distance = abs(stations[neighbour] - stations[node])
    sign = 1.0 if neighbour > node else -1.0
    first, second = sign * distance * tangents(q[[node, neighbour]])
    u = fraction
    return (
        x[node] * (1 + 2 * u) * (1 - u) ** 2
        + first * u * (1 - u) ** 2
        + x[neighbour] * u * u * (3 - 2 * u)
        - second * u * u * (1 - u)
    )
