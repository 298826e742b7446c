"""A view without a page: the result of each exercise is shown, and at once."""

import threading
from collections.abc import Iterator
from typing import Any
from unittest.mock import MagicMock

import pytest
from program import LONGEST
from simulated import phantom, pull_session

from app.simulation import Exercise, Stay
from app.trainer.client.client_state import Workers
from app.trainer.client.pull_state import PullState
from app.trainer.stage.lighting import Look
from app.trainer.view.pull_view import PullView


class View(PullView):
    """What a client would see of its session."""

    def __init__(self, state: PullState) -> None:
        self.results: list[Any] = []
        self.shown = threading.Event()
        super().__init__(state, "plain")
        self._annotations: Any = MagicMock()

    def _make_scene(self, look: Look) -> Any:
        return MagicMock()

    def _make_panel(self) -> Any:
        return MagicMock(show_result=self._show_result, lags=False)

    def _show_result(self, run: Any) -> None:
        self.results.append(run)
        self.shown.set()


@pytest.fixture
def view() -> Iterator[View]:
    workers = Workers()
    yield View(PullState(MagicMock(), pull_session(phantom(), vertices=300), workers, "any"))
    workers.stop()


def finish_exercise(view: View) -> None:
    """Do an exercise by the slider between two looks of the page."""
    session = view.session
    session.start_exercise(
        Exercise("near", "Near", Stay("distance_to_break", 0.0, 0.9, 0.1)), inputs="any"
    )
    view.state.set_target_force(2.0)
    while not session.run.over:
        session.advance()


def test_a_pull_that_goes_on_after_an_exercise_takes_no_result_away(view: View) -> None:
    finish_exercise(view)
    run = view.session.run
    view.state.set_target_force(2.1)
    assert view.session.run is run
    view.tick(0.2)
    assert view.shown.wait(LONGEST)
    assert [each.outcome for each in view.results] == [run.outcome]
    assert run.outcome is not None
    assert view.session.planar.grasper.slider_force == 0.0
    # From then on a pull begins anew, and nothing is told twice.
    view.state.set_target_force(2.5)
    assert view.session.run is not run
    view.tick(0.2)
    assert view.session.planar.grasper.slider_force == 2.5
    assert len(view.results) == 1


def test_a_result_waits_for_no_long_work_of_others(view: View) -> None:
    go = threading.Event()

    def work() -> None:
        go.wait()

    view.state.workers.background.submit("another page's", work)
    try:
        finish_exercise(view)
        view.tick(0.2)
        assert view.shown.wait(LONGEST)
    finally:
        go.set()
