"""`bluntdissect perform`: scripted hands at an anatomy, and what came of them."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.command_line.answer import AsJson, answer
from app.command_line.load import anatomy_from

if TYPE_CHECKING:
    from app.simulation import CriticalView, Event


def perform(
    script: Annotated[
        Path, typer.Argument(help="The script, a TOML file; docs/anatomy-file.md has its fields.")
    ],
    anatomy: Annotated[
        str, typer.Option(help="A shipped anatomy's name or an anatomy file.")
    ] = "normal",
    seed: Annotated[int | None, typer.Option(help="Instead: draw a case from this number.")] = None,
    relax: Annotated[
        bool, typer.Option("--relax", help="Let tissue and walls relax while they are held.")
    ] = False,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Write the run here, as JSON.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Let scripted hands dissect an anatomy; say what tore, bled and was clipped, and what is safe.

    Example: bluntdissect perform assets/scripts/hasty.toml --anatomy normal --json
    """
    import msgspec

    from app.anatomy import drawn_anatomy
    from app.simulation import FEW, Session, Specimen, performed, read_script, run_json
    from organ_geometry import check_target, write_atomic

    if output is not None:
        check_target(output)
    found = read_script(script)
    made = anatomy_from(anatomy) if seed is None else drawn_anatomy(seed)
    session = Session(Specimen.of_anatomy(made, relaxation=relax), vertices=FEW)
    try:
        done = performed(found, session)
    except ValueError as error:
        raise ValueError(f"{script}: {error}") from None
    run, reading = session.run_file(), session.reading()
    if output is not None:
        write_atomic(output, run_json(run))
    events = [_event(each) for each in session.spatial.events]
    view, clip, tenting = done.view, done.view_at_first_clip, done.tenting
    assert view is not None  # noqa: S101
    result = {
        "anatomy": made.name,
        "seconds": done.seconds,
        "events": events,
        "marks": [
            {"structure": each.structure, "tube": each.tube, "station_mm": each.station}
            for each in session.spatial.marks
        ],
        "critical_view": _view(view),
        "critical_view_at_first_clip": None if clip is None else _view(clip),
        "freed_all_round_mm": done.freed_mm,
        "tenting": None
        if tenting is None
        else {
            "diameters": tenting.diameters,
            "cystic_deg": tenting.cystic_deg,
            "upper_deg": tenting.upper_deg,
            "trap": done.trap,
        },
        "lost_ml": {each.name: each.lost_ml for each in reading.fluids},
        "peak_stress_ratio": reading.peak_stress_ratio,
        "strands": reading.strands,
        "strands_broken": reading.broken,
        "refused": done.refused,
        "metrics": msgspec.to_builtins(run.metrics),
    }
    lines: list[tuple[str, object]] = [
        ("anatomy", made.name),
        ("time", f"{done.seconds:.1f} s"),
        ("strands broken", f"{reading.broken} of {reading.strands}"),
        ("largest stress", f"{100.0 * reading.peak_stress_ratio:.0f} % of the strength"),
        *(("event", _words(each)) for each in events),
        *(("lost", f"{each.lost_ml:.3g} ml of {each.name}") for each in reading.fluids),
        ("critical view", f"{view.total} of 6{_torn(view)}"),
        ("  structures", f"{view.two_structures}: {_fractions(view)}"),
        ("  triangle", f"{view.triangle_cleared}: {view.triangle:.0%} parted"),
        ("  plate", f"{view.plate_freed}: {view.plate:.0%} of its lower third parted"),
        *(("freed all round", f"{name} {mm:.1f} mm") for name, mm in done.freed_mm.items()),
        *(("refused", each) for each in done.refused),
    ]
    if clip is not None:
        lines.append(("at first clip", f"{clip.total} of 6"))
    if done.trap:
        lines.append(("trap", "the common duct stood in one line with the cystic duct"))
    answer(result, lines, as_json=as_json)


def _event(event: "Event") -> dict[str, object]:
    from app.simulation import TICK_SECONDS

    return {
        "kind": event.kind,
        "time_s": event.tick * TICK_SECONDS,
        "tube": event.tube,
        "station_mm": event.station,
        "hand": None if event.hand is None else event.hand + 1,
    }


def _view(view: "CriticalView") -> dict[str, object]:
    return {
        "total": view.total,
        "two_structures": view.two_structures,
        "triangle_cleared": view.triangle_cleared,
        "plate_freed": view.plate_freed,
        "parted": {
            "structures": view.structures,
            "neck": view.neck,
            "triangle": view.triangle,
            "plate": view.plate,
        },
        "torn": list(view.torn),
    }


def _words(event: dict[str, object]) -> str:
    by = "" if event["hand"] is None else f", hand {event['hand']}"
    return (
        f"{event['kind']} of {event['tube']} at {event['station_mm']:.1f} mm after "
        f"{event['time_s']:.1f} s{by}"
    )


def _torn(view: "CriticalView") -> str:
    return f": nothing is safe, torn is {', '.join(view.torn)}" if view.torn else ""


def _fractions(view: "CriticalView") -> str:
    about = [f"{name} {fraction:.0%}" for name, fraction in view.structures.items()]
    return f"{', '.join(about)}, neck {view.neck:.0%} parted"
