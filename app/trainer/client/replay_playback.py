"""Playback of a recorded run: it plays on by itself, or goes to where its slider is put."""

import math
import time
from collections.abc import Callable, Sequence

from app.simulation import TICK_SECONDS, TICKS_PER_SECOND, Incident, Replay, Session

BEFORE = 1.0
"""s before an error from which its moment is played."""
SEEK_SECONDS = 0.4 * TICK_SECONDS
"""s of work on a jump in one tick of the clock, which serves the other clients too."""
# Ticks replayed between two readings of the clock: about a millisecond of work.
SEEK_TICKS = 5


# Ticks between two pictures of another's duct.
LIVE_TICKS = 3


class ReplayPlayback:
    """A replayed run. Any thread may ask for a moment; only the clock's `tick` goes there.

    A jump back replays the run from its start, over several ticks if that takes long. `incidents`
    are the run's errors; None if they are to be found as it goes on. `speed` is how many times as
    fast as the run it plays by itself, as far as there is time to.
    """

    title = "Replay"
    live = False

    def __init__(self, replay: Replay, incidents: Sequence[Incident] | None = None) -> None:
        self._replay, self._incidents = replay, incidents
        self.speed = 1
        self._last = self._replay.ticks
        self.duration = self._replay.duration  # s, the run and the recoil of the torn pieces
        self.playing = False  # whether it advances by itself
        self._at = 0
        # A request is a new object each time, so that the clock sees which one it has served.
        self._requested = self._served = (0,)
        self._moved = True

    @property
    def session(self) -> Session:
        """The session that is taken through the run; to be read only."""
        return self._replay.session

    @property
    def incidents(self) -> Sequence[Incident]:
        """The run's errors, or those until now."""
        return self.session.run.incidents() if self._incidents is None else self._incidents

    @property
    def incident(self) -> Incident | None:
        """The error that is made now, or about to be, or was made a moment ago."""
        time = self.time
        near = [
            each for each in self.incidents if each.start_s - BEFORE <= time <= each.end_s + BEFORE
        ]
        return min(near, key=lambda each: abs(each.start_s - time), default=None)

    @property
    def time(self) -> float:
        """Present time, or the one it is on its way to, s from the first pull."""
        requested = self._requested
        return (self._at if requested is self._served else requested[0]) * TICK_SECONDS

    @property
    def on_its_way(self) -> bool:
        """Whether a time that was asked for is not reached yet."""
        return self._requested is not self._served

    @property
    def at_end(self) -> bool:
        """Whether the end is reached."""
        return self._at >= self._last and not self.on_its_way

    def play(self) -> None:
        """Advance by itself from now on; from the start if the end is reached."""
        if self.at_end:
            self.seek(0.0)
        self.playing = True

    def pause(self) -> None:
        """Stop where it is."""
        self.playing = False

    def seek(self, seconds: float) -> None:
        """Go to a time, s, over the next ticks; NaN is ignored."""
        if not math.isnan(seconds):
            end = self._last * TICK_SECONDS
            self._requested = (round(min(max(seconds, 0.0), end) * TICKS_PER_SECOND),)

    def tick(self, ticks: int) -> bool:
        """Advance by some ticks, or towards the time asked for; return whether it has moved."""
        requested = self._requested
        if requested is not self._served:
            if self._approach(requested[0]):
                self._served = requested
                self._moved = True
        elif self.playing and ticks:
            before = self._at
            self._approach(min(before + ticks * self.speed, self._last))
            self._moved |= self._at != before
            self.playing = self._at < self._last
        moved, self._moved = self._moved, False
        return moved

    def _approach(self, tick: int) -> bool:
        """Return whether a tick has been reached within `SEEK_SECONDS` of work."""
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


class LivePlayback:
    """The session of another page as it goes on; `find` returns it, or None once it is gone."""

    title = "Live"
    live = True
    duration = time = 0.0  # it is now
    speed = 1  # whatever is chosen: it goes on as the other page does
    playing = at_end = on_its_way = False
    incidents: Sequence[Incident] = ()
    incident = None

    def __init__(self, session: Session, find: Callable[[], Session | None]) -> None:
        self.session, self._find = session, find  # to be read only
        self._ticks = 0

    def play(self) -> None:
        """Do nothing: it goes on by itself."""

    def pause(self) -> None:
        """Do nothing: it goes on as long as the other page does."""

    def seek(self, seconds: float) -> None:
        """Do nothing: it is now."""

    def tick(self, ticks: int) -> bool:
        """Return whether there is another picture to draw."""
        self._ticks += ticks
        if self._ticks < LIVE_TICKS:
            return False
        self._ticks = 0
        self.session = self._find() or self.session
        return True
