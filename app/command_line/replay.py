"""`bluntdissect replay`: a run that was downloaded, made again: its measures, or a file of it."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.command_line.answer import AsJson, answer
from app.command_line.load import organ_from

if TYPE_CHECKING:
    from app.simulation import Measures, Replay
    from app.simulation.bed import DissectionMeasures, DissectionReplay

__all__ = ["replay"]

# Kinds of file that play a run, by suffix.
PLAYED = (".glb", ".html")


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
    as_json: AsJson = False,
) -> None:
    """Make a run again from its inputs, of a pull or of a dissection, and print its measures.

    Says whether they are those of the original, to 12 digits. With -o the run can be seen in other
    programs. Examples: bluntdissect replay run.json; bluntdissect replay run.json -o run.glb
    """
    import msgspec

    from app.bounded_file import read_bounded
    from app.simulation import MOST_BYTES, Replay, series_csv
    from app.simulation.bed import DissectionFile, DissectionReplay, dissection_csv, read_any_run
    from app.versions import versions
    from organ_geometry import check_target, write_atomic

    if output is not None:
        _check_output(output)
    elif frames is not None or edge_length is not None:
        raise ValueError("--frames and --edge-length are of a file that plays the run: give -o")
    original = read_any_run(read_bounded(run, MOST_BYTES, "run"))
    if csv is not None:
        check_target(csv)
    shape = organ_from(organ)
    again: DissectionReplay | Replay
    facts: dict[str, object] = {}
    if isinstance(original, DissectionFile):
        again = DissectionReplay(original.log, shape, vertices=300)
        found = again.run_file()
        same = original.agrees_with(found)
        rows = "" if csv is None else dissection_csv(again.series())
        lines = _dissection_lines(found.measures)
    else:
        again = Replay(original.log, shape, vertices=300)
        found = again.run_file()
        same = original.agrees_with(found)
        rows = "" if csv is None else series_csv(again.series())
        lines = _lines(found.measures)
        if found.log.exercise is not None:
            facts = {"exercise_inputs": found.log.exercise_inputs}
    played = {} if output is None else _write_played(again, output, frames, edge_length)
    if csv is not None:
        write_atomic(csv, rows.encode())
    outcome = found.outcome
    result = {
        "measures": msgspec.to_builtins(found.measures),
        "outcome": None if outcome is None else msgspec.to_builtins(outcome),
        "as_recorded": same,
    }
    if outcome is not None:
        passed = "passed" if outcome.passed else "not passed"
        lines.append(("exercise", f"{passed}: {outcome.reason}"))
    if facts:
        by_hand = facts["exercise_inputs"] == "hand"
        lines.append(("done with", "the hand alone" if by_hand else "sliders and keys allowed"))
    made = ", ".join(
        f"{name} {version}"
        for name, version in original.log.versions.items()
        if versions().get(name, version) != version
    )
    note = f"; it was made with {made}" if made else ""
    lines.append(("as recorded", "yes, to 12 digits" if same else f"no{note}"))
    answer(result | played | facts, lines, as_json=as_json, width=28)
    if played and not as_json:
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
    again: "DissectionReplay | Replay", path: Path, frames: int | None, edge_length: float | None
) -> dict[str, object]:
    """Write a file that plays a run, and return its description."""
    from app.export.motion import MOST_FRAMES, PAGE_FRAMES
    from app.export.recorded_run import RecordedRun
    from app.simulation.bed import DissectionReplay
    from organ_geometry import write_atomic

    rigged = path.suffix.lower() == ".glb"
    if frames is None:
        frames = MOST_FRAMES if rigged else PAGE_FRAMES
    if isinstance(again, DissectionReplay):
        run = RecordedRun.of_dissection(again, frames=frames)
    else:
        run = RecordedRun.of(again, frames=frames)
    if rigged:
        content = run.rigged(edge_length=0.5 if edge_length is None else edge_length)
    else:
        from app.trainer.pages.html_player import page_edge_length, run_page

        edges = page_edge_length(run.dissection.organ) if edge_length is None else edge_length
        content = run_page(run, edge_length=edges).encode()
    write_atomic(path, content)
    return {"file": str(path), "bytes": len(content), "keys": len(run.motion.times)}


def _figure(value: float | None, unit: str = "") -> str:
    return "none" if value is None else f"{value!r} {unit}".rstrip()


def _dissection_lines(measures: "DissectionMeasures") -> list[tuple[str, str]]:
    def both(values: tuple[float, float], unit: str) -> str:
        return f"{values[0]!r} and {values[1]!r} {unit}".rstrip()

    found, torn = measures, measures.tear
    return [
        ("time", _figure(found.time_s, "s")),
        ("freed length", _figure(found.freed_mm, "mm")),
        ("longest freed stretch", _figure(found.longest_freed_stretch_mm, "mm")),
        ("strands parted", f"{found.strands_parted} of {found.strands}"),
        ("by each hand", both(found.strands_parted_by_hand, "")),
        ("against an instrument", str(found.strands_parted_by_instrument)),
        ("out of sight", str(found.strands_parted_out_of_sight)),
        (
            "peak stress share",
            f"{found.peak_stress_share!r} of the break, {found.peak_stress_station_mm:.6g} mm from "
            f"the first clamp",
        ),
        ("smallest distance to break", _figure(found.smallest_distance_to_break)),
        ("time above half of the break", _figure(found.time_above_half_s, "s")),
        ("shortest time to break", _figure(found.shortest_time_to_break_s, "s")),
        ("work of each hand", both(found.work_mJ, "mJ")),
        ("energy parted", _figure(found.parted_energy_mJ, "mJ")),
        ("most energy in the duct", _figure(found.duct_energy_mJ, "mJ")),
        ("economy of work", _figure(found.economy_of_work)),
        ("maximum force of each hand", both(found.maximum_force_N, "N")),
        ("force-time product of each", both(found.force_time_product_N_s, "N s")),
        ("maximum instrument force", _figure(found.maximum_instrument_force_N, "N")),
        ("direction of traction", _figure(found.traction_angle_deg, "degrees off straight up")),
        (
            "tear",
            "none"
            if torn is None
            else f"at {torn.time_s!r} s, {torn.station_mm:.6g} mm from the first clamp",
        ),
    ]


def _lines(measures: "Measures") -> list[tuple[str, str]]:
    torn = measures.tear
    lines = [
        ("time", _figure(measures.time_s, "s")),
        ("maximum force", _figure(measures.maximum_force_N, "N")),
        ("mean absolute non-zero force", _figure(measures.mean_absolute_nonzero_force_N, "N")),
        ("standard deviation of it", _figure(measures.force_sd_N, "N")),
        ("force-time product", _figure(measures.force_time_product_N_s, "N s")),
        (
            "time over threshold",
            f"{measures.time_over_threshold_s!r} s over {measures.task_threshold_N!r} N",
        ),
        ("maximum rate of loading", _figure(measures.maximum_loading_rate_N_per_s, "N/s")),
        ("overshoot", _figure(measures.overshoot, "of the goal")),
        ("path length", _figure(measures.path_length_mm, "mm")),
        ("economy of motion", _figure(measures.economy_of_motion, "")),
        (
            "smoothness",
            "too short"
            if measures.smoothness is None and measures.path_length_mm > 0.0
            else _figure(measures.smoothness, "(log dimensionless jerk)"),
        ),
        ("smallest distance to break", _figure(measures.smallest_distance_to_break, "")),
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
