"""Textures of a duct's wall: its colours and its fine relief, periodic along and around it.

Columns run along the duct and rows around it. Features have their widths in mm whatever the duct's
radius, so that a thin duct shows fewer of them, and larger beside it, as in reality. The vessels
are random walks: a trunk keeps its course but winds about it, and branches into ever thinner twigs.
Capillaries are level lines of smooth noise; fibres are noise stretched along the duct.
"""

import itertools
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from app.trainer.stage.appearance import Appearance, Color
from app.trainer.stage.textures import (
    Image,
    blurred,
    jpeg_file,
    mixed_color,
    normal_map,
    smooth_step,
)

PERIOD = 12.0
"""Length of the axis that the pictures cover before they repeat, in radii."""
_COLUMNS, _ROWS = 2048, 1024
_RELIEF = 0.8
_STEP = 0.12  # mm along a vessel
_TWIGS = 4  # of each trunk


@dataclass(frozen=True, slots=True)
class WallTexture:
    """Textures of a wall, as JPEG files."""

    base: bytes  # colours
    normals: bytes  # in tangent space


@lru_cache(maxsize=8)  # a few ducts; trainees can build any number
def wall_texture(look: Appearance, radius: float) -> WallTexture:
    """Return the textures of a duct's wall, periodic over `PERIOD` radii and once around it."""
    grain = _Grain(radius)
    broad, patches, speckle = grain(9.0, 5.0, 31), grain(4.0, 3.0, 32), grain(0.9, 0.9, 34)
    # Bundles of fibres run along the duct, wavy where the wall is slack.
    fibres = grain(5.0, 0.35, 35)
    strands = smooth_step(np.abs(grain(7.0, 0.8, 36) - 0.5).astype(np.float32), 0.06, 0.0)
    network = _network(grain)
    fat = smooth_step(grain(3.2, 2.4, 33), 0.62, 0.8) * smooth_step(broad, 0.4, 0.7)

    color = mixed_color(look.base, look.deep, 0.8 * smooth_step(broad, 0.35, 0.75))
    color = mixed_color(color, look.flushed, 0.5 * smooth_step(patches, 0.5, 0.85))
    color = mixed_color(color, look.pale, look.fibres * 0.3 * smooth_step(fibres, 0.45, 0.85))
    color = mixed_color(color, look.pale, look.fibres * 0.3 * strands)
    color = mixed_color(color, look.flushed, 0.7 * look.capillaries * network)
    color = mixed_color(color, look.pale, look.fibres * 0.5 * fat)
    depth, breadth = _vessels(look, radius)
    # A vessel shows through the wall: a wide, faint band with a dark core.
    halo = blurred(np.pad(breadth, 24, mode="wrap"), 5.0)[24:-24, 24:-24]
    color = mixed_color(color, look.flushed, 0.45 * halo)
    color = mixed_color(color, look.vessel, 0.8 * depth)
    color = color * (0.955 + 0.09 * speckle)[..., None]

    height = (
        0.6 * (fibres - 0.5) * look.fibres + 0.5 * (speckle - 0.5)
        + 1.5 * (patches - 0.5) + 0.35 * strands * look.fibres + 0.9 * fat * look.fibres
        + 0.8 * breadth
    )  # fmt: skip
    half = (_COLUMNS // 2, _ROWS // 2)
    small = cv2.resize(height.astype(np.float32), half, interpolation=cv2.INTER_AREA)
    # Rows go down in a picture, and around the duct against the direction of glTF's green channel.
    padded = np.pad(small, 4, mode="wrap").astype(np.float32)
    relief = normal_map(padded, _RELIEF * _pixels_per_mm(radius) / 18.0)
    return WallTexture(
        jpeg_file(color.astype(np.float32), quality=82),
        jpeg_file(np.ascontiguousarray(relief[4:-4, 4:-4]), quality=84),
    )


def _pixels_per_mm(radius: float) -> float:
    return _COLUMNS / (PERIOD * radius)


class _Grain:
    """Periodic noise on the wall with the same scale in mm along and around it."""

    def __init__(self, radius: float) -> None:
        self._along = np.fft.rfftfreq(_COLUMNS // 2, PERIOD * radius / (_COLUMNS // 2))
        self._around = np.fft.fftfreq(_ROWS // 2, 2.0 * np.pi * radius / (_ROWS // 2))

    def __call__(self, along: float, around: float, seed: int) -> Image:
        """Return noise about 0.5 with waves down to these lengths, mm, along and around."""
        shape = (_ROWS // 2, _COLUMNS // 2)
        spectrum = np.fft.rfft2(np.random.default_rng(seed).standard_normal(shape))
        reach = np.hypot(self._along[None] * along, self._around[:, None] * around)
        noise = np.fft.irfft2(spectrum * np.exp(-0.5 * reach**2) / (0.6 + reach), shape)
        noise = np.clip(0.5 + (noise - noise.mean()) / (5.0 * noise.std()), 0.0, 1.0)
        wide = cv2.resize(
            np.pad(noise.astype(np.float32), 2, mode="wrap"), None, fx=2.0, fy=2.0,
            interpolation=cv2.INTER_CUBIC,
        )  # fmt: skip
        return wide[4:-4, 4:-4].astype(np.float32)


def _network(grain: _Grain) -> Image:
    """Return the capillaries: thin level lines of smooth noise at its mean, with gaps."""
    lines = [
        smooth_step(np.abs(grain(size, size, seed) - 0.5).astype(np.float32), 0.03, 0.004)
        for size, seed in ((2.6, 41), (1.5, 42))
    ]
    shown = smooth_step(grain(4.0, 4.0, 43), 0.4, 0.65)
    return (np.maximum(lines[0], 0.7 * lines[1]) * shown).astype(np.float32)


def _vessels(look: Appearance, radius: float) -> tuple[Image, Image]:
    """Return the share of the vessels' colour and their relief, both 0 to 1."""
    core = np.zeros((_ROWS, _COLUMNS), np.uint8)
    wide = np.zeros_like(core)
    scale = _pixels_per_mm(radius), _ROWS / (2.0 * np.pi * radius)
    for points, widths in _paths(look, radius):
        pixels = points * scale
        # Drawn nine times, so that the picture is periodic both ways.
        for shift in itertools.product((-_COLUMNS, 0, _COLUMNS), (-_ROWS, 0, _ROWS)):
            shifted = pixels + np.array(shift)
            _stroke(wide, shifted, 1.15 * widths * scale[0])
            _stroke(core, shifted, 0.8 * widths * scale[0])
    soft = blurred(core.astype(np.float32) / 255.0, 0.9)
    return soft, blurred(wide.astype(np.float32) / 255.0, 1.6)


def _stroke(
    picture: NDArray[np.uint8], pixels: NDArray[np.float64], widths: NDArray[np.float64]
) -> None:
    """Draw a line of varying width with round ends, in place."""
    rows, columns = picture.shape
    low, high = pixels.min(axis=0) - widths.max(), pixels.max(axis=0) + widths.max()
    if high[0] < 0.0 or high[1] < 0.0 or low[0] > columns or low[1] > rows:
        return
    # Discs so close that the line's thinnest part is not a row of dots.
    steps: NDArray[np.float64] = np.linalg.norm(np.diff(pixels, axis=0), axis=1)
    arc = np.concatenate([np.zeros(1), np.cumsum(steps, dtype=np.float64)])
    dense = np.linspace(0.0, float(arc[-1]), max(2, round(1.6 * float(arc[-1]))))
    columns_at, rows_at = np.interp(dense, arc, pixels[:, 0]), np.interp(dense, arc, pixels[:, 1])
    widths_at = np.interp(dense, arc, widths)
    for x, y, width in zip(columns_at, rows_at, widths_at, strict=True):
        cv2.circle(
            picture, (round(16.0 * x), round(16.0 * y)), max(1, round(8.0 * width)), 255,
            thickness=-1, lineType=cv2.LINE_AA, shift=4,
        )  # fmt: skip


def _paths(
    look: Appearance, radius: float
) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Return each vessel as (N, 2) places along and around the duct and (N,) widths, mm."""
    random = np.random.default_rng(8)
    length, girth = PERIOD * radius, 2.0 * np.pi * radius
    paths: list[tuple[NDArray[np.float64], NDArray[np.float64]]] = []

    def wander(start: NDArray[np.float64], heading: float, count: int) -> NDArray[np.float64]:
        # A random walk of the heading, with its drift taken out so that the course is kept, plus a
        # regular winding.
        turns = np.cumsum(random.normal(0.0, 0.055, count))
        turns -= np.linspace(0.0, 1.0, count) * turns[-1]
        turns += 0.28 * np.sin(np.arange(count) * _STEP / random.uniform(0.7, 1.3))
        direction = heading + turns
        steps = _STEP * np.stack([np.cos(direction), np.sin(direction)], axis=-1)
        return start + np.cumsum(steps, axis=0)

    def branch(
        points: NDArray[np.float64], widths: NDArray[np.float64], count: int, depth: int
    ) -> None:
        for _ in range(count):
            joint = int(random.uniform(0.05, 0.85) * len(points))
            after = min(joint + 4, len(points) - 1)
            course = points[after] - points[joint - 1]
            heading = float(np.arctan2(course[1], course[0]))
            heading += random.choice([-1.0, 1.0]) * random.uniform(0.5, 1.0)
            reach = int(random.uniform(2.0, 6.0) / _STEP / (1.0 + 0.6 * depth))
            twig = wander(points[joint], heading, reach)
            first = widths[joint] * random.uniform(0.45, 0.65)
            thin = first * np.linspace(1.0, 0.25, reach) ** 0.8
            paths.append((twig, thin))
            if depth < 2:
                branch(twig, thin, 1, depth + 1)

    for number in range(look.vessels):
        start = np.array(
            [
                random.uniform(0.0, length),
                girth * (number + random.uniform(-0.3, 0.3)) / look.vessels,
            ]
        )
        count = int(random.uniform(0.4, 0.8) * length / _STEP)
        trunk = wander(start, random.normal(0.0, 0.12), count)
        widest = look.vessel_width * random.uniform(0.55, 1.0)
        along = np.linspace(0.0, 1.0, count)
        # Thin at its start and end, where it comes out of the wall and goes into it again.
        widths = widest * np.minimum(1.0, 6.0 * along + 0.25) * (1.0 - 0.8 * along**2)
        paths.append((trunk, widths))
        branch(trunk, widths, _TWIGS, 0)
    return paths


def mean_color(look: Appearance) -> Color:
    """Return the mean colour of a kind of duct, sRGB, 0 to 255."""
    mixed = 0.6 * np.array(look.base) + 0.25 * np.array(look.deep) + 0.15 * np.array(look.pale)
    red, green, blue = mixed.round().astype(int).tolist()
    return red, green, blue
