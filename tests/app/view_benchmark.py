"""Benchmarks of the course's last level, by hands that do only what the page asks for.

`python tests/app/view_benchmark.py` prints them, from runs at the level's anatomies; with seeds,
as `python tests/app/view_benchmark.py 1 2 3`, from those at these that pass.
"""

import sys

import msgspec
import tomli_w
from test_first_view import followed, last_level

from app.classroom.benchmarks import scripted_benchmark
from app.classroom.course import INCIDENTS, default_course, read_course
from app.simulation import Incident, Metrics

METRICS = ("peak_stress_ratio", INCIDENTS, "time_s")


def main(seeds: list[int]) -> None:
    """Print how each run ended, and the benchmarks."""
    runs: list[tuple[Metrics, list[Incident]]] = []
    for seed in seeds or read_course(default_course()).level_of("view").seeds:
        session = followed(seed, last_level(seed), 1800.0).session
        outcome, made = session.run.outcome, (session.metrics(), session.run.incidents())
        ended = session.run.standing if outcome is None else outcome.reason
        print(f"# seed {seed}, {made[0]['time_s']:.0f} s. {ended}", flush=True)
        if outcome is not None and outcome.passed:
            runs.append(made)
    found = [scripted_benchmark("view", each, runs) for each in METRICS]
    print(tomli_w.dumps({"benchmark": [msgspec.to_builtins(each) for each in found]}))


if __name__ == "__main__":
    main([int(each) for each in sys.argv[1:]])
