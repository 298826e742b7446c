"""The organs behind the duct: the liver's lower edge and the gallbladder, smooth and wet.

In the tissue bed's coordinates, for a span of 50.8 mm.
"""

from functools import cache

import numpy as np

from app.trainer.stage.solids import Piece, Solid, smooth_path, solids_glb, swept_solid
from app.trainer.stage.textures import (
    jpeg_file,
    mixed_color,
    smooth_noise,
    smooth_step,
)
from organ_geometry.mesh import Finish, vertex_normals

_LIVER = ((98, 40, 31), (68, 24, 20), (132, 70, 54))
_GALLBLADDER = ((110, 116, 82), (88, 100, 76), (134, 130, 92))
_VEIN = (96, 44, 34)
_TILE = 46.0  # mm of either organ that its picture covers


@cache
def neighbours_glb(*, corners: int = 30, pixels: int = 256) -> bytes:
    """Return liver edge and gallbladder as one GLB file."""
    return solids_glb(
        [
            Piece(
                _waved(_liver(corners), amplitude=0.9),
                _finish(_LIVER, pixels, seed=41, veins=0.0, roughness=0.44, clearcoat=0.45),
            ),
            Piece(
                _waved(_gallbladder(corners), amplitude=0.35),
                _finish(_GALLBLADDER, pixels, seed=51, veins=0.6, roughness=0.4, clearcoat=0.6),
            ),
        ]
    )


def _liver(corners: int) -> Solid:
    """Return the liver's lower edge: a thick lip across the picture's top."""
    path = smooth_path(
        [[-190, 70, 54], [-90, 64, 47], [-30, 63, 42], [20, 70, 47], [80, 78, 58], [190, 90, 72]],
        56,
    )
    return swept_solid(path, 34.0, 17.0, side=(0.0, 0.8, 0.6), corners=corners)


def _gallbladder(corners: int) -> Solid:
    """Return the gallbladder: a pear that narrows towards the duct's first clamp."""
    path = smooth_path(
        [[-104, 66, 33], [-88, 60, 29], [-70, 51, 23], [-54, 42, 16], [-42, 33, 9], [-36, 25, 4]],
        34,
    )
    along = np.linspace(0.0, 1.0, len(path))
    return swept_solid(
        path,
        np.interp(along, [0.0, 0.15, 0.4, 0.62, 0.8, 0.92, 1.0], [11, 14, 15.5, 13, 7.5, 4.4, 3.6]),
        corners=corners,
        cap_rings=10,
    )


def _finish(
    colors: tuple[tuple[int, int, int], tuple[int, int, int], tuple[int, int, int]],
    pixels: int,
    *,
    seed: int,
    veins: float,
    roughness: float,
    clearcoat: float,
) -> Finish:
    """Return a wet, mottled finish with fine veins."""
    shape = (pixels, pixels)
    broad = smooth_noise(shape, cells=2.0, fall=1.8, seed=seed)
    fine = smooth_noise(shape, cells=9.0, fall=1.2, seed=seed + 1)
    color = mixed_color(colors[0], colors[1], smooth_step(broad, 0.3, 0.75))
    color = mixed_color(color, colors[2], 0.4 * smooth_step(fine, 0.5, 0.85))
    # Veins are the level line of a smooth noise field at its mean.
    field = np.abs(smooth_noise(shape, cells=2.0, fall=2.2, seed=seed + 2) - 0.5)
    color = mixed_color(color, _VEIN, veins * smooth_step(field, 0.012, 0.0))
    return Finish(
        roughness=roughness,
        clearcoat=clearcoat,
        clearcoat_roughness=0.22,
        base_jpeg=jpeg_file(color, quality=72),
    )


def _waved(solid: Solid, *, amplitude: float) -> Solid:
    """Return the solid with gentle waves along its normals, mm."""
    x, y, z = (solid.vertices / 15.0).T
    wave = np.sin(1.3 * x + 0.7 * y) + np.sin(1.1 * z - 1.9 * x + 2.0) + np.sin(2.3 * y + 1.1 * x)
    vertices = solid.vertices + amplitude * wave[:, None] * solid.normals
    # The texture is projected from in front and above, from where it is seen, so it has no seam.
    uv = np.stack([vertices[:, 0], vertices[:, 2] + 0.6 * vertices[:, 1]], axis=-1) / _TILE
    return Solid(vertices, solid.faces, vertex_normals(vertices, solid.faces, welded=True), uv)
