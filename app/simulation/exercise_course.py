"""The exercises that a duct is good for: their numbers follow from where it breaks."""

import numpy as np

from app.simulation.exercise import ApproachBreak, Exercise, GentleDissection, HoldStretch
from app.simulation.grasped_duct import GraspedDuct

__all__ = ["exercises_for"]

HOLD_PART, HOLD_TOLERANCE = 0.6, 0.05
"""Deflection to hold and how near, in deflections at break."""
HOLD_SECONDS = 3.0
SPARE_FORCE = 1.1
"""Limit of force over the largest that the hold needs."""
MARGIN = 0.15
STAY_SECONDS = 1.0
PULL_SECONDS = 4.0
"""An even pull of this length to the break has the largest force-time product that passes."""


def exercises_for(duct: GraspedDuct) -> tuple[Exercise, ...]:
    """Return the exercises for a duct.

    Parameters
    ----------
    duct
        The duct, its grasp and its threshold.

    Returns
    -------
    tuple[Exercise, ...]
        Hold a stretch, approach the break and dissect gently; none for a duct that cannot break.
    """
    event = duct.breaks_at
    if event is None:
        return ()
    deflections, forces = duct.curve(60)
    band = (HOLD_PART + HOLD_TOLERANCE) * event.deflection
    needed = float(np.interp(band, deflections, forces))
    # What an even pull by displacement spends: the mean force over the way, times the time.
    way = deflections <= event.deflection
    mean = float(np.trapezoid(forces[way], deflections[way])) / event.deflection
    return (
        HoldStretch(
            deflection_mm=HOLD_PART * event.deflection,
            tolerance_mm=HOLD_TOLERANCE * event.deflection,
            seconds=HOLD_SECONDS,
            force_limit_N=SPARE_FORCE * needed,
        ),
        ApproachBreak(margin=MARGIN, seconds=STAY_SECONDS),
        GentleDissection(product_limit_N_s=PULL_SECONDS * mean),
    )
