"""Demonstrations: scripted hands of the trainer at work through an environment's actions."""

from collections.abc import Callable, Iterator
from itertools import islice
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from app.rl.environment import DissectionEnv
from app.rl.episode import Observation
from app.simulation import MANNERS, TICK_SECONDS, Instrument, Session, Technique

Floats = NDArray[np.float64]
Change = Callable[[Observation, Floats], Floats]
"""An observation and the action that hands would take there, to the action that is taken."""

NEAR_MM = 1.0
"""How near a tip is led to where it is to take hold."""
MOST_STEPS = 200
"""Steps in which it has to come there."""


class Demonstration(NamedTuple):
    """One episode of T steps."""

    observations: Observation  # T + 1 of each key
    actions: NDArray[np.float32]  # (T, A)
    rewards: NDArray[np.float64]  # (T,)
    terminated: bool
    truncated: bool


class _OverError(Exception):
    """The episode is over."""


class _Hands:
    """Stands between a technique and its session: what it asks of hands becomes actions.

    All else is the session's. `tremor` is the standard deviation of each target, mm.
    """

    def __init__(
        self, env: DissectionEnv, seen: Observation, tremor: float, seed: int, change: Change | None
    ) -> None:
        assert env.episode is not None  # noqa: S101 (made by `work`)
        self._env, self._session = env, env.episode.session
        self._seen, self._change = seen, change
        self._tremor, self._draw = tremor, np.random.default_rng(seed)
        self._hold, self._use = [False] * env.task.hands, [False] * env.task.hands
        self._places: list[Floats] = [each.target.copy() for each in self._mine]
        self._openings = [0.0] * env.task.hands
        self.steps: list[tuple[Observation, NDArray[np.float32], float]] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self._session, name)

    @property
    def _mine(self) -> Any:
        return self._session.spatial.hands[: self._env.task.hands]

    def choose_instrument(self, hand: int, instrument: Instrument) -> None:
        """Refuse another instrument than the one in the hand."""
        if self._mine[hand].instrument != instrument:
            raise ValueError(f"these hands need instruments with {instrument!r} in hand {hand}")
        self._places[hand] = self._mine[hand].place.copy()

    def grab(self, hand: int, station: float) -> tuple[float, float, float] | None:
        """Lead the tip to the duct and take hold; None where it does not come there."""
        duct = self._session.spatial
        at = station * duct.beam.beam.span / self._env.task.duct.beam.span
        node = int(np.abs(duct.beam.stations - at).argmin())
        for _ in range(MOST_STEPS):
            # From above, and not along the duct while it is near.
            goal, tip = duct.beam.places[node].copy(), self._mine[hand].place
            if abs(tip[0] - goal[0]) > NEAR_MM:
                goal[2] += 3.0 * duct.radius
            self._places[hand] = goal
            self._hold[hand] = bool(((tip - duct.beam.places[node]) ** 2).sum() < NEAR_MM**2)
            self.step()
            if self._mine[hand].node is not None:
                break
        held = self._session.tissue.held_place(hand)
        if held is not None:
            self._places[hand] = np.array(held)
        return held

    def release(self, hand: int) -> None:
        """Let go with the next step."""
        self._hold[hand] = False

    def move_hand(self, hand: int, place: Floats) -> None:
        """Lead a hand."""
        self._places[hand] = np.array(place)

    def open_jaws(self, hand: int, opening: float) -> None:
        """Open jaws."""
        self._openings[hand] = opening

    def clip(self, hand: int) -> None:
        """Clip with the next step."""
        self._use[hand] = True

    def step(self) -> None:
        """Do a step towards what is asked for."""
        task = self._env.task
        most = task.speed * TICK_SECONDS * task.ticks_per_step
        rows: list[list[float]] = []
        for hand, place in enumerate(self._places):
            holder = self._mine[hand]
            shaken = place + self._tremor * self._draw.standard_normal(3)
            opened = self._openings[hand] - holder.target_opening
            used = [2.0 * self._use[hand] - 1.0] if task.several else []
            grip = 2.0 * self._hold[hand] - 1.0
            rows.append([*((shaken - holder.target) / most), opened / most, grip, *used])
        self._use = [False] * task.hands
        wanted = np.array(rows).ravel()
        if self._change is not None:
            wanted = self._change(self._seen, wanted)
        action = np.clip(wanted, -1.0, 1.0).astype(np.float32)
        observed, reward, terminated, truncated, _ = self._env.step(action)
        self._seen = observed
        self.steps.append((observed, action, reward))
        if terminated or truncated:
            raise _OverError


def demonstrate(
    env: DissectionEnv, bed_seed: int, *, manner: str = "good", tremor: float = 0.0
) -> Demonstration:
    """Let scripted hands do an environment's exercise in the bed of a seed.

    Parameters
    ----------
    env
        With fixed instruments: a hook, and a dissector where the exercise is done with one.
    bed_seed
        Of the bed, and of the tremor.
    manner
        How the hands work: "good", "hasty", "clumsy" ...
    tremor
        Standard deviation of where a hand is led, in each direction and step, mm.

    Returns
    -------
    Demonstration
        The episode, to its end or to that of the script.

    Raises
    ------
    ValueError
        If there are no such hands, or their instruments are others.
    """
    exercise = env.task.seeded(bed_seed)
    known = MANNERS.get(exercise.name, {})
    if manner not in known:
        raise ValueError(f"{exercise.title} has hands that are {', '.join(known)}, got {manner!r}")
    if env.task.free_choice or env.task.hands < 2:
        raise ValueError("demonstrations need two hands with instruments that are not free")
    return work(env, known[manner], bed_seed, tremor=tremor)


def work(
    env: DissectionEnv,
    technique: Technique,
    bed_seed: int,
    *,
    tremor: float = 0.0,
    change: Change | None = None,
) -> Demonstration:
    """Let a technique work in the bed of a seed; `change` may alter each of its actions."""
    observed, _ = env.reset(options={"bed_seed": bed_seed})
    hands = _Hands(env, observed, tremor, bed_seed, change)
    script = technique.inputs(cast(Session, hands), env.task.seeded(bed_seed))
    try:
        while _several(script, env.task.ticks_per_step):
            hands.step()
    except _OverError:
        pass
    assert env.episode is not None  # noqa: S101
    rows = [observed, *(each[0] for each in hands.steps)]
    return Demonstration(
        {key: np.stack([row[key] for row in rows]) for key in observed},
        np.stack([each[1] for each in hands.steps]),
        np.array([each[2] for each in hands.steps]),
        env.episode.terminated,
        env.episode.truncated,
    )


def _several(script: Iterator[None], ticks: int) -> bool:
    """Take so many ticks of a script; return whether it goes on."""
    return sum(1 for _ in islice(script, ticks)) == ticks
