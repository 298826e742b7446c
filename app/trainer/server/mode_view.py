"""What one client sees of one of its sessions: drawn and told about as often as there is time."""

from abc import ABC, abstractmethod
from typing import Any

import viser

from app.simulation import Clock
from app.trainer.client.client_state import ClientState
from app.trainer.panel.model_tab import SIMPLE_PICTURE
from app.trainer.stage.lighting import LookChoice
from app.trainer.viser_bridge import watch_pace

__all__ = ["ModeView"]

PANEL_SECONDS = 0.1
"""s, shortest time between updates of the panel: faster changes of a figure cannot be read."""
LEAST_PICTURES = 5.0
"""Frames per second below which a page gets the simple picture."""
REMEDY = (
    f"A simpler picture helps: {SIMPLE_PICTURE!r} in the Model tab, or start with --look plain."
)


class ModeView(ABC):
    """The scene and the panel of one mode of the page. `frames` counts how often it was drawn."""

    def __init__(self, state: ClientState[Any, Any]) -> None:
        self.client = state.client
        self.frames = 0
        self._clock = Clock()
        self._undrawn = False
        self._panel_due = 0.0
        self._panel_stale = True
        self._figures = True

    @property
    @abstractmethod
    def state(self) -> ClientState[Any, Any]:
        """What the parts of the page share."""

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
        if self._undrawn:
            self._undrawn = False
            self.frames += 1
            self._draw()
        if self._panel_stale and self._panel_due <= 0.0:
            self._panel_due = PANEL_SECONDS
            self._panel_stale = False
            self._tell()

    @abstractmethod
    def close(self) -> None:
        """Release the duct and remove what was uploaded, when the client has gone."""

    @abstractmethod
    def leave(self) -> None:
        """Remove the scene, for another mode."""

    @abstractmethod
    def _advance(self, ticks: int) -> bool:
        """Advance what is shown by some ticks; return whether anything has moved."""

    @abstractmethod
    def _has_news(self) -> bool:
        """Return whether the panel has something to tell although nothing has moved."""

    @abstractmethod
    def _draw(self) -> None:
        """Draw the session as it is now."""

    @abstractmethod
    def _tell(self) -> None:
        """Bring the panel up to date."""

    def _watch_pace(self, look: LookChoice) -> None:
        """Suggest the simple picture to a page that draws in software; "auto" switches to it."""
        if look == "plain":
            return
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
                    f"one comes back with {SIMPLE_PICTURE!r} in the Model tab.",
                    color="blue",
                )

        watch_pace(self.client, least=LEAST_PICTURES, command=command, remedy=REMEDY)
