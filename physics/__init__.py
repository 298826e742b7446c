"""Beams under a pull: deflection, stress and rupture, in mm, N, MPa and rad."""

from physics.beam import Beam
from physics.cubic import Cubic
from physics.equilibrium import Equilibrium
from physics.rupture import (
    BreakEvent,
    RuptureCheck,
    break_event,
    calibrated_threshold,
    check_rupture,
    critical_stations,
)
from physics.taut_string import TautString
from physics.theory import THEORIES, Theory, theory_named

__all__ = [
    "THEORIES",
    "Beam",
    "BreakEvent",
    "Cubic",
    "Equilibrium",
    "RuptureCheck",
    "TautString",
    "Theory",
    "break_event",
    "calibrated_threshold",
    "check_rupture",
    "critical_stations",
    "theory_named",
]
