"""Following an organ from one section image to the next."""

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from organ_geometry.edge_curve import SQUARE, Image, NoEdgeFound, Scale, blurred
from organ_geometry.edge_strip import carried_edge
from organ_geometry.edges import (
    EdgeMethod,
    FoundPolarity,
    as_grey,
    region_edges,
    touches_border,
)
from organ_geometry.image_stack import GreyImage
from organ_geometry.section_region import (
    MARGIN,
    SMALLEST_ORGAN_PX,
    SMOOTHING_PX,
    Choice,
    Mask,
    Outline,
    Region,
    fill,
    find_region,
    grown,
    inner_level,
    level_around,
    main_outline,
    mask_of,
    only_outline,
    otsu,
    outline_around,
    outline_of,
    with_margin,
    without,
)

# How far around the last section the next is looked for, as a share of the root of its area.
REACH = 0.4
SMALLEST_REACH_PX = 12
# Ground is won or lost without reason where the image hardly changed, by less than this share of
# the contrast. More than this share of the organ's area of it is a leak.
UNCHANGED = 0.3
LEAK_SHARE = 0.15
# So is sudden growth by this factor of an organ whose area was steady to within the other.
SUDDEN_GROWTH = 2.0
STEADY = 1.5
# A second part of at least this share of the first splits the organ.
SPLIT_SHARE = 0.35
# A wall is open where a section lost its lumen and more than this share of its area with it.
OPEN_SHARE = 0.25
# After a longer gap, an organ is the same one only if both share this much of their joint area.
LONGEST_GAP = 3
GAP_OVERLAP = 0.5
# Growth that is worth a word.
LARGE_GROWTH = 2.5
OTHER_PART = 0.05
_AREAS = 5
_SMALLEST_WINDOW = 12


@dataclass(frozen=True, slots=True)
class EdgeRule:
    """What an organ's edge is in all images of a stack.

    Attributes
    ----------
    polarity
        Whether the organ is brighter or darker than its surroundings.
    threshold
        Grey level of the edge, or None for half way between both sides.
    method
        "half-level" or "canny".
    scale
        Width and height of a pixel, in pixels of mean size.
    """

    polarity: FoundPolarity
    threshold: float | None = None
    method: EdgeMethod = "half-level"
    scale: Scale = SQUARE

    @property
    def sign(self) -> float:
        """1 for a bright organ, -1 for a dark one."""
        return 1.0 if self.polarity == "bright" else -1.0

    @property
    def level(self) -> float | None:
        """The given threshold where the organ is bright."""
        return None if self.threshold is None else self.sign * self.threshold


@dataclass(frozen=True, slots=True, eq=False)
class FoundSection:
    """An organ's section to a pixel, as the next one is looked for by it.

    Attributes
    ----------
    index
        Number of the slice.
    image
        (H, W) the whole image.
    corner
        Column and row of the window's first pixel.
    bright
        (h, w) levels of the window with its margin, in which the organ is bright.
    region
        Where the organ is in it.
    carried
        (N, 2) points of the edge in the window where it was carried from the last section, because
        the organ's threshold leaks into a neighbour, or None.
    areas
        Areas of the last sections found, this one last, px^2.
    """

    index: int
    image: GreyImage
    corner: tuple[int, int]
    bright: Image
    region: Region
    carried: NDArray[np.float64] | None
    areas: tuple[int, ...]

    @property
    def growth(self) -> float:
        """Area over that of the section before."""
        return self.areas[-1] / self.areas[-2] if len(self.areas) > 1 else 1.0


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
    return _trimmed(FoundSection(index, image, (0, 0), bright, region, carried=None, areas=(area,)))


def next_section(
    index: int, image: GreyImage, rule: EdgeRule, last: FoundSection, last_name: str
) -> FoundSection:
    """Return the section that continues the organ.

    It is the component that covers most of the last section, of what is brighter than half way
    between the levels inside and around the last section's place.

    Parameters
    ----------
    index
        Number of the slice.
    image
        (H, W) grey levels.
    rule
        What the edge is.
    last
        The last section found.
    last_name
        Name of its image.

    Returns
    -------
    FoundSection
        The section.

    Raises
    ------
    NoEdgeFound
        If nothing continues the organ, or what does touches the border, has split or merged.
    """
    x0, y0, x1, y1 = _box(last)
    reach = max(SMALLEST_REACH_PX, round(REACH * math.sqrt((x1 - x0) * (y1 - y0))))
    while True:
        corner, bright, before = _window(image, rule, last, (x0, y0, x1, y1), reach)
        region = _continuing(bright, before, rule, last_name)
        if not _open_sides(region.filled, corner, image.shape):
            break
        reach *= 2
    if region.other_part >= SPLIT_SHARE:
        raise NoEdgeFound(
            f"the organ splits: beside the part that continues {last_name} there is one of "
            f"{region.other_part:.0%} of its area"
        )
    if _opens(before, region):
        raise NoEdgeFound(f"the wall is open, which closes a lumen in {last_name}")
    carried = None
    if _leaks(bright, region, before, last, corner, rule):
        if abs(index - last.index) == 1 and rule.method == "half-level":
            carried = _carried(bright, corner, region, last, rule)
        if carried is None:
            raise NoEdgeFound(f"the organ merges with what was beside it in {last_name}")
        outline = np.round(carried).astype(np.int32)
        region = replace(
            region, filled=fill(outline, bright.shape), lumen=None, lumen_level=math.nan
        )
    if touches_border(region.filled):
        raise NoEdgeFound("the organ touches the image's border")
    area = cv2.countNonZero(region.filled)
    if abs(index - last.index) > LONGEST_GAP:
        both = cv2.countNonZero(cv2.bitwise_and(region.filled, before.filled))
        if both < GAP_OVERLAP * cv2.countNonZero(cv2.bitwise_or(region.filled, before.filled)):
            raise NoEdgeFound(f"nothing continues the organ of {last_name}, the last one found")
    areas = (*last.areas, area)[-_AREAS:]
    return _trimmed(
        FoundSection(
            index,
            image,
            corner,
            bright,
            region,
            carried=carried,
            areas=areas,
        )
    )


def section_edges(
    section: FoundSection, rule: EdgeRule
) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
    """Return the outer and the lumen's boundary of a section, px of its image.

    Parameters
    ----------
    section
        The section to a pixel.
    rule
        What the edge is.

    Returns
    -------
    tuple[NDArray[np.float64], NDArray[np.float64] | None]
        (N, 2) and (M, 2) points x, y, px, or None without a lumen.

    Raises
    ------
    NoEdgeFound
        If the edge does not close.
    """
    shift = np.array(section.corner, dtype=np.float64) - MARGIN
    if section.carried is not None:
        return section.carried + shift, None
    outer, lumen = region_edges(
        section.bright, section.region, method=rule.method, scale=rule.scale
    )
    return outer + shift, None if lumen is None else lumen + shift


def shows_other_part(section: FoundSection, rule: EdgeRule) -> bool:
    """Return whether the image shows another part of at least `OTHER_PART` of the organ's area."""
    image, region = section.image, section.region
    # A coarser image shows all parts of that size, and is quicker to search.
    area = section.areas[-1]
    coarse = max(1, min(4, math.floor(math.sqrt(OTHER_PART * area / 4.0))))
    sign = rule.sign
    above = image > region.outer_level if sign > 0 else image < -region.outer_level
    mask = mask_of(above)
    x, y = section.corner
    filled = grown(region.filled, 2)[MARGIN:-MARGIN, MARGIN:-MARGIN]
    rows, columns = filled.shape
    part = mask[y : y + rows, x : x + columns]
    part[filled[: part.shape[0], : part.shape[1]] > 0] = 0
    rows, columns = mask.shape
    size = (math.ceil(columns / coarse), math.ceil(rows / coarse))
    if coarse > 1:
        mask = np.asarray(cv2.resize(mask, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    else:
        mask = np.asarray(cv2.blur(mask, (3, 3)), dtype=np.uint8)
    mask = mask_of(mask > 127)
    if cv2.countNonZero(mask) * coarse**2 < max(OTHER_PART * area, SMALLEST_ORGAN_PX):
        return False
    _, _, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    largest = int(np.asarray(stats)[1:, cv2.CC_STAT_AREA].max())
    return largest * coarse**2 >= max(OTHER_PART * area, SMALLEST_ORGAN_PX)


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
            if _open_sides(region.filled, (x0, y0), image.shape):
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
    return _trimmed(best)


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


def _box(section: FoundSection) -> tuple[int, int, int, int]:
    """Return the first and last column and row, x0, y0, x1, y1, of a section in its image."""
    x, y, width, height = cv2.boundingRect(section.region.filled)
    x0, y0 = x + section.corner[0] - MARGIN, y + section.corner[1] - MARGIN
    return x0, y0, x0 + width - 1, y0 + height - 1


def _window(
    image: GreyImage,
    rule: EdgeRule,
    last: FoundSection,
    box: tuple[int, int, int, int],
    reach: int,
) -> tuple[tuple[int, int], Image, Region]:
    """Return the corner and levels of a window around a box, and the last region there."""
    rows, columns = image.shape
    x0, y0 = max(0, box[0] - reach), max(0, box[1] - reach)
    x1, y1 = min(columns, box[2] + reach + 1), min(rows, box[3] + reach + 1)
    grey = as_grey(image[y0:y1, x0:x1]) * np.float32(rule.sign)
    shape = (y1 - y0 + 2 * MARGIN, x1 - x0 + 2 * MARGIN)
    filled = _moved(last.region.filled, last.corner, (x0, y0), shape)
    lumen = last.region.lumen
    moved = None if lumen is None else _moved(lumen, last.corner, (x0, y0), shape)
    before = replace(last.region, filled=filled, lumen=moved)
    bright = with_margin(grey)
    return (x0, y0), bright, before


def _moved(
    mask: Mask, corner: tuple[int, int], new_corner: tuple[int, int], shape: tuple[int, int]
) -> Mask:
    """Return a window's mask in another window of the same image."""
    result = np.zeros(shape, dtype=np.uint8)
    x, y = corner[0] - new_corner[0], corner[1] - new_corner[1]
    rows, columns = mask.shape
    top, left = max(0, y), max(0, x)
    bottom, right = min(shape[0], y + rows), min(shape[1], x + columns)
    if top < bottom and left < right:
        result[top:bottom, left:right] = mask[top - y : bottom - y, left - x : right - x]
    return result


def _open_sides(filled: Mask, corner: tuple[int, int], shape: tuple[int, ...]) -> bool:
    """Return whether a region reaches a side of its window that is not the image's border."""
    x, y, width, height = cv2.boundingRect(filled)
    rows, columns = filled.shape[0] - 2 * MARGIN, filled.shape[1] - 2 * MARGIN
    return (
        (x <= MARGIN and corner[0] > 0)
        or (y <= MARGIN and corner[1] > 0)
        or (x + width >= columns + MARGIN and corner[0] + columns < shape[1])
        or (y + height >= rows + MARGIN and corner[1] + rows < shape[0])
    )


def _trimmed(section: FoundSection) -> FoundSection:
    """Return a section whose window is not much larger than the organ."""
    x, y, width, height = cv2.boundingRect(section.region.filled)
    rows, columns = section.region.filled.shape
    reach = SMALLEST_REACH_PX + MARGIN
    left, top = max(0, x - reach), max(0, y - reach)
    right, bottom = min(columns, x + width + reach), min(rows, y + height + reach)
    inner = (slice(top, bottom), slice(left, right))
    region = section.region
    carried = section.carried
    return replace(
        section,
        carried=None if carried is None else carried - (left, top),
        corner=(section.corner[0] + left, section.corner[1] + top),
        bright=section.bright[inner],
        region=replace(
            region,
            filled=region.filled[inner],
            lumen=None if region.lumen is None else region.lumen[inner],
        ),
    )


def _continuing(bright: Image, before: Region, rule: EdgeRule, last_name: str) -> Region:
    """Return the region that continues the one before."""
    choose = _outline_continuing(before, last_name)
    organ, around = inner_level(bright, before.solid), level_around(bright, before.filled)
    if rule.level is None and organ > around:
        try:
            return find_region(bright, choose, start_level=0.5 * (organ + around), scale=rule.scale)
        except NoEdgeFound:
            # The organ may have moved far, and Otsu's split find it.
            pass
    return find_region(bright, choose, threshold=rule.level, scale=rule.scale)


def _outline_continuing(before: Region, last_name: str) -> Choice:
    """Return the choice of the component that covers most of a region, or is nearest to it."""
    solid = before.solid

    def choose(mask: Mask) -> tuple[Outline | None, float]:
        only = only_outline(mask)
        if (
            only is not None
            and cv2.contourArea(only) >= SMALLEST_ORGAN_PX
            and bool((solid[only[:, 1], only[:, 0]] > 0).any())
        ):
            return only, 0.0
        _, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
        labels = np.asarray(labels, dtype=np.int32)
        areas = np.asarray(stats, dtype=np.int32)[:, cv2.CC_STAT_AREA]
        if len(areas) < 2 or areas[1:].max() < SMALLEST_ORGAN_PX:
            return None, 0.0
        over = _overlaps(labels, solid, areas)
        if not over.any():
            radius = math.sqrt(cv2.countNonZero(before.filled) / math.pi)
            over = _overlaps(labels, grown(before.filled, max(3, round(0.5 * radius))), areas)
        label = int(over.argmax())
        if over[label] == 0:
            raise NoEdgeFound(f"nothing continues the organ of {last_name}, the last one found")
        rest = np.where(2 * over > areas, areas, 0)
        rest[label] = 0
        return outline_of(mask_of(labels == label)), float(rest.max() / areas[label])

    return choose


def _overlaps(
    labels: NDArray[np.int32], region: Mask, areas: NDArray[np.int32]
) -> NDArray[np.intp]:
    """Return how many pixels of each component of a suitable size lie in a region."""
    over = np.bincount(labels[region > 0], minlength=len(areas))
    over[0] = 0
    over[areas < SMALLEST_ORGAN_PX] = 0
    return over


def _opens(before: Region, region: Region) -> bool:
    """Return whether a ring has become an open one, whose edge runs along both of its sides."""
    if before.lumen is None or region.lumen is not None:
        return False
    left = cv2.countNonZero(region.filled)
    return left < (1.0 - OPEN_SHARE) * cv2.countNonZero(before.filled)


def _leaks(
    bright: Image,
    region: Region,
    before: Region,
    last: FoundSection,
    corner: tuple[int, int],
    rule: EdgeRule,
) -> bool:
    """Return whether the organ won or lost much ground where the image did not change."""
    won = without(region.solid, grown(before.filled, 2))
    lost = without(before.solid, grown(region.filled, 2))
    moved = cv2.bitwise_or(won, lost)
    largest = LEAK_SHARE * last.areas[-1]
    if cv2.countNonZero(moved) <= largest:
        return False
    steady = len(last.areas) == _AREAS and max(last.areas) < STEADY * min(last.areas)
    if steady and cv2.countNonZero(region.filled) > SUDDEN_GROWTH * last.areas[-1]:
        return True
    now, then = _blurred_pair(bright, last, corner, rule)
    same = mask_of(np.abs(now - then) < UNCHANGED * last.region.contrast)
    return cv2.countNonZero(cv2.bitwise_and(moved, same)) > largest


def _blurred_pair(
    bright: Image, last: FoundSection, corner: tuple[int, int], rule: EdgeRule
) -> tuple[Image, Image]:
    """Return the slightly blurred levels of a window, and those of the last image there."""
    rows, columns = bright.shape
    x, y = corner
    crop = last.image[y : y + rows - 2 * MARGIN, x : x + columns - 2 * MARGIN]
    then = with_margin(as_grey(crop) * np.float32(rule.sign))
    return blurred(bright, 1.0, rule.scale), blurred(then, 1.0, rule.scale)


def _carried(
    bright: Image,
    corner: tuple[int, int],
    region: Region,
    last: FoundSection,
    rule: EdgeRule,
) -> NDArray[np.float64] | None:
    """Return the last section's edge, carried into a window, px of the window."""
    shift = np.array(last.corner, dtype=np.float64) - corner
    if last.carried is not None:
        edge = last.carried
    else:
        outline = outline_of(last.region.filled)
        if outline is None:
            return None
        edge = outline.astype(np.float64)
    now, then = _blurred_pair(bright, last, corner, rule)
    return carried_edge(now, then, edge + shift, max(region.contrast, last.region.contrast))
