"""Finds the errors of `app.simulation.exercises.errors` at a duct in its bed, tick by tick.

A run that is replayed has the same incidents, so no run file holds them. Speeds and growths are
taken over several ticks, from end to end: over one a hand's tremor is most of them.
"""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.anatomy import tube_title
from app.bed_preset import bed_named
from app.simulation.exercises.errors import ERROR_CLASSES, Conditions, Incidents
from app.simulation.exercises.errors.incidents import Consequence
from app.simulation.exercises.errors.pace import (
    LEAST_SPEED,
    PULL_TICKS,
    Pace,
    PaceLimits,
    judge,
    take_ratio,
)
from app.simulation.inputs.clock import REACTION_SECONDS, TICK_SECONDS
from app.simulation.inputs.hand import MEAN_PULL, Hand
from app.simulation.inputs.inputs import HOLDING, SCOPE_NUMBERS
from app.simulation.runs.run_file import HANDS
from app.simulation.tissue.safety import Safety
from app.simulation.tissue.sight import LINE_OF_SIGHT, in_picture
from app.simulation.tissue.spatial_tissue import LEAST_FLOW, Event, SpatialTissue
from kernel_cache import SameTypes, kernel
from physics.bed.kernels import SHAFT, TIP

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bytes = NDArray[np.int8]
Span = tuple[float, float]

# Ticks over which an instrument's speed and a slow shift of jaws are taken.
TIP_TICKS, SHIFT_TICKS = 3, 8
TURN_MM = 2.0
"""mm by which a tip that goes back turns, and within which two holds are at one place."""
SERIOUS_ML = 2.0
"""ml of blood beyond which a bleeding is an injury, a choice."""
LEAST_WARNING = 1.0
"""s before a tear from which on it is worth a word that the wall was near its break."""
PULL_LESS = "Slacken as soon as its stress rises, and part what holds it before you pull on."
OPEN_ELSEWHERE = "Close the jaws, draw back, and open them where only strands lie between them."
VIEW_TICKS = 10
"""Ticks from one look at the critical view to the next."""
SAME = 1e-6
"""mm. Ends of stretches differ from a clamp or a divided end by rounding only."""


# Columns of what a tick shows of a hand: strands that parted, that are being parted and that touch;
# its force, N, and its work over `PULL_TICKS`, mJ; speeds of the tip over `TIP_TICKS` and over
# `PULL_TICKS`, and how fast it opens, mm/s; mean press, N; how often it turned back; of a hold the
# largest force, N, and the greatest mean height, mm; ticks for which it has leaned, and for which
# the hand has worked out of the picture; its lean, degrees.
PARTED, GOING, TOUCHING, SIZE, WORK, TIP_SPEED, PULL_SPEED, OPENS, PRESS, TURNS = range(10)
MOST, HIGHEST, LEANING, UNSEEN, ANGLE = range(10, 15)
# Whether a condition holds: an instrument is fast in tissue, its jaws jump, it parts strands that
# no hold makes taut, is fast where it may be unseen, presses, parts on jaws that stay; a hold
# has lost its traction, pulls where its place is to be judged, leans, lifts too high; a hand works
# out of the picture; and what `judge` finds of its pace.
FAST, JUMPS, ALONE, STABS, PRESSES, PLOUGHS, LOST, PLACE, LEANS, LIFTS, HIDDEN = range(15, 26)
PACE, PULL, SEEN = 26, 27, 30
"""Columns of its pace, and of the mean pull of a hold, (3,) N; how many there are."""
OPENING = 3
"""Column of a hand's track after its place."""
NO_SCOPE = (0.0,) * LINE_OF_SIGHT


class _Limits(NamedTuple):
    """Parameters of the classes whose conditions `_look` judges."""

    pull: float  # N that a hold pulls at least
    fast: float  # mm/s
    fast_strands: float
    jump: float  # mm/s
    alone: bool  # whether it is an error to part strands without a hold
    stab: float  # mm/s
    press: float  # N
    lost_pull: float  # N
    lost_fraction: float
    lost_down: float  # mm
    angle: float  # degrees
    leaning_pull: float  # N
    leaning: float  # s
    lifted: float  # stress ratio
    hidden_pull: float  # N
    hidden: float  # s
    pace: PaceLimits

    @classmethod
    def of(cls, incidents: Incidents, pace: PaceLimits) -> "_Limits":
        """Return those of a run."""
        limits = incidents.limits
        fast, lost, leaning, hidden = (
            limits[key] for key in ("fast_in_tissue", "traction_lost", "leaning", "out_of_view")
        )
        return cls(
            pull=limits["ahead_of_front"]["pull"],
            fast=fast["speed"],
            fast_strands=fast["strands"],
            jump=1.001 * limits["jumping_jaws"]["speed"],
            alone="no_traction" not in incidents.ignored,
            stab=limits["blind_stab"]["speed"],
            press=limits["instrument_on_wall"]["least"],
            lost_pull=lost["pull"],
            lost_fraction=lost["fraction"],
            lost_down=lost["down"],
            angle=leaning["angle"],
            leaning_pull=leaning["pull"],
            leaning=leaning["seconds"],
            lifted=limits["over_lifted"]["most"],
            hidden_pull=hidden["pull"],
            hidden=hidden["seconds"],
            pace=pace,
        )


class _Watch:
    """What is known of a hand's last seconds."""

    __slots__ = (
        "events", "events_start", "front_away", "held_at", "holds", "instrument", "judged",
        "ploughed", "ploughed_mm", "recent_holds", "slips", "turns",
    )  # fmt: skip

    def __init__(self, hand: Hand) -> None:
        self.instrument, self.holds, self.slips = hand.instrument, hand.holds, hand.slips
        self.recent_holds: list[tuple[int, float]] = []
        self.held_at = 0.0
        self.front_away: float | None = None
        self.judged = True
        self.ploughed, self.ploughed_mm = 0, 0.0  # strands on jaws that did not open, and how far
        # Strands that have parted on jaws that do not open: tick, how many.
        self.events: list[tuple[int, int]] = []
        self.events_start = (0.0, 0.0, 0.0)
        self.turns: list[int] = []


class ErrorFinder:
    """Finds the incidents of one run on one duct.

    Parameters
    ----------
    duct
        At the start of the run.
    limits
        The exercise's, if there is one, by the key of a metric or of a class of errors.
    about
        Names of the tubes that the exercise is about; None where any may be handled.
    """

    def __init__(
        self,
        duct: SpatialTissue,
        limits: Mapping[str, float],
        about: Sequence[str] | None = None,
    ) -> None:
        ratio = limits.get("peak_stress_ratio")
        hidden = limits.get("strands_broken_out_of_sight")
        self._duct = duct
        # A free duct has no strands to judge. Those of an anatomy's layers are taken for as tough
        # as loose tissue about a duct.
        bed = duct.bed or bed_named("normal")
        tubes = duct.tubes.names
        anatomy = duct.specimen.anatomy
        kinds = [] if anatomy is None else [each.kind for each in anatomy.tube]
        self._several = anatomy is not None
        self._titles = [tube_title(name) for name in tubes]
        self._vessels = [tube for tube, kind in enumerate(kinds) if kind in ("artery", "vein")]
        self._wrong = [about is not None and name not in about for name in tubes]
        self._bleeding_since: dict[str, int] = {}
        self._near_since: dict[int, int] = {}  # of each tube, when it first neared its break
        # clips on tubes that bled: tick, what flowed then
        self._clipped: list[tuple[int, float, Event]] = []
        self._rates: dict[str, float] = {}  # of blood out of each tube
        self._safety = None if anatomy is None else _safety_of(duct)
        # of the critical view, as it was looked at last
        self._points = 0 if self._safety is None else self._safety.critical_view().total
        self._most_points = self._points
        self._unsafe = False  # whether it was called unsafe to tell
        self._divided = False  # whether a structure that is part of it is
        self._events, self._marks = len(duct.events), len(duct.marks)
        self.incidents = Incidents(
            Conditions(bed.yield_mm, bed.failure_mm, duct.radius, ratio, hidden),
            limits,
        )
        self._most_fraction = ratio or 1.0
        self._watches = [_Watch(hand) for hand in duct.hands]
        self._damage = duct.beam.state.damage.copy()
        # Of each hand: its track, oldest first; presses of the last ticks, N; where it last turned,
        # and how it goes along each axis: 1 or -1, 0 before the first.
        self._tracks = np.zeros((HANDS, SHIFT_TICKS + 1, OPENING + 1))
        self._presses, self._turned = np.zeros((HANDS, PULL_TICKS)), np.zeros((HANDS, 2, 3))
        self._seen = np.zeros((HANDS, SEEN))
        for i in range(HANDS):
            self._start_track(i)
        self._pace = Pace(self.incidents)
        self._limits = _Limits.of(self.incidents, self._pace.limits)
        self._stretches: list[Span] = []
        # Of each hand, whether the place of its hold is to be judged: until it has been, and again
        # where the free stretches have changed.
        self._unplaced = [True] * HANDS
        nodes = [duct.beam.nodes_of(name) for name in tubes]  # of all tubes one after the other
        self._nodes = np.concatenate(nodes)
        self._firsts = np.cumsum([0, *(each.size for each in nodes)])
        self._torn = False  # whether a tube tore in this tick
        self.ticks_in_tissue = 0  # with a hand that holds, is among strands or presses
        self._nicked = list(duct.nicked)

    @property
    def most_points(self) -> int | None:
        """Points of the critical view, most at once; None without a gallbladder."""
        if self._safety is None:
            return None
        now = 0 if self._divided else self._safety.critical_view().total
        return max(self._most_points, now)

    def take(self, stretches: list[Span], out_of_sight: int) -> None:
        """Take a tick with the stretches that are free, mm; so many strands parted unseen in it."""
        duct, incidents = self._duct, self.incidents
        incidents.tick += 1
        if stretches is not self._stretches:
            self._stretches, self._unplaced = stretches, [True] * HANDS
        for i, (hand, watch) in enumerate(zip(duct.hands, self._watches, strict=True)):
            if hand.instrument != watch.instrument:
                watch.instrument = hand.instrument
                self._start_track(i)
                watch.turns.clear()
                watch.events.clear()
            if hand.slips != watch.slips:
                watch.slips = hand.slips
                incidents.note(
                    "hold_slipped", i, watch.held_at, hand.pull, tube=hand.tube,
                    at_mm=watch.held_at, force_N=hand.pull, what=f"the {self._titles[hand.tube]}",
                )  # fmt: skip
            if hand.node is not None and hand.holds != watch.holds:
                self._take_hold(i, hand, watch)
        state, (a, b), (force, other) = duct.beam.state, duct.hands, duct.forces
        scoped, stress = len(duct.pose) >= SCOPE_NUMBERS, duct.stress_ratio
        parted, due, in_tissue = _LOOK(
            state.damage, self._damage, state.side, state.press,
            duct.rod_counts, (a.node is not None, b.node is not None),
            (a.place, b.place), (a.opening, b.opening), (*force, *other),
            (a.instrument == "dissector", b.instrument == "dissector"),
            (self._unplaced[0], self._unplaced[1]), stress, self._several,
            scoped, duct.pose[:LINE_OF_SIGHT] if scoped else NO_SCOPE, self._limits,
            self._tracks, self._presses, self._turned, self._pace.ratios, self._seen,
        )  # fmt: skip
        self.ticks_in_tissue += in_tissue
        if due:
            self._judge_hands(parted)
        if out_of_sight and out_of_sight >= incidents.limits["unseen"]["strands"]:
            incidents.note("unseen", None, duct.station, out_of_sight, out_of_sight)
        if self._several:
            self._judge_tubes(parted)
        self._torn = False
        if (
            len(duct.events) != self._events
            or len(duct.marks) != self._marks
            or duct.called_unsafe != self._unsafe
            or duct.nicked != self._nicked
        ):
            self._take_events()
        # What is divided in the view is no part of it any more: the view before it counts.
        if self._safety is not None and incidents.tick % VIEW_TICKS == 0 and not self._divided:
            self._points = self._safety.critical_view().total
            self._most_points = max(self._most_points, self._points)
        if incidents.followed:
            incidents.end_tick(self._consequence(stress, out_of_sight))

    def _judge_hands(self, parted: int) -> None:
        """Note what `_look` has found of what each hand does."""
        hands, tick = self._duct.hands, self.incidents.tick
        seen: list[list[float]] = self._seen.tolist()
        for i, (hand, watch, row) in enumerate(zip(hands, self._watches, seen, strict=True)):
            if row[TURNS]:
                watch.turns.extend([tick] * int(row[TURNS]))
            if hand.node is not None:
                self._judge_hold(i, hand, watch, row)
            else:
                self._judge_instrument(i, hand, watch, row)
            if row[HIDDEN]:
                self.incidents.note(
                    "out_of_view", i, float(hand.place[0]), row[UNSEEN] * TICK_SECONDS,
                    tool=watch.instrument, seconds=row[UNSEEN] * TICK_SECONDS,
                )  # fmt: skip
        for i, row in enumerate(seen):
            if row[PACE]:
                self._pace.note(int(row[PACE]), i, self._watches[i].held_at, row[PULL_SPEED])

    def _start_track(self, i: int) -> None:
        """Start a new track where a hand is."""
        hand = self._duct.hands[i]
        self._tracks[i] = *hand.place.tolist(), hand.opening
        self._presses[i], self._turned[i, 0], self._turned[i, 1] = 0.0, hand.place, 0.0

    def _take_events(self) -> None:
        """Note what tore, was clipped or was divided in this tick."""
        duct, incidents = self._duct, self.incidents
        for event in duct.events[self._events :]:
            if event.kind in ("clip", "division"):
                self._judge_closing(event)
            if event.kind == "tear":
                self._torn = True
                tube = duct.tubes.names.index(event.tube)
                by, instead = self._deed(event.hand, tube)
                self.incidents.note(
                    "tear",
                    event.hand,
                    event.station,
                    tube=tube,
                    at_mm=event.station,
                    name=self._titles[tube],
                    by=by and by + self._since(tube),
                    instead=instead,
                )
        self._events = len(duct.events)
        if duct.nicked != self._nicked:
            self._judge_nicks()
        safe = self._points >= incidents.limits["named_unsafe"]["points"]
        for mark in duct.marks[self._marks :]:
            safety, tube = self._safety, duct.tubes.names.index(mark.tube)
            if safety is not None and mark.tube not in safety.tubes_of[mark.structure]:
                self.incidents.note(
                    "mistaken", None, mark.station, tube=tube, name=self._titles[tube],
                    taken=mark.structure,
                )  # fmt: skip
            if not safe:
                incidents.note(
                    "named_unsafe", None, mark.station, tube=tube, name=self._titles[tube],
                    taken=mark.structure, points=self._points,
                )  # fmt: skip
        self._marks = len(duct.marks)
        if duct.called_unsafe and not self._unsafe:
            self._unsafe = True
            if safe:
                incidents.note("held_back", None, None, points=self._points)

    def _judge_nicks(self) -> None:
        """Note the walls that tore farther in this tick without parting."""
        duct = self._duct
        for nick in duct.nicks():
            if nick.depth != duct.nicked[nick.tube] or nick.depth == self._nicked[nick.tube]:
                continue
            mine = [each for each in duct.events if each.tube == duct.tubes.names[nick.tube]]
            began = [each for each in mine if each.kind == "nick"][-1]
            by, instead = self._deed(began.hand, nick.tube)
            self.incidents.note(
                "nick",
                began.hand,
                nick.station,
                nick.depth,
                tube=nick.tube,
                consequence="injury" if nick.leaks else "minor",
                section_fraction=nick.depth,
                at_mm=nick.station,
                leak=", and it leaks" if nick.leaks else "",
                name=self._titles[nick.tube],
                by=by and by + self._since(nick.tube),
                instead=instead,
            )
        self._nicked[:] = duct.nicked

    def _deed(self, i: int | None, tube: int) -> tuple[str, str]:
        """Return what a hand does to a wall, and what to do instead; nothing if no hand does."""
        if i is None or not self._several:
            return "", ""
        hand, row = self._duct.hands[i], self._seen[i]
        if hand.instrument in HOLDING:
            what = "it" if hand.tube == tube else f"the {self._titles[hand.tube]}"
            return f" as the {hand.instrument} pulled {what}", PULL_LESS
        if hand.opening > 0.0 and row[OPENS] >= row[TIP_SPEED]:
            return f" as the jaws of the {hand.instrument} opened against it", OPEN_ELSEWHERE
        instead = ERROR_CLASSES["instrument_on_wall"].instead
        return f" as the {hand.instrument} pressed on it", instead

    def _since(self, tube: int) -> str:
        """Return since when a wall that gave way was near its break, if for long enough to tell."""
        since = self._near_since.get(tube, self.incidents.tick) * TICK_SECONDS
        if self.incidents.tick * TICK_SECONDS - since < LEAST_WARNING:
            return ""
        near = self.incidents.limits["tear"]["near"]
        return f"; it had first passed {100.0 * near:.0f} % of its break at {since:.1f} s"

    def _judge_closing(self, event: Event) -> None:
        """Judge a clip or a division: on which tube, and whether the time has come for it."""
        duct, incidents = self._duct, self.incidents
        tube, at = duct.tubes.names.index(event.tube), event.station
        if self._wrong[tube]:
            did = "clipped" if event.kind == "clip" else "divided"
            incidents.note(
                "clip_wrong_tube",
                event.hand,
                at,
                tube=tube,
                did=did,
                at_mm=at,
                name=self._titles[tube],
            )
        before = self._rates.get(event.tube, 0.0)
        if event.kind == "clip" and before > LEAST_FLOW:
            self._clipped.append((incidents.tick, before, event))
        safety = self._safety
        if event.kind == "clip" or safety is None or event.tube not in safety.entering:
            return
        points, self._divided = self._points, True
        if points < incidents.limits["divided_before_view"]["points"]:
            incidents.note(
                "divided_before_view",
                event.hand,
                at,
                tube=tube,
                points=points,
                name=self._titles[tube],
            )
        stays = safety.entering[event.tube] == 1  # whether the side towards its begin stays
        clips = sum(
            each.kind == "clip" and each.tube == event.tube and (each.station < at) == stays
            for each in duct.events
        )
        if clips < incidents.limits["clip_short"]["clips"]:
            incidents.note(
                "clip_short", event.hand, at, tube=tube, clips=clips, name=self._titles[tube]
            )

    def _judge_tubes(self, parted: int) -> None:
        """Judge what is done to an anatomy's tubes: which are pulled, and what bleeds."""
        duct, incidents, limits = self._duct, self.incidents, self.incidents.limits
        for i, hand in enumerate(duct.hands):
            if hand.node is None or not self._wrong[hand.tube]:
                continue
            pull = float(self._seen[i, SIZE])
            if pull > limits["wrong_structure"]["pull"]:
                incidents.note(
                    "wrong_structure", i, duct.held_at(i), pull, tube=hand.tube,
                    force_N=pull, name=self._titles[hand.tube],
                )  # fmt: skip
        most, near = limits["tension_on_vessel"]["most"], limits["tear"]["near"]
        if duct.stress_ratio > most:
            pulls: list[float] = self._seen[:, SIZE].tolist()
            hardest = pulls.index(max(pulls)) if max(pulls) > 0.0 else None
            for tube in self._vessels:
                ratio = duct.stress_ratios[tube]
                if ratio > most and duct.tears[tube] is None:
                    by, instead = self._deed(hardest, tube)
                    incidents.note(
                        "tension_on_vessel", hardest, None, ratio, tube=tube,
                        stress_percent=100.0 * min(ratio, 1.0), name=self._titles[tube], by=by,
                        instead=instead,
                    )  # fmt: skip
        if duct.stress_ratio > near:
            for tube, ratio in enumerate(duct.stress_ratios):
                if ratio > near:
                    self._near_since.setdefault(tube, incidents.tick)
        self._judge_bleeding(parted)

    def _judge_bleeding(self, parted: int) -> None:
        duct, incidents = self._duct, self.incidents
        blood = duct.fluids.get("blood")
        if blood is None or not blood.holes:
            return
        limits = incidents.limits["unattended_bleeding"]
        rates: dict[str, float] = {}
        for hole in blood.holes:
            rates[hole.tube] = rates.get(hole.tube, 0.0) + hole.flow
        self._judge_clips(rates)
        self._rates = rates
        for name, rate in rates.items():
            if rate <= LEAST_FLOW:
                self._bleeding_since.pop(name, None)
                continue
            since = self._bleeding_since.setdefault(name, incidents.tick)
            seconds = (incidents.tick - since) * TICK_SECONDS
            tube = duct.tubes.names.index(name)
            hole = next(each for each in blood.holes if each.tube == name)
            lost = 1e-3 * sum(each.lost for each in blood.holes if each.tube == name)
            harm: Consequence = "injury" if lost > SERIOUS_ML else "minor"
            if name != duct.opens_torn:  # which nobody's hand has torn
                began = [e for e in duct.events if (e.kind, e.tube) == ("bleeding", name)]
                incidents.note(
                    "bleeding", began[-1].hand if began else None, hole.station, lost, tube=tube,
                    consequence=harm, lost_ml=lost, seconds=seconds, name=self._titles[tube],
                )  # fmt: skip
            if not parted or seconds <= limits["seconds"]:
                continue
            place = duct.beam.places[hole.node].tolist()
            for i, hand in enumerate(duct.hands):
                away = math.dist(hand.place.tolist(), place)
                if away > limits["away"] and (hand.node is not None or duct.rod_counts[i]):
                    incidents.note(
                        "unattended_bleeding", i, hole.station, seconds, tube=tube,
                        consequence=harm, distance_mm=away, seconds=seconds, lost_ml=lost,
                        name=self._titles[tube],
                    )  # fmt: skip

    def _judge_clips(self, rates: dict[str, float]) -> None:
        """Judge whether clips have stopped anything, once blood has had time to stand."""
        limits, incidents = self.incidents.limits["clip_astray"], self.incidents
        after = round(limits["seconds"] / TICK_SECONDS)
        while self._clipped and incidents.tick - self._clipped[0][0] >= after:
            _, before, clip = self._clipped.pop(0)
            if rates[clip.tube] > limits["fraction"] * before:
                tube = self._duct.tubes.names.index(clip.tube)
                incidents.note(
                    "clip_astray", clip.hand, clip.station, tube=tube, at_mm=clip.station,
                    name=self._titles[tube],
                )  # fmt: skip

    def _consequence(self, stress: float, out_of_sight: int) -> Consequence:
        if self._torn:
            return "injury"
        if out_of_sight:
            return "minor"
        if stress > self._most_fraction or self._pace.too_fast:
            return "near miss"
        return "none"

    # Jaws and swabs

    def _judge_instrument(self, i: int, hand: Hand, watch: _Watch, row: list[float]) -> None:
        incidents, limits, duct, beam = (
            self.incidents, self.incidents.limits, self._duct, self._duct.beam,
        )  # fmt: skip
        station, tool = float(hand.place[0]), watch.instrument
        parted, speed, press = int(row[PARTED]), row[TIP_SPEED], row[PRESS]
        if row[FAST]:
            incidents.note(
                "fast_in_tissue", i, station, speed, parted,
                speed_mm_per_s=speed,
                speed_limit_mm_per_s=limits["fast_in_tissue"]["speed"], tool=tool,
            )  # fmt: skip
        if row[JUMPS]:
            incidents.note(
                "jumping_jaws", i, station, row[OPENS], parted, speed_mm_per_s=row[OPENS]
            )
        if row[ALONE]:
            incidents.note("no_traction", i, station, 0.0, parted)
        if row[STABS]:
            node = _hiding(beam.places, beam.state.thick, duct.radius, hand.place, duct.view)
            names = duct.tubes.names if node >= 0 else ()
            for tube in [k for k, name in enumerate(names) if node in beam.nodes_of(name)][:1]:
                incidents.note(
                    "blind_stab", i, station, speed, tube=tube,
                    speed_mm_per_s=speed, distance_mm=speed * REACTION_SECONDS,
                    speed_limit_mm_per_s=limits["blind_stab"]["speed"],
                    what=f"the {self._titles[tube]}",
                )  # fmt: skip
        if row[PRESSES]:
            state, last = beam.state, 2 * i + duct.rod_counts[i]
            pressed: tuple[int, int] = _DEEPEST(
                state.x, state.thick, state.rods, 2 * i, last, self._nodes, self._firsts
            )
            tube, node = pressed
            ratio = press * duct.tubes.press_stresses[tube][node] / duct.strengths[tube]
            on_wall = limits["instrument_on_wall"]
            hard = ratio > on_wall["fraction"]
            if self._several:  # what strains a vessel is an error of its own
                near = duct.stress_ratios[tube] > on_wall["near"]
                hard = hard and near and tube not in self._vessels
            # To press on what bleeds is right.
            if hard and self._rates.get(duct.tubes.names[tube], 0.0) <= LEAST_FLOW:
                station = float(beam.stations_of(duct.tubes.names[tube])[node])
                incidents.note(
                    "instrument_on_wall", i, station, press,
                    tube=tube, force_N=press, tool=tool, what=f"the {self._titles[tube]}",
                )  # fmt: skip
        if row[PLOUGHS]:
            self._judge_sweep(i, watch, parted)

    def _judge_sweep(self, i: int, watch: _Watch, parted: int) -> None:
        """Judge what parts on jaws that do not open: how far they go, and whether to and fro."""
        incidents, tick = self.incidents, self.incidents.tick
        stir, plough = incidents.limits["stirring"], incidents.limits["ploughing"]
        before, now = self._tracks[i, [0, -1]].tolist()
        while watch.turns and (tick - watch.turns[0]) * TICK_SECONDS > stir["seconds"]:
            watch.turns.pop(0)
        while watch.events and (tick - watch.events[0][0]) * TICK_SECONDS > plough["seconds"]:
            watch.events.pop(0)
        if not watch.events:
            watch.events_start = (now[0], now[1], now[2])
        watch.events.append((tick, parted))
        watch.ploughed += parted
        opened = abs(now[3] - before[3])
        watch.ploughed_mm += (math.dist(now[:3], before[:3]) + 0.5 * opened) / SHIFT_TICKS
        total = sum(number for _, number in watch.events)
        far = math.dist(now[:3], watch.events_start)
        if watch.ploughed > plough["in_all"]:
            far = watch.ploughed_mm
            incidents.note("ploughing", i, now[0], far, strands=watch.ploughed, distance_mm=far)
        if total < plough["strands"]:
            return
        if len(watch.turns) >= stir["turns"]:
            incidents.note("stirring", i, now[0], total, strands=total)
        elif far > plough["travel"]:
            incidents.note("ploughing", i, now[0], far, strands=total, distance_mm=far)

    # Holds

    def _take_hold(self, i: int, hand: Hand, watch: _Watch) -> None:
        """Start a new hold."""
        watch.holds = hand.holds
        self._tracks[i] = *hand.place.tolist(), hand.opening
        at = self._duct.held_at(i) or 0.0
        watch.held_at, watch.judged, self._unplaced[i] = at, False, True
        row = self._seen[i]
        row[MOST], row[HIGHEST], row[LEANING] = 0.0, hand.place[2], 0.0
        watch.front_away = self._front(at)[0]
        tick, limits = self.incidents.tick, self.incidents.limits["repeated_holds"]
        holds = watch.recent_holds
        if holds and abs(holds[-1][1] - at) > TURN_MM:
            holds.clear()
        holds.append((tick, at))
        while (tick - holds[0][0]) * TICK_SECONDS > limits["seconds"]:
            holds.pop(0)
        if len(holds) >= limits["holds"]:
            self.incidents.note(
                "repeated_holds", i, at, len(holds), holds=float(len(holds)), at_mm=at
            )

    def _front(self, at: float) -> tuple[float | None, float]:
        """Return how far a station is from the nearest edge of a free stretch, mm, and the edge."""
        # Above zero where it is not free; None without an edge, as a divided end and a clamp are
        # none.
        span = self._duct.dissection.beam.span
        outside: list[tuple[float, float]] = []
        for a, b in self._stretches:
            edges = [(abs(edge - at), edge) for edge in (a, b) if SAME < edge < span - SAME]
            if a - SAME <= at <= b + SAME:
                far, edge = min(edges, default=(None, 0.0))
                return (None if far is None else -far), edge
            outside += edges
        return min(outside, default=(None, 0.0))

    def _judge_hold(self, i: int, hand: Hand, watch: _Watch, row: list[float]) -> None:
        incidents, at, stress = self.incidents, watch.held_at, self._pace.ratio
        if row[LOST]:
            incidents.note(
                "traction_lost", i, at, -row[SIZE], most_force_N=row[MOST], force_N=row[SIZE]
            )
        if row[PLACE]:
            self._unplaced[i] = self._judge_place(i, watch)
        if row[LEANS]:
            to = ", to the far side" if row[PULL + 1] > 0.0 else ", to the near side"
            incidents.note("leaning", i, at, row[ANGLE], angle_deg=row[ANGLE], to=to)
        if row[LIFTS]:
            incidents.note(
                "over_lifted", i, at, stress, stress_percent=100.0 * stress,
                lifted_mm=float(hand.place[2]),
                stress_limit_percent=100.0 * incidents.limits["over_lifted"]["most"],
            )  # fmt: skip

    def _judge_place(self, i: int, watch: _Watch) -> bool:
        """Judge where a hold was taken, once it pulls, and how far the front has run from it.

        Returns
        -------
        bool
            Whether it has run too far, which goes on with each tick of the hold.
        """
        incidents, limits = self.incidents, self.incidents.limits
        at, away = watch.held_at, watch.front_away
        if away is None:
            return False
        now, front = self._front(at)
        if not watch.judged:
            watch.judged = True
            if away > limits["ahead_of_front"]["near"]:
                incidents.note("ahead_of_front", i, at, at_mm=at, distance_mm=away, front_mm=front)
            elif -away > limits["behind_front"]["far"]:
                incidents.note("behind_front", i, at, at_mm=at, distance_mm=-away, front_mm=front)
        runs = now is not None and min(0.0, away) - now > limits["one_go"]["far"]
        if now is not None and runs:
            incidents.note("one_go", i, at, -now, distance_mm=-now)
        return runs


def _safety_of(tissue: SpatialTissue) -> Safety | None:
    """Return what judges an anatomy with a gallbladder; None of another."""
    try:
        return Safety(tissue)
    except ValueError:
        return None


@kernel()
def _norm(x: float, y: float, z: float) -> float:
    return math.sqrt(x * x + y * y + z * z)


@kernel()
def _away(a: Floats, b: Floats) -> float:
    return _norm(a[0] - b[0], a[1] - b[1], a[2] - b[2])


@kernel()
def _look_at_hold(
    row: Floats, track: Floats, dissected: bool, stress: float, limits: _Limits
) -> None:
    """Judge a hold in a bed, where strands are being parted by the other hand or not."""
    height = 0.0
    for k in range(SHIFT_TICKS + 1):  # a mean, as a hand that holds still trembles
        height += track[k, 2] / (SHIFT_TICKS + 1)
    size, most = row[SIZE], max(row[MOST], row[SIZE])
    row[MOST], row[HIGHEST] = most, max(row[HIGHEST], height)
    down = row[HIGHEST] - height
    lost = (
        most > limits.lost_pull and size < limits.lost_fraction * most and down > limits.lost_down
    )
    row[LOST] = dissected and lost
    if size <= limits.pull:
        return
    x, y, z = row[PULL], row[PULL + 1], row[PULL + 2]
    row[ANGLE] = math.degrees(math.atan2(abs(y), z))
    leans = row[ANGLE] > limits.angle and _norm(x, y, z) > limits.leaning_pull
    row[LEANING] = row[LEANING] + 1.0 if leans else 0.0
    row[LEANS] = row[LEANING] * TICK_SECONDS > limits.leaning
    row[LIFTS] = stress > limits.lifted


@kernel()
def _look_at_instrument(
    row: Floats, track: Floats, dissects: bool, held: bool, limits: _Limits
) -> None:
    """Judge jaws or a swab, while a hand holds the duct or none does."""
    parted, speed = row[PARTED], row[TIP_SPEED] if row[TOUCHING] > 0.0 else 0.0
    if parted > 0.0:
        now, before = track[SHIFT_TICKS], track[0]
        # Jaws open where they part farther than their tip moves.
        opened = now[OPENING] - before[OPENING]
        row[FAST] = speed > limits.fast and parted >= limits.fast_strands
        row[JUMPS] = row[OPENS] > limits.jump
        row[ALONE] = limits.alone and not held
        row[PLOUGHS] = dissects and opened <= max(0.3, _away(now, before))
    row[STABS] = speed > limits.stab
    row[PRESSES] = row[PRESS] > limits.press


@kernel()
def _look(
    damage: Floats, before: Floats, side: Bytes, press: Floats, rods: tuple[int, int],
    holds: tuple[bool, bool], places: tuple[Floats, Floats], openings: tuple[float, float],
    forces: tuple[float, ...], dissects: tuple[bool, bool], unplaced: tuple[bool, bool],
    stress: float, several: bool, scoped: bool, pose: tuple[float, ...], limits: _Limits,
    tracks: Floats, presses: Floats, turned: Floats, ratios: Floats, seen: Floats,
) -> tuple[int, bool, bool]:  # fmt: skip
    """Write what a tick shows of the hands, and which conditions hold of them.

    Returns
    -------
    tuple[int, bool, bool]
        How many strands parted, whether any condition holds or a hand has turned back, and whether
        a hand holds, is among strands or presses on a wall.
    """
    # A strand that touches both of a hand's rods is counted twice among those that touch.
    take_ratio(ratios, stress)
    in_tissue = False
    for i in range(HANDS):
        first, last = 2 * i, 2 * i + rods[i]
        track, row = tracks[i], seen[i]
        touching = 0
        for rod in range(first, last):
            for s in range(side.shape[1]):
                touching += side[rod, s] == 1 or side[rod, s] == -1
        row[PARTED] = row[GOING] = row[PRESS] = row[TURNS] = 0.0
        row[TOUCHING] = touching
        in_tissue |= holds[i] or touching > 0
        for k in range(SHIFT_TICKS):
            for c in range(OPENING + 1):
                track[k, c] = track[k + 1, c]
        now, tip, pull = (
            track[SHIFT_TICKS],
            track[SHIFT_TICKS - TIP_TICKS],
            track[SHIFT_TICKS - PULL_TICKS],
        )
        now[OPENING] = openings[i]
        work = 0.0
        for r in range(3):
            now[r] = places[i][r]
            work += forces[3 * i + r] * (now[r] - pull[r])
        size = _norm(forces[3 * i], forces[3 * i + 1], forces[3 * i + 2])
        row[SIZE], row[WORK] = size, work
        row[TIP_SPEED] = _away(now, tip) / (TIP_TICKS * TICK_SECONDS)
        row[PULL_SPEED] = _away(now, pull) / (PULL_TICKS * TICK_SECONDS)
        row[OPENS] = (now[OPENING] - tip[OPENING]) / (TIP_TICKS * TICK_SECONDS)
        if holds[i]:
            for r in range(3):
                row[PULL + r] += MEAN_PULL * (forces[3 * i + r] - row[PULL + r])
        if rods[i] == 0:
            continue
        total, most = 0.0, 0.0
        for rod in range(first, last):
            most = max(most, _norm(press[rod, 0], press[rod, 1], press[rod, 2]))
        in_tissue |= most > 0.0
        for k in range(PULL_TICKS):
            presses[i, k] = presses[i, k + 1] if k < PULL_TICKS - 1 else most
            total += presses[i, k]
        row[PRESS] = total / PULL_TICKS
        at, heading = turned[i, 0], turned[i, 1]
        for r in range(3):
            away = now[r] - at[r]
            if away * heading[r] > 0.0:
                at[r] = now[r]
            elif abs(away) > TURN_MM:
                row[TURNS] += heading[r] != 0.0
                at[r], heading[r] = now[r], 1.0 if away > 0.0 else -1.0
    parted = 0
    for s in range(damage.shape[0]):
        if damage[s] > before[s] + 1e-9:
            parts = damage[s] >= 1.0
            parted += parts
            for i in range(HANDS):
                for rod in range(2 * i, 2 * i + rods[i]):
                    if side[rod, s] == 1 or side[rod, s] == -1:
                        seen[i, PARTED] += parts
                        seen[i, GOING] += 1.0
                        break
        before[s] = damage[s]
    due = False
    for i in range(HANDS):
        row = seen[i]
        for c in range(FAST, PACE + 1):
            row[c] = 0.0
        if not holds[i]:
            _look_at_instrument(row, tracks[i], dissects[i], holds[0] or holds[1], limits)
        # What holds an anatomy's tubes has no one front, a hold may not be what loads a wall, and
        # what is taut is let back while the other hand parts tissue.
        elif not several:
            _look_at_hold(row, tracks[i], seen[1 - i, GOING] > 0.0, stress, limits)
            row[PLACE] = row[SIZE] > limits.pull and unplaced[i] and rods[1 - i] == 0
        if scoped:
            acts = row[SIZE] > limits.hidden_pull or row[TOUCHING] > 0.0
            moves = row[TIP_SPEED] > LEAST_SPEED or row[OPENS] != 0.0
            unseen = acts and moves and not in_picture(pose, places[i])
            row[UNSEEN] = row[UNSEEN] + 1.0 if unseen else 0.0
            row[HIDDEN] = row[UNSEEN] * TICK_SECONDS > limits.hidden
    # The wall is loaded by the hand whose motion does most work on it; what jaws and swabs press is
    # an error of its own.
    loads = 1 if seen[1, WORK] > seen[0, WORK] else 0
    row = seen[loads]
    least = row[SIZE] * LEAST_SPEED * PULL_TICKS * TICK_SECONDS
    if holds[loads] and row[SIZE] > limits.pull and row[WORK] > least:
        row[PACE] = judge(ratios, row[PULL_SPEED], parted > 0, limits.pace)
    for i in range(HANDS):
        due |= seen[i, TURNS] != 0.0
        for c in range(FAST, PACE + 1):
            due |= seen[i, c] != 0.0
    return parted, due, in_tissue


@kernel()
def _deepest(
    places: Floats, thick: Floats, rods: Floats, first: int, last: int, nodes: Ints, firsts: Ints
) -> tuple[int, int]:
    """Return the tube whose wall some rods are deepest in, and the node along it."""
    least, tube, found = np.inf, 0, 0
    for k in range(firsts.size - 1):
        for j in range(firsts[k], firsts[k + 1]):
            n, gap = nodes[j], np.inf
            for m in range(first, last):
                x, y, z = rods[m, SHAFT], rods[m, SHAFT + 1], rods[m, SHAFT + 2]
                a = places[n, 0] - rods[m, TIP]
                b = places[n, 1] - rods[m, TIP + 1]
                c = places[n, 2] - rods[m, TIP + 2]
                along = max(a * x + b * y + c * z, 0.0)
                gap = min(gap, _norm(a - along * x, b - along * y, c - along * z))
            gap -= thick[n, 0]
            if gap < least:
                least, tube, found = gap, k, j - firsts[k]
    return tube, found


@kernel()
def _hiding(places: Floats, thick: Floats, least: float, tip: Floats, towards: Floats) -> int:
    """Return the first node that hides a tip from the viewer, -1 for none."""
    # The line from the tip towards the viewer passes within the outer radius there, or within
    # `least`: tissue about a thin tube hides as well.
    for n in range(places.shape[0]):
        along, square = 0.0, 0.0
        for r in range(3):
            gap = places[n, r] - tip[r]
            along += gap * towards[r]
            square += gap * gap
        if along > 0.0 and square - along * along < max(thick[n, 0], least) ** 2:
            return n
    return -1


_LOOK, _DEEPEST = SameTypes(_look), SameTypes(_deepest)
