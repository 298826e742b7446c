"""Errors of pace: how fast a hold loads the wall, in a bed or without one."""

import math
from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.simulation.exercises.errors.incidents import Incidents
from app.simulation.inputs.clock import REACTION_SECONDS, TICK_SECONDS
from kernel_cache import kernel

Floats = NDArray[np.float64]

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
BREAKING, PARTING, NEAR = 1, 2, 3
"""What a hand does that is too fast: load the wall, part strands, go on near the break."""


class PaceLimits(NamedTuple):
    """Parameters of the errors of pace."""

    fast: float  # stress ratio from which on its growth is judged
    fast_seconds: float
    fast_speed: float  # mm/s
    near: float  # stress ratio near the break
    near_seconds: float


class Pace:
    """The stress ratio of the last ticks, and what is said of its growth."""

    def __init__(self, incidents: Incidents) -> None:
        self._incidents = incidents
        self.ratios = np.zeros(KEPT_TICKS)
        """(KEPT_TICKS,) of the last ticks, newest first."""
        fast, near = (incidents.limits[key] for key in ("fast_pull", "near_break_fast"))
        # Without strands there is no speed at which they part.
        speed = fast.get("speed", math.inf)
        self.limits = PaceLimits(
            fast["least"], fast["seconds"], speed, near["least"], near["seconds"]
        )

    @property
    def ratio(self) -> float:
        """The stress ratio now."""
        return float(self.ratios[0])

    @property
    def too_fast(self) -> bool:
        """Whether at this pace the wall would break within a reaction time."""
        return seconds_left(self.ratios, PULL_TICKS, 1) < REACTION_SECONDS

    def note(self, found: int, hand: int, at: float | None, speed: float) -> None:
        """Note what `judge` has found of the hand that loads the wall, mm/s, at a station."""
        if found == BREAKING:
            left = seconds_left(self.ratios, PULL_TICKS, 1)
            # Rounded down, so that it is seen to be below a reaction time.
            ms = math.floor(1e3 * left)
            words = f"the wall would have broken in {1e-3 * ms:.3f} s" if ms else AT_BREAK
            self._incidents.note(
                "fast_pull", hand, at, 1e3 - left, speed_mm_per_s=speed, outcome=words
            )
        elif found == PARTING:
            self._incidents.note("fast_pull", hand, at, speed, speed_mm_per_s=speed, outcome=BEFORE)
        elif found == NEAR:
            growth = 100.0 * _growth(self.ratios, NEAR_TICKS, SMOOTH_TICKS)
            self._incidents.note(
                "near_break_fast",
                hand,
                at,
                growth,
                stress_percent=100.0 * self.ratio,
                growth_percent_per_s=growth,
            )


@kernel()
def take_ratio(ratios: Floats, ratio: float) -> None:
    """Take the stress ratio of a tick."""
    for k in range(KEPT_TICKS - 1, 0, -1):
        ratios[k] = ratios[k - 1]
    ratios[0] = ratio


@kernel()
def _growth(ratios: Floats, ticks: int, smooth: int) -> float:
    """Return the ratio's growth a second; each end is a mean of some ticks."""
    growth = 0.0
    for k in range(smooth):
        growth += ratios[k] - ratios[ticks + k]
    return growth / smooth / (ticks * TICK_SECONDS)


@kernel()
def seconds_left(ratios: Floats, ticks: int, smooth: int) -> float:
    """Return 1 less the ratio over its growth, s."""
    growth = _growth(ratios, ticks, smooth)
    return max(1.0 - ratios[0], 0.0) / growth if growth > 0.0 else math.inf


@kernel()
def judge(ratios: Floats, speed: float, parted: bool, limits: PaceLimits) -> int:
    """Judge the hand that loads the wall, mm/s, and whether strands part too: what it does."""
    ratio = ratios[0]
    if ratio > limits.fast and seconds_left(ratios, PULL_TICKS, 1) < limits.fast_seconds:
        return BREAKING
    if parted and speed > limits.fast_speed:
        return PARTING
    if ratio > limits.near:
        total = 0.0
        for k in range(PULL_TICKS):
            total += ratios[k]
        left = seconds_left(ratios, NEAR_TICKS, SMOOTH_TICKS)
        if total / PULL_TICKS > limits.near and left < limits.near_seconds:
            return NEAR
    return 0


class PullErrorFinder:
    """Finds the incidents of one run of a free duct: errors of pace, and the tear."""

    def __init__(self) -> None:
        self.incidents = Incidents(None, {})
        self._pace = Pace(self.incidents)
        self._deflections = deque([0.0] * (PULL_TICKS + 1), maxlen=PULL_TICKS + 1)

    def take(self, stress_ratio: float, deflection: float, *, held: bool) -> None:
        """Take a tick (mm)."""
        self.incidents.tick += 1
        pace = self._pace
        take_ratio(pace.ratios, stress_ratio)
        self._deflections.append(deflection)
        speed = (deflection - self._deflections[0]) / (PULL_TICKS * TICK_SECONDS)
        if held and speed > LEAST_SPEED:
            pace.note(judge(pace.ratios, speed, False, pace.limits), 0, None, speed)
        self.incidents.end_tick("near miss" if self._pace.too_fast else "none")

    def tear(self, station: float) -> None:
        """Note a tear at a station, mm, in the present tick."""
        self.incidents.note("tear", None, station, at_mm=station, name="duct", by="", instead="")
        self.incidents.end_tick("injury")
