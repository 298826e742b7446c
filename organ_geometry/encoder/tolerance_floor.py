"""The smallest tolerance that can be kept, named where one is refused."""

import math
from collections.abc import Callable

_RAISE, _RAISES_GROW, _HALVINGS, _NEAR_ENOUGH = 1.05, 1.5, 5, 1.04


class ToleranceTooSmall(ValueError):  # noqa: N818
    """A tolerance below what half-curves and pixels allow.

    Attributes
    ----------
    smallest_mm
        A tolerance near the smallest that was kept, mm.
    """

    def __init__(self, message: str, smallest_mm: float) -> None:
        super().__init__(message)
        self.smallest_mm = smallest_mm


def smallest_kept(kept: Callable[[float], bool], refused: float, nearest: float) -> float:
    """Return a tolerance that is kept, near the smallest, in four digits."""
    largest, more = _four_digits(nearest), _RAISE
    while not kept(largest):
        refused, largest = largest, _four_digits(largest * more)
        more **= _RAISES_GROW
    for _ in range(_HALVINGS):
        if largest <= refused * _NEAR_ENOUGH:
            break
        middle = _four_digits(math.sqrt(max(refused, 0.5 * largest) * largest))
        if kept(middle):
            largest = middle
        else:
            refused = middle
    return largest


def _four_digits(length: float) -> float:
    """Return a length rounded up to four digits, as a message prints it."""
    digit = 10.0 ** (math.floor(math.log10(length)) - 3)
    return float(f"{math.ceil(length / digit) * digit:.4g}")
