"""Errors of pace: how fast a hold loads the wall, in a bed or without one."""

import math
from collections import deque

from app.simulation.exercises.errors.incidents import Incidents
from app.simulation.inputs.clock import REACTION_SECONDS, TICK_SECONDS

__all__ = ["LEAST_SPEED", "PULL_TICKS", "Pace", "PullErrorFinder"]

PULL_TICKS, NEAR_TICKS = 4, 10
"""Ticks over which the growth of the stress ratio is taken, and that near the break: over fewer a
hand's tremor is most of it."""
SMOOTH_TICKS = 3
"""Ticks whose mean each end of the growth near the break is: 0.1 s, nearly a whole tremor. The
middle of all that it is taken from is 0.2 s ago: later, and a hand that slows down seems fast."""
KEPT_TICKS = NEAR_TICKS + SMOOTH_TICKS
LEAST_SPEED = 1.0
"""mm/s below which a hand that holds still trembles: what loads the wall then is not its pull."""
BEFORE = "strands parted before you could stop"
AT_BREAK = "the wall came to its break before you could stop"


class Pace:
    """The stress ratio of the last ticks, and what is said of its growth."""

    def __init__(self, incidents: Incidents) -> None:
        self._incidents = incidents
        self._stress_ratios = deque([0.0] * KEPT_TICKS, maxlen=KEPT_TICKS)

    @property
    def ratio(self) -> float:
        """The stress ratio now."""
        return self._stress_ratios[-1]

    @property
    def too_fast(self) -> bool:
        """Whether at this pace the wall would break within a reaction time."""
        return self._left(PULL_TICKS) < REACTION_SECONDS

    def take(self, ratio: float) -> None:
        """Take the stress ratio of a tick."""
        self._stress_ratios.append(ratio)

    def judge(self, hand: int, at: float | None, speed: float, *, parted: bool) -> None:
        """Judge the hand that loads the wall, mm/s, at a station; whether strands part too."""
        fast, near = (self._incidents.limits[key] for key in ("fast_pull", "near_break_fast"))
        left = self._left(PULL_TICKS)
        if self.ratio > fast["least"] and left < fast["seconds"]:
            # Rounded down, so that it is seen to be below a reaction time.
            ms = math.floor(1e3 * left)
            words = f"the wall would have broken in {1e-3 * ms:.3f} s" if ms else AT_BREAK
            self._incidents.note("fast_pull", hand, at, 1e3 - left, v=speed, left=words)
        elif parted and speed > fast["speed"]:
            self._incidents.note("fast_pull", hand, at, speed, v=speed, left=BEFORE)
        elif self.ratio > near["least"]:
            mean = sum(self._stress_ratios[-1 - k] for k in range(PULL_TICKS)) / PULL_TICKS
            if mean > near["least"] and self._left(NEAR_TICKS, SMOOTH_TICKS) < near["seconds"]:
                growth = 100.0 * self._growth(NEAR_TICKS, SMOOTH_TICKS)
                self._incidents.note(
                    "near_break_fast", hand, at, growth, p=100.0 * self.ratio, g=growth
                )

    def _growth(self, ticks: int, smooth: int = 1) -> float:
        """Return the ratio's growth a second; each end is a mean of some ticks."""
        ratios = self._stress_ratios
        growth = sum(ratios[-1 - k] - ratios[-1 - ticks - k] for k in range(smooth)) / smooth
        return growth / (ticks * TICK_SECONDS)

    def _left(self, ticks: int, smooth: int = 1) -> float:
        """Return 1 less the ratio over its growth, s."""
        growth = self._growth(ticks, smooth)
        return max(1.0 - self.ratio, 0.0) / growth if growth > 0.0 else math.inf


class PullErrorFinder:
    """Finds the incidents of one run of a free duct: errors of pace, and the tear."""

    def __init__(self) -> None:
        self.incidents = Incidents(None, {})
        self._pace = Pace(self.incidents)
        self._deflections = deque([0.0] * (PULL_TICKS + 1), maxlen=PULL_TICKS + 1)

    def take(self, stress_ratio: float, deflection: float, *, held: bool) -> None:
        """Take a tick (mm)."""
        self.incidents.tick += 1
        self._pace.take(stress_ratio)
        self._deflections.append(deflection)
        speed = (deflection - self._deflections[0]) / (PULL_TICKS * TICK_SECONDS)
        if held and speed > LEAST_SPEED:
            self._pace.judge(0, None, speed, parted=False)
        self.incidents.end_tick("near miss" if self._pace.too_fast else "none")

    def tear(self, station: float) -> None:
        """Note a tear at a station, mm, in the present tick."""
        self.incidents.note("tear", None, station, x=station, name="duct", by="", instead="")
        self.incidents.end_tick("injury")
