"""Stress as colour: the map cividis over a fixed range, from nothing to the threshold.

Cividis reads the same with and without colour vision deficiency (Nunez, Anderton and Renslow 2018,
doi:10.1371/journal.pone.0199239).
"""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

__all__ = ["color_map", "stress_colors"]


def color_map() -> NDArray[np.uint8]:
    """Return the map."""
    return cv2.applyColorMap(np.arange(256, dtype=np.uint8)[:, None], cv2.COLORMAP_CIVIDIS)[
        :, 0, ::-1
    ].astype(np.uint8)


def stress_colors(distance_to_break: NDArray[np.floating[Any]]) -> NDArray[np.uint8]:
    """Return the colour of a stress."""
    place = 255.0 * np.clip(1.0 - distance_to_break, 0.0, 1.0)
    return color_map()[np.rint(place).astype(np.intp)]
