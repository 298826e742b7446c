"""Work in blocks, by processes on this machine or by the workers of a Dask cluster.

A function goes to each worker once and its arguments one at a time; what it returns comes back in
any order. What a process that died was at is done again: first by itself, and if that process dies
too, it is that argument's fault.
"""

import multiprocessing
import os
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from importlib import import_module
from itertools import islice
from typing import Any, TypeVar

A = TypeVar("A")
R = TypeVar("R")
Progress = Callable[[int, int], None]
"""Is told how many are done of how many."""

# Arguments handed out for each worker.
AHEAD = 3


def cores() -> int:
    """Return the number of cores that this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on this system
        return os.cpu_count() or 1


def by_processes(
    function: Callable[[A], R],
    arguments: Sequence[A],
    workers: int,
    *,
    died: Callable[[A], R],
) -> Iterator[tuple[A, R]]:
    """Yield each argument and what the function returns of it, or `died` where no process lives."""
    waiting = deque(arguments)
    alone: deque[A] = deque()  # were being worked on when a process died
    while waiting or alone:
        one_by_one = bool(alone)
        left, count = (alone, 1) if one_by_one else (waiting, workers)
        running: dict[Future[R], A] = {}
        with _pool(function, count) as pool:
            try:
                while left or running:
                    while left and len(running) < (1 if one_by_one else AHEAD * count):
                        future = pool.submit(_apply, left[0])
                        running[future] = left.popleft()
                    for each in wait(running, return_when=FIRST_COMPLETED).done:
                        result = each.result()
                        yield running.pop(each), result
            except BrokenProcessPool:
                if one_by_one:
                    for culprit in running.values():
                        yield culprit, died(culprit)
                else:
                    alone.extend(running.values())


@contextmanager
def _pool(function: Callable[[Any], Any], workers: int) -> Generator[ProcessPoolExecutor]:
    # A process that starts anew holds no locks of threads that it does not have.
    context = multiprocessing.get_context("spawn")
    others = multiprocessing.active_children()
    pool = ProcessPoolExecutor(workers, context, _take, (function,))
    try:
        yield pool
    finally:
        # One that died may have held the lock of what is handed out, for which the others would
        # wait for ever; and where somebody stops it, what runs would go on to its end.
        pool.shutdown(wait=False, cancel_futures=True)
        for process in multiprocessing.active_children():
            if process not in others:
                process.terminate()


_function: Callable[[Any], Any] | None = None


def _take(function: Callable[[Any], Any]) -> None:
    """Keep the function in a worker, which ends with the program, even one that is killed."""
    global _function
    _function = function
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None  # noqa: S101 (only workers come here)
    parent.join()
    os._exit(1)


def _apply(argument: Any) -> Any:
    assert _function is not None  # noqa: S101 (the pool has called `_take`)
    return _function(argument)


def by_dask(
    function: Callable[[A], R],
    arguments: Sequence[A],
    address: str,
    versions: Callable[[], dict[str, str]],
) -> Iterator[tuple[A, R]]:
    """Yield each argument and what the function returns of it, from a scheduler's workers.

    Dask repeats what was lost with a worker.

    Raises
    ------
    ValueError
        If there is no Dask or no scheduler, or a worker has other versions than this process.
    """
    try:
        distributed: Any = import_module("distributed")
    except ImportError as error:
        raise ValueError("a scheduler needs Dask: pip install 'bluntdissect[dask]'") from error
    try:
        client = distributed.Client(address, timeout=20, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ValueError(f"no Dask scheduler answers at {address}: {error}") from None
    with client:
        ours = versions()
        for worker, theirs in client.run(versions, on_error="return").items():
            if theirs != ours:
                version: object = theirs
                if not isinstance(theirs, dict):
                    version = f"not this program ({theirs})"
                raise ValueError(
                    f"the worker {worker} has {version}, and this process {ours}: install the same"
                )
        waiting = deque(enumerate(arguments))
        whole = client.scatter(function, broadcast=True, hash=True)
        ahead = AHEAD * max(1, sum(client.nthreads().values()))

        def submit() -> Iterator[Any]:
            while waiting:
                number, argument = waiting.popleft()
                yield client.submit(_apply_whole, whole, number, argument, pure=False, retries=3)

        more = submit()
        running = distributed.as_completed(
            list(islice(more, ahead)), loop=client.loop, with_results=True
        )
        for future, (number, result) in running:
            yield arguments[number], result
            future.release()
            if (new := next(more, None)) is not None:
                running.add(new)


def _apply_whole(function: Callable[[A], R], number: int, argument: A) -> tuple[int, R]:
    return number, function(argument)
