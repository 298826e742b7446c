"""The bile-duct phantom: section images drawn from published dimensions, with their true geometry.

``python -m assets.phantom [FOLDER]`` draws the images that ship with the trainer anew.

What is drawn
-------------
A straight hollow duct, bright wall on darker ground around a still darker lumen, cut by 128
parallel planes. It is a drawing, not a scan: no patient or animal was imaged.

- Span 50.8 mm and mean outer diameter 8.89 mm: the thesis's bile duct, half-length 1 inch and
  diameter 0.35 inch (section 6.5, table 6.3). The porcine common bile duct measures alike: 8.6 to
  9.3 mm wide at 0 to 5 kPa (Duch, Andersen and Gregersen 2004, Biomed Eng Online 3:23, PMC493277).
  A healthy human duct is narrower, 4.1 mm on average with a range of 2.0 to 7.9 mm (Lal, Mehra and
  Lal 2014, J Clin Diagn Res 8(12):AC01), so the phantom stands for a porcine or a dilated duct.
- Wall 1.0 mm at the mean calibre: an assumption of the usual order, no measurement. It
  thins where the duct widens and thickens where it narrows, as a wall of constant volume would.
- A waist (5 % narrower, slightly flat) and a bulge (6 % wider, slightly tall) between stretches of
  constant calibre: invented, as an example of how a duct changes and of where sections repeat.
- Edges blurred by a Gaussian point spread, tissue mottle, uneven gain and noise: invented, of the
  order seen in a fair scan (contrast-to-noise about 10).

Frame
-----
A station is the distance from the first clamp along the axis, mm. The axis passes through the
centre of every image, between its four middle pixels; columns run along the first half-axis, rows
along the second.
"""

import json
import math
import sys
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from assets import BILE_DUCT_PHANTOM

SECTION_COUNT = 128
"""Number of images."""
IMAGE_SIZE = 96
"""Rows and columns of an image, pixels."""
PIXEL_SPACING = 0.125
"""Distance between pixel centres, mm."""
SLICE_SPACING = 0.4
"""Distance between neighbouring images, mm."""
SPAN = (SECTION_COUNT - 1) * SLICE_SPACING
"""Distance between the clamps, mm: the thesis's 2 inches."""
MEAN_DIAMETER = 8.89
"""Outer diameter averaged over the span and the two half-axes, mm: the thesis's 0.35 inch."""
# Standard deviation of the blur across an edge, mm.
POINT_SPREAD = 0.15

WALL_GREY = 164.0
BACKGROUND_GREY = 62.0
LUMEN_GREY = 46.0
# Standard deviation of the noise, grey levels.
NOISE_GREY = 10.5

_MEAN_WALL = 1.0
# Station in mm and value there; constant between equal values, a smooth ramp between others.
# The trapezoids of the calibre sum to the span, which keeps the mean diameter.
_CALIBRE = (
    (0.0, 1.0),
    (8.0, 1.0),
    (14.0, 0.95),
    (18.0, 0.95),
    (24.0, 1.0),
    (31.0, 1.0),
    (37.0, 1.06),
    (40.8, 1.06),
    (46.8, 0.9875),
    (50.8, 0.9875),
)
_OVALITY = (
    (0.0, 0.0),
    (8.0, 0.0),
    (14.0, 0.03),
    (18.0, 0.03),
    (24.0, 0.0),
    (31.0, 0.0),
    (37.0, -0.02),
    (40.8, -0.02),
    (46.8, 0.0),
    (50.8, 0.0),
)
_MOTTLE = 0.045
_MOTTLE_WAVES = 32
_MOTTLE_SEED = 1
_NOISE_SEED = 1000
_NOISE_KERNEL = np.array([1.0, 6.0, 1.0]) / 8.0

_erf = np.vectorize(math.erf, otypes=[np.float64])


def outer_half_axes(stations: ArrayLike) -> NDArray[np.float64]:
    """Return the true half-axes of the outer edge, an ellipse about the axis.

    Returns
    -------
    NDArray[np.float64]
        (..., 2) half-axes along the image's columns and rows, mm, at (...) stations, mm;
        constant beyond the clamps.

    Examples
    --------
    >>> outer_half_axes(0.0).tolist()
    [4.445, 4.445]
    """
    radius = 0.5 * MEAN_DIAMETER * _eased(stations, _CALIBRE)
    ovality = _eased(stations, _OVALITY)
    return np.stack([radius * (1.0 + ovality), radius * (1.0 - ovality)], axis=-1)


def wall_thickness(stations: ArrayLike) -> NDArray[np.float64]:
    """Return the true thickness of the wall, the same all around a section."""
    return _MEAN_WALL / _eased(stations, _CALIBRE)


def lumen_half_axes(stations: ArrayLike) -> NDArray[np.float64]:
    """Return the true half-axes of the inner edge, an ellipse about the axis."""
    return outer_half_axes(stations) - wall_thickness(stations)[..., np.newaxis]


def section_image(index: int) -> NDArray[np.uint8]:
    """Return one section as an image, the same at every call."""
    if not 0 <= index < SECTION_COUNT:
        raise ValueError(f"index must be from 0 to {SECTION_COUNT - 1}, got {index}")
    station = index * SLICE_SPACING
    offsets = PIXEL_SPACING * (np.arange(IMAGE_SIZE, dtype=np.float64) - 0.5 * (IMAGE_SIZE - 1))
    across, down = np.meshgrid(offsets, offsets)
    within_outer = _coverage(across, down, outer_half_axes(station))
    within_lumen = _coverage(across, down, lumen_half_axes(station))
    tissue = (
        BACKGROUND_GREY
        + (WALL_GREY - BACKGROUND_GREY) * within_outer
        + (LUMEN_GREY - WALL_GREY) * within_lumen
    )
    gain = _gain(across, down, station)
    # Bile is clear: the mottle of tissue fades inside the lumen.
    mottle = 1.0 + _mottle(across, down, station) * (1.0 - 0.8 * within_lumen)
    grey = tissue * gain * mottle + _noise(index)
    return np.clip(np.rint(grey), 0, 255).astype(np.uint8)


def write_phantom(folder: Path) -> None:
    """Write the images and their ``spacing.json``, replacing those of the same names."""
    folder.mkdir(parents=True, exist_ok=True)
    for index in range(SECTION_COUNT):
        path = folder / f"section_{index:03d}.png"
        if not cv2.imwrite(str(path), section_image(index), [cv2.IMWRITE_PNG_COMPRESSION, 9]):
            raise OSError(f"cannot write the image {path}")
    (folder / "spacing.json").write_text(json.dumps(_spacing(), indent=1) + "\n", encoding="utf-8")


def _spacing() -> dict[str, object]:
    return {
        "organ": "bile-duct phantom: a drawing from published dimensions, not a scan",
        "geometry": "parallel planes across a straight axis, regular spacing",
        "units": "mm",
        "pixel_spacing_mm": [PIXEL_SPACING, PIXEL_SPACING],
        "slice_spacing_mm": SLICE_SPACING,
        "slice_count": SECTION_COUNT,
        "image_size_px": [IMAGE_SIZE, IMAGE_SIZE],
        "explanation": (
            "Bright hollow wall on darker ground, the duct's axis through the centre of every "
            f"image. {SECTION_COUNT - 1} gaps of {SLICE_SPACING} mm make the {SPAN:.1f} mm between "
            f"the clamps; the outer diameter is {MEAN_DIAMETER} mm on average. Drawn by "
            "assets/phantom.py, which knows the true edges and the sources."
        ),
    }


# The table's value at the stations, its ramps with continuous curvature.
def _eased(stations: ArrayLike, table: tuple[tuple[float, float], ...]) -> NDArray[np.float64]:
    knots, values = np.array(table).T
    held = np.clip(np.asarray(stations, dtype=np.float64), knots[0], knots[-1])
    before = np.clip(np.searchsorted(knots, held, side="right") - 1, 0, len(knots) - 2)
    fraction = (held - knots[before]) / (knots[before + 1] - knots[before])
    ease = fraction**3 * (10.0 - 15.0 * fraction + 6.0 * fraction**2)
    return values[before] + (values[before + 1] - values[before]) * ease


# How much of each blurred pixel lies within the ellipse: 0 to 1, and 1/2 on its edge.
def _coverage(
    across: NDArray[np.float64], down: NDArray[np.float64], half_axes: NDArray[np.float64]
) -> NDArray[np.float64]:
    a, b = half_axes
    ratio = np.hypot(across / a, down / b)
    # First-order distance to the edge: (ratio - 1) over the slope of the ratio.
    distance = ratio * (ratio - 1.0) / np.hypot(across / a**2, down / b**2)
    return 0.5 * (1.0 - _erf(distance / (math.sqrt(2.0) * POINT_SPREAD)))


# The uneven brightness: a tilt that turns along the axis, and darker corners.
def _gain(
    across: NDArray[np.float64], down: NDArray[np.float64], station: float
) -> NDArray[np.float64]:
    reach = 0.5 * IMAGE_SIZE * PIXEL_SPACING
    turn = 2.0 * math.pi * station / SPAN
    tilt = (across * math.cos(turn) + down * math.sin(turn)) / reach
    return 1.0 + 0.06 * tilt - 0.05 * ((across**2 + down**2) / reach**2 - 0.5)


# A smooth random field that goes on from image to image, its standard deviation `_MOTTLE`:
# a sum of plane waves of 1.5 to 6 mm in seeded directions.
def _mottle(
    across: NDArray[np.float64], down: NDArray[np.float64], station: float
) -> NDArray[np.float64]:
    uniform = _uniform(_MOTTLE_SEED, 4 * _MOTTLE_WAVES).reshape(4, _MOTTLE_WAVES)
    length = 1.5 + 4.5 * uniform[0]
    along = 2.0 * uniform[1] - 1.0
    turn = 2.0 * math.pi * uniform[2]
    start = 2.0 * math.pi * uniform[3]
    level = np.sqrt(1.0 - along**2)
    direction = np.stack([level * np.cos(turn), level * np.sin(turn), along]) / length
    phase = (
        2.0
        * math.pi
        * (
            across[..., np.newaxis] * direction[0]
            + down[..., np.newaxis] * direction[1]
            + station * direction[2]
        )
    )
    return _MOTTLE * math.sqrt(2.0 / _MOTTLE_WAVES) * np.cos(phase + start).sum(axis=-1)


# An image's noise: Gaussian, a little correlated between neighbouring pixels as in a scan.
def _noise(index: int) -> NDArray[np.float64]:
    first, second = _uniform(_NOISE_SEED + index, 2 * IMAGE_SIZE**2).reshape(2, -1)
    # Box and Muller; 1 - first lies in (0, 1].
    white = np.sqrt(-2.0 * np.log(1.0 - first)) * np.cos(2.0 * math.pi * second)
    smooth = cv2.sepFilter2D(
        white.reshape(IMAGE_SIZE, IMAGE_SIZE), cv2.CV_64F, _NOISE_KERNEL, _NOISE_KERNEL
    )
    return np.asarray(smooth, dtype=np.float64) * (NOISE_GREY / np.sum(_NOISE_KERNEL**2))


# Numbers from 0 to below 1. numpy keeps a bit generator's raw stream for ever, a Generator's not.
def _uniform(seed: int, count: int) -> NDArray[np.float64]:
    raw = np.random.PCG64(seed).random_raw(count)
    return (raw >> np.uint64(11)).astype(np.float64) * 2.0**-53


if __name__ == "__main__":
    write_phantom(Path(sys.argv[1]) if len(sys.argv) > 1 else BILE_DUCT_PHANTOM)
