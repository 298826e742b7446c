"""The hook-like grasper: a steel wire that curls under the duct, on an insulated shaft."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from app.trainer.stage.clamps import INSULATION, steel
from app.trainer.stage.solids import Piece, Solid, solids_glb, swept_solid

TIP_ANGLE = -0.45
"""Angle of the wire's end on the viewer's side, rad; half pi is straight below the duct."""
LEAN = np.array([0.40, 0.14, 0.90]) / np.linalg.norm([0.40, 0.14, 0.90])
"""Direction of the shaft."""
LIFT_AFTER_TEAR = 2.5
"""Height of the hook above where the torn duct lay, in radii."""
SHAFT_LENGTH = 320.0
"""mm of an instrument that is drawn: out of every picture."""
_NECK = 2.6
_PRESS = 0.15


def wire_radius(radius: float) -> float:
    """Return the radius of the hook's wire."""
    return 0.5 + 0.07 * radius


def bend_radius(radius: float) -> float:
    """Return the radius of the hook's bend, to the middle of its wire."""
    return radius + wire_radius(radius) - _PRESS


@lru_cache(maxsize=16)  # a few ducts; trainees can build any number
def hook_glb(radius: float, *, detail: float = 1.0) -> bytes:
    """Return the hook as a GLB file, mm, for a pull along +z, its origin on the duct's axis."""
    # From the tip, which shows on the viewer's side, the wire runs around the underside to the far
    # side and up into a shaft that leans to the right and out of the picture.
    corners = max(8, round(20 * detail))
    wire, count = wire_radius(radius), max(14, round(30 * detail))
    path = _wire_path(radius, count)
    radii = np.interp(np.arange(len(path)), [0, 5], [0.82 * wire, wire])

    root = path[-1]
    taper = np.linspace(0.0, 1.0, 14)
    swelling = taper * taper * (3.0 - 2.0 * taper)
    ferrule = root + (7.0 * taper[:, None] - 1.0) * LEAN
    steps = np.concatenate([[5.0, 5.3, 5.8], np.linspace(12.0, SHAFT_LENGTH, 6)])
    shaft = root + steps[:, None] * LEAN
    return solids_glb(
        [
            Piece(swept_solid(path, radii, side=(1.0, 0.0, 0.0), corners=corners), steel(detail)),
            Piece(
                swept_solid(ferrule, wire + (1.85 - wire) * swelling, corners=corners),
                steel(detail),
            ),
            Piece(
                swept_solid(shaft, [2.05, 2.2, 2.25, *[2.25] * 6], corners=corners),
                INSULATION,
            ),
        ]
    )


def grip_solid(radius: float) -> Solid:
    """Return a coarse bar around the hook's neck and shaft, for a mouse to pick."""
    wire, path = wire_radius(radius), _wire_path(radius, 14)
    above = path[-1] + np.array([[4.0], [40.0]]) * LEAN
    return swept_solid(np.concatenate([path, above]), 1.5 * wire, corners=6, cap_rings=1)


def _wire_path(radius: float, count: int) -> NDArray[np.float64]:
    """Return the middle of the wire, from its tip around below the duct to the shaft, mm."""
    bend = bend_radius(radius)
    angles = np.linspace(TIP_ANGLE, np.pi, count, dtype=np.float64)
    arc = np.stack([0.0 * angles, -bend * np.cos(angles), -bend * np.sin(angles)], axis=-1)
    turns = np.linspace(0.0, 1.0, 16)[1:, None]
    directions = (1.0 - turns) * np.array([0.0, 0.0, 1.0]) + turns * LEAN
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    neck = arc[-1] + np.cumsum(directions, axis=0) * (_NECK * radius / len(turns))
    return np.concatenate([arc, neck])
