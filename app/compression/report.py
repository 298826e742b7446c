"""Report of a compressed stack: facts as JSON, lines and tables as text."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec

from organ_geometry import BuiltOrgan, ImageStack, SectionReport

# Sections left out that a report names one by one.
MOST_LEFT_OUT = 10


DOUBTFUL = "probably another organ than the one wanted, or only a part of it"
"""What is said of an organ with doubts, before these."""


@dataclass(frozen=True, slots=True)
class Facts:
    """Facts of a compressed stack; the attributes' names are `--json`'s keys."""

    stack: str  # Where the images are
    file: str  # The organ file
    polarity: str  # "bright" or "dark": the organ in its images
    hollow: bool  # Whether it has a lumen
    length_mm: float
    mean_radius_mm: float
    # RMS distance promised for every section, and for all together or None.
    tolerance_mm: float
    tolerance_px: float
    overall_mm: float | None
    overall_px: float | None
    sections_in: int  # Images
    sections_found: int  # Images in which the organ was found
    sections_kept: int  # Key sections
    # RMS distance of the edges to their own section's half-curves along the curves' normals, and in
    # y, as the thesis's least squares measure it.
    fit_normal_rms_mm: float
    fit_normal_rms_px: float
    fit_algebraic_rms_mm: float
    fit_algebraic_rms_px: float
    # RMS and largest distance between the original edges and the decompressed organ.
    rms_error_mm: float
    rms_error_px: float
    max_error_mm: float
    max_error_px: float
    bytes_in: int  # Of the image files
    bytes_out: int  # Of the organ file
    ratio: float  # Bytes in, over bytes out
    seconds: float  # Time for reading the images and building the organ, s
    warnings: tuple[str, ...]
    # Those of the warnings that make it probably another organ than the one wanted, or only a part
    # of it.
    doubts: tuple[str, ...]
    notes: tuple[str, ...]  # How the organ was found
    sections: tuple[SectionReport, ...]  # One report for each image

    def as_json(self) -> dict[str, object]:
        """Return the facts as values for JSON."""
        return msgspec.json.decode(msgspec.json.encode(self))  # nan becomes null


def facts(
    built: BuiltOrgan, images: ImageStack, *, stack: Path, output: Path, seconds: float
) -> Facts:
    """Return the facts of a compressed stack."""
    bytes_out = output.stat().st_size
    pixel = images.mean_pixel
    return Facts(
        stack=str(stack),
        file=str(output),
        polarity=built.polarity,
        hollow=built.organ.hollow,
        length_mm=built.organ.length,
        mean_radius_mm=built.organ.mean_radius,
        tolerance_mm=built.tolerance_mm,
        tolerance_px=built.tolerance_mm / pixel,
        overall_mm=built.overall_mm,
        overall_px=None if built.overall_mm is None else built.overall_mm / pixel,
        sections_in=built.sections_in,
        sections_found=built.sections_found,
        sections_kept=built.sections_kept,
        fit_normal_rms_mm=built.fit_normal_rms_mm,
        fit_normal_rms_px=built.fit_normal_rms_mm / pixel,
        fit_algebraic_rms_mm=built.fit_algebraic_rms_mm,
        fit_algebraic_rms_px=built.fit_algebraic_rms_mm / pixel,
        rms_error_mm=built.rms_error_mm,
        rms_error_px=built.rms_error_px,
        max_error_mm=built.max_error_mm,
        max_error_px=built.max_error_mm / pixel,
        bytes_in=images.bytes_in,
        bytes_out=bytes_out,
        ratio=images.bytes_in / bytes_out,
        seconds=seconds,
        warnings=(*images.notes, *built.warnings),
        doubts=built.doubts,
        notes=built.notes,
        sections=built.sections,
    )


def report_lines(done: Facts, *, every_section: bool) -> Iterator[str]:
    """Yield the report of one stack."""
    if every_section:
        yield from section_lines(done.sections)
        yield ""
    wall = "hollow" if done.hollow else "solid"
    overall = ""
    if done.overall_mm is not None:
        overall = f"; {done.overall_mm:.4f} mm, {done.overall_px:.3f} px over all"
    rows = [
        (
            "organ",
            f"{wall}, {done.length_mm:.2f} mm long, mean radius {done.mean_radius_mm:.3f} mm, "
            f"{done.polarity} in its images",
        ),
        (
            "sections",
            f"{done.sections_in} in, {done.sections_found} found, {done.sections_kept} kept",
        ),
        (
            "promise",
            f"{done.tolerance_mm:.4f} mm, {done.tolerance_px:.3f} px RMS at every section{overall}",
        ),
        (
            "fit",
            f"{done.fit_normal_rms_mm:.4f} mm, {done.fit_normal_rms_px:.3f} px RMS along the "
            f"normal; {done.fit_algebraic_rms_mm:.4f} mm, {done.fit_algebraic_rms_px:.3f} px along "
            "y, as the thesis takes it",
        ),
        ("RMS error", f"{done.rms_error_mm:.4f} mm, {done.rms_error_px:.3f} px"),
        ("largest", f"{done.max_error_mm:.4f} mm, {done.max_error_px:.3f} px, either way"),
        ("bytes", f"{done.bytes_in:,} in, {done.bytes_out:,} out, ratio {done.ratio:,.0f}"),
        ("time", f"{done.seconds:.2f} s"),
        ("written", done.file),
    ]
    yield from (f"{name:<10} {value}" for name, value in rows)
    yield from remark_lines(done)
    yield from (f"{'how':<10} {note}" for note in done.notes)
    without = [section for section in done.sections if section.problem is not None]
    for section in without[:MOST_LEFT_OUT]:
        yield f"left out   {section.name}: {section.problem}"
    if len(without) > MOST_LEFT_OUT:
        yield f"left out   {len(without) - MOST_LEFT_OUT} more; --sections lists every section"
    elif not every_section:
        yield "           --sections lists every section"


def remark_lines(done: Facts) -> Iterator[str]:
    """Yield an organ's doubts, then its other warnings."""
    if done.doubts:
        yield f"{'doubtful':<10} {DOUBTFUL}; look at it with --figure before it is used:"
    yield from (f"{'doubtful':<10} {doubt}" for doubt in done.doubts)
    yield from (f"{'note':<10} {each}" for each in done.warnings if each not in done.doubts)


def section_lines(sections: Sequence[SectionReport]) -> Iterator[str]:
    """Yield the table of all sections."""
    yield (
        f"{'section':<24} {'edge points':>11} {'lumen':>5} {'kept':>4} "
        f"{'fit RMS px':>10} {'fit RMS mm':>10} {'in y px':>7} {'in y mm':>7} "
        f"{'RMS px':>7} {'RMS mm':>7} {'max mm':>7}"
    )
    for section in sections:
        if section.problem is not None:
            yield f"{section.name:<24} {section.problem}"
            continue
        yield (
            f"{section.name:<24} {section.edge_points:>11} {'yes' if section.lumen else '':>5} "
            f"{'kept' if section.kept else '':>4} {section.fit_normal_rms_px:>10.3f} "
            f"{section.fit_normal_rms_mm:>10.4f} {section.fit_algebraic_rms_px:>7.3f} "
            f"{section.fit_algebraic_rms_mm:>7.4f} {section.rms_px:>7.3f} {section.rms_mm:>7.4f} "
            f"{section.max_mm:>7.4f}"
        )


def summary_lines(every: Sequence[Facts]) -> Iterator[str]:
    """Yield the table of many stacks, one a line."""
    width = max([len("organ file"), *(len(done.file) for done in every)])
    yield (
        f"{'organ file':<{width}} {'in':>5} {'found':>5} {'kept':>5} {'RMS mm':>8} {'RMS px':>7} "
        f"{'max mm':>8} {'bytes in':>12} {'out':>7} {'ratio':>8} {'s':>6}"
    )
    for done in every:
        yield (
            f"{done.file:<{width}} {done.sections_in:>5} {done.sections_found:>5} "
            f"{done.sections_kept:>5} {done.rms_error_mm:>8.4f} {done.rms_error_px:>7.3f} "
            f"{done.max_error_mm:>8.4f} {done.bytes_in:>12,} {done.bytes_out:>7,} "
            f"{done.ratio:>8,.0f} {done.seconds:>6.2f}"
        )
