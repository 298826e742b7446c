"""Options of a duct in its bed, which `solve` and `export` share."""

import json
from collections.abc import Mapping
from typing import Annotated

import typer

__all__ = [
    "BED_NAMES",
    "Bed",
    "BedSeed",
    "Elements",
    "Hook",
    "HookPath",
    "Lift",
    "Steps",
    "StrandCount",
    "check_options",
    "hook_path",
]

BED_NAMES = "normal, loose, firm, inflamed or scar"
"""For the help, which must not wait until the beds are read; a test compares."""

Bed = Annotated[
    str | None,
    typer.Option(
        help=f"Free the duct from a bed of strands that part: {BED_NAMES} (`info --beds`)."
    ),
]
BedSeed = Annotated[
    int, typer.Option("--seed", "--bed-seed", help="Bed: chooses its scattered strands.")
]
Hook = Annotated[
    float | None, typer.Option(help="Bed: mm from the first clamp; the middle if not given.")
]
Lift = Annotated[float | None, typer.Option(help="Bed: lift the hook so far off the bed, mm.")]
HookPath = Annotated[
    str | None,
    typer.Option(
        help="Bed: the hook's displacements from rest, mm, as JSON: a list of points of three "
        "numbers each."
    ),
]
Steps = Annotated[
    int, typer.Option(help="Bed: steps along the path; a motion has a key after each.")
]
Elements = Annotated[int, typer.Option(help="Bed: elements of the beam.")]
StrandCount = Annotated[
    int | None, typer.Option(help="Bed: how many strands; about 600 if not given.")
]


def check_options(
    bed: str | None, of_bed: Mapping[str, object], of_pull: Mapping[str, object]
) -> None:
    """Raise if options of a bed are given without one, or options of a pull with one.

    Both are by name, None where they are not given.
    """
    wrong = of_bed if bed is None else of_pull
    given = ", ".join(name for name, value in wrong.items() if value is not None)
    if given and bed is None:
        raise ValueError(f"{given} go with --bed")
    if given:
        raise ValueError(
            f"a duct in a --bed is a beam in space, pulled by --hook and --lift or --path in "
            f"--steps; leave out {given}"
        )


def hook_path(lift: float | None, path: str | None) -> tuple[tuple[float, float, float], ...]:
    """Return the hook's displacements from the options, mm."""
    if (lift is None) == (path is None):
        raise ValueError("give either --lift (mm) or --path '[[x,y,z],...]' (mm)")
    if path is None:
        assert lift is not None  # noqa: S101
        return ((0.0, 0.0, lift),)
    try:
        points = json.loads(path)
        return tuple((float(x), float(y), float(z)) for x, y, z in points)
    except (TypeError, ValueError, RecursionError):
        raise ValueError(f"--path must be JSON of points [[x,y,z],...] in mm, not {path}") from None
