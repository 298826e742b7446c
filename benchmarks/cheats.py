"""Looks for policies that pass an exercise with errors, as trainees find them: by trying.

CMA-ES (Hansen and Ostermeier 2001, Evol. Comput. 9:159) searches the numbers of a policy. It begins
as hands that pass without an error, and is paid for each pass, and more for one with errors. In a
bed and at an anatomy a policy is linear in what scripted hands would do now and in a few features,
on beds that change. Of a free duct it is a series of motions. What passes with an incident, or past
what the exercise teaches, is a cheat: its run is kept, and replays in the page.
"""

import math
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from app.command_line.load import shipped_organ
from app.rl.demonstration import work
from app.rl.environment import DissectionEnv
from app.rl.episode import Observation
from app.rl.task import Task
from app.simulation import (
    ELEMENTS,
    FEW,
    HAND_SPEED,
    MANNERS,
    TICK_SECONDS,
    Exercise,
    Session,
    free_specimen,
    run_json,
)
from app.simulation.exercises.goals import Stay
from app.simulation.inputs.clock import REACTION_SECONDS
from benchmarks.faults import exercises

Floats = NDArray[np.float64]

IN_SPACE: dict[str, dict[str, Any]] = {
    "window": {},
    "follow_front": {},
    "free_scar": {},
    "stop_bleeding": {"anatomy": "normal", "instruments": ("grasper", "clip applier")},
    "first_view": {"anatomy": "normal"},
    "critical_view": {"anatomy": "normal"},
}
PULLS = ("hold_stretch", "approach_break", "gentle_lifts")
EXERCISES = (*IN_SPACE, *PULLS)
POPULATION, TIME_LIMIT_S, TICKS_PER_STEP = 16, 40.0, 3
FOLDER = Path(__file__).parents[1] / "build" / "cheats"
REWARD = {"errors": 0.0, "stress": 0.0, "failed": -0.2}
SIGMA, SIGMA_OF_PULLS, PAID = 0.03, 0.25, 0.5
"""Standard deviation of the first weights, and of a pull's numbers; reward of each class of errors
in a pass."""
MOTIONS, NUMBERS = 7, 9
"""Of a pull: how many, and numbers of each; zero is what good hands do."""
GROWTH_TICKS, LEAST_RATIO = 4, 0.1
"""Ticks over which the growth of the stress is taken, and the part of the break from which on it
is looked at: as of the error `fast_pull`, but whatever the hand does."""
TOO_FAST, NOT_KEPT, NOT_LED = "too-fast", "not-kept", "not-led-back"
"""What a pull may go past: it leaves no time to react, no one hold leads it there and keeps it, and
it is not led back."""


class Try(NamedTuple):
    """What came of a policy's try."""

    session: Session
    reward: float
    past: dict[str, float]  # how far, 0 to 1, it went past what the exercise teaches; 1: wholly


class Searched(NamedTuple):
    """What a search is about."""

    start: Floats  # numbers of a policy that does well
    sigma: float
    play: Callable[[Floats, int], Try]  # numbers and the seed of a bed


class _Rest:
    """Hands that do nothing, where no scripted ones know the exercise."""

    def inputs(self, session: Session, exercise: Exercise) -> Iterator[None]:
        """Wait."""
        while True:
            yield


def centre_of(task: Task) -> Floats:
    """Return where an exercise is about, (3,) mm: under its stretch of duct, or amid the tubes."""
    if task.goal is not None:
        return np.array([0.5 * (task.goal.from_mm + task.goal.to_mm), 0.0, -6.0])
    tubes = task.duct.tubes(elements=ELEMENTS).network.tubes.values()
    return np.concatenate([each.places for each in tubes]).mean(axis=0)


def features(observed: Observation, wanted: Floats, centre: Floats) -> Floats:
    """Return (F,) what hands would do, each hand about a centre, what is done, and time."""
    # Both end with progress and the time left.
    goal = observed["goal" if "goal" in observed else "view"].astype(np.float64)
    inputs = [np.clip(wanted, -1.0, 1.0), goal[-2:-1], 1.0 - goal[-1:] / TIME_LIMIT_S, np.ones(1)]
    for hand in observed["hands"].astype(np.float64):
        force = np.sqrt((hand[3:6] ** 2).sum())
        inputs += [(hand[:3] - centre) / (10.0, 10.0, 5.0), [force, hand[6], hand[7] / 20.0]]
    return np.concatenate(inputs)


def in_space(exercise: str) -> Searched:
    """Return a linear policy of hands in a bed or at an anatomy."""
    env = DissectionEnv(
        exercise=exercise,
        **IN_SPACE[exercise],
        ticks_per_step=TICKS_PER_STEP,
        time_limit=TIME_LIMIT_S,
        speed=HAND_SPEED,
        reward=REWARD,
    )
    technique = MANNERS.get(exercise, {}).get("good", _Rest())
    observed, _ = env.reset(seed=1)
    centre, outputs = centre_of(env.task), env.task.size
    size = features(observed, np.zeros(outputs), centre).size

    def play(numbers: Floats, bed: int) -> Try:
        weights = numbers.reshape(outputs, size)

        def change(seen: Observation, wanted: Floats) -> Floats:
            return (weights * features(seen, wanted, centre)).sum(axis=1)

        reward = float(work(env, technique, bed, change=change).rewards.sum())
        assert env.episode is not None
        return Try(env.episode.session, reward, {})

    return Searched(np.eye(outputs, size).ravel(), SIGMA, play)


def of_free_duct(name: str) -> Searched:
    """Return a policy of a pull: motions one after another."""
    exercise = exercises(None)[name]
    goal = exercise.goal
    assert isinstance(goal, Stay)
    session = Session(free_specimen(shipped_organ()), vertices=FEW, watched=False)

    def play(numbers: Floats, bed: int) -> Try:
        session.start_exercise(exercise)
        course: list[Pulled] = []
        for hold in motions(session, goal, numbers.reshape(MOTIONS, NUMBERS)):
            session.advance()
            tissue = session.planar
            check, holds = tissue.grasped.check, tissue.grasper.holds
            deflection = tissue.grasped.pulled.deflection
            course.append(Pulled(hold if holds else 0, deflection, 1.0 - check.distance_to_break))
            if session.run.over:
                break
        outcome = session.run.outcome
        passed = outcome is not None and outcome.passed
        return Try(session, session.run.progress + passed, went_past(goal, course))

    return Searched(np.zeros(MOTIONS * NUMBERS), SIGMA_OF_PULLS, play)


class Pulled(NamedTuple):
    """A tick of a pull."""

    hold: int  # which one, from 1; 0 where nothing holds the duct
    deflection: float  # mm, of where it is held
    ratio: float  # stress over the break's

    def within(self, goal: Stay) -> bool:
        """Return whether it is where the exercise asks for it."""
        by_deflection = goal.quantity == "deflection_mm"
        return goal.low <= (self.deflection if by_deflection else 1.0 - self.ratio) <= goal.high


def motions(session: Session, goal: Stay, numbers: Floats) -> Iterator[int]:
    """Do motions one after another, and stay after each; yields the number of the hold."""
    band, centre = session.goal, session.task_grasp
    assert band is not None
    middle = 0.5 * sum(band)
    holds, reached = 0, 0.0
    for number, row in enumerate(numbers):
        anew, place, to, slow, shape, stay, lets_go, sway, quick = row
        # By hand it takes hold of the duct elsewhere, or where it holds it already.
        if anew > 0.5 or not session.planar.grasper.holds:
            session.grab(0, centre + 10.0 * place)
            holds, reached = holds + 1, session.planar.grasper.deflection
        back = number % 2 == 1 and goal.return_below is not None
        start, end = reached, middle * ((0.0 if back else 1.0) + 0.3 * to)
        ticks = round(min(4.0 * math.exp(slow), 20.0) / TICK_SECONDS) + 1
        stays = round(min((goal.seconds + 0.5) * math.exp(stay), 20.0) / TICK_SECONDS)
        for tick in range(1, ticks + stays + 1):
            s = min(tick / ticks, 1.0) ** min(math.exp(shape), 50.0)
            reached = start + (end - start) * s**3 * (10.0 - 15.0 * s + 6.0 * s * s)
            angle = 2.0 * math.pi * min(math.exp(quick), 10.0) * tick * TICK_SECONDS
            # A sway is a reversal, which good hands have none of.
            session.lift(reached + 0.1 * sway * middle * math.sin(angle))
            yield holds
        if lets_go > 0.5:
            session.release()


def went_past(goal: Stay, course: Sequence[Pulled]) -> dict[str, float]:
    """Return how far a pull went past what is taught: to react, to lead and keep, to lead back."""
    least = math.inf
    for before, now in zip(course, course[GROWTH_TICKS:], strict=False):
        growth = (now.ratio - before.ratio) / (GROWTH_TICKS * TICK_SECONDS)
        if before.hold == now.hold > 0 and growth > 0.0 and now.ratio > LEAST_RATIO:
            least = min(least, max(1.0 - now.ratio, 1e-9) / growth)
    past = {TOO_FAST: min(REACTION_SECONDS / least, 1.0)}
    wanted = round(goal.seconds / TICK_SECONDS)
    if goal.return_below is None:
        holds = {each.hold for each in course[-wanted:]}
        first = next((each for each in course if each.hold in holds), None)
        past[NOT_KEPT] = float(len(holds) > 1 or (first is not None and first.within(goal)))
        return past
    led = kept = hold = 0
    for each in course:
        kept, hold = kept if each.hold == hold else 0, each.hold
        if kept < wanted:
            kept = kept + 1 if hold and each.within(goal) else 0
        elif each.deflection <= goal.return_below:
            led, kept = led + 1, 0
    past[NOT_LED] = float(led < goal.repeats)
    return past


def search(exercise: str, seconds: float) -> dict[str, Any]:
    """Search for so many seconds; return what was tried, what passed, and cheats by error."""
    import cma  # pyright: ignore[reportMissingImports]

    searched = of_free_duct(exercise) if exercise in PULLS else in_space(exercise)

    def begun(seed: int) -> Any:
        options = {"popsize": POPULATION, "seed": seed, "verbose": -9, "CMA_diagonal": True}
        return cma.CMAEvolutionStrategy(searched.start, searched.sigma, options)

    starts, evolution = 1, begun(1)
    draw, start = np.random.default_rng(1), time.monotonic()
    tried = passed = ticks = 0
    best = -np.inf
    cheats: Counter[str] = Counter()
    while time.monotonic() - start < seconds:
        if evolution.stop():
            starts += 1
            evolution = begun(starts)
        asked = evolution.ask()
        bed, returns = int(draw.integers(1, 21)), np.zeros(POPULATION)
        for i, each in enumerate(asked):
            session, returns[i], past = searched.play(np.asarray(each), bed)
            ticks += session.run.ticks
            outcome = session.run.outcome
            if outcome is None or not outcome.passed:
                continue
            passed += 1
            errors = {found.error for found in session.run.incidents()}
            returns[i] += PAID * (len(errors) + sum(past.values()))
            found = sorted(errors | {key for key, far in past.items() if far >= 1.0})
            if found:
                key = ", ".join(found)
                if not cheats[key]:
                    FOLDER.mkdir(parents=True, exist_ok=True)
                    name = f"{exercise}-{'-'.join(found)}.json"
                    (FOLDER / name).write_bytes(run_json(session.run_file()))
                cheats[key] += 1
        evolution.tell(asked, (-returns).tolist())
        tried += POPULATION
        best = max(best, float(returns.max()))
    return {
        "seconds": time.monotonic() - start,
        "episodes": tried,
        "starts": starts,
        "ticks_per_second": ticks / (time.monotonic() - start),
        "passed": passed,
        "best_return": best,
        "cheats": dict(cheats),
    }


def measure_cheats(
    console: Console, seconds: float = 600.0, names: Sequence[str] = EXERCISES
) -> dict[str, Any]:
    """Print and return what a search finds in exercises, some seconds in each."""
    figures: dict[str, Any] = {}
    for exercise in names:
        with console.status(f"Looking for cheats in {exercise} ..."):
            found = search(exercise, seconds)
        figures[exercise] = found
        cheats = "; ".join(f"{often} with {key}" for key, often in found["cheats"].items())
        console.print(
            f"{exercise}: {found['episodes']} episodes in {found['seconds']:.0f} s, best return "
            f"{found['best_return']:.2f}, {found['passed']} passed; cheats: {cheats or 'none'}",
            highlight=False,
            soft_wrap=True,
        )
    return figures
