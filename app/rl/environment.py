"""`bluntdissect/Dissection-v0`: a dissection as an environment of Gymnasium, alone or N at once."""

import math
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import gymnasium
import numpy as np
from gymnasium import error, spaces
from gymnasium.utils.seeding import np_random
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from app.compiling import say_when_compiling
from app.rl.episode import Episode, Observation
from app.rl.task import Task
from app.simulation import TICKS_PER_SECOND, RunFile
from kernel_cache import SameTypes, kernel

Floats = NDArray[np.float64]


def _checked(action: object, shape: tuple[int, ...]) -> Floats:
    """Return an action as finite numbers from -1 to 1, or raise Gymnasium's `InvalidAction`."""
    try:
        found = np.array(action, dtype=np.float64, order="C")
    except (TypeError, ValueError) as reason:
        raise error.InvalidAction(f"an action must be numbers of shape {shape}: {reason}") from None
    if found.shape != shape:
        raise error.InvalidAction(f"an action must have shape {shape}, got {found.shape}")
    if not _BOUND(found.reshape(-1)):
        raise error.InvalidAction(f"an action must be finite numbers, got {found.tolist()}")
    return found


@kernel()
def _bound(action: Floats) -> bool:
    """Bound an action to -1 to 1; return whether its numbers are finite, else it stays as it is."""
    for each in action:
        if not math.isfinite(each):
            return False
    for i in range(action.size):
        action[i] = min(max(action[i], -1.0), 1.0)
    return True


_BOUND = SameTypes(_bound)


def _bed_seed(task: Task, options: dict[str, Any] | None, draw: np.random.Generator) -> int:
    """Return the seed of the next bed: the one in `options`, or one that is drawn."""
    asked = (options or {}).get("bed_seed")
    if asked is None:
        return int(draw.choice(np.asarray(task.seeds)))
    if not 0 <= int(asked) < 2**63:
        raise ValueError(f"bed_seed must be from 0 to below 2^63, got {asked}")
    return int(asked)


def _stacked(infos: list[dict[str, Any]]) -> dict[str, Any]:
    """Return what is known of N environments, as `VectorEnv` has it: arrays, and who has them."""
    found: dict[str, Any] = {}
    everyone = np.ones(len(infos), np.bool_)
    for key, first in infos[0].items():
        rows = [each[key] for each in infos]
        found[key] = _stacked(rows) if isinstance(first, dict) else np.array(rows)
        found[f"_{key}"] = everyone
    return found


class DissectionEnv(gymnasium.Env[Observation, NDArray[np.float32]]):
    """A duct in its bed under a policy's hands; the arguments are those of `Task`.

    `reset` takes a `bed_seed` in its options, to choose the bed instead of drawing it from `seeds`.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": TICKS_PER_SECOND}  # noqa: RUF012

    def __init__(self, *, render_mode: str | None = None, **arguments: Any) -> None:
        say_when_compiling()
        self.task = Task(**arguments)
        self.metadata = self.metadata | {"render_fps": self.task.steps_per_second}
        self.render_mode = render_mode
        self.episode: Episode | None = Episode(self.task)
        self.observation_space: spaces.Space[Any] = self.episode.space
        self.action_space: spaces.Space[Any] = self.task.action_space

    @property
    def _going(self) -> Episode:
        if self.episode is None:
            raise error.ClosedEnvironmentError("the environment is closed: make another")
        return self.episode

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode; return the first observation and what else is known."""
        episode = self._going
        super().reset(seed=seed)
        episode.reset(_bed_seed(self.task, options, self.np_random))
        return self._observed(), episode.info()

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Do one step; return observation, reward, terminated, truncated and what else is known."""
        episode = self._going
        if episode.terminated or episode.truncated:
            raise error.ResetNeeded("the episode is over: call reset()")
        reward = episode.act(_checked(action, (self.task.size,)))
        return self._observed(), reward, episode.terminated, episode.truncated, episode.info()

    def _observed(self) -> Observation:
        out = self._going.room()
        self._going.observe(out)
        return out

    def run_file(self) -> RunFile:
        """Return the episode so far as a run, which replays in the page."""
        return self._going.session.run_file()

    def render(self) -> NDArray[np.uint8] | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Return a picture, (240, 320, 3), if the render mode is "rgb_array"."""
        return self._going.picture() if self.render_mode == "rgb_array" else None

    def close(self) -> None:
        """Drop the session."""
        self.episode = None


class DissectionVectorEnv(VectorEnv[Observation, NDArray[np.float32], NDArray[Any]]):
    """N dissections stepped side by side; the same bits as N of `DissectionEnv`.

    An episode that is over starts anew with the next step, as Gymnasium's own vector environments
    do. `threads` work at once, as many as there are processors when None; the physics lets go of
    Python's lock.
    """

    metadata: dict[str, Any] = {"autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012

    def __init__(
        self,
        num_envs: int = 1,
        *,
        threads: int | None = None,
        render_mode: str | None = None,
        **arguments: Any,
    ) -> None:
        if num_envs < 1:
            raise ValueError(f"num_envs must be 1 or more, got {num_envs}")
        if threads is not None and threads < 1:
            raise ValueError(f"threads must be 1 or more, got {threads}")
        self.num_envs, self.render_mode = num_envs, render_mode
        say_when_compiling()
        self.task = Task(**arguments)
        self.metadata = self.metadata | {"render_fps": self.task.steps_per_second}
        self.episodes = [Episode(self.task) for _ in range(num_envs)]
        self.single_observation_space = self.episodes[0].space
        self.single_action_space = self.task.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._threads = min(num_envs, threads or os.cpu_count() or 1)
        self._pool = ThreadPoolExecutor(self._threads)
        self._draws = [np_random()[0] for _ in range(num_envs)]
        self._started = False

    def reset(
        self,
        *,
        seed: int | list[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Observation, dict[str, Any]]:
        """Start all episodes: the i-th with seed + i, or with the i-th of a list of seeds."""
        self._check_open()
        count = self.num_envs
        seeds = (
            seed
            if isinstance(seed, list)
            else [None if seed is None else seed + i for i in range(count)]
        )
        if len(seeds) != count:
            raise ValueError(f"seed must be one of each of {count} environments, got {len(seeds)}")
        for i, each in enumerate(seeds):
            if each is not None:
                self._draws[i] = np_random(each)[0]
        beds = [_bed_seed(self.task, options, draw) for draw in self._draws]
        out = self.episodes[0].room(count)

        def start(i: int) -> None:
            self.episodes[i].reset(beds[i])
            self.episodes[i].observe({key: rows[i] for key, rows in out.items()})

        self._all(start)
        self._started = True
        return out, self._infos()

    def step(
        self, actions: NDArray[np.float32]
    ) -> tuple[Observation, NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        """Do one step of each; those that were over start anew instead, with a reward of 0."""
        self._check_open()
        if not self._started:
            raise error.ResetNeeded("call reset() before step()")
        count = self.num_envs
        rows = _checked(actions, (count, self.task.size))
        out, rewards = self.episodes[0].room(count), np.zeros(count)

        def work(i: int) -> None:
            episode = self.episodes[i]
            if episode.terminated or episode.truncated:
                episode.reset(_bed_seed(self.task, None, self._draws[i]))
            else:
                rewards[i] = episode.act(rows[i])
            episode.observe({key: rows_of[i] for key, rows_of in out.items()})

        self._all(work)
        over = [
            np.array([getattr(e, name) for e in self.episodes])
            for name in ("terminated", "truncated")
        ]
        return out, rewards, over[0], over[1], self._infos()

    def _all(self, work: Callable[[int], None]) -> None:
        """Work on all episodes, by turns of each thread."""
        turns = iter(range(self.num_envs))

        def go_on(_: int) -> None:
            for i in turns:  # a thread takes the next one when it has done one
                work(i)

        list(self._pool.map(go_on, range(self._threads)))

    def _infos(self) -> dict[str, Any]:
        return _stacked([episode.info() for episode in self.episodes])

    def _check_open(self) -> None:
        if self.closed:
            raise error.ClosedEnvironmentError("the environments are closed: make others")

    def close_extras(self, **kwargs: Any) -> None:
        """Drop the sessions and threads."""
        self._pool.shutdown()
        self.episodes.clear()
