"""The voxels of an organ: those that hang together in space, where tracing cannot follow it.

Tracing follows one outline from slice to slice. A slice that cuts the organ lengthwise or more than
once ends it there, or leads it into one limb of several; only in space do they hang together. So a
region is grown at the level of the edges traced, on their side of it. It is the seed's, or the
largest: single slices show a thin upright organ more clearly than a large one that lies flat. Where
nothing was traced, because the organ runs out of every picture, some images are split as one.

Parts of neighbouring images that overlap in a pixel are one organ (union and find). Images are read
one at a time, twice: to link their parts, and to fill the box around the organ.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from organ_geometry.contours.edges import find_polarity
from organ_geometry.contours.organ_tracing import SAMPLES
from organ_geometry.contours.section_region import otsu
from organ_geometry.contours.trace_options import Seed, TraceOptions, seed_point
from organ_geometry.contours.traced_organ import TracedOrgan
from organ_geometry.images.grey_image import GreyImage, ImageStackError
from organ_geometry.images.image_stack import ImageStack

# A part of the organ in an image counts beside the largest from this share of its area.
PIECE_FRACTION = 0.1
# Voxels around the organ that are kept, so that its edge can be interpolated.
_MARGIN = 4


@dataclass(frozen=True, slots=True, eq=False)
class OrganVoxels:
    """An organ's voxels within its bounding box."""

    inside: NDArray[np.bool_]  # (K, H, W) whether a voxel is the organ's, holes in an image filled
    levels: GreyImage  # (K, H, W) grey levels of the box
    corner: tuple[int, int, int]  # (3,) column, row and image of the box's first voxel in the stack
    # (K,) number of parts that each image of the box shows of the organ, small ones left out.
    components: NDArray[np.intp]
    outside_level: float  # Typical level around the organ


@dataclass(frozen=True, slots=True, eq=False)
class _Components:
    """The connected parts of all images, numbered in one row."""

    first: list[int]  # Number of each image's first part
    organs: NDArray[np.intp]  # (P,) number of a part that stands for the organ each is of
    stats: NDArray[np.int32]  # (P, 5) column, row, width, height and area of each
    images: NDArray[np.intp]  # (P,) image of each


def organ_voxels(stack: ImageStack, traced: TracedOrgan, options: TraceOptions) -> OrganVoxels:
    """Return the voxels of a traced organ."""
    level, bright = _level_and_side(stack, traced, options)
    found = _linked_components(stack, level, bright)
    if len(found.organs) == 0:
        raise ImageStackError(f"nothing stands out in the images of {stack.source}")
    mine = found.organs == _wanted(stack, options.seed, found, level, bright)
    rows, columns = stack.shape
    x, y, width, height, _ = found.stats[mine].T
    x0, y0 = max(0, int(x.min()) - _MARGIN), max(0, int(y.min()) - _MARGIN)
    x1 = min(columns, int((x + width).max()) + _MARGIN)
    y1 = min(rows, int((y + height).max()) + _MARGIN)
    first = max(0, int(found.images[mine].min()) - 1)
    last = min(len(stack) - 1, int(found.images[mine].max()) + 1)
    shape = (last - first + 1, y1 - y0, x1 - x0)
    inside = np.zeros(shape, dtype=np.bool_)
    levels = np.empty(shape, dtype=stack.image(first).dtype)
    components = np.zeros(shape[0], dtype=np.intp)
    around: list[float] = []
    for place, index in enumerate(range(first, last + 1)):
        image = stack.image(index)
        levels[place] = image[y0:y1, x0:x1]
        numbers = np.flatnonzero(mine & (found.images == index))
        if len(numbers):
            labels, _ = _components_of(image, level, bright)
            areas = found.stats[numbers, cv2.CC_STAT_AREA]
            components[place] = int(np.count_nonzero(areas >= PIECE_FRACTION * areas.max()))
            labels = labels[y0:y1, x0:x1]
            inside[place] = _filled(np.isin(labels, numbers - found.first[index] + 1))
        outer = levels[place][~inside[place]]
        if outer.size:
            around.append(float(np.median(outer)))
    return OrganVoxels(
        inside=inside,
        levels=levels,
        corner=(x0, y0, first),
        components=components,
        outside_level=float(np.median(around)) if around else 0.0,
    )


def _level_and_side(
    stack: ImageStack, traced: TracedOrgan, options: TraceOptions
) -> tuple[float, bool]:
    """Return the level of an organ's edge, and whether the organ is above it."""
    if traced.sections:
        level = float(np.median([section.threshold for section in traced.sections]))
        polarity = traced.polarity
    else:
        count = min(SAMPLES, len(stack))
        wanted = np.linspace(0, len(stack) - 1, count).round().astype(int)
        images = [stack.image(int(index)) for index in wanted]
        level = otsu(np.concatenate(images).astype(np.float32))
        polarity = find_polarity(images) if options.polarity == "auto" else options.polarity
    return level if options.threshold is None else options.threshold, polarity == "bright"


def _wanted(
    stack: ImageStack, seed: Seed | None, found: _Components, level: float, bright: bool
) -> int:
    if seed is None:
        sizes = np.bincount(found.organs, weights=found.stats[:, cv2.CC_STAT_AREA])
        return int(sizes.argmax())
    point = seed_point(seed, stack)
    labels, _ = _components_of(stack.image(point.index), level, bright)
    label = int(labels[round(point.y), round(point.x)])
    if label == 0:
        raise ImageStackError(
            f"the seed {point.x:g},{point.y:g} is not on an organ in {stack.names[point.index]}"
        )
    return int(found.organs[found.first[point.index] + label - 1])


def _linked_components(stack: ImageStack, level: float, bright: bool) -> _Components:
    """Return the parts of all images, those that overlap in neighbouring ones of one organ."""
    parents: list[int] = []
    first: list[int] = []
    stats: list[NDArray[np.int32]] = []
    before = np.zeros(stack.shape, dtype=np.int32)

    def root(number: int) -> int:
        while parents[number] != number:
            parents[number] = parents[parents[number]]
            number = parents[number]
        return number

    for image in stack.images():
        labels, found = _components_of(image, level, bright)
        first.append(len(parents))
        parents.extend(range(len(parents), len(parents) + len(found)))
        both = (before > 0) & (labels > 0)
        pairs = np.unique(np.stack([before[both], labels[both]], axis=1), axis=0)
        for old, new in pairs.tolist():
            parents[root(first[-1] + new - 1)] = root(first[-2] + old - 1)
        stats.append(found)
        before = labels
    return _Components(
        first=first,
        organs=np.array([root(number) for number in range(len(parents))], dtype=np.intp),
        stats=np.concatenate(stats),
        images=np.repeat(np.arange(len(stack)), [len(found) for found in stats]),
    )


def _components_of(
    image: GreyImage, level: float, bright: bool
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return the (H, W) labels of an image's connected parts, from 1, and their (L, 5) stats."""
    mask = ((image > level) if bright else (image < level)).astype(np.uint8)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=4)
    return np.asarray(labels, dtype=np.int32), np.asarray(stats, dtype=np.int32)[1:]


def _filled(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    outlines, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    filled = np.zeros(mask.shape, dtype=np.uint8)
    return np.asarray(cv2.drawContours(filled, outlines, -1, 1, cv2.FILLED)) > 0
