"""Stress on the duct's surface as colours: a fixed range from none to the threshold, and a key."""

import html
from typing import Any

import numba
import numpy as np
import viser
from numpy.typing import NDArray

from app.trainer.stage.gltf_asset import Finish
from app.trainer.stage.streamed_mesh import StreamedMesh
from app.trainer.stage.tone import COLOR_MAP, color_table, light_for, light_table
from app.trainer.stage.underlay import Underlay
from app.trainer.stage.wall import Wall, wall_normals
from organ_geometry.mesh import Skin

__all__ = ["UNLIT", "HeatMap", "heat_colors", "heat_legend_html"]

UNLIT = Finish(roughness=1.0)
DARKEST = 0.62
"""Light that is left where the wall turns away from the viewer, so that its form is seen; where it
faces the viewer the colours are the map's own."""
_INSIDE, _BELOW = (72, 66, 66), (70, 74, 92)
KPA_PER_MPA = 1000.0
_STOPS = 24


class HeatMap:
    """The stress on one surface of the duct, on a client's scene.

    The colours are sent as light, not as a surface under lamps, so that the page shows those of
    the key: `color_table` to a few of 255 steps wherever the wall faces the viewer.

    Parameters
    ----------
    scene
        Of one client.
    name
        The scene node.
    skin
        The surface.
    viewer
        (3,) direction from the duct towards the viewer, in the organ's coordinates.
    torn
        Whether the surface is a torn piece, whose inside shows; that has no stress.
    """

    def __init__(
        self,
        scene: viser.SceneApi,
        name: str,
        skin: Skin,
        viewer: NDArray[np.float64],
        *,
        torn: bool = False,
    ) -> None:
        self._wall = wall = Wall.of(skin)
        inner = skin.faces[skin.outer_faces :] if torn else skin.faces[:0]
        self._inside, renumbered = np.unique(inner, return_inverse=True)
        faces = np.concatenate(
            [skin.faces[: skin.outer_faces], renumbered.reshape(-1, 3) + wall.count]
        )
        self._mesh = StreamedMesh(
            scene, name, faces, wall.count + len(self._inside), UNLIT, unlit=True
        )
        self._underlay = Underlay(scene, f"{name}_underlay", wall, _BELOW)
        self._mesh.colors[wall.count :] = light_for(_INSIDE)
        self._normals = np.empty((wall.count, 3), np.float32)
        self._viewer = np.asarray(viewer, np.float64) / np.linalg.norm(viewer)

    @property
    def visible(self) -> bool:
        """Whether it is drawn."""
        return self._mesh.visible

    @visible.setter
    def visible(self, visible: bool) -> None:
        self._mesh.visible = visible
        self._underlay.visible = visible

    def show(self, vertices: NDArray[np.float32], share: NDArray[np.floating[Any]]) -> None:
        """Draw the stress as it is now."""
        wall, mesh = self._wall, self._mesh
        wall_normals(vertices, wall.rings, wall.sides, wall.right_handed, self._normals)
        mesh.positions[: wall.count] = vertices[: wall.count]
        np.take(vertices, self._inside, axis=0, out=mesh.positions[wall.count :])
        heat_colors(share, self._normals, self._viewer, mesh.colors[: wall.count])
        self._underlay.show(mesh.positions[: wall.count], self._normals)
        mesh.send()

    def remove(self) -> None:
        """Take it off the scene."""
        self._mesh.remove()
        self._underlay.remove()


def heat_colors(
    share: NDArray[np.floating[Any]],
    normals: NDArray[np.float32],
    viewer: NDArray[np.float64],
    out: NDArray[np.float32],
) -> None:
    """Write the light that is sent for stresses."""
    _heat_colors(share, normals, viewer, light_table(), DARKEST, out)


@numba.njit(cache=True)
def _heat_colors(
    share: NDArray[np.floating[Any]],
    normals: NDArray[np.float32],
    viewer: NDArray[np.float64],
    table: NDArray[np.float32],
    darkest: float,
    out: NDArray[np.float32],
) -> None:
    last = table.shape[0] - 1
    for v in range(out.shape[0]):
        place = min(max(share[v], 0.0), 1.0) * last
        below = min(int(place), last - 1)
        part = place - below
        facing = normals[v, 0] * viewer[0] + normals[v, 1] * viewer[1] + normals[v, 2] * viewer[2]
        turn = min(max(1.0 - max(facing, 0.0), 0.0) / 0.75, 1.0)
        light = 1.0 - (1.0 - darkest) * turn * turn
        for i in range(3):
            out[v, i] = light * (table[below, i] + part * (table[below + 1, i] - table[below, i]))


def heat_legend_html(threshold: float) -> str:
    """Return the heat map's key: its colours, ticks in kPa and where the duct breaks."""
    if not (np.isfinite(threshold) and threshold > 0.0):
        raise ValueError(f"threshold must be above 0 MPa, got {threshold}")
    places = np.linspace(0, len(color_table()) - 1, _STOPS).round().astype(int)
    stops = ",".join(
        f"rgb({red},{green},{blue}) {100.0 * place / places[-1]:.2f}%"
        for place, (red, green, blue) in zip(places, color_table()[places].tolist(), strict=True)
    )
    end = KPA_PER_MPA * threshold
    ticks = "".join(
        f"<span style='position:absolute;left:{100.0 * part:g}%;"
        f"transform:translateX({-100.0 * part:g}%)'>{_figure(part * end, end)}</span>"
        for part in (0.0, 0.25, 0.5, 0.75, 1.0)
    )
    return (
        f"<div data-testid='heat-legend' data-threshold-kpa='{end:.6g}' "
        "style='padding:8px 14px;font-size:12px;line-height:1.35'>"
        "<div style='display:flex;justify-content:space-between'>"
        "<b>Tensile stress at the wall</b><span style='opacity:.75'>kPa</span></div>"
        f"<div style='height:14px;margin-top:6px;border-radius:2px;border-right:3px solid #ff6b5e;"
        f"background:linear-gradient(90deg,{stops})'></div>"
        f"<div style='position:relative;height:16px;margin-top:3px'>{ticks}</div>"
        "<div style='display:flex;justify-content:space-between;margin-top:2px'>"
        "<span><span style='color:#ff6b5e'>&#9614;</span>"
        f"breaks at {_figure(end, end)} kPa</span>"
        f"<span style='opacity:.6'>{html.escape(COLOR_MAP)}</span></div></div>"
    )


def _figure(value: float, end: float) -> str:
    """Return a tick's figure with three digits of the scale's end."""
    digits = max(0, 2 - int(np.floor(np.log10(end))))
    return f"{value:.{digits}f}"
