"""`bluntdissect export`: the organ in other people's tools, without a browser."""

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.command_line.load import (
    PRESET_HELP,
    THEORY_HELP,
    chosen_theory,
    organ_from,
    theory_options,
)

if TYPE_CHECKING:
    from app.export.order import Order

__all__ = ["export"]


def export(
    organ: Annotated[Path, typer.Argument(help="An .organ file, from `bluntdissect compress`.")],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", help="File to write: .glb, .stl, .ply, .obj, .vtp, .pvd or .csv."
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
    grasp: Annotated[
        float | None, typer.Option(help="mm from the first clamp; the middle if not given.")
    ] = None,
    preset: Annotated[
        str | None,
        typer.Option(
            help=f"The duct's material and beam: {PRESET_HELP}",
            show_default="assumed-duct: the organ's own sections; of the shipped duct the first",
        ),
    ] = None,
    theory: Annotated[str, typer.Option(help=THEORY_HELP)] = "cubic",
    q: Annotated[
        str | None,
        typer.Option(help="Cubic: axial coupling, a number or 'fitted'; 0.5 if not given."),
    ] = None,
    shear: Annotated[bool, typer.Option("--shear", help="Exact: let sections shear.")] = False,
    law: Annotated[
        str | None,
        typer.Option(help="Exact: linear or neo-hooke (with shear); linear if not given."),
    ] = None,
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
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> None:
    """Write an organ under a pull as a file for other tools.

    A GLB is rigged: it has a joint at each driving point, and animations of the pull and the tear.
    STL, PLY and OBJ are closed meshes, VTP and PVD carry the stresses for ParaView, CSV has the
    curve or the axis. All but GLB (metres, y up) are in mm and stand where the organ's images
    stand. Example: bluntdissect export duct.organ --force 2.0 -o duct.glb
    """
    from app.export.order import Order
    from app.simulation import Dissection, chosen_preset, default_preset
    from organ_geometry import write_atomic

    if output is None and html is None:
        raise ValueError("say what to write: --output FILE or --html PAGE")
    if color not in (None, "stress"):
        raise ValueError(f"--color must be stress, not {color}")
    if table not in ("curve", "axis"):
        raise ValueError(f"--table must be curve or axis, not {table}")
    chosen = chosen_theory(theory, q=q, shear=shear, law=law)
    options = theory_options(chosen)
    tissue = organ_from(organ)
    dissection = Dissection.of(tissue, chosen_preset(preset) if preset else default_preset(tissue))
    order = Order(
        dissection,
        chosen,
        0.5 * dissection.beam.span if grasp is None else grasp,
        force=force,
        torn=torn,
        still=still,
        painted=color is not None,
        frames=frames,
        edge_length=0.5 if edge_length is None else edge_length,
        table=table,
    )
    facts: dict[str, object] = {}
    if output is not None:
        order.check(output)
    page = b"" if html is None else page_content(order, html, edge_length)
    if output is not None:
        facts |= write_file(order, output)
    if html is not None:
        write_atomic(html, page)
        facts |= {"page": str(html), "page_bytes": len(page)}
    event = order.break_event
    facts |= {
        "preset": dissection.preset.name,
        "section": dissection.section(chosen),
        "strength": dissection.preset.strength,
        "threshold_MPa": order.strength,
        "breaks_at_N": None if event is None else event.force,
        "theory": chosen.name,
        **options,
    }
    if as_json:
        print(json.dumps(facts))
        return
    if output is not None:
        each = " each" if output.suffix.lower() == ".pvd" else ""
        faces = f", {facts['faces']:,} faces{each}" if facts["faces"] else ""
        print(f"{output}: {facts['kind']}{faces}, {facts['bytes']:,} bytes")
        print(f"preset {dissection.preset.name}, {_state(facts, torn=torn)}")
        print(f"solved as {facts['section']}")
    if html is not None:
        print(f"{html}: a page that plays, {len(page):,} bytes")


def _state(facts: "dict[str, object]", *, torn: bool) -> str:
    """Say how the organ is pulled, and by which theory."""
    force, theory = facts["force_N"], facts["theory"]
    if torn:
        return f"{theory} beam, torn at {force:.4g} N"
    return f"{theory} beam, pulled with {force:.4g} N" if force else "at rest"


def write_file(order: "Order", path: Path) -> dict[str, object]:
    """Write an order to a file."""
    delivery = order.write(path)
    return {
        "file": str(path),
        "files": len(delivery.files),
        "kind": delivery.kind,
        "bytes": sum(file.stat().st_size for file in delivery.files),
        "surfaces": list(delivery.surfaces),
        "vertices": delivery.vertices,
        "faces": delivery.faces,
        "animations": list(delivery.animations),
        "force_N": delivery.force,
        "deflection_mm": delivery.deflection,
    }


def page_content(order: "Order", path: Path, edge_length: float | None) -> bytes:
    """Return the page that plays an order."""
    from app.trainer.pages.html_player import page_edge_length, pull_page
    from organ_geometry import check_target

    check_target(path)
    if order.torn or order.still or order.painted:
        raise ValueError("--html plays a motion; leave out --torn, --still and --color")
    edges = page_edge_length(order.dissection.organ) if edge_length is None else edge_length
    return pull_page(replace(order, edge_length=edges)).encode()
