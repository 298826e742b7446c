"""Replays of dissections: the same readings to the bit."""

from dataclasses import dataclass

import msgspec
import numpy as np
from numpy.typing import NDArray

from app.simulation.bed.bedded_duct import HANDS
from app.simulation.bed.run_log import (
    DissectionFile,
    DissectionInput,
    DissectionLog,
    strands_digest,
)
from app.simulation.bed.session import BedSession
from app.simulation.bed_preset import bed_named
from app.simulation.clock import TICK_SECONDS
from app.simulation.preset import preset_named
from app.simulation.replay import BaseReplay, check_organ
from app.simulation.run_log import RunFileError
from app.simulation.session import VERTICES
from organ_geometry import Organ

__all__ = ["DissectionReplay", "DissectionSeries", "dissection_csv"]

Floats = NDArray[np.float64]

COLUMNS = (
    "time_s",
    *(
        f"hand_{hand + 1}_{name}"
        for hand in range(HANDS)
        for name in (
            "along_mm",
            "sideways_mm",
            "up_mm",
            "opening_mm",
            "force_along_N",
            "force_sideways_N",
            "force_up_N",
            "held",
        )
    ),
    "freed_mm",
    "strands_parted",
    "stress_share",
    "work_mJ",
    "stored_mJ",
    "dissipated_mJ",
)


@dataclass(frozen=True, slots=True, eq=False)
class DissectionSeries:
    """What the instruments showed at each of T ticks; hands are H."""

    time: Floats  # (T,) s from the first input
    places: Floats  # (T, H, 3) of the tips, mm in the duct's frame
    openings: Floats  # (T, H) between a dissector's jaws, mm
    forces: Floats  # (T, H, 3) N
    held: NDArray[np.bool_]  # (T, H) whether each hand holds the duct
    freed: Floats  # (T,) mm
    parted: NDArray[np.int64]  # (T,) strands
    stress_share: Floats  # (T,) largest stress over the threshold
    energy: Floats  # (T, 3) work, stored and dissipated, mJ


class DissectionReplay(BaseReplay[BedSession, DissectionInput]):
    """A logged dissection in a session of its own, on the organ that it was made on.

    The session's skin has about `vertices` vertices. A `RunFileError` says that the run was made on
    another organ, or that its preset or its bed is not to be had here.
    """

    def __init__(self, log: DissectionLog, organ: Organ, *, vertices: int = VERTICES) -> None:
        check_organ(log.organ, organ)
        start = log.start
        try:
            preset, bed = start.preset, start.bed
            preset = preset_named(preset) if isinstance(preset, str) else preset
            session = BedSession(
                organ,
                msgspec.structs.replace(preset, law=start.law, stiffening=start.stiffening),
                bed_named(bed) if isinstance(bed, str) else bed,
                bed_seed=start.bed_seed,
                threshold=start.threshold_MPa,
                vertices=vertices,
                seed=log.seed,
                by_touch=start.by_touch,
            )
        except ValueError as error:
            raise RunFileError(f"the run's preset or bed: {error}") from None
        if strands_digest(session.duct.beam.strands) != start.strands_sha256:
            raise RunFileError(
                f"seed {start.bed_seed} gives other strands here than where the run was made"
            )
        if log.exercise is not None and (log.exercise.bed, log.exercise.bed_seed) != (
            start.bed,
            start.bed_seed,
        ):
            raise RunFileError("the run's exercise is of another bed than the run")
        self.log = log
        super().__init__(session, log.ticks, log.inputs)

    def run_file(self) -> DissectionFile:
        """Return the run as it has come out here, made to its end."""
        self.seek_tick(self.log.ticks)
        session = self._session
        return DissectionFile.of(self.log, session.measures(), session.run.outcome)

    def series(self) -> DissectionSeries:
        """Return what the instruments showed, tick by tick; the replay is then at its end."""
        self.seek_tick(0)
        ticks = self.log.ticks
        made = DissectionSeries(
            time=np.arange(1, ticks + 1, dtype=np.float64) * TICK_SECONDS,
            places=np.empty((ticks, HANDS, 3)),
            openings=np.empty((ticks, HANDS)),
            forces=np.empty((ticks, HANDS, 3)),
            held=np.empty((ticks, HANDS), dtype=np.bool_),
            freed=np.empty(ticks),
            parted=np.empty(ticks, dtype=np.int64),
            stress_share=np.empty(ticks),
            energy=np.empty((ticks, 3)),
        )
        for tick in range(ticks):
            self.seek_tick(tick + 1)
            reading, books = self._session.reading(), self._session.reading().books
            for hand, holder in enumerate(self._session.duct.hands):
                made.places[tick, hand] = holder.place
                made.openings[tick, hand] = holder.opening
            made.forces[tick] = reading.forces
            made.held[tick] = reading.held
            made.freed[tick], made.parted[tick] = reading.freed, reading.parted
            made.stress_share[tick] = reading.stress_share
            made.energy[tick] = books.work, books.stored, books.dissipated
        return made

    def _restart(self) -> None:
        session, exercise = self._session, self.log.exercise
        if exercise is None:
            session.reset()
        else:
            session.start_exercise(exercise, self.log.feedback)
        if self.log.tips_mm is not None:
            session.put_hands(self.log.tips_mm)

    def _give(self, each: DissectionInput) -> None:
        session, hand, value = self._session, each.hand, each.value
        if each.kind == "let-go":
            session.release(hand)
        elif isinstance(value, tuple):
            session.move_hand(hand, np.array(value))
        elif isinstance(value, str):
            session.choose_instrument(hand, value)  # pyright: ignore[reportArgumentType]
        elif value is not None:
            (session.grab if each.kind == "grab" else session.open_jaws)(hand, value)

    def _torn(self) -> bool:
        return self._session.duct.torn is not None


def dissection_csv(series: DissectionSeries) -> str:
    """Return a series as comma-separated values, its numbers to the last bit."""
    lines = [",".join(COLUMNS)]
    hands = np.concatenate([series.places, series.openings[..., None], series.forces], axis=2)
    for tick, time in enumerate(series.time):
        row = [repr(float(time))]
        for numbers, held in zip(hands[tick].tolist(), series.held[tick], strict=True):
            row += [*map(repr, numbers), str(int(held))]
        row += [repr(float(series.freed[tick])), str(int(series.parted[tick]))]
        row += [repr(float(each)) for each in (series.stress_share[tick], *series.energy[tick])]
        lines.append(",".join(row))
    return "\n".join(lines) + "\n"
