"""Looks for policies that pass an exercise with errors, as trainees find them: by trying.

CMA-ES (Hansen and Ostermeier 2001, Evol. Comput. 9:159) searches the weights of a linear policy of
a few features, with a reward that does not count errors, on beds that change. What passes with an
incident is a cheat: its run is kept, and replays in the page.
"""

import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from app.rl.environment import DissectionVectorEnv
from app.rl.task import Task
from app.simulation import ELEMENTS, HAND_SPEED, run_json

__all__ = ["features", "measure_cheats", "policy_actions"]

Floats = NDArray[np.float64]

EXERCISES: dict[str, dict[str, Any]] = {
    "window": {},
    "follow_front": {},
    "free_scar": {},
    "critical_view": {"anatomy": "normal"},
}
POPULATION, TIME_LIMIT_S, TICKS_PER_STEP = 16, 20.0, 6
FOLDER = Path(__file__).parents[1] / "build" / "cheats"
REWARD = {"errors": 0.0, "stress": 0.0, "failed": -0.2}
SIGMA = 0.6


def centre_of(task: Task) -> Floats:
    """Return where an exercise is about, (3,) mm: under its stretch of duct, or amid the tubes."""
    if task.goal is not None:
        return np.array([0.5 * (task.goal.from_mm + task.goal.to_mm), 0.0, -6.0])
    tubes = task.duct.tubes(elements=ELEMENTS).network.tubes.values()
    return np.concatenate([each.places for each in tubes]).mean(axis=0)


def features(observed: dict[str, NDArray[Any]], centre: Floats) -> Floats:
    """Return (N, F) of N observations: each hand about a centre, what is done, and time."""
    hands = observed["hands"].astype(np.float64)
    # Both end with progress and the time left.
    goal = observed["goal" if "goal" in observed else "view"].astype(np.float64)
    parts = [goal[:, -2:-1], 1.0 - goal[:, -1:] / TIME_LIMIT_S, np.ones((len(goal), 1))]
    for hand in range(hands.shape[1]):
        force = np.sqrt((hands[:, hand, 3:6] ** 2).sum(axis=1, keepdims=True))
        parts += [
            (hands[:, hand, :3] - centre) / (10.0, 10.0, 5.0),
            force,
            hands[:, hand, 6:7],
            hands[:, hand, 7:8] / 20.0,
        ]
    return np.concatenate(parts, axis=1)


def policy_actions(weights: Floats, found: Floats) -> NDArray[np.float32]:
    """Return (N, A) actions of N linear policies, (N, A, F), each at its own features."""
    return np.tanh((weights * found[:, None, :]).sum(axis=2)).astype(np.float32)


def search(exercise: str, seconds: float) -> dict[str, Any]:
    """Search for so many seconds; return what was tried, what passed, and cheats by error."""
    import cma  # pyright: ignore[reportMissingImports]

    envs = DissectionVectorEnv(
        POPULATION,
        exercise=exercise,
        **EXERCISES[exercise],
        ticks_per_step=TICKS_PER_STEP,
        time_limit=TIME_LIMIT_S,
        speed=HAND_SPEED,
        reward=REWARD,
    )
    observed, _ = envs.reset(seed=1)
    centre, outputs = centre_of(envs.task), envs.task.size
    size = features(observed, centre).shape[1]
    evolution = cma.CMAEvolutionStrategy(
        np.zeros(outputs * size), SIGMA, {"popsize": POPULATION, "seed": 1, "verbose": -9,
                                          "CMA_diagonal": True},
    )  # fmt: skip
    draw, start = np.random.default_rng(1), time.monotonic()
    tried = passed = ticks = 0
    best = -np.inf
    cheats: Counter[str] = Counter()
    while time.monotonic() - start < seconds:
        asked = evolution.ask()
        weights = np.array(asked).reshape(POPULATION, outputs, size)
        observed, _ = envs.reset(options={"bed_seed": int(draw.integers(1, 21))})
        returns, over = np.zeros(POPULATION), np.zeros(POPULATION, np.bool_)
        while not over.all():
            actions = policy_actions(weights, features(observed, centre))
            observed, rewards, terminated, truncated, infos = envs.step(actions)
            ended = (terminated | truncated) & ~over
            returns += np.where(over, 0.0, rewards)
            over |= ended
            for i in np.flatnonzero(ended):
                ticks += round(30.0 * float(infos["seconds"][i]))
                if not infos["passed"][i]:
                    continue
                passed += 1
                session = envs.episodes[i].session
                errors = sorted({each.error for each in session.run.incidents()})
                if errors:
                    if not cheats[", ".join(errors)]:
                        FOLDER.mkdir(parents=True, exist_ok=True)
                        name = f"{exercise}-{'-'.join(errors)}.json"
                        (FOLDER / name).write_bytes(run_json(session.run_file()))
                    cheats[", ".join(errors)] += 1
        evolution.tell(asked, (-returns).tolist())
        tried += POPULATION
        best = max(best, float(returns.max()))
    envs.close()
    return {
        "seconds": time.monotonic() - start,
        "episodes": tried,
        "ticks_per_second": ticks / (time.monotonic() - start),
        "passed": passed,
        "best_return": best,
        "cheats": dict(cheats),
    }


def measure_cheats(console: Console, seconds: float = 600.0) -> dict[str, Any]:
    """Print and return what a search finds in each exercise, some seconds in each."""
    figures: dict[str, Any] = {}
    for exercise in EXERCISES:
        with console.status(f"Looking for cheats in {exercise} ..."):
            found = search(exercise, seconds)
        figures[exercise] = found
        cheats = "; ".join(f"{often} with {key}" for key, often in found["cheats"].items())
        console.print(
            f"{exercise}: {found['episodes']} episodes in {found['seconds']:.0f} s, best return "
            f"{found['best_return']:.2f}, {found['passed']} passed; cheats: {cheats or 'none'}",
            highlight=False,
            soft_wrap=True,
        )
    return figures
