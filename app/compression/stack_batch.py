"""Many stacks compressed into one folder, from where that was ended.

The folder's `summary.jsonl` gets a line for each stack as it is done, with what `--json` says of it
and a hash of the stack's files, the options and the program's version. A stack whose line and organ
file are there is not compressed again; one that failed is tried again. When all are done,
`summary.csv` is the same as a table.
"""

import csv
import dataclasses
import hashlib
import io
import math
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import msgspec

from app.compression.report import Facts
from app.compression.stack_job import Failed, StackJob, try_stack
from app.versions import versions
from app.workers import by_dask, by_processes, cores
from organ_geometry import write_atomic

SUMMARY = "summary.jsonl"
TABLE = "summary.csv"
NOT_IN_TABLE = ("warnings", "doubts", "notes", "sections")


def compress_all(
    jobs: Sequence[StackJob], folder: Path, scheduler: str | None = None
) -> Iterator[Facts | Failed]:
    """Compress many stacks, one process a core or on a Dask cluster, and keep the summary.

    Those done before come first. One that fails does not stop the others, nor does one whose
    process dies.
    """
    summary = folder / SUMMARY
    hashes = {job: _hash_of(job) for job in jobs}
    before = _read(summary)
    outcomes: list[Facts | Failed] = []
    for job in jobs:
        facts = before.get(hashes[job])
        there = job.output.is_file() and (job.figure is None or job.figure.is_file())
        if facts is not None and there and job.output.stat().st_size == facts.bytes_out:
            outcomes.append(facts)
            yield facts
    done = {outcome.stack for outcome in outcomes}
    todo = [job for job in jobs if str(job.stack) not in done]
    if scheduler is not None:
        solved = by_dask(try_stack, todo, scheduler, versions)
    else:
        solved = by_processes(try_stack, todo, min(len(todo), cores()), died=_died)
    with summary.open("ab") as file:
        if summary.stat().st_size > 0:
            file.write(b"\n")  # after a line that a kill cut short
        for job, outcome in solved:
            if isinstance(outcome, Facts):
                facts = {"job": hashes[job], **outcome.as_json()}
                file.write(msgspec.json.encode(facts) + b"\n")
                file.flush()
                os.fsync(file.fileno())
            outcomes.append(outcome)
            yield outcome
    order = {str(job.stack): number for number, job in enumerate(jobs)}
    outcomes.sort(key=lambda outcome: order[outcome.stack])
    write_atomic(folder / TABLE, _table(outcomes))


def _hash_of(job: StackJob) -> str:
    """Return a hash of a stack's files, by name, size and time, its options and the version."""
    stack = job.stack.resolve()
    try:
        files = sorted(stack.rglob("*")) if stack.is_dir() else [stack]
        held = [(str(file), file.stat().st_size, file.stat().st_mtime_ns) for file in files]
    except OSError:  # is said when it is read
        held = []
    asked = (versions(), held, job.output.name, job.read, job.reslice, job.trace, job.promise)
    return hashlib.sha256(repr(asked).encode()).hexdigest()


def _read(summary: Path) -> dict[str, Facts]:
    """Return what was done before by its job's hash; a line that a kill cut short is none."""
    found: dict[str, Facts] = {}
    for line in summary.read_bytes().splitlines() if summary.exists() else ():
        try:
            facts = msgspec.json.decode(line, type=dict[str, Any])
            for section in facts["sections"]:
                missing = {key: math.nan for key, value in section.items() if value is None}
                section.update(missing | {"problem": section["problem"]})
            found[facts.pop("job")] = msgspec.convert(facts, Facts)
        except (msgspec.DecodeError, KeyError, TypeError, AttributeError):
            continue
    return found


def _died(job: StackJob) -> Failed:
    return Failed(str(job.stack), "its process ended, for lack of memory perhaps")


def _table(outcomes: Sequence[Facts | Failed]) -> bytes:
    """Return the outcomes as CSV, one stack a row; a failed one has its error and no figures."""
    names = [one.name for one in dataclasses.fields(Facts) if one.name not in NOT_IN_TABLE]
    text = io.StringIO()
    table = csv.DictWriter(text, [*names, "doubtful", "error"])
    table.writeheader()
    for outcome in outcomes:
        if isinstance(outcome, Failed):
            table.writerow(outcome.as_json())
            continue
        row = {name: getattr(outcome, name) for name in names}
        table.writerow(row | {"doubtful": "yes" if outcome.doubts else "no"})
    return text.getvalue().encode()
