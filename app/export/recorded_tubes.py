"""Recorded runs at several tubes: the motion of each, with where it was torn or divided."""

from dataclasses import replace

import numpy as np

from app.export.bed_recorder import BedRecorder
from app.export.motion import WHOLE, check_frames
from app.export.recorded_run import RUN, RecordedRun
from app.simulation import (
    FEW,
    PIECES,
    TICK_SECONDS,
    Phase,
    Replay,
    RunLog,
    tear_front,
)
from organ_geometry import Organ
from physics import RuptureCheck


def recorded_runs(log: RunLog, organ: Organ, *, frames: int) -> tuple[RecordedRun, ...]:
    """Return a logged run as the motion of each tube, of `frames` keys; of a duct there is one."""
    # A tube that tears or is divided comes apart at its first cut; a second one is not drawn.
    if log.start.anatomy is None:
        return (RecordedRun.of_log(log, organ, frames=frames),)
    check_frames(frames)
    if not log.ticks:
        raise ValueError("a run of no ticks has nothing to play; move a hand, and wait")
    replay = Replay(log, organ, vertices=FEW)
    tissue = replay.session.spatial
    tubes = tissue.tubes
    recorders = [
        BedRecorder(dissection, surface, strands=mine)
        for dissection, surface, mine in zip(
            tubes.dissections, tubes.surfaces, tubes.strands_of, strict=True
        )
    ]
    cuts: dict[int, tuple[int, RuptureCheck]] = {}  # tick and place of each tube's first cut
    for tick in np.unique(np.rint(np.linspace(0.0, log.ticks, frames)).astype(int)).tolist():
        replay.seek_tick(tick)
        reading = replay.session.reading()
        for event in tissue.events:
            number = tubes.names.index(event.tube)
            if event.kind in ("tear", "division") and number not in cuts:
                strength = tissue.strengths[number]
                cut = RuptureCheck(event.station, 1, 0.0, 0.0, strength)
                cuts[number] = event.tick, tissue.tears[number] or cut
        for number, recorder in enumerate(recorders):
            phase, front = Phase.INTACT, WHOLE
            if number in cuts:
                since, check = cuts[number]
                front = tear_front((tick - since) * TICK_SECONDS)
                phase = Phase.TEARING if front < 1.0 else Phase.TORN
            else:
                strength = tissue.strengths[number]
                check = tubes.surfaces[number].check(tissue.beam, strength)
            recorder.add(
                tick * TICK_SECONDS,
                tissue.beam,
                replace(
                    reading,
                    phase=phase,
                    check=check,
                    nicks=tuple(each for each in reading.nicks if each.tube == number),
                ),
                tissue.torn_elements[number],
                front,
            )
    return tuple(
        RecordedRun(
            dissection,
            recorder.motion(RUN),
            log.seed,
            log.ticks * TICK_SECONDS,
            (name, f"{name}_{PIECES[0]}", f"{name}_{PIECES[1]}"),
        )
        for name, dissection, recorder in zip(
            tubes.names, tubes.dissections, recorders, strict=True
        )
    )
