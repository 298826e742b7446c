"""An anatomy as the network of beams and strands that stands for it (docs/anatomy-method.md)."""

import math
from dataclasses import dataclass, replace
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from app.anatomy.tables import Anatomy, JoinTable, LayerTable, TableError, TubeTable
from app.bed_preset import bed_named
from physics.bed import BeamOnBed, Bed, End, Flow, Fluid, Join, Network, SpaceBeam, Strands
from physics.bed.space_beam import axis_line

Floats = NDArray[np.float64]

FLUIDS = {
    "blood": Fluid(viscosity=3.5e-6, pressure=12.0, supply=4000.0, volume=5e6),
    "bile": Fluid(viscosity=1.5e-6, pressure=1.2, supply=300.0, volume=4e4),
}
"""Assumed: 3.5 and 1.5 mPa s, 90 mmHg and 12 cm of water; an open end of a hepatic artery gives
4 ml/s, one of a bile duct 0.3 ml/s; 5 l and 40 ml."""
LAGGED = -math.inf
"""No gap at rest is so small that nodes of tubes that touch are solved for together."""
UP = (0.0, 0.0, 1.0)
# Part of a tube's length within which a place along it is one of its ends.
AT_END = 1e-2
# From and to which part of its length a strand is looked at: its ends lie on walls. And mm between
# the places of a tube's axis.
ALONG_STRAND, STATION_MM = (0.1, 0.9), 0.5


@dataclass(frozen=True, eq=False)
class AnatomyNetwork:
    """The tubes of an anatomy as beams, and the strands between them and to their bed."""

    anatomy: Anatomy
    network: Network
    strands: Strands
    floor: tuple[Floats, ...]  # of each tube (n,) stiffnesses of the bed under its nodes, N/mm
    # (S,) numbers of the layers that the strands are of
    layers: NDArray[np.int64]

    def on_bed(self, *, rods: int = 0, retrace: bool = False) -> BeamOnBed:
        """Return the network on its bed, at rest."""
        return BeamOnBed(self.network, self.strands, floor=self.floor, rods=rods, retrace=retrace)

    def flows(self, bed: BeamOnBed) -> dict[str, Flow]:
        """Return the fluids that there are, by name, in tubes that are fed at clamped ends."""
        out: dict[str, Flow] = {}
        for name, fluid in FLUIDS.items():
            tubes = [each for each in self.anatomy.tube if each.fluid == name]
            if tubes:
                fed = [
                    (each.name, end)
                    for each in tubes
                    for end in range(2)
                    if each.ends[end] == "clamped"
                ]
                out[name] = Flow(bed, fluid, {each.name: self._bore(each) for each in tubes}, fed)
        return out

    def _bore(self, tube: TubeTable) -> Floats:
        """Return the inner radii at a tube's nodes, mm."""
        return self.network.tubes[tube.name].radius - float(tube.wall_mm)


def anatomy_network(
    anatomy: Anatomy, *, touching: bool = True, clear: bool = True
) -> AnatomyNetwork:
    """Return the network that stands for an anatomy.

    Parameters
    ----------
    anatomy
        Of a file that was read, or drawn: its tubes meet where they join.
    touching
        Whether its tubes touch each other; else they pass through one another.
    clear
        Whether there is no strand that would lead through a tube that it does not hold.

    Returns
    -------
    AnatomyNetwork
        Tubes in the order of the file. Of a bed that lies elsewhere than behind (`toward`), there
        are the strands and no floor.

    Raises
    ------
    TableError
        If a tube cannot be a beam, or a layer cannot be made.
    """
    tubes: dict[str, SpaceBeam] = {}
    joins: list[Join] = []
    for number, tube in enumerate(anatomy.tube):
        ends = [join for join in anatomy.join if join.tube == tube.name]
        joins += [
            Join(tube.name, each.end, each.to, _at(each, tubes[each.to]), each.stiff, each.face_mm)
            for each in ends
        ]
        try:
            tubes[tube.name] = _beam(anatomy, tube, [(each, tubes[each.to]) for each in ends])
        except ValueError as error:
            raise TableError(f"tube {tube.name!r}: {error}", "tube", number) from None
    network = Network(tubes, joins, touching=LAGGED if touching else None)
    names = list(tubes)
    strands: list[Strands] = []
    layers: list[int] = []
    floor = [np.zeros(each.stations.size) for each in tubes.values()]
    for number, layer in enumerate(anatomy.layer):
        beam = tubes[layer.tube]
        try:
            bed = _bed(anatomy, layer, beam, seed=97 * anatomy.seed + number)
            if layer.to == "bed":
                made = _toward(bed, layer, beam, names.index(layer.tube))
                if layer.toward is None:
                    floor[names.index(layer.tube)] += bed.floor_under(beam)
            else:
                reach = np.inf if layer.reach_mm is None else float(layer.reach_mm)
                made = bed.strands_between(
                    network, layer.tube, layer.to, reach=reach, side=layer.side
                )
        except ValueError as error:
            message = f"layer of {layer.tube!r} to {layer.to!r}: {error}"
            raise TableError(message, "layer", number) from None
        if clear:
            made = made.some(np.flatnonzero(~_led_through(made, tubes)))
        strands.append(made)
        layers += [number] * made.count
    return AnatomyNetwork(
        anatomy, network, Strands.joined(strands), tuple(floor), np.array(layers, dtype=np.int64)
    )


def _led_through(strands: Strands, tubes: dict[str, SpaceBeam]) -> NDArray[np.bool_]:
    """Return which strands, (S,), would lead through a tube that they do not hold."""
    out = np.zeros(strands.count, dtype=np.bool_)
    for number, beam in enumerate(tubes.values()):
        others = np.flatnonzero((strands.tubes != number) & (strands.to != number))
        path = (strands.feet - strands.ends)[others, np.newaxis]
        stations: Floats = np.linspace(0.0, beam.span, 1 + math.ceil(beam.span / STATION_MM))
        axis, radius = beam.places_at(stations)[0], np.interp(stations, beam.stations, beam.radius)
        off = axis - strands.ends[others, np.newaxis]  # (S, n, 3)
        fraction = (off * path).sum(axis=2) / (path**2).sum(axis=2)
        off -= np.clip(fraction, *ALONG_STRAND)[:, :, np.newaxis] * path
        out[others] |= ((off**2).sum(axis=2) < radius**2).any(axis=1)
    return out


def _at(join: JoinTable, to: SpaceBeam) -> float:
    """Return where a tube joins another, mm: an end of that, or a node that it has there."""
    if isinstance(join.at_mm, str):
        return to.span if join.at_mm == "end" else 0.0
    at = float(join.at_mm)
    return float(to.stations[int(np.argmin(np.abs(to.stations - at)))])


def _beam(anatomy: Anatomy, tube: TubeTable, joins: list[tuple[JoinTable, SpaceBeam]]) -> SpaceBeam:
    """Return a tube as a beam whose ends are where they join, with nodes where others do."""
    points = np.array(tube.points_mm, dtype=np.float64)
    for join, to in joins:
        points[-join.end] = to.places[int(np.argmin(np.abs(to.stations - _at(join, to))))]
    length = float(axis_line(points)[0][-1])
    nodes_at = sorted(
        {
            float(join.at_mm)
            for join in anatomy.join
            if join.to == tube.name
            and not isinstance(join.at_mm, str)
            and AT_END * length < join.at_mm < (1.0 - AT_END) * length
        }
    )
    ends: list[End] = ["free" if each == "joined" else each for each in tube.ends]
    return SpaceBeam.round_tube(
        points,
        radius=np.array(tube.radius_mm, dtype=np.float64).reshape(-1),
        wall=float(tube.wall_mm),
        modulus=float(tube.modulus_MPa),
        elements=tube.elements,
        ends=(ends[0], ends[1]),
        nodes_at=nodes_at,
    )


def _bed(anatomy: Anatomy, layer: LayerTable, beam: SpaceBeam, *, seed: int) -> Bed:
    """Return the tissue of a layer: its preset's, with the layer's own numbers."""
    preset = bed_named(layer.preset)
    own: dict[str, Any] = {
        name: float(value)
        for name in ("gap_mm", "yield_mm", "failure_mm", "slack_mm", "floor_N_per_mm2")
        if (value := getattr(layer, name)) is not None
    }
    toughness = preset.toughness_J_per_m2 * layer.factor
    changed = msgspec.structs.replace(preset, toughness_J_per_m2=toughness, **own)
    upto = beam.span if layer.to_mm is None else min(float(layer.to_mm), beam.span)
    return changed.bed(
        beam, seed=seed, strands=layer.strands, from_mm=float(layer.from_mm), to_mm=upto
    )


def _toward(bed: Bed, layer: LayerTable, beam: SpaceBeam, tube: int) -> Strands:
    """Return the strands of a tube to the bed, which may lie elsewhere than behind."""
    up = UP
    if layer.toward is not None:
        size = float(np.sqrt((np.array(layer.toward, dtype=np.float64) ** 2).sum()))
        x, y, z = (-each / size for each in layer.toward)
        up = (x, y, z)
    made = bed.strands_under(beam, up)
    return replace(made, tubes=np.full(made.count, tube))
