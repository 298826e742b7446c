"""From section contours to the organ in fewest bytes that keeps every section to a tolerance."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from organ_geometry.contours.contour import SectionContour
from organ_geometry.encoder.candidate import KeptCode, OrganAttempts
from organ_geometry.encoder.sampled_search import MANY_SECTIONS, SampledSearch
from organ_geometry.encoder.search import Effort, EncoderSearch, NotKept
from organ_geometry.encoder.section_encoder import Outlines
from organ_geometry.encoder.tolerance_floor import ToleranceTooSmall, smallest_kept
from organ_geometry.organ import Organ
from organ_geometry.organ_file import organ_from_bytes

Selection: TypeAlias = Literal["fewest", "thesis"]


@dataclass(frozen=True, slots=True, eq=False)
class EncodedOrgan:
    """An organ, decoded from its file's content, and where its sections are.

    Attributes
    ----------
    organ
        The organ; it carries the content of its file.
    places
        (S,) place of each section along it, from 0 to 1.
    outlines
        What the contours are at equal distances along it.
    """

    organ: Organ
    places: NDArray[np.float64]
    outlines: Outlines


def encoded_organ(
    contours: Sequence[SectionContour],
    tolerance: float,
    *,
    overall: float | None = None,
    hollow: bool = False,
    left_handed: bool = False,
    select: Selection = "fewest",
    effort: Effort = "quick",
    units: str = "mm",
    name: str = "",
) -> EncodedOrgan:
    """Return the organ that keeps every section to a tolerance in few bytes."""
    if len(contours) < 2:
        raise ValueError(f"an organ needs two or more sections, not {len(contours)}")

    def attempts(limit: float, whole: float | None) -> OrganAttempts:
        return OrganAttempts(
            contours, limit, whole, hollow=hollow, left_handed=left_handed, units=units
        )

    own = attempts(tolerance, overall)
    by_sections = overall is None or overall >= tolerance
    try:
        if select == "thesis":
            kept = EncoderSearch(own).by_the_thesis()
        elif effort == "quick" and by_sections and len(contours) >= MANY_SECTIONS:
            kept = SampledSearch(own).in_few_bytes()
        else:
            kept = EncoderSearch(own).in_fewest_bytes(effort)
    except NotKept as error:
        missed = error
        if missed.nearest_mm <= tolerance:
            raise ToleranceTooSmall(
                f"{overall:.4g} mm over all sections cannot be kept by two degree-6 curves a "
                f"boundary: {missed.overall_mm:.4g} mm can",
                missed.overall_mm,
            ) from None

        def can(limit: float) -> bool:
            try:
                EncoderSearch(attempts(limit, None)).nearest(missed.way)
            except NotKept:
                return False
            return True

        smallest = smallest_kept(can, tolerance, missed.nearest_mm)
        raise ToleranceTooSmall(
            f"a tolerance of {tolerance:.4g} mm cannot be kept by two degree-6 curves a "
            f"boundary: section {missed.section} needs {smallest:.4g} mm",
            smallest,
        ) from None
    return _decoded(kept, name)


def _decoded(kept: KeptCode, name: str) -> EncodedOrgan:
    organ = organ_from_bytes(kept.data, name)
    return EncodedOrgan(organ, kept.cut.places, kept.cut.outlines)
