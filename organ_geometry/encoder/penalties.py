"""What errors cost in bits, and how that is learned from one attempt to the next."""

import math
from dataclasses import dataclass, replace

_BEYOND_GROWS, _MOST_BEYOND = 2.0, 5000.0
_LEAST_MARGIN, _JUST_MISSED = 0.6, 1.1
# How an error changes with its price: many bits for little.
_STEEPNESS, _MOST_OFF = 8.0, 1.25
# So that the price sought soon lies between two that were tried.
_OVERSHOOT = 1.1
_CLOSE = 1.03


@dataclass(frozen=True, slots=True)
class Aim:
    """What errors cost, in bits; a slice's error is its mean square in squared limits.

    Attributes
    ----------
    everywhere
        Bits for an error of one.
    beyond
        Bits for the square of what an error has beyond the margin.
    margin
        Error up to which a slice is well kept.
    """

    everywhere: float
    beyond: float
    margin: float


EACH_SLICE = Aim(0.3, 300.0, 0.96)
"""To begin with where each slice is to be kept to its limit."""
NEAR = Aim(30.0, 3000.0, 0.9)
"""To come as near to all slices as the steps allow."""


class Aiming:
    """Learns from attempts what errors are to cost.

    Parameters
    ----------
    aim
        To begin with.
    together
        Whether it is the error of all slices together that decides: then it is sought at which
        price it is just kept.

    Attributes
    ----------
    aim
        For the next attempt.
    """

    def __init__(self, aim: Aim, *, together: bool = False) -> None:
        self.aim = aim
        self._together = together
        self._low = self._high = math.nan

    @property
    def settled(self) -> bool:
        """Whether the price at which all slices together are just kept is known."""
        return self._high < _CLOSE * self._low

    def learn(self, worst: float, overall: float) -> None:
        """Learn from an attempt that was made for the aim."""
        if worst > 1.0:
            margin = self.aim.margin
            if worst < _JUST_MISSED:
                margin = max(margin - (worst**2 - 1.0), _LEAST_MARGIN)
            beyond = min(_BEYOND_GROWS * self.aim.beyond, _MOST_BEYOND)
            self.aim = replace(self.aim, beyond=beyond, margin=margin)
        if not self._together:
            return
        if overall > 1.0:
            self._low = self.aim.everywhere
        else:
            self._high = self.aim.everywhere
        if math.isnan(self._low) or math.isnan(self._high):
            off = min(max(overall, 1.0 / _MOST_OFF), _MOST_OFF)
            beyond = _OVERSHOOT if overall > 1.0 else 1.0 / _OVERSHOOT
            everywhere = self.aim.everywhere * beyond * off**_STEEPNESS
        else:
            everywhere = math.sqrt(self._low * self._high)
        self.aim = replace(self.aim, everywhere=everywhere)
