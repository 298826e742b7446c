"""The result of timing one engine."""

import math
from dataclasses import dataclass

# Relative error of the deflection beyond which an engine solves another problem.
TOLERATED = 0.01


@dataclass(frozen=True, slots=True)
class Engine:
    """An engine, or a way to call one, and its time for a warm solve."""

    key: str  # Its name in the figures: `<key>_us`
    title: str  # What was solved, and how
    time: float | None  # Time of a solve, us; None if there is none
    # Deflection over the converged one of the same law, less 1; None if there is none.
    error: float | None = None
    note: str = ""  # Why there is no time

    def checked(self) -> "Engine":
        """Return this engine, without its time if it does not reach the right deflection."""
        if self.error is None or (math.isfinite(self.error) and abs(self.error) < TOLERATED):
            return self
        note = f"{self.title}: the deflection is {100.0 * self.error:+.2g} % off, so it has no time"
        return Engine(self.key, self.title, None, self.error, note)


def unavailable(key: str, name: str, failure: Exception) -> Engine:
    """Return a peer that cannot be run here."""
    if isinstance(failure, ModuleNotFoundError):
        return Engine(key, name, None, None, f"{name} is not installed: pip install .[bench]")
    cause = failure
    while cause.__context__ is not None and isinstance(cause.__context__, Exception):
        cause = cause.__context__
    return Engine(key, name, None, None, f"{name} does not run here: {cause}")
