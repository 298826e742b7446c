"""Relaxation of tissue that is held: a Prony series of its stiffness."""

import math
from dataclasses import dataclass

from physics.quantity import finite, positive


@dataclass(frozen=True, slots=True)
class Relaxation:
    """By how much less stiff tissue is some time after a stretch than at once.

    k(t)/k(0) = 1 - sum g_i (1 - exp(-t/tau_i)): Maxwell branches beside a spring. The stiffness
    that strands and walls have elsewhere is the one at once.
    """

    fractions: tuple[float, ...]  # g_i, of the stiffness at once
    times: tuple[float, ...]  # tau_i, s

    def __post_init__(self) -> None:
        if len(self.fractions) != len(self.times) or not self.times:
            raise ValueError(
                f"a relaxation needs a time for each fraction, got {len(self.fractions)} fractions "
                f"and {len(self.times)} times"
            )
        for fraction in self.fractions:
            positive(fraction, "a fraction of a relaxation", "")
        for time in self.times:
            positive(time, "a time of a relaxation", "s")
        total = math.fsum(self.fractions)
        if total >= 1.0:
            raise ValueError(
                f"fractions of a relaxation must sum to less than 1, got {total:g}: nothing would "
                "be left to hold"
            )

    def stiffness(self, seconds: float) -> float:
        """Return k(t)/k(0) some time after a stretch that is held."""
        t = finite(seconds, "a time", "s")
        return 1.0 + math.fsum(
            g * math.expm1(-t / tau) for g, tau in zip(self.fractions, self.times, strict=True)
        )

    def within(self, seconds: float) -> None:
        """Raise a `ValueError` if a time is longer than a run, in which it would not be seen."""
        if max(self.times) > seconds:
            raise ValueError(
                f"a relaxation of {max(self.times):g} s is longer than the run of {seconds:g} s, "
                "which would not show it: leave that time out, or take more or longer steps"
            )
