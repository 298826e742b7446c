"""What may make an organ another than the one wanted."""

from collections.abc import Iterator

import numpy as np

from organ_geometry.contours.found_section import OTHER_PART
from organ_geometry.contours.slice_ranges import slice_ranges
from organ_geometry.curves.fitted_section import FittedSection
from organ_geometry.images.image_stack import ImageStack
from organ_geometry.organ import Organ
from organ_geometry.section_report import SectionReport

# An axis so many times longer than the stack, and errors of this share of the mean radius.
LONG_AXIS = 1.5
FAR_SHARE = 0.5
# Sections whose error is at least this share of the largest are named where a tolerance was raised.
HARDEST_SHARE = 0.95


def organ_warnings(
    stack: ImageStack,
    organ: Organ,
    fitted: list[FittedSection],
    sections: tuple[SectionReport, ...],
    wanted_mm: float,
) -> Iterator[str]:
    """Yield what the organ's user should know.

    Parameters
    ----------
    stack
        The images.
    organ
        The organ, as its file gives it.
    fitted
        The sections found.
    sections
        One report for each image.
    wanted_mm
        The tolerance that was wanted, mm.

    Yields
    ------
    str
        Sentences.
    """
    largest = FAR_SHARE * organ.mean_radius
    far = [one.index for one in sections if one.max_mm > largest]
    if far:
        worst = max(sections[index].max_mm for index in far)
        yield (
            f"the organ is up to {worst:.3g} mm from its edge in {slice_ranges(far)}: sections "
            f"there are not single-valued, differ from those beside them, or lie in a bend about "
            f"as tight as the organ is wide"
        )
    carried = [section.index for section in fitted if section.carried]
    if carried:
        yield (
            f"no grey level parts the organ from what is beside it in {slice_ranges(carried)}: the "
            f"edge there is carried on from the image before, and should be looked at"
        )
    found = len(fitted)
    lumens = sum(section.lumen is not None for section in fitted)
    if lumens and not organ.hollow:
        yield (
            f"a lumen was found in {lumens} of {found} sections and is therefore ignored: "
            f"the organ is taken as solid"
        )
    beside = sum(section.other_part for section in fitted)
    if beside:
        yield (
            f"{beside} of {found} sections show another part of at least {OTHER_PART:.0%} of the "
            f"organ's area beside it, which was left out"
        )
    if organ.tolerance_mm > wanted_mm:
        limit = HARDEST_SHARE * max(one.rms_mm for one in sections if one.problem is None)
        hardest = [one.index for one in sections if one.rms_mm >= limit]
        yield (
            f"the tolerance was raised from {wanted_mm:.3g} to {organ.tolerance_mm:.3g} mm, which "
            f"two degree-6 curves a boundary can keep at every section, with "
            f"{slice_ranges(hardest)} the furthest off: sections are not single-valued, or what "
            f"was found jumps from section to section"
        )
    planes = stack.origins[fitted[0].index : fitted[-1].index + 1]
    path = float(np.linalg.norm(np.diff(planes, axis=0), axis=1).sum())
    if organ.length > LONG_AXIS * path:
        yield (
            f"the axis is {organ.length:.1f} mm long and the stack only {path:.1f} mm: what was "
            f"found jumps from section to section, or runs along the sections"
        )
    if stack.units != "mm":
        yield f"the images' lengths are {stack.units}, not mm: one unit is taken as 1 mm"
