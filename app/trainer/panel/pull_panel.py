"""The panel of a duct without a bed: the read-out, the tabs and the keys."""

from app.simulation import Reading
from app.trainer.client.pull_state import PullState
from app.trainer.pages.downloads import SUFFIXES, download
from app.trainer.panel.build_tab import BuildTab
from app.trainer.panel.compare_tab import CompareTab
from app.trainer.panel.export_box import add_export
from app.trainer.panel.help import PULL_KEYS
from app.trainer.panel.mode_panel import ModePanel
from app.trainer.panel.model_tab import ModelTab
from app.trainer.panel.readout import (
    duct_html,
    hidden_html,
    readout_html,
    zone,
    zone_told,
)
from app.trainer.panel.result_page import show_pull_result
from app.trainer.panel.train_tab import TrainTab
from app.trainer.stage.heat_map import heat_legend_html

__all__ = ["PullPanel"]


class PullPanel(ModePanel[PullState]):
    """The panel of a duct without a bed."""

    def __init__(self, state: PullState) -> None:
        super().__init__(state, "pull", show_pull_result)
        gui, tabs = self._gui, self._tabs
        # To add a tab: write a module, add a line here and, if it shows readings, one in `show`.
        with tabs.add_tab("Train"):
            self._train = TrainTab(gui, state)
        self._add_exercises()
        with tabs.add_tab("Compare"):
            self._compare = CompareTab(gui, state)
        self._add_replays()
        with tabs.add_tab("Build"):
            self._build = BuildTab(gui, state)
        with tabs.add_tab("Model"):
            self._model = ModelTab(gui, state)
            add_export(
                gui,
                state,
                SUFFIXES,
                lambda suffix: download(state.shown, suffix, state.workers.export_vertices),
                "The duct as it is now, in a file",
            )
        anytime = {"H": lambda: state.show(heat=not state.heat), "V": state.bring_home}
        actions = {
            "R": state.reset,
            "T": state.ramp_to_tear,
            "P": lambda: state.set_paused(not state.paused),
        }
        self._add_rest(PULL_KEYS, actions, anytime)

    def show(self, reading: Reading) -> None:
        """Show a reading."""
        state, shown, visible = self._state, self._state.shown, self._state.figures_visible
        heat = state.heat and visible
        self._show_common(
            readout=readout_html(reading, self._playing, state.spread)
            if visible
            else hidden_html(reading.phase.value),
            duct=duct_html(shown, figures=visible),
            legend=heat_legend_html(shown.tissue.threshold) if heat else "",
            zone=zone(reading) if visible else zone_told(reading.phase),
        )
        self._train.show(reading)
        self._compare.show(reading)
        self._model.show(reading)

    def close(self) -> None:
        """Remove what the client has uploaded, when it has gone."""
        self._build.close()
