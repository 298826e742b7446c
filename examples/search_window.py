"""Improve a cloned policy by CMA-ES (Hansen and Ostermeier 2001): faster, and without errors.

    pip install 'bluntdissect[dataset]' cma
    bluntdissect dataset -o window/ --seeds 1-20 --tremor 0.1
    python examples/search_window.py window/ --minutes 15

It searches the last layer of the network of `clone_window.py`, on beds 1 to 20 that change with
each generation; an error costs as much as half a pass. What comes out is judged on beds never seen.
"""

import time
from pathlib import Path

import numpy as np
from clone_window import KEYS, TIME_LIMIT_S, Network, arguments, demonstrations, judge

from app.rl.environment import DissectionVectorEnv

try:
    import cma  # pyright: ignore[reportMissingImports]  # not among what tests need
except ImportError:
    raise SystemExit("search_window.py needs cma: pip install cma") from None

POPULATION, BEDS, SIGMA = 12, 4, 0.02
REWARD = {"time": -0.1, "errors": -0.5, "stress": 0.0}


def returns(network: Network, layers: list[np.ndarray], envs: DissectionVectorEnv, seed: int):
    """What each of N last layers earns in the bed of a seed."""
    observed, _ = envs.reset(options={"bed_seed": seed})
    earned, over = np.zeros(envs.num_envs), np.zeros(envs.num_envs, np.bool_)
    hidden = network.layers[:-1]
    while not over.all():
        rows = np.concatenate([observed[key].reshape(len(over), -1) for key in KEYS], axis=1)
        x = (rows[:, :-1] - network.mean) / network.scale
        for layer in hidden:
            x = np.tanh(np.concatenate([x, np.ones((len(x), 1))], axis=1) @ layer)
        x = np.concatenate([x, np.ones((len(x), 1))], axis=1)
        actions = np.stack([row @ layer for row, layer in zip(x, layers, strict=True)])
        observed, rewards, terminated, truncated, _ = envs.step(actions)
        earned += np.where(over, 0.0, rewards)
        over |= terminated | truncated
    return earned


def main() -> None:
    parser = arguments("Improve a cloned policy by CMA-ES, and judge it.")
    parser.add_argument("--minutes", type=float, default=15.0)
    given = parser.parse_args()
    network = Network(*demonstrations(given.folder))
    judge("clone", network.act)
    envs = DissectionVectorEnv(
        POPULATION, exercise="window", time_limit=TIME_LIMIT_S, reward=REWARD
    )
    start = network.layers[-1]
    options = {"popsize": POPULATION, "seed": 1, "verbose": -9, "CMA_diagonal": True}
    evolution = cma.CMAEvolutionStrategy(start.ravel(), SIGMA, options)
    draw, until, generations = np.random.default_rng(1), time.monotonic() + 60 * given.minutes, 0
    while time.monotonic() < until:
        asked = evolution.ask()
        layers = [np.reshape(each, start.shape) for each in asked]
        beds = draw.choice(np.arange(1, 21), BEDS, replace=False)
        earned = np.mean([returns(network, layers, envs, int(bed)) for bed in beds], axis=0)
        evolution.tell(asked, (-earned).tolist())
        generations += 1
        if generations % 5 == 0:
            print(f"generation {generations}: {earned.mean():.2f} a bed", flush=True)
    network.layers[-1] = np.reshape(evolution.result.xfavorite, start.shape)
    print(f"{generations} generations, {generations * POPULATION * BEDS} episodes")
    network.save(Path("search.onnx"))
    judge("search", network.act)


if __name__ == "__main__":
    main()
