"""A replay that is played: it goes on by itself, or to wherever its slider is put."""

import math
import threading

from app.simulation.clock import TICK_SECONDS
from app.simulation.replay import Replay
from app.simulation.run_log import RunFile
from app.simulation.session import Session
from organ_geometry import Organ

__all__ = ["ReplayPlayback"]


class ReplayPlayback:
    """A run made again, seen from the clock while a slider seeks in it.

    A jump back makes the run again from its start, which may take a while for a long one. It is
    made by whoever asks for it; the clock meanwhile goes on with other clients.

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
    """

    def __init__(self, run: RunFile, organ: Organ) -> None:
        self.run = run
        self._replay = Replay(run.log, organ)
        self.duration = self._replay.duration
        self._at_work = threading.Lock()  # on the replay, by the clock or by the seeker
        self._seeker = threading.Lock()
        self._wish = threading.Lock()
        self._wanted: float | None = None
        self._moved = True
        self._playing = False

    @property
    def session(self) -> Session:
        """The session that is taken through the run; for looking at."""
        return self._replay.session

    @property
    def _sought(self) -> bool:
        return self._wanted is not None

    @property
    def time(self) -> float:
        """Where the replay is, s from the first pull."""
        return self._replay.time

    @property
    def playing(self) -> bool:
        """Whether it goes on by itself."""
        return self._playing

    @property
    def at_end(self) -> bool:
        """Whether there is nothing more to play."""
        return self._replay.time >= self.duration - 1e-9

    def play(self) -> None:
        """Go on by itself, from the start if the end is reached."""
        if self.at_end:
            self.seek(0.0)
        self._playing = True

    def pause(self) -> None:
        """Stay where it is."""
        self._playing = False

    def seek(self, seconds: float) -> None:
        """Go to a moment, or leave it to a call that is at work already."""
        if math.isnan(seconds):
            return
        with self._wish:
            self._wanted = seconds
        while self._sought and self._seeker.acquire(blocking=False):
            try:
                with self._wish:
                    wanted, self._wanted = self._wanted, None
                if wanted is not None:
                    with self._at_work:
                        self._replay.seek(wanted)
                        self._moved = True
            finally:
                self._seeker.release()

    def tick(self, ticks: int) -> bool:
        """Play on."""
        if not self._at_work.acquire(blocking=False):
            return False
        try:
            if self._playing and ticks:
                before = self._replay.time
                self._replay.seek(before + ticks * TICK_SECONDS)
                self._moved |= self._replay.time != before
                self._playing = not self.at_end
            moved, self._moved = self._moved, False
            return moved
        finally:
            self._at_work.release()
