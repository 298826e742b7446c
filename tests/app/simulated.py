"""Organs that tests of the application pull, and how they pull them."""

from functools import cache

from app.command_line.load import shipped_organ
from app.simulation.session import Phase, Session
from organ_geometry.organ import Organ

SECONDS = 1.0 / 30.0
"""One step."""


@cache
def phantom() -> Organ:
    """The organ of the shipped images, built once."""
    return shipped_organ()


def settle(session: Session, *, most_seconds: float = 30.0) -> None:
    """Step until nothing changes any more."""
    for _ in range(round(most_seconds / SECONDS)):
        if not session.step(SECONDS):
            return
    raise AssertionError(f"still moving after {most_seconds} s: {session.reading()}")


def pull(session: Session, force: float) -> None:
    """Pull with a force until the duct is at rest under it, or torn."""
    session.set_force(force)
    settle(session)


def tear(session: Session) -> None:
    """Pull until the duct is in two pieces and at rest."""
    pull(session, session.force_limit)
    assert session.reading().phase is Phase.TORN
