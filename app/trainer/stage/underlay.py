"""A plain mesh just below a streamed one, for the frame that a page draws without it.

A page that is busy may draw a frame between one GLB file and the next. viser's simple meshes are
updated in place and never missing, so that what is seen then is a duct without gloss, not a hole.
"""

import numba
import numpy as np
import viser
from numpy.typing import NDArray

from app.trainer.stage.wall import Wall

__all__ = ["Underlay", "sink_wall"]

DEPTH = 0.12
"""mm below the streamed surface."""


class Underlay:
    """The plain mesh below one wall.

    Parameters
    ----------
    scene
        Of one client.
    name
        The scene node.
    wall
        The wall.
    color
        sRGB, 0 to 255.
    """

    def __init__(
        self, scene: viser.SceneApi, name: str, wall: Wall, color: tuple[int, int, int]
    ) -> None:
        skin = wall.skin
        self._places = skin.vertices[: wall.count].copy()
        self._mesh = scene.add_mesh_simple(
            name,
            self._places,
            skin.faces[: skin.outer_faces].astype(np.uint32),
            color=color,
            side="front",
            cast_shadow=False,
            receive_shadow=False,
        )

    @property
    def visible(self) -> bool:
        """Whether it is drawn."""
        return self._mesh.visible

    @visible.setter
    def visible(self, visible: bool) -> None:
        self._mesh.visible = visible

    def show(self, places: NDArray[np.float32], normals: NDArray[np.float32]) -> None:
        """Follow the wall."""
        sink_wall(places, normals, self._places)
        self._mesh.vertices = self._places

    def remove(self) -> None:
        """Take it off the scene."""
        self._mesh.remove()


@numba.njit(cache=True)
def sink_wall(
    places: NDArray[np.float32], normals: NDArray[np.float32], out: NDArray[np.float32]
) -> None:
    """Write places just below a wall."""
    for v in range(out.shape[0]):
        for i in range(3):
            out[v, i] = places[v, i] - np.float32(DEPTH) * normals[v, i]
