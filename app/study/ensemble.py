"""A study carried out: its rows in blocks that any process solves alike, in any order.

What a block is follows from the plan alone, so that results are the same to the bit whatever the
number of workers. A block is thousands of ducts by a closed form, hundreds by compiled code, one
on a bed or one anatomy: some tenths of a second of work, beside which handing it over costs
nothing; of a long study up to four times as many. This process writes what comes back, and joins
what is there in order meanwhile; blocks that are written are not solved again.
"""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from app.study.correlation import copula_factor, correlated
from app.study.distribution import Choices
from app.study.ducts import Block, solve_pulls
from app.study.inputs import INPUTS
from app.study.plan import Plan, Value
from app.study.results import ResultsFolder, packed, study_versions
from app.study.sampling import drawn_columns, draws
from app.workers import Progress, by_dask, by_processes, cores

# Rows of a block, about, by theory; of several the fewest.
ROWS_OF_BLOCK = {"cubic": 16384, "string": 16384, "exact": 1024, "fem": 16, "mass-spring": 8}
# The same of organs by the exact theory, each with a mesh of its own at worst.
ROWS_OF_ORGANS = 256
# To start a process takes as long as so many short blocks, about: fewer are not worth it.
BLOCKS_OF_WORKER = 16
SHORT_BLOCKS, LONGEST = 32, 4
"""A study of more blocks than this has longer ones, so many times as long at most."""


@dataclass(frozen=True)
class Ensemble:
    """The blocks of a plan; what a worker is sent."""

    plan: Plan

    @cached_property
    def _short(self) -> int:
        """Draws in a short block."""
        plan = self.plan
        theories = plan.values_of("theory") or ("exact",)
        rows = (
            1
            if plan.has_bed or plan.has_anatomy
            else min(ROWS_OF_BLOCK[str(each)] for each in theories)
        )
        if "organ" in {*plan.fixed, *plan.varied} and "exact" in theories:
            rows = min(rows, ROWS_OF_ORGANS)
        return max(1, rows // (plan.mixes * plan.cells))

    @property
    def length(self) -> int:
        """How many short blocks make one."""
        if self.plan.has_bed or self.plan.has_anatomy:
            return 1
        return min(max(self.plan.samples // (self._short * SHORT_BLOCKS), 1), LONGEST)

    @property
    def samples_of_block(self) -> int:
        """Draws in a block."""
        return self._short * self.length

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
        if plan.correlations:
            points = correlated(points, copula_factor(list(plan.drawn), plan.correlations))
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

        def discrete(name: str, values: tuple[Value, ...], at: Any) -> None:
            if INPUTS[name].is_number:
                numbers[name] = np.array([float(each) for each in values])[at]
            else:
                words[name] = (tuple(str(each) for each in values), at)

        for name, value in plan.fixed.items():
            discrete(name, (value,), np.zeros(rows, dtype=np.int64))
        for name, kind in plan.drawn.items():
            if isinstance(kind, Choices):
                discrete(name, plan.values_of(name), drawn[name])
            else:
                numbers[name] = drawn[name]
        stride = cells
        for name, values in plan.grid.items():
            stride //= len(values)
            discrete(name, values, np.arange(rows) % cells // stride % len(values))
        block_of = Block(rows, numbers, words)
        outputs: Mapping[str, Any]
        if plan.has_anatomy:
            from app.study.anatomies import solve_anatomies

            outputs, faults = solve_anatomies(plan, block_of, plan.seed + draw)
        elif plan.has_bed:
            from app.study.beds import solve_beds

            outputs, faults = solve_beds(plan, block_of)
        else:
            outputs, faults = solve_pulls(plan, block_of)
        inputs = {name: words[name] if name in words else numbers[name] for name in plan.varied}
        return packed(draw, mix, inputs, outputs, faults)


@dataclass(frozen=True, slots=True)
class Done:
    """What a run of a study did."""

    rows: int  # in the results
    solved: int  # of them in this run
    faults: int  # rows that have a fault


def run_study(
    plan: Plan,
    folder: Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    as_csv: bool = False,
    progress: Progress | None = None,
) -> Done:
    """Carry a study out, from where it was ended, and write its results in a folder.

    Parameters
    ----------
    plan, folder, workers
        None: one process a core, of a short study this process alone.
    scheduler
        Address of a Dask scheduler, whose workers do the work instead.
    as_csv, progress
        Whether to write the results as CSV, too; is told the rows done and those of the study.

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
    if results.table.exists():
        if as_csv and not (folder / "results.csv").exists():
            results.csv()
        return Done(plan.rows, 0, results.faults())
    written = results.written()
    todo = [block for block in range(study.blocks) if block not in written]
    size = study.samples_of_block * plan.mixes * plan.cells
    before = done = (study.blocks - len(todo)) * size
    if progress is not None:
        progress(min(done, plan.rows), plan.rows)
    most = min(cores(), len(todo) * study.length // BLOCKS_OF_WORKER)
    if scheduler is not None:
        solved = by_dask(study.solve, todo, scheduler, study_versions)
    elif (count := min(workers or most, len(todo))) <= 1:
        solved = ((block, study.solve(block)) for block in todo)
    else:
        solved = by_processes(study.solve, todo, count, died=_died)
    with results.joining(plan, study.blocks) as join:
        for block, content in solved:
            results.write(block, content)
            join()
            done += size
            if progress is not None:
                progress(min(done, plan.rows), plan.rows)
    if as_csv:
        results.csv()
    return Done(plan.rows, plan.rows - min(before, plan.rows), results.faults())


def _died(block: int) -> bytes:
    raise ValueError(
        f"a worker ended at block {block} twice, for lack of memory perhaps; what is written is "
        "kept: give fewer --workers and start it again"
    )
