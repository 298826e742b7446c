"""The geometrically exact beam: its laws, its kernels and the pull that holds it."""

from physics.exact.exact import BeyondLaw, Exact, ExactPull, Hold, Law, Reason
from physics.exact.fibre_laws import MOST_STIFFENING, Exponential, NeoHooke
from physics.exact.linear_law import Linear

__all__ = [
    "MOST_STIFFENING",
    "BeyondLaw",
    "Exact",
    "ExactPull",
    "Exponential",
    "Hold",
    "Law",
    "Linear",
    "NeoHooke",
    "Reason",
]
