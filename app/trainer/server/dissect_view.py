"""Dissect: the scene and the panel of a duct in its bed."""

import viser

from app.simulation.bed import BedReading, DissectionRun
from app.trainer.client.dissect_state import DissectState
from app.trainer.panel.dissect_panel import DissectPanel
from app.trainer.scene.bed_scene import BedScene
from app.trainer.server.mode_view import ModeView
from app.trainer.stage.lighting import LookChoice

__all__ = ["DissectView"]


class DissectView(ModeView):
    """A session in a bed, and what one client sees of it; `look` as of `PullView`."""

    def __init__(self, state: DissectState, look: LookChoice) -> None:
        super().__init__(state)
        client, session = self.client, self.session = state.client, state.session
        self._state = state
        self._scene = BedScene(client, session, "plain" if state.plain else "full")
        # Before the panel is sent, so that all that can be seen can be dragged.
        self._scene.let_drag(state.grab, state.move_hand, state.release_hand)
        self._panel = DissectPanel(state)
        self._watch_pace(look)
        self._notice: viser.NotificationHandle | None = None
        self._told: DissectionRun | None = session.run if session.run.over else None

    @property
    def state(self) -> DissectState:
        """What the parts of the page share."""
        return self._state

    def close(self) -> None:
        """Release the duct, when the client has gone."""
        self.state.release_hand()

    def leave(self) -> None:
        """Remove the scene, for another mode."""
        self.state.leave_replay()
        self.close()
        self._forget_tear()
        self._scene.remove()

    def _advance(self, ticks: int) -> bool:
        state = self.state
        if state.take_home():
            self._scene.frame_camera()
        if (playback := state.playback) is not None:
            return playback.tick(ticks)
        return not state.paused and self.session.advance(ticks)

    def _has_news(self) -> bool:
        run = self.session.run
        # While all stands still the time shown runs on.
        timed = run.going and run.exercise is not None
        return timed or (run.over and run is not self._told)

    def _draw(self) -> None:
        state, scene = self.state, self._scene
        scene.watch(state.shown)
        scene.set_look("plain" if state.plain else "full")
        scene.draw(state.shown.reading(), state.colours if state.figures_visible else "tissue")

    def _tell(self) -> None:
        state, run = self.state, self.session.run
        self._panel.show(state.shown.reading())
        reading = self.session.reading()
        if run.over and run is not self._told:
            self._told = run
            state.keep_run()
            kept = state.last_run
            if run.exercise is not None and kept is not None:
                state.release_hand()
                state.workers.background.submit(
                    (id(self), "result"), lambda: self._panel.show_result(kept)
                )
            elif reading.torn_at is not None:
                self._notice = self._tear_notice(reading)
            self._panel_stale = True
        if reading.torn_at is None:
            self._forget_tear()

    def _tear_notice(self, reading: BedReading) -> viser.NotificationHandle:
        """Show where the duct has torn, and what it was freed of before."""
        return self.client.add_notification(
            "The duct is torn",
            f"It tore {reading.torn_at:.1f} mm from the left clamp, with {reading.freed:.0f} mm "
            "freed. Press Reset (R) for a new one.",
            color="red",
        )

    def _forget_tear(self) -> None:
        if self._notice is not None:
            self._notice.remove()
            self._notice = None
