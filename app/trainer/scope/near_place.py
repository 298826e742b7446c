"""Which tube is at an instrument's tip, and where jaws that hold one are."""

import numpy as np
from numpy.typing import NDArray

from app.simulation import TROCARS, SpatialTissue
from physics.bed import BeamOnBed

__all__ = ["REACH", "near_place", "wall_offset"]

Floats = NDArray[np.float64]

REACH = 3.5
"""mm from a tube's wall at which jaws can still close on it."""
BITE = 1.2
"""mm of a wall that jaws take in."""


def near_place(beam: BeamOnBed, tip: Floats, reach: float = REACH) -> tuple[int, float] | None:
    """Return the number of the tube at a tip, (3,) mm, and the station; None out of reach."""
    # Distances are from walls: within them they are below zero, and the deepest counts.
    best, found = reach, None
    for number, (name, tube) in enumerate(beam.network.tubes.items()):
        places = beam.places[beam.nodes_of(name)]
        chord = np.diff(places, axis=0)
        square = np.maximum((chord**2).sum(axis=1), 1e-12)
        fraction = np.clip(((tip - places[:-1]) * chord).sum(axis=1) / square, 0.0, 1.0)
        off = np.sqrt((((places[:-1] + fraction[:, None] * chord) - tip) ** 2).sum(axis=1))
        off -= tube.radius[:-1] + fraction * np.diff(tube.radius)
        k = int(off.argmin())
        if off[k] < best:
            stations = beam.stations_of(name)
            best = float(off[k])
            found = number, float(stations[k] + fraction[k] * (stations[k + 1] - stations[k]))
    return found


def wall_offset(tissue: SpatialTissue, hand: int) -> Floats:
    """(3,) mm from the axis that a hand holds to its jaws on the wall; zero of an empty hand."""
    holder = tissue.hands[hand]
    if holder.node is None:
        return np.zeros(3)
    name = tissue.tubes.names[holder.tube]
    at = int(np.flatnonzero(tissue.beam.nodes_of(name) == holder.node)[0])
    radius = float(tissue.tubes.network.tubes[name].radius[at])
    return max(radius - BITE, 0.0) * TROCARS[hand].shaft(holder.place)
