"""How long it takes to find errors in a tick: processor time, median and mean, of good hands."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from rich.console import Console

from app.command_line.load import shipped_organ
from app.simulation import CarefulRun, Replay
from app.simulation.scripts.exercise_limits import IN_BED
from app.simulation.session.error_finder import ErrorFinder
from assets import RUNS
from benchmarks.faults import TREMOR, done, exercises, good

TICKS = 6000
"""Of the recorded critical view, from its begin."""


@contextmanager
def timed_finder() -> Iterator[list[float]]:
    """Give a list of how long each tick's errors took to find, us; the first compiles."""
    take, times = ErrorFinder.take, list[float]()

    def timed(self: ErrorFinder, stretches: list[tuple[float, float]], out_of_sight: int) -> None:
        start = time.thread_time()
        take(self, stretches, out_of_sight)
        times.append(1e6 * (time.thread_time() - start))

    ErrorFinder.take = timed
    try:
        yield times
    finally:
        ErrorFinder.take = take


def measure_finder(console: Console) -> dict[str, Any]:
    """Print and return the time a tick, by exercise: three in beds, and the critical view."""
    figures: dict[str, Any] = {}

    def note(name: str, times: list[float]) -> None:
        figures[name] = {"median_us": float(np.median(times)), "mean_us": float(np.mean(times[1:]))}
        console.print(
            f"Errors of {name} found: median {figures[name]['median_us']:.1f}, "
            f"mean {figures[name]['mean_us']:.1f} us of a tick",
            highlight=False,
        )

    exercises("normal")  # found before, as hands do them meanwhile
    for name in IN_BED:
        with timed_finder() as times:
            done(name, "normal", 71, good, tremor=TREMOR)
        note(name, times)
    recorded = CarefulRun.read(RUNS / "critical_view.json.xz").run
    with timed_finder() as times:
        Replay(recorded.log, shipped_organ()).seek_tick(TICKS)
    note("critical_view", times)
    return figures
