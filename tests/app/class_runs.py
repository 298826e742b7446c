"""Runs as a class keeps them."""

import uuid
from functools import cache

import msgspec
import numpy as np
from simulated import bed_session, phantom

from app.classroom.exercise_file import AssignedExercise, read_exercise, template
from app.classroom.store import RunRecord, now
from app.simulation import run_json


@cache
def asked() -> AssignedExercise:
    """An exercise that a teacher sets."""
    return read_exercise(template("window")).on(phantom(), None)


@cache
def dissection() -> tuple[bytes, str]:
    """A short dissection's file and measures."""
    session = bed_session(phantom(), vertices=300)
    session.grab(0, 25.4)
    session.move_hand(0, session.spatial.hands[0].place + np.array([0.0, 0.0, 4.0]))
    session.advance(20)
    file = session.run_file()
    return run_json(file), msgspec.json.encode(file.metrics).decode()


def record(
    person_id: str,
    *,
    run_id: str = "",
    finished: bool = True,
    passed: bool | None = None,
    reason: str = "",
    assignment: int | None = None,
    peak: float | None = None,
) -> RunRecord:
    """A run of a person."""
    file, measures = dissection()
    if peak is not None:
        measures = msgspec.json.encode(
            msgspec.json.decode(measures) | {"smallest_distance_to_break": 1.0 - peak}
        ).decode()
    return RunRecord(
        run_id or uuid.uuid4().hex, person_id, assignment, "dissect", "Open a window", now(),
        finished, passed, reason, measures, file,
    )  # fmt: skip
