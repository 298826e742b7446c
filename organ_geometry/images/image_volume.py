"""Volumes: voxels in memory, where they stand, and the images along one of their axes."""

import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from organ_geometry.images.grey_image import GreyImage, ImageStackError, list_text
from organ_geometry.images.grey_levels import GreyLevels, Window, grey_levels, label_mask
from organ_geometry.images.image_planes import (
    DIRECTION_TOLERANCE,
    ImagePlanes,
    check_pixel_size,
    check_spacing,
    plane_frame,
)
from organ_geometry.images.medical_file import check_whole_nifti, read_header, read_values

Axis = str | int

INDEX_AXES = ("i", "j", "k")
SPACE_AXES = ("x", "y", "z")

# Planes are evenly spaced if none is further off than this share of their distance.
EVEN_FRACTION = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class VolumeSlices:
    """The images of a volume in memory."""

    voxels: GreyImage  # (S, H, W) grey levels

    def image(self, index: int) -> GreyImage:
        """Return the image of that number, from 0."""
        return np.ascontiguousarray(self.voxels[index])


def read_volume(
    path: Path, *, label: int | None, window: Window | None
) -> tuple[GreyImage, ImagePlanes, GreyLevels | None]:
    """Return the grey levels of a volume file, its planes, and the values of the levels."""
    # A NIfTI, NRRD or MetaImage file or a DICOM file of several frames is read whole, as (K, J, I)
    # levels of K planes across its last axis; with a label as that label's mask, with a window (2,)
    # clipped to its lowest and highest value. Levels that are the values themselves have None
    # beside them. What is no single grey volume or lacks the label is an ImageStackError.
    header = read_header(path)
    if header.components > 1:
        raise ImageStackError(
            f"{path} has {header.components} values in each voxel, as colour has; grey is read"
        )
    depth = math.prod(header.size[3:])
    if depth > 1:
        raise ImageStackError(
            f"{path} holds {depth} volumes ({len(header.size)} dimensions): save one of them alone"
        )
    if len(header.size) < 3:
        raise ImageStackError(f"{path} is one image and not a volume")
    check_whole_nifti(path, header)
    values = read_values(path)
    values = values.reshape(values.shape[-3:])
    planes = _planes(path, header.size, header.spacing, header.origin, header.direction)
    if label is not None:
        if label not in values:
            present = list_text(f"{value:g}" for value in np.unique(values) if value != 0)
            raise ImageStackError(f"label {label} is not in {path}, which has {present or 'none'}")
        return label_mask(values, label), planes, None
    levels = _levels(path, values, window)
    return (values if levels is None else levels.image(values)), planes, levels


def _levels(path: Path, values: NDArray[Any], window: Window | None) -> GreyLevels | None:
    """Return the levels that keep the values, or None if they are levels already."""
    if values.dtype.kind not in "iuf":
        raise ImageStackError(f"{path} has {values.dtype} voxels; whole numbers or floats are read")
    whole = values.dtype.kind in "iu"
    if window is not None:
        return grey_levels(*window, whole=whole)
    if values.dtype in (np.dtype(np.uint8), np.dtype(np.uint16)):
        return None
    finite = values if whole else values[np.isfinite(values)]
    if finite.size == 0:
        raise ImageStackError(f"{path} holds no finite value")
    return grey_levels(float(finite.min()), float(finite.max()), whole=whole)


def _planes(
    path: Path,
    size: tuple[int, ...],
    spacing: tuple[float, ...],
    origin: tuple[float, ...],
    direction: tuple[float, ...],
) -> ImagePlanes:
    """Return the planes across the third axis; axes beyond it have one voxel each."""
    side = len(size)
    axes = np.array(direction, dtype=np.float64).reshape(side, side)[:3, :3]
    check_pixel_size((spacing[0], spacing[1]), path)
    check_spacing("slice spacing", spacing[2], path)
    steps = axes * np.array(spacing[:3])
    middle = np.array(origin[:3]) + steps[:, :2] @ (0.5 * (np.array(size[:2]) - 1.0))
    return ImagePlanes(
        pixel_size=np.array(spacing[:2]),
        slice_spacing=spacing[2],
        origins=middle + np.arange(size[2])[:, np.newaxis] * steps[:, 2],
        # Orthonormal to rounding, which a file's single floats are not.
        frames=np.broadcast_to(
            plane_frame(axes[:, 0], axes[:, 1], axes[:, 2], path), (size[2], 3, 3)
        ),
    )


def even_step(planes: ImagePlanes, where: Path) -> NDArray[np.float64]:
    """Return the (3,) step, mm, between planes, which must be parallel, even and aligned."""
    if len(planes.origins) < 2:
        raise ImageStackError(f"{where} is one image and not a volume")
    steps = np.diff(planes.origins, axis=0)
    step = steps.mean(axis=0)
    distance = float(np.linalg.norm(step))
    turned = np.abs(planes.frames - planes.frames[0]).max() > DIRECTION_TOLERANCE
    uneven = np.abs(steps - step).max() > EVEN_FRACTION * distance
    leaning = np.abs(planes.frames[0, :, :2].T @ step).max() > DIRECTION_TOLERANCE * distance
    if turned or uneven or leaning:
        what = "parallel" if turned else "evenly spaced" if uneven else "straight above each other"
        raise ImageStackError(f"the images of {where} are not {what}, and so are no volume")
    return step


def axis_number(axis: Axis, planes: ImagePlanes) -> int:
    """Return the index axis that is meant: 0 along rows (i), 1 along columns (j), 2 through (k)."""
    name = str(axis).lower()
    if name in INDEX_AXES:
        return INDEX_AXES.index(name)
    if name in {"0", "1", "2"}:
        return int(name)
    if name in SPACE_AXES:
        return int(np.abs(planes.frames[0, SPACE_AXES.index(name)]).argmax())
    raise ImageStackError(f"an axis must be x, y, z, i, j, k, 0, 1 or 2, not {axis}")


def along_axis(
    voxels: GreyImage, planes: ImagePlanes, axis: int, where: Path
) -> tuple[GreyImage, ImagePlanes]:
    """Return a volume as images across another of its axes."""
    step = even_step(planes, where)
    if axis == 2:
        return voxels, planes
    distance = float(np.linalg.norm(step))
    frame = planes.frames[0]
    directions = np.stack([frame[:, 0], frame[:, 1], step / distance], axis=1)
    sizes = np.array([*planes.pixel_size, distance])
    order = [1, 2, 0] if axis == 0 else [0, 2, 1]
    column, row, across = directions[:, order].T
    frame = plane_frame(column, row, across, where)
    counts = np.array(voxels.shape[::-1])
    middle = 0.5 * (planes.origins[0] + planes.origins[-1])
    count = int(counts[axis])
    offsets = (np.arange(count) - 0.5 * (count - 1)) * sizes[axis]
    turned = dataclasses.replace(
        planes,
        pixel_size=sizes[order[:2]],
        slice_spacing=float(sizes[axis]),
        origins=middle + offsets[:, np.newaxis] * directions[:, axis],
        frames=np.broadcast_to(frame, (count, 3, 3)),
    )
    view = voxels.transpose(2, 0, 1) if axis == 0 else voxels.transpose(1, 0, 2)
    return view, turned
