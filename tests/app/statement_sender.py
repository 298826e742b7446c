"""A process that saves runs of a class with their statements, and sends them, until it is killed.

`python tests/app/statement_sender.py CLASS` prints each run that is saved.
"""

import sys
import uuid
from pathlib import Path

from app.classroom import store as store_module
from app.classroom.class_course import ClassCourse
from app.classroom.store import ClassStore, RunRecord, now
from app.classroom.xapi_sender import Sender, class_statements

INCIDENTS = (
    '[{"error": "leaning", "start_s": 0.2, "end_s": 0.4, "hand": 0, "tube": 0, "station_mm": 25.4,'
    ' "consequence": "none", "values": {"a": 33.0}}]'
)


def save_and_send() -> None:
    """Save runs one after the other, which wake the sender."""
    store_module.MOST_RUNS = 10**6
    store = ClassStore(Path(sys.argv[1]))
    person = store.name_person("browser", "Ann")
    book, sender = ClassCourse(store), Sender(store, first_wait=0.02)
    while True:
        run = RunRecord(
            uuid.uuid4().hex, person.id, None, "dissect", "Open a window", now(), True, True,
            "Freed 13 mm.", '{"time_s": 1.0}', b"run", None, None, INCIDENTS,
        )  # fmt: skip
        store.save(run, class_statements(store, book, run))
        sender.wake()
        print(run.id, flush=True)


if __name__ == "__main__":
    save_and_send()
