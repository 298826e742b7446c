"""`bluntdissect replay`: a run that was downloaded, made again: its measures, or a file of it."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.command_line.load import organ_from

if TYPE_CHECKING:
    from app.simulation import Measures, Replay

__all__ = ["replay"]

PLAYED = (".glb", ".html")
"""Kinds of file that play a run, by suffix."""


def replay(
    run: Annotated[Path, typer.Argument(help="A run, as the trainer's JSON download.")],
    organ: Annotated[
        Path | None,
        typer.Option(help="The .organ file that it was made on; the shipped organ if not given."),
    ] = None,
    csv: Annotated[
        Path | None,
        typer.Option(help="File for the run tick by tick, as comma-separated values."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", help="File that plays the run: a rigged .glb or a page, .html."
        ),
    ] = None,
    frames: Annotated[
        int | None,
        typer.Option(
            help="With -o: keys up to the end or the tear.",
            show_default="each tick, at most 2,000; of a page 300",
        ),
    ] = None,
    edge_length: Annotated[
        float | None,
        typer.Option(
            help="With -o: length of the triangles' edges, mm.",
            show_default="0.5; of a page what keeps it small",
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> None:
    """Make a run again from its inputs and print its measures.

    Says whether they are those of the original, to the digit. With -o the run can be seen in other
    programs. Examples: bluntdissect replay run.json; bluntdissect replay run.json -o run.glb
    """
    import msgspec

    from app.simulation import MOST_BYTES, Replay, read_run, series_csv, versions

    if output is not None:
        _check_output(output)
    elif frames is not None or edge_length is not None:
        raise ValueError("--frames and --edge-length are of a file that plays the run: give -o")
    try:
        with run.open("rb") as file:
            content = file.read(MOST_BYTES + 1)
    except OSError as error:
        raise ValueError(f"cannot read {run}: {(error.strerror or str(error)).lower()}") from error
    original = read_run(content)
    if csv is not None and not csv.parent.is_dir():
        raise ValueError(f"no folder {csv.parent} to write {csv.name} into")
    again = Replay(original.log, organ_from(organ), vertices=300)
    found = again.run_file()
    same = original.agrees_with(found)
    others = {name: made for name, made in original.log.versions.items() if name in versions()}
    others = {name: made for name, made in others.items() if versions()[name] != made}
    played: dict[str, object] = {}
    if output is not None:
        played = _write_played(again, output, frames, edge_length)
    if csv is not None:
        csv.write_text(series_csv(again.series()))
    if as_json:
        outcome = None if found.outcome is None else msgspec.to_builtins(found.outcome)
        measures = msgspec.to_builtins(found.measures)
        facts = {"measures": measures, "outcome": outcome, "as_recorded": same, **played}
        if found.log.exercise is not None:
            facts["exercise_inputs"] = found.log.exercise_inputs
        print(json.dumps(facts))
        return
    for name, value in _lines(found.measures):
        print(f"{name:<28} {value}")
    if found.outcome is not None:
        print(f"{'exercise':<28} {'passed' if found.outcome.passed else 'not passed'}: ", end="")
        print(found.outcome.reason)
    if found.log.exercise is not None:
        by_hand = found.log.exercise_inputs == "hand"
        print(f"{'done with':<28} {'the hand alone' if by_hand else 'sliders and keys allowed'}")
    made = ", ".join(f"{name} {version}" for name, version in others.items())
    note = f"; it was made with {made}" if others else ""
    print(f"{'as recorded':<28} {'yes, to the digit' if same else f'no{note}'}")
    if played:
        print(f"{output}: the run in {played['keys']:,} keys, {played['bytes']:,} bytes")


def _check_output(path: Path) -> None:
    from organ_geometry import check_target

    if path.suffix.lower() not in PLAYED:
        raise ValueError(
            f"cannot write {path}: a run is played by one of {', '.join(PLAYED)}; its name must "
            f"end so"
        )
    check_target(path)


def _write_played(
    again: "Replay", path: Path, frames: int | None, edge_length: float | None
) -> dict[str, object]:
    """Write a file that plays a run, and return its description."""
    from app.export.motion import MOST_FRAMES
    from app.export.recorded_run import RecordedRun
    from organ_geometry import write_atomic

    if path.suffix.lower() == ".glb":
        run = RecordedRun.of(again, frames=MOST_FRAMES if frames is None else frames)
        content = run.rigged(edge_length=0.5 if edge_length is None else edge_length)
    else:
        from app.trainer.pages.html_player import PAGE_FRAMES, page_edge_length, run_page

        run = RecordedRun.of(again, frames=PAGE_FRAMES if frames is None else frames)
        edges = page_edge_length(run.dissection.organ) if edge_length is None else edge_length
        content = run_page(run, edge_length=edges).encode()
    write_atomic(path, content)
    return {"file": str(path), "bytes": len(content), "keys": len(run.motion.times)}


def _lines(measures: "Measures") -> list[tuple[str, str]]:
    def figure(value: float | None, unit: str) -> str:
        return "none" if value is None else f"{value!r} {unit}".rstrip()

    torn = measures.tear
    lines = [
        ("time", figure(measures.time_s, "s")),
        ("maximum force", figure(measures.maximum_force_N, "N")),
        ("mean absolute non-zero force", figure(measures.mean_absolute_nonzero_force_N, "N")),
        ("standard deviation of it", figure(measures.force_sd_N, "N")),
        ("force-time product", figure(measures.force_time_product_N_s, "N s")),
        (
            "time over threshold",
            f"{measures.time_over_threshold_s!r} s over {measures.task_threshold_N!r} N",
        ),
        ("maximum rate of loading", figure(measures.maximum_loading_rate_N_per_s, "N/s")),
        ("overshoot", figure(measures.overshoot, "of the goal")),
        ("path length", figure(measures.path_length_mm, "mm")),
        ("economy of motion", figure(measures.economy_of_motion, "")),
        (
            "smoothness",
            "too short"
            if measures.smoothness is None and measures.path_length_mm > 0.0
            else figure(measures.smoothness, "(log dimensionless jerk)"),
        ),
        ("smallest distance to break", figure(measures.smallest_distance_to_break, "")),
    ]
    if torn is None:
        return [*lines, ("tear", "none")]
    return [
        *lines,
        (
            "tear",
            f"at {torn.time_s!r} s under {torn.force_N!r} N, {torn.station_mm:.6g} mm from the "
            f"first clamp: {torn.criterion}",
        ),
    ]
