"""One section's edge in mm, and the two half-curves a boundary that are fitted to it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from organ_geometry.contours.contour import SectionContour
from organ_geometry.contours.traced_organ import TracedSection
from organ_geometry.curves.half_curves import HalfCurves, NotSingleValued, fit_half_curves
from organ_geometry.images.image_stack import ImageStack


@dataclass(frozen=True, slots=True, eq=False)
class FittedSection:
    """The edge of one section in mm, and its half-curves.

    Attributes
    ----------
    index
        Number of the section in the stack.
    centroid
        (3,) centroid of the outer boundary in space, mm.
    area
        Area within the outer boundary, mm^2.
    outer
        (N, 2) edge points from the centroid, mm.
    lumen
        (M, 2) edge points of the lumen from the same centroid, mm, or None.
    curves
        Half-curves of the outer boundary.
    lumen_curves
        Half-curves of the lumen, or None.
    other_part
        Whether the image shows another part that stands out as clearly.
    carried
        Whether the edge is carried on from the image before, because no grey level closes it.
    """

    index: int
    centroid: NDArray[np.float64]
    area: float
    outer: NDArray[np.float64]
    lumen: NDArray[np.float64] | None
    curves: HalfCurves
    lumen_curves: HalfCurves | None
    other_part: bool
    carried: bool


def fitted_section(stack: ImageStack, edges: TracedSection) -> FittedSection:
    """Return one section's edge and half-curves."""
    index = edges.index
    rows, columns = stack.shape
    image_middle = 0.5 * np.array([columns - 1.0, rows - 1.0])
    outer = (edges.outer - image_middle) * stack.pixel_size
    area, middle = _area_and_centroid(outer)
    lumen = None
    if edges.lumen is not None:
        lumen = (edges.lumen - image_middle) * stack.pixel_size - middle
    outer = outer - middle
    return FittedSection(
        index=index,
        centroid=stack.origins[index] + stack.frames[index][:, :2] @ middle,
        area=area,
        outer=outer,
        lumen=lumen,
        curves=fit_half_curves(outer),
        lumen_curves=None if lumen is None else _lumen_curves(lumen),
        other_part=edges.other_part,
        carried=edges.carried,
    )


def _lumen_curves(lumen: NDArray[np.float64]) -> HalfCurves:
    try:
        return fit_half_curves(lumen)
    except NotSingleValued as error:
        raise NotSingleValued(f"in the lumen, {error}") from error


def _area_and_centroid(points: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
    """Return the area, mm^2, and the (2,) centroid, mm, within a closed boundary."""
    start = points.mean(axis=0)
    here = points - start
    after = np.roll(here, -1, axis=0)
    cross = here[:, 0] * after[:, 1] - here[:, 1] * after[:, 0]
    twice = float(cross.sum())
    return abs(0.5 * twice), start + cross @ (here + after) / (3.0 * twice)


def section_contour(stack: ImageStack, section: FittedSection) -> SectionContour:
    """Return a section's edge where it stands in space."""
    frame = stack.frames[section.index]

    def placed(points: NDArray[np.float64]) -> NDArray[np.float64]:
        return section.centroid + points @ frame[:, :2].T

    return SectionContour(
        index=section.index,
        outer=placed(section.outer),
        lumen=None if section.lumen is None else placed(section.lumen),
        normal=frame[:, 2],
        x_dir=frame[:, 0],
    )
