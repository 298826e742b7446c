"""The panel of a duct in its bed: the read-out, the hands, the bed, and the keys."""

from functools import partial

import numpy as np
import viser

from app.simulation.bed import BedReading, DissectionFile
from app.trainer.client.dissect_state import NUDGE, DissectState
from app.trainer.panel.bed_readout import (
    bed_html,
    bed_readout_html,
    bed_zone,
    hidden_bed_readout_html,
)
from app.trainer.panel.bed_tab import BedTab
from app.trainer.panel.controls import on_click, set_if_changed
from app.trainer.panel.exercise_tab import ExerciseTab
from app.trainer.panel.frame import LEARN, REPLAY, add_disclaimer, add_keys, dress_panel
from app.trainer.panel.hands_tab import HandsTab
from app.trainer.panel.help import DISSECT_KEYS, show_help
from app.trainer.panel.legend import Legend
from app.trainer.panel.readout import TORN
from app.trainer.panel.replay_tab import ReplayTab, result_actions
from app.trainer.panel.result_page import show_dissection_result
from app.trainer.stage.heat_map import freed_legend_html, heat_legend_html
from app.trainer.viser_bridge import announce, open_tab, take_arrows

__all__ = ["DissectPanel"]


class DissectPanel:
    """One client's panel: it passes inputs to the session and shows its readings."""

    def __init__(self, state: DissectState) -> None:
        self._state = state
        self._said = ""
        gui = state.client.gui
        dress_panel(gui, state, "dissect")
        take_arrows(state.client, True)
        self._readout = gui.add_html("")
        self._duct = gui.add_html("")
        add_disclaimer(gui)
        self._legend = Legend(gui)
        tabs = gui.add_tab_group()
        with tabs.add_tab("Dissect"):
            self._hands = HandsTab(gui, state)
        with tabs.add_tab(LEARN):
            self._exercises = ExerciseTab(gui, state)
        with tabs.add_tab(REPLAY):
            self._replay = ReplayTab(gui, state)
        with tabs.add_tab("Bed"):
            self._bed = BedTab(gui, state)
        ask = gui.add_button("Help", icon=viser.Icon.HELP, color="gray")
        on_click(ask, lambda: show_help(state.client, "dissect"))
        on_click(self._exercises.result, self._show_last)
        self._add_keys()
        if state.in_exercise:  # the page was reloaded
            open_tab(state.client, LEARN)
        self.show(state.shown.reading())

    def show(self, reading: BedReading) -> None:
        """Show a reading."""
        state = self._state
        visible = state.figures_visible
        mode = "Replay" if state.playback is not None else "Paused" if state.paused else ""
        content = bed_readout_html(reading, mode) if visible else hidden_bed_readout_html(reading)
        set_if_changed(self._readout, content=content)
        set_if_changed(self._duct, content=bed_html(state.shown))
        self._announce(reading)
        colours = state.colours if visible else "tissue"
        self._legend.show(
            {
                "tissue": "",
                "stress": heat_legend_html(state.shown.duct.threshold),
                "freed": freed_legend_html(),
            }[colours],
            state.client.camera.aspect,
        )
        self._hands.show(reading)
        self._exercises.show()
        self._replay.show()
        self._bed.show()

    def show_result(self, run: DissectionFile) -> None:
        """Open the result page of a run."""
        again, watch = result_actions(self._state, self._replay, run)
        show_dissection_result(self._state, run, again=again, replay=watch)

    def _show_last(self) -> None:
        run = self._state.last_run
        if run is not None:
            self.show_result(run)

    def _announce(self, reading: BedReading) -> None:
        """Have a screen reader announce the duct's new state, without figures."""
        state = self._state
        torn = reading.torn_at is not None
        run = state.session.run
        words = [
            "Replay" if state.playback is not None else "",
            "Paused" if state.paused else "",
            ("Exercise" if run.started else "Exercise ready") if state.in_exercise else "",
            bed_zone(reading) if state.figures_visible else TORN if torn else "",
        ]
        said = ", ".join(word for word in words if word)
        if said != self._said:
            self._said = said
            announce(state.client, said)

    def _add_keys(self) -> None:
        state = self._state
        ways = {
            "Left": (-NUDGE, 0.0, 0.0),
            "Right": (NUDGE, 0.0, 0.0),
            "Up": (0.0, 0.0, NUDGE),
            "Down": (0.0, 0.0, -NUDGE),
            "Shift+Up": (0.0, NUDGE, 0.0),
            "Shift+Down": (0.0, -NUDGE, 0.0),
        }
        moves = {key: partial(state.nudge, np.array(way)) for key, way in ways.items()}
        anytime = {"H": state.show_next, "V": state.bring_home}
        actions = {
            **moves,
            "G": state.take_or_let_go,
            "O": lambda: state.open_more(2.0 * NUDGE),
            "C": lambda: state.open_more(-2.0 * NUDGE),
            "X": lambda: state.choose_hand(1 - state.hand),
            "N": state.next_instrument,
            "P": lambda: state.set_paused(not state.paused),
            "R": state.reset,
        }
        add_keys(state, DISSECT_KEYS, actions, anytime)
