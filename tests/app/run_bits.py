"""Run as a program: digests of replayed runs, which may not depend on the processor."""

import hashlib
import sys
from pathlib import Path

import numpy as np
from simulated import phantom

from app.simulation import Replay, preset_named, run_json
from app.simulation.bed import BedSession, DissectionFile, DissectionReplay, read_any_run
from physics.bed.space_beam import axis_line

RUNS = Path(__file__).parent / "runs"


def digests() -> list[str]:
    """Of a pull, a dissection that tears, a lift along an organ's own axis, and a spline."""
    found: list[bytes] = []
    for name in ("version_1_hold", "version_3_torn"):
        run = read_any_run((RUNS / f"{name}.json").read_bytes())
        kind = DissectionReplay if isinstance(run, DissectionFile) else Replay
        found.append(run_json(kind(run.log, phantom(), vertices=300).run_file()))
    session = BedSession(phantom(), preset_named("porcine-bile-duct"), bed_seed=3, vertices=300)
    start = session.grab(0, 20.0)
    assert start is not None
    for tick in range(12):
        session.move_hand(0, start + np.array([0.0, 0.3 * tick, 0.4 * tick]))
        session.advance()
    found.append(run_json(session.run_file()))
    way = np.linspace(0.0, 50.0, 101)
    bent = np.stack([way, 3.0 * np.sin(way / 9.0), 2.0 * np.cos(way / 7.0)], axis=1)
    found.append(b"".join(np.ascontiguousarray(each).tobytes() for each in axis_line(bent)))
    return [hashlib.sha256(each).hexdigest() for each in found]


if __name__ == "__main__":
    sys.stdout.write("\n".join(digests()))
