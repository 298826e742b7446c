"""Organs of circular sections: tubes of which no more is known than an axis and radii."""

import numpy as np
from numpy.typing import NDArray

from organ_geometry.curves.half_curves import fit_half_curves
from organ_geometry.organ import Organ
from organ_geometry.reslice.curve_frames import rotation_minimising_frames


def round_organ(axis: NDArray[np.float64], radii: NDArray[np.float64], name: str = "") -> Organ:
    """Return the solid organ of circles across an axis.

    Parameters
    ----------
    axis, radii
        (S, 3) points, mm, and (S,) outer radii there, mm.
    name
        The organ's.

    Returns
    -------
    Organ
        With a key section at every point.
    """
    tangents = np.gradient(axis, axis=0)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    across = np.eye(3)[int(np.abs(tangents[0]).argmin())]
    angles = np.linspace(0.0, 2.0 * np.pi, 256, endpoint=False)
    circle = fit_half_curves(np.stack([np.cos(angles), np.sin(angles)], axis=1)).as_row()
    return Organ(
        axis=axis,
        frames=rotation_minimising_frames(axis, tangents, across),
        keys=np.arange(len(axis)),
        outer=np.outer(radii, circle),
        name=name,
    )
