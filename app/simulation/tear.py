"""A tear under way: the two pieces, and how they are drawn while it runs and they swing back."""

import numpy as np
from numpy.typing import NDArray

from app.simulation import tear_course
from app.simulation.clock import TICK_SECONDS
from app.simulation.dissection import PIECES, Dissection
from app.simulation.reading import Phase, Surface
from physics import BreakEvent, Equilibrium

__all__ = ["Tear"]


class Tear:
    """A duct that has met the criterion.

    Parameters
    ----------
    dissection
        The organ between its clamps.
    driven
        The beam at the break, sampled at the driving points.
    event
        The load at which it broke, and the criterion there.
    edge_length
        Wanted length of the triangles' edges, mm.
    seed
        Chooses the rim's raggedness.

    Attributes
    ----------
    driven, event
        As given.
    surfaces
        The two pieces.
    """

    def __init__(
        self,
        dissection: Dissection,
        driven: Equilibrium,
        event: BreakEvent,
        *,
        edge_length: float,
        seed: int,
    ) -> None:
        self.driven, self.event = driven, event
        self._dissection = dissection
        self._pieces = dissection.torn_at(event.check, edge_length=edge_length, seed=seed)
        self._bound = [piece.skin.bound_to(dissection.driving) for piece in self._pieces]
        self._ticks = 0
        self.surfaces = tuple(
            Surface(name, piece.skin, piece.skin.vertices.copy())
            for name, piece in zip(PIECES, self._pieces, strict=True)
        )

    @property
    def _elapsed(self) -> float:
        """Time since the break, s."""
        return self._ticks * TICK_SECONDS

    @property
    def phase(self) -> Phase:
        """Whether the front still runs."""
        return Phase.TEARING if self._elapsed < tear_course.RUN_SECONDS else Phase.TORN

    @property
    def settled(self) -> bool:
        """Whether nothing moves any more."""
        return self._elapsed >= tear_course.SETTLED_SECONDS

    @property
    def front(self) -> float:
        """How far it has run (`tear_course.front`)."""
        return tear_course.front(self._elapsed)

    @property
    def carried(self) -> float:
        """Part of its stress that the duct still has: 1 at the break, 0 when it is in two."""
        return max(0.0, 1.0 - self.front)

    def advance(self) -> None:
        """Advance by one tick."""
        self._ticks += 1

    def draw(self, transforms: NDArray[np.float64]) -> None:
        """Write the pieces' vertices as they are now."""
        self._dissection.move(self.driven, transforms, part=tear_course.swing(self._elapsed))
        for surface, piece, bound in zip(self.surfaces, self._pieces, self._bound, strict=True):
            bound.deform(transforms, surface.vertices)
            piece.open(self.front, surface.vertices)
