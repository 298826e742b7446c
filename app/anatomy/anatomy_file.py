"""Anatomy files: read with errors that name line and tube, checked, and written (TOML)."""

import math
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, cast

import msgspec
import tomli_w

from app.anatomy.anatomy_geometry import tube_lines
from app.anatomy.tables import Anatomy, JoinTable, LayerTable, TableError, TubeTable
from app.bounded_file import decoded, read_bounded
from assets import ANATOMIES

__all__ = ["anatomy_named", "anatomy_toml", "checked", "read_anatomy", "shipped_anatomies"]

MOST_BYTES = 1_000_000
"""Size of an anatomy file: some hundred tubes."""

_HEADER = re.compile(r"\s*\[\[\s*(\w+)\s*\]\]")
_PATH = re.compile(r"^(.*) - at `\$((?:\.\w+)?)(?:\[(\d+)\])?(?:\.(\w+))?.*`$")
_UNKNOWN_FIELD = re.compile(r"unknown field `(\w+)`")


def read_anatomy(path: Path) -> Anatomy:
    """Return the anatomy in a file, checked; errors name the line and the tube."""
    content = read_bounded(path, MOST_BYTES, "anatomy")
    try:
        anatomy = decoded(msgspec.toml.decode, content, Anatomy, "")
    except ValueError as error:
        raise ValueError(_located(path, content, str(error).removeprefix(": "))) from None
    try:
        checked(anatomy)
    except TableError as fault:
        line = _line_of(content, fault.table, fault.number, fault.field)
        raise ValueError(f"{path}{line}: {fault}") from None
    return anatomy


def shipped_anatomies() -> dict[str, Path]:
    """Return the files of the anatomies that ship with the program, by name, `normal` first."""
    found = {path.stem: path for path in sorted(ANATOMIES.glob("*.toml"))}
    return {"normal": found.pop("normal"), **found}


def anatomy_named(name: str | Anatomy) -> Anatomy:
    """Return a shipped anatomy by its name, or a whole one checked; a ValueError lists them."""
    if isinstance(name, Anatomy):
        return checked(name)
    known = shipped_anatomies()
    if name not in known:
        raise ValueError(f"there is no anatomy {name!r} here: {', '.join(known)}")
    return read_anatomy(known[name])


def checked(anatomy: Anatomy) -> Anatomy:
    """Return an anatomy whose tables can be; a `TableError` at the first that cannot."""
    check_tables(anatomy)
    tube_lines(anatomy)
    return anatomy


def anatomy_toml(anatomy: Anatomy) -> str:
    """Return an anatomy as its file has it: a key a line, without what has its default."""
    tables: list[str] = []

    def put(header: str, table: msgspec.Struct | Mapping[str, Any]) -> None:
        rows = table.items() if isinstance(table, Mapping) else _own_values(table)
        lines = [header] if header else []
        tables.append("\n".join([*lines, *(f"{key} = {_as_toml(value)}" for key, value in rows)]))

    put("", anatomy)
    for key in ("place", "drawn"):
        if getattr(anatomy, key):
            put(f"[{key}]", getattr(anatomy, key))
    for key in ("tube", "join", "touch", "layer", "shown"):
        for table in getattr(anatomy, key):
            put(f"[[{key}]]", table)
    return "\n\n".join(tables) + "\n"


def check_tables(anatomy: Anatomy) -> None:
    """Raise a `TableError` at the first number or name that cannot be, of each table by itself."""
    if not anatomy.tube:
        raise TableError("an anatomy needs a [[tube]]", "tube", 0)
    seen: set[str] = set()
    for number, tube in enumerate(anatomy.tube):
        _check_tube(tube, number, seen)
        seen.add(tube.name)
    for number, join in enumerate(anatomy.join):
        _check_join(anatomy, join, number)
    for number, tube in enumerate(anatomy.tube):
        for end, how in enumerate(tube.ends):
            count = sum((join.tube, join.end) == (tube.name, end) for join in anatomy.join)
            if count > 1 or (how == "joined") != (count == 1):
                raise TableError(
                    f"end {end} of tube {tube.name!r} is {how} and has {count} [[join]]; a joined "
                    f"end has one, any other end none",
                    "tube", number, "ends",
                )  # fmt: skip
    for number, touch in enumerate(anatomy.touch):
        for name in (touch.tube, touch.to):
            _check_known(anatomy, name, "touch", number, "to" if name == touch.to else "tube")
    for number, layer in enumerate(anatomy.layer):
        _check_layer(anatomy, layer, number)


def _check_tube(tube: TubeTable, number: int, seen: set[str]) -> None:
    def fault(message: str, field: str) -> TableError:
        return TableError(f"tube {tube.name!r}: {message}", "tube", number, field)

    if not tube.name or tube.name == "bed":
        raise fault("a tube needs a name, and not that of the bed", "name")
    if tube.name in seen:
        raise fault("another tube has this name", "name")
    if len(tube.points_mm) < 2:
        raise fault(f"points_mm needs 2 or more points, got {len(tube.points_mm)}", "points_mm")
    if not all(math.isfinite(value) for point in tube.points_mm for value in point):
        raise fault("points_mm must be finite", "points_mm")
    radii = tube.radius_mm if isinstance(tube.radius_mm, list) else [tube.radius_mm]
    if not radii:
        raise fault("radius_mm needs a radius", "radius_mm")
    for name, value in (
        *(("radius_mm", radius) for radius in radii),
        ("wall_mm", tube.wall_mm),
        ("modulus_MPa", tube.modulus_MPa),
        ("strength_MPa", tube.strength_MPa),
    ):
        if not (math.isfinite(value) and value > 0.0):
            unit = name.rpartition("_")[2]
            raise fault(f"{name} must be above 0 {unit} and finite, got {value:g}", name)
    if tube.wall_mm >= min(radii):
        raise fault(
            f"a wall of {tube.wall_mm:g} mm leaves no bore in a radius of {min(radii):g} mm",
            "wall_mm",
        )
    stretch = tube.stretch_at_break
    if stretch is not None and not (math.isfinite(stretch) and stretch > 1.0):
        raise fault(f"stretch_at_break must be above 1, got {stretch:g}", "stretch_at_break")
    if not 2 <= tube.elements <= 1000:
        raise fault(f"elements must be 2 to 1,000, got {tube.elements}", "elements")


def _check_join(anatomy: Anatomy, join: JoinTable, number: int) -> None:
    _check_known(anatomy, join.tube, "join", number, "tube")
    _check_known(anatomy, join.to, "join", number, "to")
    names = [tube.name for tube in anatomy.tube]
    if names.index(join.to) >= names.index(join.tube):
        raise TableError(
            f"tube {join.tube!r} must stand after {join.to!r}, which it joins",
            "join", number, "to",
        )  # fmt: skip
    if not (math.isfinite(join.stiff) and join.stiff > 0.0):
        raise TableError(
            f"join of {join.tube!r}: stiff must be above 0, got {join.stiff:g}",
            "join", number, "stiff",
        )  # fmt: skip


def _check_layer(anatomy: Anatomy, layer: LayerTable, number: int) -> None:
    from app.simulation import bed_presets

    def fault(message: str, field: str) -> TableError:
        return TableError(
            f"layer of {layer.tube!r} to {layer.to!r}: {message}", "layer", number, field
        )

    _check_known(anatomy, layer.tube, "layer", number, "tube")
    if layer.to != "bed":
        _check_known(anatomy, layer.to, "layer", number, "to")
    if layer.to == layer.tube:
        raise fault("strands go to another tube or to the bed", "to")
    if layer.preset not in bed_presets():
        raise fault(
            f"there is no bed {layer.preset!r}; there are {', '.join(bed_presets())}", "preset"
        )
    if layer.strands < 1:
        raise fault(f"strands must be 1 or more, got {layer.strands}", "strands")
    for name in ("factor", "to_mm", "reach_mm", "gap_mm", "yield_mm", "part_mm"):
        value = getattr(layer, name)
        if value is not None and not (math.isfinite(value) and value > 0.0):
            raise fault(f"{name} must be above 0 and finite, got {value:g}", name)
    for name in ("from_mm", "slack_mm", "floor_N_mm2"):
        value = getattr(layer, name)
        if value is not None and not (math.isfinite(value) and value >= 0.0):
            raise fault(f"{name} must be 0 or more and finite, got {value:g}", name)
    if layer.toward is not None:
        if layer.to != "bed":
            raise fault('toward is where a bed lies, and goes with to = "bed"', "toward")
        size = math.dist(layer.toward, (0.0, 0.0, 0.0))
        if not 0.99 < size < 1.01:
            raise fault(f"toward must be of length 1, got {size:g}", "toward")


def _check_known(anatomy: Anatomy, name: str, table: str, number: int, field: str) -> None:
    if all(tube.name != name for tube in anatomy.tube):
        known = ", ".join(tube.name for tube in anatomy.tube)
        raise TableError(f"there is no tube {name!r}; there are {known}", table, number, field)


def _own_values(table: msgspec.Struct) -> Iterator[tuple[str, Any]]:
    """Yield a table's fields that are no tables and differ from their defaults."""
    for field in msgspec.structs.fields(table):
        value: Any = getattr(table, field.name)
        rows = cast("list[Any]", value) if isinstance(value, list) else [value]
        tables = any(isinstance(row, (Mapping, msgspec.Struct)) for row in rows)
        if not tables and value not in (field.default, []):
            yield field.name, value


def _as_toml(value: Any) -> str:
    if isinstance(value, (list, tuple)):
        rows = cast("list[Any]", value)
        return f"[{', '.join(map(_as_toml, rows))}]"
    return tomli_w.dumps({"v": value}).removeprefix("v = ").rstrip("\n")


def _located(path: Path, content: bytes, message: str) -> str:
    """Return an error of msgspec's with its line and tube."""
    found = _PATH.match(message)
    if found is None:
        return f"{path}: {message}"
    what, table, number, field = found.groups()
    unknown = _UNKNOWN_FIELD.search(what)
    if unknown is not None:
        field = unknown[1]
    table = table.removeprefix(".")
    index = int(number or 0)
    named = ""
    if table == "tube":
        name = re.search(
            r'^\s*name\s*=\s*["\'](.*?)["\']', "\n".join(_rows(content, table, index)), re.M
        )
        named = f"tube {name[1]!r}: " if name else f"tube {index + 1}: "
    elif table:
        named = f"{table} {index + 1}: "
    at = "" if field is None or unknown is not None else f" in {field}"
    return f"{path}{_line_of(content, table, index, field)}: {named}{what}{at}"


def _rows(content: bytes, table: str, number: int) -> list[str]:
    """Return the lines of a file's table, from its header on."""
    lines = content.decode(errors="replace").splitlines()
    starts = [place for place, line in enumerate(lines) if _HEADER.match(line)]
    mine = [place for place in starts if lines[place].strip().strip("[] ") == table]
    if number >= len(mine):
        return []
    end = next((place for place in starts if place > mine[number]), len(lines))
    return lines[mine[number] : end]


def _line_of(content: bytes, table: str, number: int, field: str | None) -> str:
    """Return ", line N" of a field, or of its table's header; nothing where it is not found."""
    rows = _rows(content, table, number)
    if not rows:
        return ""
    lines = content.decode(errors="replace").splitlines()
    headers = [place for place, line in enumerate(lines) if line.strip().strip("[] ") == table]
    offset = 0
    if field is not None:
        key = re.compile(rf"\s*{re.escape(field)}\s*=")
        offset = next((place for place, line in enumerate(rows) if key.match(line)), 0)
    return f", line {headers[number] + offset + 1}"
