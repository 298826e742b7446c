"""Whose duct is drawn in which tick: every duct in each, fewer while that takes too long."""

__all__ = ["Turns"]

MOST_TICKS = 4
"""Longest time from one picture of a duct to the next, ticks: 7.5 pictures a second."""
FULL, ROOMY = 0.8, 0.6
"""Parts of a tick that its work may take, and below which more pictures are drawn again."""
WEIGHT = 0.1
"""Of the newest tick in the mean: a tick that something else held up says little."""


class Turns:
    """Who draws in a tick, when there may be no time for all.

    Steps of the sessions are never left out, pictures may be. The mean work of a tick decides how
    often each duct is drawn.

    Attributes
    ----------
    ticks
        From one picture of a duct to the next.
    """

    __slots__ = ("_mean", "_tick", "ticks")

    def __init__(self) -> None:
        self.ticks: int = 1
        self._tick = 0
        self._mean = 0.0

    def take(self, work: float) -> None:
        """Take the next tick."""
        self._tick += 1
        self._mean += WEIGHT * (min(work, 1.0 / WEIGHT) - self._mean)
        before = self.ticks
        if self._mean > FULL and before < MOST_TICKS:
            self.ticks = before + 1
        elif before > 1 and self._mean * before / (before - 1) < ROOMY:
            self.ticks = before - 1
        # What it will take now; drawing is nearly all of the work.
        self._mean *= before / self.ticks

    def draws(self, number: int) -> bool:
        """Return whether somebody draws in this tick."""
        return (self._tick + number) % self.ticks == 0
