"""What still holds a duct that is to be freed, and why a dissector there leaves it whole."""

from typing import NamedTuple

import numpy as np

from app.simulation.tissue.spatial_tissue import SpatialTissue

HALF_MM, REACH_MM = 1.0, 3.0
"""Strands within the first of a station are looked at. A dissector whose jaws are within the second
of it is there; those farther inside both jaws are not parted by them as they open."""
LEAST_SHORT = 0.5
"""mm by which a tip is worth being called short."""


class Holding(NamedTuple):
    """Strands that hold next to what is free."""

    strands: int
    station: float  # mm from the first clamp
    why: str  # why the dissector leaves them whole, and what to do; empty where none is there


def why_left(duct: SpatialTissue, station: float) -> str:
    """Return why a dissector at a station, mm, leaves whole what holds there; empty without one."""
    surface, beam = duct.surface, duct.beam
    near = np.abs(surface.strands.stations / surface.scale - station) <= HALF_MM
    which = np.flatnonzero(near & (beam.damage[duct.tubes.strands_of[0]] < 1.0))
    if not which.size:
        return ""
    ends, feet = beam.strand_ends(which), beam.strand_feet(which)
    for hand in duct.hands:
        x, y, z = hand.place.tolist()
        aside = abs(x - station)
        if hand.instrument != "dissector" or aside > 0.5 * hand.opening + REACH_MM or z > 0.0:
            continue
        # Where they are at the jaws' height.
        span = np.minimum(feet[:, 2] - ends[:, 2], -1e-6)
        down = np.clip((z - ends[:, 2]) / span, 0.0, 1.0)
        across = ends[:, 1] + down * (feet[:, 1] - ends[:, 1])
        short = float(across.max()) - y
        if short > LEAST_SHORT:
            return f"The dissector's tip is {short:.0f} mm short of them: lead it deeper"
        if aside < 0.5 * hand.opening - REACH_MM:
            return "They lie between the jaws: close these, and open them beside there"
    return ""
