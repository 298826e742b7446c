"""The anatomy of a case: common and cystic duct, gallbladder, right hepatic and cystic arteries.

x runs along the common duct to the liver's hilum, y to the patient's right, z to the viewer, away
from the bed. The cystic duct leaves the common duct under its angle with the upper duct, winds
round it to the right where its orifice is on another side, and has its drawn length to the neck.
What no frequency gives, the arteries' exact course, is tried in a fixed order until no two tubes
cross, and no artery runs on within a wall that it joins, or upright.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import product

import numpy as np
from numpy.typing import NDArray

from app.anatomy.anatomy_geometry import (
    TubeLine,
    check_lines,
    joined_station,
    length_in_wall,
    tube_line,
)
from app.anatomy.frequencies import Case, case_of
from app.anatomy.tables import (
    Anatomy,
    JoinTable,
    LayerTable,
    Number,
    TableError,
    TubeEnd,
    TubeKind,
    TubeTable,
)
from app.anatomy.tube_kinds import wall_of
from physics.bed.space_beam import axis_line

Floats = NDArray[np.float64]

_JOIN_MM = 28.0  # of the common duct, below the cystic duct
_HEPATIC_MM = {"high": 16.0, "mid": 30.0, "low": 50.0}  # of the common duct above it
_ORIFICE_DEG = {
    "lateral": 0.0,
    "parallel": 0.0,
    "posterior": -90.0,
    "anterior": 90.0,
    "medial": -135.0,
}
_COMMON_WALL_MM = 1.0
# The gallbladder runs up, to the right and a little to the front from its neck; its liver bed lies
# above, right and in front of it, as in the atlas of docs/anatomy-method.md.
_GALLBLADDER_DIRECTION = np.array([0.62, 0.78, 0.05]) / math.hypot(0.62, 0.78, 0.05)
_LIVER_DIRECTION = (0.68, 0.60, 0.42)
# Of the gallbladder's largest radius, even along it; of its length, depth of its sag.
_GALLBLADDER_RADII = (0.2, 0.55, 0.85, 1.0, 0.95, 0.6)
_GALLBLADDER_SAG = (0.0, 1.0, 2.0, 2.5, 2.0, 1.0)
# Where cystic arteries end on the gallbladder, mm from its neck.
ARTERY_AT_MM, _SECOND_AT_MM = 5.0, 11.0
_CLEARANCE_MM = 0.6
# From where a tube has left a wall that it joins, mm, and of its length, to where strands hold it.
_ROOM_MM, _MOST_IN_WALL = 1.0, 0.7
_LEAST_LEVEL = 0.05  # part of its length in which an artery runs across what is up
_LEAST_HELD = 0.1  # of a short artery's length, in its middle
_LARGEST_WAVE_MM = 3.2
_MOST_WAVES = 8
_BOW = 1.5  # to one side, of the waves' height
_SLACK = 1.03  # of the chord, where no length is drawn
_TISSUE = 3.0  # gap to the bed, mm
LONGEST_IN_WALL = 2.0
"""The most that an artery's axis runs within a wall that it joins, of the sum of their radii."""
ARTERY_ROOT = 0.57
"""Factor on the stiffness of an artery's first element where it leaves another, as a solid model
has it (benchmarks/artery_joint.py)."""
# What is tried of the arteries' course, in this order from the last to the first.
_DEPTHS = (0.0, 1.5, 4.0, 7.0)
_CHORDS = (0.93, 0.8, 0.65, 0.5)
_APART = (0.0, math.pi)
_TURNS = tuple(math.radians(45.0 * turn) for turn in range(8))


def drawn_anatomy(seed: int) -> Anatomy:
    """Return the anatomy that published frequencies and a seed give."""
    return anatomy_of(case_of(seed))


def anatomy_of(case: Case) -> Anatomy:
    """Return the anatomy of a case; a ValueError if no course tried keeps its tubes clear."""
    fault: TableError | None = None
    ducts = _ducts(case)
    # With these beginnings of a course a tube is not clear, whatever comes after it.
    hopeless: set[tuple[float, ...]] = set()
    for depth, chord, apart, turn in product(_DEPTHS, _CHORDS, _APART, _TURNS):
        begun: dict[str, tuple[float, ...]] = {"rha": (depth, chord)}
        if case.kinds["cystic_artery"] != "outside":
            begun["artery"] = (depth, chord, turn)
        if not hopeless.isdisjoint(begun.values()):
            continue
        tubes = _with_arteries(case, ducts, _Course(depth, chord, turn, turn + apart))
        anatomy = _anatomy(case, tubes)
        try:
            check_lines(anatomy, tubes.lines)
            _check_arteries(anatomy, tubes.lines)
        except TableError as error:
            fault = error
            if (name := _at_fault(anatomy, error)) in begun:
                hopeless.add(begun[name])
        else:
            return anatomy
    raise ValueError(f"case {case.seed} has no course of its arteries that keeps clear: {fault}")


def _at_fault(anatomy: Anatomy, error: TableError) -> str:
    """Return the last of the tubes that a fault is of."""
    if error.table == "tube":
        return anatomy.tube[error.number].name
    return anatomy.join[error.number].tube if error.table == "join" else ""


@dataclass(frozen=True, slots=True)
class _Course:
    """What is tried of the arteries' course."""

    depth: float  # of the hepatic artery behind the nearest that is clear of the duct, mm
    chord: float  # of the cystic artery, of its length
    turn: float  # of the plane of the first one's waves about its chord, rad
    second_turn: float  # of the second one's


@dataclass(frozen=True, slots=True)
class _Tubes:
    """Tubes that are drawn so far, where they join, and their axes."""

    tubes: list[TubeTable] = field(default_factory=list[TubeTable])
    joins: list[JoinTable] = field(default_factory=list[JoinTable])
    lines: dict[str, TubeLine] = field(default_factory=dict[str, TubeLine])

    def copy(self) -> "_Tubes":
        """Return them, to add others."""
        return _Tubes([*self.tubes], [*self.joins], {**self.lines})

    def add(
        self,
        name: str,
        kind: TubeKind,
        points: Floats,
        radius: Number | list[Number],
        ends: tuple[TubeEnd, TubeEnd],
        elements: int,
        wall: float | None = None,
    ) -> None:
        """Add a tube through points."""
        made = wall_of(kind)
        radii = [float(r) for r in radius] if isinstance(radius, list) else [float(radius)]
        tube = TubeTable(
            name=name,
            kind=kind,
            points_mm=[(x, y, z) for x, y, z in (points.round(4) + 0.0).tolist()],
            radius_mm=radius,
            wall_mm=made.thickness(radii) if wall is None else wall,
            modulus_MPa=made.modulus_MPa,
            strength_MPa=made.strength_MPa,
            stretch_at_break=made.stretch_at_break,
            ends=ends,
            elements=elements,
            fluid=made.fluid,
            confidence_wall=made.confidence,
        )
        self.tubes.append(tube)
        self.lines[name] = tube_line(tube)

    def join(self, name: str, end: int, to: str, at: float | None, stiff: float) -> None:
        """Join an end to a tube, at its own end if no station is given."""
        # Where one tube goes on as another, it has no wall to come out of.
        face = 0.0 if at is None else self.lines[to].radius_at(at)
        self.joins.append(
            JoinTable(
                tube=name, end=1 if end else 0, to=to, at_mm="end" if at is None else round(at, 3),
                stiff=stiff, face_mm=round(face, 3),
            )
        )  # fmt: skip


def _ducts(case: Case) -> _Tubes:
    """Return common and cystic duct and the gallbladder, which no course of arteries changes."""
    sizes = case.sizes
    common_r, cystic_r = _radii(case)
    hepatic = _HEPATIC_MM[case.kinds["level"]]
    made = _Tubes()
    add, join, lines = made.add, made.join, made.lines
    top = _JOIN_MM + hepatic
    common = np.array(
        [
            [0.0, 1.0, -1.0],
            [14.0, 0.2, 0.0],
            [_JOIN_MM, 0.0, 0.0],
            [_JOIN_MM + 0.5 * hepatic, 0.4, -0.5],
            [top, 2.0, -2.0],
        ]
    )
    add("common", "duct", common, round(common_r, 3), ("clamped", "clamped"), 24, _COMMON_WALL_MM)
    at = lines["common"].nearest(common[2])
    start = lines["common"].at(at)
    cystic = _cystic_course(case, start, common_r, cystic_r)
    add("cystic", "duct", cystic, round(cystic_r, 3), ("joined", "free"), 20)
    join("cystic", 0, "common", at, 4.0)

    neck = cystic[-1]
    length, widest = sizes["gallbladder_length_mm"], 0.5 * sizes["gallbladder_diameter_mm"]
    fractions = np.linspace(0.0, 1.0, len(_GALLBLADDER_RADII))
    body = neck + np.outer(fractions * length, _GALLBLADDER_DIRECTION)
    body[:, 2] += _GALLBLADDER_SAG
    radii = [round(widest * fraction, 3) for fraction in _GALLBLADDER_RADII]
    radii[0] = round(max(1.2 * cystic_r, 1.8), 3)
    add("gallbladder", "organ", body, list(radii), ("joined", "free"), 14)
    join("gallbladder", 0, "cystic", None, 1.0)
    return made


def _with_arteries(case: Case, ducts: _Tubes, course: _Course) -> _Tubes:
    """Return the tubes with arteries of a course."""
    sizes, kinds = case.sizes, case.kinds
    common_r, _ = _radii(case)
    made = ducts.copy()
    add, join, lines = made.add, made.join, made.lines
    artery_r = 0.5 * sizes["cystic_artery_diameter_mm"]
    hepatic_r = 0.5 * sizes["right_hepatic_artery_diameter_mm"]
    gallbladder = lines["gallbladder"]
    target = gallbladder.at(ARTERY_AT_MM)
    # Lengths are from wall to wall, axes run from axis to axis.
    inside = gallbladder.radius_at(ARTERY_AT_MM)
    whole = sizes["cystic_artery_length_mm"] + inside + hepatic_r
    rha_points = _hepatic_course(
        case, lines["common"], target, course.chord * whole, hepatic_r + common_r, course.depth
    )
    add("rha", "artery", rha_points, round(hepatic_r, 3), ("clamped", "clamped"), 16)
    number = kinds["cystic_artery"]
    if number in ("inside", "double", "both"):
        rha = lines["rha"]
        # From the place that lets it be nearly straight, right of the duct if there is one.
        apart = np.linalg.norm(rha.places - target, axis=1)
        right = rha.stations > 0.4 * rha.length
        origin = float(
            rha.stations[np.where(right, np.abs(apart - course.chord * whole), np.inf).argmin()]
        )
        path = wavy_course(rha.at(origin), target, whole, course.turn)
        add("artery", "artery", path, round(artery_r, 3), ("joined", "joined"), 20)
        join("artery", 0, "rha", origin, ARTERY_ROOT)
        join("artery", 1, "gallbladder", ARTERY_AT_MM, 2.0)
        if number == "double":
            second = min(origin + 8.0, rha.length - 3.0)
            if second < origin + 5.0:
                second = origin - 8.0
            beyond = gallbladder.at(_SECOND_AT_MM)
            start = rha.at(second)
            path = wavy_course(start, beyond, _SLACK * math.dist(start, beyond), course.second_turn)
            add("artery2", "artery", path, round(0.8 * artery_r, 3), ("joined", "joined"), 20)
            join("artery2", 0, "rha", second, ARTERY_ROOT)
            join("artery2", 1, "gallbladder", _SECOND_AT_MM, 2.0)
    if number in ("outside", "both"):
        name, on = ("artery", ARTERY_AT_MM) if number == "outside" else ("artery2", _SECOND_AT_MM)
        end = gallbladder.at(on)
        # From the duodenum's side, right of the common duct.
        right = max(9.0 + common_r, float(end[1]) - 8.0)
        start = np.array([end[0] - 24.0, right, -3.5])
        path = wavy_course(start, end, _SLACK * math.dist(start, end), course.second_turn)
        add(name, "artery", path, round(artery_r, 3), ("clamped", "joined"), 20)
        join(name, 1, "gallbladder", on, 2.0)
    return made


def _radii(case: Case) -> tuple[float, float]:
    """Return the outer radii of common and cystic duct, mm."""
    sizes = case.sizes
    common_r = 0.5 * sizes["common_duct_lumen_mm"] + _COMMON_WALL_MM
    return common_r, 0.5 * sizes["cystic_duct_diameter_mm"]


def _anatomy(case: Case, made: _Tubes) -> Anatomy:
    """Return the anatomy of tubes, with the tissue between them."""
    tissue = case.kinds["tissue"]
    return Anatomy(
        name=f"case-{case.seed}",
        seed=case.seed,
        tissue=tissue,
        tube=made.tubes,
        join=made.joins,
        layer=list(_layers(made.lines, made.joins, tissue)),
        drawn={**case.kinds, **case.sizes},
    )


def _check_arteries(anatomy: Anatomy, lines: dict[str, TubeLine]) -> None:
    """Check that arteries leave the walls that they join, and that a bed can lie under them."""
    kinds = {tube.name: tube.kind for tube in anatomy.tube}
    for number, tube in enumerate(anatomy.tube):
        steps = np.diff(lines[tube.name].places, axis=0)
        level = np.sqrt((steps[:, :2] ** 2).sum(axis=1) / (steps**2).sum(axis=1))
        if tube.kind == "artery" and level.min() < _LEAST_LEVEL:
            raise TableError(f"tube {tube.name!r} stands upright", "tube", number, "points_mm")
    for number, join in enumerate(anatomy.join):
        if kinds[join.tube] != "artery":
            continue
        to = lines[join.to]
        radii = to.radius_at(joined_station(join, to)) + float(lines[join.tube].radius[-join.end])
        length = length_in_wall(join, lines)
        if length > LONGEST_IN_WALL * radii:
            raise TableError(
                f"tube {join.tube!r} runs within the wall of {join.to!r} for {length:.3g} mm",
                "join", number, "at_mm",
            )  # fmt: skip


def _cystic_course(case: Case, start: Floats, common_r: float, cystic_r: float) -> Floats:
    """Return points of the cystic duct from the common duct's axis to the neck."""
    length = wanted = case.sizes["cystic_duct_length_mm"]
    points = _cystic_points(case, start, common_r, cystic_r, length)
    # A spline through the points cuts a winding course's corners.
    for _ in range(3):
        length *= wanted / float(axis_line(points)[0][-1])
        points = _cystic_points(case, start, common_r, cystic_r, length)
    return points


def _cystic_points(
    case: Case, start: Floats, common_r: float, cystic_r: float, length: float
) -> Floats:
    count = 200
    insertion = case.kinds["insertion"]
    angle = "parallel_angle_deg" if insertion == "parallel" else "insertion_angle_deg"
    first = math.radians(case.sizes[angle])
    away = common_r + cystic_r + _CLEARANCE_MM
    # Round the common duct it runs steeply; a short duct has no length for that.
    steep = math.radians(65.0)
    spare = max(0.75 * length - away / math.sin(first), 0.0)
    round_it = math.radians(_ORIFICE_DEG[insertion])
    most = spare * math.sin(steep) / away
    azimuth = math.copysign(min(abs(round_it), most), round_it)
    x = off = 0.0
    step = length / count
    course = [start]
    for piece in range(count):
        if off >= away and azimuth != 0.0:
            side = step * math.sin(steep)
            x += step * math.cos(steep)
            off += 0.1 * side
            turned = min(abs(azimuth), side / off)
            azimuth -= math.copysign(turned, azimuth)
        else:
            angle_here = first + math.radians(25.0) * piece / count
            x += step * math.cos(angle_here)
            off += step * math.sin(angle_here)
        across = np.array([0.0, math.cos(azimuth), math.sin(azimuth)])
        course.append(start + off * across + [x, 0.0, 0.0])
    return np.array(course)[np.linspace(0, count, 9).round().astype(int)]


def _hepatic_course(
    case: Case, common: TubeLine, target: Floats, chord: float, radii: float, depth: float
) -> Floats:
    """Return points of the right hepatic artery from the left of the common duct to the hilum."""
    hepatic = _HEPATIC_MM[case.kinds["level"]]
    passes = case.kinds["right_hepatic_artery"]
    crossing = common.at(common.nearest(np.array([_JOIN_MM + 0.62 * hepatic, 0.0, 0.0])))
    below = -(radii + _CLEARANCE_MM + depth)
    # Beyond the neck, so that the cystic artery comes from the hilum's side of the cystic duct.
    top = max(_JOIN_MM + max(hepatic, 20.0) + 4.0, float(target[0]) + 6.0)
    end = np.array([top, 10.5, -4.0 - depth])
    if passes == "none":
        # It comes from the right, behind both ducts.
        first = np.array([_JOIN_MM - 14.0, radii + 6.0, 2.0 * below])
        second = np.array([crossing[0] - 4.0, radii + 4.0, 1.4 * below])
    else:
        z = crossing[2] - below if passes == "front" else crossing[2] + below
        first = np.array([crossing[0] - 16.0, crossing[1] - 10.0, z])
        second = np.array([crossing[0], crossing[1], z])
    middle = 0.5 * (second + end) + [0.0, 1.0, 0.0]
    middle[2] = second[2] * 0.7
    off = middle - target
    if passes == "hump" or float(np.linalg.norm(off)) > chord:
        middle = target + chord * off / np.linalg.norm(off)
    return np.stack([first, second, middle, end])


def wavy_course(start: Floats, end: Floats, length: float, turn: float) -> Floats:
    """Return points of a wavy line of a length, mm, or of the chord's, if that is longer."""
    chord = end - start
    along = chord / np.linalg.norm(chord)
    side = np.cross(along, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side)
    side = math.cos(turn) * side + math.sin(turn) * np.cross(along, side)
    fractions = np.linspace(0.0, 1.0, 200)

    def points(height: float, waves: int, at: Floats) -> Floats:
        # It leaves and arrives along the chord.
        swing = np.sin(math.pi * at) * (np.sin(2.0 * math.pi * waves * at) + _BOW)
        return start + np.outer(at, chord) + height * np.outer(swing, side)

    def extent(height: float, waves: int) -> float:
        steps = np.diff(points(height, waves, fractions), axis=0)
        return float(np.sqrt((steps**2).sum(axis=1)).sum())

    waves = 1
    while waves < _MOST_WAVES and extent(_LARGEST_WAVE_MM, waves) < length:
        waves += 1
    low, high = 0.0, _LARGEST_WAVE_MM
    for _ in range(24):
        height = 0.5 * (low + high)
        low, high = (low, height) if extent(height, waves) > length else (height, high)
    return points(low, waves, np.linspace(0.0, 1.0, 4 * waves + 5))


def _layers(
    lines: dict[str, TubeLine], joins: list[JoinTable], tissue: str
) -> Iterator[LayerTable]:
    """Yield the tissue between the tubes and under them; its strands are assumed."""
    # Where a tube comes out of a wall that it joins there is no room for strands, nor to part them.
    off = {
        (join.tube, join.end): min(
            length_in_wall(join, lines) + _ROOM_MM, _MOST_IN_WALL * lines[join.tube].length
        )
        for join in joins
    }
    cystic, off_common = lines["cystic"].length, off["cystic", 0]
    between = round(max(min(5.0, 0.4 * cystic), off_common), 3)
    for name in ("artery", "artery2"):
        if name in lines:
            length = lines[name].length
            begin, end = off.get((name, 0), 0.0), length - off[name, 1]
            if end - begin < _LEAST_HELD * length:
                begin, end = (0.5 * (1.0 + side * _LEAST_HELD) * length for side in (-1, 1))
            begin, end = round(begin, 3), round(end, 3)
            for to, reach, strands in (("cystic", 9.0, 140), ("common", 12.0, 90)):
                yield LayerTable(
                    tube=name, to=to, strands=strands, preset=tissue, reach_mm=reach,
                    from_mm=begin, to_mm=end, sheet="triangle",
                )  # fmt: skip
            yield LayerTable(
                tube=name, to="bed", strands=90, preset=tissue, gap_mm=2.0, floor_N_per_mm2=0.05,
                from_mm=begin, to_mm=end,
            )  # fmt: skip
    yield LayerTable(
        tube="cystic", to="common", strands=200, preset=tissue, reach_mm=14.0, from_mm=between,
        sheet="triangle",
    )  # fmt: skip
    # The peritoneum in front: short strands, four times as tough as areolar tissue.
    yield LayerTable(
        tube="cystic", to="common", strands=70, preset="normal", factor=4.0, reach_mm=14.0,
        from_mm=between, yield_mm=1.0, failure_mm=2.0, slack_mm=0.3,
        side="front", sheet="peritoneum",
    )  # fmt: skip
    yield LayerTable(
        tube="cystic", to="rha", strands=80, preset=tissue, reach_mm=10.0,
        from_mm=round(max(min(8.0, 0.5 * cystic), off_common), 3), sheet="triangle",
    )  # fmt: skip
    yield LayerTable(
        tube="gallbladder", to="common", strands=60, preset=tissue, to_mm=9.0, reach_mm=16.0,
        sheet="triangle",
    )  # fmt: skip
    yield LayerTable(tube="common", to="bed", strands=260, preset="firm", gap_mm=_TISSUE)
    yield LayerTable(
        tube="cystic", to="bed", strands=200, preset=tissue, gap_mm=_TISSUE,
        from_mm=round(max(min(4.0, 0.3 * cystic), off_common), 3),
    )  # fmt: skip
    yield LayerTable(
        tube="gallbladder", to="bed", strands=240, preset="firm", gap_mm=2.5, yield_mm=1.2,
        failure_mm=3.2, slack_mm=0.6, toward=_LIVER_DIRECTION, sheet="plate",
    )  # fmt: skip
    yield LayerTable(tube="rha", to="bed", strands=160, preset="firm", gap_mm=2.5)
