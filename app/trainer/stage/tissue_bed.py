"""The tissue bed under the duct: red fascia with lobules of fat, softly out of focus.

All of it is made for a span of 50.8 mm about the origin below the duct's middle, and scaled. One
relief, the height over a large smooth basin, gives the surface, its normals and its colours. It is
a weighted sum of
    noise at two scales        swelling of the fascia
    lobules of fat             Worley noise: domes about scattered points, in clusters
    fibres                     noise stretched across the groove, where there is no fat
    veins, capillaries         strokes along given knots; level lines of noise.
The grid is denser near the duct, where the camera looks.
"""

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from app.trainer.stage.solids import Piece, Solid, grid_faces, smooth_path, solids_glb
from app.trainer.stage.textures import (
    Image,
    blurred,
    jpeg_file,
    mixed_color,
    noise_at,
    normal_map,
    smooth_step,
)
from organ_geometry.mesh import Finish, vertex_normals

REFERENCE_SPAN = 50.8
_ROWS, COLUMNS, _PIXELS = 64, 70, 1152  # of the full look
PLAIN_COLUMNS = 36

_HALF_WIDTH, _NEAR, _FAR = 150.0, -220.0, 150.0
_FASCIA, _FASCIA_DEEP, _FASCIA_PALE = (122, 52, 44), (84, 28, 26), (170, 106, 90)
_FAT, _FAT_DEEP, _FAT_PALE = (164, 118, 72), (128, 76, 48), (190, 150, 104)
_VEIN, _CAPILLARY = (62, 16, 26), (112, 22, 22)
_LOBULE = 3.4  # mm, the size of a lobule of fat

# Veins: knots x, y (mm) and width (mm).
_VEINS = (
    (((-60, 2), (-36, 8), (-16, 5), (4, 12), (24, 9), (46, 26), (70, 30)), 1.5),
    (((-16, 5), (-8, -6), (-12, -20), (-2, -34), (-6, -60)), 1.1),
    (((24, 9), (30, -4), (22, -16), (28, -40)), 0.9),
    (((4, 12), (2, 24), (10, 44)), 0.9),
)


@cache
def tissue_bed_glb(*, rows: int = _ROWS, columns: int = COLUMNS, pixels: int = _PIXELS) -> bytes:
    """Return the bed as a GLB file."""
    ground = _drawn_ground(pixels)
    surface_x, surface_y, height = _surface(rows, columns, pixels)
    vertices = np.stack([surface_x, surface_y, height], axis=-1).reshape(-1, 3).astype(np.float64)
    faces = grid_faces(rows, columns)
    uv = np.stack(
        np.meshgrid(np.linspace(0.0, 1.0, columns), np.linspace(0.0, 1.0, rows)), axis=-1
    ).reshape(-1, 2)
    solid = Solid(vertices, faces, vertex_normals(vertices, faces, welded=True), uv)

    color = _bed_color(ground)
    finish = Finish(
        roughness=0.58,
        specular=0.45,
        clearcoat=0.22,
        clearcoat_roughness=0.3,
        base_jpeg=jpeg_file(np.flipud(color), quality=74),
        normal_jpeg=_normal_jpeg(ground) if pixels >= 512 else b"",
    )
    return solids_glb([Piece(solid, finish)])


def bed_height(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the height of the full bed at places."""
    surface_x, surface_y, height = _surface(_ROWS, COLUMNS, _PIXELS)
    columns, rows = np.arange(COLUMNS, dtype=np.float64), np.arange(_ROWS, dtype=np.float64)
    column = np.interp(x, surface_x[0].astype(np.float64), columns).astype(np.float32)
    row = np.interp(y, surface_y[:, 0].astype(np.float64), rows).astype(np.float32)
    return cv2.remap(height, column, row, cv2.INTER_LINEAR).astype(np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class _Ground:
    """Pictures of the bed, (H, W): places, mm; what lies there, 0 to 1; and the relief, mm."""

    x: Image
    y: Image
    fat: Image
    dome: Image
    tint: Image
    veins: Image
    capillaries: Image
    coarse: Image
    fine: Image
    fibres: Image
    relief: Image


@cache
def _drawn_ground(pixels: int) -> _Ground:
    shape = (round(pixels * 0.85), pixels)
    x, y = _ground(shape)
    coarse = noise_at(x, y, length=130.0, cells=3.0, fall=2.0, seed=11)
    fine = noise_at(x, y, length=60.0, cells=6.0, fall=1.7, seed=12)
    # Lobules of fat are in clusters, with few of them in the groove below the duct.
    bent = 2.4 * (noise_at(x, y, length=40.0, cells=5.0, fall=2.2, seed=18) - 0.5)
    slant = 2.4 * (noise_at(x, y, length=40.0, cells=5.0, fall=2.2, seed=19) - 0.5)
    dome, tint = _lobules(_shifted(x, bent), _shifted(y, slant), _LOBULE, seed=5)
    small, small_tint = _lobules(_shifted(x, slant), _shifted(y, bent), 0.5 * _LOBULE, seed=6)
    wanted = noise_at(x, y, length=120.0, cells=3.0, fall=2.2, seed=17)
    wanted = wanted + 0.10 * smooth_step(np.abs(y), 5.0, 16.0) + 0.05 * (tint - 0.5)
    fat = smooth_step((wanted + 0.07 * (dome - 0.5)).astype(np.float32), 0.55, 0.67)
    dome = (0.7 * dome + 0.3 * small).astype(np.float32)
    tint = (0.6 * tint + 0.4 * small_tint).astype(np.float32)
    veins = _veins(x, y)
    capillaries = _capillaries(x, y)
    # Sheets of fascia are drawn out into fibres across the groove.
    fibres = noise_at(x, 0.3 * y, length=26.0, cells=4.0, fall=1.7, seed=13)
    relief = (
        2.6 * (coarse - 0.5) + 0.5 * (fine - 0.5) + 1.5 * fat * (0.3 + dome)
        + 0.16 * (1.0 - fat) * (fibres - 0.5) + 0.7 * veins + 0.10 * capillaries
    ).astype(np.float32)  # fmt: skip
    return _Ground(x, y, fat, dome, tint, veins, capillaries, coarse, fine, fibres, relief)


@cache
def _surface(rows: int, columns: int, pixels: int) -> tuple[Image, Image, Image]:
    """Return x, y and height of the surface's points, (rows, columns) mm."""
    relief = blurred(_drawn_ground(pixels).relief, pixels / 180.0)
    surface_relief = cv2.resize(relief, (columns, rows), interpolation=cv2.INTER_AREA)
    surface_x, surface_y = _ground((rows, columns))
    height = _basin(surface_x, surface_y) + surface_relief
    return surface_x, surface_y, height.astype(np.float32)


def _ground(shape: tuple[int, int]) -> tuple[Image, Image]:
    """Return x and y of each pixel or point, mm, closer together near the duct."""
    rows, columns = shape
    across = np.linspace(-1.0, 1.0, columns)
    along = np.linspace(-1.0, 1.0, rows)
    x = _HALF_WIDTH * (0.45 * across + 0.55 * across**3)
    middle = 0.5 * (_NEAR + _FAR)
    y = middle + 0.5 * (_FAR - _NEAR) * (0.35 * along + 0.65 * along**3)
    y -= middle * (1.0 - along**2)  # the densest rows lie under the duct
    grid = np.meshgrid(x, y)
    return grid[0].astype(np.float32), grid[1].astype(np.float32)


def _basin(x: Image, y: Image) -> Image:
    """Return the bed's large shape: a groove below the duct, rising to all sides."""
    groove = -2.6 * np.exp(-((y / 13.0) ** 2) - (x / 46.0) ** 2)
    back = 26.0 * smooth_step(y, 14.0, 95.0)
    front = 9.0 * smooth_step(y, -16.0, -80.0)
    sides = 20.0 * smooth_step(np.abs(x), 34.0, 130.0)
    return (groove + back + front + sides).astype(np.float32)


def _shifted(place: Image, shift: NDArray[np.floating]) -> Image:
    return (place + shift).astype(np.float32)


def _lobules(x: Image, y: Image, size: float, *, seed: int) -> tuple[Image, Image]:
    """Return lobules packed side by side: their domes, 0 at their edges, and a shade for each."""
    # Each pixel belongs to the nearest of scattered centres [Worley 1996].
    random = np.random.default_rng(seed)
    cells = 64
    offsets, shades = random.random((2, cells, cells)), random.random((cells, cells))
    column, row = np.floor(x / size).astype(int), np.floor(y / size).astype(int)
    nearest, second = np.full(x.shape, np.inf), np.full(x.shape, np.inf)
    shade = np.zeros(x.shape)
    for step_x in (-1, 0, 1):
        for step_y in (-1, 0, 1):
            i, j = (column + step_x) % cells, (row + step_y) % cells
            apart = np.hypot(
                x / size - (column + step_x + offsets[0][i, j]),
                y / size - (row + step_y + offsets[1][i, j]),
            )
            closer = apart < nearest
            second = np.where(closer, nearest, np.minimum(second, apart))
            shade = np.where(closer, shades[i, j], shade)
            nearest = np.where(closer, apart, nearest)
    # Round on top, and rounded where two of them meet.
    high = np.clip(1.15 * (second - nearest), 0.0, 1.0)
    return np.sqrt(high * (2.0 - high)).astype(np.float32), shade.astype(np.float32)


def _capillaries(x: Image, y: Image) -> Image:
    """Return a net of fine vessels: level lines of smooth noise at its mean, with gaps."""
    lines = [
        smooth_step(
            np.abs(noise_at(x, y, length=length, cells=5.0, fall=2.4, seed=seed) - 0.5),
            0.035,
            0.008,
        )
        for length, seed in ((60.0, 61), (36.0, 62))
    ]
    shown = smooth_step(noise_at(x, y, length=70.0, cells=4.0, fall=2.0, seed=63), 0.42, 0.62)
    return (np.maximum(lines[0], 0.7 * lines[1]) * shown).astype(np.float32)


def _veins(x: Image, y: Image) -> Image:
    rows, columns = x.shape
    picture = np.zeros(x.shape, np.uint8)
    for knots, width in _VEINS:
        flat = [[x_mm, y_mm, 0.0] for x_mm, y_mm in knots]
        curve = smooth_path(flat, 80)
        column = np.interp(curve[:, 0], x[0], np.arange(columns, dtype=np.float64))
        row = np.interp(curve[:, 1], y[:, 0], np.arange(rows, dtype=np.float64))
        pixel = float(np.diff(x[0]).min())
        cv2.polylines(
            picture,
            [np.stack([column, row], axis=-1).round().astype(np.int32)],
            isClosed=False,
            color=255,
            thickness=max(1, round(width / pixel)),
            lineType=cv2.LINE_AA,
        )
    return blurred(picture.astype(np.float32) / 255.0, columns / 700.0)


def _bed_color(ground: _Ground) -> Image:
    """Return the bed's colours, darker in the groove and softer away from the duct."""
    x, y, fat, dome = ground.x, ground.y, ground.fat, ground.dome
    color = mixed_color(_FASCIA, _FASCIA_DEEP, smooth_step(ground.coarse, 0.35, 0.75))
    color = mixed_color(color, _FASCIA_PALE, 0.55 * smooth_step(ground.fine, 0.45, 0.8))
    color = mixed_color(color, _FASCIA_PALE, 0.25 * smooth_step(ground.fibres, 0.5, 0.8))
    color = mixed_color(color, _CAPILLARY, 0.6 * ground.capillaries)
    lobes = mixed_color(_FAT_DEEP, _FAT, smooth_step(dome, 0.05, 0.85))
    lobes = mixed_color(lobes, _FAT_PALE, 0.6 * ground.tint * smooth_step(dome, 0.3, 1.0))
    lobes = mixed_color(lobes, _FASCIA, 0.4 * smooth_step(ground.fine, 0.45, 0.8))
    lobes = mixed_color(lobes, _FASCIA_DEEP, 0.35 * smooth_step(ground.coarse, 0.45, 0.8))
    lobes = mixed_color(lobes, _CAPILLARY, 0.35 * ground.capillaries)
    color = mixed_color(color, lobes, fat)
    color = mixed_color(color, _VEIN, 0.75 * ground.veins)
    shade = 1.0 - 0.3 * np.exp(-((y / 9.0) ** 2) - (x / 34.0) ** 4)
    shade = shade * (1.0 - 0.72 * smooth_step(y, -34.0, -120.0))
    shade = shade * (1.0 - 0.45 * smooth_step(np.abs(x), 40.0, 120.0))
    color = color * shade[..., None].astype(np.float32)
    # Out of focus only far from the duct's plane, as with a small aperture.
    pixels = x.shape[1]
    softer = blurred(color, pixels / 240.0)
    away = np.hypot(y / 1.0, x / 2.2)
    return mixed_color(color, softer, smooth_step(away.astype(np.float32), 26.0, 80.0))


def _normal_jpeg(ground: _Ground) -> bytes:
    """Return the part of the relief that the surface is too coarse for, as a normal map."""
    x, y, pixels = ground.x, ground.y, ground.x.shape[1]
    # A pixel far away covers more ground, so the same height is a gentler slope there.
    covered = np.hypot(np.gradient(x, axis=1), np.gradient(y, axis=0))
    relief = (ground.relief * (covered.min() / covered)).astype(np.float32)
    detail = blurred(relief, pixels / 900.0) - blurred(relief, pixels / 90.0)
    detail = detail * (1.0 - 0.6 * smooth_step(np.abs(y), 15.0, 55.0))
    picture = normal_map(np.flipud(detail).astype(np.float32), 4.0)
    half = cv2.resize(picture, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    return jpeg_file(half.astype(np.float32), quality=80)
