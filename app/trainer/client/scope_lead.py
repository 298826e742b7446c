"""At an anatomy mouse and keys lead a hand through its trocar, or the scope."""

import numpy as np
from numpy.typing import NDArray

from app.simulation import HOLDING, TROCARS
from app.trainer.client.page_state import PageState
from app.trainer.scope.held_scope import HeldScope
from app.trainer.scope.near_place import near_place, wall_offset

__all__ = ["SPREAD", "ScopeLead"]

Floats = NDArray[np.float64]

SPREAD = 8.0
"""mm that jaws part by at once."""
NOTHING_NEAR = "No tube is between the jaws. Bring the tip to one: its shadow shows how near it is."
ENDS = "Jaws do not hold there: a clamp, the other hand or a tear is too near."


class ScopeLead:
    """What mouse and keys lead at an anatomy: the state's active hand, or the scope."""

    def __init__(self, state: PageState, held: HeldScope) -> None:
        self._state, self.held = state, held
        self.leads_scope = False

    @property
    def hand(self) -> int:
        """Number of the active hand."""
        return self._state.hand

    def choose(self, hand: int | None) -> None:
        """Lead a hand from now on, or the scope."""
        self.leads_scope = hand is None
        self._state.choose_hand(self.hand if hand is None else hand)

    def choose_next(self) -> None:
        """Lead the next of both hands and the scope."""
        last = self.hand == len(self._state.hands) - 1
        following = 0 if self.leads_scope else None if last else self.hand + 1
        self.choose(following)

    def lead_hand(self, place: Floats) -> None:
        """Lead the active hand's tip, as it is drawn, to a place, (3,) mm."""
        state = self._state
        if self._may_act():
            offset = wall_offset(state.session.spatial, self.hand)
            state.session.move_hand(self.hand, TROCARS[self.hand].within(place - offset))

    def nudge(self, right: float, up: float, away: float) -> None:
        """Move the active hand's tip in the picture, mm, or turn the scope by as many steps."""
        if self.leads_scope:
            self.move_scope(pan=0.04 * right, tilt=0.04 * up, depth=2.0 * away)
            return
        axes = self.held.camera.axes
        step = axes @ np.array([right, up, -away])
        offset = wall_offset(self._state.session.spatial, self.hand)
        self.lead_hand(self._state.hands[self.hand].target + offset + step)

    def use_instrument(self) -> None:
        """Take hold with a hook or grasper, or let go; part other jaws, or close them."""
        state, hand = self._state, self.hand
        if not self._may_act():
            return
        holder = state.hands[hand]
        if holder.node is not None:
            state.let_go(hand)
        elif holder.instrument not in HOLDING:
            self.open_more(-SPREAD if holder.target_opening > 0.0 else SPREAD)
        else:
            found = near_place(state.session.spatial.beam, holder.place)
            if found is None:
                state.refuse(NOTHING_NEAR)
            elif state.session.grab(hand, found[1], found[0]) is None:
                state.refuse(ENDS)

    def open_more(self, more: float) -> None:
        """Part the active hand's jaws by some mm more, or less."""
        state = self._state
        if self._may_act():
            state.session.open_jaws(self.hand, state.hands[self.hand].target_opening + more)

    def _may_act(self) -> bool:
        """Return whether the active hand can do something now; tell the client where not."""
        state = self._state
        return state.playback is None and not state.refuses(self.hand) and not state.is_closed()

    def move_scope(
        self, pan: float = 0.0, tilt: float = 0.0, depth: float = 0.0, cable: float = 0.0
    ) -> None:
        """Move the scope oneself, rad and mm."""
        self.held.move(pan, tilt, depth, cable)
        self._state.show()

    def change_scope(self) -> None:
        """Take the other scope, straight or oblique."""
        self.held.change()
        self._state.show()
