"""Strands of a bed in a motion: where they are drawn, how they are loaded, and which have parted.

A whole strand is a straight line from its foot on the bed to the organ's surface. A parted one
leaves a stub at either end: what it was at rest, up to `STUB_MM`, one fixed to the bed and the
other to the organ.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from app.simulation import SurfaceMapping
from organ_geometry import DrivingPoints

Floats = NDArray[np.float64]

# Length of a stub, and most of its strand's length at rest.
STUB_MM, STUB_FRACTION = 1.0, 0.35


@dataclass(frozen=True, slots=True, eq=False)
class StrandsSnapshot:
    """Strands at one moment, in the organ's coordinates."""

    feet: Floats  # (S, 2, 3) on the bed, and the tip of the stub there, mm
    ends: Floats  # (S, 2, 3) on the organ, and the tip of the stub there, mm
    damage: Floats  # (S,) 0 whole to 1 parted
    force: Floats  # (S,) N

    @classmethod
    def joined(cls, snapshots: "Sequence[StrandsSnapshot]") -> "StrandsSnapshot":
        """Return the strands of several tubes as one."""
        return cls(
            *(
                np.concatenate([getattr(each, name.name) for each in snapshots])
                for name in fields(cls)
            )
        )

    @property
    def parted(self) -> NDArray[np.bool_]:
        """(S,) whether each has parted."""
        return self.damage >= 1.0

    def lines(self) -> tuple[Floats, NDArray[np.intp]]:
        """Return (L, 2, 3) lines, mm, and (L,) the strand that each belongs to."""
        whole, parted = np.flatnonzero(~self.parted), np.flatnonzero(self.parted)
        across = np.stack([self.feet[whole, 0], self.ends[whole, 0]], axis=1)
        lines = np.concatenate([across, self.feet[parted], self.ends[parted]])
        return lines, np.concatenate([whole, parted, parted])


def stubs(feet: Floats, ends: Floats) -> tuple[Floats, Floats]:
    """Return (S, 2, 3) feet and ends of strands, mm, each with the tip of its stub."""
    direction = feet - ends
    length = np.sqrt((direction**2).sum(axis=1, keepdims=True))
    stub = direction * np.minimum(STUB_FRACTION, STUB_MM / length)
    return np.stack([feet, feet - stub], axis=1), np.stack([ends, ends + stub], axis=1)


@dataclass(frozen=True, slots=True, eq=False)
class BedTrack:
    """What becomes of a bed in a motion of T keys: S strands, and the stresses they cause."""

    surface: SurfaceMapping
    strand_stations: Floats  # (S,) along the organ's axis, mm
    feet: Floats  # (S, 2, 3) as of a `StrandsSnapshot`, at rest
    ends: Floats  # (S, 2, 3) at rest
    on_tubes: NDArray[np.intp]  # (K,) numbers of the strands whose feet are on another tube
    shifts: Floats  # (T, K, 3) how far those feet have moved, mm
    damage: Floats  # (T, S) 0 whole to 1 parted
    force: Floats  # (T, S) N
    freed: Floats  # (T,) length of organ whose strands have parted, mm
    stations: Floats  # (T, N) of the beam's nodes, mm from the first clamp
    stresses: Floats  # (T, N - 1, 2, 3) MPa (`BeamOnBed.stresses`)
    tear: float | None = None  # where the organ tears, mm along its axis
    divided: bool = False  # whether the organ ends at its second clamp, which is gone

    def binding(self, driving: DrivingPoints, stations: Floats) -> tuple[NDArray[np.int32], Floats]:
        """Return the first of the two driving points that places follow, the second's weight."""
        index, weight = driving.binding(stations)
        if self.tear is not None:  # what is beside the tear follows its own piece alone
            before, after = driving.stations[index], driving.stations[index + 1]
            beside = (before < self.tear) & (after >= self.tear)
            weight = np.where(beside, stations >= self.tear, weight)
        return index, weight

    def strands_at(self, key: int, driving: DrivingPoints, transforms: Floats) -> StrandsSnapshot:
        """Return the strands at a key, moved by the driving points' transforms there."""
        index, weight = self.binding(driving, self.strand_stations)
        weight = weight[:, None, None]
        blended = (1.0 - weight) * transforms[index] + weight * transforms[index + 1]
        moved = self.ends + np.einsum("sij,spj->spi", blended[..., :3], self.ends)
        moved += blended[:, None, :, 3]
        feet = self.feet.copy()
        feet[self.on_tubes] += self.shifts[key][:, None]
        return StrandsSnapshot(feet, moved, self.damage[key], self.force[key])

    def freed_at(self, key: int, stations: Floats) -> Floats:
        """Return the share of strands that have parted about stations, mm from the first clamp."""
        return self.surface.freed_at(self.damage[key], stations)
