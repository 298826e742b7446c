"""The theories held against a table of the thesis: deflections, and errors against ANSYS."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.validation.thesis_tables import HELD_OUT, HOLLOW, INCH, LBF, Hollow, Table
from physics import (
    Beam,
    Cubic,
    Exact,
    Fem,
    Linear,
    MassSpring,
    NeoHooke,
    NoEquilibrium,
    TautString,
    Theory,
)
from physics.bed import Hand, SpaceBeam, pull

COMPARED: Mapping[str, Theory] = {
    "cubic": Cubic(),
    "cubic, fitted q": Cubic(q="fitted"),
    "string": TautString(),
    "mass-spring": MassSpring(),
    "fem": Fem(),
    "exact": Exact(),
    "exact, shear": Exact(Linear(shear=True)),
    "exact, shear, neo-hooke": Exact(NeoHooke()),
}
"""The theories that are compared, by the name of their column."""


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """One theory's answers to a table."""

    name: str
    # (R,) inch; NaN under a load that the theory's law cannot carry
    deflections: NDArray[np.float64]
    errors: NDArray[np.float64]  # (R,) against ANSYS, %; NaN likewise

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
    """A table of the thesis and the theories' answers to it."""

    table: Table
    columns: tuple[Column, ...]  # one for each theory, in the order of `COMPARED`
    # largest one between the thesis's numbers and the same theory here, with the section as the
    # thesis rounded it, inch
    calculated_difference: float


def compared(table: Table) -> Comparison:
    """Return what the theories make of a table."""
    ansys = np.array([row[2] for row in table.rows])
    calculated = np.array([float(row[1]) for row in table.rows])
    columns: list[Column] = []
    for name, theory in COMPARED.items():
        deflections = np.array(
            [_deflected(theory, table, 0.5 * table.beam.span, 2.0 * row[0]) for row in table.rows]
        )
        columns.append(Column(name, deflections, 100.0 * (deflections / ansys - 1.0)))
    own = COMPARED[table.theory]
    beam = table.rounded_beam
    again = [
        own.pull(beam, 0.5 * beam.span).to_force(2.0 * row[0] * LBF).deflection / INCH
        for row in table.rows
    ]
    return Comparison(table, tuple(columns), float(np.abs(np.array(again) - calculated).max()))


@dataclass(frozen=True, slots=True)
class SolidErrors:
    """A theory's errors against three-dimensional neo-Hookean solids of one table's duct."""

    name: str  # of the theory's column
    table: str  # its number
    # with a central grasp at the lowest load, %; below zero where the beam is stiffer
    lowest: float
    highest: float  # the same at the highest load that the solids reach
    largest: float  # of largest size over all loads with a central grasp, %
    largest_off_centre: float  # the same with a grasp at 30 % of the span, %


def solid_errors(table: Table) -> tuple[SolidErrors, ...]:
    """Return how near the theories come to solids of the table's duct."""
    span = table.beam.span
    found: list[SolidErrors] = []
    for name, theory in COMPARED.items():
        central = [
            100.0 * (_deflected(theory, table, 0.5 * span, 2.0 * half_force) / solid - 1.0)
            for half_force, solid in table.solid.items()
        ]
        off_centre = [
            100.0 * (_deflected(theory, table, 0.3 * span, force) / solid - 1.0)
            for force, solid in table.solid_off_centre.items()
        ]
        found.append(
            SolidErrors(
                name,
                table.number,
                central[0],
                central[-1],
                max(central, key=abs),
                max(off_centre, key=abs),
            )
        )
    return tuple(found)


def held_out_errors() -> dict[tuple[float, float], float]:
    """Return how near the exact beam comes to solids that nothing was fitted to."""
    theory = Exact(NeoHooke())
    found: dict[tuple[float, float], float] = {}
    for each in HELD_OUT:
        beam = Beam.round(
            span=2.0, diameter=each.diameter, modulus=45.0, poisson_ratio=each.poisson_ratio
        )  # inch, lbf and psi, as the curves are: the theory knows no units
        errors = [
            100.0 * (theory.pull(beam, 1.0).to_force(2.0 * half_force).deflection / solid - 1.0)
            for half_force, solid in each.curve.items()
        ]
        found[each.diameter, each.poisson_ratio] = max(errors, key=abs)
    return found


@dataclass(frozen=True, slots=True)
class HollowErrors:
    """The neo-Hookean beam's errors against a solid tube: a row for each force."""

    solid: Hollow
    plane: tuple[float, ...]  # of the exact beam's deflection, %
    space: tuple[float, ...]  # of the beam's in space
    stress: tuple[float, ...]  # highest nominal stress, over the modulus


def hollow_errors() -> tuple[HollowErrors, ...]:
    """Return how near the beams, in the plane and in space, come to solid tubes."""
    found: list[HollowErrors] = []
    for each in HOLLOW:
        beam, at = each.beam, 0.5 * each.span
        solver = Exact(NeoHooke()).pull(beam, at)
        held = SpaceBeam.of(beam, law=NeoHooke(), elements=160, nodes_at=[at])
        path = tuple((0.0, 0.0, force) for force in each.curve)
        history = pull(held, None, [Hand(at=at, path=path, by="force", steps=(1,) * len(path))])
        plane = [solver.to_force(force).deflection for force in each.curve]
        assert history.stress is not None  # noqa: S101 (a tube has a wall)
        solid = np.array(list(each.curve.values()))
        found.append(
            HollowErrors(
                each,
                tuple((100.0 * (np.array(plane) / solid - 1.0)).tolist()),
                tuple((100.0 * (history.hands[:, 0, 2] / solid - 1.0)).tolist()),
                tuple((history.stress / each.modulus).tolist()),
            )
        )
    return tuple(found)


def _deflected(theory: Theory, table: Table, grasp: float, force: float) -> float:
    """Return a theory's deflection, inch, under a whole force, lbf; NaN if it has none."""
    try:
        pulled = theory.pull(table.beam, grasp).to_force(force * LBF)
    except NoEquilibrium:
        return float("nan")
    return pulled.deflection / INCH
