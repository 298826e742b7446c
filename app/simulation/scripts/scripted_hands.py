"""Scripted hands: an exercise done well, hastily or clumsily, always the same.

A technique is what hands do, with numbers for how they do it. It gives a session its inputs each
time a tick is due. Good hands are careful and steady, and no surgeon's.

The hand of a free duct moves to the middle of the goal's band by a reach of minimum jerk (Flash and
Hogan 1985, J Neurosci 5:1688),
    x(t) = x0 + (x1 - x0) (10 s^3 - 15 s^4 + 6 s^5),   s = t / T,
stays as long as the exercise asks for, and moves on to what it asks for next until it is over.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import cycle
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from app.simulation.exercises.exercise import Exercise
from app.simulation.exercises.goals import FreeLength, Stay
from app.simulation.inputs.clock import TICK_SECONDS
from app.simulation.inputs.grasper import HAND_SPEED
from app.simulation.session.holding import NEAR_BREAK, STEP_MM
from app.simulation.session.session import Session
from app.simulation.tissue.clip_steps import Bleeding, ClipSite
from app.simulation.tissue.instruments import JAW_RADIUS
from app.simulation.tissue.spatial_tissue import LEAST_FLOW

Floats = NDArray[np.float64]
REST_SECONDS = 0.3
JAWS_MM = 4.0
"""How wide a clip applier is open: past an artery's width, and short of its neighbours."""
FROM_TEAR_MM = (1.5, 2.0, 3.0, 4.0)
"""Sites of a clip; that which is clearest of other tubes is taken."""
MOST_MM = 25.0
"""How far a hand lifts at most."""
# s of staying beyond what the exercise asks for.
SPARE_SECONDS = 0.5
LOST_SECONDS = 0.3
"""s for which a lost duct is not held."""
# Peak speed of a reach of minimum jerk over its mean speed: 15/8.
PEAK_SPEED = 1.875


class Technique(Protocol):
    """What a pair of hands does."""

    def inputs(self, session: Session, exercise: Exercise) -> Iterator[None]:
        """Give the inputs of an exercise that was started; yields when a tick is due."""
        ...


def perform(session: Session, technique: Technique) -> None:
    """Do the exercise that was started, until it is over or the hands are done."""
    exercise = session.run.exercise
    if exercise is None:
        raise ValueError("scripted hands do an exercise: start one")
    for _ in technique.inputs(session, exercise):
        session.advance()
        if session.run.over:
            return


@dataclass(frozen=True, slots=True)
class Lift:
    """Takes hold in the middle of what is to be freed and pulls it off."""

    speed: float = 5.0  # mm/s
    lean: float = 0.0  # off straight up, rad

    def inputs(self, session: Session, exercise: Exercise) -> Iterator[None]:
        """Pull."""
        yield from _lift(session, _middle(exercise), MOST_MM, self.speed, self.lean)


@dataclass(frozen=True, slots=True)
class Spread:
    """Passes a closed dissector behind the duct and opens it."""

    speed: float = 5.0  # mm/s of a jaw
    held: float = 0.0  # how high the duct is held up meanwhile, in gaps of its bed
    beside: bool = False  # starts beside what is to be freed, not in its middle

    def inputs(self, session: Session, exercise: Exercise) -> Iterator[None]:
        """Hold up, pass behind, open."""
        duct, middle = session.spatial, _middle(exercise)
        if self.held > 0.0:
            yield from _lift(session, middle, self.held * duct.gap_mm, self.speed)
        # Opening jaws part what is beside the closed ones and the strands that lean over them: all
        # of a scar, if they start beside it.
        aside = 2.0 * JAW_RADIUS + 0.5 * duct.gap_mm
        session.choose_instrument(1, "dissector")
        start = duct.hands[1].place.copy()
        start[0] = _goal(exercise).from_mm - aside if self.beside else middle
        session.move_hand(1, start)
        behind = start.copy()
        for passed in _steps(-2.0 * start[1], 20.0):
            behind[1] = start[1] + passed
            session.move_hand(1, behind.copy())
            yield
        yield from _rest()
        for opened in _steps(2.0 * MOST_MM, 2.0 * self.speed):
            session.open_jaws(1, opened)
            yield


@dataclass(frozen=True, slots=True)
class Follow:
    """Lifts at the front of a divided duct until it has moved on, and takes hold again there."""

    speed: float = 5.0  # mm/s
    behind: float = 0.0  # how far behind the front the hook takes hold, mm
    lean: float = 0.0  # of pulls off straight up, rad
    slows: bool = True  # near the break

    def inputs(self, session: Session, exercise: Exercise) -> Iterator[None]:
        """Lift and take hold again, without end."""
        while True:
            front = _front(session, exercise)
            at = front + self.behind
            for _ in _lift(session, at, MOST_MM, self.speed, self.lean, slows=self.slows):
                yield
                if front - _front(session, exercise) >= STEP_MM:
                    break
            session.release(0)
            yield from _rest()


@dataclass(frozen=True, slots=True)
class Reach:
    """Leads a free duct to its goal, as often as the exercise asks for."""

    seconds: float  # s of a reach
    overshoot: float = 0.0  # of an outward reach before it is corrected, over the goal
    # amplitude over the goal, and Hz, of each of its own oscillations
    sway: tuple[tuple[float, float], ...] = ()
    loses_after: float = math.inf  # s of holding after which the duct slips away, each time

    def inputs(self, session: Session, exercise: Exercise) -> Iterator[None]:
        """Reach, stay, and lead back where that is asked for."""
        band, goal = session.goal, exercise.goal
        if band is None or not isinstance(goal, Stay):
            raise ValueError(f"a hand that reaches does an exercise with a band, not {goal}")
        middle, stay = 0.5 * sum(band), goal.seconds + SPARE_SECONDS
        stops = [(middle, stay)]
        if goal.return_below is not None:
            stops.append((0.0, SPARE_SECONDS))
        session.grab(0, session.task_grasp)
        held, wanted = 0.0, 0.0
        for to, seconds in cycle(stops):
            for reached in self._reach(wanted, to, seconds):
                held += TICK_SECONDS
                if held > self.loses_after:
                    session.release()
                    for _ in range(round(LOST_SECONDS / TICK_SECONDS)):
                        yield
                    session.grab(0, session.task_grasp)
                    held = 0.0
                angle = 2.0 * math.pi * session.run.seconds
                off = sum(amplitude * math.sin(angle * rate) for amplitude, rate in self.sway)
                session.lift(reached + off * middle)
                yield
            wanted = to

    def _reach(self, start: float, goal: float, stay: float) -> list[float]:
        """Return the deflections of a reach by tick, mm: out, any correction, and the stay."""
        past = goal + self.overshoot * max(goal - start, 0.0)
        back = self.seconds if past > goal else 0.0
        out = _minimum_jerk(start, past, self.seconds)
        return out + _minimum_jerk(past, goal, back) + [goal] * round(stay / TICK_SECONDS)


@dataclass(frozen=True, slots=True)
class Clip:
    """Clips the tube that bleeds, on the side from which the blood comes."""

    speed: float = 8.0  # mm/s of the tip
    seconds: float = 2.0  # until it goes, to find the tube
    before: tuple[float, ...] = FROM_TEAR_MM  # mm, the sites of which the clearest is taken

    def inputs(self, session: Session, exercise: Exercise) -> Iterator[None]:
        """Come along the shaft past the tube, clip it, and wait; once more if it bleeds on."""
        duct = session.spatial
        while True:
            session.choose_instrument(1, "clip applier")
            session.open_jaws(1, JAWS_MM)
            for _ in range(round(self.seconds / TICK_SECONDS)):
                yield
            blood = duct.fluids["blood"]
            bleeding = Bleeding.of(duct)
            if bleeding is None:
                return
            site = ClipSite.clearest(
                duct, bleeding.tube, bleeding.stations(self.before), JAWS_MM, bleeding.is_closed_by
            )
            session.aim(1, site.shaft.tolist())
            session.spread(1, site.across.tolist())
            start, goal = duct.hands[1].place.copy(), site.tip
            far = float(np.sqrt(((goal - start) ** 2).sum()))
            for gone in _steps(far, self.speed):
                session.move_hand(1, start + (goal - start) * (gone / far))
                yield
            yield from _rest()
            session.clip(1)
            yield from _rest()
            while not any(each.flow > LEAST_FLOW for each in blood.holes):
                yield


CAREFUL = Reach(5.0, 0.0, ((0.004, 9.0),))
"""Slow, with the tremor that every hand has, of 8 to 12 Hz."""
HASTY = Reach(0.3, 0.4, ((0.01, 9.0),))
"""As quick as a hand can be; it corrects its overshoot a reaction time late."""
CLUMSY = Reach(1.2, 0.1, ((0.2, 0.7), (0.15, 1.9)), 4.0)
"""Neither quick nor steady; it loses the duct every few seconds."""
REACHES: dict[str, Technique] = {"good": CAREFUL, "hasty": HASTY, "clumsy": CLUMSY}

MANNERS: dict[str, dict[str, Technique]] = {
    "window": {"good": Spread(), "hasty": Lift(speed=40.0), "clumsy": Spread(held=1.0)},
    "follow_front": {
        "good": Follow(),
        "hasty": Follow(speed=40.0),
        "clumsy": Follow(behind=5.0),
        "sideways": Follow(lean=math.radians(45.0)),
    },
    "free_scar": {
        "good": Spread(held=0.8, beside=True),
        "hasty": Spread(speed=20.0, beside=True),
        "clumsy": Spread(held=8.0 / 3.0, beside=True),
    },
    "stop_bleeding": {"good": Clip()},
    "hold_stretch": REACHES,
    "approach_break": REACHES,
    "gentle_lifts": REACHES,
}
"""Good hands and others, by the name of the exercise."""


def _lift(
    session: Session,
    station: float,
    height: float,
    speed: float,
    lean: float = 0.0,
    *,
    slows: bool = False,
) -> Iterator[None]:
    """Take hold with the first hand and pull to a height, mm; slower near the break if asked."""
    start = session.grab(0, station)
    if start is None:
        return
    up = np.array([0.0, math.sin(lean), math.cos(lean)])
    ticks, done = len(_steps(height, speed)), 0.0
    while done < ticks:
        done += 0.5 if slows and session.spatial.stress_ratio > NEAR_BREAK else 1.0
        session.move_hand(0, np.array(start) + height * done / ticks * up)
        yield


def _goal(exercise: Exercise) -> FreeLength:
    goal = exercise.goal
    if not isinstance(goal, FreeLength):
        raise ValueError(f"these hands free a length of duct, which {exercise.title} does not ask")
    return goal


def _middle(exercise: Exercise) -> float:
    goal = _goal(exercise)
    return 0.5 * (goal.from_mm + goal.to_mm)


def _front(session: Session, exercise: Exercise) -> float:
    """Return where the bed begins before what was open, mm."""
    # A strand left behind does not count as the front.
    goal = _goal(exercise)
    return goal.to_mm - goal.freed(session.spatial.freed_stretches())


def _steps(distance: float, speed: float) -> list[float]:
    """Return how far a hand has come at each tick of an even way, mm."""
    ticks = max(1, math.ceil(abs(distance) / (speed * TICK_SECONDS)))
    return [distance * tick / ticks for tick in range(1, ticks + 1)]


def _rest() -> Iterator[None]:
    for _ in range(round(REST_SECONDS / TICK_SECONDS)):
        yield


def _minimum_jerk(start: float, goal: float, seconds: float) -> list[float]:
    """Return a reach of minimum jerk tick by tick, never faster than `HAND_SPEED`."""
    # Long enough for the peak speed to stay below that of a hand.
    least = PEAK_SPEED * abs(goal - start) / HAND_SPEED if seconds > 0.0 else 0.0
    ticks = math.ceil(max(seconds, least) / TICK_SECONDS - 1e-9)
    fractions = [tick / ticks for tick in range(1, ticks + 1)]
    return [start + (goal - start) * s**3 * (10.0 - 15.0 * s + 6.0 * s * s) for s in fractions]
