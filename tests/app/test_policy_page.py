"""A policy in the page: it leads the right hand, or is drawn as a ghost; it is refused in words."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from browser import TrainerPage, newest_dissection, trainer_page
from onnx_files import linear
from playwright.sync_api import Browser, expect
from program import refused
from simulated import phantom

from app.rl.companion import Companion
from app.rl.policy import Policy
from app.trainer.server.trainer import Trainer
from app.trainer.view.page_view import PageView

# A policy whose second hand goes to the right and whose first does so at half that speed.
OFFSET = np.array([0.2, 0.0, 0.0, 0.0, -1.0, 0.4, 0.0, 0.0, 0.0, -1.0])


@pytest.fixture(scope="module")
def trainer_with_policy(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Trainer]:
    path = tmp_path_factory.mktemp("policies") / "right.onnx"
    policy = Policy(linear(path, np.zeros((10, 24)), OFFSET))
    running = Trainer(
        phantom(),
        port=0,
        look="plain",
        policy=lambda session, ghost: Companion(policy, session, ghost=ghost),
    )
    running.warm_up.wait("bed")
    yield running
    running.stop()


def begin(tab: TrainerPage, view: PageView, role: str) -> None:
    tab.open("Learn")
    start = tab.page.get_by_role("button", name="Start", exact=True)
    expect(start).to_be_enabled()  # its exercises are found
    tab.page.get_by_role("group", name="Policy").get_by_role("button", name=role).click()
    tab.wait_until(lambda: view.state.beside.role == {"Second hand": "hand"}.get(role, "ghost"))
    tab.press("Start")
    tab.wait_until(lambda: view.state.in_exercise)


def test_a_policy_leads_the_right_hand_and_then_is_a_ghost(
    browser: Browser, trainer_with_policy: Trainer
) -> None:
    with trainer_page(browser, trainer_with_policy.address) as tab:
        view = newest_dissection(trainer_with_policy)
        begin(tab, view, "Second hand")
        session, (left, right) = view.session, view.session.spatial.hands
        starts = left.place.copy(), right.place.copy()
        tab.wait_until(lambda: view.state.beside.leads(1))
        assert view.state.hand == 0  # the mouse and the keys have the other
        assert not session.run.started  # it waits for the trainee
        session.grab(0, 25.0)
        tab.wait_until(lambda: session.spatial.hands[1].place[0] > starts[1][0] + 3.0)
        assert {each.hand for each in session.run_file().log.inputs[1:]} == {1}
        tab.page.keyboard.press("x")
        tab.wait_until(lambda: view.state.hand == 1)
        tab.page.keyboard.press("o")
        expect(tab.page.get_by_text("The policy has this hand")).to_be_visible()
        tab.press("Stop")
        tab.wait_until(lambda: not view.state.in_exercise)
        result = tab.page.get_by_test_id("outcome")
        result.wait_for()
        tab.page.keyboard.press("Escape")
        expect(result).to_have_count(0)

        begin(tab, view, "Ghost")
        tab.wait_until(lambda: view.state.beside.ghost)
        ghost = view.state.beside.ghost
        assert ghost is not None
        session.grab(0, 25.0)
        tab.wait_until(lambda: ghost.run.ticks > 20)
        assert len(session.run_file().log.inputs) == 1  # the trainee's hands are left alone
        tab.page.wait_for_function(
            "() => ['duct', 'hand_0', 'hand_1'].every("
            "name => window.__viserMutable.nodeRefFromName['/ghost/' + name])"
        )
        expect(tab.page.get_by_test_id("exercise-state")).to_contain_text("The ghost is at 0 %")
        tab.press("Stop")
        tab.wait_until(lambda: not view.state.in_exercise)


def test_the_command_refuses_what_is_no_policy_of_it(tmp_path: Path) -> None:
    path = tmp_path / "policy.onnx"
    linear(path, np.zeros((10, 27)), np.zeros(10), ("hands", [1, 3, 9]))
    message = refused(("trainer", "--port", 0, "--policy", path))
    assert f"{path}: the policy sees 'hands' of shape 1x3x9; here it is 1x2x12" in message
