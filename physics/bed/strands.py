"""Strands of loose connective tissue between a beam and its bed, or between two tubes.

A strand's force f over its elongation u (beyond the length L at which it comes taut) is a bilinear
cohesive law: 0 for u < 0, k u to the yield elongation u_0, then k u_0 (u_f - u)/(u_f - u_0), 0 from
u_f on. The energy to part it is k u_0 u_f / 2. Softening, u_f/u_0, of 1.5 or more spreads the front
over several strands: brittle strands read too tough, by how far a front is trapped between two
(docs/theory.md).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from physics.bed.space_beam import SpaceBeam

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Numbers of a bed are rounded to multiples of this, mm, N/mm. Sines and roots differ far less than
# that between machines, so that a seed gives the same bed on all.
GRAIN = 2.0**-32


@dataclass(frozen=True, eq=False)
class Strands:
    """S strands: where they are at rest, and their law.

    A strand carries nothing while it is shorter than `length`, then `stiffness` for each mm more;
    from `yield_elongation` on it softens, and at `failure_elongation` it has parted: the energy to
    part it is stiffness yield_elongation failure_elongation / 2. In a network a strand holds one of
    its `tubes`, and its foot may be on another, `to`. Arrays are copied, rounded to `GRAIN` and
    locked.
    """

    stations: Floats  # (S,) where they hold the beam, mm from its first end
    ends: Floats  # (S, 3) places on the beam's surface at rest, mm
    feet: Floats  # (S, 3) places on the bed, mm
    stiffness: Floats  # (S,) k, N/mm
    length: Floats  # (S,) L, at which they come taut, mm
    yield_elongation: Floats  # (S,) elongations u_0 at which they begin to soften, mm
    failure_elongation: Floats  # (S,) elongations u_f at which they have parted, mm
    bilateral: Floats  # (S,) 1 for a strand that also pushes when it is shorter, else 0
    # (S,) numbers of the tubes that they hold; the first one's if left empty
    tubes: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    # (S,) numbers of the tubes that their feet are on, -1 for the bed; the bed if left empty
    to: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    # (S,) where that is, mm from that tube's first end
    to_stations: Floats = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        count = np.asarray(self.stations).size
        for name, number in (("tubes", 0), ("to", -1)):
            given = np.array(getattr(self, name), dtype=np.int64)
            whole = given if given.size else np.full(count, number)
            if whole.shape != (count,):
                raise ValueError(f"{name} of {count} strands must have the shape {(count,)}")
            whole.setflags(write=False)
            object.__setattr__(self, name, whole)
        if not np.asarray(self.to_stations).size:
            object.__setattr__(self, "to_stations", np.zeros(count))
        for each in fields(self):
            if each.name in ("tubes", "to"):
                continue
            value = np.asarray(getattr(self, each.name), dtype=np.float64)
            shape = (count, 3) if each.name in ("ends", "feet") else (count,)
            if value.shape != shape:
                raise ValueError(f"{each.name} of {count} strands must have the shape {shape}")
            if not np.all(np.isfinite(value)):
                raise ValueError(f"{each.name} of a strand must be finite numbers of mm or N/mm")
            rounded = np.rint(value / GRAIN) * GRAIN
            # A stiffness far below a grain is kept to as many digits instead.
            rounded = np.where(np.abs(value) < 1e-4, value, rounded)
            rounded.setflags(write=False)
            object.__setattr__(self, each.name, rounded)
        for name, unit in (("stiffness", "N/mm"), ("length", "mm"), ("yield_elongation", "mm")):
            value: Floats = getattr(self, name)
            if count and not value.min() > 0.0:
                at = float(self.stations[int(np.argmin(value))])
                word = {"yield_elongation": "elongation at which it yields"}.get(name, name)
                raise ValueError(
                    f"a strand's {word} must be above 0 {unit}, got {value.min():g} {unit} "
                    f"at {at:g} mm: it would have no strength"
                )
        if count and not np.all(self.failure_elongation >= self.yield_elongation):
            raise ValueError("a strand must part at an elongation beyond that at which it yields")
        # A strand that parts at once still softens, within a millionth of its elongation.
        failure = np.maximum(self.failure_elongation, self.yield_elongation * (1.0 + 1e-6))
        failure.setflags(write=False)
        object.__setattr__(self, "failure_elongation", failure)

    @property
    def count(self) -> int:
        """How many there are."""
        return self.stations.size

    @property
    def toughness(self) -> Floats:
        """(S,) energies to part them, mJ."""
        return 0.5 * self.stiffness * self.yield_elongation * self.failure_elongation

    @property
    def strength(self) -> Floats:
        """(S,) largest forces they bear, N."""
        return self.stiffness * self.yield_elongation

    @cached_property
    def tributary_lengths(self) -> Floats:
        """(S,) lengths of beam that they stand for, mm: half-way to the next stations either way.

        At the first and the last station as far out as in; strands at one station share alike.
        """
        out = np.zeros(self.count)
        for tube in np.unique(self.tubes):
            mine = self.tubes == tube
            at, which, count = np.unique(
                self.stations[mine], return_inverse=True, return_counts=True
            )
            if at.size > 1:
                gaps = np.diff(at)
                halves = 0.5 * np.concatenate([gaps[:1], gaps])
                after = 0.5 * np.concatenate([gaps, gaps[-1:]])
                out[mine] = ((halves + after) / count)[which]
        out.setflags(write=False)
        return out

    def forces(self, ends: Floats, feet: Floats, damage: Floats) -> Floats:
        """(S,) forces with ends and feet at (S, 3), mm, and (S,) damage, N."""
        elongation = np.sqrt(((ends - feet) ** 2).sum(axis=1)) - self.length
        taut = (elongation > 0.0) | (self.bilateral > 0.0)
        return np.where(taut, (1.0 - damage) * self.stiffness * elongation, 0.0)

    @classmethod
    def none(cls) -> "Strands":
        """Return no strands at all."""
        row = np.zeros(0)
        return cls(row, np.zeros((0, 3)), np.zeros((0, 3)), row, row, row, row, row)

    @classmethod
    def joined(cls, beds: Sequence["Strands"]) -> "Strands":
        """Return the strands of several beds as one."""
        if not beds:
            return cls.none()
        return cls(
            *(np.concatenate([getattr(bed, each.name) for bed in beds]) for each in fields(cls))
        )

    def some(self, which: Ints) -> "Strands":
        """Return some of them by their numbers."""
        return Strands(*(getattr(self, each.name)[which] for each in fields(self)))

    @classmethod
    def between(
        cls,
        beam: SpaceBeam,
        stations: Floats,
        *,
        around: Floats,
        out: Floats,
        gap: float | Floats,
        lean: Floats,
        slack: Floats,
        stiffness: Floats,
        yield_elongation: Floats,
        failure_elongation: Floats,
        bilateral: bool = False,
        up: tuple[float, float, float] = (0.0, 0.0, 1.0),
    ) -> "Strands":
        """Return strands from a beam at rest down to the bed under it.

        Parameters
        ----------
        beam, stations
            The beam, and (S,) where they hold it, mm from its first end.
        around, out
            (S,) angles about the axis from straight down, rad, positive towards y; and distances
            from the axis, mm.
        gap
            Depth of the bed's surface under the beam's lowest strand end, mm.
        lean
            (S, 2) how far feet are off the point below, along the axis and across it, mm.
        slack
            (S,) mm before they come taut.
        stiffness, yield_elongation, failure_elongation, bilateral
            (S,) and one for all; see the class.
        up
            Unit direction away from the bed.

        Returns
        -------
        Strands
            As many.
        """
        place, frame = beam.frames_at(stations, up)
        along, across, above = frame[:, 0], frame[:, 1], frame[:, 2]
        side, down = out * np.sin(around), out * np.cos(around)
        ends = place + side[:, None] * across - down[:, None] * above
        deepest = np.maximum(out, 0.0)
        feet = (
            place
            + (side + lean[:, 1])[:, None] * across
            + lean[:, 0][:, None] * along
            - (deepest + gap)[:, None] * above
        )
        length = np.sqrt(((ends - feet) ** 2).sum(axis=1)) + slack
        ones = np.ones(np.asarray(stations).size)
        return cls(
            stations,
            ends,
            feet,
            stiffness,
            length,
            yield_elongation,
            failure_elongation,
            ones if bilateral else 0.0 * ones,
        )
