"""A metronome: even beats that a busy machine may miss, and the count of both."""

import threading
import time
from collections.abc import Callable

__all__ = ["Metronome"]


class Metronome:
    """Beats that are due at even times from the first `wait` on.

    A beat may come late by less than a period. One that would come later still is missed: nothing
    is caught up, and the next comes when it is due.

    Parameters
    ----------
    period
        From beat to beat, s.
    clock
        Gives the time, s.

    Attributes
    ----------
    beats, missed
        How many there were, and how many were due and did not come.
    work
        From the last beat to the wait for the next, in periods.

    Raises
    ------
    ValueError
        If the period is not positive.
    """

    __slots__ = ("_clock", "_due", "_last", "_period", "beats", "missed", "work")

    def __init__(self, period: float, *, clock: Callable[[], float] = time.monotonic) -> None:
        if not period > 0.0:
            raise ValueError(f"the period must be positive, got {period} s")
        self._period, self._clock = period, clock
        self._due = self._last = -1.0
        self.beats = self.missed = 0
        self.work = 0.0

    def wait(self, stop: threading.Event) -> float | None:
        """Wait for the next beat."""
        now = self._clock()
        if not self.beats:
            self._due = self._last = now
        self.work = (now - self._last) / self._period
        if stop.wait(max(0.0, self._due - now)):
            return None
        now = self._clock()
        passed = max(0, int((now - self._due) / self._period))
        seconds, self._last = now - self._last, now
        self._due += (passed + 1) * self._period
        self.missed += passed
        self.beats += 1
        return seconds
