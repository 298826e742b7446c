"""The panel of a duct in its bed: the read-out, the hands, the bed, and the keys."""

from functools import partial

import numpy as np
import viser

from app.simulation.bed import BedReading
from app.trainer.client.dissect_state import NUDGE, DissectState
from app.trainer.panel.bed_readout import (
    bed_html,
    bed_readout_html,
    bed_zone,
    hidden_bed_readout_html,
)
from app.trainer.panel.bed_tab import BedTab
from app.trainer.panel.controls import on_click, set_if_changed
from app.trainer.panel.frame import add_disclaimer, add_keys, dress_panel
from app.trainer.panel.hands_tab import HandsTab
from app.trainer.panel.help import DISSECT_KEYS, show_help
from app.trainer.panel.legend import Legend
from app.trainer.panel.readout import TORN
from app.trainer.stage.heat_map import freed_legend_html, heat_legend_html
from app.trainer.viser_bridge import announce, take_arrows

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
        with tabs.add_tab("Bed"):
            self._bed = BedTab(gui, state)
        ask = gui.add_button("Help", icon=viser.Icon.HELP, color="gray")
        on_click(ask, lambda: show_help(state.client, "dissect"))
        self._add_keys()
        self.show(state.session.reading())

    def show(self, reading: BedReading) -> None:
        """Show a reading."""
        state = self._state
        visible = state.figures_visible
        content = (
            bed_readout_html(reading, "Paused" if state.paused else "")
            if visible
            else hidden_bed_readout_html(reading)
        )
        set_if_changed(self._readout, content=content)
        set_if_changed(self._duct, content=bed_html(state.session))
        self._announce(reading)
        colours = state.colours if visible else "tissue"
        self._legend.show(
            {
                "tissue": "",
                "stress": heat_legend_html(state.session.duct.threshold),
                "freed": freed_legend_html(),
            }[colours],
            state.client.camera.aspect,
        )
        self._hands.show(reading)
        self._bed.show()

    def _announce(self, reading: BedReading) -> None:
        """Have a screen reader announce the duct's new state, without figures."""
        state = self._state
        torn = reading.torn_at is not None
        words = [
            "Paused" if state.paused else "",
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
