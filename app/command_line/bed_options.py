"""Options of a duct in its bed, which `solve` and `export` share."""

import json
from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import Annotated

import typer

from app.command_line.shared_options import given_options

BED_NAMES = "normal, loose, firm, inflamed or scar"
"""For the help, which must not wait until the beds are read; a test compares."""


@dataclass(frozen=True, slots=True)
class BedOptions:
    """The options as they are given; the fields' names are those of the options."""

    bed: Annotated[
        str | None,
        typer.Option(
            help=f"Free the duct from a bed of strands that part: {BED_NAMES} (`info --beds`)."
        ),
    ] = None
    hook: Annotated[
        float | None, typer.Option(help="Bed: mm from the first clamp; the middle if not given.")
    ] = None
    lift: Annotated[
        float | None, typer.Option(help="Bed: lift the hook so far off the bed, mm.")
    ] = None
    path: Annotated[
        str | None,
        typer.Option(
            help="Bed: the hook's displacements from rest, mm, as JSON: a list of points of three "
            "numbers each."
        ),
    ] = None
    strands: Annotated[
        int | None, typer.Option(help="Bed: how many strands; about 600 if not given.")
    ] = None
    seed: Annotated[
        int, typer.Option("--seed", "--bed-seed", help="Bed: chooses its scattered strands.")
    ] = 1
    steps: Annotated[
        int, typer.Option(help="Bed: steps along the path; a motion has a key after each.")
    ] = 60
    elements: Annotated[int, typer.Option(help="Bed: elements of the beam.")] = 80

    def check(
        self, context: typer.Context, *, of_bed: Iterable[str] = (), of_pull: Iterable[str]
    ) -> None:
        """Raise if options of a bed are given without one, or options of a pull with one.

        Both are parameters' names; `of_bed` are those besides the fields.
        """
        own = [each.name for each in fields(self) if each.name != "bed"]
        if self.bed is None:
            if given := given_options(context, [*own, *of_bed]):
                raise ValueError(f"{', '.join(given)} go with --bed")
        elif given := given_options(context, of_pull):
            raise ValueError(
                f"a duct in a --bed is a beam in space, pulled by --hook and --lift or --path in "
                f"--steps; leave out {', '.join(given)}"
            )

    def hook_path(self) -> tuple[tuple[float, float, float], ...]:
        """Return the hook's displacements, mm."""
        if (self.lift is None) == (self.path is None):
            raise ValueError("give either --lift (mm) or --path '[[x,y,z],...]' (mm)")
        if self.lift is not None:
            return ((0.0, 0.0, self.lift),)
        try:
            points = json.loads(self.path or "")
            return tuple((float(x), float(y), float(z)) for x, y, z in points)
        except (TypeError, ValueError, RecursionError):
            raise ValueError(
                f"--path must be JSON of points [[x,y,z],...] in mm, not {self.path}"
            ) from None
