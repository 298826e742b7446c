"""A moving surface with a material of its own: fine, smooth, textured and wet.

viser's streamed meshes have one colour and normals by their triangles. This one streams rings of a
coarse grid; the page interpolates a finer grid through them and draws it in the material of a GLB
file that was sent once (`refined_surface.js`). A frame is each point's place and the light that
reaches it, 16 bytes a point. Instead of light it can be the stress at each point, to which the page
gives the colours of `tone.light_table`, drawn as they are whatever the lamps.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import viser
from numpy.typing import NDArray

from app.trainer.stage.drawn import add_mesh, add_model
from app.trainer.stage.hook import LEAN, TIP_ANGLE, bend_radius, wire_radius
from app.trainer.stage.solids import Piece, Solid, solids_glb
from app.trainer.stage.tone import light_for, light_table
from app.trainer.viser_bridge.fast_transport import stream
from app.trainer.viser_bridge.page import float32_text, run_function, run_module
from organ_geometry.mesh import Finish

SCRIPT = Path(__file__).with_suffix(".js")
FAR = 100.0
"""Value of `behind` without a torn rim, radii."""
NO_STRESS = -9.0
"""Stress where none is computed. So low that the mean with any computed one is below zero too, when
the page interpolates between points."""
DARKEST = 0.62
"""Part of a stress's colour that is left where the wall turns away from the viewer, so that its
shape can be seen; where it faces the viewer the colours are those of the map."""
# sRGB of places without a stress.
_UNKNOWN = (72, 66, 66)


@dataclass(frozen=True, slots=True)
class Patch:
    """Rings of a surface, one after the other, that are drawn as one smooth sheet."""

    rings: tuple[int, ...]  # their numbers, as they are streamed
    outwards: bool  # whether (along a ring) x (from ring to ring) points to the visible side
    # linear light that its colours are multiplied with
    tint: tuple[float, float, float] = (1.0, 1.0, 1.0)


def keep_finish(scene: viser.SceneApi, name: str, finish: Finish) -> None:
    """Send a material for surfaces to be drawn in, on a triangle too small to be seen."""
    normals = np.tile((0.0, 0.0, 1.0), (3, 1))
    solid = Solid(1e-3 * np.eye(3), np.array([[0, 1, 2]]), normals, np.eye(3)[:, :2].copy())
    add_model(scene, name, solids_glb([Piece(solid, finish)]))


def light_surfaces(
    scene: viser.SceneApi,
    *,
    lamp: NDArray[np.float64],
    aim: NDArray[np.float64],
    floor: NDArray[np.float64],
    radius: float,
) -> None:
    """Let the hook's wire cast its shadow on the duct, and the duct and the hook on the bed."""
    towards_lamp = (lamp - aim) / np.linalg.norm(lamp - aim)
    light = {
        "lamp": (lamp - floor).tolist(),
        "radius": radius,
        "bend": bend_radius(radius),
        "wire": wire_radius(radius),
        "tip": TIP_ANGLE,
        "shaft": LEAN.tolist(),
        "lampDirection": towards_lamp.tolist(),
    }
    run_module(scene, SCRIPT, "bluntdissectSurfaces.stage", light)


class RefinedSurface:
    """A streamed surface of one client in a material of its own, the scene node `name`.

    Parameters
    ----------
    scene, name, patches
        Of one client, the scene node, and what is drawn of the rings.
    finish
        The scene node of its material (`keep_finish`); None where only its stress is shown.
    along
        (rings, sides) place of each point along the material's pictures, in their widths.
    behind
        (rings, sides) distance from a torn rim, radii, negative beyond it; `FAR` without one.
    color
        sRGB of the surface in a page that does not know the material.
    raw, blood
        Linear light of torn wall, and of the blood that soaks it, if any.
    torn
        Linear light that colours are multiplied with where the light is below zero: torn wall.
    towards_viewer
        (3,) direction from the surface in which the stress's colours are those of the map.
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
        torn: tuple[float, float, float],
        blood: Sequence[float] | None,
        towards_viewer: NDArray[np.float64],
    ) -> None:
        self._scene, self._name = scene, name
        rings, sides = along.shape
        count = rings * sides
        tail = -(-(count + 1) // 3)  # the very last number tells shades from stresses
        self._sent = np.zeros((count + tail, 3), np.float32)
        # (rings, sides, 3) mm, to be written before `send`
        self.places = self._sent[:count].reshape(rings, sides, 3)
        # (rings, sides), to be written before `send`: light, 0 to 1, below zero where the wall is
        # torn; or stress over the threshold, 0 or more, or `NO_STRESS`
        self.shades = self._sent[count:].reshape(-1)[:count].reshape(rings, sides)
        self.shades[:] = 1.0
        faces = np.concatenate([_triangles(patch, sides) for patch in patches])
        self._mesh = add_mesh(scene, name, self._sent, faces, color=color, side="double")
        # What the page's script needs to know once; big arrays as base64 of little-endian float32.
        wear = {
            "finish": finish,
            "sides": sides,
            "count": count,
            "along": float32_text(along),
            "behind": float32_text(behind),
            "raw": [round(float(value), 4) for value in raw],
            "torn": [round(value, 4) for value in torn],
            "blood": None if blood is None else [round(float(value), 4) for value in blood],
            "stress": {
                "table": float32_text(light_table()),
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
        run_module(scene, SCRIPT, "bluntdissectSurfaces.dress", name, wear)

    def set_visible(self, visible: bool) -> None:
        """Show or hide it."""
        self._mesh.visible = visible

    def send(self, *, stress: bool = False) -> None:
        """Send places and shades, or stresses, as they are now."""
        self._sent[-1, -1] = stress
        stream(self._mesh, "vertices", self._sent)

    def remove(self) -> None:
        """Remove it from the scene."""
        self._mesh.remove()
        run_function(self._scene, "bluntdissectSurfaces.undress", self._name)


def _triangles(patch: Patch, sides: int) -> NDArray[np.int64]:
    rings = np.array(patch.rings)[:, None] * sides + np.arange(sides)
    here, after = rings[:-1], rings[1:]
    right, beyond = np.roll(here, -1, axis=1), np.roll(after, -1, axis=1)
    corners = [[here, right, beyond], [here, beyond, after]]
    faces = np.concatenate([np.stack(three, axis=-1).reshape(-1, 3) for three in corners])
    return faces if patch.outwards else faces[:, ::-1]
