"""`bluntdissect compress`: an organ from cross-section images."""

import dataclasses
import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from organ_geometry.edges import Polarity
    from organ_geometry.image_region import Region
    from organ_geometry.image_stack import ImageStack
    from organ_geometry.organ_builder import BuiltOrgan
    from organ_geometry.recut_stack import When

__all__ = ["compress"]


def compress(
    stack: Annotated[
        Path,
        typer.Argument(
            help="Folder of images or of a DICOM series; TIFF, NIfTI, NRRD or MetaImage file."
        ),
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="The .organ file to write.")],
    tolerance_mm: Annotated[
        float | None,
        typer.Option(
            help="RMS distance by which a section must differ from the last one kept, to be kept.",
            show_default="suits the organ",
        ),
    ] = None,
    polarity: Annotated[
        str, typer.Option(help="auto, bright or dark: the organ against its surroundings.")
    ] = "auto",
    pixel_size: Annotated[
        str | None,
        typer.Option(help="Pixel's width, or width,height, mm, where no spacing.json tells."),
    ] = None,
    slice_spacing: Annotated[
        float | None,
        typer.Option(help="Distance between sections, mm, where no spacing.json tells."),
    ] = None,
    axis: Annotated[
        str | None,
        typer.Option(
            help="Axis the images are across: x, y, z (LPS) or i, j, k.", show_default="k"
        ),
    ] = None,
    label: Annotated[
        int | None, typer.Option(help="The organ's label, where the images hold labels.")
    ] = None,
    window: Annotated[
        str | None, typer.Option(help="LOW,HIGH: the values to keep, of CT in HU.")
    ] = None,
    roi: Annotated[
        str | None,
        typer.Option(help="X0,Y0,X1,Y1[,FIRST,LAST]: columns, rows and images to keep, from 0."),
    ] = None,
    recut: Annotated[
        str,
        typer.Option(
            help="auto, always or never: cut again across a curved organ that slices do not suit."
        ),
    ] = "auto",
    sections: Annotated[bool, typer.Option("--sections", help="List every section.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> None:
    """Find the organ in section images, drop redundant sections, and write an organ file.

    Example: bluntdissect compress scans/ -o duct.organ --pixel-size 0.1 --slice-spacing 0.4
    """
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    from organ_geometry.image_stack import read_image_stack
    from organ_geometry.organ_builder import build_organ
    from organ_geometry.organ_file import write_organ
    from organ_geometry.recut_stack import recut_where_needed
    from organ_geometry.whole_file import check_target

    check_target(output)
    side = _polarity(polarity)
    when = _when(recut)
    console = Console(stderr=True)
    images = read_image_stack(
        stack,
        pixel_size=_pair(pixel_size),
        slice_spacing=slice_spacing,
        axis=axis,
        label=label,
        window=_window(window),
        roi=_region(roi),
    )
    images = recut_where_needed(images, when, polarity=side)
    with Progress(
        TextColumn("Finding edges"),
        BarColumn(),
        MofNCompleteColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    ) as bar:
        task = bar.add_task("edges", total=len(images))
        built = build_organ(
            images,
            polarity=side,
            tolerance_mm=tolerance_mm,
            name=output.stem,
            progress=lambda done, total: bar.update(task, completed=done, total=total),
        )
    write_organ(built.organ, output)
    if as_json:
        print(json.dumps(_facts(built, images, output)))
    else:
        _print_report(built, images, output, every_section=sections)


def _facts(built: "BuiltOrgan", images: "ImageStack", output: Path) -> dict[str, object]:
    """Return what `--json` says."""
    return {
        "file": str(output),
        "polarity": built.polarity,
        "hollow": built.organ.hollow,
        "length_mm": built.organ.length,
        "mean_radius_mm": built.organ.mean_radius,
        "tolerance_mm": built.tolerance_mm,
        "sections_in": built.sections_in,
        "sections_found": built.sections_found,
        "sections_kept": built.sections_kept,
        "rms_error_px": built.rms_error_px,
        "rms_error_mm": built.rms_error_mm,
        "max_error_mm": built.max_error_mm,
        "bytes_in": images.bytes_in,
        "bytes_out": output.stat().st_size,
        "seconds": built.seconds,
        "warnings": [*images.notes, *built.warnings],
        "sections": [
            {
                key: None if isinstance(value, float) and math.isnan(value) else value
                for key, value in dataclasses.asdict(section).items()
            }
            for section in built.sections
        ],
    }


def _print_report(
    built: "BuiltOrgan", images: "ImageStack", output: Path, *, every_section: bool
) -> None:
    """Print the sections, if wanted, then what the file holds."""
    organ = built.organ
    if every_section:
        print(
            f"{'section':<24} {'edge points':>11} {'lumen':>5} {'kept':>4} "
            f"{'fit RMS px':>10} {'fit RMS mm':>10} {'RMS px':>7} {'RMS mm':>7} {'max mm':>7}"
        )
        for section in built.sections:
            if section.problem is not None:
                print(f"{section.name:<24} {section.problem}")
                continue
            print(
                f"{section.name:<24} {section.edge_points:>11} {'yes' if section.lumen else '':>5} "
                f"{'kept' if section.kept else '':>4} {section.fit_rms_px:>10.3f} "
                f"{section.fit_rms_mm:>10.4f} {section.rms_px:>7.3f} {section.rms_mm:>7.4f} "
                f"{section.max_mm:>7.4f}"
            )
        print()
    without = [section for section in built.sections if section.problem is not None]
    wall = "hollow" if organ.hollow else "solid"
    bytes_out = output.stat().st_size
    lines = [
        (
            "organ",
            f"{wall}, {organ.length:.2f} mm long, mean radius {organ.mean_radius:.3f} mm, "
            f"{built.polarity} in its images",
        ),
        (
            "sections",
            f"{built.sections_in} in, {built.sections_found} found, "
            f"{built.sections_kept} kept (tolerance {built.tolerance_mm:.4f} mm RMS)",
        ),
        (
            "RMS error",
            f"{built.rms_error_px:.3f} px, {built.rms_error_mm:.4f} mm, "
            f"largest {built.max_error_mm:.4f} mm either way",
        ),
        (
            "bytes",
            f"{images.bytes_in:,} in, {bytes_out:,} out, ratio {images.bytes_in / bytes_out:,.0f}",
        ),
        ("time", f"{built.seconds:.2f} s"),
        ("written", str(output)),
    ]
    for name, value in lines:
        print(f"{name:<10} {value}")
    for warning in (*images.notes, *built.warnings):
        print(f"{'note':<10} {warning}")
    for section in without[:10]:
        print(f"left out   {section.name}: {section.problem}")
    if len(without) > 10:
        print(f"left out   {len(without) - 10} more; --sections lists every section")
    elif not every_section:
        print("           --sections lists every section")


def _pair(text: str | None) -> tuple[float, float] | None:
    """Return "0.1" as (0.1, 0.1) and "0.1,0.2" as (0.1, 0.2)."""
    if text is None:
        return None
    try:
        sizes = [float(part) for part in text.split(",")]
    except ValueError:
        sizes = []
    if len(sizes) not in (1, 2):
        raise ValueError(
            f"--pixel-size must be one number or two, mm, as 0.1 or 0.1,0.2, not {text}"
        )
    return sizes[0], sizes[-1]


def _window(text: str | None) -> tuple[float, float] | None:
    """Return "-150,500" as (-150, 500)."""
    if text is None:
        return None
    try:
        low, high = (float(part) for part in text.split(","))
    except ValueError:
        raise ValueError(
            f"--window must be the lowest and the highest value kept, as -150,500, not {text}"
        ) from None
    return low, high


def _region(text: str | None) -> "Region | None":
    """Return "0,0,9,9" as (0, 0, 9, 9), and six numbers likewise."""
    if text is None:
        return None
    try:
        numbers = [int(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) == 4:
        return numbers[0], numbers[1], numbers[2], numbers[3]
    if len(numbers) == 6:
        return numbers[0], numbers[1], numbers[2], numbers[3], numbers[4], numbers[5]
    raise ValueError(
        f"--roi must be four or six whole numbers, x0,y0,x1,y1 or x0,y0,x1,y1,first,last, "
        f"not {text}"
    )


def _when(text: str) -> "When":
    """Return when to cut again."""
    if text not in ("auto", "always", "never"):
        raise ValueError(f"--recut must be auto, always or never, not {text}")
    return text


def _polarity(text: str) -> "Polarity":
    """Return the polarity of that name."""
    if text not in ("auto", "bright", "dark"):
        raise ValueError(f"--polarity must be auto, bright or dark, not {text}")
    return text
