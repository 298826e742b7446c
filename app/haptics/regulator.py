"""What stands between a model's force and a hand: passivity, limits, a soft start.

The device holds a force for a period, so that the work of a hand over it is -f . dx exactly, with
the force that was given and the way that was gone. Against that stands what the model has stored
and spent. What is missing has been made by sampling: E = stored + spent - work > 0. The controller
takes it out again by a damper, alpha = E / (v^2 tau), bounded by what the device can bear
(time-domain passivity, Hannaford and Ryu 2002, IEEE Trans. Robot. Autom. 18:1, with the model's own
energy as the reference that is followed, Ryu et al. 2005). Then the force is bounded, and its
change.

Books, in N mm, of all hands together: the work is that on the model, what holding its force for a
period loses, and what the damper and the bounds take.
"""

import math

import numpy as np
from numpy.typing import NDArray

from kernel_cache import njit

__all__ = [
    "ALLOWED", "BRAKED", "LEAST", "MADE", "MODELLED", "SAMPLED", "WITHHELD", "WORK", "Regulator",
]  # fmt: skip

Array = NDArray[np.float64]

WORK, MODELLED, SAMPLED, BRAKED, WITHHELD, MADE, LEAST, ALLOWED = range(8)
"""Entries of the books: work of the hands; that on the model, what holding its force for a period
loses, what the damper and the bounds take; energy that was made, now; the least margin so far
between what hands put in and what they got; what a start under tension allows."""

SOFT_SECONDS = 0.3
"""Time in which the force comes, after a start or after states were missing."""
TOLERANCE = 1e-3
"""Energy, N mm, that is left alone: 1 uJ."""
DRAIN_SECONDS = 0.02
"""tau: time over which energy that was made is taken out. Within one period it would be a knock."""
SLOWEST = 1e-4
"""Speed, m/s, below which nothing can be damped."""


@njit(cache=True, nogil=True)
def _regulate(
    places: Array,
    model: Array,
    modelled: float,
    energy: float,
    live: bool,
    memory: Array,
    given: Array,
    books: Array,
    figures: Array,
) -> None:
    """Book the last period's work and find the forces of the next; see the module's docstring."""
    period, most, slew, added, soft = figures[0], figures[1], figures[2], figures[3], figures[4]
    hands = places.shape[0]
    last, old_model, old_brake, old_rest = memory[0], memory[1], memory[2], memory[3]
    for h in range(hands):
        for j in range(3):
            way = 1e3 * (places[h, j] - last[h, j])
            books[WORK] -= given[h, j] * way
            books[SAMPLED] -= old_model[h, j] * way
            books[BRAKED] -= old_brake[h, j] * way
            books[WITHHELD] -= old_rest[h, j] * way
    books[MODELLED] += modelled
    books[SAMPLED] -= modelled
    made = energy - books[WORK] - books[ALLOWED]
    if not live:
        figures[5] = 0.0
    gain = min(figures[5], 1.0)
    if gain == 0.0:
        # What the model holds as the force comes, no hand has given; it is allowed for once.
        books[ALLOWED] += max(made, 0.0)
        made = min(made, 0.0)
    books[MADE] = made
    books[LEAST] = min(books[LEAST], books[WORK])
    for h in range(hands):
        speed2 = 0.0
        for j in range(3):
            v = (places[h, j] - last[h, j]) / period
            speed2 += v * v
        alpha = 0.0
        if made > TOLERANCE and speed2 > SLOWEST * SLOWEST:
            alpha = min(1e-3 * made / (speed2 * DRAIN_SECONDS), added)
        size = change = 0.0
        for j in range(3):
            v = (places[h, j] - last[h, j]) / period
            brake = -alpha * v if live else 0.0
            wanted = gain * model[h, j] + brake if live else 0.0
            old_brake[h, j] = brake
            old_rest[h, j] = wanted
            size += wanted * wanted
        shrink = most / math.sqrt(size) if size > most * most else 1.0
        for j in range(3):
            difference = shrink * old_rest[h, j] - given[h, j]
            change += difference * difference
        part = slew / math.sqrt(change) if change > slew * slew and live else 1.0
        for j in range(3):
            given[h, j] += part * (shrink * old_rest[h, j] - given[h, j])
            old_rest[h, j] = given[h, j] - model[h, j] - old_brake[h, j]
            old_model[h, j] = model[h, j]
            last[h, j] = places[h, j]
    figures[5] += period / soft


class Regulator:
    """The regulator of one or more hands on one model.

    Parameters
    ----------
    hands
        How many.
    period
        Of the servo, s.
    force, force_rate
        Bounds of each force, N and N/s.
    added_damping
        Bound of the damper, N s/m.
    soft_seconds
        Time in which the force comes, s.

    Attributes
    ----------
    given
        (H, 3) forces for the devices, N.
    books
        (8,) energies, N mm.
    """

    def __init__(
        self,
        hands: int,
        period: float,
        *,
        force: float,
        force_rate: float,
        added_damping: float,
        soft_seconds: float = SOFT_SECONDS,
    ) -> None:
        self.given = np.zeros((hands, 3))
        self.books = np.zeros(8)
        self._figures = np.array(
            [period, force, force_rate * period, added_damping, max(soft_seconds, period), 0.0]
        )
        self._memory = np.zeros((4, hands, 3))
        still = np.zeros((hands, 3))
        self.regulate(still, still, 0.0, 0.0, False)  # compiled before it is felt

    def start(self, places: NDArray[np.float64]) -> None:
        """Begin where the hands are."""
        self._memory[0] = places

    def regulate(
        self,
        places: NDArray[np.float64],
        model: NDArray[np.float64],
        modelled: float,
        energy: float,
        live: bool,
    ) -> None:
        """Find the forces for the next period."""
        _regulate(
            places, model, modelled, energy, live,
            self._memory, self.given, self.books, self._figures,
        )  # fmt: skip
