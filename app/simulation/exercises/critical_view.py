"""The critical view of safety and a tented duct, as `Safety` finds them (docs/anatomy-file.md)."""

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

from app.anatomy import tube_title

MOST_POINTS = 6
"""Of the critical view: two for each of its parts."""
TWO_POINTS, ONE_POINT = 0.9, 0.6
"""Fractions of a region's strands that have parted, for two points and for one."""
CLEARED = 0.8
"""Fraction of the triangle's strands, from which on the gallbladder is drawn off the liver: freed
there, it gives room for the rest."""
NEARLY = 0.99
"""Of the way to its points, that is shown at most until all of them are there."""
TENTED_DIAMETERS, TENTED_DEG = 0.5, 10.0

Part = Literal["triangle", "tubes", "plate"]


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

    def checklist(self) -> list[str]:
        """Return for each of its parts how many points it has, how free it is and must be."""
        # A point asks for one structure and ONE_POINT of the neck, two for both and TWO_POINTS.
        around = [
            f"{tube_title(name)} {_percent(is_free)}" for name, is_free in self.structures.items()
        ]
        neck = f"neck {_percent(self.neck)}, {_percent(TWO_POINTS)} asked of each"
        return [
            _line("two tubes alone", self.two_structures, ", ".join([*around, neck])),
            _line("triangle", self.triangle_cleared, _free(self.triangle)),
            _line("cystic plate", self.plate_freed, _free(self.plate)),
        ]

    def towards(self, points: int) -> float:
        """Return how far it has come to so many points, 0 to 1: 1 only once they are reached."""
        if self.total >= points:
            return 1.0
        # Two structures alone are seen at once; what is on its way to a point counts in part.
        parts = self.two_structures + sum(
            min(each / ONE_POINT, 1.0)
            + min(max(each - ONE_POINT, 0.0) / (TWO_POINTS - ONE_POINT), 1.0)
            for each in (self.triangle, self.plate)
        )
        return min(parts / points, NEARLY)

    def next_parts(self, points: int) -> list[Part]:
        """Return what to free next for so many points, what is easiest first; none at the end."""
        most = MOST_POINTS // 3
        asked: list[tuple[Part, int, int]] = [  # with the points that it has, and is to have
            ("plate", self.plate_freed, most),
            ("triangle", self.triangle_cleared, most),
            ("tubes", self.two_structures, most if points > 2 * most else 0),
        ]
        parts: list[Part] = [part for part, has, wanted in asked if has < wanted]
        if self.triangle < CLEARED:
            return ["triangle", *(part for part in parts if part != "triangle")]
        return parts


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


def _line(what: str, points: int, is_free: str) -> str:
    done = "\N{CHECK MARK} " if points == MOST_POINTS // 3 else ""
    return f"{done}{what}, {points} of {MOST_POINTS // 3}: {is_free}"


def _free(fraction: float) -> str:
    asked = ONE_POINT if fraction < ONE_POINT else TWO_POINTS
    both = f" for {MOST_POINTS // 3} points" if asked == TWO_POINTS else ""
    return f"{_percent(fraction)} free, {_percent(asked)} asked{both}"


def _percent(fraction: float) -> str:
    # Rounded down: what is lacking by a little is not yet there.
    return f"{math.floor(100.0 * fraction + 1e-9)} %"


class Closing(NamedTuple):
    """How far a structure is marked, clipped and divided."""

    tube: str
    marked: bool
    stay: int  # clips on the side that stays; all of them before it is divided
    go: int  # clips on the side that goes with the gallbladder
    divided: bool
