"""Beams under a pull: deflection, stress and rupture, in mm, N, MPa and rad."""

from physics.beam import Beam
from physics.cubic import Cubic
from physics.equilibrium import Equilibrium, NoEquilibrium
from physics.exact import BeyondLaw, Exact, ExactSolver
from physics.exact_along import ExactAlong
from physics.fem import Fem
from physics.fitted_q import FITTED_Q, FittedQ, fitted_to
from physics.mass_spring import MassSpring
from physics.mass_spring_chain import MassSpringChain
from physics.pull import Pull
from physics.rayleigh import BentBeam, RayleighBeam, Support
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
    "FITTED_Q",
    "THEORIES",
    "Beam",
    "BentBeam",
    "BeyondLaw",
    "BreakEvent",
    "Cubic",
    "Equilibrium",
    "Exact",
    "ExactAlong",
    "ExactSolver",
    "Fem",
    "FittedQ",
    "MassSpring",
    "MassSpringChain",
    "NoEquilibrium",
    "Pull",
    "RayleighBeam",
    "RuptureCheck",
    "Support",
    "TautString",
    "Theory",
    "VaryingBeam",
    "break_event",
    "calibrated_threshold",
    "check_rupture",
    "critical_stations",
    "fitted_to",
    "theory_named",
]
