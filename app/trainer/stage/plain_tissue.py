"""The duct in two colours, for slow machines: one mesh for the wall, one for the inside."""

from functools import partial

import numpy as np
import viser
from numpy.typing import NDArray

from app.trainer.stage.contact import Contact
from app.trainer.stage.drawn import add_mesh
from app.trainer.stage.tissue import Tissue, TornEnd
from app.trainer.viser_bridge.fast_transport import stream
from organ_geometry.mesh import INSIDE, OUTER_WALL, Color


class PlainTissue:
    """One surface of the duct on a client's scene: nodes `name`, `name`_inside and `name`_stress.

    `contact` gives the vertices, deformed by clamps and hook; `radius` is the duct's, mm;
    `torn_end` says which end of it is torn, if any.
    """

    def __init__(
        self,
        scene: viser.SceneApi,
        name: str,
        contact: Contact,
        *,
        radius: float,
        color: Color = OUTER_WALL,
        torn_end: TornEnd | None = None,
    ) -> None:
        self._stress: Tissue | None = None
        self._make_stress = partial(
            Tissue,
            scene,
            f"{name}_stress",
            contact,
            look=None,
            radius=radius,
            torn_end=torn_end,
        )
        skin = contact.skin
        self._meshes: list[tuple[viser.MeshHandle, NDArray[np.intp]]] = []
        # The inside is a mesh of its own for another colour and a sharp edge along the torn rim.
        for (numbers, faces), node, shown in (
            (skin.side("outer"), name, color),
            (skin.side("inside"), f"{name}_inside", INSIDE),
        ):
            vertices = skin.vertices[numbers]
            mesh = add_mesh(scene, node, vertices, faces, color=shown, side="double")
            self._meshes.append((mesh, numbers))

    def show(self, vertices: NDArray[np.float32], shade: NDArray[np.float32]) -> None:
        """Draw the surface as it is now."""
        del shade
        self._show_stress(False)
        for mesh, numbers in self._meshes:
            stream(mesh, "vertices", vertices[numbers])

    def show_stress(self, vertices: NDArray[np.float32], fraction: NDArray[np.float32]) -> None:
        """Draw the stress on the surface as it is now, over the threshold."""
        if self._stress is None:
            self._stress = self._make_stress()
        self._show_stress(True)
        self._stress.show_stress(vertices, fraction)

    def _show_stress(self, shown: bool) -> None:
        if self._stress is not None:
            self._stress.set_visible(shown)
        for mesh, _ in self._meshes:
            mesh.visible = not shown

    def remove(self) -> None:
        """Remove it from the scene."""
        for mesh, _ in self._meshes:
            mesh.remove()
        if self._stress is not None:
            self._stress.remove()
