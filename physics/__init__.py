"""Beams under a pull: deflection, stress and rupture, in mm, N, MPa and rad."""

from physics.beam import Beam
from physics.cubic import Cubic
from physics.equilibrium import Equilibrium
from physics.exact import Exact, ExactSolver, NoEquilibrium
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
from physics.varying_beam import VaryingBeam

__all__ = [
    "THEORIES",
    "Beam",
    "BreakEvent",
    "Cubic",
    "Equilibrium",
    "Exact",
    "ExactSolver",
    "NoEquilibrium",
    "RuptureCheck",
    "TautString",
    "Theory",
    "VaryingBeam",
    "break_event",
    "calibrated_threshold",
    "check_rupture",
    "critical_stations",
    "theory_named",
]
