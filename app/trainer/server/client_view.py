"""One browser client: its state, its scene and its panel."""

from collections.abc import Sequence

import numpy as np
import viser
from numpy.typing import NDArray

from app.simulation import Clock, Phase, Reading, Run, Session
from app.trainer.client.client_state import ClientState
from app.trainer.panel.model_tab import SIMPLE_PICTURE
from app.trainer.panel.panel import Panel
from app.trainer.scene.annotations import Annotations
from app.trainer.scene.duct_scene import DuctScene
from app.trainer.stage.lighting import LookChoice
from app.trainer.viser_bridge import watch_pace

__all__ = ["ClientView"]

PANEL_SECONDS = 0.1
"""s, shortest time between updates of the panel: faster changes of a figure cannot be read."""

LEAST_PICTURES = 5.0
"""Frames per second below which a page gets the simple picture."""
REMEDY = (
    f"A simpler picture helps: {SIMPLE_PICTURE!r} in the Model tab, or start with --look plain."
)


class ClientView:
    """A session and what one client sees of it.

    The state's session is the client's alone. The look "plain" is for slow machines; "auto" changes
    to it where the page draws too slowly. `frames` counts how often the duct was drawn.
    """

    def __init__(
        self,
        state: ClientState,
        look: LookChoice,
    ) -> None:
        client, session = self.client, self.session = state.client, state.session
        self.state = state
        state.plain = look == "plain"
        self._scene = DuctScene(client, session, "plain" if look == "plain" else "full")
        # Before the panel is sent, so that all that can be seen can be dragged.
        self._scene.let_drag(self.state.grab, self.state.move_hand, self.state.release_hand)
        self._annotations = Annotations(client)
        self._panel = Panel(self.state)
        if look != "plain":
            self._watch_pace(may_simplify=look == "auto")
        self._clock = Clock()
        self._notice: viser.NotificationHandle | None = None
        self.frames = 0
        self._undrawn = False
        self._panel_due = 0.0
        self._panel_stale = True
        self._told: Run | None = session.run if session.run.over else None
        self._figures = True
        self._stress: list[NDArray[np.float32]] = []
        self._stress_shape = -1
        self._stress_of: Session | None = None

    def _watch_pace(self, *, may_simplify: bool) -> None:
        """Suggest the simple picture to a page that draws in software; switch a slow page to it."""
        command: viser.CommandHandle | None = None
        if may_simplify:
            command = self.client.gui.add_command(
                SIMPLE_PICTURE, description="For a page that draws slowly"
            )

            @command.on_trigger
            async def _(_: object) -> None:  # pyright: ignore[reportUnusedFunction]
                self.state.show(plain=True)
                self.client.add_notification(
                    "A simpler picture",
                    f"This page draws fewer than {LEAST_PICTURES:g} pictures a second. The full "
                    f"one comes back with {SIMPLE_PICTURE!r} in the Model tab.",
                    color="blue",
                )

        watch_pace(self.client, least=LEAST_PICTURES, command=command, remedy=REMEDY)

    def close(self) -> None:
        """Release the duct and remove what was sent, when the client has gone."""
        self.state.release_hand()
        self._panel.close()

    def tick(self, seconds: float, *, draws: bool = True) -> None:
        """Advance the session, or its replay, by real time, s, and send what has changed."""
        state = self.state
        state.take_organ()
        if state.take_home():
            self._scene.frame_camera()
        playback = state.playback
        ticks = self._clock.ticks(seconds)
        if playback is not None:
            changed = playback.tick(ticks)
        else:
            changed = not state.paused and self.session.advance(ticks)
        visible = state.figures_visible
        changed |= state.take_change() | (visible != self._figures)
        self._figures = visible
        self._panel_due -= seconds
        run = self.session.run
        # While a deflection is held nothing moves, but the time shown runs on.
        timed = run.going and run.exercise is not None
        self._panel_stale |= changed | timed | (run.over and run is not self._told)
        # A change is kept until there is time to draw it.
        self._undrawn |= changed
        if not draws:
            return
        if self._undrawn:
            self._undrawn = False
            self._draw()
        if self._panel_stale and self._panel_due <= 0.0:
            reading = state.shown.reading()
            self._panel_due = PANEL_SECONDS
            self._panel_stale = False
            self._panel.show(reading)
            self._annotations.say_standing(state.shown, figures=state.figures_visible)
            self._tell(reading)

    def _draw(self) -> None:
        self.frames += 1
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

    def _tell(self, reading: Reading) -> None:
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
