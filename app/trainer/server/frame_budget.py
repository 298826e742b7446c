"""How often each client's duct is drawn: at every tick, less often while that takes too long."""

__all__ = ["FrameBudget"]

MAX_INTERVAL = 4
"""Longest time between two frames of a duct, ticks: 7.5 frames a second."""
HIGH_LOAD, LOW_LOAD = 0.8, 0.6
"""Mean load, work by period, above which frames are left out, and below which they come back."""
WEIGHT = 0.1
"""Of the newest tick in the mean: one tick that another process has delayed says little."""


class FrameBudget:
    """Which clients draw in a tick, when there may be no time for all.

    Steps of the sessions are never left out, frames may be.

    Attributes
    ----------
    interval
        Ticks from one frame of a duct to the next.
    """

    __slots__ = ("_mean_load", "_tick", "interval")

    def __init__(self) -> None:
        self.interval: int = 1
        self._tick = 0
        self._mean_load = 0.0

    def begin_tick(self, load: float) -> None:
        """Begin the next tick, after one that has worked for `load` periods."""
        self._tick += 1
        self._mean_load += WEIGHT * (min(load, 1.0 / WEIGHT) - self._mean_load)
        before = self.interval
        if self._mean_load > HIGH_LOAD and before < MAX_INTERVAL:
            self.interval = before + 1
        elif before > 1 and self._mean_load * before / (before - 1) < LOW_LOAD:
            self.interval = before - 1
        # The load expected at the new interval: drawing is nearly all of the work.
        self._mean_load *= before / self.interval

    def draws(self, number: int) -> bool:
        """Return whether the client of this number draws in this tick."""
        return (self._tick + number) % self.interval == 0
