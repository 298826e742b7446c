"""The critical view of safety and a tented duct, as `Safety` finds them (docs/anatomy-file.md)."""

from dataclasses import dataclass
from typing import NamedTuple

__all__ = ["MOST_POINTS", "Closing", "CriticalView", "Tenting"]

MOST_POINTS = 6
"""Of the critical view: two for each of its parts."""
TENTED_DIAMETERS, TENTED_DEG = 0.5, 10.0


@dataclass(frozen=True, slots=True)
class CriticalView:
    """The critical view of safety, with the shares of strands that have parted."""

    two_structures: int
    triangle_cleared: int
    plate_freed: int
    structures: dict[str, float]  # share about each one that enters the gallbladder, by its name
    neck: float
    triangle: float
    plate: float
    torn: tuple[str, ...]  # structures that have torn

    @property
    def total(self) -> int:
        """Points, 0 to 6."""
        return self.two_structures + self.triangle_cleared + self.plate_freed


@dataclass(frozen=True, slots=True)
class Tenting:
    """How the common duct is drawn out of its bed where the cystic duct joins it."""

    diameters: float  # the junction's displacement, in the common duct's diameters
    cystic_deg: float  # between the cystic duct and the common duct below the junction
    upper_deg: float  # between the common duct above and below the junction

    @property
    def trap(self) -> bool:
        """Whether the cystic duct goes on in the line of the common duct's lower part."""
        return self.diameters > TENTED_DIAMETERS and self.cystic_deg < self.upper_deg + TENTED_DEG


class Closing(NamedTuple):
    """How far a structure is marked, clipped and divided."""

    tube: str
    marked: bool
    stay: int  # clips on the side that stays; all of them before it is divided
    go: int  # clips on the side that goes with the gallbladder
    divided: bool
