"""Where a right angle parts what holds the hepatocystic triangle and its tubes (docs/scope.md).

Its bent tip lies flat behind a tube or between two, and its jaws part to either side: what crosses
the rectangle that they sweep is parted.

    p          (3,) mm, of the tip's end as its jaws part
    u          (3,) unit, from the end back along the bent tip; across s
    s          (3,) unit, from the end back along the shaft
    v = s x u  (3,) unit, along which jaws part
"""

import math
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.simulation.inputs.trocar import TROCARS
from app.simulation.tissue.instruments import LENGTH, RADIUS
from app.simulation.tissue.reached_tube import wall_gap
from app.simulation.tissue.safety import Safety
from physics.bed import BeamOnBed

Floats = NDArray[np.float64]

JAW_MM, RADIUS_MM = LENGTH["right angle"], RADIUS["right angle"]
HALF_MM = 10.0
"""Most that one jaw opens from the middle, mm."""
NEAR_MM, BEYOND_MM = 0.5, 1.0
"""Jaws that open sweep a rectangle. They also part strands so far in front of it or behind it, and
so far beyond its end, mm."""
BESIDE_MM = 6.0
"""How far back along the tip from the place of a pass it comes down, mm."""
IN_FRONT_MM = 60.0
"""How far in front of the tissue it comes from, mm."""
MANY = 120
"""With so many strands left, all that jaws cross count alike; with fewer, each by how likely it
parts."""
BETWEEN = 0.35
"""How likely a strand between two tubes parts, relative to one from a tube to the bed."""
BED_BEHIND_MM, TUBE_BEHIND_MM = 0.7, 2.0
"""A strand whose end is at least this far behind the jaws is likeliest to part, mm: one to the
bed, and one between tubes."""
# Lengths over which a strand gets less likely to part, mm. From 9,396 strands in reach of 660
# passes that were tried in eleven states.
SLIPS_OFF_MM = 1.5
"""Beyond the tip's end."""
TAPERS_MM = 6.0
"""Before the end of the jaws."""
ASIDE_MM = 4.0
"""Before the farthest that they open."""
STEP_MM = 0.7
"""Distance between the points of an axis at which a tip's clearance is checked, mm."""
PUSHED_MM, CLEAR_MM = -1.0, -0.6
"""Clearances from a wall, mm: below the first a tip pushes it too far, from the second on it passes
freely."""
SAME_MM, ALIKE = 2.0, 0.9
"""Two passes no farther apart than this, mm, and at least so parallel, as a cosine, are one."""
AGAIN, LEAST = 0.6, 0.05
"""Weights of a pass that has parted all strands that crossed it, and of one that parted none."""
FORGOTTEN = 60
"""Strands that part elsewhere before a pass has its whole weight again."""
VARIED_WEIGHT = 0.5
"""Weight of a pass that is shifted or turned from one of the `PASSES`."""


class Pass(NamedTuple):
    """Where a bent tip goes, in the triangle's frame as it lies now."""

    to_neck: float  # part of the way from the junction to the neck
    to_hilum: float  # and to the hilum
    front: float  # mm in front of the triangle
    turn: float  # degrees from the way to the neck, in the picture, of u


PASSES = (
    Pass(0.19, 0.13, 0.5, -28.0),
    Pass(0.44, 0.20, -3.6, 96.0),
    Pass(0.28, 0.14, -0.7, -14.0),
    Pass(0.02, 0.88, -6.3, 29.0),
    Pass(0.01, 1.03, -3.5, 68.0),
    Pass(-0.06, 0.87, -3.4, 59.0),
    Pass(0.59, 0.34, -3.1, -19.0),
    Pass(0.71, -0.08, 3.6, -64.0),
    Pass(0.28, 0.09, 2.0, -47.0),
    Pass(0.03, 0.48, -5.8, -79.0),
    Pass(0.26, -0.01, 2.1, -20.0),
    Pass(0.56, 0.60, -0.2, 124.0),
    Pass(0.44, 0.97, -1.2, 136.0),
    Pass(0.27, 1.16, -2.2, 126.0),
    Pass(0.23, 0.75, -5.4, 15.0),
    Pass(0.32, 0.62, 0.1, 126.0),
    Pass(0.23, 0.67, -5.2, -127.0),
    Pass(0.26, 0.22, 2.6, 94.0),
    Pass(0.46, 0.09, -4.8, 139.0),
)
"""Found in the anatomy `normal`, one after the other: of some 50 places that were tried each time
in the physics, those that parted most with no wall over 80 % of its break."""
VARIED = tuple(
    each._replace(front=each.front + front, turn=each.turn + turn)
    for each in PASSES
    for front, turn in ((2.5, 0.0), (-2.5, 0.0), (0.0, 30.0), (0.0, -30.0))
)
"""The same shifted and turned, for strands that those leave."""


class Tip(NamedTuple):
    """A bent tip as its jaws part."""

    place: Floats  # p
    along: Floats  # u
    shaft: Floats  # s

    @property
    def beside(self) -> Floats:
        """(3,) mm, from there to where it comes from the front."""
        return BESIDE_MM * self.along


def tip_of(each: Pass, corners: Floats) -> Tip:
    """Return where a pass is in a triangle of junction, neck and hilum, (3, 3) mm."""
    junction, neck, hilum = corners
    place = junction + each.to_neck * (neck - junction) + each.to_hilum * (hilum - junction)
    place[2] += each.front
    angle = math.atan2(*(neck - junction)[1::-1]) + math.radians(each.turn)
    flat, shaft = np.array([math.cos(angle), math.sin(angle), 0.0]), TROCARS[1].shaft(place)
    along = flat - float(flat @ shaft) * shaft
    return Tip(place, along / math.hypot(*along), shaft)


class _Crossing(NamedTuple):
    """Where strands cross the plane in which a tip's jaws part, seen from its end."""

    along: Floats  # (S,) mm, back along the bent tip
    aside: Floats  # (S,) mm, along which its jaws part
    front: Floats  # (S,) mm in front of the plane, of the end that is further so
    behind: Floats  # (S,) mm behind it, of the other


def _crossing(tip: Tip, ends: Floats, feet: Floats) -> _Crossing:
    first, second = (ends - tip.place) @ tip.shaft, (feet - tip.place) @ tip.shaft
    apart = first - second
    parts = np.divide(first, apart, out=np.full(apart.size, 0.5), where=apart != 0.0)
    places = ends + np.clip(parts, 0.0, 1.0)[:, None] * (feet - ends) - tip.place
    across = np.cross(tip.shaft, tip.along)
    front, behind = np.maximum(first, second), -np.minimum(first, second)
    return _Crossing(places @ tip.along, places @ across, front, behind)


def crossed(tip: Tip, ends: Floats, feet: Floats) -> NDArray[np.bool_]:
    """Return which strands, from (S, 3) to (S, 3) mm, cross what a tip's jaws sweep, (S,)."""
    at = _crossing(tip, ends, feet)
    within = (at.along > -BEYOND_MM) & (at.along < JAW_MM) & (np.abs(at.aside) < HALF_MM)
    return within & (at.front > -NEAR_MM) & (at.behind > -NEAR_MM)


def likelihood(tip: Tip, ends: Floats, feet: Floats, to_bed: NDArray[np.bool_]) -> Floats:
    """Return how likely strands part there, to the bed or not, over the likeliest, (S,)."""
    # One to the bed parts if its foot is behind the jaws. One between tubes goes aside with them.
    at = _crossing(tip, ends, feet)
    likely = np.where(to_bed, np.clip(at.behind / BED_BEHIND_MM, 0.0, 1.0),
                      BETWEEN * np.clip(at.behind / TUBE_BEHIND_MM, 0.0, 1.0))  # fmt: skip
    likely *= np.clip(1.0 + at.along / SLIPS_OFF_MM, 0.0, 1.0)
    likely *= np.clip((JAW_MM - at.along) / TAPERS_MM, 0.0, 1.0)
    likely *= np.clip((HALF_MM - np.abs(at.aside)) / ASIDE_MM, 0.0, 1.0)
    return likely * (at.front > -NEAR_MM)


class Passes:
    """The passes of a right angle in a tissue, and how often they have been tried."""

    def __init__(self, safety: Safety) -> None:
        self._safety, self._tissue = safety, safety.tissue
        # Where, (3,) mm, along what, (3,), the part that parted of what crossed it, and how many
        # strands had parted then.
        self._tried = list[tuple[Floats, Floats, float, int]]()

    def best(
        self, ends: Floats, feet: Floats, to_bed: NDArray[np.bool_], counts: Floats
    ) -> tuple[Tip, NDArray[np.bool_]]:
        """Return where most of some strands part, and which, (S,).

        Parameters
        ----------
        ends, feet
            (S, 3) and (S, 3) mm, from where to where they go.
        to_bed
            (S,) whether to the bed.
        counts
            (S,) how much each counts.

        Returns
        -------
        Tip, ndarray
        """
        beam, corners = self._tissue.beam, self._safety.corners()
        self._tried = [each for each in self._tried if beam.broken - each[3] < FORGOTTEN]
        tips = [tip_of(each, corners) for each in (*PASSES, *VARIED)]
        # Many part together, whatever they hold.
        part = partial(likelihood, to_bed=to_bed) if len(ends) < MANY else crossed
        weights = [
            float((part(tip, ends, feet) * counts).sum())
            * self._again(tip)
            * (1.0 if number < len(PASSES) else VARIED_WEIGHT)
            for number, tip in enumerate(tips)
        ]
        best, most = 0, -1.0
        for number in sorted(range(len(tips)), key=weights.__getitem__, reverse=True):
            if weights[number] <= most:
                break
            off = clearance(tips[number], beam)
            is_clear = min(max((off - PUSHED_MM) / (CLEAR_MM - PUSHED_MM), 0.0), 1.0)
            if weights[number] * is_clear > most:
                best, most = number, weights[number] * is_clear
        return tips[best], crossed(tips[best], ends, feet)

    def note_tried(self, place: Floats, along: Floats, parted: float) -> None:
        """Weigh a pass less from now on, which has parted some part of what crossed it."""
        self._tried.append((place, along, parted, self._tissue.beam.broken))

    def _again(self, tip: Tip) -> float:
        been = [
            parted
            for place, along, parted, _ in self._tried
            if float(((place - tip.place) ** 2).sum()) < SAME_MM**2
            and float(along @ tip.along) > ALIKE
        ]
        return math.prod(max(AGAIN * each, LEAST) for each in been)


def clearance(tip: Tip, beam: BeamOnBed) -> float:
    """Return how far a tip stays off all walls, mm; below zero where it has to push one aside."""
    ways = (
        (tip.place + tip.beside, JAW_MM, IN_FRONT_MM),
        (tip.place, JAW_MM + BESIDE_MM, 0.0),
    )
    return -RADIUS_MM + min(
        wall_gap(beam, name, start, (tip.along, 0.0, back), (tip.shaft, 0.0, forward), step=STEP_MM)
        for name in beam.network.tubes
        for start, back, forward in ways
    )
