"""What an exercise of a critical view asks for next, and where (docs/scope.md).

Of what a part of the view lacks, strands of one group are asked for: those between two tubes, or
from a tube to the bed. Jaws part them where they have room: beside a wall they press on the wall.
So each of them is weighed by how many others are near and how far the next wall is, seen from the
front; and less, each time that jaws have opened there before. The tip goes a little behind them,
so that shafts push them, and not tips.
"""

import math
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.anatomy import tube_title
from app.simulation.exercises.critical_view import (
    DRAW_OFF,
    LIFT,
    OPENED,
    PART,
    SLACKEN,
    SOME,
    TAKE_HOLD,
    CriticalView,
    NextStep,
    Where,
    closing_step,
)
from app.simulation.exercises.exercise import Exercise
from app.simulation.exercises.goals import CriticalView as Goal
from app.simulation.inputs.inputs import HOLDING
from app.simulation.tissue.safety import Safety

__all__ = ["Guidance"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

BEGUN = 0.1
"""Of the triangle's strands that have parted, from which on one has begun."""
DEEP_MM = 0.5
"""How far behind both tubes' axes what holds between them lies, from which on a straight instrument
does not reach it."""
NECK_MM, BODY_MM, LEAST_BODY_MM, DRAWN_MM = 8.0, (13.0, 18.0, 10.0), 9.0, 1.0
"""mm from the gallbladder's neck, where it is held to be drawn aside, and where to be drawn off the
liver, one after the other; the least of these; and how far it is drawn then."""
MOST_TRIES = 3
"""Places that jaws have been at, after which the gallbladder is drawn otherwise."""
NEAR_MM, LEAST_ROOM_MM, ROOM_MM, PAST_MM = 4.0, 0.5, 3.0, 2.0
"""mm within which strands are parted at once; from a wall, from which on jaws have room and beyond
which they need no more; and of a tip behind the strands."""
BESIDE_MM, UNDER_MM = 5.0, 3.0
"""mm beside and behind a tube's axis, where jaws open that are led under it."""

TAUT, EASED = 0.6, 0.45
"""Of a wall's break, from which on what pulls is slackened, and to where."""
LEFT_MM, AGAIN, FORGOTTEN = 5.0, 0.3, 60
"""mm off a place that an instrument has left; its weight then; and strands that part until it has
its whole weight again."""


class _Asked(NamedTuple):
    """Strands that are asked for, where they are parted and in which direction."""

    where: Where
    strands: Ints
    weight: float
    place: Floats  # (3,) mm
    along: Floats  # (3,)


def _weight(asked: _Asked) -> float:
    return asked.weight


class Guidance:
    """What is asked for next of a tissue, by what of its critical view is lacking."""

    def __init__(self, safety: Safety) -> None:
        self._safety = safety
        self.tissue = safety.tissue
        """What is judged."""

        self._last: Floats | None = None  # (3,) mm, where jaws were last asked for
        self._there = self._taut = False
        self._drawn_by: int | None = None  # the node by which it was drawn off the liver last
        self._draws = 0
        self._tries = 0  # places that were tried since it was drawn or let go
        self._held = False
        # Where instruments have been, and the strands that had parted then.
        self._tried = list[tuple[Floats, int]]()

    def next_step(self, exercise: Exercise, *, viewed: bool) -> NextStep | None:
        """Return what an exercise asks for next, once `viewed` what closes; None if nothing."""
        goal, view = exercise.goal, self._safety.critical_view()
        if not isinstance(goal, Goal):
            return None
        if viewed:
            words = closing_step(self._safety.closings(), goal.stay, goal.go)
            return NextStep(words, np.zeros(0, dtype=np.int64)) if words else None
        part = view.next_part
        if part is None:
            return None
        self._watch()
        lacking = np.flatnonzero(self._safety.lacking(part) & (self.tissue.beam.damage < 1.0))
        strands, names = self.tissue.tubes.strands, self.tissue.tubes.names
        if part == "triangle":
            lacking = self._in_reach(view, lacking)
        if not lacking.size:
            return None
        best = max((self._asked(view, group) for group in self._groups(lacking)), key=_weight)
        where, left = best.where, best.strands
        gallbladder, drawn_off = tube_title(self._safety.gallbladder), self._drawn_off()
        if self._strained():
            words = SLACKEN.format(gallbladder, tube_title(self.tissue.most_stressed))
            return NextStep(words, left)
        if view.triangle < BEGUN and not self._drawn():
            return NextStep(TAKE_HOLD.format(gallbladder), left, place=self._held_at(NECK_MM))
        if where == "plate" and not drawn_off:
            at = self._held_at(BODY_MM[self._draws % len(BODY_MM)])
            return NextStep(DRAW_OFF.format(gallbladder), left, place=at)
        held = self._held_node is not None
        if (held and where == "under") or (part != "plate" and self._tries >= MOST_TRIES):
            place = None if held else self._held_at(NECK_MM)
            return NextStep(LIFT.format(gallbladder), left, place=place)
        if not self._there:
            self._last = best.place
        ends = strands.tubes[left[0]], strands.to[left[0]]
        titles = [tube_title(names[each]) for each in ends if each >= 0]
        words = PART[where].format(*titles)
        return NextStep(words, left, _three(best.along), _three(best.place))

    def _in_reach(self, view: CriticalView, which: Ints) -> Ints:
        """Return those of the triangle's strands that are parted before others, if any are."""
        # A dissector parts what is between tubes first, then what is under the cystic duct.
        strands, cystic = self.tissue.tubes.strands, self._safety.cystic
        first = strands.to[which] >= 0
        if view.triangle >= OPENED:
            first |= strands.tubes[which] == self.tissue.tubes.names.index(cystic)
        return which[first] if view.triangle < SOME and first.any() else which

    def _groups(self, which: Ints) -> list[Ints]:
        """Return strands by the two tubes that they hold."""
        strands = self.tissue.tubes.strands
        # A number of both ends, whichever of them it grows from.
        of, to = strands.tubes[which], strands.to[which]
        ends = np.maximum(of, to) * len(self.tissue.tubes.names) + np.minimum(of, to) + 1
        return [which[ends == each] for each in np.unique(ends)]

    def _asked(self, view: CriticalView, group: Ints) -> _Asked:
        """Return where to part a group of strands, and how."""
        strands, names = self.tissue.tubes.strands, self.tissue.tubes.names
        ends = strands.tubes[group[0]], strands.to[group[0]]
        where = self._where(view, [names[each] for each in ends if each >= 0], group)
        if where == "under":
            places, along = self._beside(group)
            at, weight = self._weighed(places)
            return _Asked(where, group, weight, places[at], along[at])
        middles = self._middles(group)
        at, weight = self._weighed(middles)
        near = ((middles - middles[at]) ** 2).sum(axis=1) < NEAR_MM**2
        place = middles[at].copy()
        place[2] = middles[near, 2].mean() - PAST_MM
        if where == "behind":
            return _Asked(where, group, weight, place, self._beside(group)[1][at])
        # Strands of one pair all lead from one tube to the other, but some the other way round.
        paths = strands.feet[group] - strands.ends[group]
        along = np.linalg.svd(paths[near], full_matrices=False)[2][0]
        return _Asked(where, group, weight, place, along)

    def _watch(self) -> None:
        """Note what was asked for, once an instrument has been there and has gone."""
        held, self._held = self._held, self._held_node is not None
        if held and not self._held:
            self._tries = 0
        if self._last is None:
            return
        broken = self.tissue.beam.broken
        off = [
            math.dist(hand.place, self._last)
            for hand in self.tissue.hands if hand.instrument not in HOLDING
        ]  # fmt: skip
        if self._there and min(off, default=math.inf) > LEFT_MM:
            self._tried.append((self._last, broken))
            self._there = False
            self._tries += 1
        elif min(off, default=math.inf) < NEAR_MM:
            self._there = True
        self._tried = [each for each in self._tried if broken - each[1] < FORGOTTEN]

    def _where(self, view: CriticalView, names: list[str], strands: Ints) -> Where:
        """Return where strands are, of the tubes that they hold or of the one that is held."""
        bent = view.triangle >= SOME  # before that a dissector does
        if len(names) > 1:
            return "deep" if bent and self._in_front[strands].mean() < -DEEP_MM else "between"
        if names[0] == self._safety.gallbladder:
            return "plate"
        return "behind" if bent else "under"

    # The gallbladder

    def _strained(self) -> bool:
        """Whether the gallbladder is held so taut that there is no room for jaws."""
        # From where it is too taut to where it no longer is, it goes on being slackened.
        most = EASED if self._taut else TAUT
        opened = any(hand.opening > 0.0 for hand in self.tissue.hands)
        self._taut = self._held_node is not None and not opened and self.tissue.stress_ratio > most
        return self._taut

    @property
    def _held_node(self) -> int | None:
        """The gallbladder's node that a hand holds; None if none does."""
        number = self.tissue.tubes.names.index(self._safety.gallbladder)
        held = (hand.node for hand in self.tissue.hands if hand.tube == number)
        return next((node for node in held if node is not None), None)

    def _drawn(self, towards: Floats | None = None) -> bool:
        """Whether the gallbladder is held and drawn, anywhere or in a direction, (3,)."""
        node, beam = self._held_node, self.tissue.beam
        if node is None:
            return False
        moved = beam.places[node] - beam.rest_place(node)
        return (math.hypot(*moved) if towards is None else float(moved @ towards)) > DRAWN_MM

    def _drawn_off(self) -> bool:
        """Whether the gallbladder is held far from its neck and has been drawn off the liver."""
        # What is slackened later has been drawn; where jaws have parted little, elsewhere is next.
        node, beam, name = self._held_node, self.tissue.beam, self._safety.gallbladder
        if node is None:
            return False
        if node == self._drawn_by:
            return self._tries < MOST_TRIES
        at = float(beam.stations_of(name)[beam.nodes_of(name) == node][0])
        if at < LEAST_BODY_MM or not self._drawn(self._off_the_liver):
            return False
        self._drawn_by, self._tries = node, 0
        self._draws += 1
        return True

    def _held_at(self, station: float) -> tuple[float, float, float]:
        """Return where the gallbladder's wall is, to the front, so far from its neck, mm."""
        name = self._safety.gallbladder
        tube = self.tissue.tubes.network.tubes[name]
        x, y, z = _three(self.tissue.beam.places_at(np.array([station]), name)[0])
        return x, y, z + float(np.interp(station, tube.stations, tube.radius))

    @cached_property
    def _off_the_liver(self) -> Floats:
        """(3,) the direction in which the gallbladder is drawn from what holds it to the liver."""
        strands = self.tissue.tubes.strands
        plate = self._safety.lacking("plate")
        path = (strands.ends[plate] - strands.feet[plate]).mean(axis=0)
        return path / math.hypot(*path)

    # Places

    def _middles(self, which: Ints) -> Floats:
        """(S, 3) mm where the middles of some strands are now: each end goes with its tube."""
        tubes, beam = self.tissue.tubes, self.tissue.beam
        strands = tubes.strands
        places = 0.5 * (strands.ends[which] + strands.feet[which])
        for number, (name, tube) in enumerate(tubes.network.tubes.items()):
            for of, at in ((strands.tubes, strands.stations), (strands.to, strands.to_stations)):
                own = of[which] == number
                if own.any():
                    stations = at[which][own]
                    moved = beam.places_at(stations, name) - tube.places_at(stations)[0]
                    places[own] += 0.5 * moved
        return places

    def _beside(self, which: Ints) -> tuple[Floats, Floats]:
        """(S, 3) mm where to open jaws that are led under strands' tube, and (S, 3) along it."""
        tubes, beam = self.tissue.tubes, self.tissue.beam
        strands = tubes.strands
        name, stations = tubes.names[strands.tubes[which[0]]], strands.stations[which]
        axis = beam.places_at(stations, name)
        along = beam.places_at(stations + 0.5, name) - beam.places_at(stations - 0.5, name)
        along /= np.sqrt((along**2).sum(axis=1))[:, None]
        triangle = np.flatnonzero(self._safety.lacking("triangle"))
        inwards = self._middles(triangle).mean(axis=0) - axis
        side = np.stack([along[:, 1], -along[:, 0], np.zeros(which.size)], axis=1)
        side /= np.sqrt((side**2).sum(axis=1))[:, None]
        side *= np.where((side * inwards).sum(axis=1) < 0.0, -1.0, 1.0)[:, None]
        return axis + BESIDE_MM * side - np.array([0.0, 0.0, UNDER_MM]), along

    def _weighed(self, places: Floats) -> tuple[int, float]:
        """Return which of some places, (S, 3) mm, has most others near and room, and its weight."""
        room = np.full(len(places), math.inf)
        beam = self.tissue.beam
        for name, tube in self.tissue.tubes.network.tubes.items():
            nodes = beam.places[beam.nodes_of(name)]
            off = np.hypot(*(places[:, None, :2] - nodes[None, :, :2]).transpose(2, 0, 1))
            room = np.minimum(room, (off - tube.radius).min(axis=1))
        apart = ((places[:, None] - places[None]) ** 2).sum(axis=2)
        near = (apart < NEAR_MM**2).sum(axis=1)
        weights = near * np.clip(room - LEAST_ROOM_MM, 0.1, ROOM_MM - LEAST_ROOM_MM)
        for place, _ in self._tried:
            weights[((places - place) ** 2).sum(axis=1) < NEAR_MM**2] *= AGAIN
        at = int(weights.argmax())
        return at, float(weights[at])

    @cached_property
    def _in_front(self) -> Floats:
        """How far the middle of each strand between tubes is in front of both axes, (S,) mm."""
        tubes, strands = self.tissue.tubes.network.tubes, self.tissue.tubes.strands
        axes = np.zeros((2, strands.count))
        for number, tube in enumerate(tubes.values()):
            for row, of, at in (
                (0, strands.tubes, strands.stations), (1, strands.to, strands.to_stations),
            ):  # fmt: skip
                axes[row, of == number] = tube.places_at(at[of == number])[0][:, 2]
        return 0.5 * (strands.ends[:, 2] + strands.feet[:, 2]) - axes.mean(axis=0)


def _three(values: Floats) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z
