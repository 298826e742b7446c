"""Round tubes with a waist, and their meshes: organs whose every measure is known."""

import numpy as np
import trimesh
from numpy.typing import NDArray

from organ_geometry.curves.half_curves import HalfCurves, fit_half_curves
from organ_geometry.mesh.skin import Skin
from organ_geometry.organ import Organ

LENGTH = 50.8
RADIUS = 4.445
SECTIONS = 128


def of_row(row: NDArray[np.float64]) -> HalfCurves:
    """The half-curves of a row of sixteen numbers, as `as_row` gives it."""
    return HalfCurves(float(row[0]), float(row[1]), row[2:9], row[9:])


def tube(
    *,
    wall: float | None = None,
    left_handed: bool = False,
    sag: float = 0.0,
    radius: float = RADIUS,
) -> Organ:
    """A round organ along x: solid or with a wall, straight or sagging, either handedness."""
    turn = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)
    circle = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    calibre = np.array([1.0, 0.9, 1.0])
    outer = np.stack([fit_half_curves(radius * fraction * circle).as_row() for fraction in calibre])
    lumen = None
    if wall is not None:
        lumen = np.stack(
            [fit_half_curves((radius * fraction - wall) * circle).as_row() for fraction in calibre]
        )
    axis = np.zeros((SECTIONS, 3))
    axis[:, 0] = np.linspace(0.0, LENGTH, SECTIONS)
    axis[:, 1] = -sag * np.sin(np.pi * axis[:, 0] / LENGTH)
    x_dir = [0.0, 1.0, 0.0] if left_handed else [0.0, -1.0, 0.0]
    frame = np.array([x_dir, [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]).T
    frames = np.broadcast_to(frame, (SECTIONS, 3, 3))
    return Organ(axis, frames, np.array([0, 60, SECTIONS - 1]), outer, lumen)


def mesh_of(skin: Skin, vertices: np.ndarray | None = None) -> trimesh.Trimesh:
    return trimesh.Trimesh(
        skin.vertices if vertices is None else vertices, skin.faces, process=False
    )
