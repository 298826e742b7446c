"""What is seen of a duct in its bed from the standard view."""

import numpy as np

__all__ = ["TOWARDS_VIEWER", "WORKING_DISTANCE"]

TOWARDS_VIEWER = np.array([0.0, -0.8, 0.6])
"""(3,) in the duct's frame, towards the camera of the standard view."""
WORKING_DISTANCE = 5.0
"""mm along the duct from an instrument within which strands are seen, on whichever side."""
