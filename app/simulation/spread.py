"""How far ducts differ in tissue, and so in their distance to break.

Ducts of one shape that are bent and stretched alike have stresses s in proportion to their modulus
E, by every theory. With the strength T the used share s/T is in proportion to E/T, which is
lognormal with the median of this duct where E and T are so, each within its factor.
"""

import math
from dataclasses import dataclass
from statistics import NormalDist

from app.simulation.preset import Preset

__all__ = ["Spread"]

PART = 0.90
"""Of the ducts, between the ends of a band."""
# Factors where a preset states none: those of assets/study_plan.toml.
ASSUMED = 1.5, 1.3


@dataclass(frozen=True, slots=True)
class Spread:
    """Geometric standard deviations, 1 or more, of the modulus and the strength of ducts."""

    modulus_factor: float
    strength_factor: float

    @classmethod
    def of(cls, preset: Preset) -> "Spread":
        """Return what a preset states, and for what it does not, an assumption."""
        given = preset.modulus_factor, preset.strength_factor
        if given == (None, None):
            return cls(*ASSUMED)
        modulus, strength = (1.0 if each is None else each for each in given)
        return cls(modulus, strength)

    @property
    def _deviation(self) -> float:
        """Standard deviation of ln(E/T)."""
        return math.hypot(math.log(self.modulus_factor), math.log(self.strength_factor))

    def band(self, distance: float) -> tuple[float, float]:
        """Return the distances to break between which nine of ten ducts are; 0 is torn."""
        reach = math.exp(NormalDist().inv_cdf(0.5 + 0.5 * PART) * self._deviation)
        used = 1.0 - distance
        return max(0.0, 1.0 - used * reach), max(0.0, 1.0 - used / reach)

    def torn(self, distance: float) -> float:
        """Return the share of ducts that would be torn."""
        used = 1.0 - distance
        if used <= 0.0 or self._deviation == 0.0:
            return float(used >= 1.0)
        return NormalDist(0.0, self._deviation).cdf(math.log(used))
