"""From a stack of cross-section images to an organ, with a report of how well it fits."""

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from organ_geometry.edges import EdgeMethod, FoundPolarity, Polarity
from organ_geometry.found_section import OTHER_PART
from organ_geometry.half_curves import (
    HalfCurves,
    NotSingleValued,
    closed_outlines,
    fit_half_curves,
    polygon_distances,
)
from organ_geometry.image_stack import ImageStack
from organ_geometry.key_sections import check_tolerance, key_sections
from organ_geometry.organ import Organ
from organ_geometry.organ_file import stored_organ
from organ_geometry.organ_tracing import TracedSection, trace_organ

Progress = Callable[[int, int], None]

# Without a tolerance: this share of the mean radius, but not so little that the noise of single
# pixels makes every section a key section.
TOLERANCE_SHARE = 0.02
SMALLEST_TOLERANCE_PX = 0.5
_BACK_CORNERS = 128

# What a report warns of.
LARGE_ERROR = 2.0
LONG_AXIS = 1.5


@dataclass(frozen=True, slots=True)
class SectionReport:
    """What was found in one section, and how near the organ comes to it.

    Errors are distances of the edge points to a boundary: "fit" to the section's own half-curves,
    the others to the decompressed organ's outline there, that is after sections were left out and
    interpolated. The largest error is the larger of both ways, edge points to the outline and
    outline to the edge, so that no part of the organ is far from what the image shows. A lumen
    counts where the organ has one. Pixels are the geometric mean of the pixel's two sides.

    Attributes
    ----------
    index
        Number of the section in the stack, from 0.
    name
        Name of its image.
    edge_points
        Number of edge points found, the lumen's included.
    lumen
        Whether a lumen was found.
    problem
        Why nothing that can be used was found, or None.
    kept
        Whether it is a key section.
    fit_rms_px, fit_rms_mm
        RMS distance to its own half-curves; NaN if nothing was found.
    rms_px, rms_mm
        RMS distance to the organ; NaN if nothing was found.
    max_mm
        Largest distance between edge and organ, both ways; NaN if nothing was found.
    """

    index: int
    name: str
    edge_points: int
    lumen: bool
    problem: str | None
    kept: bool
    fit_rms_px: float
    fit_rms_mm: float
    rms_px: float
    rms_mm: float
    max_mm: float


@dataclass(frozen=True, slots=True, eq=False)
class BuiltOrgan:
    """An organ and how it came about.

    Attributes
    ----------
    organ
        The organ, already rounded to what its file keeps.
    sections
        One report for each image, in order.
    polarity
        Whether the organ is "bright" or "dark" in its images, as given or as decided.
    tolerance_mm
        RMS distance by which a section had to change to be kept, mm.
    seconds
        Time for reading the images and building the organ, s.
    warnings
        What may make the organ another than the one wanted, one sentence each.
    """

    organ: Organ
    sections: tuple[SectionReport, ...]
    polarity: FoundPolarity
    tolerance_mm: float
    seconds: float
    warnings: tuple[str, ...] = ()

    @property
    def sections_in(self) -> int:
        """Number of images."""
        return len(self.sections)

    @property
    def sections_found(self) -> int:
        """Number of images in which the organ was found."""
        return sum(section.problem is None for section in self.sections)

    @property
    def sections_kept(self) -> int:
        """Number of key sections."""
        return len(self.organ.keys)

    @property
    def rms_error_mm(self) -> float:
        """RMS distance of all edge points to the organ, mm."""
        return _pooled(self.sections, [section.rms_mm for section in self.sections])

    @property
    def rms_error_px(self) -> float:
        """RMS distance of all edge points to the organ, px."""
        return _pooled(self.sections, [section.rms_px for section in self.sections])

    @property
    def max_error_mm(self) -> float:
        """Largest distance between an edge and the organ, both ways, mm."""
        return max(section.max_mm for section in self.sections if section.problem is None)


def build_organ(
    stack: ImageStack,
    *,
    polarity: Polarity = "auto",
    threshold: float | None = None,
    method: EdgeMethod = "half-level",
    seed: tuple[float, float] | None = None,
    tolerance_mm: float | None = None,
    progress: Callable[[int, int], None] | None = None,
    name: str | None = None,
) -> BuiltOrgan:
    """Return the organ of a stack of images, and a report on every section.

    A section in which nothing continues the organ is left out, and so is one whose organ touches
    the image's border or is not single-valued; its neighbours keep their places. The organ is
    hollow if a lumen is found in every section that is found.

    Parameters
    ----------
    stack
        The images; they are read one at a time.
    polarity
        Whether the organ is brighter or darker than its background; "auto" decides once for the
        whole stack.
    threshold, method, seed
        What the edge is and where the organ begins, see `trace_organ`.
    tolerance_mm
        RMS distance by which a section must change to be kept, mm. Default: 2 % of the mean radius,
        but at least half a pixel.
    progress
        Called after each image with the number done and the number of images.
    name
        What the organ is called. Default: the name of the folder or file.

    Returns
    -------
    BuiltOrgan
        The organ, rounded to what its file keeps, and the report.

    Raises
    ------
    ValueError
        If the tolerance is negative or not finite, an image cannot be read, or fewer than two
        sections show an edge.
    """
    started = time.perf_counter()
    if tolerance_mm is not None:
        check_tolerance(tolerance_mm)
    edges = trace_organ(
        stack, polarity=polarity, threshold=threshold, method=method, seed=seed, progress=progress
    )
    traced: list[_Traced] = []
    problems = dict(edges.problems)
    for section in edges.sections:
        try:
            traced.append(_traced(stack, section))
        except NotSingleValued as error:
            problems[section.index] = str(error)
    if len(traced) < 2:
        first = min(problems, default=None)
        reason = "" if first is None else f"; {stack.names[first]}: {problems[first]}"
        raise ValueError(
            f"{stack.source} shows an organ in {len(traced)} of {len(stack)} images and two or "
            f"more are needed{reason}"
        )

    outer = np.array([section.curves.as_row() for section in traced])
    lumens = [section.lumen_curves for section in traced]
    hollow = [curves for curves in lumens if curves is not None]
    lumen = np.array([curves.as_row() for curves in hollow]) if len(hollow) == len(traced) else None
    suitable_mm = _suitable_tolerance(traced, stack)
    if tolerance_mm is None:
        tolerance_mm = suitable_mm
    axis = np.array([section.centroid for section in traced])
    stations = np.zeros(len(axis))
    np.cumsum(np.linalg.norm(np.diff(axis, axis=0), axis=1), out=stations[1:])
    keys = key_sections(outer, lumen, tolerance_mm, stations=stations)
    organ = stored_organ(
        Organ(
            axis=axis,
            frames=stack.frames[[section.index for section in traced]],
            keys=keys,
            outer=outer[keys],
            lumen=None if lumen is None else lumen[keys],
            units=stack.units,
            tolerance_mm=tolerance_mm,
            name=_stack_name(stack.source) if name is None else name,
        )
    )
    sections = _reports(stack, organ, traced, problems)
    return BuiltOrgan(
        organ=organ,
        sections=sections,
        polarity=edges.polarity,
        tolerance_mm=tolerance_mm,
        seconds=time.perf_counter() - started,
        warnings=tuple(_warnings(stack, organ, traced, sections, max(tolerance_mm, suitable_mm))),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Traced:
    """The edge of one section in mm, and its half-curves.

    Attributes
    ----------
    index
        Number of the section in the stack.
    centroid
        (3,) centroid of the outer boundary in space, mm: a point of the axis.
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
    """

    index: int
    centroid: NDArray[np.float64]
    area: float
    outer: NDArray[np.float64]
    lumen: NDArray[np.float64] | None
    curves: HalfCurves
    lumen_curves: HalfCurves | None
    other_part: bool


def _traced(stack: ImageStack, edges: TracedSection) -> _Traced:
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
    return _Traced(
        index=index,
        centroid=stack.origins[index] + stack.frames[index][:, :2] @ middle,
        area=area,
        outer=outer,
        lumen=lumen,
        curves=fit_half_curves(outer),
        lumen_curves=None if lumen is None else _lumen_curves(lumen),
        other_part=edges.other_part,
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


def _suitable_tolerance(traced: list[_Traced], stack: ImageStack) -> float:
    """Return the tolerance, mm, that is used when none is given."""
    mean_radius = float(np.mean([math.sqrt(section.area / math.pi) for section in traced]))
    return max(TOLERANCE_SHARE * mean_radius, SMALLEST_TOLERANCE_PX * _mean_pixel(stack))


def _mean_pixel(stack: ImageStack) -> float:
    """Return the geometric mean of a pixel's sides, mm."""
    return math.sqrt(float(stack.pixel_size.prod()))


def _stack_name(source: Path) -> str:
    return source.stem if source.is_file() else source.resolve().name


def _reports(
    stack: ImageStack, organ: Organ, traced: list[_Traced], problems: dict[int, str]
) -> tuple[SectionReport, ...]:
    """Return one report for each image, measured on the organ as its file keeps it."""
    pixel = _mean_pixel(stack)
    stations = organ.stations
    outer = organ.rows_at(stations)
    lumen = organ.rows_at(stations, "lumen") if organ.hollow else None
    kept = set(organ.keys.tolist())
    reports = {
        index: SectionReport(
            index=index,
            name=stack.names[index],
            edge_points=0,
            lumen=False,
            problem=problem,
            kept=False,
            fit_rms_px=math.nan,
            fit_rms_mm=math.nan,
            rms_px=math.nan,
            rms_mm=math.nan,
            max_mm=math.nan,
        )
        for index, problem in problems.items()
    }
    for place, section in enumerate(traced):
        # The stored axis point is rounded, which moves the whole outline a little.
        shift = (section.centroid - organ.axis[place]) @ organ.frames[place][:, :2]
        own = [section.curves.distances(section.outer)]
        away = [HalfCurves.from_row(outer[place]).distances(section.outer + shift)]
        back = [_back_distance(outer[place], section.outer + shift)]
        if lumen is not None and section.lumen is not None and section.lumen_curves is not None:
            own.append(section.lumen_curves.distances(section.lumen))
            away.append(HalfCurves.from_row(lumen[place]).distances(section.lumen + shift))
            back.append(_back_distance(lumen[place], section.lumen + shift))
        fit_rms = _root_mean_square(np.concatenate(own))
        distances = np.concatenate(away)
        rms = _root_mean_square(distances)
        reports[section.index] = SectionReport(
            index=section.index,
            name=stack.names[section.index],
            edge_points=len(section.outer) + (0 if section.lumen is None else len(section.lumen)),
            lumen=section.lumen is not None,
            problem=None,
            kept=place in kept,
            fit_rms_px=fit_rms / pixel,
            fit_rms_mm=fit_rms,
            rms_px=rms / pixel,
            rms_mm=rms,
            max_mm=max(float(distances.max()), *back),
        )
    return tuple(reports[index] for index in range(len(stack)))


def _back_distance(row: NDArray[np.float64], edge: NDArray[np.float64]) -> float:
    """Return the largest distance, mm, of half-curves (16,) to the edge that they stand for."""
    corners = closed_outlines(row[np.newaxis], _BACK_CORNERS)[0]
    return float(polygon_distances(corners, edge).max())


def _warnings(
    stack: ImageStack,
    organ: Organ,
    traced: list[_Traced],
    sections: tuple[SectionReport, ...],
    tolerance_mm: float,
) -> Iterator[str]:
    """Yield what the organ's user should know, for the larger of given and suitable tolerance."""
    found = len(traced)
    lumens = sum(section.lumen is not None for section in traced)
    if lumens and not organ.hollow:
        yield (
            f"a lumen was found in {lumens} of {found} sections and is therefore ignored: "
            f"the organ is taken as solid"
        )
    beside = sum(section.other_part for section in traced)
    if beside:
        yield (
            f"{beside} of {found} sections show another part of at least {OTHER_PART:.0%} of the "
            f"organ's area beside it, which was left out"
        )
    rms = _pooled(sections, [section.rms_mm for section in sections])
    if rms > LARGE_ERROR * tolerance_mm:
        yield (
            f"the RMS error of {rms:.3g} mm is more than {LARGE_ERROR:g} times a tolerance of "
            f"{tolerance_mm:.3g} mm: the sections are not single-valued, or what was found "
            f"jumps from section to section"
        )
    planes = stack.origins[traced[0].index : traced[-1].index + 1]
    path = float(np.linalg.norm(np.diff(planes, axis=0), axis=1).sum())
    if organ.length > LONG_AXIS * path:
        yield (
            f"the axis is {organ.length:.1f} mm long and the stack only {path:.1f} mm: what was "
            f"found jumps from section to section, or runs along the sections"
        )
    if stack.units != "mm":
        yield f"the images' lengths are {stack.units}, not mm: one unit is taken as 1 mm"


def _pooled(sections: tuple[SectionReport, ...], values: list[float]) -> float:
    """Return the root mean square over all edge points of values that are one per section."""
    squares, points = 0.0, 0
    for section, value in zip(sections, values, strict=True):
        if section.problem is None:
            squares += section.edge_points * value**2
            points += section.edge_points
    return math.sqrt(squares / points)


def _root_mean_square(values: NDArray[np.float64]) -> float:
    return math.sqrt(float((values * values).mean()))
