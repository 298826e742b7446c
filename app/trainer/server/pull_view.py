"""Pull: the scene and the panel of a duct without a bed."""

from collections.abc import Sequence

import numpy as np
import viser
from numpy.typing import NDArray

from app.simulation import Phase, Reading, Run, Session
from app.trainer.client.pull_state import PullState
from app.trainer.panel.pull_panel import PullPanel
from app.trainer.scene.annotations import Annotations
from app.trainer.scene.duct_scene import DuctScene
from app.trainer.server.mode_view import ModeView
from app.trainer.stage.lighting import LookChoice

__all__ = ["PullView"]


class PullView(ModeView):
    """A session without a bed, and what one client sees of it.

    The state's session is the client's alone. The look "plain" is for slow machines; "auto" changes
    to it where the page draws too slowly.
    """

    def __init__(self, state: PullState, look: LookChoice) -> None:
        super().__init__(state)
        client, session = self.client, self.session = state.client, state.session
        self._state = state
        self._scene = DuctScene(client, session, "plain" if state.plain else "full")
        # Before the panel is sent, so that all that can be seen can be dragged.
        self._scene.let_drag(state.grab, state.move_hand, state.release_hand)
        self._annotations = Annotations(client)
        self._panel = PullPanel(state)
        self._watch_pace(look)
        self._notice: viser.NotificationHandle | None = None
        self._told: Run | None = session.run if session.run.over else None
        self._stress: list[NDArray[np.float32]] = []
        self._stress_shape = -1
        self._stress_of: Session | None = None

    @property
    def state(self) -> PullState:
        """What the parts of the page share."""
        return self._state

    def close(self) -> None:
        """Release the duct and remove what was sent, when the client has gone."""
        self.state.release_hand()
        self._panel.close()

    def leave(self) -> None:
        """Remove the scene, for another mode."""
        self.state.leave_replay()
        self.close()
        self._scene.remove()
        self._annotations.remove()

    def _advance(self, ticks: int) -> bool:
        state = self.state
        state.take_organ()
        if state.take_home():
            self._scene.frame_camera()
        playback = state.playback
        if playback is not None:
            return playback.tick(ticks)
        return not state.paused and self.session.advance(ticks)

    def _has_news(self) -> bool:
        run = self.session.run
        # While a deflection is held nothing moves, but the time shown runs on.
        timed = run.going and run.exercise is not None
        return timed or (run.over and run is not self._told)

    def _tell(self) -> None:
        state = self.state
        reading = state.shown.reading()
        self._panel.show(reading)
        self._annotations.say_standing(state.shown, figures=state.figures_visible)
        self._tell_end(reading)

    def _draw(self) -> None:
        state = self.state
        shown, figures = state.shown, state.figures_visible
        reading = shown.reading()
        heat = state.heat and figures
        scene = self._scene
        scene.watch(shown)
        scene.set_look("plain" if state.plain else "full")
        scene.draw(reading, self._shares(shown) if heat else None)
        self._annotations.draw(shown, reading, figures=figures, overlay=state.overlay)

    def _shares(self, session: Session) -> Sequence[NDArray[np.float32]]:
        """Return each surface's stress at its vertices over the threshold."""
        if self._stress_of is not session or self._stress_shape != session.drawn.shape:
            self._stress_of, self._stress_shape = session, session.drawn.shape
            self._stress = [
                np.empty(len(surface.vertices), np.float32) for surface in session.drawn.surfaces
            ]
        threshold = session.duct.threshold
        for index, out in enumerate(self._stress):
            session.stress(out, index)
            out /= threshold
        return self._stress

    def _tell_end(self, reading: Reading) -> None:
        """Announce a tear, and show the result of an exercise that has ended."""
        state, run = self.state, self.session.run
        # The duct is not called torn before the picture shows it in two.
        if run.over and run is not self._told and reading.phase is not Phase.TEARING:
            self._told = run
            state.keep_run()
            kept = state.last_run
            if run.exercise is not None and kept is not None:
                state.release()
                state.workers.background.submit(
                    (id(self), "result"), lambda: self._panel.show_result(kept)
                )
            elif reading.phase is not Phase.INTACT:
                self._notice = self._tear_notice(reading)
            self._panel_stale = True
        if not run.over and self._notice is not None:
            self._notice.remove()
            self._notice = None

    def _tear_notice(self, reading: Reading) -> viser.NotificationHandle:
        """Show what has torn, where and at which force."""
        check, event = reading.check, reading.breaks_at
        place = f"{check.station:.1f} mm from the left clamp"
        force = f" at F = {event.force:.2f} N" if event else ""
        return self.client.add_notification(
            "The duct is torn",
            f"It tore {place}{force}. Press Reset for a new one.",
            color="red",
        )
