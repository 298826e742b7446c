"""What an exercise at an anatomy asks for next, and where (docs/scope.md).

A step goes on until it is done: the gallbladder is taken hold of and drawn, or jaws are brought to
a place, opened, closed and withdrawn. Only what strains a wall comes before it.
"""

from collections import Counter

import numpy as np
from numpy.typing import NDArray

from app.anatomy import tube_title
from app.simulation.exercises.critical_view import Part
from app.simulation.exercises.exercise import Exercise
from app.simulation.exercises.goals import CriticalView as Goal
from app.simulation.exercises.goals import StopBleeding
from app.simulation.exercises.next_step import (
    FIRM,
    GENTLE,
    NO_STRANDS,
    PULLS,
    STAYS_TAUT,
    WITHDRAW,
    NextStep,
    Strain,
)
from app.simulation.inputs.inputs import HOLDING
from app.simulation.tissue.clip_steps import ClipSteps, ClosingSteps
from app.simulation.tissue.hold_steps import LEFT, HoldSteps
from app.simulation.tissue.instruments import COMES_OPEN
from app.simulation.tissue.jaw_steps import PUSHES_N, RIGHT, JawSteps
from app.simulation.tissue.parting import PartingPlaces
from app.simulation.tissue.safety import Safety

Floats = NDArray[np.float64]

MOST_FAILED = 2
"""Failed attempts at one part of the view before another part is asked for."""
FIRMER_AFTER = 2
"""Failed attempts in a row before walls may be strained more."""
MOVED_MM = 0.05
"""A hand that goes farther than this between two judgements has moved, mm."""
LONGEST = 20
"""Judgements after which the other hand is asked to slacken a wall instead: some 10 s."""


class Guidance:
    """What is asked for next of a tissue: by what of its critical view is lacking, or bleeds."""

    def __init__(self, safety: Safety) -> None:
        self._safety, self._places = safety, PartingPlaces(safety)
        self.tissue = safety.tissue
        """What is judged."""

        self._hold = HoldSteps(safety)
        self._clips, self._closing = ClipSteps(self.tissue), ClosingSteps(safety)
        self._jaws: JawSteps | None = None
        self._part: Part | None = None
        self._failed = Counter[Part]()  # how often little has parted, one time after the other
        self._in_vain = 0  # how much more often than not, at least 0, of all parts
        self._viewed = False  # whether what follows closes
        self._freed = False  # whether it was let go for jaws that could not close, and not drawn
        self._strains: int | None = None  # the hand that strains a wall
        self._asked = 0  # judgements for which it has been asked to slacken that
        self._places_then = self._hand_places  # at the last judgement
        self._mover = LEFT  # the hand that moved last

    def next_step(self, exercise: Exercise, *, viewed: bool) -> NextStep | None:
        """Return what an exercise asks for next, once `viewed` what closes; None if nothing."""
        # What hands do is followed from call to call, some twice a second.
        self._viewed = viewed
        step = self._to_do(exercise)
        return None if step is None else step._replace(strain=self._strain, strands=self._strands)

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
        if self._viewed:
            return self._jaws_out() or self._close(goal)
        view = self._safety.critical_view()
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
        hold = self._hold
        while (jaws := self._find_place(part)) is not None:
            bent = jaws.site.beside is not None
            if bent and not jaws.begun and hold.holder is not None:
                hold.end_pull()
                return hold.let_go(PULLS.format(jaws.site.tool))
            if not bent and not jaws.begun:
                hold.pull_for(jaws.site)
            if jaws.stays_strained and hold.holder is not None:
                return self._let_go_taut()
            if bent or not hold.pulls:
                back = None if jaws.begun else hold.let_back(view.plate)
                return back or jaws.next_step()
            if (step := hold.next_step(self._strain.eased)) is not None:
                return step
            # What was drawn lies otherwise now: where jaws part, and along what, is found anew.
            if not jaws.begun:
                self._jaws = None
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
        jaws = self._jaws
        if jaws is None or not jaws.begun:
            self._jaws = None
            return None
        strained = self._strained()
        if strained is None and jaws.stays_strained and self._hold.holder is not None:
            return self._let_go_taut()
        return strained or jaws.next_step()

    def _close(self, goal: Goal) -> NextStep | None:
        """Return what closes next, or how the tubes are to lie first for jaws to have room."""
        hold, closing = self._hold, self._closing
        closing.follow()
        if hold.holder is not None and (closing.stays_strained or closing.cannot_close):
            self._freed |= closing.cannot_close
            return self._let_go_taut()
        if closing.presses:
            return self._withdrawn(RIGHT)
        if closing.cannot_close:
            closing.begin_anew()
            if hold.drawn_apart or not self._freed:
                closing.come_out()
                hold.pull_apart()
            self._freed = False
        drawn = closing.drawn_out() or hold.next_step(self._strain.eased)
        return drawn or closing.next_step(goal.stay, goal.go)

    def _let_go_taut(self) -> NextStep:
        """Return that the gallbladder is let go of, as a wall stays strained."""
        return self._hold.let_go(STAYS_TAUT.format(tube_title(self.tissue.most_stressed)))

    def _withdrawn(self, hand: int) -> NextStep:
        """Return that what a hand holds is drawn back a little from the wall that it strains."""
        wall = tube_title(self.tissue.most_stressed)
        words = WITHDRAW.format(self.tissue.hands[hand].instrument, wall)
        return NextStep(words, hand=RIGHT)

    def _follow(self) -> None:
        """Note what hands have done, and what is asked for no more."""
        self._hold.follow()
        jaws = self._jaws
        if jaws is None:
            return
        jaws.follow()
        # What strains a wall is drawn back by the same steps, however far off its place it is.
        if jaws.is_over and self.tissue.stress_ratio < jaws.strain.taut:
            self._jaws = None
            if jaws.tried and self._part is not None:
                self._places.note_tried(jaws.site, fruitless=jaws.fruitless)
                self._hold.tries += 1
                self._failed[self._part] = self._failed[self._part] + 1 if jaws.fruitless else 0
                self._in_vain = max(0, self._in_vain + (1 if jaws.fruitless else -1))

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
        pulled = not self._hold.pulls and pushes[LEFT] and not pushes[RIGHT]
        slack = strain.taut if self._strains is None and not pulled else strain.eased
        if opened or ratio < slack or not pushes.any():
            self._strains = None
            return None
        if self._strains is not None and pushes.all() and self._asked > LONGEST:
            self._mover, self._strains = 1 - self._strains, None
        self._asked += 1
        if self._strains is None or not pushes[self._strains]:
            self._strains, self._asked = self._mover if pushes[self._mover] else int(pushes[1]), 0
            if not self._hold.note_strained() and self._jaws is not None:
                self._jaws.strained += 1
        hand = hands[self._strains]
        if hand.instrument not in HOLDING:
            if self._jaws is not None:
                return self._jaws.withdrawn()
            return self._withdrawn(self._strains)
        if hand.node is None:
            return None
        often = self._jaws is not None and self._jaws.strained_often
        return self._hold.slackened(hand, strain.eased, often=often)

    @property
    def _hand_places(self) -> Floats:
        """(2, 3) mm where the hands are."""
        return np.array([each.place for each in self.tissue.hands])

    @property
    def _strands(self) -> NDArray[np.int64]:
        """The strands that are asked for, or none yet."""
        return NO_STRANDS if self._jaws is None else self._jaws.strands
