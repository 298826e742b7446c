"""The shortest time of some runs, as others can only make it longer; and waiting for a time."""

import time
from collections.abc import Callable

from app.haptics.servo import SPIN_SECONDS

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


def wait_until(due: float) -> float:
    """Sleep and spin until a time of `perf_counter`, as the servo does, and return the time."""
    while (wait := due - time.perf_counter()) > SPIN_SECONDS:
        time.sleep(wait - SPIN_SECONDS)
    while (now := time.perf_counter()) < due:
        pass
    return now
