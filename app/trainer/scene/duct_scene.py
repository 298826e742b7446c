"""The scene of a pull: the duct of one client between its clamps, and the hook that pulls it."""

from collections.abc import Sequence

import numpy as np
import viser
from numpy.typing import NDArray

from app.simulation import Phase, Reading, Session
from app.trainer.scene.drag_proxy import DragProxy
from app.trainer.scene.duct_on_stage import DuctOnStage
from app.trainer.stage.contact import HookPlace, sink
from app.trainer.stage.hook import grip_solid
from app.trainer.stage.lighting import Look
from app.trainer.stage.stage import Stage

__all__ = ["DuctScene"]

LIFT_AFTER_TEAR = 2.5
"""Height of the hook above where the torn duct lay, in radii."""


class DuctScene(DuctOnStage):
    """One client's picture of its session; the look is "plain" for slow machines."""

    def __init__(self, client: viser.ClientHandle, session: Session, look: Look) -> None:
        super().__init__(client, session, look)
        self.draw(session.reading())

    def draw(self, reading: Reading, stress: Sequence[NDArray[np.float32]] | None = None) -> None:
        """Draw the session as it is now, as tissue or by the stress at each surface's vertices."""
        with self._client.atomic():
            stage = self._set_stage()
            stage.set_lift(self._lift(stage, reading), self._client)
            self._set_surfaces()
            if reading.phase is Phase.TORN:
                stage.spill(reading.check.station)
            else:
                stage.wipe()
            hook = self._place_hook(stage, reading)
            for drawn in self._drawn:
                drawn.contact.mark(drawn.surface.vertices, hook)
            self._show(stress)

    def _offer_instruments(self, hand: DragProxy) -> None:
        hand.set_instrument(0, "/stage/hook", grip_solid(self._radius))

    def _place_hook(self, stage: Stage, reading: Reading) -> HookPlace | None:
        """Put the hook where it pulls, sunk into the wall, and return where that is."""
        if reading.phase is Phase.TORN:
            up = LIFT_AFTER_TEAR * stage.radius
            stage.place_hook(np.add(reading.hook, (0.0, 0.0, up)))
            return None
        dissection = self._session.tissue.dissection
        share = 1.0 - reading.check.distance_to_break
        center = np.add(reading.hook, (0.0, 0.0, sink(share, stage.radius)))
        stage.place_hook(center)
        place = self._first + dissection.frame @ center
        return HookPlace(place, dissection.frame, stage.radius)

    def _lift(self, stage: Stage, reading: Reading) -> float:
        """Return the height to show, mm: the duct's arch at rest plus its deflection at break."""
        event = reading.breaks_at
        pulled = max(reading.deepest, 0.0 if event is None else event.deflection)
        tenth = 0.1 * stage.span
        # In steps, so that the camera moves when another duct is chosen, not at every reading.
        return max(3.0, np.ceil((self._arch + 1.1 * pulled) / tenth)) * tenth
