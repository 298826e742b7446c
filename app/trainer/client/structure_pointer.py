"""At an anatomy mouse and keys point at structures, and tell which they are."""

import math

import numpy as np
from numpy.typing import NDArray

from app.simulation import FIELD_OF_VIEW, Structure, pointed_at
from app.trainer.client.asked_step import AskedStep
from app.trainer.client.page_state import PageState
from app.trainer.scope.held_scope import HeldScope

Floats = NDArray[np.float64]

NOTHING_THERE = "No tube is seen there. Point at the wall of one."
NOT_ASKED = (
    "Structures are marked in the exercise Critical view, once its points are reached, and in Who "
    "is who."
)
CROSS_STEP, CROSS_AT_MOST = 0.06, 0.95
"""Of the picture's radius, that a key moves the cross by, and how far off its middle it goes."""


class StructurePointer:
    """What the pointer marks, while it leads no hand."""

    def __init__(self, state: PageState, held: HeldScope, asked: AskedStep) -> None:
        self._state, self._held, self._asked = state, held, asked
        self._chosen: Structure | None = None
        self._cross = 0.0, 0.0

    @property
    def structure(self) -> Structure | None:
        """The structure that is marked now; None while the pointer leads hands."""
        return self._chosen if self._chosen in self._asked.structures else None

    @property
    def cross(self) -> tuple[float, float] | None:
        """Where keys point, right and up in the picture, whose radius is 1; None if they do not."""
        return None if self.structure is None else self._cross

    def move_cross(self, right: float, up: float) -> None:
        """Move the cross by so many steps."""
        x, y = self._cross
        x, y = (
            min(max(each, -CROSS_AT_MOST), CROSS_AT_MOST)
            for each in (x + CROSS_STEP * right, y + CROSS_STEP * up)
        )
        self._cross = x, y
        self._state.show()

    def leave(self) -> None:
        """Let the pointer lead hands again."""
        self._chosen = None

    def choose(self, structure: Structure | None) -> None:
        """Let the pointer mark a structure from now on, or lead hands again."""
        self._chosen = structure
        self._state.show()

    def choose_next(self) -> None:
        """Let the pointer mark the next structure, and after the last one lead hands again."""
        asked: list[Structure | None] = [None, *self._asked.structures]
        if len(asked) == 1:
            self._state.refuse(NOT_ASKED)
            return
        self.choose(asked[(asked.index(self.structure) + 1) % len(asked)])

    def mark_at_cross(self) -> None:
        """Take what the cross points at for the structure."""
        (x, y), wide = self._cross, math.tan(0.5 * FIELD_OF_VIEW)
        self.mark(self._held.camera.axes @ np.array([wide * x, wide * y, -1.0]))

    def mark(self, direction: Floats) -> None:
        """Take the tube that is seen first along a direction, (3,), for the structure."""
        structure, state = self.structure, self._state
        if structure is None or not state.may_act(state.hand):
            return
        tissue = state.session.spatial
        found = pointed_at(tissue.beam, self._held.camera.tip, direction)
        if found is None:
            state.refuse(NOTHING_THERE)
            return
        tube, at = found
        state.session.mark(structure, tube, at / tissue.tubes.surfaces[tube].scale)
        exercise, marked = state.session.run.exercise, {each.structure for each in tissue.marks}
        # Where hands have something to do as well, the pointer leads them again.
        asked = self._asked.structures if exercise is not None and exercise.looks_only else ()
        self.choose(next((each for each in asked if each not in marked), None))

    def call_unsafe(self) -> None:
        """Say that it is not yet safe to tell."""
        if self._asked.structures and self._state.may_act(self._state.hand):
            self._state.session.call_unsafe()
