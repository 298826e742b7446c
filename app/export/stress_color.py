"""Stress as colour: the map cividis over a fixed range, from nothing to the threshold.

Cividis reads the same with and without colour vision deficiency (Nunez, Anderton and Renslow 2018,
doi:10.1371/journal.pone.0199239).
"""

import numpy as np
from numpy.typing import NDArray

__all__ = ["stress_colors"]

_CIVIDIS = np.array(
    [
        [0, 0, 34, 78],
        [17, 0, 46, 108],
        [22, 0, 49, 113],
        [28, 18, 53, 112],
        [35, 32, 58, 111],
        [53, 56, 71, 108],
        [86, 88, 94, 109],
        [125, 122, 122, 120],
        [152, 147, 142, 120],
        [175, 170, 160, 115],
        [203, 199, 183, 103],
        [234, 233, 211, 78],
        [246, 247, 222, 62],
        [251, 253, 227, 52],
        [255, 254, 232, 56],
    ]
)
"""Places in the map, 0 to 255, and sRGB there; what is straight between is off by two at most."""


def stress_colors(distance_to_break: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Return the colour of a stress.

    Parameters
    ----------
    distance_to_break
        (V,) 1 without stress, which is dark blue, to 0 at the threshold, which is yellow; what
        is pressed together has the colour of no stress.

    Returns
    -------
    NDArray[np.uint8]
        (V, 3) sRGB, 0 to 255.
    """
    place = np.clip(1.0 - distance_to_break, 0.0, 1.0)
    steps = _CIVIDIS[:, 0] / 255.0
    channels = [np.interp(place, steps, _CIVIDIS[:, channel]) for channel in (1, 2, 3)]
    return np.rint(np.stack(channels, axis=1)).astype(np.uint8)
