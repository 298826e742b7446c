"""Train: what hands or a force do to the duct, what colours it, and a plot of what comes of it."""

import viser

from app.simulation import Reading
from app.trainer.client.page_state import PageState
from app.trainer.panel.controls import Choice, on_click, set_if_changed
from app.trainer.panel.force_box import ForceBox
from app.trainer.panel.force_curve import ForceCurve
from app.trainer.panel.hands_box import HandsBox
from app.trainer.panel.last_seconds import LastSeconds
from app.trainer.scene.tissue_scene import Colours
from app.trainer.viser_bridge.page import pairs_html

COLOURED: dict[Colours, tuple[str, str]] = {
    "tissue": ("Tissue", "The duct as it looks (H)"),
    "stress": ("Stress", "Tensile stress at the wall, from none to the threshold (H)"),
    "freed": ("Freed", "Where the strands around the duct have broken (H)"),
}


class TrainTab:
    """The tab that the page opens on: a force where a theory solves the duct, else the hands."""

    def __init__(self, gui: viser.GuiApi, state: PageState) -> None:
        self._state = state
        gui.add_html(pairs_html())
        self._force = ForceBox(gui, state) if state.in_plane else None
        self._hands = None if state.in_plane else HandsBox(gui, state)
        words: dict[Colours, tuple[str, str]] = {
            each: COLOURED[each] for each in state.colours_offered
        }
        self._colours = Choice(gui, "Colours", words, lambda value: state.show(colours=value))
        self._pause = gui.add_button(
            "Pause (P)", icon=viser.Icon.PLAYER_PAUSE, color="gray", hint="Let time stand still"
        )
        self._reset = gui.add_button(
            "Reset (R)", icon=viser.Icon.REFRESH, hint="Let go, and make all whole"
        )
        if self._hands is not None:
            self._hands.add_lower(gui)
        self._curve = ForceCurve(gui, state) if state.in_plane else None
        self._last = None if state.in_plane else LastSeconds(gui)
        on_click(self._pause, lambda: state.set_paused(not state.paused))
        on_click(self._reset, state.reset)

    @property
    def needs_redraw(self) -> bool:
        """Whether the plot has to go on although nothing has moved."""
        return self._last is not None and self._last.needs_redraw(self._state.shown)

    def show(self, reading: Reading) -> None:
        """Show a reading."""
        state = self._state
        visible, shown = state.figures_visible, state.shown
        in_plane = shown.specimen.theory is not None  # what is replayed may be another's
        if self._force is not None:
            self._force.show(reading if state.playback is None else state.session.reading())
        if self._hands is not None and not in_plane:
            self._hands.show(reading)
        self._colours.show(state.colours)
        live = state.playback is None
        set_if_changed(
            self._pause,
            visible=live and not state.in_exercise,
            label="Go on (P)" if state.paused else "Pause (P)",
        )
        set_if_changed(self._reset, visible=live)
        if self._curve is not None:
            self._curve.visible = visible and in_plane
            if visible and in_plane:
                self._curve.show(shown, reading)
        if self._last is not None:
            self._last.show(shown, reading, figures=visible and not in_plane)
