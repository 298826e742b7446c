"""The geometrically exact beam: its laws, its kernels and the pull that holds it."""

from physics.exact.exact import BeyondLaw, Exact, ExactPull, Hold, Law, Reason
from physics.exact.linear_law import Linear
from physics.exact.neo_hooke_law import NeoHooke

__all__ = ["BeyondLaw", "Exact", "ExactPull", "Hold", "Law", "Linear", "NeoHooke", "Reason"]
