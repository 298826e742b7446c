"""Pull: the scene and the panel of a duct without a bed."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from app.simulation import Phase, Reading, Session
from app.trainer.client.pull_state import PullState
from app.trainer.panel.pull_panel import PullPanel
from app.trainer.scene.annotations import Annotations
from app.trainer.scene.duct_scene import DuctScene
from app.trainer.stage.lighting import Look, LookChoice
from app.trainer.view.mode_view import ModeView

__all__ = ["PullView"]


class PullView(ModeView[PullState, DuctScene]):
    """A session without a bed, and what one client sees of it."""

    plain_tab = "Model"

    def __init__(self, state: PullState, look: LookChoice) -> None:
        super().__init__(state, look)
        self._annotations = Annotations(self.client)
        self._stress: list[NDArray[np.float32]] = []
        self._stress_shape = -1
        self._stress_of: Session | None = None

    def leave(self) -> None:
        """Remove the scene, for another mode."""
        super().leave()
        self._annotations.remove()

    def _make_scene(self, look: Look) -> DuctScene:
        return DuctScene(self.client, self.state.session, look)

    def _make_panel(self) -> PullPanel:
        return PullPanel(self.state)

    def _advance(self, ticks: int) -> bool:
        self.state.take_organ()
        return super()._advance(ticks)

    def _tell(self) -> None:
        state = self.state
        self._annotations.say_standing(state.shown, figures=state.figures_visible)
        super()._tell()

    def _draw_reading(self, reading: Reading) -> None:
        state = self.state
        shown, figures = state.shown, state.figures_visible
        self._scene.draw(reading, self._shares(shown) if state.heat and figures else None)
        self._annotations.draw(shown, reading, figures=figures, overlay=state.overlay)

    def _shares(self, session: Session) -> Sequence[NDArray[np.float32]]:
        """Return each surface's stress at its vertices over the threshold."""
        if self._stress_of is not session or self._stress_shape != session.drawn.shape:
            self._stress_of, self._stress_shape = session, session.drawn.shape
            self._stress = [
                np.empty(len(surface.vertices), np.float32) for surface in session.drawn.surfaces
            ]
        threshold = session.tissue.threshold
        for index, out in enumerate(self._stress):
            session.stress(out, index)
            out /= threshold
        return self._stress

    def _tear_is_seen(self, reading: Reading) -> bool:
        return reading.phase is not Phase.TEARING

    def _torn_words(self, reading: Reading) -> str:
        if reading.phase is Phase.INTACT:
            return ""
        event = reading.breaks_at
        force = f" at F = {event.force:.2f} N" if event else ""
        return f"It tore {reading.check.station:.1f} mm from the left clamp{force}."
