"""Scripted faults at a duct in its bed, and good hands that tremble: what the errors are held to.

A fault is a way to do an exercise wrongly, at one of three speeds, with the classes of which at
least one must be found.
"""

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import islice, product
from typing import Any

import msgspec
import numpy as np
from rich.console import Console

from app.anatomy import Anatomy, drawn_anatomy
from app.command_line.load import shipped_organ
from app.simulation import (
    ERROR_CLASSES,
    FEW,
    GRIP_N,
    JAW_RADIUS,
    MANNERS,
    TICK_SECONDS,
    Exercise,
    FreeLength,
    Incident,
    Instrument,
    Outcome,
    Session,
    SpatialTissue,
    Specimen,
    bed_named,
    exercises_offered,
    free_specimen,
    preset_named,
    specimen_in_bed,
)
from app.simulation.inputs.inputs import InputKind
from app.simulation.scripts.exercise_limits import AT_ANATOMY, IN_BED
from app.simulation.scripts.scripted_hands import Clip, Follow, Spread
from app.simulation.tissue.spatial_tissue import CLIP_OPENING

BEDS, SEEDS, TREMOR = ("normal", "firm"), (71, 72), 0.15
GOOD_BEDS, GOOD_SEEDS = ("loose", "normal", "firm", "inflamed"), range(71, 91)
GOOD_TREMORS = (0.15, 0.3)
"""Where `measure_faults` looks, and the hands' tremor, mm."""
SAFE, COVERED = (20, 23, 26), (12, 15, 18)
"""Seeds of pictures in which all is seen, and in which too little is."""

Floats = np.ndarray
Make = Callable[["Hands", Exercise, float], Iterator[None]]
MOST_TICKS = 60 * 30
"""Ticks of a fault at most."""


class Hands(Session):
    """A session whose hands tremble about where they are led: an AR(1) noise of about 8 Hz."""

    tremor = 0.0  # mm

    def tremble(self, tremor: float, seed: int) -> None:
        """Let the hands tremble from now on, by so many mm."""
        self.tremor = tremor
        self._noise, self._rng = np.zeros((2, 3)), np.random.default_rng(seed)
        self._led: list[Floats | None] = [None, None]

    @property
    def duct(self) -> SpatialTissue:
        """The tissue in hand."""
        return self.spatial

    def advance(self, ticks: int = 1) -> bool:
        """Let ticks pass; hands tremble in each, whether they are led on or wait."""
        changed = False
        for _ in range(ticks):
            if self.tremor > 0.0:
                fresh = self._rng.normal(0.0, math.sqrt(1.0 - 0.2**2) * self.tremor, (2, 3))
                self._noise = 0.2 * self._noise + fresh
                for hand, place in enumerate(self._led):
                    if place is not None:
                        super()._act(hand, "move", *(place + self._noise[hand]))
            changed |= super().advance()
        return changed

    def _act(self, hand: int, kind: InputKind, *values: float) -> Sequence[float] | None:
        if self.tremor > 0.0 and kind in ("move", "grab", "release", "instrument"):
            self._led[hand] = np.array(values) if kind == "move" else None
        return super()._act(hand, kind, *values)


def steps(distance: float, speed: float) -> Iterator[float]:
    """How far a hand has come at each tick, mm."""
    ticks = max(1, math.ceil(abs(distance) / (speed * TICK_SECONDS)))
    return (distance * tick / ticks for tick in range(1, ticks + 1))


def wait(seconds: float) -> Iterator[None]:
    """Ticks of nothing."""
    for _ in range(round(seconds / TICK_SECONDS)):
        yield


def go(hands: Hands, hand: int, to: Floats, speed: float) -> Iterator[None]:
    """Lead a hand straight to a place."""
    start = hands.duct.hands[hand].target.copy()
    far = float(np.linalg.norm(to - start))
    for distance in steps(far, speed):
        hands.move_hand(hand, start + (to - start) * (distance / far if far else 1.0))
        yield


def behind(hands: Hands, station: float, speed: float = 20.0) -> Iterator[None]:
    """Pass a closed dissector behind the duct with the second hand."""
    hands.choose_instrument(1, "dissector")
    start = hands.duct.hands[1].place.copy()
    start[0] = station
    yield from go(hands, 1, start, 60.0)
    yield from wait(0.3)
    yield from go(hands, 1, start * [1.0, -1.0, 1.0], speed)
    yield from wait(0.3)


def opened(hands: Hands, most: float, speed: float) -> Iterator[None]:
    """Open the jaws at a speed, mm/s of their opening."""
    for distance in steps(most, speed):
        hands.open_jaws(1, distance)
        yield


def lift(hands: Hands, distance: Floats, speed: float, hand: int = 0) -> Iterator[None]:
    """Lead a hand by some mm."""
    yield from go(hands, hand, hands.duct.hands[hand].target + distance, speed)


def lift_both(hands: Hands, far: float, speed: float) -> Iterator[None]:
    """Lead both hands up by some mm."""
    start = [each.target.copy() for each in hands.duct.hands]
    for distance in steps(far, speed):
        for hand in range(2):
            hands.move_hand(hand, start[hand] + np.array([0.0, 0.0, distance]))
        yield


def goal(exercise: Exercise) -> FreeLength:
    """Return the stretch that an exercise asks to free."""
    assert isinstance(exercise.goal, FreeLength)
    return exercise.goal


def middle(exercise: Exercise) -> float:
    """Return the station in the middle of that stretch, mm."""
    return 0.5 * (goal(exercise).from_mm + goal(exercise).to_mm)


def front(hands: Hands, exercise: Exercise) -> float:
    """Return the station up to which that stretch still holds, mm."""
    return goal(exercise).to_mm - goal(exercise).freed(hands.duct.freed_stretches())


# Window


def plough(fly: float = 0.0) -> Make:
    """Plough lengthwise with jaws that stay open by `fly` mm."""

    def make(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
        yield from behind(hands, middle(exercise) - 10.0)
        yield from opened(hands, fly, 10.0)
        yield from lift(hands, np.array([22.0, 0.0, 0.0]), speed, 1)

    return make


def stir(times: int, *moves: tuple[float, float, float], beside: float = 0.0) -> Make:
    """Sweep the closed jaws by some moves, mm, again and again, from beside the middle on."""

    def make(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
        yield from behind(hands, middle(exercise) + beside)
        for _ in range(times):
            for move in moves:
                yield from lift(hands, np.array(move), speed, 1)

    return make


def to_and_fro(height: float) -> Make:
    """Sweep the closed jaws along the duct and back, so far up and down."""
    return stir(12, (6.0, 0.0, height), (-12.0, 0.0, -height), (6.0, 0.0, 0.0))


STIR_DEEP = stir(7, (2.0, -14.0, 0.0), (0.0, 14.0, 0.0), beside=-7.0)
"""In and out while they go along."""
STIR_IN_PLACE = stir(10, (3.0, -8.0, 0.0), (-3.0, 8.0, 0.0), (-3.0, -8.0, 0.0), (3.0, 8.0, 0.0))
"""In and out and to both sides about one place."""


def jump(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Throw the jaws open."""
    yield from behind(hands, middle(exercise))
    yield from opened(hands, 40.0, speed)
    yield from wait(1.0)


def jump_in_steps(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Open the jaws in jumps with rests between."""
    yield from behind(hands, middle(exercise))
    for _ in range(4):
        start = hands.duct.hands[1].opening
        for distance in steps(8.0, speed):
            hands.open_jaws(1, start + distance)
            yield
        yield from wait(0.5)


def drag(
    hands: Hands, far: float, speed: float, opening: Callable[[float], float]
) -> Iterator[None]:
    """Drag the jaws along by so many mm, open by a function of the distance gone."""
    start = hands.duct.hands[1].target.copy()
    for distance in steps(far, speed):
        hands.move_hand(1, start + np.array([distance, 0.0, 0.0]))
        hands.open_jaws(1, opening(distance))
        yield


def open_and_drag(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Open the jaws slowly while they are dragged along faster."""
    yield from behind(hands, middle(exercise) - 10.0)
    yield from drag(hands, 24.0, speed, lambda distance: 0.2 * distance)


def stab(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Stab in behind the duct, then open as one should."""
    yield from behind(hands, middle(exercise), speed)
    yield from opened(hands, 40.0, 10.0)


def stab_and_jump(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Stab in behind the duct, and open as fast."""
    yield from behind(hands, middle(exercise), speed)
    yield from opened(hands, 40.0, speed)
    yield from wait(1.0)


def stab_aslant(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Stab in aslant and plough with it."""
    hands.choose_instrument(1, "dissector")
    start = hands.duct.hands[1].place.copy()
    start[0] = middle(exercise) - 8.0
    yield from go(hands, 1, start, 60.0)
    yield from wait(0.3)
    yield from go(hands, 1, start * [1.0, -1.0, 1.0] + [16.0, 0.0, 0.0], speed)
    yield from wait(0.5)


def patient_plough(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Plough a little at a time, and wait until it is forgotten."""
    yield from behind(hands, middle(exercise) - 9.0)
    for _ in range(10):
        yield from lift(hands, np.array([2.5, 0.0, 0.0]), speed, 1)
        yield from wait(5.2)


def press(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Come up against the duct from behind."""
    yield from behind(hands, middle(exercise))
    yield from lift(hands, np.array([0.0, -8.0, 4.0]), speed, 1)
    yield from wait(1.0)


def press_swab(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Press a swab on the duct."""
    hands.choose_instrument(1, "swab")
    z = hands.duct.hands[1].place[2]
    yield from go(hands, 1, np.array([middle(exercise), 0.0, z]), 60.0)
    yield from wait(0.3)
    yield from lift(hands, np.array([0.0, 0.0, -z + hands.duct.radius]), speed, 1)
    yield from wait(1.0)


def pull_off(lean: float = 0.0) -> Make:
    """Pull the duct off instead of passing behind it."""

    def make(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
        hands.grab(0, middle(exercise))
        yield from lift(hands, 25.0 * np.array([0.0, math.sin(lean), math.cos(lean)]), speed)

    return make


def hold_up(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Hold the duct up before the jaws open, which they do not need."""
    hands.grab(0, middle(exercise))
    yield from lift(hands, np.array([0.0, 0.0, 5.0]), speed)
    yield from behind(hands, middle(exercise))


# Follow the front


def hold_again(
    pull: tuple[float, float, float] = (0.0, 0.0, 9.0), times: int = 12, off: float = 0.0
) -> Make:
    """Pull by some mm and take hold again, off the front by some mm, above zero behind it."""

    def make(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
        for _ in range(times):
            at = front(hands, exercise)
            hands.grab(0, at + off)
            for _ in lift(hands, np.array(pull), speed):
                yield
                if at - front(hands, exercise) >= 2.0:
                    break
            hands.release(0)
            yield from wait(0.3)

    return make


def long_pull(lean: float = 0.0, back: float = 0.0) -> Make:
    """Pull on in one go from the front, leaning sideways or back over what is free."""

    def make(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
        hands.grab(0, front(hands, exercise))
        distance = np.array([back, math.sin(lean), math.cos(lean)])
        yield from lift(hands, 30.0 * distance, speed)

    return make


def lean(angle: float) -> Make:
    """Pull off straight up by an angle, holding again as one should."""

    def make(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
        yield from Follow(speed=speed, lean=math.radians(angle)).inputs(hands, exercise)

    return make


def jerk(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Jerk at the front and go down again."""
    for _ in range(8):
        hands.grab(0, front(hands, exercise))
        yield from lift(hands, np.array([0.0, 0.0, 9.0]), speed)
        yield from lift(hands, np.array([0.0, 0.0, -9.0]), speed)
        hands.release(0)
        yield from wait(0.2)


def nibble(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Take hold again and again while pulling a little."""
    for _ in range(60):
        hands.grab(0, front(hands, exercise))
        yield from lift(hands, np.array([0.0, 0.0, 1.5]), speed)
        hands.release(0)


def two_hooks(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Hold at the front with one hand and ahead of it with the other."""
    at = front(hands, exercise)
    hands.grab(0, at)
    hands.grab(1, at - 10.0)
    yield from lift_both(hands, 20.0, speed)


# Free a scar


def open_beside(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Open the jaws behind the duct as it is held, or not, and beside the stretch, not in it."""
    yield from behind(hands, goal(exercise).from_mm - 2.0 * JAW_RADIUS - 1.5)
    yield from opened(hands, 40.0, speed)
    yield from wait(1.0)


def too_high(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Hold the duct up higher than the jaws need."""
    hands.grab(0, middle(exercise))
    yield from lift(hands, np.array([0.0, 0.0, 8.0]), speed)
    yield from wait(0.5)


def held_and(act: Make) -> Make:
    """Hold the duct up as one should, and then do something."""

    def make(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
        hands.grab(0, middle(exercise))
        yield from lift(hands, np.array([0.0, 0.0, 3.0]), 5.0)
        yield from act(hands, exercise, speed)

    return make


def drop(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Let the duct down while the jaws open."""
    yield from behind(hands, goal(exercise).from_mm - 2.0 * JAW_RADIUS - 1.5)
    start = hands.duct.hands[0].target.copy()
    for distance in steps(40.0, 10.0):
        hands.open_jaws(1, distance)
        hands.move_hand(0, start - np.array([0.0, 0.0, min(distance * speed / 10.0, 4.5)]))
        yield


def near_break(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Do as good hands do at the front, and go on as fast near the break."""
    yield from Follow(speed=speed, slows=False).inputs(hands, exercise)


# Stop a bleeding


def stab_and_clip(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Clip as one should, but get there too fast."""
    yield from Clip(speed=speed).inputs(hands, exercise)


def spray_clips(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Clip the torn tube all along, beyond its tear, without a look where the blood comes from."""
    for before in (-6.0, -9.0, -12.0):
        clips = sum(each.kind == "clip" for each in hands.duct.events)
        technique = Clip(speed=speed, before=(before,), seconds=0.5)
        for _ in islice(technique.inputs(hands, exercise), 150):
            yield
            if sum(each.kind == "clip" for each in hands.duct.events) > clips:
                break


# An anatomy


def tear_off(tube: str, station: float, lean: float = 0.0, tool: Instrument = "grasper") -> Make:
    """Pull at one tube until all about it has parted."""

    def make(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
        hands.choose_instrument(0, tool)
        assert hands.grab(0, station, hands.duct.tubes.names.index(tube)) is not None
        yield from lift(hands, 60.0 * np.array([0.0, math.sin(lean), math.cos(lean)]), speed)

    return make


def sweep_triangle(tool: Instrument) -> Make:
    """Sweep an instrument to and fro through all that lies between the tubes."""

    def make(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
        hands.choose_instrument(1, tool)
        beam = hands.duct.beam
        centre = np.mean([beam.places[beam.nodes_of(each)].mean(axis=0)
                          for each in exercise.about or ()], axis=0)  # fmt: skip
        for row in range(-6, 7, 2):
            for side in (-12.0, 12.0):
                yield from go(hands, 1, centre + np.array([float(side), float(row), 0.0]), speed)

    return make


def close_on(
    hands: Hands, tool: Instrument, tube: str, station: float, speed: float
) -> Iterator[None]:
    """Bring open jaws past a tube from above."""
    hands.choose_instrument(1, tool)
    shaft = np.array([0.0, 0.0, 1.0])
    line = hands.duct.beam.places_at(np.array([station - 0.5, station, station + 0.5]), tube)
    hands.aim(1, shaft.tolist())
    hands.spread(1, np.cross(shaft, line[2] - line[0]).tolist())
    hands.open_jaws(1, CLIP_OPENING)
    yield from go(hands, 1, line[1] + 14.0 * shaft, 60.0)
    past = float(hands.duct.tubes.network.tubes[tube].radius.max()) + 1.5
    yield from go(hands, 1, line[1] - past * shaft, speed)
    yield from wait(0.3)


def divide_at_once(tube: str) -> Make:
    """Divide a tube that runs into the gallbladder, before anything is freed."""

    def make(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
        yield from close_on(hands, "scissors", tube, 10.0, speed)
        for _ in range(round(1.0 / TICK_SECONDS)):  # until a tremor leaves the tube between them
            hands.cut(1)
            yield

    return make


def unseen_work(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Pull while the scope looks elsewhere."""
    place = hands.grab(0, 20.0, hands.duct.tubes.names.index("gallbladder"))
    assert place is not None
    x, y, z = place
    hands.look_from([0.0, -0.7, 0.7, x, y, z + 80.0, 0.0, 0.0, 150.0, 0.0, 0.0, 0.0])
    yield from lift(hands, np.array([0.0, 0.0, 12.0]), speed)


def clip_other(tube: str, station: float) -> Make:
    """Clip a tube that is not asked for."""

    def make(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
        yield from close_on(hands, "clip applier", tube, station, speed)
        hands.clip(1)
        yield from wait(0.5)

    return make


def go_on(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Part strands at the gallbladder while the artery bleeds."""
    hands.open_jaws(1, 1.0)
    yield from wait(5.5)
    hands.choose_instrument(1, "dissector")
    place = hands.duct.beam.places_at(np.array([35.0]), "gallbladder")[0]
    yield from go(hands, 1, place + np.array([-10.0, 0.0, -6.0]), 60.0)
    yield from go(hands, 1, place + np.array([10.0, 0.0, -6.0]), speed)


# A picture


def say_unsafe(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Say that too little is seen, although all is."""
    hands.call_unsafe()
    yield


def name_all(*tubes: str) -> Make:
    """Name the structures without a look at what is seen of them."""

    def make(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
        for structure, tube in zip(exercise.structures, tubes, strict=True):
            hands.mark(structure, hands.duct.tubes.names.index(tube), 5.0)
            yield

    return make


@dataclass(frozen=True)
class Fault:
    """A way to do an exercise wrongly."""

    exercise: str
    name: str
    make: Make
    speeds: tuple[float, float, float]
    named: frozenset[str]  # of which at least one is found
    bed: str | None = None  # the only one in which it is one
    anatomies: tuple[int, ...] = ()  # seeds of those where it is done
    walls: str | None = None  # preset whose walls their tubes have; their own when None

    def runs(self, beds: Sequence[str], seeds: Sequence[int]) -> list[tuple[str, int, float]]:
        """Return where it is done and how fast: in beds of seeds, or at its anatomies."""
        if self.anatomies:
            return [("", *each) for each in zip(self.anatomies, self.speeds, strict=True)]
        return list(product((self.bed,) if self.bed else beds, seeds, self.speeds))


def fault(
    exercise: str, name: str, make: Make, speeds: tuple[float, ...], *named: str,
    bed: str | None = None, at: tuple[int, ...] = (), walls: str | None = None,
) -> Fault:  # fmt: skip
    """Return a fault at a slow, a middling and a fast speed."""
    low, mid, high = speeds
    return Fault(exercise, name, make, (low, mid, high), frozenset(named), bed, at, walls)


PULLED = ("one_go", "over_lifted", "unseen")
PLOUGHED = ("ploughing", "fast_in_tissue")
FAULTS = (
    fault("window", "plough", plough(), (5.0, 10.0, 20.0), *PLOUGHED),
    fault("window", "plough with open jaws", plough(6.0), (4.0, 8.0, 15.0), *PLOUGHED),
    fault("window", "open and drag", open_and_drag, (6.0, 10.0, 20.0), *PLOUGHED),
    fault("window", "stir", to_and_fro(0.0), (8.0, 15.0, 30.0), "stirring", *PLOUGHED),
    fault("window", "stir up and down", to_and_fro(1.0), (8.0, 15.0, 30.0), "stirring", *PLOUGHED),
    fault("window", "stir deep", STIR_DEEP, (10.0, 20.0, 30.0), "stirring", *PLOUGHED),
    fault("window", "jump", jump, (30.0, 60.0, 1200.0), "jumping_jaws"),
    fault("window", "jump in steps", jump_in_steps, (30.0, 60.0, 240.0), "jumping_jaws"),
    fault("window", "stab", stab, (45.0, 60.0, 95.0), "blind_stab"),
    fault("window", "stab and jump", stab_and_jump, (45.0, 60.0, 95.0), "blind_stab"),
    fault("window", "stab aslant", stab_aslant, (45.0, 60.0, 95.0), "blind_stab"),
    fault("window", "press", press, (4.0, 8.0, 16.0), "instrument_on_wall"),
    fault("window", "press with a swab", press_swab, (4.0, 8.0, 16.0), "instrument_on_wall"),
    fault("window", "plough fast", plough(), (30.0, 45.0, 60.0), "fast_in_tissue"),
    fault("window", "pull off", pull_off(), (5.0, 20.0, 40.0), "over_lifted", "fast_pull"),
    fault("window", "pull off aslant", pull_off(0.7), (5.0, 10.0, 20.0), "leaning", "over_lifted"),
    fault("window", "hold up", hold_up, (4.0, 8.0, 12.0), "over_lifted"),
    fault("follow_front", "10 mm ahead", hold_again(off=-10.0), (5.0, 8.0, 20.0), "ahead_of_front"),
    fault("follow_front", "5 mm ahead", hold_again(off=-5.0), (5.0, 8.0, 20.0), "ahead_of_front"),
    fault("follow_front", "20 mm ahead", hold_again(off=-20.0), (5.0, 8.0, 20.0), "ahead_of_front"),
    fault("follow_front", "5 mm behind", hold_again(off=5.0), (4.0, 6.0, 8.0), "behind_front"),
    fault("follow_front", "long pull", long_pull(), (4.0, 6.0, 8.0), "one_go"),
    fault("follow_front", "long pull back", long_pull(back=0.5), (4.0, 6.0, 8.0), *PULLED),
    fault("follow_front", "long pull aside", long_pull(0.8), (4.0, 6.0, 8.0), "leaning"),
    fault("follow_front", "lean 45", lean(45.0), (4.0, 6.0, 8.0), "leaning"),
    fault("follow_front", "lean 60", lean(60.0), (4.0, 6.0, 8.0), "leaning"),
    fault("follow_front", "lean back 45", lean(-45.0), (4.0, 6.0, 8.0), "leaning"),
    fault("follow_front", "hasty", lean(0.0), (30.0, 40.0, 60.0), "fast_pull"),
    fault("follow_front", "jerk", jerk, (30.0, 40.0, 60.0), "fast_pull"),
    fault("follow_front", "nibble", nibble, (10.0, 15.0, 20.0), "repeated_holds"),
    fault("follow_front", "two hooks", two_hooks, (4.0, 6.0, 10.0), "ahead_of_front"),
    fault("free_scar", "one-handed", open_beside, (8.0, 14.0, 18.0), "no_traction"),
    fault("free_scar", "one-handed jump", open_beside, (40.0, 60.0, 240.0), "no_traction"),
    fault("free_scar", "too high", too_high, (4.0, 6.0, 8.0), "over_lifted", "unseen"),
    fault("free_scar", "jump", held_and(open_beside), (30.0, 60.0, 1200.0), "jumping_jaws"),
    fault("free_scar", "drop", held_and(drop), (4.0, 8.0, 16.0), "traction_lost"),
    fault("free_scar", "hasty lift", too_high, (30.0, 45.0, 60.0), "fast_pull"),
    fault("free_scar", "stab", held_and(stab), (45.0, 60.0, 95.0), "blind_stab"),
    fault("follow_front", "near", near_break, (9.0, 10.0, 11.0), "near_break_fast", bed="loose"),
    fault("window", "plough patiently", patient_plough, (4.0, 5.0, 8.0), "ploughing"),
    *(
        fault("stop_bleeding", name, make, speeds, *named, at=(21, 27, 30))
        for name, make, speeds, named in (
            ("stab", stab_and_clip, (60.0, 100.0, 200.0), ("blind_stab",)),
            ("spray", spray_clips, (10.0, 12.0, 14.0), ("clip_astray", "tension_on_vessel")),
            ("go on", go_on, (3.0, 5.0, 8.0), ("unattended_bleeding",)),
            ("clip the duct", clip_other("cystic", 12.0), (8.0, 12.0, 15.0), ("clip_wrong_tube",)),
        )
    ),
    *(
        fault("critical_view", name, make, speeds, named, at=(25, 28, 30))
        for name, make, speeds, named in (
            ("pull the common duct", tear_off("common", 15.0), (3.0, 5.0, 8.0), "wrong_structure"),
            ("pull the artery", tear_off("artery", 8.0), (1.0, 2.0, 4.0), "tension_on_vessel"),
            ("tear the artery", tear_off("artery", 12.0), (3.0, 5.0, 8.0), "bleeding"),
            ("tear the duct", tear_off("cystic", 10.0), (3.0, 5.0, 8.0), "tear"),
            ("divide at once", divide_at_once("cystic"), (8.0, 12.0, 15.0), "divided_before_view"),
            ("divide unclipped", divide_at_once("artery"), (8.0, 12.0, 15.0), "clip_short"),
            ("look away", unseen_work, (3.0, 4.0, 5.0), "out_of_view"),
        )
    ),
    fault(
        "who_is_who",
        "take for another",
        name_all("cystic", "cystic", "common"),
        (1.0, 1.0, 1.0),
        "mistaken",
        at=SAFE,
    ),
    fault("who_is_who", "say unsafe", say_unsafe, (1.0, 1.0, 1.0), "held_back", at=SAFE),
    fault(
        "who_is_who",
        "name unseen",
        name_all("cystic", "artery", "common"),
        (1.0, 1.0, 1.0),
        "named_unsafe",
        at=COVERED,
    ),
    fault("window", "stir in place", STIR_IN_PLACE, (5.0, 6.0, 7.0), "stirring"),
    fault(
        "follow_front",
        "pull far back",
        long_pull(back=1.2),
        (6.0, 8.0, 10.0),
        "unseen",
        bed="normal",
    ),
    # Of an anatomy's own walls the artery tears long before a hold slips, and all are torn through
    # at once. The ureter's are strong, and the one shipped wall that tears in time.
    fault(
        "critical_view",
        "pull out of the grasper",
        tear_off("gallbladder", 5.0),
        (2.0, 4.0, 8.0),
        "hold_slipped",
        at=(29, 30, 32),
        walls="human-ureter",
    ),
    fault(
        "critical_view",
        "nick the duct",
        tear_off("cystic", 10.0, tool="hook"),
        (2.0, 4.0, 8.0),
        "nick",
        at=(26, 31, 44),
        walls="human-ureter",
    ),
)


def with_walls(anatomy: Anatomy, preset: str) -> Anatomy:
    """Return an anatomy whose tubes have a preset's modulus, strength and speed of a tear."""
    wall = preset_named(preset)
    assert wall.break_stress_MPa is not None
    tubes = [
        msgspec.structs.replace(
            each,
            modulus_MPa=wall.modulus_MPa,
            strength_MPa=wall.break_stress_MPa,
            stretch_at_break=None,
            tear_mm_per_s=wall.tear_mm_per_s,
        )
        for each in anatomy.tube
    ]
    return msgspec.structs.replace(anatomy, name=f"{anatomy.name}-{preset}", tube=tubes)


@cache
def hands_in(where: str | int | None, walls: str | None = None) -> Hands:
    """Return hands at the duct in a bed by name, at an anatomy by its seed, or at a free duct."""
    organ = shipped_organ()
    if where is None:
        specimen = free_specimen(organ)
    elif isinstance(where, int):
        anatomy = drawn_anatomy(where)
        specimen = Specimen.of_anatomy(with_walls(anatomy, walls) if walls else anatomy)
    else:
        specimen = specimen_in_bed(organ, bed=bed_named(where))
    return Hands(specimen, vertices=FEW, grip_N=GRIP_N)


@cache
def exercises(where: str | int | None, walls: str | None = None) -> dict[str, Exercise]:
    """Return the exercises there, by name."""
    return {each.name: each for each in exercises_offered(hands_in(where, walls))}


def begun(name: str, bed: str, seed: int, walls: str | None = None) -> Hands:
    """Return hands that have begun an exercise, in a bed where it is done in one."""
    where = bed if name in IN_BED else seed if name in AT_ANATOMY else None
    exercise = exercises(where, walls)[name]
    opening = exercise.opening
    if opening is not None and opening.bed is not None:
        assert isinstance(opening.bed, str)
        where = opening.bed
        opening = msgspec.structs.replace(opening, bed_seed=seed)
        exercise = msgspec.structs.replace(exercise, opening=opening)
    hands = hands_in(where, walls)
    hands.start_exercise(exercise.by_hands_alone())
    return hands


def done(
    name: str, bed: str, seed: int, make: Make, speed: float = 1.0, tremor: float = 0.0,
    walls: str | None = None,
) -> tuple[Outcome, list[Incident]]:  # fmt: skip
    """Do an exercise in a bed of a seed, or at the anatomy of a seed."""
    hands = begun(name, bed, seed, walls)
    hands.tremble(tremor, seed)
    assert hands.run.exercise is not None
    for _ in islice(make(hands, hands.run.exercise, speed), MOST_TICKS):
        hands.advance()
        if hands.run.over:
            break
    standing = hands.run.standing
    end = hands.run.outcome or Outcome(False, f"The hands were done with {standing}.")
    return end, hands.run.incidents()


def good(hands: Hands, exercise: Exercise, speed: float) -> Iterator[None]:
    """Do an exercise well, at a speed relative to the good hand's; jaws once more on both sides."""
    technique = MANNERS[exercise.name]["good"]
    assert isinstance(technique, Spread | Follow | Clip)
    technique = replace(technique, speed=speed * technique.speed)
    yield from technique.inputs(hands, exercise)
    if not isinstance(technique, Spread):
        return
    for beside in (-10.0, 10.0):
        for distance in steps(40.0, 20.0):
            hands.open_jaws(1, 40.0 - distance)
            yield
        start = hands.duct.hands[1].target.copy()
        yield from go(hands, 1, start * [1.0, -1.0, 1.0], 20.0)
        out, aside = start * [1.0, -1.0, 1.0], np.array([beside, 0.0, 0.0])
        yield from go(hands, 1, out + aside, 20.0)
        yield from go(hands, 1, start + aside, 20.0)
        yield from wait(0.3)
        yield from opened(hands, 40.0, 2.0 * technique.speed)


def measure_faults(console: Console) -> dict[str, Any]:
    """Print and return how well each class is found, and what good hands are accused of."""
    # Of a fault that is meant to show one class: where it may show several, the first that fails
    # the exercise ends it.
    meant, found = Counter[str](), Counter[str]()
    runs = right = passed = 0
    with console.status("Faults ..."):
        for each in FAULTS:
            for bed, seed, speed in each.runs(BEDS, SEEDS):
                end, incidents = done(
                    each.exercise, bed, seed, each.make, speed, TREMOR, walls=each.walls
                )
                errors = {one.error for one in incidents}
                runs, right = runs + 1, right + bool(each.named & errors)
                passed += end.passed
                if len(each.named) == 1:
                    meant.update(each.named)
                    found.update(each.named & errors)
                if not each.named & errors or end.passed:
                    console.print(
                        f"  {each.exercise}, {each.name}, {speed:g}, {bed} {seed}: "
                        f"{'passed' if end.passed else 'not named'}, {sorted(errors)}",
                        highlight=False,
                    )
    console.print(f"Faults: {runs} runs, {right} named, {passed} passed", highlight=False)
    good_runs, accused = Counter[float](), Counter[tuple[str, float]]()
    good_passed = Counter[float]()
    with console.status("Good hands ..."):
        for tremor, bed, seed in product(GOOD_TREMORS, GOOD_BEDS, GOOD_SEEDS):
            for name in exercises(bed):
                end, incidents = done(name, bed, seed, good, tremor=tremor)
                good_runs[tremor] += 1
                good_passed[tremor] += end.passed
                accused.update((error, tremor) for error in {one.error for one in incidents})
    for tremor in GOOD_TREMORS:
        console.print(
            f"Good hands, tremor {tremor} mm: {good_runs[tremor]} runs, {good_passed[tremor]} pass",
            highlight=False,
        )
    figures: dict[str, Any] = {}
    there = {*meant, *(error for error, _ in accused)}
    for error in (each for each in ERROR_CLASSES if each in there):
        without = {str(t): good_runs[t] - accused[error, t] for t in GOOD_TREMORS}
        figures[error] = {"meant": meant[error], "found": found[error], "without": without}
        clean = ", ".join(f"{without[str(t)]} of {good_runs[t]} at {t} mm" for t in GOOD_TREMORS)
        console.print(
            f"  {error}: found in {found[error]} of {meant[error]}; good hands without it {clean}",
            highlight=False,
        )
    return {"runs": runs, "named": right, "passed": passed, "classes": figures}
