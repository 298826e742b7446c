"""Exercises: a goal, a limit and a result, in numbers that scale with the duct's own break."""

import math
from typing import ClassVar

import msgspec

from app.simulation.clock import TICK_SECONDS

__all__ = ["ApproachBreak", "Exercise", "GentleDissection", "HoldStretch"]

LONGEST_SECONDS = 3600.0
"""An exercise is a matter of minutes; a longer one is a slip of the unit."""


class HoldStretch(msgspec.Struct, frozen=True, tag_field="exercise", tag="hold-stretch"):
    """Hold a given deflection for a time without exceeding a force.

    Attributes
    ----------
    deflection_mm, tolerance_mm
        Where to hold the grasp, and how near.
    seconds
        For how long without leaving, s.
    force_limit_N
        A larger force ends the exercise.
    time_limit_s
        Time for all of it.
    """

    deflection_mm: float
    tolerance_mm: float
    seconds: float
    force_limit_N: float  # noqa: N815
    time_limit_s: float = 60.0
    title: ClassVar[str] = "Hold a stretch"

    def __post_init__(self) -> None:
        _above_zero(self, "deflection_mm", "tolerance_mm", "force_limit_N")
        _in_time(self.seconds, self.time_limit_s)

    @property
    def goal(self) -> str:
        """What to do, in one sentence."""
        return (
            f"Hold the duct {self.deflection_mm:.1f} mm out, within {self.tolerance_mm:.1f} mm, "
            f"for {self.seconds:g} s."
        )

    @property
    def limit(self) -> str:
        """What not to do, in one sentence."""
        return f"Never pull with more than {self.force_limit_N:.3g} N."


class ApproachBreak(msgspec.Struct, frozen=True, tag_field="exercise", tag="approach-break"):
    """Approach the break to a margin, stay there for a time, and do not tear the duct.

    Attributes
    ----------
    margin
        Distance to break to come to, as a part of one.
    seconds
        How long to stay at or below it, s.
    time_limit_s
        Time for all of it.
    """

    margin: float
    seconds: float
    time_limit_s: float = 60.0
    title: ClassVar[str] = "Approach the break"

    def __post_init__(self) -> None:
        if not 0.0 < self.margin < 1.0:
            raise ValueError(f"margin must be above 0 and below 1, got {self.margin}")
        _in_time(self.seconds, self.time_limit_s)

    @property
    def goal(self) -> str:
        """What to do, in one sentence."""
        return (
            f"Bring the distance to break down to {100.0 * self.margin:.0f} % or less and keep it "
            f"there for {self.seconds:g} s."
        )

    @property
    def limit(self) -> str:
        """What not to do, in one sentence."""
        return "Do not tear the duct."


class GentleDissection(msgspec.Struct, frozen=True, tag_field="exercise", tag="gentle-dissection"):
    """Tear the duct with the least force-time product.

    Attributes
    ----------
    product_limit_N_s
        Largest force-time product, N s.
    time_limit_s
        Time for all of it.
    """

    product_limit_N_s: float  # noqa: N815
    time_limit_s: float = 60.0
    title: ClassVar[str] = "Dissect gently"

    def __post_init__(self) -> None:
        _above_zero(self, "product_limit_N_s")
        _in_time(TICK_SECONDS, self.time_limit_s)

    @property
    def goal(self) -> str:
        """What to do, in one sentence."""
        return "Tear the duct with as little force-time product as you can."

    @property
    def limit(self) -> str:
        """What not to do, in one sentence."""
        return f"Spend no more than {self.product_limit_N_s:.3g} N s."


def _above_zero(exercise: msgspec.Struct, *names: str) -> None:
    for name in names:
        value = getattr(exercise, name)
        if not 0.0 < value < math.inf:
            raise ValueError(f"{name} must be above 0 and finite, got {value}")


def _in_time(seconds: float, limit: float) -> None:
    if not 0.0 < seconds <= limit <= LONGEST_SECONDS:
        raise ValueError(
            f"seconds must be above 0 and within time_limit_s, at most {LONGEST_SECONDS:g} s; "
            f"got {seconds} of {limit}"
        )


Exercise = HoldStretch | ApproachBreak | GentleDissection
