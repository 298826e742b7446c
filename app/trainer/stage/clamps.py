"""The two clamps that hold the duct's ends: jaws above and below, on shafts that leave the picture.

Lengths in this module are in duct radii until the last step, so that a thin duct gets a small
clamp.
"""

from functools import lru_cache
from typing import Literal

import numpy as np

from app.trainer.stage.solids import (
    Piece,
    Solid,
    joined_solid,
    smooth_path,
    solids_glb,
    swept_solid,
)
from organ_geometry.mesh import Finish, vertex_normals

STEEL = Finish(color=(176, 181, 188), roughness=0.30, metallic=0.7)
# Steel for a stage without an environment map, where polished metal reflects nothing.
MATT_STEEL = Finish(color=(150, 154, 160), roughness=0.45, metallic=0.25)

INSULATION = Finish(color=(24, 26, 30), roughness=0.42, metallic=0.1, clearcoat=0.2)

JAW_REACH = 0.5
"""How far the jaws reach over the duct's end, in duct radii."""

JAW_LENGTH = 2.7
"""From the duct's end back to the hinge, in duct radii."""

_SHAFT_LEAN = np.array([-0.93, 0.30, 0.20])
_SHAFT_LENGTH = 60.0
_RIBS = 5
STUB = (
    (0.12, 1.0, 1.0),
    (0.45, 1.03, 0.96),
    (0.85, 1.06, 0.62),
    (1.25, 1.0, 0.36),
    (1.6, 0.8, 0.2),
)
"""Rings of the tissue between a clamp's jaws: distance behind the wall's end, in radii, and width
and height over those of the end."""
# Where the cuff meets the duct, radii.
_CUFF_FACE = -0.05
_IN_SHADE = 0.86
_ROUND_BITE = 0.8  # with this bite or more, the duct's ends count as round


@lru_cache(maxsize=16)  # a few ducts; trainees can build any number
def clamp_glb(
    end: Literal["first", "second"],
    *,
    radius: float,
    bite: float,
    tissue: tuple[int, int, int],
    detail: float = 1.0,
) -> bytes:
    """Return one clamp and the pinched tissue in its mouth, as a GLB file."""
    corners = max(10, round(16 * detail))
    pieces = [
        Piece(_steel_solid(bite, corners), steel(detail)),
        Piece(_shaft_solid(corners), INSULATION),
        Piece(_cuff_solid(bite, corners), _cuff_finish(tissue, detail)),
    ]
    mirrored = end == "second"
    return solids_glb(
        [Piece(_placed(piece.solid, radius, mirrored=mirrored), piece.finish) for piece in pieces]
    )


def steel(detail: float) -> Finish:
    """Return the finish of steel at a level of detail."""
    return STEEL if detail >= 1.0 else MATT_STEEL


def _cuff_finish(tissue: tuple[int, int, int], detail: float) -> Finish:
    """Return the finish of the pinched tissue, which lies in the jaws' shade."""
    if detail < 1.0:
        return Finish(color=tissue, roughness=1.0)
    red, green, blue = (round(_IN_SHADE * channel) for channel in tissue)
    return Finish(color=(red, green, blue), roughness=0.46, clearcoat=0.8, clearcoat_roughness=0.17)


def _steel_solid(bite: float, corners: int) -> Solid:
    """Return jaws, ribs, hinge and ferrule of the first clamp."""
    solids: list[Solid] = []
    for up in (1.0, -1.0):
        jaw = smooth_path(
            [
                [JAW_REACH - 0.25, 0.0, up * (bite + 0.30)],
                [-0.35, 0.0, up * (bite + 0.28)],
                [-1.25, 0.0, up * 0.50],
                [-JAW_LENGTH, 0.0, up * 0.27],
            ],
            22,
        )
        along = np.linspace(0.0, 1.0, len(jaw))
        solids.append(
            swept_solid(
                jaw,
                np.interp(along, [0.0, 0.15, 0.45, 1.0], [0.80, 0.90, 0.90, 0.5]),
                np.interp(along, [0.0, 0.2, 0.6, 1.0], [0.24, 0.30, 0.36, 0.34]),
                squareness=0.5,
                corners=corners,
            )
        )
        solids.extend(
            swept_solid(
                [[x, -0.8, up * (bite + 0.02)], [x, 0.0, up * (bite + 0.02)], [x, 0.8, up * bite]],
                0.075,
                side=(1.0, 0.0, 0.0),
                corners=8,
                cap_rings=2,
            )
            for x in np.linspace(JAW_REACH - 0.2, -0.4, _RIBS)
        )
    hinge = -JAW_LENGTH + 0.1
    solids.append(
        swept_solid(
            [[hinge, -0.72, 0.0], [hinge, 0.0, 0.0], [hinge, 0.72, 0.0]],
            0.24,
            side=(1.0, 0.0, 0.0),
            corners=corners,
        )
    )
    for y in (-0.56, 0.56):
        plate = np.array([[hinge + 0.25, y, 0.0], [hinge - 0.4, y, 0.0], [hinge - 1.3, y * 0.6, 0]])
        solids.append(swept_solid(plate, 0.13, [0.36, 0.52, 0.56], squareness=0.3, corners=corners))
    wrist = np.array([hinge - 1.0, 0.0, 0.0])
    ferrule = [wrist, wrist + 0.4 * _SHAFT_LEAN, wrist + 1.5 * _SHAFT_LEAN, wrist + 2 * _SHAFT_LEAN]
    solids.append(swept_solid(ferrule, [0.50, 0.64, 0.68, 0.68], corners=corners))
    return joined_solid(solids)


def _shaft_solid(corners: int) -> Solid:
    """Return the insulated shaft of the first clamp, long enough to leave any picture."""
    start = np.array([-JAW_LENGTH - 0.9, 0.0, 0.0]) + 1.4 * _SHAFT_LEAN
    steps = np.linspace(0.0, _SHAFT_LENGTH, 8)[:, None]
    return swept_solid(start + steps * _SHAFT_LEAN, 0.76, corners=corners)


def _cuff_solid(bite: float, corners: int) -> Solid:
    """Return the tissue between the jaws, just inside the stub that carries the wall on."""
    reach = [0.0, *(behind for behind, _, _ in STUB)]
    wide, high = [1.0, *(width for _, width, _ in STUB)], [1.0, *(height for *_, height in STUB)]
    x = np.linspace(_CUFF_FACE, -1.6, 12)
    path = np.stack([x, np.zeros_like(x), np.zeros_like(x)], axis=-1)
    spread = 0.95 * (0.99 + 0.7 * max(0.0, _ROUND_BITE - bite))
    cuff = swept_solid(
        path,
        spread * np.interp(-x, reach, wide),
        0.9 * min(bite, 0.97) * np.interp(-x, reach, high),
        corners=corners,
    )
    return _blunted(cuff, _CUFF_FACE)


def _blunted(solid: Solid, x: float) -> Solid:
    """Return a solid whose rounded end beyond x is nearly flat."""
    vertices = solid.vertices.copy()
    beyond = vertices[:, 0] > x
    vertices[beyond, 0] = x + 0.05 * (vertices[beyond, 0] - x)
    return Solid(vertices, solid.faces, vertex_normals(vertices, solid.faces, welded=True))


def _placed(solid: Solid, radius: float, *, mirrored: bool) -> Solid:
    """Return the solid in mm, mirrored in x for the second clamp."""
    flip = np.array([-1.0 if mirrored else 1.0, 1.0, 1.0])
    return Solid(
        solid.vertices * radius * flip,
        solid.faces[:, ::-1] if mirrored else solid.faces,
        solid.normals * flip,
    )
