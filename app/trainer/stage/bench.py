"""The bench under a rubber rod: a cutting mat with a grid of centimetres.

In the tissue bed's coordinates, for a span of 50.8 mm.
"""

from functools import cache

import numpy as np

from app.trainer.stage.solids import Piece, Solid, grid_faces, solids_glb
from app.trainer.stage.textures import jpeg_file, mixed_color, smooth_noise
from organ_geometry.mesh import Finish, vertex_normals

_HALF_WIDTH, _NEAR, _FAR = 150.0, -220.0, 150.0
_MAT, _LINE = (38, 74, 72), (96, 138, 130)
_CENTIMETRE = 256  # pixels of the picture, which repeats


@cache
def bench_glb() -> bytes:
    """Return the bench as a GLB file."""
    x, y = np.meshgrid(np.linspace(-_HALF_WIDTH, _HALF_WIDTH, 9), np.linspace(_NEAR, _FAR, 9))
    vertices = np.stack([x, y, 0.0 * x], axis=-1).reshape(-1, 3)
    faces = grid_faces(9, 9)
    solid = Solid(
        vertices, faces, vertex_normals(vertices, faces, welded=True), vertices[:, :2] / 10.0
    )
    # A line every five millimetres; those of whole centimetres are wider.
    place = np.linspace(0.0, 1.0, _CENTIMETRE, endpoint=False)
    thick = np.minimum(place, 1.0 - place) < 0.012
    thin = np.abs(place - 0.5) < 0.006
    lines = np.maximum(1.0 * thick, 0.5 * thin)
    grid = np.maximum(lines[:, None], lines[None]).astype(np.float32)
    color = mixed_color(_MAT, _LINE, grid)
    grain = smooth_noise((_CENTIMETRE, _CENTIMETRE), cells=24.0, fall=0.4, seed=71)
    color = color * (0.92 + 0.16 * grain)[..., None]
    finish = Finish(
        roughness=0.75, base_jpeg=jpeg_file(color.astype(np.float32), quality=80), specular=0.4
    )
    return solids_glb([Piece(solid, finish)])
