"""One of the two hands at a duct in its bed: its instrument, where its tip is and where it goes.

The tip x follows the hand's target as a critically damped mass on a spring,
    x'' = -2 r x' - r^2 (x - target),   r = HAND_RATE,
never faster than `HAND_SPEED`, advanced by its closed form over a tick (`follow`, a kernel, so that
compiled code may lead many hands): the same to the bit on a slow and a fast machine. Places are mm
in the duct's frame: along it from the first clamp, lateral (the viewer is at negative ones) and
along the pull, away from the bed.
"""

import math

import numpy as np
from numpy.typing import NDArray

from app.simulation.inputs.clock import TICK_SECONDS
from app.simulation.inputs.grasper import (
    ARRIVED_MM,
    ARRIVED_MM_PER_S,
    DECAY,
    HAND_RATE,
    HAND_SPEED,
)
from app.simulation.inputs.inputs import Instrument
from kernel_cache import kernel

GRIP_N = 11.3
"""Mean pull at which tissue slips out of a grasper, N: people pinch with 6.8 N where 3.0 N hold it
against a pull of 5 N (Heijnsdijk 2004, Surg Endosc 18:980, pig bowel), so 5 N x 6.8 / 3.0."""
MEAN_PULL = 0.1
"""Part by which the mean pull nears that of a tick: a mean over 0.3 s."""

_MOST = HAND_SPEED * TICK_SECONDS


@kernel()
def follow(
    place: NDArray[np.float64], speed: NDArray[np.float64], target: NDArray[np.float64]
) -> None:
    """Move a tip, mm, and its speed, mm/s, (3,) each, towards its target for one tick."""
    if place[0] == target[0] and place[1] == target[1] and place[2] == target[2]:
        return
    before = place[0], place[1], place[2]
    square = 0.0
    for r in range(3):
        away = place[r] - target[r]
        push = speed[r] + HAND_RATE * away
        place[r] = target[r] + (away + push * TICK_SECONDS) * DECAY
        speed[r] = (speed[r] - HAND_RATE * push * TICK_SECONDS) * DECAY
        square += (place[r] - before[r]) ** 2
    far = math.sqrt(square)
    arrived = True
    for r in range(3):
        if far > _MOST:
            displacement = place[r] - before[r]
            place[r] = before[r] + displacement * (_MOST / far)
            speed[r] = displacement * (HAND_SPEED / far)
        arrived &= abs(place[r] - target[r]) <= ARRIVED_MM and abs(speed[r]) <= ARRIVED_MM_PER_S
    for r in range(3 if arrived else 0):
        place[r], speed[r] = target[r], 0.0


class Hand:
    """A hand with its instrument."""

    __slots__ = (
        "aim",
        "closes",
        "holds",
        "instrument",
        "jaws",
        "node",
        "opening",
        "place",
        "pull",
        "slips",
        "speed",
        "spread",
        "target",
        "target_opening",
        "tube",
    )

    def __init__(self, instrument: Instrument, place: NDArray[np.float64]) -> None:
        self.instrument: Instrument = instrument
        self.place = np.array(place, dtype=np.float64)  # (3,) of the tip, mm
        self.target = self.place.copy()  # (3,) where the tip goes, mm
        self.speed = np.zeros(3)  # mm/s
        self.opening = self.target_opening = 0.0  # between the axes of a dissector's jaws, mm
        self.closes = False  # whether they were led together last
        self.aim = self.spread = (0.0, 0.0, 0.0)  # from the tip back along the shaft; of jaws
        self.node: int | None = None  # the beam's node that it holds
        self.tube = 0  # number of the tube that it holds or last held
        self.jaws = np.zeros(3)  # (3,) from the axis that it holds to its jaws on the wall, mm
        self.pull = 0.0  # N, mean of the last 0.3 s of a hold
        self.holds = self.slips = 0  # how often it has taken hold, and what it held has slipped out

    @property
    def arrived(self) -> bool:
        """Whether the tip is where the hand wants it."""
        # As lists: numpy takes ten times as long for three numbers.
        there: bool = self.place.tolist() == self.target.tolist()
        return there and self.opening == self.target_opening

    @property
    def tip(self) -> NDArray[np.float64]:
        """(3,) mm where its jaws are: on the wall of what they hold, whose axis is at `place`."""
        return self.place + self.jaws

    def put(self, place: NDArray[np.float64]) -> None:
        """Put the tip somewhere at once, at rest."""
        self.place[:] = self.target[:] = place
        self.speed[:] = 0.0

    def part_jaws(self) -> None:
        """Move the jaws towards where they are to be for one tick."""
        if (left := self.target_opening - self.opening) != 0.0:
            self.opening += min(max(left, -_MOST), _MOST)
