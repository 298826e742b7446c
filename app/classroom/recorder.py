"""Saves runs in a thread of its own, and says of each when it is on the disk."""

import logging
import sqlite3
import threading
from collections.abc import Callable, Sequence

from app.classroom.store import ClassStore, RunRecord, Statement

RETRY_SECONDS = 2.0
STOP_SECONDS = 5.0
Done = Callable[[str | None], object]
"""Called with None once a run is saved, else with why it is not."""

log = logging.getLogger(__name__)


class Recorder:
    """A writer of runs. What cannot be written is kept and tried again; the newest of each wins.

    `statements` says what a learning record store is to be told of a finished run.
    """

    def __init__(
        self, store: ClassStore, statements: Callable[[RunRecord], Sequence[Statement]]
    ) -> None:
        self._store, self._statements = store, statements
        self._waiting: dict[str, tuple[Callable[[], RunRecord], Done]] = {}
        self._news = threading.Condition()
        self._stopping = False
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    def save(self, run_id: str, make: Callable[[], RunRecord], done: Done) -> None:
        """Save what `make` returns, which is called by the recorder's thread."""
        with self._news:
            self._waiting[run_id] = make, done
            self._news.notify()

    def stop(self) -> None:
        """Save what waits, and end."""
        with self._news:
            self._stopping = True
            self._news.notify()
        self._thread.join(STOP_SECONDS)

    def _run(self) -> None:
        while True:
            with self._news:
                while not self._waiting:
                    if self._stopping:
                        return
                    self._news.wait()
                run_id = next(iter(self._waiting))
                make, done = self._waiting.pop(run_id)
            again = False
            try:
                run = make()
                self._store.save(run, self._statements(run) if run.finished else ())
                fault = None
            except sqlite3.IntegrityError:  # the person's data have been deleted meanwhile
                fault = "your data have been deleted"
            except (sqlite3.Error, OSError) as error:
                log.warning("a run of the class could not be saved yet: %s", error)
                fault, again = f"not saved yet ({error}); it is tried again", True
            except ValueError as error:  # too many or too long
                fault = str(error)
            except Exception as error:
                log.exception("a run of the class could not be saved")
                fault = f"not saved: a fault of the program ({type(error).__name__})"
            done(fault)
            if again:
                with self._news:
                    self._waiting.setdefault(run_id, (make, done))
                    if self._stopping:
                        return
                    self._news.wait(RETRY_SECONDS)
