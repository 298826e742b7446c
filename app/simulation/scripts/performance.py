"""Scripted hands at an anatomy: a file of steps, done in a session (docs/anatomy-file.md)."""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Literal, TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from app.bounded_file import decoded, read_bounded
from app.simulation.exercises.critical_view import CriticalView, Tenting
from app.simulation.inputs.clock import TICK_SECONDS
from app.simulation.inputs.inputs import Instrument, Structure
from app.simulation.session.session import Session
from app.simulation.tissue.safety import Safety
from app.simulation.tissue.spatial_tissue import Event

Floats = NDArray[np.float64]
Number: TypeAlias = int | float
Point: TypeAlias = tuple[Number, Number, Number]
Do: TypeAlias = Literal[
    "take",
    "grab",
    "lead",
    "release",
    "open",
    "aim",
    "spread",
    "clip",
    "divide",
    "suck",
    "wait",
    "mark",
]

MOST_BYTES = 1_000_000
MOST_SECONDS = 1800.0
MOST_STEPS, MOST_MM, LEAST_DIRECTION = 20_000, 1000.0, 1e-3
_STEP = re.compile(r"step\[(\d+)\]")
SETTLE_SECONDS = 1.0
"""Longest time for which a hand is waited for after it was led somewhere."""
JAWS_SPEED, SPEED = 10.0, 20.0
"""mm/s, of jaws and of hands, where a step gives none."""
LOOK_TICKS = 5
"""Ticks after which the common duct is looked at again, whether it is tented."""
NEEDED: dict[Do, tuple[str, ...]] = {
    "take": ("instrument",), "grab": ("tube", "at_mm"), "open": ("opening_mm",),
    "aim": ("direction",), "spread": ("direction",), "suck": ("rate_ml_per_s",),
    "wait": ("seconds",), "mark": ("structure", "tube", "at_mm"),
}  # fmt: skip


class Step(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """`[[step]]`: what a hand does, or steps that are done at each of several stations or places.

    With a `tube`, directions and offsets are along the tube as it lies now, to its side (up times
    along) and up, away from the bed; without one in the anatomy's frame.
    """

    do: Do | None = None
    hand: Literal[1, 2] = 1
    instrument: Instrument | None = None
    structure: Structure | None = None  # that the tube is taken for
    tube: str | None = None
    at_mm: Number | None = None
    to_mm: Point | None = None
    by_mm: Point | None = None
    off_mm: Point = (0, 0, 0)  # from that place, or from the tube's
    off_radii: Point = (0, 0, 0)  # in the tube's outer radii there
    direction: Point | None = None
    opening_mm: Number | None = None
    rate_ml_per_s: Number | None = None
    seconds: Number | None = None
    speed_mm_per_s: Number | None = None
    stop_at: Number | None = None  # largest stress over strength from which on it goes no farther
    each_mm: list[Number] | None = None
    each_place_mm: list[Point] | None = None
    step: "list[Step]" = []


class Script(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A script: its steps in order."""

    step: list[Step]
    title: str = ""


@dataclass(slots=True)
class Performance:
    """What came of a script."""

    refused: list[str] = field(default_factory=list[str])  # steps that did nothing, and why
    seconds: float = 0.0
    view: CriticalView | None = None  # at the end
    view_at_first_clip: CriticalView | None = None
    freed_mm: dict[str, float] = field(default_factory=dict[str, float])
    tenting: Tenting | None = None  # where the common duct was drawn out farthest
    trap: bool = False  # whether it ever stood in one line with the cystic duct
    tear: Event | None = None  # the first
    tear_force: float = 0.0  # N, the largest of a hand, a tick before it


def read_script(path: Path) -> Script:
    """Return the script in a file."""
    content = read_bounded(path, MOST_BYTES, "script")
    try:
        return decoded(msgspec.toml.decode, content, Script, "")
    except ValueError as error:
        raise ValueError(f"{path}: {_with_step(str(error).removeprefix(': '))}") from None


def _with_step(message: str) -> str:
    """Return an error of msgspec's with the number of its step, as all others have it."""
    what, _, at = message.rpartition(" - at `$")
    numbers = ".".join(str(int(number) + 1) for number in _STEP.findall(at))
    field = at.rstrip("`").rpartition("]")[2].lstrip(".")
    return f"step {numbers}: {what}{field and f' in {field}'}" if numbers else message


def performed(script: Script, session: Session) -> Performance:
    """Do what a script says in a session at an anatomy.

    Parameters
    ----------
    script
        The steps.
    session
        At an anatomy; the run that it has afterwards is the script's.

    Returns
    -------
    Performance
        What was refused, and what is safe in the end.

    Raises
    ------
    ValueError
        If a step names a tube or an instrument that is not there, or needs more than it says.
    """
    hands = _Hands(session)
    steps = list(islice(_flat(script.step, ""), MOST_STEPS + 1))
    if not steps:
        raise ValueError("a script needs a [[step]]")
    if len(steps) > MOST_STEPS:
        raise ValueError(f"a script has at most {MOST_STEPS:,} steps, repeated ones counted")
    for name, step in steps:
        hands.check(name, step)
    for name, step in steps:
        if session.run.over:  # nothing is left to act on, and nothing is logged
            break
        hands.do(name, step)
    out = hands.out
    out.seconds = session.run.seconds
    out.view = hands.safety.critical_view()
    out.freed_mm = hands.safety.freed_all_round()
    return out


def _flat(steps: list[Step], before: str) -> Iterator[tuple[str, Step]]:
    """Yield all steps with their names, those of repeated ones at each station."""
    for number, step in enumerate(steps, 1):
        name = f"step {before}{number}"
        if (step.do is None) == (not step.step):
            raise ValueError(f"{name} needs either do, or steps of its own")
        if step.do is not None:
            yield name, step
            continue
        if (step.each_mm is None) == (step.each_place_mm is None):
            raise ValueError(f"{name} has steps of its own and needs each_mm or each_place_mm")
        for at in step.each_mm or ():
            inner = [
                msgspec.structs.replace(each, at_mm=at)
                if each.tube is not None and each.at_mm is None
                else each
                for each in step.step
            ]
            yield from _flat(inner, f"{before}{number}.")
        for place in step.each_place_mm or ():
            inner = [
                msgspec.structs.replace(each, to_mm=place)
                if each.do == "lead" and each.tube is each.to_mm is each.by_mm is None
                else each
                for each in step.step
            ]
            yield from _flat(inner, f"{before}{number}.")


class _Hands:
    """Hands that do one step after another."""

    def __init__(self, session: Session) -> None:
        self.session, self.tissue = session, session.spatial
        self.safety, self.out = Safety(session.spatial), Performance()
        self._ticks = 0

    def check(self, name: str, step: Step) -> None:
        """Raise a `ValueError` if a step cannot be done on any tissue like this."""
        assert step.do is not None  # noqa: S101 (of `_flat`)
        for key in NEEDED.get(step.do, ()):
            if getattr(step, key) is None:
                raise ValueError(f"{name}, {step.do}, needs {key}")
        if step.do == "lead":
            targets = sum(each is not None for each in (step.to_mm, step.by_mm, step.tube))
            if targets != 1:
                raise ValueError(f"{name}, lead, needs one of to_mm, by_mm and tube with at_mm")
        if step.tube is not None:
            names = self.tissue.tubes.names
            if step.tube not in names:
                raise ValueError(f"{name}: there is no tube {step.tube!r}: {', '.join(names)}")
            span = self.tissue.tubes.network.tubes[step.tube].span
            if step.at_mm is None or not 0.0 <= step.at_mm <= span:
                raise ValueError(
                    f"{name}: at_mm on {step.tube!r} must be from 0 to {span:.4g} mm, got "
                    f"{step.at_mm}"
                )
        numbers = {
            "speed_mm_per_s": step.speed_mm_per_s, "seconds": step.seconds, "stop_at": step.stop_at,
            "opening_mm": step.opening_mm, "rate_ml_per_s": step.rate_ml_per_s,
        }  # fmt: skip
        for key, value in numbers.items():
            low = 0.0 if key in ("opening_mm", "rate_ml_per_s") else 1e-3
            if value is not None and not low <= value <= MOST_SECONDS:
                raise ValueError(
                    f"{name}: {key} must be from {low:g} to {MOST_SECONDS:g}, got {value}"
                )
        for key in ("to_mm", "by_mm", "off_mm", "off_radii", "direction"):
            value = getattr(step, key)
            if value is not None and not all(abs(each) <= MOST_MM for each in value):
                raise ValueError(
                    f"{name}: {key} must be three finite numbers of at most {MOST_MM:g}, got "
                    f"{list(value)}"
                )
        if step.do in ("aim", "spread") and step.direction is not None:
            size = math.dist(step.direction, (0.0, 0.0, 0.0))
            if size < LEAST_DIRECTION:
                raise ValueError(f"{name}: direction must not be 0, 0, 0")

    def do(self, name: str, step: Step) -> None:
        """Do a step, as long as it takes."""
        session, hand = self.session, step.hand - 1
        holder = self.tissue.hands[hand]
        done = True
        if step.do == "take":
            assert step.instrument is not None  # noqa: S101 (checked)
            session.choose_instrument(hand, step.instrument)
            done = self.tissue.hands[hand].instrument == step.instrument
        elif step.do == "grab":
            tube = self.tissue.tubes.names.index(step.tube or "")
            done = session.grab(hand, float(step.at_mm or 0.0), tube) is not None
        elif step.do == "release":
            session.release(hand)
        elif step.do in ("aim", "spread"):
            given = self._in_frame(step, step.direction or (0, 0, 0))
            (session.aim if step.do == "aim" else session.spread)(hand, given.tolist())
        elif step.do == "suck":
            session.suck(hand, float(step.rate_ml_per_s or 0.0))
        elif step.do == "clip":
            before = self.safety.critical_view()
            done = session.clip(hand)
            if done and self.out.view_at_first_clip is None:
                self.out.view_at_first_clip = before
        elif step.do == "mark":
            assert step.structure is not None  # noqa: S101 (checked)
            tube = self.tissue.tubes.names.index(step.tube or "")
            done = session.mark(step.structure, tube, float(step.at_mm or 0.0))
        elif step.do == "divide":
            done = session.cut(hand)
        elif step.do == "wait":
            self._go(round(float(step.seconds or 0.0) / TICK_SECONDS), step)
        elif step.do == "open":
            wanted, first = float(step.opening_mm or 0.0), holder.opening
            for fraction in self._fractions(abs(wanted - first), step.speed_mm_per_s or JAWS_SPEED):
                session.open_jaws(hand, first + (wanted - first) * fraction)
                if self._tick(step):
                    session.open_jaws(hand, holder.opening)
                    break
        elif step.do == "lead":
            self._lead(step, hand)
        if not done:
            self.out.refused.append(f"{name}: hand {step.hand} could not {step.do}")
        if session.run.going:
            self._tick(step)

    def _lead(self, step: Step, hand: int) -> None:
        holder = self.tissue.hands[hand]
        first = holder.place.copy()
        if step.tube is not None:
            goal = self._place(step) + self._in_frame(step, step.off_mm)
            goal += self._radius(step) * self._in_frame(step, step.off_radii)
        elif step.to_mm is not None:
            goal = np.array(step.to_mm, dtype=np.float64) + np.array(step.off_mm)
        else:
            goal = first + np.array(step.by_mm, dtype=np.float64)
        far = math.sqrt(float(((goal - first) ** 2).sum()))
        for fraction in self._fractions(far, step.speed_mm_per_s or SPEED):
            self.session.move_hand(hand, first + (goal - first) * fraction)
            if self._tick(step):
                self.session.move_hand(hand, holder.place)
                return
        for _ in range(round(SETTLE_SECONDS / TICK_SECONDS)):
            if holder.arrived or self._tick(step):
                return

    @staticmethod
    def _fractions(far: float, speed: Number) -> Iterator[float]:
        """Yield which part of a way is done after each tick."""
        ticks = max(1, math.ceil(far / float(speed) / TICK_SECONDS))
        return (tick / ticks for tick in range(1, ticks + 1))

    def _go(self, ticks: int, step: Step) -> None:
        for _ in range(ticks):
            if self._tick(step):
                return

    def _tick(self, step: Step) -> bool:
        """Advance by a tick; return whether the step is to go no farther."""
        before = self.tissue.forces
        self.session.advance()
        self._ticks += 1
        if self.out.tear is None and self.tissue.events:
            self.out.tear = next((e for e in self.tissue.events if e.kind == "tear"), None)
            self.out.tear_force = math.sqrt(max(x * x + y * y + z * z for x, y, z in before))
        if self._ticks * TICK_SECONDS > MOST_SECONDS:
            raise ValueError(f"the script takes more than {MOST_SECONDS:g} s")
        if self._ticks % LOOK_TICKS == 0:
            tenting = self.safety.tenting()
            self.out.trap |= tenting.trap
            if self.out.tenting is None or tenting.diameters > self.out.tenting.diameters:
                self.out.tenting = tenting
        tense = step.stop_at is not None and self.tissue.stress_ratio > step.stop_at
        return tense or self.session.run.over

    def _place(self, step: Step) -> Floats:
        """Return where a step's station of a tube is now, (3,) mm."""
        at = np.array([float(step.at_mm or 0.0)])
        return self.tissue.beam.places_at(at, step.tube)[0]

    def _radius(self, step: Step) -> float:
        """Return a step's tube's outer radius at its station, mm."""
        tube = self.tissue.tubes.network.tubes[step.tube or ""]
        at = np.array([float(step.at_mm or 0.0)])
        return float(np.interp(at, tube.stations, tube.radius)[0])

    def _in_frame(self, step: Step, given: Point) -> Floats:
        """Return a direction or distance in the anatomy's frame."""
        vector = np.array(given, dtype=np.float64)
        if step.tube is None:
            return vector
        beam, name = self.tissue.beam, step.tube
        places, stations = beam.places[beam.nodes_of(name)], beam.stations_of(name)
        at = min(
            max(int(np.searchsorted(stations, float(step.at_mm or 0.0))), 1), len(stations) - 1
        )
        along = places[at] - places[at - 1]
        along = np.array([along[0], along[1], 0.0])
        size = math.sqrt(float((along**2).sum()))
        along = along / size if size > 0.0 else np.array([1.0, 0.0, 0.0])
        side = np.array([-along[1], along[0], 0.0])
        return vector[0] * along + vector[1] * side + np.array([0.0, 0.0, vector[2]])
