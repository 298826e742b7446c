"""Whether parallel slices may not suit the organ they show, by a look at some of them."""

import cv2
import numpy as np
from numpy.typing import NDArray

from organ_geometry.contours.trace_options import TraceOptions
from organ_geometry.images.grey_image import GreyImage, ImageStackError
from organ_geometry.images.image_stack import ImageStack
from organ_geometry.images.image_volume import even_step
from organ_geometry.reslice.organ_voxels import PART_SHARE, organ_level, sample_images

_FEWEST_IMAGES = 8

# A mask: all but this share of its pixels are within this share of its levels of either end.
_GREY_SHARE = 0.05
_GREY_LEVELS = 0.15

# More than these shares of the slices show several parts, or drift by over 45 degrees to the next.
# They are below those that decide: a closer look is what this is for.
_SEVERAL_SHARE = 0.08
_DRIFT_SHARE = 0.12
# The organ is so many times longer across the slices than the part of the stack that shows it.
_LONG = 1.0


def needs_reslicing(stack: ImageStack, options: TraceOptions) -> bool:
    """Return whether a closer look is worth its time: a few images are read."""
    threshold = options.threshold
    if len(stack) < _FEWEST_IMAGES:
        return False
    try:
        step = even_step(stack.planes, stack.source)
    except ImageStackError:
        return False
    if threshold is None and not _is_mask(stack.image(len(stack) // 2)):
        return False
    images = sample_images(stack)
    if threshold is None and not all(_is_mask(image) for image in images):
        return False
    found = organ_level(images, options)
    if found is None:
        return False
    level, bright = found
    several = drifting = shown = 0
    longest = 0.0
    gap = float(np.linalg.norm(step)) * (len(stack) - 1) / (len(images) - 1)
    before: NDArray[np.float64] | None = None
    for image in images:
        mask = (image > level) if bright else (image < level)
        _, _, stats, centroids = cv2.connectedComponentsWithStats(
            mask.astype(np.uint8), connectivity=4
        )
        if len(stats) < 2:
            before = None
            continue
        shown += 1
        areas = np.asarray(stats)[1:, cv2.CC_STAT_AREA]
        largest = int(areas.argmax())
        several += int(np.count_nonzero(areas >= PART_SHARE * areas[largest]) > 1)
        box = np.asarray(stats)[1 + largest, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]]
        longest = max(longest, float((box * stack.pixel_size).max()))
        middle = np.asarray(centroids)[1 + largest] * stack.pixel_size
        if before is not None:
            drifting += int(np.linalg.norm(middle - before) > gap)
        before = middle
    return (
        several > _SEVERAL_SHARE * shown
        or drifting > _DRIFT_SHARE * shown
        or longest > _LONG * shown * gap
    )


def _is_mask(image: GreyImage) -> bool:
    low, high = int(image.min()), int(image.max())
    near = _GREY_LEVELS * (high - low)
    grey = np.count_nonzero((image > low + near) & (image < high - near))
    return bool(grey <= _GREY_SHARE * image.size)
