"""Recorded runs at several tubes: the motion of each, with where it was torn or divided."""

import numpy as np

from app.export.motion import Motion, MotionKey, check_frames
from app.export.recorded_run import RUN, RecordedRun
from app.export.rigged_organ import Rig, rigged_organs
from app.simulation import FEW, PIECES, TICK_SECONDS, Replay, RunLog, tear_front
from organ_geometry import Organ
from organ_geometry.mesh import organ_skin
from physics import RuptureCheck

__all__ = ["recorded_tubes", "rigged_tubes"]


def recorded_tubes(log: RunLog, organ: Organ, *, frames: int) -> dict[str, RecordedRun]:
    """Return a logged run at several tubes as the motion of each, by its name, `frames` keys."""
    # A tube that tears or is divided comes apart at its first cut; a second one is not drawn.
    check_frames(frames)
    if not log.ticks:
        raise ValueError("a run of no ticks has nothing to play; move a hand, and wait")
    replay = Replay(log, organ, vertices=FEW)
    tissue = replay.session.spatial
    tubes = tissue.tubes
    keys: list[list[MotionKey]] = [[] for _ in tubes.names]
    cut_at: dict[int, tuple[int, RuptureCheck]] = {}  # tick and place of each tube's first cut
    for tick in np.unique(np.rint(np.linspace(0.0, log.ticks, frames)).astype(int)).tolist():
        replay.seek_tick(tick)
        reading, time = replay.session.reading(), tick * TICK_SECONDS
        for event in tissue.events:
            number = tubes.names.index(event.tube)
            if event.kind in ("tear", "division") and number not in cut_at:
                torn = tissue.tears[number] or RuptureCheck(
                    event.station, 1, 0.0, 0.0, tubes.strengths[number]
                )
                cut_at[number] = event.tick, torn
        for number, (dissection, surface) in enumerate(
            zip(tubes.dissections, tubes.surfaces, strict=True)
        ):
            element = tissue.torn_elements[number]
            first, second = dissection.rest_transforms(), dissection.rest_transforms()
            if element < 0:
                surface.move(tissue.beam, first)
                keys[number].append(MotionKey(time, first, reading))
                continue
            since, torn = cut_at[number]
            surface.move(tissue.beam, first, 0, element)
            surface.move(tissue.beam, second, 1, element)
            front = tear_front((tick - since) * TICK_SECONDS)
            keys[number].append(MotionKey(time, first, reading, front, second))
    return {
        name: RecordedRun(
            dissection,
            Motion.of(RUN, own),
            log.seed,
            cut_at[number][1] if number in cut_at else None,
        )
        for number, (name, dissection, own) in enumerate(
            zip(tubes.names, tubes.dissections, keys, strict=True)
        )
    }


def rigged_tubes(runs: dict[str, RecordedRun], *, edge_length: float) -> bytes:
    """Return tubes as one binary glTF: of each a named mesh with its own rig, and one animation."""
    rigs: list[Rig] = []
    for name, run in runs.items():
        organ = run.dissection.organ
        edges = min(edge_length, organ.mean_radius)  # of a thin tube not larger than that
        rigs.append(
            Rig(
                name,
                organ_skin(organ, edge_length=edges),
                run.dissection.driving,
                [run.motion],
                None if run.cut is None else run.pieces(edge_length=edges),
                organ.mean_radius,
                (f"{name}_{PIECES[0]}", f"{name}_{PIECES[1]}"),
            )
        )
    return rigged_organs(rigs)
