"""How often anatomies are built how, with sources, and cases drawn from that by a seed.

Each size and each kind is drawn from a stream of its own, seeded by the case's number and the name,
so that a further frequency changes no case's other draws. `random.Random` gives the same numbers on
every machine and in every version of Python.
"""

import random
from dataclasses import dataclass
from functools import cache
from statistics import NormalDist

import msgspec

from assets import FREQUENCIES


class Size(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A normal distribution that is cut off at both ends."""

    mean: float
    sd: float
    source: str
    assumed: str = ""
    low: float = msgspec.field(default=0.0, name="from")
    high: float = msgspec.field(default=float("inf"), name="to")

    def at(self, draw: float) -> float:
        """Return the size that a draw from 0 to 1 gives, to 0.001."""
        normal = NormalDist(self.mean, self.sd)
        below, above = normal.cdf(self.low), normal.cdf(self.high)
        return round(normal.inv_cdf(below + draw * (above - below)), 3)


class Tied(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Kinds that occur only with a size above, or below, its median: twice as often there."""

    to: str  # name of the size
    above: list[str] = []
    below: list[str] = []


class Fraction(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Kinds and the share of each."""

    values: dict[str, float]
    source: str
    assumed: str = ""
    tied: Tied | None = None

    def at(self, draw: float, size_draw: float = 0.5) -> str:
        """Return the kind that a draw from 0 to 1 gives, the size tied to it having another."""
        here: list[str] = []
        tied: list[str] = []
        if self.tied is not None:
            here = self.tied.above if size_draw >= 0.5 else self.tied.below
            tied = self.tied.above + self.tied.below
        # So that each kind keeps its share over both halves.
        rest = 1.0 - 2.0 * sum(self.values[name] for name in here)
        rest /= 1.0 - sum(self.values[name] for name in tied)
        left = draw
        found = ""
        for name, fraction in self.values.items():
            factor = 2.0 * (name in here) if name in tied else rest
            if factor > 0.0:
                found = name
                left -= factor * fraction
                if left < 0.0:
                    break
        return found


class Frequencies(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The distributions of sizes and kinds, by name (assets/frequencies.toml)."""

    size: dict[str, Size]
    fraction: dict[str, Fraction]


@dataclass(frozen=True, slots=True)
class Case:
    """What is drawn for an anatomy: kinds and sizes by their names, mm and degrees."""

    seed: int
    kinds: dict[str, str]
    sizes: dict[str, float]


@cache
def frequencies() -> Frequencies:
    """Return the frequencies that ship with the program."""
    return msgspec.toml.decode(FREQUENCIES.read_bytes(), type=Frequencies)


def case_of(seed: int) -> Case:
    """Return the case of a seed."""
    known = frequencies()

    def draw(name: str) -> float:
        return random.Random(f"{seed} {name}").random()  # noqa: S311 (no secret)

    return Case(
        seed=seed,
        kinds={
            name: fraction.at(draw(name), draw(fraction.tied.to) if fraction.tied else 0.5)
            for name, fraction in known.fraction.items()
        },
        sizes={name: size.at(draw(name)) for name, size in known.size.items()},
    )
