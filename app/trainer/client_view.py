"""One browser client: its session, its scene and its panel."""

import viser

from app.simulation.session import Phase, Reading, Session
from app.trainer.panel import Panel
from app.trainer.scene import Scene
from app.trainer.stage.lighting import Look

__all__ = ["ClientView"]

PANEL_SECONDS = 0.1
"""Shortest time between two updates of the panel: figures that change faster cannot be read."""


class ClientView:
    """A session and what one client sees of it.

    Parameters
    ----------
    client
        The client.
    session
        The session that is the client's alone.
    look
        "plain" for slow machines.
    """

    def __init__(self, client: viser.ClientHandle, session: Session, look: Look) -> None:
        self.session = session
        self.client = client
        self._scene = Scene(client, session, look)
        self._panel = Panel(client.gui, session, self._refusal)
        self._phase = Phase.INTACT
        self._notice: viser.NotificationHandle | None = None
        self._panel_due = 0.0
        self._panel_stale = False

    def tick(self, seconds: float) -> None:
        """Advance the session and show what has changed.

        Parameters
        ----------
        seconds
            Time since the last tick, s.
        """
        changed = self.session.step(seconds)
        self._panel_due -= seconds
        self._panel_stale |= changed
        if changed:
            self._scene.draw(self.session.reading())
        if self._panel_stale and self._panel_due <= 0.0:
            reading = self.session.reading()
            self._panel.show(reading)
            self._panel_due = PANEL_SECONDS
            self._panel_stale = False
            if reading.phase is Phase.TORN and self._phase is not Phase.TORN:
                self._notice = self._tear_notice(reading)
            if reading.phase is Phase.INTACT and self._notice is not None:
                self._notice.remove()
                self._notice = None
            self._phase = reading.phase

    def _refusal(self, reason: str) -> None:
        """Show why a choice could not be made."""
        self.client.add_notification("Not possible", reason, color="yellow", auto_close_seconds=8.0)

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
