"""Inputs: all that drives a session, from a page, a device, a script or a file."""

from array import array
from collections.abc import Sequence
from typing import Literal, cast, get_args

import msgspec

from app.simulation.inputs.clock import TICK_SECONDS
from physics import Theory, theory_named
from physics.theory import LawName

MOST_TICKS = 2 * 60 * 60 * round(1.0 / TICK_SECONDS)
"""Two hours of ticks, far beyond any training on one duct."""
MOST_INPUTS = 200_000

Instrument = Literal[
    "hook", "grasper", "dissector", "swab", "right angle", "clip applier", "scissors", "suction"
]
"""A hook and a grasper hold the duct; a grasper stays where it is left. A dissector's two jaws and
a swab part strands without holding it, a right angle's thin jaws those behind a tube. Clips close a
tube, scissors cut what lies between them, suction takes up what has been lost."""
ALL_INSTRUMENTS: tuple[Instrument, ...] = get_args(Instrument)
INSTRUMENTS: tuple[Instrument, ...] = ("hook", "grasper", "dissector", "swab")
"""Those for a duct in which nothing flows."""
HOLDING: tuple[Instrument, ...] = ("hook", "grasper")

Structure = Literal["cystic duct", "cystic artery", "common duct"]
"""What a tube is taken for by who marks it."""
STRUCTURES: tuple[Structure, ...] = get_args(Structure)

InputKind = Literal[
    "instrument", "grab", "move", "open", "release", "lift", "force", "grasp", "threshold",
    "theory", "aim", "spread", "clip", "divide", "suck", "view", "wipe", "mark", "unsafe",
    "cut",
]  # fmt: skip
KINDS: tuple[InputKind, ...] = get_args(InputKind)
NUMBER_OF = {kind: number for number, kind in enumerate(KINDS)}
REPLACED: frozenset[InputKind] = frozenset({"move", "open", "lift", "threshold", "suck", "view"})
"""Of these only the last between two ticks has an effect: it replaces the one before."""
WITHOUT_VALUE: frozenset[InputKind] = frozenset(
    {"release", "clip", "divide", "wipe", "unsafe", "cut"}
)
VECTORS: frozenset[InputKind] = frozenset({"move", "aim", "spread"})
"""Kinds whose value is nothing, and three numbers."""
SCOPE_NUMBERS = 12
"""Of a view through a scope, before its horizon."""
VIEWS = (3, 6, SCOPE_NUMBERS, 13)
"""How many numbers a view may have; with 12 a scope's horizon is not known."""


class TheoryChoice(msgspec.Struct, frozen=True, omit_defaults=True):
    """A theory by its name and options, as `theory_named` takes them."""

    name: str
    q: float | Literal["fitted"] | None = None  # of the cubic
    shear: bool = False  # of the exact beam
    law: LawName | None = None  # of the exact beam
    stiffening: float | None = None  # of the exponential law

    @classmethod
    def of(cls, theory: Theory) -> "TheoryChoice":
        """Return the choice that stands for a theory; raise if it has no name."""
        choice = msgspec.convert({"name": theory.name, **theory.options}, cls)
        if choice.theory() != theory:
            raise ValueError(f"theory {theory!r} cannot be written into a run")
        return choice

    def theory(self) -> Theory:
        """Return the theory."""
        return theory_named(
            self.name, q=self.q, shear=self.shear, law=self.law, stiffening=self.stiffening
        )


Value = str | float | tuple[int | float, ...] | TheoryChoice | None


Applied = tuple[InputKind, tuple[float, ...]]
"""An input as it has acted, its numbers within their range: what a run logs."""


class Input(msgspec.Struct, frozen=True, array_like=True):
    """One input, applied before a tick.

    The value of each kind:
    "instrument": its name; "grab": the number of the tube and the station on it, mm;
    "move": (3,) mm of the tip in the duct's frame; "open": mm between the jaws; "release": None;
    "lift": deflection of the place that is held, mm; "force": N along the pull;
    "grasp": station at which force or deflection act, mm; "threshold": MPa; "theory": a choice;
    "aim": (3,) direction from the tip back along the shaft; "spread": (3,) direction in which jaws
    part; "clip", "cut" and, by which older runs divide tubes and cut no strand, "divide": None;
    "wipe": None, of the scope's lens; "suck": ml/s; "view", whichever the hand: (3,) unit direction
    towards the viewer, where it is known (3,) mm of the camera's place, and through a scope its six
    numbers: pan, tilt, depth, cable, head and the optical axis's angle, rad and mm; then how far
    its horizon is turned, rad; "mark": the number of the structure, of the tube that is taken for
    it, and the station on it, mm; "unsafe": None, that it is not yet safe to tell.
    """

    tick: int  # number of ticks done before it
    hand: int
    kind: InputKind
    value: Value


class InputLog:
    """The inputs of a run in order, kept as bare numbers: half an hour of dragging is a few MB."""

    def __init__(self) -> None:
        self._rows = array("d")  # of each its tick, key and how many numbers, and these
        self.count = self._last = 0  # how many, and where the last one begins
        self._theories: list[Theory] = []

    def note(self, tick: int, hand: int, kind: InputKind, values: Sequence[float | Theory]) -> None:
        """Append an input; it may replace one of its hand and kind just before, in its tick."""
        if kind == "theory":
            values = tuple(self._number(each) for each in cast(tuple[Theory, ...], values))
        key, rows, last = len(KINDS) * hand + NUMBER_OF[kind], self._rows, self._last
        if rows and rows[last] == tick and rows[last + 1] == key and kind in REPLACED:
            del rows[last:]
        else:
            self.count, self._last = self.count + 1, len(rows)
        # A list, as it is taken in half the time of a tuple.
        rows.fromlist([tick, key, len(values), *values])  # pyright: ignore[reportArgumentType]

    def inputs(self) -> list[Input]:
        """Return the inputs so far."""
        found, at = list[Input](), 0
        while at < len(self._rows):
            tick, key, count = map(int, self._rows[at : at + 3])
            found.append(self._input(tick, key, tuple(self._rows[at + 3 : at + 3 + count])))
            at += 3 + count
        return found

    def _input(self, tick: int, key: int, numbers: tuple[float, ...]) -> Input:
        hand, number = divmod(key, len(KINDS))
        kind = KINDS[number]
        value: Value
        if kind in WITHOUT_VALUE:
            value = None
        elif kind == "instrument":
            value = ALL_INSTRUMENTS[int(numbers[0])]
        elif kind == "grab":
            value = (int(numbers[0]), numbers[1])
        elif kind == "mark":
            value = (int(numbers[0]), int(numbers[1]), numbers[2])
        elif kind == "theory":
            value = TheoryChoice.of(self._theories[int(numbers[0])])
        else:
            value = numbers if kind in VECTORS or kind == "view" else numbers[0]
        return Input(tick, hand, kind, value)

    def _number(self, theory: Theory) -> float:
        self._theories.append(theory)
        return float(len(self._theories) - 1)
