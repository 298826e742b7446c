"""The outer wall of a skin as a grid of rings, and places, normals and noise on it."""

from dataclasses import dataclass

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

from app.trainer.stage.textures import Image
from organ_geometry.mesh import Skin, ring_angles

__all__ = ["Wall", "wall_normals"]


@dataclass(frozen=True, slots=True, eq=False)
class Wall:
    """The outer wall of a skin: its first `rings` x `sides` vertices.

    Attributes
    ----------
    skin
        The skin.
    rings, sides
        Rings along the axis, and vertices of each.
    right_handed
        Whether (along a ring) x (from ring to ring) points outwards.
    """

    skin: Skin
    rings: int
    sides: int
    right_handed: bool

    @classmethod
    def of(cls, skin: Skin) -> "Wall":
        """Return the outer wall of a skin."""
        faces = skin.faces[: skin.outer_faces]
        count = int(faces.max()) + 1
        # Between two rings lie two faces for each side.
        sides = count - skin.outer_faces // 2
        first = faces[0].tolist()
        start = first.index(0)
        right_handed = first[(start + 1) % 3] == 1
        return cls(skin, count // sides, sides, right_handed)

    @property
    def count(self) -> int:
        """How many vertices the wall has."""
        return self.rings * self.sides

    @property
    def stations(self) -> NDArray[np.float64]:
        """(rings, sides) arc length of each vertex along the organ's axis, mm."""
        return self.skin.stations[: self.count].reshape(self.rings, self.sides)

    def sampled(self, picture: Image, *, length: float) -> NDArray[np.float32]:
        """Return a periodic picture's values at the wall's vertices."""
        height, width = picture.shape
        # A border of one pixel on each side, so that the interpolation meets across the seam.
        padded = np.pad(picture, 1, mode="wrap")
        columns = np.mod(self.stations / length, 1.0) * width + 1.0
        rows = np.broadcast_to(ring_angles(self.sides) / (2.0 * np.pi) * height, columns.shape)
        return cv2.remap(
            padded, columns.astype(np.float32), (rows + 1.0).astype(np.float32), cv2.INTER_LINEAR
        ).astype(np.float32)


@numba.njit(cache=True)
def wall_normals(
    places: NDArray[np.float32],
    rings: int,
    sides: int,
    right_handed: bool,
    out: NDArray[np.float32],
) -> None:
    """Write the outward unit normals of a wall."""
    sign = 1.0 if right_handed else -1.0
    for ring in range(rings):
        before, after = max(ring - 1, 0), min(ring + 1, rings - 1)
        for side in range(sides):
            left = ring * sides + (side - 1) % sides
            right = ring * sides + (side + 1) % sides
            back, forth = before * sides + side, after * sides + side
            ax, ay, az = (
                places[right, 0] - places[left, 0],
                places[right, 1] - places[left, 1],
                places[right, 2] - places[left, 2],
            )
            bx, by, bz = (
                places[forth, 0] - places[back, 0],
                places[forth, 1] - places[back, 1],
                places[forth, 2] - places[back, 2],
            )
            x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
            scale = sign / max(np.sqrt(x * x + y * y + z * z), 1e-12)
            here = ring * sides + side
            out[here, 0], out[here, 1], out[here, 2] = x * scale, y * scale, z * scale
