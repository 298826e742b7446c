"""What hands do now and by which key or button, in a sentence, beside a demonstration."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from app.anatomy import tube_title
from app.simulation import HOLDING, Hand, SpatialTissue, near_place

NEAR_MM = 6.0
"""mm from a wall within which its tube says where a tip is."""
OPENS_MM, MOVES_MM = 0.1, 0.2
"""mm between two looks from which on jaws open or close, and a tip moves."""
ALONG = 0.8
"""Of a move, from which on it goes into the picture or along a shaft."""


class Caption:
    """A sentence of what hands do, found anew at each look; it stays while they are still."""

    def __init__(self) -> None:
        self.words = ""
        self._places = np.zeros((0, 3))
        self._openings = np.zeros(0)
        self._broken = self._clips = 0

    def look(self, tissue: SpatialTissue) -> None:
        """Compare the hands with how they were at the last look."""
        places, openings, broken, clips = self._places, self._openings, self._broken, self._clips
        hands, self._broken = tissue.hands, tissue.broken
        self._places = np.array([hand.place for hand in hands])
        self._openings = np.array([hand.opening for hand in hands])
        clipped = [each.tube for each in tissue.events if each.kind == "clip"]
        self._clips = len(clipped)
        if len(places) != len(hands):
            return
        if len(clipped) > clips:
            self.words = f"The clip applier clips the {tube_title(clipped[-1])} (G)."
            return
        opened, moves = self._openings - openings, self._places - places
        moved = np.sqrt((moves**2).sum(axis=1))
        i = max(range(len(hands)), key=lambda each: (abs(opened[each]) > OPENS_MM, moved[each]))
        if abs(opened[i]) > OPENS_MM:
            at_bed, opens = tissue.specimen.anatomy is None, opened[i] > 0.0
            does = "opens" if opens else "closes" if hands[i].opening < OPENS_MM else "narrows"
            does = f"{does} its jaws ({'G' if not at_bed else 'O' if opens else 'C'})"
        elif moved[i] <= MOVES_MM:
            return
        elif tissue.broken > broken and hands[i].instrument not in HOLDING:
            does = "parts strands"
        else:
            does = _led(tissue, hands[i], moves[i] / moved[i])
        self.words = _sentence(tissue, hands[i], does)


def _led(tissue: SpatialTissue, hand: Hand, direction: NDArray[np.float64]) -> str:
    """Return how a hand is led in a direction, (3,), and by what."""
    if tissue.specimen.anatomy is None:
        into, by = float(direction[1]), "picture (right button)"
    else:
        into, by = -float(direction @ np.array(hand.aim)), "tissue along its shaft (wheel)"
    if abs(into) < ALONG:
        return "is led (drag)"
    return f"is led into the {by}" if into > 0.0 else f"is led out of the {by}"


def _sentence(tissue: SpatialTissue, hand: Hand, does: str) -> str:
    names, tool = tissue.tubes.names, hand.instrument
    if hand.node is not None:
        return f"The {tool} draws the {tube_title(names[hand.tube])}: take hold, then drag."
    near = near_place(tissue.beam, hand.place, NEAR_MM)
    where = "" if near is None else f" beside the {tube_title(names[near[0]])}"
    return f"The {tool} {does}{where}."


def reached_words(standings: Sequence[str]) -> str:
    """Return the points of the critical view that are reached, of how far an exercise has come."""
    first, *more = standings
    reached = [each for each in more if ", 0 of" not in each]
    return "; ".join([first, *reached])
