"""What an exercise at an anatomy asks for next, and where (docs/scope.md).

A step goes on until it is done: the gallbladder is taken hold of and drawn, or jaws are brought to
a place, opened, closed and withdrawn. Only what strains a wall comes before it.
"""

import math
from collections import Counter
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.anatomy import tube_title
from app.simulation.exercises.critical_view import SOME, CriticalView, Part
from app.simulation.exercises.exercise import Exercise
from app.simulation.exercises.goals import CriticalView as Goal
from app.simulation.exercises.goals import StopBleeding
from app.simulation.exercises.next_step import (
    BACK,
    DRAW_ASIDE,
    DRAW_DOWN,
    DRAW_OFF,
    ELSEWHERE,
    FIRM,
    GENTLE,
    LET_BACK,
    LET_GO,
    NO_STRANDS,
    PULLS,
    SLACKEN,
    STAYS_TAUT,
    TAKE_HOLD,
    TO_RING,
    WITHDRAW,
    NextStep,
    Strain,
    Three,
)
from app.simulation.inputs.inputs import HOLDING
from app.simulation.inputs.trocar import TROCARS
from app.simulation.tissue.clip_steps import ClipSteps, ClosingSteps
from app.simulation.tissue.instruments import COMES_OPEN
from app.simulation.tissue.jaw_steps import (
    IN_RING_MM,
    MOST_STUCK,
    RIGHT,
    JawSteps,
    three,
)
from app.simulation.tissue.parting import PartingPlaces, Site
from app.simulation.tissue.safety import Safety

Floats = NDArray[np.float64]

SLACK_MM, NECK_MM, BODY_MM = 4.0, 8.0, (20.0, 16.0, 24.0)
"""mm from the gallbladder's neck, where it is held to be drawn towards the common duct, where for
jaws to close on a tube, and where to be drawn off the liver, one after the other."""
STAGES, STAGE_MM = 3, 3.0
"""In which it is drawn, and mm of each."""
MOST_TRIES = 3
"""Places that jaws have been at, after which the gallbladder is drawn otherwise."""
MOST_FAILED = 2
"""How often few strands may part for one part of the view until another is asked for."""
BACK_MM = 6.0
"""mm off where it was taken hold of, to which the gallbladder is let back once `SOME` of its plate
has parted: as the rest gives way, artery and duct take the pull over."""
FIRMER_AFTER = 2
"""How often little parts, one time after the other, until walls may be strained more."""
EASES_MM = 3.0
"""By which what is held is let back at a time."""
IS_BACK_MM, NEARLY_TORN = 1.0, 0.85
"""mm off where it was taken hold of, within which what is held has been let back; and of a wall's
break, from which on it is let go instead: let back, it may bend, and that strains a wall more."""
GIVES_WAY = 15
"""Strands that part, from which on it is drawn no further: more may part at once, and a vessel take
the pull over."""
PUSHES_N = 0.1
"""Force from which on a hand can be what strains a wall."""
MOVED_MM = 0.05
"""Between two judgements, from which on a hand has moved."""
LONGEST = 20
"""Judgements for which one hand is asked to slacken a wall until the other is: some 10 s."""
OUT_FIRST_MM = 12.0
"""By which the right hand is drawn out before the gallbladder draws tubes apart."""
MOST_IN_VAIN = 4
"""How often jaws may come to close on a tube and cannot, until what is held is let go."""
LEFT = 0
"""Number of the hand that holds."""


class _Pull(NamedTuple):
    """What the gallbladder is taken hold of for."""

    words: str
    direction: Three  # in the anatomy's frame: along the common duct, to the right, to the front
    gripped: float  # of the pull at which tissue slips out of a grasper, at which it ends


OFF_THE_LIVER = _Pull(DRAW_OFF, (-0.89, 0.32, -0.33), 0.35)
TO_COMMON = _Pull(DRAW_DOWN, (-0.71, -0.64, 0.3), 0.85)
ASIDE = _Pull(DRAW_ASIDE, (0.1, 0.74, 0.67), 0.85)
FOR_CLOSING = (ASIDE, OFF_THE_LIVER, TO_COMMON)
"""One after the other, where jaws that are to close on a tube cannot: it draws tubes apart."""


@dataclass(slots=True)
class _Pulling:
    """A pull that is asked for, and how far it has come."""

    pull: _Pull
    station: float
    start: Floats | None = None  # (3,) mm, where what is held was then; None until it is held
    broken: int = 0  # strands, that had parted then
    stage: int = 0
    drawn: bool = False


class Guidance:
    """What is asked for next of a tissue: by what of its critical view is lacking, or bleeds."""

    def __init__(self, safety: Safety) -> None:
        self._safety, self._places = safety, PartingPlaces(safety)
        self.tissue = safety.tissue
        """What is judged."""

        self._clips, self._closing = ClipSteps(self.tissue), ClosingSteps(safety)
        self._part: Part | None = None
        self._pulling: _Pulling | None = None
        self._jaws: JawSteps | None = None
        self._held_for: _Pull | None = None  # what it was drawn for by the hold that goes on
        self._held_from: Floats | None = None  # (3,) mm, where it was as that began
        self._draws = 0  # off the liver
        self._tries = 0  # places that were tried since it was drawn or let go
        self._failed = Counter[Part]()  # how often little has parted, one time after the other
        self._in_vain = 0  # how much more often than not, at least 0, of all parts
        self._viewed = False  # whether what follows closes
        self._closes_held = False  # whether jaws have come in vain while the gallbladder is held
        self._out: Floats | None = None  # (3,) mm, where to the right hand goes before that
        self._drawn = 0  # how often the gallbladder has been drawn for them
        self._strains: int | None = None  # the hand that strains a wall
        self._presses = False  # whether the right hand presses on a wall as it closes on a tube
        self._taut = 0  # judgements in a row at which a wall was taut meanwhile
        self._asked = 0  # judgements for which it has been asked to slacken that
        self._places_then = self._hand_places  # at the last judgement
        self._mover = LEFT  # the hand that moved last

    def next_step(self, exercise: Exercise, *, viewed: bool) -> NextStep | None:
        """Return what an exercise asks for next, once `viewed` what closes; None if nothing."""
        # What hands do is followed from call to call, some twice a second.
        self._viewed = viewed
        step = self._to_do(exercise)
        return None if step is None else step._replace(strain=self._strain)

    @property
    def _strain(self) -> Strain:
        """How far walls may be strained now."""
        if self._jaws is not None and (self._jaws.begun or not self._viewed):
            return self._jaws.strain
        # Strands of the plate give way at once, and an artery takes over what they held.
        firmer = self._in_vain >= FIRMER_AFTER and self._part != "plate"
        return FIRM if self._viewed or firmer else GENTLE

    def _to_do(self, exercise: Exercise) -> NextStep | None:
        goal = exercise.goal
        if isinstance(goal, StopBleeding):
            return self._clips.next_step()
        if not isinstance(goal, Goal):
            return None
        view = self._safety.critical_view()
        if self._viewed:
            return (
                self._jaws_out()
                or self._pressed()
                or self._drawn_apart()
                or self._closing.next_step(goal.stay, goal.go)
            )
        parts = view.next_parts(goal.points)
        if not parts:
            return None
        self._follow()
        # Where little parts, another part of the view is asked for, and that one again later.
        part = min(parts, key=lambda each: self._failed[each] // MOST_FAILED)
        if part != self._part:
            self._part = part
            # Jaws that are open are closed first.
            if self._jaws is not None and not self._jaws.begun:
                self._jaws = None
        self._find_place(part)
        strained = self._strained()
        if strained is not None:
            return strained
        while (jaws := self._find_place(part)) is not None:
            bent = jaws.site.beside is not None
            if bent and not jaws.begun and self._holder is not None:
                self._pulling = None
                return self._let_go(PULLS.format(jaws.site.tool))
            if self._pulling is None and not bent and not jaws.begun:
                self._pulling = self._pull_for(jaws.site)
            if (let_go := self._let_go_where(jaws.stays_strained)) is not None:
                return let_go
            if self._pulling is None or bent:
                return self._let_back(view) or jaws.next_step()
            step = self._pull_step(self._pulling)
            if step is not None:
                return step
        return None

    def _find_place(self, part: Part) -> JawSteps | None:
        """Return how far jaws have come at a place, which is found if there is none; or None."""
        if self._jaws is None and (site := self._places.best(part)) is not None:
            self._jaws = JawSteps(self.tissue, self._places, site, self._strain)
        return self._jaws

    def note_blocked(self) -> None:
        """Note that the right hand's tip could not come to where it is asked to be led."""
        if self._jaws is not None and (self._jaws.begun or not self._viewed):
            self._jaws.note_blocked()
        elif self._viewed:
            self._closing.hindered += 1

    def _jaws_out(self) -> NextStep | None:
        """Return how jaws are closed and drawn out that have opened; None if there are none."""
        self._follow()
        if self._jaws is None or not self._jaws.begun:
            return None
        let_go = self._let_go_where(self._jaws.stays_strained)
        return self._strained() or let_go or self._jaws.next_step()

    def _pressed(self) -> NextStep | None:
        """Return how a wall is slackened as jaws come to close on a tube; None if none is taut."""
        tissue, before = self.tissue, self._presses
        pushes = math.hypot(*tissue.forces[RIGHT]) >= PUSHES_N
        self._presses = tissue.stress_ratio >= FIRM.taut and pushes
        self._closing.hindered += self._presses and not before
        self._taut = (
            self._taut + 1 if tissue.stress_ratio >= (FIRM.taut if pushes else FIRM.stops_at) else 0
        )
        in_vain = self._closing.in_vain > MOST_IN_VAIN
        stuck = self._taut > (MOST_STUCK if pushes else 0) or in_vain
        self._closes_held |= in_vain and self._holder is not None
        withdrawn = self._withdrawn(RIGHT) if self._presses else None
        return self._let_go_where(stuck) or withdrawn

    def _drawn_apart(self) -> NextStep | None:
        """Return how the gallbladder is drawn where nothing can close as tubes lie now; or None."""
        hand = self.tissue.hands[RIGHT]
        if self._closing.in_vain > MOST_IN_VAIN and self._holder is None:
            if self._drawn or not self._closes_held:
                self._pulling = _Pulling(FOR_CLOSING[self._drawn % len(FOR_CLOSING)], NECK_MM)
                self._drawn += 1
                self._out = hand.place + OUT_FIRST_MM * TROCARS[RIGHT].shaft(hand.place)
            self._closes_held = False
            self._closing.begin_anew()
        if self._out is not None and math.dist(hand.place, self._out) > IN_RING_MM:
            tool = hand.instrument
            return NextStep(BACK.format(tool), place=three(self._out), hand=RIGHT, tool=tool)
        self._out = None
        return None if self._pulling is None else self._pull_step(self._pulling)

    def _withdrawn(self, hand: int) -> NextStep:
        """Return that what a hand holds is drawn back a little from the wall that it strains."""
        wall = tube_title(self.tissue.most_stressed)
        words = WITHDRAW.format(self.tissue.hands[hand].instrument, wall)
        return NextStep(words, self._strands, hand=RIGHT)

    def _follow(self) -> None:
        """Note what hands have done, and what is asked for no more."""
        if self._holder is None:
            self._held_for = self._held_from = None
        jaws = self._jaws
        if jaws is None:
            return
        jaws.follow()
        # What strains a wall is drawn back by the same steps, however far off its place it is.
        if jaws.is_over and self.tissue.stress_ratio < jaws.strain.taut:
            self._jaws = None
            if jaws.tried and self._part is not None:
                self._places.note_tried(jaws.site, fruitless=jaws.fruitless)
                self._tries += 1
                self._failed[self._part] = self._failed[self._part] + 1 if jaws.fruitless else 0
                self._in_vain = max(0, self._in_vain + (1 if jaws.fruitless else -1))

    # The gallbladder

    @property
    def _holder(self) -> int | None:
        """Number of the hand that holds the gallbladder; None if none does."""
        number = self.tissue.tubes.names.index(self._safety.gallbladder)
        hands = enumerate(self.tissue.hands)
        return next((i for i, each in hands if each.node is not None and each.tube == number), None)

    @property
    def _held(self) -> Floats | None:
        """(3,) mm where the tip is that holds the gallbladder; None if none does."""
        holder = self._holder
        if holder is None:
            return None
        return self.tissue.hands[holder].tip

    def _let_go(self, why: str) -> NextStep:
        """Return that the gallbladder is let go."""
        words = LET_GO.format(tube_title(self._safety.gallbladder), why)
        return NextStep(words, self._strands, hand=LEFT)

    def _let_go_where(self, stays_strained: bool) -> NextStep | None:
        """Return that it is let go, if it is held, where a wall stays strained; else None."""
        if not stays_strained or self._holder is None:
            return None
        return self._let_go(STAYS_TAUT.format(tube_title(self.tissue.most_stressed)))

    def _pull_for(self, site: Site) -> _Pulling | None:
        """Return how the gallbladder is to be drawn before jaws part at a place, if it is."""
        # What runs into the neck is slack then, and jaws open wide between.
        pull = OFF_THE_LIVER if site.where == "plate" else TO_COMMON
        if self._held_for is pull and self._tries < MOST_TRIES:
            return None
        if pull is TO_COMMON:
            return _Pulling(pull, SLACK_MM)
        self._draws += 1
        return _Pulling(pull, BODY_MM[(self._draws - 1) % len(BODY_MM)])

    def _pull_step(self, pulling: _Pulling) -> NextStep | None:
        """Return what a pull asks for; None once it is over."""
        pull, held, name = pulling.pull, self._held, tube_title(self._safety.gallbladder)
        strands = self._strands
        if held is None:
            pulling.start = None
            place = self._wall_at(pulling.station)
            return NextStep(TAKE_HOLD.format(name), strands, place=place, hand=LEFT)
        if pulling.start is None:
            if self._held_for is not None:  # it is held elsewhere
                return self._let_go(ELSEWHERE)
            pulling.start = self._held_from = held
            pulling.broken = self.tissue.beam.broken
        # What can be pulled no harder has been drawn.
        pulling.drawn |= self.tissue.grip_ratio(self._holder or 0) > pull.gripped
        pulling.drawn |= self.tissue.beam.broken - pulling.broken > GIVES_WAY
        # Drawn further, what holds is let back again before jaws come.
        pulling.drawn |= self.tissue.stress_ratio > self._strain.eased
        while pulling.stage < STAGES:
            # By stages, so that whoever goes aside first and then deeper keeps near the line.
            far = STAGE_MM * (pulling.stage + 1)
            place = pulling.start + far * np.array(pull.direction)
            if not pulling.drawn and math.dist(held, place) > IN_RING_MM:
                words = pull.words.format(name, pulling.stage + 1, STAGES)
                return NextStep(words, strands, place=three(place), hand=LEFT, leads=True)
            pulling.stage += 1
        return self._end_pull()

    def _let_back(self, view: CriticalView) -> NextStep | None:
        """Return how far the gallbladder is let back before its plate gives way, if it is."""
        held, back = self._held, self._held_from
        begun = self._jaws is not None and self._jaws.begun
        if begun or self._held_for is not OFF_THE_LIVER or view.plate < SOME:
            return None
        if held is None or back is None or math.dist(held, back) < BACK_MM + IN_RING_MM:
            return None
        place = back + BACK_MM / math.dist(held, back) * (held - back)
        words = LET_BACK.format(tube_title(self._safety.gallbladder))
        return NextStep(words, self._strands, place=three(place), hand=LEFT, leads=True)

    def _end_pull(self) -> None:
        if self._pulling is not None:
            self._held_for, self._pulling, self._tries = self._pulling.pull, None, 0
        # What was drawn lies otherwise now: where jaws part, and along what, is found anew.
        if self._jaws is not None and not self._jaws.begun:
            self._jaws = None

    def _strained(self) -> NextStep | None:
        """Return how a wall is slackened that is too taut for jaws to have room, if one is."""
        # The hand that strains it is the one that moved last.
        now = self._hand_places
        moved, self._places_then = ((now - self._places_then) ** 2).sum(axis=1), now
        if moved.max() > MOVED_MM**2:
            self._mover = int(moved.argmax())
        pushes = (np.array(self.tissue.forces) ** 2).sum(axis=1) > PUSHES_N**2
        ratio, hands, strain = self.tissue.stress_ratio, self.tissue.hands, self._strain
        opened = any(each.opening for each in hands if each.instrument not in COMES_OPEN)
        # From where it is too taut to where it no longer is, it goes on being slackened, unless it
        # is strained with no hand pulling. Jaws come to what is slack: a press adds to a pull.
        pulled = self._pulling is None and pushes[LEFT] and not pushes[RIGHT]
        slack = strain.taut if self._strains is None and not pulled else strain.eased
        if opened or ratio < slack or not pushes.any():
            self._strains = None
            return None
        if self._strains is not None and pushes.all() and self._asked > LONGEST:
            self._mover, self._strains = 1 - self._strains, None
        self._asked += 1
        if self._strains is None or not pushes[self._strains]:
            self._strains, self._asked = self._mover if pushes[self._mover] else int(pushes[1]), 0
            pulling = self._pulling
            # What is strained has been drawn.
            if pulling is not None and pulling.start is not None:
                pulling.drawn = True
            elif self._jaws is not None:
                self._jaws.strained += 1
        hand, wall = self.tissue.hands[self._strains], tube_title(self.tissue.most_stressed)
        if hand.instrument not in HOLDING:
            if self._jaws is not None:
                return self._jaws.withdrawn()
            return self._withdrawn(self._strains)
        if hand.node is None:
            return None
        held = tube_title(self.tissue.tubes.names[hand.tube])
        # What is taut again and again is not held while the other hand withdraws.
        often = self._jaws is not None and self._jaws.strained_often
        back = self._held_from
        is_back = back is not None and math.dist(back, hand.tip) < IS_BACK_MM
        if often or is_back or ratio > NEARLY_TORN:
            return NextStep(LET_GO.format(held, STAYS_TAUT.format(wall)), self._strands, hand=LEFT)
        words = SLACKEN.format(held, "" if back is None else TO_RING, 100.0 * strain.eased, wall)
        place = None
        if back is not None:  # a little at a time: what is let back all the way leaves no room
            path = back - hand.tip
            place = three(hand.tip + path * min(1.0, EASES_MM / max(math.hypot(*path), 1e-9)))
        return NextStep(words, self._strands, place=place, hand=LEFT)

    @property
    def _hand_places(self) -> Floats:
        """(2, 3) mm where the hands are."""
        return np.array([each.place for each in self.tissue.hands])

    def _wall_at(self, station: float) -> Three:
        """Return where the gallbladder's wall is, to the front, so far from its neck, mm."""
        name = self._safety.gallbladder
        tube = self.tissue.tubes.network.tubes[name]
        x, y, z = three(self.tissue.beam.places_at(np.array([station]), name)[0])
        return x, y, z + float(np.interp(station, tube.stations, tube.radius))

    @property
    def _strands(self) -> NDArray[np.int64]:
        """The strands that are asked for, or none yet."""
        return NO_STRANDS if self._jaws is None else self._jaws.strands
