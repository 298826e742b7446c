"""A surface that moves and has a finish of its own: fine, smooth, textured and wet.

viser's streamed meshes have one colour and normals by their triangles. This one streams the rings
of a coarse grid, and the page lays a finer grid through them and draws it in the material of a GLB
file that was sent once (`dressed_surface.js`). A frame is the rings' places and how much light
reaches them, 16 bytes for each point. Or, instead of light, how much stress each point bears: the
page gives it the colours of `tone.light_table`, drawn as they are whatever lamps there are.
"""

import base64
import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import viser
from numpy.typing import NDArray

from app.trainer.stage.hook import LEAN, TIP_ANGLE, bend_radius, wire_radius
from app.trainer.stage.solids import Part, Solid, solids_glb
from app.trainer.stage.tone import light_for, light_table
from app.trainer.viser_bridge import run_in_page
from organ_geometry.mesh import Finish

__all__ = ["DressedSurface", "Patch", "keep_finish", "light_surfaces"]

FAR = 100.0
"""Distance from a torn rim where there is none, radii."""
NO_STRESS = -9.0
"""Share of a place whose stress nobody has computed; half of it and any share is below zero too."""
DARKEST = 0.62
"""Light that is left of a stress's colour where the wall turns away from the viewer, so that its
form is seen; where it faces the viewer the colours are the map's own."""
_UNKNOWN = (72, 66, 66)
"""sRGB of places without a stress."""


@dataclass(frozen=True, slots=True)
class Patch:
    """Rings of a surface, one after the other, that are drawn as one smooth sheet.

    Attributes
    ----------
    rings
        Their numbers, as they are streamed.
    outwards
        Whether (along a ring) x (from ring to ring) points to the side that is seen.
    tint
        Linear light that its colours are multiplied with.
    """

    rings: tuple[int, ...]
    outwards: bool
    tint: tuple[float, float, float] = (1.0, 1.0, 1.0)


@cache
def _script() -> str:
    return Path(__file__).with_suffix(".js").read_text(encoding="utf-8")


def keep_finish(scene: viser.SceneApi, name: str, finish: Finish) -> None:
    """Send a finish that surfaces can be drawn in, on a triangle too small to be seen."""
    normals = np.tile((0.0, 0.0, 1.0), (3, 1))
    solid = Solid(1e-3 * np.eye(3), np.array([[0, 1, 2]]), normals, np.eye(3)[:, :2].copy())
    scene.add_glb(name, solids_glb([Part(solid, finish)]), cast_shadow=False, receive_shadow=False)


def light_surfaces(
    scene: viser.SceneApi,
    *,
    lamp: NDArray[np.float64],
    aim: NDArray[np.float64],
    floor: NDArray[np.float64],
    radius: float,
) -> None:
    """Let the hook's wire throw its shadow on the duct, and the duct and the hook on the bed."""
    way = (lamp - aim) / np.linalg.norm(lamp - aim)
    light = {
        "lamp": (lamp - floor).tolist(),
        "radius": radius,
        "bend": bend_radius(radius),
        "wire": wire_radius(radius),
        "tip": TIP_ANGLE,
        "shaft": (LEAN / np.linalg.norm(LEAN)).tolist(),
        "lampWay": way.tolist(),
    }
    run_in_page(scene, f"{_script()}\nbluntdissectSurfaces.stage({json.dumps(light)});")


class DressedSurface:
    """A streamed surface of one client in a finish of its own.

    Parameters
    ----------
    scene
        Of one client.
    name
        The scene node.
    finish
        The scene node of its finish (`keep_finish`); None where only its stress is shown.
    along
        (rings, sides) place of each point along the finish's pictures, in their widths.
    behind
        (rings, sides) distance from a torn rim, radii, negative beyond it; `FAR` without one.
    patches
        What is drawn of the rings.
    color
        sRGB of the surface in a page that does not know the finish.
    raw, blood
        Linear light of torn wall, and of the blood that soaks it, if any.
    towards_viewer
        (3,) direction from the surface, in whose light the stress's colours are the map's own.

    Attributes
    ----------
    places
        (rings, sides, 3) mm, to be written before `send`.
    shades
        (rings, sides) light that reaches each point, 0 to 1, or its stress in parts of the
        threshold, not below 0, or `NO_STRESS`; to be written before `send`.
    """

    def __init__(
        self,
        scene: viser.SceneApi,
        name: str,
        finish: str | None,
        *,
        along: NDArray[np.floating],
        behind: NDArray[np.floating],
        patches: Sequence[Patch],
        color: tuple[int, int, int],
        raw: Sequence[float],
        blood: Sequence[float] | None,
        towards_viewer: NDArray[np.float64],
    ) -> None:
        self._scene, self._name = scene, name
        rings, sides = along.shape
        count = rings * sides
        tail = -(-(count + 1) // 3)  # the last number says whether they are shades or stresses
        self._sent = np.zeros((count + tail, 3), np.float32)
        self.places = self._sent[:count].reshape(rings, sides, 3)
        self.shades = self._sent[count:].reshape(-1)[:count].reshape(rings, sides)
        self.shades[:] = 1.0
        self._mesh = scene.add_mesh_simple(
            name,
            self._sent,
            np.concatenate([_triangles(patch, sides) for patch in patches]).astype(np.uint32),
            color=color,
            side="double",
            cast_shadow=False,
            receive_shadow=False,
        )
        wear = {
            "finish": finish,
            "sides": sides,
            "count": count,
            "along": _text(along),
            "behind": _text(behind),
            "raw": [round(float(part), 4) for part in raw],
            "blood": None if blood is None else [round(float(part), 4) for part in blood],
            "stress": {
                "table": _text(light_table()),
                "unknown": light_for(_UNKNOWN).tolist(),
                "darkest": DARKEST,
                "towards": (towards_viewer / np.linalg.norm(towards_viewer)).tolist(),
            },
            "patches": [
                {
                    "rows": [ring * sides for ring in patch.rings],
                    "outwards": patch.outwards,
                    "smooth": len(patch.rings) > 3,
                    "tint": list(patch.tint),
                }
                for patch in patches
            ],
        }
        run_in_page(
            scene,
            f"{_script()}\nbluntdissectSurfaces.dress({json.dumps(name)}, {json.dumps(wear)});",
        )

    @property
    def visible(self) -> bool:
        """Whether it is drawn."""
        return self._mesh.visible

    @visible.setter
    def visible(self, visible: bool) -> None:
        self._mesh.visible = visible

    def send(self, *, stress: bool = False) -> None:
        """Show places and shades, or stresses, as they are now."""
        self._sent[-1, -1] = stress
        self._mesh.vertices = self._sent

    def remove(self) -> None:
        """Take it off the scene."""
        self._mesh.remove()
        run_in_page(self._scene, f"bluntdissectSurfaces.undress({json.dumps(self._name)});")


def _triangles(patch: Patch, sides: int) -> NDArray[np.int64]:
    """Return the triangles between the rings of a patch."""
    rings = np.array(patch.rings)[:, None] * sides + np.arange(sides)
    here, after = rings[:-1], rings[1:]
    right, beyond = np.roll(here, -1, axis=1), np.roll(after, -1, axis=1)
    corners = [[here, right, beyond], [here, beyond, after]]
    faces = np.concatenate([np.stack(three, axis=-1).reshape(-1, 3) for three in corners])
    return faces if patch.outwards else faces[:, ::-1]


def _text(numbers: NDArray[np.floating]) -> str:
    return base64.b64encode(numbers.astype("<f4").tobytes()).decode()
