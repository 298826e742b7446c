"""Judge hands on many beds at once, on workers of this machine or of a Dask cluster.

    pip install 'bluntdissect[rl,dask]'
    python examples/judge_on_workers.py --workers 2 --beds 21-40

Over machines, start a scheduler on one and a worker on each, and give the scheduler's address:

    dask scheduler --host 127.0.0.1
    dask worker tcp://127.0.0.1:8786
    python examples/judge_on_workers.py --scheduler tcp://127.0.0.1:8786

An episode is a function of its bed's seed: wherever it is done it earns the same, to the bit. Put a
policy of your own in the place of the scripted hands.
"""

import argparse
import time
from typing import Any

from dask.distributed import Client, LocalCluster

from app.rl.demonstration import demonstrate
from app.rl.environment import DissectionEnv


def earned(bed: int, exercise: str) -> tuple[float, bool, float]:
    """What an episode in a bed earns, whether it is passed, and its seconds of the duct's time."""
    env = DissectionEnv(exercise=exercise)
    reward = float(demonstrate(env, bed).rewards.sum())
    assert env.episode is not None
    info = env.episode.info()
    return reward, bool(info["passed"]), float(info["seconds"])


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--exercise", default="window")
    parser.add_argument("--beds", default="21-40", help="first and last")
    parser.add_argument("--workers", type=int, default=2, help="on this machine")
    parser.add_argument("--scheduler", help="address of a cluster to use instead")
    given = parser.parse_args()
    first, last = map(int, given.beds.split("-"))
    beds = range(first, last + 1)
    local = None
    if given.scheduler is None:
        local = LocalCluster(
            n_workers=given.workers,
            threads_per_worker=1,
            host="127.0.0.1",
            dashboard_address="127.0.0.1:0",
        )
    with Client(local or given.scheduler) as client:
        # Each worker loads the compiled code and finds the exercise's limits once.
        client.run(earned, first, given.exercise)
        workers, start = len(client.scheduler_info()["workers"]), time.perf_counter()
        found: Any = client.gather(client.map(earned, beds, exercise=given.exercise))
        together = time.perf_counter() - start
    if local is not None:
        local.close()
    earned(first, given.exercise)
    start = time.perf_counter()
    mine = [earned(bed, given.exercise) for bed in beds]
    alone = time.perf_counter() - start
    ticks = 30.0 * sum(seconds for _, _, seconds in found)
    passed = sum(each[1] for each in found)
    print(f"{passed} of {len(beds)} beds passed; the same here: {found == mine}")
    print(
        f"{ticks / together:,.0f} ticks a second on {workers} workers, {ticks / alone:,.0f} in one "
        f"process: {alone / together:.2f} times as fast"
    )


if __name__ == "__main__":
    main()
