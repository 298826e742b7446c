"""Which tube is at a tip or is pointed at, and where jaws take a wall."""

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from physics.bed import BeamOnBed

Floats = NDArray[np.float64]

REACH = 3.5
"""mm from a tube's wall at which jaws can still close on it."""
MISSED = 0.5
"""mm beside a wall at which it is still pointed at, where nothing else is."""
Side = Literal["in front of", "behind", "beside"]
"""Of a tube, as it is seen."""
BESIDE = math.sin(math.radians(30.0))
"""Sine of the angle with the picture's plane within which a tip is beside a tube."""
BITE = 1.2
"""mm of a wall that jaws take in."""


def near_place(beam: BeamOnBed, tip: Floats, reach: float = REACH) -> tuple[int, float] | None:
    """Return the number of the tube at a tip, (3,) mm, and the station; None out of reach."""
    distance, number, station = nearest_wall(beam, tip)
    return (number, station) if distance < reach else None


def nearest_wall(beam: BeamOnBed, tip: Floats, only: str | None = None) -> tuple[float, int, float]:
    """Return how far a tip, (3,) mm, is from the nearest wall, or a tube's; tube and station."""
    # Within a wall the distance is below zero, and the deepest counts.
    best, found = math.inf, (0, 0.0)
    for number, (name, tube) in enumerate(beam.network.tubes.items()):
        if only not in {None, name}:
            continue
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
    return best, *found


def fine_axis(beam: BeamOnBed, name: str) -> tuple[Floats, Floats]:
    """Return stations along a tube, (n,) mm, and where its axis is there, (n, 3) mm."""
    # Elements in fifths: an axis between two nodes is nearly straight.
    stations = beam.stations_of(name)
    fifths = stations[:-1] + np.arange(5)[:, None] / 5.0 * np.diff(stations)
    fine = np.append(np.sort(fifths.ravel()), stations[-1])
    return fine, beam.places_at(fine, name)


def wall_gap(
    beam: BeamOnBed,
    name: str,
    place: Floats,
    *sides: tuple[Floats, float, float],
    step: float = 0.5,
) -> float:
    """Return how far a tube's wall is from the axis of a rod, or from what jaws sweep, mm.

    Parameters
    ----------
    beam, name
        Of which tube.
    place
        (3,) mm, from which that goes.
    *sides
        (3,) unit directions across each other, and from and to how many mm it goes along each.
    step
        mm between the places of the tube's axis that are looked at.

    Returns
    -------
    float
        Below zero where it is within the wall.
    """
    tube = beam.network.tubes[name]
    stations = np.arange(0.0, tube.span, step)
    off = beam.places_at(stations, name) - place
    for direction, low, high in sides:
        off -= np.clip(off @ direction, low, high)[:, None] * direction
    gaps = np.sqrt((off**2).sum(axis=1)) - np.interp(stations, tube.stations, tube.radius)
    return float(gaps.min())


def seen_beside(
    beam: BeamOnBed, tip: Floats, axes: Floats, only: str | None = None
) -> tuple[float, int, Side]:
    """Return how far a tip, (3,) mm, is from the nearest wall, which tube's, and its side of it.

    Of the tube `only`, if it is given. The picture's axes are columns: right, up, and back to the
    eye.

    Returns
    -------
    tuple
        mm, the number of the tube, and the side.
    """
    far, number, station = nearest_wall(beam, tip, only)
    name = list(beam.network.tubes)[number]
    off = tip - beam.places_at(np.array([station]), name)[0]
    back = float(off @ axes[:, 2])
    if abs(back) < BESIDE * math.sqrt(float((off * off).sum())):
        return far, number, "beside"
    return far, number, "in front of" if back > 0.0 else "behind"


def pointed_at(beam: BeamOnBed, eye: Floats, direction: Floats) -> tuple[int, float] | None:
    """Return the number of the tube seen first along a direction, (3,), and the station, mm."""
    direction = direction / math.sqrt(float((direction * direction).sum()))
    least, found = (math.inf, math.inf), None
    for number, (name, tube) in enumerate(beam.network.tubes.items()):
        stations = beam.stations_of(name)
        fine = np.linspace(0.0, float(stations[-1]), 4 * len(stations))
        offset = beam.places_at(fine, name) - eye
        deep = (offset * direction).sum(axis=1)
        radius = np.interp(fine, tube.stations, tube.radius)
        off = np.sqrt(((offset - deep[:, None] * direction) ** 2).sum(axis=1))
        wall = deep - np.sqrt(np.maximum(radius**2 - off**2, 0.0))
        # A finger is less exact than a mouse: what is missed by little is meant, if none is met.
        missed = np.maximum(off - radius, 0.0)
        missed[(missed > MISSED) | (deep <= 0.0)] = math.inf
        at = int(np.lexsort((wall, missed))[0])
        this = float(missed[at]), float(wall[at])
        if this[0] < math.inf and this < least:
            least, found = this, (number, float(fine[at]))
    return found


def jaws_on_wall(off: Floats, shaft: Floats, radius: float) -> Floats:
    """Return where jaws take a tube's wall, (3,) mm from its axis.

    Parameters
    ----------
    off
        (3,) mm from the axis to the tip as they close.
    shaft
        (3,) direction from the tip back along the shaft.
    radius
        Of the tube there, mm.

    Returns
    -------
    NDArray
        Nowhere deeper in the wall than jaws bite.
    """
    deep, square = max(radius - BITE, 0.0), float(off @ off)
    if square > deep**2:
        return off * (deep / math.sqrt(square))
    # Within the wall they come back along their shaft until they are in it.
    along = float(off @ shaft)
    return off + (math.sqrt(along**2 - square + deep**2) - along) * shaft
