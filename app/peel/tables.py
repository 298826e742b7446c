"""Tables of a scene, as its TOML file has them (docs/peel.md), and what each stands for."""

import math
from dataclasses import replace
from typing import Any, Literal, TypeVar

import msgspec
import numpy as np

from app.bed_preset import bed_named
from app.relaxation_preset import Prony, relaxation_named
from physics import Beam, LawName, law_named
from physics.bed import (
    Bed,
    End,
    Fluid,
    Hand,
    Patch,
    Rod,
    SpaceBeam,
    Strands,
)  # fmt: skip
from physics.bed.space_beam import axis_line, beyond
from physics.quantity import finite, positive

Number = int | float
Numbers = Number | list[Number]
Point = tuple[Number, Number, Number]
Steps = int | list[int]
Span = tuple[Number, Number]
SceneEnd = End | Literal["joined"]
TableT = TypeVar("TableT", bound=msgspec.Struct)

DIRECTIONS = {"x": 0, "y": 1, "z": 2}
STIFFNESSES = (
    "axial_stiffness_N",
    "shear_stiffness_N",
    "bending_stiffness_N_mm2",
    "torsion_stiffness_N_mm2",
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
    bending_stiffness_N_mm2: Numbers | None = None  # noqa: N815
    bending_across_N_mm2: Numbers | None = None  # noqa: N815
    torsion_stiffness_N_mm2: Numbers | None = None  # noqa: N815
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

    def build(self, nodes_at: list[float]) -> SpaceBeam:
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
            self.torsion_stiffness_N_mm2,
            self.bending_stiffness_N_mm2,
            self.bending_stiffness_N_mm2
            if self.bending_across_N_mm2 is None
            else self.bending_across_N_mm2,
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
    stiffness_N_per_mm2: Numbers | None = None  # noqa: N815
    toughness_N: Numbers | None = None  # noqa: N815
    strength_N_per_mm: Number | None = None  # noqa: N815
    softening: Number | None = None
    bilateral: bool = False
    floor_N_per_mm2: Number | None = None  # noqa: N815
    gap_mm: Number | None = None
    around_deg: Number | None = None
    fan_deg: Number | None = None
    slack_mm: Number | None = None
    scatter: Number | None = None
    stiffness_scatter: Number | None = None
    jitter: Number | None = None
    patch: list[PatchTable] = []

    def build(self, beam: SpaceBeam) -> Bed:
        """Return the bed under a beam."""
        patches = tuple(Patch(each.from_mm, each.to_mm, each.factor) for each in self.patch)
        own: dict[str, Any] = {"bilateral": True} if self.bilateral else {}
        for field, value in (
            ("softening", self.softening),
            ("floor", self.floor_N_per_mm2),
            ("gap", self.gap_mm),
            ("around", None if self.around_deg is None else math.radians(self.around_deg)),
            ("fan", None if self.fan_deg is None else math.radians(self.fan_deg)),
            ("slack", self.slack_mm),
            ("scatter", self.scatter),
            ("stiffness_scatter", self.stiffness_scatter),
            ("jitter", self.jitter),
        ):
            if value is not None:
                own[field] = float(value)
        first = None if self.from_mm is None else float(self.from_mm)
        last = None if self.to_mm is None else float(self.to_mm)
        if self.preset is not None:
            given = [
                name
                for name in (
                    "stiffness_N_per_mm2",
                    "toughness_N",
                    "strength_N_per_mm",
                    "stations_mm",
                )
                if getattr(self, name) is not None
            ]
            if given:
                raise ValueError(f"a preset brings its own strands; leave out {', '.join(given)}")
            bed = bed_named(self.preset).bed(
                beam, seed=self.seed, strands=self.strands, from_mm=first, to_mm=last
            )
            return replace(bed, **own).with_patch(*patches)
        if self.stiffness_N_per_mm2 is None:
            raise ValueError("[bed] needs a preset, or stiffness_N_per_mm2 and toughness_N")
        if (self.toughness_N is None) == (self.strength_N_per_mm is None):
            raise ValueError("[bed] needs either toughness_N or strength_N_per_mm")
        softening = 2.0 if self.softening is None else float(self.softening)
        toughness = _values(self.toughness_N)
        if self.strength_N_per_mm is not None:
            # Its energy to part: G = p^2 softening / (2 k), p the force for each mm at its peak.
            strength = positive(self.strength_N_per_mm, "strength_N_per_mm of [bed]", "N/mm")
            if isinstance(self.stiffness_N_per_mm2, list):
                raise ValueError("strength_N_per_mm of [bed] goes with one stiffness_N_per_mm2")
            stiffness = positive(self.stiffness_N_per_mm2, "stiffness_N_per_mm2 of [bed]", "N/mm^2")
            toughness = strength * strength * softening / (2.0 * stiffness)
        stiffness = _values(self.stiffness_N_per_mm2)
        assert stiffness is not None  # noqa: S101
        assert toughness is not None  # noqa: S101
        return Bed(
            from_mm=first,
            to_mm=last,
            strands=480 if self.strands is None else self.strands,
            stiffness=stiffness,
            toughness=toughness,
            stations=None if self.stations_mm is None else tuple(map(float, self.stations_mm)),
            patches=patches,
            seed=self.seed,
            **own,
        )


class TubeTable(BeamTable, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """`[[tube]]`: a beam of a network, with a name; its axis is `points_mm`."""

    name: str
    points_mm: list[Point]
    fluid: str | None = None
    bore_radius_mm: Numbers | None = None
    fed_ends: list[Literal[0, 1]] | None = None

    def bore(self, beam: SpaceBeam) -> np.ndarray:
        """Return the (n,) radii at the tube's nodes, mm, within which its fluid flows."""
        name = f"bore_radius_mm of tube {self.name!r}"
        stations = None if self.stations_mm is None else np.array(self.stations_mm, np.float64)
        row = _row(self.bore_radius_mm, stations, name)
        if row.ndim and stations is not None:
            row = np.interp(beam.stations, stations, row)
        bore = np.broadcast_to(row, beam.stations.shape)
        for inner, outer in zip(bore.tolist(), beam.radius.tolist(), strict=True):
            if positive(inner, name, "mm") >= outer:
                raise ValueError(f"{name} must be below its radius of {outer:g} mm, got {inner:g}")
        return bore

    def fed(self) -> list[int]:
        """Return the ends through which the fluid comes: by themselves those that are clamped."""
        if self.fed_ends is None:
            return [end for end in range(2) if self.ends[end] == "clamped"]
        for end in self.fed_ends:
            if self.ends[end] == "joined":
                raise ValueError(
                    f"end {end} of tube {self.name!r} is in fed_ends and joined: what it joins "
                    "feeds it"
                )
        return sorted(set(self.fed_ends))


class FluidTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """`[[fluid]]`: what flows in tubes, and out where they have torn."""

    name: str
    viscosity_mPa_s: Number  # noqa: N815 (units are written as they are)
    pressure_kPa: Number  # noqa: N815
    supply_ml_per_s: Number
    volume_ml: Number

    def build(self) -> Fluid:
        """Return the fluid."""
        of = f"of [[fluid]] {self.name!r}"
        return Fluid(
            viscosity=1e-6 * positive(self.viscosity_mPa_s, f"viscosity_mPa_s {of}", "mPa s"),
            pressure=positive(self.pressure_kPa, f"pressure_kPa {of}", "kPa"),
            supply=1e3 * positive(self.supply_ml_per_s, f"supply_ml_per_s {of}", "ml/s"),
            volume=1e3 * positive(self.volume_ml, f"volume_ml {of}", "ml"),
        )


class JoinTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """`[[join]]`: an end of a tube fixed to a place of one that stands earlier."""

    tube: str
    end: Literal[0, 1]
    to: str
    at_mm: Number | Literal["begin", "end"]
    stiff: Number = 1.0
    face_mm: Number = 0.0

    def station(self, span: float) -> float:
        """Return the place on the tube that is joined, which is so long, mm."""
        if self.at_mm == "begin":
            return 0.0
        at = span if self.at_mm == "end" else finite(self.at_mm, "at_mm of [[join]]", "mm")
        return span if at > span and not beyond(at, span) else at


class LayerTable(BedTable, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """`[[layer]]`: strands from a tube to the bed, or to another tube."""

    tube: str
    to: str = "bed"
    reach_mm: Number | None = None
    side: Literal["facing", "front", "back"] = "facing"


class StrandTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """`[[strand]]`: one strand by itself."""

    at_mm: Number
    stiffness_N_per_mm: Number  # noqa: N815
    offset_mm: Span = (0.0, 0.0)
    foot_mm: Point | None = None
    gap_mm: Number = 3.0
    slack_mm: Number = 0.0
    softening: Number = 2.0
    toughness_mJ: Number | None = None  # noqa: N815
    strength_N: Number | None = None  # noqa: N815
    yield_mm: Number | None = None
    failure_mm: Number | None = None
    bilateral: bool = False

    def build(self, beam: SpaceBeam, number: int) -> Strands:
        """Return the strand as a row of one."""
        name = f"[[strand]] {number}"
        at = finite(self.at_mm, f"at_mm of {name}", "mm")
        if not 0.0 <= at <= beam.span:
            raise ValueError(
                f"{name} at {at:g} mm is not on the beam, which runs from 0 to {beam.span:g} mm"
            )
        k = positive(self.stiffness_N_per_mm, f"stiffness_N_per_mm of {name}", "N/mm")
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
        if self.failure_mm is not None:
            softening = positive(self.failure_mm, f"failure_mm of {name}", "mm") / yields
        if softening < 1.0:
            raise ValueError(f"{name} must part beyond its yield, got a softening of {softening:g}")
        slack = finite(self.slack_mm, f"slack_mm of {name}", "mm")
        if slack < 0.0:
            raise ValueError(f"slack_mm of {name} must be 0 or more, got {slack:g} mm")
        if self.bilateral and slack > 0.0:
            raise ValueError(f"{name} is bilateral and cannot be slack, got {slack:g} mm")
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
            one if self.bilateral else 0.0 * one,
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

    def build(self) -> Hand:
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

    def build(self) -> Rod:
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
    """`[time]`: how long a step takes; strands and walls relax meanwhile, and fluids flow."""

    step_s: Number
    strands: str | Prony | None = None  # name of a shipped relaxation, or its constants
    wall: str | Prony | None = None

    def settings(self, steps: int, *, flows: bool) -> dict[str, Any]:
        """Return what `pull` takes for so many steps, in which a fluid `flows` or none does."""
        strands, wall = (
            relaxation_named(each) if isinstance(each, str) else each
            for each in (self.strands, self.wall)
        )
        if strands is None and wall is None and not flows:
            raise ValueError(
                "[time] needs strands or wall, which relax, or a tube with a fluid, which flows: "
                "nothing else takes time"
            )
        seconds = positive(self.step_s, "step_s of [time]", "s")
        for each in (self.strands, self.wall):
            if isinstance(each, Prony):
                each.made().within(seconds * steps)
        return {
            "step_seconds": seconds,
            "strand_relaxation": None if strands is None else strands.made(),
            "wall_relaxation": None if wall is None else wall.made(),
        }


def on_axis(table: TableT, field: str, length: float | None) -> TableT:
    """Return a table whose place is the end of a curved axis where it is just beyond it."""
    # Who writes an arc's length knows it without its spline's last digits.
    place = getattr(table, field)
    if length is None or place is None or place <= length or beyond(place, length):
        return table
    return msgspec.structs.replace(table, **{field: length})


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
