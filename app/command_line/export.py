"""`bluntdissect export`: the organ in other people's tools, without a browser."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.command_line.answer import AsJson
from app.command_line.bed_options import BedOptions
from app.command_line.load import (
    PRESET_HELP,
    AxialCoupling,
    Grasp,
    Law,
    Shear,
    Stiffening,
    TheoryName,
    chosen_theory,
    organ_from,
    with_law,
)
from app.command_line.shared_options import options_of

if TYPE_CHECKING:
    from app.export.organ_export import ExportResult, OrganExport

OF_PULL = ("force", "grasp", "q", "shear", "theory", "torn", "frames", "table")
"""Parameters of a duct without a bed."""


@options_of(BedOptions)
def export(
    context: typer.Context,
    organ: Annotated[Path, typer.Argument(help="An .organ file, from `bluntdissect compress`.")],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            help="File to write: .glb, .stl, .ply, .obj, .zip of .stl, .vtp, .pvd or .csv.",
        ),
    ] = None,
    html: Annotated[
        Path | None, typer.Option(help="A page to write that plays the pull and the tear.")
    ] = None,
    force: Annotated[
        float | None,
        typer.Option(
            help="The grasper's whole force, N; with --torn the force at the break. Not given: "
            "still meshes are at rest, the others go to the break."
        ),
    ] = None,
    grasp: Grasp = None,
    preset: Annotated[
        str | None,
        typer.Option(
            help=f"The duct's material and beam: {PRESET_HELP}",
            show_default="assumed-duct: the organ's own sections; of the shipped duct the first",
        ),
    ] = None,
    theory: TheoryName = "cubic",
    q: AxialCoupling = None,
    shear: Shear = False,
    law: Law = None,
    stiffening: Stiffening = None,
    torn: Annotated[
        bool, typer.Option("--torn", help="The two pieces after the duct has torn, still.")
    ] = False,
    still: Annotated[
        bool, typer.Option("--still", help="GLB: one moment, without joints and animations.")
    ] = False,
    color: Annotated[
        str | None,
        typer.Option(help="stress: PLY and GLB, still, from 0 (blue) to the threshold (yellow)."),
    ] = None,
    frames: Annotated[
        int, typer.Option(help="Keys of a pull, files of a .pvd series, rows of a curve.")
    ] = 60,
    table: Annotated[
        str, typer.Option(help="CSV: curve (force and deflection) or axis (at the force).")
    ] = "curve",
    edge_length: Annotated[
        float | None,
        typer.Option(
            help="Length of the triangles' edges, mm.",
            show_default="0.5; of a page what keeps it small",
        ),
    ] = None,
    as_json: AsJson = False,
    **options: Any,
) -> None:
    """Write an organ under a pull, or freed from its bed, as a file for other tools.

    A GLB is rigged: it has a joint at each driving point, and animations of the pull and the tear.
    With --bed it shows how the hook frees the duct, with the strands.
    STL, PLY and OBJ are closed meshes, VTP and PVD carry the stresses for ParaView, CSV has the
    curve or the axis. All but GLB (metres, y up) are in mm and stand where the organ's images
    stand. Example: bluntdissect export duct.organ --force 2.0 -o duct.glb
    """
    from app.export.bed_export import BedExport
    from app.export.pull_export import PullExport
    from app.simulation import Specimen, bed_named, chosen_preset, default_preset
    from organ_geometry import write_atomic

    if output is None and html is None:
        raise ValueError("say what to write: --output FILE or --html PAGE")
    if color not in (None, "stress"):
        raise ValueError(f"--color must be stress, not {color}")
    if table not in ("curve", "axis"):
        raise ValueError(f"--table must be curve or axis, not {table}")
    in_bed = BedOptions(**options)
    in_bed.check(context, of_pull=OF_PULL)
    tissue = organ_from(organ)
    specimen = Specimen(
        with_law(
            chosen_preset(preset) if preset else default_preset(tissue),
            None if in_bed.bed is None else law,
            None if in_bed.bed is None else stiffening,
        ),
        tissue,
        None if in_bed.bed is None else bed_named(in_bed.bed),
        bed_seed=in_bed.seed,
        theory=None
        if in_bed.bed is not None
        else chosen_theory(theory, q=q, shear=shear, law=law, stiffening=stiffening),
    )
    span = specimen.beam.span
    edges = 0.5 if edge_length is None else edge_length
    wanted: OrganExport
    if in_bed.bed is not None:
        wanted = BedExport(
            specimen,
            0.5 * span if in_bed.hook is None else in_bed.hook,
            in_bed.hook_path(),
            static=still,
            stress_colors=color is not None,
            edge_length=edges,
            steps=in_bed.steps,
            elements=in_bed.elements,
            strands=in_bed.strands,
        )
    else:
        wanted = PullExport(
            specimen,
            0.5 * span if grasp is None else grasp,
            force=force,
            torn=torn,
            static=still,
            stress_colors=color is not None,
            frames=frames,
            edge_length=edges,
            table=table,
        )
    facts: dict[str, object] = {}
    shown: float | None = None
    if output is not None:
        wanted.check(output)
    page = b"" if html is None else page_content(wanted, html, edge_length)
    if output is not None:
        result = wanted.write(output)
        shown = result.force
        facts |= written_facts(result, output)
    if html is not None:
        write_atomic(html, page)
        facts |= {"page": str(html), "page_bytes": len(page)}
    facts |= {
        "preset": specimen.preset.name,
        "strength": specimen.preset.strength,
        "threshold_MPa": specimen.threshold,
        "section": specimen.section,
        **wanted.facts(),
    }
    if as_json:
        print(json.dumps(facts))
        return
    if output is not None:
        each = " each" if output.suffix.lower() == ".pvd" else ""
        faces = f", {facts['faces']:,} faces{each}" if facts["faces"] else ""
        print(f"{output}: {facts['kind']}{faces}, {facts['bytes']:,} bytes")
    if html is not None:
        print(f"{html}: a page that plays, {len(page):,} bytes")
    print(f"preset {specimen.preset.name}, {wanted.summary(shown)}")
    print(f"solved as {facts['section']}")


def written_facts(result: "ExportResult", path: Path) -> dict[str, object]:
    """Return what is in a file that was written."""
    return {
        "file": str(path),
        "files": len(result.files),
        "kind": result.kind,
        "bytes": sum(file.stat().st_size for file in result.files),
        "surfaces": list(result.surfaces),
        "vertices": result.vertices,
        "faces": result.faces,
        "animations": list(result.animations),
        "force_N": result.force,
        "deflection_mm": result.deflection,
    }


def page_content(export: "OrganExport", path: Path, edge_length: float | None) -> bytes:
    """Return the page that plays an export."""
    from app.trainer.pages.html_player import export_page, page_edge_length
    from organ_geometry import check_target

    check_target(path)
    if not export.moves:
        raise ValueError("--html plays a motion; leave out --torn, --still and --color")
    edges = page_edge_length(export.dissection.organ) if edge_length is None else edge_length
    return export_page(export, edge_length=edges).encode()
