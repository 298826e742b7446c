"""The duct as tissue: wet, with vessels in its wall, stubs in the clamps and bleeding torn ends."""

from typing import Literal

import numpy as np
import viser
from numpy.typing import NDArray

from app.trainer.stage.appearance import Appearance
from app.trainer.stage.clamps import STUB
from app.trainer.stage.contact import Contact
from app.trainer.stage.dressed_surface import FAR, DressedSurface, Patch, keep_finish_of
from app.trainer.stage.gltf_asset import Finish
from app.trainer.stage.tone import linear_light
from app.trainer.stage.wall import Wall
from app.trainer.stage.wall_texture import PERIOD, mean_color, wall_texture

__all__ = ["Tissue", "TornEnd", "send_finish"]

TornEnd = Literal["first", "last"]
"""The end of a piece that was torn, along the organ's axis."""

FINISH = "/finish/wall"
"""The scene node of what a client's duct is drawn in."""
FRINGE = (0.2, 0.42)
"""How far beyond a torn rim the rings of its fibres stand, in radii."""
_DROOP = 0.35  # how much of a fringe's reach it hangs down


def send_finish(scene: viser.SceneApi, look: Appearance, radius: float) -> None:
    """Send what the duct's surfaces are drawn in."""
    texture = wall_texture(look, radius)
    finish = Finish(
        roughness=look.roughness,
        clearcoat=look.clearcoat,
        clearcoat_roughness=0.2,
        base_jpeg=texture.base,
        normal_jpeg=texture.normals,
    )
    keep_finish_of(scene, FINISH, finish)


class Tissue:
    """One surface of the duct on a client's scene.

    Parameters
    ----------
    scene
        Of one client, to which `send_finish` has been sent.
    name
        The scene node.
    contact
        The surface's skin with the marks of clamps and hook.
    look
        What the duct is made of.
    radius
        Of the duct, mm.
    lumen
        Radius of the lumen in parts of the wall's where it is not the skin's own.
    torn_end
        Which end of it is torn, if any: the inside shows only then.
    """

    def __init__(
        self,
        scene: viser.SceneApi,
        name: str,
        contact: Contact,
        *,
        look: Appearance,
        radius: float,
        lumen: float | None = None,
        torn_end: TornEnd | None = None,
    ) -> None:
        self._wall = wall = Wall.of(contact.skin)
        self._lumen = lumen
        self._torn_end = torn_end
        rings = wall.rings
        self._hollow = len(contact.skin.vertices) >= 2 * wall.count
        first, last = contact.stubs
        before = len(first)
        self._outer = slice(before, before + rings)
        after = before + rings + len(last)
        rows = [_stations(wall, len(first), at_start=True, radius=radius), wall.stations]
        rows.append(_stations(wall, len(last), at_start=False, radius=radius))
        patches = [Patch(tuple(range(after)), wall.right_handed)]
        self._inner = self._fringe = slice(after, after)
        if torn_end is not None:
            rim = before + (rings - 1 if torn_end == "last" else 0)
            inner = rings if self._hollow else 1
            self._inner = slice(after, after + inner)
            rows.append(wall.stations if self._hollow else wall.stations[[rim - before]])
            facing = wall.right_handed == (torn_end == "last")
            inside_rim = after + (inner - 1 if torn_end == "last" and self._hollow else 0)
            base = linear_light(mean_color(look))
            raw = tuple((linear_light(look.raw) / base).tolist())
            patches.append(Patch((rim, inside_rim), facing, raw))
            if self._hollow:
                dark = tuple((linear_light(look.inside) / base).tolist())
                patches.append(
                    Patch(tuple(range(after, after + inner)), not wall.right_handed, dark)
                )
            if look.blood is not None:
                self._fringe = slice(after + inner, after + inner + len(FRINGE))
                rows.append(np.repeat(wall.stations[[rim - before]], len(FRINGE), axis=0))
                patches.append(Patch((rim, after + inner, after + inner + 1), facing, raw))
        stations = np.concatenate(rows)
        behind = np.full(stations.shape, FAR)
        if torn_end is not None:
            edge = wall.stations[-1 if torn_end == "last" else 0]
            behind = np.abs(stations - edge) / radius
            behind[self._fringe] = -np.array(FRINGE)[: len(behind[self._fringe]), None]
        self._surface = DressedSurface(
            scene,
            name,
            FINISH,
            along=stations / (PERIOD * radius),
            behind=behind,
            patches=patches,
            color=mean_color(look),
            raw=linear_light(look.raw).tolist(),
            blood=None if look.blood is None else linear_light(look.blood).tolist(),
        )
        self._down = -contact.frame[:, 2].astype(np.float32)
        self._radius = radius
        places, shades = self._surface.places, self._surface.shades
        places[:before], places[before + rings : after] = first, last
        shades[:before] = shades[before + rings : after] = contact.stub_shade
        shades[self._inner] = 0.75

    @property
    def visible(self) -> bool:
        """Whether it is drawn."""
        return self._surface.visible

    @visible.setter
    def visible(self, visible: bool) -> None:
        self._surface.visible = visible

    def show(self, vertices: NDArray[np.float32], shade: NDArray[np.float32]) -> None:
        """Draw the surface as it is now."""
        wall, surface = self._wall, self._surface
        shape = (wall.rings, wall.sides)
        outer = vertices[: wall.count].reshape(*shape, 3)
        surface.places[self._outer] = outer
        surface.shades[self._outer] = shade[: wall.count].reshape(shape)
        if self._torn_end is not None:
            end = -1 if self._torn_end == "last" else 0
            if self._hollow and self._lumen is not None:
                middles = outer.mean(axis=1, keepdims=True)
                surface.places[self._inner] = middles + self._lumen * (outer - middles)
            elif self._hollow:
                inner = vertices[wall.count : 2 * wall.count]
                surface.places[self._inner] = inner.reshape(*shape, 3)
            else:
                surface.places[self._inner] = vertices[wall.count :][end]
            rim, behind = outer[end], outer[-2 if end else 1]
            ahead = rim - behind
            ahead /= np.maximum(np.linalg.norm(ahead, axis=-1, keepdims=True), 1e-9)
            fringe = surface.places[self._fringe]
            for place, reach in zip(fringe, FRINGE, strict=False):
                place[:] = rim + self._radius * reach * (ahead + _DROOP * reach * self._down)
        surface.send()

    def remove(self) -> None:
        """Take it off the scene."""
        self._surface.remove()


def _stations(wall: Wall, count: int, *, at_start: bool, radius: float) -> NDArray[np.float64]:
    """Return where the rings of a stub would lie along the axis, mm."""
    end = wall.stations[0 if at_start else -1]
    steps = radius * np.array([reach for reach, _, _ in STUB[:count]])[:, None]
    return end - steps[::-1] if at_start else end + steps
