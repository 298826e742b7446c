"""The model that a session solves: a dissection, a theory of it and how hard it can be pulled."""

import math
from dataclasses import dataclass
from typing import Self

from app.simulation.dissection import Dissection
from physics import Beam, NoEquilibrium, Theory, break_of

__all__ = ["BOUNDLESS_DEFLECTION", "Model"]

FORCE_RANGE = 1.5
"""Largest force, in forces at break with a grasp in the middle."""
RAMP_SECONDS = 0.75
"""Time in which the pull can grow from nothing to the force at break."""
BOUNDLESS_DEFLECTION = 1.0
"""Deflection, in spans, that sets the range of forces for a duct that cannot be broken."""


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """What is solved: found in full before a session takes it, so that a refusal changes nothing.

    Attributes
    ----------
    dissection
        The organ between its clamps.
    theory
        The theory that was chosen.
    threshold
        The preset's threshold for it, MPa.
    break_force
        Force at break with a grasp in the middle, N; the largest there is if it cannot break.
    """

    dissection: Dissection
    theory: Theory
    threshold: float
    break_force: float

    @classmethod
    def of(cls, dissection: Dissection, theory: Theory) -> Self:
        """Return the model of a dissection by a theory."""
        beam = dissection.beam
        threshold = dissection.preset.threshold(theory, beam)
        middle = 0.5 * beam.span
        event = break_of(theory.pull(beam, middle), threshold)
        force = (
            _farthest_force(theory, beam, middle) / FORCE_RANGE if event is None else event.force
        )
        return cls(dissection, theory, threshold, force)

    @property
    def force_limit(self) -> float:
        """Largest force the grasper gives, N."""
        return _rounded_up(FORCE_RANGE * self.break_force)

    @property
    def force_per_second(self) -> float:
        """How fast the pull grows, N/s."""
        return self.break_force / RAMP_SECONDS


def _farthest_force(theory: Theory, beam: Beam, grasp: float) -> float:
    """Return the force at a deflection that no duct needs, or where the theory ends, N."""
    deflection = BOUNDLESS_DEFLECTION * beam.span
    while True:
        try:
            return theory.pull(beam, grasp).to_deflection(deflection).force
        except NoEquilibrium:
            deflection *= 0.8


def _rounded_up(value: float) -> float:
    """Return the value rounded up to two digits, for the end of a scale."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return math.ceil(value / unit) * unit
