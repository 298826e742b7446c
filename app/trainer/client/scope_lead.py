"""At an anatomy mouse and keys lead a hand through its trocar, or the scope."""

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.anatomy import tube_title
from app.simulation import (
    CLIP_OPENING,
    COMES_OPEN,
    FIRM,
    GRIP_N,
    GRIPS_AT,
    HOLDING,
    IN_RING_MM,
    TICK_SECONDS,
    TROCARS,
    Hand,
    Instrument,
    Session,
    near_place,
    wall_gap,
)
from app.trainer.client.asked_step import PARTS, AskedStep
from app.trainer.client.page_state import PageState
from app.trainer.client.photographer import Photographer
from app.trainer.client.structure_pointer import StructurePointer
from app.trainer.scope.held_scope import HeldScope

Floats = NDArray[np.float64]

HOLDS_MM_S = 8.0
"""mm/s at most of a hand that holds a tube, wherever the pointer is: a flick of the mouse tears
nothing, and a pull can be stopped by what is seen."""
LEAD_MM_S: Mapping[Instrument, float] = {
    "hook": 60.0, "grasper": 60.0, "dissector": 25.0, "swab": 25.0, "right angle": 15.0,
    "clip applier": 25.0, "scissors": 25.0, "suction": 25.0,
}  # fmt: skip
"""mm/s at most of a hand that holds nothing: those that part or press go slowly."""
SPREAD, PARTS_MM_S, CLOSES_MM_S = 20.0, 5.0, 15.0
"""mm that jaws part by at most, and mm/s: quicker ones are thrown open (`jumping_jaws`), and jaws
that close at once crush what has come between them."""
OFF_MM = 5.0
"""By which jaws part again that were closing."""
MEETS_MM = 0.5
"""From a wall, within which a tip would meet it."""
CLOSES_SLOWLY_AT = 0.5
"""Of a wall's break, from which on jaws close as slowly as they part."""
INSISTS = 0.03
"""Of a wall's break, how much more than there is at a stop each key or click allows."""
RISES = 0.003
"""Of a wall's break in a tick, by which what a hand does strains it, whatever its force is."""
AHEAD_TICKS, LEAST_SPEED = 3.0, 0.1
"""Before a wall would come to the stop as it rises now, from which on hands and jaws slow down, and
the part of their speed that they keep: what slips off jaws goes from the stop to its break within
two or three ticks."""
OVER = 0.05
"""Of a wall's break above the stop, from which on nothing goes on that strains it, pull or not."""
GIVES_MM = 0.1
"""By which a hand that stops gives way."""
NOTCH_MM = 1.5
"""Along a shaft, that a notch of the wheel leads."""
LEAST_INTO = 0.1
"""Of a pointer's ray, into the plane in which it leads."""
NEAR_MM, THERE_MM = 1.2, 0.1
"""Off a ring or its path, within which a tip that is led there comes into it; and off the ring,
within which the wheel stops until the tip has come there."""
ALIGNS_MM, ALIGNS_RAD_S = 6.0, 2.5
"""Off a ring's path, within which jaws that are led there turn to its bar; and how fast."""
PRESSED_MM, DRAGGED_MM = 3.0, 2.0
"""Off a ring, within which a press on it leads the tip there, and by which a drag from there leads
it otherwise."""
ON_PATH_MM, IN_FRONT_MM = 2.0, 25.0
"""Off a ring's path, from which on a tip that goes there by itself comes out before it goes aside,
and how far before the ring it then is at most."""
RING_MOVES = 3
"""Of a ring away from the tip that goes there, in a row, after which the tip is held up."""
NEARS_MM, NEARS_MM_S, IN_TISSUE_MM_S, DRAWS_MM_S = 15.0, 15.0, 8.0, 3.0
"""Off a ring, within which a tip that goes there by itself goes no faster; and how fast at most
among strands, as errors have it (`fast_in_tissue`), or with open blades, and with what it
holds."""
LEAST_PUSH_N = 0.1
"""N against a hand's move, from which on it goes as slowly as one that holds."""
INSISTING = "Going on as before brings it 3 % nearer to its break with each click, notch or key."
STOPPED = (
    "Lead the instrument back where it came from, or close its jaws (G). Slacken what the other "
    f"hand pulls (X leads it), and part elsewhere or less deep. {INSISTING}"
)
JAWS_STOPPED = (
    "It lies in or beside the jaws. Close them (G), lead them further from it, and part there."
)
DO_NEXT = "Do what the panel asks for as Next."
NEXT_SLACKENS = f"Do what the panel asks for as Next: that slackens it. {INSISTING}"
CLOSED_ON = (
    "A wall lies between the jaws: open them again (G), lead them deeper or less deep, and close "
    "them there."
)
PUSHED = "Close them (G): what has parted gives room. Then part there again, or less deep."
HELD_BACK = (
    f"A grasper holds {GRIP_N:g} N: pulled harder, tissue slips out of it. Part with the other "
    "hand what holds the tissue back."
)
SAME_WAY = math.cos(math.radians(60.0))
"""Cosine of the angle within which a path goes the way that was stopped before."""
SEEN_TICKS = 30
"""Ticks after a stop, in which keys do nothing: they were pressed before it was seen."""
SUCTION = 15.0
"""ml/s."""
NOTHING_LIES = "Lead its tip to where blood or bile lies. G stops it."
QUICK_TURNS, AT_BAR, QUICK_MOVES = 3.0, 0.02, 4.0
"""Times as far that a key turns jaws towards a bar, rad within which they are there, and times as
far that a key moves a tip towards a ring."""
STEADY_DEG = 3.0
STEADY = math.cos(math.radians(STEADY_DEG))
"""Cosine of the angle within which an instrument's shaft is left as it lies in the tissue."""
BENT_STEADY = math.sin(math.radians(STEADY_DEG))
"""Cosine, either way, of the angle of a right angle's tip with its shaft that is left."""
MM_DIGITS, DIRECTION_DIGITS = 3, 6
"""Of a place in mm and of a direction, that hands are led to: runs with all digits are three times
as large."""
NOTHING_NEAR = (
    "Neither a tube nor the gallbladder is between the jaws. Lead the tip further in with the "
    "wheel, some notches at a time, and try again."
)
NOT_IN_RING = "Lead the tip into the ring first: To the ring, in the panel, says how far it is."
NO_RING = "No ring is shown for this hand: an exercise under Learn has one for each of its steps."
ONLY_THROUGH_SCOPE = (
    "In an exercise you see what the scope sees: lead it with Y. The free camera is for practice, "
    "replays and a teacher who watches."
)
ENDS = "Jaws do not hold there: a clamp, the other hand or a tear is too near."
NOT_BETWEEN = (
    "No tube lies between the open jaws with its whole width. Lead their tips on past it, one jaw "
    "on either side; clear away first what is in between."
)
NOTHING_TO_CUT = (
    "Nothing lies between the blades that crosses them. Lead their tips on past it, one blade on "
    "either side; J and L turn them."
)
SWEEPS = "A swab has no jaws: wipe with it along a tube."


class _Pointer(NamedTuple):
    """A pointer that is pressed in the picture, and leads a hand."""

    hand: int
    ray: Floats  # (6,) mm, from the camera, and direction
    normal: Floats  # (3,) of the plane in which the hand is led
    under: Floats  # (3,) mm, what is under it in that plane
    aside: Floats  # (3,) mm, from there to where the tip is led
    start: Floats  # (3,) mm, where the hand was led before


class Stop(NamedTuple):
    """A move of a hand that was stopped."""

    path: Floats  # (3,) mm, that it had still to go
    stress: float  # of a wall's break
    eases: bool = False  # whether it has slackened, after all


class ScopeLead:
    """What mouse and keys lead at an anatomy: the state's active hand, or the scope."""

    def __init__(self, state: PageState, held: HeldScope) -> None:
        self._state, self.held = state, held
        self.asked = AskedStep(state)
        """What an exercise asks for next."""
        self.pointer = StructurePointer(state, held, self.asked)
        """What points at structures."""
        self.photographer = Photographer(state)
        """What takes photographs for the record."""
        self.leads_scope = self.by_handle = False
        self.free_camera = False
        """Whether the page looks with a camera of its own, and not through the scope."""
        # Of each hand, where its tip is led to, (3,) mm, or None.
        self._goals: list[Floats | None] = [None] * len(state.hands)
        self._pointer: _Pointer | None = None
        self._aligns = False  # whether the active hand's jaws turn to the ring's bar
        # (3,) mm each: the ring to which the active hand's tip goes by itself, and where that was
        # at the end of the last leg there.
        self._seeks: tuple[Floats, Floats] | None = None
        # For what the ring last moved away from a tip that went there, and how often in a row.
        self._moved_away: tuple[str, int] = "", 0
        # Of each hand, how far its jaws go apart or together, mm, or None.
        self._jaws: list[float | None] = [None] * len(state.hands)
        self._crushes = [False] * len(state.hands)  # whether what closing jaws strain waits
        self._run = state.session.run
        self._stops_at = FIRM.stops_at
        self._stress = 0.0  # of the last tick, over the strength
        # The tick in which something was stopped last, and that of the stop that a key went past.
        self._stopped_at = self._answered = -SEEN_TICKS
        # Of each hand, the move that was stopped, or None.
        self._stopped: list[Stop | None] = [None] * len(state.hands)

    @property
    def session(self) -> Session:
        """The client's session."""
        return self._state.session

    @property
    def hand(self) -> int:
        """Number of the active hand."""
        return self._state.hand

    @property
    def to_ring(self) -> tuple[float, float, float] | None:
        """How far right and up of the led tip the ring's path is, and in along that the ring, mm.

        The pointer leads the tip right and up, at its depth, and then the wheel in. One that is on
        its way counts from where it comes to. None where there is no ring for it, or the scope is
        led.
        """
        if (place := self.asked.place) is None or self.leads_scope:
            return None
        holder = self._state.hands[self.hand]
        still = self._goals[self.hand] is None and holder.arrived
        tip = holder.tip if still else self._led_to
        shaft = TROCARS[self.hand].shaft(place)
        into = self._far_along(place, shaft, tip)
        right, up = self.held.camera.axes[:, :2].T @ (place - tip + into * shaft)
        return float(right), float(up), into

    @property
    def meets_wall(self) -> bool:
        """Whether the led tip, on its way aside to the ring's path, would meet a wall."""
        if (to_ring := self.to_ring) is None:
            return False
        aside = self.held.camera.axes[:, :2] @ np.array(to_ring[:2])
        far = math.sqrt(float(aside @ aside))
        tip, beam = self._led_to, self.session.spatial.beam
        sides = aside / max(far, 1e-9), 0.0, far
        return any(wall_gap(beam, name, tip, sides) < MEETS_MM for name in beam.network.tubes)

    def _far_along(self, ring: Floats, shaft: Floats, place: Floats) -> float:
        """How far from a ring back along a shaft the plane is that the pointer leads in, mm."""
        normal = self._normal_of(shaft)
        return float((place - ring) @ normal) / float(shaft @ normal)

    def _normal_of(self, shaft: Floats) -> Floats:
        """(3,) of the plane in which the pointer leads a hand with such a shaft."""
        # Half-way between the picture's and that across the shaft: in the picture's, a shaft that
        # lies nearly in it would have to go far for a little depth.
        normal = self.held.camera.axes[:, 2] + shaft
        return normal / math.sqrt(float(normal @ normal))

    @property
    def _normal(self) -> Floats:
        """(3,) of the plane in which the pointer leads the active hand: to the ring, if any."""
        ring = self.asked.place
        place = self._led_to if ring is None else ring
        return self._normal_of(TROCARS[self.hand].shaft(place))

    def choose(self, hand: int | None) -> None:
        """Lead a hand from now on, or the scope."""
        self._leave_ring()
        self.pointer.leave()
        self.leads_scope = hand is None
        self._state.choose_hand(self.hand if hand is None else hand)

    def choose_next(self) -> None:
        """Lead the other hand, or after the scope the same hand again."""
        hands = len(self._state.hands)
        self.choose(self.hand if self.leads_scope else (self.hand + 1) % hands)

    def choose_scope(self) -> None:
        """Lead the scope, or the hand again."""
        self.choose(self.hand if self.leads_scope else None)

    def choose_instrument(self, hand: int, instrument: Instrument) -> None:
        """Give a hand another instrument, which comes through its trocar with its jaws open."""
        self._leave_ring()
        state = self._state
        self.leads_scope = False
        before = state.hands[hand].instrument
        state.choose_instrument(hand, instrument)
        if state.hands[hand].instrument == before:
            return
        self._goals[hand] = self._jaws[hand] = None
        self._aim(hand)
        if instrument in COMES_OPEN:
            state.session.open_jaws(hand, CLIP_OPENING)

    def choose_next_instrument(self) -> None:
        """Give the active hand what the next step asks for, or else the next instrument."""
        if (asked := self.asked.tool) is not None:
            self.choose_instrument(self.hand, asked)
            return
        offered, now = self._state.instruments, self._state.instrument
        at = offered.index(now) if now in offered else -1
        self.choose_instrument(self.hand, offered[(at + 1) % len(offered)])

    def lead_hand(self, place: Floats) -> None:
        """Lead the active hand's tip, as it is drawn, to a place, (3,) mm."""
        if self._may_act():
            marked = self._marked_for(place)
            self._aligns |= any(math.dist(each, place) < ALIGNS_MM for each in marked[-1:])
            # One eye does not tell depth, and a hand that points is a little off. What leads away
            # from a mark is not drawn back to it.
            now = self._led_to
            place = next(
                (
                    each
                    for each in marked
                    if math.dist(each, place) < min(NEAR_MM, math.dist(each, now) + THERE_MM)
                ),
                place,
            )
            place = place - self._state.hands[self.hand].jaws
            self._goals[self.hand] = TROCARS[self.hand].within(place)

    @property
    def _led_to(self) -> Floats:
        """(3,) mm where the active hand's tip is led, or else is."""
        goal, holder = self._goals[self.hand], self._state.hands[self.hand]
        return (holder.target if goal is None else goal) + holder.jaws

    def press(self, *ray: float) -> None:
        """Lead the active hand by a pointer from now on: (6,) a ray from the camera to it.

        The tip comes under it, or goes to the ring that is under it; what is held is led from where
        it is, and a handle goes as far as the pointer.
        """
        self._leave_ring()
        holder, at = self._state.hands[self.hand], np.array(ray)
        held = holder.node is not None
        tip, normal = holder.tip if held else self._led_to, self._normal
        under = _meeting(at, normal, tip)
        aside = tip - under if held else np.zeros(3)
        goal = self._goals[self.hand]
        start = (holder.target if goal is None else goal).copy()
        self._pointer = _Pointer(self.hand, at, normal, under, aside, start)
        if self.by_handle:
            return
        if self._is_at_ring(at):
            self.seek_ring()
        elif not held:
            self.lead_hand(under)

    def _is_at_ring(self, ray: Floats) -> bool:
        """Return whether a ray passes through the active hand's ring, whose tip is not there."""
        if (ring := self.asked.place) is None or self.asked.in_ring:
            return False
        to, along = ring - ray[:3], ray[3:]
        past = to - float(to @ along) / max(float(along @ along), 1e-12) * along
        return math.sqrt(float(past @ past)) < PRESSED_MM

    def seek_ring(self) -> None:
        """Lead the active hand's tip to its ring, until it is there or something else is done.

        It goes out of the tissue first, aside in front of that, and in along the ring's path; with
        what it holds it goes straight there.
        """
        if (ring := self.asked.place) is None or self.leads_scope:
            self._state.refuse(NO_RING)
        elif self._may_act():
            self._goals[self.hand] = None
            self._seeks = ring, np.full(3, math.inf)

    def _leave_ring(self) -> None:
        """Lead a tip that goes to its ring by itself there no further."""
        if self._seeks is not None:
            self._goals[self.hand] = self._seeks = None

    def _seek(self) -> None:
        """Lead a tip that goes to its ring on by a leg, once it has come to the end of the last."""
        hand, step = self._state.hands[self.hand], self.asked.step
        if self._seeks is None or self._goals[self.hand] is not None or not hand.arrived:
            return
        (asked, before), tip = self._seeks, hand.tip
        ring, to_ring = self.asked.place, self.to_ring
        if step is None or ring is None or to_ring is None:
            self._seeks = None
            return
        if math.dist(ring, asked) > IN_RING_MM:
            self._seeks = None
            words, times = self._moved_away
            times = times + 1 if words == step.words else 1
            self._moved_away = step.words, times
            # It goes with the tissue that the tip pushes.
            if times % RING_MOVES == 0:
                self.asked.note_blocked()
            return
        right, up, into = to_ring
        aside = math.hypot(right, up)
        away = hand.node is None and not step.through and aside > ON_PATH_MM
        if not away and self._aligns:
            return
        if math.dist(tip, ring) < THERE_MM or math.dist(tip, before) < THERE_MM:
            self._seeks = None
            if not self.asked.in_ring and hand.instrument not in HOLDING:
                self.asked.note_blocked()
            return
        self._seeks = ring.copy(), tip
        touches = self.session.spatial.touched(self.hand) > 0
        if away and into < IN_FRONT_MM and (into < 0.0 or touches or self.meets_wall):
            ring = tip + NOTCH_MM * TROCARS[self.hand].shaft(tip)
        elif away:
            ring += into * TROCARS[self.hand].shaft(ring)
        self.lead_hand(ring)

    def drag(self, *ray: float) -> None:
        """Lead the hand on to where the pointer is now."""
        before, at = self._pointer, np.array(ray)
        if before is None or before.hand != self.hand:
            return
        under = _meeting(at, before.normal, before.under)
        if self._seeks is not None:
            if math.dist(under, before.under) < DRAGGED_MM:
                return
            self._leave_ring()
        self._pointer = before._replace(ray=at, under=under)
        if self.by_handle:
            right, up = self.held.camera.axes[:, :2].T @ (under - before.under)
            self.push_handle(float(right), float(up), 0.0)
        else:
            self.lead_hand(under + before.aside)

    def wheel(self, notches: float) -> None:
        """Lead the active hand in along its shaft, or the scope where that is led or one points."""
        self._leave_ring()
        into = NOTCH_MM * notches
        if self.leads_scope or self.pointer.structure is not None:
            self.move_scope(depth=into)
        elif self.by_handle:
            self.push_handle(0.0, 0.0, into)
        elif into := self._to_ring_at_most(into):
            start, pointer = self._led_to, self._pointer
            place = start - into * TROCARS[self.hand].shaft(start)
            self.lead_hand(place)
            if pointer is not None and pointer.hand == self.hand:  # which goes on from there
                under = _meeting(pointer.ray, pointer.normal, place)
                self._pointer = pointer._replace(under=under, aside=place - under)

    def _to_ring_at_most(self, into: float) -> float:
        """Return how far in a tip on a ring's path is led: not past the ring before it is there."""
        right, up, left = self.to_ring or (math.inf, math.inf, 0.0)
        if math.hypot(right, up) > IN_RING_MM:
            return into
        if abs(left) < THERE_MM:
            return into if self._goals[self.hand] is None else 0.0
        return _quicker(into, left, 1.0)

    def _marked_for(self, place: Floats) -> list[Floats]:
        """(3,) mm each: the active hand's ring, and the cross on its path before a place."""
        ring = self.asked.ring
        if ring is None or ring[9] != self.hand:
            return []
        at, shaft = np.array(ring[:3]), np.array(ring[6:9])
        marked = [at]
        if shaft.any():
            marked.append(at + self._far_along(at, shaft, place) * shaft)
        return marked

    def push_handle(self, right: float, up: float, into: float) -> None:
        """Move the active hand's handle, mm at the tip: across its shaft, and along it.

        Of what is right and up in the picture that counts which is across the shaft, and there the
        tip goes the other way.
        """
        if self._may_act():
            goal, trocar = self._goals[self.hand], TROCARS[self.hand]
            start = self._state.hands[self.hand].target if goal is None else goal
            move, shaft = self.held.camera.axes @ np.array([right, up, 0.0]), trocar.shaft(start)
            move -= (float((move * shaft).sum()) + into) * shaft
            self._goals[self.hand] = trocar.led_by_handle(start, move)

    def stop(self) -> None:
        """Leave a hand that holds a tube where it is, as its pointer lets go."""
        self._pointer = None
        if self._state.hands[self.hand].node is not None:
            self.rest()

    def rest(self) -> None:
        """Leave the active hand where it is, as a stick that led it comes back to rest."""
        self._goals[self.hand] = self._seeks = None

    def take_back(self) -> None:
        """Lead the active hand to where it was led before its pointer: that was half of a pinch."""
        before, self._pointer = self._pointer, None
        self._leave_ring()
        if before is not None and before.hand == self.hand:
            self._goals[self.hand] = before.start

    def advance(self, ticks: int) -> None:
        """Lead the hands on for some ticks, no faster than they may."""
        state, run = self._state, self._state.session.run
        if run is not self._run:  # what was led before goes on in no other
            self._run = run
            self._lead_nothing()
        self.free_camera = self.free_camera and not state.in_exercise
        if state.playback is not None or state.paused or run.closed:
            return
        if self._aligns:
            self._align(ALIGNS_RAD_S * TICK_SECONDS * ticks)
        if self._seeks is not None:
            self._seek()
        stress = state.session.spatial.stress_ratio
        rise, self._stress = stress - self._stress, stress
        stops, rises = self._nears_break(), rise > RISES
        brake = 1.0
        if rises and state.figures_visible:
            left = (self._stops_at - stress) / (AHEAD_TICKS * rise)
            brake = min(1.0, max(left, LEAST_SPEED))
        if not stops:
            self._stopped = [None] * len(self._stopped)
        for hand, goal in enumerate(self._goals):
            holder = state.hands[hand]
            self._lead_jaws(hand, stops, rises, brake, TICK_SECONDS * ticks)
            if goal is None:
                self._give_way(hand)
                continue
            path = goal - holder.target
            far = math.sqrt(float((path * path).sum()))
            pushes = float(path @ state.session.spatial.forces[hand]) / max(far, 1e-12)
            # What slackens its own pull may press the wall on the other instrument, or other jaw.
            over = rises and stress > self._stops_at + OVER
            strains_else = over and (holder.node is None or self._other_pushes(hand))
            strains, slackens = pushes > LEAST_PUSH_N, pushes < -LEAST_PUSH_N and not strains_else
            before = self._stopped[hand]
            again = before is not None and _alike(path, before.path)
            if before is not None and again and stress > before.stress + RISES:
                # To give way strained it: that way lies what slackens it.
                before = self._stopped[hand] = before._replace(eases=True)
            eases = before is not None and again and before.eases
            slips = strains and self._nears_slip(hand)
            # Stress may go on rising by what the hand did before: what slackens goes on.
            strains_more = rises if eases else strains or ((again or rises) and not slackens)
            if far > 0.0 and (slips or (stops and strains_more)):
                self._goals[hand], self._stopped[hand] = None, Stop(path, stress)
                if hand == self.hand:
                    self._seeks = None
                self._move(hand, holder.place - path * (GIVES_MM / far))
                if slips:
                    self._say_stopped(HELD_BACK, "the grasper nears its grip")
                else:
                    self._say_stopped(STOPPED)
                continue
            if strains and self._other_slips(hand):
                continue  # until the other hand has gone after what it holds
            slowly = strains or self._crushes[hand]
            most = self._speed(holder, slowly) * TICK_SECONDS * ticks
            if not slackens:
                most *= brake
            if far <= most:
                self._goals[hand] = None
            step = path if far <= most else path * (most / far)
            self._move(hand, holder.target + step)
            self._aim(hand)

    def _nears_break(self) -> bool:
        """Return whether a wall is nearer to its break than it may come: no force is felt here."""
        ratio, most = self.session.spatial.stress_ratio, self._most_strain
        self._stops_at = most if ratio < most else max(most, self._stops_at)
        return ratio > self._stops_at and self._state.figures_visible

    @property
    def _most_strain(self) -> float:
        """Of a wall's break, at which what strains it is stopped."""
        step = self.asked.step
        return (FIRM if step is None else step.strain).stops_at

    def _other_slips(self, hand: int) -> bool:
        """Return whether what another hand holds is about to slip out of it."""
        return any(self._nears_slip(i) for i in range(len(self._goals)) if i != hand)

    def _other_pushes(self, hand: int) -> bool:
        """Return whether another hand pushes or pulls at something."""
        forces = enumerate(self.session.spatial.forces)
        return any(math.hypot(*each) > LEAST_PUSH_N for i, each in forces if i != hand)

    def _nears_slip(self, hand: int) -> bool:
        """Return whether a hand pulls nearly as hard as it grips: no force is felt here."""
        ratio = self.session.spatial.grip_ratio(hand)
        return ratio > GRIPS_AT and self._state.figures_visible

    def _give_way(self, hand: int) -> None:
        """Let a hand go after what it holds before that slips out of it."""
        if self._nears_slip(hand):
            pull = np.array(self.session.spatial.forces[hand])
            place = self._state.hands[hand].target - pull * (GIVES_MM / math.hypot(*pull))
            self._move(hand, place)

    def _insist(self) -> None:
        """Let a wall come a little nearer to its break than it is, if it is near."""
        self._stops_at = max(self._most_strain, self.session.spatial.stress_ratio + INSISTS)
        self._stopped = [None] * len(self._stopped)

    def _steps(self) -> bool:
        """Let a key go on a little; not one that was pressed before the last stop was seen."""
        now = self.session.spatial.ticks
        if 0 <= now - self._stopped_at < SEEN_TICKS:
            return False
        # Once for each stop: a key that is held, or a stick, would else never come to the next.
        if self._answered != self._stopped_at:
            self._answered = self._stopped_at
            self._insist()
        return True

    def _say_stopped(self, advice: str, why: str = "") -> None:
        """Tell what was stopped and what to do; by default a wall nears its break."""
        tissue = self.session.spatial
        self._stopped_at = tissue.ticks
        if self.asked.step is not None:
            self.asked.judge_soon()
            advice = advice if why else NEXT_SLACKENS
        wall = tube_title(tissue.most_stressed)
        why = why or f"the {wall} is at {100.0 * tissue.stress_ratio:.0f} % of its break"
        self._state.refuse(advice, f"Stopped: {why}")

    def _lead_jaws(self, hand: int, stops: bool, rises: bool, brake: float, seconds: float) -> None:
        """Part or close jaws as far as they are led, no faster than they may."""
        goal, opened = self._jaws[hand], self._state.hands[hand].target_opening
        if goal is None:
            return
        if stops and goal > opened:
            self._jaws[hand] = None
            self._say_stopped(JAWS_STOPPED)
            return
        push = math.hypot(*self.session.spatial.forces[hand])
        if push > GRIPS_AT * GRIP_N and goal > opened and self._state.figures_visible:
            self._jaws[hand] = None
            advice = PUSHED if self.asked.step is None else DO_NEXT
            self._say_stopped(advice, f"the jaws push with {push:.0f} N")
            return
        if goal > opened and push > LEAST_PUSH_N and self._other_slips(hand):
            return
        crushed = self._crushes[hand]
        # From where closing jaws strain a wall to where that is slack, or they touch nothing, they
        # wait.
        self._crushes[hand] = stops and goal < opened and push > 0.0 and (rises or crushed)
        if self._crushes[hand]:
            if not crushed:
                self._say_stopped(CLOSED_ON)
            return
        slowly = goal > opened or self._stress > CLOSES_SLOWLY_AT
        most = seconds * (PARTS_MM_S if slowly else CLOSES_MM_S)
        if goal > opened:
            most *= brake
        self.session.open_jaws(hand, min(max(goal, opened - most), opened + most))
        if abs(goal - opened) <= most:
            self._jaws[hand] = None

    def nudge(self, right: float, up: float, away: float) -> None:
        """Move the active hand's tip in the picture and in along its shaft, mm, or the scope."""
        self._leave_ring()
        if self.pointer.structure is not None:
            self.pointer.move_cross(right, up)
            return
        if self.leads_scope:
            self.move_scope(pan=0.04 * right, tilt=0.04 * up, depth=2.0 * away)
            return
        if self.by_handle:
            self.push_handle(right, up, away)
            return
        if not self._steps():
            return
        start, (x, y, back), normal = self._led_to, self.held.camera.axes.T, self._normal
        step = right * x + up * y
        step -= float(step @ normal) / float(back @ normal) * back  # as the pointer leads
        self.lead_hand(start + step - away * TROCARS[self.hand].shaft(start))

    def step(self, right: float, up: float, into: float) -> None:
        """Move as `nudge` does, but a tip several times as far towards its ring, not past it."""
        to_ring = self.to_ring if self.pointer.structure is None else None
        steps, left = (right, up, into), to_ring or (0.0, 0.0, 0.0)
        if to_ring is not None and math.hypot(*to_ring) < THERE_MM:  # it leads out of that only
            self.nudge(right, up, min(into, 0.0))
            return
        self.nudge(
            *(_quicker(each, far, QUICK_MOVES) for each, far in zip(steps, left, strict=True))
        )

    def _align(self, most: float) -> None:
        """Turn the active hand's jaws to the ring's bar, rad at most, while they touch nothing."""
        left, push = self.asked.turn, math.hypot(*self.session.spatial.forces[self.hand])
        if self.leads_scope or left is None or abs(left) <= AT_BAR or push > LEAST_PUSH_N:
            self._aligns = False
        else:
            self._turn_jaws(math.copysign(min(abs(left), most), left))

    def turn(self, angle: float) -> None:
        """Turn the active hand's jaws about its shaft, or the scope's cable, rad.

        Towards a bar they go several times as far, but not past it.
        """
        if self.leads_scope:
            self.move_scope(cable=angle)
            return
        if not self._may_act() or self._state.hands[self.hand].instrument in HOLDING:
            return
        if self._aligns:  # it turns by itself: a key too many would lead past the bar
            return
        left = self.asked.turn
        if left is not None and abs(left) > AT_BAR and left * angle > 0.0:
            angle = _quicker(angle, left, QUICK_TURNS)
        if not self._turn_jaws(angle):  # they would turn into a tube
            self.asked.note_blocked()

    def _turn_jaws(self, angle: float) -> bool:
        """Turn the active hand's jaws by an angle, rad; return whether they have turned."""
        holder = self._state.hands[self.hand]
        before = holder.aim, holder.spread
        shaft = TROCARS[self.hand].shaft(holder.place)
        if holder.instrument == "right angle":
            self._bend(self.hand, shaft, _about(np.array(holder.aim), shaft, angle))
        else:
            turned = _about(np.array(holder.spread), shaft, angle)
            self._spread(self.hand, turned)
        after = self._state.hands[self.hand]
        return (after.aim, after.spread) != before

    def use_instrument(self) -> None:
        """Do what the active hand's instrument does, or mark what the cross points at."""
        if self.pointer.structure is not None:
            self.pointer.mark_at_cross()
            return
        if self._may_act():
            self._leave_ring()
            self._state.forget_refusal()
            self._uses[self._state.instrument]()
            self.asked.judge_soon()

    @property
    def use(self) -> str:
        """What the active hand's instrument does if it is used now, in words."""
        holder = self._state.shown.tissue.hands[self.hand]
        now: dict[Instrument, str] = {
            "clip applier": "Clip",
            "scissors": "Cut",
            "suction": "Stop" if self._state.shown.spatial.suction.on(self.hand) else "Suck",
            "swab": "Wipe",
        }
        if holder.instrument in HOLDING:
            return "Take hold" if holder.node is None else "Let go"
        return now.get(holder.instrument, "Close" if self._opens_to > 0.0 else "Part")

    @property
    def _uses(self) -> Mapping[Instrument, Callable[[], object]]:
        return {
            "hook": self._take_or_let_go, "grasper": self._take_or_let_go,
            "dissector": self._open_or_close, "right angle": self._open_or_close,
            "swab": lambda: self._state.refuse(SWEEPS),
            "clip applier": lambda: self._close(self.session.clip, NOT_BETWEEN),
            "scissors": lambda: self._close(self.session.cut, NOTHING_TO_CUT),
            "suction": self._suck,
        }  # fmt: skip

    def _take_or_let_go(self) -> None:
        state, hand = self._state, self.hand
        holder = state.hands[hand]
        self._goals[hand] = None
        if holder.node is not None:
            tip = holder.tip
            state.let_go(hand)
            if state.hands[hand].node is None:  # and not held by a device
                self.session.move_hand(hand, tip)
            return
        found = near_place(state.session.spatial.beam, holder.place)
        if found is None:
            state.refuse(
                NOTHING_NEAR if self.to_ring is None or self.asked.in_ring else NOT_IN_RING
            )
        elif state.session.grab(hand, found[1], found[0]) is None:
            state.refuse(ENDS)

    def _open_or_close(self) -> None:
        self._insist()
        opened = self._state.hands[self.hand].target_opening
        # Jaws that close on something come off it.
        closes = opened > 0.0 and self._opens_to == 0.0
        self._jaws[self.hand] = opened + OFF_MM if closes else 0.0 if opened > 0.0 else SPREAD

    def _close(self, act: Callable[[int], bool], refusal: str) -> None:
        if not act(self.hand):
            self._state.refuse(refusal)

    def _suck(self) -> None:
        tissue = self.session.spatial
        on = tissue.suction.on(self.hand)
        self.session.suck(self.hand, 0.0 if on else SUCTION)
        if not on and not tissue.suction.reaches(tissue.hands[self.hand].place, tissue.beam):
            self._state.refuse(NOTHING_LIES, title="It takes up nothing here")
        self._state.show()

    def open_more(self, more: float) -> None:
        """Part the active hand's jaws by some mm more, or less, as far as they go."""
        if self._may_act() and (more < 0.0 or self._steps()):
            self._jaws[self.hand] = min(max(0.0, self._opens_to + more), SPREAD)

    @property
    def _opens_to(self) -> float:
        """How far the active hand's jaws are to part, mm."""
        goal = self._jaws[self.hand]
        return self._state.hands[self.hand].target_opening if goal is None else goal

    def _lead_nothing(self) -> None:
        self._goals = [None] * len(self._goals)
        self._jaws = [None] * len(self._jaws)
        self._aligns, self._seeks = False, None

    def _may_act(self) -> bool:
        """Return whether the active hand can do something now; tell the client why not."""
        return self._state.may_act(self.hand)

    def _speed(self, holder: Hand, strains: bool) -> float:
        if holder.instrument in PARTS and holder.opening > 0.0:
            return PARTS_MM_S  # they part what they are led through
        seeks = self._seeks is not None and holder is self._state.hands[self.hand]
        if holder.node is not None:
            return DRAWS_MM_S if seeks else HOLDS_MM_S
        if strains:
            return HOLDS_MM_S
        most = LEAD_MM_S[holder.instrument]
        if not seeks:
            return most
        nears = self._seeks is not None and math.dist(self._seeks[0], holder.tip) < NEARS_MM
        opens = holder.instrument in COMES_OPEN and nears
        slowly = opens or self.session.spatial.touched(self.hand)
        return min(most, IN_TISSUE_MM_S if slowly else NEARS_MM_S if nears else most)

    def _aim(self, hand: int) -> None:
        """Lay an instrument along its shaft; a right angle's tip goes with it."""
        holder = self._state.hands[hand]
        if holder.instrument in HOLDING:
            return
        shaft, aim = TROCARS[hand].shaft(holder.target), np.array(holder.aim)
        along = float((shaft * aim).sum())
        if holder.instrument == "right angle":
            if abs(along) > BENT_STEADY:
                self._bend(hand, shaft, aim)
        elif along < STEADY:
            self._point(hand, shaft)

    def _bend(self, hand: int, shaft: Floats, aim: Floats) -> None:
        """Bend a tip off its shaft by 90 degrees, nearest to an aim; its jaws part across."""
        across = aim - float((aim * shaft).sum()) * shaft
        self._point(hand, across)
        self._spread(hand, np.cross(shaft, across))

    def _move(self, hand: int, place: Floats) -> None:
        self.session.move_hand(hand, np.round(place, MM_DIGITS))

    def _point(self, hand: int, aim: Floats) -> None:
        self.session.aim(hand, np.round(aim, DIRECTION_DIGITS).tolist())

    def _spread(self, hand: int, direction: Floats) -> None:
        self.session.spread(hand, np.round(direction, DIRECTION_DIGITS).tolist())

    def move_scope(self, *by: float, **named: float) -> None:
        """Move the scope oneself, rad and mm, as `Pose.moved`."""
        self.held.move(*by, **named)
        self._state.show()

    def wipe_lens(self) -> None:
        """Wipe the scope's lens, which jets of blood and touch soil."""
        if self._state.playback is None and not self._state.is_closed():
            self.session.wipe_lens()
            self._state.show()

    def switch_camera(self) -> None:
        """Look with a free camera, or through the scope again; in an exercise only through it."""
        if self._state.in_exercise:
            self._state.refuse(ONLY_THROUGH_SCOPE)
            return
        self.free_camera = not self.free_camera
        self._state.show()

    def give_scope_back(self) -> None:
        """Give the scope back to the assistant, and lead a hand again.

        In a replay it shows what was seen.
        """
        if self.leads_scope:
            self.choose(self.hand)
        # Nobody leads it back while time stands still.
        self.held.home() if self._state.paused else self.held.give_back()
        self._state.show()

    def change_scope(self) -> None:
        """Take the other scope, straight or oblique."""
        self.held.change()
        self._state.show()


def _meeting(ray: Floats, normal: Floats, place: Floats) -> Floats:
    """(3,) mm where a ray meets the plane through a place."""
    start, way = ray[:3], ray[3:]
    size = math.sqrt(float(way @ way)) or 1.0
    into = -float(way @ normal) / size
    far = float((start - place) @ normal) / max(into, LEAST_INTO)
    return start + way * (far / size)


def _quicker(step: float, left: float, times: float) -> float:
    """Return a step so many times as far, if it leads to where so much is left, but not past."""
    return math.copysign(min(abs(left), times * abs(step)), step) if step * left > 0.0 else step


def _alike(one: Floats, other: Floats) -> bool:
    """Return whether two paths go the same way."""
    return float(one @ other) > SAME_WAY * math.sqrt(float(one @ one) * float(other @ other))


def _about(vector: Floats, axis: Floats, angle: float) -> Floats:
    """Return a vector turned about a unit axis, rad."""
    along = float((vector * axis).sum()) * axis
    across = vector - along
    return along + math.cos(angle) * across + math.sin(angle) * np.cross(axis, across)
