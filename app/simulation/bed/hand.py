"""One of the two hands at a duct in its bed: its instrument, where its tip is and where it goes.

The tip x follows the hand's target as a critically damped mass on a spring,
    x'' = -2 r x' - r^2 (x - target),   r = HAND_RATE,
never faster than `HAND_SPEED`, advanced by its closed form over a tick: the same to the bit on a
slow and a fast machine. Places are mm in the duct's frame: along it from the first clamp, lateral
(the viewer is at negative ones) and along the pull, away from the bed.
"""

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from app.simulation.clock import TICK_SECONDS
from app.simulation.grasper import ARRIVED_MM, ARRIVED_MM_PER_S, HAND_RATE, HAND_SPEED

__all__ = ["HOLDING", "INSTRUMENTS", "Hand", "Instrument"]

Instrument = Literal["hook", "grasper", "dissector", "swab"]
"""A hook and a grasper hold the duct; a grasper stays where it is left. A dissector's two jaws and
a swab part strands without holding it."""
INSTRUMENTS: tuple[Instrument, ...] = ("hook", "grasper", "dissector", "swab")
HOLDING: tuple[Instrument, ...] = ("hook", "grasper")

_DECAY = math.exp(-HAND_RATE * TICK_SECONDS)


class Hand:
    """A hand with its instrument."""

    __slots__ = ("_speed", "instrument", "node", "opening", "place", "target", "target_opening")

    def __init__(self, instrument: Instrument, place: NDArray[np.float64]) -> None:
        self.instrument: Instrument = instrument
        self.place = np.array(place, dtype=np.float64)  # (3,) of the tip, mm
        self.target = self.place.copy()  # (3,) where the tip goes, mm
        self._speed = np.zeros(3)  # mm/s
        self.opening = self.target_opening = 0.0  # between the axes of a dissector's jaws, mm
        self.node: int | None = None  # the beam's node that it holds

    @property
    def arrived(self) -> bool:
        """Whether the tip is where the hand wants it."""
        return self._there and self.opening == self.target_opening

    @property
    def _there(self) -> bool:
        # As lists: numpy takes ten times as long for three numbers.
        return bool(self.place.tolist() == self.target.tolist())

    def put(self, place: NDArray[np.float64]) -> None:
        """Put the tip somewhere at once, at rest."""
        self.place[:] = self.target[:] = place
        self._speed[:] = 0.0

    def advance(self) -> None:
        """Move the tip and the jaws towards their targets for one tick."""
        most = HAND_SPEED * TICK_SECONDS
        if not self._there:
            before, away = self.place.copy(), self.place - self.target
            push = self._speed + HAND_RATE * away
            after = self.target + (away + push * TICK_SECONDS) * _DECAY
            speed = (self._speed - HAND_RATE * push * TICK_SECONDS) * _DECAY
            way = after - before
            far = math.sqrt((way**2).sum())
            if far > most:
                after = before + way * (most / far)
                speed = way * (HAND_SPEED / far)
            if (
                np.abs(after - self.target).max() <= ARRIVED_MM
                and np.abs(speed).max() <= ARRIVED_MM_PER_S
            ):
                after, speed = self.target, np.zeros(3)
            self.place[:], self._speed[:] = after, speed
        self.opening += min(max(self.target_opening - self.opening, -most), most)
