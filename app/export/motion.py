"""Motions: an organ's driving points in time, how far a tear has run, and the readings.

A prescribed pull and a recorded run both give one, and every file that moves is written from it,
so that the equilibrium of a key is solved once.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.export.strands import BedTrack, StrandsSnapshot
from app.simulation import FRONT_SECONDS, SETTLED_SECONDS, Reading
from organ_geometry import DrivingPoints

WHOLE = -1.0
"""Value of `front` while there is no tear."""
MOST_FRAMES = 2000
"""Most keys of a pull: half a minute at 60 Hz. With more, a viewer's own blending is as smooth."""
PAGE_FRAMES = 300
"""Keys of a run in a page by default."""
RUN_STEP = 0.1
"""s between keys while the front runs, for viewers that blend between them."""
RECOIL_STEP = 0.05
"""s between keys while the pieces swing: ten to a period."""


@dataclass(frozen=True, slots=True, eq=False)
class MotionKey:
    """One moment of a motion."""

    time: float  # s
    transforms: NDArray[np.float64]  # (D, 3, 4), less the identity (`DrivingPoints.transforms`)
    reading: Reading
    front: float = WHOLE  # progress of the tear (`tear_front`); `WHOLE` without one
    second: NDArray[np.float64] | None = None  # as `transforms`, where the second piece has its own


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """A motion of an organ, key by key; a `ValueError` if it has no key or time does not grow.

    Where the organ comes apart, the last key of the whole and the first of the pieces have one
    time.
    """

    name: str
    times: NDArray[np.float64]  # (T,) s
    transforms: NDArray[np.float64]  # (T, D, 3, 4), of the driving points, less the identity
    fronts: NDArray[np.float64]  # (T,) how far the tear has run; `WHOLE` while there is none
    readings: tuple[Reading, ...]  # T
    bed: BedTrack | None = None  # what becomes of the bed that the organ lies in, if it does
    second: NDArray[np.float64] | None = None  # as `transforms`, of the second piece where it parts

    def __post_init__(self) -> None:
        for chosen in (self.whole, ~self.whole):
            if not (np.diff(self.times[chosen]) > 0.0).all():
                raise ValueError(f"times of motion {self.name!r} must grow from key to key")
        if not (np.diff(self.times) >= 0.0).all():
            raise ValueError(f"times of motion {self.name!r} must not fall")

    @classmethod
    def of(cls, name: str, keys: Iterable[MotionKey], bed: BedTrack | None = None) -> "Motion":
        """Return the motion of a series of keys, a recorded run for example."""
        series = list(keys)
        if not series:
            raise ValueError(f"motion {name!r} has no key")
        second = None
        if any(key.second is not None for key in series):
            each = (key.transforms if key.second is None else key.second for key in series)
            second = np.stack(list(each))
        return cls(
            name,
            np.array([key.time for key in series]),
            np.stack([key.transforms for key in series]),
            np.array([key.front for key in series]),
            tuple(key.reading for key in series),
            bed,
            second,
        )

    def of_piece(self, piece: int) -> "Motion":
        """Return the motion whose transforms are those of piece 0 or 1."""
        if piece == 0 or self.second is None:
            return self
        return replace(self, transforms=self.second)

    def of_strands(self, driving: DrivingPoints) -> "Motion":
        """Return the motion whose transforms are those that the strands' ends follow."""
        keys = range(len(self.times))
        return replace(self, transforms=np.stack([self._led(key, driving) for key in keys]))

    def strands_at(self, key: int, driving: DrivingPoints) -> StrandsSnapshot | None:
        """Return the strands at a key; None without a bed."""
        if self.bed is None:
            return None
        return self.bed.strands_at(key, driving, self._led(key, driving))

    def _led(self, key: int, driving: DrivingPoints) -> NDArray[np.float64]:
        """Return the (D, 3, 4) transforms that strands' ends follow at a key."""
        if self.second is None or self.bed is None or self.bed.tear is None:
            return self.transforms[key]
        led, beyond = self.transforms[key].copy(), driving.stations >= self.bed.tear
        led[beyond] = self.second[key][beyond]
        return led

    def nicks(self) -> list[dict[str, object]]:
        """Return the tears that go part of the way, each by its depth, mm, at the keys it has."""
        found: dict[float, dict[float, float]] = {}
        for time, reading in zip(self.times.tolist(), self.readings, strict=True):
            for nick in reading.nicks:
                found.setdefault(nick.station, {})[time] = nick.depth_mm
        return [
            {"station_mm": station, "time_s": [*depths], "depth_mm": [*depths.values()]}
            for station, depths in found.items()
        ]

    @property
    def whole(self) -> NDArray[np.bool_]:
        """(T,) whether the organ is whole at each key."""
        return self.fronts < 0.0


def check_frames(frames: int) -> None:
    """Raise if a motion cannot have this number of keys."""
    if not 2 <= frames <= MOST_FRAMES:
        raise ValueError(
            f"frames must be 2 (rest and pulled) to {MOST_FRAMES:,} (half a minute at 60 a "
            f"second), got {frames:,}"
        )


def recoil_times(run_step: float) -> NDArray[np.float64]:
    """Return times after the start of a tear, s, `run_step` apart while its front runs."""
    run, settled = FRONT_SECONDS, SETTLED_SECONDS
    return np.concatenate(
        [
            np.linspace(0.0, run, round(run / run_step) + 1),
            np.linspace(run, settled, round((settled - run) / RECOIL_STEP) + 1)[1:],
        ]
    )
