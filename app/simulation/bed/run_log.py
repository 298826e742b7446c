"""Run files of dissections: version 3 of the format that `app.simulation.run_log` has for pulls."""

import hashlib
import itertools
import math
from typing import Literal, get_args

import msgspec
import numpy as np

from app.simulation.bed.bedded_duct import ELEMENTS, HANDS, SUBSTEPS
from app.simulation.bed.exercise import BedExercise
from app.simulation.bed.hand import INSTRUMENTS
from app.simulation.bed.measures import DissectionMeasures
from app.simulation.bed_preset import BedPreset
from app.simulation.exercise import Feedback, Outcome
from app.simulation.preset import Preset
from app.simulation.run_log import (
    OrganIdentity,
    RunFile,
    RunFileError,
    check_course,
    decoded_run,
    read_run,
    run_version,
    same_figures,
)
from physics import LawName
from physics.bed import Strands

__all__ = [
    "DissectionFile",
    "DissectionInput",
    "DissectionInputKind",
    "DissectionLog",
    "DissectionStart",
    "read_any_run",
    "strands_digest",
]

VERSION = 3

DissectionInputKind = Literal["instrument", "grab", "move", "jaws", "let-go"]
KINDS: tuple[DissectionInputKind, ...] = get_args(DissectionInputKind)


class DissectionStart(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The settings that a dissection starts from."""

    preset: str | Preset  # name of a shipped preset, or another in full
    bed: str | BedPreset  # likewise
    bed_seed: int  # of the bed's scatter
    threshold_MPa: float  # nominal stress at which the duct tears  # noqa: N815
    strands_sha256: str  # digest of the strands that came of bed and seed
    elements: int = ELEMENTS  # of the beam
    substeps: int = SUBSTEPS  # of a tick
    # whether a parted strand is an instrument's only if it touched it; in runs made before also if
    # it had not met it
    by_touch: bool = False
    # of the wall, instead of the preset's; runs made before had no other
    law: LawName = "linear"
    stiffening: float | None = None


class DissectionInput(msgspec.Struct, frozen=True, array_like=True):
    """One input of one hand, applied before a tick."""

    tick: int  # number of ticks done before it
    hand: int  # 0 or 1
    kind: DissectionInputKind
    # a name for "instrument"; mm from the first clamp for "grab", (3,) mm in the duct's frame for
    # "move", mm between the jaws for "jaws"; None for "let-go"
    value: str | float | tuple[float, float, float] | None


class DissectionLog(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """All that the course of a dissection depends on."""

    versions: dict[str, str]  # of this program and of the libraries that it computes with
    organ: OrganIdentity
    start: DissectionStart
    seed: int  # of the torn rim's raggedness
    tick_seconds: float
    ticks: int
    inputs: list[DissectionInput]  # in order; only those that changed something
    exercise: BedExercise | None = None
    feedback: Feedback = Feedback.CONTINUOUS  # when the figures were shown
    # of each hand when the run began, mm; None in runs made before: where empty hands wait
    tips_mm: tuple[tuple[float, float, float], ...] | None = None


class DissectionFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A dissection and its result, as they are downloaded."""

    format: Literal["bluntdissect-run"]
    version: Literal[3]
    log: DissectionLog
    measures: DissectionMeasures
    outcome: Outcome | None = None

    @classmethod
    def of(
        cls, log: DissectionLog, measures: DissectionMeasures, outcome: Outcome | None
    ) -> "DissectionFile":
        """Return a file of this version."""
        return cls("bluntdissect-run", VERSION, log, measures, outcome)

    def agrees_with(self, found: "DissectionFile") -> bool:
        """Return whether a replayed run has this file's outcome and measures."""
        return same_figures((self.measures, self.outcome), (found.measures, found.outcome))


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


def read_any_run(content: bytes) -> RunFile | DissectionFile:
    """Return the run in a JSON file, of a pull or a dissection, its inputs checked."""
    if run_version(content) != VERSION:
        return read_run(content)
    run = decoded_run(content, DissectionFile)
    _check(run.log)
    return run


def _check(log: DissectionLog) -> None:
    start = log.start
    check_course(
        tick_seconds=log.tick_seconds,
        ticks=log.ticks,
        seeds={"seed": log.seed, "bed_seed": start.bed_seed},
        inputs=log.inputs,
    )
    if not 0.0 < start.threshold_MPa < math.inf:
        raise RunFileError(f"threshold_MPa must be above 0 and finite, got {start.threshold_MPa}")
    if (start.elements, start.substeps) != (ELEMENTS, SUBSTEPS):
        raise RunFileError(
            f"a run of {start.elements} elements and {start.substeps} steps a tick; this program "
            f"computes with {ELEMENTS} and {SUBSTEPS}"
        )
    tips = () if log.tips_mm is None else log.tips_mm
    if len(tips) not in (0, HANDS) or not all(map(math.isfinite, itertools.chain(*tips))):
        raise RunFileError(f"tips_mm must be a place of each of {HANDS} hands, got {tips!r}")
    for number, each in enumerate(log.inputs):
        where = f"input {number}, {each.kind},"
        if not 0 <= each.hand < HANDS:
            raise RunFileError(f"{where} must be of hand 0 or 1, got {each.hand}")
        value = each.value
        if each.kind == "let-go":
            if value is not None:
                raise RunFileError(f"{where} must have no value, got {value!r}")
        elif each.kind == "instrument":
            if value not in INSTRUMENTS:
                known = ", ".join(INSTRUMENTS)
                raise RunFileError(f"{where} must name one of {known}, got {value!r}")
        elif each.kind == "move":
            if not isinstance(value, tuple) or not all(map(math.isfinite, value)):
                raise RunFileError(f"{where} must have three numbers, got {value!r}")
        elif not isinstance(value, float) or not math.isfinite(value):
            raise RunFileError(f"{where} must have a number, got {value!r}")
