"""One client's panel: the read-out, tabs for what the tissue in hand offers, and the keys."""

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np
import viser

from app.simulation import Reading, Session
from app.trainer.client.page_state import NUDGE, PageState
from app.trainer.client.practice import SceneName
from app.trainer.panel.build_tab import BuildTab
from app.trainer.panel.compare_tab import CompareTab
from app.trainer.panel.controls import on_click, set_if_changed
from app.trainer.panel.exercise_tab import ExerciseTab
from app.trainer.panel.frame import BUILD, LEARN, REPLAY, add_disclaimer
from app.trainer.panel.help import keys_of, show_help
from app.trainer.panel.keys import add_keys
from app.trainer.panel.legend import Legend
from app.trainer.panel.model_tab import ModelTab
from app.trainer.panel.readout import duct_html, hidden_html, readout_html, zone, zone_while_hidden
from app.trainer.panel.replay_tab import ReplayTab
from app.trainer.panel.scenes import add_scenes
from app.trainer.panel.train_tab import TrainTab
from app.trainer.stage.heat_map import freed_legend_html, heat_legend_html
from app.trainer.viser_bridge.page import announce, open_tab, take_arrows

STEPS = {
    "Left": (-NUDGE, 0.0, 0.0),
    "Right": (NUDGE, 0.0, 0.0),
    "Up": (0.0, 0.0, NUDGE),
    "Down": (0.0, 0.0, -NUDGE),
    "Shift+Up": (0.0, NUDGE, 0.0),
    "Shift+Down": (0.0, -NUDGE, 0.0),
}
"""mm that keys move the active hand's tip by."""
ANYTIME = ("H", "V")
"""Keys that act while a replay is shown, too."""


def offers(session: Session) -> tuple[bool, bool]:
    """Return what decides on a session's tabs, boxes and keys: whether it has a theory, a bed."""
    return session.specimen.theory is not None, session.specimen.bed is not None


class PagePanel:
    """One client's panel: it passes inputs to the session and shows its readings."""

    def __init__(
        self, state: PageState, scene: SceneName, choose_scene: Callable[[SceneName], None]
    ) -> None:
        self._state = state
        self._announced = ""
        gui = state.client.gui
        add_scenes(gui, scene, choose_scene)
        take_arrows(state.client, not state.in_plane)
        self._readout, self._duct = gui.add_html(""), gui.add_html("")
        add_disclaimer(gui)
        self._legend = Legend(gui)
        tabs = gui.add_tab_group()
        # To add a tab: write a module, add a line here and, if it shows readings, one in `show`.
        with tabs.add_tab("Train"):
            self._train = TrainTab(gui, state)
        learn = tabs.add_tab(LEARN)
        with tabs.add_tab("Compare"):
            self._compare = CompareTab(gui, state)
        with tabs.add_tab(REPLAY):
            self.replays = ReplayTab(gui, state)
        with learn:
            self.exercises = ExerciseTab(gui, state, self.replays.watch)
        with tabs.add_tab(BUILD):
            self._build = BuildTab(gui, state)
        with tabs.add_tab("Model"):
            self._model = ModelTab(gui, state)
        ask = gui.add_button("Help", icon=viser.Icon.HELP, color="gray")
        on_click(ask, lambda: show_help(state.client, state.session))
        self._add_keys()
        if state.in_exercise:  # the page was loaded or made anew
            open_tab(state.client, LEARN)
        self.show(state.shown.reading())

    def show(self, reading: Reading) -> None:
        """Show a reading."""
        state, shown, visible = self._state, self._state.shown, self._state.figures_visible
        playback, run = state.playback, state.session.run
        standing = playback.title if playback is not None else "Paused" if state.paused else ""
        set_if_changed(
            self._readout,
            content=readout_html(reading, standing, state.spread)
            if visible
            else hidden_html(reading.phase.value),
        )
        set_if_changed(self._duct, content=duct_html(shown, figures=visible))
        legends = {
            "tissue": "",
            "stress": heat_legend_html(shown.tissue.threshold),
            "freed": freed_legend_html(),
        }
        legend = legends[state.colours if visible else "tissue"]
        self._legend.show(legend, state.client.camera.aspect)
        for tab in (self._train, self._compare, self._model):
            tab.show(reading)
        self.exercises.show()
        self.replays.show()
        # A screen reader announces the duct's new state, without figures.
        words = [
            standing,
            ("Exercise" if run.started else "Exercise ready") if state.in_exercise else "",
            zone(reading) if visible else zone_while_hidden(reading.phase),
        ]
        words = ", ".join(word for word in words if word)
        if words != self._announced:
            self._announced = words
            announce(state.client, words)

    @property
    def needs_redraw(self) -> bool:
        """Whether something shown has to go on although nothing has moved."""
        return self._train.needs_redraw

    def close(self) -> None:
        """Remove what the client has uploaded, when it has gone."""
        self._build.close()

    def _add_keys(self) -> None:
        state = self._state
        actions: Mapping[str, Callable[[], object]] = {
            **{name: partial(state.nudge, np.array(step)) for name, step in STEPS.items()},
            "H": state.show_next,
            "V": state.bring_home,
            "G": state.take_or_let_go,
            "O": lambda: state.open_more(2.0 * NUDGE),
            "C": lambda: state.open_more(-2.0 * NUDGE),
            "X": state.next_hand,
            "N": state.next_instrument,
            "T": state.ramp_to_tear,
            "P": lambda: state.set_paused(not state.paused),
            "R": state.reset,
        }
        add_keys(state, keys_of(state.session), actions, ANYTIME)
