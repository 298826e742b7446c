"""How often each client's duct is drawn: at every tick, or less often under high load."""

MAX_INTERVAL = 4
"""Most ticks between two frames of a duct: 7.5 frames per second."""
HIGH_LOAD, LOW_LOAD = 0.95, 0.9
"""Mean loads above which frames are left out, and below which they come back. Sessions keep their
steps up to the first; a trainer with 32 that dissect is below it with a picture in every other
tick."""
# Work of a session's step and of its picture, as measured: their ratio says what another interval
# would make of the load.
STEP_MS, PICTURE_MS = 0.78, 0.98
WEIGHT = 0.05
"""Weight of the newest tick in the running mean, so that one delayed tick changes little."""


class FrameBudget:
    """Decides which clients draw in a tick, when there is not enough time for all.

    Sessions are stepped at every tick; only frames are left out. Clients take turns, so that the
    drawing is spread evenly over the ticks of an interval.
    """

    __slots__ = ("_mean_load", "_tick", "interval")

    def __init__(self) -> None:
        self.interval: int = 1  # ticks between two frames of a duct
        self._tick = 0
        self._mean_load = 0.0

    def begin_tick(self, load: float) -> None:
        """Begin the next tick; `load` is the time that the last one worked, in periods."""
        self._tick += 1
        self._mean_load += WEIGHT * (min(load, 1.0 / WEIGHT) - self._mean_load)
        before = self.interval
        if self._mean_load > HIGH_LOAD and before < MAX_INTERVAL:
            self.interval = before + 1
        elif before > 1 and self._mean_load * _work(before - 1) / _work(before) < LOW_LOAD:
            self.interval = before - 1
        # The load expected at the new interval.
        self._mean_load *= _work(self.interval) / _work(before)

    def draws(self, number: int) -> bool:
        """Return whether the client of this number draws in this tick."""
        return (self._tick + number) % self.interval == 0


def _work(interval: int) -> float:
    """Return the mean work for a client in a tick, ms."""
    return STEP_MS + PICTURE_MS / interval
