"""Measures of a dissection, taken while it runs (docs/measures.md)."""

import math
from functools import cached_property

import msgspec
import numpy as np
from numpy.typing import NDArray

from app.simulation.clock import TICK_SECONDS
from app.simulation.critical_view import Closing, CriticalView
from app.simulation.error_finder import ErrorFinder
from app.simulation.errors import Incidents
from app.simulation.exercise import Exercise
from app.simulation.inputs import SCOPE_NUMBERS, Structure
from app.simulation.measures import RATE_SECONDS, RATE_TICKS
from app.simulation.run_file import HANDS
from app.simulation.safety import Safety
from app.simulation.sight import WORKING_DISTANCE, in_picture
from app.simulation.spatial_tissue import LEAST_FLOW, SpatialTissue
from physics.bed.kernels import BEAM, DISSIPATED, ROD_WORK, WORK

__all__ = ["DissectionMeasures", "DissectionRecorder", "DissectionTear"]

Floats = NDArray[np.float64]

BESIDE_MM = 2.0
"""mm next to a free stretch whose strands are counted."""
LEAST_FORCE = 1e-3
"""N. A smaller force has no direction worth measuring."""


class DissectionTear(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Where and when the duct tore, and under what."""

    station_mm: float  # from the first clamp
    time_s: float  # from the start of the run
    normal_stress_MPa: float  # noqa: N815
    bending_stress_MPa: float  # noqa: N815
    threshold_MPa: float  # noqa: N815


class DissectionMeasures(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True
):
    """The measures of a dissection (docs/measures.md); None where it gives none.

    Pairs are of the first and the second hand.
    """

    time_s: float
    freed_mm: float  # length of duct whose strands have parted
    longest_freed_stretch_mm: float
    strands: int  # whole at the start
    strands_broken: int
    strands_broken_by_hand: tuple[int, int]
    strands_broken_by_instrument: int  # that a jaw or a swab touched
    strands_broken_out_of_sight: int
    peak_stress_ratio: float  # largest stress in the wall over the threshold
    peak_stress_station_mm: float
    smallest_distance_to_break: float  # 1 less that share
    time_above_half_s: float  # with a share above 0.5
    # (1 - share) over the share's growth; None while it never grew
    shortest_time_to_break_s: float | None
    work_mJ: tuple[float, float]  # noqa: N815
    strand_energy_mJ: float  # dissipated in strands  # noqa: N815
    duct_energy_mJ: float  # most that the duct has stored at once  # noqa: N815
    economy_of_work: float | None  # parted energy over both hands' work
    maximum_force_N: tuple[float, float]  # noqa: N815
    force_time_product_N_s: tuple[float, float]  # noqa: N815
    maximum_instrument_force_N: float  # on jaws and swabs  # noqa: N815
    # angle between the pull on the duct and the bed's normal, weighted by force
    traction_angle_deg: float | None
    tear: DissectionTear | None
    blood_lost_ml: float | None = None  # left out where no tube has blood
    critical_view_points: int | None = None  # most at once; left out without a gallbladder
    # of a run through a scope; left out of others
    time_out_of_picture_s: float | None = None  # with a tip of either hand outside it
    scope_path_mm: float | None = None
    horizon_deg: float | None = None  # mean of its turn, without sign


class DissectionRecorder:
    """Takes the measures of a duct in its bed, tick by tick, and finds errors.

    `exercise` is what the run is judged by, if it is.
    """

    def __init__(
        self,
        duct: SpatialTissue,
        exercise: Exercise | None = None,
    ) -> None:
        self.exercise = exercise
        self.duct, self.broken_by_touch = duct, duct.broken_by_touch
        self._started = False
        self.ticks = 0
        self.peak = self.peak_station = 0.0
        self.instrument_force = 0.0
        self.min_time_to_break = math.inf
        self._fractions = (0.0,) * RATE_TICKS  # newest first
        self._above_half = 0
        # Hands that last did so; `_acting`: hold the duct or press on it.
        self._holding = self._sweeping = self._acting = list(range(HANDS))
        self._work = [0.0] * HANDS
        self._most = [0.0] * HANDS
        self._product = [0.0] * HANDS
        self._pulled = self._turned = 0.0  # sums of force, and of force times angle
        self._duct_energy = 0.0
        self._by_hand = [0] * HANDS
        self.out_of_sight = 0
        self._scope: tuple[float, ...] | None = None  # its view, once there is one
        self._unseen = self._levelled = 0  # ticks: a tip out of the picture; a horizon known
        self._scope_path = self._rolled = 0.0  # mm; sum of rad

    def start(self) -> None:
        """Start on a duct at rest, whose bed may be opened already."""
        duct = self.duct
        self._started = True
        self._whole = duct.beam.damage < 1.0
        self._before = self._broken = duct.broken
        self._note_energies()
        self._places: list[list[float]] = [hand.place.tolist() for hand in duct.hands]
        self._torn, self._lost = duct.torn, self._lost_now
        self._measure_freed()
        exercise = self.exercise
        self._finder = (
            ErrorFinder(duct, {})
            if exercise is None
            else ErrorFinder(duct, exercise.limit_of, exercise.about)
        )

    def _note_energies(self) -> list[float]:
        """Keep the energies now, mJ; return all sums of the beam's state."""
        sums: list[float] = self.duct.beam.state.sums.tolist()
        self._beam_work, self._rod_work = sums[WORK], sums[ROD_WORK]
        self._dissipated = sums[DISSIPATED]
        return sums

    def _measure_freed(self) -> None:
        self.freed = self.duct.freed
        self._broken_by_rods = self.duct.beam.broken_by_rods
        self.stretches = self.duct.freed_stretches()

    def take(self, *, moved: bool) -> None:
        """Take one tick, in which something moved or all stood still."""
        self.ticks += 1
        duct = self.duct
        ratio = duct.stress_ratio
        if ratio > self.peak:
            self.peak, self.peak_station = ratio, duct.station
        self._above_half += ratio > 0.5
        growth = (ratio - self._fractions[-1]) / RATE_SECONDS
        if growth > 0.0:
            self.min_time_to_break = min(self.min_time_to_break, max(1.0 - ratio, 0.0) / growth)
        self._fractions = (ratio, *self._fractions[:-1])
        self._torn, self._lost = duct.torn, self._lost_now
        if len(duct.pose) >= SCOPE_NUMBERS:
            self._take_scope(duct.pose)
        forces = duct.forces
        self._take_forces(forces)
        out_of_sight = self.out_of_sight
        if moved:
            self._take_work(forces)
            if duct.broken > self._broken:
                self._broken = duct.broken
                self._take_broken()
                self._measure_freed()
        self._finder.take(self.stretches, self.out_of_sight - out_of_sight)

    def _take_scope(self, pose: tuple[float, ...]) -> None:
        """Take how the scope is held, which is known in steps of 5 mm or 5 degrees."""
        before, self._scope = self._scope, pose
        if before is not None and before is not pose:
            self._scope_path += _size([b - a for a, b in zip(before[3:6], pose[3:6], strict=True)])
        self._unseen += not all(in_picture(pose, hand.place.tolist()) for hand in self.duct.hands)
        if len(pose) > SCOPE_NUMBERS:
            self._levelled += 1
            self._rolled += abs(pose[SCOPE_NUMBERS])

    def _take_forces(self, forces: list[list[float]]) -> None:
        pulls: list[list[float]] = self.duct.beam.state.pull.tolist()
        for hand, holder in enumerate(self.duct.hands):
            size = _size(forces[hand])
            self._most[hand] = max(self._most[hand], size)
            self._product[hand] += size * TICK_SECONDS
            for rod in self.duct.rods_of(hand):
                self.instrument_force = max(self.instrument_force, _size(pulls[rod]))
            if holder.node is not None and size > LEAST_FORCE:
                self._pulled += size
                self._turned += size * math.acos(min(max(forces[hand][2] / size, -1.0), 1.0))

    def _take_work(self, forces: list[list[float]]) -> None:
        """Divide the tick's work, as the beam counts it, between the hands."""
        # Work on the duct goes to the hands that hold it, work on rods to those that sweep; where
        # both do the same, in proportion to force times way of each.
        duct, work, rod_work = self.duct, self._beam_work, self._rod_work
        self._duct_energy = max(self._duct_energy, self._note_energies()[BEAM])
        swept = self._rod_work - rod_work
        held = self._beam_work - work - swept
        before, self._places = self._places, [hand.place.tolist() for hand in duct.hands]
        # The energies are a step behind: a hand that has just let go still gets its last part.
        holding = [i for i in range(HANDS) if duct.hands[i].node is not None]
        sweeping = [i for i in range(HANDS) if duct.rods_of(i)]
        self._holding, self._sweeping = holding or self._holding, sweeping or self._sweeping
        presses: list[list[float]] = duct.beam.state.press.tolist()
        pressing = [i for i in sweeping if any(any(presses[rod]) for rod in duct.rods_of(i))]
        self._acting = holding + pressing or self._acting
        for work, hands in ((held, self._holding), (swept, self._sweeping)):
            if not work:
                continue
            if len(hands) == 1:
                self._work[hands[0]] += work
                continue
            fractions = [
                abs(sum(f * (a - b) for f, a, b in zip(*each, strict=True)))
                for each in zip(forces, self._places, before, strict=True)
            ]
            total = sum(fractions[i] for i in hands)
            for i in hands:
                weight = fractions[i] / total if total > 0.0 else 1.0 / len(hands)
                self._work[i] += weight * work

    def _take_broken(self) -> None:
        """Count the strands that parted in this tick: whose they are, whether they were seen."""
        duct, beam = self.duct, self.duct.beam
        damage = beam.damage
        new = np.flatnonzero((damage >= 1.0) & self._whole)
        self._whole = damage < 1.0
        ends, arms = beam.strand_ends(new), beam.strand_arms(new)
        seen = (arms * duct.view).sum(axis=1) > 0.0
        nearest = np.full(new.size, np.inf)
        owner = np.zeros(new.size, dtype=np.int64)
        for hand, holder in enumerate(duct.hands):
            rods = duct.rods_of(hand)
            away = np.abs(ends[:, 0] - holder.place[0])
            away = np.maximum(away - 0.5 * holder.opening, 0.0)  # from the nearer jaw or between
            if holder.node is not None or rods:
                seen |= away <= WORKING_DISTANCE
            touched = np.zeros(new.size, dtype=np.bool_)
            for rod in rods:
                touched |= beam.touched_by(rod, including_no_contact=not self.broken_by_touch)[new]
            # A strand is its instrument's if one touches it, else that of the nearest hand that
            # acts on the duct.
            acts = hand in self._acting if self.broken_by_touch else holder.node is not None
            away = np.where(touched, -1.0, away if acts else np.inf)
            owner[away < nearest] = hand
            nearest = np.minimum(nearest, away)
        for hand in range(HANDS):
            self._by_hand[hand] += int((owner == hand).sum())
        self.out_of_sight += int((~seen).sum())

    @property
    def errors(self) -> Incidents:
        """The errors so far, from the start on."""
        return self._finder.incidents

    @property
    def torn(self) -> bool:
        """Whether the duct has torn."""
        return self.duct.torn is not None

    @property
    def held(self) -> bool:
        """Whether a hand holds the duct."""
        return any(hand.node is not None for hand in self.duct.hands)

    @property
    def deflection_mm(self) -> float:
        """Of the place that is pulled hardest, now."""
        return self.duct.reading().deflection

    @property
    def distance_to_break(self) -> float:
        """1 less the stress over the threshold, now."""
        return 1.0 - self.duct.stress_ratio

    @property
    def bleeds(self) -> bool:
        """Whether blood flows out of a tube, now."""
        blood = self.duct.fluids.get("blood")
        return blood is not None and any(each.flow > LEAST_FLOW for each in blood.holes)

    @property
    def _lost_now(self) -> float | None:
        """Blood that has flowed out, ml: it flows on after the run, which has its own."""
        blood = self.duct.fluids.get("blood")
        return None if blood is None else 1e-3 * blood.lost

    def holding_beside(self, low: float, high: float) -> tuple[int, float] | None:
        """Return how many strands hold next to the longest free stretch, and where, mm."""
        # Of both of its ends, that which fewer hold; None without a stretch.
        inside = [
            (max(a, low), min(b, high)) for a, b in self.stretches if min(b, high) > max(a, low)
        ]
        if not inside:
            return None
        a, b = max(inside, key=lambda each: each[1] - each[0])
        surface = self.duct.surface
        stations = surface.strands.stations / surface.scale
        whole = stations[self.duct.beam.damage[self.duct.tubes.strands_of[0]] < 1.0]
        found: list[tuple[int, float]] = []
        for start, end in ((a - BESIDE_MM, a), (b, b + BESIDE_MM)):
            count = int(((whole >= start) & (whole < end)).sum())
            if count and low <= start and end <= high:
                found.append((count, 0.5 * (start + end)))
        return min(found, default=None)

    def critical_view(self) -> CriticalView:
        """Return the critical view of safety now; a `ValueError` where there is none."""
        return self._safety.critical_view()

    @property
    def named(self) -> frozenset[Structure]:
        """The structures that were pointed at, whether it was right or not."""
        return frozenset(each.structure for each in self.duct.marks)

    @property
    def called_unsafe(self) -> bool:
        """Whether it was said that nothing can safely be told."""
        return self.duct.called_unsafe

    def closings(self) -> list[Closing]:
        """Return how far each structure that enters the gallbladder is marked and closed."""
        return self._safety.closings()

    @cached_property
    def _safety(self) -> Safety:
        return Safety(self.duct)

    def measures(self) -> DissectionMeasures:
        """Return the measures so far; a `ValueError` before the start."""
        if not self._started:
            raise ValueError("a run starts with the first input; there has been none")
        torn, work = self._torn, sum(self._work)
        return DissectionMeasures(
            time_s=self.ticks * TICK_SECONDS,
            freed_mm=self.freed,
            longest_freed_stretch_mm=max((b - a for a, b in self.stretches), default=0.0),
            strands=self._whole.size - self._before,
            strands_broken=self._broken - self._before,
            strands_broken_by_hand=(self._by_hand[0], self._by_hand[1]),
            strands_broken_by_instrument=self._broken_by_rods,
            strands_broken_out_of_sight=self.out_of_sight,
            peak_stress_ratio=self.peak,
            peak_stress_station_mm=self.peak_station,
            smallest_distance_to_break=1.0 - self.peak,
            time_above_half_s=self._above_half * TICK_SECONDS,
            shortest_time_to_break_s=None
            if self.min_time_to_break == math.inf
            else self.min_time_to_break,
            work_mJ=(self._work[0], self._work[1]),
            strand_energy_mJ=self._dissipated,
            duct_energy_mJ=self._duct_energy,
            economy_of_work=self._dissipated / work if work > 0.0 else None,
            maximum_force_N=(self._most[0], self._most[1]),
            force_time_product_N_s=(self._product[0], self._product[1]),
            maximum_instrument_force_N=self.instrument_force,
            traction_angle_deg=(
                math.degrees(self._turned / self._pulled) if self._pulled > 0.0 else None
            ),
            tear=None
            if torn is None
            else DissectionTear(
                station_mm=torn.station,
                time_s=self.ticks * TICK_SECONDS,
                normal_stress_MPa=torn.normal_stress,
                bending_stress_MPa=torn.bending_stress,
                threshold_MPa=torn.threshold,
            ),
            blood_lost_ml=self._lost,
            critical_view_points=self._finder.most_points,
            time_out_of_picture_s=None if self._scope is None else self._unseen * TICK_SECONDS,
            scope_path_mm=None if self._scope is None else self._scope_path,
            horizon_deg=math.degrees(self._rolled / self._levelled) if self._levelled else None,
        )


def _size(force: list[float]) -> float:
    x, y, z = force
    return math.sqrt(x * x + y * y + z * z)
