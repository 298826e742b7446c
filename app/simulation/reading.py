"""What a session shows of itself: its phase, what the instruments read, the surfaces to draw."""

from dataclasses import dataclass
from enum import StrEnum

from organ_geometry.mesh import Surface
from physics import BreakEvent, RuptureCheck

__all__ = ["Phase", "Reading", "Surface"]


class Phase(StrEnum):
    """What the duct is going through."""

    INTACT = "intact"
    TEARING = "tearing"
    TORN = "torn"


@dataclass(frozen=True, slots=True)
class Reading:
    """What the instruments show after a step.

    Attributes
    ----------
    phase
        What the duct is going through.
    force
        The grasper's whole force, N; 0 while the duct springs back with nobody holding it.
    deflection
        Displacement of the grasp, mm; 0 once the duct is in two.
    check
        Highest stress held against the threshold; at the break once it is torn.
    breaks_at
        Load at which the duct would break, or broke; None if it cannot.
    deepest
        Largest deflection of this pull, mm.
    hook
        The duct's axis at the grasp, mm from the first clamp along the clamps, sideways and
        along the pull.
    held
        Whether the grasper holds the duct, by a force or by hand.
    by_hand
        Whether a hand leads the grasper, so that the beam answers with the force.
    """

    phase: Phase
    force: float
    deflection: float
    check: RuptureCheck
    breaks_at: BreakEvent | None
    deepest: float
    hook: tuple[float, float, float]
    held: bool = False
    by_hand: bool = False
