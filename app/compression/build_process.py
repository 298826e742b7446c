"""A process that builds organs, so that the trainer's threads do not wait for it.

Finding edges and encoding an organ take seconds of Python's one lock: in the trainer's own process
a fifth of all sessions' ticks came too late while an organ was built.
"""

import contextlib
import multiprocessing
import os
import pickle
import signal
import threading
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any, TypeVar

from app.compression.image_upload import UploadBounds
from app.workers import Progress

Made = TypeVar("Made")
# How often whoever waits looks whether they still want it.
POLL_SECONDS = 0.1
# Longest time of a task: others wait for it.
BUILD_SECONDS = 120.0
# Most memory of the process: more would slow the trainer down, or end it.
BUILD_MIB = 3072
MIB = 2**20
# How much the building gives way to sessions on a machine with few cores.
NICENESS = 5


class Abandoned(Exception):  # noqa: N818
    """The work was cancelled."""


class BuildProcess:
    """One process for one task after the other; it is started with the first.

    A task has at most `seconds` and, where the system can bound it, `mib` of memory. Its methods
    may be called from any thread.
    """

    def __init__(
        self,
        seconds: float = BUILD_SECONDS,
        mib: int = BUILD_MIB,
        bounds: UploadBounds | None = None,
    ) -> None:
        for name, value, least in (("seconds", seconds, 1), ("memory", mib, 512)):
            if not value >= least:
                raise ValueError(f"--build-{name} must be at least {least}")
        self.bounds = bounds or UploadBounds()  # of what may be sent to be built
        self._seconds, self._mib = seconds, mib
        self._lock = threading.Lock()
        self._stopped = threading.Event()
        self._process: BaseProcess | None = None
        self._pipe: Connection | None = None

    def make(
        self,
        work: Callable[..., Made],
        *args: object,
        progress: Progress,
        wanted: Callable[[], bool],
    ) -> Made:
        """Have something made, and wait for it."""
        with self._lock:
            if self._stopped.is_set() or not wanted():
                raise Abandoned
            try:
                made, answer = self._answer(work, args, progress, wanted)
            except (EOFError, OSError) as error:
                self._end()
                raise RuntimeError("the process that builds organs has ended") from error
            except BaseException:
                self._end()
                raise
        if made:
            return answer
        raise answer

    def stop(self) -> None:
        """End the process and its task."""
        self._stopped.set()
        with self._lock:
            self._end()

    def _answer(
        self,
        work: Callable[..., object],
        args: tuple[object, ...],
        progress: Progress,
        wanted: Callable[[], bool],
    ) -> tuple[bool, Any]:
        """Return whether the work was done, with its value or its error."""
        pipe = self._started()
        pipe.send((work, args))
        end = time.monotonic() + self._seconds
        while True:
            while not pipe.poll(POLL_SECONDS):
                if self._stopped.is_set() or not wanted():
                    raise Abandoned
                if time.monotonic() > end:
                    raise ValueError(
                        f"it takes longer than {self._seconds:g} s, which others wait for: use "
                        "fewer or smaller images, or bluntdissect compress"
                    )
            kind, answer = pipe.recv()
            if kind != "progress":
                return kind == "made", answer
            progress(*answer)

    def _started(self) -> Connection:
        if self._pipe is None or self._process is None or not self._process.is_alive():
            self._end()
            # A process that starts anew holds no locks of threads that it does not have.
            context = multiprocessing.get_context("spawn")
            self._pipe, other = context.Pipe()
            self._process = context.Process(target=_serve, args=(other, self._mib), daemon=True)
            self._process.start()
            other.close()
        return self._pipe

    def _end(self) -> None:
        process, pipe = self._process, self._pipe
        self._process = self._pipe = None
        if process is not None:
            process.terminate()
            process.join()
            process.close()
        if pipe is not None:
            pipe.close()


def _serve(pipe: Connection, mib: int) -> None:
    """Do one task after the other, until the pipe is closed."""
    with contextlib.suppress(ImportError):  # not on Windows
        import resource

        resource.setrlimit(resource.RLIMIT_DATA, (mib * MIB, mib * MIB))
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl+C is for the trainer, which ends this
    if hasattr(os, "nice"):
        os.nice(NICENESS)

    def progress(done: int, total: int) -> None:
        pipe.send(("progress", (done, total)))

    while True:
        try:
            work, args = pipe.recv()
        except EOFError:
            return
        try:
            made = work(*args, progress)
        except BrokenPipeError:
            return
        except MemoryError:
            words = f"it takes more than {mib} MiB of memory: use fewer or smaller images"
            pipe.send(("failed", ValueError(words)))
        except Exception as error:
            pipe.send(("failed", _sendable(error)))
        else:
            pipe.send(("made", made))


def _sendable(error: Exception) -> Exception:
    """Return an error that can be pickled: itself, or the nearest that can."""
    nearest: Any = ValueError if isinstance(error, ValueError) else RuntimeError
    try:
        pickle.loads(pickle.dumps(error))  # noqa: S301
    except Exception:
        return nearest(str(error))
    return error
