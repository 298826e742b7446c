"""Beams under a pull: deflection, stress and rupture, in mm, N, MPa and rad."""

from physics.beam import Beam
from physics.cubic import Cubic
from physics.equilibrium import Equilibrium, NoEquilibrium
from physics.exact import BeyondLaw, Exact, ExactPull, Exponential, Hold, Law, Linear, NeoHooke
from physics.fem import Fem
from physics.fitted_q import FITTED_Q, FittedQ, fitted_to
from physics.ligament_section import LigamentSection, ligament
from physics.mass_spring import MassSpring
from physics.mass_spring_chain import MassSpringChain
from physics.pull import Pull, break_of, calibrated_threshold
from physics.rayleigh import BentBeam, RayleighBeam, Support
from physics.rupture import (
    BreakEvent,
    RuptureCheck,
    check_rupture,
    critical_stations,
)
from physics.taut_string import TautString
from physics.tear_growth import (
    DEEPEST,
    TearPath,
    tear_by_pull,
    tear_under_force,
    tear_under_grip,
    torn_beam,
)
from physics.theory import THEORIES, LawName, Theory, law_named, theory_named, theory_words
from physics.varying_beam import VaryingBeam

__all__ = [
    "DEEPEST",
    "FITTED_Q",
    "THEORIES",
    "Beam",
    "BentBeam",
    "BeyondLaw",
    "BreakEvent",
    "Cubic",
    "Equilibrium",
    "Exact",
    "ExactPull",
    "Exponential",
    "Fem",
    "FittedQ",
    "Hold",
    "Law",
    "LawName",
    "LigamentSection",
    "Linear",
    "MassSpring",
    "MassSpringChain",
    "NeoHooke",
    "NoEquilibrium",
    "Pull",
    "RayleighBeam",
    "RuptureCheck",
    "Support",
    "TautString",
    "TearPath",
    "Theory",
    "VaryingBeam",
    "break_of",
    "calibrated_threshold",
    "check_rupture",
    "critical_stations",
    "fitted_to",
    "law_named",
    "ligament",
    "tear_by_pull",
    "tear_under_force",
    "tear_under_grip",
    "theory_named",
    "theory_words",
    "torn_beam",
]
