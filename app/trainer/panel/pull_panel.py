"""The panel of a duct without a bed: the read-out, the tabs and the keys."""

import viser

from app.simulation import Reading, RunFile
from app.trainer.client.pull_state import PullState
from app.trainer.panel.build_tab import BuildTab
from app.trainer.panel.compare_tab import CompareTab
from app.trainer.panel.controls import on_click, set_if_changed
from app.trainer.panel.exercise_tab import ExerciseTab
from app.trainer.panel.export_box import ExportBox
from app.trainer.panel.frame import LEARN, REPLAY, add_disclaimer, add_keys, dress_panel
from app.trainer.panel.help import PULL_KEYS, show_help
from app.trainer.panel.legend import Legend
from app.trainer.panel.model_tab import ModelTab
from app.trainer.panel.readout import (
    duct_html,
    hidden_readout_html,
    readout_html,
    zone,
    zone_told,
)
from app.trainer.panel.replay_tab import ReplayTab, result_actions
from app.trainer.panel.result_page import show_pull_result
from app.trainer.panel.train_tab import TrainTab
from app.trainer.stage.heat_map import heat_legend_html
from app.trainer.viser_bridge import announce, open_tab, take_arrows

__all__ = ["PullPanel"]


class PullPanel:
    """One client's panel: it passes inputs to the session and shows its readings."""

    def __init__(self, state: PullState) -> None:
        self._state = state
        self._said = ""
        gui = self._gui = state.client.gui
        dress_panel(gui, state, "pull")
        take_arrows(state.client, False)
        self._readout = gui.add_html("")
        self._duct = gui.add_html("")
        add_disclaimer(gui)
        self._legend = Legend(gui)
        # To add a tab: write a module, add a line here and, if it shows readings, one in `show`.
        tabs = gui.add_tab_group()
        with tabs.add_tab("Train"):
            self._train = TrainTab(gui, state)
        with tabs.add_tab(LEARN):
            self._exercises = ExerciseTab(gui, state)
        with tabs.add_tab("Compare"):
            self._compare = CompareTab(gui, state)
        with tabs.add_tab(REPLAY):
            self._replay = ReplayTab(gui, state)
        with tabs.add_tab("Build"):
            self._build = BuildTab(gui, state)
        with tabs.add_tab("Model"):
            self._model = ModelTab(gui, state)
            ExportBox(gui, state)
        ask = gui.add_button("Help", icon=viser.Icon.HELP, color="gray")
        on_click(ask, lambda: show_help(state.client, "pull"))
        on_click(self._exercises.result, self._show_last)
        self._add_commands()
        if state.in_exercise:  # the page was reloaded
            open_tab(state.client, LEARN)
        self.show(state.shown.reading())

    def show(self, reading: Reading) -> None:
        """Show a reading."""
        state = self._state
        visible = state.figures_visible
        if visible:
            mode = "Replay" if state.playback is not None else "Paused" if state.paused else ""
            content = readout_html(reading, mode)
        else:
            content = hidden_readout_html(reading.phase)
        set_if_changed(self._readout, content=content)
        self._announce(reading)
        set_if_changed(self._duct, content=duct_html(state.shown, figures=visible))
        self._legend.show(
            heat_legend_html(state.shown.duct.threshold) if state.heat and visible else "",
            state.client.camera.aspect,
        )
        self._train.show(reading)
        self._exercises.show()
        self._compare.show(reading)
        self._replay.show()
        self._model.show(reading)

    def _announce(self, reading: Reading) -> None:
        """Have a screen reader announce the duct's new state, without figures."""
        state = self._state
        run = state.session.run
        words = [
            "Replay" if state.playback is not None else "",
            "Paused" if state.paused else "",
            ("Exercise" if run.started else "Exercise ready") if state.in_exercise else "",
            zone(reading) if state.figures_visible else zone_told(reading.phase),
        ]
        said = ", ".join(word for word in words if word)
        if said != self._said:
            self._said = said
            announce(state.client, said)

    def close(self) -> None:
        """Remove what the client has uploaded, when it has gone."""
        self._build.close()

    def show_result(self, run: RunFile) -> None:
        """Open the result page of a run; replaying the run for its plots takes a while."""
        state = self._state
        again, watch = result_actions(state, self._replay, run)
        show_pull_result(state, run, again=again, replay=watch)

    def _show_last(self) -> None:
        run = self._state.last_run
        if run is not None:
            self._state.attempt("Measuring the run.", lambda: self.show_result(run))

    def _add_commands(self) -> None:
        state = self._state
        anytime = {"H": lambda: state.show(heat=not state.heat), "V": state.bring_home}
        actions = {
            "R": state.reset,
            "T": state.ramp_to_tear,
            "P": lambda: state.set_paused(not state.paused),
        }
        add_keys(state, PULL_KEYS, actions, anytime)
