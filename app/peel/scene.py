"""A scene of a beam on a bed, or of tubes that join, and what hands do there (docs/peel.md)."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import msgspec
import numpy as np

from app.bounded_file import decoded, read_bounded
from app.peel.tables import (
    BeamTable,
    BedTable,
    FluidTable,
    HandTable,
    JoinTable,
    LayerTable,
    RodTable,
    StrandTable,
    TimeTable,
    TubeTable,
    beyond,
    on_axis,
)
from physics.bed import BeamOnBed, Flow, Fluid, History, Join, Network, SpaceBeam, Strands, pull

MOST_BYTES = 20_000_000
"""Size of a scene file: some 100,000 strands, each in a table of its own."""
MEETS_MM = 0.5
"""How far a joined end may be from what it joins; it is moved there."""
BEAM = "beam"
"""Name of the tube that [beam] is."""


class PeelScene(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A beam on a bed, or tubes that join, and the hands that pull them."""

    beam: BeamTable | None = None
    bed: BedTable | list[BedTable] | None = None
    strand: list[StrandTable] = []
    hand: list[HandTable] = []
    rod: list[RodTable] = []
    tube: list[TubeTable] = []
    join: list[JoinTable] = []
    layer: list[LayerTable] = []
    fluid: list[FluidTable] = []
    time: TimeTable | None = None  # no time goes by without it
    # how far a tear crosses a tube's wall in a step; None: it is through at once
    tear_mm: int | float | None = None

    def run(self) -> History:
        """Move the hands along their paths."""
        if not self.hand and not self.rod:
            raise ValueError("a scene needs a [[hand]] or a [[rod]]")
        if self.tear_mm is not None and not self.tube:
            raise ValueError("tear_mm goes with [[tube]], whose walls tear, not with [beam]")
        tubes = self._network_tubes() if self.tube else {BEAM: self._lone_beam()}
        layers = self.layer if self.tube else self._layers_of_beam()
        joins = [
            Join(
                each.tube,
                each.end,
                each.to,
                each.station(tubes[each.to].span),
                float(each.stiff),
                float(each.face_mm),
            )
            for each in self.join
        ]
        network = Network(tubes, joins)
        floor = {name: np.zeros(beam.stations.size) for name, beam in tubes.items()}
        strands: list[Strands] = []
        for number, layer in enumerate(layers):
            for name in (layer.tube, layer.to):
                if name not in tubes and not (name == "bed" and name == layer.to):
                    raise ValueError(f"[[layer]] {number + 1}: there is no tube {name!r}")
            beam = tubes[layer.tube]
            bed = on_axis(layer, "to_mm", self._length(layer.tube)).build(beam)
            if layer.to == "bed":
                found = bed.strands_under(beam)
                _check_elements(layer.tube, beam, found)
                tube = np.full(found.count, list(tubes).index(layer.tube))
                strands.append(replace(found, tubes=tube))
                floor[layer.tube] += bed.floor_under(beam)
            else:
                reach = math.inf if layer.reach_mm is None else float(layer.reach_mm)
                strands.append(
                    bed.strands_between(network, layer.tube, layer.to, reach=reach, side=layer.side)
                )
        strands += [
            on_axis(each, "at_mm", self._length(BEAM)).build(tubes[BEAM], number + 1)
            for number, each in enumerate(self.strand)
        ]
        tables: list[BeamTable] = [*self.tube] or [self.beam or BeamTable()]
        return pull(
            network if self.tube else tubes[BEAM],
            Strands.joined(strands),
            [each.build() for each in self._hands()],
            rods=[each.build() for each in self.rod],
            plane=any(each.plane for each in tables),
            floor=list(floor.values()) if self.tube else floor[BEAM],
            strength={
                each.name: float(each.break_stress_MPa)
                for each in self.tube
                if each.break_stress_MPa is not None
            },
            tear_mm=math.inf if self.tear_mm is None else float(self.tear_mm),
            fluids=self._fluids(tubes),
            **self._timed(),
        )

    def _timed(self) -> dict[str, Any]:
        if self.time is None:
            if self.fluid:
                raise ValueError("[[fluid]] needs [time], whose step_s says for how long it flows")
            return {}
        each = [(table.from_step, table.steps) for table in (*self.hand, *self.rod)]
        steps = max(a + (sum(b) if isinstance(b, list) else b) for a, b in each)
        return self.time.settings(steps, flows=bool(self.fluid))

    def _fluids(self, tubes: dict[str, SpaceBeam]) -> Callable[[BeamOnBed], dict[str, Flow]] | None:
        """Return what puts the fluids into the tubes once those are on their bed."""
        for number, each in enumerate(self.fluid):
            if any(other.name == each.name for other in self.fluid[:number]):
                raise ValueError(f"there are two fluids {each.name!r}")
            if not any(tube.fluid == each.name for tube in self.tube):
                raise ValueError(f"[[fluid]] {number + 1}: no tube has the fluid {each.name!r}")
        for tube in self.tube:
            for name in ("bore_radius_mm", "fed_ends"):
                if tube.fluid is None and getattr(tube, name) is not None:
                    raise ValueError(f"{name} of tube {tube.name!r} goes with a fluid")
            if tube.fluid is not None and tube.bore_radius_mm is None:
                raise ValueError(f"tube {tube.name!r} has a fluid and needs bore_radius_mm")
            if tube.fluid is not None and all(each.name != tube.fluid for each in self.fluid):
                known = ", ".join(each.name for each in self.fluid) or "none"
                raise ValueError(
                    f"tube {tube.name!r}: there is no [[fluid]] {tube.fluid!r}: {known}"
                )
        found: dict[str, tuple[Fluid, dict[str, Any], list[tuple[str, int]]]] = {}
        for each in self.fluid:
            having = [tube for tube in self.tube if tube.fluid == each.name]
            fed = [(tube.name, end) for tube in having for end in tube.fed()]
            if not fed:
                raise ValueError(
                    f"[[fluid]] {each.name!r} comes into no tube: give one of its tubes fed_ends"
                )
            bores = {tube.name: tube.bore(tubes[tube.name]) for tube in having}
            found[each.name] = each.build(), bores, fed
        if not found:
            return None
        return lambda bed: {name: Flow(bed, *of) for name, of in found.items()}

    def _length(self, tube: str) -> float | None:
        """Return the length of a tube's curved axis, mm; None where it is straight."""
        tables: dict[str, BeamTable] = {each.name: each for each in self.tube}
        if self.beam is not None:
            tables[BEAM] = self.beam
        return tables[tube].axis_length() if tube in tables else None

    def _hands(self) -> list[HandTable]:
        first = self.tube[0].name if self.tube else BEAM
        return [on_axis(each, "at_mm", self._length(each.tube or first)) for each in self.hand]

    # A beam by itself

    def _lone_beam(self) -> SpaceBeam:
        if self.beam is None:
            raise ValueError("a scene needs a [beam], or [[tube]] tables")
        if (
            self.join
            or self.layer
            or self.fluid
            or any(each.tube is not None for each in self.hand)
        ):
            raise ValueError(
                "[[join]], [[layer]], [[fluid]] and a hand's tube go with [[tube]], not [beam]"
            )
        if "joined" in self.beam.ends:
            raise ValueError("an end that is joined goes with [[tube]] and [[join]]")
        return self.beam.build([float(each.at_mm) for each in self._hands()])

    def _layers_of_beam(self) -> list[LayerTable]:
        """Return the beds under the beam as a network's layers."""
        beds = self.bed if isinstance(self.bed, list) else [] if self.bed is None else [self.bed]
        return [LayerTable(tube=BEAM, **msgspec.structs.asdict(each)) for each in beds]

    # Tubes that join

    def _network_tubes(self) -> dict[str, SpaceBeam]:
        if self.beam is not None or self.bed is not None or self.strand:
            raise ValueError("[[tube]] has [[layer]] tables, and no [beam], [bed] or [[strand]]")
        tubes: dict[str, SpaceBeam] = {}
        for table in self.tube:
            if table.name in tubes:
                raise ValueError(f"there are two tubes {table.name!r}")
            tubes[table.name] = self._tube(table, tubes)
        for number, each in enumerate(self.join):
            if each.tube not in tubes:
                raise ValueError(f"[[join]] {number + 1}: there is no tube {each.tube!r}")
        return tubes

    def _tube(self, table: TubeTable, tubes: dict[str, SpaceBeam]) -> SpaceBeam:
        """Return a tube as a beam whose ends are where they join, with nodes where others do."""
        name, points = table.name, list(table.points_mm)
        joins = [join for join in self.join if join.tube == name]
        for end in range(2):
            if (table.ends[end] == "joined") != any(join.end == end for join in joins):
                raise ValueError(
                    f"end {end} of tube {name!r} is joined in one of [[tube]] and [[join]] alone"
                )
        for join in joins:
            if join.to not in tubes:
                raise ValueError(f"tube {name!r} joins {join.to!r}, which must stand before it")
            to = tubes[join.to]
            node = to.places[int(np.argmin(np.abs(to.stations - join.station(to.span))))]
            away = float(np.sqrt(((node - points[-join.end]) ** 2).sum()))
            if away > MEETS_MM:
                raise ValueError(
                    f"end {join.end} of tube {name!r} is {away:.3g} mm away from {join.to!r}"
                )
            points[-join.end] = (float(node[0]), float(node[1]), float(node[2]))
        whole = msgspec.structs.replace(table, axis_mm=points)
        length = whole.axis_length() or 0.0
        own = {join.station(length) for join in self.join if join.to == name}
        first = self.tube[0].name
        own |= {
            float(min(hand.at_mm, length))
            for hand in self.hand
            if (hand.tube or first) == name and not beyond(hand.at_mm, length)
        }
        return whole.build(sorted(at for at in own if 0.0 < at < length))


def read_scene(path: Path) -> PeelScene:
    """Return the scene in a file."""
    content = read_bounded(path, MOST_BYTES, "scene")
    return decoded(_tables, content, PeelScene, str(path), lines=True)


def _tables(content: bytes) -> Any:
    """Return a scene's tables as they are written, none of which is a rod of one tube."""
    found = msgspec.toml.decode(content)
    rods = found.get("rod")
    for number, rod in enumerate(cast("list[Any]", rods) if isinstance(rods, list) else []):
        if isinstance(rod, dict) and "tube" in rod:
            raise msgspec.ValidationError(
                "tube is no field of a [[rod]]: its places are given in space, and it touches "
                f"every tube that it meets; leave it out - at `$.rod[{number}].tube`"
            )
    return found


def _check_elements(name: str, beam: SpaceBeam, strands: Strands) -> None:
    """Refuse elements that cannot follow how a bed's strands bend the beam."""
    # A beam on springs bends in waves, half of which is pi (4 E I / k)^(1/4) long (Hetenyi 1946).
    lengths, low, high = np.diff(beam.stations), 0.0, 0.0
    if strands.count:
        low, high = float(strands.stations.min()), float(strands.stations.max())
    middles = beam.stations[:-1] + 0.5 * lengths
    held = (middles > low) & (middles < high)
    if not held.any():
        return
    stiffness = float(strands.stiffness.sum()) / (high - low)
    half_wave = math.pi * (4.0 * beam.stiffness[held, 4] / stiffness) ** 0.25
    over = lengths[held] / half_wave
    worst = int(np.argmax(over))
    if over[worst] > 1.0:
        raise ValueError(
            f"elements of the {name} are up to {lengths[held][worst]:.3g} mm long, but on its bed "
            f"it bends over {half_wave[worst]:.3g} mm: elements must be "
            f"{math.ceil(lengths.size * over[worst]):,} or more"
        )
