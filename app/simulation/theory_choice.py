"""Theories by name and options, as they are written into a run."""

from typing import Literal

import msgspec

from physics import Cubic, Exact, Theory, theory_named
from physics.theory import LawName

__all__ = ["TheoryChoice"]


class TheoryChoice(msgspec.Struct, frozen=True, omit_defaults=True):
    """A theory by its name and options, as `theory_named` takes them.

    Attributes
    ----------
    name
        Name of the theory.
    q
        Of the cubic.
    shear, law
        Of the exact beam.
    """

    name: str
    q: float | Literal["fitted"] | None = None
    shear: bool = False
    law: LawName | None = None

    @classmethod
    def of(cls, theory: Theory) -> "TheoryChoice":
        """Return the choice that gives a theory."""
        if isinstance(theory, Cubic):
            choice = cls(theory.name, q=theory.q)
        elif isinstance(theory, Exact):
            choice = cls(theory.name, shear=theory.law.shear, law=theory.law.name)
        else:
            choice = cls(theory.name)
        if choice.theory() != theory:
            raise ValueError(f"theory {theory!r} cannot be written into a run")
        return choice

    def theory(self) -> Theory:
        """Return the theory."""
        return theory_named(self.name, q=self.q, shear=self.shear, law=self.law)
