"""A tear in time: its front runs across the section, then the two pieces recoil.

A pull that has reached the threshold does not let go while the section weakens, so the tear runs
through. How fast it runs and how the pieces swing back is drawn, not computed: physics.tear_growth
computes how deep a tear goes under a load, not how long it takes.
"""

import math
from enum import StrEnum

from app.simulation.inputs.clock import TICK_SECONDS
from physics import BreakEvent

FRONT_SECONDS = 0.6
"""s in which the front crosses the section: slow enough to see on which side it starts."""
# s in which the free rims draw back.
RIM_SECONDS = 0.3
SETTLED_SECONDS = FRONT_SECONDS + 2.2
"""s after which nothing moves: the swing has decayed below 0.2 % of the displacement."""
FADE_SECONDS = 0.35
"""s in which the swing decays to 1/e."""
SWINGS_PER_SECOND = 2.0


class Phase(StrEnum):
    """What the duct is going through."""

    INTACT = "intact"
    TEARING = "tearing"
    TORN = "torn"


def tear_front(elapsed: float) -> float:
    """Return how far a tear has run, `elapsed` seconds after its start.

    Returns
    -------
    float
        0 at the start, 1 when it has crossed the section, 2 when the rims have drawn back.

    Examples
    --------
    >>> tear_front(0.0), tear_front(FRONT_SECONDS), tear_front(SETTLED_SECONDS)
    (0.0, 1.0, 2.0)
    """
    if elapsed < FRONT_SECONDS:
        return (max(elapsed, 0.0) / FRONT_SECONDS) ** 2  # ever less of the section bears the pull
    free = min((elapsed - FRONT_SECONDS) / RIM_SECONDS, 1.0)
    return 1.0 + free * (2.0 - free)


def tear_swing(elapsed: float) -> float:
    """Return the fraction of the displacement that a piece still has, `elapsed` s after the start.

    Returns
    -------
    float
        1 until the front has crossed the section, then a damped oscillation about 0, in the end 0.

    Examples
    --------
    >>> tear_swing(FRONT_SECONDS), tear_swing(SETTLED_SECONDS)
    (1.0, 0.0)
    """
    if elapsed >= SETTLED_SECONDS:
        return 0.0
    free = max(0.0, elapsed - FRONT_SECONDS)
    return math.exp(-free / FADE_SECONDS) * math.cos(2.0 * math.pi * SWINGS_PER_SECOND * free)


class Tear:
    """A tear in progress, tick by tick, at the load that met the criterion."""

    __slots__ = ("_ticks", "event")

    def __init__(self, event: BreakEvent) -> None:
        self.event = event
        self._ticks = 0

    @property
    def _elapsed(self) -> float:
        return self._ticks * TICK_SECONDS

    @property
    def phase(self) -> Phase:
        """Tearing until the front has crossed the section and the pieces are apart, then torn."""
        return Phase.TEARING if self._elapsed < FRONT_SECONDS else Phase.TORN

    @property
    def settled(self) -> bool:
        """Whether nothing moves any more."""
        return self._elapsed >= SETTLED_SECONDS

    @property
    def front(self) -> float:
        """How far it has run (`tear_front`)."""
        return tear_front(self._elapsed)

    @property
    def swing(self) -> float:
        """Fraction of the displacement under the pull that the pieces still have (`tear_swing`)."""
        return tear_swing(self._elapsed)

    @property
    def stress_left(self) -> float:
        """Fraction of its stress that the duct still has: 1 at the break, 0 when it is in two."""
        return max(0.0, 1.0 - self.front)

    def advance(self) -> None:
        """Advance by one tick."""
        self._ticks += 1
