"""What hands act on: a specimen that is held, moved and torn tick by tick, whatever solves it."""

from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from app.simulation.exercises.exercise import Exercise
from app.simulation.inputs.hand import Hand
from app.simulation.inputs.inputs import Applied, InputKind, Instrument
from app.simulation.runs.run_file import RunStart
from app.simulation.specimen.dissection import Dissection
from app.simulation.specimen.drawn_duct import DrawnDuct
from app.simulation.specimen.specimen import Specimen
from app.simulation.tissue.planar_tissue import PlanarTissue
from app.simulation.tissue.reading import Reading, Vector
from app.simulation.tissue.spatial_tissue import SpatialTissue
from physics import RuptureCheck


class Tissue(Protocol):
    """A specimen in the state that hands act on."""

    threshold: float
    """Stress at which the wall tears, MPa."""

    @property
    def own_threshold(self) -> float:
        """The specimen's own threshold, MPa."""
        ...

    @property
    def threshold_range(self) -> tuple[float, float]:
        """Smallest and largest threshold, MPa."""
        ...

    @property
    def hands(self) -> tuple[Hand, ...]:
        """Its hands, each with its instrument, to be read only."""
        ...

    @property
    def specimen(self) -> Specimen:
        """What it is."""
        ...

    @property
    def dissection(self) -> Dissection:
        """The organ between its clamps."""
        ...

    @property
    def in_plane(self) -> PlanarTissue | None:
        """It as a theory in the plane of its pull solves it, or None."""
        ...

    @property
    def in_space(self) -> SpatialTissue | None:
        """It as beams in space, with strands or free, or None."""
        ...

    @property
    def torn(self) -> RuptureCheck | None:
        """Where and under what the wall has torn, of several tubes the first that tore, or None."""
        ...

    @property
    def over(self) -> bool:
        """Whether nothing is left whole to act on."""
        ...

    def tear_of(self, tube: int) -> RuptureCheck | None:
        """Return where and under what a tube has torn, or None."""
        ...

    @property
    def instruments(self) -> tuple[Instrument, ...]:
        """What its hands may have."""
        ...

    @property
    def moving(self) -> bool:
        """Whether the next tick will change something."""
        ...

    def prepare(self, exercise: Exercise | None) -> None:
        """Make all whole and let go, as an exercise begins, or without one."""
        ...

    def apply(
        self, hand: int, kind: InputKind, values: tuple[float, ...], begin: Callable[[], bool]
    ) -> Applied | None:
        """Apply an input; return it as it has acted, or None where it changes nothing.

        `begin` is called before what starts a run; it says whether this has started one.
        """
        ...

    def renew(self) -> list[tuple[int, Applied]]:
        """Forget what was solved before, as a run depends on its own inputs alone.

        Return the inputs of hands that are still under way, by hand.
        """
        ...

    def held_place(self, hand: int) -> Vector | None:
        """Return where a hand holds the duct, mm, or None."""
        ...

    def stop(self) -> None:
        """Leave each hand where it is."""
        ...

    def advance(self) -> bool:
        """Advance by one tick; return whether anything has moved."""
        ...

    def reading(self) -> Reading:
        """Return what the instruments show now."""
        ...

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the figures of `row`."""
        ...

    def row(self) -> tuple[float, ...]:
        """Return what the instruments show now, for a table by tick."""
        ...

    def draw(self, drawn: DrawnDuct) -> None:
        """Move the drawn surfaces."""
        ...

    def write_stress(
        self, drawn: DrawnDuct, out: NDArray[np.float32], surface: int
    ) -> NDArray[np.float32]:
        """Write the stress along the organ at each vertex of a drawn surface, MPa."""
        ...

    def start(self) -> Callable[[], RunStart]:
        """Return what makes the start of a run that begins now."""
        ...

    def goal_of(self, exercise: Exercise) -> tuple[float, float] | None:
        """Return the deflections between which an exercise's goal lies here, mm, or None."""
        ...
