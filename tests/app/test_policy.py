"""Policies in ONNX files: beside a trainee they do what they do alone, and wait for nothing."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace
from onnx import helper
from onnx_files import HANDS, endless, linear, write
from simulated import bed_exercises, bed_session, phantom, pull_session, replayed

from app.rl.companion import Companion
from app.rl.environment import DissectionEnv
from app.rl.policy import Policy
from app.simulation import Session, exercises_offered, run_json

RANDOM = np.random.default_rng(3)
WEIGHTS, OFFSET = 0.02 * RANDOM.standard_normal((10, 24)), 0.3 * RANDOM.standard_normal(10)


@pytest.fixture(scope="module")
def policy(tmp_path_factory: pytest.TempPathFactory) -> Policy:
    path = tmp_path_factory.mktemp("policies") / "linear.onnx"
    return Policy(linear(path, WEIGHTS, OFFSET, ticks_per_step=2, speed=40.0))


@pytest.fixture
def awaited(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a tick wait for the policy, however busy the machine is."""
    monkeypatch.setattr("app.rl.companion.PATIENCE_S", 60.0)


def opened(bed_seed: int) -> Session:
    """A trainee's session at the beginning of *Open a window*."""
    session = bed_session(phantom(), vertices=300)
    (window,) = (each for each in bed_exercises(session) if each.name == "window")
    assert window.opening is not None
    session.start_exercise(replace(window, opening=replace(window.opening, bed_seed=bed_seed)))
    return session


@pytest.mark.usefixtures("awaited")
def test_a_ghost_does_what_the_policy_does_alone_to_the_bit(policy: Policy) -> None:
    session = opened(5)
    ghost = Companion(policy, session, ghost=True)
    ghost.tick()
    assert not ghost.session.run.ticks  # it waits for the trainee's first input
    session.open_jaws(1, 3.0)
    for _ in range(300):
        ghost.tick()
        session.advance()
    assert not ghost.fault
    env = DissectionEnv(exercise="window", ticks_per_step=2, speed=40.0)
    observed, _ = env.reset(options={"bed_seed": 5})
    over = False
    while not over and env.run_file().log.ticks < ghost.session.run.ticks:
        action = policy.ask(observed).action(10.0)
        assert action is not None
        observed, _, terminated, truncated, _ = env.step(action.astype(np.float32))
        over = terminated or truncated
    alone, beside = env.run_file(), ghost.session.run_file()
    assert len(alone.log.inputs) > 20
    assert beside.log == alone.log
    assert beside.metrics == alone.metrics


@pytest.mark.usefixtures("awaited")
def test_an_assistant_leads_the_second_hand_only_and_the_run_replays(policy: Policy) -> None:
    session = opened(5)
    helper_ = Companion(policy, session, ghost=False)
    session.grab(0, 25.0)
    for _ in range(90):
        helper_.tick()
        session.advance()
    run = session.run_file()
    assert {each.hand for each in run.log.inputs[1:]} == {1}
    assert len(run.log.inputs) > 30
    assert replayed(run, phantom()).metrics == run.metrics
    assert run_json(run)
    session.finish()
    assert not helper_.acts


def test_who_takes_too_long_is_left_and_no_tick_waits(tmp_path: Path) -> None:
    policy = Policy(endless(tmp_path / "endless.onnx"))
    session = opened(1)
    companion = Companion(policy, session, ghost=False)
    session.open_jaws(1, 3.0)
    for _ in range(60):
        companion.tick()
        session.advance()
    while companion.acts:
        companion.tick()
    assert companion.fault == "the policy took longer than 1 s for an action"
    assert session.run.ticks == 60
    assert [each.kind for each in session.run_file().log.inputs] == ["open"]
    answered = policy.ask(companion.episode.room())  # the thread is free again
    answered.give_up()
    policy.close()


def test_an_action_that_is_no_number_stops_the_policy(tmp_path: Path) -> None:
    policy = Policy(linear(tmp_path / "nan.onnx", WEIGHTS, np.full(10, np.nan)))
    session = opened(1)
    companion = Companion(policy, session, ghost=True)
    session.open_jaws(1, 3.0)
    while companion.acts:
        companion.tick()
    assert companion.fault == "the policy has failed: its action is not finite"


def _model(tmp_path: Path, seen: tuple[str, list[Any]], actions: int, **arguments: Any) -> Path:
    size = int(np.prod(seen[1][1:]))
    weights = np.zeros((actions, size))
    return linear(tmp_path / "policy.onnx", weights, np.zeros(actions), seen, **arguments)


@pytest.mark.parametrize(
    ("seen", "actions", "arguments", "words"),
    [
        (
            ("view", [1, 3]),
            10,
            {},
            "wants to see 'view'; there are hands, duct, strands",
        ),
        (("hands", [1, 2, 9]), 10, {}, "sees 'hands' of shape 1x2x9; here it is 1x2x12"),
        (("hands", [4, 2, 12]), 10, {}, "sees 'hands' of shape 4x2x12; here it is 1x2x12"),
        (("hands", [1, 24]), 10, {}, "sees 'hands' of shape 1x24; here it is 1x2x12"),
        (HANDS, 12, {}, "does actions of shape 1x12; here it is 1x10"),
        (HANDS, 10, {"hands": 1}, "sees 'hands' of shape 1x2x12; here it is 1x1x12"),
        (HANDS, 10, {"speed": 1e9}, "speed must be above 0 and at most 60 mm/s"),
        (HANDS, 10, {"colour": "red"}, "unexpected keyword argument 'colour'"),
    ],
)
def test_a_policy_of_other_shapes_is_refused_in_a_sentence(
    tmp_path: Path, seen: tuple[str, list[Any]], actions: int, arguments: Any, words: str
) -> None:
    path = _model(tmp_path, seen, actions, **arguments)
    with pytest.raises(ValueError, match=re.escape(words)) as refused:
        Policy(path)
    assert "\n" not in str(refused.value)


def test_what_is_no_model_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "no.onnx"
    path.write_bytes(b"no model")
    with pytest.raises(ValueError, match=re.escape(f"{path} is no ONNX model")):
        Policy(path)
    with pytest.raises(ValueError, match="cannot read"):
        Policy(tmp_path / "nothing.onnx")
    two = write(
        path,
        [helper.make_node("Flatten", ["hands"], ["a"]), helper.make_node("Cos", ["a"], ["b"])],
        [HANDS],
        [("a", [1, 24]), ("b", [1, 24])],
    )
    with pytest.raises(ValueError, match="one output"):
        Policy(two)


def test_a_policy_acts_in_exercises_of_its_kind_only(policy: Policy, tmp_path: Path) -> None:
    session = bed_session(phantom(), vertices=300)
    with pytest.raises(ValueError, match="start one"):
        Companion(policy, session, ghost=True)
    plane = pull_session(phantom(), vertices=300)
    plane.start_exercise(exercises_offered(plane)[0])
    with pytest.raises(ValueError, match="not one in the plane"):
        Companion(policy, plane, ghost=True)
    one = Policy(_model(tmp_path, ("wall", [1, 3]), 5, hands=1))
    with pytest.raises(ValueError, match="it can be a ghost"):
        Companion(one, opened(1), ghost=False)
