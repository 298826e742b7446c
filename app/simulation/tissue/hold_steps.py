"""How the left hand takes hold of the gallbladder, draws it and lets it go (docs/scope.md).

It is drawn by stages. A pull ends where it is as far as is asked for, where the grasper pulls
nearly as hard as it grips, where a wall is strained, or where much has parted.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.anatomy import tube_title
from app.simulation.exercises.critical_view import ONE_POINT
from app.simulation.exercises.next_step import (
    DRAW_ASIDE,
    DRAW_DOWN,
    DRAW_OFF,
    ELSEWHERE,
    LET_BACK,
    LET_GO,
    SLACKEN,
    STAYS_TAUT,
    TAKE_HOLD,
    TO_RING,
    NextStep,
    Three,
)
from app.simulation.inputs.hand import Hand
from app.simulation.tissue.jaw_steps import IN_RING_MM, three
from app.simulation.tissue.parting import Site
from app.simulation.tissue.safety import Safety

Floats = NDArray[np.float64]

LEFT = 0
"""Number of the hand that holds."""
# Where the gallbladder is held, mm from its neck.
SLACK_MM = 4.0
"""To draw it towards the common duct."""
NECK_MM = 8.0
"""To make room for jaws that close on a tube."""
BODY_MM = (20.0, 16.0, 24.0)
"""To draw it off the liver; tried in this order."""
STAGES, STAGE_MM = 3, 3.0
"""It is drawn in so many stages of so many mm."""
MOST_TRIES = 3
"""Places that jaws try before the gallbladder is drawn in another direction."""
GIVES_WAY = 15
"""It is drawn no further once so many strands part: if more did, a vessel might take the pull."""
BACK_MM = 6.0
"""How far the gallbladder stays drawn once `ONE_POINT` of its plate has parted, mm. It is let back
then, since artery and duct take over the pull of the strands that part."""
EASES_MM = 3.0
"""How far the hold is let back at a time, mm."""
IS_BACK_MM = 1.0
"""Within this distance of where it was taken, the hold has been let back, mm."""
NEARLY_TORN = 0.85
"""Part of a wall's break above which the hold is let go: led back, it could bend the wall more."""


class Pull(NamedTuple):
    """What the gallbladder is taken hold of for."""

    words: str
    direction: Three  # in the anatomy's frame: along the common duct, to the right, to the front
    gripped: float  # of the pull at which tissue slips out of a grasper, at which it ends


OFF_THE_LIVER = Pull(DRAW_OFF, (-0.89, 0.32, -0.33), 0.35)
TO_COMMON = Pull(DRAW_DOWN, (-0.71, -0.64, 0.3), 0.85)
ASIDE = Pull(DRAW_ASIDE, (0.1, 0.74, 0.67), 0.85)
FOR_CLOSING = (ASIDE, OFF_THE_LIVER, TO_COMMON)
"""Pulls that are tried in this order to draw tubes apart, where jaws cannot close on one."""


@dataclass(slots=True)
class _Pulling:
    """A pull that is asked for, and how far it has come."""

    pull: Pull
    station: float  # mm from the gallbladder's neck, where it is taken hold of
    start: Floats | None = None  # (3,) mm, where what is held was then; None until it is held
    broken: int = 0  # strands, that had parted then
    stage: int = 0
    drawn: bool = False


class HoldSteps:
    """How far the left hand has come with the gallbladder."""

    def __init__(self, safety: Safety) -> None:
        self._tissue, self._name = safety.tissue, safety.gallbladder
        self._title = tube_title(self._name)
        self._pulling: _Pulling | None = None
        self._held_for: Pull | None = None  # what it was drawn for by the hold that goes on
        self._held_from: Floats | None = None  # (3,) mm, where it was as that began
        self._draws = 0  # off the liver
        self.drawn_apart = 0
        """How often it has been drawn for jaws to close on a tube."""
        self.tries = 0
        """Places that were tried since it was drawn or let go."""

    @property
    def holder(self) -> int | None:
        """Number of the hand that holds the gallbladder; None if none does."""
        number = self._tissue.tubes.names.index(self._name)
        hands = enumerate(self._tissue.hands)
        return next((i for i, each in hands if each.node is not None and each.tube == number), None)

    @property
    def pulls(self) -> bool:
        """Whether a pull is asked for."""
        return self._pulling is not None

    def follow(self) -> None:
        """Note whether it is still held."""
        if self.holder is None:
            self._held_for = self._held_from = None

    def pull_for(self, site: Site) -> None:
        """Ask for the pull that jaws need at a place, if it is not drawn so."""
        # What runs into the neck is slack then, and jaws open wide between.
        pull = OFF_THE_LIVER if site.where == "plate" else TO_COMMON
        if self.pulls or (self._held_for is pull and self.tries < MOST_TRIES):
            return
        if pull is TO_COMMON:
            self._pulling = _Pulling(pull, SLACK_MM)
            return
        self._pulling = _Pulling(pull, BODY_MM[self._draws % len(BODY_MM)])
        self._draws += 1

    def pull_apart(self) -> None:
        """Ask for a pull that draws tubes apart, each time for another."""
        self._pulling = _Pulling(FOR_CLOSING[self.drawn_apart % len(FOR_CLOSING)], NECK_MM)
        self.drawn_apart += 1

    def end_pull(self) -> None:
        """Ask for no pull."""
        self._pulling = None

    def note_strained(self) -> bool:
        """Note that a wall is strained: return whether a pull was under way, which has ended."""
        if self._pulling is None or self._pulling.start is None:
            return False
        self._pulling.drawn = True
        return True

    def next_step(self, eased: float) -> NextStep | None:
        """Return what a pull asks for next, up to a part of a break; None once it is over."""
        tissue, pulling, holder = self._tissue, self._pulling, self.holder
        if pulling is None:
            return None
        if holder is None:
            pulling.start = None
            place = self._wall_at(pulling.station)
            return NextStep(TAKE_HOLD.format(self._title), place=place, hand=LEFT)
        held = tissue.hands[holder].tip
        if pulling.start is None:
            if self._held_for is not None:  # it is held elsewhere
                return self.let_go(ELSEWHERE)
            pulling.start = self._held_from = held
            pulling.broken = tissue.beam.broken
        # What can be pulled no harder has been drawn.
        pulling.drawn |= tissue.grip_ratio(holder) > pulling.pull.gripped
        pulling.drawn |= tissue.beam.broken - pulling.broken > GIVES_WAY
        # Drawn further, what holds is let back again before jaws come.
        pulling.drawn |= tissue.stress_ratio > eased
        while pulling.stage < STAGES:
            # By stages, so that whoever goes aside first and then deeper keeps near the line.
            far = STAGE_MM * (pulling.stage + 1)
            place = pulling.start + far * np.array(pulling.pull.direction)
            if not pulling.drawn and math.dist(held, place) > IN_RING_MM:
                words = pulling.pull.words.format(self._title, pulling.stage + 1, STAGES)
                return NextStep(words, place=three(place), hand=LEFT, leads=True)
            pulling.stage += 1
        self._held_for, self._pulling, self.tries = pulling.pull, None, 0
        return None

    def let_back(self, plate: float) -> NextStep | None:
        """Return how far it is let back before the rest of its plate gives way, if it is."""
        holder, back = self.holder, self._held_from
        if (
            self._held_for is not OFF_THE_LIVER
            or plate < ONE_POINT
            or holder is None
            or back is None
        ):
            return None
        held = self._tissue.hands[holder].tip
        if math.dist(held, back) < BACK_MM + IN_RING_MM:
            return None
        place = back + BACK_MM / math.dist(held, back) * (held - back)
        words = LET_BACK.format(self._title)
        return NextStep(words, place=three(place), hand=LEFT, leads=True)

    def let_go(self, why: str) -> NextStep:
        """Return that it is let go of."""
        return NextStep(LET_GO.format(self._title, why), hand=LEFT)

    def slackened(self, hand: Hand, eased: float, *, often: bool) -> NextStep:
        """Return that what a hand holds is let back to a part of a break, or let go of."""
        tissue, back = self._tissue, self._held_from
        held, wall = tube_title(tissue.tubes.names[hand.tube]), tube_title(tissue.most_stressed)
        is_back = back is not None and math.dist(back, hand.tip) < IS_BACK_MM
        # What is taut often is not held while the other hand withdraws.
        if often or is_back or tissue.stress_ratio > NEARLY_TORN:
            return NextStep(LET_GO.format(held, STAYS_TAUT.format(wall)), hand=LEFT)
        words = SLACKEN.format(held, "" if back is None else TO_RING, 100.0 * eased, wall)
        if back is None:
            return NextStep(words, hand=LEFT)
        # A little at a time: what is let back all the way leaves no room.
        path = back - hand.tip
        place = hand.tip + path * min(1.0, EASES_MM / max(math.hypot(*path), 1e-9))
        return NextStep(words, place=three(place), hand=LEFT)

    def _wall_at(self, station: float) -> Three:
        """Return where the gallbladder's wall is, to the front, so far from its neck, mm."""
        tube = self._tissue.tubes.network.tubes[self._name]
        x, y, z = three(self._tissue.beam.places_at(np.array([station]), self._name)[0])
        return x, y, z + float(np.interp(station, tube.stations, tube.radius))
