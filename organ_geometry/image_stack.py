"""A stack of cross-section images and where each image stands in space."""

import json
import math
import re
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias, cast

import cv2
import numpy as np
from numpy.typing import NDArray

GreyImage: TypeAlias = NDArray[np.uint8] | NDArray[np.uint16]

IMAGE_SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp"})
TIFF_SUFFIXES = frozenset({".tif", ".tiff"})
SPACING_FILE = "spacing.json"

# Image up is +z and the organ runs along +x, so that a duct lies as the trainer shows it.
DEFAULT_COLUMN_DIRECTION = (0.0, 1.0, 0.0)
DEFAULT_ROW_DIRECTION = (0.0, 0.0, -1.0)
DEFAULT_SLICE_DIRECTION = (1.0, 0.0, 0.0)

# Directions in a spacing.json are usually rounded to a few decimals.
DIRECTION_TOLERANCE = 1e-3

# Outside of these, a pixel size or slice spacing is a slip of its unit.
SMALLEST_SPACING_MM = 1e-6
LARGEST_SPACING_MM = 1000.0
LARGEST_COORDINATE_MM = 1e7

# What `units` in a spacing.json may be, or may start with.
MM = "mm"
RELATIVE = "relative"

_READ_GREY = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION


class ImageStackError(ValueError):
    """A stack of images that cannot be used, with one line saying what would be right."""


@dataclass(frozen=True, slots=True, eq=False)
class ImageStack:
    """Cross-section images in order, read one at a time, and the plane of each.

    The centre of pixel (row r, column c) of section i, in an image of H rows and W columns, is
    ``origins[i] + (c-(W-1)/2) pixel_size[0] x_dir + (r-(H-1)/2) pixel_size[1] y_dir``.

    Attributes
    ----------
    source
        The folder, or the multipage TIFF file.
    names
        (S,) name of each section, for messages and reports.
    files
        (S,) file of each image; the same file S times when `paged`.
    paged
        Whether the images are the pages of one file.
    shape
        (2,) rows H and columns W of every image.
    pixel_size
        (2,) distance between pixel centres, mm: first along a row (from column to column, x),
        then along a column (from row to row, y).
    slice_spacing
        Distance between neighbouring planes, mm.
    origins
        (S, 3) centre of each image in space, mm.
    frames
        (S, 3, 3) unit directions as columns: x_dir (column to column), y_dir (row to row, down the
        image) and the plane's normal, pointing along the stack.
    units
        What the lengths are called where they come from: "mm", or "relative" and what follows it.
    """

    source: Path
    names: tuple[str, ...]
    files: tuple[Path, ...]
    paged: bool
    shape: tuple[int, int]
    pixel_size: NDArray[np.float64]
    slice_spacing: float
    origins: NDArray[np.float64]
    frames: NDArray[np.float64]
    units: str = MM

    def __post_init__(self) -> None:
        for field in ("pixel_size", "origins", "frames"):
            locked = np.array(getattr(self, field), dtype=np.float64)
            locked.setflags(write=False)
            object.__setattr__(self, field, locked)

    def __len__(self) -> int:
        return len(self.names)

    def image(self, index: int) -> GreyImage:
        """Return one image, read from its file now.

        Parameters
        ----------
        index
            Number of the section, from 0.

        Returns
        -------
        GreyImage
            (H, W) grey levels, 8 or 16 bit; colour is turned into grey.

        Raises
        ------
        ImageStackError
            If the file is not a readable image or its size is not that of the first image.
        """
        page = index if self.paged else None
        image = _read_grey(self.files[index], page, self.names[index])
        if image.shape != self.shape:
            raise ImageStackError(
                f"all images of a stack must have one size: {self.names[0]} has "
                f"{_size_text(self.shape)} and {self.names[index]} has "
                f"{_size_text(image.shape)} pixels (in {self.source})"
            )
        return image

    def images(self) -> Iterator[GreyImage]:
        """Yield the images in order; only one is held at a time.

        Yields
        ------
        GreyImage
            (H, W) grey levels of the next section.
        """
        for index in range(len(self)):
            yield self.image(index)


def read_image_stack(
    folder: Path,
    *,
    pixel_size: tuple[float, float] | None = None,
    slice_spacing: float | None = None,
) -> ImageStack:
    """Return the stack of cross-section images in a folder or in a multipage TIFF file.

    Files are taken in natural order (slice_2 before slice_10). What is not given as an argument
    comes from a ``spacing.json`` in the folder or in its parent; its ``pixel_spacing_mm`` may be
    one number for square pixels. Without directions there, the sections stand along +x, with +y to
    the right and +z up in the image.

    Parameters
    ----------
    folder
        Folder of PNG, JPEG, TIFF or BMP images, or one multipage TIFF file.
    pixel_size
        Distance between pixel centres, mm: from column to column (x), then from row to row (y).
        Note that a ``spacing.json`` has the row spacing first.
    slice_spacing
        Distance between neighbouring sections, mm. Given, it wins over one frame per slice too: the
        sections are then stacked straight.

    Returns
    -------
    ImageStack
        The sections; only the first image has been read.

    Raises
    ------
    ImageStackError
        If there are no images, the first is unreadable, or the spacing is missing or wrong.
    """
    source = Path(folder)
    files, paged = _image_files(source)
    names = (
        tuple(f"{file.name} page {page}" for page, file in enumerate(files))
        if paged
        else tuple(file.name for file in files)
    )
    first = _read_grey(files[0], 0 if paged else None, names[0])
    rows, columns = first.shape

    spacing_path, spacing = _read_spacing(files[0].parent)
    where = spacing_path or source
    pixels = _pixel_size(source, where, pixel_size, spacing)
    if slice_spacing is None and spacing.frames is not None:
        origins, frames = _separate_planes(spacing.frames, len(files), source, where)
        distance = _given(spacing.slice_spacing_mm, spacing.slice_spacing)
        if distance is None:
            steps = np.linalg.norm(np.diff(origins, axis=0), axis=1)
            distance = float(steps.mean()) if len(steps) else 0.0
        else:
            _check_spacing("slice spacing", distance, where)
    else:
        distance = _given(slice_spacing, spacing.slice_spacing_mm, spacing.slice_spacing)
        if distance is None:
            raise ImageStackError(_missing("slice spacing", source))
        _check_spacing("slice spacing", distance, where if slice_spacing is None else source)
        origins, frames = _parallel_planes(spacing, len(files), distance, where)
    return ImageStack(
        source=source,
        names=names,
        files=files,
        paged=paged,
        shape=(rows, columns),
        pixel_size=pixels,
        slice_spacing=distance,
        origins=origins,
        frames=frames,
        units=MM if pixel_size is not None and slice_spacing is not None else spacing.units,
    )


_Vector: TypeAlias = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class _PlaneRecord:
    """One slice's plane in a spacing.json."""

    origin_mm: _Vector
    col_dir: _Vector
    row_dir: _Vector
    normal: _Vector | None = None


@dataclass(frozen=True, slots=True)
class _SpacingRecord:
    """What is used of a spacing.json; pixel spacings there are row first, then column."""

    pixel_spacing_mm: tuple[float, float] | None = None
    pixel_spacing: tuple[float, float] | None = None
    slice_spacing_mm: float | None = None
    slice_spacing: float | None = None
    units: str = MM
    first_slice_origin_mm: _Vector | None = None
    col_dir: _Vector | None = None
    row_dir: _Vector | None = None
    slice_dir: _Vector | None = None
    frames: list[_PlaneRecord] | None = None


def _image_files(source: Path) -> tuple[tuple[Path, ...], bool]:
    """Return the file of each image in natural order, and whether they are pages of one file."""
    if source.is_file():
        if source.suffix.lower() not in TIFF_SUFFIXES:
            raise ImageStackError(
                f"{source} is one file and not a multipage TIFF: give a folder of images or a .tif"
            )
        return (source,) * _page_count(source), True
    if not source.is_dir():
        raise ImageStackError(f"there is no folder of images at {source}")
    files = sorted(
        (
            file
            for file in source.iterdir()
            if file.suffix.lower() in IMAGE_SUFFIXES
            and not file.name.startswith(".")
            and file.is_file()
        ),
        key=lambda file: _natural_key(file.name),
    )
    if not files:
        raise ImageStackError(
            f"the folder {source} holds no images: PNG, JPEG, TIFF or BMP files are read"
        )
    if len(files) == 1 and files[0].suffix.lower() in TIFF_SUFFIXES:
        pages = _page_count(files[0])
        if pages > 1:
            return (files[0],) * pages, True
    return tuple(files), False


def _natural_key(name: str) -> tuple[list[str | int], str]:
    """Return a sorting key by which slice_2 comes before slice_10."""
    parts = re.split(r"([0-9]+)", name.casefold())
    return [int(part) if index % 2 else part for index, part in enumerate(parts)], name


def _page_count(file: Path) -> int:
    """Return the number of pages of a TIFF file."""
    try:
        with _quiet_decoders():
            count = cv2.imcount(str(file), _READ_GREY)
    except cv2.error:
        count = 0
    if count < 1:
        raise ImageStackError(f"{file.name} cannot be read as an image (in {file.parent})")
    return count


@contextmanager
def _quiet_decoders() -> Generator[None]:
    """Keep OpenCV's own lines about a broken file off the error stream: one error tells it."""
    level = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        yield
    finally:
        cv2.utils.logging.setLogLevel(level)


def _read_grey(file: Path, page: int | None, name: str) -> GreyImage:
    """Return one image as 8 or 16 bit grey."""
    try:
        with _quiet_decoders():
            if page is None:
                data = np.frombuffer(file.read_bytes(), dtype=np.uint8)
                image = cv2.imdecode(data, _READ_GREY)
            else:
                _, pages = cv2.imreadmulti(str(file), start=page, count=1, flags=_READ_GREY)
                image = pages[0] if pages else None
    except (OSError, cv2.error):
        image = None
    if image is None:
        raise ImageStackError(f"{name} cannot be read as an image (in {file.parent})")
    if page is None and file.suffix.lower() in TIFF_SUFFIXES and _page_count(file) > 1:
        raise ImageStackError(
            f"{name} has several pages (in {file.parent}): give a multipage TIFF alone"
        )
    if image.dtype not in {np.dtype(np.uint8), np.dtype(np.uint16)}:
        raise ImageStackError(
            f"{name} has {image.dtype} pixels (in {file.parent}); 8 or 16 bit grey is read"
        )
    return image  # pyright: ignore[reportReturnType]


def _size_text(shape: tuple[int, ...]) -> str:
    return f"{shape[1]} x {shape[0]}"


def _read_spacing(folder: Path) -> tuple[Path | None, _SpacingRecord]:
    """Return the spacing.json of a folder or its parent, and its path if there is one."""
    for place in (folder, folder.resolve().parent):
        path = place / SPACING_FILE
        if not path.is_file():
            continue
        return path, _spacing_record(_Keys(_json_content(path), str(path)))
    return None, _SpacingRecord()


def _json_content(path: Path) -> object:
    """Return what a JSON file holds."""
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

    def vector(self, key: str) -> _Vector | None:
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

    def needed_vector(self, key: str) -> _Vector:
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


def _spacing_record(keys: _Keys) -> _SpacingRecord:
    """Return the checked content of a spacing.json."""
    planes = keys.objects("frames")
    return _SpacingRecord(
        pixel_spacing_mm=keys.pair("pixel_spacing_mm"),
        pixel_spacing=keys.pair("pixel_spacing"),
        slice_spacing_mm=keys.number("slice_spacing_mm"),
        slice_spacing=keys.number("slice_spacing"),
        units=keys.units("units"),
        first_slice_origin_mm=keys.vector("first_slice_origin_mm"),
        col_dir=keys.vector("col_dir"),
        row_dir=keys.vector("row_dir"),
        slice_dir=keys.vector("slice_dir"),
        frames=None
        if planes is None
        else [
            _PlaneRecord(
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
    """Return a list of so many numbers, or None if it is something else."""
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


def _given(*values: float | None) -> float | None:
    """Return the first value that is given."""
    return next((value for value in values if value is not None), None)


def _missing(what: str, source: Path) -> str:
    return (
        f"the {what} of {source} is missing: give --pixel-size and --slice-spacing or a "
        f"{SPACING_FILE} in the folder or its parent"
    )


def _check_spacing(what: str, value: float, where: Path) -> None:
    if not (math.isfinite(value) and value > 0.0):
        raise ImageStackError(f"the {what} of {where} must be above 0 mm, not {value:g} mm")
    if not SMALLEST_SPACING_MM <= value <= LARGEST_SPACING_MM:
        raise ImageStackError(
            f"the {what} of {where} must be from {SMALLEST_SPACING_MM:g} to "
            f"{LARGEST_SPACING_MM:g} mm, not {value:g} mm, which looks like a slip of the unit"
        )


def _pixel_size(
    source: Path,
    where: Path,
    argument: tuple[float, float] | None,
    spacing: _SpacingRecord,
) -> NDArray[np.float64]:
    """Return the checked (2,) pixel size, mm, column to column first."""
    if argument is not None:
        pixels = argument
        where = source
    else:
        recorded = spacing.pixel_spacing_mm or spacing.pixel_spacing
        if recorded is None:
            raise ImageStackError(_missing("pixel size", source))
        pixels = (recorded[1], recorded[0])
    for value in pixels:
        _check_spacing("pixel size", value, where)
    return np.array(pixels, dtype=np.float64)


def _parallel_planes(
    spacing: _SpacingRecord, count: int, distance: float, where: Path
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return (S, 3) origins, mm, and (S, 3, 3) frames of parallel planes."""
    column = spacing.col_dir or DEFAULT_COLUMN_DIRECTION
    row = spacing.row_dir or DEFAULT_ROW_DIRECTION
    along = np.array(spacing.slice_dir or DEFAULT_SLICE_DIRECTION)
    if abs(float(np.linalg.norm(along)) - 1.0) > DIRECTION_TOLERANCE:
        raise ImageStackError(f"slice_dir in {where} must have length 1, not {along.tolist()}")
    frame = _frame(column, row, along, where)
    first = np.array(spacing.first_slice_origin_mm or (0.0, 0.0, 0.0))
    steps = distance * np.arange(count)
    origins = first + steps[:, np.newaxis] * (along / np.linalg.norm(along))
    return origins, np.broadcast_to(frame, (count, 3, 3)).copy()


def _separate_planes(
    records: list[_PlaneRecord], count: int, source: Path, where: Path
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return (S, 3) origins, mm, and (S, 3, 3) frames, one plane for each image."""
    if len(records) != count:
        raise ImageStackError(
            f"{where} has {len(records)} frames and {source} has {count} images: "
            f"one frame for each image is needed"
        )
    origins = np.array([record.origin_mm for record in records])
    frames = np.array(
        [
            _frame(
                record.col_dir,
                record.row_dir,
                np.cross(record.col_dir, record.row_dir)
                if record.normal is None
                else np.array(record.normal),
                where,
            )
            for record in records
        ]
    )
    return origins, frames


def _frame(
    column: _Vector, row: _Vector, along: NDArray[np.float64], where: Path
) -> NDArray[np.float64]:
    """Return the (3, 3) frame with unit columns x_dir, y_dir and the normal nearest to `along`."""
    x_dir = np.array(column)
    y_dir = np.array(row)
    for what, direction in (("col_dir", x_dir), ("row_dir", y_dir)):
        if abs(float(np.linalg.norm(direction)) - 1.0) > DIRECTION_TOLERANCE:
            raise ImageStackError(f"{what} in {where} must have length 1, not {direction.tolist()}")
    if abs(float(x_dir @ y_dir)) > DIRECTION_TOLERANCE:
        raise ImageStackError(
            f"col_dir and row_dir in {where} must be perpendicular, not {list(column)}, {list(row)}"
        )
    x_dir = x_dir / np.linalg.norm(x_dir)
    y_dir = y_dir - x_dir * (x_dir @ y_dir)
    y_dir = y_dir / np.linalg.norm(y_dir)
    normal = np.cross(x_dir, y_dir)
    rise = float(normal @ along)
    if abs(rise) < DIRECTION_TOLERANCE:
        raise ImageStackError(
            f"the sections of {where} must follow each other across their planes: the direction "
            f"{along.tolist()} lies in the plane of {list(column)}, {list(row)}"
        )
    return np.stack([x_dir, y_dir, math.copysign(1.0, rise) * normal], axis=1)
