"""Tables 6.1, 6.2 and 6.3 of the thesis, and curves of solids to hold the theories against.

The figures, with where they are from, are in assets/validation.toml; inch, lbf and psi.
"""

from dataclasses import replace

import msgspec

from assets import VALIDATION
from physics import Beam

INCH = 25.4
"""mm."""
LBF = 4.4482216152605
"""N."""
PSI = LBF / INCH**2
"""MPa."""

Row = tuple[float, str, float]
"""P; deflection 'calculated' by the thesis, as printed; deflection by ANSYS."""
Curve = dict[float, float]
"""Deflections by force."""


class Table(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One table."""

    number: str
    title: str
    theory: str  # that the thesis calculated with: cubic (q = 0.5) or string
    half_span: float  # L, inch
    diameter: float  # d, inch
    modulus: float  # E, psi
    rows: tuple[Row, ...]  # but the one at rest
    solid: Curve  # of a solid of the same duct, by P
    solid_off_centre: Curve  # the same, grasped at 30 % of the span, by the whole force
    # with the next, the section that reproduces every digit calculated, in^2; None where the exact
    # one does
    rounded_area: float | None = None
    rounded_second_moment: float | None = None  # in^4

    @property
    def beam(self) -> Beam:
        """The table's beam, in mm, N and MPa."""
        return Beam.round(
            span=2.0 * self.half_span * INCH,
            diameter=self.diameter * INCH,
            modulus=self.modulus * PSI,
            poisson_ratio=0.3,
        )

    @property
    def rounded_beam(self) -> Beam:
        """The beam with the section that the thesis rounded."""
        beam = self.beam
        area, moment = self.rounded_area, self.rounded_second_moment
        return replace(
            beam,
            area=beam.area if area is None else area * INCH**2,
            second_moment=beam.second_moment if moment is None else moment * INCH**4,
        )


class HeldOut(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The central curve of a solid that nothing was fitted to."""

    diameter: float  # inch
    poisson_ratio: float
    curve: Curve


class Hollow(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The central curve of a solid tube that nothing was fitted to; mm, N and MPa."""

    span: float
    diameter: float
    wall: float
    modulus: float
    poisson_ratio: float
    curve: Curve  # by the whole force

    @property
    def beam(self) -> Beam:
        """The beam that stands for it."""
        return Beam.round(
            span=self.span, diameter=self.diameter, modulus=self.modulus,
            poisson_ratio=self.poisson_ratio, wall=self.wall,
        )  # fmt: skip


class _File(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    table: tuple[Table, Table, Table]
    held_out: tuple[HeldOut, ...]
    hollow: tuple[Hollow, ...]


_FILE = msgspec.toml.decode(VALIDATION.read_bytes(), type=_File)
TABLES, HELD_OUT, HOLLOW = _FILE.table, _FILE.held_out, _FILE.hollow
TABLE_6_1, TABLE_6_2, TABLE_6_3 = TABLES
