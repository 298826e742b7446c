"""What a teacher sees of a trainee at work: state, distance to break, the duct from the side."""

from typing import Any

import msgspec
import numpy as np

from app.simulation import Dissection, Session

MOST_POINTS = 40
"""Points of a duct's outline."""


class Live(msgspec.Struct, frozen=True):
    """A trainee at work."""

    work: str  # the exercise, or what is practised on
    state: str
    torn: bool
    distance: float  # to the break: 1 at rest, 0 at the break
    standing: str
    progress: float  # of the exercise, 0 to 1
    duct: list[tuple[float, float]]  # mm along and up, in the duct's frame
    hands: list[tuple[float, float]]  # tips of what holds the duct


def live(session: Session, *, replaying: bool) -> Live:
    """Return what a session is doing."""
    run = session.run
    reading, in_bed = session.reading(), session.specimen.bed is not None
    torn, distance = reading.torn_at is not None, reading.distance_to_break
    hands = [place for place, held in zip(reading.places, reading.holding, strict=True) if held]
    work = "A duct in its bed" if in_bed else "A free duct"
    standing = f"{reading.freed:.0f} mm free" if in_bed else f"{reading.force:.2f} N"
    if session.specimen.anatomy is not None:
        work, standing = "Calot's triangle", f"{reading.broken} strands broken"
    exercise = run.exercise
    if replaying:
        state = "watching a replay"
    elif exercise is None:
        state = "practising" if run.going else "torn" if torn else "at rest"
    elif run.outcome is not None:
        state, standing = "passed" if run.outcome.passed else "failed", ""
    elif run.over:
        state = "stopped"
    elif run.started:
        state, standing = f"{run.seconds:.0f} of {exercise.time_limit_s:.0f} s", run.standing
    else:
        state = "ready"
    return Live(
        work=work if exercise is None else exercise.title,
        state=state,
        torn=torn,
        distance=0.0 if torn else min(max(float(distance), 0.0), 1.0),
        standing=standing,
        progress=run.progress,
        duct=_outline(session.tissue.dissection, session.drawn.transforms),
        hands=[(round(float(x), 1), round(float(z), 1)) for x, _, z in hands],
    )


def _outline(dissection: Dissection, transforms: Any) -> list[tuple[float, float]]:
    """Return the axis as it lies now, from the side."""
    places = dissection.driving.positions
    every = max(1, -(-len(places) // MOST_POINTS))
    places, moves = places[::every], transforms[::every]
    moved = places + np.einsum("dij,dj->di", moves[:, :, :3], places) + moves[:, :, 3]
    seen = dissection.in_frame(moved)
    return [(round(float(x), 1), round(float(z), 1)) for x, _, z in seen]
