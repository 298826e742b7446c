"""What an exercise at an anatomy asks the hands for next, and where, as a page shows it."""

import math
from typing import cast

import numpy as np
from numpy.typing import NDArray

from app.simulation import (
    COMES_OPEN,
    IN_RING_MM,
    TROCARS,
    Guidance,
    Instrument,
    NextStep,
    Safety,
    Structure,
    turn_off,
)
from app.trainer.client.page_state import PageState

Floats = NDArray[np.float64]

JUDGED_TICKS, USED_TICKS = 15, 4
"""Ticks after which what comes next is judged anew, and after an instrument was used: then it has
begun to move."""
PARTS: frozenset[Instrument] = frozenset({"dissector", "right angle"})
"""Instruments whose jaws part tissue."""


class AskedStep:
    """What is asked for next: of which hand, with what, and where."""

    def __init__(self, state: PageState) -> None:
        self._state = state
        # What is asked for next, and of which run and tissue.
        self._guidance, self._guided = cast(Guidance, None), cast(object, None)
        self._judged: object = None  # of what `_next` was found
        self._judge_at = 0  # the tick in which it is found anew
        self._next = self._marked = cast(NextStep | None, None)
        self._to_part: tuple[int, ...] = ()  # of what is `_marked`

    @property
    def structures(self) -> tuple[Structure, ...]:
        """What an exercise that goes on asks to be pointed at, as far as it has come."""
        run = self._state.session.run
        exercise = None if run.over or self._state.playback is not None else run.exercise
        if exercise is None or run.progress < exercise.points_from:
            return ()
        return exercise.structures

    @property
    def step(self) -> NextStep | None:
        """What is to be done next, while that is shown."""
        state, run = self._state, self._state.session.run
        exercise, tissue = run.exercise, state.session.spatial
        shown = state.marks_next and state.figures_visible and state.playback is None
        if exercise is None or exercise.looks_only or run.over or not shown:
            return None
        if self._guided != (run, tissue):
            self._guided, self._guidance = (run, tissue), Guidance(Safety(tissue))
        # What is asked for does not change with each strand that parts.
        now = exercise, tissue.beam, len(tissue.events), len(tissue.marks), self.structures
        due = not 0 < self._judge_at - tissue.ticks <= JUDGED_TICKS
        if due or now != self._judged:
            self._judged, self._judge_at = now, tissue.ticks + JUDGED_TICKS
            self._next = self._guidance.next_step(exercise, viewed=bool(self.structures))
        return self._next

    def judge_soon(self) -> None:
        """Judge anew what is to be done as soon as what was done now has begun to show."""
        self._judge_at = min(self._judge_at, self._state.session.spatial.ticks + USED_TICKS)

    def note_blocked(self) -> None:
        """Note that the active hand's tip could not come to where it is asked to be led."""
        if self.own_step is not None:
            self._guidance.note_blocked()

    @property
    def own_step(self) -> NextStep | None:
        """What the active hand is to do next; None where it is to do nothing."""
        step = self.step
        return step if step is not None and step.hand == self._state.hand else None

    @property
    def tool(self) -> Instrument | None:
        """What the active hand is to take; None where it has that already."""
        asked = None if (step := self.own_step) is None else step.tool
        return None if asked == self._state.instrument else asked

    @property
    def place(self) -> Floats | None:
        """(3,) mm where to the active hand's tip is to be led; None nowhere."""
        step = self.own_step
        return None if step is None or step.place is None else np.array(step.place)

    @property
    def to_part(self) -> tuple[int, ...]:
        """The strands, as the page numbers them, that the next step is about."""
        step = self.step
        if step is not self._marked:
            wanted = () if step is None else step.strands
            order = self._state.session.spatial.beam.order
            numbers = np.flatnonzero(np.isin(order, wanted)).tolist()
            self._marked, self._to_part = step, tuple(numbers)
        return self._to_part

    @property
    def ring(self) -> tuple[float, ...] | None:
        """Where the next step is done: mm, two directions and the hand, (10,); None nowhere.

        Jaws part along the first direction, the wheel leads there along the second. Each is zero
        where there is none: a hand that holds is not led along its shaft.
        """
        step = self.step
        if step is None or step.place is None:
            return None
        along = (0.0, 0.0, 0.0) if step.along is None else step.along
        shaft = np.zeros(3)
        if step.hand is not None and self._state.hands[step.hand].node is None:
            shaft = TROCARS[step.hand].shaft(np.array(step.place))
        numbers = *step.place, *along, *shaft.tolist(), float(step.hand or 0)
        return tuple(round(each, 3) for each in numbers)

    @property
    def in_ring(self) -> bool:
        """Whether the active hand's tip is in the ring."""
        ring, tip = self.place, self._state.hands[self._state.hand].tip
        return ring is not None and math.dist(ring, tip) < IN_RING_MM

    @property
    def turn(self) -> float | None:
        """Angle by which the active hand's jaws are to be turned to the ring's bar, rad.

        0 of a shaft along the bar, whose jaws need no turn; None where no direction is asked for.
        """
        step, state = self.own_step, self._state
        jawed = state.instrument in PARTS or state.instrument in COMES_OPEN
        if step is None or step.along is None or not jawed:
            return None
        return turn_off(state.hand, state.hands[state.hand], np.array(step.along)) or 0.0
