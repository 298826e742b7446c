"""What runs out of a torn duct: a pool of blood or bile on the tissue bed, with drops beside it."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from app.trainer.stage.appearance import Appearance, Color
from app.trainer.stage.solids import Piece, Solid, grid_faces, solids_glb
from app.trainer.stage.tissue_bed import bed_height
from organ_geometry.mesh import Finish, vertex_normals

_RINGS, _CORNERS = 16, 56
_DROPS = 9
_FILM = 0.08  # mm, how thick it is where it only wets the bed
_BELOW = 0.35  # mm that its edge lies below the bed's surface


@lru_cache(maxsize=16)
def spill_glb(look: Appearance, radius: float, place: float) -> bytes:
    """Return the pools below a tear as a GLB file, in the bed's coordinates; empty if none."""
    random = np.random.default_rng(3)
    pieces: list[Piece] = []
    pools: list[tuple[Color, float, float]] = []  # colour, reach, aside
    if look.spilt is not None:
        pools.append((look.spilt, 1.25 * radius, 0.5 * radius))
    if look.blood is not None:
        pools.append((look.blood, 0.75 * radius, -1.1 * radius))
    for color, reach, aside in pools:
        finish = Finish(color=color, roughness=0.25, clearcoat=1.0, clearcoat_roughness=0.08)
        middle = np.array([place + aside, -0.5 * radius])
        pieces.append(Piece(_pool(middle, reach, random), finish))
        for _ in range(_DROPS):
            offset = random.normal(0.0, 0.9 * radius, 2)
            drop = random.uniform(0.04, 0.11) * radius
            pieces.append(Piece(_pool(middle + offset, drop, random), finish))
    return solids_glb(pieces) if pieces else b""


def _pool(middle: NDArray[np.float64], reach: float, random: np.random.Generator) -> Solid:
    """Return a pool in the bed's hollows: a level surface, ending where the bed is higher."""
    angles = np.linspace(0.0, 2.0 * np.pi, _CORNERS, endpoint=False)
    orders = np.arange(2, 7)
    sizes = random.normal(0.0, 0.07, orders.size)
    phases = random.uniform(0.0, 2.0 * np.pi, orders.size)
    outline = 1.0 + np.cos(np.outer(angles, orders) + phases) @ sizes
    fraction = np.linspace(0.02, 1.0, _RINGS)[:, None]
    x = middle[0] + reach * fraction * outline * np.cos(angles)
    y = middle[1] + 0.75 * reach * fraction * outline * np.sin(angles)
    bed = bed_height(x, y)
    # The film covers what rises above it, and gets thinner towards its edge.
    level = np.quantile(bed, 0.5) + _FILM
    z = np.maximum(level, bed + _FILM) * (1.0 - fraction**6) + (bed - _BELOW) * fraction**6
    vertices = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    faces = grid_faces(_RINGS, _CORNERS, closed=True)[:, ::-1]
    return Solid(vertices, faces, vertex_normals(vertices, faces, welded=True))
