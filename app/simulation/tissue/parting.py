"""Where jaws part best what a part of the critical view lacks (docs/scope.md).

A right angle parts what holds the triangle and its tubes (passes.py), a dissector what holds the
gallbladder's plate: where most of its strands are near and the next wall, seen from the front, is
far, since jaws beside a wall press on it. The tip goes a little behind them, so that shafts push
them, and not tips. A place counts less, each time that jaws have opened. What is left at last runs
from the cystic duct to what enters the neck beside it. A dissector parts that from the front: one
jaw goes to the neck and the duct, the other away from both. Or it is swept through, closed.

What holds two tubes together and does not part by jaws, which would strain the tubes before, is
cut by scissors whose blades lie between the two.
"""

import math
from collections import Counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.simulation.exercises.critical_view import (
    Part,
)
from app.simulation.exercises.next_step import Where
from app.simulation.inputs.inputs import Instrument
from app.simulation.inputs.trocar import TROCARS
from app.simulation.tissue.cuts import IN_FRONT_MM, best_cut
from app.simulation.tissue.instruments import RADIUS
from app.simulation.tissue.passes import Passes
from app.simulation.tissue.reached_tube import wall_gap
from app.simulation.tissue.safety import Safety

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

NEAR_MM = 4.0
"""Strands within this distance are parted at once, mm."""
LEAST_ROOM_MM, ROOM_MM = 0.5, 3.0
"""Distance from a wall at which jaws have room, and beyond which more is no better, mm."""
PAST_MM = 2.0
"""How far a tip goes past the strands, mm."""
AGAIN = 0.3
"""Weight of a place where jaws have been already."""
FORGOTTEN = 60
"""Strands that part elsewhere before such a place has its whole weight again."""
NECK_ONLY = 0.9
"""Part of the strands at entering tubes that lie at the cystic duct's neck, above which a dissector
parts them there."""
OFF_DUCT, PAST_DUCT_MM = 0.35, 2.5
"""Where jaws part those: a fraction of the distance from the duct, and mm behind it. Of some 1,700
openings tried in the physics these parted most (docs/scope.md)."""
DUCT_MM = 4.0
"""Length of the cystic duct at the neck over which its direction is taken, mm."""
CUT_AFTER = 2
"""Failed attempts between two tubes before scissors are asked for."""
CUT_LEAST = 5
"""Least strands that are worth a cut."""
LEFT_OVER = 0.25
"""Part of the strands near a place that may stay: with no more, nothing is left to part there."""


class Spread(NamedTuple):
    """How jaws open at the neck."""

    nearer: float  # part of the strands that are farther from the neck than where they open
    turn_deg: float  # by which they are turned towards the neck


class Sweep(NamedTuple):
    """How closed jaws are led through what holds the cystic duct at the neck."""

    off_duct: float  # part of the way from the duct
    deep: float  # mm behind it
    to_neck: bool  # or from there


AT_NECK = (
    Spread(0.7, 45.0), Sweep(0.7, 4.5, True), Spread(0.4, 45.0), Sweep(0.7, 5.0, False),
    Spread(0.85, 45.0), Sweep(0.5, 3.0, True), Spread(0.7, 0.0), Spread(0.4, 0.0),
)  # fmt: skip
"""What is tried at the neck, in this order, while few strands part."""
PASSES_AFTER = 3
"""Passes of a right angle that are tried after these, before the first again."""
SWEEP_BEFORE_MM, SWEEP_PAST_MM = 4.0, 2.0
"""How far before the strands a sweep begins, and how far past them it ends, mm."""
MOST_PUSHED_MM = 3.0
"""Most that a dissector at the neck may push the gallbladder aside, mm: beyond, the grasper loses
it."""


class Site(NamedTuple):
    """Strands that are asked for, where they are parted and in which direction."""

    where: Where
    strands: Ints  # all of the group
    near: Ints  # those that are parted there at once
    anchor: int  # the strand with which the place goes
    offset: Floats  # (3,) mm, from the anchor's middle
    along: Floats  # (3,) along which jaws part, or a bent tip's direction, from its end back
    through: Floats | None = None  # (3,) mm, how closed jaws are led on from there, if they are
    tool: Instrument = "dissector"
    beside: Floats | None = None  # (3,) mm, from there to where a bent tip or blades come from


class PartingPlaces:
    """The places in a tissue where jaws part what its critical view lacks."""

    def __init__(self, safety: Safety) -> None:
        self._safety, self._tissue = safety, safety.tissue
        # Where jaws have been, (3,) mm, and the strands that had parted then.
        self._tried = list[tuple[Floats, int]]()
        self._passes = Passes(safety)
        self._fruitless = Counter[int]()  # how often few strands of a group have parted

    def best(self, part: Part) -> Site | None:
        """Return where jaws part what a part of the view lacks; None if nothing holds it."""
        lacking = np.flatnonzero(self._safety.lacking(part) & self._whole)
        if not lacking.size:
            return None
        if part == "plate":
            return self._on_plate(lacking)
        if (site := self._cut(lacking)) is not None:
            return site
        beside = lacking[self._beside_duct(lacking)]
        if part == "tubes" and beside.size > NECK_ONLY * lacking.size:
            group = max(self._groups(beside), key=len)
            tried = self._fruitless[self._tubes_of(group)] % (len(AT_NECK) + PASSES_AFTER)
            for how in AT_NECK[tried:]:
                site = self._at_neck(group, how)
                if self._deep_in_gallbladder(self.place_of(site)) < MOST_PUSHED_MM:
                    return site
        return self._passed(lacking)

    def place_of(self, site: Site) -> Floats:
        """(3,) mm where jaws open, as the tissue lies now."""
        return self._middles(np.array([site.anchor]))[0] + site.offset

    def left(self, site: Site) -> bool:
        """Return whether there is still something to part."""
        return int(self._whole[site.near].sum()) > LEFT_OVER * site.near.size

    def note_tried(self, site: Site, *, fruitless: bool) -> None:
        """Weigh a place less from now on: jaws have opened there.

        Where that was fruitless, all places of the group are weighed less, until it is not.
        """
        group = self._tubes_of(site.strands)
        self._fruitless[group] = self._fruitless[group] + 1 if fruitless else 0
        if site.beside is not None:
            left = float(self._whole[site.near].mean())
            self._passes.note_tried(self.place_of(site), site.along, 1.0 - left)
            return
        self._tried.append((self.place_of(site) - site.offset, self._tissue.beam.broken))

    @property
    def _whole(self) -> NDArray[np.bool_]:
        return self._tissue.beam.damage < 1.0

    def _groups(self, which: Ints) -> list[Ints]:
        """Return strands by the two tubes that they hold."""
        groups = self._group(which)
        return [which[groups == each] for each in np.unique(groups)]

    def _group(self, which: Ints) -> Ints:
        """(S,) a number of both tubes that strands hold, whichever of them they grow from."""
        strands = self._tissue.tubes.strands
        of, to = strands.tubes[which], strands.to[which]
        return np.maximum(of, to) * len(self._tissue.tubes.names) + np.minimum(of, to) + 1

    def _tubes_of(self, group: Ints) -> int:
        """Return the number of both tubes that a group's strands hold."""
        return int(self._group(group[:1])[0])

    def _on_plate(self, which: Ints) -> Site:
        """Return where a dissector parts some strands of the gallbladder's plate."""
        broken = self._tissue.beam.broken
        self._tried = [each for each in self._tried if broken - each[1] < FORGOTTEN]
        strands, middles = self._tissue.tubes.strands, self._middles(which)
        apart = ((middles[:, None] - middles[None]) ** 2).sum(axis=2)
        room = np.clip(self._room(middles) - LEAST_ROOM_MM, 0.1, ROOM_MM - LEAST_ROOM_MM)
        weights = (apart < NEAR_MM**2).sum(axis=1) * room
        for place, _ in self._tried:
            weights[((middles - place) ** 2).sum(axis=1) < NEAR_MM**2] *= AGAIN
        at = int(weights.argmax())
        near = apart[at] < NEAR_MM**2
        along = _main_direction((strands.feet[which] - strands.ends[which])[near])
        offset = np.array([0.0, 0.0, middles[near, 2].mean() - PAST_MM - middles[at, 2]])
        return Site("plate", which, which[near], int(which[at]), offset, along)

    def _beside_duct(self, which: Ints) -> NDArray[np.bool_]:
        """(S,) whether strands lead from the cystic duct to another tube, or from that to it."""
        strands = self._tissue.tubes.strands
        duct = self._tissue.tubes.names.index(self._safety.cystic)
        of, to = strands.tubes[which], strands.to[which]
        return (to >= 0) & ((of == duct) | (to == duct))

    def _at_neck(self, group: Ints, how: Spread | Sweep) -> Site:
        """Return where to part the cystic duct from what runs into the neck beside it, and how."""
        safety, tubes = self._safety, self._tissue.tubes
        own = tubes.strands.tubes[group] == tubes.names.index(safety.cystic)
        ends, feet = self._ends(group)
        duct = np.where(own[:, None], ends, feet)
        across = ends + feet - 2.0 * duct  # to the other tube
        neck, span = safety.corners()[1], tubes.network.tubes[safety.cystic].span
        before = span - DUCT_MM if safety.entering[safety.cystic] else DUCT_MM
        runs = neck - self._tissue.beam.places_at(np.array([before]), safety.cystic)[0]
        farthest = np.argsort(((neck - duct) ** 2).sum(axis=1))[::-1]
        middles = duct + 0.5 * across
        if isinstance(how, Sweep):
            at, along = int(farthest[group.size // 2]), runs / math.hypot(*runs)
            along *= 1.0 if how.to_neck else -1.0
            places = duct + how.off_duct * across
            reach = (places - middles[at]) @ along
            offset = places.mean(axis=0) - middles[at] - how.deep * TROCARS[1].shaft(middles[at])
            offset += (reach.min() - SWEEP_BEFORE_MM - float(reach.mean())) * along
            through = (float(np.ptp(reach)) + SWEEP_BEFORE_MM + SWEEP_PAST_MM) * along
            return Site("between", group, group, int(group[at]), offset, along, through)
        at = int(farthest[int(how.nearer * group.size)])
        offset = (OFF_DUCT - 0.5) * across[at] - [0.0, 0.0, PAST_DUCT_MM]
        flat = np.append(across[:, :2].mean(axis=0), 0.0)
        flat /= math.hypot(*flat)
        to_neck = math.copysign(1.0, float(runs @ _across(flat))) * _across(flat)
        angle = math.radians(how.turn_deg)
        along = math.cos(angle) * flat - math.sin(angle) * to_neck
        near = group[((middles - middles[at]) ** 2).sum(axis=1) < NEAR_MM**2]
        return Site("between", group, near, int(group[at]), offset, along)

    def _deep_in_gallbladder(self, place: Floats) -> float:
        """Return how far a dissector at a place would push the gallbladder aside, mm."""
        along = TROCARS[1].shaft(place), 0.0, math.inf
        beam = self._tissue.beam
        return RADIUS["dissector"] - wall_gap(beam, self._safety.gallbladder, place, along)

    def _passed(self, which: Ints) -> Site:
        """Return where a right angle parts some strands, named by those that are most."""
        to_bed = self._tissue.tubes.strands.to[which] < 0
        # What holds an entering tube's end, too, counts for two parts of the view.
        counts = np.where(self._safety.lacking("tubes")[which], 2.0, 1.0)
        tip, found = self._passes.best(*self._ends(which), to_bed, counts)
        near = which[found] if found.any() else which
        group = max(self._groups(near), key=len)
        off = tip.place - self._middles(group)
        nearest = int((off**2).sum(axis=1).argmin())
        where: Where = "behind" if self._tissue.tubes.strands.to[group[0]] < 0 else "between"
        return Site(
            where, group, near, int(group[nearest]), off[nearest], tip.along, None, "right angle",
            tip.beside,
        )  # fmt: skip

    def _cut(self, which: Ints) -> Site | None:
        """Return where scissors cut what does not part between two tubes, if there is room."""
        if "scissors" not in self._tissue.instruments:
            return None
        for group in sorted(self._groups(which), key=len, reverse=True):
            tried = self._fruitless[self._tubes_of(group)] % (CUT_AFTER + 1)
            if tried < CUT_AFTER or self._tissue.tubes.strands.to[group[0]] < 0:
                continue
            cut = best_cut(self._tissue.beam, *self._ends(group))
            if cut is None or cut.strands.sum() < CUT_LEAST:
                continue
            near = group[cut.strands]
            offset = cut.tip - self._middles(near[:1])[0]
            return Site(
                "between", group, near, int(near[0]), offset, cut.spread, None, "scissors",
                IN_FRONT_MM * TROCARS[1].shaft(cut.tip),
            )  # fmt: skip
        return None

    def _middles(self, which: Ints) -> Floats:
        """(S, 3) mm where the middles of some strands are now."""
        ends, feet = self._ends(which)
        return 0.5 * (ends + feet)

    def _ends(self, which: Ints) -> tuple[Floats, Floats]:
        """(S, 3) and (S, 3) mm where some strands end now: each end goes with its tube."""
        tubes, beam = self._tissue.tubes, self._tissue.beam
        strands = tubes.strands
        ends, feet = strands.ends[which], strands.feet[which]
        for number, (name, tube) in enumerate(tubes.network.tubes.items()):
            for places, of, at in (
                (ends, strands.tubes, strands.stations), (feet, strands.to, strands.to_stations),
            ):  # fmt: skip
                own = of[which] == number
                if own.any():
                    stations = at[which][own]
                    places[own] += beam.places_at(stations, name) - tube.places_at(stations)[0]
        return ends, feet

    def _room(self, places: Floats) -> Floats:
        """(S,) mm from places, (S, 3), to the next wall, seen from the front."""
        room = np.full(len(places), math.inf)
        beam = self._tissue.beam
        for name, tube in self._tissue.tubes.network.tubes.items():
            nodes = beam.places[beam.nodes_of(name)]
            off = np.hypot(*(places[:, None, :2] - nodes[None, :, :2]).transpose(2, 0, 1))
            room = np.minimum(room, (off - tube.radius).min(axis=1))
        return room


def _across(along: Floats) -> Floats:
    """(3,) to the side of a direction, (3,), seen from the front."""
    return np.array([along[1], -along[0], 0.0]) / math.hypot(*along[:2])


def _main_direction(paths: Floats) -> Floats:
    """(3,) the direction in which most of some paths, (S, 3), lead, either way."""
    return np.linalg.svd(paths, full_matrices=False)[2][0]
