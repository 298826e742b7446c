"""Measures of a dissection, taken while it runs (docs/measures.md)."""

import math
from collections.abc import Callable
from functools import cached_property
from typing import Any, ClassVar, Self

import msgspec
import numpy as np
from numpy.typing import NDArray

from app.simulation.exercises.critical_view import Closing, CriticalView
from app.simulation.exercises.errors import Incidents
from app.simulation.exercises.exercise import Exercise
from app.simulation.inputs.clock import TICK_SECONDS
from app.simulation.inputs.inputs import SCOPE_NUMBERS, Structure
from app.simulation.runs.run_file import HANDS
from app.simulation.session.error_finder import ErrorFinder
from app.simulation.session.measures import RATE_SECONDS, RATE_TICKS
from app.simulation.tissue.safety import Safety
from app.simulation.tissue.sight import LINE_OF_SIGHT, WORKING_DISTANCE, in_picture
from app.simulation.tissue.spatial_tissue import LEAST_FLOW, SpatialTissue
from kernel_cache import SameTypes, kernel
from physics.bed.kernels import BEAM, DISSIPATED, ROD_WORK, WORK

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bytes = NDArray[np.int8]

BESIDE_MM = 2.0
"""mm next to a free stretch whose strands are counted."""
LEAST_FORCE = 1e-3
"""N. A smaller force has no direction worth measuring."""
# Columns of a hand's sums: N, N s, mJ, whether it was the last to hold the duct, to sweep, and to
# do either; force along its way in this tick, mJ; where it was, mm.
MOST, PRODUCT, WORK_DONE, HOLDING, SWEEPING, ACTING, ALONG, PLACE = range(8)
# Sums of both: N on jaws and swabs; of force, and of force times angle; mJ, all but the first now;
# largest share of the break, and where, mm; ticks above half of it; s to the break; last shares.
INSTRUMENT, PULLED, TURNED, DUCT_MOST, WORK_NOW, ROD_WORK_NOW, DISSIPATED_NOW = range(7)
PEAK, PEAK_AT, ABOVE_HALF, TIME_TO_BREAK, RATIOS = range(7, 12)


class DissectionTear(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """Where and when the first tube that tore did, and under what."""

    station_mm: float  # from the first clamp, or the tube's first end
    time_s: float  # from the start of the run
    normal_stress_MPa: float  # noqa: N815
    bending_stress_MPa: float  # noqa: N815
    threshold_MPa: float  # noqa: N815
    tube: str | None = None  # its name; left out of a duct alone


class DissectionMeasures(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True
):
    """The measures of a dissection (docs/measures.md); None where it gives none.

    Pairs are of the first and the second hand.
    """

    time_s: float
    time_in_tissue_s: float  # with a hand that holds, is among strands or presses
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
    peak_stress_tube: str | None = None  # name of the tube; left out of a duct alone


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
        self.ticks = self._torn_at = self._torn_tube = 0
        self._hands, self._sums = np.zeros((HANDS, PLACE + 3)), np.zeros(RATIOS + RATE_TICKS)
        self._hands[:, HOLDING:ALONG], self._sums[TIME_TO_BREAK] = 1.0, math.inf
        self._by_hand = np.zeros(HANDS, np.int64)
        self.out_of_sight = 0
        self._peak, self._peak_tube = 0.0, 0  # largest share of the break, and of which tube
        self._scope: tuple[float, ...] | None = None  # its view, once there is one
        self._unseen = self._levelled = 0  # ticks: a tip out of the picture; a horizon known
        self._scope_path = self._rolled = 0.0  # mm; sum of rad

    def start(self) -> None:
        """Start on a duct at rest, whose bed may be opened already."""
        duct = self.duct
        self._started = True
        self._whole = duct.beam.state.damage < 1.0  # as the state has them
        self._before = self._broken = duct.broken
        _note_energies(duct.beam.state.sums, self._sums)
        self._hands[:, PLACE:] = [hand.place for hand in duct.hands]
        self._lost = self._lost_now
        self._take_tear()
        self._measure_freed()
        exercise = self.exercise
        self._finder = (
            ErrorFinder(duct, {})
            if exercise is None
            else ErrorFinder(duct, exercise.limit_of, exercise.about)
        )

    def _take_tear(self) -> None:
        """Note the first tear, its tube and when it came: a run is kept after its duct is whole."""
        self._torn, self._torn_at = self.duct.torn, self.ticks
        if self._torn is not None:
            self._torn_tube = self.duct.tears.index(self._torn)

    def _measure_freed(self) -> None:
        self.freed = self.duct.freed
        self._broken_by_rods = self.duct.beam.broken_by_rods
        self.stretches = self.duct.freed_stretches()

    def take(self, *, moved: bool) -> None:
        """Take one tick, in which something moved or all stood still."""
        self.ticks += 1
        duct = self.duct
        self._lost = self._lost_now
        if self._torn is None:
            self._take_tear()
        if len(duct.pose) >= SCOPE_NUMBERS:
            self._take_scope(duct.pose)
        state, (a, b), (force, other) = duct.beam.state, duct.hands, duct.forces
        _TAKE(
            self._hands, self._sums, (*force, *other), state.pull, state.press, state.sums,
            (a.place, b.place), (a.node is not None, b.node is not None),
            duct.rod_counts, duct.stress_ratio, duct.station, moved,
        )  # fmt: skip
        if duct.stress_ratio > self._peak:
            self._peak, self._peak_tube = duct.stress_ratio, duct.worst_tube
        out_of_sight = self.out_of_sight
        if moved and duct.broken > self._broken:
            self._broken = duct.broken
            self._take_broken()
            self._measure_freed()
        self._finder.take(self.stretches, self.out_of_sight - out_of_sight)

    def _take_scope(self, pose: tuple[float, ...]) -> None:
        """Take how the scope is held, which is known in steps of 5 mm or 5 degrees."""
        before, self._scope = self._scope, pose
        if before is not None and before is not pose:
            self._scope_path += _size([b - a for a, b in zip(before[3:6], pose[3:6], strict=True)])
        sight = pose[:LINE_OF_SIGHT]
        self._unseen += not all(in_picture(sight, hand.place) for hand in self.duct.hands)
        if len(pose) > SCOPE_NUMBERS:
            self._levelled += 1
            self._rolled += abs(pose[SCOPE_NUMBERS])

    def _take_broken(self) -> None:
        """Count the strands that parted in this tick: whose they are, whether they were seen."""
        duct, beam = self.duct, self.duct.beam
        parted = beam.state.damage >= 1.0
        new = np.flatnonzero(parted & self._whole)
        self._whole = ~parted
        which, (a, b) = beam.order[new], duct.hands
        self.out_of_sight += _TAKE_NEW(
            new, beam.state.side, beam.strand_ends(which), beam.strand_arms(which), duct.view,
            (a.place, b.place), (a.opening, b.opening), (a.node is not None, b.node is not None),
            duct.rod_counts, self.broken_by_touch, self._hands, self._by_hand,
        )  # fmt: skip

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
    def holds(self) -> int:
        """How many holds there have been, of all hands."""
        return sum(hand.holds for hand in self.duct.hands)

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
        """Return how many strands hold next to the longest free stretch, and where it ends, mm."""
        # Of both of its ends, that which fewer hold; without a stretch, of all places where some
        # have parted, their middle.
        # One that ends where the others begin counts; bins of some 1 mm say where.
        inside = [
            (max(a, low), min(b, high))
            for a, b in self.stretches
            if min(b, high) >= max(a, low) - 0.5 * BESIDE_MM
        ]
        surface = self.duct.surface
        stations = surface.strands.stations / surface.scale
        holds = self.duct.beam.damage[self.duct.tubes.strands_of[0]] < 1.0
        whole, parted = stations[holds], stations[~holds]
        if inside:
            a, b = max(inside, key=lambda each: each[1] - each[0])
            places = [(a - BESIDE_MM, a, a), (b, b + BESIDE_MM, b)]
        else:
            starts = np.arange(low, high - BESIDE_MM + 1e-9, 0.5 * BESIDE_MM).tolist()
            places = [
                (start, start + BESIDE_MM, start + 0.5 * BESIDE_MM)
                for start in starts
                if ((parted >= start) & (parted < start + BESIDE_MM)).any()
            ]
        found: list[tuple[int, float]] = []
        for start, end, place in places:
            first, last = max(start, low), min(end, high)
            count = int(((whole >= first) & (whole < last)).sum())
            if count:
                found.append((count, place))
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

    def measure(self, key: str) -> float | tuple[float, ...] | None:
        """Return one of the measures so far; None of a key that there is not."""
        found = self._measures.get(key)
        return None if found is None else found(self)

    def measures(self) -> DissectionMeasures:
        """Return the measures so far; a `ValueError` before the start."""
        if not self._started:
            raise ValueError("a run starts with the first input; there has been none")
        return DissectionMeasures(**{key: found(self) for key, found in self._measures.items()})

    def _tear(self) -> DissectionTear | None:
        torn = self._torn
        if torn is None:
            return None
        return DissectionTear(
            station_mm=torn.station,
            time_s=self._torn_at * TICK_SECONDS,
            normal_stress_MPa=torn.normal_stress,
            bending_stress_MPa=torn.bending_stress,
            threshold_MPa=torn.threshold,
            tube=self._name(self._torn_tube),
        )

    def _name(self, tube: int) -> str | None:
        """Return a tube's name where there are several."""
        names = self.duct.tubes.names
        return names[tube] if len(names) > 1 else None

    def _of_hands(self, column: int) -> tuple[float, ...]:
        return tuple(self._hands[:, column].tolist())

    def _ratio(self, of: int, over: float) -> float | None:
        return float(self._sums[of]) / over if over > 0.0 else None

    # Each by itself: an exercise asks for few of them in each tick.
    _measures: ClassVar[dict[str, Callable[[Self], Any]]] = {
        "time_s": lambda self: self.ticks * TICK_SECONDS,
        "time_in_tissue_s": lambda self: self._finder.ticks_in_tissue * TICK_SECONDS,
        "freed_mm": lambda self: self.freed,
        "longest_freed_stretch_mm": lambda self: max(
            (b - a for a, b in self.stretches), default=0.0
        ),
        "strands": lambda self: self._whole.size - self._before,
        "strands_broken": lambda self: self._broken - self._before,
        "strands_broken_by_hand": lambda self: tuple(self._by_hand.tolist()),
        "strands_broken_by_instrument": lambda self: self._broken_by_rods,
        "strands_broken_out_of_sight": lambda self: self.out_of_sight,
        "peak_stress_ratio": lambda self: float(self._sums[PEAK]),
        "peak_stress_station_mm": lambda self: float(self._sums[PEAK_AT]),
        "smallest_distance_to_break": lambda self: 1.0 - float(self._sums[PEAK]),
        "time_above_half_s": lambda self: float(self._sums[ABOVE_HALF]) * TICK_SECONDS,
        "shortest_time_to_break_s": lambda self: (
            None if self._sums[TIME_TO_BREAK] == math.inf else float(self._sums[TIME_TO_BREAK])
        ),
        "work_mJ": lambda self: self._of_hands(WORK_DONE),
        "strand_energy_mJ": lambda self: float(self._sums[DISSIPATED_NOW]),
        "duct_energy_mJ": lambda self: float(self._sums[DUCT_MOST]),
        "economy_of_work": lambda self: self._ratio(DISSIPATED_NOW, sum(self._of_hands(WORK_DONE))),
        "maximum_force_N": lambda self: self._of_hands(MOST),
        "force_time_product_N_s": lambda self: self._of_hands(PRODUCT),
        "maximum_instrument_force_N": lambda self: float(self._sums[INSTRUMENT]),
        "traction_angle_deg": lambda self: (
            math.degrees(self._sums[TURNED] / self._sums[PULLED])
            if self._sums[PULLED] > 0.0
            else None
        ),
        "tear": lambda self: self._tear(),
        "blood_lost_ml": lambda self: self._lost,
        "critical_view_points": lambda self: self._finder.most_points,
        "time_out_of_picture_s": lambda self: (
            None if self._scope is None else self._unseen * TICK_SECONDS
        ),
        "scope_path_mm": lambda self: None if self._scope is None else self._scope_path,
        "horizon_deg": lambda self: (
            math.degrees(self._rolled / self._levelled) if self._levelled else None
        ),
        "peak_stress_tube": lambda self: self._name(self._peak_tube) if self._peak else None,
    }


def _size(force: list[float]) -> float:
    x, y, z = force
    return math.sqrt(x * x + y * y + z * z)


@kernel()
def _note_energies(energies: Floats, sums: Floats) -> None:
    """Keep the energies of a beam's state, mJ."""
    sums[WORK_NOW], sums[ROD_WORK_NOW] = energies[WORK], energies[ROD_WORK]
    sums[DISSIPATED_NOW] = energies[DISSIPATED]


@kernel()
def _any(press: Floats, first: int, count: int) -> bool:
    """Return whether some rods press."""
    found = False
    for rod in range(first, first + count):
        for r in range(3):
            found |= press[rod, r] != 0.0
    return found


@kernel()
def _take_hands(
    hands: Floats, sums: Floats, forces: tuple[float, ...], pull: Floats, press: Floats,
    energies: Floats, places: tuple[Floats, Floats], held: tuple[bool, bool],
    rods: tuple[int, int], ratio: float, station: float, moved: bool,
) -> None:  # fmt: skip
    """Add a tick to the sums of hands with these forces, N, and places, mm; so many rods each.

    `ratio` is the share of the break, at a `station`, mm.
    """
    if ratio > sums[PEAK]:
        sums[PEAK], sums[PEAK_AT] = ratio, station
    sums[ABOVE_HALF] += ratio > 0.5
    growth = (ratio - sums[RATIOS + RATE_TICKS - 1]) / RATE_SECONDS
    if growth > 0.0:
        sums[TIME_TO_BREAK] = min(sums[TIME_TO_BREAK], max(1.0 - ratio, 0.0) / growth)
    for k in range(RATE_TICKS - 1, 0, -1):
        sums[RATIOS + k] = sums[RATIOS + k - 1]
    sums[RATIOS] = ratio
    for i in range(HANDS):
        x, y, z = forces[3 * i], forces[3 * i + 1], forces[3 * i + 2]
        size = math.sqrt(x * x + y * y + z * z)
        hands[i, MOST] = max(hands[i, MOST], size)
        hands[i, PRODUCT] += size * TICK_SECONDS
        for rod in range(2 * i, 2 * i + rods[i]):
            square = pull[rod, 0] ** 2 + pull[rod, 1] ** 2 + pull[rod, 2] ** 2
            sums[INSTRUMENT] = max(sums[INSTRUMENT], math.sqrt(square))
        if held[i] and size > LEAST_FORCE:
            sums[PULLED] += size
            sums[TURNED] += size * math.acos(min(max(z / size, -1.0), 1.0))
    if not moved:
        return
    # The tick's work, as the beam counts it, is divided between the hands: that on the duct goes to
    # those that hold it, that on rods to those that sweep; where both do the same, in proportion to
    # force times way of each. The energies are a step behind: a hand that has just let go still
    # gets its last part.
    work, swept = sums[WORK_NOW], sums[ROD_WORK_NOW]
    _note_energies(energies, sums)
    sums[DUCT_MOST] = max(sums[DUCT_MOST], energies[BEAM])
    swept = sums[ROD_WORK_NOW] - swept
    work = sums[WORK_NOW] - work - swept
    presses = _any(press, 0, rods[0]), _any(press, 2, rods[1])
    for i in range(HANDS):
        if held[0] or held[1]:
            hands[i, HOLDING] = held[i]
        if rods[0] or rods[1]:
            hands[i, SWEEPING] = rods[i] > 0
        if held[0] or held[1] or presses[0] or presses[1]:
            hands[i, ACTING] = held[i] or presses[i]
    for i in range(HANDS):
        along = 0.0
        for r in range(3):
            along += forces[3 * i + r] * (places[i][r] - hands[i, PLACE + r])
            hands[i, PLACE + r] = places[i][r]
        hands[i, ALONG] = abs(along)
    for column, done in ((HOLDING, work), (SWEEPING, swept)):
        if done == 0.0:
            continue
        count = total = 0.0
        for i in range(HANDS):
            count += hands[i, column]
            total += hands[i, column] * hands[i, ALONG]
        for i in range(HANDS):
            if hands[i, column] == 0.0:
                continue
            weight = hands[i, ALONG] / total if total > 0.0 else 1.0 / count
            hands[i, WORK_DONE] += (1.0 if count == 1.0 else weight) * done


@kernel()
def _take_new(
    new: Ints, side: Bytes, ends: Floats, arms: Floats, view: Floats,
    places: tuple[Floats, Floats], openings: tuple[float, float], held: tuple[bool, bool],
    rods: tuple[int, int], by_touch: bool, hands: Floats, by_hand: Ints,
) -> int:  # fmt: skip
    """Count strands that have parted, with these ends and arms; return how many were not seen."""
    # A strand is its instrument's if one touches it, else that of the nearest hand that acts on the
    # duct.
    unseen = 0
    for k in range(new.size):
        seen = arms[k, 0] * view[0] + arms[k, 1] * view[1] + arms[k, 2] * view[2] > 0.0
        owner, nearest = 0, math.inf
        for i in range(HANDS):
            # From the nearer jaw, or between them.
            away = max(abs(ends[k, 0] - places[i][0]) - 0.5 * openings[i], 0.0)
            seen |= (held[i] or rods[i] > 0) and away <= WORKING_DISTANCE
            touched = False
            for rod in range(2 * i, 2 * i + rods[i]):
                how = side[rod, new[k]]
                touched |= how == 1 or how == -1 or (how != 0 and not by_touch)
            acts = hands[i, ACTING] > 0.0 if by_touch else held[i]
            if touched:
                away = -1.0
            if (touched or acts) and away < nearest:
                owner, nearest = i, away
        by_hand[owner] += 1
        unseen += not seen
    return unseen


_TAKE, _TAKE_NEW = SameTypes(_take_hands), SameTypes(_take_new)
