"""Instruments through trocars: a shaft always passes its trocar, whichever end is led."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

LENGTH = 330.0
"""From the handle to the tip of a laparoscopic instrument, mm."""
SHALLOWEST, DEEPEST = 25.0, 300.0
"""How deep a tip may be behind its trocar, mm."""


@dataclass(frozen=True, slots=True, eq=False)
class Trocar:
    """Where an instrument passes the wall of the belly."""

    place: Floats  # (3,) mm

    def within(self, tip: Floats) -> Floats:
        """Return the place nearest to a tip's, along its shaft, that the instrument reaches."""
        inside, depth = self._axis(tip)
        return self.place + min(max(depth, SHALLOWEST), DEEPEST) * inside

    def shaft(self, tip: Floats) -> Floats:
        """(3,) the direction from a tip back along its shaft."""
        return -self._axis(tip)[0]

    def handle(self, tip: Floats) -> Floats:
        """(3,) where the handle is, mm."""
        inside, depth = self._axis(tip)
        return self.place - (LENGTH - depth) * inside

    def tip(self, handle: Floats) -> Floats:
        """(3,) where the tip is of an instrument whose handle is somewhere, mm."""
        outside = self.place - handle
        far = math.sqrt(float((outside * outside).sum()))
        return self.place + (LENGTH - far) * outside / far

    def led_by_handle(self, tip: Floats, move: Floats) -> Floats:
        """Return where a tip comes to by a move of the handle that is so long, mm, at the tip."""
        # Across the shaft the fulcrum reverses it; along the shaft it does not.
        inside, depth = self._axis(tip)
        along = float((move * inside).sum()) * inside
        scale = (LENGTH - depth) / depth
        return self.within(self.tip(self.handle(tip) + along + scale * (move - along)))

    def _axis(self, tip: Floats) -> tuple[Floats, float]:
        offset = tip - self.place
        depth = math.sqrt(float((offset * offset).sum()))
        return offset / depth, depth


TROCARS = (Trocar(np.array([-40.0, 150.0, 150.0])), Trocar(np.array([85.0, -70.0, 190.0])))
"""Of the hands at an anatomy, in its frame: in the patient's right flank, and below the sternum.
Placed by eye after the usual four ports of a cholecystectomy."""
