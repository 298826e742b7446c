"""Scripted hands: an exercise done as a careful, hasty or clumsy person would, always the same.

A hand moves to the middle of the goal's band by a reach of minimum jerk (Flash and Hogan 1985, J
Neurosci 5:1688),
    x(t) = x0 + (x1 - x0) (10 s^3 - 15 s^4 + 6 s^5),   s = t / T,
stays as long as the exercise asks for, and moves on to what it asks for next until it is over. A
manner adds to that: how long a reach takes, how far it overshoots, how the hand sways, and how
often it loses the duct.
"""

import math
from dataclasses import dataclass
from itertools import cycle

from app.simulation.clock import TICK_SECONDS
from app.simulation.exercise import ApproachBreak, Exercise, GentleDissection, HoldStretch
from app.simulation.grasper import HAND_SPEED
from app.simulation.session import Session

__all__ = ["CAREFUL", "CLUMSY", "HASTY", "Manner", "do_exercise"]

# s of staying beyond what the exercise asks for.
SPARE_SECONDS = 0.5
LOST_SECONDS = 0.3
"""s for which a lost duct is not held."""
# Peak speed of a reach of minimum jerk over its mean speed: 15/8.
PEAK_SPEED = 1.875


@dataclass(frozen=True, slots=True)
class Manner:
    """How a hand moves."""

    reach_seconds: float  # s
    overshoot: float  # of an outward reach before it is corrected, over the goal
    # amplitude over the goal, and Hz, of each of its own oscillations
    sway: tuple[tuple[float, float], ...]
    loses_after: float = math.inf  # s of holding after which the duct slips away, each time


CAREFUL = Manner(1.5, 0.0, ((0.004, 9.0),))
"""Slow, with the tremor that every hand has, of 8 to 12 Hz."""
HASTY = Manner(0.3, 0.4, ((0.01, 9.0),))
"""As quick as a hand can be; it corrects its overshoot a reaction time late."""
CLUMSY = Manner(1.2, 0.1, ((0.2, 0.7), (0.15, 1.9)), 4.0)
"""Neither quick nor steady; it loses the duct every few seconds."""


def do_exercise(session: Session, manner: Manner) -> None:
    """Do the exercise that was started, until it is over."""
    run, band = session.run, session.goal
    if run.exercise is None or band is None:
        raise ValueError("a scripted hand does an exercise with a band of deflections")
    goal = 0.5 * sum(band)
    session.grab(0, session.task_grasp)
    held, wanted = 0.0, 0.0
    ways = cycle(_ways(run.exercise, goal))
    while not run.over:
        to, stay = next(ways)
        for reached in _reach(wanted, to, stay, manner):
            if run.over:
                return
            held += TICK_SECONDS
            if held > manner.loses_after:
                session.release()
                session.advance(round(LOST_SECONDS / TICK_SECONDS))
                session.grab(0, session.task_grasp)
                held = 0.0
            seconds = run.seconds
            off = sum(part * math.sin(2.0 * math.pi * rate * seconds) for part, rate in manner.sway)
            session.lift(reached + off * goal)
            session.advance()
        wanted = to


def _ways(exercise: Exercise, goal: float) -> list[tuple[float, float]]:
    """Return the deflections that a hand goes to, mm, and how long it stays at each, s."""
    if isinstance(exercise, HoldStretch | ApproachBreak):
        return [(goal, exercise.seconds + SPARE_SECONDS)]
    if isinstance(exercise, GentleDissection):
        return [(goal, exercise.seconds + SPARE_SECONDS), (0.0, SPARE_SECONDS)]
    return [(goal, exercise.time_limit_s)]


def _reach(start: float, goal: float, stay: float, manner: Manner) -> list[float]:
    """Return the deflections of a reach, tick by tick, mm: out, any correction, and the stay."""
    past = goal + manner.overshoot * max(goal - start, 0.0)
    back = manner.reach_seconds if past > goal else 0.0
    out = _minimum_jerk(start, past, manner.reach_seconds)
    return out + _minimum_jerk(past, goal, back) + [goal] * round(stay / TICK_SECONDS)


def _minimum_jerk(start: float, goal: float, seconds: float) -> list[float]:
    """Return a reach of minimum jerk tick by tick, never faster than `HAND_SPEED`."""
    # Long enough for the peak speed to stay below that of a hand.
    least = PEAK_SPEED * abs(goal - start) / HAND_SPEED if seconds > 0.0 else 0.0
    ticks = math.ceil(max(seconds, least) / TICK_SECONDS - 1e-9)
    parts = [tick / ticks for tick in range(1, ticks + 1)]
    return [start + (goal - start) * s**3 * (10.0 - 15.0 * s + 6.0 * s * s) for s in parts]
