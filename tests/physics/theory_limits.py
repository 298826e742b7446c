"""How far the theories that iterate can be pulled, and how exactly they come to rest."""

from physics import THEORIES, Beam, spring_chain

TESTED = sorted(
    name for name in THEORIES if name != "mass-spring" or hasattr(spring_chain.settle, "py_func")
)
"""Theories that tests of all of them take: a chain takes thousands of steps, only compiled."""

CHAINS = ("fem", "mass-spring")
"""Theories of elements or masses in a row."""

SLIDING = ("exact", *CHAINS)
"""Theories whose points also move along the line of the clamps."""

ROUND_TRIP = {"cubic": 1e-12, "string": 1e-12, "exact": 1e-9, "fem": 1e-9, "mass-spring": 1e-6}
"""Relative: force to deflection to force. Closed forms to rounding; the 240 equations of 80
elements lose three digits more to the ratio of their stiffest to their softest shape; masses settle
until a billionth of the force is left, which is some hundred billionths of the deflection."""

SYMMETRY = {"cubic": 1e-9, "string": 1e-9, "exact": 1e-8, "fem": 1e-9, "mass-spring": 1e-6}
"""Relative: a pull against the same pull in the mirror."""

MOST_DEFLECTION = {"fem": 1.0, "mass-spring": 0.3}
"""As a part of the span. Elements end where one is crushed to nothing, which a pull of a span or
more does to a beam shorter than some two and a half diameters; four coarse segments between a clamp
and a grasp near it can fold, and then there is more than one way to rest."""


def within_reach(name: str, beam: Beam, relative: float) -> bool:
    """Whether a theory finds this beam at this part of its span; closed forms always do."""
    slenderness = beam.span / (2.0 * beam.fibre_distance)
    if name == "exact":  # from a half span of one diameter on
        return slenderness >= 2.0
    return name not in CHAINS or (slenderness >= 4.0 and relative <= MOST_DEFLECTION[name])
