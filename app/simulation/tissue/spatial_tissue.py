"""Tubes in space under two hands, free or in the tissue that holds them, in real time.

`physics.bed.BeamOnBed` solves it; here are the hands and their instruments, the strengths at which
walls tear, what bleeds, and the transforms by which surfaces follow the beams. A single duct is one
tube. A tick of 1/30 s is `SUBSTEPS` steps of the beam: the peak force of a pull at 8 mm/s is then
within 0.4 % of that with steps four times as short, at 40 mm/s within 2.6 % (docs/theory.md).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from app.bed_preset import BedPreset, named_or_whole
from app.relaxation_preset import Prony
from app.simulation.exercises.exercise import Exercise
from app.simulation.inputs.clock import TICK_SECONDS
from app.simulation.inputs.hand import MEAN_PULL, Hand
from app.simulation.inputs.inputs import (
    ALL_INSTRUMENTS,
    HOLDING,
    INSTRUMENTS,
    STRUCTURES,
    VIEWS,
    Applied,
    InputKind,
    Instrument,
    Structure,
)
from app.simulation.inputs.trocar import TROCARS
from app.simulation.runs.run_file import (
    ELEMENTS,
    HANDS,
    SUBSTEPS,
    RunStart,
    anatomy_or_name,
    strands_digest,
)
from app.simulation.specimen.dissection import Dissection
from app.simulation.specimen.drawn_duct import DrawnDuct
from app.simulation.specimen.preset import OrganBeam
from app.simulation.specimen.specimen import THRESHOLD_RANGE, Specimen
from app.simulation.specimen.structures import entering_tubes, front_strands, named_structures
from app.simulation.specimen.tear import SETTLED_SECONDS, Phase, tear_front, tear_swing
from app.simulation.tissue.blades import Between, Blades
from app.simulation.tissue.instruments import (
    ALONG,
    CLIP_OPENING,
    FIRST_INSTRUMENTS,
    FROM_ABOVE,
    JAWED,
    LENGTH,
    MOST_OPENING,
    RADIUS,
    RODS,
    SCOPE_INSTRUMENTS,
    TOWARDS_HAND,
    HandContact,
    Rod,
    jaw_offset,
)
from app.simulation.tissue.lens import Lens
from app.simulation.tissue.reached_tube import fine_axis, jaws_on_wall
from app.simulation.tissue.reading import FluidReading, NickReading, Reading, Vector
from app.simulation.tissue.sight import STEADY, STEADY_MM, TOWARDS_VIEWER
from app.simulation.tissue.suction import MOST_SUCTION, Suction
from app.simulation.tissue.tissue_tick import RATIO, STEP_NUMBERS, SUM_FORCES, TISSUE_TICK, WORST
from physics import DEEPEST, NoEquilibrium, RuptureCheck
from physics.bed import BeamOnBed, Network, WorstStress

Floats = NDArray[np.float64]
EventKind = Literal["nick", "tear", "bleeding", "leak", "stanched", "clip", "division"]
"""A tear part of the way through a wall, and one that parts the tube; blood or bile that begins to
flow out of a tube, and that no longer does; a clip that closes a tube, and scissors that divide
it."""

LOSSES: dict[str, EventKind] = {"blood": "bleeding", "bile": "leak"}
OPENINGS: tuple[EventKind, ...] = ("nick", "tear", "division")
LEAST_FLOW = 1e-3
"""mm^3/s. Out of a tube that loses less, nothing flows."""
LIFTED_AT_MM, LIFT_MM_S, SETTLE_TICKS = 10.0, 10.0, 30
"""Where an exercise lifts the gallbladder, mm from its neck; at what mm/s; ticks of rest."""
MOST_LIFTED = 0.75
"""Largest stress over strength, from which on it is lifted no farther."""
CLEAR_MM = 18.0
"""mm before the tubes of an anatomy, on the way to its trocar, where an empty instrument waits."""
# Of the span, where the hands' empty instruments wait: the second one out of the first's way.
PARKED_AT = (0.5, 0.2)
DIRECTION = (1e-9, 1e9)
"""Length of what can be a direction."""
REACH = 60.0
"""mm beyond the duct's ends and to its sides that a hand can reach."""
GAP_MM = 3.0  # between a free duct and where an empty dissector waits below it
BIN_MM, FREED_FRACTION = 1.0, 0.95
"""mm, and the part of a bin's strands that must have parted for its stretch to be free."""
# A tick in which no node moves farther has reached equilibrium: no strand yields any more.
STILL_MM = 1e-6
# A stress that leaps is no equilibrium's, as where a vessel slips off closing jaws: one Newton step
# a ms overshoots. It counts if the next tick has it too. A leap is by more than this part of the
# wall's strength in a tick, and by more than so many times what the tick before it rose by: under a
# load that grows fast stresses rise more and more, but not from one tick to the next.
LEAP, MORE_THAN_BEFORE = 0.25, 2.0
# Tissue that relaxes does so for minutes: it is left as it is once no node moves farther, and its
# stress changes by no more of the strength.
RELAXED_MM, RELAXED_FRACTION = 1e-5, 1e-6


class Event(NamedTuple):
    """What has happened to a tube: where, when and by which hand."""

    kind: EventKind
    tick: int  # since all was whole
    tube: str
    station: float  # mm from the tube's first end
    hand: int | None


class Mark(NamedTuple):
    """That a tube was taken for a structure, by pointing at it."""

    structure: Structure
    tube: str
    station: float  # mm from the tube's first end
    tick: int  # since all was whole


class SpatialTissue:
    """A specimen's tubes in their tissue, two hands at them, and what has become of them.

    Of a tube that is not named, the first is meant.
    """

    def __init__(
        self,
        specimen: Specimen,
        *,
        broken_by_touch: bool = True,
        grip_N: float | None = None,  # noqa: N803 (a unit)
        exercise: Exercise | None = None,
    ) -> None:
        self.specimen, self.broken_by_touch, self._grip = specimen, broken_by_touch, grip_N
        self.threshold = specimen.threshold
        self.tubes = specimen.tubes(elements=ELEMENTS)
        self._rest = next(iter(self.tubes.network.tubes.values()))
        self.radius = float(self._rest.radius.mean())  # of the first tube, mm
        self.surface = self.tubes.surfaces[0]
        # Of tubes that were asked for: of each strand its bin, and the most that hold a free bin.
        self._bins: dict[int, tuple[NDArray[np.int16], Floats]] = {}
        # Hands go no farther than `REACH` beyond the frame's origin, the first tube and all others.
        places = [each.places for each in self.tubes.network.tubes.values()]
        ends = np.array([[0.0, 0.0, 0.0], [self.dissection.beam.span, 0.0, 0.0]])
        places = np.concatenate([ends, *places])
        low, high = places.min(axis=0) - REACH, places.max(axis=0) + REACH
        self._reach: list[tuple[float, float]] = list(zip(low.tolist(), high.tolist(), strict=True))
        self.prepare(exercise)

    @property
    def most_stressed(self) -> str:
        """Name of the tube whose wall is nearest its break."""
        return self.tubes.names[self.worst_tube]

    @property
    def dissection(self) -> Dissection:
        """The organ between its clamps."""
        return self.specimen.dissection

    @property
    def in_plane(self) -> None:
        """Nothing: no theory of the plane solves it."""

    @property
    def in_space(self) -> Self:
        """Itself, solved by beams in space."""
        return self

    @property
    def bed(self) -> BedPreset | None:
        """What it lies in, if it is not free."""
        return self.specimen.bed

    @property
    def gap_mm(self) -> float:
        """Between duct and bed, or to where an empty dissector waits below a free duct."""
        return GAP_MM if self.bed is None else self.bed.gap_mm

    @property
    def own_threshold(self) -> float:
        """The specimen's own threshold, MPa."""
        return self.specimen.threshold

    @property
    def threshold_range(self) -> tuple[float, float]:
        """Smallest and largest threshold, MPa."""
        low, high = THRESHOLD_RANGE
        return low * self.specimen.threshold, high * self.specimen.threshold

    def prepare(self, exercise: Exercise | None) -> None:
        """Make all whole and let go, as an exercise begins, or without one."""
        opening = None if exercise is None else exercise.opening
        self._opened = None if opening is None else opening.opened_mm
        self._exposed = None if opening is None else opening.exposed
        self._lifted = 0.0 if opening is None else opening.lifted_mm
        self.divided: bool = opening is not None and opening.divided
        self.opens_torn: str | None = None if opening is None else opening.torn
        """The tube that tears with the first touch, if one does."""
        usual = () if self.specimen.anatomy is None else SCOPE_INSTRUMENTS
        self._in_hand = usual if exercise is None else exercise.in_hand or usual
        self.view: Floats = TOWARDS_VIEWER  # (3,) unit vector towards the viewer
        # what is known of it: also the camera's place, mm, and how a scope is held
        self.pose: tuple[float, ...] = tuple(TOWARDS_VIEWER.tolist())
        self._soils = opening is None or opening.soils
        self._relaxing = self.specimen.relaxing(None if opening is None else opening.relaxes)
        self._make_whole()

    def renew(self) -> list[tuple[int, Applied]]:
        """Make all whole with the hands where they are; return where those go on their way."""
        hands = self.hands
        if self._whole:
            self.ticks = 0
        else:
            self._make_whole()
        if self.opens_torn is not None:
            name, tubes = self.opens_torn, self.tubes
            middle = 0.5 * tubes.network.tubes[name].span
            self.torn_elements[tubes.names.index(name)] = self.beam.tear(middle, name)
        for hand, before in enumerate(hands if self.hands is not hands else ()):
            self.put_hand(hand, before.place)
            self.hands[hand].target[:] = before.target
        in_progress: list[tuple[int, Applied]] = [
            (hand, ("move", tuple(holder.target.tolist())))
            for hand, holder in enumerate(self.hands)
            if not holder.arrived
        ]
        if self.view is not TOWARDS_VIEWER:
            in_progress.append((0, ("view", self.pose)))
            self.lens.touch(self.pose, self.beam)
        return in_progress

    def _make_whole(self) -> None:
        opened = self._opened
        tubes = self.tubes
        strands, wall = self._relaxing
        self.beam = BeamOnBed(
            _with_free_end(tubes.network) if self.divided else tubes.network,
            tubes.strands,
            floor=tubes.floor,
            rods=2 * HANDS,
            strand_relaxation=strands,
            wall_relaxation=wall,
        )
        if opened is not None:
            scale = self.surface.scale
            self.beam.break_between(scale * opened[0], scale * opened[1])
        if self._exposed is not None:
            assert self.specimen.anatomy is not None  # noqa: S101 (of `Opening`)
            self.beam.detach(front_strands(self.specimen.anatomy, tubes, self._exposed))
        self.fluids = tubes.fluids(self.beam)
        self.events: list[Event] = []
        self.lens = Lens(soils=self._soils)
        self.marks: list[Mark] = []
        self.called_unsafe = False  # whether it was said that nothing can safely be told
        self.suction = Suction(self.fluids)
        self._closed_at = [-math.inf] * HANDS  # ticks, by button
        self.ticks = 0  # since all was made whole
        self.hands = tuple(
            Hand(each, self.parking(hand, each)) for hand, each in enumerate(FIRST_INSTRUMENTS)
        )
        self.rod_counts = 0, 0  # how many rods of the beam each hand's instrument is
        self.tears: list[RuptureCheck | None] = [None] * len(tubes.names)
        self.torn_elements = [-1] * len(tubes.names)  # of each tube, from 0
        self.nicked = [0.0] * len(tubes.names)  # how deep each is torn, of its height
        # of the strength, of each tube
        self.stress_ratios = [0.0] * len(tubes.names)
        # Those of the last two ticks, with their leaps.
        self._found_ratios: tuple[list[float], list[float]] = self.stress_ratios, self.stress_ratios
        # the largest; where, mm from that tube's first end, and of which tube
        self.stress_ratio, self.station, self.worst_tube = 0.0, 0.0, 0
        self._leaking: set[tuple[str, str]] = set()  # fluids and tubes that lose some
        self.peak_stress_ratio = 0.0  # since all was made whole
        self.broken: int = self.beam.broken
        self.freed = self.beam.freed  # mm
        self._before = np.empty_like(self.beam.places)
        self._stresses = np.empty_like(self.beam.walls)
        self._found = np.zeros((WORST + len(tubes.names), RATIO + 1))
        self._still = True
        self._torn_ticks = 0
        self._forget_reading()
        for hand, instrument in enumerate(self._in_hand):
            if instrument != FIRST_INSTRUMENTS[hand]:
                self.choose_instrument(hand, instrument)
            if instrument == "clip applier":
                self.hands[hand].opening = self.hands[hand].target_opening = CLIP_OPENING
        if self._lifted > 0.0:
            self._lift(self._lifted)
        self._whole = True  # nothing has changed since

    def _lift(self, far: float) -> None:
        """Have the first hand's grasper hold the gallbladder up, and away from the common duct."""
        anatomy, beam = self.specimen.anatomy, self.beam
        assert anatomy is not None  # noqa: S101 (of `Opening`)
        gallbladder, duct, _ = named_structures(anatomy)
        start = self.grab(0, LIFTED_AT_MM, self.tubes.names.index(gallbladder))
        if start is None:
            raise ValueError("the gallbladder cannot be held there")
        cystic = beam.nodes_of(duct)
        away = start - beam.places[cystic[0 if entering_tubes(anatomy, gallbladder)[duct] else -1]]
        away[2] = math.sqrt(float((away[:2] ** 2).sum()))
        away = away / math.sqrt(float((away**2).sum()))
        ticks = math.ceil(far / LIFT_MM_S / TICK_SECONDS)
        for tick in range(1, ticks + SETTLE_TICKS):
            self.move_hand(0, start + min(tick / ticks, 1.0) * far * away)
            self._advance()
            if self.stress_ratio > MOST_LIFTED:
                self.move_hand(0, self.hands[0].place)
                break
        self.peak_stress_ratio = self.stress_ratio

    def parking(self, hand: int, instrument: Instrument) -> Floats:
        """Return where an instrument that touches nothing waits, (3,) mm."""
        if (anatomy := self.specimen.anatomy) is not None:
            tubes = self.tubes.network.tubes
            thin = [tubes[each.name].places for each in anatomy.tube if each.kind != "organ"]
            middle: Floats = np.concatenate(thin).mean(axis=0)
            return middle + CLEAR_MM * TROCARS[hand].shaft(middle)
        along = PARKED_AT[hand] * self._rest.span
        if instrument == "dissector":  # beside the duct, at the height at which it passes under it
            height = -self.radius - 0.5 * self.gap_mm
            return np.array([along, -3.0 * self.radius - 5.0, height])
        return np.array([along, -self.radius, 3.0 * self.radius])

    # Hands

    def apply(
        self, hand: int, kind: InputKind, values: tuple[float, ...], begin: Callable[[], bool]
    ) -> Applied | None:
        """Apply an input; return it as it has acted, or None where it changes nothing."""
        if not 0 <= hand < HANDS or not all(map(math.isfinite, values)):
            return None
        if kind == "move":
            x, y, z = values
            before: list[float] = self.hands[hand].target.tolist()
            place = self._towards(hand, x, y, z, before, begin)
            return None if place is None else ("move", place)
        if kind == "open":
            if self.hands[hand].instrument in JAWED:
                begin()
            return self._open(hand, float(values[0]))
        if kind == "instrument":
            instrument = ALL_INSTRUMENTS[int(values[0])]
            if instrument not in self.instruments:
                return None
            begin()
            self.choose_instrument(hand, instrument)
            return kind, values
        if kind == "view":
            return self._look_from(values)
        if kind in ("aim", "spread"):
            return self._turn(hand, kind, values, begin)
        if kind in ("clip", "divide", "cut"):
            return (kind, ()) if self._close(hand, kind) else None
        if kind == "wipe":
            return ("wipe", ()) if self.lens.wipe() else None
        if kind in ("mark", "unsafe"):
            return self._name(kind, values, begin)
        if kind == "suck":
            return self._suck(hand, float(values[0]))
        if kind == "grab":
            tube = int(values[0])
            if not 0 <= tube < len(self.tubes.names):
                return None
            at = min(max(float(values[1]), 0.0), self.tubes.dissections[tube].beam.span)
            held = self.hands[hand].node is not None
            place = self.grab(hand, at, tube)
            if place is not None and begin():
                self.grab(hand, at, tube)
            return ("grab", (tube, at)) if held or place is not None else None
        if kind == "release":
            return ("release", ()) if self.release(hand) else None
        if kind == "threshold" and self.tears[0] is None:
            low, high = self.threshold_range
            wanted = min(max(float(values[0]), low), high)
            if wanted != self.threshold:
                self.threshold = wanted
                self._forget_reading()
                return "threshold", (wanted,)
        return None

    def _towards(
        self,
        hand: int,
        x: float,
        y: float,
        z: float,
        before: list[float],
        begin: Callable[[], bool],
    ) -> Vector | None:
        """Set where a hand's tip goes, within its reach; return that, or None as it was before."""
        (a, b), (c, d), (e, f) = self._reach
        # Comparisons: each min or max takes as long as all of them.
        place = (
            a if x < a else b if x > b else x,
            c if y < c else d if y > d else y,
            e if z < e else f if z > f else z,
        )
        if place == (before[0], before[1], before[2]):
            return None
        if self.rod_counts[hand]:  # it may part strands before a hand takes hold
            begin()
        self.move_hand(hand, place)
        return place

    def lead(
        self, hand: int, step: Sequence[float], begin: Callable[[], bool]
    ) -> tuple[Vector | None, Applied | None]:
        """Lead a hand on by a (4,) step, mm, of its tip and of its jaws' opening.

        Returns
        -------
        tuple[Vector | None, Applied | None]
            Where the tip goes, and the input that opens jaws; None of what stays as it was.
        """
        x, y, z, opened = step
        before: list[float] = self.hands[hand].target.tolist()
        place = self._towards(hand, before[0] + x, before[1] + y, before[2] + z, before, begin)
        holder = self.hands[hand]
        if not opened or holder.instrument not in JAWED:
            return place, None
        begin()
        return place, self._open(hand, holder.target_opening + opened)

    @property
    def instruments(self) -> tuple[Instrument, ...]:
        """What its hands may have: to clip and divide only where something flows."""
        return ALL_INSTRUMENTS if self.fluids else INSTRUMENTS

    def _look_from(self, values: tuple[float, ...]) -> Applied | None:
        """Let the tissue be seen from elsewhere, if that is farther than a glance away."""
        towards, rest = values[:3], values[3:]
        size = math.sqrt(sum(each * each for each in towards))
        if len(values) not in VIEWS or size == 0.0:
            return None
        if not math.isclose(size, 1.0, rel_tol=1e-12):  # a logged one stays as it is, to the bit
            towards = tuple(each / size for each in towards)
        view, pose = np.array(towards), (*towards, *rest)
        if float((view * self.view).sum()) > STEADY and not _moved(self.pose, pose):
            return None
        self.view, self.pose = view, pose
        self.lens.touch(self.pose, self.beam)
        return "view", pose

    def _turn(
        self, hand: int, kind: InputKind, values: tuple[float, ...], begin: Callable[[], bool]
    ) -> Applied | None:
        """Turn an instrument's shaft, or the direction in which its jaws part."""
        holder = self.hands[hand]
        if holder.instrument not in RADIUS or not DIRECTION[0] < math.hypot(*values) < DIRECTION[1]:
            return None
        begun = begin()  # which makes hands anew
        holder = self.hands[hand]
        aim, spread = np.array(holder.aim), np.array(holder.spread)
        if kind == "aim":
            aim = np.array(values)
            aim = aim / np.sqrt((aim**2).sum())
        else:
            spread = np.array(values)
        across = spread - (spread * aim).sum() * aim
        size = math.sqrt((across**2).sum())
        if size < 1e-3:  # as good as along the shaft: any direction across it
            across = np.cross(aim, [1.0, 0.0, 0.0] if abs(aim[0]) < 0.9 else [0.0, 1.0, 0.0])
            size = math.sqrt((across**2).sum())
        before, deep = (holder.aim, holder.spread), self._nearness(hand)
        holder.aim, holder.spread = _vector(aim.tolist()), _vector((across / size).tolist())
        if not begun and self._nearness(hand) < deep:  # it would turn into a tube
            holder.aim, holder.spread = before
            return None
        self._still = False
        self._forget_reading()
        for rod in self.touch(hand).rods:
            self.beam.set_rod(*rod)
        return kind, values

    def _nearness(self, hand: int) -> float:
        """Return how near an instrument is to the axis of a tube that it is deep in, or 1."""
        rods = self.touch(hand).rods
        return min((self.beam.nearness(*each[1:]) for each in rods), default=1.0)

    def between_jaws(self, tip: Floats, aim: Floats, opening: float) -> list[tuple[int, float]]:
        """Return tubes, and stations on their beams, between jaws: (3,) mm, (3,) back, mm."""
        # The whole width of a tube must be between them, and their tips past it.
        beam, half = self.beam, 0.5 * opening
        out: list[tuple[int, float]] = []
        for tube, (name, rest) in enumerate(self.tubes.network.tubes.items()):
            fine, line = fine_axis(beam, name)
            offset = line - tip
            deep = (offset * aim).sum(axis=1)
            off = np.sqrt(((offset - deep[:, None] * aim) ** 2).sum(axis=1))
            at = int(off.argmin())
            radius = float(np.interp(fine[at : at + 1], rest.stations, rest.radius)[0])
            if off[at] + radius <= half and deep[at] >= radius:
                out.append((tube, float(fine[at])))
        return out

    def _close(self, hand: int, kind: InputKind) -> bool:
        """Clip or cut what is between a hand's jaws; return whether anything was."""
        holder, found = self.hands[hand], False
        if holder.instrument != ("clip applier" if kind == "clip" else "scissors"):
            return False
        self._closed_at[hand] = self.ticks
        if kind == "cut":
            found = self._cut(hand)
        else:
            close = self._clip if kind == "clip" else self._divide
            for tube, at in self.between_jaws(holder.place, np.array(holder.aim), holder.opening):
                found |= close(tube, at, hand)
        if found:
            self._still = False
            self._forget_reading()
        return found

    def blades(self, hand: int) -> Blades:
        """Return the blades of a hand that has scissors."""
        holder = self.hands[hand]
        aim, spread = np.array(holder.aim), np.array(holder.spread)
        return Blades(holder.place, aim, spread, holder.opening)

    def _clip(self, tube: int, at: float, hand: int) -> bool:
        name = self.tubes.names[tube]
        for flow in self.fluids.values():
            if name in flow.tubes:
                flow.clip(at, name)
        self._note("clip", tube, at / self.tubes.surfaces[tube].scale, hand)
        return True

    def _divide(self, tube: int, at: float, hand: int) -> bool:
        """Divide a tube, mm from its beam's first end; return False where it is divided already."""
        name = self.tubes.names[tube]
        element = self.beam.element_at(at, name)
        if self.beam.state.stiff[self.beam.elements_of(name)][element, 0] == 0.0:
            return False
        self.beam.tear(at, name)
        if self.torn_elements[tube] < 0:
            self.torn_elements[tube] = element
        self._note("division", tube, at / self.tubes.surfaces[tube].scale, hand)
        return True

    def _cut(self, hand: int) -> bool:
        """Cut what is between scissors' blades: strands, and tubes through or as far as it goes."""
        beam, blades = self.beam, self.blades(hand)
        strands = blades.strands(beam, self.rods_of(hand)) & (beam.damage < 1.0)
        found = bool(strands.any())
        if found:
            beam.detach(strands)
        for each in blades.tubes(beam):
            found |= self._cut_tube(each, hand)
        return found

    def _cut_tube(self, found: Between, hand: int) -> bool:
        """Divide a tube, or cut its wall in part; return False where it is divided already."""
        tube, at = found.tube, found.station
        if not found.whole:
            up, across = self.beam.section_side(at, found.side, self.tubes.names[tube])
            where, deeper = WorstStress(at, 0.0, up, -across), found.depth * found.width
            # A new one begins with a depth of its own, from which the cut goes on.
            if self._nick(tube, where, hand, 0.0) and self._nick(tube, where, hand, deeper):
                return True
        return self._divide(tube, at, hand)

    def since_closed(self, hand: int) -> float:
        """Return how long ago a hand last closed a clip applier's jaws or scissors' blades, s."""
        return (self.ticks - self._closed_at[hand]) * TICK_SECONDS

    def _name(
        self, kind: InputKind, values: tuple[float, ...], begin: Callable[[], bool]
    ) -> Applied | None:
        """Take a tube for a structure, or call it unsafe to tell."""
        if self.specimen.anatomy is None:
            return None
        if kind == "unsafe":
            begin()
            self.called_unsafe = True
            return kind, ()
        structure, tube, station = int(values[0]), int(values[1]), float(values[2])
        names = self.tubes.names
        if not (0 <= structure < len(STRUCTURES) and 0 <= tube < len(names)):
            return None
        begin()
        self.marks.append(Mark(STRUCTURES[structure], names[tube], station, self.ticks))
        return kind, (structure, tube, station)

    def _suck(self, hand: int, rate: float) -> Applied | None:
        if self.hands[hand].instrument != "suction":
            return None
        wanted = min(max(rate, 0.0), MOST_SUCTION)
        if wanted == self.suction.rates[hand]:
            return None
        self.suction.rates[hand] = wanted
        self._forget_reading()
        return "suck", (wanted,)

    def _open(self, hand: int, opening: float) -> Applied | None:
        holder = self.hands[hand]
        if holder.instrument not in JAWED:  # no other opens
            return None
        before = holder.target_opening
        self.open_jaws(hand, opening)
        after = holder.target_opening
        return ("open", (after,)) if after != before else None

    def choose_instrument(self, hand: int, instrument: Instrument) -> None:
        """Give a hand another instrument, which touches nothing yet."""
        self.release(hand)
        for rod in self.rods_of(hand):
            self.beam.withdraw_rod(rod)
        self._still = False
        self._forget_reading()
        holder = self.hands[hand]
        holder.instrument = instrument
        self.rod_counts = len(self.rods_of(0)), len(self.rods_of(1))
        holder.opening = holder.target_opening = 0.0
        holder.aim, holder.spread = TOWARDS_HAND.get(instrument, FROM_ABOVE), ALONG
        self.suction.rates[hand], self._closed_at[hand] = 0.0, -math.inf
        holder.put(self.parking(hand, instrument))
        for rod in self.touch(hand).rods:
            self.beam.set_rod(*rod)

    def grab(self, hand: int, station: float, tube: int = 0) -> Floats | None:
        """Take hold, mm from a tube's first end; return the place, or None where it cannot."""
        holder = self.hands[hand]
        if holder.instrument not in HOLDING or self.tears[tube] is not None:
            return None
        self.release(hand)
        at, name = self.tubes.surfaces[tube].scale * station, self.tubes.names[tube]
        try:
            holder.node = self.beam.take(at, name)
        except ValueError:  # at a clamp, or on top of the other hook
            return None
        holder.tube = tube
        holder.holds += 1
        holder.pull = 0.0
        axis, tip = self.beam.places[holder.node], holder.place
        rest = self.tubes.network.tubes[name]
        radius = float(np.interp(at, rest.stations, rest.radius))
        holder.jaws[:] = jaws_on_wall(tip - axis, TROCARS[hand].shaft(tip), radius)
        holder.put(axis)
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
        holder.jaws[:] = 0.0
        self._still = False
        self._forget_reading()
        return True

    def move_hand(self, hand: int, place: Floats | Vector) -> None:
        """Set where a hand's tip goes, (3,) mm."""
        target = self.hands[hand].target
        target[0], target[1], target[2] = place

    def put_hand(self, hand: int, place: Floats) -> None:
        """Put the tip of a hand that holds nothing somewhere at once, (3,) mm."""
        self.hands[hand].put(place)
        for rod in self.touch(hand).rods:
            self.beam.set_rod(*rod)
        self._forget_reading()

    def open_jaws(self, hand: int, opening: float) -> None:
        """Set how far a dissector's jaws part, mm between their axes."""
        holder, opening = self.hands[hand], min(max(opening, 0.0), MOST_OPENING)
        if opening != holder.target_opening:
            holder.closes = opening < holder.target_opening
        holder.target_opening = opening

    def touch(self, hand: int) -> HandContact:
        """Return what a hand does to the beam now."""
        holder = self.hands[hand]
        node, instrument = holder.node, holder.instrument
        length = LENGTH.get(instrument, math.inf)
        rods = tuple(Rod(number, tip.copy(), holder.aim, RADIUS[instrument], length)
                     for number, tip in self._tips(hand))  # fmt: skip
        station = None if node is None else self._station_of(node, holder.tube)
        return HandContact(station, holder.place.copy(), rods, self.tubes.names[holder.tube])

    def _station_of(self, node: int, tube: int) -> float:
        """Return where a node is on a beam, mm."""
        name = self.tubes.names[tube]
        at = int(np.flatnonzero(self.beam.nodes_of(name) == node)[0])
        return float(self.beam.stations_of(name)[at])

    def rods_of(self, hand: int) -> tuple[int, ...]:
        """Return the rods of the beam that are a hand's jaws or its swab."""
        return RODS[self.hands[hand].instrument][hand]

    def touched(self, hand: int) -> int:
        """Return how many whole strands lie against a hand's jaws or its swab."""
        found = np.zeros(self.beam.order.size, dtype=np.bool_)
        for rod in self.rods_of(hand):
            found |= self.beam.touched_by(rod)
        return int((found & (self.beam.damage < 1.0)).sum())

    def _tips(self, hand: int) -> list[tuple[int, Floats]]:
        """Return the rods of a hand's instrument and where their tips are."""
        holder, rods = self.hands[hand], self.rods_of(hand)
        if len(rods) < 2:
            return [(rod, holder.place) for rod in rods]
        apart = jaw_offset(holder) * np.array(holder.spread)
        return [(rods[0], holder.place - apart), (rods[1], holder.place + apart)]

    # Time

    @property
    def moving(self) -> bool:
        """Whether the next tick will change something."""
        if self._swinging or self._leaking:
            return True
        return not self._still or not all(hand.arrived for hand in self.hands)

    @property
    def _swinging(self) -> bool:
        """Whether the first tube's drawn pieces still come to rest."""
        return self.tears[0] is not None and self._torn_ticks * TICK_SECONDS < SETTLED_SECONDS

    def stop(self) -> None:
        """Leave each hand where it is."""
        for hand in self.hands:
            hand.put(hand.place)
            hand.target_opening = hand.opening

    def advance(self) -> bool:
        """Advance by one tick; return whether anything has moved."""
        self.ticks += 1
        moved = self._advance()
        bled = self._bleed()
        if self._swinging:
            self._torn_ticks += 1
            return True
        return moved or bled

    def _advance(self) -> bool:
        a, b = self.hands
        if self._still and a.arrived and b.arrived:
            return False
        self._whole, self._reading, self._forces = False, None, None
        a.part_jaws()
        b.part_jaws()
        before = self.stress_ratio
        self.step()
        (farthest, broken, *_), one, two, *worst = self._found.tolist()
        self._forces = [one[:3], two[:3]]
        relaxes = self._relaxing != (None, None)
        self._still = farthest <= (RELAXED_MM if relaxes else STILL_MM)
        if broken != self.broken:
            self.broken, self.freed = int(broken), self.beam.freed
        self._take_stresses(worst)
        self._slip()
        if relaxes and abs(self.stress_ratio - before) > RELAXED_FRACTION:
            self._still = False
        return True

    def step(self) -> None:
        """Move hands and beam for a tick; lets other threads run meanwhile."""
        a, b = self.hands
        if self._arguments is None:
            self._arguments = self._arguments_now()
        if not TISSUE_TICK((jaw_offset(a), jaw_offset(b)), *self._arguments):
            raise NoEquilibrium("the beam is lost: no step makes its energy less")

    def _arguments_now(self) -> tuple[Any, ...]:
        """Return what `step` hands over besides the jaws' places, until an input changes it."""
        beam, (a, b) = self.beam, self.hands
        self._stations = [beam.stations_of(name).tolist() for name in self.tubes.names]
        return (
            beam.state, (a.place, b.place), (a.speed, b.speed), (a.target, b.target),
            self._nodes(), self.rod_counts, (a.spread, b.spread), self._before, STEP_NUMBERS,
            beam.walls, beam.first_elements, np.array(self.strengths), self._stresses, self._found,
        )  # fmt: skip

    def grip_ratio(self, hand: int) -> float:
        """Return a hand's pull over that at which what it holds slips out; 0 where it cannot."""
        holder = self.hands[hand]
        if self._grip is None or holder.node is None or holder.instrument != "grasper":
            return 0.0
        return math.hypot(*self.forces[hand]) / self._grip

    def _slip(self) -> None:
        """Let tissue slip out of graspers that pull harder than they grip."""
        for number, hand in enumerate(self.hands):
            if hand.node is None:
                hand.pull = 0.0
                continue
            x, y, z = self.forces[number]
            pull = math.sqrt(x * x + y * y + z * z)
            hand.pull += MEAN_PULL * (pull - hand.pull)
            if self._grip is not None and hand.instrument == "grasper" and hand.pull > self._grip:
                self.release(number)
                hand.slips += 1

    def _take_stresses(self, found: list[list[float]]) -> None:
        """Hold the walls' stresses against their strengths; tear those that are past them."""
        beam = self.beam
        worsts: list[WorstStress] = []
        if beam.nominal:
            ratios = [each[RATIO] for each in found]
        else:
            worsts = beam.worst_stresses()
            ratios = [a.total / b for a, b in zip(worsts, self.strengths, strict=True)]
        before, last = self._found_ratios
        self._found_ratios = last, ratios
        if max(ratios) > 1.0:
            ratios = self._without_leaps(ratios, last, before)
        self.stress_ratios = ratios
        ratio = self.stress_ratio = max(ratios)
        tube = self.worst_tube = ratios.index(ratio)
        at = worsts[tube].station if worsts else self._stations[tube][int(found[tube][0])]
        self.station = at / self.tubes.surfaces[tube].scale
        self.peak_stress_ratio = max(self.peak_stress_ratio, ratio)
        if ratio > 1.0:
            self._tear_walls()

    def _without_leaps(
        self, ratios: list[float], last: list[float], before: list[float]
    ) -> list[float]:
        """Return stresses as they were judged last where they leap from the last tick's."""
        leaps = [
            now > 1.0 and now - then > max(LEAP, MORE_THAN_BEFORE * (then - earlier))
            for now, then, earlier in zip(ratios, last, before, strict=True)
        ]
        self._still = self._still and not any(leaps)
        return [
            then if leap else now
            for now, then, leap in zip(ratios, self.stress_ratios, leaps, strict=True)
        ]

    def _tear_walls(self) -> None:
        """Tear the walls whose stress is past their strength."""
        beam, surfaces, strengths = self.beam, self.tubes.surfaces, self.strengths
        ratios, worsts = self.stress_ratios, beam.worst_stresses()
        for tube, name in enumerate(self.tubes.names):
            if ratios[tube] <= 1.0 or self.tears[tube] is not None:
                continue
            worst = worsts[tube]
            check = surfaces[tube].check_of(worst, strengths[tube])
            hand = self._hand_at(tube, worst.station)
            speed = self.tubes.tear_speeds.get(name, math.inf)
            if self._nick(tube, worst, hand, speed * TICK_SECONDS):
                continue
            self.tears[tube], self.nicked[tube] = check, 1.0
            self.torn_elements[tube] = beam.tear(worst.station, name)
            self.broken, self.freed = beam.broken, beam.freed
            self._note("tear", tube, check.station, hand)
            for number, holder in enumerate(self.hands):  # it slips off what holds it
                if holder.tube == tube:
                    self.release(number)

    def _nick(self, tube: int, worst: WorstStress, hand: int | None, by: float) -> bool:
        """Let a tear go on by some mm; return False where it is through."""
        beam, name = self.beam, self.tubes.names[tube]
        nicks = len(beam.nicks_of(name))
        depth = beam.nick(worst, by, name)
        if depth >= DEEPEST:
            return False
        self._still = False
        self.nicked[tube] = max(self.nicked[tube], depth)
        if len(beam.nicks_of(name)) > nicks:
            self._note("nick", tube, worst.station / self.tubes.surfaces[tube].scale, hand)
        for nick in beam.nicks_of(name):
            for flow in self.fluids.values():
                if name in flow.tubes:
                    flow.open_nick(nick, self._thickness(tube))
        return True

    def _thickness(self, tube: int) -> float:
        """Return how thick a tube's wall is, mm; without bound where nothing is said of it."""
        beam = self.tubes.dissections[tube].preset.beam
        thick = beam.wall_mm if isinstance(beam, OrganBeam) else None
        return math.inf if thick is None else thick

    def nicks(self) -> list[NickReading]:
        """Return the tears that go part of the way through tubes."""
        return [
            NickReading(
                tube,
                nick.station / self.tubes.surfaces[tube].scale,
                nick.side,
                nick.depth,
                nick.depth * nick.height,
                nick.reach,
                nick.depth * nick.height > self._thickness(tube),
            )
            for tube, name in enumerate(self.tubes.names)
            if 0.0 < self.nicked[tube] < 1.0
            for nick in self.beam.nicks_of(name)
        ]

    def _hand_at(self, tube: int, station: float) -> int | None:
        """Return the hand that holds a tube, or else the nearest that pulls or presses."""
        forces = [x * x + y * y + z * z for x, y, z in self.forces]
        at = self.beam.places_at(np.array([station]), self.tubes.names[tube])[0]
        found, nearest = None, math.inf
        for hand, holder in enumerate(self.hands):
            if not forces[hand]:
                continue
            if holder.node is not None and holder.tube == tube:
                return hand
            offsets = [at - tip for _, tip in self._tips(hand)] or [at - holder.place]
            for offset in offsets:
                along = max(float((offset * holder.aim).sum()), 0.0)
                away = offset - along * np.array(holder.aim)
                square = float((away**2).sum())
                if square < nearest:
                    found, nearest = hand, square
        return found

    def _note(self, kind: EventKind, tube: int, station: float, hand: int | None) -> None:
        self.events.append(Event(kind, self.ticks, self.tubes.names[tube], station, hand))

    def _bleed(self) -> bool:
        """Let fluids flow out of holes for a tick, and take them up; return whether any flows."""
        if not self.fluids:
            return False
        self.suction.advance(self.hands, self.beam)
        if self._leaking and "blood" in self.fluids:
            self.lens.spray(self.pose, self.beam, self.fluids["blood"])
        for fluid, flow in self.fluids.items():
            if not flow.advance(TICK_SECONDS) and not self._leaking:
                continue
            self._forget_reading()
            rates: dict[str, float] = {}
            for hole in flow.holes:
                rates[hole.tube] = rates.get(hole.tube, 0.0) + hole.flow
            for name, rate in rates.items():
                now, key = rate > LEAST_FLOW, (fluid, name)
                if now == (key in self._leaking):
                    continue
                self._leaking ^= {key}
                tube = self.tubes.names.index(name)
                at = next(hole.station for hole in flow.holes if hole.tube == name)
                kind = LOSSES[fluid] if now else "stanched"
                # It flows out of what was opened last, whoever has clipped the tube since.
                by = [
                    each.hand
                    for each in self.events
                    if each.tube == name and (not now or each.kind in OPENINGS)
                ]
                self._note(kind, tube, at, by[-1] if by else None)
        return bool(self._leaking)

    @property
    def strengths(self) -> tuple[float, ...]:
        """Of each tube: the stress at which its wall tears, MPa; of the first the threshold."""
        return self.threshold, *self.tubes.strengths[1:]

    @property
    def torn(self) -> RuptureCheck | None:
        """Where and under what the first tube that tore has torn, or None."""
        if not self.events:
            return None
        tear = next((each for each in self.events if each.kind == "tear"), None)
        return None if tear is None else self.tears[self.tubes.names.index(tear.tube)]

    @property
    def over(self) -> bool:
        """Whether nothing is left whole to act on: no tube, and no strand that holds one."""
        return all(self.tears) and self.broken >= self.beam.strands.count

    def tear_of(self, tube: int) -> RuptureCheck | None:
        """Return where and under what a tube has torn, or None."""
        return self.tears[tube]

    def reading(self) -> Reading:
        """Return what the instruments show now."""
        if self._reading is None:
            self._reading = self._read()
        return self._reading

    def _read(self) -> Reading:
        beam = self.beam
        forces = [_vector(force) for force in self.forces]
        squares = [x * x + y * y + z * z for x, y, z in forces]
        pulling = squares.index(max(squares))
        node = self.hands[pulling].node
        moved = np.zeros(3) if node is None else beam.places[node] - beam.rest_place(node)
        deflection = math.sqrt(float(moved @ moved))
        elapsed = self._torn_ticks * TICK_SECONDS
        # How a tear runs is drawn of the first tube only.
        tearing = self.tears[0] is not None and tear_front(elapsed) < 1.0
        torn = Phase.TEARING if tearing else Phase.TORN
        return Reading(
            phase=Phase.INTACT if self.torn is None else torn,
            check=self.torn
            or self.tubes.surfaces[self.worst_tube].check(beam, self.strengths[self.worst_tube]),
            stress_ratio=self.stress_ratio,
            forces=tuple(forces),
            places=tuple(_vector(hand.place.tolist()) for hand in self.hands),
            holding=tuple(hand.node is not None for hand in self.hands),
            pulling=pulling,
            force=math.sqrt(squares[pulling]),
            deflection=deflection,
            deepest=deflection,
            breaks_at=None,
            peak_stress_ratio=self.peak_stress_ratio,
            strands=beam.strands.count,
            broken=self.broken,
            freed=self.freed,
            energy=beam.energy,
            stress_ratios=tuple(self.stress_ratios),
            nicks=tuple(self.nicks()),
            fluids=tuple(
                FluidReading(name, 1e-3 * flow.lost, 1e-3 * flow.left, 1e-3 * flow.rate)
                for name, flow in self.fluids.items()
            ),
        )

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the figures of `row`."""
        by_hand = (
            "x_mm", "y_mm", "z_mm", "opening_mm", "force_x_N", "force_y_N", "force_z_N", "held",
        )  # fmt: skip
        return (
            *(f"hand_{hand + 1}_{name}" for hand in range(HANDS) for name in by_hand),
            "freed_mm", "strands_broken", "stress_ratio",
            "work_mJ", "stored_mJ", "dissipated_mJ", "torn",
            *(f"{name}_nick{end}" for name in self.tubes.tear_speeds for end in ("ed", "_mm")),
            *(
                f"{name}_{figure}"
                for name in self._others
                for figure in ("stress_ratio", "freed_mm", "torn")
            ),
            *(f"{name}_lost_ml" for name in self.fluids),
        )  # fmt: skip

    def row(self) -> tuple[float, ...]:
        """Return what the instruments show now, for a table by tick."""
        energy = self.beam.energy
        hands = zip(self.hands, self.forces, strict=True)
        return (
            *(
                number
                for hand, force in hands
                for number in (
                    *hand.place.tolist(),
                    hand.opening,
                    *force,
                    int(hand.node is not None),
                )
            ),
            self.freed,
            int(self.broken),
            self.stress_ratio,
            energy.work,
            energy.stored,
            energy.dissipated,
            int(self.torn is not None),
            *(depth for name in self.tubes.tear_speeds for depth in self._depths(name)),
            *(
                figure
                for tube, name in enumerate(self.tubes.names)
                if name in self._others
                for figure in (
                    self.stress_ratios[tube],
                    self.beam.freed_of(name),
                    int(self.tears[tube] is not None),
                )
            ),
            *(1e-3 * flow.lost for flow in self.fluids.values()),
        )

    @property
    def _others(self) -> tuple[str, ...]:
        """Names of tubes of which a table has figures of their own: where there are several."""
        return self.tubes.names if len(self.tubes.names) > 1 else ()

    def _depths(self, name: str) -> tuple[float, float]:
        """Return how deep a tube is torn, of its height and mm."""
        deepest = max((each.depth * each.height for each in self.beam.nicks_of(name)), default=0.0)
        return self.nicked[self.tubes.names.index(name)], deepest

    def held_place(self, hand: int) -> Vector | None:
        """Return where a hand holds the duct, mm, or None."""
        holder = self.hands[hand]
        return None if holder.node is None else _vector(holder.place.tolist())

    def draw(self, drawn: DrawnDuct) -> None:
        """Move the drawn surfaces; the pieces of a torn duct swing to where they come to rest."""
        if self.tears[0] is None:
            drawn.draw_moved(self.move)
            return
        # The beam is in its new equilibrium at once.
        elapsed = self._torn_ticks * TICK_SECONDS
        swing = tear_swing(elapsed)

        def move(out: Floats, piece: int | None) -> None:
            self.move(out, piece)
            out += swing * (drawn.at_tear - out)

        drawn.draw_moved(move)
        drawn.open_tear(tear_front(elapsed))

    def write_stress(
        self, drawn: DrawnDuct, out: NDArray[np.float32], surface: int
    ) -> NDArray[np.float32]:
        """Write the stress along the organ at each vertex of a drawn surface, MPa."""
        at = self.beam.stations_of() / self.surface.scale
        stresses = self.beam.stresses()[self.beam.elements_of()]
        return drawn.write_bed_stress(at, stresses, out, surface)

    # Runs

    def start(self) -> Callable[[], RunStart]:
        """Return what makes the start of a run that begins now."""
        specimen, threshold = self.specimen, self.threshold
        preset, bed, anatomy = specimen.preset, specimen.bed, specimen.anatomy
        strands = self.tubes.strands
        tips = tuple(_vector(hand.place.tolist()) for hand in self.hands)
        return lambda: RunStart(
            preset.name if preset.ships else preset,
            threshold,
            bed=None if bed is None else named_or_whole(bed),
            bed_seed=None if bed is None else specimen.bed_seed,
            strands_sha256=strands_digest(strands) if strands.count else None,
            law=preset.law,
            stiffening=preset.stiffening,
            elements=ELEMENTS,
            substeps=SUBSTEPS,
            broken_by_touch=self.broken_by_touch,
            grip_N=self._grip,
            tips_mm=tips,
            anatomy=None if anatomy is None else anatomy_or_name(anatomy),
            strand_relaxation=Prony.of(self._relaxing[0]),
            wall_relaxation=Prony.of(self._relaxing[1]),
            tear_mm_per_s=preset.tear_mm_per_s,
            tubes_touch=self.specimen.anatomy is not None and self.specimen.tubes_touch,
            clear_strands=anatomy is not None and self.specimen.clear_strands,
            joint_faces=anatomy is not None,
        )

    def goal_of(self, exercise: Exercise) -> None:
        """Return nothing: goals in space are no deflections."""

    def put_hands(self, tips: Sequence[Sequence[float]]) -> None:
        """Put the hands' tips somewhere at once, (HANDS, 3) mm, before a run begins."""
        for hand, tip in enumerate(tips):
            self.put_hand(hand, np.array(tip))

    @property
    def forces(self) -> list[list[float]]:
        """(HANDS, 3) of each hand on duct or strands, N."""
        # As lists, here and in what looks at them in each tick: numpy takes ten times as long for
        # three numbers.
        if self._forces is None:
            state, out = self.beam.state, np.empty((HANDS, 3))
            SUM_FORCES(self._nodes(), self.rod_counts, state.react, state.load, state.pull, out)
            forces: list[list[float]] = out.tolist()
            self._forces = forces
        return self._forces

    def _nodes(self) -> tuple[int, int]:
        """Return the nodes that the hands hold, -1 for none."""
        a, b = self.hands
        return -1 if a.node is None else a.node, -1 if b.node is None else b.node

    def _forget_reading(self) -> None:
        self._whole = False
        self._arguments: tuple[Any, ...] | None = None
        self._reading: Reading | None = None
        self._forces: list[list[float]] | None = None

    def freed_at(self, stations: Floats) -> Floats:
        """Return the share of strands that have parted about each station, mm, 0 to 1."""
        return self.surface.freed_at(self.beam.damage[self.tubes.strands_of[0]], stations)

    def held_at(self, hand: int) -> float | None:
        """Return the station that a hand holds, mm from its tube's first end, or None."""
        holder = self.hands[hand]
        if holder.node is None:
            return None
        return self._station_of(holder.node, holder.tube) / self.tubes.surfaces[holder.tube].scale

    def freed_stretches(self, tube: int = 0) -> list[tuple[float, float]]:
        """Return the stretches of a tube that are free, mm from its first end to mm, in order."""
        # Free is a bin of about `BIN_MM` of whose strands at least `FREED_FRACTION` have parted.
        span, surface = self.tubes.dissections[tube].beam.span, self.tubes.surfaces[tube]
        bins = max(1, round(span / BIN_MM))
        if tube not in self._bins:
            length = self.tubes.network.tubes[self.tubes.names[tube]].span
            place = (surface.strands.stations * (bins / length)).astype(np.int16)
            place = np.minimum(place, bins - 1)
            count = np.bincount(place, minlength=bins).astype(np.float64)
            self._bins[tube] = place, (1.0 - FREED_FRACTION) * count
        place, most = self._bins[tube]
        damage = self.beam.damage[self.tubes.strands_of[tube]]
        free = np.zeros(bins + 2, np.bool_)
        free[1:-1] = np.bincount(place[damage < 1.0], minlength=bins) <= most
        edges: list[float] = (np.flatnonzero(free[1:] != free[:-1]) * (span / bins)).tolist()
        return list(zip(edges[::2], edges[1::2], strict=True))

    def move(self, out: Floats, piece: int | None = None) -> Floats:
        """Write the (D, 3, 4) transforms of the driving points, of a torn duct's piece 0 or 1."""
        return self.surface.move(self.beam, out, piece, self.torn_elements[0])


def _with_free_end(network: Network) -> Network:
    """Return a network whose first tube's second end is free."""
    name, first = next(iter(network.tubes.items()))
    free = replace(first, ends=("clamped", "free"))
    return replace(network, tubes={**network.tubes, name: free})


def _moved(before: tuple[float, ...], now: tuple[float, ...]) -> bool:
    """Return whether a camera has left its place, or a scope's is turned about its own axis."""
    if len(before) != len(now):
        return True
    far = math.sqrt(sum((a - b) ** 2 for a, b in zip(before[3:6], now[3:6], strict=True)))
    turned = max((abs(a - b) for a, b in zip(before[9:11], now[9:11], strict=True)), default=0.0)
    return far >= STEADY_MM or math.cos(turned) <= STEADY


def _vector(values: list[float]) -> Vector:
    x, y, z = values
    return x, y, z
