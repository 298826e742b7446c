"""Learn *Open a window* from scripted hands: behaviour cloning in plain numpy, some minutes.

    bluntdissect dataset -o window/ --seeds 1-20 --tremor 0.1
    python examples/clone_window.py window/

A small network learns the demonstrations' actions from what they saw, and is judged on beds that
were never seen, beside the scripted hands and random ones. The best run goes to `clone.json`, the
network to `clone.onnx`; the trainer plays the one, and the other acts beside you in it:

    bluntdissect trainer --replay clone.json
    bluntdissect trainer --policy clone.onnx

With `--curve curve.png` it is judged while it learns, too, and the learning curve is drawn.
"""

import argparse
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq

from app.rl.demonstration import demonstrate
from app.rl.environment import DissectionEnv
from app.rl.task import Task
from app.simulation import run_json

KEYS = ("hands", "wall", "goal")
HIDDEN, STEPS, RATE, NOISE = 64, 3000, 3e-3, 0.02
UNSEEN, TIME_LIMIT_S = range(21, 41), 20.0
CURVE_STEPS, CURVE_BEDS = (0, 30, 60, 120, 250, 500, 1000, STEPS), range(21, 31)
Act = Callable[[dict[str, np.ndarray]], np.ndarray] | None


def demonstrations_folder(text: str) -> Path:
    """Return the folder that an argument names; raise where there is none."""
    folder = Path(text)
    if not folder.is_dir():
        raise argparse.ArgumentTypeError(
            f"there is no folder {folder}: bluntdissect dataset -o {folder} makes it"
        )
    return folder


def arguments(description: str) -> argparse.ArgumentParser:
    """Return a parser that knows the folder of demonstrations."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument(
        "folder", type=demonstrations_folder, help="of `bluntdissect dataset --exercise window`"
    )
    return parser


def demonstrations(folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return (T, F) observations and (T, A) actions of all episodes."""
    seen, done = [], []
    for path in sorted((folder / "data").glob("*/part-0.parquet")):
        table = pq.read_table(path)
        observed = table["observations"].combine_chunks()
        rows = [np.stack(observed.field(key).to_numpy(zero_copy_only=False)) for key in KEYS]
        seen.append(np.concatenate(rows, axis=1)[:-1, :-1])  # what is seen but the time left
        done.append(np.stack(table["actions"].to_numpy())[:-1])
    return np.concatenate(seen), np.concatenate(done)


class Network:
    """Two hidden layers of tanh, fitted by Adam (Kingma and Ba 2015).

    `watch` is called with the network and the number of steps, before the first and after each.
    """

    def __init__(
        self,
        seen: np.ndarray,
        done: np.ndarray,
        watch: Callable[["Network", int], None] = lambda *_: None,
        seed: int = 0,
    ) -> None:
        draw = np.random.default_rng(seed)
        self.mean, self.scale = seen.mean(axis=0), np.maximum(seen.std(axis=0), 0.2)
        sizes = [seen.shape[1], HIDDEN, HIDDEN, done.shape[1]]
        self.layers = [
            np.concatenate([draw.normal(0.0, a**-0.5, (a, b)), np.zeros((1, b))])
            for a, b in pairwise(sizes)
        ]
        first = [np.zeros_like(each) for each in self.layers]
        second = [np.zeros_like(each) for each in self.layers]
        watch(self, 0)
        for step in range(1, STEPS + 1):
            rows = draw.integers(len(seen), size=256)
            x = (seen[rows] - self.mean) / self.scale
            inputs, out = self.forward(x + NOISE * draw.standard_normal(x.shape))
            back = 2.0 * (out - done[rows]) / out.size
            for k in reversed(range(len(self.layers))):
                slope = inputs[k].T @ back
                if k:
                    back = (back @ self.layers[k].T)[:, :-1] * (1.0 - inputs[k][:, :-1] ** 2)
                first[k] += 0.1 * (slope - first[k])
                second[k] += 1e-3 * (slope**2 - second[k])
                mean, size = first[k] / (1 - 0.9**step), second[k] / (1 - 0.999**step)
                self.layers[k] -= RATE * mean / (np.sqrt(size) + 1e-8)
            watch(self, step)

    def forward(self, x: np.ndarray) -> tuple[list[np.ndarray], np.ndarray]:
        """Return each layer's inputs with a one, and what comes out."""
        inputs = []
        for k, layer in enumerate(self.layers):
            inputs.append(np.concatenate([x, np.ones((len(x), 1))], axis=1))
            x = inputs[-1] @ layer
            if k < len(self.layers) - 1:
                x = np.tanh(x)
        return inputs, x

    def act(self, observed: dict[str, np.ndarray]) -> np.ndarray:
        """Return the action for an observation."""
        row = np.concatenate([observed[key].ravel() for key in KEYS])[:-1]
        return self.forward(((row - self.mean) / self.scale)[None])[1][0]

    def save(self, path: Path) -> None:
        """Write an ONNX file, which the trainer reads, if there is the package `onnx`."""
        try:
            import onnx
        except ImportError:
            return
        # What is seen is scaled within the first layer, which has zeros for the time left.
        first = self.layers[0][:-1] / self.scale[:, None]
        start = self.layers[0][-1] - self.mean @ first
        weights = [np.pad(first, ((0, 1), (0, 0))), *(each[:-1] for each in self.layers[1:])]
        offsets = [start, *(each[-1] for each in self.layers[1:])]
        make = onnx.helper.make_node
        nodes = [make("Flatten", [key], [f"flat {key}"]) for key in KEYS]
        nodes.append(make("Concat", [f"flat {key}" for key in KEYS], ["x0"], axis=1))
        constants = []
        for k, pair in enumerate(zip(weights, offsets, strict=True)):
            last = k == len(weights) - 1
            nodes.append(make("Gemm", [f"x{k}", f"w{k}", f"b{k}"], ["action" if last else f"y{k}"]))
            if not last:
                nodes.append(make("Tanh", [f"y{k}"], [f"x{k + 1}"]))
            for name, values in zip((f"w{k}", f"b{k}"), pair, strict=True):
                constants.append(onnx.numpy_helper.from_array(values.astype(np.float32), name))
        shapes = {"hands": [1, 2, 12], "wall": [1, 3], "goal": [1, 5], "action": [1, 10]}
        ends = {
            name: onnx.helper.make_tensor_value_info(name, onnx.TensorProto.FLOAT, shape)
            for name, shape in shapes.items()
        }
        graph = onnx.helper.make_graph(
            nodes, "clone", [ends[key] for key in KEYS], [ends["action"]], constants
        )
        opset = onnx.helper.make_opsetid("", 17)
        model = onnx.helper.make_model(graph, opset_imports=[opset], ir_version=9)
        path.write_bytes(model.SerializeToString())


def episode(env: DissectionEnv, seed: int, act: Act) -> dict[str, Any]:
    """Do an episode in the bed of a seed, with scripted hands where there is no policy."""
    if act is None:
        demonstrate(env, seed)
    else:
        observed, _ = env.reset(options={"bed_seed": seed})
        over = False
        while not over:
            observed, _, terminated, truncated, _ = env.step(act(observed))
            over = terminated or truncated
    assert env.episode is not None
    return env.episode.info()


def judge(name: str, act: Act) -> None:
    """Judge a policy on beds never seen, and keep the fastest run that passes."""
    env = DissectionEnv(exercise="window", time_limit=TIME_LIMIT_S)
    passed, clean, seconds = 0, 0, []
    for seed in UNSEEN:
        info = episode(env, seed, act)
        passed += info["passed"]
        clean += info["passed"] and not info["errors"]
        seconds.append(info["seconds"])
        if info["passed"] and seconds[-1] == min(seconds):
            Path(f"{name}.json").write_bytes(run_json(env.run_file()))
    print(
        f"{name}: {passed} of {len(seconds)} beds passed, {clean} without an error, "
        f"{np.mean(seconds):.1f} s a bed",
        flush=True,
    )


class LearningCurve:
    """How many unseen beds a network passes as it learns, drawn into a picture."""

    def __init__(self) -> None:
        self._env = DissectionEnv(exercise="window", time_limit=TIME_LIMIT_S)
        self._steps: list[int] = []
        self._passed: list[int] = []

    def watch(self, network: Network, step: int) -> None:
        """Judge a network, at some of its steps."""
        if step not in CURVE_STEPS:
            return
        passed = sum(episode(self._env, seed, network.act)["passed"] for seed in CURVE_BEDS)
        self._steps.append(step)
        self._passed.append(passed)
        print(f"step {step}: {passed} of {len(CURVE_BEDS)} beds passed", flush=True)

    def save(self, path: Path) -> None:
        """Write the curve as a picture."""
        from matplotlib.figure import Figure

        figure = Figure((6.4, 4.0), layout="constrained")
        axes = figure.subplots()
        axes.plot(self._steps, self._passed, marker="o")
        axes.set_xscale("symlog", linthresh=CURVE_STEPS[1])
        axes.set_xticks(CURVE_STEPS, [str(step) for step in CURVE_STEPS])
        axes.minorticks_off()
        axes.set(
            xlabel="Steps of the fit",
            ylabel=f"Unseen beds passed (of {len(CURVE_BEDS)})",
            ylim=(-0.3, len(CURVE_BEDS) + 0.3),
        )
        figure.savefig(path, dpi=150)


def main() -> None:
    parser = arguments("Fit a network to demonstrations, and judge it.")
    parser.add_argument("--curve", type=Path, help="picture of beds passed against steps")
    given = parser.parse_args()
    if given.curve is None:
        network = Network(*demonstrations(given.folder))
    else:
        curve = LearningCurve()
        network = Network(*demonstrations(given.folder), curve.watch)
        curve.save(given.curve)
    network.save(Path("clone.onnx"))
    space = Task().action_space
    space.seed(1)
    judge("clone", network.act)
    judge("random", lambda _: space.sample())
    judge("scripted", None)


if __name__ == "__main__":
    main()
