"""Work for a process that is started anew: it must be found in a module by its name."""

import os
import time
from collections.abc import Callable

Progress = Callable[[int, int], None]


class TwoWordsError(ValueError):
    """An error that pickle cannot make again."""

    def __init__(self, one: str, two: str) -> None:
        super().__init__(f"{one} {two}")


def doubled(number: int, progress: Progress) -> tuple[int, int]:
    """Twice a number, and the process that found it."""
    for done in range(number):
        progress(done + 1, number)
    return 2 * number, os.getpid()


def refused(progress: Progress) -> None:
    """Refuse."""
    raise TwoWordsError("not", "possible")


def missing(progress: Progress) -> None:
    """Look for what is not there."""
    raise FileNotFoundError(2, "nowhere")


def forever(progress: Progress) -> None:
    """Go on, but for being ended."""
    progress(1, 2)
    time.sleep(3600.0)


def dead(progress: Progress) -> None:
    """End the process."""
    os._exit(3)


def large(progress: Progress) -> int:
    """Take a gigabyte of memory."""
    return sum(memoryview(bytearray(2**30))[:: 2**20])
