"""Replays: a logged run computed again from its inputs, with the same readings to the bit."""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from app.simulation.clock import TICK_SECONDS, TICKS_PER_SECOND
from app.simulation.measures import RATE_SECONDS, RATE_TICKS
from app.simulation.preset import preset_named
from app.simulation.run_log import (
    OrganIdentity,
    RunFile,
    RunFileError,
    RunInput,
    RunLog,
    TheoryChoice,
    TimedInput,
)
from app.simulation.session import VERTICES, Session
from app.simulation.tear import SETTLED_SECONDS, Phase
from organ_geometry import Organ

__all__ = [
    "AFTER_TEAR",
    "BaseReplay",
    "Replay",
    "Series",
    "check_organ",
    "loading_rates",
    "series_csv",
]

AFTER_TEAR = math.ceil(SETTLED_SECONDS * TICKS_PER_SECOND) + 1
"""Ticks after a tear in which the pieces come to rest: replayed, but not part of the run."""


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """What the instruments showed at each of T ticks."""

    time: NDArray[np.float64]  # (T,) s from the first pull
    force: NDArray[np.float64]  # (T,) N
    deflection: NDArray[np.float64]  # (T,) mm
    stress: NDArray[np.float64]  # (T,) highest normal plus bending stress, MPa
    distance_to_break: NDArray[np.float64]  # (T,) 1 at rest, 0 at the break
    # (T, 3) axis at the grasp, mm along the clamps, lateral, along the pull
    hook: NDArray[np.float64]
    held: NDArray[np.bool_]  # (T,) whether the grasper held the duct
    phase: tuple[Phase, ...]  # T phases

    HEADER: ClassVar[str] = (
        "time_s,force_N,deflection_mm,stress_MPa,distance_to_break,"
        "hook_along_mm,hook_sideways_mm,hook_pull_mm,held,phase"
    )


class Advancing(Protocol):
    """A session that a replay takes through a run."""

    def advance(self, ticks: int = 1) -> bool:
        """Advance by some ticks."""
        ...

    def finish(self) -> None:
        """End the run."""
        ...


SessionT = TypeVar("SessionT", bound=Advancing)
InputT = TypeVar("InputT", bound=TimedInput)


class BaseReplay(ABC, Generic[SessionT, InputT]):
    """A session that is taken through the inputs of a logged run, of a pull or a dissection."""

    def __init__(self, session: SessionT, run_ticks: int, inputs: Sequence[InputT]) -> None:
        self._session, self._run_ticks, self._inputs = session, run_ticks, inputs
        self._at = self._next = 0
        self._tore: bool | None = None
        self._restart()

    @property
    def session(self) -> SessionT:
        """The session that is taken through the run; to be read only."""
        return self._session

    @property
    def time(self) -> float:
        """Where the replay is, s from the first pull."""
        return self._at * TICK_SECONDS

    @property
    def duration(self) -> float:
        """Length of the replay, s: the run and the recoil of the torn pieces."""
        return self.ticks * TICK_SECONDS

    @property
    def ticks(self) -> int:
        """The same in ticks."""
        if self._tore is None:
            at = self._at
            self.seek_tick(self._run_ticks)
            self.seek_tick(at)
        return self._run_ticks + (AFTER_TEAR if self._tore else 0)

    def seek(self, seconds: float) -> None:
        """Go to a time, s; an earlier one is reached by starting again."""
        self.seek_tick(round(min(max(seconds, 0.0), 1e9) * TICKS_PER_SECOND))

    def seek_tick(self, tick: int) -> None:
        """Go to a tick."""
        if tick < self._at:
            self._restart()
            self._at = self._next = 0
        while self._at < min(tick, self._run_ticks):
            self._take_inputs()
            due = min(tick, self._run_ticks, self._next_tick())
            self._session.advance(due - self._at)
            self._at = due
        if self._at >= self._run_ticks:
            self._take_inputs()
            self._session.finish()
            if self._tore is None:
                self._tore = self._torn()
            rest = min(tick, self.ticks) - self._at
            if rest > 0:
                self._session.advance(rest)
                self._at += rest

    @abstractmethod
    def _restart(self) -> None:
        """Set the session to where the run starts."""
        ...

    @abstractmethod
    def _give(self, each: InputT) -> None: ...

    @abstractmethod
    def _torn(self) -> bool: ...

    def _next_tick(self) -> int:
        """Return the tick before which the next input comes."""
        inputs = self._inputs
        return inputs[self._next].tick if self._next < len(inputs) else self._run_ticks

    def _take_inputs(self) -> None:
        inputs = self._inputs
        while self._next < len(inputs) and inputs[self._next].tick <= self._at:
            self._give(inputs[self._next])
            self._next += 1


class Replay(BaseReplay[Session, RunInput]):
    """A logged run in a session of its own, on the organ that it was made on.

    The session's skin has about `vertices` vertices. A `RunFileError` says that the run was made on
    another organ, or that its preset or theory is not available.
    """

    def __init__(self, log: RunLog, organ: Organ, *, vertices: int = VERTICES) -> None:
        check_organ(log.organ, organ)
        preset = log.start.preset
        try:
            if isinstance(preset, str):
                preset = preset_named(preset)
            session = Session(organ, preset, vertices=vertices, seed=log.seed)
        except ValueError as error:
            raise RunFileError(f"the run's preset: {error}") from None
        self.log = log
        super().__init__(session, log.ticks, log.inputs)

    def run_file(self) -> RunFile:
        """Return the run as it has come out here, made to its end."""
        self.seek_tick(self.log.ticks)
        return RunFile.of(self.log, self._session.measures(), self._session.run.outcome)

    def series(self) -> Series:
        """Return what the instruments showed, tick by tick; the replay is then at its end."""
        self.seek_tick(0)
        rows = np.empty((self.log.ticks, 7))
        held = np.empty(self.log.ticks, dtype=np.bool_)
        phases: list[Phase] = []
        for tick in range(self.log.ticks):
            self.seek_tick(tick + 1)
            reading = self._session.reading()
            check = reading.check
            rows[tick, :4] = (
                reading.force,
                reading.deflection,
                check.total_stress,
                check.distance_to_break,
            )
            rows[tick, 4:] = reading.hook
            held[tick] = reading.held
            phases.append(reading.phase)
        return Series(
            time=np.arange(1, self.log.ticks + 1, dtype=np.float64) * TICK_SECONDS,
            force=rows[:, 0],
            deflection=rows[:, 1],
            stress=rows[:, 2],
            distance_to_break=rows[:, 3],
            hook=rows[:, 4:],
            held=held,
            phase=tuple(phases),
        )

    def _restart(self) -> None:
        session, log = self._session, self.log
        session.reset()
        try:
            theory = log.start.theory.theory()
            if session.duct.theory != theory:
                session.choose_theory(theory)
        except ValueError as error:
            raise RunFileError(f"the run's theory: {error}") from None
        session.set_grasp(log.start.grasp_mm)
        session.set_threshold(log.start.threshold_MPa)
        duct = session.duct
        if (duct.grasp, duct.threshold) != (log.start.grasp_mm, log.start.threshold_MPa):
            raise RunFileError(
                f"the run's grasp of {log.start.grasp_mm:g} mm or threshold of "
                f"{log.start.threshold_MPa:g} MPa is out of this duct's range"
            )
        if log.exercise is not None:
            session.start_exercise(log.exercise, log.feedback, inputs=log.exercise_inputs)
        session.advance()  # settle first: the run starts from a duct at rest, already drawn

    def _give(self, each: RunInput) -> None:
        session, value = self._session, each.value
        if each.kind == "let-go":
            session.release()
        elif isinstance(value, TheoryChoice):
            session.choose_theory(value.theory())
        elif value is not None:
            {
                "force": session.set_target_force,
                "grab": session.grab,
                "hand": session.move_hand,
                "grasp": session.set_grasp,
                "threshold": session.set_threshold,
            }[each.kind](value)

    def _torn(self) -> bool:
        return self._session.reading().phase is not Phase.INTACT


def loading_rates(series: Series) -> NDArray[np.float64]:
    """Return (T,) loading rates, N/s over `RATE_SECONDS` of a hold; 0 without a hold."""
    force, held = np.abs(series.force), series.held
    ticks = np.arange(len(force))
    # The first tick of the hold that a tick belongs to; a regrasp goes on with the same hold here.
    first = np.maximum.accumulate(np.where(held & ~np.append(False, held[:-1]), ticks, 0))
    before = np.maximum(ticks - RATE_TICKS, first)
    return np.where(held, (force - force[before]) / RATE_SECONDS, 0.0)


def series_csv(series: Series) -> str:
    """Return a series as comma-separated values, its numbers to the last bit."""
    lines = [Series.HEADER]
    columns = (series.time, series.force, series.deflection, series.stress)
    table = np.column_stack([*columns, series.distance_to_break, series.hook])
    for row, held, phase in zip(table.tolist(), series.held, series.phase, strict=True):
        lines.append(",".join([*map(repr, row), str(int(held)), phase.value]))
    return "\n".join(lines) + "\n"


def check_organ(wanted: OrganIdentity, organ: Organ) -> None:
    """Raise if a run was made on another organ."""
    identity = OrganIdentity.of(organ)
    if identity.sha256 != wanted.sha256:
        raise RunFileError(
            f"this run was made on another organ, {_named(wanted)}; this one is {_named(identity)}"
        )


def _named(organ: OrganIdentity) -> str:
    return f"{organ.name or 'unnamed'} ({organ.length_mm:.1f} mm, sha256 {organ.sha256[:12]})"
