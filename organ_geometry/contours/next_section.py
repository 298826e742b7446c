"""The section that continues an organ in the next image.

Around the last section's box the image is split at a level, and the component that covers most of
the last section continues it. That is no longer the organ, and said so, where

- another component has over `SPLIT_SHARE` of its area beside it (it splits),
- a ring has become an open one (its wall is open), or
- ground is won or lost where the two images hardly differ, or the area of a steady organ jumps (it
  merges with a neighbour, or leaks into one).

Then the edge is carried on along steps of grey from the last image (`edge_strip`), from one image
to the next only; a level is trusted again once it closes about the same as was carried on. After a
gap, the organ is the same one only where both share most of their area.
"""

import math
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from organ_geometry.contours.edge_curve import Image, NoEdgeFound, blurred
from organ_geometry.contours.edge_strip import carried_edge
from organ_geometry.contours.edges import (
    BORDER_PROBLEM,
    as_grey,
    touches_border,
)
from organ_geometry.contours.found_section import (
    SMALLEST_REACH_PX,
    EdgeRule,
    FoundSection,
    open_sides,
    trimmed,
)
from organ_geometry.contours.masked_levels import median_where
from organ_geometry.contours.section_region import (
    MARGIN,
    SMALLEST_ORGAN_PX,
    Choice,
    Mask,
    Outline,
    Region,
    fill,
    find_region,
    grown,
    inner_level,
    level_around,
    mask_of,
    only_outline,
    outline_of,
    with_margin,
    without,
)
from organ_geometry.images.grey_image import GreyImage

# How far around the last section the next is looked for, as a share of the root of its area.
REACH = 0.4
# Ground is won or lost without reason where the image hardly changed, by less than this share of
# the contrast. More than this share of the organ's area of it is a leak.
UNCHANGED = 0.3
LEAK_FRACTION = 0.15
# So is sudden growth by this factor of an organ whose area was steady to within the other.
SUDDEN_GROWTH = 2.0
STEADY = 1.5
# A second part of at least this share of the first splits the organ.
SPLIT_FRACTION = 0.35
# But not where what parts it is brighter than what is around, by more than this share of the
# contrast: the flap of a dissection, a thrombus.
SEPTUM_FRACTION = 0.2
# A wall is open where a section lost its lumen and more than this share of its area with it.
OPEN_FRACTION = 0.25
# After a longer gap, an organ is the same one only if both share this much of their joint area.
LONGEST_GAP = 3
GAP_OVERLAP = 0.5
# And where its edge was carried on, a grey level is trusted again only if it closes the same thing.
CARRIED_OVERLAP = 0.7
_AREAS = 5


def next_section(
    index: int, image: GreyImage, rule: EdgeRule, last: FoundSection, last_name: str
) -> FoundSection:
    """Return the section that continues the organ."""
    x0, y0, x1, y1 = _box(last)
    reach = max(SMALLEST_REACH_PX, round(REACH * math.sqrt((x1 - x0) * (y1 - y0))))
    while True:
        corner, bright, before = _window(image, rule, last, (x0, y0, x1, y1), reach)
        region = _continuing(bright, before, rule, last_name)
        if not open_sides(region.filled, corner, image.shape):
            break
        reach *= 2
    carried = None
    trouble = _trouble(bright, region, before, last, corner, rule, last_name)
    if trouble is not None:
        if abs(index - last.index) == 1 and rule.method == "half-level":
            carried = _carried(bright, corner, region, last, rule)
        if carried is None:
            raise NoEdgeFound(trouble)
        filled = fill(np.round(carried).astype(np.int32), bright.shape)
        if region.other_component >= SPLIT_FRACTION and not _is_septum(
            bright, filled, region, rule
        ):
            raise NoEdgeFound(trouble)
        region = replace(region, filled=filled, lumen=None, lumen_level=math.nan)
    if touches_border(region.filled):
        raise NoEdgeFound(BORDER_PROBLEM)
    area = cv2.countNonZero(region.filled)
    if abs(index - last.index) > LONGEST_GAP and _overlap(region, before) < GAP_OVERLAP:
        raise NoEdgeFound(f"nothing continues the organ of {last_name}, the last one found")
    areas = (*last.areas, area)[-_AREAS:]
    return trimmed(
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


def _continuing(bright: Image, before: Region, rule: EdgeRule, last_name: str) -> Region:
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


def _trouble(
    bright: Image,
    region: Region,
    before: Region,
    last: FoundSection,
    corner: tuple[int, int],
    rule: EdgeRule,
    last_name: str,
) -> str | None:
    """Return why the region that a grey level encloses is not the organ, or None if it is."""
    if region.other_component >= SPLIT_FRACTION:
        return (
            f"the organ splits: beside the part that continues {last_name} there is one of "
            f"{region.other_component:.0%} of its area"
        )
    if _opens(before, region):
        raise NoEdgeFound(f"the wall is open, which closes a lumen in {last_name}")
    if _leaks(bright, region, before, last, corner, rule):
        return f"the organ merges with what was beside it in {last_name}"
    if last.carried is not None and _overlap(region, before) < CARRIED_OVERLAP:
        return f"a grey level closes something else than the organ carried on to {last_name}"
    return None


def _overlap(region: Region, other: Region) -> float:
    """Return the area that two regions share over their joint area."""
    both = cv2.countNonZero(cv2.bitwise_and(region.filled, other.filled))
    return both / max(1, cv2.countNonZero(cv2.bitwise_or(region.filled, other.filled)))


def _opens(before: Region, region: Region) -> bool:
    """Return whether a ring has become an open one, whose edge runs along both of its sides."""
    if before.lumen is None or region.lumen is not None:
        return False
    left = cv2.countNonZero(region.filled)
    return left < (1.0 - OPEN_FRACTION) * cv2.countNonZero(before.filled)


def _leaks(
    bright: Image,
    region: Region,
    before: Region,
    last: FoundSection,
    corner: tuple[int, int],
    rule: EdgeRule,
) -> bool:
    """Return whether the organ won or lost much ground where the image did not change."""
    largest = LEAK_FRACTION * last.areas[-1]
    if cv2.countNonZero(cv2.bitwise_xor(region.filled, before.filled)) <= largest:
        return False
    won = without(region.solid, grown(before.filled, 2))
    lost = without(before.solid, grown(region.filled, 2))
    moved = cv2.bitwise_or(won, lost)
    if cv2.countNonZero(moved) <= largest:
        return False
    steady = len(last.areas) == _AREAS and max(last.areas) < STEADY * min(last.areas)
    if steady and cv2.countNonZero(region.filled) > SUDDEN_GROWTH * last.areas[-1]:
        return True
    now, then = _blurred_pair(bright, last, corner, rule)
    same = mask_of(np.abs(now - then) < UNCHANGED * last.region.contrast)
    return cv2.countNonZero(cv2.bitwise_and(moved, same)) > largest


def _is_septum(bright: Image, filled: Mask, pieces: Region, rule: EdgeRule) -> bool:
    """Return whether the parts of a region are joined by tissue, brighter than the background."""
    above = mask_of(blurred(bright, pieces.sigma, rule.scale) > pieces.outer_level)
    between, count = median_where(bright, without(grown(filled, -1), grown(above, 1)))
    if count == 0:
        return True
    return between - level_around(bright, filled) > SEPTUM_FRACTION * pieces.contrast


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
