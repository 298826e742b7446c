"""Dissect: the scene and the panel of a duct in its bed."""

from app.simulation import Reading
from app.trainer.client.dissect_state import DissectState
from app.trainer.panel.dissect_panel import DissectPanel
from app.trainer.scene.bed_scene import BedScene
from app.trainer.stage.lighting import Look
from app.trainer.view.mode_view import ModeView

__all__ = ["DissectView"]


class DissectView(ModeView[DissectState, BedScene]):
    """A session in a bed, and what one client sees of it."""

    plain_tab = "Bed"

    def _make_scene(self, look: Look) -> BedScene:
        return BedScene(self.client, self.state.session, look)

    def _make_panel(self) -> DissectPanel:
        return DissectPanel(self.state)

    def _draw_reading(self, reading: Reading) -> None:
        state, figures = self.state, self.state.figures_visible
        self._scene.lead_into_picture(state.into_picture)
        self._scene.draw(reading, state.colours if figures else "tissue", figures=figures)

    def _torn_words(self, reading: Reading) -> str:
        if reading.torn_at is None:
            return ""
        return (
            f"It tore {reading.torn_at:.1f} mm from the left clamp, with {reading.freed:.0f} mm "
            "freed."
        )
