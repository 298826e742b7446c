"""Sessions by token: a page that is reloaded finds its trainee's session again."""

import secrets
import time
from collections.abc import Callable
from threading import RLock

from app.trainer.client.practice import Practice
from app.trainer.connections.bounds import MOST_CLIENTS

# s that a session waits for its page to come back.
KEPT_SECONDS = 600.0
TOKEN_BYTES = 16


class SessionsFullError(ValueError):
    """The largest number of sessions is in use."""


class Sessions:
    """The sessions of all clients, a `Practice` each, under a token that only its client knows.

    `make` makes a new client's. There are `most` at most; one that was left is kept for
    `kept_seconds`, or until its place is needed. `clock` gives the time, s.
    """

    def __init__(
        self,
        make: Callable[[], Practice],
        *,
        most: int = MOST_CLIENTS,
        kept_seconds: float = KEPT_SECONDS,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._make, self._clock = make, clock
        self._most, self._kept_seconds = most, kept_seconds
        self._lock = RLock()
        self._kept: dict[str, Practice | None] = {}  # None while it is made
        self._left: dict[str, float] = {}  # when each was left, s; the longest left first

    def __len__(self) -> int:
        with self._lock:
            return len(self._kept)

    def __contains__(self, token: str) -> bool:
        with self._lock:
            self.expire()
            return token in self._kept

    def claim(self, token: str | None = None) -> tuple[str, Practice]:
        """Return the session that a client left, or a new one."""
        with self._lock:
            self.expire()
            kept = None if token is None else self._kept.get(token)
            if token is not None and kept is not None and token in self._left:
                del self._left[token]
                return token, kept
            if len(self._kept) >= self._most:
                self._drop_longest_left()
            token = secrets.token_urlsafe(TOKEN_BYTES)
            self._kept[token] = None  # the place is taken while the session is made
        try:
            practice = self._make()
        except BaseException:
            with self._lock:
                del self._kept[token]
            raise
        with self._lock:
            self._kept[token] = practice
        return token, practice

    def leave(self, token: str) -> None:
        """Note that a session's client has gone; the session is kept for a while."""
        with self._lock:
            if token in self._kept:
                self._left.setdefault(token, self._clock())
            self.expire()

    def expire(self) -> None:
        """Drop the sessions that were left too long ago."""
        with self._lock:
            now = self._clock()
            for token, left_at in list(self._left.items()):
                if now - left_at > self._kept_seconds:
                    self._drop(token)

    def _drop_longest_left(self) -> None:
        if not self._left:
            raise SessionsFullError(
                f"{self._most} trainees are at work already; come back when one has left"
            )
        self._drop(next(iter(self._left)))

    def _drop(self, token: str) -> None:
        del self._left[token], self._kept[token]
