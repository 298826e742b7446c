"""What the panels of both modes share: read-out, exercises, replays and keys."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import Generic, TypeVar

import viser

from app.simulation import Reading, RunFile
from app.trainer.client.client_state import ClientState, Mode
from app.trainer.panel.controls import on_click, set_if_changed
from app.trainer.panel.exercise_tab import ExerciseTab
from app.trainer.panel.frame import LEARN, REPLAY, add_disclaimer, add_keys, dress_panel
from app.trainer.panel.help import Key, show_help
from app.trainer.panel.legend import Legend
from app.trainer.panel.replay_tab import ReplayTab
from app.trainer.panel.result_page import ResultPage
from app.trainer.viser_bridge.page import announce, open_tab, take_arrows

__all__ = ["ModePanel"]

StateT = TypeVar("StateT", bound=ClientState)


class ModePanel(ABC, Generic[StateT]):
    """One client's panel: it passes inputs to the session and shows its readings."""

    def __init__(self, state: StateT, mode: Mode, open_result: ResultPage[StateT]) -> None:
        self._state, self._open_result = state, open_result
        self._mode: Mode = mode
        self._said = ""
        gui = self._gui = state.client.gui
        dress_panel(gui, state, mode)
        take_arrows(state.client, mode == "dissect")
        self._readout, self._duct = gui.add_html(""), gui.add_html("")
        add_disclaimer(gui)
        self._legend = Legend(gui)
        self._tabs = gui.add_tab_group()

    def _add_exercises(self) -> None:
        with self._tabs.add_tab(LEARN):
            self._exercises = ExerciseTab(self._gui, self._state)

    def _add_replays(self) -> viser.GuiTabHandle:
        tab = self._tabs.add_tab(REPLAY)
        with tab:
            self._replay = ReplayTab(self._gui, self._state)
        return tab

    def _add_rest(
        self,
        keys: Sequence[Key],
        actions: Mapping[str, Callable[[], object]],
        anytime: Mapping[str, Callable[[], object]],
    ) -> None:
        """Add what follows the tabs, and show the session."""
        state, mode = self._state, self._mode
        ask = self._gui.add_button("Help", icon=viser.Icon.HELP, color="gray")
        on_click(ask, lambda: show_help(state.client, mode))
        on_click(self._exercises.result, self._show_last)
        add_keys(state, keys, actions, anytime)
        if state.in_exercise:  # the page was reloaded
            open_tab(state.client, LEARN)
        self.show(state.shown.reading())

    @abstractmethod
    def show(self, reading: Reading) -> None:
        """Show a reading."""

    def show_result(self, run: RunFile) -> None:
        """Open the result page of a run; replaying the run for its plots takes a while."""
        state = self._state

        def again() -> None:
            state.start_again(run)
            open_tab(state.client, LEARN)

        def watch() -> None:
            self._replay.replay(lambda: run)
            open_tab(state.client, REPLAY)

        self._open_result(state, run, again, watch)

    def close(self) -> None:
        """Remove what the client has uploaded, when it has gone."""

    @property
    def lags(self) -> bool:
        """Whether something shown has to go on although nothing has moved."""
        return False

    @property
    def _playing(self) -> str:
        """What is shown in place of the running session, in a word; empty for none."""
        state = self._state
        playback = state.playback
        return playback.title if playback is not None else "Paused" if state.paused else ""

    def _show_common(self, *, readout: str, duct: str, legend: str, zone: str) -> None:
        """Show what both modes have; `zone` is the word for the duct's state, if it is told."""
        state, run = self._state, self._state.session.run
        set_if_changed(self._readout, content=readout)
        set_if_changed(self._duct, content=duct)
        self._legend.show(legend, state.client.camera.aspect)
        self._exercises.show()
        self._replay.show()
        # A screen reader announces the duct's new state, without figures.
        words = [
            self._playing,
            ("Exercise" if run.started else "Exercise ready") if state.in_exercise else "",
            zone,
        ]
        said = ", ".join(word for word in words if word)
        if said != self._said:
            self._said = said
            announce(state.client, said)

    def _show_last(self) -> None:
        run = self._state.last_run
        if run is not None:
            self._state.attempt("Measuring the run.", lambda: self.show_result(run))
