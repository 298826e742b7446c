"""A pull that ends at a distance to break, and is then held while the tissue relaxes."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from physics.bed import BeamOnBed, Bed, Hand, History, Relaxation, SpaceBeam, pull
from physics.quantity import positive


def pull_and_hold(
    beam: SpaceBeam,
    bed: Bed | None,
    hand: Hand,
    *,
    until: float | None = None,
    step_seconds: float | None = None,
    hold_seconds: float | None = None,
    relaxing: tuple[Relaxation | None, Relaxation | None] = (None, None),
) -> History:
    """Pull a beam off a bed by one hand, then hold it.

    Parameters
    ----------
    beam, bed, hand
        As `pull` takes them; the hand's path is one straight leg where it is to end or be held.
    until
        Stress at which the pull ends, MPa; at the end of the path if None or not reached.
    step_seconds
        Time that a step takes, s; none if None.
    hold_seconds
        Time for which the hand then stays, s.
    relaxing
        How strands and wall relax meanwhile.

    Returns
    -------
    History
        The last of the steps that pull is that before the hold.

    Raises
    ------
    ValueError
        If a time is not above 0, or what is to be held has no time.
    NoEquilibrium
        As `pull` does.
    """
    seconds = 0.0 if step_seconds is None else positive(step_seconds, "the time of a step", "s")
    if hold_seconds is not None and step_seconds is None:
        raise ValueError("what is held for a time needs the time of a step")

    def pulled(hand: Hand, watch: Callable[[BeamOnBed], bool] | None = None) -> History:
        return pull(
            beam,
            bed,
            [hand],
            step_seconds=seconds,
            strand_relaxation=relaxing[0],
            wall_relaxation=relaxing[1],
            watch=watch,
        )

    if until is not None:
        history = pulled(hand, lambda held: held.worst_stress().total >= until)
        hand = _ending_at(hand, history, until)
    if hold_seconds is not None:
        waits = math.ceil(positive(hold_seconds, "the time of a hold", "s") / seconds)
        (end,), steps = hand.path, hand.steps
        assert isinstance(steps, int)  # noqa: S101 (of one leg)
        hand = replace(hand, path=(end, end), steps=(steps, waits))
    return pulled(hand)


def _ending_at(hand: Hand, history: History, stress: float) -> Hand:
    """Return a hand whose path ends where a pull along it comes to a stress."""
    assert history.stress is not None  # noqa: S101 (only a wall has stress to end at)
    steps, (end,) = hand.steps, hand.path
    assert isinstance(steps, int)  # noqa: S101 (of one leg)
    rows = np.concatenate([[0.0], history.stress])
    count = history.steps
    if rows[count] < stress:
        return hand
    # Between the steps before and after, in proportion to the stress.
    gone = count - (rows[count] - stress) / (rows[count] - rows[count - 1])
    x, y, z = (float(each) * gone / steps for each in end)
    return replace(hand, path=((x, y, z),), steps=count)
