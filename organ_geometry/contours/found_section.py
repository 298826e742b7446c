"""An organ's section to a pixel, in a window of its image, and the rule for its edge."""

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from organ_geometry.contours.edge_curve import SQUARE, Image, Scale
from organ_geometry.contours.edges import region_edges
from organ_geometry.contours.section_region import (
    MARGIN,
    SMALLEST_ORGAN_PX,
    Mask,
    Region,
    grown,
    mask_of,
)
from organ_geometry.contours.trace_options import EdgeMethod, FoundPolarity
from organ_geometry.images.grey_image import GreyImage

# Another part counts from this share of the organ's area on.
OTHER_COMPONENT = 0.05
# What is kept around an organ, px.
SMALLEST_REACH_PX = 12


@dataclass(frozen=True, slots=True)
class EdgeRule:
    """How an organ's edge is defined in all images of a stack."""

    polarity: FoundPolarity  # Whether the organ is brighter or darker than its surroundings
    # Grey level of the edge, or None for half way between both sides.
    threshold: float | None = None
    method: EdgeMethod = "half-level"  # "half-level" or "canny"
    scale: Scale = SQUARE  # Width and height of a pixel, in pixels of mean size

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
    """An organ's section to a pixel, as the next one is looked for by it."""

    index: int  # Number of the slice
    image: GreyImage  # (H, W) the whole image
    corner: tuple[int, int]  # Column and row of the window's first pixel
    bright: Image  # (h, w) levels of the window with its margin, in which the organ is bright
    region: Region  # Where the organ is in it
    # (N, 2) points of the edge in the window where it was carried from the last section, because
    # the organ's threshold leaks into a neighbour, or None.
    carried: NDArray[np.float64] | None
    areas: tuple[int, ...]  # Areas of the last sections found, this one last, px^2

    @property
    def growth(self) -> float:
        """Area over that of the section before."""
        return self.areas[-1] / self.areas[-2] if len(self.areas) > 1 else 1.0


def section_edges(
    section: FoundSection, rule: EdgeRule
) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
    """Return the outer and the lumen's boundary of a section, px of its image."""
    shift = np.array(section.corner, dtype=np.float64) - MARGIN
    if section.carried is not None:
        return section.carried + shift, None
    outer, lumen = region_edges(
        section.bright, section.region, method=rule.method, scale=rule.scale
    )
    return outer + shift, None if lumen is None else lumen + shift


def shows_other_component(section: FoundSection, rule: EdgeRule) -> bool:
    """Return whether another component has at least `OTHER_COMPONENT` of the organ's area."""
    image, region = section.image, section.region
    # A coarser image shows all parts of that size, and is quicker to search.
    area = section.areas[-1]
    halvings = math.floor(0.5 * math.log2(max(1.0, OTHER_COMPONENT * area / 4.0)))
    halvings = min(2, halvings, math.floor(math.log2(min(image.shape))))
    # Levels are whole numbers, and comparing them with one is ten times as quick.
    mask = (
        mask_of(image > math.floor(region.outer_level))
        if rule.sign > 0
        else mask_of(image < math.ceil(-region.outer_level))
    )
    x, y = section.corner
    filled = grown(region.filled, 2)[MARGIN:-MARGIN, MARGIN:-MARGIN]
    rows, columns = filled.shape
    window = mask[y : y + rows, x : x + columns]
    window[filled[: window.shape[0], : window.shape[1]] > 0] = 0
    if halvings == 0:
        mask = np.asarray(cv2.blur(mask, (3, 3)), dtype=np.uint8)
    for _ in range(halvings):
        rows, columns = mask.shape[0] // 2, mask.shape[1] // 2
        even = mask[: 2 * rows, : 2 * columns]
        halved = cv2.resize(even, (columns, rows), interpolation=cv2.INTER_AREA)
        mask = np.asarray(halved, dtype=np.uint8)
    coarse = 2**halvings
    mask = mask_of(mask > 127)
    if cv2.countNonZero(mask) * coarse**2 < max(OTHER_COMPONENT * area, SMALLEST_ORGAN_PX):
        return False
    _, _, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    largest = int(np.asarray(stats)[1:, cv2.CC_STAT_AREA].max())
    return largest * coarse**2 >= max(OTHER_COMPONENT * area, SMALLEST_ORGAN_PX)


def trimmed(section: FoundSection) -> FoundSection:
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


def open_sides(filled: Mask, corner: tuple[int, int], shape: tuple[int, ...]) -> bool:
    """Return whether a region reaches a side of its window that is not the image's border."""
    x, y, width, height = cv2.boundingRect(filled)
    rows, columns = filled.shape[0] - 2 * MARGIN, filled.shape[1] - 2 * MARGIN
    return (
        (x <= MARGIN and corner[0] > 0)
        or (y <= MARGIN and corner[1] > 0)
        or (x + width >= columns + MARGIN and corner[0] + columns < shape[1])
        or (y + height >= rows + MARGIN and corner[1] + rows < shape[0])
    )
