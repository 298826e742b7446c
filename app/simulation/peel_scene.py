"""A scene of a beam on a bed, read from a TOML file; no organ is needed (docs/peel.md)."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, TypeVar

import msgspec
import numpy as np

from app.bed_preset import bed_named
from app.bounded_file import decoded, read_bounded
from app.simulation.relaxation_preset import Prony, relaxation_named
from physics import Beam, LawName, law_named
from physics.bed import (
    Bed,
    End,
    Hand,
    History,
    Join,
    Network,
    Patch,
    Rod,
    SpaceBeam,
    Strands,
    pull,
)  # fmt: skip
from physics.bed.space_beam import axis_line
from physics.quantity import finite, positive

__all__ = ["PeelScene", "read_scene"]

Number = int | float
Numbers = Number | list[Number]
Point = tuple[Number, Number, Number]
Steps = int | list[int]
Span = tuple[Number, Number]
SceneEnd = End | Literal["joined"]
TableT = TypeVar("TableT", bound=msgspec.Struct)

MOST_BYTES = 20_000_000
"""Size of a scene file: some 100,000 strands, each in a table of its own."""
# Part of a curved axis's length.
JUST_BEYOND = 1e-3
MEETS_MM = 0.5
"""How far a joined end may be from what it joins; it is moved there."""
DIRECTIONS = {"x": 0, "y": 1, "z": 2}
STIFFNESSES = (
    "axial_stiffness_N",
    "shear_stiffness_N",
    "bending_stiffness_Nmm2",
    "torsion_stiffness_Nmm2",
)


class BeamTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """`[beam]`: by its stiffnesses, or as a round bar by diameter and modulus."""

    span_mm: Number | None = None
    axis_mm: list[Point] | None = None
    elements: int = 240
    ends: tuple[SceneEnd, SceneEnd] = ("clamped", "clamped")
    stations_mm: list[Number] | None = None
    axial_stiffness_N: Numbers | None = None  # noqa: N815 (units are written as they are)
    shear_stiffness_N: Numbers | None = None  # noqa: N815
    shear_across_N: Numbers | None = None  # noqa: N815
    bending_stiffness_Nmm2: Numbers | None = None  # noqa: N815
    bending_across_Nmm2: Numbers | None = None  # noqa: N815
    torsion_stiffness_Nmm2: Numbers | None = None  # noqa: N815
    diameter_mm: Number | None = None
    modulus_MPa: Number | None = None  # noqa: N815
    poisson_ratio: Number = 0.3
    break_stress_MPa: Number | None = None  # noqa: N815
    law: LawName | None = None
    stiffening: Number | None = None
    radius_mm: Numbers | None = None
    plane: bool = False

    def axis_length(self) -> float | None:
        """Return the length of a curved axis, mm."""
        if self.axis_mm is None:
            return None
        return float(axis_line(np.array(self.axis_mm, dtype=np.float64))[0][-1])

    def made(self, nodes_at: list[float]) -> SpaceBeam:
        """Return the beam, with nodes where hooks take hold."""
        if (self.span_mm is None) == (self.axis_mm is None):
            raise ValueError("[beam] needs either span_mm or axis_mm")
        axis = None if self.axis_mm is None else np.array(self.axis_mm, dtype=np.float64)
        free: list[End] = ["free" if each == "joined" else each for each in self.ends]
        ends = free[0], free[1]
        if self.diameter_mm is not None or self.modulus_MPa is not None:
            given = [name for name in STIFFNESSES if getattr(self, name) is not None]
            if given or self.diameter_mm is None or self.modulus_MPa is None:
                raise ValueError(
                    "[beam] needs either its stiffnesses or diameter_mm and modulus_MPa, got "
                    f"{', '.join([*given, 'diameter_mm' if self.diameter_mm else 'modulus_MPa'])}"
                )
            # With an axis the span only has to be above zero: the axis has a length of its own.
            bar = Beam.round(
                span=1.0 if self.span_mm is None else self.span_mm,
                diameter=self.diameter_mm,
                modulus=self.modulus_MPa,
                poisson_ratio=self.poisson_ratio,
            )
            law = law_named(self.law or "linear", stiffening=self.stiffening)
            return SpaceBeam.of(
                bar, law=law, elements=self.elements, ends=ends, axis=axis, nodes_at=nodes_at
            )
        if self.break_stress_MPa is not None:
            raise ValueError("break_stress_MPa of [beam] goes with diameter_mm and modulus_MPa")
        if self.law is not None or self.stiffening is not None:
            raise ValueError("law of [beam] goes with diameter_mm and modulus_MPa")
        missing = [name for name in STIFFNESSES if getattr(self, name) is None]
        if missing:
            raise ValueError(f"[beam] needs {', '.join(missing)}")
        columns = [
            self.axial_stiffness_N,
            self.shear_stiffness_N if self.shear_across_N is None else self.shear_across_N,
            self.shear_stiffness_N,
            self.torsion_stiffness_Nmm2,
            self.bending_stiffness_Nmm2,
            self.bending_stiffness_Nmm2
            if self.bending_across_Nmm2 is None
            else self.bending_across_Nmm2,
        ]
        stations = None if self.stations_mm is None else np.array(self.stations_mm, np.float64)
        rows = [_row(each, stations, "a stiffness of [beam]") for each in columns]
        stiffness = np.stack(np.broadcast_arrays(*rows), axis=-1)
        # The radius of a full round bar with these stiffnesses where none is given.
        ratio = np.maximum(stiffness[..., 4], 0.0) / np.maximum(stiffness[..., 0], 1e-300)
        radius = 2.0 * np.sqrt(np.maximum(ratio, 1e-30))
        if self.radius_mm is not None:
            radius = _row(self.radius_mm, stations, "radius_mm of [beam]")
        return SpaceBeam.from_axis(
            elements=self.elements,
            stiffness=stiffness,
            span=None if self.span_mm is None else float(self.span_mm),
            axis=axis,
            ends=ends,
            stations=stations,
            radius=radius,
            nodes_at=nodes_at,
        )


class PatchTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A stretch of a bed whose strands are `factor` times as stiff and tough."""

    from_mm: Number
    to_mm: Number
    factor: Number


class BedTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """`[bed]`, or one of several `[[bed]]`: by its own numbers or by a preset."""

    preset: str | None = None
    seed: int = 1
    from_mm: Number | None = None
    to_mm: Number | None = None
    strands: int | None = None
    stations_mm: list[Number] | None = None
    stiffness_N_mm2: Numbers | None = None  # noqa: N815
    toughness_N: Numbers | None = None  # noqa: N815
    strength_N_mm: Number | None = None  # noqa: N815
    softening: Number | None = None
    two_sided: bool = False
    floor_N_mm2: Number | None = None  # noqa: N815
    gap_mm: Number | None = None
    around_deg: Number | None = None
    fan_deg: Number | None = None
    slack_mm: Number | None = None
    scatter: Number | None = None
    stiffness_scatter: Number | None = None
    jitter: Number | None = None
    patch: list[PatchTable] = []

    def made(self, beam: SpaceBeam) -> Bed:
        """Return the bed under a beam."""
        patches = tuple(Patch(each.from_mm, each.to_mm, each.factor) for each in self.patch)
        own: dict[str, float] = {"bilateral": True} if self.two_sided else {}
        for name, field, value in (
            ("softening", "softening", self.softening),
            ("floor_N_mm2", "floor", self.floor_N_mm2),
            ("gap_mm", "gap", self.gap_mm),
            ("around_deg", "around", _radians(self.around_deg)),
            ("fan_deg", "fan", _radians(self.fan_deg)),
            ("slack_mm", "slack", self.slack_mm),
            ("scatter", "scatter", self.scatter),
            ("stiffness_scatter", "stiffness_scatter", self.stiffness_scatter),
            ("jitter", "jitter", self.jitter),
        ):
            if value is not None:
                own[field] = finite(value, f"{name} of [bed]", "")
        first = None if self.from_mm is None else float(self.from_mm)
        last = None if self.to_mm is None else float(self.to_mm)
        if self.preset is not None:
            given = [
                name
                for name in ("stiffness_N_mm2", "toughness_N", "strength_N_mm", "stations_mm")
                if getattr(self, name) is not None
            ]
            if given:
                raise ValueError(f"a preset brings its own strands; leave out {', '.join(given)}")
            bed = bed_named(self.preset).bed(
                beam, seed=self.seed, strands=self.strands, from_mm=first, to_mm=last
            )
            return with_own(bed, own).with_patch(*patches)
        if self.stiffness_N_mm2 is None:
            raise ValueError("[bed] needs a preset, or stiffness_N_mm2 and toughness_N")
        if (self.toughness_N is None) == (self.strength_N_mm is None):
            raise ValueError("[bed] needs either toughness_N or strength_N_mm")
        softening = 2.0 if self.softening is None else float(self.softening)
        toughness = _values(self.toughness_N)
        if self.strength_N_mm is not None:
            # Its energy to part: G = p^2 softening / (2 k), p the force for each mm at its peak.
            strength = positive(self.strength_N_mm, "strength_N_mm of [bed]", "N/mm")
            if isinstance(self.stiffness_N_mm2, list):
                raise ValueError("strength_N_mm of [bed] goes with one stiffness_N_mm2")
            stiffness = positive(self.stiffness_N_mm2, "stiffness_N_mm2 of [bed]", "N/mm^2")
            toughness = strength * strength * softening / (2.0 * stiffness)
        stiffness = _values(self.stiffness_N_mm2)
        assert stiffness is not None  # noqa: S101
        assert toughness is not None  # noqa: S101
        return with_own(
            Bed(
                from_mm=first,
                to_mm=last,
                strands=480 if self.strands is None else self.strands,
                stiffness=stiffness,
                toughness=toughness,
                stations=None if self.stations_mm is None else tuple(map(float, self.stations_mm)),
                patches=patches,
                seed=self.seed,
            ),
            own,
        )


class TubeTable(BeamTable, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """`[[tube]]`: a beam of a network, with a name; its axis is `points_mm`."""

    name: str
    points_mm: list[Point]


class JoinTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """`[[join]]`: an end of a tube fixed to a place of one that stands earlier."""

    tube: str
    end: Literal[0, 1]
    to: str
    at_mm: Number | Literal["begin", "end"]
    stiff: Number = 1.0

    def station(self, to: SpaceBeam | float) -> float:
        """Return the place on the tube that is joined, mm."""
        span = to.span if isinstance(to, SpaceBeam) else to
        if self.at_mm == "begin":
            return 0.0
        at = span if self.at_mm == "end" else finite(self.at_mm, "at_mm of [[join]]", "mm")
        return span if span < at <= span * (1.0 + JUST_BEYOND) else at


class LayerTable(BedTable, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """`[[layer]]`: strands from a tube to the bed, or to another tube."""

    tube: str
    to: str = "bed"
    reach_mm: Number | None = None
    side: Literal["facing", "front", "back"] = "facing"


class StrandTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """`[[strand]]`: one strand by itself."""

    at_mm: Number
    stiffness_N_mm: Number  # noqa: N815
    offset_mm: Span = (0.0, 0.0)
    foot_mm: Point | None = None
    gap_mm: Number = 3.0
    slack_mm: Number = 0.0
    softening: Number = 2.0
    toughness_mJ: Number | None = None  # noqa: N815
    strength_N: Number | None = None  # noqa: N815
    yield_mm: Number | None = None
    part_mm: Number | None = None
    two_sided: bool = False

    def made(self, beam: SpaceBeam, number: int) -> Strands:
        """Return the strand as a row of one."""
        name = f"[[strand]] {number}"
        at = finite(self.at_mm, f"at_mm of {name}", "mm")
        if not 0.0 <= at <= beam.span:
            raise ValueError(
                f"{name} at {at:g} mm is not on the beam, which runs from 0 to {beam.span:g} mm"
            )
        k = positive(self.stiffness_N_mm, f"stiffness_N_mm of {name}", "N/mm")
        softening = finite(self.softening, f"softening of {name}", "")
        given = [self.toughness_mJ, self.strength_N, self.yield_mm]
        if sum(each is not None for each in given) != 1:
            raise ValueError(f"{name} needs one of toughness_mJ, strength_N and yield_mm")
        if self.toughness_mJ is not None:
            toughness = positive(self.toughness_mJ, f"toughness_mJ of {name}", "mJ")
            yields = math.sqrt(2.0 * toughness / (k * softening)) if softening >= 1.0 else 1.0
        elif self.strength_N is not None:
            yields = positive(self.strength_N, f"strength_N of {name}", "N") / k
        else:
            yields = positive(self.yield_mm or 0.0, f"yield_mm of {name}", "mm")
        if self.part_mm is not None:
            softening = positive(self.part_mm, f"part_mm of {name}", "mm") / yields
        if softening < 1.0:
            raise ValueError(f"{name} must part beyond its yield, got a softening of {softening:g}")
        slack = finite(self.slack_mm, f"slack_mm of {name}", "mm")
        if slack < 0.0:
            raise ValueError(f"slack_mm of {name} must be 0 or more, got {slack:g} mm")
        if self.two_sided and slack > 0.0:
            raise ValueError(f"{name} is two_sided and cannot be slack, got {slack:g} mm")
        place, frame = beam.frames_at(np.array([at]))
        y, z = (finite(each, f"offset_mm of {name}", "mm") for each in self.offset_mm)
        end = place[0] + y * frame[0, 1] + z * frame[0, 2]
        if self.foot_mm is None:
            foot = end - positive(self.gap_mm, f"gap_mm of {name}", "mm") * frame[0, 2]
        else:
            foot = np.array([finite(each, f"foot_mm of {name}", "mm") for each in self.foot_mm])
        length = float(np.sqrt(((end - foot) ** 2).sum()))
        if length <= 0.0:
            raise ValueError(f"{name} has no length: its foot is where it holds the beam")
        one = np.ones(1)
        return Strands(
            at * one,
            end[None],
            foot[None],
            k * one,
            (length + slack) * one,
            yields * one,
            softening * yields * one,
            one if self.two_sided else 0.0 * one,
        )


class HandTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """`[[hand]]`: a hook and its path."""

    at_mm: Number
    path_mm: list[Point] | None = None
    path_N: list[Point] | None = None  # noqa: N815
    steps: Steps = 100
    directions: str = "xyz"
    from_step: int = 0
    until_step: int | None = None
    tube: str | None = None

    def made(self) -> Hand:
        """Return the hand."""
        if (self.path_mm is None) == (self.path_N is None):
            raise ValueError("[[hand]] needs either path_mm or path_N")
        path = self.path_mm if self.path_mm is not None else self.path_N
        assert path is not None  # noqa: S101
        if not self.directions or set(self.directions) - set(DIRECTIONS):
            raise ValueError(f"directions of [[hand]] are of x, y and z, not {self.directions!r}")
        if self.path_N is not None and self.directions != "xyz":
            raise ValueError("directions of [[hand]] go with path_mm: a force holds nothing")
        return Hand(
            at=float(self.at_mm),
            path=tuple((float(x), float(y), float(z)) for x, y, z in path),
            by="displacement" if self.path_mm is not None else "force",
            steps=_steps(self.steps),
            along=("x" in self.directions, "y" in self.directions, "z" in self.directions),
            from_step=self.from_step,
            until_step=self.until_step,
            tube=self.tube,
        )


class RodTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """`[[rod]]`: a blunt rod among the strands and the path of its tip."""

    path_mm: list[Point]
    shaft: Point
    radius_mm: Number
    steps: Steps = 100
    from_step: int = 0

    def made(self) -> Rod:
        """Return the rod."""
        x, y, z = self.shaft
        return Rod(
            path=tuple((float(a), float(b), float(c)) for a, b, c in self.path_mm),
            shaft=(float(x), float(y), float(z)),
            radius=float(self.radius_mm),
            steps=_steps(self.steps),
            from_step=self.from_step,
        )


class TimeTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """`[time]`: how long a step takes, and how strands and walls relax meanwhile."""

    step_s: Number
    strands: str | Prony | None = None  # name of a shipped relaxation, or its constants
    wall: str | Prony | None = None

    def settings(self, steps: int) -> dict[str, Any]:
        """Return what `pull` takes for so many steps."""
        strands, wall = (
            relaxation_named(each) if isinstance(each, str) else each
            for each in (self.strands, self.wall)
        )
        if strands is None and wall is None:
            raise ValueError("[time] needs strands or wall, which relax: nothing else takes time")
        seconds = positive(self.step_s, "step_s of [time]", "s")
        for each in (self.strands, self.wall):
            if isinstance(each, Prony):
                each.made().within(seconds * steps)
        return {
            "step_seconds": seconds,
            "strand_relaxation": None if strands is None else strands.made(),
            "wall_relaxation": None if wall is None else wall.made(),
        }


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
    time: TimeTable | None = None  # no time goes by without it

    def played(self) -> History:
        """Move the hands along their paths."""
        if not self.hand and not self.rod:
            raise ValueError("a scene needs a [[hand]] or a [[rod]]")
        if self.tube:
            return self._network_played()
        if self.beam is None:
            raise ValueError("a scene needs a [beam], or [[tube]] tables")
        if self.join or self.layer or any(each.tube is not None for each in self.hand):
            raise ValueError("[[join]], [[layer]] and a hand's tube go with [[tube]], not [beam]")
        if "joined" in self.beam.ends:
            raise ValueError("an end that is joined goes with [[tube]] and [[join]]")
        span = self.beam.axis_length()
        hands = [_on_axis(each, "at_mm", span).made() for each in self.hand]
        beam = self.beam.made([hand.at for hand in hands])
        tables = self.bed if isinstance(self.bed, list) else [] if self.bed is None else [self.bed]
        beds = [_on_axis(table, "to_mm", span).made(beam) for table in tables]
        strands = [bed.strands_under(beam) for bed in beds]
        strands += [
            _on_axis(each, "at_mm", span).made(beam, i + 1) for i, each in enumerate(self.strand)
        ]
        return pull(
            beam,
            Strands.joined(strands),
            hands,
            rods=[each.made() for each in self.rod],
            plane=self.beam.plane,
            floor=np.sum([bed.floor_under(beam) for bed in beds], axis=0) if beds else None,
            **self._timed,
        )

    @property
    def _timed(self) -> dict[str, Any]:
        if self.time is None:
            return {}
        each = [(table.from_step, table.steps) for table in (*self.hand, *self.rod)]
        steps = max(a + (sum(b) if isinstance(b, list) else b) for a, b in each)
        return self.time.settings(steps)

    def _network_played(self) -> History:
        """Move the hands along their paths at tubes that join."""
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
        joins = [
            Join(each.tube, each.end, each.to, each.station(tubes[each.to]), float(each.stiff))
            for each in self.join
        ]
        network = Network(tubes, joins)
        floor = {name: np.zeros(beam.stations.size) for name, beam in tubes.items()}
        strands: list[Strands] = []
        for number, layer in enumerate(self.layer):
            for name in (layer.tube, layer.to):
                if name not in tubes and not (name == "bed" and name == layer.to):
                    raise ValueError(f"[[layer]] {number + 1}: there is no tube {name!r}")
            beam = tubes[layer.tube]
            bed = _on_axis(layer, "to_mm", beam.span).made(beam)
            if layer.to == "bed":
                made = bed.strands_under(beam)
                tube = np.full(made.count, list(tubes).index(layer.tube))
                strands.append(replace(made, tubes=tube))
                floor[layer.tube] += bed.floor_under(beam)
            else:
                reach = math.inf if layer.reach_mm is None else float(layer.reach_mm)
                strands.append(
                    bed.strands_between(network, layer.tube, layer.to, reach=reach, side=layer.side)
                )
        hands = [
            _on_axis(each, "at_mm", tubes[each.tube or next(iter(tubes))].span)
            if each.tube is None or each.tube in tubes
            else each
            for each in self.hand
        ]
        return pull(
            network,
            Strands.joined(strands),
            [hand.made() for hand in hands],
            rods=[each.made() for each in self.rod],
            plane=any(each.plane for each in self.tube),
            floor=list(floor.values()),
            strength={
                each.name: float(each.break_stress_MPa)
                for each in self.tube
                if each.break_stress_MPa is not None
            },
            **self._timed,
        )

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
            node = to.places[int(np.argmin(np.abs(to.stations - join.station(to))))]
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
            if (hand.tube or first) == name and hand.at_mm <= length * (1.0 + JUST_BEYOND)
        }
        return whole.made(sorted(at for at in own if 0.0 < at < length))


def read_scene(path: Path) -> PeelScene:
    """Return the scene in a file."""
    content = read_bounded(path, MOST_BYTES, "scene")
    return decoded(msgspec.toml.decode, content, PeelScene, str(path))


def with_own(bed: Bed, own: dict[str, float]) -> Bed:
    """Return a bed with some of its numbers replaced."""
    return replace(bed, **own)  # pyright: ignore[reportArgumentType]


def _on_axis(table: TableT, field: str, length: float | None) -> TableT:
    """Return a table whose place is the end of a curved axis where it is just beyond it."""
    # Who writes an arc's length knows it without its spline's last digits.
    place = getattr(table, field)
    if length is None or place is None or not length < place <= length * (1.0 + JUST_BEYOND):
        return table
    return msgspec.structs.replace(table, **{field: length})


def _radians(degrees: Number | None) -> float | None:
    return None if degrees is None else math.radians(degrees)


def _steps(steps: Steps) -> int | tuple[int, ...]:
    return tuple(steps) if isinstance(steps, list) else steps


def _values(value: Numbers | None) -> float | tuple[float, ...] | None:
    if value is None:
        return None
    return tuple(map(float, value)) if isinstance(value, list) else float(value)


def _row(value: Numbers | None, stations: np.ndarray | None, name: str) -> np.ndarray:
    """Return a number for each station, or one."""
    row = np.array(value, dtype=np.float64)
    if row.ndim == 1 and (stations is None or row.size != stations.size):
        raise ValueError(f"{name} has {row.size} numbers; give stations_mm with as many")
    return row
