"""Benchmarks of the course's last level, by hands that do only what the page asks for.

`python tests/app/view_benchmark.py 1 2 3` prints them, from those of these seeds' runs that pass.
They are at the anatomy *normal*: such hands passed at none of the level's own that were tried.
"""

import sys

import msgspec
import tomli_w
from test_first_view import followed

from app.classroom.benchmarks import scripted_benchmark
from app.classroom.course import INCIDENTS
from app.simulation import Incident, Metrics

METRICS = ("peak_stress_ratio", INCIDENTS, "time_s")


def main(seeds: list[int]) -> None:
    """Print how each run ended, and the benchmarks."""
    runs: list[tuple[Metrics, list[Incident]]] = []
    for seed in seeds:
        session = followed(seed, "critical_view", 1200.0).session
        outcome, made = session.run.outcome, (session.metrics(), session.run.incidents())
        ended = session.run.standing if outcome is None else outcome.reason
        print(f"# seed {seed}, {made[0]['time_s']:.0f} s. {ended}", flush=True)
        if outcome is not None and outcome.passed:
            runs.append(made)
    found = [scripted_benchmark("view", each, runs) for each in METRICS]
    print(tomli_w.dumps({"benchmark": [msgspec.to_builtins(each) for each in found]}))


if __name__ == "__main__":
    main([int(each) for each in sys.argv[1:]])
