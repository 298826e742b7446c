"""Suction of what has been lost, and where that lies.

What flows out of a hole lies about it as a round puddle of an even depth: of a volume V, mm^3, it
has the radius sqrt(V/(pi `DEEP_MM`)). A tip takes it up within `REACH_MM` of the puddle's rim, and
no higher than that above the hole. Fluids are taken up as they are mixed.
"""

import math
from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from app.simulation.inputs.clock import TICK_SECONDS
from app.simulation.inputs.hand import Hand
from app.simulation.runs.run_file import HANDS
from physics.bed import BeamOnBed, Flow

MOST_SUCTION = 30.0
"""ml/s."""
REACH_MM, DEEP_MM = 7.0, 1.0
"""Reach of a tip and depth of a puddle: choices, not measurements."""


class Suction:
    """How strongly each hand sucks, and what all have taken up."""

    def __init__(self, fluids: Mapping[str, Flow]) -> None:
        self._fluids = fluids
        self.rates = [0.0] * HANDS
        """ml/s, of each hand."""
        self.taken_ml = 0.0

    def on(self, hand: int) -> bool:
        """Return whether a hand's suction is on."""
        return self.rates[hand] > 0.0

    def pooled_ml(self, fluid: str | None = None) -> float:
        """Return what is lost and not taken up, ml; of one fluid or of all."""
        return self._lost_ml(fluid) * self._left

    def reaches(self, tip: NDArray[np.float64], bed: BeamOnBed) -> bool:
        """Return whether something lies within reach of a tip, (3,) mm."""
        left = self._left
        for flow in self._fluids.values():
            for hole in flow.holes:
                x, y, z = (tip - bed.places[hole.node]).tolist()
                volume = left * hole.lost
                radius = REACH_MM + math.sqrt(volume / (math.pi * DEEP_MM))
                if volume > 0.0 and z <= REACH_MM and math.hypot(x, y) <= radius:
                    return True
        return False

    def advance(self, hands: Iterable[Hand], bed: BeamOnBed) -> None:
        """Take up for a tick what lies within reach of the hands."""
        wanted = TICK_SECONDS * sum(
            rate
            for rate, hand in zip(self.rates, hands, strict=True)
            if rate > 0.0 and self.reaches(hand.place, bed)
        )
        if wanted > 0.0:
            self.taken_ml += min(wanted, self.pooled_ml())

    @property
    def _left(self) -> float:
        """The fraction of what is lost that is not taken up."""
        whole = self._lost_ml()
        return max(1.0 - self.taken_ml / whole, 0.0) if whole > 0.0 else 0.0

    def _lost_ml(self, fluid: str | None = None) -> float:
        return 1e-3 * sum(flow.lost for name, flow in self._fluids.items() if fluid in {None, name})
