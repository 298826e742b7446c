"""Parallel images of a curved organ, resliced: cut again perpendicular to its centreline.

Straightened curved planar reformation of an organ that was traced: whether its slices suit it
(`needs_reslicing`), the voxels that hang together with it (`organ_voxels`), the minimal path
through them (`minimal_path`), the centreline it is relaxed to (`centreline`), planes along it that
do not cross each other inside the organ (`section_planes`), and the images in them (`plane_cut`).
"""

import dataclasses
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from organ_geometry.contours.organ_tracing import Progress, trace_organ
from organ_geometry.contours.trace_options import TraceOptions
from organ_geometry.contours.traced_organ import TracedOrgan
from organ_geometry.images.grey_image import GreyImage, ImageStackError
from organ_geometry.images.image_planes import ImagePlanes
from organ_geometry.images.image_stack import ImageStack
from organ_geometry.images.image_volume import even_step
from organ_geometry.reslice.centreline import (
    SMOOTH_RADII,
    Centreline,
    NoTube,
    Tube,
    centreline,
)
from organ_geometry.reslice.curve_frames import (
    evenly_spaced,
    smooth_points,
)
from organ_geometry.reslice.needs_reslicing import needs_reslicing
from organ_geometry.reslice.organ_voxels import OrganVoxels, organ_voxels
from organ_geometry.reslice.plane_cut import plane_cut
from organ_geometry.reslice.section_planes import section_planes

When = Literal["auto", "always", "never"]

_EDGE_PX = 6
# Slices do not suit an organ of which so many of them show several parts, or whose centreline lies
# flatter than 45 degrees to them over so much of its length.
_COMPONENTS_FRACTION = 0.1
_FLAT_FRACTION = 0.2
_FLAT_COSINE = 0.5**0.5

# More than this share of the organ beside its sections is said.
_BESIDE_FRACTION = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class ReslicedSlices:
    """Images cut out of a volume in memory, each when it is asked for."""

    levels: GreyImage  # (K, H, W) grey levels of the volume
    outside_level: float  # Level beyond it
    centres: NDArray[np.float64]  # (S, 3) middle of each image, in voxels: column, row, image
    # (S, 2, 3) steps from column to column and from row to row, in voxels.
    steps: NDArray[np.float64]
    shape: tuple[int, int]  # (2,) rows and columns of every image

    def image(self, index: int) -> GreyImage:
        """Return the image of that number, from 0, interpolated linearly between voxels."""
        return plane_cut(
            self.levels, self.outside_level, self.centres[index], self.steps[index], self.shape
        )


def reslice_stack(
    stack: ImageStack, options: TraceOptions | None = None, *, spacing: float | None = None
) -> ImageStack:
    """Return a curved organ's sections, perpendicular to its centreline."""
    options = TraceOptions() if options is None else options
    return _resliced(stack, trace_organ(stack, options), options, spacing)


def reslice_where_needed(
    stack: ImageStack,
    traced: TracedOrgan,
    options: TraceOptions | None = None,
    when: When = "auto",
    *,
    progress: Progress | None = None,
) -> tuple[ImageStack, TracedOrgan]:
    """Return images that suit the organ traced, with a note if resliced, and its edges in them."""
    options = TraceOptions() if options is None else options
    resliced = _where_needed(stack, traced, options, when)
    if resliced is None:
        return stack, traced
    # The seed was a pixel of the images as they were.
    options = dataclasses.replace(options, seed=None)
    return resliced, trace_organ(resliced, options, progress=progress)


def _where_needed(
    stack: ImageStack, traced: TracedOrgan, options: TraceOptions, when: When
) -> ImageStack | None:
    """Return the resliced images, or None where they stay as they are."""
    if when == "always":
        return _resliced(stack, traced, options)
    if when == "never" or not needs_reslicing(stack, traced, options):
        return None
    try:
        voxels, tube = _organ(stack, traced, options)
        line = centreline(tube)
    except (ImageStackError, NoTube):
        # What is wrong with the images, the sections traced say.
        return None
    reason = _reason(voxels, line)
    if reason is None:
        return None
    found = _resliced_along(stack, voxels, tube, line, None)
    return dataclasses.replace(found, notes=(f"{reason}: {found.notes[-1]}", *stack.notes))


def _resliced(
    stack: ImageStack, traced: TracedOrgan, options: TraceOptions, spacing: float | None = None
) -> ImageStack:
    voxels, tube = _organ(stack, traced, options)
    try:
        line = centreline(tube)
    except NoTube as error:
        raise ImageStackError(f"the organ in {stack.source} has no centreline: {error}") from error
    return _resliced_along(stack, voxels, tube, line, spacing)


def _organ(
    stack: ImageStack, traced: TracedOrgan, options: TraceOptions
) -> tuple[OrganVoxels, Tube]:
    step = even_step(stack.planes, stack.source)
    voxels = organ_voxels(stack, traced, options)
    sizes = np.array([*stack.pixel_size, float(np.linalg.norm(step))])
    return voxels, Tube(voxels.inside.astype(np.uint8) * np.uint8(255), sizes)


def _reason(voxels: OrganVoxels, line: Centreline) -> str | None:
    """Return why slices do not suit an organ, or None if they do."""
    shown = int(np.count_nonzero(voxels.components))
    several = int(np.count_nonzero(voxels.components > 1))
    if several > _COMPONENTS_FRACTION * shown:
        return f"{several} of {shown} images show several parts of the organ"
    steps = np.diff(line.points, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    flat = lengths[np.abs(steps[:, 2]) < _FLAT_COSINE * lengths].sum() / lengths.sum()
    if flat > _FLAT_FRACTION:
        return f"the organ lies flatter than 45 degrees to the images over {flat:.0%} of its length"
    return None


def _resliced_along(
    stack: ImageStack,
    voxels: OrganVoxels,
    tube: Tube,
    line: Centreline,
    spacing: float | None,
) -> ImageStack:
    """Return the images across a centreline."""
    points = evenly_spaced(line.points, stack.slice_spacing if spacing is None else spacing)
    gap = float(np.linalg.norm(np.diff(points, axis=0), axis=1).mean())
    points = smooth_points(points, round(SMOOTH_RADII * line.radius / gap))
    depths = np.interp(
        np.linspace(0.0, 1.0, len(points)), np.linspace(0.0, 1.0, len(line.depths)), line.depths
    )
    planes = section_planes(tube, points, depths, line.radius / gap)
    frames = planes.frames
    pixel = float(stack.pixel_size.min())
    side = 2 * int(np.ceil(planes.reach / pixel)) + 2 * _EDGE_PX + 1
    # From the box's own axes to space.
    step = even_step(stack.planes, stack.source)
    axes = np.stack([*stack.frames[0, :, :2].T, step / np.linalg.norm(step)], axis=1)
    corner = np.array(voxels.corner[:2]) - 0.5 * (np.array(stack.shape[::-1]) - 1.0)
    start = stack.origins[voxels.corner[2]] + axes[:, :2] @ (corner * stack.pixel_size)
    note = f"cut again into {len(points)} sections perpendicular to its centreline"
    if planes.crossing:
        note += (
            f", of which {planes.crossing} cross their neighbours inside the organ, which bends "
            f"more tightly there than it is wide"
        )
    if planes.beside > _BESIDE_FRACTION:
        first, last = (stack.names[voxels.corner[2] + index] for index in planes.beside_images)
        note += (
            f"; {planes.beside:.0%} of the organ lies beside them, in a branch or where it touches "
            f"itself, most of it in {first} to {last}"
        )
    return dataclasses.replace(
        stack,
        names=tuple(f"section {index}" for index in range(len(points))),
        slices=ReslicedSlices(
            levels=voxels.levels,
            outside_level=voxels.outside_level,
            centres=points / tube.sizes,
            steps=np.swapaxes(frames[:, :, :2], 1, 2) * pixel / tube.sizes,
            shape=(side, side),
        ),
        shape=(side, side),
        planes=ImagePlanes(
            pixel_size=np.array([pixel, pixel]),
            slice_spacing=gap,
            origins=start + points @ axes.T,
            frames=axes @ frames,
            units=stack.units,
        ),
        notes=(*stack.notes, note),
    )
