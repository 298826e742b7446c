"""A duct as it is drawn: its surfaces, how they follow the beam, and the stress on them."""

import math

import numpy as np
from numpy.typing import NDArray

from app.simulation.dissection import Dissection
from app.simulation.pulled_duct import PulledDuct
from app.simulation.reading import Surface
from app.simulation.surface_stress import SurfaceStress
from organ_geometry import Organ
from organ_geometry.mesh import organ_skin

__all__ = ["DrawnDuct"]


class DrawnDuct:
    """The surfaces of a session's duct.

    Parameters
    ----------
    organ
        The organ.
    vertices
        About how many vertices the skin shall have.

    Attributes
    ----------
    skin
        The skin of the whole organ, at rest.
    edge_length
        Length of its triangles' edges, mm.
    surfaces
        What is to be drawn: the skin or two pieces.
    shape
        Number that changes whenever `surfaces` are others than before.
    """

    def __init__(self, organ: Organ, vertices: int) -> None:
        walls = 2 if organ.hollow else 1
        area = walls * 2.0 * math.pi * organ.mean_radius * organ.length
        self.edge_length = min(math.sqrt(area / vertices), organ.mean_radius)
        self.skin = organ_skin(organ, edge_length=self.edge_length)
        self.shape = 0
        self.surfaces: tuple[Surface, ...] = ()
        self._stress: tuple[SurfaceStress, ...] | None = None

    @property
    def transforms(self) -> NDArray[np.float64]:
        """(D, 3, 4) transforms of the driving points less the identity; overwritten."""
        return self._transforms

    def follow(self, dissection: Dissection) -> None:
        """Show the whole organ, moved by a dissection's driving points from now on."""
        self._dissection = dissection
        self._bound = self.skin.bound_to(dissection.driving)
        self._transforms = dissection.rest_transforms()
        self.show_whole()

    def show_whole(self) -> None:
        """Show the whole organ at rest."""
        self.show((Surface("skin", self.skin, self.skin.vertices.copy()),))

    def show(self, surfaces: tuple[Surface, ...]) -> None:
        """Show other surfaces."""
        self.surfaces = surfaces
        self._stress = None
        self.shape += 1

    def draw(self, pulled: PulledDuct) -> None:
        """Write the surfaces' vertices as the duct is now."""
        if pulled.tear is not None:
            pulled.tear.draw(self._transforms)
            return
        transforms = self._dissection.move(pulled.grasped.driven, self._transforms)
        self._bound.deform(transforms, self.surfaces[0].vertices)

    def write_stress(
        self, pulled: PulledDuct, surface: int, out: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        """Write the stress at each vertex of a surface."""
        if self._stress is None:
            self._stress = tuple(
                SurfaceStress(self._dissection, each.skin) for each in self.surfaces
            )
        part = 1.0 if pulled.tear is None else pulled.tear.carried
        return self._stress[surface].write(pulled.grasped.pulled, out, part=part)
