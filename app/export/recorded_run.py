"""Recorded runs as motions: what was done to the duct, key by key, and the tear it came to."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from app.export.bed_recorder import BedRecorder
from app.export.motion import WHOLE, Motion, MotionKey, check_frames
from app.export.rigged_organ import Rig, rigged_organs
from app.export.snapshot import NAMES, Snapshot, bed_snapshots
from app.simulation import (
    AFTER_TEAR,
    FEW,
    TICK_SECONDS,
    Dissection,
    Phase,
    Replay,
    RunLog,
    tear_front,
    tear_swing,
)
from organ_geometry import Organ
from organ_geometry.mesh import TornPiece, organ_skin

RUN = "run"
"""Name of the motion."""


@dataclass(frozen=True, slots=True, eq=False)
class RecordedRun:
    """A replayed run as a motion, its times s from the first pull."""

    dissection: Dissection
    motion: Motion
    seed: int  # of the torn rim's raggedness
    seconds: float  # of the run, without the recoil after its end
    names: tuple[str, str, str] = NAMES  # of the duct's mesh, and of its pieces'

    @classmethod
    def of_log(cls, log: RunLog, organ: Organ, *, frames: int) -> "RecordedRun":
        """Return a logged run in `frames` keys, after a tear also the recoil tick by tick."""
        check_frames(frames)
        if not log.ticks:
            raise ValueError("a run of no ticks has nothing to play; move a hand, and wait")
        replay = Replay(log, organ, vertices=FEW)
        if log.start.theory is None:
            return cls._of_space(replay, frames)
        return cls._of_plane(replay, frames)

    @classmethod
    def _of_plane(cls, replay: Replay, frames: int) -> "RecordedRun":
        """Return a run in a plane, whose surface is where it is drawn."""
        ticks, session = replay.log.ticks, replay.session
        dissection = session.tissue.dissection
        shown = set(np.rint(np.linspace(0.0, ticks, frames)).astype(int).tolist())
        # The first key stays the identity to the bit.
        keys = [MotionKey(0.0, dissection.rest_transforms(), session.reading())]
        tick, last = 0, ticks
        while tick < last:
            tick += 1
            replay.seek_tick(tick)
            tear, time = session.planar.tear, tick * TICK_SECONDS
            front = None if tear is None else tear.front
            if front is None and tick not in shown:
                continue
            transforms, reading = session.drawn.transforms.copy(), session.reading()
            if front is not None and keys[-1].front == WHOLE:
                last = tick + AFTER_TEAR - 1
                keys.append(MotionKey(time, transforms, reading))  # the whole organ as it breaks
            keys.append(MotionKey(time, transforms, reading, WHOLE if front is None else front))
        seconds = replay.log.ticks * TICK_SECONDS
        return cls(dissection, Motion.of(RUN, keys), replay.log.seed, seconds)

    @classmethod
    def _of_space(cls, replay: Replay, frames: int) -> "RecordedRun":
        """Return a run in space, whose strands are recorded with it."""
        ticks, duct = replay.log.ticks, replay.session.spatial
        recorder = BedRecorder(duct.dissection, duct.surface, divided=duct.divided)
        shown = set(np.rint(np.linspace(0.0, ticks, frames)).astype(int).tolist())
        replay.seek_tick(ticks)
        tore = next((each.tick for each in duct.events if each.kind == "tear"), None)
        check, element = duct.torn, duct.torn_elements[0]
        if tore is not None:  # the tear runs from the last tick in which all is whole
            shown.update(range(tore - 1, tore + AFTER_TEAR))
        broke = 0.0
        for tick in sorted(shown):
            replay.seek_tick(tick)
            reading, time = duct.reading(), tick * TICK_SECONDS
            if tore is None or tick < tore:
                recorder.add(time, duct.beam, reading)
                broke = reading.force
            if tore is None or check is None or tick < tore - 1:
                continue
            elapsed = (tick - tore + 1) * TICK_SECONDS
            front = tear_front(elapsed)
            if front < 1.0:
                reading = replace(reading, phase=Phase.TEARING, check=check, force=broke, nicks=())
            recorder.add(time, duct.beam, reading, element, front, tear_swing(elapsed))
        motion, seconds = recorder.motion(RUN), ticks * TICK_SECONDS
        return cls(duct.dissection, motion, replay.log.seed, seconds)

    @property
    def torn(self) -> bool:
        """Whether the duct tears in the run."""
        return self.motion.readings[-1].phase is not Phase.INTACT

    def pieces(self, *, edge_length: float) -> tuple[TornPiece, TornPiece] | None:
        """Return the two pieces that the duct tore into."""
        if not self.torn:
            return None
        check, edges = self.motion.readings[-1].check, self.edges(edge_length)
        return self.dissection.torn_at(check, edge_length=edges, seed=self.seed)

    def edges(self, wanted: float) -> float:
        """Return the length of the triangles' edges, mm: of a thin tube not above its radius."""
        return min(wanted, self.dissection.organ.mean_radius)


def rigged_runs(runs: Sequence[RecordedRun], *, edge_length: float) -> bytes:
    """Return a run, of a duct or of several tubes, as a binary glTF: a mesh and a rig for each."""
    return rigged_organs(
        [
            Rig(
                organ_skin(run.dissection.organ, edge_length=run.edges(edge_length)),
                run.dissection.driving,
                # Strands between tubes would need joints of both: a file of several has none.
                [run.motion if len(runs) == 1 else replace(run.motion, bed=None)],
                run.pieces(edge_length=edge_length),
                run.dissection.organ.mean_radius,
                run.names,
            )
            for run in runs
        ]
    )


def run_snapshots(
    runs: Sequence[RecordedRun], *, edge_length: float, last: bool = False
) -> Iterator[tuple[float, Snapshot]]:
    """Yield a dissection at its keys, or at its last one: times, s, tubes and strands."""
    times = runs[0].motion.times
    # Where a duct comes apart two keys have one time.
    keys = np.flatnonzero(np.diff(times, prepend=-1.0) > 0.0)[-1 if last else 0 :].tolist()
    of_tubes = [
        bed_snapshots(
            run.dissection,
            run.motion,
            run.pieces(edge_length=edge_length),
            keys,
            edge_length=run.edges(edge_length),
            names=run.names,
        )
        for run in runs
    ]
    for key, *moments in zip(keys, *of_tubes, strict=True):
        yield float(times[key]), Snapshot.joined(moments)
