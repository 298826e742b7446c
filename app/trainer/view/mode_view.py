"""What one client sees of one of its sessions: drawn and told about as often as there is time."""

from abc import ABC, abstractmethod
from typing import Any, Generic, TypeVar

import viser

from app.simulation import Clock, Reading
from app.trainer.client.client_state import ClientState
from app.trainer.panel.mode_panel import ModePanel
from app.trainer.panel.model_tab import SIMPLE_PICTURE
from app.trainer.scene.duct_on_stage import DuctOnStage
from app.trainer.stage.lighting import Look, LookChoice
from app.trainer.viser_bridge.page import watch_pace

__all__ = ["ModeView"]

# s, shortest time between updates of the panel: faster changes of a figure cannot be read.
PANEL_SECONDS = 0.2
LEAST_PICTURES = 5.0
"""Frames per second below which a page gets the simple picture."""
# s that this is said for: on a phone it covers the picture.
NOTICE_SECONDS = 20.0


StateT = TypeVar("StateT", bound=ClientState)
SceneT = TypeVar("SceneT", bound=DuctOnStage)


class ModeView(ABC, Generic[StateT, SceneT]):
    """The scene and the panel of one mode of the page. `frames` counts how often it was drawn.

    `plain_tab` is the tab of the panel that offers the simple picture.

    The state's session is the client's alone. The look "plain" is for slow machines; "auto" changes
    to it where the page draws too slowly.
    """

    plain_tab: str

    def __init__(self, state: StateT, look: LookChoice) -> None:
        self.client, self.state, self.session = state.client, state, state.session
        self.frames = 0
        self._clock = Clock()
        self._undrawn = False
        self._panel_due = 0.0
        self._panel_stale = True
        self._figures = True
        self._notice: viser.NotificationHandle | None = None
        self._scene = self._make_scene("plain" if state.plain else "full")
        # Before the panel is sent, so that all that can be seen can be dragged.
        self._scene.let_drag(state.grab, state.move_hand, state.release_hand)
        self._panel = self._make_panel()
        self._watch_pace(look)

    def tick(self, seconds: float, *, draws: bool = True) -> None:
        """Advance the session, or its replay, by real time, s, and send what has changed."""
        state = self.state
        changed = self._advance(self._clock.ticks(seconds))
        visible = state.figures_visible
        changed |= state.take_change() | (visible != self._figures)
        self._figures = visible
        self._panel_due -= seconds
        self._panel_stale |= changed | self._has_news()
        # A change is kept until there is time to draw it.
        self._undrawn |= changed
        if not draws:
            return
        tells = self._panel_stale and self._panel_due <= 0.0
        if not (self._undrawn or tells):
            return
        with self.client.atomic():  # one frame of the socket, and the server's loop wakes once
            if self._undrawn:
                self._undrawn = False
                self.frames += 1
                self._draw()
            if tells:
                self._panel_due = PANEL_SECONDS
                self._panel_stale = False
                self._tell()

    def close(self) -> None:
        """Release the duct and remove what was sent, when the client has gone."""
        self.state.release_hand()
        self._panel.close()

    def leave(self) -> None:
        """Remove the scene, for another mode."""
        self.state.leave_replay()
        self.close()
        self._forget_tear()
        self._scene.remove()

    @abstractmethod
    def _make_scene(self, look: Look) -> SceneT:
        """Return the scene."""

    @abstractmethod
    def _make_panel(self) -> ModePanel[Any]:
        """Return the panel."""

    def _advance(self, ticks: int) -> bool:
        """Advance what is shown by some ticks; return whether anything has moved."""
        state = self.state
        if state.take_home():
            self._scene.frame_camera()
        if (playback := state.playback) is not None:
            return playback.tick(ticks)
        return not state.paused and self.session.advance(ticks)

    def _has_news(self) -> bool:
        """Return whether the panel has something to tell although nothing has moved."""
        run = self.session.run
        # While all stands still the time shown runs on.
        timed = run.going and run.exercise is not None
        return timed or self._panel.lags or self.state.has_end_to_tell

    def _draw(self) -> None:
        state, scene = self.state, self._scene
        scene.watch(state.shown)
        scene.set_look("plain" if state.plain else "full")
        self._draw_reading(state.shown.reading())

    @abstractmethod
    def _draw_reading(self, reading: Reading) -> None:
        """Draw what the mode shows of a reading."""

    def _tell(self) -> None:
        """Bring the panel up to date, announce a tear, and show the result of an exercise."""
        state = self.state
        self._panel.show(state.shown.reading())
        run, reading = self.session.run, self.session.reading()
        if state.has_end_to_tell and self._tear_is_seen(reading):
            state.keep_run()
            kept = state.last_run
            judged = run.exercise is not None
            if judged:
                state.release()
            state.told = run  # from now on another pull may begin anew
            if judged and kept is not None:
                state.workers.awaited.submit(
                    (id(self), "result"), lambda: self._panel.show_result(kept)
                )
            elif torn := self._torn_words(reading):
                self._notice = self.client.add_notification(
                    "The duct is torn", f"{torn} Press Reset (R) for a new one.", color="red"
                )
            self._panel_stale = True
        if not run.over:
            self._forget_tear()

    def _forget_tear(self) -> None:
        if self._notice is not None:
            self._notice.remove()
            self._notice = None

    def _tear_is_seen(self, reading: Reading) -> bool:
        """Return whether the picture shows a torn duct in two: it is not called torn before."""
        return True

    @abstractmethod
    def _torn_words(self, reading: Reading) -> str:
        """Return where the duct has torn, in a sentence; nothing for a whole one."""

    def _watch_pace(self, look: LookChoice) -> None:
        """Suggest the simple picture to a page that draws in software; "auto" switches to it."""
        if look == "plain":
            return
        where = f"{SIMPLE_PICTURE!r} in the {self.plain_tab} tab"
        remedy = f"A simpler picture helps: {where}, or start with --look plain."
        command: viser.CommandHandle | None = None
        if look == "auto":
            command = self.client.gui.add_command(
                SIMPLE_PICTURE, description="For a page that draws slowly"
            )

            @command.on_trigger
            async def _(_: object) -> None:  # pyright: ignore[reportUnusedFunction]
                self.state.show(plain=True)
                self.client.add_notification(
                    "A simpler picture",
                    f"This page draws fewer than {LEAST_PICTURES:g} pictures a second. The full "
                    f"one comes back with {where}.",
                    color="blue",
                    auto_close_seconds=NOTICE_SECONDS,
                )

        watch_pace(self.client, least=LEAST_PICTURES, command=command, remedy=remedy)
