"""When a trainee sees the figures of an exercise."""

from enum import StrEnum

__all__ = ["Feedback", "feedback_visible"]

FADE_SECONDS = 30.0
"""Time after which fading feedback is gone."""
FADE_PERIOD = 3.0
"""Fading feedback comes once in so many seconds, for ever less of them."""


class Feedback(StrEnum):
    """When a trainee sees the figures: continuous feedback can make dependent on it."""

    CONTINUOUS = "continuous"
    FADING = "fading"
    SUMMARY = "summary"


def feedback_visible(feedback: Feedback, seconds: float, *, over: bool) -> bool:
    """Return whether the figures are to be seen.

    Parameters
    ----------
    feedback
        The mode.
    seconds
        Time since the run has started, s.
    over
        Whether the run is over; then they always are.

    Returns
    -------
    bool
        Continuous: yes. Summary: not before the end. Fading: in each period of 3 s at first
        throughout, then for a part that falls evenly to none at 30 s.

    Examples
    --------
    >>> [feedback_visible(Feedback.FADING, t, over=False) for t in (0.0, 14.0, 15.1, 40.0)]
    [True, False, True, False]
    """
    if over or feedback is Feedback.CONTINUOUS:
        return True
    if feedback is Feedback.SUMMARY:
        return False
    start = seconds - seconds % FADE_PERIOD
    return seconds - start < FADE_PERIOD * max(0.0, 1.0 - start / FADE_SECONDS)
