"""How far the theories that iterate can be pulled, and how exactly they come to rest."""

from physics import Beam

CHAINS = ("fem",)
"""Theories of elements or masses in a row, whose points also move along the line of the clamps."""

ROUND_TRIP = {"cubic": 1e-12, "string": 1e-12, "fem": 1e-9}
"""Relative: force to deflection to force. Closed forms to rounding; the 240 equations of 80
elements lose three digits more to the ratio of their stiffest to their softest shape."""

SYMMETRY = {"cubic": 1e-9, "string": 1e-9, "fem": 1e-9}
"""Relative: a pull against the same pull in the mirror."""


def within_reach(name: str, beam: Beam, relative: float) -> bool:
    """Whether a theory finds this beam at this part of its span.

    The closed forms have an answer to everything. Elements end where one is crushed to nothing,
    which a pull of a span or more does to a beam shorter than some two and a half diameters.
    """
    slenderness = beam.span / (2.0 * beam.fibre_distance)
    return name not in CHAINS or (slenderness >= 4.0 and relative <= 1.0)
