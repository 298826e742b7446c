"""Hands that do what the page asks for, measured: how each run ended, and what it needed.

`PYTHONPATH=. python tests/app/followers.py first_view 1-32` (docs/scope.md) tries an exercise at
*normal*, `critical_view` the other. `view` and `bleeding` are the last levels of the course, at the
anatomy of each seed; `view` ends with the benchmarks that those runs make which pass.
"""

import sys
from collections import Counter

import msgspec
import tomli_w
from test_first_view import followed, of_level, usual

from app.classroom.benchmarks import scripted_benchmark
from app.classroom.course import INCIDENTS
from app.simulation import Incident, Metrics

SECONDS = 1800.0
"""In which a run ends."""
LEVELS = ("view", "bleeding")
BENCHMARKS = ("peak_stress_ratio", INCIDENTS, "time_s")
"""Of `view`."""


def tried(name: str, seed: int) -> tuple[Metrics, list[Incident]] | None:
    """Print how a run at an exercise or a level ended; return what it measured, if it passed."""
    session = followed(
        seed, of_level(name, seed) if name in LEVELS else usual(name), SECONDS
    ).session
    outcome, incidents = session.run.outcome, session.run.incidents()
    passed = outcome is not None and outcome.passed
    tears = sum(each.kind == "tear" for each in session.spatial.events)
    print(
        f"# {name} {seed}: {'passed' if passed else 'FAILED'}, {session.run.seconds:.0f} s,",
        f"{len(incidents)} errors {dict(Counter(each.error for each in incidents))},",
        f"{100.0 * session.spatial.peak_stress_ratio:.0f} % of a break, {tears} tears.",
        "" if passed else session.run.standing if outcome is None else outcome.reason,
        flush=True,
    )
    return (session.metrics(), incidents) if passed else None


def main(name: str, seeds: list[int]) -> None:
    """Print how each run ended, and the benchmarks."""
    runs = [each for seed in seeds if (each := tried(name, seed)) is not None]
    print(f"# {len(runs)} of {len(seeds)} passed")
    if name == "view" and runs:
        found = [scripted_benchmark(name, each, runs) for each in BENCHMARKS]
        print(tomli_w.dumps({"benchmark": [msgspec.to_builtins(each) for each in found]}))


if __name__ == "__main__":
    ranges = [each.partition("-") for each in sys.argv[2:]]
    main(sys.argv[1], [n for low, _, high in ranges for n in range(int(low), int(high or low) + 1)])
