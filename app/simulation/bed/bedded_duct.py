"""A duct in its bed under two hands, in real time.

`physics.bed.BeamOnBed` solves it; here are the hands and their instruments, the threshold at which
the wall tears, and the transforms by which the duct's surface follows the beam. A tick of 1/30 s is
`SUBSTEPS` steps of the beam: the peak force of a pull at 8 mm/s is then within 0.4 % of that with
steps four times as short, at 40 mm/s within 2.6 % (docs/theory.md).
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.simulation.bed.bedded_surface import BeddedSurface
from app.simulation.bed.hand import Hand
from app.simulation.clock import TICK_SECONDS
from app.simulation.inputs import HOLDING, Instrument
from app.simulation.run_file import ELEMENTS, HANDS, SUBSTEPS
from app.simulation.specimen import Specimen
from kernel_cache import njit
from physics import RuptureCheck
from physics.bed import BeamOnBed, EnergyBalance

__all__ = [
    "ELEMENTS", "HANDS", "MOST_OPENING", "SUBSTEPS", "BedReading", "BeddedDuct",
    "Rod", "Touch",
]  # fmt: skip

Floats = NDArray[np.float64]

FIRST_INSTRUMENTS: tuple[Instrument, ...] = ("hook", "grasper")
# Of the span, where the hands' empty instruments wait: the second one out of the first's way.
PARKED_AT = (0.5, 0.2)
JAW_RADIUS, SWAB_RADIUS = 1.2, 3.0
"""mm. Closed jaws pass between the duct and the bed, whose gap is 3 mm; a swab does not."""
MOST_OPENING = 40.0
"""mm between the axes of a dissector's jaws: more than any clamps' distance allows to use."""
TOWARDS_HAND = {"dissector": (0.0, -1.0, 0.0), "swab": (0.0, -0.6, 0.8)}
"""Way from the tip back along an instrument's shaft: jaws pass behind the duct from the side of the
viewer, a swab comes from above."""
# Rods of the beam that each hand's instrument is.
RODS: dict[Instrument, tuple[tuple[int, ...], ...]] = {
    "hook": ((),) * HANDS,
    "grasper": ((),) * HANDS,
    "dissector": tuple((2 * hand, 2 * hand + 1) for hand in range(HANDS)),
    "swab": tuple((2 * hand,) for hand in range(HANDS)),
}
BIN_MM, FREED_PART = 1.0, 0.95
"""mm, and the part of a bin's strands that must have parted for its stretch to be free."""
# A tick in which no node moves farther has reached equilibrium: no strand yields any more.
STILL_MM = 1e-6


@dataclass(frozen=True, slots=True)
class BedReading:
    """What the instruments show of a duct in its bed."""

    strands: int  # all of the bed
    parted: int
    freed: float  # length of duct whose strands have parted, mm
    stress_share: float  # largest stress in the wall over the threshold: 1 at the break
    station: float  # where that is, mm from the first clamp
    peak_share: float  # largest share since the duct was whole and at rest
    forces: Floats  # (HANDS, 3) of each hand on duct or strands, N
    held: tuple[bool, ...]  # whether each hand holds the duct
    books: EnergyBalance
    torn_at: float | None  # mm from the first clamp

    @property
    def distance_to_break(self) -> float:
        """1 at rest, 0 at the break."""
        return 1.0 - self.stress_share


class Rod(NamedTuple):
    """A jaw or a swab, as the beam has it."""

    number: int
    tip: Floats  # (3,) mm
    shaft: tuple[float, float, float]  # way back along it
    radius: float  # mm


class Touch(NamedTuple):
    """What a hand does to the beam."""

    station: float | None  # that it holds, mm along the beam
    place: Floats  # (3,) of its tip, mm
    rods: tuple[Rod, ...]


class BeddedDuct:
    """A specimen's duct on its bed, two hands at it, and what has become of it."""

    def __init__(self, specimen: Specimen) -> None:
        assert specimen.bed is not None  # noqa: S101 (the caller's)
        self.specimen, self.dissection = specimen, specimen.dissection
        self.bed, self.seed = specimen.bed, specimen.bed_seed
        self.threshold = specimen.threshold
        self._rest = specimen.space_beam(elements=ELEMENTS)
        self._layer = self.bed.bed(self._rest, seed=self.seed)
        self._strands = self._layer.strands_under(self._rest)
        self._radius = float(self._rest.radius.mean())
        self.surface = BeddedSurface(self.dissection, self._rest, self._strands)
        self._scale = self.surface.scale
        self.reset()

    def reset(self, opened: tuple[float, float] | None = None, *, divided: bool = False) -> None:
        """Make the duct and its bed whole, but for a stretch `opened` between two stations, mm.

        A `divided` duct ends where its second clamp was.
        """
        self.divided = divided
        self.beam = BeamOnBed(
            replace(self._rest, ends=("clamped", "free")) if divided else self._rest,
            self._strands,
            floor=self._layer.floor_under(self._rest),
            rods=2 * HANDS,
        )
        if opened is not None:
            self.beam.break_between(self._scale * opened[0], self._scale * opened[1])
        self.hands = tuple(
            Hand(each, self.parking(hand, each)) for hand, each in enumerate(FIRST_INSTRUMENTS)
        )
        self.torn: RuptureCheck | None = None
        self.torn_element = -1  # of the beam, which is none any more
        self.share = self.station = 0.0  # of the threshold, largest, and mm from the first clamp
        self._peak = 0.0
        self.parted = self.beam.broken
        self.freed = self.beam.freed  # mm
        self._before = np.empty_like(self.beam.places)
        self._still = True
        self._forget_reading()

    def parking(self, hand: int, instrument: Instrument) -> Floats:
        """Return where an instrument that touches nothing waits, (3,) mm."""
        along = PARKED_AT[hand] * self._rest.span
        if instrument == "dissector":  # beside the duct, at the height at which it passes under it
            height = -self._radius - 0.5 * self.bed.gap_mm
            return np.array([along, -3.0 * self._radius - 5.0, height])
        return np.array([along, -self._radius, 3.0 * self._radius])

    # Hands

    def choose_instrument(self, hand: int, instrument: Instrument) -> None:
        """Give a hand another instrument, which touches nothing yet."""
        self.release(hand)
        self._withdraw(hand)
        self._forget_reading()
        holder = self.hands[hand]
        holder.instrument = instrument
        holder.opening = holder.target_opening = 0.0
        holder.put(self.parking(hand, instrument))
        for rod in self.touch(hand).rods:
            self.beam.set_rod(*rod)

    def grab(self, hand: int, station: float) -> Floats | None:
        """Take hold, mm from the first clamp; return the place, or None where it cannot."""
        holder = self.hands[hand]
        if holder.instrument not in HOLDING or self.torn is not None:
            return None
        self.release(hand)
        try:
            holder.node = self.beam.take(self._scale * station)
        except ValueError:  # at a clamp, or on top of the other hook
            return None
        holder.put(self.beam.places[holder.node])
        self._still = False
        self._forget_reading()
        return holder.place.copy()

    def release(self, hand: int) -> bool:
        """Let go of the duct; return whether the hand held it."""
        holder = self.hands[hand]
        if holder.node is None:
            return False
        self.beam.let_go(holder.node)
        holder.node = None
        self._still = False
        self._forget_reading()
        return True

    def move_hand(self, hand: int, place: Floats) -> None:
        """Set where a hand's tip goes, (3,) mm."""
        self.hands[hand].target[:] = place

    def put_hand(self, hand: int, place: Floats) -> None:
        """Put the tip of a hand that holds nothing somewhere at once, (3,) mm."""
        self.hands[hand].put(place)
        self._forget_reading()

    def open_jaws(self, hand: int, opening: float) -> None:
        """Set how far a dissector's jaws part, mm between their axes."""
        self.hands[hand].target_opening = min(max(opening, 0.0), MOST_OPENING)

    def touch(self, hand: int) -> Touch:
        """Return what a hand does to the beam now."""
        holder = self.hands[hand]
        node, instrument = holder.node, holder.instrument
        radius = SWAB_RADIUS if instrument == "swab" else JAW_RADIUS
        rods = tuple(Rod(number, tip.copy(), TOWARDS_HAND[instrument], radius)
                     for number, tip in self._tips(hand))  # fmt: skip
        station = None if node is None else float(self.beam.stations[node])
        return Touch(station, holder.place.copy(), rods)

    def rods_of(self, hand: int) -> tuple[int, ...]:
        """Return the rods of the beam that are a hand's jaws or its swab."""
        return RODS[self.hands[hand].instrument][hand]

    def _tips(self, hand: int) -> list[tuple[int, Floats]]:
        """Return the rods of a hand's instrument and where their tips are."""
        holder = self.hands[hand]
        if holder.instrument == "swab":
            return [(self.rods_of(hand)[0], holder.place)]
        if holder.instrument == "dissector":
            # Closed jaws lie side by side, so that no strand is between them.
            apart = np.array([0.5 * holder.opening + 1.05 * JAW_RADIUS, 0.0, 0.0])
            left, right = self.rods_of(hand)
            return [(left, holder.place - apart), (right, holder.place + apart)]
        return []

    def _withdraw(self, hand: int) -> None:
        self.beam.withdraw_rod(2 * hand)
        self.beam.withdraw_rod(2 * hand + 1)
        self._still = False

    # Time

    def advance(self) -> bool:
        """Advance by one tick; return whether anything has moved."""
        if self._still and all(hand.arrived for hand in self.hands):
            return False
        self._forget_reading()
        beam = self.beam
        for number, hand in enumerate(self.hands):
            hand.advance()
            if hand.node is not None:
                beam.lead(hand.node, hand.place)
            for rod, tip in self._tips(number):
                beam.lead_rod(rod, tip)
        self._before[:] = beam.places
        beam.tick(TICK_SECONDS, ticks=SUBSTEPS)
        farthest, parted = _changes(self._before, beam.places, beam.state.damage)
        self._still = farthest <= STILL_MM
        if parted != self.parted:
            self.parted, self.freed = parted, beam.freed
        check = self.surface.check(beam, self.threshold)
        self.station = check.station
        self.share = check.total_stress / self.threshold
        self._peak = max(self._peak, self.share)
        if self.share > 1.0 and self.torn is None:
            self.torn = check
            self.torn_element = beam.tear(beam.worst_stress().station)
            self.parted, self.freed = beam.broken, beam.freed
            for number in range(HANDS):  # a duct in two slips off what holds it
                self.release(number)
        return True

    def reading(self) -> BedReading:
        """Return what the instruments show now."""
        if self._reading is None:
            beam = self.beam
            self._reading = BedReading(
                strands=beam.strands.count,
                parted=self.parted,
                freed=self.freed,
                stress_share=self.share,
                station=self.station,
                peak_share=self._peak,
                forces=self.forces,
                held=tuple(hand.node is not None for hand in self.hands),
                books=beam.energy,
                torn_at=None if self.torn is None else self.torn.station,
            )
        return self._reading

    @property
    def forces(self) -> Floats:
        """(HANDS, 3) of each hand on duct or strands, N."""
        if self._forces is None:
            beam = self.beam
            self._forces = np.zeros((HANDS, 3))
            for number, hand in enumerate(self.hands):
                if hand.node is not None:
                    self._forces[number] = beam.hand_force(hand.node)
                for rod in self.rods_of(number):
                    self._forces[number] += beam.rod_force(rod)
        return self._forces

    def _forget_reading(self) -> None:
        self._reading: BedReading | None = None
        self._forces: Floats | None = None

    def freed_at(self, stations: Floats) -> Floats:
        """Return the share of strands that have parted about each station, mm, 0 to 1."""
        return self.surface.freed_at(self.beam.damage, stations)

    def held_at(self, hand: int) -> float | None:
        """Return the station that a hand holds, mm from the first clamp, or None."""
        node = self.hands[hand].node
        return None if node is None else float(self.beam.stations[node]) / self._scale

    def freed_stretches(self) -> list[tuple[float, float]]:
        """Return the stretches that are free, mm from the first clamp to mm, in order."""
        # Free is a bin of about `BIN_MM` of whose strands at least `FREED_PART` have parted.
        span = self.dissection.beam.span
        bins = max(1, round(span / BIN_MM))
        place = (self._strands.stations * (bins / self._rest.span)).astype(np.int64)
        place = np.minimum(place, bins - 1)
        whole = np.bincount(place, self.beam.damage < 1.0, minlength=bins)
        most = (1.0 - FREED_PART) * np.bincount(place, minlength=bins)
        free = np.concatenate([[False], whole <= most, [False]])
        edges = np.flatnonzero(free[1:] != free[:-1]) * (span / bins)
        return [(float(a), float(b)) for a, b in edges.reshape(-1, 2)]

    def move(self, out: Floats, piece: int | None = None) -> Floats:
        """Write the (D, 3, 4) transforms of the driving points, of a torn duct's piece 0 or 1."""
        return self.surface.move(self.beam, out, piece, self.torn_element)


@njit(cache=True, nogil=True)
def _changes(before: Floats, places: Floats, damage: Floats) -> tuple[float, int]:
    """Return how far the node has moved that moved farthest, mm, and how many strands parted."""
    farthest, parted = 0.0, 0
    for n in range(places.shape[0]):
        for i in range(3):
            farthest = max(farthest, abs(places[n, i] - before[n, i]))
    for i in range(damage.shape[0]):
        parted += damage[i] >= 1.0
    return farthest, parted
