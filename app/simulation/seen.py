"""What was seen when: how a run at an anatomy came to its view, and what happened meanwhile."""

from typing import NamedTuple

from app.anatomy import tube_title
from app.simulation.exercises.critical_view import MOST_POINTS, CriticalView
from app.simulation.inputs.clock import TICK_SECONDS, TICKS_PER_SECOND
from app.simulation.session.session import Session
from app.simulation.tissue.safety import ONE_POINT, TWO_POINTS, Safety
from app.simulation.tissue.spatial_tissue import EventKind

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


class Sights:
    """Takes what was seen and what happened while a run is replayed, tick by tick."""

    def __init__(self, session: Session, ticks: int) -> None:
        self._session, self._last = session, ticks
        self._safety = Safety(session.spatial)
        self._seen: list[Seen] = []
        self._reached: dict[str, float] = {}
        self._points = 0

    def look(self, tick: int) -> None:
        """Look at the session after a tick of its run, from 1; only some are looked at."""
        if tick % LOOK_TICKS and tick != self._last:
            return
        view, now, seen = self._safety.critical_view(), tick * TICK_SECONDS, self._seen
        for what, fraction in _fractions(view):
            level = max((each for each in (ONE_POINT, TWO_POINTS) if fraction >= each), default=0.0)
            if level > self._reached.get(what, 0.0):
                self._reached[what] = level
                seen.append(Seen(now, what.format(f"{100.0 * level:.0f} %")))
        # What is divided between clips is no part of the view any more, and takes nothing from it.
        divided = any(each.kind == "division" for each in self._session.spatial.events)
        if view.total > self._points or (view.total < self._points and (view.torn or not divided)):
            seen.append(Seen(now, f"{view.total} of {MOST_POINTS} points (before: {self._points})"))
            self._points = view.total
        if tick == self._last:
            spatial = self._session.spatial
            start = spatial.ticks - tick
            seen += [
                Seen(
                    max(event.tick - start, 0) * TICK_SECONDS,
                    HAPPENED[event.kind].format(tube_title(event.tube)),
                )
                for event in spatial.events
            ]
            seen += [
                Seen(
                    max(mark.tick - start, 0) * TICK_SECONDS,
                    f"{tube_title(mark.tube)} is marked as the {mark.structure}",
                )
                for mark in spatial.marks
            ]

    @property
    def seen(self) -> list[Seen]:
        """What was seen and what happened, in order."""
        return sorted(self._seen, key=lambda each: each.seconds)


def _fractions(view: CriticalView) -> list[tuple[str, float]]:
    """Return the shares that a view is judged by, with a sentence that lacks the share."""
    return [
        *((f"{tube_title(name)}: {{}} of what holds its end at the gallbladder has parted", loose)
          for name, loose in view.structures.items()),
        ("{} of what holds the gallbladder's neck to other tubes has parted", view.neck),
        ("the triangle is cleared to {}", view.triangle),
        ("the lower third of the cystic plate is freed to {}", view.plate),
    ]  # fmt: skip
