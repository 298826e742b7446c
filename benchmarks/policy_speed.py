"""How fast environments for policies go: alone, side by side, and what Python takes of it."""

import os
import statistics
import time
import tracemalloc
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from app.rl.environment import DissectionEnv, DissectionVectorEnv
from app.rl.episode import Episode
from app.rl.task import Task
from app.simulation import SpatialTissue
from app.workers import cores
from benchmarks.mujoco_duct import beside_mujoco

SECONDS, WARM, COUNTS, EPISODES, BLOCK = 3.0, 20, (8, 16), 8, 10
PASSES, STEPS = 60, 40


@contextmanager
def _physics_marked() -> Iterator[list[float]]:
    """Note in a list when each tick's compiled part begins and ends, s."""
    marks, step = list[float](), SpatialTissue.step

    def marked(self: SpatialTissue) -> None:
        # Not a processor's time: to ask for it takes longer, and leaves less in the caches.
        marks.append(time.perf_counter())
        step(self)
        marks.append(time.perf_counter())

    SpatialTissue.step = marked
    try:
        yield marks
    finally:
        SpatialTissue.step = step


def _alone(passes: int, **arguments: Any) -> dict[str, float]:
    """Random hands in one environment, and what the physics takes of it."""
    # The same steps in each pass, and the least time of each part: what else runs takes no part.
    env = DissectionEnv(**arguments)
    env.action_space.seed(1)
    actions = [env.action_space.sample() for _ in range(STEPS)]
    least: NDArray[np.float64] | None = None
    with _physics_marked() as marks:
        for _ in range(passes):
            env.reset(seed=1)
            marks[:] = [time.perf_counter()]
            for action in actions:
                env.step(action)
            marks.append(time.perf_counter())
            parts = np.diff(marks)
            least = parts if least is None else np.minimum(least, parts)
    assert least is not None
    ticks = STEPS * env.task.ticks_per_step
    return {
        "ticks_per_second": ticks / float(least.sum()),
        "tick_ms": 1e3 * float(least.sum()) / ticks,
        "physics_ms": 1e3 * float(least[1::2].sum()) / ticks,
    }


def _side_by_side(count: int, threads: int) -> dict[str, float]:
    """Random hands in environments side by side: the median of blocks, and the best one."""
    envs = DissectionVectorEnv(count, threads=threads)
    envs.action_space.seed(1)
    actions = [envs.action_space.sample() for _ in range(100)]
    envs.reset(seed=1)
    for action in actions[:WARM]:
        envs.step(action)
    rates, start, busy = list[float](), time.perf_counter(), time.process_time()
    now = start
    while now - start < SECONDS:
        before = now
        for action in actions[:BLOCK]:
            envs.step(action)
        now = time.perf_counter()
        rates.append(count * BLOCK * envs.task.ticks_per_step / (now - before))
    busy = time.process_time() - busy
    envs.close()
    return {
        "ticks_per_second": statistics.median(rates),
        "best_ticks_per_second": max(rates),
        "cores_used": busy / (now - start),
    }


def _megabytes() -> float:
    task = Task()
    first = Episode(task)
    first.act(np.zeros(task.size))
    tracemalloc.start()
    kept = [Episode(task) for _ in range(EPISODES)]
    for each in kept:
        each.act(np.zeros(task.size))
    size = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    return size / EPISODES / 1e6


def measure_policies(console: Console) -> dict[str, Any]:
    """Print and return how fast environments go, the memory of a bed, and MuJoCo beside us."""
    with console.status("Timing environments ..."):
        alone, megabytes = _alone(PASSES), _megabytes()
        tubes = _alone(PASSES // 4, anatomy="normal", exercise="critical_view")
        found = {
            f"{count} with {threads}": _side_by_side(count, threads)
            for count in COUNTS
            for threads in sorted({1, cores()})
        }
        peer = beside_mujoco()
    fraction = 1.0 - alone["physics_ms"] / alone["tick_ms"]
    console.print(
        f"One environment: {alone['ticks_per_second']:,.0f} ticks of 1/30 s a second of one "
        f"core, {alone['tick_ms']:.2f} ms each, of which the physics is "
        f"{alone['physics_ms']:.2f} ms and all else {100.0 * fraction:.0f} %; "
        f"{megabytes:.2f} MB a bed; load {os.getloadavg()[0]:.1f}",
        highlight=False,
        soft_wrap=True,
    )
    console.print(
        f"Five tubes of an anatomy with 1,426 strands: {tubes['ticks_per_second']:,.0f} ticks "
        f"a second of one core, {tubes['tick_ms']:.2f} ms each, the physics "
        f"{tubes['physics_ms']:.2f} ms",
        highlight=False,
        soft_wrap=True,
    )
    for name, each in found.items():
        console.print(
            f"{name} threads: {each['ticks_per_second']:,.0f} ticks a second, at best "
            f"{each['best_ticks_per_second']:,.0f}, on {each['cores_used']:.2f} cores",
            highlight=False,
        )
    console.print(
        f"MuJoCo: {peer['note']}"
        if "note" in peer
        else f"MuJoCo {peer['mujoco']} with {peer['tendons']} tendons and {peer['freedoms']} "
        f"freedoms: {peer['mujoco_us']:,.0f} us a step of 1/240 s, ours {peer['ours_us']:.0f} us",
        highlight=False,
        soft_wrap=True,
    )
    return {
        "alone": alone,
        "tubes": tubes,
        "megabytes": megabytes,
        "side_by_side": found,
        "mujoco": peer,
    }
