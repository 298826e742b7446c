"""The duct as tissue: wet, with vessels in its wall, stubs in the clamps and bleeding torn ends.

One streamed surface has, in this order, the rings of
    the first stub (in the clamp) | the outer wall | the last stub | the inner wall | the fringe,
where inner wall and fringe are there only in a torn piece. Patches join them to sheets: stub, wall
and stub; the cut face, from the torn rim to the inner wall; the inner wall; and the fringe of
bleeding fibres beyond the rim.
"""

from typing import Literal

import numpy as np
import viser
from numpy.typing import NDArray

from app.simulation import Dissection
from app.trainer.stage.appearance import Appearance, appearance_of, drawn_lumen, drawn_radius
from app.trainer.stage.camera import TOWARDS_VIEWER
from app.trainer.stage.clamps import STUB
from app.trainer.stage.contact import Contact
from app.trainer.stage.refined_surface import (
    FAR,
    NO_STRESS,
    Patch,
    RefinedSurface,
    keep_finish,
)
from app.trainer.stage.wall_texture import PERIOD, mean_color, wall_texture
from organ_geometry.mesh import INSIDE, Finish, Skin, linear_light

TornEnd = Literal["first", "last"]
"""The torn end of a piece, along the organ's axis."""
TORN_ENDS: dict[str, TornEnd] = {"first_piece": "last", "second_piece": "first"}

# The scene node of the material of a client's duct.
FINISH = "/finish/wall"
# Distances of the fringe's rings beyond a torn rim, in radii.
FRINGE = (0.2, 0.42)
_DROOP = 0.35  # part of a fringe's length that it hangs down


def cut_end(surface: str, *, divided: bool) -> TornEnd | None:
    """Return which end of a dissection's surface is open, torn or divided."""
    return TORN_ENDS.get(surface) or ("last" if divided else None)


def send_finish(scene: viser.SceneApi, look: Appearance, radius: float) -> None:
    """Send the material of the duct's surfaces."""
    texture = wall_texture(look, radius)
    finish = Finish(
        roughness=look.roughness,
        clearcoat=look.clearcoat,
        clearcoat_roughness=0.2,
        base_jpeg=texture.base,
        normal_jpeg=texture.normals,
    )
    keep_finish(scene, FINISH, finish)


def lumen_fraction(skin: Skin) -> float | None:
    """Return the radius of the lumen over the wall's at the last ring; None of a solid skin."""
    # An inner wall that is drawn so follows the dents of the outer one, and never shows through.
    if not skin.hollow:
        return None
    rings = skin.grid(skin.vertices)[-1], skin.grid(skin.vertices, "lumen")[-1]
    wall, lumen = (np.linalg.norm(ring - ring.mean(axis=0), axis=1).mean() for ring in rings)
    return float(lumen / wall)


class Tissue:
    """One surface of the duct on a client's scene, to which `send_finish` has been applied.

    Parameters
    ----------
    scene, name, contact
        Of one client, the scene node, and the skin, deformed by clamps and hook.
    look
        What the duct is made of; None where only its stress is shown.
    radius, lumen
        Of the duct, mm, and the lumen's over the wall's where it is not the skin's own.
    torn_end
        Which end is torn, if any: only then the inside shows.
    """

    def __init__(
        self,
        scene: viser.SceneApi,
        name: str,
        contact: Contact,
        *,
        look: Appearance | None,
        radius: float,
        lumen: float | None = None,
        torn_end: TornEnd | None = None,
    ) -> None:
        self._skin = skin = contact.skin
        self._lumen = lumen
        self._torn_end = torn_end
        rings = skin.rings
        first, last = contact.stubs
        before = len(first)
        self._outer = slice(before, before + rings)
        after = before + rings + len(last)
        wall = skin.grid(skin.stations)
        rows = [_stations(wall[0], len(first), at_start=True, radius=radius), wall]
        rows.append(_stations(wall[-1], len(last), at_start=False, radius=radius))
        # The wall as one sheet with its stubs.
        patches = [Patch(tuple(range(after)), skin.right_handed)]
        raw = dark = (1.0, 1.0, 1.0)
        if look is not None:
            # A tint multiplies the texture, so it is the wanted colour over the mean one.
            base = linear_light(mean_color(look))
            raw = tuple((linear_light(look.raw) / base).tolist())
            dark = tuple((linear_light(look.inside) / base).tolist())
        self._inner = self._fringe = slice(after, after)
        if torn_end is not None:
            # The cut face goes from the rim to the lumen's ring, or to the centre of a solid skin.
            rim = before + (rings - 1 if torn_end == "last" else 0)
            inner = rings if skin.hollow else 1
            self._inner = slice(after, after + inner)
            rows.append(wall if skin.hollow else wall[[rim - before]])
            facing = skin.right_handed == (torn_end == "last")
            inside_rim = after + (inner - 1 if torn_end == "last" and skin.hollow else 0)
            patches.append(Patch((rim, inside_rim), facing, raw))
            if skin.hollow:
                inside = tuple(range(after, after + inner))
                patches.append(Patch(inside, not skin.right_handed, dark))
            if look is not None and look.blood is not None:
                self._fringe = slice(after + inner, after + inner + len(FRINGE))
                rows.append(np.repeat(wall[[rim - before]], len(FRINGE), axis=0))
                patches.append(Patch((rim, after + inner, after + inner + 1), facing, raw))
        stations = np.concatenate(rows)
        # Distance of each point from the torn rim, which the page soaks with blood.
        behind = np.full(stations.shape, FAR)
        if torn_end is not None:
            edge = wall[-1 if torn_end == "last" else 0]
            behind = np.abs(stations - edge) / radius
            behind[self._fringe] = -np.array(FRINGE)[: len(behind[self._fringe]), None]
        blood = None if look is None else look.blood
        self._surface = RefinedSurface(
            scene,
            name,
            None if look is None else FINISH,
            along=stations / (PERIOD * radius),
            behind=behind,
            patches=patches,
            color=INSIDE if look is None else mean_color(look),
            raw=linear_light(INSIDE if look is None else look.raw).tolist(),
            torn=raw,
            blood=None if blood is None else linear_light(blood).tolist(),
            towards_viewer=contact.frame @ TOWARDS_VIEWER,
        )
        self._down = -contact.frame[:, 2].astype(np.float32)
        self._radius = radius
        self._stub_shade = contact.stub_shade
        places = self._surface.places
        places[:before], places[before + rings : after] = first, last

    @classmethod
    def of(
        cls,
        scene: viser.SceneApi,
        surface: str,
        contact: Contact,
        dissection: Dissection,
        *,
        divided: bool,
    ) -> "Tissue":
        """Return a surface of a dissection, whole or a piece, under `/organ`."""
        fraction = lumen_fraction(contact.skin) if divided else None
        return cls(
            scene,
            f"/organ/{surface}",
            contact,
            look=appearance_of(dissection.preset),
            radius=drawn_radius(dissection),
            lumen=drawn_lumen(dissection) or fraction,
            torn_end=cut_end(surface, divided=divided),
        )

    def set_visible(self, visible: bool) -> None:
        """Show or hide it."""
        self._surface.set_visible(visible)

    def show(self, vertices: NDArray[np.float32], shade: NDArray[np.float32]) -> None:
        """Draw the surface as it is now."""
        shades = self._surface.shades
        shades[:] = self._stub_shade
        shades[self._inner], shades[self._fringe] = 0.75, 1.0
        shades[self._outer] = self._skin.grid(shade)
        self._place(vertices)
        self._surface.send()

    def show_stress(self, vertices: NDArray[np.float32], fraction: NDArray[np.float32]) -> None:
        """Draw the stress on the surface as it is now, over the threshold."""
        fractions = self._surface.shades
        fractions[:] = NO_STRESS
        np.maximum(self._skin.grid(fraction), 0.0, out=fractions[self._outer])
        self._place(vertices)
        self._surface.send(stress=True)

    def _place(self, vertices: NDArray[np.float32]) -> None:
        """Write the places of the rings."""
        skin, surface = self._skin, self._surface
        outer = skin.grid(vertices)
        surface.places[self._outer] = outer
        if self._torn_end is not None:
            end = -1 if self._torn_end == "last" else 0
            if skin.hollow and self._lumen is not None:
                middles = outer.mean(axis=1, keepdims=True)
                surface.places[self._inner] = middles + self._lumen * (outer - middles)
            elif skin.hollow:
                surface.places[self._inner] = skin.grid(vertices, "lumen")
            else:
                surface.places[self._inner] = vertices[skin.wall_size :][end]
            rim, behind = outer[end], outer[-2 if end else 1]
            # The fringe goes on in the direction of the wall and hangs down towards its end.
            ahead = rim - behind
            ahead /= np.maximum(np.linalg.norm(ahead, axis=-1, keepdims=True), 1e-9)
            fringe = surface.places[self._fringe]
            for place, reach in zip(fringe, FRINGE, strict=False):
                place[:] = rim + self._radius * reach * (ahead + _DROOP * reach * self._down)

    def remove(self) -> None:
        """Remove it from the scene."""
        self._surface.remove()


def _stations(
    end: NDArray[np.float64], count: int, *, at_start: bool, radius: float
) -> NDArray[np.float64]:
    """Return where the rings of a stub beyond a wall's end ring would lie along the axis, mm."""
    steps = radius * np.array([reach for reach, _, _ in STUB[:count]])[:, None]
    return end - steps[::-1] if at_start else end + steps
