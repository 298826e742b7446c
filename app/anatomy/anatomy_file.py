"""Anatomy files: read with errors that name line and tube, checked, and written (TOML)."""

import contextlib
import math
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, cast

import msgspec
import tomli_w

from app.anatomy.anatomy_geometry import tube_lines
from app.anatomy.tables import Anatomy, JoinTable, LayerTable, Place, TableError, TubeTable
from app.anatomy.tube_organ import ORGAN_SUFFIX, check_organs, with_organs
from app.bed_preset import bed_presets
from app.bounded_file import decoded, read_bounded
from app.toml_lines import TomlLines
from assets import ANATOMIES

MOST_BYTES = 1_000_000
"""Size of an anatomy file: some hundred tubes."""

MOST_MM = 1e4
"""Farthest that any place or length may be."""
RANGES = {
    "radius_mm": (1e-2, 1e3), "wall_mm": (1e-3, 1e3), "modulus_MPa": (1e-5, 1e6),
    "strength_MPa": (1e-6, 1e6), "tear_mm_per_s": (0.1, 1e4),
    "factor": (1e-3, 1e3), "reach_mm": (1e-3, MOST_MM),
    "gap_mm": (1e-3, 1e3), "yield_mm": (1e-3, 1e3), "failure_mm": (1e-3, 1e3),
    "stiff": (1e-3, 1e3), "face_mm": (0.0, 1e3), "length_mm": (0.0, MOST_MM),
    "from_mm": (0.0, MOST_MM),
    "to_mm": (0.0, MOST_MM), "slack_mm": (0.0, 1e3), "floor_N_per_mm2": (0.0, 1e3),
}  # fmt: skip
"""Least and most of each number, as far as tissue and the solver go."""
MOST_STRANDS, MOST_SEED = 200_000, 2**31

_RIGID = 1e-3

_PATH = re.compile(r"^(.*) - at `\$((?:\.\w+)?)(?:\[(\d+)\])?(?:\.(\w+))?.*`$")
_UNKNOWN_FIELD = re.compile(r"unknown field `(\w+)`")


def read_anatomy(path: Path) -> Anatomy:
    """Return the anatomy in a file, with its organs, checked; errors name line and tube."""
    content = read_bounded(path, MOST_BYTES, "anatomy")
    try:
        anatomy = decoded(msgspec.toml.decode, content, Anatomy, "")
    except ValueError as error:
        raise ValueError(_located(path, content, str(error).removeprefix(": "))) from None
    try:
        check_tables(anatomy)
        return checked(with_organs(anatomy, path.parent))
    except TableError as fault:
        line = _line_of(content, fault.table, fault.number, fault.field)
        raise ValueError(f"{path}{line}: {fault}") from None


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


def first_edition(name: str) -> Anatomy:
    """Return a shipped anatomy as it was before its joints had faces.

    Its stresses were judged up to the axis of the tube that another joins, and arteries were twice
    as stiff where they leave another, without a source.

    Returns
    -------
    Anatomy
    """
    anatomy = anatomy_named(name)
    kinds = {tube.name: tube.kind for tube in anatomy.tube}
    joins = [
        msgspec.structs.replace(
            each,
            face_mm=0.0,
            stiff=2.0 if kinds[each.tube] == kinds[each.to] == "artery" else each.stiff,
        )
        for each in anatomy.join
    ]
    return msgspec.structs.replace(anatomy, join=joins)


def checked(anatomy: Anatomy) -> Anatomy:
    """Return an anatomy whose tables can be; a `TableError` at the first that cannot."""
    check_tables(anatomy)
    check_organs(anatomy, tube_lines(anatomy))
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
    if not 0 <= anatomy.seed < MOST_SEED:
        raise TableError(f"seed must be 0 to {MOST_SEED - 1:,}, got {anatomy.seed}", "", 0, "seed")
    if anatomy.tissue not in bed_presets():
        raise TableError(
            f"there is no tissue {anatomy.tissue!r}; there are {', '.join(bed_presets())}",
            "", 0, "tissue",
        )  # fmt: skip
    if anatomy.place is not None:
        _check_place(anatomy.place)
    for number, shown in enumerate(anatomy.shown):
        _check_beside(shown.organ, "shown", number)
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
        if touch.tube == touch.to:
            raise TableError(f"tube {touch.tube!r} touches itself", "touch", number, "to")
        _check_range(touch.length_mm, "length_mm", f"touch of {touch.tube!r}", "touch", number)
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
    if not all(abs(value) <= MOST_MM for point in tube.points_mm for value in point):
        raise fault(f"points_mm must be finite and within {MOST_MM:,.0f} mm", "points_mm")
    radii = tube.radius_mm if isinstance(tube.radius_mm, list) else [tube.radius_mm]
    if not radii:
        raise fault("radius_mm needs a radius", "radius_mm")
    for name, value in (
        *(("radius_mm", radius) for radius in radii),
        ("wall_mm", tube.wall_mm),
        ("modulus_MPa", tube.modulus_MPa),
        ("strength_MPa", tube.strength_MPa),
        *(() if tube.tear_mm_per_s is None else (("tear_mm_per_s", tube.tear_mm_per_s),)),
    ):
        _check_range(value, name, f"tube {tube.name!r}", "tube", number)
    if tube.organ is not None and tube.organ.endswith(ORGAN_SUFFIX):
        _check_beside(tube.organ, "tube", number)
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
    for name in ("stiff", "face_mm"):
        _check_range(getattr(join, name), name, f"join of {join.tube!r}", "join", number)


def _check_layer(anatomy: Anatomy, layer: LayerTable, number: int) -> None:
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
    if not 1 <= layer.strands <= MOST_STRANDS:
        raise fault(f"strands must be 1 to {MOST_STRANDS:,}, got {layer.strands:,}", "strands")
    named = f"layer of {layer.tube!r} to {layer.to!r}"
    for name in RANGES:
        if (value := getattr(layer, name, None)) is not None:
            _check_range(value, name, named, "layer", number)
    bed = bed_presets()[layer.preset]
    yields = bed.yield_mm if layer.yield_mm is None else layer.yield_mm
    failure = bed.failure_mm if layer.failure_mm is None else layer.failure_mm
    if failure < yields:
        raise fault(
            f"strands part at {failure:g} mm, before they yield at {yields:g} mm",
            "yield_mm" if layer.failure_mm is None else "failure_mm",
        )
    if layer.toward is not None:
        if layer.to != "bed":
            raise fault('toward is where a bed lies, and goes with to = "bed"', "toward")
        size = math.dist(layer.toward, (0.0, 0.0, 0.0))
        if not 0.99 < size < 1.01:
            raise fault(f"toward must be of length 1, got {size:g}", "toward")


def _check_place(place: Place) -> None:
    rows = place.rows_LPS
    if not all(abs(value) <= MOST_MM for row in (place.origin_LPS_mm, *rows) for value in row):
        raise TableError(f"place must be finite and within {MOST_MM:,.0f} mm", "place", 0)
    (a, b, c), (d, e, f), (g, h, i) = rows
    turn = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    off = max(
        abs(sum(p * q for p, q in zip(one, other, strict=True)) - (m == n))
        for m, one in enumerate(rows)
        for n, other in enumerate(rows)
    )
    if not (off < _RIGID and turn > 0.0):
        raise TableError("rows_LPS must be three directions of a turn", "place", 0, "rows_LPS")


def _check_beside(organ: str, table: str, number: int) -> None:
    if not organ or Path(organ).name != organ:
        raise TableError(
            f"organ {organ!r} must be a file beside the anatomy", table, number, "organ"
        )


def _check_range(value: float, name: str, what: str, table: str, number: int) -> None:
    low, high = RANGES[name]
    if not low <= value <= high:
        unit = {"factor": "", "stiff": ""}.get(name, f" {name.partition('_')[2].replace('_', '/')}")
        raise TableError(
            f"{what}: {name} must be from {low:g} to {high:g}{unit}, got {value:g}",
            table, number, name,
        )  # fmt: skip


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
    at = "" if field is None or unknown is not None else f" in {field}"
    table, index = table.removeprefix("."), int(number or 0)
    named = f"{table} {index + 1}: " if table else ""
    if table == "tube":
        with contextlib.suppress(LookupError, TypeError):
            named = f"tube {msgspec.toml.decode(content)['tube'][index]['name']!r}: "
    field = field if unknown is None else unknown[1]
    return f"{path}{_line_of(content, table, index, field)}: {named}{what}{at}"


def _line_of(content: bytes, table: str, number: int, field: str | None) -> str:
    """Return ", line N" of a field, or of the nearest table that holds it."""
    steps = (*((table, number) if table else ()), *(() if field is None else (field,)))
    line = TomlLines(content.decode()).line_of(*steps)
    return "" if line is None else f", line {line}"
