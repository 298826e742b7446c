"""A process that saves runs of a class until it is killed, and what has become of them."""

import os
import signal
import subprocess
import sys
import threading
import uuid
from pathlib import Path

from app.classroom.recorder import Recorder
from app.classroom.store import ClassStore, RunRecord, now


def killed_while_saving(path: Path, seconds: float) -> set[str]:
    """Kill a process that saves, so long after its first; return what it had acknowledged."""
    root = Path(__file__).parents[2]
    with subprocess.Popen(
        [sys.executable, __file__, str(path)], stdout=subprocess.PIPE, text=True,
        env=os.environ | {"PYTHONPATH": str(root)},
    ) as process:  # fmt: skip
        assert process.stdout is not None
        printed = [process.stdout.readline()]
        threading.Timer(seconds, process.send_signal, [signal.SIGKILL]).start()
        printed += process.stdout
    return {line.strip() for line in printed if line.endswith("\n")}


def check_killed(path: Path, acknowledged: set[str]) -> None:
    """Check that all that was acknowledged is whole."""
    store = ClassStore(path)
    kept = {each.id for each in store.runs()}
    assert acknowledged <= kept
    for each in acknowledged:
        found = store.run(each)
        assert found is not None
        assert found.file == each.encode() * 128
    (whole,) = store._rows("PRAGMA integrity_check")
    assert whole[0] == "ok"
    store.close()


def save_until_killed() -> None:
    """Save runs one after the other, and print each one's identity once it is acknowledged."""
    store = ClassStore(Path(sys.argv[1]))
    person = store.name_person("browser", "Ann")
    recorder = Recorder(store, lambda _: ())
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


if __name__ == "__main__":
    from app.classroom import store as store_module

    store_module.MOST_RUNS = 10**6
    save_until_killed()
