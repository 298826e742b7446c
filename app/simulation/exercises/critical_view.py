"""The critical view of safety and a tented duct, as `Safety` finds them (docs/anatomy-file.md)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.anatomy import tube_title

__all__ = [
    "DRAW_OFF", "ENOUGH", "LIFT", "MOST_POINTS", "OPENED", "PART", "SLACKEN", "SOME", "TAKE_HOLD",
    "Closing", "CriticalView", "NextStep", "Part", "Tenting", "Where", "closing_step",
]  # fmt: skip

MOST_POINTS = 6
"""Of the critical view: two for each of its parts."""
ENOUGH, SOME = 0.9, 0.6
"""Fractions of a region's strands that have parted, for two points and for one."""
OPENED = 0.3
"""Fraction of the triangle's strands, from which on the gallbladder is drawn off the liver: freed
there, it gives room for the rest."""
TENTED_DIAMETERS, TENTED_DEG = 0.5, 10.0

Part = Literal["triangle", "tubes", "plate"]
Where = Literal["between", "deep", "under", "behind", "plate"]
PART: dict[Where, str] = {
    "between": "Next: part the tissue between {} and {}, right hand's dissector: tip into the "
    "ring, jaws (J, L) along its bar.",
    "deep": "Next: part the deep tissue between {} and {}, right hand's right angle: jaws (J, L) "
    "along the bar.",
    "under": "Next: part the tissue under the {}, right hand's dissector: open in the ring, along "
    "its bar (J, L), then lead it under.",
    "behind": "Next: part the tissue behind the {}, right hand's right angle; "
    "turn (J, L) its tip across it, and pass under.",
    "plate": "Next: part the {} from the liver, right hand's dissector: tip into the ring, jaws "
    "(J, L) along its bar.",
}
"""How to part what holds, by where it is of the tubes that it holds."""
TAKE_HOLD = (
    "Next: take hold of the {} in the ring with the left hand's grasper, and draw it aside, up and "
    "to the left."
)
DRAW_OFF = (
    "Next: take hold of the {} in the ring with the left hand's grasper, and draw it down and "
    "towards you, off the liver."
)
LIFT = (
    "Next: hold the {} near its neck with the left hand's grasper, lift it towards you until it "
    "stops, and let go."
)
SLACKEN = "Next: let the {} back a little with the left hand's grasper: the {} is near its break."
MARK = "Next: mark the {}: choose it under Point at, and press it in the picture (K, then G)."
CLIP = (
    "Next: clip the {} {} the gallbladder, clip applier in the right hand; turn (J, L) a jaw to "
    "either side."
)
DIVIDE = (
    "Next: divide the {} between its clips, {} to stay and {} to go, scissors in the right hand."
)


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
        # One point asks for one structure and SOME of the neck, two for both and ENOUGH of it.
        around = [
            f"{tube_title(name)} {_percent(is_free)}" for name, is_free in self.structures.items()
        ]
        neck = f"neck {_percent(self.neck)}, {_percent(ENOUGH)} asked of each"
        return [
            _line("two tubes alone", self.two_structures, ", ".join([*around, neck])),
            _line("triangle", self.triangle_cleared, _free(self.triangle)),
            _line("cystic plate", self.plate_freed, _free(self.plate)),
        ]

    @property
    def next_part(self) -> Part | None:
        """What to free next, what is easiest first; None once each part has all its points."""
        # All of the plate and `SOME` of the triangle are in a dissector's reach, `OPENED` before
        # the plate; for the rest the right angle goes behind tubes.
        if self.triangle < OPENED:
            return "triangle"
        asked: list[tuple[Part, int]] = [
            ("plate", self.plate_freed), ("triangle", self.triangle_cleared),
            ("tubes", self.two_structures),
        ]  # fmt: skip
        return next((part for part, points in asked if points < MOST_POINTS // 3), None)


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
    asked = SOME if fraction < SOME else ENOUGH
    return f"{_percent(fraction)} free, {_percent(asked)} asked"


def _percent(fraction: float) -> str:
    return f"{100.0 * fraction:.0f} %"


class Closing(NamedTuple):
    """How far a structure is marked, clipped and divided."""

    tube: str
    marked: bool
    stay: int  # clips on the side that stays; all of them before it is divided
    go: int  # clips on the side that goes with the gallbladder
    divided: bool


class NextStep(NamedTuple):
    """What an exercise asks for next."""

    words: str
    strands: NDArray[np.int64]  # that it is about; none once there is nothing to part
    along: tuple[float, float, float] | None = None  # direction in which jaws part them
    place: tuple[float, float, float] | None = None  # mm, where jaws part them or take hold


def closing_step(closings: Sequence[Closing], stay: int, go: int) -> str:
    """Return what to do next with the first structure that is not yet closed; empty if all are."""
    for each in closings:
        name, clips = tube_title(each.tube), each.stay + each.go
        if not each.marked:
            return MARK.format(name)
        if each.divided:
            continue
        if clips < stay + go:
            return CLIP.format(name, "away from" if clips < stay else "beside")
        return DIVIDE.format(name, stay, go)
    return ""
