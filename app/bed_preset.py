"""Beds that a duct can lie in."""

import math
from functools import cache
from typing import Literal

import msgspec
import numpy as np

from assets import BEDS
from physics.bed import Bed, Patch, SpaceBeam


class PatchPreset(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """An adhesion: where it is along its bed, as fractions of the bed's length."""

    from_fraction: float
    to_fraction: float
    factor: float  # on the strands' toughness and stiffness


class BedPreset(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A bed with its source; assets/beds.toml says what each number is."""

    name: str
    title: str
    description: str
    toughness_J_per_m2: float  # noqa: N815 (units are written as they are)
    source: str
    confidence: Literal["high", "medium", "low"]
    confidence_note: str
    yield_mm: float = 1.5
    failure_mm: float = 4.0
    gap_mm: float = 3.0
    around_deg: float = 70.0
    fan_deg: float = 25.0
    slack_mm: float = 1.0
    scatter: float = 0.3
    strands_per_mm: float = 11.811
    floor_N_per_mm2: float = 0.3  # noqa: N815
    patch: PatchPreset | None = None
    relaxation: str | None = None  # how its strands relax, by name; not at all when None

    def bed(
        self,
        beam: SpaceBeam,
        *,
        seed: int = 1,
        strands: int | None = None,
        from_mm: float | None = None,
        to_mm: float | None = None,
    ) -> Bed:
        """Return this bed under a beam."""
        a = 0.0 if from_mm is None else from_mm
        b = beam.span if to_mm is None else to_mm
        around = math.radians(self.around_deg)
        radius = float(np.trapezoid(beam.radius, beam.stations)) / beam.span
        toughness = 1e-3 * self.toughness_J_per_m2 * 2.0 * around * radius
        found = Bed(
            from_mm=a,
            to_mm=b,
            strands=max(1, round(self.strands_per_mm * (b - a))) if strands is None else strands,
            stiffness=2.0 * toughness / (self.yield_mm * self.failure_mm),
            toughness=toughness,
            softening=self.failure_mm / self.yield_mm,
            floor=self.floor_N_per_mm2,
            gap=self.gap_mm,
            around=around,
            fan=math.radians(self.fan_deg),
            slack=self.slack_mm,
            scatter=self.scatter,
            jitter=1.0,
            seed=seed,
        )
        if self.patch is None:
            return found
        length = b - a
        return found.with_patch(
            Patch(
                a + self.patch.from_fraction * length,
                a + self.patch.to_fraction * length,
                self.patch.factor,
            )
        )


class _BedFile(msgspec.Struct, frozen=True):
    bed: list[BedPreset]


@cache
def bed_presets() -> dict[str, BedPreset]:
    """Return the beds that ship with the trainer, by name, the default first."""
    found = msgspec.toml.decode(BEDS.read_bytes(), type=_BedFile).bed
    return {each.name: each for each in found}


def bed_named(name: str | BedPreset) -> BedPreset:
    """Return the bed of that name, or a whole one; a `ValueError` says which there are."""
    if isinstance(name, BedPreset):
        return name
    if name not in bed_presets():
        raise ValueError(f"unknown bed {name!r}; there are: {', '.join(bed_presets())}")
    return bed_presets()[name]


def named_or_whole(bed: BedPreset) -> str | BedPreset:
    """Return a shipped bed's name, or another in full, as files have it."""
    return bed.name if bed_presets().get(bed.name) == bed else bed
