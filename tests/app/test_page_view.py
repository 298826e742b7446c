"""A view without a page: the result of each exercise is shown, and at once."""

import threading
from collections.abc import Iterator
from typing import Any, cast
from unittest.mock import MagicMock

import pytest
from msgspec.structs import replace
from program import LONGEST, refused
from simulated import phantom

from app.anatomy import anatomy_named
from app.simulation import TOWARDS_VIEWER, Exercise, Feedback, Stay
from app.trainer.client import background_worker
from app.trainer.client.background_worker import BackgroundWorker
from app.trainer.client.practice import Practice
from app.trainer.client.workers import Workers
from app.trainer.view.page_view import PageView


class Results:
    """A panel that keeps the results that it is to show."""

    def __init__(self, *_: object) -> None:
        self.results: list[Any] = []
        self.shown = threading.Event()
        self.needs_redraw = False
        self.exercises = self

    def show(self, _: object) -> None:
        """Show nothing."""

    def show_result(self, run: Any, _: object) -> None:
        """Keep the run."""
        self.results.append(run)
        self.shown.set()


@pytest.fixture
def view() -> Iterator[Any]:
    workers = Workers()
    practice = Practice(phantom(), None, "free")
    scene, panel = cast(Any, MagicMock()), cast(Any, Results)
    scene.return_value.view = TOWARDS_VIEWER.tolist()
    yield PageView(
        MagicMock(), practice, workers, "plain", exercise_inputs="any", scene=scene, panel=panel
    )
    workers.stop()


def finish_exercise(view: Any) -> None:
    """Do an exercise by the slider between two looks of the page."""
    session = view.session
    session.start_exercise(
        Exercise("near", "Near", Stay("distance_to_break", 0.0, 0.9, 0.1)), inputs="any"
    )
    view.state.set_target_force(2.0)
    while not session.run.over:
        session.advance()


def test_a_pull_that_goes_on_after_an_exercise_takes_no_result_away(view: Any) -> None:
    finish_exercise(view)
    run = view.session.run
    view.state.set_target_force(2.1)
    assert view.session.run is run
    view.tick(0.2)
    assert view._panel.shown.wait(LONGEST)
    assert [each.outcome for each in view._panel.results] == [run.outcome]
    assert run.outcome is not None
    assert view.session.planar.grasper.slider_force == 0.0
    # From then on a pull begins anew, and nothing is told twice.
    view.state.set_target_force(2.5)
    assert view.session.run is not run
    view.tick(0.2)
    assert view.session.planar.grasper.slider_force == 2.5
    assert len(view._panel.results) == 1


def test_each_try_begins_with_the_view_home(view: Any) -> None:
    near = Exercise("near", "Near", Stay("distance_to_break", 0.0, 0.9, 0.1))
    view.tick(0.2)
    for tries in (1, 2):
        view._scene.frame_camera.reset_mock()
        view.state.start_exercise(near, Feedback.CONTINUOUS)
        view.tick(0.2)
        view.tick(0.2)
        assert view._scene.frame_camera.call_count == 1, tries


def test_a_result_waits_for_no_long_work_of_others(view: Any) -> None:
    go = threading.Event()

    def work() -> None:
        go.wait()

    view.state.workers.background.submit("another page's", work)
    try:
        finish_exercise(view)
        view.tick(0.2)
        assert view._panel.shown.wait(LONGEST)
    finally:
        go.set()


def test_work_for_a_panel_that_was_removed_is_dropped(view: Any) -> None:
    state, began, go = view.state, threading.Event(), threading.Event()
    ended: list[str] = []

    def write() -> None:
        began.set()
        go.wait(LONGEST)
        ended.append("running")
        raise RuntimeError("the widget has been removed")

    worker = BackgroundWorker()
    state.when_free(worker, "running", write)
    state.when_free(worker, "waiting", lambda: ended.append("waiting"))
    assert began.wait(LONGEST)
    with pytest.MonkeyPatch.context() as patch:
        failed = MagicMock()
        patch.setattr(background_worker.log, "exception", failed)
        state.remove_panel()
        go.set()
        worker.stop()
        failed.assert_not_called()
    assert ended == ["running"]


def test_pages_begin_with_the_trainer_s_own_anatomy() -> None:
    own = replace(anatomy_named("short-cystic"), name="mine")
    practice = Practice(phantom(), None, "calot", own)
    assert practice.session("calot").specimen.anatomy is own
    # Another is chosen, and the ducts of other scenes are what they were.
    practice.choose_anatomy(anatomy_named("normal"))
    assert practice.session("calot").specimen.anatomy == anatomy_named("normal")
    assert practice.session("free").specimen.anatomy is None
    usual = Practice(phantom(), None, "calot")
    assert usual.session("calot").specimen.anatomy == anatomy_named("normal")


@pytest.mark.parametrize(
    ("more", "says"),
    [
        (["--anatomy", "nothing.toml"], "nothing.toml"),
        (["--anatomy", "normal", "--scene", "bed"], "--anatomy goes with --scene calot"),
        (["--anatomy", "normal", "--replay", "run.json"], "--anatomy goes with --scene calot"),
    ],
)
def test_an_anatomy_that_cannot_be_shown_is_refused(more: list[str], says: str) -> None:
    assert says in refused(["trainer", "--port", 0, *more])
