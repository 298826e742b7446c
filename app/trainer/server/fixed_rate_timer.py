"""A fixed-rate timer: ticks that come too late are counted as missed, not made up for."""

import threading
import time
from collections.abc import Callable


class FixedRateTimer:
    """Ticks due every `period` s from the first `wait` on; `clock` gives the time, s.

    A tick may come late by less than a period; one that would come later is missed. `ticks` and
    `missed` count both kinds. `load` is the time from the last tick to the next `wait`, in periods.
    A `ValueError` if the period is not positive.
    """

    __slots__ = ("_clock", "_due", "_last", "_period", "load", "missed", "ticks")

    def __init__(self, period: float, *, clock: Callable[[], float] = time.monotonic) -> None:
        if not period > 0.0:
            raise ValueError(f"the period must be positive, got {period} s")
        self._period, self._clock = period, clock
        self._due = self._last = -1.0
        self.ticks = self.missed = 0
        self.load = 0.0

    def wait(self, stop: threading.Event) -> float | None:
        """Return the seconds since the last tick when the next is due; None once stopped."""
        now = self._clock()
        if not self.ticks:
            self._due = self._last = now
        self.load = (now - self._last) / self._period
        if stop.wait(max(0.0, self._due - now)):
            return None
        now = self._clock()
        # Whole periods late are missed; the next tick stays on the fixed grid of times.
        missed = max(0, int((now - self._due) / self._period))
        seconds, self._last = now - self._last, now
        self._due += (missed + 1) * self._period
        self.missed += missed
        self.ticks += 1
        return seconds
