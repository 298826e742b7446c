"""The tissue bed under the duct: red fascia with lobules of fat, softly out of focus.

Everything is drawn for a span of 50.8 mm about the origin below the duct's middle, and scaled.
One height picture drives the surface, its normals and its colours.
"""

from dataclasses import dataclass
from functools import cache

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

from app.trainer.stage.gltf_asset import Finish, Part, binary_gltf
from app.trainer.stage.solids import Solid, grid_faces, smooth_path, vertex_normals
from app.trainer.stage.textures import (
    Image,
    blurred,
    jpeg_file,
    mixed_color,
    noise_at,
    normal_map,
    smooth_step,
)

REFERENCE_SPAN = 50.8
_ROWS, _COLUMNS, _PIXELS = 64, 70, 896  # of the full look

_HALF_WIDTH, _NEAR, _FAR = 150.0, -220.0, 150.0
_FASCIA, _FASCIA_DEEP, _FASCIA_PALE = (86, 26, 23), (52, 14, 15), (120, 62, 54)
_FAT, _FAT_DEEP = (158, 116, 66), (92, 44, 28)
_VEIN = (44, 12, 22)

# Clusters of fat lobules, kept clear of the duct: middle x, y, reach x, y (mm), lobules.
_CLUSTERS = (
    (-33.0, 22.0, 13.0, 6.0, 70),
    (-50.0, -6.0, 8.0, 8.0, 36),
    (-33.0, -26.0, 9.0, 4.0, 30),
    (15.0, 25.0, 13.0, 5.0, 64),
    (40.0, 15.0, 8.0, 6.0, 40),
    (39.0, -22.0, 9.0, 5.0, 40),
    (60.0, -2.0, 8.0, 10.0, 36),
    (-76.0, 30.0, 16.0, 14.0, 50),
    (70.0, 44.0, 16.0, 12.0, 50),
)
# Veins: knots x, y (mm) and width (mm).
_VEINS = (
    (((-60, 2), (-36, 8), (-16, 5), (4, 12), (24, 9), (46, 26), (70, 30)), 1.5),
    (((-16, 5), (-8, -6), (-12, -20), (-2, -34), (-6, -60)), 1.1),
    (((24, 9), (30, -4), (22, -16), (28, -40)), 0.9),
    (((4, 12), (2, 24), (10, 44)), 0.9),
)


@cache
def tissue_bed_glb(*, rows: int = _ROWS, columns: int = _COLUMNS, pixels: int = _PIXELS) -> bytes:
    """Return the bed as a GLB file.

    Parameters
    ----------
    rows, columns
        Points of the surface.
    pixels
        Width of the textures; below 512 the normal map is left out.

    Returns
    -------
    bytes
        The file, mm at a span of 50.8 mm; z = 0 is the bed's floor below the duct's middle.
    """
    ground = _drawn_ground(pixels)
    surface_x, surface_y, height = _surface(rows, columns, pixels)
    vertices = np.stack([surface_x, surface_y, height], axis=-1).reshape(-1, 3).astype(np.float64)
    faces = grid_faces(rows, columns)
    uv = np.stack(
        np.meshgrid(np.linspace(0.0, 1.0, columns), np.linspace(0.0, 1.0, rows)), axis=-1
    ).reshape(-1, 2)
    solid = Solid(vertices, faces, vertex_normals(vertices, faces), uv)

    color = _bed_color(ground)
    finish = Finish(
        roughness=0.46,
        specular=0.5,
        base_jpeg=jpeg_file(np.flipud(color), quality=78),
        normal_jpeg=_normal_jpeg(ground) if pixels >= 512 else b"",
    )
    return binary_gltf([Part(solid, finish)])


@cache
def bed_surface() -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float32]]:
    """Return the full bed as a grid.

    Returns
    -------
    tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float32]]
        (columns,) x, (rows,) y and (rows, columns) height, mm at a span of 50.8 mm; x and y grow.
    """
    surface_x, surface_y, height = _surface(_ROWS, _COLUMNS, _PIXELS)
    return (
        surface_x[0].astype(np.float64),
        surface_y[:, 0].astype(np.float64),
        np.ascontiguousarray(height),
    )


@numba.njit(cache=True)
def height_at(
    x: float,
    y: float,
    bed_x: NDArray[np.float64],
    bed_y: NDArray[np.float64],
    bed_z: NDArray[np.float32],
) -> float:
    """Return the height of the full bed at a place, linear between the points of its grid.

    Parameters
    ----------
    x, y
        The place, mm at a span of 50.8 mm; one beyond the bed counts as on its edge.
    bed_x, bed_y, bed_z
        As `bed_surface` gives them.

    Returns
    -------
    float
        The height, mm.
    """
    left = min(max(np.searchsorted(bed_x, x, side="right") - 1, 0), len(bed_x) - 2)
    near = min(max(np.searchsorted(bed_y, y, side="right") - 1, 0), len(bed_y) - 2)
    u = min(max((x - bed_x[left]) / (bed_x[left + 1] - bed_x[left]), 0.0), 1.0)
    v = min(max((y - bed_y[near]) / (bed_y[near + 1] - bed_y[near]), 0.0), 1.0)
    return (
        (1.0 - v) * ((1.0 - u) * bed_z[near, left] + u * bed_z[near, left + 1])
        + v * ((1.0 - u) * bed_z[near + 1, left] + u * bed_z[near + 1, left + 1])
    )  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class _Ground:
    """Pictures of the bed, all (H, W): places, mm, what lies there, 0 to 1, and the relief, mm."""

    x: Image
    y: Image
    lobules: Image
    grain: Image
    veins: Image
    coarse: Image
    fine: Image
    folds: Image
    relief: Image


@cache
def _drawn_ground(pixels: int) -> _Ground:
    shape = (round(pixels * 0.85), pixels)
    x, y = _ground(shape)
    lobules, grain = _lobules(x, y)
    veins = _veins(x, y)
    coarse = noise_at(x, y, length=130.0, cells=3.0, fall=2.0, seed=11)
    fine = noise_at(x, y, length=90.0, cells=7.0, fall=1.4, seed=12)
    # Folds of fascia: ridges where a smooth field passes its middle.
    folds = 1.0 - np.abs(2.0 * noise_at(x, y, length=120.0, cells=4.0, fall=2.4, seed=13) - 1.0)
    folds = smooth_step(folds.astype(np.float32), 0.72, 1.0)
    relief = (
        3.0 * (coarse - 0.5) + 1.1 * (fine - 0.5) + 1.0 * folds + 1.9 * lobules + 0.8 * veins
    ).astype(np.float32)
    return _Ground(x, y, lobules, grain, veins, coarse, fine, folds, relief)


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


def _lobules(x: Image, y: Image) -> tuple[Image, Image]:
    """Return how thick the fat is, 0 to 1, and a shade of its own for each lobule."""
    random = np.random.default_rng(5)
    thickness, shade = np.zeros_like(x), np.full_like(x, 0.5)
    for middle_x, middle_y, reach_x, reach_y, count in _CLUSTERS:
        for _ in range(count):
            offset = random.normal(0.0, 0.5, 2)
            size = random.uniform(1.3, 3.2) * (1.0 - 0.25 * min(1.0, float(np.hypot(*offset))))
            stretch = random.uniform(0.75, 1.3)
            tint = random.uniform(0.0, 1.0)
            place = (middle_x + reach_x * offset[0], middle_y + reach_y * offset[1])
            columns = np.flatnonzero(np.abs(x[0] - place[0]) < size * stretch)
            rows = np.flatnonzero(np.abs(y[:, 0] - place[1]) < size)
            if not len(rows) or not len(columns):
                continue
            window = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
            squared = ((x[window] - place[0]) / (size * stretch)) ** 2 + (
                (y[window] - place[1]) / size
            ) ** 2
            dome = np.sqrt(np.clip(1.0 - squared, 0.0, 1.0)) * (0.5 + 0.14 * size)
            higher = dome > thickness[window]
            thickness[window] = np.where(higher, dome, thickness[window])
            shade[window] = np.where(higher, tint, shade[window])
    return np.clip(thickness, 0.0, 1.0).astype(np.float32), shade


def _veins(x: Image, y: Image) -> Image:
    """Return the veins, 1 along their middles."""
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
    return blurred(picture.astype(np.float32) / 255.0, columns / 400.0)


def _bed_color(ground: _Ground) -> Image:
    """Return the bed's colours, darker in the groove and softer away from the duct."""
    x, y, lobules, veins = ground.x, ground.y, ground.lobules, ground.veins
    grain, coarse, fine, folds = ground.grain, ground.coarse, ground.fine, ground.folds
    color = mixed_color(_FASCIA, _FASCIA_DEEP, smooth_step(coarse, 0.35, 0.75))
    color = mixed_color(color, _FASCIA_PALE, 0.35 * smooth_step(fine, 0.5, 0.85))
    color = mixed_color(color, _FASCIA_PALE, 0.45 * folds)
    color = mixed_color(color, _VEIN, 0.7 * veins)
    fat = mixed_color(_FAT_DEEP, _FAT, smooth_step(lobules, 0.25, 0.85))
    fat = mixed_color(fat, _FASCIA, 0.10 + 0.35 * grain)
    color = mixed_color(color, fat, smooth_step(lobules, 0.06, 0.38))
    shade = 1.0 - 0.25 * np.exp(-((y / 9.0) ** 2) - (x / 34.0) ** 4)
    shade = shade * (1.0 - 0.75 * smooth_step(y, -36.0, -130.0))
    color = color * shade[..., None].astype(np.float32)
    # Out of focus: the farther from the duct's plane, the softer.
    pixels = x.shape[1]
    soft, softer = blurred(color, pixels / 420.0), blurred(color, pixels / 130.0)
    away = np.hypot(y / 1.0, x / 2.2)
    return mixed_color(soft, softer, smooth_step(away.astype(np.float32), 14.0, 48.0))


def _normal_jpeg(ground: _Ground) -> bytes:
    """Return the part of the relief that the surface is too coarse for, as a normal map."""
    x, y, pixels = ground.x, ground.y, ground.x.shape[1]
    # A pixel far away covers more ground, so the same height is a gentler slope there.
    covered = np.hypot(np.gradient(x, axis=1), np.gradient(y, axis=0))
    relief = (ground.relief * (covered.min() / covered)).astype(np.float32)
    detail = blurred(relief, pixels / 420.0) - blurred(relief, pixels / 110.0)
    detail = detail * (1.0 - 0.6 * smooth_step(np.abs(y), 15.0, 55.0))
    picture = normal_map(np.flipud(detail).astype(np.float32), 5.0)
    half = cv2.resize(picture, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    return jpeg_file(half.astype(np.float32), quality=80)
