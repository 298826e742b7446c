"""Colours: sRGB and linear light, the colours of an organ's walls, and the map for stress.

Files and screens name colours in sRGB (IEC 61966-2-1), 0 to 255; light adds up, and glTF takes
factors, in linear light. Stress is shown by cividis, which is even in lightness and reads the same
with and without colour vision deficiency (Nunez, Anderton and Renslow 2018,
doi:10.1371/journal.pone.0199239).
"""

from functools import cache
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

Color: TypeAlias = tuple[int, int, int]
"""sRGB, 0 to 255."""

OUTER_WALL: Color = (192, 124, 80)
INSIDE: Color = (138, 48, 40)
"""Of the lumen and of torn tissue."""
COLOR_MAP = "cividis"

_TOE_SLOPE, _TOE_END = 12.92, 0.04045  # of the curve's straight part near black, in sRGB


def linear_light(srgb: ArrayLike) -> NDArray[np.float64]:
    """Return sRGB colours, 0 to 255, as linear light, 0 to 1; (0, 255, 188) is (0, 1, 0.5)."""
    value = np.asarray(srgb, np.float64) / 255.0
    return np.where(value <= _TOE_END, value / _TOE_SLOPE, ((value + 0.055) / 1.055) ** 2.4)


def srgb_color(light: ArrayLike) -> NDArray[np.float64]:
    """Return linear light, 0 to 1, as sRGB colours, 0 to 255; the inverse of `linear_light`."""
    value = np.asarray(light, np.float64)
    toe = value <= _TOE_END / _TOE_SLOPE
    return 255.0 * np.where(toe, _TOE_SLOPE * value, 1.055 * value ** (1.0 / 2.4) - 0.055)


@cache
def color_map() -> NDArray[np.uint8]:
    """Return (256, 3) sRGB colours, from no stress to the threshold."""
    import cv2  # here: a quarter of a second that only a map of stress needs

    levels = np.arange(256, dtype=np.uint8)[:, None]
    table = cv2.applyColorMap(levels, cv2.COLORMAP_CIVIDIS)[:, 0, ::-1].astype(np.uint8)
    table.setflags(write=False)
    return table


def stress_colors(distance_to_break: NDArray[np.floating[Any]]) -> NDArray[np.uint8]:
    """Return (V, 3) sRGB colours of (V,) distances to break, 1 without stress, 0 at the break."""
    place = 255.0 * np.clip(1.0 - distance_to_break, 0.0, 1.0)
    return color_map()[np.rint(place).astype(np.intp)]
