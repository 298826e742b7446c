"""The one way to call a theory of a pulled beam, whichever it is."""

from collections.abc import Callable, Mapping
from typing import ClassVar, Literal, Protocol, get_args

from physics.beam import Beam
from physics.cubic import Cubic
from physics.exact import Exact, Exponential, Law, Linear, NeoHooke
from physics.fem import Fem
from physics.mass_spring import MassSpring
from physics.pull import Pull
from physics.taut_string import TautString

LawName = Literal["linear", "neo-hooke", "exponential"]
"""Laws of a wall, as they are called on the command line and in files."""


class Theory(Protocol):
    """A way to find the equilibria of a beam pulled across its axis at one place."""

    name: ClassVar[str]  # as on the command line
    takes_all_sections: ClassVar[bool]  # not the weakest alone, where sections vary along a beam

    @property
    def options(self) -> Mapping[str, object]:
        """What `theory_named` takes beside the name, by keyword."""
        ...

    def pull(self, beam: Beam, grasp: float) -> Pull:
        """Return a beam at rest, grasped at a distance from the first clamp, mm."""
        ...


THEORIES: dict[str, Callable[[], Theory]] = {
    "cubic": Cubic,
    "string": TautString,
    "exact": Exact,
    "fem": Fem,
    "mass-spring": MassSpring,
}
"""The theories by name, each with its own defaults."""


def theory_named(
    name: str,
    *,
    q: float | Literal["fitted"] | None = None,
    shear: bool = False,
    law: LawName | None = None,
    stiffening: float | None = None,
) -> Theory:
    """Return the theory of that name."""
    if name not in THEORIES:
        raise ValueError(f"unknown theory {name!r}; there are: {', '.join(THEORIES)}")
    if q is not None and name != "cubic":
        raise ValueError(f"q belongs to the cubic theory, the {name} theory has none")
    if (shear or law is not None or stiffening is not None) and name != "exact":
        raise ValueError(f"shear and law belong to the exact theory, the {name} theory has none")
    if name == "cubic" and q is not None:
        return Cubic(q=q)
    if name == "exact":
        return Exact(law_named(law or "linear", shear=shear, stiffening=stiffening))
    return THEORIES[name]()


def law_named(name: str, *, shear: bool = True, stiffening: float | None = None) -> Law:
    """Return the law of a wall of that name; `shear` only matters to the linear one."""
    if name not in get_args(LawName):
        raise ValueError(f"law must be one of {', '.join(get_args(LawName))}, got {name!r}")
    if (name == "exponential") != (stiffening is not None):
        raise ValueError("the exponential law has a stiffening, and the others have none")
    if stiffening is not None:
        return Exponential(stiffening)
    return NeoHooke() if name == "neo-hooke" else Linear(shear=shear)


def theory_words(theory: Theory) -> str:
    """Return a theory's name with its options."""
    return ", ".join([theory.name, *(f"{key} {v}" for key, v in theory.options.items())])
