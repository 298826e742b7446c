"""Ways to get through an exercise without doing what it teaches: none may pass."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from app.simulation import JAW_RADIUS, Exercise
from app.simulation.exercises.goals import Stay
from app.simulation.scripts.scripted_hands import Clip
from benchmarks.faults import (
    COVERED,
    SAFE,
    Hands,
    Make,
    behind,
    divide_at_once,
    drag,
    front,
    go,
    goal,
    held_and,
    hold_again,
    lift,
    lift_both,
    middle,
    name_all,
    open_beside,
    opened,
    patient_plough,
    say_unsafe,
    steps,
    sweep_triangle,
    tear_off,
    wait,
)

ACROSS = np.array([1.0, -1.0, 1.0])
"""What leads a place before the duct to the one behind it."""


class Cheat(NamedTuple):
    """A way past what an exercise teaches."""

    exercise: str
    name: str
    make: Make
    speeds: tuple[float, ...]
    seed: int = 31  # of the bed or of the anatomy


def twist(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Turn the open jaws about their shaft instead of opening them farther."""
    yield from behind(hands, middle(exercise))
    yield from opened(hands, 14.0, 10.0)
    for angle in steps(12.0 * math.pi, speed):
        hands.spread(1, [math.cos(angle), 0.0, math.sin(angle)])
        yield


def swing(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Swing the shaft about its tip."""
    yield from behind(hands, middle(exercise))
    for angle in steps(12.0 * math.pi, speed):
        lean = 0.9 * math.sin(angle)
        hands.aim(1, [math.sin(lean), -math.cos(lean), 0.0])
        yield


def close_jaws(opening: float) -> Make:
    """Go in with open jaws and close them about what is between."""

    def make(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
        hands.choose_instrument(1, "dissector")
        start = hands.duct.hands[1].place.copy()
        start[0] = middle(exercise)
        yield from go(hands, 1, start, 60.0)
        yield from opened(hands, opening, 40.0)
        yield from go(hands, 1, start * ACROSS, 20.0)
        yield from wait(0.3)
        for closed in steps(opening, speed):
            hands.open_jaws(1, opening - closed)
            yield
        yield from go(hands, 1, start, 20.0)

    return make


def poke(opening: float) -> Make:
    """Go in and out at many places, with jaws that stay as they are."""

    def make(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
        hands.choose_instrument(1, "dissector")
        start = hands.duct.hands[1].place.copy()
        yield from opened(hands, opening, 20.0)
        for off in np.arange(-9.0, 10.0, 1.5):
            start[0] = middle(exercise) + off
            yield from go(hands, 1, start.copy(), 60.0)
            yield from go(hands, 1, start * ACROSS, speed)
            yield from go(hands, 1, start.copy(), speed)

    return make


def two_dissectors(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Plough with two dissectors in turn, neither of them far."""
    hands.choose_instrument(0, "dissector")
    yield from behind(hands, middle(exercise) - 8.0)
    start = hands.duct.hands[0].place.copy()
    start[0] = middle(exercise) + 8.0
    yield from go(hands, 0, start, 60.0)
    yield from go(hands, 0, start * ACROSS, 20.0)
    for _ in range(8):
        yield from lift(hands, np.array([1.4, 0.0, 0.0]), speed, 1)
        yield from lift(hands, np.array([-1.4, 0.0, 0.0]), speed, 0)
        yield from wait(0.5)


def saw(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Draw back less than a turn, and go on aslant."""
    yield from behind(hands, middle(exercise) - 8.0)
    for _ in range(9):
        yield from lift(hands, np.array([0.0, -1.9, 0.0]), speed, 1)
        yield from lift(hands, np.array([1.9, 1.9, 0.0]), speed, 1)
        yield from wait(0.6)


def flutter(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Plough while the jaws open and close a little."""
    yield from behind(hands, middle(exercise) - 9.0)
    yield from drag(
        hands, 18.0, speed, lambda distance: 1.5 * (1.0 + math.sin(36.0 * distance / speed))
    )


def swab_under(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Wipe a swab through below the duct."""
    hands.choose_instrument(1, "swab")
    low = -hands.duct.radius - 1.5
    for place in ((-10.0, low - 4.0, 8.0), (-10.0, low - 4.0, low)):
        yield from go(hands, 1, np.array(place) + np.array([middle(exercise), 0.0, 0.0]), 60.0)
    for place in ((-10.0, 0.0, low), (10.0, 0.0, low)):
        yield from go(hands, 1, np.array(place) + np.array([middle(exercise), 0.0, 0.0]), speed)


def small_lifts(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Lift a little at many places."""
    for off in np.tile(np.arange(-6.0, 7.0, 2.0), 6):
        if hands.grab(0, middle(exercise) + off) is not None:
            yield from lift(hands, np.array([0.0, 0.0, 3.0]), speed)
            yield from lift(hands, np.array([0.0, 0.0, -3.0]), speed)
            hands.release(0)
            yield from wait(0.2)


def both_lift(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Pull the duct off with both hands."""
    hands.choose_instrument(1, "grasper")
    for hand, off in enumerate((-5.0, 5.0)):
        hands.grab(hand, middle(exercise) + off)
    yield from lift_both(hands, 12.0, speed)


def never_lets_go(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Take hold again in the air."""
    for _ in range(60):
        at = front(hands, exercise)
        hands.grab(0, at)
        for _ in lift(hands, np.array([0.0, 0.0, 12.0]), speed):
            yield
            if at - front(hands, exercise) >= 1.0:
                break


def waggle(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Shake sideways while lifting, straight up as a mean."""
    for _ in range(40):
        at = front(hands, exercise)
        start = hands.grab(0, at)
        for distance in steps(12.0, speed):
            if start is not None:
                aside = 0.9 * distance * math.sin(27.0 * distance / speed)
                hands.move_hand(0, np.array(start) + np.array([0.0, aside, distance]))
            yield
            if at - front(hands, exercise) >= 2.0:
                break
        hands.release(0)
        yield from wait(0.3)


def helped_ahead(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Pull on at the front while the other hand pulls a little ahead of it."""
    hands.choose_instrument(1, "grasper")
    at = front(hands, exercise)
    hands.grab(1, at - 8.0)
    hands.grab(0, at)
    start = [each.target.copy() for each in hands.duct.hands]
    for distance in steps(20.0, speed):
        hands.move_hand(0, start[0] + np.array([0.0, 0.0, distance]))
        hands.move_hand(1, start[1] + np.array([0.0, 0.0, 0.1 * distance]))
        yield


def hold_for_show(x: float, y: float, z: float, at: float | None = None) -> Make:
    """Hold the duct without holding it up, and open the jaws; on both sides of the scar."""

    def make(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
        hands.grab(0, middle(exercise) if at is None else at)
        yield from lift(hands, np.array([x, y, z]), 5.0)
        yield from open_beside(hands, exercise, speed)
        for aside in (-6.0, 6.0):
            for closed in steps(40.0, 40.0):
                hands.open_jaws(1, 40.0 - closed)
                yield
            start = hands.duct.hands[1].target.copy()
            place = start + np.array([aside, 0.0, 0.0])
            for to in (start * ACROSS, place * ACROSS, place):
                yield from go(hands, 1, to, 20.0)
            yield from wait(0.3)
            yield from opened(hands, 40.0, speed)

    return make


def let_down_first(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Hold the duct up, let it down again, and open the jaws."""
    hands.grab(0, middle(exercise))
    yield from lift(hands, np.array([0.0, 0.0, 3.0]), 5.0)
    yield from hold_for_show(0.0, 0.0, -3.0)(hands, exercise, speed)


def let_go_first(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Hold the duct up, and let go before the jaws open."""
    hands.grab(0, middle(exercise))
    yield from lift(hands, np.array([0.0, 0.0, 3.0]), 5.0)
    yield from behind(hands, goal(exercise).from_mm - 2.0 * JAW_RADIUS - 1.5)
    hands.release(0)
    yield from opened(hands, 40.0, speed)


def pull_in_pieces(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Pull at the scar from place to place, without a dissector."""
    for at in np.arange(goal(exercise).from_mm, goal(exercise).to_mm + 1.0, 2.0):
        if hands.grab(0, at) is not None:
            yield from lift(hands, np.array([0.0, 0.0, 4.0]), speed)
            yield from lift(hands, np.array([0.0, 0.0, -4.0]), speed)
            hands.release(0)
            yield from wait(0.2)


# A free duct


def band_middle(hands: Hands) -> float:
    """Return the deflection in the middle of what is asked for, mm."""
    band = hands.goal
    assert band is not None
    return 0.5 * sum(band)


def raise_to(hands: Hands, far: float, speed: float) -> Iterator[None]:
    """Lift a free duct, mm from its rest, at a speed, mm/s."""
    for reached in steps(far, speed):
        hands.lift(reached)
        yield


def jump_to(part: float) -> Make:
    """Throw the duct to a part of what is asked for, and then into it."""

    def make(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
        middle = band_middle(hands)
        hands.grab(0, hands.task_grasp)
        for _ in range(6):
            yield from raise_to(hands, part * middle, speed)
            hands.lift(middle)
            yield from wait(4.0)
            hands.lift(0.0)
            yield from wait(1.0)

    return make


def shake(far: float) -> Make:
    """Shake the duct about what is asked for, by a part of it."""

    def make(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
        middle = band_middle(hands)
        hands.grab(0, hands.task_grasp)
        yield from raise_to(hands, middle, 5.0)
        for tick in range(600):
            hands.lift(middle * (1.0 + far * math.sin(speed * tick)))
            yield

    return make


def spring_back(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Lift as one should, and let go in place of leading back."""
    middle = band_middle(hands)
    for _ in range(5):
        hands.grab(0, hands.task_grasp)
        yield from raise_to(hands, middle, speed)
        yield from wait(1.5)
        hands.release()
        yield from wait(0.5)


def hold_in_turns(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Take hold three times a second, so that no hold ever lasts."""
    middle = band_middle(hands)
    for _ in range(30):
        hands.grab(0, hands.task_grasp)
        yield from raise_to(hands, middle, speed)
        hands.release()
        yield


def held_elsewhere(aside: float, part: float) -> Make:
    """Lift, take hold aside, where the duct is deflected less, and anew; nothing is led back."""

    def make(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
        assert isinstance(exercise.goal, Stay)
        hands.grab(0, hands.task_grasp)
        middle, start = band_middle(hands), 0.0
        for _ in range(6):
            for distance in steps(middle - start, speed):
                hands.lift(start + distance)
                yield
            yield from wait(part * exercise.goal.seconds)
            for place in (hands.task_grasp - aside, hands.task_grasp):
                hands.grab(0, place)
                yield
            start = hands.planar.grasper.deflection

    return make


def hold_nearer_to_break(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Lift short of what is asked for, and take hold aside, where the wall is strained more."""
    hands.grab(0, hands.task_grasp)
    short = hands.planar.grasped.load_at(0.75)
    assert short is not None
    yield from raise_to(hands, short.deflection, speed)
    yield from wait(0.5)
    hands.grab(0, hands.task_grasp - 17.5)
    yield from wait(3.0)


def by_sliders(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Make the wall stronger, and set the force in place of pulling."""
    hands.set_threshold(1.0)
    for force in steps(4.0, speed):
        hands.set_target_force(force)
        yield
    yield from wait(5.0)


def look_on_and_clip(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Let it bleed for 20 s, and clip it then."""
    yield from Clip(speed=speed, seconds=20.0).inputs(hands, exercise)


# A picture


def try_each(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Name every tube as each structure in turn, the right one last."""
    names = hands.duct.tubes.names
    for structure, right in zip(exercise.structures, ("cystic", "artery", "common"), strict=True):
        for tube in sorted(range(len(names)), key=lambda each: names[each] == right):
            hands.mark(structure, tube, 5.0)
            yield


def name_then_unsafe(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Name two, and say that it is not safe in place of the third."""
    for structure, tube in zip(exercise.structures, ("cystic", "artery"), strict=False):
        hands.mark(structure, hands.duct.tubes.names.index(tube), 5.0)
        yield
    hands.call_unsafe()
    yield


WITH_A_DISSECTOR = (
    ("twist", twist, (1.5, 3.0)),
    ("swing", swing, (3.0, 6.0)),
    ("close the jaws", close_jaws(26.0), (8.0, 30.0)),
    ("close wide jaws", close_jaws(40.0), (8.0, 15.0)),
    ("poke", poke(0.0), (20.0, 35.0)),
    ("poke with open jaws", poke(2.0), (20.0, 35.0)),
    ("saw", saw, (5.0, 9.0)),
    ("flutter", flutter, (3.0, 9.0)),
    ("a swab below", swab_under, (4.0, 8.0)),
    ("plough patiently", patient_plough, (5.0, 8.0)),
)
CHEATS = (
    *(Cheat("window", *each) for each in WITH_A_DISSECTOR),
    *(
        Cheat("free_scar", f"hold and {name}", held_and(make), speeds)
        for name, make, speeds in WITH_A_DISSECTOR
    ),
    Cheat("window", "two dissectors", two_dissectors, (5.0, 9.0)),
    Cheat("window", "small lifts", small_lifts, (5.0, 10.0)),
    Cheat("window", "both hands lift", both_lift, (3.0, 8.0)),
    Cheat("follow_front", "back over what is free", hold_again((10.0, 0.0, 9.0), 40), (5.0, 9.0)),
    Cheat("follow_front", "on over what is fixed", hold_again((-10.0, 0.0, 9.0), 40), (5.0, 9.0)),
    Cheat("follow_front", "down", hold_again((0.0, 0.0, -6.0), 40), (5.0, 9.0)),
    Cheat("follow_front", "aside", hold_again((0.0, 12.0, 0.0), 40), (5.0, 9.0)),
    Cheat("follow_front", "never let go", never_lets_go, (5.0, 9.0)),
    Cheat("follow_front", "waggle", waggle, (3.0, 5.0, 9.0)),
    Cheat("follow_front", "help ahead", helped_ahead, (4.0, 6.0)),
    Cheat("follow_front", "small lifts", small_lifts, (5.0, 10.0)),
    Cheat("follow_front", "both hands lift", both_lift, (3.0, 8.0)),
    Cheat("free_scar", "hold for show", hold_for_show(0.0, 0.0, 0.1), (8.0, 14.0)),
    Cheat("free_scar", "hold down", hold_for_show(0.0, 0.0, -2.0), (8.0, 14.0)),
    Cheat("free_scar", "hold aside", hold_for_show(0.0, 3.0, 0.0), (8.0, 14.0)),
    Cheat("free_scar", "hold at one end", hold_for_show(0.0, 0.0, 2.0, 4.0), (8.0, 14.0)),
    Cheat("free_scar", "hold at the other", hold_for_show(0.0, 0.0, 2.0, 46.0), (8.0, 14.0)),
    Cheat("free_scar", "let down first", let_down_first, (8.0, 14.0)),
    Cheat("free_scar", "let go first", let_go_first, (8.0, 14.0)),
    Cheat("free_scar", "pull in pieces", pull_in_pieces, (5.0, 10.0)),
    *(
        Cheat(exercise, name, make, speeds)
        for exercise in ("hold_stretch", "approach_break", "gentle_lifts")
        for name, make, speeds in (
            ("jump", jump_to(1.0), (60.0, 200.0)),
            ("jump on", jump_to(0.3), (5.0, 10.0)),
            ("shake", shake(0.25), (0.2, 0.4)),
            ("hold in turns", hold_in_turns, (40.0, 80.0)),
            ("by sliders", by_sliders, (0.5, 2.0)),
        )
    ),
    Cheat("hold_stretch", "hold elsewhere", held_elsewhere(2.0, 0.6), (1.0, 2.0)),
    Cheat("approach_break", "hold nearer to it", hold_nearer_to_break, (1.0, 2.0)),
    Cheat("gentle_lifts", "hold elsewhere", held_elsewhere(18.5, 1.2), (1.0, 2.0)),
    Cheat("gentle_lifts", "spring back", spring_back, (3.0, 5.0)),
    Cheat("critical_view", "tear it off", tear_off("gallbladder", 20.0), (5.0, 40.0)),
    Cheat("critical_view", "tear it aside", tear_off("gallbladder", 8.0, 0.8), (5.0, 40.0)),
    Cheat("critical_view", "tear off the duct", tear_off("cystic", 10.0), (5.0, 40.0)),
    Cheat("critical_view", "sweep the jaws", sweep_triangle("dissector"), (10.0, 40.0)),
    Cheat("critical_view", "wipe", sweep_triangle("swab"), (10.0, 40.0)),
    Cheat("critical_view", "divide at once", divide_at_once("cystic"), (10.0,)),
    Cheat("stop_bleeding", "look on", look_on_and_clip, (12.0,), 1),
    Cheat("who_is_who", "say unsafe", say_unsafe, (1.0,), SAFE[0]),
    Cheat("who_is_who", "all the same", name_all("cystic", "cystic", "cystic"), (1.0,), SAFE[0]),
    Cheat("who_is_who", "try each", try_each, (1.0,), SAFE[0]),
    Cheat("who_is_who", "name two", name_then_unsafe, (1.0,), SAFE[0]),
    Cheat("who_is_who", "name at once", name_all("cystic", "artery", "common"), (1.0,), COVERED[0]),
    Cheat("who_is_who", "name two unseen", name_then_unsafe, (1.0,), COVERED[0]),
)
