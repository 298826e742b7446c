"""Run logs: the inputs of a run and all else that a replay to the bit needs."""

import hashlib
import math
from collections.abc import Sequence
from typing import Literal, Protocol, TypeVar, cast

import msgspec
import numpy as np

from app.bounded_file import decoded
from app.simulation.clock import TICK_SECONDS
from app.simulation.exercise import Exercise, ExerciseInputs, Feedback, Outcome
from app.simulation.measures import Measures
from app.simulation.preset import Preset
from organ_geometry import Organ
from physics import Cubic, Exact, Exponential, Theory, theory_named
from physics.theory import LawName

__all__ = [
    "MOST_INPUTS",
    "MOST_TICKS",
    "InputKind",
    "OrganIdentity",
    "RunFile",
    "RunFileError",
    "RunInput",
    "RunLog",
    "RunStart",
    "TheoryChoice",
    "TimedInput",
    "check_course",
    "decoded_run",
    "read_run",
    "run_json",
    "run_version",
    "same_figures",
]

FORMAT: Literal["bluntdissect-run"] = "bluntdissect-run"
VERSION = 2
# Files of version 1 have no rate of loading, no overshoot and no `exercise_inputs`. Version 3 is
# that of a dissection (app.simulation.bed).
READ_VERSIONS = (1, VERSION)
MOST_TICKS = 2 * 60 * 60 * 30
"""Two hours of ticks, far beyond any training on one duct."""
MOST_INPUTS = 200_000
MOST_BYTES = 16_000_000

InputKind = Literal["force", "grab", "hand", "let-go", "grasp", "threshold", "theory"]


FileT = TypeVar("FileT")


class RunFileError(ValueError):
    """A file that is not a run, or a run that cannot be replayed here."""


class OrganIdentity(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Which organ a run was made on."""

    name: str
    length_mm: float
    sha256: str  # digest of its axis, frames and curves

    @classmethod
    def of(cls, organ: Organ) -> "OrganIdentity":
        """Return the identity, which is the same for equal geometry but for the name."""
        digest = hashlib.sha256()
        for array in (organ.axis, organ.frames, organ.keys, organ.outer, organ.lumen):
            if array is not None:
                digest.update(repr(array.shape).encode())
                digest.update(np.ascontiguousarray(array, dtype="<f8").tobytes())
        return cls(organ.name, organ.length, digest.hexdigest())


class TheoryChoice(msgspec.Struct, frozen=True, omit_defaults=True):
    """A theory by its name and options, as `theory_named` takes them."""

    name: str
    q: float | Literal["fitted"] | None = None  # of the cubic
    shear: bool = False  # of the exact beam
    law: LawName | None = None  # of the exact beam
    stiffening: float | None = None  # of the exponential law

    @classmethod
    def of(cls, theory: Theory) -> "TheoryChoice":
        """Return the choice that stands for a theory; raise if it has no name."""
        if isinstance(theory, Cubic):
            choice = cls(theory.name, q=theory.q)
        elif isinstance(theory, Exact):
            law = theory.law
            stiffening = law.stiffening if isinstance(law, Exponential) else None
            choice = cls(theory.name, shear=law.shear, law=law.name, stiffening=stiffening)
        else:
            choice = cls(theory.name)
        if choice.theory() != theory:
            raise ValueError(f"theory {theory!r} cannot be written into a run")
        return choice

    def theory(self) -> Theory:
        """Return the theory."""
        return theory_named(
            self.name, q=self.q, shear=self.shear, law=self.law, stiffening=self.stiffening
        )


class RunStart(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The settings that a run starts from."""

    preset: str | Preset  # name of a shipped preset, or another in full
    theory: TheoryChoice
    grasp_mm: float  # from the first clamp
    threshold_MPa: float  # stress at which the duct tears  # noqa: N815


class RunInput(msgspec.Struct, frozen=True, array_like=True):
    """One input, applied before a tick."""

    tick: int  # number of ticks done before it
    kind: InputKind
    # N for "force"; mm for "grab" (station), "hand" (deflection) and "grasp"; MPa for "threshold";
    # a choice for "theory"; None for "let-go"
    value: float | TheoryChoice | None


class RunLog(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """All that the course of a run depends on."""

    versions: dict[str, str]  # of this program and of the libraries that it computes with
    organ: OrganIdentity
    start: RunStart
    seed: int  # of the torn rim's raggedness
    tick_seconds: float
    ticks: int
    inputs: list[RunInput]  # in order; only those that changed something
    exercise: Exercise | None = None
    feedback: Feedback = Feedback.CONTINUOUS  # when the figures were shown
    exercise_inputs: ExerciseInputs = "any"  # which inputs counted in the exercise


class RunFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A run and its result, as they are downloaded."""

    format: Literal["bluntdissect-run"]
    version: int
    log: RunLog
    measures: Measures
    outcome: Outcome | None = None

    @classmethod
    def of(cls, log: RunLog, measures: Measures, outcome: Outcome | None) -> "RunFile":
        """Return a file of this version."""
        return cls(FORMAT, VERSION, log, measures, outcome)

    def agrees_with(self, found: "RunFile") -> bool:
        """Return whether a replayed run has this file's outcome and measures."""
        # Version 1: those measures that it has, but for a smoothness that is not given any more
        # (docs/measures.md).
        measures = self.measures
        if self.version < VERSION:
            now = found.measures
            measures = msgspec.structs.replace(
                measures,
                maximum_loading_rate_N_per_s=now.maximum_loading_rate_N_per_s,
                overshoot=now.overshoot,
                smoothness=None if now.smoothness is None else measures.smoothness,
            )
        return same_figures((measures, self.outcome), (found.measures, found.outcome))


def same_figures(recorded: object, found: object) -> bool:
    """Return whether all is the same that structures hold, numbers to 12 digits."""
    # A run is the same to the bit on all processors, but those made before sums were taken in one
    # order on all of them.
    if isinstance(recorded, msgspec.Struct) and isinstance(found, msgspec.Struct):
        recorded, found = map(msgspec.structs.astuple, (recorded, found))
    if isinstance(recorded, float) and isinstance(found, float):
        return math.isclose(recorded, found, rel_tol=1e-12)
    if isinstance(recorded, tuple) and isinstance(found, tuple):
        one, other = cast("tuple[object, ...]", recorded), cast("tuple[object, ...]", found)
        return len(one) == len(other) and all(map(same_figures, one, other))
    return recorded == found


def run_json(run: msgspec.Struct) -> bytes:
    """Return a run as JSON, its numbers to the last bit."""
    return msgspec.json.encode(run)


def run_version(content: bytes) -> int:
    """Return the version of a run's file, of any kind."""
    if len(content) > MOST_BYTES:
        raise RunFileError(f"a run has at most {MOST_BYTES:,} bytes, not {len(content):,}")
    wrong = "not a run of bluntdissect"
    return decoded(msgspec.json.decode, content, _Head, wrong, RunFileError).version


def read_run(content: bytes) -> RunFile:
    """Return the pull in a JSON file, its version, length and inputs checked."""
    found = run_version(content)
    if found == VERSION + 1:
        raise RunFileError("a run of a dissection in a bed, not of a pull")
    if found not in READ_VERSIONS:
        raise RunFileError(f"a run of version {found}; this program reads 1, 2 and 3")
    run = decoded_run(content, RunFile)
    _check(run.log)
    return run


def decoded_run(content: bytes, kind: type[FileT]) -> FileT:
    """Return a file of a kind of run, not yet checked."""
    return decoded(msgspec.json.decode, content, kind, "a damaged run", RunFileError)


class _Head(msgspec.Struct):
    format: Literal["bluntdissect-run"]
    version: int


class TimedInput(Protocol):
    """An input at a tick."""

    @property
    def tick(self) -> int:
        """Number of ticks done before it."""
        ...


def check_course(
    *, tick_seconds: float, ticks: int, seeds: dict[str, int], inputs: Sequence[TimedInput]
) -> None:
    """Raise if a run's length, seeds or the order of its inputs make no sense."""
    if tick_seconds != TICK_SECONDS:
        raise RunFileError(f"tick_seconds must be {TICK_SECONDS} s, got {tick_seconds}")
    if not 0 <= ticks <= MOST_TICKS:
        raise RunFileError(f"ticks must be from 0 to {MOST_TICKS:,}, got {ticks:,}")
    for name, seed in seeds.items():
        if not 0 <= seed < 2**63:
            raise RunFileError(f"{name} must be from 0 to below 2^63, got {seed}")
    if len(inputs) > MOST_INPUTS:
        raise RunFileError(f"a run has at most {MOST_INPUTS:,} inputs, not {len(inputs):,}")
    before = 0
    for number, each in enumerate(inputs):
        if not before <= each.tick <= ticks:
            raise RunFileError(
                f"input {number} must be at a tick from {before} to {ticks}, got {each.tick}"
            )
        before = each.tick


def _check(log: RunLog) -> None:
    check_course(
        tick_seconds=log.tick_seconds,
        ticks=log.ticks,
        seeds={"seed": log.seed},
        inputs=log.inputs,
    )
    _known(log.start.theory, "start")
    for number, each in enumerate(log.inputs):
        where = f"input {number}"
        if each.kind == "theory":
            if not isinstance(each.value, TheoryChoice):
                raise RunFileError(f"{where}, a theory, must name one, got {each.value!r}")
            _known(each.value, where)
        elif each.kind == "let-go":
            if each.value is not None:
                raise RunFileError(f"{where}, let-go, must have no value, got {each.value!r}")
        elif not isinstance(each.value, float) or not math.isfinite(each.value):
            raise RunFileError(f"{where}, {each.kind}, must have a number, got {each.value!r}")


def _known(choice: TheoryChoice, where: str) -> None:
    try:
        choice.theory()
    except ValueError as error:
        raise RunFileError(f"{where}: {error}") from None
