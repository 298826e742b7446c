"""The panel of one client: the read-out, the tabs and the keys."""

import viser
from viser import theme

from app.simulation import Reading, RunFile
from app.trainer.client.client_state import ClientState
from app.trainer.panel.build_tab import BuildTab
from app.trainer.panel.compare_tab import CompareTab
from app.trainer.panel.controls import on_click, set_if_changed
from app.trainer.panel.exercise_tab import ExerciseTab
from app.trainer.panel.export_box import ExportBox
from app.trainer.panel.help import HOTKEYS, show_help
from app.trainer.panel.legend import HeatLegend
from app.trainer.panel.model_tab import ModelTab
from app.trainer.panel.readout import (
    duct_html,
    hidden_readout_html,
    readout_html,
    zone,
    zone_told,
)
from app.trainer.panel.replay_tab import ReplayTab
from app.trainer.panel.result_page import ResultPage
from app.trainer.panel.train_tab import TrainTab
from app.trainer.viser_bridge import announce, offer_home, open_tab

__all__ = ["DISCLAIMER", "Panel"]

DISCLAIMER = "Not clinically validated, not a medical device."
WIDTH = 364
"""px."""
LEARN, REPLAY = "Learn", "Replay"
BRAND = (38, 166, 154)


class Panel:
    """One client's panel: it passes inputs to the session and shows its readings."""

    def __init__(self, state: ClientState) -> None:
        self._state = state
        self._said = ""
        gui = self._gui = state.client.gui
        gui.configure_theme(
            titlebar_content=theme.TitlebarConfig(
                buttons=(),
                image=theme.TitlebarImage(
                    image_url_light=_LOGO,
                    image_url_dark=_LOGO,
                    image_alt="Blunt-dissection trainer",
                    href=None,
                ),
            ),
            dark_mode=True,
            show_logo=False,
            show_share_button=False,
            brand_color=BRAND,
        )
        gui.set_panel_label("Controls")
        gui.main_panel.dock_right()
        gui.main_panel.set_width(WIDTH)
        self._readout = gui.add_html("")
        self._duct = gui.add_html("")
        gui.add_html(
            "<div data-testid='disclaimer' style='padding:0 14px 6px;"
            f"font-size:11px;opacity:.75'>{DISCLAIMER}</div>"
        )
        self._legend = HeatLegend(gui)
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
        on_click(ask, lambda: show_help(state.client))
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
            state.heat and visible,
            state.shown.duct.threshold,
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
        offered = run.log.exercise is not None

        def again() -> None:
            self._exercises.again(run)
            open_tab(self._state.client, LEARN)

        def watch() -> None:
            self._replay.replay(lambda: run)
            open_tab(self._state.client, REPLAY)

        ResultPage(self._state, run, again=again if offered else None, replay=watch)

    def _show_last(self) -> None:
        run = self._state.last_run
        if run is not None:
            self._state.attempt("Measuring the run.", lambda: self.show_result(run))

    def _add_commands(self) -> None:
        state = self._state
        actions = {
            "R": state.reset,
            "T": state.ramp_to_tear,
            "P": lambda: state.set_paused(not state.paused),
            "H": lambda: state.show(heat=not state.heat),
            "V": state.bring_home,
        }
        for key, name, what in HOTKEYS:
            command = self._gui.add_command(name, description=what, hotkey=key)

            @command.on_trigger
            async def _(_: object, action=actions[key]) -> None:  # pyright: ignore
                if state.playback is None or action in (actions["H"], actions["V"]):
                    action()

            if key == "V":
                offer_home(state.client, command, f"{name} ({key})", what)


_LOGO = (
    "data:image/svg+xml;utf8,"
    "<svg xmlns='http://www.w3.org/2000/svg' width='310' height='32'>"
    "<path d='M4 21C14 21 14 11 24 11s10 10 20 10' stroke='%23d9a066' stroke-width='8' "
    "fill='none' stroke-linecap='round'/>"
    "<path d='M24 1v8a4 4 0 0 0 8 0' stroke='%23cfd4d9' stroke-width='2.5' fill='none' "
    "stroke-linecap='round'/>"
    "<text x='58' y='22' font-family='sans-serif' font-size='17' font-weight='600' "
    "fill='%23e8eaed'>Blunt-dissection trainer</text></svg>"
)
