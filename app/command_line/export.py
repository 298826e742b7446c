"""`bluntdissect export`: the deformed or torn organ as a mesh, without a browser."""

import json
from pathlib import Path
from typing import Annotated

import typer

from app.command_line.load import (
    PRESET_NAMES,
    THEORY_HELP,
    chosen_theory,
    organ_from,
    theory_options,
)

__all__ = ["export"]


def export(
    organ: Annotated[Path, typer.Argument(help="An .organ file, from `bluntdissect compress`.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Mesh to write: .stl, .ply, .obj or .glb.")
    ],
    force: Annotated[
        float | None,
        typer.Option(help="The grasper's whole force, N; with --torn the force at the break."),
    ] = None,
    grasp: Annotated[
        float | None, typer.Option(help="mm from the first clamp; the middle if not given.")
    ] = None,
    preset: Annotated[
        str | None,
        typer.Option(
            help=f"The duct's material and beam: {PRESET_NAMES}.",
            show_default="the first where the organ is long enough for it, else porcine-bile-duct",
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
        bool, typer.Option("--torn", help="The two pieces after the duct has torn.")
    ] = False,
    edge_length: Annotated[float, typer.Option(help="Length of the triangles' edges, mm.")] = 0.5,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> None:
    """Write an organ under a pull as a closed mesh.

    STL, PLY and OBJ are in mm and stand where the organ's images stand, GLB is in metres with
    y up. Example: bluntdissect export duct.organ --force 2.0 -o duct.stl
    """
    from app.simulation.dissection import Dissection, default_preset
    from app.simulation.preset import preset_named
    from app.simulation.snapshot import pulled_snapshot, torn_snapshot
    from organ_geometry.mesh_file import check_mesh_path, write_mesh

    check_mesh_path(output)
    chosen = chosen_theory(theory, q=q, shear=shear, law=law)
    options = theory_options(chosen)
    tissue = organ_from(organ)
    dissection = Dissection.of(tissue, preset_named(preset) if preset else default_preset(tissue))
    chosen = dissection.theory_for(chosen)
    at = 0.5 * dissection.beam.span if grasp is None else grasp
    take = torn_snapshot if torn else pulled_snapshot
    snapshot = take(dissection, chosen, grasp=at, force=force, edge_length=edge_length)
    write_mesh(snapshot.parts, output)
    facts = {
        "file": str(output),
        "bytes": output.stat().st_size,
        "surfaces": list(snapshot.parts),
        "vertices": sum(len(vertices) for vertices, _ in snapshot.parts.values()),
        "faces": sum(len(faces) for _, faces in snapshot.parts.values()),
        "preset": dissection.preset.name,
        "theory": chosen.name,
        **options,
        "force_N": snapshot.force,
        "deflection_mm": snapshot.deflection,
    }
    if as_json:
        print(json.dumps(facts))
        return
    closed = "two closed pieces" if torn else "one closed surface"
    print(f"{output}: {closed}, {facts['faces']:,} faces, {facts['bytes']:,} bytes")
    broke = "torn at" if torn else "pulled with"
    print(f"preset {dissection.preset.name}, {broke} {snapshot.force:.4g} N")
