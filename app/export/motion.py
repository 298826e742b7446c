"""Motions: how an organ's driving points move in time, and how far a tear has run."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.simulation import tear_course
from app.simulation.dissection import Dissection
from physics import BreakEvent, Theory

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
    front
        How far the tear has run (`tear_course.front`); `WHOLE` while there is none.
    """

    time: float
    transforms: NDArray[np.float64]
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

    Raises
    ------
    ValueError
        If there is no key, or time does not grow.
    """

    name: str
    times: NDArray[np.float64]
    transforms: NDArray[np.float64]
    fronts: NDArray[np.float64]

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
    dissection: Dissection, theory: Theory, *, grasp: float, force: float, frames: int
) -> Motion:
    """Return the motion from rest to a force, in equilibrium all the way."""
    check_frames(frames)
    pull = theory.pull(dissection.beam, grasp)
    stations = dissection.beam_stations
    transforms = np.zeros((frames, *dissection.rest_transforms().shape))
    # The first key is rest itself, to the bit.
    for key, at in enumerate(np.linspace(0.0, force, frames)[1:].tolist(), start=1):
        dissection.move(pull.to_force(at).sample(stations), transforms[key])
    times = np.linspace(0.0, PULL_SECONDS, frames)
    return Motion("pull", times, transforms, np.full(frames, WHOLE))


def tear_motion(
    dissection: Dissection,
    theory: Theory,
    *,
    grasp: float,
    event: BreakEvent,
    frames: int,
    run_step: float = RUN_STEP,
) -> Motion:
    """Return the motion from rest over the break until both pieces lie still."""
    pull = pull_motion(dissection, theory, grasp=grasp, force=event.force, frames=frames)
    at_break = (
        theory.pull(dissection.beam, grasp).to_force(event.force).sample(dissection.beam_stations)
    )
    run, settled = tear_course.RUN_SECONDS, tear_course.SETTLED_SECONDS
    elapsed = np.concatenate(
        [
            np.linspace(0.0, run, round(run / run_step) + 1),
            np.linspace(run, settled, round((settled - run) / RECOIL_STEP) + 1)[1:],
        ]
    )
    torn = np.zeros((elapsed.size, *pull.transforms.shape[1:]))
    for key, seconds in enumerate(elapsed.tolist()):
        dissection.move(at_break, torn[key], part=tear_course.swing(seconds))
    return Motion(
        "tear",
        np.concatenate([pull.times, pull.times[-1] + elapsed]),
        np.concatenate([pull.transforms, torn]),
        np.concatenate([pull.fronts, [tear_course.front(each) for each in elapsed.tolist()]]),
    )
