"""Warnings about a doubtful result.

An organ is *doubtful*, probably another one or only a part of the one wanted, where one of these
holds:

- The largest distance between an edge and the organ exceeds the mean radius, or in more than a
  fifth of the sections half of it.
- It was found in fewer than half of the images, or ran out of the picture in more than a tenth.
- Its axis is over 1.5 times as long as the stack: what was found jumps from section to section.
- Without a seed, more than half of the sections show something else of its kind beside it.
- In more than half of the sections no grey level parts it from what is beside it.
- In more than a fifth of the images between its first and its last nothing was found; of sections
  across its own centreline, of all.
- Neighbouring sections differ more than any two: the images are out of order.
- The images say so (`ImageStack.doubts`): some are missing, a label is in parts.

Of real organs in masks, and of the shipped phantom, the largest error is at most 0.32 of the radius
and none of these holds. Of a thorax's CT without a seed the heart is outlined: 1.7 radii.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from organ_geometry.contours.edges import BORDER_PROBLEM
from organ_geometry.contours.found_section import OTHER_COMPONENT
from organ_geometry.contours.traced_organ import slice_ranges
from organ_geometry.curves.fitted_organ import FittedOrgan
from organ_geometry.organ import Organ
from organ_geometry.reslice.resliced_stack import ReslicedSlices
from organ_geometry.section_report import SectionReport

# An axis so many times longer than the stack, and errors of this share of the mean radius.
LONG_AXIS = 1.5
FAR_FRACTION = 0.5
# Sections whose error is at least this share of the largest are named where a tolerance was raised.
HARDEST_FRACTION = 0.95
# What makes an organ doubtful: errors in mean radii, and shares of the images or sections.
DOUBTFUL_ERROR = 1.0
DOUBTFUL_FAR = 0.2
DOUBTFUL_FOUND = 0.5
DOUBTFUL_BORDER = 0.1
DOUBTFUL_BESIDE = 0.5
DOUBTFUL_CARRIED = 0.5
DOUBTFUL_LOST = 0.2
# Sections are out of order where the mean square step from one to the next is so large, of the mean
# square distance of any two, and in RMS so large, of the mean radius. Fewer sections say nothing.
SHUFFLED_STEP, SHUFFLED_RADII, SHUFFLED_FEWEST = 0.6, 0.01, 10


@dataclass(frozen=True, slots=True)
class OrganWarning:
    """A warning to an organ's user."""

    text: str  # A sentence without its full stop
    doubtful: bool = False  # Whether the organ is probably another than the one wanted


def organ_warnings(
    fitted: FittedOrgan,
    organ: Organ,
    sections: tuple[SectionReport, ...],
    wanted_mm: float,
) -> Iterator[OrganWarning]:
    """Yield the warnings to the organ's user."""
    stack, radius, found = fitted.stack, organ.mean_radius, len(fitted.sections)
    for doubt in stack.doubts:
        yield OrganWarning(doubt, True)
    if not isinstance(stack.slices, ReslicedSlices) and _neighbour_step(fitted) > SHUFFLED_STEP:
        yield OrganWarning(
            "neighbouring images differ as much as any two do: they seem to be out of order", True
        )
    far = [one.index for one in sections if one.max_mm > FAR_FRACTION * radius]
    if far:
        worst = max(sections[index].max_mm for index in far)
        yield OrganWarning(
            f"the organ is up to {worst:.3g} mm from its edge, {worst / radius:.2g} times its mean "
            f"radius, in {slice_ranges(far)}: sections there are not single-valued, differ from "
            f"those beside them, or lie in a bend about as tight as the organ is wide",
            worst > DOUBTFUL_ERROR * radius or len(far) > DOUBTFUL_FAR * found,
        )
    if found < DOUBTFUL_FOUND * len(sections):
        yield OrganWarning(f"the organ was found in only {found} of {len(sections)} images", True)
    first, last = fitted.sections[0].index, fitted.sections[-1].index
    if isinstance(stack.slices, ReslicedSlices):
        first, last = 0, len(sections) - 1
    lost = [one.index for one in sections[first : last + 1] if one.problem is not None]
    if len(lost) > DOUBTFUL_LOST * (last - first + 1) and found >= DOUBTFUL_FOUND * len(sections):
        yield OrganWarning(
            f"nothing was found in {len(lost)} of {last - first + 1} sections of the organ: "
            f"{slice_ranges(lost)}",
            True,
        )
    border = [one.index for one in sections if one.problem == BORDER_PROBLEM]
    if len(border) > DOUBTFUL_BORDER * len(sections):
        yield OrganWarning(
            f"what was followed runs out of the picture in {slice_ranges(border)}", True
        )
    carried = [section.index for section in fitted.sections if section.carried]
    if carried:
        yield OrganWarning(
            f"no grey level parts the organ from what is beside it in {slice_ranges(carried)}: the "
            f"edge there is carried on from the image before, and should be looked at",
            len(carried) > DOUBTFUL_CARRIED * found,
        )
    lumens = sum(section.lumen is not None for section in fitted.sections)
    if lumens and not organ.hollow:
        yield OrganWarning(
            f"a lumen was found in {lumens} of {found} sections and is therefore ignored: "
            f"the organ is taken as solid"
        )
    beside = sum(section.other_component for section in fitted.sections)
    if beside:
        yield OrganWarning(
            f"{beside} of {found} sections show another part of at least {OTHER_COMPONENT:.0%} of "
            f"the organ's area beside it, which was left out",
            beside > DOUBTFUL_BESIDE * found,
        )
    if organ.tolerance_mm > wanted_mm:
        limit = HARDEST_FRACTION * max(one.rms_mm for one in sections if one.problem is None)
        hardest = [one.index for one in sections if one.rms_mm >= limit]
        yield OrganWarning(
            f"the tolerance was raised from {wanted_mm:.3g} to {organ.tolerance_mm:.3g} mm, which "
            f"two degree-6 curves a boundary can keep at every section, with "
            f"{slice_ranges(hardest)} the furthest off: sections are not single-valued, or what "
            f"was found jumps from section to section"
        )
    planes = stack.origins[fitted.sections[0].index : fitted.sections[-1].index + 1]
    path = float(np.linalg.norm(np.diff(planes, axis=0), axis=1).sum())
    if organ.length > LONG_AXIS * path:
        yield OrganWarning(
            f"the axis is {organ.length:.1f} mm long and the stack only {path:.1f} mm: what was "
            f"found jumps from section to section, or runs along the sections",
            True,
        )
    if stack.units != "mm":
        yield OrganWarning(
            f"the images' lengths are {stack.units}, not mm: one unit is taken as 1 mm"
        )


def _neighbour_step(fitted: FittedOrgan) -> float:
    """Return the mean square step from section to section, of that between any two of them."""
    # 1 for sections in any order, near 0 for a smooth organ (J. von Neumann, Annals of
    # Mathematical Statistics 12, 1941, 367); 0 where steps are small beside the radius.
    stack, sections = fitted.stack, fitted.sections
    if len(sections) < SHUFFLED_FEWEST:
        return 0.0
    # Where each section is in its image, and how large and wide.
    rows = np.array(
        [
            [
                *(section.centroid - stack.origins[section.index])
                @ stack.frames[section.index][:, :2],
                math.sqrt(section.area / math.pi),
                *section.outer.std(axis=0),
            ]
            for section in sections
        ]
    )
    step = float((np.diff(rows, axis=0) ** 2).mean())
    if math.sqrt(step) < SHUFFLED_RADII * fitted.mean_radius:
        return 0.0
    return step / (2.0 * float(rows.var(axis=0).mean()))
