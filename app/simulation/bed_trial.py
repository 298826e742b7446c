"""One attempt at an exercise in a bed, and why it failed."""

import math
from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from app.simulation.clock import TICK_SECONDS
from app.simulation.dissection_measures import LEAST_FORCE, DissectionMeasureTaker
from app.simulation.exercise import BedExercise, Outcome
from app.simulation.run_file import HANDS
from app.simulation.trial import Trial

if TYPE_CHECKING:
    from app.simulation.spatial_tissue import SpatialTissue

__all__ = ["BedTrial"]

# A pull within all three is not what a failed try is put down to: its angle to the bed's normal,
# its distance behind the front and its speed.
STEEP_DEG, NEAR_MM, SLOW_MM_PER_S = 20.0, 2.0, 15.0
# Ticks before a limit was passed in which the hand's speed counts.
SPEED_TICKS = 6


class BedTrial(Trial):
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

    def judge(self) -> Outcome | None:
        """Return the outcome if this tick ends the exercise."""
        wanted, taker, duct = self._exercise, self._taker, self._taker.duct
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
        if taker.peak > wanted.stress_ratio_limit:
            return Outcome(
                False,
                f"The wall reached {100.0 * taker.peak:.1f} % of its break, past "
                f"{100.0 * wanted.stress_ratio_limit:.1f} %: {self._why()}.",
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

    def _follow(self, duct: "SpatialTissue") -> None:
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
        if self._exercise.name == "free_scar":
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
