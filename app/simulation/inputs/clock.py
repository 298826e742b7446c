"""The clock of a session: fixed ticks, however unevenly real time passes."""

TICKS_PER_SECOND = 30
TICK_SECONDS = 1.0 / TICKS_PER_SECOND
"""s. A run depends on its ticks alone, never on real time, so it can be replayed to the bit."""
REACTION_SECONDS = 0.25
"""s, a visual reaction time (docs/measures.md, source 11)."""
# After a stall of more than a second the rest is dropped: the pull slows instead of jumping.
MOST_TICKS_AT_ONCE = TICKS_PER_SECOND


class Clock:
    """Turns real time into whole ticks; the rounding error is carried on to the next call.

    A caller that is up to half a tick early or late still gets one tick at each call.

    >>> clock = Clock()
    >>> [clock.ticks(0.02) for _ in range(5)]
    [1, 0, 1, 0, 1]
    """

    __slots__ = ("_owed",)

    def __init__(self) -> None:
        self._owed = 0.0

    def ticks(self, seconds: float) -> int:
        """Return how many ticks are due; `seconds` is the real time since the last call."""
        self._owed += max(seconds, 0.0) * TICKS_PER_SECOND
        due = int(self._owed + 0.5)
        self._owed -= due
        return min(due, MOST_TICKS_AT_ONCE)
