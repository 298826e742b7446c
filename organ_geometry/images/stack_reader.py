"""From files of images to a stack: folders, multipage TIFF, DICOM series and volumes."""

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from organ_geometry.images.dicom_series import read_series
from organ_geometry.images.grey_image import ImageStackError, list_text
from organ_geometry.images.grey_levels import (
    GreyLevels,
    LabelSlices,
    Window,
    WindowedSlices,
    check_window,
    grey_levels,
)
from organ_geometry.images.image_files import (
    IMAGE_SUFFIXES,
    TIFF_SUFFIXES,
    FileSlices,
    file_slices,
    files_in,
    name_jumps,
)
from organ_geometry.images.image_planes import ImagePlanes, check_pixel_size, planes_of_files
from organ_geometry.images.image_region import CroppedSlices, Region, cropped_planes, image_region
from organ_geometry.images.image_stack import ImageStack
from organ_geometry.images.image_volume import (
    INDEX_AXES,
    Axis,
    VolumeSlices,
    along_axis,
    axis_number,
    even_step,
    read_volume,
)
from organ_geometry.images.medical_file import (
    is_dicom_file,
    is_volume_file,
    read_header,
    volume_files,
)
from organ_geometry.images.spacing_file import read_spacing

# Images of more values are grey.
MOST_LABELS = 64


@dataclass(frozen=True, slots=True)
class ReadOptions:
    """Which images of a stack to read, and sizes that they do not state themselves.

    Attributes
    ----------
    pixel_size
        Distance between pixel centres, mm: from column to column (x), then from row to row (y).
        Note that a ``spacing.json`` has the row spacing first.
    slice_spacing
        Distance between neighbouring sections, mm. Given, it wins over one frame per slice too: the
        sections are then stacked straight.
    axis
        Axis that the images are across: "i" (rows), "j" (columns), "k" (through the images, the
        default) or 0, 1, 2; or "x", "y", "z" for the one of these nearest to that direction. Any
        other than "k" reads the stack into memory.
    label
        The label whose masks are wanted, of label images.
    window
        (2,) lowest and highest value to keep (of CT: HU); values beyond are set to these.
    roi
        Columns and rows to keep, and if wanted sections: (x0, y0, x1, y1) or (x0, y0, x1, y1,
        first, last), from 0, the last ones included, in the images across `axis`.
    """

    pixel_size: tuple[float, float] | None = None
    slice_spacing: float | None = None
    axis: Axis | None = None
    label: int | None = None
    window: Window | None = None
    roi: Region | None = None

    def __post_init__(self) -> None:
        if self.label is not None and self.window is not None:
            raise ImageStackError(
                "a label and a window cannot be given together: a label has no levels"
            )
        if self.window is not None:
            check_window(self.window)


def read_image_stack(path: Path, options: ReadOptions | None = None) -> ImageStack:
    """Return the stack of cross-section images in a folder, a multipage TIFF or a volume file.

    A folder holds PNG, JPEG, TIFF or BMP images, taken in natural order (slice_2 before slice_10),
    or one DICOM series, taken in the order of its places. Of a volume (NIfTI, NRRD, MetaImage) the
    images across its last axis are taken. Medical images stand in LPS mm, as their files say. One
    DICOM file of a series stands for its folder.

    What is not given of image files' sizes comes from a ``spacing.json`` in the folder or in its
    parent; its ``pixel_spacing_mm`` may be one number for square pixels. Without directions there,
    the sections stand along +x, with +y to the right and +z up in the image.

    Returns
    -------
    ImageStack
        The sections; of a folder, only the first image has been read.

    Raises
    ------
    ImageStackError
        If there are no images, the first is unreadable, the spacing is missing or wrong, the label
        or axis is not there or the region is not inside.
    """
    source, options = Path(path), ReadOptions() if options is None else options
    stack = _whole_stack(source, options)
    if options.axis is not None:
        stack = _across(stack, options.axis)
    return stack if options.roi is None else _cropped(stack, options.roi)


def stack_labels(stack: ImageStack) -> tuple[int, ...]:
    """Return the labels of a stack whose images look like labels: 0 and a few whole numbers."""
    present: set[int] = set()
    for image in stack.images():
        levels = np.flatnonzero(np.bincount(image.ravel()))
        values = stack.level_offset + stack.level_step * levels
        whole = np.rint(values)
        if np.abs(values - whole).max() > 0.5 * stack.level_step or stack.level_step > 1.0:
            return ()
        present.update(int(value) for value in whole)
        if len(present) > MOST_LABELS + 1 or min(present) < 0:
            return ()
        # The smooth edge of a mask has few values too, up to white.
        if isinstance(stack.slices, FileSlices) and max(present) > MOST_LABELS:
            return ()
    return tuple(sorted(present - {0})) if 0 in present and len(present) > 2 else ()


def _whole_stack(source: Path, options: ReadOptions) -> ImageStack:
    label, window = options.label, options.window
    if not source.exists():
        raise ImageStackError(f"there is no folder of images at {source}, and no file")
    if source.is_dir() and _holds_dicom(source):
        stack = _dicom_stack(source, window)
    elif source.is_dir() or source.suffix.lower() in TIFF_SUFFIXES:
        return _file_stack(source, options)
    elif is_volume_file(source):
        stack = _volume_stack(source, label, window)
        label = None
    elif is_dicom_file(source):
        depth = read_header(source).size[2:]
        stack = (
            _volume_stack(source, label, window)
            if depth and depth[0] > 1
            else _dicom_stack(source, window)
        )
    else:
        raise ImageStackError(
            f"{source} is one file and not a multipage TIFF, DICOM, NIfTI (.nii, .nii.gz), NRRD "
            f"or MetaImage (.mhd, .mha) file: give one of these or a folder of images"
        )
    if label is not None:
        raise ImageStackError(f"{source} has grey values and no labels")
    planes = stack.planes.with_sizes(options.pixel_size, options.slice_spacing, source)
    return dataclasses.replace(stack, planes=planes)


def _holds_dicom(folder: Path) -> bool:
    """Return whether a folder holds DICOM files; images beside them could be meant too."""
    files = files_in(folder)
    dicom = sum(is_dicom_file(file) for file in files)
    if not dicom:
        return False
    images = sum(file.suffix.lower() in IMAGE_SUFFIXES for file in files)
    if images:
        raise ImageStackError(
            f"{folder} holds {dicom} DICOM files and {images} other images: "
            f"put the ones wanted into a folder of their own"
        )
    return True


def _file_stack(source: Path, options: ReadOptions) -> ImageStack:
    """Return the stack of a folder of image files or of a multipage TIFF."""
    files = file_slices(source)
    planes = planes_of_files(
        source,
        files.files[0].parent,
        len(files.files),
        options.pixel_size,
        options.slice_spacing,
    )
    stack = ImageStack(
        source=source,
        names=files.names,
        slices=files,
        shape=files.shape,
        planes=planes,
        bytes_in=files.byte_count,
        doubts=tuple(_missing_images(files, planes)),
    )
    if options.label is not None:
        _check_label(stack, options.label)
        return dataclasses.replace(stack, slices=LabelSlices(files, options.label))
    if options.window is not None:
        levels = grey_levels(*options.window, whole=True)
        return _levelled(dataclasses.replace(stack, slices=WindowedSlices(files, levels)), levels)
    return stack


def _missing_images(files: FileSlices, planes: ImagePlanes) -> Iterator[str]:
    """Yield a sentence if images seem to be missing, by their names' numbers or spacing.json."""
    gaps = np.linalg.norm(np.diff(planes.origins, axis=0), axis=1)
    # A gap that the planes have, too, is none.
    jumps = {
        place: count
        for place, count in name_jumps(files.names).items()
        if gaps[place] < 1.5 * planes.slice_spacing
    }
    missing = sum(jumps.values())
    if missing and not files.paged:
        place = max(jumps, key=lambda each: jumps[each])
        more = f" and at {len(jumps) - 1} other places" if len(jumps) > 1 else ""
        lost = missing * planes.slice_spacing
        yield (
            f"{missing} {'image seems' if missing == 1 else 'images seem'} to be missing, as "
            f"names jump from {files.names[place]} to "
            f"{files.names[place + 1]}{more}: the organ is then {lost:.3g} mm too short"
        )
    path, spacing = read_spacing(files.files[0].parent)
    count = spacing.slice_count
    if count is not None and count != len(files.names) and count != len(files.names) + missing:
        yield f"{path} says slice_count {count:g}, and there are {len(files.names)} images"


def _check_label(stack: ImageStack, label: int) -> None:
    """Raise an error that names all labels if none of the images has the wanted one."""
    present: set[int] = set()
    for image in stack.images():
        present.update(np.unique(image).tolist())
        if label in present:
            return
    named = list_text(sorted(present - {0}))
    raise ImageStackError(f"label {label} is not in {stack.source}, which has {named or 'none'}")


def _volume_stack(source: Path, label: int | None, window: Window | None) -> ImageStack:
    voxels, planes, levels = read_volume(source, label=label, window=window)
    doubts: list[str] = []
    if label is not None:
        from organ_geometry.images.label_components import DOUBTED_FRACTION, label_components

        components = label_components(
            voxels > 0, np.array([*planes.pixel_size, planes.slice_spacing])
        )
        if components.fraction > DOUBTED_FRACTION:
            doubts.append(
                f"label {label} is in {components.count} parts, the second {components.gap:.1f} mm "
                f"from the first and {components.fraction:.0%} of it, and an organ is one: "
                "join them"
            )
    stack = ImageStack(
        source=source,
        names=_plane_names(source, "k", len(voxels)),
        slices=VolumeSlices(voxels),
        shape=(voxels.shape[1], voxels.shape[2]),
        planes=planes,
        bytes_in=sum(file.stat().st_size for file in volume_files(source)),
        doubts=tuple(doubts),
    )
    return stack if levels is None else _levelled(stack, levels)


def _dicom_stack(source: Path, window: Window | None) -> ImageStack:
    series = read_series(source, window)
    files = series.slices.files
    return _levelled(
        ImageStack(
            source=source,
            names=tuple(file.name for file in files),
            slices=series.slices,
            shape=series.slices.shape,
            planes=series.planes,
            bytes_in=sum(file.stat().st_size for file in files),
            notes=series.notes,
        ),
        series.slices.levels,
    )


def _plane_names(source: Path, axis: str, count: int) -> tuple[str, ...]:
    return tuple(f"{source.name} {axis}={index}" for index in range(count))


def _levelled(stack: ImageStack, levels: GreyLevels) -> ImageStack:
    return dataclasses.replace(stack, level_offset=levels.low, level_step=levels.step)


def _across(stack: ImageStack, axis: Axis) -> ImageStack:
    """Return a stack as images across another axis; all images are then held in memory."""
    number = axis_number(axis, stack.planes)
    if number == 2:
        return stack
    even_step(stack.planes, stack.source)
    voxels = (
        stack.slices.voxels
        if isinstance(stack.slices, VolumeSlices)
        else np.stack(list(stack.images()))
    )
    voxels, planes = along_axis(voxels, stack.planes, number, stack.source)
    check_pixel_size((float(planes.pixel_size[0]), float(planes.pixel_size[1])), stack.source)
    return dataclasses.replace(
        stack,
        names=_plane_names(stack.source, INDEX_AXES[number], len(voxels)),
        slices=VolumeSlices(voxels),
        shape=(voxels.shape[1], voxels.shape[2]),
        planes=planes,
    )


def _cropped(stack: ImageStack, roi: Region) -> ImageStack:
    region = image_region(roi, stack.shape, len(stack))
    return dataclasses.replace(
        stack,
        names=stack.names[region.first : region.last + 1],
        slices=CroppedSlices(stack.slices, region),
        shape=region.shape,
        planes=cropped_planes(stack.planes, stack.shape, region),
    )
