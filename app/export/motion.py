"""Motions: how an organ's driving points move in time, how far a tear has run, what is read.

A prescribed pull and a recorded run both give one, and every file that moves is written from it:
what is solved for a key is solved once.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.simulation import (
    FRONT_SECONDS,
    SETTLED_SECONDS,
    Dissection,
    Phase,
    Reading,
    tear_front,
    tear_swing,
)
from physics import BreakEvent, Theory, check_rupture, critical_stations

__all__ = [
    "MOST_FRAMES",
    "RECOIL_STEP",
    "WHOLE",
    "Motion",
    "MotionKey",
    "check_frames",
    "pull_motion",
    "tear_motion",
]

WHOLE = -1.0
"""The front of a tear that has not begun."""
MOST_FRAMES = 2000
"""Keys of a pull: half a minute at 60 a second, beyond which a viewer's own blend is as smooth."""
PULL_SECONDS = 2.0
"""How long a pull is shown."""
RUN_STEP = 0.1
"""Time between keys while the front runs, s, for viewers that blend between them."""
RECOIL_STEP = 0.05
"""Time between keys while the pieces swing, s: ten to a swing."""


@dataclass(frozen=True, slots=True, eq=False)
class MotionKey:
    """One moment of a motion.

    Attributes
    ----------
    time
        s.
    transforms
        (D, 3, 4) transforms of the driving points less the identity (`DrivingPoints.transforms`).
    reading
        What the instruments show.
    front
        How far the tear has run (`tear_front`); `WHOLE` while there is none.
    """

    time: float
    transforms: NDArray[np.float64]
    reading: Reading
    front: float = WHOLE


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """A motion of an organ, key by key.

    Attributes
    ----------
    name
        What it is called.
    times
        (T,) s, growing; where the organ comes apart, the last key of the whole and the first of
        the pieces have the same.
    transforms
        (T, D, 3, 4) transforms of the driving points less the identity.
    fronts
        (T,) how far the tear has run; `WHOLE` while there is none.
    readings
        (T,) what the instruments show.

    Raises
    ------
    ValueError
        If there is no key, or time does not grow.
    """

    name: str
    times: NDArray[np.float64]
    transforms: NDArray[np.float64]
    fronts: NDArray[np.float64]
    readings: tuple[Reading, ...]

    def __post_init__(self) -> None:
        if not self.times.size:
            raise ValueError(f"motion {self.name!r} has no key")
        for part in (self.whole, ~self.whole):
            if not (np.diff(self.times[part]) > 0.0).all():
                raise ValueError(f"times of motion {self.name!r} must grow from key to key")
        if not (np.diff(self.times) >= 0.0).all():
            raise ValueError(f"times of motion {self.name!r} must not fall")

    @classmethod
    def of(cls, name: str, keys: Iterable[MotionKey]) -> "Motion":
        """Return the motion of a series of keys, a recorded run for example."""
        series = list(keys)
        if not series:
            raise ValueError(f"motion {name!r} has no key")
        return cls(
            name,
            np.array([key.time for key in series]),
            np.stack([key.transforms for key in series]),
            np.array([key.front for key in series]),
            tuple(key.reading for key in series),
        )

    @property
    def whole(self) -> NDArray[np.bool_]:
        """(T,) at which keys the organ is whole."""
        return self.fronts < 0.0


def check_frames(frames: int) -> None:
    """Raise if a motion cannot have so many keys."""
    if not 2 <= frames <= MOST_FRAMES:
        raise ValueError(
            f"frames must be 2 (rest and pulled) to {MOST_FRAMES:,} (half a minute at 60 a "
            f"second), got {frames:,}"
        )


def pull_motion(
    dissection: Dissection,
    theory: Theory,
    *,
    grasp: float,
    force: float,
    frames: int,
    threshold: float,
    breaks_at: BreakEvent | None = None,
) -> Motion:
    """Return the motion from rest to a force, in equilibrium all the way."""
    check_frames(frames)
    beam = dissection.beam
    pull = theory.pull(beam, grasp)
    driven, critical = dissection.beam_stations, critical_stations(beam, grasp)
    stations = np.concatenate([driven, critical])
    held = driven.size + int(np.searchsorted(critical, grasp))
    rest = dissection.axis_point(grasp) - dissection.axis_point(0.0)
    x, y, z = (dissection.frame.T @ rest).tolist()
    transforms = np.zeros((frames, *dissection.rest_transforms().shape))
    readings: list[Reading] = []
    for key, at in enumerate(np.linspace(0.0, force, frames).tolist()):
        pulled = pull.to_force(at).sample(stations)
        if key:  # the first is rest itself, to the bit
            dissection.move(pulled.part(slice(None, driven.size)), transforms[key])
        lifted = pulled.deflection
        readings.append(
            Reading(
                phase=Phase.INTACT,
                force=pulled.force,
                deflection=lifted,
                check=check_rupture(pulled.part(slice(driven.size, None)), threshold),
                breaks_at=breaks_at,
                deepest=lifted,
                hook=(x + float(pulled.along[held]) - grasp, y, z + lifted),
                held=True,
            )
        )
    times = np.linspace(0.0, PULL_SECONDS, frames)
    return Motion("pull", times, transforms, np.full(frames, WHOLE), tuple(readings))


def tear_motion(
    dissection: Dissection,
    theory: Theory,
    *,
    grasp: float,
    event: BreakEvent,
    frames: int,
    threshold: float,
    run_step: float = RUN_STEP,
) -> Motion:
    """Return the motion from rest over the break until both pieces lie still."""
    pull = pull_motion(
        dissection,
        theory,
        grasp=grasp,
        force=event.force,
        frames=frames,
        threshold=threshold,
        breaks_at=event,
    )
    at_break = (
        theory.pull(dissection.beam, grasp).to_force(event.force).sample(dissection.beam_stations)
    )
    run, settled = FRONT_SECONDS, SETTLED_SECONDS
    elapsed = np.concatenate(
        [
            np.linspace(0.0, run, round(run / run_step) + 1),
            np.linspace(run, settled, round((settled - run) / RECOIL_STEP) + 1)[1:],
        ]
    )
    fronts = np.array([tear_front(each) for each in elapsed.tolist()])
    torn = np.zeros((elapsed.size, *pull.transforms.shape[1:]))
    for key, seconds in enumerate(elapsed.tolist()):
        dissection.move(at_break, torn[key], part=tear_swing(seconds))
    # The hook stays where it tore the duct, and what it read is the break's.
    tearing = replace(pull.readings[-1], phase=Phase.TEARING, held=False)
    parted = replace(tearing, phase=Phase.TORN, force=0.0, deflection=0.0)
    readings = tuple(tearing if front < 1.0 else parted for front in fronts.tolist())
    return Motion(
        "tear",
        np.concatenate([pull.times, pull.times[-1] + elapsed]),
        np.concatenate([pull.transforms, torn]),
        np.concatenate([pull.fronts, fronts]),
        pull.readings + readings,
    )
