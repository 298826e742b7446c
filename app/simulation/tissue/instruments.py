"""Instruments: the rods of the beam that they are, and how they touch it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.simulation.inputs.hand import Hand
from app.simulation.inputs.inputs import Instrument
from app.simulation.runs.run_file import HANDS
from app.simulation.tissue.reading import Vector

Floats = NDArray[np.float64]

FIRST_INSTRUMENTS: tuple[Instrument, ...] = ("hook", "grasper")
SCOPE_INSTRUMENTS: tuple[Instrument, ...] = ("grasper", "dissector")
"""At an anatomy: the assistant's hand holds, the surgeon's parts."""
JAW_RADIUS, SWAB_RADIUS = 1.2, 3.0
"""mm. Closed jaws pass between the duct and the bed, whose gap is 3 mm; a swab does not."""
RADIUS: dict[Instrument, float] = {
    "dissector": JAW_RADIUS, "swab": SWAB_RADIUS, "right angle": 0.6, "clip applier": 0.8,
    "scissors": 0.8, "suction": 1.5,
}  # fmt: skip
"""mm, of the rods that an instrument is."""
LENGTH: dict[Instrument, float] = {"right angle": 14.0}
"""mm, of a bent tip as it is drawn; others go on through their trocar."""
COMES_OPEN: frozenset[Instrument] = frozenset({"clip applier", "scissors"})
"""What is brought with open jaws."""
CLIP_OPENING = 6.0
"""mm between jaws that close a tube, as they come open: wider than the cystic duct."""
MOST_OPENING = 40.0
"""mm between the axes of a dissector's jaws: more than any clamps' distance allows to use."""
FROM_ABOVE = (0.0, -0.6, 0.8)
TOWARDS_HAND: dict[Instrument, Vector] = {
    "dissector": (0.0, -1.0, 0.0), "swab": FROM_ABOVE, "right angle": (0.0, -1.0, 0.0),
    "clip applier": FROM_ABOVE, "scissors": FROM_ABOVE, "suction": FROM_ABOVE,
}  # fmt: skip
"""From the tip back along an instrument's shaft, unless it is aimed: jaws pass behind the duct from
the side of the viewer, a swab comes from above. Of a right angle this is its bent tip."""
ALONG = (1.0, 0.0, 0.0)
"""Direction in which jaws part, unless another is given."""
# Rods of the beam that each hand's instrument is.
JAWED: tuple[Instrument, ...] = ("dissector", "right angle", "clip applier", "scissors")
RODS: dict[Instrument, tuple[tuple[int, ...], ...]] = {
    "hook": ((),) * HANDS,
    "grasper": ((),) * HANDS,
    **dict.fromkeys(JAWED, tuple((2 * hand, 2 * hand + 1) for hand in range(HANDS))),
    "swab": tuple((2 * hand,) for hand in range(HANDS)),
    "suction": tuple((2 * hand,) for hand in range(HANDS)),
}


class Rod(NamedTuple):
    """A jaw or a swab, as the beam has it."""

    number: int
    tip: Floats  # (3,) mm
    shaft: Vector  # back along it
    radius: float  # mm
    length: float  # mm


class HandContact(NamedTuple):
    """What a hand does to the beam."""

    station: float | None  # that it holds, mm along the beam
    place: Floats  # (3,) of its tip, mm
    rods: tuple[Rod, ...]
    tube: str | None = None  # that it holds or last held


def jaw_offset(hand: Hand) -> float:
    """Return how far a jaw's axis is from the tip's middle, mm."""
    # Closed jaws lie side by side, so that no strand is between them.
    if hand.instrument not in JAWED:
        return 0.0
    return 0.5 * hand.opening + 1.05 * RADIUS[hand.instrument]
