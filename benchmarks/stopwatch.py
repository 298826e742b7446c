"""The shortest time of some runs: what else the machine does can only make a run longer."""

import time
from collections.abc import Callable

REPEATS = 9


def microseconds(action: Callable[[], object], count: int, repeats: int = REPEATS) -> float:
    """Return the shortest time of some runs, us for each operation of a run."""
    action()
    times: list[float] = []
    for _ in range(repeats):
        start = time.perf_counter()
        action()
        times.append(time.perf_counter() - start)
    return 1e6 * min(times) / count
