"""One attempt at an exercise in a bed, and why it failed."""

import math
from typing import TYPE_CHECKING

from app.simulation.clock import TICK_SECONDS
from app.simulation.dissection_measures import DissectionMeasureTaker
from app.simulation.exercise import BedExercise, Outcome
from app.simulation.trial import Trial, failed_by

if TYPE_CHECKING:
    pass

__all__ = ["BedTrial"]

LOST_MM = 3.0
"""mm freed where the exercise does not ask for it, from which on that is worth a word."""


class BedTrial(Trial):
    """One attempt, judged tick by tick from the measures of its run and the errors in it."""

    def __init__(self, exercise: BedExercise, taker: DissectionMeasureTaker) -> None:
        super().__init__(exercise.time_limit_s)
        self._exercise, self._taker = exercise, taker
        self.standing = exercise.standing(0.0)

    def judge(self) -> Outcome | None:
        """Return the outcome if this tick ends the exercise."""
        wanted, taker, duct = self._exercise, self._taker, self._taker.duct
        freed = wanted.freed(taker.stretches)
        self.progress = min(freed / wanted.free_mm, 1.0)
        self.standing = wanted.standing(freed)
        if duct.torn is not None:
            return self._failed("The duct tore")
        failed = failed_by(wanted.errors, taker.errors)
        if failed is not None:
            return failed
        if taker.soonest < wanted.time_to_break_limit_s:
            # Rounded down, so that it is seen to be below the limit.
            return self._failed(
                f"The wall would have broken in {math.floor(1e3 * taker.soonest) / 1e3:.3f} s, "
                f"sooner than {wanted.time_to_break_limit_s:g} s, in which one can react"
            )
        if taker.peak > wanted.stress_ratio_limit:
            return self._failed(
                f"The wall reached {100.0 * taker.peak:.1f} % of its break, past "
                f"{100.0 * wanted.stress_ratio_limit:.1f} %"
            )
        if taker.out_of_sight > wanted.out_of_sight_limit:
            return self._failed(
                f"{taker.out_of_sight} strands tore out of sight, more than "
                f"{wanted.out_of_sight_limit}"
            )
        force = wanted.instrument_force_limit_N
        if force is not None and taker.instrument_force > force:
            return self._failed(
                f"The instrument was pushed with {taker.instrument_force:.2g} N, past {force:.2g} N"
            )
        # Bins are whole, so lengths differ from the goal by rounding only.
        if freed >= wanted.free_mm - 1e-6:
            return Outcome(
                True,
                f"Freed the {freed:.0f} mm asked for, {taker.freed:.0f} mm in all, at no more than "
                f"{100.0 * taker.peak:.0f} % of the wall's break.",
            )
        if self._ticks * TICK_SECONDS >= wanted.time_limit_s:
            opened = wanted.opened_mm or (0.0, 0.0)
            lost = taker.freed - freed - (opened[1] - opened[0])
            return Outcome(
                False,
                f"The {wanted.time_limit_s:g} s were over with {self.standing}"
                + (f"; {lost:.0f} mm elsewhere do not count." if lost >= LOST_MM else "."),
            )
        return None

    def _failed(self, limit: str) -> Outcome:
        """Return a failure by a limit, put down to an error where there is one."""
        cause = self._taker.errors.cause()
        if cause is not None and cause.error == "over_lifted":  # says the limit itself
            return Outcome(False, cause.sentence)
        return Outcome(False, f"{limit}." if cause is None else f"{limit}: {cause.advice}")
