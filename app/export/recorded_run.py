"""Recorded runs as motions: what was done to the duct, key by key, and the tear it came to."""

from dataclasses import dataclass

import numpy as np

from app.export.bed_recorder import BedRecorder
from app.export.motion import WHOLE, Motion, MotionKey, check_frames
from app.export.rigged_organ import rigged_organ
from app.export.snapshot import Snapshot, bed_snapshots
from app.simulation import (
    AFTER_TEAR,
    FEW,
    TICK_SECONDS,
    Dissection,
    Phase,
    Replay,
    RunLog,
)
from organ_geometry import Organ
from organ_geometry.mesh import TornPiece, organ_skin
from physics import RuptureCheck

__all__ = ["RUN", "RecordedRun"]

RUN = "run"
"""Name of the motion."""


@dataclass(frozen=True, slots=True, eq=False)
class RecordedRun:
    """A replayed run as a motion, its times s from the first pull."""

    dissection: Dissection
    motion: Motion
    seed: int  # of the torn rim's raggedness
    cut: RuptureCheck | None = None  # where it comes apart, if the last reading does not say

    @classmethod
    def of_log(cls, log: RunLog, organ: Organ, *, frames: int) -> "RecordedRun":
        """Return a logged run: `frames` keys to its end or tear, then the recoil tick by tick."""
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
        return cls(dissection, Motion.of(RUN, keys), replay.log.seed)

    @classmethod
    def _of_space(cls, replay: Replay, frames: int) -> "RecordedRun":
        """Return a run in space, whose strands are recorded with it."""
        ticks, duct = replay.log.ticks, replay.session.spatial
        recorder = BedRecorder(duct.dissection, duct.surface, divided=duct.divided)
        shown = np.rint(np.linspace(0.0, ticks, frames)).astype(int)
        # A tear ends the run: the last key of the whole duct is the one before.
        for tick in np.unique([*shown, ticks - 1]).tolist():
            replay.seek_tick(tick)
            if duct.torn is None:
                recorder.add(tick * TICK_SECONDS, duct.beam, duct.reading())
        if duct.torn is not None:
            replay.seek_tick(ticks + AFTER_TEAR)
            recorder.add_tear(duct.beam, duct.torn_elements[0], duct.torn, run_step=TICK_SECONDS)
        return cls(duct.dissection, recorder.motion(RUN), replay.log.seed)

    @property
    def torn(self) -> bool:
        """Whether the run ends with a tear."""
        return self.motion.readings[-1].phase is not Phase.INTACT

    def pieces(self, *, edge_length: float) -> tuple[TornPiece, TornPiece] | None:
        """Return the two pieces that the duct tore into."""
        if not self.torn and self.cut is None:
            return None
        check = self.cut or self.motion.readings[-1].check
        return self.dissection.torn_at(check, edge_length=edge_length, seed=self.seed)

    def at_end(self, *, edge_length: float) -> Snapshot:
        """Return the duct at the end of a dissection, whole or in two pieces, with its strands."""
        pieces = self.pieces(edge_length=edge_length)
        keys = [len(self.motion.times) - 1]
        return next(
            bed_snapshots(self.dissection, self.motion, pieces, keys, edge_length=edge_length)
        )

    def rigged(self, *, edge_length: float) -> bytes:
        """Return the run as a binary glTF (`rigged_organ`)."""
        organ = self.dissection.organ
        return rigged_organ(
            organ_skin(organ, edge_length=edge_length),
            self.dissection.driving,
            [self.motion],
            self.pieces(edge_length=edge_length),
            radius=organ.mean_radius,
        )
