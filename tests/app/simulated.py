"""Organs that tests of the application pull, and how they pull them."""

from functools import cache

from app.command_line.load import shipped_organ
from app.simulation import (
    TICKS_PER_SECOND,
    VERTICES,
    BedPreset,
    Exercise,
    Phase,
    Preset,
    Replay,
    RunFile,
    Session,
    exercises_offered,
    free_specimen,
    specimen_in_bed,
)
from organ_geometry.organ import Organ


@cache
def phantom() -> Organ:
    """The organ of the shipped images, built once."""
    return shipped_organ()


def pull_session(
    organ: Organ, preset: Preset | None = None, *, vertices: int = VERTICES, seed: int = 1
) -> Session:
    """A session of a free duct in the plane of its pull."""
    return Session(free_specimen(organ, preset), vertices=vertices, seed=seed)


def bed_session(
    organ: Organ,
    preset: Preset | None = None,
    bed: BedPreset | None = None,
    *,
    bed_seed: int = 1,
    vertices: int = VERTICES,
    seed: int = 1,
) -> Session:
    """A session of a duct in a bed."""
    specimen = specimen_in_bed(organ, preset, bed, bed_seed=bed_seed)
    return Session(specimen, vertices=vertices, seed=seed)


def bed_exercises(session: Session) -> list[Exercise]:
    """The exercises of a duct in a bed."""
    return [each for each in exercises_offered(session) if each.opening is not None]


def replayed(run: RunFile, organ: Organ) -> RunFile:
    """Return a run as it comes out when it is made again."""
    return Replay(run.log, organ, vertices=300).run_file()


def settle(session: Session, *, most_seconds: float = 30.0) -> None:
    """Step until nothing changes any more."""
    for _ in range(round(most_seconds * TICKS_PER_SECOND)):
        if not session.advance():
            return
    raise AssertionError(f"still moving after {most_seconds} s: {session.reading()}")


def pull(session: Session, force: float) -> None:
    """Pull with a force until the duct is at rest under it, or torn."""
    session.set_target_force(force)
    settle(session)


def tear(session: Session) -> None:
    """Pull until the duct is in two pieces and at rest."""
    pull(session, session.planar.force_limit)
    assert session.reading().phase is Phase.TORN
