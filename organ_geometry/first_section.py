"""The section that an organ is begun with."""

import cv2
import numpy as np

from organ_geometry.edge_curve import Image, NoEdgeFound, blurred
from organ_geometry.edges import FoundPolarity, as_grey, touches_border
from organ_geometry.found_section import EdgeRule, FoundSection, open_sides, trimmed
from organ_geometry.image_stack import GreyImage
from organ_geometry.section_region import (
    MARGIN,
    SMOOTHING_PX,
    Mask,
    Outline,
    find_region,
    grown,
    main_outline,
    mask_of,
    otsu,
    outline_around,
    with_margin,
    without,
)

_SMALLEST_WINDOW = 12


def first_section(
    index: int, image: GreyImage, rule: EdgeRule, seed: tuple[float, float] | None
) -> FoundSection:
    """Return the organ's section in an image without one to follow.

    Parameters
    ----------
    index
        Number of the slice.
    image
        (H, W) grey levels.
    rule
        What the edge is.
    seed
        A point x, y of the organ, px, or None for the largest thing near the middle.

    Returns
    -------
    FoundSection
        The section.

    Raises
    ------
    NoEdgeFound
        If nothing stands out, there or at all, or what does touches the image's border.
    """
    if seed is not None:
        return _seeded(index, image, rule, seed)
    bright = with_margin(as_grey(image) * np.float32(rule.sign))
    region = find_region(bright, main_outline, threshold=rule.level, scale=rule.scale)
    if touches_border(region.filled):
        raise NoEdgeFound("the organ touches the image's border")
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
    """Return the section around a seed whose edge is steepest."""
    # What closes around the seed depends on the level: an organ, or the organ and what it lies in.
    # Windows of growing size are each split by Otsu's threshold, and the brighter part once more.
    x, y = round(seed[0]), round(seed[1])
    rows, columns = image.shape
    half = _SMALLEST_WINDOW
    reason = f"nothing stands out at the seed ({seed[0]:g}, {seed[1]:g})"
    best, steepest = None, 0.0
    while True:
        x0, y0 = max(0, x - half), max(0, y - half)
        crop = image[y0 : y + half + 1, x0 : x + half + 1]
        bright = with_margin(as_grey(crop) * np.float32(rule.sign))
        smoothed = blurred(bright, SMOOTHING_PX, rule.scale)
        choose = outline_around(seed[0] - x0 + MARGIN, seed[1] - y0 + MARGIN)
        for level in _split_levels(smoothed) if rule.level is None else (rule.level,):
            try:
                region = find_region(
                    bright, choose, start_level=level, threshold=rule.level, scale=rule.scale
                )
            except NoEdgeFound:
                continue
            if open_sides(region.filled, (x0, y0), image.shape):
                continue
            if touches_border(region.filled):
                reason = "the organ touches the image's border"
                continue
            steepness = _steepness(smoothed, region.filled)
            if steepness > steepest:
                area = cv2.countNonZero(region.filled)
                best = FoundSection(
                    index, image, (x0, y0), bright, region, carried=None, areas=(area,)
                )
                steepest = steepness
        if half >= max(rows, columns):
            break
        half *= 2
    if best is None:
        raise NoEdgeFound(reason)
    return trimmed(best)


def _split_levels(smoothed: Image) -> tuple[float, float]:
    """Return Otsu's level of an image, and that of what is above it."""
    level = otsu(smoothed)
    above = smoothed[smoothed > level]
    return level, otsu(above) if above.size else level


def _steepness(smoothed: Image, filled: Mask) -> float:
    """Return the median slope along the outline of a region, levels a pixel."""
    rim = without(filled, grown(filled, -1)) > 0
    slope_x = np.asarray(cv2.Sobel(smoothed, cv2.CV_32F, 1, 0, ksize=3, scale=1 / 8))
    slope_y = np.asarray(cv2.Sobel(smoothed, cv2.CV_32F, 0, 1, ksize=3, scale=1 / 8))
    return float(np.median(np.hypot(slope_x[rim], slope_y[rim])))
