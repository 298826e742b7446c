"""Finds the errors of `app.simulation.exercises.errors` at a duct in its bed, tick by tick.

A run that is replayed has the same incidents, so no run file holds them. Speeds and growths are
taken over several ticks, from end to end: over one a hand's tremor is most of them.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from app.anatomy import tube_title
from app.bed_preset import bed_named
from app.simulation.exercises.errors import ERROR_CLASSES, Conditions, Incidents
from app.simulation.exercises.errors.incidents import Consequence
from app.simulation.exercises.errors.pace import LEAST_SPEED, PULL_TICKS, Pace
from app.simulation.inputs.clock import REACTION_SECONDS, TICK_SECONDS
from app.simulation.inputs.hand import MEAN_PULL, Hand
from app.simulation.inputs.inputs import HOLDING, SCOPE_NUMBERS
from app.simulation.runs.run_file import HANDS
from app.simulation.tissue.safety import Safety
from app.simulation.tissue.sight import in_picture
from app.simulation.tissue.spatial_tissue import LEAST_FLOW, Event, SpatialTissue
from kernel_cache import SameTypes, kernel
from physics.bed.kernels import SHAFT, TIP

__all__ = ["ErrorFinder"]

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
# `PULL_TICKS`, and how fast it opens, mm/s; mean press, N; how often it turned back; and of a hold
# the largest force, N, the highest place, mm, and the mean pull, N.
PARTED, GOING, TOUCHING, SIZE, WORK, TIP_SPEED, PULL_SPEED, OPENS, PRESS, TURNS = range(10)
MOST, HIGHEST, PULL, SEEN = 10, 11, 12, 15
OPENING = 3
"""Column of a hand's track after its place."""


class _Watch:
    """What is known of a hand's last seconds."""

    __slots__ = (
        "events", "events_start", "front_away", "held_at", "holds", "instrument", "judged",
        "leaning", "ploughed", "ploughed_mm", "recent_holds", "slips", "turns", "unseen",
    )  # fmt: skip

    def __init__(self, hand: Hand) -> None:
        self.instrument, self.holds, self.slips = hand.instrument, hand.holds, hand.slips
        self.leaning = self.unseen = 0  # ticks
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
        self._least_pull = self.incidents.limits["ahead_of_front"]["pull"]
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
        nodes = [duct.beam.nodes_of(name) for name in tubes]  # of all tubes one after the other
        self._nodes = np.concatenate(nodes)
        self._firsts = np.cumsum([0, *(each.size for each in nodes)])
        self._torn = False  # whether a tube tore in this tick
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
        duct, incidents, watches = self._duct, self.incidents, self._watches
        incidents.tick += 1
        self._stretches = stretches
        state, hands, stress = duct.beam.state, duct.hands, duct.stress_ratio
        a, b = hands
        self._pace.take(stress)
        for i, (hand, watch) in enumerate(zip(hands, watches, strict=True)):
            if hand.instrument != watch.instrument:
                watch.instrument = hand.instrument
                self._start_track(i)
                watch.turns.clear()
                watch.events.clear()
            if hand.slips != watch.slips:
                watch.slips = hand.slips
                incidents.note(
                    "hold_slipped", i, watch.held_at, hand.pull, tube=hand.tube,
                    x=watch.held_at, f=hand.pull, what=f"the {self._titles[hand.tube]}",
                )  # fmt: skip
            if hand.node is not None and hand.holds != watch.holds:
                self._take_hold(i, hand, watch)
        force, other = duct.forces
        parted, striking = _LOOK(
            state.damage, self._damage, state.side, state.press,
            duct.rod_counts, (a.node is not None, b.node is not None),
            (a.place, b.place), (a.opening, b.opening), (*force, *other), self._least_pull,
            self._tracks, self._presses, self._turned, self._seen,
        )  # fmt: skip
        if striking or self._several or len(duct.pose) >= SCOPE_NUMBERS:
            self._judge_hands(parted)
        if out_of_sight and out_of_sight >= incidents.limits["unseen"]["strands"]:
            incidents.note("unseen", None, duct.station, out_of_sight, out_of_sight)
        if self._several:
            self._judge_tubes(self._seen.tolist(), parted)
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
        """Judge what each hand does, where strands parted or not."""
        duct, hands, incidents = self._duct, self._duct.hands, self.incidents
        seen: list[list[float]] = self._seen.tolist()
        holding = sum(hand.node is not None for hand in hands)
        for i, (hand, watch, row) in enumerate(zip(hands, self._watches, seen, strict=True)):
            if row[TURNS]:
                watch.turns.extend([incidents.tick] * int(row[TURNS]))
            if hand.node is not None:
                self._judge_hold(i, hand, watch, row, other_dissects=seen[1 - i][GOING] > 0.0)
            elif row[TOUCHING] or row[PARTED] or row[PRESS]:
                self._judge_instrument(i, hand, watch, row, holding=holding)
            if len(duct.pose) >= SCOPE_NUMBERS:
                self._judge_picture(i, hand, watch, row)
        if holding:
            self._judge_pace(seen, parted=parted > 0)

    def _start_track(self, i: int) -> None:
        """Start a new track where a hand is."""
        hand = self._duct.hands[i]
        self._tracks[i] = *hand.place.tolist(), hand.opening
        self._presses[i], self._turned[i, 0], self._turned[i, 1] = 0.0, hand.place, 0.0

    def _judge_picture(self, i: int, hand: Hand, watch: _Watch, row: list[float]) -> None:
        """Judge whether a hand that acts and moves is seen through the laparoscope."""
        limits = self.incidents.limits["out_of_view"]
        acts = row[SIZE] > limits["pull"] or row[TOUCHING] > 0.0
        moves = row[TIP_SPEED] > LEAST_SPEED or row[OPENS] != 0.0
        unseen = acts and moves and not in_picture(self._duct.pose, hand.place.tolist())
        watch.unseen = watch.unseen + 1 if unseen else 0
        seconds = watch.unseen * TICK_SECONDS
        if seconds > limits["seconds"]:
            tool, at = watch.instrument, float(hand.place[0])
            self.incidents.note("out_of_view", i, at, seconds, tool=tool, s=seconds)

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
                    x=event.station,
                    name=self._titles[tube],
                    by=by,
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
                    taken=mark.structure, n=self._points,
                )  # fmt: skip
        self._marks = len(duct.marks)
        if duct.called_unsafe and not self._unsafe:
            self._unsafe = True
            if safe:
                incidents.note("held_back", None, None, n=self._points)

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
                s=nick.depth,
                x=nick.station,
                leak=", and it leaks" if nick.leaks else "",
                name=self._titles[nick.tube],
                by=by,
                instead=instead,
            )
        self._nicked[:] = duct.nicked

    def _deed(self, i: int | None, tube: int) -> tuple[str, str]:
        """Return what a hand did to a wall that gave way, since when, and what to do instead."""
        if i is None or not self._several:
            return "", ""
        hand, row = self._duct.hands[i], self._seen[i]
        if hand.instrument in HOLDING:
            what = "it" if hand.tube == tube else f"the {self._titles[hand.tube]}"
            by, instead = f"the {hand.instrument} pulled {what}", PULL_LESS
        elif hand.opening > 0.0 and row[OPENS] >= row[TIP_SPEED]:
            by, instead = f"the jaws of the {hand.instrument} opened against it", OPEN_ELSEWHERE
        else:
            by = f"the {hand.instrument} pressed on it"
            instead = ERROR_CLASSES["instrument_on_wall"].instead
        since = self._near_since.get(tube, self.incidents.tick) * TICK_SECONDS
        if self.incidents.tick * TICK_SECONDS - since >= LEAST_WARNING:
            near = self.incidents.limits["tear"]["near"]
            by += f"; it had first passed {100.0 * near:.0f} % of its break at {since:.1f} s"
        return f" as {by}", instead

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
                x=at,
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
                n=points,
                name=self._titles[tube],
            )
        stays = safety.entering[event.tube] == 1  # whether the side towards its begin stays
        clips = sum(
            each.kind == "clip" and each.tube == event.tube and (each.station < at) == stays
            for each in duct.events
        )
        if clips < incidents.limits["clip_short"]["clips"]:
            incidents.note(
                "clip_short", event.hand, at, tube=tube, n=clips, name=self._titles[tube]
            )

    def _judge_tubes(self, seen: list[list[float]], parted: int) -> None:
        """Judge what is done to an anatomy's tubes: which are pulled, and what bleeds."""
        duct, incidents = self._duct, self.incidents
        pulls = [row[SIZE] for row in seen]
        hardest = pulls.index(max(pulls)) if max(pulls) > 0.0 else None
        for i, hand in enumerate(duct.hands):
            pulls_hard = pulls[i] > incidents.limits["wrong_structure"]["pull"]
            if hand.node is not None and self._wrong[hand.tube] and pulls_hard:
                incidents.note(
                    "wrong_structure", i, duct.held_at(i), pulls[i], tube=hand.tube,
                    f=pulls[i], name=self._titles[hand.tube],
                )  # fmt: skip
        most = incidents.limits["tension_on_vessel"]["most"]
        for tube in self._vessels:
            ratio = duct.stress_ratios[tube]
            if ratio > most and duct.tears[tube] is None:
                incidents.note(
                    "tension_on_vessel", hardest, None, ratio, tube=tube,
                    p=100.0 * min(ratio, 1.0), name=self._titles[tube],
                )  # fmt: skip
        near = incidents.limits["tear"]["near"]
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
                by = [each.hand for each in duct.events if each.tube == name]
                incidents.note(
                    "bleeding", by[0] if by else None, hole.station, lost, tube=tube,
                    consequence=harm, ml=lost, s=seconds, name=self._titles[tube],
                )  # fmt: skip
            if not parted or seconds <= limits["seconds"]:
                continue
            place = duct.beam.places[hole.node].tolist()
            for i, hand in enumerate(duct.hands):
                away = math.dist(hand.place.tolist(), place)
                if away > limits["away"] and (hand.node is not None or duct.rod_counts[i]):
                    incidents.note(
                        "unattended_bleeding", i, hole.station, seconds, tube=tube,
                        consequence=harm, d=away, s=seconds, ml=lost, name=self._titles[tube],
                    )  # fmt: skip

    def _judge_clips(self, rates: dict[str, float]) -> None:
        """Judge whether clips have stopped anything, once blood has had time to stand."""
        limits, incidents = self.incidents.limits["clip_astray"], self.incidents
        after = round(limits["seconds"] / TICK_SECONDS)
        while self._clipped and incidents.tick - self._clipped[0][0] >= after:
            _, before, clip = self._clipped.pop(0)
            if rates[clip.tube] > limits["part"] * before:
                tube = self._duct.tubes.names.index(clip.tube)
                incidents.note(
                    "clip_astray", clip.hand, clip.station, tube=tube, x=clip.station,
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

    def _judge_instrument(
        self, i: int, hand: Hand, watch: _Watch, row: list[float], *, holding: int
    ) -> None:
        incidents, limits, duct = self.incidents, self.incidents.limits, self._duct
        station, tool = float(hand.place[0]), watch.instrument
        parted, speed = int(row[PARTED]), row[TIP_SPEED] if row[TOUCHING] else 0.0
        if parted:
            fast = limits["fast_in_tissue"]
            most = fast["speed"]
            if speed > most and parted >= fast["strands"]:
                incidents.note(
                    "fast_in_tissue", i, station, speed, parted, v=speed, speed=most, tool=tool
                )
            if row[OPENS] > 1.001 * limits["jumping_jaws"]["speed"]:
                incidents.note("jumping_jaws", i, station, row[OPENS], parted, v=row[OPENS])
            if not holding:
                incidents.note("no_traction", i, station, 0.0, parted)
        most, beam = limits["blind_stab"]["speed"], duct.beam
        if speed > most:
            node = _hiding(beam.places, beam.state.thick, duct.radius, hand.place, duct.view)
            names = duct.tubes.names if node >= 0 else ()
            for tube in [k for k, name in enumerate(names) if node in beam.nodes_of(name)][:1]:
                incidents.note(
                    "blind_stab", i, station, speed, tube=tube,
                    v=speed, d=speed * REACTION_SECONDS, speed=most,
                    what=f"the {self._titles[tube]}",
                )  # fmt: skip
        press, on_wall = row[PRESS], limits["instrument_on_wall"]
        if press > on_wall["least"]:
            state, last = beam.state, 2 * i + duct.rod_counts[i]
            pressed: tuple[int, int] = _DEEPEST(
                state.x, state.thick, state.rods, 2 * i, last, self._nodes, self._firsts
            )
            tube, node = pressed
            stress = press * duct.tubes.press_stresses[tube][node]
            if stress > on_wall["part"] * duct.strengths[tube]:
                station = float(beam.stations_of(duct.tubes.names[tube])[node])
                incidents.note(
                    "instrument_on_wall", i, station, press,
                    tube=tube, f=press, tool=tool, what=f"the {self._titles[tube]}",
                )  # fmt: skip
        if parted and tool == "dissector":
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
        # Jaws open where they part farther than their tip moves.
        opened = now[3] - before[3]
        if opened > max(0.3, math.dist(now[:3], before[:3])):
            return
        if not watch.events:
            watch.events_start = (now[0], now[1], now[2])
        watch.events.append((tick, parted))
        watch.ploughed += parted
        watch.ploughed_mm += (math.dist(now[:3], before[:3]) + 0.5 * abs(opened)) / SHIFT_TICKS
        total = sum(number for _, number in watch.events)
        far = math.dist(now[:3], watch.events_start)
        if watch.ploughed > plough["in_all"]:
            far = watch.ploughed_mm
            incidents.note("ploughing", i, now[0], far, n=watch.ploughed, d=far)
        if total < plough["strands"]:
            return
        if len(watch.turns) >= stir["turns"]:
            incidents.note("stirring", i, now[0], total, n=total)
        elif far > plough["travel"]:
            incidents.note("ploughing", i, now[0], far, n=total, d=far)

    # Holds

    def _take_hold(self, i: int, hand: Hand, watch: _Watch) -> None:
        """Start a new hold."""
        watch.holds = hand.holds
        self._tracks[i] = *hand.place.tolist(), hand.opening
        at = self._duct.held_at(i) or 0.0
        watch.held_at, watch.judged, watch.leaning = at, False, 0
        self._seen[i, MOST], self._seen[i, HIGHEST] = 0.0, hand.place[2]
        watch.front_away = self._front(at)[0]
        tick, limits = self.incidents.tick, self.incidents.limits["repeated_holds"]
        holds = watch.recent_holds
        if holds and abs(holds[-1][1] - at) > TURN_MM:
            holds.clear()
        holds.append((tick, at))
        while (tick - holds[0][0]) * TICK_SECONDS > limits["seconds"]:
            holds.pop(0)
        if len(holds) >= limits["holds"]:
            self.incidents.note("repeated_holds", i, at, len(holds), n=float(len(holds)), x=at)

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

    def _judge_hold(
        self, i: int, hand: Hand, watch: _Watch, row: list[float], *, other_dissects: bool
    ) -> None:
        incidents, limits = self.incidents, self.incidents.limits
        at, stress, size = watch.held_at, self._pace.ratio, row[SIZE]
        # At an anatomy what is taut is let back while the other hand parts tissue.
        if other_dissects and not self._several:
            lost, most = limits["traction_lost"], row[MOST]
            down = row[HIGHEST] - float(hand.place[2])
            if most > lost["pull"] and size < lost["part"] * most and down > lost["down"]:
                incidents.note("traction_lost", i, at, -size, most=most, f=size)
        if size <= self._least_pull:
            return
        # What holds an anatomy's tubes has no one front, and a hold may not be what loads a wall.
        if self._several:
            return
        if not self._duct.rod_counts[1 - i]:
            self._judge_place(i, watch)
        self._judge_lean(i, watch, row[PULL:])
        most = limits["over_lifted"]["most"]
        if stress > most:
            incidents.note(
                "over_lifted", i, at, stress,
                p=100.0 * stress, m=float(hand.place[2]), most=100.0 * most,
            )  # fmt: skip

    def _judge_pace(self, seen: list[list[float]], *, parted: bool) -> None:
        """Judge how fast the wall is loaded, by the hand whose motion does most work on it."""
        i = int(seen[1][WORK] > seen[0][WORK])
        size, work, speed = seen[i][SIZE], seen[i][WORK], seen[i][PULL_SPEED]
        # What jaws and swabs press is an error of its own.
        held = self._duct.hands[i].node is not None
        if not held or size <= self._least_pull:
            return
        if work > size * LEAST_SPEED * PULL_TICKS * TICK_SECONDS:
            self._pace.judge(i, self._watches[i].held_at, speed, parted=parted)

    def _judge_lean(self, i: int, watch: _Watch, pull: list[float]) -> None:
        """Judge whether a duct is pulled straight off its bed."""
        incidents, lean = self.incidents, self.incidents.limits["leaning"]
        angle = math.degrees(math.atan2(abs(pull[1]), pull[2]))
        leans = angle > lean["angle"] and math.hypot(*pull) > lean["pull"]
        watch.leaning = watch.leaning + 1 if leans else 0
        if watch.leaning * TICK_SECONDS > lean["seconds"]:
            incidents.note("leaning", i, watch.held_at, angle, a=angle)

    def _judge_place(self, i: int, watch: _Watch) -> None:
        """Judge where a hold was taken, once it pulls, and how far the front has run from it."""
        incidents, limits = self.incidents, self.incidents.limits
        at, away = watch.held_at, watch.front_away
        if away is None:
            return
        now, front = self._front(at)
        if not watch.judged:
            watch.judged = True
            if away > limits["ahead_of_front"]["near"]:
                incidents.note("ahead_of_front", i, at, x=at, d=away, front=front)
            elif -away > limits["behind_front"]["far"]:
                incidents.note("behind_front", i, at, x=at, d=-away, front=front)
        if now is not None and min(0.0, away) - now > limits["one_go"]["far"]:
            incidents.note("one_go", i, at, -now, d=-now)


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
def _look(
    damage: Floats, before: Floats, side: Bytes, press: Floats, rods: tuple[int, int],
    holds: tuple[bool, bool], places: tuple[Floats, Floats], openings: tuple[float, float],
    forces: tuple[float, ...], least_pull: float, tracks: Floats, presses: Floats, turned: Floats,
    seen: Floats,
) -> tuple[int, bool]:  # fmt: skip
    """Write what a tick shows of the hands.

    Returns
    -------
    tuple[int, bool]
        How many strands parted, and whether hands are to be judged: those that touch and part
        nothing, go straight on and pull less than `least_pull` are not.
    """
    # A strand that touches both of a hand's rods is counted twice among those that touch.
    for i in range(HANDS):
        first, last = 2 * i, 2 * i + rods[i]
        track, row = tracks[i], seen[i]
        touching = 0
        for rod in range(first, last):
            for s in range(side.shape[1]):
                touching += side[rod, s] == 1 or side[rod, s] == -1
        row[PARTED] = row[GOING] = row[PRESS] = row[TURNS] = 0.0
        row[TOUCHING] = touching
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
        far = _norm(now[0] - tip[0], now[1] - tip[1], now[2] - tip[2])
        row[TIP_SPEED] = far / (TIP_TICKS * TICK_SECONDS)
        far = _norm(now[0] - pull[0], now[1] - pull[1], now[2] - pull[2])
        row[PULL_SPEED] = far / (PULL_TICKS * TICK_SECONDS)
        row[OPENS] = (now[OPENING] - tip[OPENING]) / (TIP_TICKS * TICK_SECONDS)
        if holds[i]:
            row[MOST], row[HIGHEST] = max(row[MOST], size), max(row[HIGHEST], now[2])
            for r in range(3):
                row[PULL + r] += MEAN_PULL * (forces[3 * i + r] - row[PULL + r])
        if rods[i] == 0:
            continue
        total, most = 0.0, 0.0
        for rod in range(first, last):
            most = max(most, _norm(press[rod, 0], press[rod, 1], press[rod, 2]))
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
    striking = False
    for i in range(HANDS):
        row = seen[i]
        striking |= row[TURNS] != 0.0
        if holds[i]:
            striking |= row[SIZE] > least_pull or seen[1 - i, GOING] > 0.0
        else:
            striking |= row[TOUCHING] != 0.0 or row[PARTED] != 0.0 or row[PRESS] != 0.0
    return parted, striking


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
