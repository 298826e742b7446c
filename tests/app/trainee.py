"""A trainee at an anatomy: mouse, wheel and keys as the page sends them, one led hand at a time."""

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, cast
from unittest.mock import MagicMock

import numpy as np
from numpy.typing import NDArray

from app.anatomy import Anatomy, anatomy_network
from app.simulation import (
    GRIP_N,
    TICK_SECONDS,
    TROCARS,
    Exercise,
    Instrument,
    NextStep,
    Safety,
    Session,
    Specimen,
    Structure,
    pointed_at,
)
from app.trainer.client.page_state import PageState
from app.trainer.client.scope_lead import NOTCH_MM, ScopeLead
from app.trainer.client.workers import Workers
from app.trainer.scope.held_scope import HeldScope
from app.trainer.view.scope_scene import ScopeScene

Floats = NDArray[np.float64]
TURN = 0.15
"""rad of a key, as the panel's keys have it."""
ROUND = math.ceil(2.0 * math.pi / TURN)
"""Keys that turn a scope's cable about."""
PAUSE = 0.3
"""s in which one looks before one goes on."""
STEP_MM = 2.0
"""Of what is led straight."""
AWAY = 4.0
"""mm off a ring, from which on one goes there in front of the tissue."""
IN_FRONT, PAST = 12.0, 3.0
"""mm in front of a tube, where jaws are turned, and past its axis, where they close."""
TAUT, EASED = 0.66, 0.45
"""Of a break: where a pull is stopped, and to where it is slackened, for the other hand."""


class Trainee:
    """Somebody who sees the picture, and leads the session by what the page sends."""

    def __init__(self, anatomy: Anatomy, exercise: Exercise) -> None:
        self.session = Session(Specimen.of_anatomy(anatomy), vertices=300, grip_N=GRIP_N)
        self.session.start_exercise(exercise)
        self.held = HeldScope(anatomy_network(anatomy))
        state = PageState(MagicMock(), self.session, cast(Workers, None))
        self.lead = ScopeLead(state, self.held)
        self._sent = 0
        self._begun: Floats = np.zeros(3)  # where the last pull began
        self._asked = ""

    # What the page sends

    def send(self, words: str) -> None:
        """Send what the page says of the pointer."""
        self._sent += 1
        ScopeScene.take(cast(Any, SimpleNamespace(_led=self.lead)), f"{self._sent} {words}")

    def wait(self, seconds: float = PAUSE) -> None:
        """Let time pass as the server does."""
        for _ in range(round(seconds / TICK_SECONDS)):
            self.lead.advance(1)
            self.held.advance([hand.place for hand in self.session.spatial.hands])
            self.session.advance()
            _ = self.lead.asked.ring  # the page reads it with each picture

    @property
    def tip(self) -> Floats:
        """The led tip, as it is drawn, (3,) mm."""
        return self.session.spatial.hands[self.lead.hand].tip

    @property
    def _settled(self) -> bool:
        """Whether the led hand is led nowhere, and its jaws neither part nor close."""
        lead = self.lead
        return lead._goals[lead.hand] is None and lead._jaws[lead.hand] is None

    def _led(self) -> None:
        """Wait until the led hand is where it goes, or has stopped."""
        for _ in range(300):
            hand = self.session.spatial.hands[self.lead.hand]
            if self.lead._goals[self.lead.hand] is None and hand.arrived:
                return
            self.wait(TICK_SECONDS)

    def _ray(self, place: Floats) -> str:
        """Return a pointer that is at a place in the picture, as the page sends it."""
        start = self.held.camera.tip
        return " ".join(f"{each:.3f}" for each in (*start, *(place - start)))

    def _point(self, place: Floats) -> None:
        """Press where a place is seen; what is held is dragged there."""
        if self.session.spatial.hands[self.lead.hand].node is None:
            self.send(f"press {self._ray(place)}")
        else:
            self.send(f"press {self._ray(self.tip)}")
            self.send(f"drag {self._ray(place)}")

    def _move(self, place: Floats) -> None:
        """Lead the tip to a place, by pointer and wheel at once."""
        far = self._far(place)
        self._point(place + far * TROCARS[self.lead.hand].shaft(place))
        self.send(f"wheel {far / NOTCH_MM:.3f}")
        self._led()

    def drag(self, place: Floats) -> None:
        """Take the tip under the pointer, at its depth, whence the wheel leads it to a place."""
        self.over(place + self._far(place) * TROCARS[self.lead.hand].shaft(place))

    def _far(self, place: Floats) -> float:
        """How far from a place along its shaft the pointer comes to that, mm."""
        shaft, normal = TROCARS[self.lead.hand].shaft(place), self.lead._normal
        return float((self.tip - place) @ normal) / float(shaft @ normal)

    def over(self, place: Floats) -> None:
        """Take the tip under the pointer where a place is seen, at the depth that it has."""
        self._point(place)
        self._led()
        self.send("stop")

    def wheel(self, notches: int) -> None:
        """Take the tip in along its shaft by notches, or out; stop where it is stopped."""
        for _ in range(abs(notches)):
            before = self.tip.copy()
            self.send(f"wheel {math.copysign(1, notches):g}")
            self._led()
            if math.dist(before, self.tip) < 0.3 * NOTCH_MM:
                return

    def to(self, place: Floats) -> None:
        """Lead the tip to a place: out by the wheel if it is too deep, the pointer, then in."""
        into, shaft = self._far(place), TROCARS[self.lead.hand].shaft(place)
        if into < 0.0:
            self.wheel(round(into / NOTCH_MM))
        self.drag(place)
        self.wheel(round(float((self.tip - place) @ shaft) / NOTCH_MM))

    def straight_to(self, place: Floats) -> None:
        """Lead the tip straight to a place, pointer and wheel by turns."""
        start = self.tip.copy()
        for part in np.linspace(0.0, 1.0, 1 + math.ceil(math.dist(start, place) / STEP_MM))[1:]:
            self.to(start + part * (place - start))

    def take(self, hand: int, instrument: Instrument) -> None:
        """Choose a hand and its instrument in the panel."""
        self.lead.choose(hand)
        self.lead.choose_instrument(hand, instrument)
        self.wait()

    def use(self) -> None:
        """Press the right button, and wait until jaws stand still."""
        self.send("act")
        self.wait(TICK_SECONDS)
        for _ in range(300):
            if self._settled:
                break
            self.wait(TICK_SECONDS)
        self.wait()

    # What is done with it

    def at(self, tube: str, station: float) -> Floats:
        """Return where a tube is seen, mm from its first end."""
        return self.session.spatial.beam.places_at(np.array([station]), tube)[0]

    def between(self, tube: str, station: float, other: str, there: float) -> Floats:
        """Return the middle between two tubes."""
        return 0.5 * (self.at(tube, station) + self.at(other, there))

    def hold(self, station: float) -> None:
        """Take hold of the gallbladder with the left hand's grasper, so far from its neck."""
        self.take(0, "grasper")
        if self.session.spatial.hands[0].node is not None:
            self.use()
        place = self.at("gallbladder", station)
        self.wheel(-4)
        self.to(place)
        self.use()

    def pull(self, direction: tuple[float, float, float], far: float) -> None:
        """Draw what is held in a direction, until a wall is taut; then give direction a little."""
        self.lead.choose(0)
        step = np.array(direction) / math.hypot(*direction)
        for _ in range(round(far / 0.5)):
            if self.session.spatial.stress_ratio > TAUT:
                break
            self._move(self.tip + 0.5 * step)
        self.wait()
        for _ in range(20):
            if self.session.spatial.stress_ratio < EASED:
                break
            self._move(self.tip - 0.5 * step)
        self.send("stop")
        self.wait()

    def turn_to(self, direction: Floats) -> None:
        """Press L or J until jaws part most nearly along a direction."""

        def along() -> float:
            return abs(float(np.array(self.session.spatial.hands[1].spread) @ direction))

        for key in (TURN, -TURN):
            for _ in range(12):
                before = along()
                self.lead.turn(key)
                if along() <= before:
                    self.lead.turn(-key)
                    break
                self.wait(0.1)

    def turn_tip(self, direction: Floats) -> None:
        """Press L or J until a bent tip lies most nearly along a direction, from its end back."""

        def along() -> float:
            return float(np.array(self.session.spatial.hands[1].aim) @ direction)

        for key in (TURN, -TURN):
            for _ in range(22):
                before = along()
                self.lead.turn(key)
                if along() <= before + 1e-6:
                    self.lead.turn(-key)
                    break
                self.wait(0.1)

    def pass_behind(self, start: Floats, end: Floats, direction: Floats) -> None:
        """Lead the closed right angle along its tip, part and close its jaws, and go back."""
        self.take(1, "right angle")
        self.wheel(-6)
        self.over(start)
        self.turn_tip(direction)
        self.straight_to(start)
        begun = self.tip.copy()
        self.straight_to(end)
        self._part_and_close()
        self.straight_to(begun)  # where jaws close that wait
        self.wheel(-6)

    def spread(self, place: Floats, direction: Floats) -> None:
        """Lead the closed dissector to a place, part its jaws, close them, and withdraw."""
        self.take(1, "dissector")
        self.wheel(-6)
        self.drag(place)
        self.turn_to(direction)
        self.to(place)
        self._part_and_close()
        self.wheel(-6)

    def _part_and_close(self) -> None:
        self.use()
        if self.session.spatial.hands[1].target_opening > 0.0:
            self.use()

    def sweep(self, places: list[Floats]) -> None:
        """Lead the closed dissector from place to place, and withdraw."""
        self.take(1, "dissector")
        self.wheel(-6)
        for place in places:
            self.to(place)
        self.wheel(-6)

    def into_ring(
        self, place: Floats, *, until: Callable[[], bool] = lambda: False, seconds: float = 30.0
    ) -> None:
        """Press where a ring is seen, until the tip has gone there or stopped, or for some time."""
        self.send(f"press {self._ray(place)}")
        for _ in range(round(seconds / TICK_SECONDS)):
            if self.lead._seeks is None or until():
                break
            self.wait(TICK_SECONDS)
        self.send("stop")
        self.wait()

    def follow(self, step: NextStep, missed: Floats, seconds: float = 30.0) -> None:
        """Do what the page asks for, by its words, ring and bar.

        A ring is missed by so much, (3,) mm, and what is held is drawn for so long at a time.
        """
        words, place = step.words, None if step.place is None else np.array(step.place) + missed
        self._asked, before = words, self._asked
        self.lead.choose(step.hand)
        tool = self.session.spatial.hands[self.lead.hand].instrument
        if step.tool is not None and step.tool != tool:
            self.take(self.lead.hand, step.tool)
        if "back into the ring" not in words and ("let the" in words or "a little" in words):
            self._ease(step.hand or 0, place)
        elif "turn the" in words:
            self._turn()
        elif "take hold" in words:
            assert place is not None
            self.into_ring(place)
            self.use()
        elif "(G)" in words:
            self.use()
        elif "by a notch" in words:
            self.wheel(-1)
        elif place is not None:
            if "drag it slowly" in words and words != before:
                self._begun = self.tip.copy()
            self.into_ring(place, seconds=seconds if step.hand == 0 else 30.0)
        elif "out of the tissue" in words:
            self.wheel(-6)
        elif "stand still" in words or "wait, and" in words:
            self.wait()
        else:
            self.wait()

    def _turn(self) -> None:
        """Press L or J as the read-out says."""
        for _ in range(12):
            off = self.lead.asked.turn
            if off is None or abs(off) < 0.5 * TURN:
                return
            self.lead.turn(math.copysign(TURN, off))
            self.wait(0.1)

    def _ease(self, hand: int, place: Floats | None) -> None:
        """Lead what strains a wall back where it came from, until it is slack."""
        if place is not None:
            self.into_ring(place, until=lambda: hand == 0 and self._eased)
            return
        if hand:
            self.wheel(-2)
            return
        back = self._begun - self.tip
        back /= max(1.0, math.hypot(*back))
        for _ in range(12):
            if self._eased:
                break
            self._move(self.tip + 0.5 * back)
        self.send("stop")
        self.wait()

    @property
    def _eased(self) -> bool:
        """Whether what is strained is slack, or slackened no more: whoever lets back reads on."""
        step = self.lead.asked.step
        asked = step is not None and "let the" in step.words
        eased = EASED if step is None else step.strain.eased
        return self.session.spatial.stress_ratio < eased or not asked

    def mark(self, structure: Structure, tube: str) -> None:
        """Choose a structure under Point at, and press where its tube is seen before all others.

        Where it is hidden, the other scope is taken, and its cable turned about.
        """
        seen = self._seen(tube)
        if not seen:
            self.lead.change_scope()
            for _ in range(ROUND):
                if seen := self._seen(tube):
                    break
                self.lead.move_scope(cable=TURN)
        assert seen, f"the {tube} is hidden"
        self.lead.pointer.choose(structure)
        self.send("point " + " ".join(f"{each:.3f}" for each in seen[len(seen) // 2]))
        self.wait()

    def _seen(self, tube: str) -> list[Floats]:
        """Return directions, (3,) each, along which a tube is seen before all others."""
        tissue, eye = self.session.spatial, self.held.camera.tip
        number, span = tissue.tubes.names.index(tube), tissue.tubes.network.tubes[tube].span
        rays = tissue.beam.places_at(np.arange(2.0, span), tube) - eye
        found = [pointed_at(tissue.beam, eye, each) for each in rays]
        return [ray for ray, at in zip(rays, found, strict=True) if at and at[0] == number]

    def close(self, instrument: Instrument, tube: str, stations: tuple[float, ...]) -> None:
        """Bring open jaws past a tube on either side, and close them, at some places of it.

        The tip is led there in front of the tube, and then goes along its shaft by the wheel.
        """
        self.take(1, instrument)
        for station in stations:
            place = self.at(tube, station)
            self.to(place + IN_FRONT * TROCARS[1].shaft(place))
            shaft = TROCARS[1].shaft(self.tip)
            across = np.cross(shaft, self.at(tube, station + 0.5) - self.at(tube, station - 0.5))
            self.turn_to(across / np.linalg.norm(across))
            deeper = round((float((self.tip - place) @ shaft) + PAST) / NOTCH_MM)
            self.wheel(deeper)
            self.use()
            self.wheel(-deeper)

    def points(self) -> tuple[int, int, int]:
        """Return the points of the two tubes, the triangle and the plate."""
        view = Safety(self.session.spatial).critical_view()
        return view.two_structures, view.triangle_cleared, view.plate_freed
