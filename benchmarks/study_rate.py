"""A study of ducts: rows a second on this machine and on a Dask cluster, and their peak memory."""

import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any
from unittest.mock import patch

import psutil
import pyarrow.parquet as pq
from rich.console import Console

from app.study.ensemble import Ensemble, run_study
from app.study.plan import Plan, read_plan
from assets import BILE_DUCT
from benchmarks.opensees_beam import opensees_deflections
from physics import Beam, Exact, break_of
from physics.exact import many

ROWS, MANY = 10_240, 204_800
"""Rows of a study of seconds, and of one beside which the start of workers is short."""
PEERS = 300
"""Rows that are solved one by one, for their rate."""
TEXT = """\
samples = {samples}
seed = 1
[duct]
preset = "thesis-bile-duct"
theory = "{theory}"
force_N = 2.0
[inputs.modulus_MPa]
distribution = "lognormal"
median = 0.31
factor = 1.5
[inputs.break_stress_MPa]
distribution = "uniform"
low = 0.1
high = 0.3
[inputs.diameter_mm]
distribution = "normal"
mean = 8.9
sd = 0.5
"""
MEMORY = """
import resource, sys
from pathlib import Path
from app.study.ensemble import run_study
from app.study.plan import read_plan
run_study(read_plan(Path(sys.argv[1])), Path(sys.argv[2]), workers=1)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""


def measure_study(console: Console) -> dict[str, float]:
    """Print and return the figures of a study."""
    figures: dict[str, float] = {"rows": ROWS}
    with tempfile.TemporaryDirectory() as place, console.status("Solving ducts ..."):
        folder = Path(place)
        plan = _plan(folder, ROWS, "exact")
        Ensemble(plan).solve(0)  # compiles
        figures["seconds_of_10240_rows"] = _seconds(plan, folder / "1", workers=1)
        plan = _plan(folder, MANY, "exact")
        cpu = time.process_time()
        figures["one_worker_per_s"] = MANY / _seconds(plan, folder / "many", workers=1)
        cpu = time.process_time() - cpu
        figures["study_us_a_row"] = 1e6 * cpu / MANY
        figures["two_workers_per_s"] = MANY / _seconds(plan, folder / "2", workers=2)
        with _dask_cluster(folder) as (address, processes):
            run_study(_plan(folder, 2 * ROWS, "exact"), folder / "warm", scheduler=address)
            before = _processor_seconds(processes)
            seconds, own = time.perf_counter(), time.process_time()
            run_study(plan, folder / "dask", scheduler=address)
            seconds, own = time.perf_counter() - seconds, time.process_time() - own
            after = _processor_seconds(processes)
        figures["two_of_dask_per_s"] = MANY / seconds
        figures["dask_efficiency"] = MANY / seconds / (2.0 * figures["one_worker_per_s"])
        # What a busy machine does not falsify: processor time, told apart. Both cores are the
        # workers' and the others' together, so that the most that can be reached is what the one
        # process took over what all of them took.
        figures["one_process_processor_s"] = cpu
        figures["dask_this_process_processor_s"] = own
        for name in after:
            figures[f"dask_{name}_processor_s"] = after[name] - before[name]
        work = own + sum(after.values()) - sum(before.values())
        figures["dask_efficiency_by_processor_time"] = cpu / work
        rows = pq.read_table(folder / "1" / "results.parquet").slice(0, PEERS).to_pylist()
        figures |= _one_by_one(rows)
        figures |= _organs(folder)
        closed = _plan(folder, 100 * ROWS, "cubic")
        figures["cubic_per_s"] = 100 * ROWS / _seconds(closed, folder / "cubic", workers=1)
        for name, samples in (("small", ROWS), ("large", 100 * ROWS)):
            _plan(folder, samples, "cubic")
            done = subprocess.run(
                [sys.executable, "-c", MEMORY, folder / "plan.toml", folder / name],
                capture_output=True, text=True, check=True,
            )  # fmt: skip
            figures[f"peak_mb_{samples}_rows"] = float(done.stdout)
    for name, value in figures.items():
        console.print(f"{name:<28} {value:,.4g}", highlight=False)
    return figures


def _plan(folder: Path, samples: int, theory: str) -> Plan:
    path = folder / "plan.toml"
    path.write_text(TEXT.format(samples=samples, theory=theory))
    return read_plan(path)


def _organs(folder: Path) -> dict[str, float]:
    """Return the processor's time a row of an organ, and over that of the compiled solver alone."""
    start = TEXT.index("[inputs.diameter_mm]")
    text = TEXT[:start].replace('preset = "thesis-bile-duct"', f'organ = "{BILE_DUCT}"')
    path = folder / "plan.toml"
    path.write_text(text.format(samples=ROWS, theory="exact"))
    study, spent = Ensemble(read_plan(path)), 0.0
    compiled = many.solve_ducts

    def timed(*given: Any) -> None:
        nonlocal spent
        started = time.process_time()
        compiled(*given)
        spent += time.process_time() - started

    study.solve(0)  # compiles
    with patch.object(many, "solve_ducts", timed):
        whole = time.process_time()
        for block in range(1, 5):
            study.solve(block)
        whole = time.process_time() - whole
    rows = 4 * study.samples_of_block
    return {"organ_us_a_row": 1e6 * whole / rows, "organ_over_compiled_solver": whole / spent}


def _seconds(plan: Plan, folder: Path, *, workers: int) -> float:
    """Return the time of a study with the start of its workers."""
    started = time.perf_counter()
    run_study(plan, folder, workers=workers)
    return time.perf_counter() - started


@contextmanager
def _dask_cluster(folder: Path) -> Iterator[tuple[str, dict[str, psutil.Process]]]:
    """Give the address of a scheduler with two workers, a process each, and these by name."""
    file = folder / "scheduler.json"
    options = ("--scheduler-file", str(file), "--no-dashboard")
    commands = {
        "scheduler": ("scheduler", "--host", "127.0.0.1", "--port", "0", *options),
        "worker_1": ("worker", "--nthreads", "1", "--no-nanny", *options),
        "worker_2": ("worker", "--nthreads", "1", "--no-nanny", *options),
    }
    client: Any = import_module("distributed").Client
    with ExitStack() as stack:
        processes: dict[str, psutil.Process] = {}
        for name, (kind, *words) in commands.items():
            program = [sys.executable, "-m", f"distributed.cli.dask_{kind}", *words]
            process = subprocess.Popen(program, cwd=folder, stderr=subprocess.DEVNULL)
            stack.callback(process.wait)
            stack.callback(process.terminate)
            processes[name] = psutil.Process(process.pid)
        with client(scheduler_file=str(file), timeout=120) as one:
            one.wait_for_workers(2)
            address = str(one.scheduler.address)
        yield address, processes


def _processor_seconds(processes: dict[str, psutil.Process]) -> dict[str, float]:
    times = {name: process.cpu_times() for name, process in processes.items()}
    return {name: each.user + each.system for name, each in times.items()}


def _one_by_one(rows: list[dict[str, float]]) -> dict[str, float]:
    """Return the processor's time a row of the same ducts by a loop over solvers."""
    beams = [
        Beam.round(span=50.8, diameter=row["diameter_mm"], modulus=row["modulus_MPa"])
        for row in rows
    ]
    started = time.process_time()
    for beam, row in zip(beams, rows, strict=True):
        Exact().pull(beam, 25.4).to_force(2.0)
        break_of(Exact().pull(beam, 25.4), row["break_stress_MPa"])
    figures = {"python_loop_us_a_row": 1e6 * (time.process_time() - started) / len(rows)}
    try:
        started = time.process_time()
        found = opensees_deflections(beams, [2.0] * len(beams))
        figures["opensees_us_a_load"] = 1e6 * (time.process_time() - started) / len(rows)
    except (ImportError, RuntimeError) as failure:
        wanted = "on Debian, apt install libblas3 liblapack3"
        print(f"no OpenSeesPy: {failure}; {wanted}", file=sys.stderr)
        return figures
    off = [abs(a / row["deflection_mm"] - 1.0) for a, row in zip(found, rows, strict=True)]
    figures["opensees_largest_difference"] = max(off)
    started = time.process_time()
    for beam in beams:
        Exact().pull(beam, 25.4).to_force(2.0)
    figures["exact_us_a_load"] = 1e6 * (time.process_time() - started) / len(rows)
    return figures
