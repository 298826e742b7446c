"""The scene of a dissection: a duct in its bed, and the instruments of both hands."""

from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import numpy as np
import viser
from numpy.typing import NDArray

from app.simulation.bed import BedReading, BedSession
from app.trainer.scene.drag_proxy import DragProxy, Hold
from app.trainer.scene.duct_on_stage import DuctOnStage
from app.trainer.stage.hook import grip_solid
from app.trainer.stage.lighting import Look
from app.trainer.stage.stage import Stage
from app.trainer.stage.strands import StrandsInBed
from physics.bed import Strands

__all__ = ["BedScene", "Colours"]

Colours = Literal["tissue", "stress", "freed"]
"""How the duct is coloured: as tissue, by the stress in its wall, or by what is freed of it."""


class BedScene(DuctOnStage[BedSession]):
    """One client's picture of its dissection; the look is "plain" for slow machines."""

    in_screen = True

    def __init__(self, client: viser.ClientHandle, session: BedSession, look: Look) -> None:
        super().__init__(client, session, look)
        self._strands: StrandsInBed | None = None
        self._strands_of: Strands | None = None
        self.draw(session.reading())

    def draw(self, reading: BedReading, colours: Colours = "tissue") -> None:
        """Draw the session as it is now."""
        with self._client.atomic():
            stage = self._set_stage()
            self._set_surfaces()
            self._set_strands(stage)
            stage.place_hook(self._session.duct.hands[0].place, (0.0, 0.0, 1.0))
            for drawn in self._drawn:
                drawn.contact.mark(drawn.surface.vertices, None)
            self._show(None)

    def _set_strands(self, stage: Stage) -> None:
        """Draw the strands as they are now."""
        beam = self._session.duct.beam
        if self._strands is not None and beam.strands is not self._strands_of:
            self._strands.remove()
            self._strands = None
        if self._strands is None:
            self._strands_of = beam.strands
            self._strands = StrandsInBed(
                self._client.scene,
                "/bed/strands",
                beam,
                floor=stage.floor,
                scale=stage.scale,
                bed_columns=stage.bed_columns,
                fibres=2 if self._look == "full" else 1,
            )
        else:
            self._strands.show(beam)

    def _clear(self) -> None:
        super()._clear()
        if self._strands is not None:
            self._strands.remove()
            self._strands = None

    def let_drag(
        self,
        grabbed: Callable[[Hold], None],
        moved: Callable[[Hold], None],
        released: Callable[[], None],
    ) -> None:
        """Let the mouse drag the duct and both instruments; holds are in the duct's frame.

        A hold's station is mm from the first clamp, None for an instrument, whose hand it names.
        """
        super().let_drag(
            lambda hold: grabbed(self._in_duct(hold)),
            lambda hold: moved(self._in_duct(hold)),
            released,
        )

    def _in_duct(self, hold: Hold) -> Hold:
        dissection = self._session.duct.dissection

        def place(organ_place: NDArray[np.float64]) -> NDArray[np.float64]:
            return (organ_place - self._first) @ dissection.frame

        station = None if hold.station is None else hold.station - dissection.clamps[0]
        return replace(hold, station=station, start=place(hold.start), place=place(hold.place))

    def _offer_instruments(self, hand: DragProxy) -> None:
        hand.set_instrument(0, "/stage/hook", grip_solid(self._radius))
