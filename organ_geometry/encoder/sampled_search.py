"""The search for the fewest bytes of a long stack: by some of its sections, kept to by all."""

import numpy as np
from numpy.typing import NDArray

from organ_geometry.encoder.candidate import KeptCode, OrganAttempts
from organ_geometry.encoder.coordinate_descent import SliceDescent
from organ_geometry.encoder.jacobian import EdgePoints
from organ_geometry.encoder.penalties import EACH_SLICE, Aiming
from organ_geometry.encoder.search import EncoderSearch, NotKept
from organ_geometry.organ_file.organ_code import signal_steps

MANY_SECTIONS = 192
"""Stacks of fewer sections are searched by all of them."""
SAMPLE = 48
"""About how many sections a long stack is searched by first."""

# Twice by so many and those that joined, then by twice as many, until they are most of all, or
# enough for an axis of most keys.
_TRIES, _LARGEST_SHARE, _LARGEST_SAMPLE = 2, 0.5, 384
_ROUNDS = 6
# More rounds are of no use where one hardly gained.
_GAINS = 0.995
# Sections so near to their limit join those that are searched by.
_NEAR = 0.97


class SampledSearch:
    """Searches for a long organ's numbers by some of its sections.

    Sections of one organ are much alike. Numbers that keep every sixth to the tolerance keep nearly
    all of them; those that they do not keep join the search, until all are kept.

    Parameters
    ----------
    attempts
        Makes and measures numbers of all sections.
    """

    def __init__(self, attempts: OrganAttempts) -> None:
        self._attempts = attempts

    def in_few_bytes(self) -> KeptCode:
        """Return numbers of few bytes that keep the tolerance in every section."""
        whole = EncoderSearch(self._attempts)
        try:
            found = self._by_samples()
        except NotKept:
            # What some sections do not let be kept, all do not, and this is the quicker to say.
            whole.nearest()
            found = None
        except ValueError:
            found = None
        return whole.in_fewest_bytes() if found is None else found

    def _by_samples(self) -> KeptCode | None:
        """Return numbers found by samples that keep all sections, or None."""
        attempts = self._attempts
        count = len(attempts.contours)
        joined = np.zeros(count, dtype=np.bool_)
        size, tries = SAMPLE, _TRIES
        while True:
            joined[_spread(count, size)] = True
            sample = attempts.of_some(np.flatnonzero(joined))
            larger = size < _LARGEST_SAMPLE and 2 * size <= _LARGEST_SHARE * count
            tries -= 1
            try:
                found = EncoderSearch(sample).in_fewest_bytes("sample")
            except NotKept:
                # The axis of so few sections may not have keys enough.
                if not larger:
                    raise
                size, tries = 2 * size, _TRIES
                continue
            held = self._held(found, joined)
            if held is not None:
                return None if attempts.thin(held).size or attempts.strays(held) else held
            if tries == 0:
                if not larger:
                    return None
                size, tries = 2 * size, _TRIES

    def _held(self, found: KeptCode, joined: NDArray[np.bool_]) -> KeptCode | None:
        """Return numbers like those found that keep all sections, which join where they do not."""
        attempts, limits = self._attempts, self._attempts.limits
        held = attempts.of_all(found)
        if held is None or held.worst <= 1.0:
            return held
        points, code = EdgePoints.of(held.cut), found.code
        aiming = Aiming(EACH_SLICE)
        worst = np.inf
        for _ in range(_ROUNDS):
            if held.worst > _GAINS * worst:
                break
            worst = held.worst
            joined[_worst_of_runs(held.rms / limits)] = True
            slices = np.flatnonzero(joined)
            descent = SliceDescent(
                points.of_slices(slices), held.numbers, signal_steps(code.section_step),
                limits[slices], held.rms[slices], aiming.aim, free_axis=False,
            )  # fmt: skip
            again = attempts.measured(held.cut, code.section_scale, descent.lowered().sections)
            if again is None or again.worst <= 1.0:
                return again
            held = again
            aiming.learn(float((held.rms / limits).max()), 1.0)
        return None


def _spread(count: int, size: int) -> NDArray[np.intp]:
    """Return about so many numbers of sections at equal distances, the first and last included."""
    pieces = -(-(count - 1) // max(1, round((count - 1) / size)))
    return np.linspace(0, count - 1, pieces + 1).round().astype(np.intp)


def _worst_of_runs(excess: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the worst of each run of sections that are beyond their limits, or nearly."""
    beyond = np.flatnonzero(excess > _NEAR)
    runs = np.split(beyond, np.flatnonzero(np.diff(beyond) > 1) + 1)
    return np.array([run[excess[run].argmax()] for run in runs if len(run)], dtype=np.intp)
