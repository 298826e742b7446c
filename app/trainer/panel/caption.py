"""What hands do now, in a sentence, beside a demonstration."""

import math

from app.anatomy import tube_title
from app.simulation import HOLDING, Hand, SpatialTissue, near_place

NEAR_MM = 12.0
"""mm from a wall within which its tube says where a tip is."""
OPENS_MM, MOVES_MM = 0.1, 0.2
"""mm between two looks from which on jaws open or close, and a tip moves."""


class Caption:
    """A sentence of what hands do, found anew at each look; it stays while they are still."""

    def __init__(self) -> None:
        self.words = ""
        self._places: list[list[float]] = []
        self._openings: list[float] = []
        self._broken = 0

    def look(self, tissue: SpatialTissue) -> None:
        """Compare the hands with how they were at the last look."""
        hands, places, openings, broken = tissue.hands, self._places, self._openings, self._broken
        self._places = [hand.place.tolist() for hand in hands]
        self._openings = [hand.opening for hand in hands]
        self._broken = tissue.broken
        if len(places) != len(hands):
            return
        opened = [hand.opening - each for hand, each in zip(hands, openings, strict=True)]
        moved = [math.dist(a, b) for a, b in zip(self._places, places, strict=True)]
        i = max(range(len(hands)), key=lambda each: (abs(opened[each]) > OPENS_MM, moved[each]))
        if abs(opened[i]) > OPENS_MM or moved[i] > MOVES_MM:
            self.words = _sentence(tissue, hands[i], opened[i], parts=tissue.broken > broken)


def _sentence(tissue: SpatialTissue, hand: Hand, opened: float, *, parts: bool) -> str:
    names, tool = tissue.tubes.names, hand.instrument
    if hand.node is not None:
        return f"The {tool} draws the {tube_title(names[hand.tube])}."
    does = "is led"
    if opened > OPENS_MM:
        does = "opens its jaws"
    elif opened < -OPENS_MM:
        does = "closes its jaws"
    elif parts and tool not in HOLDING:
        does = "parts strands"
    near = near_place(tissue.beam, hand.place, NEAR_MM)
    where = "" if near is None else f" beside the {tube_title(names[near[0]])}"
    return f"The {tool} {does}{where}."


def reached_words(standing: str) -> str:
    """Return the points of the critical view that are reached, of how far an exercise has come."""
    first, *more = standing.split("; ")
    reached = [each for each in more if ", 0 of" not in each]
    return "; ".join([first, *reached])
