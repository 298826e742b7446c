"""The duct's shadow on the tissue bed: soft dark ribbons that move with it.

viser's own shadows are made for scenes of metres. Here each point of the duct's axis is followed
from the lamp to the bed, and bands of growing width are laid there, darkest in their middle.
"""

from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from app.trainer.stage.lighting import lamp_position
from app.trainer.stage.solids import grid_faces
from app.trainer.stage.tissue_bed import REFERENCE_SPAN, bed_height

__all__ = ["BedShadow"]

STATIONS, ACROSS = 40, 7
BANDS = ((0.40, 0.17), (0.66, 0.16), (0.93, 0.15), (1.22, 0.13), (1.55, 0.11))
"""Half width of each band, in the duct's radii, and its opacity."""
PENUMBRA = 0.045
"""How much wider a band is for each mm that the duct is above the bed, in radii."""
_CLEAR = 0.25  # mm over the bed, whose triangles are coarser than the bands'
_STEPS = 4


class BedShadow:
    """The shadow of one client's duct.

    Parameters
    ----------
    scene
        Of one client.
    span
        Between the clamps, mm.
    radius
        Of the duct, mm.
    floor
        (3,) origin of the bed, mm in stage coordinates.
    """

    def __init__(
        self,
        scene: viser.SceneApi,
        *,
        span: float,
        radius: float,
        floor: tuple[float, float, float],
    ) -> None:
        self._radius = radius
        self._scale = span / REFERENCE_SPAN
        self._floor = np.array(floor)
        self._lamp = lamp_position(span)
        self._along = np.linspace(0.0, 1.0, STATIONS)
        self._across = np.linspace(-1.0, 1.0, ACROSS)
        # A round end, so that no edge shows where the ribbons stop.
        self._taper = (1.0 - (2.0 * self._along - 1.0) ** 6) ** 0.5
        faces = grid_faces(STATIONS, ACROSS)[:, ::-1].astype(np.uint32)
        nothing = np.zeros((STATIONS * ACROSS, 3), np.float32)
        self._bands = [
            scene.add_mesh_simple(
                f"/stage/bed_shadow/{number}",
                nothing,
                faces,
                color=(0, 0, 0),
                opacity=opacity,
                side="double",
                cast_shadow=False,
                receive_shadow=False,
            )
            for number, (_, opacity) in enumerate(BANDS)
        ]

    def show(self, axis: NDArray[np.floating[Any]]) -> None:
        """Draw the shadow of a duct, or of its pieces as one.

        Parameters
        ----------
        axis
            (N, 3) points of its axis in order, mm in stage coordinates.
        """
        place = self._along * (len(axis) - 1)
        points = np.stack(
            [np.interp(place, np.arange(len(axis)), axis[:, i]) for i in range(3)], axis=-1
        )
        rays = points - self._lamp
        # Where each ray meets the bed, found from the bed's height at the last guess.
        reach = np.ones(STATIONS)
        for _ in range(_STEPS):
            met = self._lamp + reach[:, None] * rays
            reach = (self._height(met) - self._lamp[2]) / rays[:, 2]
        met = self._lamp + reach[:, None] * rays
        above = np.linalg.norm(met - points, axis=1)
        onwards = np.gradient(met[:, :2], axis=0)
        onwards /= np.maximum(np.linalg.norm(onwards, axis=1, keepdims=True), 1e-9)
        sideways = np.stack([-onwards[:, 1], onwards[:, 0], np.zeros(STATIONS)], axis=-1)
        for number, (mesh, (half, _)) in enumerate(zip(self._bands, BANDS, strict=True)):
            width = self._radius * self._taper * (half + PENUMBRA * above)
            laid = met[:, None] + (width[:, None] * self._across)[..., None] * sideways[:, None]
            laid[..., 2] = self._height(laid) + _CLEAR * (1.0 + 0.3 * number)
            mesh.vertices = laid.reshape(-1, 3).astype(np.float32)

    def _height(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the bed's height below places of the stage, mm."""
        local = (places - self._floor) / self._scale
        height = bed_height(local[..., 0], local[..., 1])
        return self._floor[2] + self._scale * height
