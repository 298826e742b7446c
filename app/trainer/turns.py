"""Whose duct is drawn in which tick: every duct in each, fewer while the machine is behind."""

__all__ = ["Turns"]

MOST_TICKS = 4
"""Longest time from one picture of a duct to the next, ticks: 7.5 pictures a second."""
EVEN_TICKS = 90
"""Ticks on time after which more is drawn again."""


class Turns:
    """Who draws in a tick, when there may be no time for all.

    Steps of the sessions are never left out, pictures may be: a tick that comes late lets each
    duct be drawn less often, and some seconds of even ticks more often again.

    Attributes
    ----------
    ticks
        From one picture of a duct to the next.
    """

    __slots__ = ("_even", "_tick", "ticks")

    def __init__(self) -> None:
        self.ticks = 1
        self._tick = self._even = 0

    def take(self, *, late: bool) -> None:
        """Take the next tick.

        Parameters
        ----------
        late
            Whether it came too late, or the one before it took too long.
        """
        self._tick += 1
        self._even = 0 if late else self._even + 1
        if late:
            self.ticks = min(self.ticks + 1, MOST_TICKS)
        elif self._even >= EVEN_TICKS and self.ticks > 1:
            self._even = 0
            self.ticks -= 1

    def draws(self, number: int) -> bool:
        """Return whether somebody draws in this tick.

        Parameters
        ----------
        number
            Their place in the row, from 0.

        Returns
        -------
        bool
            True once in `ticks` ticks, and in each for a different part of the row.
        """
        return (self._tick + number) % self.ticks == 0
