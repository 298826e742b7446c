"""What is asked for of jaws at one place: to come, part, close and withdraw (docs/scope.md)."""

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from app.anatomy import tube_title
from app.simulation.exercises.next_step import (
    BACK,
    BACK_ALONG,
    BETWEEN_BLADES,
    BLOCKED,
    CLOSE,
    CLOSE_FEW,
    CLOSES,
    CUT,
    FIRM,
    LEAVE,
    NOTHING_BETWEEN,
    OPEN,
    OPENS,
    OUT_AS,
    PART,
    PASS,
    PINCHED,
    PRESSES,
    STRAINS,
    SWEEP,
    TUBE_BETWEEN,
    TURN,
    WITHDRAW,
    WITHDRAW_ALONG,
    NextStep,
    Strain,
    Three,
)
from app.simulation.inputs.clock import TICK_SECONDS
from app.simulation.inputs.hand import GRIP_N, Hand
from app.simulation.inputs.inputs import Instrument
from app.simulation.inputs.trocar import TROCARS
from app.simulation.tissue.parting import PartingPlaces, Site
from app.simulation.tissue.passes import JAW_MM
from app.simulation.tissue.reached_tube import wall_gap
from app.simulation.tissue.spatial_tissue import SpatialTissue

Floats = NDArray[np.float64]

RIGHT = 1
"""Number of the hand that has jaws."""
PUSHES_N = 0.1
"""Least force of a hand that can strain a wall, N."""
FEW = 5
"""Jaws that have parted no more strands than this have parted few."""
MOST_STRAINED = 1
"""How often a wall may be too taut at a place before another place is tried."""
GRIPS_AT = 0.9
"""Part of the pull at which tissue slips out of the grasper. Above it the grasper pulls no harder
and jaws open no wider: else the tissue slips, or all strands part at once."""
# Distances of a tip from the ring's middle, mm.
IN_RING_MM = 2.0
"""Up to this a tip is in the ring."""
LEFT_MM = 5.0
"""From this on it has left the ring."""
OUT_MM = 8.0
"""From this on, towards the viewer, jaws are out of the tissue that they have parted."""
FAR_MM = 40.0
"""From this on, in any direction, they are out of it too."""
TURNED = math.radians(20.0)
"""Jaws within this angle of the ring's bar lie along it, rad."""
LEAST_ACROSS = 0.2
"""Least part of a direction that is across the shaft: jaws part nothing along their shaft."""
DEEPER_MM = 3.0
"""How much deeper a bent tip goes again that lifts a wall as it is drawn out, mm."""
CLEAR_MM = 1.5
"""How far it then goes along itself past the wall, mm."""
LEAVES_MM = (3.0, 5.0, 8.0, 12.0)
"""Distances that are tried to lead bent jaws off a wall, mm, in each of the `DIRECTIONS`."""
LEAVES_FOR = 4
"""Judgements for which this is asked while a wall stays strained."""
DIRECTIONS = 4
"""To the front, deeper, and back or on along the tip. Jaws that were led in all are closed."""
NEEDS_MM = 1.0
"""Distance of open jaws from a wall at which they may close, mm."""
COSTS = 0.1
"""What a mm of the path there costs, in mm of that distance."""
MOST_STUCK = 10
"""Judgements for which closing jaws are drawn back from a wall before the hold is let go."""
MOST_GENTLE = 4
"""How often a wall may be too taut before it may be strained more, so that jaws come out."""
MOST_BLOCKED = 1
"""How often a tip may fail to reach a place before another is tried."""
MOVES_MM = 0.2
"""Jaws that part by more than this between two judgements are still opening, mm."""
MOST_LED_OFF = 3
"""How often open jaws are led off a tube between them before they are asked to close."""

State = Literal[
    "to come", "beside", "sweeping", "opening", "to close", "closing", "pinched",
    "to leave", "closed", "to withdraw",
]  # fmt: skip


class JawSteps:
    """How far the right hand's jaws have come at a place, and what is next there."""

    def __init__(
        self, tissue: SpatialTissue, places: PartingPlaces, site: Site, strain: Strain
    ) -> None:
        self._tissue, self._places, self.site, self._strain = tissue, places, site, strain
        self._state: State = "to come"
        self._opening = 0.0  # mm, at the last judgement
        self._broken = tissue.beam.broken
        self._wall, self._left = "", np.zeros(3)  # between its jaws; (3,) mm, where they are off it
        self._led_off: list[int] = []  # numbers of the directions in which they were led off it
        self._leaves = 0  # how often they were led off a wall before they closed on it
        self._in_vain = 0  # judgements meanwhile at which a wall was strained
        self._led_from = np.zeros(3)  # (3,) mm, where the tip was led as a direction was chosen
        self._stuck = 0  # judgements in a row at which jaws strained a wall on their way back
        self._clear: Floats | None = None  # (3,) mm, where a bent tip is clear of what it lifted
        self._blocked = 0  # how often the tip could not come to where it is led next
        self._begun_at = tissue.ticks
        self._why = ""  # what has parted nothing is drawn out
        self.strained = 0
        """How often a wall was too taut meanwhile."""

    @property
    def strain(self) -> Strain:
        """How far walls may be strained: more, where jaws strain them again and again."""
        return self._strain if self.strained < MOST_GENTLE else FIRM

    @property
    def begun(self) -> bool:
        """Whether jaws have opened here."""
        return self._state not in {"to come", "beside"}

    @property
    def strained_often(self) -> bool:
        """Whether a wall was too taut here more often than it may be."""
        return self.strained > MOST_STRAINED

    @property
    def stays_strained(self) -> bool:
        """Whether a wall stays strained though closing jaws are drawn back again and again."""
        return self.begun and self._stuck > MOST_STUCK

    @property
    def strands(self) -> NDArray[np.int64]:
        """The strands that are asked for."""
        strands = self.site.strands
        return strands[self._tissue.beam.damage[strands] < 1.0]

    @property
    def is_over(self) -> bool:
        """Whether jaws have left the place, and need not come back."""
        hand, place, site = self._hand, self._place, self.site
        if hand is None:
            return self.begun or self._gives_up or not self._places.left(site)
        moves = [each for each in (site.through, site.beside) if each is not None]
        off = min(
            math.dist(hand.place, each) for each in (place, *(place + each for each in moves))
        )
        if not self.begun:
            return off > LEFT_MM and (self._gives_up or not self._places.left(site))
        if site.beside is None:
            return off > OUT_MM and not hand.opening
        # A bent tip that is only led aside may still lie behind a wall.
        front = float((hand.place - self._back) @ TROCARS[RIGHT].shaft(self._back))
        open_jaws = hand.opening and self.site.tool != "scissors"
        return not open_jaws and (front > OUT_MM or off > FAR_MM)

    @property
    def fruitless(self) -> bool:
        """Whether few strands have parted since the place was asked for."""
        return self._tissue.beam.broken - self._broken <= FEW

    @property
    def tried(self) -> bool:
        """Whether the place is to be asked for less from now on."""
        return self.begun or self._gives_up

    @property
    def _gives_up(self) -> bool:
        return self.strained_often or bool(self._why)

    def note_blocked(self) -> None:
        """Note that the tip could not come to where it is led, by what is in its way."""
        self._blocked += 1
        if self._blocked <= MOST_BLOCKED:
            return
        self._blocked = 0
        if self._state == "to come":
            self._why = BLOCKED
        elif self._state == "beside":
            self._state = "closed"  # it goes back as it came
        elif self._state in {"closed", "sweeping"}:
            self._state = "to withdraw"
        elif self._state == "to leave":
            self._lead_otherwise()

    def _lead_otherwise(self) -> None:
        """Lead open jaws off a wall in another direction, or close them after all of those."""
        if len(self._led_off) < DIRECTIONS:
            self._leave()
        else:
            self._state = "to close"
            self._led_off.clear()

    def follow(self) -> None:
        """Note how far the jaws have come."""
        hand, site, place = self._hand, self.site, self._place
        if hand is None:
            return
        if self.site.tool == "scissors":
            self._follow_blades(hand)
            return
        if self._tissue.stress_ratio < self.strain.taut:
            self._stuck = 0
        before = self._state
        opens = hand.opening > self._opening + MOVES_MM
        closes, self._opening = hand.opening < self._opening - MOVES_MM, hand.opening
        if not self.begun:
            presses = math.hypot(*self._tissue.forces[RIGHT]) > GRIPS_AT * GRIP_N
            passed = self._state == "beside" and self._is_at(place)
            if hand.opening and math.dist(hand.place, place) < LEFT_MM:
                self._state = "opening"
            elif (presses and passed) or (self._state == "beside" and self.strained_often):
                self._state = "closed"  # it goes back as it came
            elif presses and self._is_at(self._beside):
                self._why = PRESSES
            elif site.beside is not None and self._is_at(self._beside):
                self._state = "beside"
            elif site.through is not None and math.dist(hand.place, place) < IN_RING_MM:
                self._state = "sweeping"
        elif self._state == "sweeping":
            assert site.through is not None  # noqa: S101
            led = math.dist(hand.place, place + site.through) < IN_RING_MM
            if led or self._taut:
                self._state = "to withdraw"
        elif not hand.opening:
            back = site.beside is None or math.dist(hand.place, self._back) < IN_RING_MM
            self._state = "to withdraw" if back or self._state == "to withdraw" else "closed"
        elif self._state in {"closed", "to withdraw"}:  # they have parted once more
            self._state = "opening" if opens else "to close"
        elif self._state == "pinched" and opens:
            self._state = "to leave"
            self._leave()
        elif self._state == "to leave" and closes and self._taut:
            self._state, self._wall = "pinched", self._tissue.most_stressed
        elif self._state == "to leave":
            if self._taut:
                # A ring that moved at once, or while nobody goes there, could not be followed.
                self._in_vain += 1
                led = (hand.target != self._led_from).any()
                if led and self._in_vain % LEAVES_FOR == 0:
                    self._lead_otherwise()
            elif not opens and math.dist(hand.place, self._left) < IN_RING_MM:
                self._state = "to close"
        elif closes:
            self._state = "closing"
        elif self._state == "closing" and self._taut:
            if site.beside is not None:
                self._state, self._wall = "pinched", self._tissue.most_stressed
        elif self._state == "closing":  # they have stopped, or part once more
            self._state = "opening" if opens else "to close"
        elif self._state == "opening":
            opens &= self._tissue.stress_ratio < self.strain.stops_at
            self._state = "opening" if opens else "to close"
        begins = self._state == "to close" and before != "to close"
        looks = begins and site.beside is not None and self._leaves < MOST_LED_OFF
        if looks and (between := self._between()) is not None:
            self._leaves += 1
            self._state, self._wall = "to leave", between
            self._leave()

    def _follow_blades(self, hand: Hand) -> None:
        """Note how far scissors have come, which cut with one press."""
        tissue = self._tissue
        if self._state == "to withdraw" or self._why:
            return
        if tissue.since_closed(RIGHT) <= (tissue.ticks - self._begun_at) * TICK_SECONDS:
            self._state = "to withdraw"
        elif self._state == "to come":
            if self._is_at(self._beside):
                self._state = "beside"
        elif self._taut:
            self._why = STRAINS.format(tube_title(tissue.most_stressed))
        elif math.dist(hand.place, self._place) < IN_RING_MM:
            blades = tissue.blades(RIGHT)
            if tubes := blades.tubes(tissue.beam):
                self._why = TUBE_BETWEEN.format(tube_title(tissue.tubes.names[tubes[0].tube]))
            elif not blades.strands(tissue.beam, tissue.rods_of(RIGHT))[self.strands].any():
                self._why = NOTHING_BETWEEN

    def next_step(self) -> NextStep:
        """Return what is to be done next."""
        site, tool, hand = self.site, self.site.tool, self._hand
        names, ends = self._tissue.tubes.names, self._tissue.tubes.strands
        numbers: list[int] = [int(ends.tubes[site.anchor]), int(ends.to[site.anchor])]
        titles = [tube_title(names[each]) for each in numbers if each >= 0]
        if self._state == "sweeping" and site.through is not None:
            return self._into_ring(SWEEP.format(tool, *titles), self._place + site.through)
        if self._state == "closed":
            return self._into_ring(BACK_ALONG.format(tool), self._back)
        if self.begun:
            if self._state == "to withdraw":
                return self._drawn_out()
            if self._state == "closing" and self._taut:
                # Jaws that close on a wall close once they are drawn off it.
                return self.withdrawn()
            if self._state == "pinched":
                return self._step(PINCHED.format(tool, tube_title(self._wall)))
            if self._state == "to leave":
                return self._into_ring(
                    LEAVE.format(f"open {tool}", tube_title(self._wall)), self._left
                )
            moves = {"opening": OPENS, "closing": CLOSES}
            words = moves.get(self._state, CLOSE_FEW if self.fruitless else CLOSE)
            return self._step(words.format(tool))
        if self._why:
            return self._step(OUT_AS.format(tool, self._why))
        if self.strained_often:
            return self._drawn_out()
        if hand is not None and hand.opening and tool != "scissors":
            return self._step(CLOSE.format(tool))  # open elsewhere, they strain what they pass
        beside = self._state == "beside"
        place = self._place if beside else self._beside
        there = hand is not None and math.dist(hand.place, place) < IN_RING_MM
        if there and site.through is None:
            there_words = CUT if tool == "scissors" else OPEN
            words = (there_words if self._is_at(place) else TURN).format(tool)
        elif beside:
            passes = BETWEEN_BLADES if tool == "scissors" else PASS[site.where]
            words = passes.format(tool, *titles)
        else:
            words = PART[site.where].format(*titles, tool)
        step = self._step(words, place, through=beside, leads=not there)
        return step if site.through is not None else step._replace(along=three(site.along))

    def _drawn_out(self) -> NextStep:
        """Return that the jaws are drawn out of the tissue."""
        shaft = TROCARS[RIGHT].shaft(self._back)
        # Who is in that ring is out of the tissue.
        place = self._back + (OUT_MM + IN_RING_MM) * shaft
        return self._step(BACK.format(self.site.tool), place)

    def withdrawn(self) -> NextStep:
        """Return that the jaws strain a wall, and where they go then."""
        wall = self._tissue.most_stressed
        tool: Instrument = self._tissue.hands[RIGHT].instrument
        title, comes = tube_title(wall), self._state == "to come"
        if tool != "right angle":
            self._stuck += self.begun
            return self._step(WITHDRAW.format(tool, title))._replace(tool=tool)
        # A bent tip that has passed behind something goes back along itself, past what lies in
        # front of it still.
        if self._state == "to withdraw":
            self._state, self._clear = "closed", self._clear_of(wall)
        if self._stuck % LEAVES_FOR == LEAVES_FOR - 1:
            self._leave()
        self._stuck += 1
        if self._stuck >= LEAVES_FOR:
            return self._into_ring(LEAVE.format(tool, title), self._left)._replace(tool=tool)
        if comes:
            return self._step(WITHDRAW.format(tool, title))._replace(tool=tool)
        return self._into_ring(WITHDRAW_ALONG.format(tool, title), self._back)

    def _leave(self) -> None:
        """Choose where jaws are off all walls, in a direction in which they were not led yet."""
        hand = self._tissue.hands[RIGHT]
        shaft, aim = TROCARS[RIGHT].shaft(hand.place), np.array(hand.aim)
        best: list[tuple[float, Floats]] = []
        for side in (shaft, -shaft, aim, -aim):
            ways = [far * side for far in LEAVES_MM]
            worths = [self._room(hand.place + each) - COSTS * math.hypot(*each) for each in ways]
            worth = max(worths)
            best.append((worth, ways[worths.index(worth)]))
        if len(self._led_off) == DIRECTIONS:
            self._led_off.clear()
        number = max(
            (n for n in range(len(best)) if n not in self._led_off), key=lambda n: best[n][0]
        )
        self._led_off.append(number)
        self._left, self._led_from = hand.place + best[number][1], hand.target.copy()

    def _between(self) -> str | None:
        """Return which tube runs through between the jaws, if one does."""
        hand, beam = self._tissue.hands[RIGHT], self._tissue.beam
        aim, spread = np.array(hand.aim), np.array(hand.spread)
        across = np.cross(aim, spread)
        for name, tube in self._tissue.tubes.network.tubes.items():
            off = beam.places_at(np.arange(0.0, tube.span, 0.5), name) - hand.place
            side = off @ across
            through = np.flatnonzero(side[:-1] * side[1:] <= 0.0)
            along, aside = off[through] @ aim, np.abs(off[through] @ spread)
            if ((along > 0.0) & (along < JAW_MM) & (aside < 0.5 * hand.opening)).any():
                return name
        return None

    def _room(self, place: Floats) -> float:
        """Return how far jaws at a place would be off the walls, mm, summed over the tubes."""
        hand, beam = self._tissue.hands[RIGHT], self._tissue.beam
        half = 0.5 * hand.opening
        sides = (np.array(hand.aim), 0.0, JAW_MM), (np.array(hand.spread), -half, half)
        gaps = (wall_gap(beam, name, place, *sides) for name in self._tissue.tubes.names)
        return sum(min(each, NEEDS_MM) for each in gaps)

    def _clear_of(self, wall: str) -> Floats:
        """(3,) mm where the tip is led to be clear of a wall that lies across it."""
        hand, beam = self._tissue.hands[RIGHT], self._tissue.beam
        tube, aim = self._tissue.tubes.network.tubes[wall], np.array(hand.aim)
        off = beam.places_at(np.arange(0.0, tube.span, 0.5), wall) - hand.place
        along = np.clip(off @ aim, 0.0, JAW_MM)
        nearest = ((off - along[:, None] * aim) ** 2).sum(axis=1).argmin()
        back = float(along[nearest] + tube.radius.max()) + CLEAR_MM
        return hand.place - DEEPER_MM * TROCARS[RIGHT].shaft(hand.place) + back * aim

    def _into_ring(self, words: str, place: Floats) -> NextStep:
        """Return that a tip in the tissue is led through it into the ring."""
        return self._step(words, place, through=True, leads=True)

    def _step(
        self, words: str, place: Floats | None = None, *, through: bool = False, leads: bool = False
    ) -> NextStep:
        at = None if place is None else three(place)
        return NextStep(
            words,
            self.strands,
            place=at,
            hand=RIGHT,
            tool=self.site.tool,
            through=through,
            leads=leads,
        )

    @property
    def _taut(self) -> bool:
        """Whether a wall is too taut for jaws to be led on."""
        return self._tissue.stress_ratio > self.strain.taut

    @property
    def _place(self) -> Floats:
        """(3,) mm where the jaws open."""
        return self._places.place_of(self.site)

    @property
    def _beside(self) -> Floats:
        """(3,) mm where they come from: that place itself, but for a bent tip."""
        return self._place if self.site.beside is None else self._place + self.site.beside

    @property
    def _back(self) -> Floats:
        """(3,) mm where a bent tip goes back to before it is drawn out."""
        return self._beside if self._clear is None else self._clear

    @property
    def _hand(self) -> Hand | None:
        """The right hand, if it has what parts the tissue here."""
        hand = self._tissue.hands[RIGHT]
        return hand if hand.instrument == self.site.tool else None

    def _is_at(self, place: Floats) -> bool:
        """Return whether the right hand's tip is in a ring, turned along its bar."""
        hand = self._tissue.hands[RIGHT]
        # What has gone in among tubes was turned before, and may not turn there.
        turn = None if self._state == "beside" else turn_off(RIGHT, hand, self.site.along)
        there = math.dist(hand.place, place) < IN_RING_MM
        return there and (turn is None or abs(turn) < TURNED)


def turn_off(number: int, hand: Hand, along: Floats) -> float | None:
    """Return by which angle a hand's jaws are to be turned about their shaft, rad.

    Parameters
    ----------
    number, hand
        The hand, whose trocar the shaft goes through.
    along
        (3,) direction in which jaws are to part, or from a bent tip's end back.

    Returns
    -------
    float or None
        From -pi/2 to pi/2, as jaws part either way; of a bent tip from -pi to pi. None where the
        shaft lies along the direction.
    """
    shaft, bent = TROCARS[number].shaft(hand.place), hand.instrument == "right angle"
    now = np.array(hand.aim if bent else hand.spread)
    across = along - float(along @ shaft) * shaft  # jaws part across their shaft
    if float(across @ across) < LEAST_ACROSS**2:
        return None
    angle = math.atan2(float(shaft @ np.cross(now, across)), float(now @ across))
    return angle if bent else math.remainder(angle, math.pi)


def three(values: Floats) -> Three:
    """Return three numbers of an array."""
    x, y, z = values.tolist()
    return x, y, z
