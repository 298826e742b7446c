"""How tissue relaxes while it is held, with sources."""

from functools import cache
from typing import Literal

import msgspec

from assets import RELAXATIONS
from physics.bed import Relaxation


class Prony(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A relaxation as files have it."""

    fractions: tuple[float, ...]  # of the stiffness at once
    times_s: tuple[float, ...]

    @classmethod
    def of(cls, relaxation: Relaxation | None) -> "Prony | None":
        """Return a relaxation as files have it."""
        return None if relaxation is None else cls(relaxation.fractions, relaxation.times)

    def made(self) -> Relaxation:
        """Return the relaxation, or raise a `ValueError` that says what is wrong with it."""
        return Relaxation(self.fractions, self.times_s)


class RelaxationPreset(Prony, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A relaxation with its source."""

    name: str
    source: str
    confidence: Literal["high", "medium", "low"]
    confidence_note: str


class _RelaxationFile(msgspec.Struct, frozen=True):
    relaxation: list[RelaxationPreset]


@cache
def _relaxations() -> dict[str, RelaxationPreset]:
    found = msgspec.toml.decode(RELAXATIONS.read_bytes(), type=_RelaxationFile).relaxation
    return {each.name: each for each in found}


def relaxation_named(name: str) -> RelaxationPreset:
    """Return the relaxation of that name."""
    if name not in _relaxations():
        raise ValueError(f"unknown relaxation {name!r}; there are: {', '.join(_relaxations())}")
    return _relaxations()[name]
