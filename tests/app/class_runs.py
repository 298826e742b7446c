"""Runs as a class keeps them, and a process that saves them until it is killed."""

import sys
import threading
import uuid
from functools import cache
from pathlib import Path

import msgspec
import numpy as np
from simulated import phantom

from app.classroom.exercise_file import SetExercise, read_exercise, template
from app.classroom.recorder import Recorder
from app.classroom.store import ClassStore, RunRecord, now
from app.simulation import run_json
from app.simulation.bed import BedSession

SAVER = "from class_runs import save_until_killed; save_until_killed()"


@cache
def asked() -> SetExercise:
    """An exercise that a teacher sets."""
    return read_exercise(template("window")).on(phantom(), None)


@cache
def dissection() -> tuple[bytes, str]:
    """A short dissection's file and measures."""
    session = BedSession(phantom(), vertices=300)
    session.grab(0, 25.4)
    session.move_hand(0, session.duct.hands[0].place + np.array([0.0, 0.0, 4.0]))
    session.advance(20)
    file = session.run_file()
    return run_json(file), msgspec.json.encode(file.measures).decode()


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


def save_until_killed() -> None:
    """Save runs one after the other, and print each one's identity once it is acknowledged."""
    store = ClassStore(Path(sys.argv[1]))
    person = store.name_person("browser", "Ann")
    recorder = Recorder(store)
    measures = '{"time_s": 1.0}'
    while True:
        run_id, acknowledged = uuid.uuid4().hex, threading.Event()
        run = RunRecord(
            run_id, person.id, None, "dissect", "Free", now(), True, None, "", measures,
            run_id.encode() * 128,
        )  # fmt: skip

        def done(problem: str | None, acknowledged: threading.Event = acknowledged) -> None:
            assert problem is None, problem
            acknowledged.set()

        recorder.save(run_id, lambda run=run: run, done)
        acknowledged.wait()
        print(run_id, flush=True)
