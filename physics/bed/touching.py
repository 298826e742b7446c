"""Which nodes of a network's tubes may touch which other tubes, and which are solved together."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from physics.bed import kernels
from physics.bed.network import Network
from physics.bed.space_beam import SpaceBeam

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

NEAR_JOINT = 2.0
"""Of the sum of two tubes' radii, how far from their joint they run into each other."""


class Touching(NamedTuple):
    """The nodes of tubes that may touch other tubes, C in number."""

    which: Ints  # (C, 3) node, and elements of the other tube from and to
    reach: Floats  # (C, 2) radius, mm, and stiffness, N/mm
    coupled: set[tuple[int, int]]  # pairs of nodes, the lower first, coupled in the tangent

    @classmethod
    def of(cls, network: Network, numbered: list[Ints]) -> "Touching":
        """Return those of a network whose nodes are numbered so; tubes do not touch near joints."""
        which: list[tuple[int, int, int]] = []
        reach: list[tuple[float, float]] = []
        coupled: set[tuple[int, int]] = set()
        names, beams = list(network.tubes), list(network.tubes.values())
        starts = np.cumsum([0, *(each.stations.size - 1 for each in beams)]).tolist()
        within = network.touching
        for a, tube in enumerate(beams):
            if within is None:
                break
            steps = np.diff(tube.stations)
            widths = 0.5 * (np.append(steps, 0.0) + np.append(0.0, steps))
            stiffness = 0.5 * kernels.CONTACT_STIFFNESS * widths
            for b, other in enumerate(beams):
                if a == b:
                    continue
                free = np.ones(tube.stations.size, dtype=np.bool_)
                for join in network.joins:
                    if {join.tube, join.to} == {names[a], names[b]}:
                        to = network.joined_node(join)
                        mine, its = (-join.end, to) if join.tube == names[a] else (to, -join.end)
                        near = NEAR_JOINT * (tube.radius + other.radius[its])
                        free &= np.abs(tube.stations - tube.stations[mine]) > near
                gaps, others = _gaps(tube, other), numbered[b].tolist()
                for k in np.flatnonzero(free).tolist():
                    node = int(numbered[a][k])
                    which.append((node, starts[b], starts[b + 1]))
                    reach.append((float(tube.radius[k]), float(stiffness[k])))
                    for e in np.flatnonzero(gaps[k] <= within).tolist():
                        near = others[max(e - 1, 0) : e + 3]
                        coupled |= {(min(node, i), max(node, i)) for i in near if i != node}
                        coupled |= {
                            (min(i, j), max(i, j)) for i, j in zip(near, near[2:], strict=False)
                        }
        rows = np.array(which, np.int64).reshape(-1, 3)
        return cls(rows, np.array(reach, np.float64).reshape(-1, 2), coupled)


def _gaps(tube: SpaceBeam, other: SpaceBeam) -> Floats:
    """Return the gap at rest from each node of a tube to each element of another, mm."""
    along = other.places[1:] - other.places[:-1]
    away = tube.places[:, None] - other.places[:-1]
    t = np.clip((away * along).sum(axis=2) / (along**2).sum(axis=1), 0.0, 1.0)
    distance = np.sqrt(((away - t[..., None] * along) ** 2).sum(axis=2))
    radius = (1.0 - t) * other.radius[:-1] + t * other.radius[1:]
    return distance - radius - tube.radius[:, None]
