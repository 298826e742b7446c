"""`bluntdissect anatomy`: anatomies of several tubes: shipped, drawn from a seed, or read."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.command_line.answer import AsJson, answer
from app.command_line.load import anatomy_from

if TYPE_CHECKING:
    from app.anatomy import Anatomy, TubeLine


def anatomy(
    source: Annotated[
        str | None,
        typer.Argument(metavar="[ANATOMY]", help="A shipped anatomy's name or an anatomy file."),
    ] = None,
    seed: Annotated[
        int | None, typer.Option(help="Draw a case by published frequencies from this number.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Write the anatomy here, as TOML.")
    ] = None,
    figure: Annotated[
        Path | None, typer.Option(help="Draw it from two sides: .png, .svg or .pdf.")
    ] = None,
    shipped: Annotated[
        bool, typer.Option("--list", help="The anatomies that ship with the program.")
    ] = False,
    labels: Annotated[
        Path | None,
        typer.Option(
            help="Find the tubes in a volume of labels (NIfTI, NRRD, MetaImage, DICOM-SEG) or a "
            "folder of one mask a tube; -o is then a folder, for anatomy.toml and the organs."
        ),
    ] = None,
    names: Annotated[
        Path | None,
        typer.Option(
            help='Names of the labels, JSON: {"1": "gallbladder", "2": "cystic duct"}.',
            show_default="as the labels' file has them",
        ),
    ] = None,
    draw_artery: Annotated[
        bool,
        typer.Option(
            "--draw-artery",
            help="Draw a cystic artery into --labels that have none, by published frequencies.",
        ),
    ] = False,
    build_page: Annotated[
        bool,
        typer.Option(
            "--build-page",
            help="Choose tubes, joins and ends of --labels in the browser, save the case into -o, "
            "and practise on it.",
        ),
    ] = False,
    port: Annotated[int, typer.Option(help="Port of that page; 0 takes a free one.")] = 8080,
    mesh: Annotated[
        Path | None,
        typer.Option(
            help="Write the tubes' surfaces, each closed: .glb (by name), .stl, .ply or .obj; "
            ".zip has an .stl for each tube."
        ),
    ] = None,
    merged: Annotated[
        bool, typer.Option("--merged", help="Merge the tubes of --mesh into one closed surface.")
    ] = False,
    voxels: Annotated[
        Path | None,
        typer.Option(
            help="Write the tubes as labels of voxels with their names, .seg.nrrd, as a "
            "segmentation of 3D Slicer."
        ),
    ] = None,
    voxel_mm: Annotated[float, typer.Option(help="Size of the voxels, mm.")] = 0.5,
    as_json: AsJson = False,
) -> None:
    """Say what is in an anatomy of several tubes, draw one by frequencies, find one in labels.

    Examples: bluntdissect anatomy --list; bluntdissect anatomy normal --figure normal.png;
    bluntdissect anatomy --seed 7 -o case.toml;
    bluntdissect anatomy --labels labels.nii.gz --names labels.json -o case/
    """
    if (source is not None) + (seed is not None) + (labels is not None) + shipped != 1:
        raise ValueError("give an anatomy's name or file, --seed, --labels or --list")
    if names is not None and labels is None:
        raise ValueError("--names goes with --labels")
    if draw_artery and labels is None:
        raise ValueError("--draw-artery goes with --labels")
    if build_page and (labels is None or figure is not None or as_json):
        raise ValueError("--build-page goes with --labels, without --figure and --json")
    if merged and mesh is None:
        raise ValueError("--merged goes with --mesh")
    if mesh is not None:
        from app.anatomy.anatomy_mesh import mesh_suffix

        mesh_suffix(mesh, merged=merged)
        if shipped or labels is not None:
            raise ValueError("--mesh is of one anatomy: give its name or file, or --seed")
    if voxels is not None:
        from app.anatomy import labels_suffix

        labels_suffix(voxels)
        if shipped or labels is not None:
            raise ValueError("--voxels is of one anatomy: give its name or file, or --seed")
    if labels is not None:
        if build_page:
            _build_page(labels, names, output, port, draw_artery=draw_artery)
        else:
            _from_labels(labels, names, output, figure, draw_artery=draw_artery, as_json=as_json)
        return
    from app.anatomy import anatomy_toml, drawn_anatomy, read_anatomy, shipped_anatomies, tube_lines
    from organ_geometry import check_target, write_atomic

    if shipped:
        if output is not None or figure is not None:
            raise ValueError("--list writes no file; give an anatomy's name for one")
        found = [read_anatomy(path) for path in shipped_anatomies().values()]
        answer(
            [{"name": each.name, "title": each.title, "tubes": len(each.tube)} for each in found],
            [(each.name, each.title) for each in found],
            as_json=as_json,
        )
        return
    for target in (output, figure, mesh, voxels):
        if target is not None:
            check_target(target)
    if seed is not None:
        made = drawn_anatomy(seed)
    else:
        assert source is not None  # noqa: S101
        made = anatomy_from(source)
    lines = tube_lines(made)
    if figure is not None:
        from app.anatomy.figure import anatomy_figure, figure_kind

        write_atomic(figure, anatomy_figure(made, lines, figure_kind(figure)))
    if mesh is not None:
        write_atomic(mesh, _mesh(made, lines, mesh, merged=merged))
    if voxels is not None:
        from app.anatomy import anatomy_labels
        from organ_geometry import write_labels

        write_labels(anatomy_labels(made, lines, voxel_mm), voxels)
    if output is not None:
        write_atomic(output, anatomy_toml(made).encode())
    _report(made, lines, {}, [], as_json=as_json)


def _mesh(made: "Anatomy", lines: "dict[str, TubeLine]", path: Path, *, merged: bool) -> bytes:
    """Return the tubes' surfaces as a file of a name: a GLB with a rig for each tube."""
    from app.anatomy.anatomy_mesh import anatomy_mesh, mesh_suffix

    suffix = mesh_suffix(path, merged=merged)
    if suffix != ".glb":
        return anatomy_mesh(made, lines, suffix, merged=merged)
    from app.export.rigged_organ import rigged_tubes
    from app.simulation import Tubes

    return rigged_tubes(Tubes.of_anatomy(made))


def _from_labels(
    labels: Path,
    names: Path | None,
    folder: Path | None,
    figure: Path | None,
    *,
    draw_artery: bool,
    as_json: bool,
) -> None:
    """Find the tubes in labels, write them into a folder and say what was found."""
    from app.anatomy import named_labels, patient_case, tube_lines, write_case
    from app.command_line.answer import progress_bar
    from organ_geometry import check_target, read_labels, write_atomic

    folder = _case_folder(folder)
    if figure is not None:
        from app.anatomy.figure import figure_kind

        check_target(figure)
        figure_kind(figure)
    volume = read_labels(labels)
    named = named_labels(volume, names)
    with progress_bar("Finding tubes") as progress:
        case = patient_case(
            volume,
            named,
            name=folder.resolve().name,
            draw_artery=draw_artery,
            progress=progress,
        )
    write_case(case.anatomy, folder)
    lines = tube_lines(case.anatomy)
    if figure is not None:
        from app.anatomy.figure import anatomy_figure, figure_kind

        write_atomic(figure, anatomy_figure(case.anatomy, lines, figure_kind(figure)))
    size = sum(len(tube.built.organ.encoded) for tube in case.tubes.tubes)
    more: list[tuple[str, object]] = [
        ("touch", f"{touch.tube} lies against {touch.to} over {touch.length_mm:.1f} mm")
        for touch in case.anatomy.touch
    ]
    more += [("left out", name) for name in case.left_out]
    more += [("doubt", doubt) for doubt in case.doubts]
    more.append(("organs", f"{len(case.tubes.tubes)} in {size:,} bytes"))
    result: dict[str, object] = {
        "folder": str(folder),
        "organ_bytes": size,
        "left_out": list(case.left_out),
        "doubts": list(case.doubts),
    }
    _report(case.anatomy, lines, result, more, as_json=as_json)


def _case_folder(folder: Path | None) -> Path:
    """Return the folder to write a case into, or say why there is none."""
    if folder is None:
        raise ValueError("--labels needs -o, the folder to write the case into")
    if folder.exists() and not folder.is_dir():
        raise ValueError(f"cannot write into {folder}: it is a file; give a folder")
    return folder


def _build_page(
    labels: Path, names: Path | None, folder: Path | None, port: int, *, draw_artery: bool
) -> None:
    """Find the tubes in labels, and serve the page in which a case is made of them."""
    from itertools import count

    from app.anatomy import CaseBuilder, CaseChoices, CaseWorkbench, named_labels
    from app.command_line.answer import progress_bar
    from app.command_line.serving import serve, serving
    from organ_geometry import read_labels

    folder = _case_folder(folder)
    served = serving(port=port)
    volume = read_labels(labels)
    named = named_labels(volume, names)
    with progress_bar("Finding tubes") as progress:
        steps, step = 2 * len(named), count(1)

        def done() -> None:
            progress(min(next(step), steps), steps)

        builder = CaseBuilder(volume, named, folder.resolve().name, done=done)
        case = CaseWorkbench(builder, folder, CaseChoices(draw_artery=draw_artery), done=done)
    serve(
        lambda: served.start(scene="calot", case=case),
        lambda running: print(f"The case is ready: {running.link}", flush=True),
    )


def _report(
    made: "Anatomy",
    lines: "dict[str, TubeLine]",
    facts: dict[str, object],
    more: list[tuple[str, object]],
    *,
    as_json: bool,
) -> None:
    """Print an anatomy's tubes, joins and tissue, and what else is known of it."""
    from app.anatomy import anatomy_network

    tubes = [
        {
            "name": tube.name,
            "kind": tube.kind,
            "length_mm": round(lines[tube.name].length, 3),
            "least_radius_mm": round(float(lines[tube.name].radius.min()), 3),
            "most_radius_mm": round(float(lines[tube.name].radius.max()), 3),
            "wall_mm": tube.wall_mm,
        }
        for tube in made.tube
    ]
    joins = [
        {"tube": join.tube, "end": join.end, "to": join.to, "at_mm": join.at_mm}
        for join in made.join
    ]
    width = max(18, *(len(tube.name) + 1 for tube in made.tube))
    rows: list[tuple[str, object]] = [("anatomy", made.title or made.name)]
    rows += [("drawn", f"{name} {value}") for name, value in made.drawn.items()]
    for tube in made.tube:
        line = lines[tube.name]
        low, high = float(line.radius.min()), float(line.radius.max())
        thick = f"{low:.2f}" if high - low < 5e-3 else f"{low:.2f} to {high:.2f}"
        rows.append((tube.name, f"{tube.kind}, {line.length:.1f} mm long, radius {thick} mm"))
    for join in made.join:
        where = join.at_mm if isinstance(join.at_mm, str) else f"{join.at_mm:.1f} mm"
        rows.append(("join", f"end {join.end} of {join.tube} at {where} of {join.to}"))
    # Fewer than its layers ask for: none leads through a tube that it does not hold.
    strands = anatomy_network(made).strands.count
    rows.append(("tissue", f"{made.tissue}, {len(made.layer)} layers, {strands:,} strands"))
    result = {
        "name": made.name, "drawn": made.drawn, "tubes": tubes, "joins": joins, "strands": strands,
        **facts,
    }  # fmt: skip
    answer(result, [*rows, *more], as_json=as_json, width=width)
