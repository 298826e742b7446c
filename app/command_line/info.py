"""`bluntdissect info`: what is in an organ file, and which beds there are."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.command_line.answer import AsJson, answer

if TYPE_CHECKING:
    from organ_geometry import Organ


def info(
    organ: Annotated[Path | None, typer.Argument(help="The .organ file.")] = None,
    beds: Annotated[
        bool, typer.Option("--beds", help="The beds of a duct, their sources and confidence.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Say what is in an organ file, or which beds a duct can be laid in.

    Examples: bluntdissect info duct.organ, or bluntdissect info --beds
    """
    if beds == (organ is not None):
        raise ValueError("give either an .organ file or --beds")
    if organ is None:
        _list_beds(as_json=as_json)
        return
    from organ_geometry import FILE_VERSION, code_from_bytes, read_organ

    read = read_organ(organ)
    code = code_from_bytes(read.encoded)
    facts: dict[str, object] = {
        "file": str(organ),
        "version": FILE_VERSION,
        "bytes": len(read.encoded),
        "units": read.units,
        "hollow": read.hollow,
        "length_mm": read.length,
        "mean_radius_mm": read.mean_radius,
        "handedness": "left" if code.left_handed else "right",
        "first_mm": _point(read, 0),
        "last_mm": _point(read, -1),
        "tolerance_mm": read.tolerance_mm,
        "axis_keys": len(code.bends),
        "axis_step_mm": code.axis_step,
        "section_step_mm": code.section_step,
        "sections_kept": len(read.keys),
        "section_places": code.candidates + 1,
        "key_stations_mm": [round(float(station), 4) for station in read.key_stations],
    }
    wall = "hollow" if read.hollow else "solid"
    boundaries = "an outer boundary and a lumen" if read.hollow else "an outer boundary"
    lines = (
        ("file", f"{organ}, {len(read.encoded):,} bytes, version {FILE_VERSION}, checksum right"),
        (
            "organ",
            f"{wall}, {read.length:.2f} mm long, mean radius {read.mean_radius:.3f} mm",
        ),
        ("units", read.units if read.units == "mm" else f"{read.units}, read as mm"),
        (
            "frame",
            f"{facts['handedness']}-handed (right, down and along the images), "
            f"axis from {_text(read, 0)} to {_text(read, -1)} mm",
        ),
        ("promise", f"{read.tolerance_mm:.4f} mm RMS at every section it was built from"),
        (
            "axis",
            f"cubic spline through {len(code.bends)} keys in steps of {code.axis_step:.2g} mm",
        ),
        (
            "sections",
            f"{len(read.keys)} kept of {code.candidates + 1} places, each with {boundaries}, "
            f"in steps of {code.section_step:.2g} mm",
        ),
        ("at", ", ".join(f"{station:.1f}" for station in read.key_stations) + " mm"),
    )
    answer(facts, lines, as_json=as_json, width=10)


def _list_beds(*, as_json: bool) -> None:
    import textwrap

    import msgspec

    from app.simulation import bed_presets

    def wrapped(words: str) -> str:
        return textwrap.fill(words, 89).replace("\n", "\n" + " " * 11)

    beds = list(bed_presets().values())
    lines: list[tuple[str, str]] = []
    for bed in beds:
        lines += [
            (bed.name, f"{bed.title}: {bed.toughness_J_per_m2:g} J/m2 to part it"),
            ("", wrapped(bed.description)),
            ("source", wrapped(bed.source)),
            ("confidence", wrapped(f"{bed.confidence}. {bed.confidence_note}")),
        ]
    answer(msgspec.to_builtins(beds), lines, as_json=as_json, width=10)


def _point(organ: "Organ", place: int) -> list[float]:
    """Return an end of the axis in space, mm."""
    return [round(float(coordinate), 4) for coordinate in organ.axis[place]]


def _text(organ: "Organ", place: int) -> str:
    return "(" + ", ".join(f"{coordinate:.2f}" for coordinate in organ.axis[place]) + ")"
