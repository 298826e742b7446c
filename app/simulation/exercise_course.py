"""The exercises that a duct is good for: their numbers follow from where it breaks."""

import numpy as np

from app.simulation.exercise import ApproachBreak, Exercise, GentleDissection, HoldStretch
from app.simulation.grasped_duct import GraspedDuct

__all__ = ["exercises_for", "goal_band"]

HOLD_PART, HOLD_TOLERANCE = 0.6, 0.05
"""Deflection to hold and how near, in deflections at break."""
HOLD_SECONDS = 3.0
SPARE_FORCE = 1.1
"""Limit of force over the largest that the hold needs."""
MARGIN = 0.15
STAY_SECONDS = 1.0
WORKING_SAFETY, LEAST_SAFETY = 2.0, 1.5
"""Strength over stress, the factor of safety, to work at and never to go below."""
BAND_PART = 0.08
"""Half of the working band, in deflections at its middle."""
SLACK_PART = 0.25
"""A duct that is led back, in deflections at the band's middle."""
LIFTS, LIFT_SECONDS = 3, 1.0
REACTION_SECONDS = 0.25
"""After which a hand answers to what its owner has seen (docs/measures.md, source 11)."""


def exercises_for(duct: GraspedDuct) -> tuple[Exercise, ...]:
    """Return the exercises for a duct."""
    event = duct.breaks_at
    working, most = (duct.loaded_to(1.0 / each) for each in (WORKING_SAFETY, LEAST_SAFETY))
    if event is None or working is None or most is None:
        return ()
    deflections, forces = duct.curve(60)
    band = (HOLD_PART + HOLD_TOLERANCE) * event.deflection
    needed = float(np.interp(band, deflections, forces))
    middle = working.deflection
    high = (1.0 + BAND_PART) * middle
    return (
        HoldStretch(
            deflection_mm=HOLD_PART * event.deflection,
            tolerance_mm=HOLD_TOLERANCE * event.deflection,
            seconds=HOLD_SECONDS,
            force_limit_N=SPARE_FORCE * needed,
        ),
        ApproachBreak(margin=MARGIN, seconds=STAY_SECONDS),
        GentleDissection(
            low_mm=(1.0 - BAND_PART) * middle,
            high_mm=high,
            slack_mm=SLACK_PART * middle,
            seconds=LIFT_SECONDS,
            lifts=LIFTS,
            force_limit_N=most.force,
            mean_force_limit_N=working.force,
            # From the largest force that is allowed it would reach the break in a reaction time.
            loading_rate_limit_N_per_s=(event.force - most.force) / REACTION_SECONDS,
            overshoot_limit=(most.deflection - high) / middle,
            reserve_limit=1.0 - 1.0 / LEAST_SAFETY,
        ),
    )


def goal_band(exercise: Exercise, duct: GraspedDuct) -> tuple[float, float] | None:
    """Return the deflections between which an exercise's goal lies."""
    event = duct.breaks_at
    if not isinstance(exercise, ApproachBreak) or event is None:
        return exercise.band
    near = duct.loaded_to(1.0 - exercise.margin)
    return None if near is None else (near.deflection, event.deflection)
