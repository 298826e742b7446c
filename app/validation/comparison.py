"""The theories held against a table of the thesis: deflections, and errors against ANSYS."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.validation.thesis_tables import INCH, LBF, Table
from physics import Cubic, Exact, Fem, MassSpring, NoEquilibrium, TautString, Theory

__all__ = ["COMPARED", "Column", "Comparison", "compared"]

COMPARED: Mapping[str, Theory] = {
    "cubic": Cubic(),
    "cubic, fitted q": Cubic(q="fitted"),
    "string": TautString(),
    "mass-spring": MassSpring(),
    "fem": Fem(),
    "exact": Exact(),
    "exact, shear": Exact(shear=True),
    "exact, shear, neo-hooke": Exact(shear=True, law="neo-hooke"),
}
"""The theories that are compared, by the name of their column."""


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """One theory's answers to a table.

    Attributes
    ----------
    name
        Name of the column.
    deflections
        (R,) deflections, inch; NaN under a load that the theory's law cannot carry.
    errors
        (R,) errors against ANSYS, %; NaN likewise.
    """

    name: str
    deflections: NDArray[np.float64]
    errors: NDArray[np.float64]

    @property
    def max_error(self) -> float:
        """Largest size of an error against ANSYS, %."""
        return float(np.nanmax(np.abs(self.errors)))

    @property
    def mean_error(self) -> float:
        """Mean size of the errors against ANSYS, %."""
        return float(np.nanmean(np.abs(self.errors)))


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """A table and what the theories make of it.

    Attributes
    ----------
    table
        The thesis's table.
    columns
        One for each theory, in the order of `COMPARED`.
    calculated_difference
        Largest difference between what the thesis calculated and the same theory here, with the
        section as the thesis rounded it, inch.
    """

    table: Table
    columns: tuple[Column, ...]
    calculated_difference: float


def compared(table: Table) -> Comparison:
    """Return what the theories make of a table.

    Parameters
    ----------
    table
        The thesis's table.

    Returns
    -------
    Comparison
        Its columns.
    """
    ansys = np.array([row[2] for row in table.rows])
    calculated = np.array([float(row[1]) for row in table.rows])
    columns: list[Column] = []
    for name, theory in COMPARED.items():
        deflections = np.array([_deflection(theory, table, row[0]) for row in table.rows])
        columns.append(Column(name, deflections, 100.0 * (deflections / ansys - 1.0)))
    own = COMPARED[table.theory]
    beam = table.rounded_beam
    again = [
        own.under_force(beam, 0.5 * beam.span, 2.0 * row[0] * LBF, np.empty(0)).deflection / INCH
        for row in table.rows
    ]
    return Comparison(table, tuple(columns), float(np.abs(np.array(again) - calculated).max()))


def _deflection(theory: Theory, table: Table, half_force: float) -> float:
    """Return a theory's deflection, inch, under P, lbf, on one half; NaN if it has none."""
    beam = table.beam
    try:
        pulled = theory.under_force(beam, 0.5 * beam.span, 2.0 * half_force * LBF, np.empty(0))
    except NoEquilibrium:
        return float("nan")
    return pulled.deflection / INCH
