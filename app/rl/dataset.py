"""Demonstrations as files that learners of other projects read: Minari 0.5 and LeRobot v3.

A folder has `data`, a data set of Minari in its Parquet format, with the measures and errors of
each episode in its `metadata.json`; `runs`, each episode as a run that replays in the page; and
`lerobot`, the same for LeRobot. Both are written without their packages. Episodes that are there
already are kept, so that one that was ended goes on.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any

import gymnasium
import msgspec
import numpy as np
from numpy.typing import NDArray

from app.rl import ID
from app.rl.demonstration import demonstrate
from app.rl.environment import DissectionEnv
from app.simulation import run_json
from app.versions import versions
from app.workers import Progress, by_dask, by_processes
from organ_geometry import write_atomic

MINARI = "0.5.4"
"""The version of Minari whose files these are."""


@dataclass(frozen=True)
class Maker:
    """Makes one episode of a data set; goes to worker processes as a value."""

    folder: str
    arguments: Mapping[str, Any]  # of the environment
    manner: str = "good"
    tremor: float = 0.0
    seeds: Sequence[int] = field(default_factory=tuple[int, ...])

    def __call__(self, number: int) -> str:
        """Make the episode of a number, if it is not there; return what is wrong, or nothing."""
        place = Path(self.folder, "data", str(number))
        if (place / "metadata.json").exists():
            return ""
        # One of its own: a worker of Dask's may have several threads.
        env, seed = DissectionEnv(**self.arguments), self.seeds[number]
        made = demonstrate(env, seed, manner=self.manner, tremor=self.tremor)
        assert env.episode is not None  # noqa: S101
        run = env.run_file()
        place.mkdir(parents=True, exist_ok=True)
        runs = Path(self.folder, "runs")
        runs.mkdir(exist_ok=True)
        write_atomic(runs / f"{number:05d}.json", run_json(run))
        pa, pq = _arrow()
        steps = len(made.rewards)
        flags = {"terminations": made.terminated, "truncations": made.truncated}
        columns: dict[str, Any] = {
            "observations": pa.StructArray.from_arrays(
                [_fixed(pa, each) for each in made.observations.values()], [*made.observations]
            ),
            # Minari has a row for each observation: the last action and reward are none.
            "actions": _fixed(pa, np.pad(made.actions, ((0, 1), (0, 0)))),
            "rewards": np.pad(made.rewards, (0, 1)),
            **{
                key: np.arange(steps + 1) == (steps - 1 if over else -1)
                for key, over in flags.items()
            },
        }
        pq.write_table(pa.table(columns), place / "part-0.parquet")
        incidents = env.episode.session.run.incidents()
        about = {
            "id": number,
            "total_steps": steps,
            "seed": seed,
            "options": {"bed_seed": seed},
            "passed": run.outcome is not None and run.outcome.passed,
            "reason": "" if run.outcome is None else run.outcome.reason,
            "metrics": run.metrics,
            "errors": [msgspec.to_builtins(each) for each in incidents],
            "run": f"runs/{number:05d}.json",
        }
        # Last: an episode with it is whole.
        write_atomic(place / "metadata.json", json.dumps(about).encode())
        return ""


def make_dataset(
    folder: Path,
    name: str,
    arguments: Mapping[str, Any],
    seeds: Sequence[int],
    *,
    manner: str = "good",
    tremor: float = 0.0,
    workers: int = 1,
    scheduler: str | None = None,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Make what is not there of a data set, in both formats; return a summary.

    Parameters
    ----------
    folder
        Where it goes, or lies unfinished.
    name
        Of the data set, such as "bluntdissect/window-scripted-v0".
    arguments
        Of the environment.
    seeds
        Of the beds, one an episode.
    manner, tremor
        As of `demonstrate`; mm.
    workers, scheduler
        Processes at work, or the address of a Dask scheduler.
    progress
        Is told how many episodes are done.

    Returns
    -------
    dict
        Episodes, how many were passed, steps, and the errors of all together by class.

    Raises
    ------
    ValueError
        If the folder has a data set of another making, or an argument makes no sense.
    """
    _arrow()
    env = DissectionEnv(**arguments)
    spec = gymnasium.spec(ID)
    spec.kwargs = dict(arguments)
    about: dict[str, Any] = {
        "dataset_id": name,
        "data_format": "parquet",
        "jpeg_encoding": False,
        "minari_version": MINARI,
        "env_spec": spec.to_json(),
        "observation_space": json.dumps(_space(env.observation_space)),
        "action_space": json.dumps(_space(env.action_space)),
        "algorithm_name": f"scripted hands, {manner}, tremor {tremor:g} mm",
        "description": "Not clinically validated, not a medical device.",
        "versions": versions(),
        "total_episodes": len(seeds),
    }
    place = folder / "data" / "metadata.json"
    if place.exists():
        before = json.loads(place.read_text("utf-8"))
        changed = [key for key, value in about.items() if before.get(key) != value]
        if changed:
            raise ValueError(
                f"{folder} has a data set that was made otherwise ({', '.join(changed)}); "
                f"choose another folder"
            )
    place.parent.mkdir(parents=True, exist_ok=True)
    write_atomic(place, json.dumps(about).encode())
    make = Maker(str(folder.resolve()), dict(arguments), manner, tremor, tuple(seeds))
    numbers = range(len(seeds))
    made: Any
    if scheduler is not None:
        made = by_dask(make, numbers, scheduler, versions)
    elif workers == 1:
        made = ((number, make(number)) for number in numbers)
    else:
        made = by_processes(make, numbers, workers, died=_died)
    for done, (number, wrong) in enumerate(made, start=1):
        if wrong:
            raise ValueError(f"episode {number}: {wrong}")
        if progress is not None:
            progress(done, len(seeds))
    episodes = [
        json.loads((folder / "data" / str(number) / "metadata.json").read_text("utf-8"))
        for number in numbers
    ]
    about["total_steps"] = sum(each["total_steps"] for each in episodes)
    write_atomic(place, json.dumps(about).encode())
    title = env.task.asked.task
    _write_lerobot(folder, episodes, title, env.task.steps_per_second)
    found = [each["error"] for episode in episodes for each in episode["errors"]]
    return {
        "episodes": len(episodes),
        "passed": sum(each["passed"] for each in episodes),
        "steps": about["total_steps"],
        "errors": {key: found.count(key) for key in sorted(set(found))},
    }


def _died(number: int) -> str:
    return f"the process that made it has died, that of number {number}"


def _arrow() -> tuple[Any, Any]:
    try:
        return import_module("pyarrow"), import_module("pyarrow.parquet")
    except ImportError:
        raise ValueError("data sets need pyarrow: pip install 'bluntdissect[dataset]'") from None


def _fixed(pa: Any, values: NDArray[Any]) -> Any:
    """Return a column of lists of one length, one a row."""
    rows = values.reshape(len(values), -1)
    return pa.FixedSizeListArray.from_arrays(pa.array(rows.ravel()), rows.shape[1])


def _space(space: Any) -> dict[str, Any]:
    """Return a space, a box or a dictionary of them, as Minari writes it."""
    if isinstance(space, gymnasium.spaces.Dict):
        subspaces = {key: _space(space[key]) for key in space}
        return {"type": "Dict", "subspaces": subspaces}
    return {
        "type": "Box",
        "dtype": str(space.dtype),
        "shape": list(space.shape),
        "low": space.low.tolist(),
        "high": space.high.tolist(),
    }


# LeRobot v3

STATE, ENVIRONMENT = "observation.state", "observation.environment_state"
OF_STATE = ("hands", "wall", "goal")
STATISTICS: dict[str, Callable[..., Any]] = {
    "min": np.min,
    "max": np.max,
    "mean": np.mean,
    "std": np.std,
}


def _write_lerobot(folder: Path, episodes: list[dict[str, Any]], task: str, fps: int) -> None:
    """Write the data set of Minari in a folder once more, as LeRobot v3 has it."""
    pa, pq = _arrow()
    columns: dict[str, list[NDArray[Any]]] = {}
    rows: list[dict[str, Any]] = []
    first = 0
    for number, about in enumerate(episodes):
        table: Any = pq.read_table(folder / "data" / str(number) / "part-0.parquet")
        length: int = about["total_steps"]
        observed = table["observations"].combine_chunks()
        flat = {
            key: np.stack(observed.field(key).to_numpy(zero_copy_only=False))[:length]
            for key in (each.name for each in observed.type)
        }
        steps: NDArray[np.int64] = np.arange(length)
        features: dict[str, NDArray[Any]] = {
            STATE: np.concatenate([flat[key] for key in OF_STATE], axis=1),
            ENVIRONMENT: np.concatenate(
                [each for key, each in flat.items() if key not in OF_STATE], axis=1
            ),
            "action": np.stack(table["actions"].to_numpy())[:length],
        }
        episode_columns: dict[str, NDArray[Any]] = features | {
            "next.reward": table["rewards"].to_numpy()[:length].astype(np.float32),
            "next.done": table["terminations"].to_numpy()[:length],
            "timestamp": (steps / fps).astype(np.float32),
            "frame_index": steps,
            "episode_index": np.full(length, number),
            "index": first + steps,
            "task_index": np.zeros(length, np.int64),
        }
        for key, values in episode_columns.items():
            columns.setdefault(key, []).append(values)
        rows.append(
            {
                "episode_index": number,
                "tasks": [task],
                "length": length,
                "dataset_from_index": first,
                "dataset_to_index": first + length,
                **{f"{of}/{what}_index": 0 for of in ("data", "meta/episodes")
                   for what in ("chunk", "file")},
                **{
                    f"stats/{key}/{name}": value
                    for key, values in features.items()
                    for name, value in _statistics(values).items()
                },
            }
        )  # fmt: skip
        first += length
    whole = {key: np.concatenate(pieces) for key, pieces in columns.items()}
    info = {
        "codebase_version": "v3.0",
        "robot_type": "bluntdissect",
        "total_episodes": len(episodes),
        "total_frames": first,
        "total_tasks": 1,
        "chunks_size": 1000,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 500,
        "fps": fps,
        "splits": {"train": f"0:{len(episodes)}"},
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": None,
        "features": {
            key: {"dtype": str(each.dtype), "shape": list(each.shape[1:]) or [1], "names": None}
            for key, each in whole.items()
        },
        "bluntdissect": versions(),
    }
    root = folder / "lerobot"
    for name in ("data", "meta/episodes"):
        (root / name / "chunk-000").mkdir(parents=True, exist_ok=True)
    arrays = {key: each if each.ndim == 1 else _fixed(pa, each) for key, each in whole.items()}
    pq.write_table(pa.table(arrays), root / "data/chunk-000/file-000.parquet")
    pq.write_table(pa.Table.from_pylist(rows), root / "meta/episodes/chunk-000/file-000.parquet")
    tasks = pa.table({"task_index": [0], "task": [task]})
    pq.write_table(
        tasks.replace_schema_metadata({"pandas": json.dumps(BY_TASK)}), root / "meta/tasks.parquet"
    )
    (root / "meta/stats.json").write_text(
        json.dumps({key: _statistics(whole[key]) for key in (STATE, ENVIRONMENT, "action")}),
        encoding="utf-8",
    )
    (root / "meta/info.json").write_text(json.dumps(info, indent=1), encoding="utf-8")


def _statistics(values: NDArray[Any]) -> dict[str, list[float]]:
    found: dict[str, list[float]] = {
        name: of(values, axis=0).tolist() for name, of in STATISTICS.items()
    }
    return found | {"count": [float(len(values))]}


def _pandas_column(name: str, kind: str, of_numpy: str) -> dict[str, Any]:
    return {
        "name": name,
        "field_name": name,
        "pandas_type": kind,
        "numpy_type": of_numpy,
        "metadata": None,
    }


BY_TASK = {
    "index_columns": ["task"],
    "column_indexes": [],
    "columns": [
        _pandas_column("task_index", "int64", "int64"),
        _pandas_column("task", "unicode", "object"),
    ],
    "pandas_version": "2.0.0",
}
"""What tells pandas that tasks are looked up by their words."""
