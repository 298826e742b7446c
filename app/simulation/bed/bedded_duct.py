"""A duct in its bed under two hands, in real time.

`physics.bed.BeamOnBed` solves it; here are the hands and their instruments, the threshold at which
the wall tears, and the transforms by which the duct's surface follows the beam. A tick of 1/30 s is
`SUBSTEPS` steps of the beam: the peak force of a pull at 8 mm/s is then within 0.4 % of that with
steps four times as short, at 40 mm/s within 2.6 % (docs/theory.md).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.simulation.bed.hand import HOLDING, Hand, Instrument
from app.simulation.bed.preset import BedPreset, beam_in_space
from app.simulation.clock import TICK_SECONDS
from app.simulation.dissection import Dissection
from kernel_cache import njit
from physics import Exact, Linear, RuptureCheck
from physics.bed import BeamOnBed, Books

__all__ = ["BED_THEORY", "HANDS", "BedReading", "BeddedDuct"]

Floats = NDArray[np.float64]

BED_THEORY = Exact(Linear(shear=True))
"""What the beam in space equals when no bed holds it: its threshold is that of the preset."""
ELEMENTS = 40
"""Of the beam: 0.1 % on the force and 0.3 % on the highest stress (docs/theory.md)."""
SUBSTEPS = 8
FIRST_INSTRUMENTS: tuple[Instrument, ...] = ("hook", "grasper")
HANDS = len(FIRST_INSTRUMENTS)
JAW_RADIUS, SWAB_RADIUS = 1.2, 3.0
"""mm. Closed jaws pass between the duct and the bed, whose gap is 3 mm; a swab does not."""
MOST_OPENING = 40.0
"""mm between the axes of a dissector's jaws: more than any clamps' distance allows to use."""
TOWARDS_HAND = {"dissector": (0.0, -1.0, 0.0), "swab": (0.0, -0.6, 0.8)}
"""Way from the tip back along an instrument's shaft: jaws pass behind the duct from the side of the
viewer, a swab comes from above."""
STILL_MM = 1e-6
"""A tick in which no node moves farther has reached equilibrium: no strand yields any more."""


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
    books: Books
    torn_at: float | None  # mm from the first clamp

    @property
    def distance_to_break(self) -> float:
        """1 at rest, 0 at the break."""
        return 1.0 - self.stress_share


class BeddedDuct:
    """A dissection's duct on a bed, two hands at it, and what has become of it.

    Parameters
    ----------
    dissection
        The duct between its clamps.
    bed, seed
        What it lies in, and the number that its scatter is drawn from.
    threshold
        Stress at which the wall tears, MPa; the preset's own when None.
    """

    def __init__(
        self,
        dissection: Dissection,
        bed: BedPreset,
        *,
        seed: int = 1,
        threshold: float | None = None,
    ) -> None:
        self.dissection, self.bed, self.seed = dissection, bed, seed
        self.threshold = (
            dissection.preset.threshold(BED_THEORY, dissection.beam)
            if threshold is None
            else threshold
        )
        self._rest = beam_in_space(dissection, elements=ELEMENTS)
        self._layer = bed.bed(self._rest, seed=seed)
        self._strands = self._layer.strands_under(self._rest)
        self._radius = float(self._rest.radius.mean())
        # The beam's axis, a curve through the organ's, may be longer by a trifle.
        self._scale = self._rest.span / dissection.beam.span
        self._driven = self._scale * dissection.beam_stations
        self.reset()

    def reset(self) -> None:
        """Make the duct and its bed whole, the hands empty."""
        self.beam = BeamOnBed(
            self._rest,
            self._strands,
            floor=self._layer.floor_under(self._rest),
            rods=2 * HANDS,
        )
        self.hands = tuple(Hand(each, self.parking(each)) for each in FIRST_INSTRUMENTS)
        self.torn: RuptureCheck | None = None
        self._torn_element = -1
        self._share = self._peak = self._station = 0.0
        self._still = True

    def parking(self, instrument: Instrument) -> Floats:
        """Return where an instrument that touches nothing waits, (3,) mm."""
        middle = 0.5 * self._rest.span
        if instrument == "dissector":  # beside the duct, at the height at which it passes under it
            height = -self._radius - 0.5 * self.bed.gap_mm
            return np.array([middle, -3.0 * self._radius - 5.0, height])
        return np.array([middle, -self._radius, 3.0 * self._radius])

    # Hands

    def choose_instrument(self, hand: int, instrument: Instrument) -> None:
        """Give a hand another instrument, which touches nothing yet."""
        self.release(hand)
        self._withdraw(hand)
        holder = self.hands[hand]
        holder.instrument = instrument
        holder.opening = holder.target_opening = 0.0
        holder.put(self.parking(instrument))
        if instrument in HOLDING:
            return
        radius = SWAB_RADIUS if instrument == "swab" else JAW_RADIUS
        for rod, tip in self._tips(hand):
            self.beam.set_rod(rod, tip, TOWARDS_HAND[instrument], radius)

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
        return holder.place.copy()

    def release(self, hand: int) -> bool:
        """Let go of the duct; return whether the hand held it."""
        holder = self.hands[hand]
        if holder.node is None:
            return False
        self.beam.let_go(holder.node)
        holder.node = None
        self._still = False
        return True

    def move_hand(self, hand: int, place: Floats) -> None:
        """Set where a hand's tip goes, (3,) mm."""
        self.hands[hand].target[:] = place

    def open_jaws(self, hand: int, opening: float) -> None:
        """Set how far a dissector's jaws part, mm between their axes."""
        self.hands[hand].target_opening = min(max(opening, 0.0), MOST_OPENING)

    def _tips(self, hand: int) -> list[tuple[int, Floats]]:
        """Return the rods of a hand's instrument and where their tips are."""
        holder = self.hands[hand]
        if holder.instrument == "swab":
            return [(2 * hand, holder.place)]
        if holder.instrument == "dissector":
            # Closed jaws lie side by side, so that no strand is between them.
            apart = np.array([0.5 * holder.opening + 1.05 * JAW_RADIUS, 0.0, 0.0])
            return [(2 * hand, holder.place - apart), (2 * hand + 1, holder.place + apart)]
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
        beam = self.beam
        for number, hand in enumerate(self.hands):
            hand.advance()
            if hand.node is not None:
                beam.lead(hand.node, hand.place)
            for rod, tip in self._tips(number):
                beam.lead_rod(rod, tip)
        before = beam.places.copy()
        beam.tick(TICK_SECONDS, ticks=SUBSTEPS)
        self._still = bool(np.abs(beam.places - before).max() <= STILL_MM)
        worst = beam.worst_stress()
        self._station = worst.station / self._scale
        self._share = worst.total / self.threshold
        self._peak = max(self._peak, self._share)
        if self._share > 1.0 and self.torn is None:
            self.torn = RuptureCheck(
                station=self._station,
                tension_side=1 if np.cos(worst.side) >= 0.0 else -1,
                normal_stress=worst.normal,
                bending_stress=worst.bending,
                threshold=self.threshold,
            )
            begin, _ = beam.tear(worst.station)
            self._torn_element = int(np.searchsorted(beam.stations, begin))
            for number in range(HANDS):  # a duct in two slips off what holds it
                self.release(number)
        return True

    def reading(self) -> BedReading:
        """Return what the instruments show now."""
        beam = self.beam
        forces = np.zeros((HANDS, 3))
        for number, hand in enumerate(self.hands):
            if hand.node is not None:
                forces[number] = beam.hand_force(hand.node)
            for rod, _ in self._tips(number):
                forces[number] += beam.rod_force(rod)
        return BedReading(
            strands=beam.strands.count,
            parted=beam.parted,
            freed=beam.freed,
            stress_share=self._share,
            station=self._station,
            peak_share=self._peak,
            forces=forces,
            held=tuple(hand.node is not None for hand in self.hands),
            books=beam.books,
            torn_at=None if self.torn is None else self.torn.station,
        )

    def freed_at(self, stations: Floats) -> Floats:
        """Return the share of strands that have parted about each station, mm, 0 to 1."""
        # Over the strands within one of the beam's elements to either side.
        reach = self._rest.span / ELEMENTS
        placed = np.sort(self._strands.stations)
        order = np.argsort(self._strands.stations, kind="stable")
        parted = np.concatenate([[0.0], np.cumsum(self.beam.damage[order] >= 1.0)])
        low = np.searchsorted(placed, self._scale * stations - reach)
        high = np.searchsorted(placed, self._scale * stations + reach)
        return (parted[high] - parted[low]) / np.maximum(high - low, 1)

    # The surface

    def move(self, out: Floats, piece: int | None = None) -> Floats:
        """Write the (D, 3, 4) transforms of the driving points, of a torn duct's piece 0 or 1."""
        first, last = 0, self.beam.stations.size - 1
        if piece == 0:
            last = self._torn_element
        elif piece == 1:
            first = self._torn_element + 1
        _follow(
            self._driven,
            self.dissection.driving.positions,
            self.dissection.axis_point(0.0),
            self.dissection.frame,
            self.beam.stations,
            self.beam.places,
            self.beam.rotations,
            self.beam.rest_places,
            self.beam.rest_rotations,
            first,
            last,
            out,
        )
        return out


@njit(cache=True)
def _follow(
    driven: Floats,
    positions: Floats,
    origin: Floats,
    frame: Floats,
    stations: Floats,
    x: Floats,
    q: Floats,
    rest_x: Floats,
    rest_q: Floats,
    first: int,
    last: int,
    out: Floats,
) -> None:
    """Write [R - I | t] of each driving point from the nodes `first` to `last`.

    Between two nodes the displacement is a cubic through both nodes' displacements, with the slopes
    that their rotations give a tangent; the rotation is the normalised mean of both quaternions.
    Beyond the first and last node a point follows that node rigidly.
    """
    u, r = np.zeros(3), np.zeros((3, 3))
    ends = np.zeros((2, 4))
    slope = np.zeros((2, 3))
    i = first
    for k in range(driven.shape[0]):
        s = driven[k]
        while i < last - 1 and stations[i + 1] < s:
            i += 1
        j = min(i + 1, last)
        h = stations[j] - stations[i]
        w = 0.0 if h == 0.0 else min(max((s - stations[i]) / h, 0.0), 1.0)
        for e in range(2):
            n = i if e == 0 else j
            a, b, c, d = q[n, 0], q[n, 1], q[n, 2], q[n, 3]
            # Turn since rest, q conj(q at rest), and how the tangent at rest has moved.
            ra, rb, rc, rd = rest_q[n, 0], -rest_q[n, 1], -rest_q[n, 2], -rest_q[n, 3]
            ends[e, 0] = a * ra - b * rb - c * rc - d * rd
            ends[e, 1] = a * rb + b * ra + c * rd - d * rc
            ends[e, 2] = a * rc - b * rd + c * ra + d * rb
            ends[e, 3] = a * rd + b * rc - c * rb + d * ra
            slope[e, 0] = h * 2.0 * ((rc * rc + rd * rd) - (c * c + d * d))
            slope[e, 1] = h * 2.0 * ((b * c + a * d) - (rb * rc + -ra * rd))
            slope[e, 2] = h * 2.0 * ((b * d - a * c) - (rb * rd + ra * rc))
        if (
            ends[0, 0] * ends[1, 0]
            + ends[0, 1] * ends[1, 1]
            + (ends[0, 2] * ends[1, 2] + ends[0, 3] * ends[1, 3])
            < 0.0
        ):
            for m in range(4):
                ends[1, m] = -ends[1, m]
        a = (1.0 - w) * ends[0, 0] + w * ends[1, 0]
        b = (1.0 - w) * ends[0, 1] + w * ends[1, 1]
        c = (1.0 - w) * ends[0, 2] + w * ends[1, 2]
        d = (1.0 - w) * ends[0, 3] + w * ends[1, 3]
        norm = np.sqrt(a * a + b * b + c * c + d * d)
        a, b, c, d = a / norm, b / norm, c / norm, d / norm
        # R - I, without the cancellation of 1 - 1.
        r[0, 0], r[0, 1], r[0, 2] = (
            -2.0 * (c * c + d * d),
            2.0 * (b * c - a * d),
            2.0 * (b * d + a * c),
        )
        r[1, 0], r[1, 1], r[1, 2] = (
            2.0 * (b * c + a * d),
            -2.0 * (b * b + d * d),
            2.0 * (c * d - a * b),
        )
        r[2, 0], r[2, 1], r[2, 2] = (
            2.0 * (b * d - a * c),
            2.0 * (c * d + a * b),
            -2.0 * (b * b + c * c),
        )
        h00, h01 = (1.0 + 2.0 * w) * (1.0 - w) ** 2, w * w * (3.0 - 2.0 * w)
        h10, h11 = w * (1.0 - w) ** 2, -w * w * (1.0 - w)
        for m in range(3):
            u[m] = (
                h00 * (x[i, m] - rest_x[i, m])
                + h01 * (x[j, m] - rest_x[j, m])
                + h10 * slope[0, m]
                + h11 * slope[1, m]
            )
        if s < stations[first] or s > stations[last]:  # beyond a torn end: rigidly with its node
            n = first if s < stations[first] else last
            for m in range(3):
                u[m] = x[n, m] - rest_x[n, m]
                for e in range(3):
                    for g in range(3):
                        arm = frame[g, e] * (positions[k, g] - origin[g])
                        u[m] += r[m, e] * arm
                    u[m] -= r[m, e] * rest_x[n, e]
        # Into the organ's coordinates: F (R - I) F^T, and t that moves the point itself by F u.
        for g in range(3):
            moved = 0.0
            for m in range(3):
                moved += frame[g, m] * u[m]
            for o in range(3):
                turn = 0.0
                for m in range(3):
                    for e in range(3):
                        turn += frame[g, m] * r[m, e] * frame[o, e]
                out[k, g, o] = turn
                moved -= turn * positions[k, o]
            out[k, g, 3] = moved
