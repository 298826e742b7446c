"""How fast environments for policies go: alone, side by side, and what Python takes of it."""

import os
import statistics
import time
import tracemalloc
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from rich.console import Console

from app.rl.environment import DissectionEnv, DissectionVectorEnv
from app.rl.episode import Episode
from app.rl.task import Task
from app.simulation import SpatialTissue
from app.workers import cores
from benchmarks.mujoco_duct import beside_mujoco

__all__ = ["measure_policies"]

SECONDS, WARM, COUNTS, EPISODES, BLOCK = 3.0, 20, (8, 16), 8, 10


@contextmanager
def _physics_timed() -> Iterator[list[float]]:
    """Add up the seconds that compiled ticks take in the only number of a list."""
    spent, step = [0.0], SpatialTissue.step

    def timed(self: SpatialTissue) -> None:
        # Not a processor's time: to ask for it leaves less in the caches than the physics does.
        start = time.perf_counter()
        step(self)
        spent[0] += time.perf_counter() - start

    SpatialTissue.step = timed
    try:
        yield spent
    finally:
        SpatialTissue.step = step


def _alone(**arguments: Any) -> dict[str, float]:
    """Random hands in one environment, and what the physics takes of it."""
    env = DissectionEnv(**arguments)
    env.action_space.seed(1)
    actions = [env.action_space.sample() for _ in range(200)]
    env.reset(seed=1)
    for action in actions[:WARM]:
        env.step(action)
    steps, start, busy = 0, time.perf_counter(), time.process_time()
    with _physics_timed() as physics:
        while time.perf_counter() - start < SECONDS:
            *_, terminated, truncated, _ = env.step(actions[steps % len(actions)])
            steps += 1
            if terminated or truncated:
                env.reset()
    seconds, ticks = time.perf_counter() - start, steps * env.task.ticks_per_step
    return {
        "ticks_per_cpu_second": ticks / (time.process_time() - busy),
        "tick_ms": 1e3 * seconds / ticks,
        "physics_ms": 1e3 * physics[0] / ticks,
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

    def block() -> float:
        before = time.perf_counter()
        for action in actions[:BLOCK]:
            envs.step(action)
        return count * BLOCK * envs.task.ticks_per_step / (time.perf_counter() - before)

    while time.perf_counter() - start < SECONDS:
        rates.append(block())
    busy, seconds = time.process_time() - busy, time.perf_counter() - start
    start = time.perf_counter()
    with _physics_timed() as physics:
        for _ in rates:
            block()
    whole = threads * (time.perf_counter() - start)
    envs.close()
    return {
        "ticks_per_second": statistics.median(rates),
        "best_ticks_per_second": max(rates),
        "cores_used": busy / seconds,
        # Of several threads also what they wait for each other.
        "besides_percent": 100.0 * (1.0 - physics[0] / whole),
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
        alone, megabytes = _alone(), _megabytes()
        tubes = _alone(anatomy="normal", exercise="critical_view")
        found = {
            f"{count} with {threads}": _side_by_side(count, threads)
            for count in COUNTS
            for threads in sorted({1, cores()})
        }
        peer = beside_mujoco()
    fraction = 1.0 - alone["physics_ms"] / alone["tick_ms"]
    console.print(
        f"One environment: {alone['ticks_per_cpu_second']:,.0f} ticks of 1/30 s a second of one "
        f"core, {alone['tick_ms']:.2f} ms each, of which the physics is "
        f"{alone['physics_ms']:.2f} ms and all else {100.0 * fraction:.0f} %; "
        f"{megabytes:.2f} MB a bed; load {os.getloadavg()[0]:.1f}",
        highlight=False,
        soft_wrap=True,
    )
    console.print(
        f"Five tubes of an anatomy with 1,426 strands: {tubes['ticks_per_cpu_second']:,.0f} ticks "
        f"a second of one core, {tubes['tick_ms']:.2f} ms each, the physics "
        f"{tubes['physics_ms']:.2f} ms",
        highlight=False,
        soft_wrap=True,
    )
    for name, each in found.items():
        console.print(
            f"{name} threads: {each['ticks_per_second']:,.0f} ticks a second, at best "
            f"{each['best_ticks_per_second']:,.0f}, on {each['cores_used']:.2f} cores; "
            f"{each['besides_percent']:.0f} % of their time is not the physics'",
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
