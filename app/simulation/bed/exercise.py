"""Exercises in a bed: what is to be freed, within which limits, and what to say of a failed try.

Where the limits come from is in `app.simulation.bed.exercise_limits`.
"""

import math
from collections import deque
from typing import Literal

import msgspec
import numpy as np

from app.simulation.bed.bedded_duct import HANDS, BeddedDuct
from app.simulation.bed.hand import Instrument
from app.simulation.bed.measures import LEAST_FORCE, DissectionMeasureTaker
from app.simulation.bed_preset import BedPreset
from app.simulation.clock import TICK_SECONDS
from app.simulation.exercise import LONGEST_SECONDS, Outcome
from app.simulation.trial import Trial

__all__ = ["TITLES", "BedExercise", "BedExerciseName", "BedTrial"]

BedExerciseName = Literal["window", "follow-front", "free-scar"]
TITLES: dict[BedExerciseName, str] = {
    "window": "Open a window",
    "follow-front": "Follow the front",
    "free-scar": "Free a scar with two hands",
}

# A pull within all three is not what a failed try is put down to: its angle to the bed's normal,
# its distance behind the front and its speed.
STEEP_DEG, NEAR_MM, SLOW_MM_PER_S = 20.0, 2.0, 15.0
# Ticks before a limit was passed in which the hand's speed counts.
SPEED_TICKS = 6


class BedExercise(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Free a stretch of duct within limits of what its wall and the tissue behind it bear."""

    name: BedExerciseName
    bed: str | BedPreset
    bed_seed: int
    free_mm: float  # length that is to be free between `from_mm` and `to_mm`
    from_mm: float  # from the first clamp
    to_mm: float
    instruments: tuple[Instrument, ...]
    share_limit: float  # of the wall's stress over its threshold
    time_to_break_limit_s: float  # at the pace at which that share grows
    out_of_sight_limit: int  # strands
    instrument_force_limit_N: float | None = None  # on jaws or a swab  # noqa: N815
    opened_mm: tuple[float, float] | None = None  # free at the start
    divided: bool = False  # the duct ends at its second clamp, which is gone
    time_limit_s: float = 120.0
    one_stretch: bool = False  # whether `free_mm` are of one free stretch, or of all

    def __post_init__(self) -> None:
        if not 0.0 <= self.from_mm < self.to_mm < math.inf:
            raise ValueError(f"from_mm and to_mm must rise, got {self.from_mm} and {self.to_mm}")
        if not 0.0 < self.free_mm <= self.to_mm - self.from_mm:
            raise ValueError(f"free_mm must be above 0 and within to_mm, got {self.free_mm}")
        if not 0.0 < self.share_limit < 1.0:
            raise ValueError(f"share_limit must be above 0 and below 1, got {self.share_limit}")
        if not 0.0 <= self.time_to_break_limit_s < math.inf:
            raise ValueError(
                f"time_to_break_limit_s must be 0 or more, got {self.time_to_break_limit_s}"
            )
        force = self.instrument_force_limit_N
        if force is not None and not 0.0 < force < math.inf:
            raise ValueError(f"instrument_force_limit_N must be above 0 and finite, got {force}")
        if self.opened_mm is not None and not (
            0.0 <= self.opened_mm[0] < self.opened_mm[1] < math.inf
        ):
            raise ValueError(f"opened_mm must rise, got {self.opened_mm}")
        if self.out_of_sight_limit < 0:
            raise ValueError(f"out_of_sight_limit must be 0 or more, got {self.out_of_sight_limit}")
        if not 0.0 < self.time_limit_s <= LONGEST_SECONDS:
            raise ValueError(
                f"time_limit_s must be above 0 and at most {LONGEST_SECONDS:g} s, "
                f"got {self.time_limit_s}"
            )

    @property
    def title(self) -> str:
        """Its title."""
        return TITLES[self.name]

    @property
    def goal(self) -> str:
        """What to do, in one sentence."""
        if self.name == "window":
            return (
                f"Pass the dissector behind the duct and open it until {self.free_mm:.0f} mm "
                + ("are free in one stretch." if self.one_stretch else "are free.")
            )
        if self.name == "follow-front":
            return (
                f"The duct is divided and its end is free: from there, free {self.free_mm:.0f} mm "
                f"more with the hook: take hold at the front, lift, let go, take hold again."
            )
        return (
            f"Hold the duct up with one hand and open the dissector behind it with the other until "
            f"the scar's {self.free_mm:.0f} mm are free."
        )

    @property
    def limit(self) -> str:
        """What not to do, in one sentence."""
        force = self.instrument_force_limit_N
        return (
            f"Never load the wall past {100.0 * self.share_limit:.0f} % of its break, nor so fast "
            f"that it would break within {self.time_to_break_limit_s:g} s"
            + (f", nor push the instrument with more than {force:.2g} N" if force else "")
            + f"; tear no more than {self.out_of_sight_limit} strands out of sight."
        )

    @property
    def limits(self) -> dict[str, float]:
        """Limits that fail the exercise, by the measure's name."""
        found = {
            "peak_stress_share": self.share_limit,
            "shortest_time_to_break_s": self.time_to_break_limit_s,
            "strands_parted_out_of_sight": float(self.out_of_sight_limit),
        }
        if self.instrument_force_limit_N is not None:
            found["maximum_instrument_force_N"] = self.instrument_force_limit_N
        return found

    def freed(self, stretches: list[tuple[float, float]]) -> float:
        """Return the length that is free within the goal's ends, mm: of all stretches or of one."""
        inside = [min(b, self.to_mm) - max(a, self.from_mm) for a, b in stretches]
        return (max if self.one_stretch else sum)([0.0, *(each for each in inside if each > 0.0)])

    def standing(self, freed: float) -> str:
        """Return how much of what is asked for is free, in words."""
        where = " in one stretch" if self.one_stretch else ""
        return f"{freed:.0f} of {self.free_mm:.0f} mm free{where}"


class BedTrial(Trial[BeddedDuct]):
    """One attempt, judged tick by tick from the duct and the measures of its run."""

    def __init__(self, exercise: BedExercise, taker: DissectionMeasureTaker) -> None:
        super().__init__(exercise.time_limit_s)
        self._exercise, self._taker = exercise, taker
        self._speeds = [deque[float](maxlen=SPEED_TICKS) for _ in range(HANDS)]
        self._places, self._held = np.zeros((HANDS, 3)), [False] * HANDS
        self._force = np.zeros(3)
        self._force_squared = self._station = 0.0
        self._pulled = -1
        self.standing = exercise.standing(0.0)

    def judge(self, figures: BeddedDuct) -> Outcome | None:
        """Return the outcome if this tick ends the exercise."""
        wanted, taker, duct = self._exercise, self._taker, figures
        self._follow(duct)
        freed = wanted.freed(taker.stretches)
        self.progress = min(freed / wanted.free_mm, 1.0)
        self.standing = wanted.standing(freed)
        if duct.torn is not None:
            return Outcome(False, f"The duct tore: {self._why()}.")
        if taker.soonest < wanted.time_to_break_limit_s:
            return Outcome(
                False,
                f"At that pace the wall would have broken in {taker.soonest:.2f} s, within a "
                f"reaction time of {wanted.time_to_break_limit_s:g} s: the pull was too fast.",
            )
        if taker.peak > wanted.share_limit:
            return Outcome(
                False,
                f"The wall reached {100.0 * taker.peak:.1f} % of its break, past "
                f"{100.0 * wanted.share_limit:.1f} %: {self._why()}.",
            )
        if taker.out_of_sight > wanted.out_of_sight_limit:
            return Outcome(
                False,
                f"{taker.out_of_sight} strands tore out of sight, more than "
                f"{wanted.out_of_sight_limit}: {self._why()}.",
            )
        force = wanted.instrument_force_limit_N
        if force is not None and taker.instrument_force > force:
            held = any(hand.node is not None for hand in duct.hands)
            return Outcome(
                False,
                f"The instrument was pushed with {taker.instrument_force:.2g} N, past {force:.2g} "
                f"N: the duct was {'not held high enough' if held else 'not held up'}.",
            )
        # Bins are whole, so lengths differ from the goal by rounding only.
        if freed >= wanted.free_mm - 1e-6:
            return Outcome(
                True,
                f"Freed the {freed:.0f} mm asked for, {taker.freed:.0f} mm in all, at no more than "
                f"{100.0 * taker.peak:.0f} % of the wall's break.",
            )
        if self._ticks * TICK_SECONDS >= wanted.time_limit_s:
            return Outcome(False, f"The {wanted.time_limit_s:g} s were over with {self.standing}.")
        return None

    def _follow(self, duct: BeddedDuct) -> None:
        """Note how fast the hands move, and of the one that pulls hardest force and place."""
        forces = duct.forces
        pulled = -1
        for hand, holder in enumerate(duct.hands):
            way = holder.place - self._places[hand]
            self._places[hand] = holder.place
            held = holder.node is not None
            going_on = held and self._held[hand]  # the way to a new hold is no pull
            self._held[hand] = held
            if held:
                speed = math.sqrt((way**2).sum()) / TICK_SECONDS
                self._speeds[hand].append(speed if going_on else 0.0)
            squared = float((forces[hand] ** 2).sum())
            if held and (pulled < 0 or squared > self._force_squared):
                pulled, self._force_squared = hand, squared
        # What a hand did stays, also when it has let go or slipped off.
        if duct.torn is not None or float((forces**2).sum()) <= LEAST_FORCE**2:
            return
        self._pulled = pulled if self._force_squared > LEAST_FORCE**2 else -1
        if self._pulled >= 0:
            self._force = forces[self._pulled]
            self._station = duct.held_at(self._pulled) or 0.0

    def _why(self) -> str:
        """Return what about the pull was most wrong when it passed a limit."""
        if self._pulled < 0:
            return "the instrument pushed the duct itself"
        if self._exercise.name == "window":
            return "the duct was lifted, which the dissector behind it does not need"
        if self._exercise.name == "free-scar":
            return "the duct was held up higher than the jaws need"
        # Sideways only: at a front the stretched duct itself pulls the hook along it.
        angle = math.degrees(math.atan2(abs(float(self._force[1])), float(self._force[2])))
        at = self._station
        # The end of a divided duct is no front.
        opened = self._exercise.opened_mm
        end = opened[1] - 1e-6 if opened is not None and self._exercise.divided else math.inf
        behind = max(
            [min(at - a, b - at if b < end else math.inf) for a, b in self._taker.stretches],
            default=0.0,
        )
        speed = max(self._speeds[self._pulled])
        reasons = [
            (angle / STEEP_DEG, f"the pull was sideways, {angle:.0f} degrees off straight up"),
            (behind / NEAR_MM, f"the hook pulled {behind:.0f} mm behind the front"),
            (speed / SLOW_MM_PER_S, f"the pull was too fast, {speed:.0f} mm/s"),
        ]
        worst, why = max(reasons)
        return why if worst > 1.0 else "it was lifted too far in one go instead of held again"
