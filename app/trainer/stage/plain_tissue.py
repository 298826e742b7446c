"""The duct in two colours, for slow machines: one mesh for its wall, one for its inside."""

import numpy as np
import viser
from numpy.typing import NDArray

from organ_geometry.mesh import INSIDE, OUTER_WALL, Skin

__all__ = ["INSIDE", "TISSUE", "PlainTissue"]

TISSUE = OUTER_WALL


class PlainTissue:
    """One surface of the duct on a client's scene.

    Parameters
    ----------
    scene
        Of one client.
    name
        The scene node; the inside's is the same with `_inside`.
    skin
        The surface.
    color
        sRGB of its wall, 0 to 255.
    """

    def __init__(
        self, scene: viser.SceneApi, name: str, skin: Skin, color: tuple[int, int, int] = TISSUE
    ) -> None:
        outer = skin.outer_faces
        # A mesh of its own for the inside: another colour, and a sharp edge along the torn rim.
        self._parts = [
            _drawn(scene, part_name, skin, faces, part_color)
            for part_name, faces, part_color in (
                (name, skin.faces[:outer], color),
                (f"{name}_inside", skin.faces[outer:], INSIDE),
            )
        ]

    @property
    def visible(self) -> bool:
        """Whether it is drawn."""
        return self._parts[0][0].visible

    @visible.setter
    def visible(self, visible: bool) -> None:
        for mesh, _ in self._parts:
            mesh.visible = visible

    def show(self, vertices: NDArray[np.float32], shade: NDArray[np.float32]) -> None:
        """Draw the surface as it is now."""
        del shade
        for mesh, used in self._parts:
            mesh.vertices = vertices[used]

    def remove(self) -> None:
        """Take it off the scene."""
        for mesh, _ in self._parts:
            mesh.remove()


def _drawn(
    scene: viser.SceneApi,
    name: str,
    skin: Skin,
    faces: NDArray[np.int32],
    color: tuple[int, int, int],
) -> tuple[viser.MeshHandle, NDArray[np.int32]]:
    """Return a mesh of some faces and the skin's vertices that it shows."""
    used, renumbered = np.unique(faces, return_inverse=True)
    mesh = scene.add_mesh_simple(
        name,
        skin.vertices[used],
        renumbered.reshape(faces.shape).astype(np.uint32),
        color=color,
        side="double",
        # viser's shadow camera is made for metres: in mm its bias darkens what it lights.
        cast_shadow=False,
        receive_shadow=False,
    )
    return mesh, used
