"""From a stack of cross-section images to an organ, with a report of how well it fits."""

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from organ_geometry.contour import SectionContour
from organ_geometry.edges import EdgeMethod, FoundPolarity, Polarity
from organ_geometry.encoder_search import Effort
from organ_geometry.found_section import OTHER_PART
from organ_geometry.half_curves import (
    HalfCurves,
    NotSingleValued,
    closed_outlines,
    fit_half_curves,
    polygon_distances,
)
from organ_geometry.image_stack import ImageStack
from organ_geometry.key_sections import check_tolerance
from organ_geometry.organ import Organ
from organ_geometry.organ_encoder import (
    EncodedOrgan,
    Selection,
    encoded_organ,
)
from organ_geometry.organ_tracing import TracedSection, slice_ranges, trace_organ
from organ_geometry.surface_distance import root_mean_squares, section_distances
from organ_geometry.tolerance_floor import ToleranceTooSmall

Progress = Callable[[int, int], None]

# Without a tolerance: this share of the mean radius, but not so little that the noise of single
# pixels makes every section a key section.
TOLERANCE_SHARE = 0.02
SMALLEST_TOLERANCE_PX = 0.5
_BACK_CORNERS = 64
_RAISES = 3
# Near the smallest tolerance bytes climb steeply.
_RAISE = 1.1

# What a report warns of.
LONG_AXIS = 1.5
FAR_SHARE = 0.5


@dataclass(frozen=True, slots=True)
class SectionReport:
    """What was found in one section, and how near the organ comes to it.

    Errors are distances of the edge points to a boundary: "fit" to the section's own half-curves,
    the others to the organ that its file gives, that is after sections were left out and
    interpolated. The largest error is the larger of both ways, edge points to the organ and the
    organ to the edges, so that no part of the organ is far from what the images show. A lumen
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
        The organ, decoded from its file's content, which it carries.
    sections
        One report for each image, in order.
    polarity
        Whether the organ is "bright" or "dark" in its images, as given or as decided.
    tolerance_mm
        RMS distance to the organ that no section's edge points exceed, mm.
    seconds
        Time for reading the images and building the organ, s.
    warnings
        What may make the organ another than the one wanted, one sentence each.
    notes
        How it was found, one sentence each.
    contours
        The edges of the sections that were found, where they stand in space.
    """

    organ: Organ
    sections: tuple[SectionReport, ...]
    polarity: FoundPolarity
    tolerance_mm: float
    seconds: float
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    contours: tuple[SectionContour, ...] = ()

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
    tolerance_px: float | None = None,
    select: Selection = "fewest",
    effort: Effort = "quick",
    overall_mm: float | None = None,
    progress: Callable[[int, int], None] | None = None,
    name: str | None = None,
) -> BuiltOrgan:
    """Return the organ of a stack of images, and a report on every section.

    Every section's edge points keep to the tolerance, measured on the organ that its file gives.

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
        Largest RMS distance of a section's edge points to the organ, mm. Default: 2 % of the mean
        radius, but at least half a pixel, and more where the organ needs it, with a warning.
    tolerance_px
        The same in pixels, instead.
    select
        How key sections are chosen: "fewest" keeps as few bytes as it can, "thesis" compares each
        section with the last key section.
    effort
        "quick" tries a few ways to keep it in few bytes, "full" many.
    overall_mm
        Largest RMS distance of all edge points together, mm. Default: the tolerance.
    progress
        Called after each image with the number done and the number of images.
    name
        What the organ is called. Default: the name of the folder or file.

    Returns
    -------
    BuiltOrgan
        The organ, decoded from its file's content, and the report.

    Raises
    ------
    ToleranceTooSmall
        If the tolerance given cannot be kept; the smallest that can is named.
    ValueError
        If the tolerance is negative or not finite, or given twice, an image cannot be read, or
        fewer than two sections show an edge.
    """
    started = time.perf_counter()
    if tolerance_px is not None:
        if tolerance_mm is not None:
            raise ValueError("give the tolerance in mm or in px, not both")
        tolerance_mm = tolerance_px * stack.mean_pixel
    if tolerance_mm is not None:
        check_tolerance(tolerance_mm)
    if select not in ("fewest", "thesis"):
        raise ValueError(f"select must be fewest or thesis, not {select!r}")
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

    hollow = all(section.lumen is not None for section in traced)
    suitable_mm = _suitable_tolerance(traced, stack)
    wanted_mm = suitable_mm if tolerance_mm is None else tolerance_mm
    contours = [_contour(stack, section) for section in traced]

    def encoded(tolerance: float) -> EncodedOrgan:
        return encoded_organ(
            contours,
            tolerance,
            hollow=hollow,
            left_handed=float(np.linalg.det(stack.frames[0])) < 0.0,
            select=select,
            effort=effort,
            overall=overall_mm,
            units=stack.units,
            name=_stack_name(stack.source) if name is None else name,
        )

    found = _encoded(encoded, wanted_mm, strict=tolerance_mm is not None)
    sections = _reports(stack, found, contours, traced, problems)
    return BuiltOrgan(
        organ=found.organ,
        sections=sections,
        polarity=edges.polarity,
        tolerance_mm=found.organ.tolerance_mm,
        seconds=time.perf_counter() - started,
        warnings=tuple(_warnings(stack, found.organ, traced, sections, wanted_mm)),
        notes=edges.notes,
        contours=tuple(contours),
    )


def _encoded(
    encoded: Callable[[float], EncodedOrgan], tolerance: float, *, strict: bool
) -> EncodedOrgan:
    """Return the organ at a tolerance, or at the smallest that can be kept."""
    for _ in range(_RAISES):
        try:
            return encoded(tolerance)
        except ToleranceTooSmall as error:
            if strict:
                raise
            tolerance = _RAISE * error.smallest_mm
    return encoded(tolerance)


@dataclass(frozen=True, slots=True, eq=False)
class _Traced:
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
    return max(TOLERANCE_SHARE * mean_radius, SMALLEST_TOLERANCE_PX * stack.mean_pixel)


def _stack_name(source: Path) -> str:
    return source.stem if source.is_file() else source.resolve().name


def _contour(stack: ImageStack, section: _Traced) -> SectionContour:
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


def _reports(
    stack: ImageStack,
    encoded: EncodedOrgan,
    contours: list[SectionContour],
    traced: list[_Traced],
    problems: dict[int, str],
) -> tuple[SectionReport, ...]:
    """Return one report for each image, measured on the organ as its file gives it."""
    pixel = stack.mean_pixel
    away = section_distances(encoded.organ, contours, encoded.places)
    rms = root_mean_squares(away)
    back = _back_distances(encoded)
    kept = _kept(encoded)
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
        own = [section.curves.distances(section.outer)]
        if encoded.organ.hollow and section.lumen is not None and section.lumen_curves is not None:
            own.append(section.lumen_curves.distances(section.lumen))
        fit_rms = float(root_mean_squares([np.concatenate(own)])[0])
        reports[section.index] = SectionReport(
            index=section.index,
            name=stack.names[section.index],
            edge_points=len(section.outer) + (0 if section.lumen is None else len(section.lumen)),
            lumen=section.lumen is not None,
            problem=None,
            kept=place in kept,
            fit_rms_px=fit_rms / pixel,
            fit_rms_mm=fit_rms,
            rms_px=float(rms[place]) / pixel,
            rms_mm=float(rms[place]),
            max_mm=max(float(away[place].max()), float(back[place])),
        )
    return tuple(reports[index] for index in range(len(stack)))


def _kept(encoded: EncodedOrgan) -> set[int]:
    """Return which sections stand for the key sections: the nearest, each for one of them."""
    organ = encoded.organ
    kept: set[int] = set()
    for key in organ.key_stations / organ.length:
        nearest = np.argsort(np.abs(encoded.places - key), kind="stable")
        kept.add(next((int(place) for place in nearest if int(place) not in kept), 0))
    return kept


def _back_distances(encoded: EncodedOrgan) -> NDArray[np.float64]:
    """Return the (S,) largest distances, mm, of the organ's outlines to the edges' surface."""
    organ = encoded.organ
    count = len(encoded.outlines.outer)
    stations = np.linspace(0.0, organ.length, count)
    largest = np.zeros(count)
    walls = [(organ.rows_at(stations), encoded.outlines.outer)]
    if encoded.outlines.lumen is not None:
        walls.append((organ.rows_at(stations, "lumen"), encoded.outlines.lumen))
    for rows, edges in walls:
        corners = closed_outlines(rows, _BACK_CORNERS)
        for place in range(count):
            away = polygon_distances(corners[place], edges[place])
            largest[place] = max(largest[place], float(away.max()))
    return largest[np.round(encoded.places * (count - 1)).astype(np.intp)]


def _warnings(
    stack: ImageStack,
    organ: Organ,
    traced: list[_Traced],
    sections: tuple[SectionReport, ...],
    wanted_mm: float,
) -> Iterator[str]:
    """Yield what the organ's user should know."""
    far = [one.index for one in sections if one.max_mm > FAR_SHARE * organ.mean_radius]
    if far:
        yield (
            f"the organ is more than {FAR_SHARE:g} of its mean radius from its edge near "
            f"{slice_ranges(far)}: sections cross there, or are not single-valued"
        )
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
    if organ.tolerance_mm > wanted_mm:
        yield (
            f"the tolerance was raised from {wanted_mm:.3g} to {organ.tolerance_mm:.3g} mm, which "
            f"two degree-6 curves a boundary can keep at every section: sections are not "
            f"single-valued, or what was found jumps from section to section"
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
