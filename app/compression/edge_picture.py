"""A section's image with the edges that were found drawn over it."""

import math
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from organ_geometry.contours.traced_organ import TracedSection
from organ_geometry.images.image_stack import GreyImage

__all__ = ["LUMEN_COLOR", "OUTER_COLOR", "edge_picture"]

OUTER_COLOR = (230, 159, 0)
"""RGB. Orange and sky blue of Okabe and Ito's palette: apart for the colour-blind, and on grey."""
LUMEN_COLOR = (86, 180, 233)
WIDTH = 480
"""Width of a picture, px, about: a panel's, on a screen with two pixels a point."""
HIGHEST = 720
LINE = 2
_FINE = 4
"""Bits of a pixel's part that are drawn."""


def edge_picture(image: GreyImage, section: TracedSection | None) -> NDArray[np.uint8]:
    """Return a picture of a section.

    Parameters
    ----------
    image
        (H, W) grey levels, stretched to what a screen shows.
    section
        The edges, or None where nothing was found.

    Returns
    -------
    NDArray[np.uint8]
        (h, w, 3) RGB, about `WIDTH` wide but no higher than `HIGHEST`; pixels are square.
    """
    rows, columns = image.shape
    scale = min(WIDTH / columns, HIGHEST / rows)
    size = max(1, round(columns * scale)), max(1, round(rows * scale))
    low, high = float(image.min()), float(image.max())
    level = cv2.convertScaleAbs(image.astype(np.float32) - low, alpha=255.0 / max(high - low, 1.0))
    # Enlarged, a pixel stays one that can be seen; made smaller, it is a mean.
    way = cv2.INTER_NEAREST if scale > 1.0 else cv2.INTER_AREA
    grey: Any = cv2.resize(level, size, interpolation=way)
    picture: NDArray[np.uint8] = np.repeat(grey[:, :, None], 3, axis=2)
    if section is not None:
        factor = np.array([size[0] / columns, size[1] / rows])
        for points, color in ((section.outer, OUTER_COLOR), (section.lumen, LUMEN_COLOR)):
            if points is not None:
                _draw(picture, points, factor, color)
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
