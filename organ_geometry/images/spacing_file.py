"""The `spacing.json` beside the images of a folder: sizes, distances and directions."""

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias, cast

from organ_geometry.images.grey_image import ImageStackError

SPACING_FILE = "spacing.json"
LARGEST_COORDINATE_MM = 1e7

# What `units` in a spacing.json may be, or may start with.
MM = "mm"
RELATIVE = "relative"

Vector: TypeAlias = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class PlaneRecord:
    """One slice's plane in a spacing.json."""

    origin_mm: Vector
    col_dir: Vector
    row_dir: Vector
    normal: Vector | None = None


@dataclass(frozen=True, slots=True)
class SpacingRecord:
    """The fields of a spacing.json in use; its pixel spacings are row first, then column."""

    pixel_spacing_mm: tuple[float, float] | None = None
    pixel_spacing: tuple[float, float] | None = None
    slice_spacing_mm: float | None = None
    slice_spacing: float | None = None
    units: str = MM
    first_slice_origin_mm: Vector | None = None
    col_dir: Vector | None = None
    row_dir: Vector | None = None
    slice_dir: Vector | None = None
    frames: list[PlaneRecord] | None = None
    slice_count: float | None = None


def read_spacing(folder: Path) -> tuple[Path | None, SpacingRecord]:
    """Return the spacing.json of a folder or its parent, and its path if there is one."""
    for place in (folder, folder.resolve().parent):
        path = place / SPACING_FILE
        if not path.is_file():
            continue
        return path, _spacing_record(_Keys(_json_content(path), str(path)))
    return None, SpacingRecord()


def _json_content(path: Path) -> object:
    try:
        return json.loads(path.read_bytes())
    except OSError as error:
        raise ImageStackError(f"{path} cannot be read: {error.strerror}") from error
    except json.JSONDecodeError as error:
        at = f" at line {error.lineno}, column {error.colno}"
    except (ValueError, RecursionError):
        at = ""
    raise ImageStackError(
        f"{path} is not written as JSON{at}; right would be, for example, "
        f'{{"pixel_spacing_mm": 0.1, "slice_spacing_mm": 0.5}}'
    )


class _Keys:
    """The keys of one object in a spacing.json; null is as good as a key that is not there."""

    def __init__(self, content: object, where: str) -> None:
        if not isinstance(content, dict):
            raise ImageStackError(
                f"{where} must hold keys and values in braces, not {_shown(content)}"
            )
        self._content = cast("dict[str, object]", content)
        self._where = where

    def number(self, key: str) -> float | None:
        """Return the number of a key."""
        value = self._content.get(key)
        if value is None or _is_number(value):
            return None if value is None else _as_float(value)
        raise self._wrong(key, "one number, as 0.5", value)

    def pair(self, key: str) -> tuple[float, float] | None:
        """Return the two numbers of a key, or its one number twice."""
        value = self._content.get(key)
        if value is None:
            return None
        if _is_number(value):
            return _as_float(value), _as_float(value)
        numbers = _numbers(value, 2)
        if numbers is None:
            raise self._wrong(
                key,
                "one number or two (between rows, between columns), as 0.1 or [0.1, 0.1]",
                value,
            )
        return numbers[0], numbers[1]

    def vector(self, key: str) -> Vector | None:
        """Return the three numbers of a key."""
        value = self._content.get(key)
        if value is None:
            return None
        numbers = _numbers(value, 3)
        if numbers is None or not all(abs(number) <= LARGEST_COORDINATE_MM for number in numbers):
            raise self._wrong(
                key, f"three numbers up to {LARGEST_COORDINATE_MM:g}, as [0, 0, 1]", value
            )
        return numbers[0], numbers[1], numbers[2]

    def needed_vector(self, key: str) -> Vector:
        """Return the three numbers of a key that must be there."""
        vector = self.vector(key)
        if vector is None:
            raise ImageStackError(f"{key} is missing in {self._where}: three numbers are needed")
        return vector

    def units(self, key: str) -> str:
        """Return the name of the units, mm if there is none."""
        value = self._content.get(key)
        if value is None:
            return MM
        if isinstance(value, str) and (value == MM or value.startswith(RELATIVE)):
            return value
        raise self._wrong(
            key, f'"{MM}", or start with "{RELATIVE}" where the scale is not known', value
        )

    def objects(self, key: str) -> "list[_Keys] | None":
        """Return the objects in the list of a key."""
        value = self._content.get(key)
        if value is None:
            return None
        if not isinstance(value, list):
            raise self._wrong(
                key, "a list with origin_mm, col_dir and row_dir of each image", value
            )
        items = cast("list[object]", value)
        return [
            _Keys(item, f"entry {number} of {key} in {self._where}")
            for number, item in enumerate(items, start=1)
        ]

    def _wrong(self, key: str, right: str, value: object) -> ImageStackError:
        return ImageStackError(f"{key} in {self._where} must be {right}, not {_shown(value)}")


def _spacing_record(keys: _Keys) -> SpacingRecord:
    planes = keys.objects("frames")
    return SpacingRecord(
        pixel_spacing_mm=keys.pair("pixel_spacing_mm"),
        pixel_spacing=keys.pair("pixel_spacing"),
        slice_spacing_mm=keys.number("slice_spacing_mm"),
        slice_spacing=keys.number("slice_spacing"),
        units=keys.units("units"),
        first_slice_origin_mm=keys.vector("first_slice_origin_mm"),
        col_dir=keys.vector("col_dir"),
        row_dir=keys.vector("row_dir"),
        slice_dir=keys.vector("slice_dir"),
        slice_count=keys.number("slice_count"),
        frames=None
        if planes is None
        else [
            PlaneRecord(
                origin_mm=plane.needed_vector("origin_mm"),
                col_dir=plane.needed_vector("col_dir"),
                row_dir=plane.needed_vector("row_dir"),
                normal=plane.vector("normal"),
            )
            for plane in planes
        ],
    )


def _is_number(value: object) -> bool:
    # In Python, true is an int.
    return isinstance(value, int | float) and not isinstance(value, bool)


def _as_float(value: Any) -> float:
    try:
        return float(value)
    except OverflowError:
        return math.inf


def _numbers(value: object, count: int) -> list[float] | None:
    """Return a value that is a list of so many numbers, else None."""
    if not isinstance(value, list):
        return None
    items = cast("list[object]", value)
    if len(items) != count or not all(_is_number(item) for item in items):
        return None
    return [_as_float(item) for item in items]


def _shown(value: object) -> str:
    """Return a value as it stands in the file, shortened to fit into a line."""
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 40 else f"{text[:37]}..."
