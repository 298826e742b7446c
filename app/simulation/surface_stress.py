"""The stress at an organ's surface: what a beam carries, read at each vertex's own fibre."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.simulation.dissection import Dissection
from organ_geometry.skin import Skin
from physics import Equilibrium

__all__ = ["SurfaceStress", "fibres", "surface_stress"]


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceStress:
    """Stresses at V vertices.

    Attributes
    ----------
    normal
        (V,) tension over the section, MPa.
    bending
        (V,) bending stress, MPa; above zero where bending stretches.
    total
        (V,) their sum, MPa.
    distance_to_break
        (V,) 1 without stress, 0 at the threshold, below zero past it.
    """

    normal: NDArray[np.float64]
    bending: NDArray[np.float64]
    total: NDArray[np.float64]
    distance_to_break: NDArray[np.float64]


def fibres(dissection: Dissection, skin: Skin) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return where on the beam each vertex of a skin is, and how far out in its section.

    Parameters
    ----------
    dissection
        The organ between its clamps.
    skin
        The skin of the organ, or of a piece of it.

    Returns
    -------
    tuple[NDArray[np.float64], NDArray[np.float64]]
        (V,) distances from the first clamp, mm, and (V,) signed distances from the organ's axis
        along the pull in fibre distances of the section there, from -1 to 1.
    """
    direction = dissection.frame[:, 2]
    # Stations of an even ring repeat for each of its vertices: solve each section once.
    stations, ring = np.unique(skin.stations, return_inverse=True)
    organ = dissection.organ
    if len(stations) > organ.stations.size:  # ragged rims: sections between are linear enough
        stations, ring = organ.stations, None
    reach = organ.section_properties(stations, direction=direction).fibre_distance
    reach = np.interp(skin.stations, stations, reach) if ring is None else reach[ring]
    out = (skin.vertices - organ.axis_at(skin.stations)) @ direction
    return skin.stations - dissection.clamps[0], np.clip(out / reach, -1.0, 1.0)


def surface_stress(
    pulled: Equilibrium,
    stations: NDArray[np.float64],
    fibre: NDArray[np.float64],
    *,
    span: float,
    threshold: float,
) -> SurfaceStress:
    """Return the stresses at an organ's surface.

    Plane sections stay plane, so the bending stress is linear across a section: at its outermost
    fibre that of the beam, `Equilibrium.bending_stress`, and of opposite sign on the other side.

    Parameters
    ----------
    pulled
        The beam, sampled at growing stations that hold the clamps and the grasp.
    stations
        (V,) distances of the vertices from the first clamp, mm; nothing is stressed behind a clamp.
    fibre
        (V,) distances from the axis along the pull in fibre distances, from -1 to 1 (`fibres`).
    span
        Length between the clamps, mm.
    threshold
        Stress at which the organ tears, MPa.

    Returns
    -------
    SurfaceStress
        The stresses.
    """
    # Above zero, a moment stretches the side away from the pull.
    outermost = -np.sign(pulled.moment) * pulled.bending_stress
    between = (stations >= 0.0) & (stations <= span)
    normal = between * np.interp(stations, pulled.stations, pulled.normal_stress)
    bending = between * np.interp(stations, pulled.stations, outermost) * fibre
    total = normal + bending
    return SurfaceStress(normal, bending, total, 1.0 - total / threshold)
