"""The edge of an organ in one cross-section image, found to a fraction of a pixel."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from organ_geometry.image_stack import GreyImage

Polarity: TypeAlias = Literal["auto", "bright", "dark"]
FoundPolarity: TypeAlias = Literal["bright", "dark"]

_Image: TypeAlias = NDArray[np.float32]
_Mask: TypeAlias = NDArray[np.uint8]

# Halves the noise of single mask pixels; wider blur would merge the two edges of a thin wall.
SMOOTHING_PX = 1.5
# Two edges nearer than this many sigmas pull each other's half level away.
CLEAR_WALL = 3.0
SMALLEST_SMOOTHING_PX = 0.5
FINE_SMOOTHING_PX = 0.75

# In noise alone, the largest speck stands out by up to 1.7 / sigma times the noise of a pixel.
CLEAR_CONTRAST = 2.0
SMALLEST_ORGAN_PX = 12.0
# Grey levels are whole numbers; what is left of less than this is rounding of the blur.
SMALLEST_CONTRAST = 1e-2
SMALLEST_LUMEN_SHARE = 0.05
# A lumen differs from its wall by at least this share of what the wall differs from outside.
LUMEN_CONTRAST = 0.3

_GREY_TYPES = frozenset({np.dtype(np.uint8), np.dtype(np.uint16)})
_MARGIN = 8
_RING_GAP = 3
_RING_WIDTH = 5
_NEWTON_STEPS = 4
_LARGEST_MOVE_PX = 1.5
# Standard deviation of normal noise over its median absolute deviation.
_MAD_TO_DEVIATION = 1.4826


class NoEdgeFound(ValueError):  # noqa: N818
    """An image in which no organ stands out from its background."""


@dataclass(frozen=True, slots=True, eq=False)
class SectionEdges:
    """The boundaries of an organ in one image.

    Attributes
    ----------
    outer
        (N, 2) points x = column, y = row of the outer boundary, px; pixel centres are integers and
        the last point joins the first.
    lumen
        (M, 2) points of the lumen's boundary, px, or None if the organ is solid here.
    threshold
        Grey level of the outer boundary, half way between organ and background.
    polarity
        Whether the organ is brighter or darker than its background.
    touches_border
        Whether the organ reaches the image's outermost pixels, so that part of it may be missing
        or what was found is the background.
    other_part
        Area of the largest other part that stands out as clearly, as a share of the organ's.
    """

    outer: NDArray[np.float64]
    lumen: NDArray[np.float64] | None
    threshold: float
    polarity: FoundPolarity
    touches_border: bool
    other_part: float


def find_edges(image: GreyImage, polarity: Polarity = "auto") -> SectionEdges:
    """Return the boundaries of the organ in an image.

    The background is what the image's border shows; the organ is the largest thing near the middle
    that differs from it. An edge is where the slightly blurred image passes half way between the
    levels on both sides, moved back by what the blur moves a curved edge.

    Parameters
    ----------
    image
        (H, W) grey levels or a mask.
    polarity
        Whether the organ is brighter or darker than its background; "auto" decides.

    Returns
    -------
    SectionEdges
        The outer boundary, and the lumen's if there is one.

    Raises
    ------
    NoEdgeFound
        If nothing stands out from the background.
    ValueError
        If the image is not one of grey levels or the polarity is unknown.
    """
    grey = _as_grey(image)
    if polarity not in {"auto", "bright", "dark"}:
        raise ValueError(f"polarity must be auto, bright or dark, not {polarity!r}")
    found: FoundPolarity
    found = find_polarity([image]) if polarity == "auto" else polarity
    sign = 1.0 if found == "bright" else -1.0
    bright = _with_margin(grey * np.float32(sign))

    smoothing = SMOOTHING_PX
    try:
        regions = _find_regions(bright, smoothing)
    except NoEdgeFound:
        # The wall of a fine ring may drown in the blur that takes the noise away.
        smoothing = FINE_SMOOTHING_PX
        regions = _find_regions(bright, smoothing)
    outer, lumen = _trace(bright, regions, smoothing)
    if lumen is not None:
        thickness = _wall_thickness(outer, lumen)
        if thickness < CLEAR_WALL * smoothing:
            smoothing = max(thickness / CLEAR_WALL, SMALLEST_SMOOTHING_PX)
            outer, lumen = _trace(bright, regions, smoothing)
    return SectionEdges(
        outer=outer - _MARGIN,
        lumen=None if lumen is None else lumen - _MARGIN,
        threshold=sign * regions.outer_level,
        polarity=found,
        touches_border=_touches_border(regions.filled),
        other_part=regions.other_part,
    )


def find_polarity(images: Iterable[GreyImage]) -> FoundPolarity:
    """Return whether the organ is brighter or darker than the background of its images.

    In each image, the rim of the largest thing that differs from the image's border is compared
    with the border; images with more contrast count more.

    Parameters
    ----------
    images
        (H, W) grey levels each; an organ need not be in all of them.

    Returns
    -------
    FoundPolarity
        "bright" or "dark"; "bright" if nothing differs anywhere.
    """
    balance = 0.0
    for image in images:
        padded = _with_margin(_as_grey(image))
        smoothed = _blurred(padded, SMOOTHING_PX)
        rise = smoothed - np.float32(padded[0, 0])
        outline, _ = _main_outline(_mask(np.abs(rise) > _otsu(np.abs(rise))))
        if outline is None:
            continue
        rim = rise[outline[:, 1], outline[:, 0]]
        balance += float(np.median(rim))
    return "bright" if balance >= 0.0 else "dark"


@dataclass(frozen=True, slots=True, eq=False)
class _Regions:
    """Where organ and lumen are to a pixel, and the levels of their edges.

    Attributes
    ----------
    filled
        (H, W) 255 in the organ and its lumen, 0 outside.
    outer_level
        Half way between organ and background.
    lumen
        (H, W) 255 in the lumen, or None.
    lumen_level
        Half way between organ and lumen.
    other_part
        Area of the largest component beside the organ, as a share of the organ's.
    """

    filled: _Mask
    outer_level: float
    lumen: _Mask | None
    lumen_level: float
    other_part: float


def _as_grey(image: GreyImage) -> _Image:
    """Return an image as 32 bit grey levels, checked."""
    grey = np.asarray(image)
    if grey.ndim != 2 or grey.size == 0 or grey.dtype not in _GREY_TYPES:
        raise ValueError(
            f"image must be (H, W) grey levels of 8 or 16 bit, "
            f"not {grey.dtype} of shape {grey.shape}"
        )
    return grey.astype(np.float32)


def _with_margin(grey: _Image) -> _Image:
    """Return the image in a frame of its background, so that blur and contours meet no border."""
    border = np.concatenate([grey[0], grey[-1], grey[:, 0], grey[:, -1]])
    return np.pad(grey, _MARGIN, constant_values=np.float32(np.median(border)))


def _blurred(grey: _Image, sigma: float) -> _Image:
    size = 2 * math.ceil(4.0 * sigma) + 1
    return np.asarray(cv2.GaussianBlur(grey, (size, size), sigma), dtype=np.float32)


def _mask(where: NDArray[np.bool_]) -> _Mask:
    return where.astype(np.uint8) * np.uint8(255)


def _otsu(values: _Image) -> float:
    """Return the level that best splits the values into two classes (Otsu)."""
    low, high = float(values.min()), float(values.max())
    if high - low < SMALLEST_CONTRAST:
        return high
    scaled = ((values - low) * (255.0 / (high - low))).astype(np.uint8)
    level, _ = cv2.threshold(scaled, 0.0, 255.0, cv2.THRESH_BINARY | cv2.THRESH_OTSU)
    return low + (level + 0.5) * (high - low) / 255.0


def _main_outline(mask: _Mask) -> tuple[NDArray[np.int32] | None, float]:
    """Return the (N, 2) outline pixels x, y of the largest component near the middle, or None."""
    # Beside it comes the area of the largest other component, as a share of its own.
    outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    middle = 0.5 * np.array([mask.shape[1] - 1.0, mask.shape[0] - 1.0])
    best_score, best, best_area = 0.0, None, math.inf
    areas = [cv2.contourArea(outline) for outline in outlines]
    for outline, area in zip(outlines, areas, strict=True):
        if area < SMALLEST_ORGAN_PX:
            continue
        pixels = np.asarray(outline, dtype=np.int32)[:, 0]
        away = (pixels.mean(axis=0) - middle) / middle
        score = area / (1.0 + float(away @ away))
        if score > best_score:
            best_score, best, best_area = score, pixels, area
    if best is not None:
        areas.remove(best_area)
    return best, max(areas, default=0.0) / best_area


def _fill(outline: NDArray[np.int32], shape: tuple[int, ...]) -> _Mask:
    filled = np.zeros(shape, dtype=np.uint8)
    cv2.drawContours(filled, [outline[:, np.newaxis]], -1, 255, cv2.FILLED)
    return filled


def _grown(mask: _Mask, pixels: int) -> _Mask:
    """Return the mask widened by a number of pixels, or narrowed if negative."""
    size = 2 * abs(pixels) + 1
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    change = cv2.dilate if pixels > 0 else cv2.erode
    return np.asarray(change(mask, kernel), dtype=np.uint8)


def _find_regions(bright: _Image, sigma: float) -> _Regions:
    """Return the organ's regions in an image with a margin in which the organ is bright."""
    smoothed = _blurred(bright, sigma)
    border_level = float(bright[0, 0])
    # A lumen darker than the background must not draw Otsu's split to itself.
    above = np.maximum(smoothed, np.float32(border_level))
    outline, _ = _main_outline(_mask(smoothed > _otsu(above)))
    if outline is None:
        raise NoEdgeFound("nothing stands out from the image's background")
    filled = _fill(outline, bright.shape)
    outside = _level_around(bright, filled)

    wall_top = float(np.quantile(smoothed[filled > 0], 0.9))
    seed = _hole(smoothed, filled, wall_top - LUMEN_CONTRAST * (wall_top - outside))
    solid = filled if seed is None else cv2.bitwise_and(filled, cv2.bitwise_not(seed))
    organ = _inner_level(bright, np.asarray(solid, dtype=np.uint8))
    noise = _noise(bright, smoothed)
    if not organ - outside > CLEAR_CONTRAST / sigma * noise:
        raise NoEdgeFound(
            f"what stands out from the background differs by {organ - outside:.3g} grey levels, "
            f"not clearly more than the noise of {noise:.3g}"
        )
    outer_level = 0.5 * (organ + outside)
    outline, other_part = _main_outline(_mask(smoothed > outer_level))
    if outline is None:
        raise NoEdgeFound(f"the organ is smaller than {SMALLEST_ORGAN_PX:g} pixels")
    filled = _fill(outline, bright.shape)
    if seed is None:
        return _Regions(filled, outer_level, None, math.nan, other_part)
    inside = _inner_level(bright, seed)
    if organ - inside < LUMEN_CONTRAST * (organ - outside):
        return _Regions(filled, outer_level, None, math.nan, other_part)
    lumen_level = 0.5 * (organ + inside)
    return _Regions(filled, outer_level, seed, lumen_level, other_part)


def _touches_border(filled: _Mask) -> bool:
    """Return whether a region of an image with a margin reaches the image's outermost pixels."""
    inner = slice(_MARGIN + 1, -_MARGIN - 1)
    return bool(np.count_nonzero(filled) > np.count_nonzero(filled[inner, inner]))


def _level_around(bright: _Image, filled: _Mask) -> float:
    """Return the background's level in a ring around a region, clear of its blurred rim."""
    near = _grown(filled, _RING_GAP)
    ring = (_grown(near, _RING_WIDTH) > 0) & (near == 0)
    return float(np.median(bright[ring]))


def _noise(bright: _Image, smoothed: _Image) -> float:
    """Return the standard deviation of the noise of single pixels, outside of the margin."""
    inner = slice(_MARGIN, -_MARGIN)
    rest = np.abs(bright[inner, inner] - smoothed[inner, inner])
    return _MAD_TO_DEVIATION * float(np.median(rest))


def _inner_level(bright: _Image, region: _Mask) -> float:
    """Return the level inside a region, away from its blurred rim where it is wide enough."""
    core = _grown(region, -1) > 0
    values = bright[core] if int(core.sum()) >= SMALLEST_ORGAN_PX else bright[region > 0]
    return float(np.median(values))


def _hole(smoothed: _Image, filled: _Mask, level: float) -> _Mask | None:
    """Return the largest hole below a level that the organ closes in, or None."""
    below = _mask((smoothed <= level) | (filled == 0))
    _, labels, stats, _ = cv2.connectedComponentsWithStats(below, connectivity=4)
    areas = np.asarray(stats)[:, cv2.CC_STAT_AREA].copy()
    labels = np.asarray(labels)
    # Neither the organ itself (label 0) nor what is joined to the outside is a hole.
    areas[0] = 0
    areas[labels[0, 0]] = 0
    largest = int(areas.argmax())
    if areas[largest] < SMALLEST_LUMEN_SHARE * np.count_nonzero(filled):
        return None
    return _mask(labels == largest)


def _trace(
    bright: _Image, regions: _Regions, sigma: float
) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
    """Return the outer and lumen boundaries, px, traced in the image blurred by sigma px."""
    smoothed = _blurred(bright, sigma)
    around = _grown(regions.filled, 2) > 0
    start = _outline_over(_mask((smoothed > regions.outer_level) & around), regions.filled)
    if start is None:
        raise NoEdgeFound("the organ's edge is not closed")
    outer = _refined(smoothed, start, regions.outer_level, sigma)
    if regions.lumen is None:
        return outer, None
    inside = _grown(regions.filled, -1) > 0
    start = _outline_over(_mask((smoothed < regions.lumen_level) & inside), regions.lumen)
    if start is None:
        return outer, None
    return outer, _refined(smoothed, start, regions.lumen_level, sigma)


def _outline_over(mask: _Mask, region: _Mask) -> NDArray[np.int32] | None:
    """Return the (N, 2) outline pixels of the component that covers most of a region."""
    _, labels = cv2.connectedComponents(mask, connectivity=8)
    labels = np.asarray(labels)
    counts = np.bincount(labels[region > 0])
    counts[0] = 0
    label = int(counts.argmax())
    if counts[label] == 0:
        return None
    outlines, _ = cv2.findContours(_mask(labels == label), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    longest = max(outlines, key=len)
    return np.asarray(longest, dtype=np.int32)[:, 0]


def _refined(
    smoothed: _Image, start: NDArray[np.int32], level: float, sigma: float
) -> NDArray[np.float64]:
    """Return an outline of pixels, moved onto a level of the blurred image to sub-pixels."""
    # Newton's method along the gradient, until the linearly interpolated image has the level.
    slope_x = np.asarray(cv2.Sobel(smoothed, cv2.CV_32F, 1, 0, ksize=3, scale=1 / 8), np.float32)
    slope_y = np.asarray(cv2.Sobel(smoothed, cv2.CV_32F, 0, 1, ksize=3, scale=1 / 8), np.float32)
    points = start.astype(np.float64)
    for _ in range(_NEWTON_STEPS):
        gradient = np.stack([_sampled(slope_x, points), _sampled(slope_y, points)], axis=1)
        squared = np.maximum((gradient * gradient).sum(axis=1), 1e-12)
        move = ((level - _sampled(smoothed, points)) / squared)[:, np.newaxis] * gradient
        length = np.maximum(np.linalg.norm(move, axis=1, keepdims=True), 1e-12)
        points = points + move * np.minimum(1.0, 1.0 / length)
    found = np.linalg.norm(points - start, axis=1) <= _LARGEST_MOVE_PX
    points = points[found]
    if len(points) < 3:
        raise NoEdgeFound("the organ's edge is too short to follow")
    return _unshrunk(points, sigma)


def _sampled(image: _Image, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the (N,) linearly interpolated values of an image at points x, y, px."""
    rows, columns = image.shape
    x = np.clip(points[:, 0], 0.0, columns - 1.001)
    y = np.clip(points[:, 1], 0.0, rows - 1.001)
    column, row = x.astype(np.intp), y.astype(np.intp)
    right, down = x - column, y - row
    upper = image[row, column] * (1.0 - right) + image[row, column + 1] * right
    lower = image[row + 1, column] * (1.0 - right) + image[row + 1, column + 1] * right
    return upper * (1.0 - down) + lower * down


def _unshrunk(points: NDArray[np.float64], sigma: float) -> NDArray[np.float64]:
    """Return a contour moved away from its centres of curvature by sigma^2 / (2 R)."""
    # Blur moves the half level of an edge of radius R by that much towards the centre. Curvature is
    # the turn between chords to points a few pixels off, which noise of single points hardly moves.
    reach = min(round(2.0 * sigma) + 2, len(points) // 4)
    if reach < 1:
        return points
    back = points - np.roll(points, reach, axis=0)
    ahead = np.roll(points, -reach, axis=0) - points
    along = back + ahead
    cross = back[:, 0] * ahead[:, 1] - back[:, 1] * ahead[:, 0]
    turn = np.arctan2(cross, (back * ahead).sum(axis=1))
    length = 0.5 * (np.linalg.norm(back, axis=1) + np.linalg.norm(ahead, axis=1))
    curvature = np.clip(turn / np.maximum(length, 1e-6), -0.5 / sigma, 0.5 / sigma)
    normal = np.stack([along[:, 1], -along[:, 0]], axis=1)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    return points + 0.5 * sigma**2 * curvature[:, np.newaxis] * normal


def _wall_thickness(outer: NDArray[np.float64], lumen: NDArray[np.float64]) -> float:
    """Return the mean distance between two boundaries, px."""
    areas: list[float] = []
    lengths: list[float] = []
    for boundary in (outer, lumen):
        after = np.roll(boundary, -1, axis=0)
        cross = boundary[:, 0] * after[:, 1] - boundary[:, 1] * after[:, 0]
        areas.append(0.5 * abs(float(cross.sum())))
        lengths.append(float(np.linalg.norm(after - boundary, axis=1).sum()))
    return max(0.0, areas[0] - areas[1]) / (0.5 * sum(lengths))
