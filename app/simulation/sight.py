"""From where a duct in its bed is seen, and what is always seen."""

import math

import numpy as np

__all__ = ["STEADY", "STEADY_MM", "TOWARDS_VIEWER", "WORKING_DISTANCE"]

TOWARDS_VIEWER = np.array([0.0, -0.8, 0.6])
"""(3,) in the duct's frame, towards the camera of the standard view, as long as nobody moves it."""
STEADY = math.cos(math.radians(5.0))
"""Cosine of the angle by which a view must turn before it counts as another."""
STEADY_MM = 5.0
"""mm by which a camera must move before its view counts as another."""
WORKING_DISTANCE = 5.0
"""mm along the duct from an instrument within which strands are seen, on whichever side."""
