"""A duct torn out of its root: held at one end, its other end led away at an angle to the axis."""

import math
from dataclasses import dataclass

import numpy as np

from physics.beam import Beam
from physics.bed.beam_on_bed import BeamOnBed
from physics.bed.space_beam import SpaceBeam
from physics.equilibrium import NoEquilibrium
from physics.exact import Law
from physics.load_cases import rupture_along
from physics.quantity import finite, positive

# Of the beam's length: how far the end is led at first, and at most; by how much farther each time;
# and the fraction of that to which a break is known.
FIRST, MOST, FARTHER, TOLERANCE = 1e-3, 20.0, 1.25, 1e-6


@dataclass(frozen=True, slots=True)
class Avulsion:
    """The pull under which the wall reaches its threshold."""

    force: float  # of the hand that leads the end, N
    moved: float  # by how much the end was led, mm
    station: float  # where the wall breaks, mm from the root


def avulse(
    beam: Beam, law: Law, threshold: float, angle: float = 0.0, *, elements: int = 40
) -> Avulsion:
    """Return the pull of a hand that leads the free end straight away until the duct tears.

    Parameters
    ----------
    beam, law
        At rest, and its wall's law.
    threshold
        Nominal stress that the wall bears, MPa.
    angle
        Between the hand's way and the axis at rest, rad, from 0 to pi/2.
    elements
        Of the beam in space.

    Returns
    -------
    Avulsion

    Raises
    ------
    ValueError
        If the angle or the threshold cannot be.
    NoEquilibrium
        If the wall does not tear.
    """
    positive(threshold, "threshold", "MPa")
    if not 0.0 <= finite(angle, "angle of an avulsion", "rad") <= 0.5 * math.pi:
        raise ValueError(f"angle of an avulsion must be from 0 to pi/2 rad, got {angle:g}")
    if angle == 0.0:
        straight = rupture_along(beam, law, threshold)
        return Avulsion(straight.force, straight.elongation, 0.0)
    space = SpaceBeam.of(beam, law=law, elements=elements, ends=("clamped", "free"))
    live = BeamOnBed(space, plane=True)
    tip = live.take(beam.span)
    rest, direction = live.rest_place(tip), np.array([math.cos(angle), 0.0, math.sin(angle)])

    def stress(moved: float) -> float:
        live.lead(tip, rest + moved * direction)
        live.advance()
        return live.worst_stress().total

    low, high = 0.0, FIRST * beam.span
    while stress(high) < threshold:
        low, high = high, FARTHER * high
        if high > MOST * beam.span:
            raise NoEquilibrium(f"the wall bears a pull to {MOST:g} times its length")
    while high - low > TOLERANCE * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if stress(middle) < threshold else (low, middle)
    stress(high)
    force = live.hand_force(tip)
    return Avulsion(float(np.sqrt((force**2).sum())), high, live.worst_stress().station)
