"""The geometrically exact beam: its laws, its kernels and the pull that holds it."""

from physics.exact.exact import BeyondLaw, Exact, ExactPull, Hold, Law, Reason
from physics.exact.fibre_laws import Exponential, NeoHooke
from physics.exact.linear_law import Linear

__all__ = [
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
