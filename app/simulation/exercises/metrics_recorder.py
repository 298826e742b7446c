"""What records a run's metrics and finds its errors, whatever the tissue is solved by."""

from typing import Protocol

import msgspec

from app.simulation.exercises.critical_view import Closing, CriticalView
from app.simulation.exercises.errors import Incidents
from app.simulation.inputs.inputs import Structure


class MetricsRecorder(Protocol):
    """Records a run's metrics and finds its errors, tick by tick."""

    ticks: int
    stretches: list[tuple[float, float]]
    """That are free now, mm from the first clamp."""

    @property
    def errors(self) -> Incidents:
        """The errors so far."""
        ...

    @property
    def torn(self) -> bool:
        """Whether the duct has torn."""
        ...

    @property
    def held(self) -> bool:
        """Whether a hand holds the duct."""
        ...

    @property
    def holds(self) -> int:
        """How many holds there have been; elsewhere on the duct it is another one."""
        ...

    @property
    def deflection_mm(self) -> float:
        """Of the place that is held, now."""
        ...

    @property
    def distance_to_break(self) -> float:
        """1 less the stress over the threshold, now."""
        ...

    def holding_beside(self, low: float, high: float) -> tuple[int, float] | None:
        """Return how many strands hold next to the longest free stretch, and where, mm."""
        ...

    @property
    def bleeds(self) -> bool:
        """Whether blood flows out of a tube, now."""
        ...

    def critical_view(self) -> CriticalView:
        """Return the critical view of safety now; a `ValueError` where there is none."""
        ...

    @property
    def named(self) -> frozenset[Structure]:
        """The structures that were pointed at, whether it was right or not."""
        ...

    @property
    def called_unsafe(self) -> bool:
        """Whether it was said that nothing can safely be told."""
        ...

    def closings(self) -> list[Closing]:
        """Return how far each structure that enters the gallbladder is marked and closed."""
        ...

    def start(self) -> None:
        """Start with the first input."""
        ...

    def take(self, *, moved: bool) -> None:
        """Take one tick, in which something moved or all stood still."""
        ...

    def measure(self, key: str) -> float | tuple[float, ...] | None:
        """Return one of the measures so far; None of a key that there is not."""
        ...

    def measures(self) -> msgspec.Struct:
        """Return the measures so far."""
        ...
