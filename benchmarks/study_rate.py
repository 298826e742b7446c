"""A study of ducts: rows a second on this machine and on a Dask cluster, and their peak memory."""

import subprocess
import sys
import tempfile
import time
from importlib import import_module
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
from rich.console import Console

from app.study.ensemble import Ensemble, run_study
from app.study.plan import Plan, read_plan
from benchmarks.opensees_beam import opensees_deflections
from physics import Beam, Exact, break_of

__all__ = ["measure_study"]

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
        seconds, work = _by_dask(plan, folder / "dask")
        figures["two_of_dask_per_s"] = MANY / seconds
        # What a busy machine does not falsify: the same study's processor time, of one process and
        # of cluster, client and workers together.
        figures["dask_efficiency_by_processor_time"] = cpu / work
        rows = pq.read_table(folder / "1" / "results.parquet").slice(0, PEERS).to_pylist()
        figures |= _one_by_one(rows)
        closed = _plan(folder, 100 * ROWS, "cubic")
        figures["cubic_per_s"] = 100 * ROWS / _seconds(closed, folder / "cubic", workers=1)
        for name, samples in (("small", ROWS), ("large", 100 * ROWS)):
            _plan(folder, samples, "cubic")
            done = subprocess.run(
                [sys.executable, "-c", MEMORY, folder / "plan.toml", folder / name],
                capture_output=True, text=True, check=True,
            )  # fmt: skip
            figures[f"peak_mb_{samples}_rows"] = float(done.stdout)
    figures["dask_efficiency"] = figures["two_of_dask_per_s"] / (2 * figures["one_worker_per_s"])
    for name, value in figures.items():
        console.print(f"{name:<28} {value:,.4g}", highlight=False)
    return figures


def _plan(folder: Path, samples: int, theory: str) -> Plan:
    path = folder / "plan.toml"
    path.write_text(TEXT.format(samples=samples, theory=theory))
    return read_plan(path)


def _seconds(plan: Plan, folder: Path, *, workers: int) -> float:
    """Return the time of a study with the start of its workers."""
    started = time.perf_counter()
    run_study(plan, folder, workers=workers)
    return time.perf_counter() - started


def _by_dask(plan: Plan, folder: Path) -> tuple[float, float]:
    """Return seconds by the clock, and of the processors of all processes."""
    dask: Any = import_module("distributed")
    with dask.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0", host="127.0.0.1"
    ) as cluster:
        with dask.Client(cluster) as client:  # imports and compiled code, which a cluster has once
            client.run(Ensemble(plan).solve, 0)
            before = sum(client.run(time.process_time).values())
        own, started = time.process_time(), time.perf_counter()
        run_study(plan, folder, scheduler=cluster.scheduler_address)
        seconds, own = time.perf_counter() - started, time.process_time() - own
        with dask.Client(cluster) as client:
            return seconds, own + sum(client.run(time.process_time).values()) - before


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
