"""A dissection in progress: its inputs, its measures and its exercise, tick by tick."""

from app.simulation.bed.bedded_duct import BeddedDuct
from app.simulation.bed.exercise import BedExercise, BedTrial
from app.simulation.bed.hand import INSTRUMENTS
from app.simulation.bed.measures import DissectionMeasures, DissectionMeasureTaker
from app.simulation.bed.run_log import (
    KINDS,
    DissectionInput,
    DissectionInputKind,
    DissectionLog,
    DissectionStart,
    strands_digest,
)
from app.simulation.bed_preset import named_or_whole
from app.simulation.clock import TICK_SECONDS
from app.simulation.exercise import Feedback
from app.simulation.run import BaseRun
from app.simulation.run_log import OrganIdentity
from app.versions import versions

__all__ = ["DissectionRun"]

LAST_COUNTS = frozenset({"move", "jaws"})
"""Inputs of which only the last between two ticks has an effect: it replaces the one before."""


class DissectionRun(BaseRun[BedExercise, BeddedDuct, DissectionMeasureTaker]):
    """One dissection: it starts with the first input and is over with the tear or the exercise."""

    def __init__(
        self, exercise: BedExercise | None = None, feedback: Feedback = Feedback.CONTINUOUS
    ) -> None:
        taker = DissectionMeasureTaker()
        trial = None if exercise is None else BedTrial(exercise, taker)
        super().__init__(taker, exercise, feedback, trial)
        self._tips: tuple[tuple[float, float, float], ...] = ()

    def start(self, point: BeddedDuct, *, by_touch: bool = True) -> None:
        """Start the clock, with the first input."""
        super().start(point)
        tips = (hand.place.tolist() for hand in point.hands)
        self._tips = tuple((x, y, z) for x, y, z in tips)
        self._taker.start(point, by_touch=by_touch)

    def note(self, hand: int, kind: DissectionInputKind, *values: float) -> None:
        """Log an input; ignored before the start and once the run is over."""
        row = (*values, 0.0, 0.0, 0.0)[:3]
        self._note(len(KINDS) * hand + KINDS.index(kind), *row, replaces=kind in LAST_COUNTS)

    def take(self, *, moved: bool) -> None:
        """Take one tick; ignored before the start and once the run is over."""
        if not self.going:
            return
        duct = self._start
        assert duct is not None  # noqa: S101 (it is going)
        self._taker.take(moved=moved)
        if self._trial is not None:
            self._trial.take(duct)
        self._end(torn=duct.torn is not None)

    def measures(self) -> DissectionMeasures:
        """Return the measures so far; a `ValueError` before the start."""
        self._started_on()
        return self._taker.measures()

    def log(self, organ: OrganIdentity, seed: int) -> DissectionLog:
        """Return the log so far."""
        duct = self._started_on()
        preset = duct.dissection.preset
        return DissectionLog(
            versions=versions(),
            organ=organ,
            start=DissectionStart(
                preset=preset.name if preset.ships else preset,
                bed=named_or_whole(duct.bed),
                bed_seed=duct.seed,
                threshold_MPa=duct.threshold,
                strands_sha256=strands_digest(duct.beam.strands),
                by_touch=self._taker.by_touch,
                law=preset.law,
                stiffening=preset.stiffening,
            ),
            seed=seed,
            tick_seconds=TICK_SECONDS,
            ticks=self.ticks,
            inputs=[self._input(i) for i in range(self.inputs)],
            exercise=self.exercise,
            feedback=self.feedback,
            tips_mm=self._tips,
        )

    def _started_on(self) -> BeddedDuct:
        if self._start is None:
            raise ValueError("a run starts with the first input; there has been none")
        return self._start

    def _input(self, i: int) -> DissectionInput:
        hand, number = divmod(self._kinds[i], len(KINDS))
        kind = KINDS[number]
        x, y, z = self._values[3 * i : 3 * i + 3]
        value: str | float | tuple[float, float, float] | None = x
        if kind == "let-go":
            value = None
        elif kind == "instrument":
            value = INSTRUMENTS[int(x)]
        elif kind == "move":
            value = (x, y, z)
        return DissectionInput(self._ticks[i], hand, kind, value)
