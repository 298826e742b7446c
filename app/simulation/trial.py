"""Trials: one go at an exercise, judged tick by tick."""

from abc import ABC, abstractmethod
from typing import NamedTuple

import msgspec

from app.simulation.clock import TICK_SECONDS
from app.simulation.exercise import ApproachBreak, Exercise, GentleDissection, HoldStretch

__all__ = ["Figures", "Outcome", "Trial", "trial_of"]


class Figures(NamedTuple):
    """What an exercise is judged by, at one tick.

    Attributes
    ----------
    force
        The grasper's whole force, N.
    deflection
        Displacement of the grasp, mm.
    distance_to_break
        1 at rest, 0 at the break.
    force_time_product
        So far, N s.
    held
        Whether the grasper holds the duct.
    torn
        Whether the duct has just torn.
    """

    force: float
    deflection: float
    distance_to_break: float
    force_time_product: float
    held: bool
    torn: bool


class Outcome(msgspec.Struct, frozen=True):
    """How an exercise has ended.

    Attributes
    ----------
    passed
        Whether its goal was reached within its limit.
    reason
        Why, in one sentence.
    """

    passed: bool
    reason: str


class Trial(ABC):
    """One go at an exercise, judged tick by tick.

    Attributes
    ----------
    outcome
        How it has ended; None while it runs.
    progress
        How far it has come, from 0 to 1.
    """

    def __init__(self, time_limit: float) -> None:
        self._time_limit = time_limit
        self._ticks = 0
        self.outcome: Outcome | None = None
        self.progress = 0.0

    def take(self, figures: Figures) -> None:
        """Judge one tick.

        Parameters
        ----------
        figures
            What the instruments show.
        """
        if self.outcome is not None:
            return
        self._ticks += 1
        self.outcome = self.judge(figures)
        if self.outcome is None and self._ticks * TICK_SECONDS >= self._time_limit:
            self.outcome = Outcome(False, f"The {self._time_limit:g} s were over.")

    @abstractmethod
    def judge(self, figures: Figures) -> Outcome | None:
        """Return how one more tick ends the exercise, or None; set `progress`.

        Parameters
        ----------
        figures
            What the instruments show.

        Returns
        -------
        Outcome | None
            The outcome.
        """
        ...


class _Hold(Trial):
    def __init__(self, exercise: HoldStretch) -> None:
        super().__init__(exercise.time_limit_s)
        self._exercise = exercise
        self._stay = _Stay(exercise.seconds)

    def judge(self, figures: Figures) -> Outcome | None:
        wanted = self._exercise
        if figures.torn:
            return Outcome(False, f"The duct tore at {figures.force:.3g} N.")
        if figures.force > wanted.force_limit_N:
            return Outcome(
                False,
                f"The force reached {figures.force:.3g} N, past {wanted.force_limit_N:.3g} N.",
            )
        off = abs(figures.deflection - wanted.deflection_mm)
        done = self._stay.take(figures.held and off <= wanted.tolerance_mm)
        self.progress = self._stay.part
        if done:
            return Outcome(
                True,
                f"Held {wanted.deflection_mm:.1f} mm for {wanted.seconds:g} s within "
                f"{wanted.force_limit_N:.3g} N.",
            )
        return None


class _Approach(Trial):
    def __init__(self, exercise: ApproachBreak) -> None:
        super().__init__(exercise.time_limit_s)
        self._exercise = exercise
        self._stay = _Stay(exercise.seconds)
        self._nearest = 1.0

    def judge(self, figures: Figures) -> Outcome | None:
        margin = self._exercise.margin
        if figures.torn:
            return Outcome(False, f"The duct tore at {figures.force:.3g} N.")
        self._nearest = min(self._nearest, figures.distance_to_break)
        done = self._stay.take(figures.held and figures.distance_to_break <= margin)
        # Half for the way there, half for staying.
        way = min(max((1.0 - self._nearest) / (1.0 - margin), 0.0), 1.0)
        self.progress = 0.5 * way + 0.5 * self._stay.part
        if done:
            return Outcome(
                True, f"Came within {100.0 * self._nearest:.1f} % of the break and stayed whole."
            )
        return None


class _Dissection(Trial):
    def __init__(self, exercise: GentleDissection) -> None:
        super().__init__(exercise.time_limit_s)
        self._exercise = exercise

    def judge(self, figures: Figures) -> Outcome | None:
        spent, limit = figures.force_time_product, self._exercise.product_limit_N_s
        self.progress = 1.0 if figures.torn else min(max(1.0 - figures.distance_to_break, 0.0), 1.0)
        if spent > limit:
            return Outcome(False, f"More than {limit:.3g} N s was spent.")
        if figures.torn:
            return Outcome(True, f"Torn with {spent:.3g} N s of {limit:.3g} N s.")
        return None


class _Stay:
    """Counts the time for which something has held without a break."""

    def __init__(self, seconds: float) -> None:
        self._wanted = max(1, round(seconds / TICK_SECONDS))
        self._ticks = 0

    @property
    def part(self) -> float:
        return min(self._ticks / self._wanted, 1.0)

    def take(self, there: bool) -> bool:
        self._ticks = self._ticks + 1 if there else 0
        return self._ticks >= self._wanted


def trial_of(exercise: Exercise) -> Trial:
    """Return a fresh go at an exercise.

    Parameters
    ----------
    exercise
        The exercise.

    Returns
    -------
    Trial
        The trial.
    """
    if isinstance(exercise, HoldStretch):
        return _Hold(exercise)
    if isinstance(exercise, ApproachBreak):
        return _Approach(exercise)
    return _Dissection(exercise)
