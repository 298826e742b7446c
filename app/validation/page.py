"""The validation page: tables, figures and where beam theory stops being right."""

import math
from collections.abc import Mapping, Sequence

from app.validation.bed_checks import BedCheck
from app.validation.comparison import Comparison, SolidErrors
from app.validation.figures import FIGURES

__all__ = ["beds_table", "errors_table", "page", "rows_table", "solids_table"]

INTRODUCTION = """\
# Validation

Made by `bluntdissect validate -o docs`. The thesis compares its beam with 40 ANSYS beam
elements on a half of 1 inch, under P on that half (the grasper's whole force is 2P). Deflections
are in inch, loads in lbf, as published. Errors are against the ANSYS column, whose figures have
three to five digits.

ANSYS's elements here have no shear and leave a stretch factor out of the moment's balance.
`fem` is that model, element by element, and reproduces the column; `exact` is the consistent
geometrically exact beam, which deflects up to 3.5 % more. With shear, and with a material law
for large strains, the beam moves away from ANSYS and towards three-dimensional solids: **a
smaller error against ANSYS is not a better duct.**
"""

LIMITS = """\
## Where beam theory stops being right

- **Short ducts and shear.** The bile duct of the thesis is under six diameters long. Its claim
  that shear is negligible (5.2) does not hold: already at small loads the beam without shear is
  far stiffer than a solid of the same shape (table above).
- **The material's law.** At P = 0.4 lbf strains reach tens of percent. A linear law between
  engineering stress and strain is one choice of many, and the choice matters most at the
  largest loads (table above).
- **Edges at the clamps.** In a solid the stress at the edge of a clamp grows with every
  refinement of the mesh: no threshold can be read off it. A beam's stress there is finite
  because its sections stay plane. A threshold belongs to the theory and law that it was
  calibrated with.
- **The wall.** Sections keep their shape here. A hollow duct flattens where it is bent and
  where it is held, which makes it softer; nothing here sees that.
- **The tissue.** Young's moduli published for bile ducts and their neighbours differ by a
  factor of about 200, the strength of a bile duct is not published, and tissue creeps, stiffens
  and differs lengthwise and around. No validation of the beam says anything about a patient.
"""


SOLIDS = """\
## Against three-dimensional solids

Errors in % against quadratic bricks of a compressible neo-Hookean solid of the same duct, both
ends fixed (CalculiX C3D20R, converged to 0.07 %): with a central grasp at the lowest and the
highest load that the solids reach and the largest of all loads, and the largest with a grasp at
30 % of the span. Below zero the beam is too stiff.
"""


HOLLOW = """\
**Hollow sections** have no solid here to be held against, only an argument: the law's three fibres
reproduce a ring's area and its second and fourth moments of area exactly, as they do a disc's, so
that stretch and bending of a ring are integrated to the same order as those of a disc; the shear
coefficient is the ring's own, and at small loads the beam is Timoshenko's. What a solid ring does
besides, to flatten, is not in it.
"""


BEDS = """\
## A duct on its bed

The beam in space on strands that yield and part, beside closed forms, published figures, finer
scenes and its mirror image; docs/peel.md has such scenes' fields, docs/theory.md the equations.
*Open* is the part of the work that the energy balance leaves unexplained. Newton's tangent is held
against differences of the energy by `tests/physics/test_space_beam.py`; `python -m
benchmarks.random_pulls` pulls at random.
"""


def page(
    comparisons: Sequence[Comparison],
    solids: Sequence[Sequence[SolidErrors]],
    held_out: Mapping[tuple[float, float], float],
    beds: Sequence[BedCheck],
) -> str:
    """Return the page in Markdown."""
    parts = [INTRODUCTION, "## Errors against ANSYS, max / mean %\n", errors_table(comparisons)]
    parts += [SOLIDS, solids_table(solids)]
    parts.append(
        "Against solids of E = 45 psi that nothing was fitted to, the exact beam with shear and "
        "the neo-Hookean law is off by at most "
        + ", ".join(
            f"{error:+.2f} % (d = {diameter:g} inch, Poisson's ratio {poisson_ratio:g})"
            for (diameter, poisson_ratio), error in held_out.items()
        )
        + ".\n"
    )
    parts.append(HOLLOW)
    parts += [BEDS, beds_table(beds)]
    parts.append("## The thesis's own figures\n")
    parts.append(
        "Largest difference between what the thesis printed as 'calculated' and the same theory "
        "here: "
        + ", ".join(
            f"table {each.table.number} {each.calculated_difference:.1e} inch"
            for each in comparisons
        )
        + ". Half a unit of the last printed digit is 5e-10 inch; docs/theory.md says which "
        "sections the thesis rounded.\n"
    )
    parts.append("## Figures\n")
    parts += [f"![{title}](validation/{name}.svg)\n" for name, title in FIGURES.items()]
    for comparison in comparisons:
        table = comparison.table
        parts.append(f"## Table {table.number}: {table.title}, E = {table.modulus:g} psi\n")
        parts.append(rows_table(comparison))
    parts.append(LIMITS)
    return "\n".join(parts)


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
    return _markdown(head, rows)


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
    return _markdown(head, rows)


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
    return _markdown(head, rows)


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
    return _markdown(head, rows)


def _deflection(value: float) -> str:
    return "none" if math.isnan(value) else f"{value:.6f}"


def _markdown(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
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
