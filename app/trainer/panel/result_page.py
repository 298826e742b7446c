"""The result page: how a run has ended, its measures, its plots, and what to do next."""

from collections.abc import Callable, Sequence
from datetime import datetime
from typing import Any, Generic, Literal, TypeVar

import msgspec
import viser

from app.simulation import (
    CAREFUL,
    ApproachBreak,
    Measures,
    Replay,
    RunFile,
    do_exercise,
    run_json,
)
from app.simulation.bed import MANNERS, DissectionFile, DissectionMeasures, rehearsed
from app.trainer.client.client_state import FEW, ClientState
from app.trainer.client.dissect_state import DissectState
from app.trainer.client.pull_state import PullState
from app.trainer.panel.controls import note, on_click
from app.trainer.panel.dialog import Dialog
from app.trainer.panel.measures_table import dissection_html, measures_html, outcome_html
from app.trainer.panel.plots import add_dissection_plots, add_series_plots

__all__ = ["run_name", "show_dissection_result", "show_pull_result"]

FileT = TypeVar("FileT", RunFile, DissectionFile)
MeasuresT = TypeVar("MeasuresT", Measures, DissectionMeasures)
# Earlier tries shown beside a result.
TRIES_BESIDE = 2
_BESIDE = (
    "<b>Try</b>: your earlier tries of this session at the same task. <b>Expert</b>: a scripted "
    "hand, careful and steady, at the same task; it is no surgeon."
)
_SLIDERS = "Sliders and keys were allowed in this exercise."


def _expert(run: RunFile, state: PullState) -> Measures | None:
    """Return the measures of a careful scripted hand in the same exercise; None for free pulls."""
    if run.log.exercise is None:
        return None
    waiting = msgspec.structs.replace(run.log, inputs=[], ticks=0, exercise_inputs="hand")
    session = Replay(waiting, state.session.duct.dissection.organ, vertices=FEW).session
    if session.goal is None:
        return None
    do_exercise(session, CAREFUL)
    return session.measures()


def _bed_expert(run: DissectionFile, state: DissectState) -> DissectionMeasures | None:
    """Return the measures of good scripted hands in the same exercise; None for a free one."""
    exercise = run.log.exercise
    if exercise is None:
        return None
    duct = state.replay_of(run, vertices=FEW).session.duct
    return rehearsed(duct, exercise, MANNERS[exercise.name]["good"])[0]


def _beside(tries: Sequence[Any], expert: MeasuresT | None) -> dict[str, MeasuresT]:
    """Return the runs shown beside a result: the last tries, newest first, and the expert."""
    found = {
        f"try {number}": each.measures
        for number, each in list(enumerate(tries, 1))[: -TRIES_BESIDE - 1 : -1]
    }
    return found if expert is None else {**found, "expert": expert}


def run_name(run: RunFile | DissectionFile) -> str:
    """Return a name for a run's files: its exercise, or what it was, and the time now."""
    exercise = run.log.exercise
    free = "pull" if isinstance(run, RunFile) else "dissection"
    what = free if exercise is None else exercise.title.lower().replace(" ", "-")
    return f"{what}-{datetime.now():%Y-%m-%d-%H%M%S}"


class ResultPage(Generic[FileT]):
    """A page over the trainer with one run's result, until it is closed.

    `fill` adds the measures and plots; `again` starts the same exercise again and is None for a run
    without one; `replay` replays the run.
    """

    def __init__(
        self,
        state: ClientState[Any, FileT],
        run: FileT,
        *,
        fill: Callable[[viser.GuiApi], object],
        remark: str = "",
        again: Callable[[], object] | None,
        replay: Callable[[], object],
    ) -> None:
        gui, client = state.client.gui, state.client
        self._gui = gui
        exercise = run.log.exercise
        free = "Free pull" if isinstance(run, RunFile) else "Free dissection"
        self._dialog = Dialog(gui, "Result")
        with self._dialog:
            title = free if exercise is None else exercise.title
            gui.add_html(outcome_html(run.outcome, title, remark))
            fill(gui)
            if again is not None:
                self._closing("Try again", viser.Icon.REFRESH, again, "teal")
            self._closing("Watch it again", viser.Icon.PLAYER_PLAY, replay)
            csv = gui.add_button("Download CSV", icon=viser.Icon.TABLE_EXPORT, color="gray")
            json = gui.add_button("Download JSON", icon=viser.Icon.DOWNLOAD, color="gray")
        send = client.send_file_download
        name = run_name(run)
        on_click(csv, lambda: send(f"{name}.csv", state.run_csv(run), save_immediately=True))
        on_click(json, lambda: send(f"{name}.json", run_json(run), save_immediately=True))

    def _closing(
        self,
        label: str,
        icon: viser.IconName,
        action: Callable[[], object],
        color: Literal["gray", "teal"] = "gray",
    ) -> None:
        """Add a button that closes the page and then calls `action`."""
        button = self._gui.add_button(label, icon=icon, color=color)

        def press() -> None:
            self.close()
            action()

        on_click(button, press)

    def close(self) -> None:
        """Close the page."""
        self._dialog.close()


def _show_result(
    state: ClientState[Any, FileT],
    run: FileT,
    measures: str,
    plots: Callable[[viser.GuiApi], object],
    remark: str,
    again: Callable[[], object],
    replay: Callable[[], object],
) -> None:
    """Open a result page of two tabs: the measures as HTML, and plots over time."""
    judged = run.log.exercise is not None

    def fill(gui: viser.GuiApi) -> None:
        tabs = gui.add_tab_group()
        with tabs.add_tab("Measures"):
            gui.add_html(measures)
            if judged:
                gui.add_html(note(_BESIDE))
        with tabs.add_tab("Over time"):
            plots(gui)

    ResultPage(state, run, fill=fill, remark=remark, again=again if judged else None, replay=replay)


def show_pull_result(
    state: PullState, run: RunFile, *, again: Callable[[], object], replay: Callable[[], object]
) -> None:
    """Open the result page of a pull; replaying the run for its plots takes a while."""
    series = state.replay_of(run, vertices=FEW).series()
    exercise = run.log.exercise
    table = measures_html(
        run.measures,
        _beside(state.session.earlier_tries(run), _expert(run, state)),
        limits=None if exercise is None else exercise.limits,
        sought_break=isinstance(exercise, ApproachBreak),
    )
    by_sliders = exercise is not None and run.log.exercise_inputs == "any"
    _show_result(
        state, run, table, lambda gui: add_series_plots(gui, series, exercise),
        _SLIDERS if by_sliders else "", again, replay,
    )  # fmt: skip


def show_dissection_result(
    state: DissectState,
    run: DissectionFile,
    *,
    again: Callable[[], object],
    replay: Callable[[], object],
) -> None:
    """Open the result page of a dissection; replaying the run for its plots takes a while."""
    series = state.replay_of(run, vertices=FEW).series()
    exercise = run.log.exercise
    table = dissection_html(
        run.measures,
        _beside(state.earlier_tries(run), _bed_expert(run, state)),
        {} if exercise is None else exercise.limits,
    )
    _show_result(
        state, run, table, lambda gui: add_dissection_plots(gui, series, exercise),
        "", again, replay,
    )  # fmt: skip
