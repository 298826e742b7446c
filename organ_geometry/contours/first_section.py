"""The section that tracing begins with.

Without a seed it is the largest component near the middle of its image (`main_outline`). With one,
windows around the seed grow by half, each is split at three levels, and the component around the
seed is a candidate if it closes inside the window. Of candidates with a clear edge all around, the
weakest tenth of it at least `CLEAR_EDGE` of an ideal edge's slope, the smallest is taken; of others
the one of the clearest edge.

An ideal edge is a step as high as the contrast, blurred by sigma: its slope is
contrast / (sigma sqrt(2 pi)).
"""

import math
from collections.abc import Iterator

import cv2
import numpy as np

from organ_geometry.contours.edge_curve import Image, NoEdgeFound, blurred
from organ_geometry.contours.edges import (
    BORDER_PROBLEM,
    as_grey,
    touches_border,
)
from organ_geometry.contours.found_section import EdgeRule, FoundSection, open_sides, trimmed
from organ_geometry.contours.section_region import (
    MARGIN,
    SMOOTHING_PX,
    Outline,
    Region,
    find_region,
    grown,
    main_outline,
    mask_of,
    otsu,
    outline_around,
    with_margin,
    without,
)
from organ_geometry.contours.trace_options import FoundPolarity
from organ_geometry.images.grey_image import GreyImage

# Where an organ leaks, its edge is weaker than this share of an ideal one.
CLEAR_EDGE = 0.3
# Half the side of the first window, px: a duct of a few pixels, and background around it.
_SMALLEST_WINDOW = 12


def first_section(
    index: int, image: GreyImage, rule: EdgeRule, seed: tuple[float, float] | None
) -> FoundSection:
    """Return the organ's section in an image without one to follow."""
    if seed is not None:
        return _seeded(index, image, rule, seed)
    bright = with_margin(as_grey(image) * np.float32(rule.sign))
    region = find_region(bright, main_outline, threshold=rule.level, scale=rule.scale)
    if touches_border(region.filled):
        raise NoEdgeFound(BORDER_PROBLEM)
    area = cv2.countNonZero(region.filled)
    return trimmed(FoundSection(index, image, (0, 0), bright, region, carried=None, areas=(area,)))


def seed_polarity(image: GreyImage, seed: tuple[float, float]) -> FoundPolarity:
    """Return whether the organ at a point is brighter or darker than what is around it."""
    grey = as_grey(image)
    smoothed = blurred(grey, SMOOTHING_PX)
    x, y = round(seed[0]), round(seed[1])
    rows, columns = grey.shape
    half = _SMALLEST_WINDOW
    while True:
        y0, x0 = max(0, y - half), max(0, x - half)
        window = smoothed[y0 : y + half + 1, x0 : x + half + 1]
        level = otsu(window)
        above = bool(smoothed[y, x] > level)
        mask = mask_of(window > level if above else window <= level)
        outline, _ = outline_around(float(x - x0), float(y - y0))(mask)
        whole = half >= max(rows, columns)
        if whole or (outline is not None and not _at_rim(outline, mask.shape)):
            return "bright" if above else "dark"
        half *= 2


def _at_rim(outline: Outline, shape: tuple[int, ...]) -> bool:
    low, high = outline.min(axis=0), outline.max(axis=0)
    return bool(low.min() == 0 or high[0] == shape[1] - 1 or high[1] == shape[0] - 1)


def _seeded(
    index: int, image: GreyImage, rule: EdgeRule, seed: tuple[float, float]
) -> FoundSection:
    """Return the smallest section around a seed that has an edge all around it."""
    # What closes around the seed depends on the level: an organ, or the organ and what it lies in.
    # Windows of growing size are split at several levels, and each is tried.
    rows, columns = image.shape
    x, y = round(seed[0]), round(seed[1])
    reason = f"nothing stands out at the seed ({seed[0]:g}, {seed[1]:g})"
    best, best_score = None, (False, 0.0)
    for half in _half_windows(max(rows, columns)):
        x0, y0 = max(0, x - half), max(0, y - half)
        crop = image[y0 : y + half + 1, x0 : x + half + 1]
        bright = with_margin(as_grey(crop) * np.float32(rule.sign))
        smoothed = blurred(bright, SMOOTHING_PX, rule.scale)
        here = float(smoothed[y - y0 + MARGIN, x - x0 + MARGIN])
        choose = outline_around(seed[0] - x0 + MARGIN, seed[1] - y0 + MARGIN)
        for level in _split_levels(smoothed, here) if rule.level is None else (rule.level,):
            try:
                region = find_region(
                    bright, choose, start_level=level, threshold=rule.level, scale=rule.scale
                )
            except NoEdgeFound:
                continue
            if open_sides(region.filled, (x0, y0), image.shape):
                continue
            if touches_border(region.filled):
                reason = BORDER_PROBLEM
                continue
            area = cv2.countNonZero(region.filled)
            edge = _weakest_edge(smoothed, region)
            score = (True, -float(area)) if edge >= CLEAR_EDGE else (False, edge)
            if score > best_score or best is None:
                best_score = score
                best = FoundSection(
                    index, image, (x0, y0), bright, region, carried=None, areas=(area,)
                )
    if best is None:
        raise NoEdgeFound(reason)
    return trimmed(best)


def _half_windows(largest: int) -> Iterator[int]:
    half = _SMALLEST_WINDOW
    while half < largest:
        yield half
        half = half * 3 // 2
    yield largest


def _split_levels(smoothed: Image, here: float) -> tuple[float, float, float]:
    """Return Otsu's levels: of an image, of its part above that, of it cut off at `here`."""
    # An organ may be a bright part of a bright body (the second), or dim beside a brighter one (the
    # third).
    level = otsu(smoothed)
    above = smoothed[smoothed > level]
    return level, otsu(above) if above.size else level, otsu(np.minimum(smoothed, here))


def _weakest_edge(smoothed: Image, region: Region) -> float:
    """Return the slope along a region's weakest tenth of outline, as a share of an ideal edge's."""
    rim = without(region.filled, grown(region.filled, -1)) > 0
    slope_x = np.asarray(cv2.Sobel(smoothed, cv2.CV_32F, 1, 0, ksize=3, scale=1 / 8))
    slope_y = np.asarray(cv2.Sobel(smoothed, cv2.CV_32F, 0, 1, ksize=3, scale=1 / 8))
    slopes = np.hypot(slope_x[rim], slope_y[rim])
    ideal = region.contrast / (SMOOTHING_PX * math.sqrt(2.0 * math.pi))
    return float(np.quantile(slopes, 0.1)) / max(ideal, 1e-6)
