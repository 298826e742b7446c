"""The panel of a duct in its bed: the read-out, the hands, the bed, and the keys."""

from functools import partial

import numpy as np

from app.simulation import Reading
from app.trainer.client.dissect_state import NUDGE, DissectState
from app.trainer.pages.dissection_files import RUN_SUFFIXES, run_download
from app.trainer.pages.downloads import Download
from app.trainer.panel.bed_readout import (
    bed_html,
    bed_phase,
    bed_readout_html,
    bed_zone,
)
from app.trainer.panel.bed_tab import BedTab
from app.trainer.panel.export_box import add_export
from app.trainer.panel.hands_tab import HandsTab
from app.trainer.panel.help import DISSECT_KEYS
from app.trainer.panel.mode_panel import ModePanel
from app.trainer.panel.readout import TORN, hidden_html
from app.trainer.panel.result_page import show_dissection_result
from app.trainer.stage.heat_map import freed_legend_html, heat_legend_html

__all__ = ["DissectPanel"]


class DissectPanel(ModePanel[DissectState]):
    """The panel of a duct in its bed."""

    def __init__(self, state: DissectState) -> None:
        super().__init__(state, "dissect", show_dissection_result)
        with self._tabs.add_tab("Dissect"):
            self._hands = HandsTab(self._gui, state)
        self._add_exercises()
        with self._add_replays():
            add_export(
                self._gui,
                state,
                RUN_SUFFIXES,
                self._export,
                "The run from its first touch on, or the duct and its bed at the run's end",
            )
        with self._tabs.add_tab("Bed"):
            self._bed = BedTab(self._gui, state)
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
        self._add_rest(DISSECT_KEYS, actions, anytime)

    @property
    def lags(self) -> bool:
        """Whether the plot has to go on although nothing has moved."""
        return self._hands.plot.lags(self._state.shown)

    def show(self, reading: Reading) -> None:
        """Show a reading."""
        state, visible = self._state, self._state.figures_visible
        if visible:
            readout = bed_readout_html(reading, self._playing, state.spread)
            zone = bed_zone(reading)
        else:
            readout = hidden_html(bed_phase(reading))
            zone = "" if reading.torn_at is None else TORN
        legends = {
            "tissue": "",
            "stress": heat_legend_html(state.shown.tissue.threshold),
            "freed": freed_legend_html(),
        }
        self._show_common(
            readout=readout,
            duct=bed_html(state.shown),
            legend=legends[state.colours if visible else "tissue"],
            zone=zone,
        )
        self._hands.show(reading)
        self._bed.show()

    def _export(self, suffix: str) -> Download:
        state = self._state
        state.require_no_exercise()
        organ = state.session.tissue.dissection.organ
        return run_download(state.run_at_hand(), organ, suffix, state.workers.export_vertices)
