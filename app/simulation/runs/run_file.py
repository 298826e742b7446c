"""Run files: the inputs of a run, all else that a replay to the bit needs, and its metrics."""

import hashlib
import itertools
import math
from typing import Literal, cast

import msgspec
import numpy as np

from app.anatomy import Anatomy, anatomy_named, shipped_anatomies
from app.bed_preset import BedPreset
from app.relaxation_preset import Prony
from app.simulation.exercises.exercise import Exercise, ExerciseInputs, Feedback, Outcome
from app.simulation.exercises.metrics import Metrics
from app.simulation.inputs.clock import TICK_SECONDS
from app.simulation.inputs.inputs import (
    ALL_INSTRUMENTS,
    MOST_INPUTS,
    MOST_TICKS,
    STRUCTURES,
    VECTORS,
    VIEWS,
    WITHOUT_VALUE,
    Input,
    TheoryChoice,
    Value,
)
from app.simulation.specimen.preset import Preset
from organ_geometry import Organ
from physics import LawName
from physics.bed import Strands

FORMAT: Literal["bluntdissect-run"] = "bluntdissect-run"
VERSION: Literal[4] = 4
MOST_BYTES = 16_000_000
MOST_TUBES = 1000
ELEMENTS, SUBSTEPS, HANDS = 40, 8, 2
"""Elements of the beam in space, its steps in a tick, and the hands at it. So many elements are
0.1 % off in the force and 0.3 % in the highest stress (docs/theory.md)."""


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

    def check(self, organ: Organ) -> None:
        """Raise a `RunFileError` if an organ is another."""
        found = OrganIdentity.of(organ)
        if found.sha256 != self.sha256:
            raise RunFileError(
                f"this run was made on another organ, {self.words}; this one is {found.words}"
            )

    @property
    def words(self) -> str:
        """Which organ it is, in words."""
        return f"{self.name or 'unnamed'} ({self.length_mm:.1f} mm, sha256 {self.sha256[:12]})"


class RunStart(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The settings that a run starts from; what a tissue does not have is None."""

    preset: str | Preset  # name of a shipped preset, or another in full
    threshold_MPa: float  # nominal stress at which the duct tears  # noqa: N815
    theory: TheoryChoice | None = None  # of a free duct in the plane of its pull
    grasp_mm: float | None = None  # where force or deflection act on it, from the first clamp
    bed: str | BedPreset | None = None  # name of a shipped bed, or another in full
    bed_seed: int | None = None  # of the bed's scatter
    strands_sha256: str | None = None  # digest of the strands that came of bed and seed
    law: LawName = "linear"  # of a wall in space, instead of the preset's
    stiffening: float | None = None  # of the exponential law
    elements: int | None = None  # of the beam in space
    substeps: int | None = None  # of a tick
    # whether a broken strand is an instrument's only if it touched it; in runs of version 3 also if
    # it had not met it
    broken_by_touch: bool = True
    grip_N: float | None = None  # pull at which tissue slips out of a grasper  # noqa: N815
    # of each hand when the run began; None in some runs of version 3: where empty hands wait
    tips_mm: tuple[tuple[float, float, float], ...] | None = None
    # name of a shipped anatomy, or another in full: its tubes, of which the preset is the first's
    anatomy: str | Anatomy | None = None
    tubes_touch: bool = False  # each other; older runs' passed through one another
    clear_strands: bool = False  # of tubes that they do not hold; older runs' led through some
    joint_faces: bool = False  # of the shipped anatomies; older runs name their first edition
    # how strands and walls relax; not at all when None
    strand_relaxation: Prony | None = None
    wall_relaxation: Prony | None = None
    tear_mm_per_s: float | None = None  # how fast a tear crosses the wall; at once when None

    @property
    def in_bed(self) -> bool:
        """Whether the duct lies in a bed."""
        return self.bed is not None


class RunLog(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """All that the course of a run depends on."""

    versions: dict[str, str]  # of this program and of the libraries that it computes with
    organ: OrganIdentity
    start: RunStart
    seed: int  # of the torn rim's raggedness
    tick_seconds: float
    ticks: int
    inputs: list[Input]  # in order; only those that changed something
    exercise: Exercise | None = None
    feedback: Feedback = Feedback.CONTINUOUS  # when the figures were shown
    exercise_inputs: ExerciseInputs = "any"  # which inputs counted in the exercise


class RunFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A run and its result, as they are downloaded."""

    format: Literal["bluntdissect-run"]
    version: Literal[4]
    log: RunLog
    metrics: Metrics
    outcome: Outcome | None = None
    converted_from: int | None = None  # the version of the file that it was read from

    @classmethod
    def of(cls, log: RunLog, metrics: Metrics, outcome: Outcome | None) -> "RunFile":
        """Return a file of this version."""
        return cls(FORMAT, VERSION, log, metrics, outcome)

    def agrees_with(self, found: "RunFile") -> bool:
        """Return whether a replayed run ends as this file and has its metrics, to 12 digits."""
        wanted = self.metrics
        if self.converted_from == 1 and found.metrics.get("smoothness") is None:
            # Version 1 gave a smoothness of incomplete movements too (docs/measures.md).
            wanted = {key: value for key, value in wanted.items() if key != "smoothness"}
        # The reason of an outcome is put in today's words.
        passed = [None if each is None else each.passed for each in (self.outcome, found.outcome)]
        return passed[0] == passed[1] and all(
            key in found.metrics and same_to_12_digits(value, found.metrics[key])
            for key, value in wanted.items()
        )


def same_to_12_digits(one: object, other: object) -> bool:
    """Return whether two metrics are the same, numbers to 12 digits."""
    # A run is the same to the bit on all processors, but those made before sums were taken in one
    # order on all of them.
    if isinstance(one, float) and isinstance(other, float):
        return math.isclose(one, other, rel_tol=1e-12)
    if isinstance(one, list) and isinstance(other, list):
        first, second = cast("list[object]", one), cast("list[object]", other)
        return len(first) == len(second) and all(map(same_to_12_digits, first, second))
    if isinstance(one, dict) and isinstance(other, dict):
        found, wanted = cast("dict[str, object]", one), cast("dict[str, object]", other)
        # Older files do not say of which tube a tear is.
        return found.keys() | {"tube"} == wanted.keys() | {"tube"} and all(
            same_to_12_digits(value, wanted.get(key)) for key, value in found.items()
        )
    return one == other


def strands_digest(strands: Strands) -> str:
    """Return a digest of strands, the same wherever a seed gives the same bed."""
    digest = hashlib.sha256()
    for array in (
        strands.stations,
        strands.ends,
        strands.feet,
        strands.stiffness,
        strands.length,
        strands.yield_elongation,
        strands.failure_elongation,
    ):
        digest.update(np.ascontiguousarray(array, dtype="<f8").tobytes())
    return digest.hexdigest()


def anatomy_or_name(anatomy: Anatomy) -> str | Anatomy:
    """Return a shipped anatomy's name, or another as it is."""
    shipped = anatomy.name in shipped_anatomies() and anatomy_named(anatomy.name) == anatomy
    return anatomy.name if shipped else anatomy


def run_json(run: RunFile) -> bytes:
    """Return a run as JSON, its numbers to the last bit."""
    return msgspec.json.encode(run)


def checked(run: RunFile) -> RunFile:
    """Return a run whose length, start and inputs make sense, or raise."""
    log, start = run.log, run.log.start
    if log.tick_seconds != TICK_SECONDS:
        raise RunFileError(f"tick_seconds must be {TICK_SECONDS} s, got {log.tick_seconds}")
    if not 0 <= log.ticks <= MOST_TICKS:
        raise RunFileError(f"ticks must be from 0 to {MOST_TICKS:,}, got {log.ticks:,}")
    for name, seed in {"seed": log.seed, "bed_seed": start.bed_seed or 0}.items():
        if not 0 <= seed < 2**63:
            raise RunFileError(f"{name} must be from 0 to below 2^63, got {seed}")
    if len(log.inputs) > MOST_INPUTS:
        raise RunFileError(f"a run has at most {MOST_INPUTS:,} inputs, not {len(log.inputs):,}")
    _check_start(start)
    before = 0
    for number, each in enumerate(log.inputs):
        where = f"input {number}"
        if not before <= each.tick <= log.ticks:
            raise RunFileError(
                f"{where} must be at a tick from {before} to {log.ticks}, got {each.tick}"
            )
        before = each.tick
        if not 0 <= each.hand < HANDS:
            raise RunFileError(f"{where}, {each.kind}, must be of hand 0 or 1, got {each.hand}")
        _check_value(each, f"{where}, {each.kind},")
    return run


def _check_start(start: RunStart) -> None:
    if not 0.0 < start.threshold_MPa < math.inf:
        raise RunFileError(f"threshold_MPa must be above 0 and finite, got {start.threshold_MPa}")
    if start.theory is not None:
        _known(start.theory, "start")
        if start.bed is not None:
            raise RunFileError("a run has a theory in the plane or a bed, not both")
        if start.grasp_mm is None or not math.isfinite(start.grasp_mm):
            raise RunFileError(f"grasp_mm must be a number, got {start.grasp_mm}")
    elif start.bed is not None and (start.bed_seed is None or start.strands_sha256 is None):
        raise RunFileError("a run in a bed must have bed_seed and strands_sha256")
    elif (start.elements, start.substeps) != (ELEMENTS, SUBSTEPS):
        raise RunFileError(
            f"a run of {start.elements} elements and {start.substeps} steps a tick; this program "
            f"computes with {ELEMENTS} and {SUBSTEPS}"
        )
    if start.tear_mm_per_s is not None and not 0.0 < start.tear_mm_per_s < math.inf:
        raise RunFileError(f"tear_mm_per_s must be above 0 and finite, got {start.tear_mm_per_s}")
    for each in (start.strand_relaxation, start.wall_relaxation):
        try:
            _ = each is None or each.made()
        except ValueError as error:
            raise RunFileError(str(error)) from None
    tips = () if start.tips_mm is None else start.tips_mm
    if len(tips) not in (0, HANDS) or not all(map(math.isfinite, itertools.chain(*tips))):
        raise RunFileError(f"tips_mm must be a place of each of {HANDS} hands, got {tips!r}")


def _check_value(each: Input, where: str) -> None:
    value = each.value
    if each.kind in WITHOUT_VALUE:
        if value is not None:
            raise RunFileError(f"{where} must have no value, got {value!r}")
    elif each.kind == "instrument":
        if value not in ALL_INSTRUMENTS:
            known = ", ".join(ALL_INSTRUMENTS)
            raise RunFileError(f"{where} must name one of {known}, got {value!r}")
    elif each.kind == "theory":
        if not isinstance(value, TheoryChoice):
            raise RunFileError(f"{where} must name a theory, got {value!r}")
        _known(value, where)
    elif each.kind in VECTORS:
        if not _finite(value, 3):
            raise RunFileError(f"{where} must have three numbers, got {value!r}")
    elif each.kind == "view":
        if not (
            isinstance(value, tuple)
            and any(_finite(value, count) for count in VIEWS)
            and any(value[:3])
        ):
            raise RunFileError(
                f"{where} must have a direction, then a camera's place, then a scope's numbers, "
                f"got {value!r}"
            )
    elif each.kind == "grab":
        if (
            not isinstance(value, tuple)
            or not _finite(value, 2)
            or value[0] not in range(MOST_TUBES)
        ):
            raise RunFileError(
                f"{where} must have a tube's number, from 0, and a station in mm, got {value!r}"
            )
    elif each.kind == "mark":
        if (
            not isinstance(value, tuple)
            or not _finite(value, 3)
            or value[0] not in range(len(STRUCTURES))
            or value[1] not in range(MOST_TUBES)
        ):
            raise RunFileError(
                f"{where} must have a structure's number, from 0 to {len(STRUCTURES) - 1}, a "
                f"tube's, from 0, and a station in mm, got {value!r}"
            )
    elif not isinstance(value, float | int) or not math.isfinite(value):
        raise RunFileError(f"{where} must have a number, got {value!r}")


def _finite(value: Value, count: int) -> bool:
    return isinstance(value, tuple) and len(value) == count and all(map(math.isfinite, value))


def _known(choice: TheoryChoice, where: str) -> None:
    try:
        choice.theory()
    except ValueError as error:
        raise RunFileError(f"{where}: {error}") from None
