"""The edge of an organ in one cross-section image, found to a fraction of a pixel.

From a region found to a pixel (`section_region`) by one of two methods: on the half level between
organ and background, which is where an ideal edge lies whatever the blur; or, as in the thesis,
where Canny's detector links the steepest places to a closed line. Both are then refined in
`edge_curve`. A blurred thin wall has its half levels pulled apart by its other edge; then less blur
is used, as much as the wall's thickness allows.
"""

import math
from collections.abc import Iterable
from typing import TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from organ_geometry.contours.edge_curve import (
    SQUARE,
    Image,
    NoEdgeFound,
    Scale,
    blurred,
    curve_length,
    enclosed_area,
    level_curve,
    steepest_curve,
)
from organ_geometry.contours.section_region import (
    MARGIN,
    SMOOTHING_PX,
    Mask,
    Outline,
    Region,
    grown,
    main_outline,
    mask_of,
    otsu,
    outline_of,
    outline_over,
    with_margin,
)
from organ_geometry.contours.trace_options import EdgeMethod, FoundPolarity
from organ_geometry.images.grey_image import GreyImage

BORDER_PROBLEM = "the organ touches the image's border"

# Two edges nearer than this many sigmas pull each other's half level away.
CLEAR_WALL = 3.0
# Less blur than this does not smooth between pixels.
SMALLEST_SMOOTHING_PX = 0.5
# Canny's high threshold, as a share of the steepest gradient of an ideal edge, and low over high.
CANNY_HIGH = 0.5
CANNY_LOW = 0.4
# How far from the half level Canny's edge may run, px.
CANNY_REACH_PX = 3

# A pixel's longer side over the mean of both, beyond which blur does not follow it.
LARGEST_STRETCH = 3.0

_GREY_TYPES = frozenset({np.dtype(np.uint8), np.dtype(np.uint16)})


def find_polarity(images: Iterable[GreyImage]) -> FoundPolarity:
    """Return whether the organ is brighter or darker than the background of its images."""
    # In each image the rim of the largest thing that differs from the image's border is compared
    # with the border; images with more contrast count more. Some may show no organ; "bright" if
    # nothing differs anywhere.
    balance = 0.0
    for image in images:
        padded = with_margin(as_grey(image))
        rise = blurred(padded, SMOOTHING_PX) - padded[0, 0]
        height = np.abs(rise)
        outline, _ = main_outline(mask_of(height > otsu(height)))
        if outline is not None:
            balance += float(np.median(rise[outline[:, 1], outline[:, 0]]))
    return "bright" if balance >= 0.0 else "dark"


def region_edges(
    bright: Image,
    region: Region,
    *,
    method: EdgeMethod = "half-level",
    scale: Scale = SQUARE,
) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
    """Return the edges of a region found to a pixel, to a part of a pixel.

    Parameters
    ----------
    bright, region
        (H, W) levels with a margin, in which the organ is bright, and where it is in them.
    method, scale
        How the edge is defined; width and height of a pixel, in pixels of mean size.

    Returns
    -------
    tuple[NDArray[np.float64], NDArray[np.float64] | None]
        (N, 2) outer boundary and (M, 2) lumen's or None, px of `bright`.

    Raises
    ------
    NoEdgeFound
        If the edge does not close.
    """
    trace = _half_level if method == "half-level" else _canny
    outer, lumen = trace(bright, region, region.sigma, scale)
    if lumen is not None:
        thickness = _wall_thickness(outer * scale, lumen * scale)
        if thickness < CLEAR_WALL * region.sigma:
            sigma = max(thickness / CLEAR_WALL, SMALLEST_SMOOTHING_PX)
            outer, lumen = trace(bright, region, sigma, scale)
    return outer, lumen


def as_grey(image: GreyImage) -> Image:
    """Return an image (H, W) as 32 bit grey levels, checked."""
    grey = np.asarray(image)
    if grey.ndim != 2 or grey.size == 0 or grey.dtype not in _GREY_TYPES:
        raise ValueError(
            f"image must be (H, W) grey levels of 8 or 16 bit, "
            f"not {grey.dtype} of shape {grey.shape}"
        )
    return grey.astype(np.float32)


def pixel_scale(pixel_size: tuple[float, float]) -> Scale:
    """Return a pixel's width and height over their geometric mean, within reason."""
    wide = math.sqrt(pixel_size[0] / pixel_size[1])
    wide = min(max(wide, 1.0 / LARGEST_STRETCH), LARGEST_STRETCH)
    return wide, 1.0 / wide


def touches_border(filled: Mask) -> bool:
    """Return whether a region of an image with a margin reaches the image's outermost pixels."""
    inner = filled[MARGIN + 1 : -MARGIN - 1, MARGIN + 1 : -MARGIN - 1]
    return cv2.countNonZero(filled) > cv2.countNonZero(inner)


_Edges: TypeAlias = tuple[NDArray[np.float64], NDArray[np.float64] | None]


def _half_level(bright: Image, region: Region, sigma: float, scale: Scale) -> _Edges:
    """Return outer and lumen boundary on the half levels of the image blurred by sigma."""
    smoothed = blurred(bright, sigma, scale)
    around = grown(region.filled, 2)
    start = outline_over(mask_of((smoothed > region.outer_level) & (around > 0)), region.filled)
    if start is None:
        raise NoEdgeFound("the organ's edge is not closed")
    outer = level_curve(smoothed, start, region.outer_level, sigma, scale)
    if region.lumen is None:
        return outer, None
    inside = grown(region.filled, -1) > 0
    start = outline_over(mask_of((smoothed < region.lumen_level) & inside), region.lumen)
    if start is None:
        return outer, None
    return outer, level_curve(smoothed, start, region.lumen_level, sigma, scale)


def _canny(bright: Image, region: Region, sigma: float, scale: Scale) -> _Edges:
    """Return outer and lumen boundary where Canny links steep places to a closed edge."""
    smoothed = blurred(bright, sigma, scale)
    slope_x = np.asarray(cv2.Sobel(smoothed, cv2.CV_32F, 1, 0, ksize=3, scale=1 / 8))
    slope_y = np.asarray(cv2.Sobel(smoothed, cv2.CV_32F, 0, 1, ksize=3, scale=1 / 8))
    # Across an ideal edge the blurred level rises by contrast / (sigma sqrt(2 pi)) a pixel.
    high = CANNY_HIGH * region.contrast / (sigma * math.sqrt(2.0 * math.pi))
    unit = 1000.0 / max(high, 1e-6)
    edges = cv2.Canny(
        np.clip(slope_x * unit, -32768, 32767).astype(np.int16),
        np.clip(slope_y * unit, -32768, 32767).astype(np.int16),
        CANNY_LOW * 1000.0,
        1000.0,
        L2gradient=True,
    )
    lines = np.asarray(edges, dtype=np.uint8)
    outer = steepest_curve(smoothed, _closed_within(lines, region.filled, "organ"), sigma, scale)
    if region.lumen is None:
        return outer, None
    start = _closed_within(lines, region.lumen, "lumen")
    return outer, steepest_curve(smoothed, start, sigma, scale)


def _closed_within(lines: Mask, region: Mask, name: str) -> Outline:
    """Return the closed line (N, 2) of edge pixels along a region's boundary."""
    # Only lines near the boundary count: what lies deeper inside is texture.
    inner, outer = grown(region, -CANNY_REACH_PX), grown(region, CANNY_REACH_PX)
    if cv2.countNonZero(inner) == 0:
        inner = grown(region, -1)
    open_ground = mask_of(((lines == 0) & (outer > 0)) | (inner > 0))
    _, labels = cv2.connectedComponents(open_ground, connectivity=4)
    labels = np.asarray(labels)
    counts = np.bincount(labels[inner > 0], minlength=1)
    counts[0] = 0
    label = int(counts.argmax())
    within = labels == label
    rim = _rim(outer)
    if counts[label] == 0 or bool((within & (rim > 0)).any()):
        raise NoEdgeFound(f"Canny's edge of the {name} does not close")
    closed = np.asarray(cv2.dilate(mask_of(within), np.ones((3, 3), np.uint8)), dtype=np.uint8)
    start = outline_of(mask_of(within | ((closed > 0) & (lines > 0))))
    if start is None:
        raise NoEdgeFound(f"Canny's edge of the {name} does not close")
    return start


def _rim(mask: Mask) -> Mask:
    return np.asarray(cv2.subtract(mask, grown(mask, -1)), dtype=np.uint8)


def _wall_thickness(outer: NDArray[np.float64], lumen: NDArray[np.float64]) -> float:
    """Return the mean distance between two boundaries, px."""
    wall = max(0.0, enclosed_area(outer) - enclosed_area(lumen))
    return wall / (0.5 * (curve_length(outer) + curve_length(lumen)))
