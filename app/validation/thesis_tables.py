"""Tables 6.1, 6.2 and 6.3 of the thesis: its own deflections and ANSYS's, under P on one half."""

from dataclasses import dataclass, replace

from physics import Beam

__all__ = ["INCH", "LBF", "PSI", "TABLES", "TABLE_6_1", "TABLE_6_2", "TABLE_6_3", "Row", "Table"]

INCH = 25.4
"""mm."""
LBF = 4.4482216152605
"""N."""
PSI = LBF / INCH**2
"""MPa."""

Row = tuple[float, str, float]
"""P, lbf; deflection 'calculated' by the thesis, inch, as printed; deflection by ANSYS, inch.

What was calculated stays text, so that it can be seen how many digits were published."""


@dataclass(frozen=True, slots=True)
class Table:
    """One table."""

    number: str
    title: str
    theory: str  # that the thesis calculated with: cubic (q = 0.5) or string
    half_span: float  # L, inch
    diameter: float  # d, inch
    modulus: float  # E, psi
    rows: tuple[Row, ...]  # but the one at rest
    # with the next, the section that reproduces every digit calculated, in^2; None where the exact
    # one does. The thesis states the rounded I of 6.1; the others were found by search, within 6e-8
    # of the exact section
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


TABLE_6_1 = Table(
    "6.1",
    "Rubber, d = 0.4 inch",
    "cubic",
    1.0,
    0.4,
    1500.0,
    (
        (1, "0.043976852", 0.0437),
        (2, "0.086520266", 0.085),
        (3, "0.126605275", 0.123),
        (4, "0.163749542", 0.157),
        (5, "0.197897743", 0.187),
        (6, "0.22923599", 0.215),
        (7, "0.258048918", 0.24),
        (8, "0.284638504", 0.264),
        (9, "0.309286683", 0.285),
        (10, "0.332242075", 0.306),
        (11, "0.35371814", 0.324),
        (12, "0.373896019", 0.342),
        (13, "0.392928869", 0.359),
        (14, "0.410946283", 0.376),
        (15, "0.428058269", 0.391),
        (20, "0.502895775", 0.461),
    ),
    rounded_area=0.1256637059,
    rounded_second_moment=0.001256,
)
TABLE_6_2 = Table(
    "6.2",
    "Thin rubber, d = 0.1 inch",
    "string",
    1.0,
    0.1,
    1500.0,
    (
        (1, "0.598314452", 0.558),
        (2, "0.78934952", 0.748),
        (3, "0.939278779", 0.896),
        (4, "1.070192942", 1.025),
        (5, "1.189988135", 1.14),
    ),
)
TABLE_6_3 = Table(
    "6.3",
    "Bile duct, d = 0.35 inch",
    "cubic",
    1.0,
    0.35,
    45.0,
    (
        (0.01, "0.025078136", 0.02503),
        (0.02, "0.049796046", 0.049433),
        (0.03, "0.073842132", 0.072728),
        (0.04, "0.096985194", 0.094649),
        (0.05, "0.119082813", 0.11511),
        (0.06, "0.140071203", 0.13416),
        (0.07, "0.159946127", 0.1519),
        (0.08, "0.178742988", 0.16845),
        (0.09, "0.196520337", 0.18395),
        (0.1, "0.213347962", 0.19851),
        (0.11, "0.229299067", 0.21223),
        (0.15, "0.28571136", 0.26061),
        (0.2, "0.343703521", 0.31066),
        (0.25, "0.392167613", 0.3532),
        (0.3, "0.4339643", 0.39066),
        (0.35, "0.470855528", 0.42444),
        (0.4, "0.503987995", 0.45543),
        (0.45, "0.534145741", 0.48423),
        (0.5, "0.561887452", 0.51128),
        (0.55, "0.587625092", 0.53687),
        (0.6, "0.611671212", 0.56123),
        (0.65, "0.63426868", 0.58454),
        (0.7, "0.655610089", 0.60695),
        (0.75, "0.675850841", 0.62858),
        (0.8, "0.695118239", 0.64952),
        (0.85, "0.713517944", 0.66985),
        (0.9, "0.731138674", 0.68962),
        (0.95, "0.748055694", 0.70889),
        (1, "0.764333436", 0.72773),
        (1.05, "0.780027515", 0.74616),
        (1.1, "0.795186292", 0.76422),
        (1.2, "0.824062241", 0.79933),
        (1.3, "0.851243958", 0.8333),
        (1.4, "0.876955181", 0.86627),
        (1.5, "0.901376277", 0.89839),
        (1.6, "0.924654956", 0.92973),
        (1.7, "0.946913839", 0.96043),
        (1.8, "0.968255933", 0.99051),
        (1.9, "0.988768682", 1.0201),
        (2, "1.00852701", 1.0492),
        (2.5, "1.098002171", 1.1889),
    ),
    rounded_area=0.09621127,
    rounded_second_moment=0.0007366175666,
)

TABLES = (TABLE_6_1, TABLE_6_2, TABLE_6_3)
