"""From section contours to the organ in fewest bytes that keeps every section to a tolerance.

docs/encoder.md explains the method and its symbols.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from organ_geometry.contours.contour import SectionContour
from organ_geometry.encoder.candidate import CandidateEncoder
from organ_geometry.encoder.search import SampledSearch, Search, ToleranceNotMet
from organ_geometry.encoder.section_encoder import Outlines
from organ_geometry.encoder.settings import SETTINGS, Effort, EncoderSettings
from organ_geometry.organ import Organ
from organ_geometry.organ_file import organ_from_bytes

Selection: TypeAlias = Literal["fewest", "thesis"]


class ToleranceTooSmall(ValueError):  # noqa: N818
    """A tolerance smaller than half-curves and pixels allow.

    Attributes
    ----------
    smallest_mm
        A tolerance near the smallest that was kept, mm.
    """

    def __init__(self, message: str, smallest_mm: float) -> None:
        super().__init__(message)
        self.smallest_mm = smallest_mm


@dataclass(frozen=True, slots=True, eq=False)
class EncodedOrgan:
    """An organ, decoded from its file's content, with its sections' places."""

    organ: Organ  # Carries the content of its file
    places: NDArray[np.float64]  # (S,) place of each section along it, from 0 to 1
    outlines: Outlines  # The contours cut at equal distances along it


def encoded_organ(
    contours: Sequence[SectionContour],
    tolerance: float,
    *,
    overall: float | None = None,
    hollow: bool = False,
    left_handed: bool = False,
    select: Selection = "fewest",
    effort: Effort = "quick",
    settings: EncoderSettings | None = None,
    units: str = "mm",
    name: str = "",
) -> EncodedOrgan:
    """Return the organ that keeps every section to a tolerance in few bytes.

    Parameters
    ----------
    contours
        Two or more sections in order.
    tolerance, overall
        Largest RMS distance of a section's edge points to the organ, mm, and of those of all
        sections together, if that is promised too.
    hollow
        Whether all sections have a lumen that counts.
    left_handed
        Whether right, down and along the stack are left-handed in the images.
    select
        The fewest key sections that keep the promise, or those of the thesis's rule.
    effort, settings
        How widely the search goes; settings, if given, instead of the effort's own.
    units, name
        What the lengths are called, and the organ.

    Returns
    -------
    EncodedOrgan
        The organ.

    Raises
    ------
    ToleranceTooSmall
        If the promise cannot be kept, with one that can.
    ValueError
        If there are fewer than two sections, or they make no organ.
    """
    if len(contours) < 2:
        raise ValueError(f"an organ needs two or more sections, not {len(contours)}")
    chosen = SETTINGS[effort] if settings is None else settings

    def candidates(limit: float, together: float | None) -> CandidateEncoder:
        return CandidateEncoder(
            contours, limit, together, chosen, hollow=hollow, left_handed=left_handed, units=units
        )

    own = candidates(tolerance, overall)
    # A sample of the sections says nothing of all of them together, and full effort spares nothing.
    sampled = (
        effort == "quick"
        and (overall is None or overall >= tolerance)
        and len(contours) >= chosen.many_sections
    )
    try:
        if select == "thesis":
            kept = Search(own).by_the_thesis()
        elif sampled:
            kept = SampledSearch(own).fewest_bytes()
        else:
            kept = Search(own).fewest_bytes()
    except ToleranceNotMet as error:
        missed = error
        # Every section by itself is kept then: it is the promise of all together that is not.
        if missed.nearest_mm <= tolerance:
            raise ToleranceTooSmall(
                f"{overall:.4g} mm over all sections cannot be kept by two degree-6 curves a "
                f"boundary: {missed.overall_mm:.4g} mm can",
                missed.overall_mm,
            ) from None

        # Without the promise of all together: what is named is what that section needs. Trials take
        # the axis's levels, its depth and the turn that came nearest; others would take as long
        # again each.
        def keeps(limit: float) -> bool:
            try:
                Search(candidates(limit, None)).nearest(missed.setting)
            except ToleranceNotMet:
                return False
            return True

        smallest = smallest_kept(keeps, tolerance, missed.nearest_mm)
        raise ToleranceTooSmall(
            f"a tolerance of {tolerance:.4g} mm cannot be kept by two degree-6 curves a "
            f"boundary: section {missed.section} needs {smallest:.4g} mm",
            smallest,
        ) from None
    # As any reader decodes it, so that what is reported is measured on the file's own content.
    organ = organ_from_bytes(kept.data, name)
    return EncodedOrgan(organ, kept.sampling.places, kept.sampling.outlines)


def smallest_kept(keeps: Callable[[float], bool], refused: float, nearest: float) -> float:
    """Return a tolerance that can be kept, near the smallest, in four digits, by bisection."""
    # What came out nearest is kept or nearly: upwards from it in growing steps of 5 % first.
    largest, more = _four_digits(nearest), 1.05
    while not keeps(largest):
        refused, largest = largest, _four_digits(largest * more)
        more **= 1.5
    # Each trial takes a second: what is named may be 4 % above the smallest.
    for _ in range(5):
        if largest <= refused * 1.04:
            break
        middle = _four_digits(math.sqrt(max(refused, 0.5 * largest) * largest))
        if keeps(middle):
            largest = middle
        else:
            refused = middle
    return largest


def _four_digits(length: float) -> float:
    """Return a length rounded up to four digits, as a message prints it."""
    # Up: rounded down, what a message names could be refused itself.
    digit = 10.0 ** (math.floor(math.log10(length)) - 3)
    return float(f"{math.ceil(length / digit) * digit:.4g}")
