"""The organs behind the duct: the liver's lower edge and the gallbladder, smooth and wet.

Drawn in the tissue bed's coordinates, for a span of 50.8 mm.
"""

from functools import cache

import numpy as np

from app.trainer.stage.gltf_asset import Finish, Part, binary_gltf
from app.trainer.stage.solids import Solid, smooth_path, swept_solid, vertex_normals

_LIVER = Finish(color=(86, 34, 26), roughness=0.5, clearcoat=0.35)
_GALLBLADDER = Finish(color=(74, 78, 56), roughness=0.55, clearcoat=0.2)


@cache
def neighbours_glb(*, corners: int = 30) -> bytes:
    """Return liver edge and gallbladder as one GLB file.

    Parameters
    ----------
    corners
        Points around each organ.

    Returns
    -------
    bytes
        The file, mm at a span of 50.8 mm, in the coordinates of the tissue bed.
    """
    return binary_gltf(
        [
            Part(_waved(_liver(corners), amplitude=0.9), _LIVER),
            Part(_waved(_gallbladder(corners), amplitude=0.3), _GALLBLADDER),
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
    """Return the gallbladder: its rounded fundus, beside the duct."""
    path = smooth_path([[-130, 72, 34], [-104, 60, 28], [-80, 50, 21], [-61, 41, 14]], 26)
    along = np.linspace(0.0, 1.0, len(path))
    return swept_solid(
        path,
        np.interp(along, [0.0, 0.3, 0.6, 0.85, 1.0], [13.0, 14.5, 16.0, 16.5, 15.0]),
        corners=corners,
        cap_rings=12,
    )


def _waved(solid: Solid, *, amplitude: float) -> Solid:
    """Return the solid with gentle waves along its normals, mm."""
    x, y, z = (solid.vertices / 15.0).T
    wave = np.sin(1.3 * x + 0.7 * y) + np.sin(1.1 * z - 1.9 * x + 2.0) + np.sin(2.3 * y + 1.1 * x)
    vertices = solid.vertices + amplitude * wave[:, None] * solid.normals
    return Solid(vertices, solid.faces, vertex_normals(vertices, solid.faces))
