"""From a stack of cross-section images to an organ, with a report of how well it fits.

The stages, each a function whose value the next takes:

    read      `read_image_stack(path, ReadOptions)`  -> ImageStack
    trace     `trace_organ(stack, TraceOptions)`     -> TracedOrgan, edges in px
    reslice   `reslice_where_needed(stack, traced)`  -> ImageStack, TracedOrgan: the same or better
    fit       `fit_organ(stack, traced)`             -> FittedOrgan, edges in mm, half-curves
    encode    `encode_organ(fitted, Promise)`        -> EncodedOrgan, the organ of its file
    report    `report_organ(fitted, encoded)`        -> BuiltOrgan

`build_organ` does all after the images but reslicing; `build_fitted` the last two, which is what
another tolerance costs.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from organ_geometry.contours.contour import SectionContour
from organ_geometry.contours.organ_tracing import trace_organ
from organ_geometry.contours.trace_options import FoundPolarity, TraceOptions
from organ_geometry.curves.fitted_organ import FittedOrgan, fit_organ
from organ_geometry.encoder.encode import EncodedOrgan, Selection, ToleranceTooSmall, encoded_organ
from organ_geometry.encoder.settings import Effort
from organ_geometry.images.image_stack import ImageStack
from organ_geometry.organ import Organ
from organ_geometry.organ_warnings import organ_warnings
from organ_geometry.section_report import SectionReport, pooled_rms, section_reports

# Without a tolerance: this share of the mean radius, but not so little that the noise of single
# pixels makes every section a key section.
TOLERANCE_FRACTION = 0.02
SMALLEST_TOLERANCE_PX = 0.5
# With an overall tolerance alone, a section may be off by so many times as much. The fewest bytes
# at an error are found with 3 to 5 (benchmarks/organ_bytes.py).
LOOSE_SECTIONS = 4.0
# How often a tolerance that nobody asked for is raised, and by how much above what can be kept,
# near which bytes climb steeply.
_RAISES = 3
_RAISE = 1.1


@dataclass(frozen=True, slots=True)
class Promise:
    """How far the organ may be from its edges, and how hard to look for few bytes.

    Attributes
    ----------
    tolerance_mm, tolerance_px
        RMS distance that no section exceeds. None for 2 % of the mean radius, half a pixel or
        more, and the smallest that can be kept if that cannot; or for `LOOSE_SECTIONS` times the
        overall one.
    overall_mm, overall_px
        RMS distance that all sections together do not exceed, or None.
    effort
        "quick", or "full" for some bytes less in about four times the time.
    """

    tolerance_mm: float | None = None
    tolerance_px: float | None = None
    overall_mm: float | None = None
    overall_px: float | None = None
    select: Selection = "fewest"
    effort: Effort = "quick"

    def __post_init__(self) -> None:
        for name, mm, px in (
            ("tolerance", self.tolerance_mm, self.tolerance_px),
            ("overall tolerance", self.overall_mm, self.overall_px),
        ):
            if mm is not None and px is not None:
                raise ValueError(f"give the {name} in mm or in px, not both")
            for value, unit in ((mm, "mm"), (px, "px")):
                if value is not None and not (math.isfinite(value) and value >= 0.0):
                    raise ValueError(
                        f"{name} must be 0 {unit} or more and finite, not {value:g} {unit}"
                    )
        if self.select not in ("fewest", "thesis"):
            raise ValueError(f"select must be fewest or thesis, not {self.select!r}")
        if self.effort not in ("quick", "full"):
            raise ValueError(f"effort must be quick or full, not {self.effort!r}")

    def tolerance_of(self, pixel_mm: float) -> float | None:
        """Return the tolerance asked of every section, mm, or None."""
        return self.tolerance_mm if self.tolerance_px is None else self.tolerance_px * pixel_mm

    def overall_of(self, pixel_mm: float) -> float | None:
        """Return the tolerance asked of all sections together, mm, or None."""
        return self.overall_mm if self.overall_px is None else self.overall_px * pixel_mm


@dataclass(frozen=True, slots=True, eq=False)
class BuiltOrgan:
    """An organ, decoded from its file's content, and how it came about.

    Attributes
    ----------
    sections
        One report for each image, in order.
    polarity
        Whether the organ is "bright" or "dark" in its images, as given or as decided.
    tolerance_mm, overall_mm
        What is promised of each section and of all together (or None), see `Promise`.
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
    overall_mm: float | None
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
    trace: TraceOptions | None = None,
    promise: Promise | None = None,
    *,
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
    trace, promise
        Which organ, how its edge is defined, and how near it is kept to that.
    progress
        Called after each image with the number done and the number of images.
    name
        Default: that of the folder or file.

    Returns
    -------
    BuiltOrgan
        The organ and the report.

    Raises
    ------
    ToleranceTooSmall
        If a tolerance given cannot be kept; the smallest that can is named.
    ValueError
        If an image cannot be read or fewer than two sections show an edge.
    """
    fitted = fit_organ(stack, trace_organ(stack, trace, progress=progress))
    return build_fitted(fitted, promise, name=name)


def build_fitted(
    fitted: FittedOrgan, promise: Promise | None = None, *, name: str | None = None
) -> BuiltOrgan:
    """Return the organ of fitted sections, and its report: no image is read again."""
    return report_organ(fitted, encode_organ(fitted, promise, name=name), promise)


def encode_organ(
    fitted: FittedOrgan, promise: Promise | None = None, *, name: str | None = None
) -> EncodedOrgan:
    """Return the organ that keeps a promise; a tolerance by default is raised if need be."""
    promise = Promise() if promise is None else promise
    stack = fitted.stack
    overall_mm = promise.overall_of(stack.mean_pixel)
    asked = promise.tolerance_of(stack.mean_pixel) is not None or overall_mm is not None
    tolerance = _wanted_mm(fitted, promise)
    for raised in range(_RAISES + 1):
        try:
            return encoded_organ(
                fitted.contours,
                tolerance,
                hollow=fitted.hollow,
                left_handed=float(np.linalg.det(stack.frames[0])) < 0.0,
                select=promise.select,
                effort=promise.effort,
                overall=overall_mm,
                units=stack.units,
                name=_stack_name(stack.source) if name is None else name,
            )
        except ToleranceTooSmall as error:
            if asked or raised == _RAISES:
                raise
            tolerance = _RAISE * error.smallest_mm
    raise AssertionError("the last try returns or raises")


def report_organ(
    fitted: FittedOrgan, encoded: EncodedOrgan, promise: Promise | None = None
) -> BuiltOrgan:
    """Return an organ with its errors at every section, and warnings for its user."""
    sections = section_reports(fitted, encoded)
    promise = Promise() if promise is None else promise
    wanted_mm = _wanted_mm(fitted, promise)
    warnings = tuple(organ_warnings(fitted, encoded.organ, sections, wanted_mm))
    return BuiltOrgan(
        organ=encoded.organ,
        sections=sections,
        polarity=fitted.polarity,
        tolerance_mm=encoded.organ.tolerance_mm,
        overall_mm=promise.overall_of(fitted.stack.mean_pixel),
        warnings=tuple(warning.text for warning in warnings),
        doubts=tuple(warning.text for warning in warnings if warning.doubtful),
        notes=fitted.notes,
        contours=fitted.contours,
    )


def _wanted_mm(fitted: FittedOrgan, promise: Promise) -> float:
    """Return the tolerance of every section, mm: as asked, or by the organ's radius."""
    pixel = fitted.stack.mean_pixel
    asked, overall = promise.tolerance_of(pixel), promise.overall_of(pixel)
    if asked is not None:
        return asked
    if overall is not None:
        return LOOSE_SECTIONS * overall
    return max(TOLERANCE_FRACTION * fitted.mean_radius, SMALLEST_TOLERANCE_PX * pixel)


def _stack_name(source: Path) -> str:
    return source.stem if source.is_file() else source.resolve().name
