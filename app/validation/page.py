"""The validation page: tables, figures and where beam theory stops being right."""

import math
from collections.abc import Mapping, Sequence
from importlib.resources import files

from app.validation.bed_checks import BedCheck
from app.validation.comparison import Comparison, HollowErrors, SolidErrors
from app.validation.figures import FIGURES


def page(
    comparisons: Sequence[Comparison],
    solids: Sequence[Sequence[SolidErrors]],
    held_out: Mapping[tuple[float, float], float],
    hollow: Sequence[HollowErrors],
    beds: Sequence[BedCheck],
) -> str:
    """Return the page in Markdown."""
    blocks = {
        "errors": errors_table(comparisons),
        "solids": solids_table(solids),
        "held_out": ", ".join(
            f"{error:+.2f} % (d = {diameter:g} inch, Poisson's ratio {poisson_ratio:g})"
            for (diameter, poisson_ratio), error in held_out.items()
        ),
        "hollow": hollow_table(hollow),
        "beds": beds_table(beds),
        "differences": ", ".join(
            f"table {each.table.number} {each.calculated_difference:.1e} inch"
            for each in comparisons
        ),
        "figures": "\n\n".join(
            f"![{title}](validation/{name}.svg)" for name, title in FIGURES.items()
        ),
        "tables": "\n".join(
            f"## Table {each.table.number}: {each.table.title}, E = {each.table.modulus:g} psi\n\n"
            f"{rows_table(each)}"
            for each in comparisons
        ),
    }
    words = files("app.validation").joinpath("page.md").read_text(encoding="utf-8")
    return words.format(**{name: block.rstrip() for name, block in blocks.items()})


def errors_table(comparisons: Sequence[Comparison]) -> str:
    """Return the errors of every theory in Markdown."""
    head = ["theory", *(comparison.table.number for comparison in comparisons)]
    rows = [
        [
            column.name,
            *(
                f"{comparison.columns[index].max_error:.3g} / "
                f"{comparison.columns[index].mean_error:.3g}"
                for comparison in comparisons
            ),
        ]
        for index, column in enumerate(comparisons[0].columns)
    ]
    return markdown_table(head, rows)


def hollow_table(hollow: Sequence[HollowErrors]) -> str:
    """Return the errors against solid tubes in Markdown."""
    head = ["wall / diameter", "force, N", "solid, mm", "stress / E", "plane, %", "space, %"]
    rows: list[list[str]] = []
    for each in hollow:
        fraction = f"{each.solid.wall:g} / {each.solid.diameter:g} mm"
        for (force, deflection), stress, plane, space in zip(
            each.solid.curve.items(), each.stress, each.plane, each.space, strict=True
        ):
            figures = [f"{force:g}", f"{deflection:.4g}", f"{stress:.2f}"]
            rows.append([fraction, *figures, f"{plane:+.2f}", f"{space:+.2f}"])
            fraction = ""
    return markdown_table(head, rows)


def solids_table(solids: Sequence[Sequence[SolidErrors]]) -> str:
    """Return the errors against solids in Markdown."""
    head = ["theory", *(f"{row[0].table}: low, high, max; at 30 %" for row in solids)]
    rows = [
        [
            each.name,
            *(
                f"{row[index].lowest:+.2f}, {row[index].highest:+.2f}, "
                f"{row[index].largest:+.2f}; {row[index].largest_off_centre:+.2f}"
                for row in solids
            ),
        ]
        for index, each in enumerate(solids[0])
    ]
    return markdown_table(head, rows)


def beds_table(beds: Sequence[BedCheck]) -> str:
    """Return a beam on its bed beside what it is held against, in Markdown."""
    head = ["scene", "figure", "here", "held against", "error, %", "open"]
    rows = [
        [
            each.name,
            each.quantity,
            f"{each.found:.5g}",
            f"{each.expected:.5g}",
            f"{each.error:+.2f}",
            f"{each.unexplained:.0e}",
        ]
        for each in beds
    ]
    return markdown_table(head, rows)


def rows_table(comparison: Comparison) -> str:
    """Return a table of the thesis with our columns beside it, in Markdown."""
    head = ["P, lbf", "thesis", "ANSYS", *(column.name for column in comparison.columns)]
    rows = [
        [
            f"{force:g}",
            f"{float(calculated):.6f}",
            f"{ansys:g}",
            *(_deflection(column.deflections[index]) for column in comparison.columns),
        ]
        for index, (force, calculated, ansys) in enumerate(comparison.table.rows)
    ]
    return markdown_table(head, rows)


def _deflection(value: float) -> str:
    return "none" if math.isnan(value) else f"{value:.6f}"


def markdown_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table in Markdown, its columns as wide as their widest cells."""
    widths = [max(len(line[index]) for line in (head, *rows)) for index in range(len(head))]
    lines = [head, ["-" * (width - 1) + ":" for width in widths], *rows]
    return (
        "\n".join(
            "| "
            + " | ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True))
            + " |"
            for line in lines
        )
        + "\n"
    )
