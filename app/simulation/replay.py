"""Replays: a logged run computed again from its inputs, with the same readings to the bit."""

import math
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.simulation.exercises.errors import Incident
from app.simulation.inputs.clock import TICK_SECONDS, TICKS_PER_SECOND
from app.simulation.runs.run_file import RunFile, RunLog
from app.simulation.session.measures import RATE_SECONDS, RATE_TICKS
from app.simulation.session.session import Session
from app.simulation.specimen.tear import SETTLED_SECONDS
from organ_geometry import Organ

AFTER_TEAR = math.ceil(SETTLED_SECONDS * TICKS_PER_SECOND) + 1
"""Ticks after a tear in which the pieces come to rest: replayed, but not part of the run."""
FEW = 300
"""Vertices of the skin of a duct that is replayed for its numbers only."""


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """What the instruments showed at each of T ticks."""

    columns: tuple[str, ...]  # names with units
    rows: Sequence[tuple[float, ...]]  # T rows; what counts or is yes or no as whole numbers

    def __getitem__(self, column: str) -> NDArray[np.float64]:
        """Return one (T,) column."""
        i = self.columns.index(column)
        return np.array([row[i] for row in self.rows], dtype=np.float64)

    def csv(self) -> str:
        """Return it as comma-separated values, its numbers to the last bit."""
        lines = [",".join(self.columns), *(",".join(map(repr, row)) for row in self.rows)]
        return "\n".join(lines) + "\n"


class Replay:
    """A logged run in a session of its own, on the organ that it was made on.

    The session's skin has about `vertices` vertices. A `RunFileError` says that the run was made on
    another organ, or that its preset, bed or theory is not available. What is asked of a replay
    leaves it where it is. `tore` says whether something tears in the run, where that is known: else
    its length is known once it was gone through.
    """

    def __init__(
        self, log: RunLog, organ: Organ, *, vertices: int = FEW, tore: bool | None = None
    ) -> None:
        self.log = log
        self._session = Session.of_log(log, organ, vertices)
        self._tore = tore
        self._ended: tuple[RunFile, list[Incident]] | None = None
        self._restart()

    @property
    def session(self) -> Session:
        """The session that is taken through the run; to be read only."""
        return self._session

    @property
    def time(self) -> float:
        """Where the replay is, s from the first input."""
        return self._at * TICK_SECONDS

    @property
    def duration(self) -> float:
        """Length of the replay, s: the run and the recoil of the torn pieces."""
        return self.ticks * TICK_SECONDS

    @property
    def ticks(self) -> int:
        """The same in ticks."""
        if self._tore is None:
            with self._aside():
                self.seek_tick(self.log.ticks)
        return self.log.ticks + (AFTER_TEAR if self._tore else 0)

    def seek(self, seconds: float) -> None:
        """Go to a time, s; an earlier one is reached by starting again."""
        self.seek_tick(round(min(max(seconds, 0.0), 1e9) * TICKS_PER_SECOND))

    def seek_tick(self, tick: int) -> None:
        """Go to a tick."""
        last = self.log.ticks
        if tick < self._at:
            self._restart()
        while self._at < min(tick, last):
            self._take_inputs()
            due = min(tick, last, self._next_tick())
            self._session.advance(due - self._at)
            self._at = due
        if self._at >= last:
            self._take_inputs()
            self._session.finish()
            if self._ended is None:  # the same each time that it comes here
                session = self._session
                self._tore = session.tissue.torn is not None
                file = RunFile.of(self.log, session.metrics(), session.run.outcome)
                self._ended = file, session.run.incidents()
            rest = min(tick, self.ticks) - self._at
            if rest > 0:
                self._session.advance(rest)
                self._at += rest

    def run_file(self) -> RunFile:
        """Return the run as it comes out here."""
        return self._end()[0]

    def incidents(self) -> list[Incident]:
        """Return the errors that were made in the run, in order."""
        return self._end()[1]

    def series(self, look: Callable[[int], object] = lambda _: None) -> Series:
        """Return what the instruments showed, tick by tick; `look` is called after each tick."""
        rows: list[tuple[float, ...]] = []
        with self._aside():
            self.seek_tick(0)
            for tick in range(1, self.log.ticks + 1):
                self.seek_tick(tick)
                rows.append((tick * TICK_SECONDS, *self._session.tissue.row()))
                look(tick)
        return Series(("time_s", *self._session.tissue.columns), rows)

    def _restart(self) -> None:
        """Begin again, with what was in hand and seen at the run's first moment."""
        self._session.restart(self.log)
        self._at = self._next = 0
        self._take_inputs()

    def _end(self) -> tuple[RunFile, list[Incident]]:
        if self._ended is None:
            with self._aside():
                self.seek_tick(self.log.ticks)
        assert self._ended is not None  # noqa: S101 (just been there)
        return self._ended

    @contextmanager
    def _aside(self) -> Generator[None]:
        """Go elsewhere, and come back."""
        at = self._at
        try:
            yield
        finally:
            self.seek_tick(at)

    def _next_tick(self) -> int:
        """Return the tick before which the next input comes."""
        inputs = self.log.inputs
        return inputs[self._next].tick if self._next < len(inputs) else self.log.ticks

    def _take_inputs(self) -> None:
        inputs = self.log.inputs
        while self._next < len(inputs) and inputs[self._next].tick <= self._at:
            self._session.apply(inputs[self._next])
            self._next += 1


def loading_rates(series: Series) -> NDArray[np.float64]:
    """Return (T,) loading rates of a pull, N/s over `RATE_SECONDS` of a hold; 0 without a hold."""
    force, held = np.abs(series["force_N"]), series["held"] > 0.0
    ticks = np.arange(len(force))
    # The first tick of the hold that a tick belongs to; a regrasp goes on with the same hold here.
    first = np.maximum.accumulate(np.where(held & ~np.append(False, held[:-1]), ticks, 0))
    before = np.maximum(ticks - RATE_TICKS, first)
    return np.where(held, (force - force[before]) / RATE_SECONDS, 0.0)
