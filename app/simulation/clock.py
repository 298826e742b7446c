"""The clock of a session: fixed ticks, however unevenly real time passes."""

__all__ = ["MOST_TICKS_AT_ONCE", "TICKS_PER_SECOND", "TICK_SECONDS", "Clock"]

TICKS_PER_SECOND = 30
TICK_SECONDS = 1.0 / TICKS_PER_SECOND
"""Length of every tick, s: what happens in a run is a matter of ticks alone."""
MOST_TICKS_AT_ONCE = TICKS_PER_SECOND
"""A stalled machine slows a pull; it does not make up for more than a second."""


class Clock:
    """Real time in whole ticks, to the nearest one: what is over or missing is carried on."""

    __slots__ = ("_owed",)

    def __init__(self) -> None:
        self._owed = 0.0

    def ticks(self, seconds: float) -> int:
        """Return how many ticks are due.

        Parameters
        ----------
        seconds
            Real time since the last call, s.

        Returns
        -------
        int
            Number of ticks. A caller that is up to half a tick early or late gets one at each
            call all the same.

        Examples
        --------
        >>> clock = Clock()
        >>> [clock.ticks(0.02) for _ in range(5)]
        [1, 0, 1, 0, 1]
        """
        self._owed += max(seconds, 0.0) * TICKS_PER_SECOND
        due = int(self._owed + 0.5)
        self._owed -= due
        return min(due, MOST_TICKS_AT_ONCE)
