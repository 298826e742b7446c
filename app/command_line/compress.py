"""`bluntdissect compress`: organs from cross-section images."""

import json
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.command_line.answer import progress_bar
from app.command_line.image_options import (
    chosen,
    pixel_pair,
    region,
    seed_point,
    window_levels,
)

if TYPE_CHECKING:
    from app.compression.stack_job import StackJob
    from organ_geometry import Region, Seed

# Options by the panel of the help that they stand in.
_images = partial(typer.Option, rich_help_panel="Images")
_organ = partial(typer.Option, rich_help_panel="Organ")
_promise = partial(typer.Option, rich_help_panel="Promise")
_report = partial(typer.Option, rich_help_panel="Report")


def compress(
    stacks: Annotated[
        list[Path],
        typer.Argument(
            metavar="STACK...",
            help="Folders of images or of a DICOM series; TIFF, NIfTI, NRRD or MetaImage files; "
            "zips of these.",
        ),
    ],
    output: Annotated[
        str,
        typer.Option(
            "--output",
            "-o",
            metavar="PATH",
            help="The .organ file to write; for several stacks, a folder.",
        ),
    ],
    pixel_size: Annotated[
        str | None,
        _images(help="Pixel's width, or width,height, mm, where the images do not tell."),
    ] = None,
    slice_spacing: Annotated[
        float | None,
        _images(help="Distance between sections, mm, where the images do not tell."),
    ] = None,
    axis: Annotated[
        str | None,
        _images(help="Axis the images are across: x, y, z (LPS) or i, j, k.", show_default="k"),
    ] = None,
    label: Annotated[
        int | None,
        _images(help="The organ's label, where the images hold labels."),
    ] = None,
    window: Annotated[
        str | None,
        _images(help="LOW,HIGH: the values to keep, of CT in HU."),
    ] = None,
    roi: Annotated[
        str | None,
        _images(help="X0,Y0,X1,Y1[,FIRST,LAST]: columns, rows and images to keep, from 0."),
    ] = None,
    recut: Annotated[
        str,
        _organ(
            help="auto, always or never: cut again across a curved organ that slices do not suit."
        ),
    ] = "auto",
    seed: Annotated[
        str | None,
        _organ(
            help="X,Y[,IMAGE]: a pixel of the organ where other things are in view, in the first "
            "image or the one of that number, from 0.",
            show_default="the largest thing in view",
        ),
    ] = None,
    polarity: Annotated[
        str,
        _organ(help="auto, bright or dark: the organ against its surroundings."),
    ] = "auto",
    threshold: Annotated[
        float | None,
        _organ(
            help="Grey value of the organ's edge.",
            show_default="halfway between organ and surroundings",
        ),
    ] = None,
    edges: Annotated[
        str,
        _organ(help="half-level, to a part of a pixel, or canny, as in the thesis."),
    ] = "half-level",
    edge_shift_mm: Annotated[
        float,
        _organ(
            help="Move edges out by so many mm, or in if negative, for masks drawn too small or "
            "too large.",
            show_default="0",
        ),
    ] = 0.0,
    tolerance_mm: Annotated[
        float | None,
        _promise(
            help="RMS distance, mm, of every section's edge to the organ that is kept.",
            show_default="2 % of the mean radius, half a pixel or more",
        ),
    ] = None,
    tolerance_px: Annotated[
        float | None,
        _promise(help="The same in pixels."),
    ] = None,
    overall_mm: Annotated[
        float | None,
        _promise(
            help="RMS distance, mm, of all edges together to the organ that is kept. Without a "
            "tolerance, a section may be off by four times as much."
        ),
    ] = None,
    overall_px: Annotated[
        float | None,
        _promise(help="The same in pixels."),
    ] = None,
    select: Annotated[
        str,
        _promise(
            help="fewest sections that keep the promise, or the thesis's rule: a section is kept "
            "that differs from the last one kept."
        ),
    ] = "fewest",
    effort: Annotated[
        str,
        _promise(
            help="quick, or full: tries more ways for some bytes less, about four times as long."
        ),
    ] = "quick",
    sections: Annotated[bool, _report("--sections", help="List every section.")] = False,
    figure: Annotated[
        Path | None,
        _report(
            help="Draw all sections, kept sections, key and driving points; for several stacks, "
            "a folder."
        ),
    ] = None,
    as_json: Annotated[
        bool,
        _report("--json", help="JSON on stdout: an object, or a list of them."),
    ] = False,
    scheduler: Annotated[
        str | None,
        _report(
            help="Address of a Dask scheduler, tcp://HOST:PORT, whose workers compress several "
            "stacks; they must see the same files."
        ),
    ] = None,
) -> None:
    """Find the organ in section images, drop redundant sections, and write an organ file.

    Examples: bluntdissect compress scans/ -o duct.organ --pixel-size 0.1 --slice-spacing 0.4;
    bluntdissect compress a/ b.nii.gz c.tif -o organs/
    """
    if tolerance_mm is not None and tolerance_px is not None:
        raise ValueError("give either --tolerance-mm or --tolerance-px")
    if overall_mm is not None and overall_px is not None:
        raise ValueError("give either --overall-mm or --overall-px")
    from app.compression.stack_job import StackJob, jobs_into
    from organ_geometry import Promise, ReadOptions, TraceOptions

    area = region(roi)
    target = Path(output)
    job = StackJob(
        stack=stacks[0],
        output=target,
        figure=figure,
        read=ReadOptions(
            pixel_size=pixel_pair(pixel_size),
            slice_spacing=slice_spacing,
            axis=axis,
            label=label,
            window=window_levels(window),
            roi=area,
        ),
        reslice=chosen("--recut", recut, ("auto", "always", "never")),
        trace=TraceOptions(
            polarity=chosen("--polarity", polarity, ("auto", "bright", "dark")),
            threshold=threshold,
            method=chosen("--edges", edges, ("half-level", "canny")),
            seed=_within(area, seed_point(seed)),
            edge_shift_mm=edge_shift_mm,
        ),
        promise=Promise(
            tolerance_mm=tolerance_mm,
            tolerance_px=tolerance_px,
            overall_mm=overall_mm,
            overall_px=overall_px,
            select=chosen("--select", select, ("fewest", "thesis")),
            effort=chosen("--effort", effort, ("quick", "full")),
        ),
    )
    if scheduler is not None and len(stacks) < 2:
        raise ValueError("--scheduler is for several stacks")
    if len(stacks) > 1 or target.is_dir() or output.endswith("/"):
        jobs = jobs_into(target, stacks, figures=figure, like=job)
        _compress_many(jobs, target, figure, scheduler, every=sections, as_json=as_json)
    else:
        _compress_one(job, every=sections, as_json=as_json)


def _compress_one(job: "StackJob", *, every: bool, as_json: bool) -> None:
    from app.compression.report import report_lines
    from app.compression.stack_job import compress_stack

    with progress_bar("Finding edges") as progress:
        facts = compress_stack(job, progress)
    if as_json:
        print(json.dumps(facts.as_json()))
    else:
        print("\n".join(report_lines(facts, every_section=every)))


def _compress_many(
    jobs: "list[StackJob]",
    folder: Path,
    figures: Path | None,
    scheduler: str | None,
    *,
    every: bool,
    as_json: bool,
) -> None:
    """Compress many stacks, report on each, and fail if one has failed."""
    from app.compression.report import Facts, remark_lines, section_lines, summary_lines
    from app.compression.stack_batch import compress_all
    from app.compression.stack_job import Failed
    from organ_geometry import make_folder

    for place in (folder, figures):
        if place is not None:
            make_folder(
                place, f"several stacks need a folder to write into, and {place} cannot be one"
            )
    by_stack: dict[str, Facts | Failed] = {}
    with progress_bar("Compressing") as progress:
        for outcome in compress_all(jobs, folder, scheduler):
            by_stack[outcome.stack] = outcome
            progress(len(by_stack), len(jobs))
    outcomes = [by_stack[str(job.stack)] for job in jobs]
    done = [outcome for outcome in outcomes if isinstance(outcome, Facts)]
    failed = [outcome for outcome in outcomes if isinstance(outcome, Failed)]
    if as_json:
        print(json.dumps([outcome.as_json() for outcome in outcomes]))
    else:
        for facts in done if every else ():
            print("\n".join([facts.file, *section_lines(facts.sections), ""]))
        print("\n".join(summary_lines(done)))
        for facts in done:
            for line in remark_lines(facts):
                print(f"{line[:10]} {facts.stack}: {line[11:]}")
        for one in failed:
            print(f"failed     {one.stack}: {one.error}")
    if failed:
        raise ValueError(
            f"{len(failed)} of {len(jobs)} stacks could not be compressed: "
            + ", ".join(one.stack for one in failed)
        )


def _within(area: "Region | None", seed: "Seed | None") -> "Seed | None":
    """Return a seed relative to the region that is kept."""
    if area is None or seed is None:
        return seed
    x, y = seed[0] - area[0], seed[1] - area[1]
    if len(seed) == 2:
        return x, y
    return x, y, seed[2] - (area[4] if len(area) == 6 else 0)
