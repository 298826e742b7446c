"""The problem that every engine solves: the thesis's bile duct where it breaks (table 6.3)."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from physics import Beam, Exact

DUCT = Beam.round(span=50.8, diameter=8.89, modulus=0.310264)
FORCE = 2.0 * 0.4 * 4.4482216
"""The grasper's whole force, N: P = 0.4 lbf on each half."""
CENTRE, OFF_CENTRE = 25.4, 15.24
"""Grasps, mm: at half and at 30 % of the span."""
STEP = 0.01
"""Relative change of the load from one equilibrium to the next."""
SETTLED = 1e-4
"""Relative to its last deflection, how near an engine that swings must be to count as settled."""
TURN = 20
"""Steps from the middle load to the largest and the smallest of a walk."""


def converged_deflection(theory: Exact, grasp: float) -> float:
    """Return the deflection of the duct with ten times the intervals, mm."""
    fine = replace(theory, intervals=10 * theory.intervals)
    return fine.pull(DUCT, grasp).to_force(FORCE).deflection


def walk_about(middle: float, count: int) -> NDArray[np.float64]:
    """Return loads around a middle one that fall and rise by `STEP` from one to the next."""
    wave = np.abs((np.arange(count) + TURN) % (4 * TURN) - 2 * TURN) - TURN
    return middle * (1.0 + STEP) ** wave


def relative_error(deflection: float, theory: Exact | None = None, grasp: float = CENTRE) -> float:
    """Return how far a deflection under `FORCE` is from the converged one, as a part of it."""
    return deflection / converged_deflection(theory or Exact(), grasp) - 1.0
