"""A patient's anatomy from a volume of labels: an anatomy file and an organ of each tube.

The anatomy's frame has x to the head, y to the patient's right and z to the front; the duct of the
gallbladder joins the common duct at (28, 0, 0), as in the anatomies that ship. What labels do not
tell, walls, strengths and tissue, is assumed by kind.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import count, product
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypeAlias, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from app.anatomy.anatomy_file import anatomy_toml, check_tables
from app.anatomy.anatomy_geometry import (
    TubeLine,
    crossings,
    joined_places,
    tube_line,
    tube_lines,
)
from app.anatomy.frequencies import frequencies
from app.anatomy.hepatocystic_triangle import ARTERY_AT_MM, ARTERY_ROOT, wavy_course
from app.anatomy.tables import (
    HEAD_RIGHT_FRONT,
    Anatomy,
    JoinTable,
    LayerTable,
    Place,
    Point,
    TableError,
    TouchTable,
    TubeEnd,
    TubeKind,
    TubeTable,
)
from app.anatomy.tube_kinds import Role, kind_of_name, wall_of
from app.anatomy.tube_organ import ORGAN_SUFFIX, check_organs, organ_content, organ_text
from app.bounded_file import decoded, read_bounded
from organ_geometry import LabelVolume, make_folder, write_atomic
from physics.bed import End

if TYPE_CHECKING:
    from organ_geometry import LabelTubes

Floats = NDArray[np.float64]
TubeEndName: TypeAlias = tuple[str, Literal[0, 1]]
"""A tube's name, and its first end or its last."""

MOST_BYTES = 1_000_000
"""Size of a file of names."""
_LONGEST_NAME, _NO_NAME = 100, '/\\:*?"<>|'  # of a file, on any system
_SLACK = 0.95  # on the range of what sizes are usual
_LEAST_MM = 5.0  # A volume of a person's tubes is no shorter.
_HEPATIC_ARTERY = "right_hepatic_artery"
# What is tried of a cystic artery's course: origins along the hepatic artery from the nearest, and
# its least length, of the distance.
_ORIGINS_MM, _SLACKS = (0.0, 5.0, -5.0, 10.0, -10.0), (1.0, 1.1, 1.25)
_KINDS = ("duct", "artery", "vein", "organ", "shown")
# Where the duct of the gallbladder joins, in the anatomy's frame, as in those that ship.
_JOIN_MM = np.array([28.0, 0.0, 0.0])
_POINT_RADII, _POINT_MM = 2.0, 3.0  # between points of an axis in the file
_MOST_POINTS, _FEWEST_POINTS = 40, 4
# Between tubes so near over so long a stretch, tissue is assumed, of so many strands a mm.
_NEAR_MM, _NEAR_LENGTH_MM, _STRANDS_MM = 8.0, 5.0, 5.0


class NamedLabel(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A label's name, and its kind where the name does not say it."""

    name: str
    kind: Role | None = None

    @property
    def role(self) -> Role:
        """What it is; a ValueError where neither kind nor name says it."""
        kind = kind_of_name(self.name) if self.kind is None else self.kind
        if kind is None:
            raise ValueError(
                f"{self.name!r} is no kind of tube that is known by its name: give its label "
                f'{{"name": "{self.name}", "kind": "..."}} in the names, of {", ".join(_KINDS)}'
            )
        return kind


@dataclass(frozen=True, slots=True, eq=False)
class PatientCase:
    """An anatomy found in labels, its tubes with their organs, and what is left out."""

    anatomy: Anatomy
    tubes: "LabelTubes"
    left_out: tuple[str, ...]
    doubts: tuple[str, ...]


def named_labels(volume: LabelVolume, names: Path | None) -> dict[int, NamedLabel]:
    """Return the names of a volume's labels: of a JSON file, or of the volume's own header.

    Parameters
    ----------
    volume
        The labels.
    names
        ``{"1": "gallbladder", "7": {"name": "branch 7", "kind": "artery"}}``, or None.

    Returns
    -------
    dict[int, NamedLabel]
        By label; labels that have no name are not among them.

    Raises
    ------
    ValueError
        If nothing is named, a name stands twice, or a named label is not in the volume.
    """
    present = volume.labels
    if names is None:
        # Segments may be empty, as those of a template that nobody has drawn.
        found = {
            label: NamedLabel(name, _kind_by_term(name, volume.terms.get(label, "")))
            for label, name in volume.names.items()
            if label in present
        }
        where = str(volume.source)
        if not found:
            listed = ", ".join(map(str, present)) or "it has none"
            raise ValueError(
                f"{where} names none of its labels ({listed}): give their names with --names, a "
                f'JSON file as {{"1": "common duct", "2": "cystic duct"}}'
            )
    else:
        content = read_bounded(names, MOST_BYTES, "file of names")
        table = decoded(msgspec.json.decode, content, dict[str, str | NamedLabel], str(names))
        written: list[tuple[str, object]] = json.loads(content, object_pairs_hook=list)
        for label, _ in written:
            if len(written) > len(table) and [each for each, _ in written].count(label) > 1:
                raise ValueError(f"{names} names label {label} twice")
            if not label.isdecimal():
                raise ValueError(
                    f'{names} names {label!r}, which is no label: labels are whole numbers, as "1"'
                )
        # 0 is what is of no label, and some write its name.
        found = {
            int(label): NamedLabel(name) if isinstance(name, str) else name
            for label, name in table.items()
            if int(label) != 0
        }
        where = str(names)
        if not found:
            raise ValueError(f"{where} names no label")
    for label, named in found.items():
        if label not in present:
            listed = ", ".join(map(str, present)) or "none"
            raise ValueError(
                f"{where} names label {label} ({named.name}), which {volume.source} does not have; "
                f"it has {listed}"
            )
        stem = _stem(named.name)
        if (
            not stem.isprintable()
            or not 0 < len(stem.encode()) <= _LONGEST_NAME
            or stem.startswith(".")
            or set(stem) & set(_NO_NAME)
        ):
            raise ValueError(
                f"label {label} needs a name that can be a file's, up to {_LONGEST_NAME} bytes "
                f"long, not {named.name[:_LONGEST_NAME]!r}"
            )
    stems = [_stem(named.name) for named in found.values()]
    for label, stem in zip(found, stems, strict=True):
        if stems.count(stem) > 1:
            raise ValueError(
                f"{where} names {stems.count(stem)} labels {found[label].name!r}: each tube has a "
                f"name of its own"
            )
    return found


def patient_case(
    volume: LabelVolume,
    names: Mapping[int, NamedLabel],
    *,
    name: str = "patient",
    draw_artery: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> PatientCase:
    """Return the anatomy of the tubes among named labels.

    Parameters
    ----------
    volume, names
        The labels and their names; kinds `shown` are left out.
    name
        The anatomy's.
    draw_artery
        Whether a cystic artery, which no label has, is drawn in by published frequencies.
    progress
        Called with how many steps of how many are done.

    Returns
    -------
    PatientCase
        With what a surgeon should look at before it is practised on.

    Raises
    ------
    ValueError
        If a label is no tube, a kind is not known, or nothing is left.
    """
    steps = 2 * len(names)
    step = count(1)

    def done() -> None:
        if progress is not None:
            progress(min(next(step), steps), steps)

    builder = CaseBuilder(volume, names, name, done=done)
    return builder.build(CaseChoices(draw_artery=draw_artery), done=done)


class CaseChoices(msgspec.Struct, frozen=True):
    """What is chosen of a case in place of what was found.

    Attributes
    ----------
    without
        Names of tubes that are left out.
    joins
        By tube and end: the tube that it joins, or None where it joins none.
    held
        By tube and end: how an end that joins none is held.
    draw_artery
        Whether a cystic artery, which no label has, is drawn in by published frequencies.
    """

    without: frozenset[str] = frozenset()
    joins: Mapping[TubeEndName, str | None] = {}
    held: Mapping[TubeEndName, End] = {}
    draw_artery: bool = False


class CaseBuilder:
    """The tubes among a volume's named labels, of which cases are made by choices.

    Parameters
    ----------
    volume, names, name
        As `patient_case` has them.
    done
        Called when a label has been looked at.

    Raises
    ------
    ValueError
        If a label is no tube, a kind is not known, or nothing is left.
    """

    def __init__(
        self,
        volume: LabelVolume,
        names: Mapping[int, NamedLabel],
        name: str = "patient",
        *,
        done: Callable[[], object] = lambda: None,
    ) -> None:
        longest = float((volume.sizes * volume.values.shape[::-1]).max())
        if longest < _LEAST_MM:
            raise ValueError(
                f"{volume.source} is {longest:.2g} mm long, which looks like a slip of the unit: a "
                f"voxel would be {float(volume.sizes.max()):.2g} mm"
            )
        self.name, self._source = name, volume.source.name
        kinds: dict[str, TubeKind] = {}
        tubes: dict[int, str] = {}
        sizes = volume.label_sizes()
        left_out = [f"label {label}" for label in sizes if label not in names]
        left_out += [f"{name}, empty" for label, name in volume.names.items() if label not in sizes]
        for label, named in names.items():
            role = named.role
            if role == "shown":
                left_out.append(named.name)
            else:
                tubes[label] = _stem(named.name)
                kinds[tubes[label]] = role
        self._left_out = tuple(left_out)
        # Ducts first, then by size: the first tube is the one that others join.
        order = sorted(tubes, key=lambda label: (kinds[tubes[label]] != "duct", -sizes[label]))
        from organ_geometry import found_tubes  # needs scipy, which is of an extra

        self.found = found_tubes(volume, {label: tubes[label] for label in order}, done=done)
        # Branches of a label, which are tubes of their own, are of its kind.
        split = self.found.split
        self.kinds: dict[str, TubeKind] = {
            split.names[each]: kinds[tubes[split.first[each]]] for each in split.axes
        }

    @property
    def takes_artery(self) -> bool:
        """Whether a cystic artery can be drawn in: none is there, and what it joins is."""
        return not self._has_artery and {"gallbladder", _HEPATIC_ARTERY} <= self.kinds.keys()

    @property
    def _has_artery(self) -> bool:
        return any("cystic" in tube and kind == "artery" for tube, kind in self.kinds.items())

    def build(
        self,
        choices: CaseChoices = CaseChoices(),  # noqa: B008 (frozen)
        *,
        done: Callable[[], object] = lambda: None,
    ) -> PatientCase:
        """Return the case of some choices; `done` is called when a tube is made."""
        if not self.kinds.keys() - choices.without:
            raise ValueError("every tube is left out: a case needs one")
        joins = None
        if choices.joins:
            joins = [
                self.found.join(tube, end, to)
                for (tube, end), to in choices.joins.items()
                if to is not None
            ]
            taken = {(join.tube, join.end) for join in joins} | choices.joins.keys()
            joins += [each for each in self.found.joins if (each.tube, each.end) not in taken]
        found = self.found.tubes(joins, choices.without, done=done)
        kinds: dict[str, TubeKind] = {tube.name: self.kinds[tube.name] for tube in found.tubes}
        anatomy = _anatomy(self._source, found, kinds, self.name, choices.held)
        doubts = [
            *found.doubts, *_alone(anatomy, kinds), *_unusual(found), *_mirrored(found, kinds)
        ]  # fmt: skip
        if choices.draw_artery:
            if self._has_artery:
                raise ValueError("a label is a cystic artery already: none is drawn in")
            anatomy = with_cystic_artery(anatomy)
        elif self.takes_artery:
            doubts.append("no label is a cystic artery: --draw-artery draws one in, assumed")
        left_out = (*self._left_out, *sorted(choices.without))
        return PatientCase(anatomy, found, left_out, tuple(doubts))


def with_cystic_artery(anatomy: Anatomy) -> Anatomy:
    """Return an anatomy with an artery from the right hepatic one to the gallbladder, assumed.

    It has the mean diameter of the frequencies and, where the two are not further apart, their mean
    length. Of several origins and courses the first that keeps clear of the other tubes is taken.

    Parameters
    ----------
    anatomy
        With a `gallbladder` and a `right_hepatic_artery`.

    Returns
    -------
    Anatomy
        With a tube `cystic_artery`, its two joins and the tissue around it.

    Raises
    ------
    ValueError
        If one of the two is missing, or no course keeps clear.
    """
    lines = tube_lines(anatomy)
    if not {"gallbladder", _HEPATIC_ARTERY} <= lines.keys():
        raise ValueError(
            f"a cystic artery is drawn from a tube named {_HEPATIC_ARTERY} to one named "
            f"gallbladder; there are {', '.join(lines)}"
        )
    gallbladder, hepatic = lines["gallbladder"], lines[_HEPATIC_ARTERY]
    # The neck is the end that the cystic duct joins, or else the narrower.
    ends = [join.at_mm for join in anatomy.join if join.to == "gallbladder"]
    narrow = "begin" if gallbladder.radius[0] < gallbladder.radius[-1] else "end"
    neck = next((end for end in ends if isinstance(end, str)), narrow)
    on = ARTERY_AT_MM if neck == "begin" else gallbladder.length - ARTERY_AT_MM
    target = gallbladder.at(on)
    nearest = hepatic.nearest(target)
    sizes = frequencies().size
    radius = round(0.5 * sizes["cystic_artery_diameter_mm"].mean, 3)
    inside = gallbladder.radius_at(on)
    length = sizes["cystic_artery_length_mm"].mean + inside + float(hepatic.radius.mean())
    wall = wall_of("artery")
    fault: ValueError | None = None
    turns = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False).tolist()
    for off, slack, turn in product(_ORIGINS_MM, _SLACKS, turns):
        origin = min(max(nearest + off, 2.0), hepatic.length - 2.0)
        start = hepatic.at(origin)
        least = slack * float(np.linalg.norm(target - start))
        points = wavy_course(start, target, max(length, least), turn)
        tube = TubeTable(
            name="cystic_artery",
            kind="artery",
            points_mm=[cast("Point", tuple(point)) for point in (points.round(3) + 0.0).tolist()],
            radius_mm=radius,
            wall_mm=wall.thickness([radius]),
            modulus_MPa=wall.modulus_MPa,
            strength_MPa=wall.strength_MPa,
            stretch_at_break=wall.stretch_at_break,
            ends=("joined", "joined"),
            fluid=wall.fluid,
            source="drawn by published frequencies; no label has it",
            confidence="assumed",
            confidence_wall=wall.confidence,
        )
        joins = [
            JoinTable(
                tube=tube.name,
                end=0,
                to=_HEPATIC_ARTERY,
                at_mm=round(origin, 3),
                stiff=ARTERY_ROOT,
                face_mm=round(hepatic.radius_at(origin), 3),
            ),
            JoinTable(
                tube=tube.name,
                end=1,
                to="gallbladder",
                at_mm=round(on, 3),
                face_mm=round(inside, 3),
            ),
        ]
        drawn = msgspec.structs.replace(
            anatomy, tube=[*anatomy.tube, tube], join=[*anatomy.join, *joins]
        )
        try:
            lines = tube_lines(drawn)
        except TableError as error:
            fault = error
        else:
            return msgspec.structs.replace(drawn, layer=_layers(drawn, lines))
    raise ValueError(f"no course of a cystic artery keeps clear of the other tubes: {fault}")


def write_case(anatomy: Anatomy, folder: Path) -> list[Path]:
    """Write an anatomy and its organs, a file each, into a folder and return the files."""
    make_folder(folder, f"a case needs a folder to write into, and {folder} cannot be one")
    files: list[Path] = []
    tubes: list[TubeTable] = []
    for tube in anatomy.tube:
        if (content := organ_content(tube)) is not None:
            files.append(folder / f"{tube.name}{ORGAN_SUFFIX}")
            write_atomic(files[-1], content)
            tube = msgspec.structs.replace(tube, organ=files[-1].name)
        tubes.append(tube)
    files.append(folder / "anatomy.toml")
    write_atomic(files[-1], anatomy_toml(msgspec.structs.replace(anatomy, tube=tubes)).encode())
    return files


def _stem(name: str) -> str:
    return "_".join(name.split()).lower()


def _kind_by_term(name: str, term: str) -> Role | None:
    """Return what a name means, or else a term of a terminology, as SCT^51114001^Artery."""
    return kind_of_name(name) or kind_of_name(term.rpartition("^")[2])


def _anatomy(
    source: str,
    found: "LabelTubes",
    kinds: dict[str, TubeKind],
    name: str,
    held: Mapping[TubeEndName, End],
) -> Anatomy:
    rows = np.array(HEAD_RIGHT_FRONT)
    origin = (_middle(found, kinds) - _JOIN_MM @ rows).round(3)
    tables: list[TubeTable] = []
    joins: list[JoinTable] = []
    lines: dict[str, TubeLine] = {}
    for tube in found.tubes:
        organ, kind = tube.built.organ, kinds[tube.name]
        wall = wall_of(kind)
        count = round(organ.length / max(_POINT_RADII * organ.mean_radius, _POINT_MM)) + 1
        at = np.linspace(0.0, organ.length, min(max(count, _FEWEST_POINTS), _MOST_POINTS))
        points = (organ.axis_at(at) - origin) @ rows.T
        areas = organ.section_properties(at).area
        radii = np.sqrt(areas / np.pi).round(3).tolist()
        ends: list[TubeEnd] = ["free" if kind == "organ" else "clamped"] * 2
        for join in found.joins:
            if join.to == tube.name and join.place != "middle":
                ends[1 if join.place == "end" else 0] = "free"
        for (of, end), how in held.items():
            if of == tube.name:
                ends[end] = how
        for join in found.joins:
            if join.tube != tube.name:
                continue
            ends[join.end] = "joined"
            to = lines[join.to]
            end = -1 if join.end else 0
            where = join.place if join.place != "middle" else round(to.nearest(points[end]), 3)
            face = 0.0
            if where == "begin" or where == "end":
                points[end] = to.places[-1 if where == "end" else 0]
            else:
                points[end] = to.at(float(where))
                face = min(to.radius_at(float(where)), 0.5 * organ.length)
            joins.append(
                JoinTable(
                    tube=tube.name,
                    end=join.end,
                    to=join.to,
                    at_mm=where,
                    stiff=ARTERY_ROOT if kind == kinds[join.to] == "artery" else 1.0,
                    face_mm=round(face, 3),
                    miss_mm=round(join.miss, 3),
                    voxels=join.voxels,
                )
            )
        table = TubeTable(
            name=tube.name,
            kind=kind,
            organ=organ_text(organ.encoded),
            points_mm=[cast("Point", tuple(point)) for point in (points.round(3) + 0.0).tolist()],
            radius_mm=radii,
            wall_mm=wall.thickness(radii),
            modulus_MPa=wall.modulus_MPa,
            strength_MPa=wall.strength_MPa,
            stretch_at_break=wall.stretch_at_break,
            ends=(ends[0], ends[1]),
            elements=min(max(round(organ.length / max(organ.mean_radius, 1.5)), 6), 40),
            fluid=wall.fluid,
            source=f"{source} label {tube.label}",
            confidence="measured",
            confidence_wall=wall.confidence,
        )
        tables.append(table)
        lines[tube.name] = tube_line(table)
    anatomy = Anatomy(
        name=name,
        tube=tables,
        join=joins,
        place=Place(
            origin_LPS_mm=cast("Point", tuple((origin + 0.0).tolist())), rows_LPS=HEAD_RIGHT_FRONT
        ),
    )
    anatomy = msgspec.structs.replace(anatomy, touch=_touches(anatomy, lines, found))
    anatomy = msgspec.structs.replace(anatomy, layer=_layers(anatomy, lines))
    check_tables(anatomy)
    check_organs(anatomy, tube_lines(anatomy))
    return anatomy


def _middle(found: "LabelTubes", kinds: dict[str, TubeKind]) -> Floats:
    """Return where the duct of the gallbladder joins another, else where the first tube begins."""
    for join in found.joins:
        enters = any(kinds[each.to] == "organ" for each in found.joins if each.tube == join.tube)
        if enters and kinds[join.tube] == kinds[join.to] == "duct":
            return found.tube(join.tube).built.organ.axis[-join.end]
    return found.tubes[0].built.organ.axis[0]


def _touches(anatomy: Anatomy, lines: dict[str, TubeLine], found: "LabelTubes") -> list[TouchTable]:
    """Return the pairs of tubes that lie against each other, in the labels or in the file."""
    touches = {
        frozenset((tube, to)): TouchTable(tube=tube, to=to, length_mm=round(length, 1))
        for tube, to, length in found.touches
    }
    for _, tube, to, crossing in crossings(anatomy, lines, joined_places(anatomy, lines)):
        length = round(max(crossing.length, 0.5), 1)
        touches.setdefault(frozenset((tube, to)), TouchTable(tube=tube, to=to, length_mm=length))
    return list(touches.values())


def _layers(anatomy: Anatomy, lines: dict[str, TubeLine]) -> list[LayerTable]:
    """Return tissue under every tube, and between those that lie near each other: assumed."""
    layers = [
        LayerTable(
            tube=tube.name,
            to="bed",
            preset="firm" if tube.kind in ("organ", "vein") else "normal",
            strands=max(20, round(_STRANDS_MM * lines[tube.name].length)),
        )
        for tube in anatomy.tube
    ]
    names = [tube.name for tube in anatomy.tube if tube.kind != "vein"]
    for number, name in enumerate(names):
        for other in names[:number]:
            one, two = lines[name], lines[other]
            apart = np.linalg.norm(one.places[:, np.newaxis] - two.places, axis=2)
            gap = (apart - one.radius[:, np.newaxis] - two.radius).min(axis=1)
            length = one.length * float(((gap > 0.0) & (gap < _NEAR_MM)).mean())
            if length > _NEAR_LENGTH_MM:
                layers.append(
                    LayerTable(
                        tube=name,
                        to=other,
                        preset="normal",
                        strands=max(20, round(_STRANDS_MM * length)),
                        reach_mm=_NEAR_MM,
                        sheet="triangle",
                    )
                )
    return layers


def _alone(anatomy: Anatomy, kinds: dict[str, TubeKind]) -> list[str]:
    """Return a doubt for each tube of bile that joins no other."""
    bile = [name for name, kind in kinds.items() if kind in ("duct", "organ")]
    joined = {name for join in anatomy.join for name in (join.tube, join.to)}
    return [
        f"{name} joins no other tube: its label may end too early"
        for name in bile
        if len(bile) > 1 and name not in joined
    ]


def _unusual(found: "LabelTubes") -> list[str]:
    """Return a doubt for each size outside the range that cases are drawn from."""
    doubts: list[str] = []
    for tube in found.tubes:
        organ = tube.built.organ
        at = np.linspace(0.0, organ.length, 50)
        widths = 2.0 * np.sqrt(organ.section_properties(at).area / np.pi)
        # An organ's diameter is its widest, a tube's that of most of it.
        width = float(widths.max() if tube.name == "gallbladder" else np.median(widths))
        sizes = frequencies().size
        measured = {"length": ("long", organ.length), "diameter": ("wide", width)}
        for what, (word, value) in measured.items():
            size = sizes.get(f"{tube.name}_{what}_mm")
            # A tube that the volume ends in is longer.
            low = 0.0 if size is None or (what == "length" and any(tube.cut)) else size.low
            if size is not None and not _SLACK * low <= value <= size.high / _SLACK:
                doubts.append(
                    f"{tube.name} is {value:.1f} mm {word}, and {size.low:g} to {size.high:g} mm "
                    f"are usual"
                )
    return doubts


def _mirrored(found: "LabelTubes", kinds: dict[str, TubeKind]) -> list[str]:
    """Return a doubt if the gallbladder lies left of the ducts."""
    middles: dict[str, float] = {}
    for kind in ("organ", "duct"):
        mine = [tube.built.organ for tube in found.tubes if kinds[tube.name] == kind]
        if mine:
            middles[kind] = float(np.mean([organ.axis[:, 0].mean() for organ in mine]))
    if len(middles) == 2 and middles["organ"] > middles["duct"]:
        return ["the gallbladder lies to the left of the ducts: the volume may be mirrored"]
    return []
