"""A section's image with the edges that were found drawn over it."""

import math
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from organ_geometry import GreyImage, Region, TracedSection

OUTER_COLOR = (230, 159, 0)
"""RGB. Orange and sky blue of Okabe and Ito's palette: apart for the colour-blind, and on grey."""
LUMEN_COLOR = (86, 180, 233)
WIDTH = 480
"""Width of a picture, px, about: a panel's, on a screen with two pixels a point."""
HIGHEST = 720
LINE = 2
# RGB, yellow of the same palette.
SEED_COLOR = (240, 228, 66)
CROSS = 22
# By how much what is beyond the region is darker.
BEYOND = 3
# Bits of a pixel's part that are drawn.
_FINE = 4


def edge_picture(
    image: GreyImage,
    section: TracedSection | None,
    *,
    region: Region | None = None,
    inside: bool = True,
    seed: tuple[float, float] | None = None,
) -> NDArray[np.uint8]:
    """Return a picture of a section."""
    rows, columns = image.shape
    scale = min(WIDTH / columns, HIGHEST / rows)
    size = max(1, round(columns * scale)), max(1, round(rows * scale))
    low, high = float(image.min()), float(image.max())
    level = cv2.convertScaleAbs(image.astype(np.float32) - low, alpha=255.0 / max(high - low, 1.0))
    # Enlarged, a pixel stays one that can be seen; made smaller, it is a mean.
    kind = cv2.INTER_NEAREST if scale > 1.0 else cv2.INTER_AREA
    grey: Any = cv2.resize(level, size, interpolation=kind)
    picture: NDArray[np.uint8] = np.repeat(grey[:, :, None], 3, axis=2)
    factor = np.array([size[0] / columns, size[1] / rows])
    if region is not None:
        left, top = np.floor(np.array(region[:2]) * factor).astype(int)
        right, bottom = np.ceil((np.array(region[2:4]) + 1) * factor).astype(int)
        looked_at = np.zeros(picture.shape[:2], np.bool_)
        looked_at[top:bottom, left:right] = inside
        picture[~looked_at] = picture[~looked_at] // BEYOND
    if section is not None:
        for points, color in ((section.outer, OUTER_COLOR), (section.lumen, LUMEN_COLOR)):
            if points is not None:
                _draw(picture, points, factor, color)
    if seed is not None:
        x, y = np.round((np.array(seed) + 0.5) * factor).astype(int).tolist()
        for color, width in ((0, 0, 0), LINE + 2), (SEED_COLOR, LINE):
            cv2.drawMarker(picture, (x, y), color, cv2.MARKER_CROSS, CROSS, width, cv2.LINE_AA)
    return picture


def _draw(
    picture: Any,
    points: NDArray[np.float64],
    factor: NDArray[np.float64],
    color: tuple[int, int, int],
) -> None:
    # A pixel's centre is an integer in both pictures.
    placed = (points + 0.5) * factor - 0.5
    fixed = np.round(placed * math.ldexp(1.0, _FINE)).astype(np.int32)
    cv2.polylines(picture, [fixed], True, color, LINE, cv2.LINE_AA, _FINE)
