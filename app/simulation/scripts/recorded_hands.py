"""Careful runs of exercises by scripted hands: performed now, or recorded where that takes long."""

import lzma
from functools import cache
from pathlib import Path

import msgspec

from app.simulation.exercises.errors import Incident
from app.simulation.exercises.exercise import Exercise
from app.simulation.runs.run_file import RunFile
from app.simulation.scripts.scripted_hands import MANNERS, perform
from app.simulation.session.session import Session
from assets import RUNS

RECORDED = ("critical_view", "first_view")
"""Exercises whose careful run ships, which does what the page asks for next:
`tests/app/test_first_view.py` records them."""


class CarefulRun(msgspec.Struct, frozen=True):
    """A run of good scripted hands, and the errors in it."""

    run: RunFile
    incidents: list[Incident]

    @classmethod
    def read(cls, path: Path) -> "CarefulRun":
        """Return the run in a file that ships."""
        return msgspec.json.decode(lzma.decompress(path.read_bytes()), type=cls)

    def packed(self) -> bytes:
        """Return it as such a file has it."""
        return lzma.compress(msgspec.json.encode(self), preset=9)


def has_careful_run(exercise: Exercise) -> bool:
    """Return whether scripted hands can do an exercise."""
    return exercise.name in MANNERS or _recorded(exercise) is not None


def careful_run(session: Session) -> CarefulRun:
    """Return a careful run of the exercise that was started in a session, which it may take on."""
    exercise = session.run.exercise
    if exercise is None:
        raise ValueError("scripted hands do an exercise: start one")
    recorded = _recorded(exercise)
    if recorded is not None:
        return recorded
    perform(session, MANNERS[exercise.name]["good"])
    return CarefulRun(session.run_file(), session.run.incidents())


def _recorded(exercise: Exercise) -> CarefulRun | None:
    """Return the recorded run of an exercise, if it begins where that did."""
    if exercise.name not in RECORDED:
        return None
    found = _shipped(exercise.name)
    own = found.run.log.exercise
    return found if own is not None and own.opening == exercise.opening else None


@cache
def _shipped(name: str) -> CarefulRun:
    return CarefulRun.read(RUNS / f"{name}.json.xz")
