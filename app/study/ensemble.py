# Dask's types are partial.
# pyright: reportUnknownVariableType=false, reportUnknownArgumentType=false
# pyright: reportUnknownMemberType=false, reportAttributeAccessIssue=false
"""A study carried out: its rows in blocks that any process solves alike, in any order.

What a block is follows from the plan alone, so that results are the same to the bit whatever the
number of workers. A block is thousands of ducts by a closed form, hundreds by compiled code, one
on a bed: some tenths of a second of work, beside which handing it over costs nothing. This process
writes what comes back; blocks that are written are not solved again.
"""

import hashlib
import multiprocessing
import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

import numpy as np

from app.study.distribution import Choices
from app.study.ducts import Block, solve_pulls
from app.study.inputs import INPUTS
from app.study.plan import Plan, Value
from app.study.results import ResultsFolder, packed, study_versions
from app.study.sampling import drawn_columns, draws

__all__ = ["Done", "Ensemble", "cores", "run_study"]

ROWS_OF_BLOCK = {"cubic": 16384, "string": 16384, "exact": 1024, "fem": 16, "mass-spring": 8}
"""Rows of a block, about, by theory; of several the fewest."""
AHEAD = 3
"""Blocks handed out for each thread of a cluster."""
MOST_DEATHS = 3
"""Times that workers may die in a row without one block coming back."""

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Ensemble:
    """The blocks of a plan; what a worker is sent."""

    plan: Plan

    @cached_property
    def samples_of_block(self) -> int:
        """Draws in a block."""
        plan = self.plan
        theories = plan.values_of("theory") or ("exact",)
        rows = 1 if plan.has_bed else min(ROWS_OF_BLOCK[str(each)] for each in theories)
        if "organ" in {*plan.fixed, *plan.varied} and "exact" in theories:
            rows = min(rows, 16)
        return max(1, rows // (plan.mixes * plan.cells))

    @property
    def blocks(self) -> int:
        """How many."""
        return -(-self.plan.samples // self.samples_of_block)

    def solve(self, block: int) -> bytes:
        """Return the results of a block as a Parquet file."""
        plan = self.plan
        first = block * self.samples_of_block
        count = min(self.samples_of_block, plan.samples - first)
        points = draws(
            len(plan.drawn),
            first,
            count,
            sampling=plan.sampling,
            seed=plan.seed,
            indices=plan.indices,
        )
        # Each row of draws in each cell of the grid.
        cells = plan.cells
        drawn = {
            name: np.repeat(column, cells)
            for name, column in drawn_columns(plan.drawn, points).items()
        }
        rows = len(points) * cells
        draw = first + np.arange(rows) // (plan.mixes * cells)
        mix = (np.arange(rows) // cells % plan.mixes).astype(np.int16)
        numbers: dict[str, Any] = {}
        words: dict[str, Any] = {}
        for name, value in plan.fixed.items():
            if INPUTS[name].is_number:
                numbers[name] = np.full(rows, value)
            else:
                words[name] = ((str(value),), np.zeros(rows, dtype=np.int64))
        for name, kind in plan.drawn.items():
            column = drawn[name]
            if isinstance(kind, Choices):
                self._discrete(name, plan.values_of(name), column, numbers, words)
            else:
                numbers[name] = column
        stride = cells
        for name, values in plan.grid.items():
            stride //= len(values)
            at = np.arange(rows) % cells // stride % len(values)
            self._discrete(name, values, at, numbers, words)
        block_of = Block(rows, numbers, words)
        if plan.has_bed:
            from app.study.beds import solve_beds

            outputs, faults = solve_beds(plan, block_of)
        else:
            outputs, faults = solve_pulls(plan, block_of)
        inputs = {name: words[name] if name in words else numbers[name] for name in plan.varied}
        return packed(draw, mix, inputs, outputs, faults)

    @staticmethod
    def _discrete(
        name: str,
        values: tuple[Value, ...],
        at: Any,
        numbers: dict[str, Any],
        words: dict[str, Any],
    ) -> None:
        if INPUTS[name].is_number:
            numbers[name] = np.array([float(each) for each in values])[at]
        else:
            words[name] = (tuple(str(each) for each in values), at)


@dataclass(frozen=True, slots=True)
class Done:
    """What a run of a study did."""

    rows: int  # in the results
    solved: int  # of them in this run
    faults: int  # rows that have a fault


def cores() -> int:
    """Return the number of cores that this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on this system
        return os.cpu_count() or 1


def run_study(
    plan: Plan,
    folder: Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    as_csv: bool = False,
    progress: Progress | None = None,
) -> Done:
    """Carry a study out, from where it was ended, and write its results.

    Parameters
    ----------
    plan, folder
        The study, and where its results are written.
    workers
        Processes on this machine; None: one a core.
    scheduler
        Address of a Dask scheduler, whose workers do the work instead.
    as_csv
        Whether to write the results as CSV, too.
    progress
        Is told the rows done and those of the study.

    Returns
    -------
    Done
        How many rows.

    Raises
    ------
    ValueError
        If the folder is of another study, or the cluster cannot be reached or is of other versions.
    """
    results = ResultsFolder(folder)
    held = b"".join(
        name.encode() + b"\0" + hashlib.sha256(plan.files[name]).digest()
        for name in sorted(plan.files)
    )
    results.open(plan, hashlib.sha256(held).hexdigest() if held else "")
    study = Ensemble(plan)
    if results.table.exists() and not results.written():
        if as_csv and not (folder / "results.csv").exists():
            results.csv()
        return Done(plan.rows, 0, results.faults())
    todo = [block for block in range(study.blocks) if block not in results.written()]
    size = study.samples_of_block * plan.mixes * plan.cells
    before = done = (study.blocks - len(todo)) * size
    if progress is not None:
        progress(min(done, plan.rows), plan.rows)
    if scheduler is not None:
        solved = _by_dask(study, todo, scheduler)
    elif (count := min(workers or cores(), len(todo))) <= 1:
        solved = ((block, study.solve(block)) for block in todo)
    else:
        solved = _by_processes(study, todo, count)
    for block, content in solved:
        results.write(block, content)
        done += size
        if progress is not None:
            progress(min(done, plan.rows), plan.rows)
    results.join(plan, study.blocks)
    if as_csv:
        results.csv()
    return Done(plan.rows, plan.rows - min(before, plan.rows), results.faults())


def _by_processes(study: Ensemble, todo: Iterable[int], count: int) -> Iterator[tuple[int, bytes]]:
    """Give blocks as they come; that of a process that died goes to a new one."""
    # A process that starts anew holds no locks of threads that it does not have; each has a pipe
    # of its own, so that none waits for one that died.
    context = multiprocessing.get_context("spawn")
    waiting = deque(todo)
    working: dict[Connection, tuple[BaseProcess, int]] = {}
    deaths = 0
    try:
        while waiting or working:
            while waiting and len(working) < count:
                ours, theirs = context.Pipe()
                process = context.Process(target=_work, args=(study, theirs), daemon=True)
                process.start()
                theirs.close()
                working[ours] = process, waiting.popleft()
                ours.send(working[ours][1])
            for link in wait(list(working)):
                assert isinstance(link, Connection)  # noqa: S101
                process, block = working.pop(link)
                try:
                    content: bytes | Exception = link.recv()
                except (EOFError, OSError):
                    waiting.appendleft(block)
                    link.close()
                    process.join()
                    deaths += 1
                    if deaths == MOST_DEATHS:
                        raise ValueError(
                            f"workers ended {deaths} times without a result, for lack of memory "
                            "perhaps; what is written is kept: give fewer --workers and start it "
                            "again"
                        ) from None
                    continue
                if isinstance(content, Exception):
                    raise content
                deaths = 0
                if waiting:  # before what it gave is written
                    working[link] = process, waiting.popleft()
                    link.send(working[link][1])
                else:
                    link.close()
                yield block, content
    finally:
        for process, _ in working.values():
            process.terminate()


def _work(study: Ensemble, link: Connection) -> None:
    """Solve blocks in a process of its own until nobody asks for more."""
    try:
        while True:
            block = link.recv()
            try:
                link.send(study.solve(block))
            except Exception as error:
                link.send(error)
    except (EOFError, OSError, KeyboardInterrupt):
        return


def _by_dask(study: Ensemble, todo: Iterable[int], address: str) -> Iterator[tuple[int, bytes]]:
    """Give blocks as the workers of a Dask cluster send them; Dask repeats those of lost ones."""
    try:
        from distributed import Client, as_completed
    except ImportError as error:
        raise ValueError("a scheduler needs Dask: pip install 'bluntdissect[dask]'") from error
    try:
        client = Client(address, timeout=20, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ValueError(f"no Dask scheduler answers at {address}: {error}") from None
    with client:
        ours = study_versions()
        for worker, theirs in client.run(study_versions, on_error="return").items():
            if theirs != ours:
                said = theirs if isinstance(theirs, dict) else f"not this program ({theirs})"
                raise ValueError(
                    f"the worker {worker} has {said}, and this process {ours}: install the same"
                )
        waiting = iter(todo)
        whole = client.scatter(study, broadcast=True, hash=True)
        ahead = AHEAD * max(1, sum(client.nthreads().values()))

        def submit() -> Iterator[Any]:
            for block in waiting:
                yield client.submit(_solve_whole, whole, block, pure=False, retries=3)

        more = submit()
        running = as_completed(
            [each for each, _ in zip(more, range(ahead), strict=False)], with_results=True
        )
        for future, (block, content) in running:
            yield block, content
            future.release()
            if (new := next(more, None)) is not None:
                running.add(new)


def _solve_whole(study: Ensemble, block: int) -> tuple[int, bytes]:
    return block, study.solve(block)
