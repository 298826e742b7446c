"""The policy beside a page's exercise: none, one that leads the second hand, or a ghost."""

from collections.abc import Callable
from typing import Literal, Protocol, TypeAlias

from app.simulation import Session

Role = Literal["none", "hand", "ghost"]


class Companion(Protocol):
    """A policy at work beside a session (`app.rl.companion`)."""

    session: Session
    is_ghost: bool
    hands: tuple[int, ...]
    fault: str

    @property
    def acts(self) -> bool:
        """Whether it is at work."""
        ...

    def tick(self) -> None:
        """Lead its hands for a tick, before the trainee's session advances."""
        ...

    def stop(self) -> None:
        """Leave what it is at work on."""
        ...


StartCompanion: TypeAlias = Callable[[Session, bool], Companion]
"""Starts a policy beside a session, as a ghost or not; a `ValueError` where it does not fit."""


class Beside:
    """What acts beside a page's session: `start` starts it, None if the trainer has no policy.

    `role` is what the trainee has chosen; `say` tells why it does not act.
    """

    def __init__(self, start: StartCompanion | None, say: Callable[[str], object]) -> None:
        self._start, self._say = start, say
        self.role: Role = "none"
        self._companion: Companion | None = None

    @property
    def offered(self) -> bool:
        """Whether there is a policy."""
        return self._start is not None

    @property
    def ghost(self) -> Session | None:
        """The session of a ghost, if there is one."""
        companion = self._companion
        return companion.session if companion is not None and companion.is_ghost else None

    def leads(self, hand: int) -> bool:
        """Whether it has a hand of the trainee's."""
        companion = self._companion
        return (
            companion is not None
            and not companion.is_ghost
            and hand in companion.hands
            and companion.acts
        )

    def begin(self, session: Session) -> None:
        """Begin anew beside an exercise, if one waits or goes on."""
        before, self._companion = self._companion, None
        if before is not None:
            before.stop()
        run = session.run
        if self._start is None or self.role == "none" or run.exercise is None or run.over:
            return
        try:
            self._companion = self._start(session, self.role == "ghost")
        except ValueError as error:
            self._say(f"{str(error)[:1].upper()}{str(error)[1:]}.")

    def advance(self, session: Session, ticks: int) -> bool:
        """Advance a session and what acts beside it; return whether anything has moved."""
        companion = self._companion
        if companion is None:
            return session.advance(ticks)
        changed = False
        for _ in range(ticks):
            companion.tick()
            changed |= session.advance() or (companion.is_ghost and companion.acts)
        if companion.fault:
            self._companion = None
            self._say(f"{companion.fault[:1].upper()}{companion.fault[1:]}.")
        return changed
