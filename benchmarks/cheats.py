"""Looks for policies that pass an exercise with errors, as trainees find them: by trying.

CMA-ES (Hansen and Ostermeier 2001, Evol. Comput. 9:159) searches the weights of a linear policy of
what scripted hands would do now and of a few features. It begins as these hands, which pass without
an error, and is paid for each pass, and more for one with errors, on beds that change. What passes
with an incident is a cheat: its run is kept, and replays in the page.
"""

import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from app.rl.demonstration import work
from app.rl.environment import DissectionEnv
from app.rl.episode import Observation
from app.rl.task import Task
from app.simulation import ELEMENTS, HAND_SPEED, MANNERS, Exercise, Session, run_json

Floats = NDArray[np.float64]

EXERCISES: dict[str, dict[str, Any]] = {
    "window": {},
    "follow_front": {},
    "free_scar": {},
    "stop_bleeding": {"anatomy": "normal", "instruments": ("grasper", "clip applier")},
    "first_view": {"anatomy": "normal"},
    "critical_view": {"anatomy": "normal"},
}
POPULATION, TIME_LIMIT_S, TICKS_PER_STEP = 16, 40.0, 3
FOLDER = Path(__file__).parents[1] / "build" / "cheats"
REWARD = {"errors": 0.0, "stress": 0.0, "failed": -0.2}
SIGMA, PAID = 0.03, 0.5
"""Standard deviation of the first weights; reward of each class of errors in a pass."""


class _Rest:
    """Hands that do nothing, where no scripted ones know the exercise."""

    def inputs(self, session: Session, exercise: Exercise) -> Iterator[None]:
        """Wait."""
        while True:
            yield


def centre_of(task: Task) -> Floats:
    """Return where an exercise is about, (3,) mm: under its stretch of duct, or amid the tubes."""
    if task.goal is not None:
        return np.array([0.5 * (task.goal.from_mm + task.goal.to_mm), 0.0, -6.0])
    tubes = task.duct.tubes(elements=ELEMENTS).network.tubes.values()
    return np.concatenate([each.places for each in tubes]).mean(axis=0)


def features(observed: Observation, wanted: Floats, centre: Floats) -> Floats:
    """Return (F,) what hands would do, each hand about a centre, what is done, and time."""
    # Both end with progress and the time left.
    goal = observed["goal" if "goal" in observed else "view"].astype(np.float64)
    inputs = [np.clip(wanted, -1.0, 1.0), goal[-2:-1], 1.0 - goal[-1:] / TIME_LIMIT_S, np.ones(1)]
    for hand in observed["hands"].astype(np.float64):
        force = np.sqrt((hand[3:6] ** 2).sum())
        inputs += [(hand[:3] - centre) / (10.0, 10.0, 5.0), [force, hand[6], hand[7] / 20.0]]
    return np.concatenate(inputs)


def search(exercise: str, seconds: float) -> dict[str, Any]:
    """Search for so many seconds; return what was tried, what passed, and cheats by error."""
    import cma  # pyright: ignore[reportMissingImports]

    env = DissectionEnv(
        exercise=exercise,
        **EXERCISES[exercise],
        ticks_per_step=TICKS_PER_STEP,
        time_limit=TIME_LIMIT_S,
        speed=HAND_SPEED,
        reward=REWARD,
    )
    technique = MANNERS.get(exercise, {}).get("good", _Rest())
    observed, _ = env.reset(seed=1)
    centre, outputs = centre_of(env.task), env.task.size
    size = features(observed, np.zeros(outputs), centre).size
    options = {"popsize": POPULATION, "seed": 1, "verbose": -9, "CMA_diagonal": True}
    evolution = cma.CMAEvolutionStrategy(np.eye(outputs, size).ravel(), SIGMA, options)
    draw, start = np.random.default_rng(1), time.monotonic()
    tried = passed = ticks = 0
    best = -np.inf
    cheats: Counter[str] = Counter()
    while time.monotonic() - start < seconds:
        asked = evolution.ask()
        bed, returns = int(draw.integers(1, 21)), np.zeros(POPULATION)
        for i, each in enumerate(asked):
            weights = np.reshape(each, (outputs, size))

            def change(seen: Observation, wanted: Floats, rows: Floats = weights) -> Floats:
                return (rows * features(seen, wanted, centre)).sum(axis=1)

            returns[i] = float(work(env, technique, bed, change=change).rewards.sum())
            assert env.episode is not None
            session = env.episode.session
            ticks += session.run.ticks
            outcome = session.run.outcome
            if outcome is None or not outcome.passed:
                continue
            passed += 1
            errors = sorted({found.error for found in session.run.incidents()})
            returns[i] += PAID * len(errors)
            if errors:
                key = ", ".join(errors)
                if not cheats[key]:
                    FOLDER.mkdir(parents=True, exist_ok=True)
                    name = f"{exercise}-{'-'.join(errors)}.json"
                    (FOLDER / name).write_bytes(run_json(session.run_file()))
                cheats[key] += 1
        evolution.tell(asked, (-returns).tolist())
        tried += POPULATION
        best = max(best, float(returns.max()))
    env.close()
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
