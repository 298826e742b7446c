"""Cutting an organ from a neighbour of the same grey level that its threshold leaks into."""

import math

import cv2
import numpy as np

from organ_geometry.edge_curve import Image
from organ_geometry.section_region import Mask, fill, grown, mask_of, outline_over, without

# How far the edge may move from one section to the next, as a share of the organ's mean radius.
LARGEST_STEP = 0.25
SMALLEST_STEP_PX = 2
# A cut of more than this share of the outline follows a step of the image of at least this share of
# the organ's contrast, or it is made up.
SHORT_CUT = 0.15
SMALLEST_CUT_STEP = 0.08


def cut_region(smoothed: Image, leaked: Mask, last: Mask, contrast: float) -> Mask | None:
    """Return the part of a region that continues the last section.

    Watershed from two markers (Meyer 1991): what lies well inside of the last section is the
    organ's, what lies well outside of it is not, and between them the flood meets at the steepest
    place.

    Parameters
    ----------
    smoothed
        (H, W) blurred levels.
    leaked
        (H, W) 255 in the region that the threshold gives.
    last
        (H, W) 255 in the last section found.
    contrast
        Organ's level less the background's.

    Returns
    -------
    Mask | None
        (H, W) 255 in the organ, or None if the image shows no line to cut along.
    """
    radius = math.sqrt(cv2.countNonZero(last) / math.pi)
    step = max(SMALLEST_STEP_PX, round(LARGEST_STEP * radius))
    inside = (grown(last, -step) > 0) & (leaked > 0)
    outside = (grown(last, step) == 0) | (leaked == 0)
    if not inside.any():
        return None
    markers = np.zeros(last.shape, dtype=np.int32)
    markers[outside] = 1
    markers[inside] = 2
    low, high = float(smoothed.min()), float(smoothed.max())
    grey = ((smoothed - np.float32(low)) * np.float32(255.0 / max(high - low, 1e-6))).astype(
        np.uint8
    )
    cv2.watershed(cv2.merge([grey, grey, grey]), markers)
    outline = outline_over(mask_of(markers == 2), last)
    if outline is None:
        return None
    part = fill(outline, last.shape)
    return part if _has_line(smoothed, part, leaked, contrast) else None


def _has_line(smoothed: Image, part: Mask, leaked: Mask, contrast: float) -> bool:
    """Return whether a cut is short, or runs along a step of the image."""
    rim = without(part, grown(part, -1)) > 0
    cut = rim & (grown(leaked, -2) > 0)
    if int(cut.sum()) <= SHORT_CUT * int(rim.sum()):
        return True
    slope_x = np.asarray(cv2.Sobel(smoothed, cv2.CV_32F, 1, 0, ksize=3, scale=1 / 8))
    slope_y = np.asarray(cv2.Sobel(smoothed, cv2.CV_32F, 0, 1, ksize=3, scale=1 / 8))
    # Across a step blurred by one pixel, levels rise by the step over sqrt(2 pi) a pixel.
    steps = np.asarray(cv2.magnitude(slope_x, slope_y))[cut] * math.sqrt(2.0 * math.pi)
    return float(np.median(steps)) >= SMALLEST_CUT_STEP * contrast
