"""Closed forms that a beam on a bed is held against: beams on springs, peeling, bending, buckling.

Symbols: k stiffness of the bed for each mm of beam, N/mm^2; G energy to part it for each mm of
beam, N (mJ/mm); P a force, N; EI bending, EA axial and GA shear stiffness of the beam, N mm^2, N
and N; lambda = (k / 4 EI)^(1/4), 1/mm; a length of beam beyond the bed, mm. A bed is a row of
springs that pull and push. Angles are rad.
"""

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def end_deflection(
    force: float, stiffness: float, bending: float, shear: float = math.inf
) -> float:
    """Return the deflection of a long beam on a bed under a force P across its free end, mm."""
    # [Hetenyi 1946], with the shear deformation of the beam: w = 2 P alpha / k with
    # alpha^2 = lambda^2 + k / (4 G A).
    alpha = math.sqrt(math.sqrt(stiffness / (4.0 * bending)) + stiffness / (4.0 * shear))
    return 2.0 * force * alpha / stiffness


def cantilever_compliance(crack: float, stiffness: float, bending: float) -> float:
    """Return the deflection for each N at the end of a beam that sticks out of its bed, mm/N."""
    # [Kanninen 1973]: a^3 / (3 EI) (1 + 3/(la) + 3/(la)^2 + 3/(2 (la)^3)), la = lambda a.
    la = (stiffness / (4.0 * bending)) ** 0.25 * crack
    return crack**3 / (3.0 * bending) * (1.0 + 3.0 / la + 3.0 / la**2 + 1.5 / la**3)


def peel_force(angle: float, toughness: float, stretching: float) -> float:
    """Return the steady force that peels a strip off at an angle to what still holds, N."""
    # [Rivlin 1944], with the stretch of the arm [Kendall 1975]: F (1 - cos) + F^2 / (2 EA) = G.
    slack = stretching * (1.0 - math.cos(angle))
    return math.sqrt(slack * slack + 2.0 * stretching * toughness) - slack


def peel_toughness(force: float, angle: float, stretching: float) -> float:
    """Return the toughness that a steady force at an angle stands for, N; see `peel_force`."""
    return force * (1.0 - math.cos(angle)) + force * force / (2.0 * stretching)


def double_peel_force(toughness: float, stretching: float) -> tuple[float, float]:
    """Return the steady force, N, and angle, rad, at which both arms of a long strip peel."""
    # The strip is pulled by its middle, straight up, with 2 EA (1/cos - 1) sin. Each arm, stretched
    # by 1/cos - 1, meets its front at the angle at which
    # EA ((1/cos - 1)(1/cos - cos) - (1/cos - 1)^2 / 2) = G: the work of the force less the energy
    # of the arm's growing length ([Putignano 2014] has the same by energy). The left side falls as
    # the cosine c grows, so bisection finds the root.
    low, high = 1e-6, 1.0
    for _ in range(200):
        c = 0.5 * (low + high)
        stretch = 1.0 / c - 1.0
        if stretching * (stretch * (1.0 / c - c) - 0.5 * stretch * stretch) > toughness:
            low = c
        else:
            high = c
    c = 0.5 * (low + high)
    return 2.0 * stretching * (1.0 / c - 1.0) * math.sqrt(1.0 - c * c), math.acos(c)
