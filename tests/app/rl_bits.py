"""Digests of what environments give, alone or side by side.

    python tests/app/rl_bits.py 1000
    python tests/app/rl_bits.py 1000 --side-by-side 8 --threads 2
    NUMBA_CPU_NAME=generic NUMBA_CACHE_DIR=build/generic python tests/app/rl_bits.py 1000

print the digest of so many seeds, 20 steps each: three times the same one.
"""

import argparse
import hashlib
from typing import Any

import numpy as np

from app.rl.environment import DissectionEnv, DissectionVectorEnv


def actions_of(seed: int, steps: int, size: int) -> np.ndarray:
    """Random hands that mostly go where the duct is, for one seed."""
    rng = np.random.default_rng(seed)
    wandering = np.cumsum(rng.uniform(-0.6, 0.6, (steps, size)), axis=0)
    return np.clip(wandering, -1.0, 1.0).astype(np.float32)


def alone(seeds: list[int], steps: int, **arguments: Any) -> list[str]:
    """Of each seed's episode, in one environment after another."""
    env, found = DissectionEnv(**arguments), []
    for seed in seeds:
        digest = hashlib.sha256()
        observed, _ = env.reset(seed=seed)
        _take(digest, observed, 0.0)
        for action in actions_of(seed, steps, env.task.size):
            observed, reward, terminated, truncated, _ = env.step(action)
            _take(digest, observed, reward)
            if terminated or truncated:
                break
        found.append(digest.hexdigest())
    return found


def together(seeds: list[int], steps: int, threads: int, **arguments: Any) -> list[str]:
    """The same, side by side."""
    envs = DissectionVectorEnv(len(seeds), threads=threads, **arguments)
    digests = [hashlib.sha256() for _ in seeds]
    observed, _ = envs.reset(seed=[*seeds])
    over = np.zeros(len(seeds), np.bool_)

    def take(rewards: np.ndarray) -> None:
        for i in np.flatnonzero(~over):
            _take(digests[i], {key: rows[i] for key, rows in observed.items()}, float(rewards[i]))

    take(np.zeros(len(seeds)))
    rows = np.stack([actions_of(seed, steps, envs.task.size) for seed in seeds], axis=1)
    for action in rows:
        observed, rewards, terminated, truncated, _ = envs.step(action)
        take(rewards)
        over |= terminated | truncated
    envs.close()
    return [digest.hexdigest() for digest in digests]


def _take(digest: Any, observed: dict[str, np.ndarray], reward: float) -> None:
    for each in observed.values():
        digest.update(each.tobytes())
    digest.update(np.float64(reward).tobytes())


def main() -> None:
    parser = argparse.ArgumentParser(description="The digest of episodes under random hands.")
    parser.add_argument("seeds", type=int)
    parser.add_argument("--steps", type=int, default=20)
    parser.add_argument("--side-by-side", type=int, default=0)
    parser.add_argument("--threads", type=int, default=1)
    given = parser.parse_args()
    seeds, count = list(range(given.seeds)), given.side_by_side
    found = (
        alone(seeds, given.steps)
        if not count
        else [
            digest
            for i in range(0, len(seeds), count)
            for digest in together(seeds[i : i + count], given.steps, given.threads)
        ]
    )
    print(hashlib.sha256("".join(found).encode()).hexdigest())


if __name__ == "__main__":
    main()
