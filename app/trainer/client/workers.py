"""Threads and a process that do the slow work of all clients, and what a client reads meanwhile."""

import threading
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass, field

import viser

from app.compression.build_process import BuildProcess
from app.trainer.client.background_worker import BackgroundWorker

PATIENCE = 0.4
"""s of waiting after which the client is told what is being done."""
EXPORT_VERTICES = 20_000
"""Of a surface that is downloaded, about: edges of half a millimetre on the shipped duct."""


@dataclass(frozen=True, slots=True)
class Workers:
    """Threads and a process that do the slow work of all clients, and how much they may make."""

    # finds in a moment what a client waits for: how a run ended, or what typed numbers mean
    awaited: BackgroundWorker = field(default_factory=BackgroundWorker)
    # replays runs for their results, which takes as long as a minute each
    results: BackgroundWorker = field(default_factory=BackgroundWorker)
    # solves what takes long, or no client waits for; seconds, and minutes where it compiles first
    background: BackgroundWorker = field(default_factory=BackgroundWorker)
    # builds organs, which takes seconds, one client's after the other's
    builder: BackgroundWorker = field(default_factory=BackgroundWorker)
    # runs the builder's work, so that it can be cancelled
    build_process: BuildProcess = field(default_factory=BuildProcess)
    export_vertices: int = EXPORT_VERTICES

    def stop(self) -> None:
        """End them."""
        threads = self.awaited, self.results, self.background
        for each in (*threads, self.build_process, self.builder):
            each.stop()


@contextmanager
def explained(client: viser.ClientHandle, what: str) -> Generator[None]:
    """Tell a client what is being done, if it takes longer than `PATIENCE`."""
    shown: list[viser.NotificationHandle] = []
    over = threading.Event()
    lock = threading.Lock()

    def show() -> None:
        with lock:
            if not over.is_set():
                shown.append(
                    client.add_notification(
                        "One moment", what, loading=True, with_close_button=False
                    )
                )

    timer = threading.Timer(PATIENCE, show)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        with lock:
            over.set()
        for notice in shown:
            notice.remove()
