"""Time in which the mass-spring chain settles after a step of the load."""

import math

from benchmarks.duct import CENTRE, DUCT, FORCE, SETTLED, relative_error, walk_about
from benchmarks.engine import Engine
from benchmarks.stopwatch import microseconds
from physics import Cubic, MassSpring

SOLVES = 80
FINE = 1e-10
LOOSEST = 1e-4
"""Tolerances of `MassSpringChain.settle`: what counts as at rest, and the loosest one tried."""


def spring_chain_engine() -> Engine:
    """Return the time of a settling to within `SETTLED`: 40 segments on the span."""
    chain = MassSpring(nodes=41).chain(DUCT, CENTRE)
    chain.pull(FORCE)
    chain.bend(Cubic().pull(DUCT, CENTRE).to_force(FORCE).deflection)
    chain.settle(FINE)
    error = relative_error(chain.deflection)
    loads = walk_about(FORCE, SOLVES).tolist()

    def settled_to(tolerance: float) -> float:
        worst = 0.0
        for load in loads:
            chain.pull(load)
            chain.settle(tolerance)
            reached = chain.deflection
            chain.settle(FINE)
            worst = max(worst, abs(reached / chain.deflection - 1.0))
        return worst

    tolerance = LOOSEST
    while settled_to(tolerance) > SETTLED:
        tolerance /= math.sqrt(10.0)

    def walk() -> None:
        for load in loads:
            chain.pull(load)
            chain.settle(tolerance)

    time = microseconds(walk, SOLVES)
    return Engine("mass_spring_warm", "mass-spring, 40 segments", time, error).checked()
