"""Work that nobody waits for: one thread, which of each kind of work does the newest only."""

import logging
import queue
import threading
from collections.abc import Callable, Hashable

__all__ = ["Background"]

log = logging.getLogger(__name__)


class Background:
    """A thread that is started with its first work and ends with `stop`, or with the program."""

    def __init__(self) -> None:
        self._newest: dict[Hashable, Callable[[], None]] = {}
        self._lock = threading.Lock()
        self._due: queue.SimpleQueue[Hashable | None] = queue.SimpleQueue()
        self._thread: threading.Thread | None = None
        self._at: Hashable | None = None

    def do(self, kind: Hashable, work: Callable[[], None]) -> None:
        """Have something done soon."""
        with self._lock:
            waiting = kind in self._newest
            self._newest[kind] = work
            if not waiting:
                self._due.put(kind)
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="background", daemon=True)
                self._thread.start()

    def others_before(self, kind: Hashable) -> int:
        """Return how many works of other kinds come before one that is asked for now."""
        with self._lock:
            return sum(each not in (kind, None) for each in (self._at, *self._newest))

    def stop(self) -> None:
        """End the thread after the work that it is at."""
        self._due.put(None)
        if self._thread is not None:
            self._thread.join(timeout=5.0)

    def _run(self) -> None:
        while (kind := self._due.get()) is not None:
            with self._lock:
                work, self._at = self._newest.pop(kind), kind
            try:
                work()
            except Exception:
                log.exception("work in the background has failed")
            finally:
                with self._lock:
                    self._at = None
