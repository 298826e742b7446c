"""From a stack of cross-section images to an organ, with a report of how well it fits."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from organ_geometry.contours.contour import SectionContour
from organ_geometry.contours.edges import EdgeMethod, FoundPolarity, Polarity
from organ_geometry.contours.organ_seed import Seed
from organ_geometry.contours.organ_tracing import trace_organ
from organ_geometry.contours.shifted_edges import NothingLeft, shifted_section
from organ_geometry.contours.traced_organ import TracedOrgan
from organ_geometry.curves.fitted_section import FittedSection, fitted_section, section_contour
from organ_geometry.curves.half_curves import (
    NotSingleValued,
)
from organ_geometry.curves.key_sections import check_tolerance
from organ_geometry.encoder.encode import (
    EncodedOrgan,
    Selection,
    encoded_organ,
)
from organ_geometry.encoder.search import Effort
from organ_geometry.encoder.tolerance_floor import ToleranceTooSmall
from organ_geometry.images.image_stack import ImageStack
from organ_geometry.organ import Organ
from organ_geometry.organ_warnings import organ_warnings
from organ_geometry.section_report import SectionReport, pooled_rms, section_reports

Progress = Callable[[int, int], None]

# Without a tolerance: this share of the mean radius, but not so little that the noise of single
# pixels makes every section a key section.
TOLERANCE_SHARE = 0.02
SMALLEST_TOLERANCE_PX = 0.5
_RAISES = 3
# Near the smallest tolerance bytes climb steeply.
_RAISE = 1.1


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
        What the organ's user should know, one sentence each.
    doubts
        Those of the warnings that make it probably another organ than the one wanted, or only a
        part of it (`organ_warnings`).
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
    doubts: tuple[str, ...] = ()
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
    def fit_normal_rms_mm(self) -> float:
        """RMS distance of all edge points to their own section's half-curves, mm."""
        return pooled_rms(self.sections, [one.fit_normal_rms_mm for one in self.sections])

    @property
    def fit_algebraic_rms_mm(self) -> float:
        """RMS distance of all edge points to their own section's half-curves in y, mm."""
        return pooled_rms(self.sections, [one.fit_algebraic_rms_mm for one in self.sections])

    @property
    def rms_error_mm(self) -> float:
        """RMS distance of all edge points to the organ, mm."""
        return pooled_rms(self.sections, [section.rms_mm for section in self.sections])

    @property
    def rms_error_px(self) -> float:
        """RMS distance of all edge points to the organ, px."""
        return pooled_rms(self.sections, [section.rms_px for section in self.sections])

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
    seed: Seed | None = None,
    edge_shift_mm: float = 0.0,
    tolerance_mm: float | None = None,
    tolerance_px: float | None = None,
    select: Selection = "fewest",
    effort: Effort = "quick",
    overall_mm: float | None = None,
    progress: Callable[[int, int], None] | None = None,
    name: str | None = None,
) -> BuiltOrgan:
    """Return the organ of a stack of images, and a report on every section."""
    started = time.perf_counter()
    tolerance_mm = _tolerance(stack, tolerance_mm, tolerance_px)
    _check(edge_shift_mm, select)
    edges = trace_organ(
        stack, polarity=polarity, threshold=threshold, method=method, seed=seed, progress=progress
    )
    built = organ_of_edges(
        stack,
        edges,
        edge_shift_mm=edge_shift_mm,
        tolerance_mm=tolerance_mm,
        select=select,
        effort=effort,
        overall_mm=overall_mm,
        name=name,
    )
    return replace(built, seconds=time.perf_counter() - started)


def organ_of_edges(
    stack: ImageStack,
    edges: TracedOrgan,
    *,
    edge_shift_mm: float = 0.0,
    tolerance_mm: float | None = None,
    tolerance_px: float | None = None,
    select: Selection = "fewest",
    effort: Effort = "quick",
    overall_mm: float | None = None,
    name: str | None = None,
) -> BuiltOrgan:
    """Return the organ of edges that `trace_organ` has found: no image is read again."""
    started = time.perf_counter()
    tolerance_mm = _tolerance(stack, tolerance_mm, tolerance_px)
    _check(edge_shift_mm, select)
    fitted: list[FittedSection] = []
    problems = dict(edges.problems)
    for section in edges.sections:
        try:
            moved = shifted_section(section, edge_shift_mm, stack.pixel_size)
            fitted.append(fitted_section(stack, moved))
        except (NotSingleValued, NothingLeft) as error:
            problems[section.index] = str(error)
    if len(fitted) < 2:
        first = min(problems, default=None)
        reason = "" if first is None else f"; {stack.names[first]}: {problems[first]}"
        raise ValueError(
            f"{stack.source} shows an organ in {len(fitted)} of {len(stack)} images and two or "
            f"more are needed{reason}"
        )

    hollow = all(section.lumen is not None for section in fitted)
    suitable_mm = _suitable_tolerance(fitted, stack)
    wanted_mm = suitable_mm if tolerance_mm is None else tolerance_mm
    contours = [section_contour(stack, section) for section in fitted]

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
    notes = edges.notes
    if edge_shift_mm:
        way = "out" if edge_shift_mm > 0.0 else "in"
        notes += (f"edges are moved {way} by {abs(edge_shift_mm):.4g} mm, as asked",)
    sections = section_reports(stack, found, contours, fitted, problems)
    warnings = tuple(organ_warnings(stack, found.organ, fitted, sections, wanted_mm))
    return BuiltOrgan(
        organ=found.organ,
        sections=sections,
        polarity=edges.polarity,
        tolerance_mm=found.organ.tolerance_mm,
        seconds=time.perf_counter() - started,
        warnings=tuple(warning.text for warning in warnings),
        doubts=tuple(warning.text for warning in warnings if warning.doubtful),
        notes=notes,
        contours=tuple(contours),
    )


def _tolerance(stack: ImageStack, mm: float | None, px: float | None) -> float | None:
    """Return a checked tolerance, mm."""
    if px is not None:
        if mm is not None:
            raise ValueError("give the tolerance in mm or in px, not both")
        mm = px * stack.mean_pixel
    if mm is not None:
        check_tolerance(mm)
    return mm


def _check(edge_shift_mm: float, select: str) -> None:
    if not math.isfinite(edge_shift_mm):
        raise ValueError(f"the edges' shift must be a length, not {edge_shift_mm} mm")
    if select not in ("fewest", "thesis"):
        raise ValueError(f"select must be fewest or thesis, not {select!r}")


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


def _suitable_tolerance(fitted: list[FittedSection], stack: ImageStack) -> float:
    """Return the tolerance, mm, that is used when none is given."""
    mean_radius = float(np.mean([math.sqrt(section.area / math.pi) for section in fitted]))
    return max(TOLERANCE_SHARE * mean_radius, SMALLEST_TOLERANCE_PX * stack.mean_pixel)


def _stack_name(source: Path) -> str:
    return source.stem if source.is_file() else source.resolve().name
