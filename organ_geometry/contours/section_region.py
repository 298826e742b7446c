"""Where an organ and its lumen are in one image, to a pixel, and the levels of their edges.

1. The image is blurred and split at a level, as given or Otsu's; one component is chosen (the
   largest near the middle, the one at a seed, the one over the last section) and filled.
2. The level of its edge is half way between the medians of the levels inside and in a ring around
   it. What stands out by less than noise would is refused; noise is the median absolute deviation
   of the image from its blur. Then all is tried once more with a finer blur, for thin walls.
3. The lumen is the largest hole at levels below the wall's top, if it is large enough and differs
   from the wall by at least `LUMEN_CONTRAST` of what the wall differs from outside.

Medians, because an organ's texture and its neighbours are outliers. All images here have a margin
and are signed so that the organ is bright.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from organ_geometry.contours.edge_curve import SQUARE, Image, NoEdgeFound, Scale, blurred
from organ_geometry.contours.masked_levels import (
    border_median,
    level_exceeded,
    median_change,
    median_where,
)

Mask: TypeAlias = NDArray[np.uint8]
Outline: TypeAlias = NDArray[np.int32]
Choice: TypeAlias = Callable[[Mask], tuple[Outline | None, float]]
"""From a mask to one component's outline, or None, and the share of the largest other one."""

# Halves the noise of single mask pixels; wider blur would merge the two edges of a thin wall.
SMOOTHING_PX = 1.5
FINE_SMOOTHING_PX = 0.75
# In noise alone, the largest speck stands out by up to 1.7 / sigma times the noise of a pixel.
CLEAR_CONTRAST = 2.0
SMALLEST_ORGAN_PX = 12.0
# Grey levels are whole numbers; what is left of less than this is rounding of the blur.
SMALLEST_CONTRAST = 1e-2
SMALLEST_LUMEN_FRACTION = 0.05
# A lumen differs from its wall by at least this share of what the wall differs from outside.
LUMEN_CONTRAST = 0.3

# Pixels of background around an image, so that blur and contours meet no border.
MARGIN = 8
_RING_GAP = 3
_RING_WIDTH = 5
# Standard deviation of normal noise over its median absolute deviation.
_MAD_TO_DEVIATION = 1.4826


@dataclass(frozen=True, slots=True, eq=False)
class Region:
    """Where organ and lumen are to a pixel, and the levels of their edges."""

    filled: Mask  # (H, W) 255 in the organ and its lumen, 0 outside
    outer_level: float  # Level of the outer edge
    lumen: Mask | None  # (H, W) 255 in the lumen, or None
    lumen_level: float  # Level of the lumen's edge, NaN without a lumen
    contrast: float  # Organ's level less the background's
    other_component: (
        float  # Area of the largest component beside the organ, as a share of the organ's
    )
    sigma: float  # Blur in which the region was found, px

    @property
    def solid(self) -> Mask:
        """(H, W) 255 in the organ without its lumen."""
        return self.filled if self.lumen is None else without(self.filled, self.lumen)


def find_region(
    bright: Image,
    choose: Choice,
    *,
    start_level: float | None = None,
    threshold: float | None = None,
    scale: Scale = SQUARE,
) -> Region:
    """Return the organ's region in an image with a margin in which the organ is bright."""
    try:
        return _region(bright, choose, start_level, threshold, SMOOTHING_PX, scale)
    except NoEdgeFound:
        # The wall of a fine ring may drown in the blur that takes the noise away.
        return _region(bright, choose, start_level, threshold, FINE_SMOOTHING_PX, scale)


def _region(
    bright: Image,
    choose: Choice,
    start_level: float | None,
    threshold: float | None,
    sigma: float,
    scale: Scale,
) -> Region:
    smoothed = blurred(bright, sigma, scale)
    border_level = float(bright[0, 0])
    first = threshold
    if first is None:
        # A lumen darker than the background must not draw Otsu's split to itself.
        first = otsu(np.maximum(smoothed, border_level)) if start_level is None else start_level
    outline, other_component = choose(mask_of(smoothed > first))
    if outline is None:
        raise NoEdgeFound("nothing stands out from the image's background")
    filled = fill(outline, bright.shape)
    outside = level_around(bright, filled)

    wall_top = level_exceeded(smoothed, filled, 0.1)
    below = threshold
    if below is None:
        below = wall_top - LUMEN_CONTRAST * (wall_top - outside)
    hole = _hole(smoothed, filled, below)
    organ = inner_level(bright, filled if hole is None else without(filled, hole))
    if threshold is None:
        noise = _noise(bright, smoothed)
        if not organ - outside > CLEAR_CONTRAST / sigma * noise:
            raise NoEdgeFound(
                f"what stands out from the background differs by {organ - outside:.3g} grey "
                f"levels, not clearly more than the noise of {noise:.3g}"
            )
        outer_level = 0.5 * (organ + outside)
        outline, other_component = choose(mask_of(smoothed > outer_level))
        if outline is None:
            raise NoEdgeFound(f"the organ is smaller than {SMALLEST_ORGAN_PX:g} pixels")
        filled = fill(outline, bright.shape)
    else:
        outer_level = threshold
    lumen_level = math.nan
    if hole is not None:
        inside = inner_level(bright, hole)
        lumen_level = 0.5 * (organ + inside) if threshold is None else threshold
        if organ - inside < LUMEN_CONTRAST * (organ - outside):
            hole, lumen_level = None, math.nan
    return Region(filled, outer_level, hole, lumen_level, organ - outside, other_component, sigma)


def main_outline(mask: Mask) -> tuple[Outline | None, float]:
    """Return the (N, 2) outline of the largest component near the middle, and the next's share."""
    outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    middle = 0.5 * np.array([mask.shape[1] - 1.0, mask.shape[0] - 1.0])
    best_score, best = 0.0, -1
    areas = np.array([cv2.contourArea(outline) for outline in outlines])
    for index in np.flatnonzero(areas >= SMALLEST_ORGAN_PX).tolist():
        away = (np.asarray(outlines[index])[:, 0].mean(axis=0) - middle) / middle
        score = float(areas[index]) / (1.0 + float(away @ away))
        if score > best_score:
            best_score, best = score, index
    if best < 0:
        return None, 0.0
    others = np.delete(areas, best)
    return _pixels(outlines[best]), float(others.max(initial=0.0) / areas[best])


def outline_around(x: float, y: float) -> Choice:
    """Return the choice of the component that holds a point, or closes it in."""

    def choose(mask: Mask) -> tuple[Outline | None, float]:
        outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        for outline in outlines:
            around = cv2.pointPolygonTest(outline, (x, y), measureDist=True) >= -0.75
            if around and cv2.contourArea(outline) >= SMALLEST_ORGAN_PX:
                return _pixels(outline), 0.0
        return None, 0.0

    return choose


def outline_over(mask: Mask, region: Mask) -> Outline | None:
    """Return the (N, 2) outline of the component that covers most of a region, or None."""
    only = only_outline(mask)
    if only is not None and bool((region[only[:, 1], only[:, 0]] > 0).any()):
        return only
    _, labels = cv2.connectedComponents(mask, connectivity=8)
    labels = np.asarray(labels)
    counts = np.bincount(labels[region > 0], minlength=1)
    counts[0] = 0
    label = int(counts.argmax())
    if counts[label] == 0:
        return None
    return outline_of(mask_of(labels == label))


def only_outline(mask: Mask) -> Outline | None:
    """Return the (N, 2) outline of a mask's component if it has just one, or None."""
    # This is much quicker than labels of all pixels, and most often all there is to do.
    outlines, tree = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    if not outlines:
        return None
    parents = np.asarray(tree)[0, :, 3]
    tops = np.flatnonzero(parents < 0)
    return _pixels(outlines[int(tops[0])]) if len(tops) == 1 else None


def outline_of(mask: Mask) -> Outline | None:
    """Return the (N, 2) outline of the longest component of a mask, or None."""
    outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return _pixels(max(outlines, key=len)) if outlines else None


def with_margin(grey: Image) -> Image:
    """Return an image in a frame of the median level of its border."""
    level = border_median(grey)
    framed = cv2.copyMakeBorder(
        grey, MARGIN, MARGIN, MARGIN, MARGIN, cv2.BORDER_CONSTANT, value=[level]
    )
    return np.asarray(framed, dtype=np.float32)


def mask_of(where: NDArray[np.bool_]) -> Mask:
    """Return 255 where an array is true and 0 elsewhere."""
    return where.view(np.uint8) * np.uint8(255)


def without(mask: Mask, other: Mask) -> Mask:
    """Return what is in one mask and not in another."""
    return np.asarray(cv2.subtract(mask, other), dtype=np.uint8)


def grown(mask: Mask, pixels: int) -> Mask:
    """Return the mask widened by a number of pixels, or narrowed if negative."""
    change = cv2.dilate if pixels > 0 else cv2.erode
    return np.asarray(change(mask, _disc(abs(pixels))), dtype=np.uint8)


@lru_cache(maxsize=64)
def _disc(radius: int) -> Mask:
    size = 2 * radius + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    return np.asarray(disc, dtype=np.uint8)


def fill(outline: Outline, shape: tuple[int, ...]) -> Mask:
    """Return 255 within an outline of pixels, itself included."""
    filled = np.zeros(shape, dtype=np.uint8)
    cv2.drawContours(filled, [outline[:, np.newaxis]], -1, 255, cv2.FILLED)
    return filled


def otsu(values: Image) -> float:
    """Return the level that best splits the values into two classes (Otsu 1979)."""
    low, high = float(values.min()), float(values.max())
    if high - low < SMALLEST_CONTRAST:
        return high
    scaled = ((values - np.float32(low)) * np.float32(255.0 / (high - low))).astype(np.uint8)
    level, _ = cv2.threshold(scaled, 0.0, 255.0, cv2.THRESH_BINARY | cv2.THRESH_OTSU)
    return low + (level + 0.5) * (high - low) / 255.0


def level_around(bright: Image, filled: Mask) -> float:
    """Return the background's level in a ring around a region, clear of its blurred rim."""
    box = _box_around(filled, _RING_GAP + _RING_WIDTH)
    near = grown(filled[box], _RING_GAP)
    level, count = median_where(bright[box], without(grown(near, _RING_WIDTH), near))
    return level if count else float(bright[0, 0])


def inner_level(bright: Image, region: Mask) -> float:
    """Return the level inside a region, away from its blurred rim where it is wide enough."""
    box = _box_around(region, 1)
    level, count = median_where(bright[box], grown(region[box], -1))
    return level if count >= SMALLEST_ORGAN_PX else median_where(bright[box], region[box])[0]


def _box_around(mask: Mask, reach: int) -> tuple[slice, slice]:
    """Return the rows and columns of a mask's bounding box, widened by a number of pixels."""
    x, y, width, height = cv2.boundingRect(mask)
    return (
        slice(max(0, y - reach), y + height + reach),
        slice(max(0, x - reach), x + width + reach),
    )


def _pixels(outline: object) -> Outline:
    return np.asarray(outline, dtype=np.int32)[:, 0]


def _noise(bright: Image, smoothed: Image) -> float:
    """Return the standard deviation of the noise of single pixels, outside of the margin."""
    inner = slice(MARGIN, -MARGIN)
    return _MAD_TO_DEVIATION * median_change(bright[inner, inner], smoothed[inner, inner])


def _hole(smoothed: Image, filled: Mask, level: float) -> Mask | None:
    """Return the largest hole below a level that the organ closes in, or None."""
    low = smoothed <= level
    inside = filled > 0
    smallest = SMALLEST_LUMEN_FRACTION * cv2.countNonZero(filled)
    if cv2.countNonZero(mask_of(low & inside)) < smallest:
        return None
    outlines, tree = cv2.findContours(mask_of(inside & ~low), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    holes = np.flatnonzero(np.asarray(tree)[0, :, 3] >= 0).tolist() if outlines else []
    if not holes:
        return None
    largest = max(holes, key=lambda hole: cv2.contourArea(outlines[hole]))
    hole = mask_of((fill(_pixels(outlines[largest]), filled.shape) > 0) & low)
    return hole if cv2.countNonZero(hole) >= smallest else None
