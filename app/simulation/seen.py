"""What was seen when: how a run at an anatomy came to its view, and what happened meanwhile."""

from typing import NamedTuple

from app.anatomy import tube_title
from app.simulation.clock import TICK_SECONDS, TICKS_PER_SECOND
from app.simulation.replay import Replay
from app.simulation.safety import ENOUGH, SOME, CriticalView, Safety
from app.simulation.spatial_tissue import EventKind

__all__ = ["Seen", "what_was_seen"]

LOOK_TICKS = TICKS_PER_SECOND
"""Ticks between two looks at the view."""
HAPPENED: dict[EventKind, str] = {
    "nick": "{} is nicked", "tear": "{} tears", "bleeding": "{} bleeds", "leak": "{} leaks bile",
    "stanched": "{} no longer loses anything", "clip": "{} is clipped",
    "division": "{} is divided",
}  # fmt: skip


class Seen(NamedTuple):
    """What came to be seen, or happened, and when."""

    seconds: float  # from the start of the run
    what: str


def what_was_seen(replay: Replay) -> list[Seen]:
    """Return what was seen and what happened in a run, in order; the replay goes to its end."""
    session = replay.session
    safety = Safety(session.spatial)
    out: list[Seen] = []
    reached: dict[str, float] = {}
    points = 0
    replay.seek_tick(0)
    for tick in [*range(LOOK_TICKS, replay.log.ticks, LOOK_TICKS), replay.log.ticks]:
        replay.seek_tick(tick)
        view = safety.critical_view()
        for what, fraction in _fractions(view):
            level = max((each for each in (SOME, ENOUGH) if fraction >= each), default=0.0)
            if level > reached.get(what, 0.0):
                reached[what] = level
                out.append(Seen(tick * TICK_SECONDS, what.format(f"{100.0 * level:.0f} %")))
        if view.total != points:
            out.append(Seen(tick * TICK_SECONDS, f"{view.total} of 6 points (before: {points})"))
            points = view.total
    start = session.spatial.ticks - replay.log.ticks
    out += [
        Seen(
            max(event.tick - start, 0) * TICK_SECONDS,
            HAPPENED[event.kind].format(tube_title(event.tube)),
        )
        for event in session.spatial.events
    ]
    return sorted(out, key=lambda each: each.seconds)


def _fractions(view: CriticalView) -> list[tuple[str, float]]:
    """Return the shares that a view is judged by, with a sentence that lacks the share."""
    return [
        *((f"{tube_title(name)}: {{}} of what holds its end at the gallbladder has parted", part)
          for name, part in view.structures.items()),
        ("{} of what holds the gallbladder's neck to other tubes has parted", view.neck),
        ("the triangle is cleared to {}", view.triangle),
        ("the lower third of the plate is freed to {}", view.plate),
    ]  # fmt: skip
