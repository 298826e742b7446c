"""The thesis's factor q as a law: what its ANSYS columns imply, for any round or other section.

The thesis takes q = 1 for small deflections and 0.4 to 0.5 for large ones (5.1.4), and no one
number fits its tables: the q that makes the cubic meet ANSYS falls from 0.89 to 0.39 along table
6.3. Three numbers without a unit describe it. With the length ell = 2ab/S of a grasp at a and b
from the clamps (L for a central one) and the radius of gyration r = sqrt(I/A) they are the slope
u = delta/ell, the ratio w = delta/r and the stoutness r/ell, and

    q = 2 (1 - 1/sqrt(1 + u^2)) / u^2 / 1.44
        * (1 + 0.44 / sqrt(1 + (w/crossover)^2)) * exp(-decline (r/ell)^2).

The first factor is the string's (5.25) over the cubic's own k3, the second leads from the cubic's
curve, whose q is 1 while the deflection is small against the section, to the string's two straight
lines. These two come out of the theory; where the second crosses over and how fast the third
declines for stout beams are fitted.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from physics.beam import Beam
from physics.quantity import positive

# Small-deflection k3 of the cubic over the string's: 0.72 / 0.5 with F = 2P.
STRING = 1.44


@dataclass(frozen=True, slots=True)
class FittedQ:
    """The law with its two fitted numbers."""

    crossover: float  # deflection over radius of gyration at which stretching takes over
    decline: float  # rate at which q falls with the square of the stoutness

    def __post_init__(self) -> None:
        positive(self.crossover, "crossover", "(no unit)")
        positive(self.decline, "decline", "(no unit)")

    def at(self, beam: Beam, grasp: float, deflection: float) -> tuple[float, float]:
        """Return q at a deflection, and how fast it changes."""
        length, gyration = lengths(beam, grasp)
        numbers = deflection / length, deflection / gyration, gyration / length
        return _law(self.crossover, self.decline, *numbers)


def lengths(beam: Beam, grasp: float) -> tuple[float, float]:
    """Return what the law measures a deflection by."""
    a, b = beam.grasped_at(grasp)
    return 2.0 * a * b / beam.span, math.sqrt(beam.second_moment / beam.area)


def fitted_to(
    slopes: NDArray[np.float64],
    ratios: NDArray[np.float64],
    implied: NDArray[np.float64],
    weights: NDArray[np.float64],
) -> FittedQ:
    """Return the law nearest to (K,) observed values of q, by weighted least squares of ln q."""
    # `slopes` are observed deflections over the length 2ab/S, `ratios` the same over the radius of
    # gyration, `implied` the q with which the cubic meets them. With the weights
    # |d(ln delta)/d(ln q)| the squared relative errors of the deflections are least.
    if not slopes.shape == ratios.shape == implied.shape == weights.shape or slopes.ndim != 1:
        raise ValueError(
            "slopes, ratios, implied and weights must be rows of one length, got shapes "
            f"{slopes.shape}, {ratios.shape}, {implied.shape}, {weights.shape}"
        )
    if not (implied > 0.0).all():
        raise ValueError(f"implied must be above 0, got {implied.min()}")
    stoutness = slopes / ratios

    def log_q(crossover: float, decline: float) -> NDArray[np.float64]:
        rows = zip(slopes.tolist(), ratios.tolist(), stoutness.tolist(), strict=True)
        return np.log([_law(crossover, decline, *row)[0] for row in rows])

    crossover, decline = 10.0, 10.0
    for _ in range(100):
        now = log_q(crossover, decline)
        step = 1e-6 * crossover
        slope = (log_q(crossover + step, decline) - log_q(crossover - step, decline)) / (2.0 * step)
        system = weights[:, None] * np.column_stack([slope, -(stoutness**2)])
        change = np.linalg.lstsq(system, weights * (np.log(implied) - now))[0]
        crossover += float(change[0])
        decline += float(change[1])
        if np.abs(change).max() < 1e-10:
            break
    return FittedQ(crossover, decline)


def _law(
    crossover: float, decline: float, slope: float, ratio: float, stoutness: float
) -> tuple[float, float]:
    """Return q and d(ln q)/d(ln delta)."""
    square = slope * slope
    h = math.sqrt(1.0 + square)
    relative = ratio / crossover
    t = math.sqrt(1.0 + relative * relative)
    curved = (STRING - 1.0) / t
    # 2 (1 - 1/h) / u^2 without the cancellation that it has as written.
    q = 2.0 / (STRING * h * (h + 1.0)) * (1.0 + curved)
    power = -(2.0 * h + 1.0) * square / (h * h * (h + 1.0))
    power -= curved / (1.0 + curved) * relative * relative / (t * t)
    return q * math.exp(-decline * stoutness * stoutness), power


FITTED_Q = FittedQ(crossover=8.1157, decline=13.6238)
"""Fitted by `fitted_to` to all rows of tables 6.1 and 6.3 of the thesis: deflections within 0.33 %
of ANSYS in 6.1 (whose values have three digits), 0.045 % in 6.3, and 0.16 % in 6.2, which was not
fitted to. Those pulls are central: at 30 % of the span of 6.3 the law is 1 % off the elements of
`physics.fem` at a slope of a half and 4 % at a slope of 1."""
