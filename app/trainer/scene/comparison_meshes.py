"""Other models beside the duct: its ghost by another theory, and a mass-spring chain."""

from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from app.trainer.stage.drawn import Drawn, add_mesh
from organ_geometry.mesh import Skin

GHOST_COLOR = (70, 130, 235)
NODE_COLOR, LINK_COLOR = (236, 120, 220), (190, 100, 200)
# Radius, mm.
NODE_SIZE = 0.55


class GhostMesh(Drawn):
    """The ghost, translucent over the duct, with the same skin. Hidden until it is made visible."""

    def __init__(self, scene: viser.SceneApi, skin: Skin) -> None:
        self._outer, faces = skin.side("outer")
        self._mesh = add_mesh(
            scene,
            "/organ/ghost",
            skin.vertices[self._outer],
            faces,
            color=GHOST_COLOR,
            opacity=0.5,
            side="back",  # its front would flicker where it is inside the duct or at its wall
            visible=False,
        )
        super().__init__(self._mesh)

    def show(self, vertices: NDArray[np.float32]) -> None:
        """Draw the ghost with these vertices."""
        self._mesh.vertices = vertices[self._outer]


class ChainLines(Drawn):
    """`count` nodes of a mass-spring chain and their links. Hidden until it is made visible."""

    def __init__(self, scene: viser.SceneApi, count: int) -> None:
        nodes = np.zeros((count, 3), np.float32)
        self._links = scene.add_line_segments(
            "/organ/chain/links",
            np.zeros((count - 1, 2, 3), np.float32),
            LINK_COLOR,
            thickness=3.0,
            thickness_units="screen",
            visible=False,
        )
        self._nodes = scene.add_point_cloud(
            "/organ/chain/nodes",
            nodes,
            NODE_COLOR,
            point_size=NODE_SIZE,
            point_shape="circle",
            precision="float32",
            visible=False,
        )
        super().__init__(self._links, self._nodes)

    def show(self, nodes: NDArray[np.floating[Any]]) -> None:
        """Draw the chain."""
        places = np.asarray(nodes, np.float32)
        self._nodes.points = places
        self._links.points = np.stack([places[:-1], places[1:]], axis=1)
