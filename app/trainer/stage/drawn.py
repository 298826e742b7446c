"""Scene nodes: how they are added without viser's shadows, and handled several as one."""

from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

# viser's shadow camera is made for metres: in mm its bias darkens what it lights.
_UNSHADED: dict[str, Any] = {"cast_shadow": False, "receive_shadow": False}


def add_mesh(
    scene: viser.SceneApi,
    name: str,
    vertices: NDArray[np.floating],
    faces: NDArray[np.integer],
    **look: Any,
) -> viser.MeshHandle:
    """Add a mesh; `look` as in viser's `add_mesh_simple`."""
    points, corners = vertices.astype(np.float32), faces.astype(np.uint32)
    return scene.add_mesh_simple(name, points, corners, **_UNSHADED, **look)


def add_model(scene: viser.SceneApi, name: str, file: bytes, **place: Any) -> viser.GlbHandle:
    """Add a GLB file; `place` as in viser's `add_glb`."""
    return scene.add_glb(name, file, **(_UNSHADED | place))


class Drawn:
    """Scene nodes, added hidden, that are handled as one; `handles` are theirs."""

    def __init__(self, *handles: Any) -> None:
        self._handles = handles
        self._visible = False

    @property
    def visible(self) -> bool:
        """Whether it is shown."""
        return self._visible

    @visible.setter
    def visible(self, visible: bool) -> None:
        if visible != self._visible:
            self._visible = visible
            for handle in self._handles:
                handle.visible = visible

    def remove(self) -> None:
        """Remove it from the scene."""
        for handle in self._handles:
            handle.remove()
