"""What the instruments show after a tick."""

from dataclasses import dataclass, fields
from typing import NamedTuple

from app.simulation.specimen.tear import Phase
from physics import BreakEvent, RuptureCheck
from physics.bed import EnergyBalance

Vector = tuple[float, float, float]
"""mm or N in the duct's frame: along the clamps, lateral and along the pull, away from a bed."""


NO_ENERGY = EnergyBalance(*[0.0] * len(fields(EnergyBalance)))


class FluidReading(NamedTuple):
    """What a fluid does in the tubes that have it."""

    name: str
    lost_ml: float
    left_ml: float
    rate_ml_s: float  # out of holes


class NickReading(NamedTuple):
    """A tear part of the way through a tube's wall (`physics.bed.Nick`)."""

    tube: int  # its number
    station: float  # mm from its first end
    side: tuple[float, float]  # unit vector, up and along y of the tube: where it began
    depth: float  # of the section's height
    depth_mm: float
    reach: float  # how far to each side it weakens the tube, mm
    leaks: bool  # whether it is deeper than the wall

    def words(self, wall: str) -> str:
        """Return a clause: which wall is torn, how far and where, and whether it leaks."""
        leak = "; leaks" if self.leaks else ""
        return f"{wall} torn to {self.depth:.2g} of its section at {self.station:.1f} mm{leak}"


@dataclass(frozen=True, slots=True)
class Reading:
    """What the instruments show after a tick, of H hands; what a tissue does not have is 0."""

    phase: Phase
    check: RuptureCheck  # highest stress against the threshold; once torn, as at the break
    stress_ratio: float  # highest stress over the threshold now
    forces: tuple[Vector, ...]  # H, of each hand on duct or strands, N
    places: tuple[Vector, ...]  # H, of the tips, or of the duct's axis that a hand holds, mm
    holding: tuple[bool, ...]  # H, whether each holds the duct
    pulling: int  # the hand that pulls hardest
    force: float  # of that hand, N; 0 while a released duct springs back
    deflection: float  # of the place that it holds, mm; 0 once the duct is in two
    deepest: float  # largest deflection of this pull, mm
    breaks_at: BreakEvent | None  # where a free duct would break, or broke; None if unknown
    by_hand: bool = True  # a hand prescribes the deflection and the beam answers with the force
    peak_stress_ratio: float = 0.0  # largest since the duct was whole and at rest
    strands: int = 0  # of the bed
    broken: int = 0  # of them
    freed: float = 0.0  # length of duct whose strands have broken, mm
    energy: EnergyBalance = NO_ENERGY  # of a beam in space
    stress_ratios: tuple[float, ...] = ()  # T, of each tube in space
    fluids: tuple[FluidReading, ...] = ()  # in tubes that have any
    nicks: tuple[NickReading, ...] = ()  # of tubes that have not parted

    @classmethod
    def of_one(
        cls,
        check: RuptureCheck,
        *,
        force: float,
        deflection: float,
        deepest: float,
        hook: Vector,
        breaks_at: BreakEvent | None = None,
    ) -> "Reading":
        """Return the reading of a whole duct that one hand holds and pulls straight up."""
        return cls(
            phase=Phase.INTACT,
            check=check,
            stress_ratio=check.total_stress / check.threshold,
            forces=((0.0, 0.0, force),),
            places=(hook,),
            holding=(True,),
            pulling=0,
            force=force,
            deflection=deflection,
            deepest=deepest,
            breaks_at=breaks_at,
        )

    @property
    def distance_to_break(self) -> float:
        """1 at rest, 0 at the break."""
        return 1.0 - self.stress_ratio

    @property
    def held(self) -> bool:
        """Whether the hand that pulls hardest holds the duct."""
        return self.holding[self.pulling]

    @property
    def hook(self) -> Vector:
        """Where that hand is, mm."""
        return self.places[self.pulling]

    @property
    def torn_at(self) -> float | None:
        """Where the duct has torn, mm from the first clamp, or None."""
        return None if self.phase is Phase.INTACT else self.check.station
