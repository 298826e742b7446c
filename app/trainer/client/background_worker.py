"""A worker thread that keeps only the newest task of each kind."""

import logging
import queue
import threading
from collections.abc import Callable, Hashable

log = logging.getLogger(__name__)


class BackgroundWorker:
    """A thread that starts with its first task and ends with `stop`, or with the program.

    A newer task of a kind replaces the waiting one and takes its place in the queue.
    """

    def __init__(self) -> None:
        self._newest: dict[Hashable, Callable[[], None]] = {}
        self._lock = threading.Lock()
        self._queue: queue.SimpleQueue[Hashable | None] = queue.SimpleQueue()
        self._thread: threading.Thread | None = None
        self._running: Hashable | None = None

    def submit(self, kind: Hashable, task: Callable[[], None]) -> None:
        """Queue a task, in place of one of its kind that has not begun."""
        with self._lock:
            queued = kind in self._newest
            self._newest[kind] = task
            if not queued:
                self._queue.put(kind)
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="background", daemon=True)
                self._thread.start()

    def tasks_ahead_of(self, kind: Hashable) -> int:
        """Return how many tasks of other kinds come before one that is submitted now."""
        with self._lock:
            return sum(each not in (kind, None) for each in (self._running, *self._newest))

    def stop(self) -> None:
        """End the thread after the queued tasks; wait some seconds for it."""
        self._queue.put(None)
        if self._thread is not None:
            self._thread.join(timeout=5.0)

    def _run(self) -> None:
        while (kind := self._queue.get()) is not None:
            with self._lock:
                task, self._running = self._newest.pop(kind), kind
            try:
                task()
            except Exception:
                log.exception("a task in the background has failed")
            finally:
                with self._lock:
                    self._running = None
