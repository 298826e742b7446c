"""Time of the cubic's deflection, inside compiled code and for arrays of forces, on one core."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from benchmarks.duct import CENTRE, DUCT, FORCE, relative_error, walk_about
from benchmarks.engine import Engine
from benchmarks.stopwatch import microseconds
from physics import Cubic
from physics.cubic_kernels import cubic_deflection

SOLVES = 100_000
ARRAY = 1_000_000


@njit  # not cached: a cache does not notice a change in the kernel's file
def total(bending: float, stretching: float, loads: NDArray[np.float64]) -> float:
    """Return the sum of the deflections, found one after the other."""
    deflections = 0.0
    for load in loads:
        deflections += cubic_deflection(bending, stretching, load)
    return deflections


def cubic_engine() -> Engine:
    """Return the time of one deflection inside compiled code."""
    k1, k3 = Cubic().stiffness(DUCT, CENTRE)
    loads = walk_about(FORCE, SOLVES)
    error = relative_error(cubic_deflection(k1, k3, FORCE))
    time = microseconds(lambda: total(k1, k3, loads), SOLVES)
    return Engine("cubic", "cubic, q = 0.5, centre", time, error)


def cubic_array_rate() -> float:
    """Return how many forces of an array are answered in a second, without an array to fill."""
    forces = np.linspace(-FORCE, FORCE, ARRAY)
    return 1e6 / microseconds(lambda: Cubic().deflections(DUCT, CENTRE, forces), ARRAY)
