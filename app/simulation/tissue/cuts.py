"""Where scissors cut strands between two tubes, and neither tube (docs/scope.md).

Their open blades come straight from the front and lie between the tubes, spread across the strands.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.simulation.inputs.trocar import TROCARS
from app.simulation.tissue.blades import Blades
from app.simulation.tissue.instruments import CLIP_OPENING, RADIUS
from app.simulation.tissue.reached_tube import wall_gap
from physics.bed import BeamOnBed

Floats = NDArray[np.float64]

IN_FRONT_MM = 12.0
"""Distance in front of a cut at which blades are turned, mm."""
FROM_FRONT_MM = 60.0
"""Length of the scissors' shaft that must be clear of walls, mm."""
PAST_MM = (1.0, 3.0, 5.0)
"""Distances of the blades' tips past the middle of a strand that are tried, mm."""
SPREADS = tuple(np.linspace(0.0, np.pi, 8, endpoint=False).tolist())
"""Directions in which the blades may open, seen from the front, rad."""
MOST_ANCHORS = 10
"""Most strands at which a cut is tried."""
MOST_LOOKED_AT = 80
"""Most cuts, the best first, that are checked against walls."""


class Cut(NamedTuple):
    """Where blades cut."""

    tip: Floats  # (3,) mm, in the middle between their ends
    spread: Floats  # (3,) in which they part
    strands: NDArray[np.bool_]  # (S,) which they cut


def best_cut(beam: BeamOnBed, ends: Floats, feet: Floats) -> Cut | None:
    """Return where most of some strands, (S, 3) to (S, 3) mm, are cut; None if nowhere."""
    middles, cuts = 0.5 * (ends + feet), list[Cut]()
    for middle in middles[:: -(-len(ends) // MOST_ANCHORS)]:
        shaft = TROCARS[1].shaft(middle)
        for past in PAST_MM:
            for angle in SPREADS:
                flat = np.array([np.cos(angle), np.sin(angle), 0.0])
                spread = flat - float(flat @ shaft) * shaft
                spread /= np.sqrt((spread * spread).sum())
                blades = Blades(middle - past * shaft, shaft, spread, CLIP_OPENING)
                crosses, aside = blades.crossing(ends, feet)
                between = np.abs(aside) < 0.5 * blades.opening
                cuts.append(Cut(blades.tip, spread, crosses & between))
    cuts.sort(key=_count, reverse=True)
    best, most = None, 0.0
    for cut in cuts[:MOST_LOOKED_AT]:
        if _count(cut) <= most:
            break
        weight = _count(cut) * _room(cut, beam)
        if weight > most:
            best, most = cut, weight
    return best


def _count(cut: Cut) -> int:
    return int(cut.strands.sum())


def _room(cut: Cut, beam: BeamOnBed) -> float:
    """Return how well blades pass, from 0, where a wall is in their plane, to 1, off all walls."""
    half = 0.5 * CLIP_OPENING
    sides = (cut.spread, -half, half), (TROCARS[1].shaft(cut.tip), 0.0, FROM_FRONT_MM)
    room = 1.0
    for name in beam.network.tubes:
        room = min(room, wall_gap(beam, name, cut.tip, *sides) / RADIUS["scissors"])
        if room <= 0.0:  # whatever the other tubes leave
            return 0.0
    return room
