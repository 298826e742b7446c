"""Edges in mm where they stand in space, and the two half-curves a boundary fitted to each."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from organ_geometry.contours.contour import SectionContour
from organ_geometry.contours.trace_options import FoundPolarity
from organ_geometry.contours.traced_organ import TracedOrgan, TracedSection
from organ_geometry.curves.half_curves import HalfCurves, NotSingleValued, fit_half_curves
from organ_geometry.images.image_stack import ImageStack


@dataclass(frozen=True, slots=True, eq=False)
class FittedSection:
    """The edge of one section in mm, and its half-curves."""

    index: int  # Number of the section in the stack
    centroid: NDArray[np.float64]  # (3,) centroid of the outer boundary in space, mm
    area: float  # Area within the outer boundary, mm^2
    outer: NDArray[np.float64]  # (N, 2) edge points from the centroid, mm
    # (M, 2) edge points of the lumen from the same centroid, mm, or None.
    lumen: NDArray[np.float64] | None
    curves: HalfCurves  # Half-curves of the outer boundary
    lumen_curves: HalfCurves | None  # Half-curves of the lumen, or None
    other_component: bool  # Whether the image shows another part that stands out as clearly
    # Whether the edge is carried on from the image before, because no grey level closes it.
    carried: bool


@dataclass(frozen=True, slots=True, eq=False)
class FittedOrgan:
    """An organ's edges with half-curves fitted to them, before anything is left out.

    Attributes
    ----------
    stack
        The images.
    sections
        The sections that half-curves can follow, in order.
    contours
        Their edges in space.
    problems
        For each other image, why it has none.
    polarity
        Whether the organ is brighter or darker than its surroundings.
    notes
        How it was found, one sentence each.
    """

    stack: ImageStack
    sections: tuple[FittedSection, ...]
    contours: tuple[SectionContour, ...]
    problems: dict[int, str]
    polarity: FoundPolarity
    notes: tuple[str, ...]

    @property
    def hollow(self) -> bool:
        """Whether every section has a lumen."""
        return all(section.lumen is not None for section in self.sections)

    @property
    def mean_radius(self) -> float:
        """Mean radius of the circles of the sections' areas, mm."""
        return float(np.mean([math.sqrt(section.area / math.pi) for section in self.sections]))


def fit_organ(stack: ImageStack, traced: TracedOrgan) -> FittedOrgan:
    """Return traced edges with half-curves fitted to each section."""
    sections: list[FittedSection] = []
    problems = dict(traced.problems)
    for section in traced.sections:
        try:
            sections.append(_fitted(stack, section))
        except NotSingleValued as error:
            problems[section.index] = str(error)
    if len(sections) < 2:
        first = min(problems, default=None)
        reason = "" if first is None else f"; {stack.names[first]}: {problems[first]}"
        raise ValueError(
            f"{stack.source} shows an organ in {len(sections)} of {len(stack)} images and two or "
            f"more are needed{reason}"
        )
    return FittedOrgan(
        stack=stack,
        sections=tuple(sections),
        contours=tuple(_contour(stack, section) for section in sections),
        problems=problems,
        polarity=traced.polarity,
        notes=traced.notes,
    )


def _fitted(stack: ImageStack, edges: TracedSection) -> FittedSection:
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
        other_component=edges.other_component,
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


def _contour(stack: ImageStack, section: FittedSection) -> SectionContour:
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
