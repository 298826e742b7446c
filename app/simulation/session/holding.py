"""What still holds a duct that is to be freed, and what to do about it."""

from typing import NamedTuple

import numpy as np

from app.simulation.exercises.goals import FreeLength
from app.simulation.inputs.hand import Hand
from app.simulation.runs.run_file import HANDS
from app.simulation.tissue.spatial_tissue import JAW_RADIUS, SpatialTissue

HALF_MM, REACH_MM = 1.0, 3.0
"""Strands within the first of a station are looked at. A dissector whose jaws are within the second
of it is there; those farther inside both jaws are not parted by them as they open."""
LEAST_MM, OPEN_MM = 0.5, 1.0
"""mm by which a tip is worth being called off its place, and from which on jaws are open."""
WIDE_MM = 25.0
"""mm of jaws that are wide enough: what holds between them then has to be parted anew."""
STEP_MM, LIFT_MM = 2.0, 2.0
"""How far the front runs from a hold before the next one; how high a duct is held up."""
BESIDE_MM = 2.0, 6.0
"""How far from what holds closed jaws are best opened, mm."""


class Holding(NamedTuple):
    """Strands that hold next to what is free, if some have parted, and what to do about them."""

    strands: int
    station: float  # mm from the first clamp
    move: str  # a sentence without its full stop; may be empty


def next_move(duct: SpatialTissue, goal: FreeLength, held_up: bool, station: float | None) -> str:
    """Return what to do next, of what holds at a station, mm, if that is known.

    A duct is freed by a dissector, if a hand has one, while it is `held_up` by the other if that is
    asked for; else by lifts where it still holds.

    Returns
    -------
    str
    """
    hand = next((each for each in duct.hands if each.instrument == "dissector"), None)
    if hand is None:
        return _lift(duct, station)
    if held_up:
        holders = [each for each in duct.hands if each.node is not None]
        if not holders:
            return f"Take hold of the duct in the bracket's middle, and lift it {LIFT_MM:.0f} mm"
        up = max(float(each.place[2]) for each in holders)
        if up < LIFT_MM - LEAST_MM:
            return f"Lift the duct {LIFT_MM - up:.0f} mm more, and leave it there"
    if hand.opening < OPEN_MM:
        return _closed_move(duct, goal, hand, station)
    half, x = 0.5 * hand.opening, float(hand.place[0])
    at = x if station is None else station
    aside = abs(x - at)
    if aside > half + REACH_MM:
        return ""
    if (short := _short(duct, hand, at)) > LEAST_MM:
        return f"Close the jaws (C), and lead them {short:.0f} mm deeper, past what holds"
    wide = x - half <= goal.from_mm and x + half >= goal.to_mm
    if (wide or hand.opening >= WIDE_MM) and aside < half - REACH_MM:
        return "Close the jaws (C), and open them beside the mark: what holds lies between them"
    return f"Press O again and again, slowly: the jaws are {hand.opening:.0f} mm apart"


def _lift(duct: SpatialTissue, station: float | None) -> str:
    """Return whether to take hold, to lift on or to let go."""
    held = next((at for i in range(HANDS) if (at := duct.held_at(i)) is not None), None)
    if held is None:
        first = "at the right end of the bracket" if duct.divided else "in its middle"
        where = first if station is None else "at the mark over it"
        return f"Take hold of the duct {where}, and lift"
    if station is not None and abs(held - station) - HALF_MM > STEP_MM:
        return "Let go, and take hold again at the mark over the duct"
    return "Lift on slowly, until the front has moved by 2 mm"


def _closed_move(duct: SpatialTissue, goal: FreeLength, hand: Hand, station: float | None) -> str:
    """Return where closed jaws are to be led: beside what holds, below the duct, and behind it."""
    x = float(hand.place[0])
    # Between closed jaws strands are not parted as they open.
    low, high = (goal.from_mm, goal.to_mm) if station is None else (station, station)
    if station is not None or not goal.one_stretch:
        near, far = BESIDE_MM if station is not None else (0.0, goal.to_mm)
        off = low - near - x if x < 0.5 * (low + high) else high + near - x
        beside = "what holds" if station is not None else "the scar"
        away = max(low - x, x - high)
        if not near - LEAST_MM <= away <= far:
            side = "right" if off > 0.0 else "left"
            return f"Lead the dissector {abs(off):.0f} mm to the {side}, beside {beside}"
    elif goal.one_stretch:
        room = min(goal.length_mm + REACH_MM, 0.5 * (high - low))
        off = min(max(x, low + room), high - room) - x
        if abs(off) > LEAST_MM:
            side = "right" if off > 0.0 else "left"
            return f"Lead the dissector {abs(off):.0f} mm to the {side}, to where there is room"
    span = duct.tubes.network.tubes[duct.tubes.names[0]].span
    at = min(max(x * duct.surface.scale, 0.0), span)
    axis = duct.beam.places_at(np.array([at]), duct.tubes.names[0])[0]
    down = float(hand.place[2] - axis[2]) + JAW_RADIUS + duct.radius
    if down > LEAST_MM:
        return f"Lead the dissector {down:.0f} mm down, until it is below the duct"
    if (short := _short(duct, hand, x)) > LEAST_MM:
        return (
            f"Lead the dissector {short:.0f} mm into the picture (right button), slowly in tissue"
        )
    return "Press O again and again, slowly: the jaws open behind the duct"


def _short(duct: SpatialTissue, hand: Hand, station: float) -> float:
    """Return how far a tip is short of the farthest strand that holds at a station, mm."""
    surface, beam = duct.surface, duct.beam
    near = np.abs(surface.strands.stations / surface.scale - station) <= HALF_MM
    which = np.flatnonzero(near & (beam.damage[duct.tubes.strands_of[0]] < 1.0))
    if not which.size:
        return 0.0
    ends, feet = beam.strand_ends(which), beam.strand_feet(which)
    # Where they are at the jaws' height.
    span = np.minimum(feet[:, 2] - ends[:, 2], -1e-6)
    down = np.clip((float(hand.place[2]) - ends[:, 2]) / span, 0.0, 1.0)
    across = ends[:, 1] + down * (feet[:, 1] - ends[:, 1])
    return float(across.max()) - float(hand.place[1])
