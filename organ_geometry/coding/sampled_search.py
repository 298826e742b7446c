"""The search for the fewest bytes of a long stack: by some of its sections, kept to by all."""

import numpy as np
from numpy.typing import NDArray

from organ_geometry.coding.edge_changes import EdgePoints
from organ_geometry.coding.encoder_search import EncoderSearch, NotKept
from organ_geometry.coding.organ_attempts import KeptCode, OrganAttempts
from organ_geometry.coding.organ_code import signal_steps
from organ_geometry.coding.section_encoder import CodedSections
from organ_geometry.coding.slice_descent import Aim, fewer_bits

MANY_SECTIONS = 96
"""Stacks of fewer sections are searched by all of them."""
SAMPLE = 48
"""About how many sections a long stack is searched by."""

_ROUNDS = 12
_EVERYWHERE, _BEYOND, _MOST_BEYOND = 0.3, 300.0, 5000.0
_MARGIN, _LEAST_MARGIN = 0.96, 0.6
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

    def in_few_bytes(self) -> KeptCode | None:
        """Return numbers of few bytes that keep the tolerance in every section.

        Returns
        -------
        KeptCode or None
            The numbers, measured by all edge points of all sections; None if none were found.
        """
        attempts = self._attempts
        count = len(attempts.contours)
        pieces = -(-(count - 1) // max(1, round((count - 1) / SAMPLE)))
        sample = np.linspace(0, count - 1, pieces + 1).round().astype(np.intp)
        try:
            found = EncoderSearch(attempts.of_some(sample)).in_fewest_bytes()
        except NotKept:
            return None
        held = self._held(found, sample)
        if held is None or attempts.thin(held).size or attempts.strays(held):
            return None
        return held

    def _held(self, found: KeptCode, sample: NDArray[np.intp]) -> KeptCode | None:
        """Return numbers like those found by a sample that keep all sections, if there are any."""
        attempts = self._attempts
        held = attempts.of_all(found)
        if held is None or held.worst <= 1.0:
            return held
        limits, cut = attempts.limits, held.cut
        points = EdgePoints.of(cut)
        beyond, margin = _BEYOND, _MARGIN
        joined = np.zeros(len(limits), dtype=np.bool_)
        joined[sample] = True
        for _ in range(_ROUNDS):
            joined |= held.rms > _NEAR * limits
            slices = np.flatnonzero(joined)
            code = held.code
            walls = [code.outer] if code.lumen is None else [code.outer, code.lumen]
            chosen, numbers = fewer_bits(
                points.of_slices(slices),
                code.keys,
                np.stack(walls),
                signal_steps(code.section_step),
                limits[slices],
                held.rms[slices],
                Aim(_EVERYWHERE, beyond, margin),
            )
            sections = CodedSections(chosen, numbers[0], numbers[1] if len(numbers) > 1 else None)
            again = attempts.measured(code.axis_scale, code, cut, code.section_scale, sections)
            if again is None or again.worst <= 1.0:
                return again
            held = again
            excess = float((held.rms / limits).max())
            if excess < 1.1:
                margin = max(margin - (excess**2 - 1.0), _LEAST_MARGIN)
            beyond = min(2.0 * beyond, _MOST_BEYOND)
        return None
