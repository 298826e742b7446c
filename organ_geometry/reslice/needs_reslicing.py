"""Whether parallel slices may not suit the organ they show, by what was traced in them."""

import math

import numpy as np

from organ_geometry.contours.trace_options import TraceOptions
from organ_geometry.contours.traced_organ import TracedOrgan
from organ_geometry.images.grey_image import GreyImage, ImageStackError
from organ_geometry.images.image_stack import ImageStack
from organ_geometry.images.image_volume import even_step

_FEWEST_IMAGES = 8

# A mask: all but this share of its pixels are within this share of its levels of either end.
_GREY_FRACTION = 0.05
_GREY_LEVELS = 0.15
# Images and sections that are looked at, spread over the stack.
_SAMPLES = 48

# In more than these shares of the slices the organ is lost or beside something else, or drifts by
# over 45 degrees to the next. They are below those that decide: a closer look is what this is for.
_LOST_FRACTION = 0.08
_DRIFT_FRACTION = 0.12


def needs_reslicing(stack: ImageStack, traced: TracedOrgan, options: TraceOptions) -> bool:
    """Return whether a closer look is worth its time."""
    if len(stack) < _FEWEST_IMAGES:
        return False
    try:
        gap = float(np.linalg.norm(even_step(stack.planes, stack.source)))
    except ImageStackError:
        return False
    return _is_doubtful(stack, traced, options, gap) and (
        options.threshold is not None or _are_masks(stack)
    )


def _is_doubtful(stack: ImageStack, traced: TracedOrgan, options: TraceOptions, gap: float) -> bool:
    """Return whether an organ may be cut lengthwise, or more than once, by slices a gap apart."""
    sections = traced.sections
    # With a seed, what else an image shows is not looked for.
    beside = sum(section.other_component or section.carried for section in sections)
    if options.seed is not None or len(traced.problems) + beside > _LOST_FRACTION * len(stack):
        return True
    longest = max(float((np.ptp(one.outer, axis=0) * stack.pixel_size).max()) for one in sections)
    some = sections[:: math.ceil(len(sections) / _SAMPLES)]
    middles = np.array([one.outer.mean(axis=0) for one in some]) * stack.pixel_size
    drifts = np.linalg.norm(np.diff(middles, axis=0), axis=1)
    drifting = int(np.count_nonzero(drifts > gap * np.diff([one.index for one in some])))
    return longest > gap * len(sections) or drifting > _DRIFT_FRACTION * len(some)


def _are_masks(stack: ImageStack) -> bool:
    count = min(_SAMPLES, len(stack))
    wanted = np.unique(np.linspace(0, len(stack) - 1, count).round().astype(int))
    return all(_is_mask(stack.image(int(index))) for index in wanted)


def _is_mask(image: GreyImage) -> bool:
    low, high = int(image.min()), int(image.max())
    near = _GREY_LEVELS * (high - low)
    grey = np.count_nonzero((image > low + near) & (image < high - near))
    return bool(grey <= _GREY_FRACTION * image.size)
