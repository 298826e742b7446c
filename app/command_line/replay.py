"""`bluntdissect replay`: a run that was downloaded, made again: its measures, or a file of it."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.command_line.answer import AsJson, answer
from app.command_line.load import organ_from

if TYPE_CHECKING:
    from app.simulation import Incident, Metrics, RunLog
    from organ_geometry import Organ

# Kinds of file that play a run, and those that have its end, by suffix.
PLAYED = (".glb", ".html", ".pvd", ".webm", ".webp")
FILMS = (".webm", ".webp")
MOMENT = (".vtp", ".stl", ".ply", ".obj", ".zip")
SERIES_FRAMES = 60
MOST_ERRORS = 20


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
            "--output",
            "-o",
            help="File of the run: a rigged .glb, a page, .html, or a series with stresses, .pvd; "
            "at an anatomy also a film, .webm or .webp; its end as .vtp, .stl, .ply, .obj, "
            "or .zip with an .stl for each tube.",
        ),
    ] = None,
    frames: Annotated[
        int | None,
        typer.Option(
            help="With -o: keys up to the end or the tear.",
            show_default="each tick, at most 2,000; of a page 300, of a series 60, "
            "of a film 10 a second, at most 200",
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
    """Make a run again from its inputs, of a pull or of a dissection; print measures and errors.

    Says whether they are those of the original, to 12 digits. With -o the run can be seen in other
    programs. Examples: bluntdissect replay run.json; bluntdissect replay run.json -o run.glb
    """
    import msgspec

    from app.bounded_file import read_bounded
    from app.simulation import MOST_BYTES, Replay, read_run
    from app.versions import versions
    from organ_geometry import check_target, write_atomic

    if output is None and (frames is not None or edge_length is not None):
        raise ValueError("--frames and --edge-length are of a file of the run: give -o")
    original = read_run(read_bounded(run, MOST_BYTES, "run"))
    if output is not None:
        _check_output(output, original.log, frames)
    if csv is not None:
        check_target(csv)
    shape = organ_from(organ)
    again = Replay(original.log, shape)
    found = again.run_file()
    same = original.agrees_with(found)
    rows = "" if csv is None else again.series().csv()
    incidents = again.incidents()
    lines = _lines(found.metrics)
    facts: dict[str, object] = {}
    if found.log.exercise is not None and found.log.start.theory is not None:
        facts = {"exercise_inputs": found.log.exercise_inputs}
    played = (
        {} if output is None else _write_played(original.log, shape, output, frames, edge_length)
    )
    if csv is not None:
        write_atomic(csv, rows.encode())
    outcome = found.outcome
    result = {
        "metrics": found.metrics,
        "outcome": None if outcome is None else msgspec.to_builtins(outcome),
        "as_recorded": same,
        "incidents": [_incident(each) for each in incidents],
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
    lines += _errors(incidents)
    answer(result | played | facts, lines, as_json=as_json, width=28)
    if played and not as_json:
        what = "the end of the run" if played["keys"] == 1 else f"the run in {played['keys']} keys"
        print(f"{output}: {what}, {played['bytes']:,} bytes")


def _check_output(path: Path, log: "RunLog", frames: int | None) -> None:
    """Raise if a file of a run cannot be written."""
    from app.export.vtk_series import check_series_path
    from organ_geometry import check_target

    suffix, kinds = path.suffix.lower(), (*PLAYED, *MOMENT)
    if suffix not in kinds:
        raise ValueError(
            f"cannot write {path}: a run is written as one of {', '.join(kinds)}; its name must "
            f"end so"
        )
    if suffix in FILMS and log.start.anatomy is None:
        raise ValueError(f"cannot write {path}: a film is of a run at an anatomy; take an .html")
    if suffix not in (".glb", ".html") and log.start.theory is not None:
        raise ValueError(
            f"cannot write {path}: of a pull without a bed a run is a .glb or an .html; "
            f"bluntdissect export writes its meshes"
        )
    if suffix in MOMENT and frames is not None:
        raise ValueError(f"--frames is of a file that plays the run; {suffix} has its end")
    if suffix == ".pvd":
        check_series_path(path)
    else:
        check_target(path)


def _write_played(
    log: "RunLog",
    organ: "Organ",
    path: Path,
    frames: int | None,
    edge_length: float | None,
) -> dict[str, object]:
    """Write a file of a run, and return its description."""
    from app.export.motion import MOST_FRAMES, PAGE_FRAMES
    from app.export.organ_export import write_moment, write_moments
    from app.export.recorded_run import rigged_runs, run_snapshots
    from app.export.recorded_tubes import recorded_runs
    from organ_geometry import write_atomic

    suffix = path.suffix.lower()
    if log.start.anatomy is not None and suffix in (".html", *FILMS):
        return _write_seen(log, organ, path, frames)
    if frames is None:
        most = {".glb": MOST_FRAMES, ".html": PAGE_FRAMES, ".pvd": SERIES_FRAMES}
        frames = most.get(suffix, 2)
    runs = recorded_runs(log, organ, frames=frames)
    edges = 0.5 if edge_length is None else edge_length
    keys = len(runs[0].motion.times)
    if suffix == ".pvd":
        result = write_moments(run_snapshots(runs, edge_length=edges), path)
        keys = len({*runs[0].motion.times.tolist()})
    elif suffix in MOMENT:
        ((_, moment),) = run_snapshots(runs, edge_length=edges, last=True)
        result, keys = write_moment(moment, path), 1
    else:
        if suffix == ".glb":
            content = rigged_runs(runs, edge_length=edges)
        else:
            from app.trainer.pages.html_player import page_edge_length, run_page

            (run,) = runs
            edges = page_edge_length(run.dissection.organ) if edge_length is None else edge_length
            content = run_page(run, edge_length=edges).encode()
        write_atomic(path, content)
        return {"file": str(path), "files": 1, "bytes": len(content), "keys": keys}
    size = sum(file.stat().st_size for file in result.files)
    return {
        "file": str(path),
        "files": len(result.files),
        "bytes": size,
        "keys": keys,
        "surfaces": list(result.surfaces),
    }


def _write_seen(log: "RunLog", organ: "Organ", path: Path, frames: int | None) -> dict[str, object]:
    """Write a run at an anatomy as it was seen through the scope, and return its description."""
    from app.export.motion import PAGE_FRAMES, check_frames
    from app.simulation import Replay
    from organ_geometry import write_atomic

    if frames is not None:
        check_frames(frames)
    if not log.ticks:
        raise ValueError("a run of no ticks has nothing to play; move a hand, and wait")
    again = Replay(log, organ)
    if path.suffix.lower() == ".html":
        from app.trainer.pages.scope_player import scope_page

        keys = min(PAGE_FRAMES if frames is None else frames, log.ticks + 1)
        write_atomic(path, scope_page(again, frames=keys).encode())
    else:
        from app.trainer.pages.scope_film import write_film

        keys = write_film(again, path, pictures=frames)
    return {"file": str(path), "files": 1, "bytes": path.stat().st_size, "keys": keys}


def _lines(metrics: "Metrics") -> list[tuple[str, str]]:
    """Return each metric's name, and its value and unit."""
    from app.anatomy import tube_title
    from app.simulation import METRICS

    lines = [
        (
            each.name(metrics)[:1].lower() + each.name(metrics)[1:],
            _value(metrics[each.key], each.factor, each.unit),
        )
        for each in METRICS
        if each.key in metrics
    ]
    if metrics.get("smoothness", 0.0) is None and metrics["path_length_mm"] > 0.0:
        lines = [(name, "too short" if name == "smoothness" else text) for name, text in lines]
    tear = metrics["tear"]
    if tear is None:
        return [*lines, ("tear", "none")]
    force = f" under {tear['force_N']:.6g} N" if "force_N" in tear else ""
    tube = tear.get("tube")
    end = "the first clamp" if tube is None else f"the first end of the {tube_title(tube)}"
    at = f"at {tear['time_s']:.6g} s{force}, {tear['station_mm']:.6g} mm from {end}"
    return [*lines, ("tear", at)]


def _incident(incident: "Incident") -> dict[str, object]:
    """Return an incident as JSON has it, its hand counted from 1."""
    import msgspec

    from app.simulation import ERROR_CLASSES

    kind = ERROR_CLASSES[incident.error]
    plain: dict[str, object] = msgspec.to_builtins(incident)
    hand = None if incident.hand is None else incident.hand + 1
    return plain | {
        "hand": hand, "title": kind.title, "mode": kind.mode, "sentence": incident.sentence,
    }  # fmt: skip


def _errors(incidents: "list[Incident]") -> list[tuple[str, str]]:
    """Return the errors of a run as lines, at most `MOST_ERRORS`."""
    from app.simulation import ERROR_CLASSES

    if not incidents:
        return [("errors", "none")]
    lines = [
        (
            "error" + ("" if each.hand is None else f" of hand {each.hand + 1}"),
            f"{ERROR_CLASSES[each.error].title}; consequence: {each.consequence}. {each.sentence}",
        )
        for each in incidents[:MOST_ERRORS]
    ]
    more = len(incidents) - MOST_ERRORS
    return [*lines, ("", f"and {more:,} more: see --json")] if more > 0 else lines


def _value(value: float | Sequence[float] | None, factor: float, unit: str) -> str:
    """Return a metric as the page shows it; --json has all digits."""
    if value is None:
        return "none"
    values = value if isinstance(value, Sequence) else (value,)
    return f"{' and '.join(f'{factor * each:.6g}' for each in values)} {unit}".rstrip()
