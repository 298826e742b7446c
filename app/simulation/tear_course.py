"""The course of a tear in time: the front runs across the section, then the pieces recoil.

A pull that has reached the threshold does not let go while the section weakens, so the tear runs
through; how fast, and how the pieces swing back, is drawn, not computed.
"""

import math

__all__ = ["RUN_SECONDS", "SETTLED_SECONDS", "front", "swing"]

RUN_SECONDS = 0.6
"""Time in which the front crosses the section."""
SPRING_SECONDS = 0.3
"""Time in which the free rims draw back."""
SETTLED_SECONDS = RUN_SECONDS + 2.2
"""Time after which nothing moves any more."""
FADE_SECONDS = 0.35
"""Time in which the swing falls to 1/e."""
SWINGS_PER_SECOND = 2.0


def front(elapsed: float) -> float:
    """Return how far the tear has run.

    Parameters
    ----------
    elapsed
        Time since it started, s.

    Returns
    -------
    float
        0 at the start, 1 when it has crossed the section, 2 when the rims are drawn back.

    Examples
    --------
    >>> front(0.0), front(RUN_SECONDS), front(SETTLED_SECONDS)
    (0.0, 1.0, 2.0)
    """
    if elapsed < RUN_SECONDS:
        return (max(elapsed, 0.0) / RUN_SECONDS) ** 2  # ever less of the section bears the pull
    free = min((elapsed - RUN_SECONDS) / SPRING_SECONDS, 1.0)
    return 1.0 + free * (2.0 - free)


def swing(elapsed: float) -> float:
    """Return the part of the pull's displacement that a piece still has.

    Parameters
    ----------
    elapsed
        Time since the tear started, s.

    Returns
    -------
    float
        1 until the section is crossed, then a damped swing about 0, in the end 0.

    Examples
    --------
    >>> swing(RUN_SECONDS), swing(SETTLED_SECONDS)
    (1.0, 0.0)
    """
    if elapsed >= SETTLED_SECONDS:
        return 0.0
    free = max(0.0, elapsed - RUN_SECONDS)
    return math.exp(-free / FADE_SECONDS) * math.cos(2.0 * math.pi * SWINGS_PER_SECOND * free)
