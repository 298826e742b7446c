"""Playback of a recorded run: it plays on by itself, or goes to where its slider is put."""

import math
import time

from app.simulation import TICK_SECONDS, TICKS_PER_SECOND, Replay, RunFile, Session
from organ_geometry import Organ

__all__ = ["ReplayPlayback"]

SEEK_SECONDS = 0.4 * TICK_SECONDS
"""Longest work on a jump in one tick of the clock, which serves other clients too."""
SEEK_TICKS = 5
"""Made between two looks at the time: a millisecond or so."""


class ReplayPlayback:
    """A run made again. Any thread may ask for a moment; the clock's `tick` alone goes there.

    A jump back makes the run again from its start, over several ticks where it is a long one.

    Parameters
    ----------
    run
        The run.
    organ
        The organ that it was made on; a `RunFileError` says if it is another, or the run is one
        that cannot be made again.

    Attributes
    ----------
    run
        As given.
    duration
        Length of what can be seen, s.
    playing
        Whether it goes on by itself.
    """

    def __init__(self, run: RunFile, organ: Organ) -> None:
        self.run = run
        self._replay = Replay(run.log, organ)
        self._last = self._replay.ticks
        self.duration = self._replay.duration
        self.playing = False
        self._at = 0
        # A request is a new object each time, so that the clock sees which one it has served.
        self._requested = self._served = (0,)
        self._moved = True

    @property
    def session(self) -> Session:
        """The session that is taken through the run; for looking at."""
        return self._replay.session

    @property
    def time(self) -> float:
        """Where the playback is, or is going, s from the first pull."""
        requested = self._requested
        return (self._at if requested is self._served else requested[0]) * TICK_SECONDS

    @property
    def at_end(self) -> bool:
        """Whether there is nothing more to play."""
        return self._at >= self._last and self._requested is self._served

    def play(self) -> None:
        """Go on by itself, from the start if the end is reached."""
        if self.at_end:
            self.seek(0.0)
        self.playing = True

    def pause(self) -> None:
        """Stay where it is."""
        self.playing = False

    def seek(self, seconds: float) -> None:
        """Go to a moment, s, with the next ticks; NaN is nowhere."""
        if not math.isnan(seconds):
            end = self._last * TICK_SECONDS
            self._requested = (round(min(max(seconds, 0.0), end) * TICKS_PER_SECOND),)

    def tick(self, ticks: int) -> bool:
        """Go on by some ticks, or towards the moment asked for; return whether it has moved."""
        requested = self._requested
        if requested is not self._served:
            if self._approach(requested[0]):
                self._served = requested
                self._moved = True
        elif self.playing and ticks:
            before = self._at
            self._go_to(min(before + ticks, self._last))
            self._moved |= self._at != before
            self.playing = self._at < self._last
        moved, self._moved = self._moved, False
        return moved

    def _approach(self, tick: int) -> bool:
        """Return whether a tick has been reached in the time that there is."""
        until = time.monotonic() + SEEK_SECONDS
        if tick < self._at:
            self._go_to(0)
        while self._at < tick:
            self._go_to(min(self._at + SEEK_TICKS, tick))
            if time.monotonic() > until:
                break
        return self._at == tick

    def _go_to(self, tick: int) -> None:
        self._replay.seek_tick(tick)
        self._at = tick
