"""The state that a policy observes, in one row that is held within its bounds at once."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kernel_cache import SameTypes, kernel
from physics.bed import BeamOnBed

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]


class StateRow:
    """A row of numbers: those of the hands, of the duct's nodes, of its strands, and others.

    Parameters
    ----------
    bounds
        Smallest and largest numbers by key, in this order.
    """

    def __init__(self, bounds: Mapping[str, tuple[NDArray[Any], NDArray[Any]]]) -> None:
        self._low, self._high = (
            np.concatenate([each[end].ravel() for each in bounds.values()]) for end in range(2)
        )
        self._row, self._parts, first = self._low.copy(), dict[str, Singles](), 0
        for key, (low, _) in bounds.items():
            self._parts[key] = self._row[first : first + low.size].reshape(low.shape)
            first += low.size

    def write(
        self,
        out: Mapping[str, NDArray[Any]],
        hands: Sequence[float],
        beam: BeamOnBed,
        parted: Floats,
        others: Sequence[float],
        *,
        lost: bool,
    ) -> None:
        """Write it to arrays by key; of a duct that is lost there may be numbers that are none."""
        _WRITE(
            self._row, self._low, self._high, np.array([*hands, *others], dtype=np.float64),
            len(hands), beam.places, beam.rest_places, parted, lost,
        )  # fmt: skip
        for key, each in self._parts.items():
            out[key][:] = each


@kernel()
def _write(
    row: Singles, low: Singles, high: Singles, numbers: Floats, first: int, places: Floats,
    rest: Floats, parted: Floats, lost: bool,
) -> None:  # fmt: skip
    """Write numbers, how far nodes have moved, which strands hold, and the other numbers."""
    for i in range(first):
        row[i] = numbers[i]
    at = first
    for n in range(places.shape[0]):
        for r in range(3):
            row[at] = places[n, r] - rest[n, r]
            at += 1
    for i in range(parted.size):
        row[at] = 1.0 - parted[i]
        at += 1
    for i in range(first, numbers.size):
        row[at] = numbers[i]
        at += 1
    for i in range(row.size):
        if lost and np.isnan(row[i]):
            row[i] = 0.0
        row[i] = low[i] if row[i] < low[i] else high[i] if row[i] > high[i] else row[i]


_WRITE = SameTypes(_write)
