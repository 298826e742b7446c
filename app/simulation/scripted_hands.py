"""Scripted hands at a duct in its bed: an exercise done well, hastily or clumsily, always the same.

A script is a generator that gives the hands their next inputs each time a tick is due. The good
hands are careful and steady, and no surgeon's.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from app.simulation.clock import TICK_SECONDS
from app.simulation.exercise import BedExercise, BedExerciseName
from app.simulation.inputs import Instrument
from app.simulation.reading import Vector
from app.simulation.spatial_tissue import JAW_RADIUS, SpatialTissue

__all__ = ["MANNERS", "BedManner", "Hands", "script"]

Floats = NDArray[np.float64]

STEP_MM = 2.0
"""How far the front is to move before a good hand takes hold again."""
REST_SECONDS = 0.3
MOST_MM = 25.0
"""How far a hand lifts at most."""


@dataclass(frozen=True, slots=True)
class BedManner:
    """How a pair of hands works."""

    speed: float = 5.0  # mm/s of pulls and of jaws that open
    behind: float = 0.0  # how far behind the front the hook takes hold, mm
    lean: float = 0.0  # of pulls off straight up, rad
    held: float = 0.0  # how high the duct is held up while jaws open, in gaps of its bed
    pulls: bool = False  # lifts the duct off instead of passing behind it


MANNERS: dict[BedExerciseName, dict[str, BedManner]] = {
    "window": {
        "good": BedManner(),
        "hasty": BedManner(speed=40.0, pulls=True),
        "clumsy": BedManner(held=1.0),
    },
    "follow_front": {
        "good": BedManner(),
        "hasty": BedManner(speed=40.0),
        "clumsy": BedManner(behind=5.0),
        "sideways": BedManner(lean=math.radians(45.0)),
    },
    "free_scar": {
        "good": BedManner(held=1.0),
        "hasty": BedManner(speed=20.0),
        "clumsy": BedManner(held=8.0 / 3.0),
    },
}
"""Good hands and others, for each exercise."""


class Hands(Protocol):
    """What a script acts on: a session, or its duct alone."""

    def choose_instrument(self, hand: int, instrument: Instrument) -> None:
        """Take an instrument."""
        ...

    def grab(self, hand: int, station: float) -> Floats | Vector | None:
        """Take hold."""
        ...

    def move_hand(self, hand: int, place: Floats) -> None:
        """Lead a hand."""
        ...

    def release(self, hand: int) -> object:
        """Let go."""
        ...

    def open_jaws(self, hand: int, opening: float) -> None:
        """Open jaws."""
        ...


def script(
    hands: Hands, duct: SpatialTissue, exercise: BedExercise, manner: BedManner
) -> Iterator[None]:
    """Give the inputs of an exercise; yields when a tick is due."""
    middle = 0.5 * (exercise.from_mm + exercise.to_mm)
    if exercise.name == "follow_front":
        yield from _follow(hands, duct, exercise, manner)
    elif manner.pulls:
        yield from _lift(hands, 0, middle, MOST_MM, manner)
    else:
        if manner.held > 0.0:
            yield from _lift(hands, 0, middle, manner.held * duct.gap_mm, manner)
        # Opening jaws part what is beside the closed ones and the strands that lean over them: all
        # of a scar, if they start beside it.
        beside = 2.0 * JAW_RADIUS + 0.5 * duct.gap_mm
        place = exercise.from_mm - beside if exercise.name == "free_scar" else middle
        yield from _spread(hands, duct, place, manner)


def _lift(
    hands: Hands, hand: int, station: float, height: float, manner: BedManner
) -> Iterator[None]:
    """Take hold and pull to a height, mm."""
    start = hands.grab(hand, station)
    if start is None:
        return
    leant = np.array([0.0, math.sin(manner.lean), math.cos(manner.lean)])
    for lifted in _steps(height, manner.speed):
        hands.move_hand(hand, np.array(start) + lifted * leant)
        yield


def _spread(hands: Hands, duct: SpatialTissue, station: float, manner: BedManner) -> Iterator[None]:
    """Pass a closed dissector behind the duct and open it."""
    hands.choose_instrument(1, "dissector")
    start = duct.hands[1].place.copy()
    start[0] = station
    hands.move_hand(1, start)
    behind = start.copy()
    for passed in _steps(-2.0 * start[1], 20.0):
        behind[1] = start[1] + passed
        hands.move_hand(1, behind.copy())
        yield
    yield from _rest()
    for opened in _steps(2.0 * MOST_MM, 2.0 * manner.speed):
        hands.open_jaws(1, opened)
        yield


def _follow(
    hands: Hands, duct: SpatialTissue, exercise: BedExercise, manner: BedManner
) -> Iterator[None]:
    """Lift at the front of a divided duct until it has moved on, and take hold again there."""
    while True:
        front = _front(duct, exercise)
        for _ in _lift(hands, 0, front + manner.behind, MOST_MM, manner):
            yield
            if front - _front(duct, exercise) >= STEP_MM:
                break
        hands.release(0)
        yield from _rest()


def _front(duct: SpatialTissue, exercise: BedExercise) -> float:
    """Return where the bed begins before what was open, mm."""
    # A strand left behind does not count as the front.
    return exercise.to_mm - exercise.freed(duct.freed_stretches())


def _steps(way: float, speed: float) -> list[float]:
    """Return how far a hand has come at each tick of an even way, mm."""
    ticks = max(1, math.ceil(abs(way) / (speed * TICK_SECONDS)))
    return [way * tick / ticks for tick in range(1, ticks + 1)]


def _rest() -> Iterator[None]:
    for _ in range(round(REST_SECONDS / TICK_SECONDS)):
        yield
