"""Environments of Gymnasium: its own checkers, the same bits alone and side by side, bad input."""

import math
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import error
from gymnasium.utils.env_checker import check_env
from rl_bits import alone, together
from rl_page import renewed
from simulated import phantom, replayed

from app.rl import ID
from app.rl.environment import DissectionEnv, DissectionVectorEnv
from app.rl.picture import Camera
from app.rl.task import REWARDS
from app.simulation import HAND_SPEED

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(
    "arguments",
    [
        {},
        {"exercise": "follow_front", "bed": "loose", "hands": 1, "ticks_per_step": 30},
        {"exercise": "free_scar", "speed": HAND_SPEED, "ticks_per_step": 1, "seeds": (0,)},
        {"instruments": "free", "bed": "inflamed", "time_limit": 0.2, "seeds": (2**63 - 1,)},
        {"observation": "both", "picture": (16, 1024)},
        {"observation": "pixels", "camera": ((0.0, -90.0, 9.0), (9.0, 0.0, 0.0))},
        {"anatomy": "normal", "exercise": "critical_view", "instruments": "free"},
        {"anatomy": "normal", "exercise": "stop_bleeding", "observation": "both", "hands": 1},
        {"hands": 1, "instruments": ("swab",), "reward": {"errors": 0.0}, "time_limit": 3600.0},
    ],
)
def test_gymnasium_s_checker_has_nothing_to_say(arguments: dict[str, Any]) -> None:
    made = gymnasium.make(ID, **arguments)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(made.unwrapped)
    made.close()


def test_what_is_observed_is_within_its_space_and_the_terms_add_up() -> None:
    """For random hands as quick as there are, through whole episodes, under the passive checker."""
    env = gymnasium.make(ID, instruments="free", speed=HAND_SPEED, time_limit=3.0)
    env.action_space.seed(1)
    ends: set[str] = set()
    for seed in range(8):
        env.reset(seed=seed)
        terminated = truncated = False
        seconds = 0.0
        while not (terminated or truncated):
            observed, reward, terminated, truncated, info = env.step(env.action_space.sample())
            assert env.observation_space.contains(observed)
            assert info["reward_terms"].keys() == REWARDS.keys()
            assert reward == pytest.approx(sum(info["reward_terms"].values()), abs=1e-12)
            seconds = info["seconds"]
        assert not (terminated and truncated)
        assert truncated == (seconds >= 3.0 - 1e-9)
        ends.add("truncated" if truncated else "terminated")
    assert "truncated" in ends


def test_the_same_bits_alone_and_side_by_side() -> None:
    seeds = [3, 4, 5, 6, 7]
    found = alone(seeds, 12, exercise="window")
    assert len(set(found)) == len(seeds)
    for count, threads in ((1, 1), (5, 1), (5, 2), (3, 3)):
        rows = [
            digest
            for i in range(0, len(seeds), count)
            for digest in together(seeds[i : i + count], 12, threads, exercise="window")
        ]
        assert rows == found, (count, threads)


def test_an_episode_is_a_run_that_replays_to_the_bit() -> None:
    env = DissectionEnv(exercise="follow_front", time_limit=4.0)
    observed, info = env.reset(seed=1, options={"bed_seed": 30})
    assert info["bed_seed"] == 30
    over = False
    while not over:  # to the duct's free end, take hold there, and up
        tip, held = observed["hands"][0, :3], observed["hands"][0, 6] > 0.0
        place = np.array([46.0, 0.0, 8.0 if held else 2.0])
        direction = np.clip((place - tip) / 2.0, -1.0, 1.0)
        grip = 1.0 if held or abs(46.0 - tip[0]) < 1.0 else -1.0
        action = np.array([*direction, 0.0, grip, 0.0, 0.0, 0.0, 0.0, -1.0], np.float32)
        observed, _, terminated, truncated, info = env.step(action)
        over = terminated or truncated
    assert observed["hands"][0, 6] == 1.0
    run = env.run_file()
    assert run.metrics["strands_broken"] > 0
    again = replayed(run, phantom())
    assert again.metrics == run.metrics
    assert again.outcome == run.outcome


def test_an_artery_is_divided_through_actions_at_an_anatomy() -> None:
    """Its hook holds the gallbladder by its wall; the run replays to the bit."""
    env = DissectionEnv(
        anatomy="normal", exercise="critical_view", instruments=("hook", "scissors")
    )
    observed, _ = env.reset(seed=1)
    assert env.episode is not None
    tissue = env.episode.session.spatial
    hands, beam = tissue.hands, tissue.beam

    def lead(hand: int, goal: np.ndarray, steps: int, **more: float) -> dict[str, Any]:
        """Lead a hand to a place; the hook holds from when it is told to on."""
        for _ in range(steps):
            action = np.zeros((2, 6), np.float32)
            action[:, 4] = 2.0 * observed["hands"][:, 6] - 1.0
            action[:, 5] = -1.0
            action[hand, :3] = np.clip((goal - hands[hand].target) / 2.0, -1.0, 1.0)
            for name, value in more.items():
                action[hand, env.task.acted.index(name)] = value
            found, _, terminated, _, info = env.step(action.ravel())
            observed.update(found)
            if terminated:
                return info
        return {}

    wall = beam.places[beam.nodes_of("gallbladder")[6]] + np.array([0.0, 0.0, 5.0])
    lead(0, wall, 60)
    lead(0, hands[0].target.copy(), 1, grip=1.0)
    assert hands[0].node in beam.nodes_of("gallbladder")
    assert observed["hands"][0, 6] == 1.0
    nodes = beam.nodes_of("artery")
    middle = beam.places[nodes[len(nodes) // 2]].copy()
    lead(1, hands[1].target.copy(), 3, jaws=1.0)
    lead(1, middle + np.array([0.0, -10.0, 25.0]), 60)
    lead(1, middle - 3.0 * np.array(hands[1].aim), 60)
    assert not tissue.events
    info = lead(1, hands[1].target.copy(), 9, use=1.0)
    assert ("division", "artery", 1) in {
        (each.kind, each.tube, each.hand) for each in tissue.events
    }
    assert info["errors"] > 0
    assert not info["passed"]
    assert observed["fluids"][0, 1] > 0.0  # it bleeds
    run = env.run_file()
    assert replayed(run, phantom()).metrics == run.metrics


def test_a_picture_shows_the_duct_where_it_is_and_as_large() -> None:
    """By the silhouette of a cylinder with round ends, seen from straight across."""
    away, side, field = 200.0, 240, math.radians(60.0)
    env = DissectionEnv(hands=1, camera=((25.4, -0.01, away), (25.4, 0.0, 0.0)))
    env.reset(seed=1)
    assert env.episode is not None
    picture = Camera(side, side, 50.8, env.task.camera).take(
        env.episode.session.spatial, np.zeros((side, side, 3), np.uint8)
    )
    green = picture[..., 1].astype(int) > picture[..., 0] + 5
    pixel = 2.0 * math.tan(0.5 * field) / side
    radius = env.episode.session.spatial.radius
    # The outline of a cylinder is what the tangents from the camera touch.
    half = radius / math.sqrt(away**2 - radius**2)
    rows = np.flatnonzero(green[:, side // 2 + 20])
    assert rows.size * pixel == pytest.approx(2.0 * half, abs=2.0 * pixel)
    assert rows.mean() == pytest.approx(0.5 * (side - 1), abs=1.0)
    columns = np.flatnonzero(green.any(axis=0))
    assert columns.size * pixel == pytest.approx((50.8 + 2.0 * radius) / away, abs=4.0 * pixel)
    env.close()


def test_a_vector_environment_starts_anew_with_the_next_step() -> None:
    envs = gymnasium.make_vec(ID, num_envs=3, time_limit=0.2, threads=2)
    assert isinstance(envs.unwrapped, DissectionVectorEnv)
    _, infos = envs.reset(seed=5)
    assert infos["bed_seed"].shape == (3,)
    still = np.zeros(envs.action_space.shape or (), np.float32)
    for wanted in (False, True, False, False, True):
        observed, rewards, terminated, truncated, infos = envs.step(still)
        assert envs.observation_space.contains(observed)
        assert not terminated.any()
        assert truncated.tolist() == [wanted] * 3
        assert (infos["seconds"] == 0.0).all() == bool((rewards == 0.0).all())
    envs.close()
    with pytest.raises(error.ClosedEnvironmentError, match="closed"):
        envs.step(still)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"exercise": "knot"}, "'window', 'follow_front', 'free_scar'.*got 'knot'"),
        ({"bed": "feather"}, "feather"),
        ({"anatomy": "nobody's"}, 'there is no anatomy "nobody\'s" here: normal'),
        (
            {"anatomy": "normal"},
            "one of 'first_view', 'critical_view', 'stop_bleeding' at the anatomy normal, got",
        ),
        ({"preset": "glass"}, "glass"),
        ({"hands": 3}, "hands must be 1 to 2, got 3"),
        ({"instruments": ("hook",)}, "one of each hand"),
        ({"instruments": ("hook", "saw")}, "'saw' is not allowed here; there are 'hook'"),
        ({"ticks_per_step": 0}, "ticks_per_step must be 1 to 30, got 0"),
        ({"speed": float("nan")}, "speed must be above 0 and at most 60 mm/s, got nan"),
        ({"seeds": ()}, "seeds must be one or more"),
        ({"time_limit": 0.0}, "time_limit must be above 0"),
        ({"observation": "sound"}, "observation must be 'state', 'pixels' or 'both'"),
        ({"picture": (96, 2000)}, "picture must be two of 16 to 1024"),
        ({"camera": ((1.0, 2.0, 3.0), (1.0, 2.0, 0.0))}, "not straight down"),
        ({"reward": {"style": 1.0}}, "reward has 'style'; its terms are 'progress'"),
        ({"reward": {"errors": float("inf")}}, "reward's errors must be a finite number"),
    ],
)
def test_arguments_that_make_no_sense_are_named(arguments: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        gymnasium.make(ID, **arguments)


@pytest.mark.long  # a process compiles anew
def test_a_first_start_says_that_it_compiles() -> None:
    """In a process of its own, with a kernel of which no machine code is kept."""
    code = (
        "import gymnasium, app.rl; from kernel_cache import njit;"
        'gymnasium.make("bluntdissect/Dissection-v0");'
        "njit(lambda x: x + 1)(1.0)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stderr.count("Compiling, which takes up to some two minutes") == 1


def test_bad_actions_and_calls_get_gymnasium_s_errors() -> None:
    env = gymnasium.make(ID, time_limit=0.1)
    fine = np.zeros(10, np.float32)
    with pytest.raises(error.ResetNeeded):
        env.step(fine)
    env.reset(seed=1)
    inner = env.unwrapped
    for action, words in (
        (np.full(10, np.nan, np.float32), "finite"),
        (np.zeros(9, np.float32), r"shape \(10,\), got \(9,\)"),
        ("up", "must be numbers"),
    ):
        with pytest.raises(error.InvalidAction, match=words):
            inner.step(action)
    assert inner.step(fine)[3]
    with pytest.raises(error.ResetNeeded, match="over"):
        inner.step(fine)
    with pytest.raises(ValueError, match="bed_seed must be from 0"):
        env.reset(options={"bed_seed": -1})
    env.close()
    with pytest.raises(error.ClosedEnvironmentError, match="closed"):
        inner.reset()
    envs = DissectionVectorEnv(2)
    with pytest.raises(error.ResetNeeded):
        envs.step(np.zeros((2, 10), np.float32))
    with pytest.raises(ValueError, match="one of each of 2"):
        envs.reset(seed=[1])
    envs.reset(seed=1)
    with pytest.raises(error.InvalidAction, match=r"\(2, 10\)"):
        envs.step(np.zeros(10, np.float32))
    with pytest.raises(ValueError, match="threads must be 1 or more"):
        DissectionVectorEnv(2, threads=0)
    envs.close()


def test_the_page_has_the_code_s_tables() -> None:
    page = (ROOT / "docs" / "rl-spaces.md").read_text(encoding="utf-8")
    assert page == renewed(page), "make it anew: python tests/app/rl_page.py docs/rl-spaces.md"
