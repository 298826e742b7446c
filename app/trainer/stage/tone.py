"""Colours as the screen shows them: the map for stress, and the light that is shown as a colour.

three.js (ACESFilmicToneMapping) shows linear light v through Stephen Hill's fit of the ACES
reference and output transforms,
    shown = sRGB(M_out f(M_in e v)),   f(x) = (x (x + a) - b) / (x (c x + d) + g),
with exposure e, so a colour sent as it is comes out paler and darker. Here its inverse is applied
first: f(x) = y is a quadratic equation for x. The curve has no bright colours of full saturation;
those come out paler.
"""

from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from organ_geometry.mesh import color_map, linear_light, srgb_color

_ACES_INPUT = np.array(
    [[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]]
)
_ACES_OUTPUT = np.array(
    [[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]]
)
_RISE, _FLOOR = 0.0245786, 0.000090537
_BEND, _SLOPE, _OFFSET = 0.983729, 0.4329510, 0.238081
_EXPOSURE = 1.0 / 0.6
_TOP_BRIGHTNESS = 0.97  # of cividis's last colour, so that the page can still show it
_MOST = 0.99  # largest value inverted: the curve reaches 1 only at infinite light


def shown_color(light: ArrayLike) -> NDArray[np.float64]:
    """Return the sRGB colours, 0 to 255, as which the page shows linear light."""
    v = _EXPOSURE * np.asarray(light, np.float64) @ _ACES_INPUT.T
    fitted = (v * (v + _RISE) - _FLOOR) / (v * (_BEND * v + _SLOPE) + _OFFSET)
    return srgb_color(np.clip(fitted @ _ACES_OUTPUT.T, 0.0, 1.0))


def light_for(srgb: ArrayLike) -> NDArray[np.float64]:
    """Return the linear light, perhaps above 1, that the page shows as these sRGB colours."""
    shown = np.clip(linear_light(srgb) @ np.linalg.inv(_ACES_OUTPUT).T, 0.0, _MOST)
    square = 1.0 - _BEND * shown
    half = 0.5 * (_RISE - _SLOPE * shown)
    root = np.sqrt(half * half + square * (_FLOOR + _OFFSET * shown))
    light = (root - half) / square @ np.linalg.inv(_ACES_INPUT).T
    return np.maximum(light / _EXPOSURE, 0.0)


@cache
def color_table() -> NDArray[np.uint8]:
    """Return the map's colours as the page can show them."""
    # Cividis, to one of 255 steps, up to nine tenths; beyond, the page's curve can only show a
    # paler, slightly darker yellow.
    table = shown_color(light_table()).round().astype(np.uint8)
    table.setflags(write=False)
    return table


@cache
def light_table() -> NDArray[np.float32]:
    """Return the light that the page shows as the colours of `color_table`."""
    cividis = color_map()
    table = light_for(cividis).astype(np.float32)
    last = int(np.flatnonzero(table.min(axis=1) > 0.0)[-1])
    end = light_for(_TOP_BRIGHTNESS * cividis[-1:])
    table[last:] = np.linspace(table[last], end[0], len(table) - last)
    table.setflags(write=False)
    return table
