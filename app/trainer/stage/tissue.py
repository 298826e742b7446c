"""The duct as wet tissue: its mottled wall, vessels, and, where it is torn, its bleeding inside."""

from functools import cache
from typing import Literal

import numba
import numpy as np
import viser
from numpy.typing import NDArray

from app.trainer.stage.gltf_asset import Finish
from app.trainer.stage.streamed_mesh import StreamedMesh
from app.trainer.stage.textures import Image, blurred, smooth_noise, smooth_step
from app.trainer.stage.tone import linear_light
from app.trainer.stage.underlay import Underlay
from app.trainer.stage.vessels import Vessels, pose_vessels
from app.trainer.stage.wall import Wall, wall_normals
from organ_geometry.mesh.skin import Skin

__all__ = ["WET", "Tissue", "TornEnd", "raise_wall"]

TornEnd = Literal["first", "last"]
"""The end of a piece that was torn, along the organ's axis."""

WET = Finish(roughness=0.46, clearcoat=0.8, clearcoat_roughness=0.17)

_TAN, _BROWN, _PINK, _FAT = (214, 160, 108), (176, 112, 74), (190, 98, 84), (228, 190, 128)
_VESSEL = (120, 26, 26)
_BLOOD, _LUMEN, _RAW = (104, 12, 14), (70, 18, 16), (156, 48, 44)
_PATTERN_LENGTH = 28.0  # mm of the axis that one picture of noise covers
_SOFTNESS = 7.5  # pixels of that picture
_RELIEF = 0.10  # mm
_SWELLING = 0.17  # mm


@cache
def _noise(cells: float, fall: float, seed: int) -> Image:
    noise = smooth_noise((256, 256), cells=cells, fall=fall, seed=seed)
    # No finer than the wall's vertices, or its triangles would be seen; wrapped around, as it is.
    soft = blurred(np.pad(noise, 32, mode="wrap"), _SOFTNESS)[32:-32, 32:-32]
    return np.clip(0.5 + (soft - soft.mean()) * (0.2 / soft.std()), 0.0, 1.0).astype(np.float32)


class Tissue:
    """One surface of the duct on a client's scene, wet.

    Parameters
    ----------
    scene
        Of one client.
    name
        The scene node.
    skin
        The surface.
    length
        Of the whole organ, mm.
    radius
        Of the duct, mm.
    torn_end
        Which end of it is torn, if any: the inside shows only then.
    """

    def __init__(
        self,
        scene: viser.SceneApi,
        name: str,
        skin: Skin,
        *,
        length: float,
        radius: float,
        torn_end: TornEnd | None = None,
    ) -> None:
        self._wall = wall = Wall.of(skin)
        self._vessels = vessels = Vessels.of(wall, length, radius)
        inner = skin.faces[skin.outer_faces :] if torn_end else skin.faces[:0]
        self._inside, renumbered = np.unique(inner, return_inverse=True)
        self._vessel_start = wall.count
        self._inside_start = wall.count + len(vessels.ring)
        faces = np.concatenate(
            [
                skin.faces[: skin.outer_faces],
                vessels.faces + self._vessel_start,
                renumbered.reshape(-1, 3) + self._inside_start,
            ]
        )
        count = self._inside_start + len(self._inside)
        self._mesh = StreamedMesh(scene, name, faces, count, WET)
        self._underlay = Underlay(scene, f"{name}_underlay", wall, _TAN)
        self._colors = np.empty((count, 3), np.float32)
        self._colors[: wall.count] = _wall_colors(wall, radius, torn_end)
        self._colors[wall.count : self._inside_start] = linear_light(_VESSEL)
        self._colors[self._inside_start :] = _inside_colors(wall, self._inside, radius, torn_end)
        self._relief = _relief(wall)
        self._normals = np.empty((wall.count, 3), np.float32)
        self._shades = np.ones(count, np.float32)

    @property
    def visible(self) -> bool:
        """Whether it is drawn."""
        return self._mesh.visible

    @visible.setter
    def visible(self, visible: bool) -> None:
        self._mesh.visible = visible
        self._underlay.visible = visible

    def show(self, vertices: NDArray[np.float32], shade: NDArray[np.float32]) -> None:
        """Draw the surface as it is now.

        Parameters
        ----------
        vertices
            (V, 3) the skin's vertices, deformed, mm.
        shade
            (V,) how much light reaches each, 0 to 1.
        """
        wall, vessels, mesh = self._wall, self._vessels, self._mesh
        start, stop = self._vessel_start, self._inside_start
        wall_normals(vertices, wall.rings, wall.sides, wall.right_handed, self._normals)
        raise_wall(vertices, self._normals, self._relief, mesh.positions[:start])
        self._shades[:start] = shade[:start]
        pose_vessels(
            mesh.positions, self._normals, self._shades, wall.sides, vessels.ring, vessels.side,
            vessels.between, vessels.lift, mesh.positions[start:stop], self._shades[start:stop],
        )  # fmt: skip
        np.take(vertices, self._inside, axis=0, out=mesh.positions[stop:])
        np.multiply(self._colors, self._shades[:, None], out=mesh.colors)
        self._underlay.show(mesh.positions[:start], self._normals)
        mesh.send()

    def remove(self) -> None:
        """Take it off the scene."""
        self._mesh.remove()
        self._underlay.remove()


def _relief(wall: Wall) -> NDArray[np.float32]:
    """Return the height of each of the wall's vertices over its smooth shape, mm."""
    fine = wall.sampled(_noise(6.0, 0.5, 21), length=_PATTERN_LENGTH) - 0.5
    broad = wall.sampled(_noise(2.0, 1.6, 22), length=_PATTERN_LENGTH) - 0.5
    return (2.0 * _RELIEF * fine + 2.0 * _SWELLING * broad).ravel().astype(np.float32)


def _wall_colors(wall: Wall, radius: float, torn_end: TornEnd | None) -> NDArray[np.float64]:
    """Return the reflectance of the outer wall's vertices, (rings * sides, 3)."""

    def noise(cells: float, fall: float, seed: int) -> Image:
        return wall.sampled(_noise(cells, fall, seed), length=_PATTERN_LENGTH)

    color = _mixed(_light(_TAN), _BROWN, smooth_step(noise(2.0, 1.5, 31), 0.35, 0.75))
    color = _mixed(color, _PINK, 0.45 * smooth_step(noise(4.0, 1.1, 32), 0.45, 0.9))
    color = _mixed(color, _FAT, 0.5 * smooth_step(noise(5.0, 1.2, 33), 0.55, 0.95))
    color = color * (0.9 + 0.2 * noise(7.0, 0.4, 34))[..., None]
    if torn_end is not None:
        rough = noise(5.0, 0.9, 35)
        behind = _behind_rim(wall, torn_end) / radius
        soaked = smooth_step(_single(behind - 1.3 * rough), 0.45, -0.45)
        color = _mixed(color, _PINK, 0.5 * smooth_step(_single(behind - rough), 0.9, 0.0))
        color = _mixed(color, _BLOOD, 0.92 * soaked)
    return color.reshape(-1, 3)


def _inside_colors(
    wall: Wall, used: NDArray[np.int32], radius: float, torn_end: TornEnd | None
) -> NDArray[np.float64]:
    """Return the reflectance of the vertices inside: raw at the rim, dark in the lumen."""
    if torn_end is None:
        return np.empty((0, 3))
    stations = wall.skin.stations
    rim = wall.stations[-1 if torn_end == "last" else 0]
    behind = np.abs(stations[used] - rim.mean()) / radius
    color = _mixed(_light(_RAW), _LUMEN, smooth_step(_single(behind), 0.05, 0.5))
    # The cut face itself is the outer wall's last ring, seen from its end.
    return _mixed(color, _RAW, 1.0 * (used < wall.count))


def _behind_rim(wall: Wall, torn_end: TornEnd) -> NDArray[np.float64]:
    """Return how far each of the wall's vertices is behind the torn rim, mm."""
    rim = wall.stations[-1 if torn_end == "last" else 0]
    return np.abs(wall.stations - rim)


def _single(values: NDArray[np.floating]) -> NDArray[np.float32]:
    return values.astype(np.float32)


def _light(color: tuple[int, int, int]) -> NDArray[np.float64]:
    return linear_light(color)


def _mixed(
    under: NDArray[np.float64], over: tuple[int, int, int], share: NDArray[np.floating]
) -> NDArray[np.float64]:
    amount = np.asarray(share, np.float64)[..., None]
    return under * (1.0 - amount) + linear_light(over) * amount


@numba.njit(cache=True)
def raise_wall(
    vertices: NDArray[np.float32],
    normals: NDArray[np.float32],
    height: NDArray[np.float32],
    out: NDArray[np.float32],
) -> None:
    """Write the wall's vertices, raised by its relief.

    Parameters
    ----------
    vertices, normals
        (V, 3) or more places, mm, and (V, 3) outward unit normals.
    height
        (V,) relief, mm.
    out
        (V, 3) receives the places, mm.
    """
    for v in range(height.shape[0]):
        for i in range(3):
            out[v, i] = vertices[v, i] + height[v] * normals[v, i]
