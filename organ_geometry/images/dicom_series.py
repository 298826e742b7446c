"""A DICOM series: its files in the order in which their images stand in space."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from organ_geometry.images.grey_image import GreyImage, ImageStackError, list_text, size_text
from organ_geometry.images.grey_levels import GreyLevels, Window, grey_levels
from organ_geometry.images.image_files import files_in
from organ_geometry.images.image_planes import (
    ImagePlanes,
    check_pixel_size,
    check_spacing,
    plane_frame,
)
from organ_geometry.images.medical_file import (
    MedicalHeader,
    is_dicom_file,
    read_header,
    read_values,
)

SERIES_UID = "0020|000e"
SERIES_DESCRIPTION = "0008|103e"
POSITION = "0020|0032"
ORIENTATION = "0020|0037"
PIXEL_SPACING = "0028|0030"
RESCALE_INTERCEPT = "0028|1052"
RESCALE_SLOPE = "0028|1053"
BITS_STORED = "0028|0101"
SIGNED = "0028|0103"

# Images nearer than this share of the usual distance stand at one position; a distance that is
# further than the second share from the usual one is said.
SAME_PLACE_FRACTION = 0.01
UNEVEN_FRACTION = 0.02
# Directions and sizes of one series agree to this many decimals.
_DECIMALS = 3


@dataclass(frozen=True, slots=True)
class DicomSlices:
    """Images of a DICOM series, read from their files when they are asked for."""

    files: tuple[Path, ...]  # (S,) file of each image, in the order of their places
    shape: tuple[int, int]  # (2,) rows H and columns W of every image
    # What the grey levels stand for; values in between are in the series' own unit, such as HU.
    levels: GreyLevels

    def image(self, index: int) -> GreyImage:
        """Return one image, read from its file now."""
        values = read_values(self.files[index])
        if values.shape != (1, *self.shape):
            raise ImageStackError(
                f"{self.files[index]} is not one grey image of {size_text(self.shape)} pixels"
            )
        return self.levels.image(values[0])


@dataclass(frozen=True, slots=True, eq=False)
class DicomSeries:
    """A series and where its images stand."""

    slices: DicomSlices  # The images
    planes: ImagePlanes  # The plane of each
    notes: tuple[str, ...]  # What is not as it should be and does no harm, a sentence each


@dataclass(frozen=True, slots=True, eq=False)
class _Image:
    """One file of a series, and its place by its header."""

    file: Path
    header: MedicalHeader
    position: NDArray[np.float64]
    orientation: NDArray[np.float64]
    pixel_size: NDArray[np.float64]

    @property
    def key(self) -> tuple[object, ...]:
        """What the images of one series have in common; a UID may be empty."""
        return (
            self.header.tags.get(SERIES_UID, ""),
            self.header.size[:2],
            *np.round(self.orientation, _DECIMALS).tolist(),
            *np.round(self.pixel_size, _DECIMALS).tolist(),
        )


def read_series(source: Path, window: Window | None) -> DicomSeries:
    """Return the DICOM series in a folder, ordered along the normal of its images."""
    folder = source.parent if source.is_file() else source
    files = [file for file in files_in(folder) if is_dicom_file(file)]
    if source.is_file() and source not in files:
        files.append(source)
    series: dict[tuple[object, ...], list[_Image]] = {}
    for file in files:
        image = _read_image(file)
        series.setdefault(image.key, []).append(image)
    if source.is_file():
        images = next(group for group in series.values() if source in {one.file for one in group})
    elif len(series) == 1:
        (images,) = series.values()
    else:
        raise ImageStackError(
            f"{source} holds {len(series)} series: give one file of the one wanted, such as "
            + list_text(_series_text(group) for group in series.values())
        )
    return _placed(images, folder, window)


def _read_image(file: Path) -> _Image:
    header = read_header(file)
    if header.components > 1:
        raise ImageStackError(f"{file} is in colour; grey is read")
    if len(header.size) > 2 and header.size[2] > 1:
        raise ImageStackError(
            f"{file} holds {header.size[2]} frames: give a file of several frames by itself"
        )
    rows, columns = _numbers(file, header, PIXEL_SPACING, "PixelSpacing", 2)
    return _Image(
        file=file,
        header=header,
        position=_numbers(file, header, POSITION, "ImagePositionPatient", 3),
        orientation=_numbers(file, header, ORIENTATION, "ImageOrientationPatient", 6),
        # DICOM has the distance between rows first.
        pixel_size=np.array([columns, rows]),
    )


def _numbers(
    file: Path, header: MedicalHeader, tag: str, name: str, count: int
) -> NDArray[np.float64]:
    text = header.tags.get(tag, "")
    try:
        numbers = np.array([float(fraction) for fraction in text.split("\\")])
    except ValueError:
        numbers = np.zeros(0)
    if len(numbers) != count or not np.isfinite(numbers).all():
        raise ImageStackError(
            f"{file} does not say where it stands: its {name} must be {count} numbers, "
            f"not {text or 'missing'}"
        )
    return numbers


def _series_text(images: list[_Image]) -> str:
    first = min(images, key=lambda image: image.file.name)
    description = first.header.tags.get(SERIES_DESCRIPTION, "")
    named = f" {description!r}" if description else ""
    return f"{first.file.name} ({len(images)} images{named})"


def _placed(images: list[_Image], folder: Path, window: Window | None) -> DicomSeries:
    """Return a series in order, and notes on its distances."""
    first = images[0]
    x_dir, y_dir = first.orientation[:3], first.orientation[3:]
    frame = plane_frame(x_dir, y_dir, np.cross(x_dir, y_dir), first.file)
    check_pixel_size((float(first.pixel_size[0]), float(first.pixel_size[1])), first.file)
    heights = np.array([float(image.position @ frame[:, 2]) for image in images])
    order = [int(index) for index in np.argsort(heights, kind="stable")]
    ordered = [images[index] for index in order]
    steps = np.diff(heights[order])
    distance, notes = _distances(steps, ordered, folder)
    columns, rows = first.header.size[:2]
    to_middle = frame[:, :2] @ (0.5 * (np.array([columns, rows]) - 1.0) * first.pixel_size)
    return DicomSeries(
        slices=DicomSlices(
            files=tuple(image.file for image in ordered),
            shape=(rows, columns),
            levels=_levels(ordered, window),
        ),
        planes=ImagePlanes(
            pixel_size=first.pixel_size,
            slice_spacing=distance,
            origins=np.array([image.position for image in ordered]) + to_middle,
            frames=np.broadcast_to(frame, (len(ordered), 3, 3)),
        ),
        notes=notes,
    )


def _distances(
    steps: NDArray[np.float64], ordered: list[_Image], folder: Path
) -> tuple[float, tuple[str, ...]]:
    """Return the usual distance between images, mm, and notes on those that differ."""
    if len(steps) == 0:
        return 0.0, ()
    usual = float(np.median(steps))
    same = [at for at, step in enumerate(steps) if step <= SAME_PLACE_FRACTION * usual]
    if same:
        one, other = ordered[same[0]].file.name, ordered[same[0] + 1].file.name
        more = f", and {len(same) - 1} more" if len(same) > 1 else ""
        raise ImageStackError(
            f"{one} and {other} stand at one position{more} (in {folder}): "
            f"a series has one image at each place"
        )
    check_spacing("slice spacing", usual, folder)
    uneven = [at for at, step in enumerate(steps) if abs(step - usual) > UNEVEN_FRACTION * usual]
    if not uneven:
        return usual, ()
    places = list_text(
        (
            f"{steps[at]:g} mm between {ordered[at].file.name} and {ordered[at + 1].file.name}"
            for at in uneven
        ),
        most=3,
    )
    return usual, (
        f"the images are {usual:g} mm apart, but {places}: they are taken where they stand",
    )


def _levels(images: list[_Image], window: Window | None) -> GreyLevels:
    """Return the levels that keep every value that the series' headers allow."""
    lows: list[float] = []
    highs: list[float] = []
    whole = True
    for image in images:
        tags = image.header.tags
        slope, intercept = _number(tags, RESCALE_SLOPE, 1.0), _number(tags, RESCALE_INTERCEPT, 0.0)
        bits = int(_number(tags, BITS_STORED, 8.0 * image.header.value_bytes))
        signed = _number(tags, SIGNED, 0.0) != 0.0
        lowest = -(2.0 ** (bits - 1)) if signed else 0.0
        ends = intercept + slope * np.array([lowest, lowest + 2.0**bits - 1.0])
        lows.append(float(ends.min()))
        highs.append(float(ends.max()))
        whole = whole and slope.is_integer() and intercept.is_integer()
    low, high = (min(lows), max(highs)) if window is None else window
    return grey_levels(low, high, whole=whole)


def _number(tags: dict[str, str], tag: str, otherwise: float) -> float:
    """Return the number of a tag, or another value where there is none."""
    try:
        value = float(tags.get(tag, ""))
    except ValueError:
        return otherwise
    return value if math.isfinite(value) else otherwise
