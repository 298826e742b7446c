"""What still holds a duct that is to be freed, and what to do about it."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.simulation.exercises.goals import FreeLength
from app.simulation.inputs.hand import Hand
from app.simulation.runs.run_file import HANDS
from app.simulation.tissue.instruments import JAW_RADIUS, MOST_OPENING
from app.simulation.tissue.spatial_tissue import SpatialTissue

NEAR_MM = 2.0
"""Strands within this distance of a station are taken together, mm."""
REACH_MM = 3.0
"""How much farther than the strands jaws are to open, mm: strands lean."""
LEAST_MM, OPEN_MM = 0.5, 1.0
"""A tip farther than the first from its place is not there; jaws farther apart than the second are
open; mm."""
SHORT_MM = 1.0
"""Open jaws that end this far before the strands do not reach them, mm."""
STEP_MM = 2.0
"""How far the front may run from a hold before the next hold, mm."""
LIFT_MM = 2.5
"""How high a duct is held up, mm."""
BESIDE_MM = 3.5, 5.5
"""How far from a scar closed jaws are best opened, mm: nearer, some of it lies between them."""
CLEAR_MM = JAW_RADIUS + 1.0, 5.5
"""The same from strands that hold, which lean, at the jaws' height."""
NEAR_BREAK = 0.5
"""Part of the break above which one lifts half as fast."""


class Move(NamedTuple):
    """What to do next."""

    words: str  # a sentence without its full stop; may be empty
    to: tuple[float, float, float] | None = None  # mm, where a dissector's tip is to be led


class Holding(NamedTuple):
    """Strands that hold next to what is free, if some have parted, and what to do about them."""

    strands: int
    station: float  # mm from the first clamp, where what is free ends
    move: Move


class _Strands(NamedTuple):
    """Where strands that hold are at the height of jaws, mm: along the duct and across it."""

    along: NDArray[np.float64]
    across: NDArray[np.float64]

    @classmethod
    def between(cls, duct: SpatialTissue, hand: Hand, low: float, high: float) -> "_Strands":
        """Return those that hold the duct between stations, mm."""
        surface, beam = duct.surface, duct.beam
        stations = surface.strands.stations / surface.scale
        near = (stations >= low) & (stations <= high)
        which = np.flatnonzero(near & (beam.damage[duct.tubes.strands_of[0]] < 1.0))
        ends, feet = beam.strand_ends(which), beam.strand_feet(which)
        span = np.minimum(feet[:, 2] - ends[:, 2], -1e-6)
        down = np.clip((float(hand.place[2]) - ends[:, 2]) / span, 0.0, 1.0)
        at = ends + down[:, None] * (feet - ends)
        return cls(at[:, 0], at[:, 1])

    def beyond(self, hand: Hand) -> float:
        """Return how far a tip is short of the farthest, mm."""
        return float(self.across.max() - hand.place[1]) if self.across.size else 0.0


def next_move(duct: SpatialTissue, goal: FreeLength, held_up: bool, station: float | None) -> Move:
    """Return what to do next, of what holds at a station, mm, if that is known.

    A duct is freed by a dissector, if a hand has one, while it is `held_up` by the other if that is
    asked for; else by lifts where it still holds.

    Returns
    -------
    Move
    """
    hand = next((each for each in duct.hands if each.instrument == "dissector"), None)
    if hand is None:
        return Move(_lift(duct, station))
    if held_up:
        holders = [each for each in duct.hands if each.node is not None]
        if not holders:
            return Move(
                f"Take hold of the duct in the bracket's middle, and lift it {LIFT_MM:g} mm"
            )
        up = max(float(each.place[2]) for each in holders)
        if up < LIFT_MM - LEAST_MM:
            return Move(f"Lift the duct {math.ceil(LIFT_MM - up)} mm more, and leave it there")
    if hand.opening < OPEN_MM:
        return _closed_move(duct, goal, hand, station)
    if hand.closes:
        return Move(f"Close the jaws wholly (hold C): they are {hand.opening:.0f} mm apart")
    half, x = 0.5 * hand.opening, float(hand.place[0])
    at = x if station is None else station
    short = _Strands.between(duct, hand, at - NEAR_MM, at + NEAR_MM).beyond(hand)
    if short > SHORT_MM:
        return Move(
            f"Close the jaws (hold C), and lead them {short:.0f} mm deeper, past what holds"
        )
    wide = half >= max(abs(goal.from_mm - x), abs(goal.to_mm - x)) + REACH_MM
    between = abs(x - at) < half - NEAR_MM
    if (wide and between) or hand.opening >= MOST_OPENING:
        return Move("Close the jaws (hold C), to open them anew beside what holds")
    return Move(f"Hold O down: the jaws are {hand.opening:.0f} of {MOST_OPENING:.0f} mm apart")


def _lift(duct: SpatialTissue, station: float | None) -> str:
    """Return whether to take hold, to lift on or to let go."""
    held = next((at for i in range(HANDS) if (at := duct.held_at(i)) is not None), None)
    if held is None:
        first = "at the right end of the bracket" if duct.divided else "in its middle"
        where = first if station is None else "at the mark over it"
        return f"Take hold of the duct {where}, and lift"
    if station is not None and abs(held - station) > STEP_MM:
        return "Let go, and take hold again at the mark over the duct"
    if duct.stress_ratio > NEAR_BREAK:
        return "Lift on half as fast: the wall is past half of its break"
    return f"Lift on slowly, until the front has moved by {STEP_MM:.0f} mm"


def _closed_move(duct: SpatialTissue, goal: FreeLength, hand: Hand, station: float | None) -> Move:
    """Return where closed jaws are to be led: beside what holds, below the duct, and behind it."""
    x, y, z = hand.place.tolist()
    # Between closed jaws strands are not parted as they open.
    low, high, (near, far), beside = goal.from_mm, goal.to_mm, BESIDE_MM, "beside the scar"
    if station is not None:
        low, high = max(low, station - NEAR_MM), min(high, station + NEAR_MM)
        along = _Strands.between(duct, hand, low, high).along
        if along.size:
            low, high = float(along.min()), float(along.max())
        (near, far), beside = CLEAR_MM, "beside what holds"
    aside = 0.0
    if goal.one_stretch and station is None:
        room = min(goal.length_mm + REACH_MM, 0.5 * (high - low))
        aside, beside = min(max(x, low + room), high - room) - x, "to where there is room"
    elif not near - LEAST_MM <= max(low - x, x - high) <= far:
        aside = low - near - x if x < 0.5 * (low + high) else high + near - x
    if abs(aside) > LEAST_MM:
        side = "right" if aside > 0.0 else "left"
        words = f"Lead the dissector {math.ceil(abs(aside))} mm to the {side}, {beside}"
        return Move(words, (x + aside, y, z))
    span = duct.tubes.network.tubes[duct.tubes.names[0]].span
    at = min(max(x * duct.surface.scale, 0.0), span)
    axis = duct.beam.places_at(np.array([at]), duct.tubes.names[0])[0]
    down = z - float(axis[2]) + JAW_RADIUS + duct.radius
    if down > LEAST_MM:
        words = f"Lead the dissector {math.ceil(down)} mm down, until it is below the duct"
        return Move(words, (x, y, z - down))
    # Behind all that its jaws are to part.
    reach = goal.length_mm + REACH_MM
    ahead = (x - reach, x + reach) if goal.one_stretch else (min(x, low), max(x, high))
    short = _Strands.between(duct, hand, *ahead).beyond(hand)
    if short > 0.0:
        words = f"Lead the dissector {math.ceil(short)} mm into the picture (right button, upwards)"
        return Move(f"{words}, slowly in tissue", (x, y + short, z))
    return Move("Hold O down: the jaws open behind the duct")
