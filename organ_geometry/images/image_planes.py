"""Where each image of a stack stands in space."""

import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from organ_geometry.images.grey_image import ImageStackError
from organ_geometry.images.spacing_file import (
    MM,
    SPACING_FILE,
    PlaneRecord,
    SpacingRecord,
    read_spacing,
)

# Image up is +z and the organ runs along +x, so that a duct lies as the trainer shows it.
DEFAULT_COLUMN_DIRECTION = (0.0, 1.0, 0.0)
DEFAULT_ROW_DIRECTION = (0.0, 0.0, -1.0)
DEFAULT_SLICE_DIRECTION = (1.0, 0.0, 0.0)

# Directions in a file are usually rounded to a few decimals.
DIRECTION_TOLERANCE = 1e-3

# Outside of these, a pixel size or slice spacing is a slip of its unit.
SMALLEST_SPACING_MM = 1e-6
LARGEST_SPACING_MM = 1000.0
# And so is a pixel of which one side is so many times the other.
LARGEST_ASPECT = 1000.0


@dataclass(frozen=True, slots=True, eq=False)
class ImagePlanes:
    """The planes of a stack of S images.

    The centre of pixel (row r, column c) of image i, of H rows and W columns, is
    ``origins[i] + (c-(W-1)/2) pixel_size[0] x_dir + (r-(H-1)/2) pixel_size[1] y_dir``.
    """

    # (2,) distance between pixel centres, mm, from column to column (x), from row to row (y).
    pixel_size: NDArray[np.float64]
    # Distance between neighbouring planes, mm; the typical one where it varies.
    slice_spacing: float
    origins: NDArray[np.float64]  # (S, 3) centre of each image, mm
    # (S, 3, 3) unit directions as columns: x_dir (column to column), y_dir (row to row, down the
    # image) and the plane's normal, pointing along the stack.
    frames: NDArray[np.float64]
    # What the lengths are called where they come from: "mm", or "relative" and what follows it.
    units: str = MM

    def __post_init__(self) -> None:
        for field in ("pixel_size", "origins", "frames"):
            locked = np.array(getattr(self, field), dtype=np.float64)
            locked.setflags(write=False)
            object.__setattr__(self, field, locked)

    def with_sizes(
        self,
        pixel_size: tuple[float, float] | None,
        slice_spacing: float | None,
        where: Path,  # What a message names
    ) -> "ImagePlanes":
        """Return the planes with other sizes, where such are given."""
        # (2,) distances between pixel centres and the distance between planes, mm; None leaves
        # them. With a spacing the planes are stacked straight from the first one on. Where both are
        # given the planes are in mm, whatever their files said. A size that is not above 0 or looks
        # like a slip of the unit is an ImageStackError.
        planes = self
        if pixel_size is not None:
            check_pixel_size(pixel_size, where)
            planes = dataclasses.replace(planes, pixel_size=np.array(pixel_size, dtype=np.float64))
        if slice_spacing is not None:
            check_spacing("slice spacing", slice_spacing, where)
            steps = slice_spacing * np.arange(len(self.origins))
            planes = dataclasses.replace(
                planes,
                slice_spacing=slice_spacing,
                origins=self.origins[0] + steps[:, np.newaxis] * self.frames[0, :, 2],
                frames=np.broadcast_to(self.frames[0], self.frames.shape),
            )
        if pixel_size is not None and slice_spacing is not None:
            planes = dataclasses.replace(planes, units=MM)
        return planes


def planes_of_files(
    source: Path,
    folder: Path,
    count: int,
    pixel_size: tuple[float, float] | None,
    slice_spacing: float | None,
) -> ImagePlanes:
    """Return the planes of images in files, by a `spacing.json` and the options given."""
    spacing_path, spacing = read_spacing(folder)
    where = spacing_path or source
    pixels = _pixel_size(source, where, pixel_size, spacing)
    if slice_spacing is None and spacing.frames is not None:
        origins, frames = _separate_planes(spacing.frames, count, source, where)
        distance = _given(spacing.slice_spacing_mm, spacing.slice_spacing)
        if distance is None:
            steps = np.linalg.norm(np.diff(origins, axis=0), axis=1)
            distance = float(steps.mean()) if len(steps) else 0.0
        else:
            check_spacing("slice spacing", distance, where)
    else:
        distance = _given(slice_spacing, spacing.slice_spacing_mm, spacing.slice_spacing)
        if distance is None:
            raise ImageStackError(_missing("slice spacing", source))
        check_spacing("slice spacing", distance, where if slice_spacing is None else source)
        origins, frames = _parallel_planes(spacing, count, distance, where)
    return ImagePlanes(
        pixel_size=pixels,
        slice_spacing=distance,
        origins=origins,
        frames=frames,
        units=MM if pixel_size is not None and slice_spacing is not None else spacing.units,
    )


def _given(*values: float | None) -> float | None:
    """Return the first value that is given."""
    return next((value for value in values if value is not None), None)


def _missing(what: str, source: Path) -> str:
    return (
        f"the {what} of {source} is missing: give --pixel-size and --slice-spacing or a "
        f"{SPACING_FILE} in the folder or its parent"
    )


def check_spacing(what: str, value: float, where: Path) -> None:
    """Raise an ImageStackError if a length between pixels or planes cannot be one in mm."""
    if not (math.isfinite(value) and value > 0.0):
        raise ImageStackError(f"the {what} of {where} must be above 0 mm, not {value:g} mm")
    if not SMALLEST_SPACING_MM <= value <= LARGEST_SPACING_MM:
        raise ImageStackError(
            f"the {what} of {where} must be from {SMALLEST_SPACING_MM:g} to "
            f"{LARGEST_SPACING_MM:g} mm, not {value:g} mm, which looks like a slip of the unit"
        )


def check_pixel_size(sides: tuple[float, float], where: Path) -> None:
    """Raise an ImageStackError if the width and the height of a pixel cannot be these, in mm."""
    for value in sides:
        check_spacing("pixel size", value, where)
    aspect = max(sides) / min(sides)
    # Three decimals written in a file are not exactly a thousandth.
    if aspect > LARGEST_ASPECT * (1.0 + DIRECTION_TOLERANCE):
        raise ImageStackError(
            f"the pixel size of {where} must have sides of which one is up to {LARGEST_ASPECT:g} "
            f"times the other, not {sides[0]:g} x {sides[1]:g} mm, which looks like a slip of the "
            f"unit"
        )


def _pixel_size(
    source: Path,
    where: Path,
    argument: tuple[float, float] | None,
    spacing: SpacingRecord,
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
    check_pixel_size(pixels, where)
    return np.array(pixels, dtype=np.float64)


def _parallel_planes(
    spacing: SpacingRecord, count: int, distance: float, where: Path
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return (S, 3) origins, mm, and (S, 3, 3) frames of parallel planes."""
    column = spacing.col_dir or DEFAULT_COLUMN_DIRECTION
    row = spacing.row_dir or DEFAULT_ROW_DIRECTION
    along = np.array(spacing.slice_dir or DEFAULT_SLICE_DIRECTION)
    if abs(float(np.linalg.norm(along)) - 1.0) > DIRECTION_TOLERANCE:
        raise ImageStackError(f"slice_dir in {where} must have length 1, not {along.tolist()}")
    frame = plane_frame(column, row, along, where)
    first = np.array(spacing.first_slice_origin_mm or (0.0, 0.0, 0.0))
    steps = distance * np.arange(count)
    origins = first + steps[:, np.newaxis] * (along / np.linalg.norm(along))
    return origins, np.broadcast_to(frame, (count, 3, 3)).copy()


def _separate_planes(
    records: list[PlaneRecord], count: int, source: Path, where: Path
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
            plane_frame(
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


def plane_frame(
    column: ArrayLike, row: ArrayLike, along: NDArray[np.float64], where: Path
) -> NDArray[np.float64]:
    """Return the checked (3, 3) frame: x_dir, y_dir and the normal towards `along`, as columns."""
    x_dir = np.array(column, dtype=np.float64)
    y_dir = np.array(row, dtype=np.float64)
    for what, direction in (("col_dir", x_dir), ("row_dir", y_dir)):
        if abs(float(np.linalg.norm(direction)) - 1.0) > DIRECTION_TOLERANCE:
            raise ImageStackError(f"{what} in {where} must have length 1, not {direction.tolist()}")
    if abs(float(x_dir @ y_dir)) > DIRECTION_TOLERANCE:
        raise ImageStackError(
            f"col_dir and row_dir in {where} must be perpendicular, "
            f"not {x_dir.tolist()}, {y_dir.tolist()}"
        )
    x_dir = x_dir / np.linalg.norm(x_dir)
    y_dir = y_dir - x_dir * (x_dir @ y_dir)
    y_dir = y_dir / np.linalg.norm(y_dir)
    normal = np.cross(x_dir, y_dir)
    rise = float(normal @ along)
    if abs(rise) < DIRECTION_TOLERANCE:
        raise ImageStackError(
            f"the sections of {where} must follow each other across their planes: the direction "
            f"{along.tolist()} lies in the plane of {x_dir.tolist()}, {y_dir.tolist()}"
        )
    return np.stack([x_dir, y_dir, math.copysign(1.0, rise) * normal], axis=1)
