"""Runs of any version, as runs of this one. Versions 1 and 2 are pulls, version 3 dissections."""

from typing import Any, Literal, cast

import msgspec
from msgspec.structs import replace

from app.anatomy import first_edition
from app.bed_preset import BedPreset
from app.bounded_file import decoded
from app.simulation.exercises.exercise import Exercise, ExerciseInputs, Feedback, Outcome
from app.simulation.exercises.metrics import Metrics
from app.simulation.exercises.older_exercises import renamed_exercise
from app.simulation.inputs.inputs import Input, InputKind, TheoryChoice, Value
from app.simulation.runs.run_file import (
    ELEMENTS,
    MOST_BYTES,
    SUBSTEPS,
    VERSION,
    OrganIdentity,
    RunFile,
    RunFileError,
    RunLog,
    RunStart,
    checked,
)
from app.simulation.specimen.preset import Preset
from physics import LawName

DAMAGED = "a damaged run"

RENAMED_METRICS = {
    "strands_parted": "strands_broken",
    "strands_parted_by_hand": "strands_broken_by_hand",
    "strands_parted_by_instrument": "strands_broken_by_instrument",
    "strands_parted_out_of_sight": "strands_broken_out_of_sight",
    "peak_stress_share": "peak_stress_ratio",
    "parted_energy_mJ": "strand_energy_mJ",
}
PULL_KINDS: dict[str, InputKind] = {
    "force": "force",
    "grab": "grab",
    "hand": "lift",
    "let-go": "release",
    "grasp": "grasp",
    "threshold": "threshold",
    "theory": "theory",
}
BED_KINDS: dict[str, InputKind] = {
    "instrument": "instrument",
    "grab": "grab",
    "move": "move",
    "jaws": "open",
    "let-go": "release",
}


class _Head(msgspec.Struct):
    format: Literal["bluntdissect-run"]
    version: int


class _PullStart(msgspec.Struct, forbid_unknown_fields=True):
    preset: str | Preset
    theory: TheoryChoice
    grasp_mm: float
    threshold_MPa: float  # noqa: N815


class _PullInput(msgspec.Struct, array_like=True):
    tick: int
    kind: Literal["force", "grab", "hand", "let-go", "grasp", "threshold", "theory"]
    value: float | TheoryChoice | None


class _PullLog(msgspec.Struct, forbid_unknown_fields=True):
    versions: dict[str, str]
    organ: OrganIdentity
    start: _PullStart
    seed: int
    tick_seconds: float
    ticks: int
    inputs: list[_PullInput]
    exercise: dict[str, Any] | None = None
    feedback: Feedback = Feedback.CONTINUOUS
    exercise_inputs: ExerciseInputs = "any"


class _PullFile(msgspec.Struct, forbid_unknown_fields=True):
    format: str
    version: int
    log: _PullLog
    measures: Metrics
    outcome: Outcome | None = None


class _BedStart(msgspec.Struct, forbid_unknown_fields=True):
    preset: str | Preset
    bed: str | BedPreset
    bed_seed: int
    threshold_MPa: float  # noqa: N815
    strands_sha256: str
    elements: int = ELEMENTS
    substeps: int = SUBSTEPS
    law: LawName = "linear"
    stiffening: float | None = None
    by_touch: bool = False


class _BedInput(msgspec.Struct, array_like=True):
    tick: int
    hand: int
    kind: Literal["instrument", "grab", "move", "jaws", "let-go"]
    value: str | float | tuple[float, float, float] | None


class _BedLog(msgspec.Struct, forbid_unknown_fields=True):
    versions: dict[str, str]
    organ: OrganIdentity
    start: _BedStart
    seed: int
    tick_seconds: float
    ticks: int
    inputs: list[_BedInput]
    exercise: dict[str, Any] | None = None
    feedback: Feedback = Feedback.CONTINUOUS
    tips_mm: tuple[tuple[float, float, float], ...] | None = None


class _BedFile(msgspec.Struct, forbid_unknown_fields=True):
    format: str
    version: int
    log: _BedLog
    measures: Metrics
    outcome: Outcome | None = None


def read_run(content: bytes) -> RunFile:
    """Return the run in a JSON file of any version, its length, start and inputs checked."""
    if len(content) > MOST_BYTES:
        raise RunFileError(f"a run has at most {MOST_BYTES:,} bytes, not {len(content):,}")
    head = decoded(msgspec.json.decode, content, _Head, "not a run of bluntdissect", RunFileError)
    if head.version == VERSION:
        run = _with_its_anatomy(decoded(_decoded, content, RunFile, DAMAGED, RunFileError))
    elif head.version == 3:
        run = _of_dissection(decoded(msgspec.json.decode, content, _BedFile, DAMAGED, RunFileError))
    elif head.version in (1, 2):
        run = _of_pull(decoded(msgspec.json.decode, content, _PullFile, DAMAGED, RunFileError))
    else:
        raise RunFileError(f"a run of version {head.version}; this program reads 1 to {VERSION}")
    return checked(run)


def _with_its_anatomy(run: RunFile) -> RunFile:
    """Return a run with the edition of a shipped anatomy that it was done at."""
    start = run.log.start
    if not isinstance(start.anatomy, str) or start.joint_faces:
        return run
    try:
        anatomy = first_edition(start.anatomy)
    except ValueError as error:
        raise RunFileError(f"the run's anatomy: {error}") from None
    log = replace(run.log, start=replace(start, anatomy=anatomy))
    exercise = log.exercise
    if exercise is not None and exercise.opening is not None:
        opening = replace(exercise.opening, anatomy=anatomy)
        log = replace(log, exercise=replace(exercise, opening=opening))
    return replace(run, log=log)


def renamed_metrics(measures: Metrics) -> Metrics:
    """Return measures of an older run by their present keys."""
    return {RENAMED_METRICS.get(key, key): value for key, value in measures.items()}


def _decoded(content: bytes) -> dict[str, Any]:
    """Return a run of this version, with its exercise, which may be an older one, as of today."""
    plain = msgspec.json.decode(content, type=dict[str, Any])
    log: object = plain.get("log")
    if isinstance(log, dict):
        fields = cast("dict[str, Any]", log)
        exercise: object = fields.get("exercise")
        if isinstance(exercise, dict):
            fields["exercise"] = _present(cast("dict[str, Any]", exercise))
    return plain


def _present(exercise: dict[str, Any]) -> dict[str, Any]:
    try:
        return renamed_exercise(exercise)
    except (ValueError, TypeError, AttributeError) as error:
        raise RunFileError(f"{DAMAGED}: exercise: {error}") from None


def _of_pull(file: _PullFile) -> RunFile:
    log, start = file.log, file.log.start
    measures: Metrics = {key: value for key, value in file.measures.items() if value is not None}
    return RunFile(
        format="bluntdissect-run",
        version=VERSION,
        log=RunLog(
            versions=log.versions,
            organ=log.organ,
            start=RunStart(
                start.preset, start.threshold_MPa, theory=start.theory, grasp_mm=start.grasp_mm
            ),
            seed=log.seed,
            tick_seconds=log.tick_seconds,
            ticks=log.ticks,
            inputs=[
                _input(number, each.tick, 0, PULL_KINDS[each.kind], each.value)
                for number, each in enumerate(log.inputs)
            ],
            exercise=_exercise(log.exercise),
            feedback=log.feedback,
            exercise_inputs=log.exercise_inputs,
        ),
        # Version 1 lacks some, which are then None.
        metrics=measures if file.version == 1 else file.measures,
        outcome=file.outcome,
        converted_from=file.version,
    )


def _of_dissection(file: _BedFile) -> RunFile:
    log, start = file.log, file.log.start
    return RunFile(
        format="bluntdissect-run",
        version=VERSION,
        log=RunLog(
            versions=log.versions,
            organ=log.organ,
            start=RunStart(
                start.preset,
                start.threshold_MPa,
                bed=start.bed,
                bed_seed=start.bed_seed,
                strands_sha256=start.strands_sha256,
                law=start.law,
                stiffening=start.stiffening,
                elements=start.elements,
                substeps=start.substeps,
                broken_by_touch=start.by_touch,
                tips_mm=log.tips_mm,
            ),
            seed=log.seed,
            tick_seconds=log.tick_seconds,
            ticks=log.ticks,
            inputs=[
                _input(number, each.tick, each.hand, BED_KINDS[each.kind], each.value)
                for number, each in enumerate(log.inputs)
            ],
            exercise=_exercise(log.exercise),
            feedback=log.feedback,
        ),
        metrics=renamed_metrics(file.measures),
        outcome=file.outcome,
        converted_from=file.version,
    )


def _input(
    number: int,
    tick: int,
    hand: int,
    kind: InputKind,
    value: Value,
) -> Input:
    if kind == "grab":
        if not isinstance(value, float):
            raise RunFileError(f"input {number}, {kind}, must have a number, got {value!r}")
        value = (0, value)
    return Input(tick, hand, kind, value)


def _exercise(exercise: dict[str, Any] | None) -> Exercise | None:
    if exercise is None:
        return None
    try:
        return msgspec.convert(_present(exercise), Exercise)
    except msgspec.ValidationError as error:
        raise RunFileError(f"{DAMAGED}: exercise: {error}") from None
