"""What lies between the open blades of scissors, and is cut as they close.

Two blades go from their tips back along the shaft and part across it: what crosses the rectangle
between them is cut. A strand that a blade has pushed aside from its outer side goes round that.

    a = (x - tip) . u   mm, back along the shaft u
    w = (x - tip) . s   mm, along s, in which the blades part
    n = (x - tip) . (u x s)   mm, off their plane
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.simulation.tissue.reached_tube import fine_axis
from physics import DEEPEST
from physics.bed import BeamOnBed

Floats = NDArray[np.float64]

BLADES_MM = 15.0
"""Length of the blades, as they are drawn."""
LEAST_SINE = 0.5
"""Least sine of the angle between a tube and the blades' plane: below, they push it aside."""
DENTED = 0.1
"""Part of a tube's width that blades may overlap and only push its wall aside."""


class Between(NamedTuple):
    """A tube between blades."""

    tube: int
    station: float  # mm on the beam
    depth: float  # of its width that is between them, up to 1
    width: float  # mm
    side: Floats  # (3,) mm, from its axis to the middle of what they cut

    @property
    def whole(self) -> bool:
        """Whether they cut it through."""
        return self.depth >= DEEPEST


class Blades(NamedTuple):
    """Open blades of scissors."""

    tip: Floats  # (3,) mm, in the middle between their ends
    shaft: Floats  # (3,) u
    spread: Floats  # (3,) s
    opening: float  # mm

    @property
    def _normal(self) -> Floats:
        return np.cross(self.shaft, self.spread)

    def seen(self, places: Floats) -> tuple[Floats, Floats, Floats]:
        """Return a, w and n of some places, (S, 3) mm, each (S,)."""
        along, aside, away = (
            ((places - self.tip) * each).sum(axis=1)
            for each in (self.shaft, self.spread, self._normal)
        )
        return along, aside, away

    def crossing(self, ends: Floats, feet: Floats) -> tuple[NDArray[np.bool_], Floats]:
        """Return which strands, from (S, 3) to (S, 3) mm, cross their plane beside them; and w."""
        first, last = self.seen(ends)[2], self.seen(feet)[2]
        apart = first - last
        part = np.divide(first, apart, out=np.zeros(apart.size), where=apart != 0.0)
        along, aside, _ = self.seen(ends + part[:, None] * (feet - ends))
        return (first * last < 0.0) & (along > 0.0) & (along < BLADES_MM), aside

    def strands(self, beam: BeamOnBed, rods: tuple[int, ...]) -> NDArray[np.bool_]:
        """Return which strands of a beam, (S,), are between them, which are two of its rods."""
        ends, feet = beam.strand_ends(), beam.strand_feet()
        crosses, aside = self.crossing(ends, feet)
        # Of the first blade the inner side is where u . (a x b) has the sign of n at the foot.
        sign = np.where(((ends - feet) * self._normal).sum(axis=1) > 0.0, -1, 1)
        one, other = (beam.sides_of(each) for each in rods)
        inside, outside = ((one * sign == each) | (other * sign == -each) for each in (1, -1))
        between = (np.abs(aside) < 0.5 * self.opening) | inside
        return crosses & between & ~outside

    def tubes(self, beam: BeamOnBed) -> list[Between]:
        """Return the tubes of a beam that are between them, with all of their width or a part."""
        half, out = 0.5 * self.opening, list[Between]()
        for number, (name, tube) in enumerate(beam.network.tubes.items()):
            fine, axis = fine_axis(beam, name)
            radius = np.interp(fine, tube.stations, tube.radius)
            along, aside, away = self.seen(axis)
            # What lies beside them is pushed aside; of what crosses their plane, how much of the
            # width is covered, back along the blades and from one to the other?
            steep = np.abs(np.diff(away)) >= LEAST_SINE * np.sqrt(
                (np.diff(axis, axis=0) ** 2).sum(axis=1)
            )
            through = np.flatnonzero((away[:-1] * away[1:] <= 0.0) & steep)
            if not through.size:
                continue
            covered = [
                (np.maximum(at - radius, low), np.minimum(at + radius, high))
                for at, low, high in ((along, 0.0, BLADES_MM), (aside, -half, half))
            ]
            part = np.min([high - low for low, high in covered], axis=0) / (2.0 * radius)
            at = int(through[part[through].argmax()])
            if part[at] > DENTED:
                (back, on), (left, right) = ((low[at], high[at]) for low, high in covered)
                side = (0.5 * (back + on) - along[at]) * self.shaft
                side = side + (0.5 * (left + right) - aside[at]) * self.spread
                width = 2.0 * float(radius[at])
                out.append(Between(number, float(fine[at]), float(part[at]), width, side))
        return out
