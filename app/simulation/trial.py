"""Trials: one attempt at an exercise, judged tick by tick."""

from abc import ABC, abstractmethod
from collections.abc import Mapping

from app.simulation.clock import TICK_SECONDS
from app.simulation.errors import Incidents
from app.simulation.exercise import (
    ApproachBreak,
    Exercise,
    GentleDissection,
    HoldStretch,
    LeastImpulse,
    Outcome,
)
from app.simulation.measures import MeasureTaker

__all__ = ["Trial", "failed_by", "trial_of"]


class Trial(ABC):
    """One attempt at an exercise, judged tick by tick.

    `outcome` is None while it runs, `progress` goes from 0 to 1, and `standing` says in a few words
    what to do now, with the seconds left of a stay.
    """

    def __init__(self, time_limit: float) -> None:
        self._time_limit = time_limit
        self._ticks = 0
        self.outcome: Outcome | None = None
        self.progress = 0.0
        self.standing = ""

    def take(self) -> None:
        """Judge one tick whose measures are taken."""
        if self.outcome is not None:
            return
        self._ticks += 1
        self.outcome = self.judge()
        if self.outcome is None and self._ticks * TICK_SECONDS >= self._time_limit:
            self.outcome = Outcome(False, f"The {self._time_limit:g} s were over.")

    @abstractmethod
    def judge(self) -> Outcome | None:
        """Return the outcome if this tick ends the exercise, else None; set `progress`."""
        ...


def failed_by(errors: Mapping[str, int], found: Incidents) -> Outcome | None:
    """Return the failure by an error of which there are more incidents than allowed, or None."""
    for error, most in errors.items():
        if found.number.get(error, 0) > most:
            return Outcome(False, found.last_of(error).sentence)
    return None


class _Hold(Trial):
    def __init__(self, exercise: HoldStretch, taker: MeasureTaker) -> None:
        super().__init__(exercise.time_limit_s)
        self._exercise, self._taker = exercise, taker
        self._stay = _Stay(exercise.seconds)
        self.standing = self._stay.standing

    def judge(self) -> Outcome | None:
        wanted, figures = self._exercise, self._taker
        if figures.torn:
            return Outcome(False, f"The duct tore at {figures.force:.3g} N.")
        if figures.force > wanted.force_limit_N:
            return Outcome(
                False,
                f"The force reached {figures.force:.3g} N, past {wanted.force_limit_N:.3g} N.",
            )
        failed = failed_by(wanted.errors, figures.errors)
        if failed is not None:
            return failed
        off = abs(figures.deflection - wanted.deflection_mm)
        done = self._stay.take(figures.held and off <= wanted.tolerance_mm)
        self.progress, self.standing = self._stay.part, self._stay.standing
        if done:
            return Outcome(
                True,
                f"Held {wanted.deflection_mm:.1f} mm for {wanted.seconds:g} s within "
                f"{wanted.force_limit_N:.3g} N.",
            )
        return None


class _Approach(Trial):
    def __init__(self, exercise: ApproachBreak, taker: MeasureTaker) -> None:
        super().__init__(exercise.time_limit_s)
        self._exercise, self._taker = exercise, taker
        self._stay = _Stay(exercise.seconds)
        self._nearest = 1.0
        self.standing = self._stay.standing

    def judge(self) -> Outcome | None:
        margin, figures = self._exercise.margin, self._taker
        if figures.torn:
            return Outcome(False, f"The duct tore at {figures.force:.3g} N.")
        failed = failed_by(self._exercise.errors, figures.errors)
        if failed is not None:
            return failed
        self._nearest = min(self._nearest, figures.distance_to_break)
        done = self._stay.take(figures.held and figures.distance_to_break <= margin)
        # Half of the progress is for getting there, half for staying.
        approach = min(max((1.0 - self._nearest) / (1.0 - margin), 0.0), 1.0)
        self.progress, self.standing = 0.5 * approach + 0.5 * self._stay.part, self._stay.standing
        if done:
            return Outcome(
                True, f"Came within {100.0 * self._nearest:.1f} % of the break and stayed whole."
            )
        return None


class _Gentle(Trial):
    def __init__(self, exercise: GentleDissection, taker: MeasureTaker) -> None:
        super().__init__(exercise.time_limit_s)
        self._exercise, self._taker = exercise, taker
        self._stay = _Stay(exercise.seconds)
        self._done = 0
        self._back = False  # whether this lift has stayed long enough and is to be led back
        self.standing = self._say()

    def judge(self) -> Outcome | None:
        wanted, figures = self._exercise, self._taker
        if figures.torn:
            return Outcome(False, f"The duct tore at {figures.force:.3g} N.")
        passed = _passed_limit(wanted, figures)
        if passed is not None:
            return Outcome(False, passed)
        if not figures.held:
            self._back = False  # it was released and sprang back, which does not count as led back
        there = figures.held and wanted.low_mm <= figures.deflection <= wanted.high_mm
        if self._back:
            if figures.deflection <= wanted.slack_mm:
                self._back, self._done, self._stay = False, self._done + 1, _Stay(wanted.seconds)
        elif self._stay.take(there):
            self._back = True
        part = self._stay.part if self._back else 0.8 * self._stay.part
        self.progress = (self._done + part * (self._done < wanted.lifts)) / wanted.lifts
        self.standing = self._say()
        if self._done < wanted.lifts:
            return None
        mean = figures.mean_absolute_nonzero_force
        if mean > wanted.mean_force_limit_N:
            return Outcome(
                False,
                f"The mean force was {mean:.3g} N, past {wanted.mean_force_limit_N:.3g} N.",
            )
        return Outcome(
            True,
            f"Lifted {wanted.lifts} times and led back with at most {figures.maximum_force:.3g} N.",
        )

    def _say(self) -> str:
        wanted = self._exercise
        if self._done >= wanted.lifts:
            return ""
        what = "lead it back" if self._back else self._stay.standing
        return f"Lift {self._done + 1} of {wanted.lifts}: {what}"


def _passed_limit(wanted: GentleDissection, figures: MeasureTaker) -> str | None:
    """Return which limit of a gentle dissection has been passed, or None."""
    if figures.force > wanted.force_limit_N:
        return f"The force reached {figures.force:.3g} N, past {wanted.force_limit_N:.3g} N."
    if figures.distance_to_break < wanted.reserve_limit:
        return (
            f"The distance to break fell to {100.0 * figures.distance_to_break:.0f} %, below "
            f"{100.0 * wanted.reserve_limit:.0f} %."
        )
    overshoot = figures.overshoot or 0.0
    if overshoot > wanted.overshoot_limit:
        return (
            f"It went {100.0 * overshoot:.0f} % past the goal, more than "
            f"{100.0 * wanted.overshoot_limit:.0f} %."
        )
    rate = figures.maximum_loading_rate
    if rate > wanted.loading_rate_limit_N_per_s:
        return (
            f"It was loaded by {rate:.3g} N/s, faster than "
            f"{wanted.loading_rate_limit_N_per_s:.3g} N/s."
        )
    return None


class _Impulse(Trial):
    def __init__(self, exercise: LeastImpulse, taker: MeasureTaker) -> None:
        super().__init__(exercise.time_limit_s)
        self._exercise, self._taker = exercise, taker

    def judge(self) -> Outcome | None:
        figures = self._taker
        spent, limit = figures.force_time_product, self._exercise.product_limit_N_s
        self.progress = 1.0 if figures.torn else min(max(1.0 - figures.distance_to_break, 0.0), 1.0)
        if spent > limit:
            return Outcome(False, f"More than {limit:.3g} N s was spent.")
        if figures.torn:
            return Outcome(True, f"Torn with {spent:.3g} N s of {limit:.3g} N s.")
        return None


class _Stay:
    """Counts the time for which a condition has held without a break."""

    def __init__(self, seconds: float) -> None:
        self._wanted = max(1, round(seconds / TICK_SECONDS))
        self._ticks = 0

    @property
    def part(self) -> float:
        return min(self._ticks / self._wanted, 1.0)

    @property
    def standing(self) -> str:
        if self._ticks == 0:
            return "into the band"
        return f"keep it, {(self._wanted - self._ticks) * TICK_SECONDS:.1f} s to go"

    def take(self, there: bool) -> bool:
        self._ticks = min(self._ticks + 1, self._wanted) if there else 0
        return self._ticks >= self._wanted


def trial_of(exercise: Exercise, taker: MeasureTaker) -> Trial:
    """Return a new attempt at an exercise of a free duct."""
    if isinstance(exercise, HoldStretch):
        return _Hold(exercise, taker)
    if isinstance(exercise, ApproachBreak):
        return _Approach(exercise, taker)
    if isinstance(exercise, GentleDissection):
        return _Gentle(exercise, taker)
    if isinstance(exercise, LeastImpulse):
        return _Impulse(exercise, taker)
    raise ValueError(f"{exercise.title} is done in a bed")
