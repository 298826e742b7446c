"""The voxels of one organ in a stack of parallel images: those that hang together in space.

A voxel is of an organ where its level is beyond one threshold for all images: as given, or the mean
of the mean levels on both sides of Otsu's threshold of their joint histogram [Otsu 1979]. Which
side is decided as for the tracing (`find_polarity`). Parts of neighbouring images that overlap in
a pixel are one organ (union and find); the largest is taken, or the one that a seed is on. Images
are read one at a time, twice: to link their parts, and to fill the box around the organ.

[Otsu 1979] N. Otsu, A threshold selection method from gray-level histograms, IEEE Transactions on
Systems, Man, and Cybernetics 9, 62-66.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from organ_geometry.contours.edges import find_polarity
from organ_geometry.contours.organ_tracing import SAMPLES
from organ_geometry.contours.trace_options import Seed, TraceOptions, seed_point
from organ_geometry.images.grey_image import GreyImage, ImageStackError
from organ_geometry.images.image_stack import ImageStack

_SAMPLES = 48

# A part of the organ in an image counts beside the largest from this share of its area.
PART_SHARE = 0.1
# Voxels around the organ that are kept, so that its edge can be interpolated.
_MARGIN = 4


@dataclass(frozen=True, slots=True, eq=False)
class OrganVoxels:
    """An organ's voxels within its bounding box."""

    inside: NDArray[np.bool_]  # (K, H, W) whether a voxel is the organ's, holes in an image filled
    levels: GreyImage  # (K, H, W) grey levels of the box
    corner: tuple[int, int, int]  # (3,) column, row and image of the box's first voxel in the stack
    # (K,) number of parts that each image of the box shows of the organ, small ones left out.
    parts: NDArray[np.intp]
    outside_level: float  # Typical level around the organ


def sample_images(stack: ImageStack) -> list[GreyImage]:
    """Return some images spread evenly over a stack."""
    count = min(_SAMPLES, len(stack))
    wanted = np.unique(np.linspace(0, len(stack) - 1, count).round().astype(int))
    return [stack.image(int(index)) for index in wanted]


def organ_level(images: Sequence[GreyImage], options: TraceOptions) -> tuple[float, bool] | None:
    """Return the level of an organ's edge and whether the organ is above it, if any."""
    level = half_level(images) if options.threshold is None else options.threshold
    if level is None:
        return None
    few = images[:: math.ceil(len(images) / SAMPLES)]
    polarity = find_polarity(few) if options.polarity == "auto" else options.polarity
    return level, polarity == "bright"


def half_level(images: Sequence[GreyImage]) -> float | None:
    """Return the level midway between the dark and the bright of images; None of one level only."""
    most = max(int(image.max()) for image in images) + 1
    counts = np.zeros(most)
    for image in images:
        counts += np.bincount(image.ravel(), minlength=most)
    levels = np.flatnonzero(counts)
    if len(levels) < 2:
        return None
    counts = counts[levels]
    below, sums = np.cumsum(counts), np.cumsum(counts * levels)
    above = below[-1] - below[:-1]
    mean_below, mean_above = sums[:-1] / below[:-1], (sums[-1] - sums[:-1]) / above
    best = int((below[:-1] * above * (mean_above - mean_below) ** 2).argmax())
    return float(0.5 * (mean_below[best] + mean_above[best]))


def organ_voxels(
    stack: ImageStack, *, threshold: float, bright: bool, seed: Seed | None = None
) -> OrganVoxels:
    """Return the voxels of one organ; images are read one at a time, twice."""
    roots, sizes, boxes = _linked_parts(stack, threshold, bright)
    if not sizes:
        raise ImageStackError(f"nothing stands out in the images of {stack.source}")
    if seed is None:
        wanted = max(sizes, key=lambda root: sizes[root])
    else:
        point = seed_point(seed, stack)
        labels, _ = _parts_of(stack.image(point.index), threshold, bright)
        label = int(labels[round(point.y), round(point.x)])
        wanted = roots[point.index].get(label, -1)
        if wanted < 0:
            raise ImageStackError(
                f"the seed {point.x:g},{point.y:g} is not on an organ in {stack.names[point.index]}"
            )
    rows, columns = stack.shape
    x0, y0, x1, y1, first, last = boxes[wanted]
    x0, y0, first = max(0, x0 - _MARGIN), max(0, y0 - _MARGIN), max(0, first - 1)
    x1, y1 = min(columns - 1, x1 + _MARGIN), min(rows - 1, y1 + _MARGIN)
    last = min(len(stack) - 1, last + 1)
    shape = (last - first + 1, y1 - y0 + 1, x1 - x0 + 1)
    inside = np.zeros(shape, dtype=np.bool_)
    levels = np.empty(shape, dtype=stack.image(first).dtype)
    parts = np.zeros(shape[0], dtype=np.intp)
    around: list[float] = []
    for place, index in enumerate(range(first, last + 1)):
        image = stack.image(index)
        levels[place] = image[y0 : y1 + 1, x0 : x1 + 1]
        labels, _ = _parts_of(image, threshold, bright)
        mine = [label for label, root in roots[index].items() if root == wanted]
        if mine:
            mask = np.isin(labels, mine)[y0 : y1 + 1, x0 : x1 + 1]
            areas = np.bincount(labels.ravel())[mine]
            parts[place] = int(np.count_nonzero(areas >= PART_SHARE * areas.max()))
            inside[place] = _filled(mask)
        outer = levels[place][~inside[place]]
        if outer.size:
            around.append(float(np.median(outer)))
    return OrganVoxels(
        inside=inside,
        levels=levels,
        corner=(x0, y0, first),
        parts=parts,
        outside_level=float(np.median(around)) if around else 0.0,
    )


_Box = tuple[int, int, int, int, int, int]


def _linked_parts(
    stack: ImageStack, threshold: float, bright: bool
) -> tuple[list[dict[int, int]], dict[int, int], dict[int, _Box]]:
    """Return the organ of each part of each image, and each organ's size and box."""
    # Parts of neighbouring images that overlap belong to one organ: union and find.
    parents: list[int] = []
    parts: list[dict[int, int]] = []
    areas: list[int] = []
    boxes: list[_Box] = []
    before: NDArray[np.int32] | None = None

    def root(number: int) -> int:
        while parents[number] != number:
            parents[number] = parents[parents[number]]
            number = parents[number]
        return number

    for index, image in enumerate(stack.images()):
        labels, stats = _parts_of(image, threshold, bright)
        numbers: dict[int, int] = {}
        for label in range(1, len(stats)):
            x, y, width, height, area = (int(value) for value in stats[label])
            numbers[label] = len(parents)
            parents.append(len(parents))
            areas.append(area)
            boxes.append((x, y, x + width - 1, y + height - 1, index, index))
        if before is not None:
            both = (before > 0) & (labels > 0)
            pairs = np.unique(np.stack([before[both], labels[both]], axis=1), axis=0)
            for old, new in pairs.tolist():
                parents[root(numbers[new])] = root(parts[-1][old])
        parts.append(numbers)
        before = labels
    roots = [{label: root(number) for label, number in numbers.items()} for numbers in parts]
    sizes: dict[int, int] = {}
    whole: dict[int, _Box] = {}
    for number, area in enumerate(areas):
        organ = root(number)
        sizes[organ] = sizes.get(organ, 0) + area
        one, other = boxes[number], whole.get(organ, boxes[number])
        whole[organ] = (
            min(one[0], other[0]),
            min(one[1], other[1]),
            max(one[2], other[2]),
            max(one[3], other[3]),
            min(one[4], other[4]),
            max(one[5], other[5]),
        )
    return roots, sizes, whole


def _parts_of(
    image: GreyImage, threshold: float, bright: bool
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return the (H, W) labels of the connected parts of an image, and their (L, 5) statistics."""
    mask = ((image > threshold) if bright else (image < threshold)).astype(np.uint8)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=4)
    return np.asarray(labels, dtype=np.int32), np.asarray(stats, dtype=np.int32)


def _filled(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return a mask with its holes filled."""
    outlines, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    filled = np.zeros(mask.shape, dtype=np.uint8)
    return np.asarray(cv2.drawContours(filled, outlines, -1, 1, cv2.FILLED)) > 0
