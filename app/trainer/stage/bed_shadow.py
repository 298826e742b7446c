"""The duct's shadow on the tissue bed: soft dark ribbons that move with it.

viser's own shadows are made for scenes of metres. Here each point of the duct's axis is followed
from the lamp to the bed, and bands of growing width are laid there, darkest in their middle.
"""

from typing import Any

import numba
import numpy as np
import viser
from numpy.typing import NDArray

from app.trainer.stage.lighting import lamp_position
from app.trainer.stage.solids import grid_faces
from app.trainer.stage.tissue_bed import REFERENCE_SPAN, bed_surface, height_at

__all__ = ["BedShadow"]

STATIONS, ACROSS = 40, 7
BANDS = (0.40, 0.66, 0.93, 1.22, 1.55)
"""Half width of each band, in the duct's radii."""
OPACITY = 0.15
"""Of each: one mesh has one opacity, and five meshes are five messages a frame."""
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
        self._floor = np.array(floor, np.float64)
        self._lamp = np.array(lamp_position(span), np.float64)
        band = grid_faces(STATIONS, ACROSS)[:, ::-1]
        # The lowest first, so that each is drawn over those below it.
        faces = [band + number * STATIONS * ACROSS for number in range(len(BANDS))]
        self._places = np.zeros((len(BANDS), STATIONS, ACROSS, 3), np.float32)
        self._mesh = scene.add_mesh_simple(
            "/stage/bed_shadow",
            self._places.reshape(-1, 3),
            np.concatenate(faces).astype(np.uint32),
            color=(0, 0, 0),
            opacity=OPACITY,
            side="double",
            cast_shadow=False,
            receive_shadow=False,
        )

    def show(self, axis: NDArray[np.floating[Any]]) -> None:
        """Draw the shadow of a duct, or of its pieces as one.

        Parameters
        ----------
        axis
            (N, 3) points of its axis in order, mm in stage coordinates.
        """
        lay_shadow(
            np.ascontiguousarray(axis, np.float64),
            self._lamp,
            self._floor,
            self._scale,
            self._radius,
            *bed_surface(),
            self._places,
        )
        self._mesh.vertices = self._places.reshape(-1, 3)


@numba.njit(cache=True)
def lay_shadow(
    axis: NDArray[np.float64],
    lamp: NDArray[np.float64],
    floor: NDArray[np.float64],
    scale: float,
    radius: float,
    bed_x: NDArray[np.float64],
    bed_y: NDArray[np.float64],
    bed_z: NDArray[np.float32],
    out: NDArray[np.float32],
) -> None:
    """Write the bands' places.

    Parameters
    ----------
    axis
        (N, 3) points of the duct's axis, mm in stage coordinates.
    lamp, floor
        (3,) where the lamp and the bed's origin are, mm.
    scale
        Of the bed.
    radius
        Of the duct, mm.
    bed_x, bed_y, bed_z
        As `bed_surface` gives them.
    out
        (bands, stations, across, 3) receives the places, mm.
    """
    stations, across = out.shape[1], out.shape[2]
    points, met = np.empty((stations, 3)), np.empty((stations, 3))
    for s in range(stations):
        place = s * (len(axis) - 1) / (stations - 1)
        before = min(int(place), len(axis) - 2)
        part = place - before
        reach = 1.0
        for i in range(3):
            points[s, i] = (1.0 - part) * axis[before, i] + part * axis[before + 1, i]
        # Where the lamp's ray meets the bed, found from the bed's height at the last guess.
        for step in range(_STEPS + 1):
            for i in range(3):
                met[s, i] = lamp[i] + reach * (points[s, i] - lamp[i])
            if step < _STEPS:
                x, y = (met[s, 0] - floor[0]) / scale, (met[s, 1] - floor[1]) / scale
                height = floor[2] + scale * height_at(x, y, bed_x, bed_y, bed_z)
                reach = (height - lamp[2]) / (points[s, 2] - lamp[2])
    for s in range(stations):
        last, following = max(s - 1, 0), min(s + 1, stations - 1)
        along_x, along_y = met[following, 0] - met[last, 0], met[following, 1] - met[last, 1]
        length = max(np.sqrt(along_x**2 + along_y**2), 1e-9)
        above = np.sqrt(np.sum((met[s] - points[s]) ** 2))
        # A round end, so that no edge shows where the ribbons stop.
        taper = np.sqrt(max(1.0 - (2.0 * s / (stations - 1) - 1.0) ** 6, 0.0))
        for band in range(out.shape[0]):
            width = radius * taper * (BANDS[band] + PENUMBRA * above)
            for a in range(across):
                off = width * (2.0 * a / (across - 1) - 1.0)
                x = met[s, 0] - off * along_y / length
                y = met[s, 1] + off * along_x / length
                height = height_at(
                    (x - floor[0]) / scale, (y - floor[1]) / scale, bed_x, bed_y, bed_z
                )
                out[band, s, a, 0], out[band, s, a, 1] = x, y
                out[band, s, a, 2] = floor[2] + scale * height + _CLEAR * (1.0 + 0.3 * band)
