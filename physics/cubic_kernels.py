"""The cubic's deflection in compiled code: for use inside other kernels, and for arrays of forces.

The one real root of F = k1 delta + k3 delta^3 by Cardano, without the cancellation that his
formula has as written: with x = F/k1, w = |x| sqrt(k3/k1) and c the cube root of
w/2 + sqrt(w^2/4 + 1/27), delta = x / (c^2 + 1/3 + 1/(9 c^2)). Nothing branches and nothing is
called, so that the loop over an array runs in vectors.
"""

import math

import numpy as np
from numpy.typing import NDArray

from kernel_cache import njit

THIRD = 1.0 / 3.0
# Two thirds of the exponent's offset of 1023, where it stands in a double.
EXPONENT = float(682 << 52)
FAR = 1e9
"""Half of w beyond which the 1/27 is lost to rounding; its square could overflow."""


@njit(cache=True, error_model="numpy")
def cubic_deflection(bending: float, stretching: float, force: float) -> float:
    """Return the deflection under a force, within 1e-13 of the root wherever F/k1 is finite."""
    linear = force / bending
    half = 0.5 * abs(linear) * math.sqrt(stretching / bending)
    cube = half + (half if half > FAR else math.sqrt(half * half + 1.0 / 27.0))
    # The bits of a double are nearly its logarithm: a third of them is a cube root to 6 %, which
    # each of Halley's steps brings to its third power.
    bits = np.float64(cube).view(np.int64)
    root = float(np.int64(np.float64(bits) * THIRD + EXPONENT).view(np.float64))
    for _ in range(3):
        reached = root * root * root
        root *= (reached + 2.0 * cube) / (2.0 * reached + cube)
    square = root * root
    return linear / (square + THIRD + 1.0 / (9.0 * square))


@njit(cache=True, error_model="numpy")
def fill_cubic_deflections(
    bending: float,
    stretching: float,
    forces: NDArray[np.float64],
    deflections: NDArray[np.float64],
) -> None:
    """Fill the deflections (N,), mm, under forces (N,), N; both may be one array."""
    for i in range(forces.shape[0]):
        deflections[i] = cubic_deflection(bending, stretching, forces[i])
