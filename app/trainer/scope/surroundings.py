"""What lies about an anatomy's tubes in the picture: the floor, the strands, and their films.

All of it is known once: the page draws from it what the frames move.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.anatomy import AnatomyNetwork
from physics.bed import BeamOnBed, kernels

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# mm: a film's width along a tube, and the widest gap that one spans.
FILM_MM, WIDEST_FILM_MM = 1.7, 4.0
# How much of the covering sheet goes with a strand: all of one in the peritoneum.
IN_SHEET = {"peritoneum": 2.2, "triangle": 0.35}
NOT_IN_SHEET = 0.25


@dataclass(frozen=True, slots=True, eq=False)
class Floor:
    """Heights on a square grid: `heights[row, column]` at x0 + column cell, y0 + row cell."""

    x0: float
    y0: float
    cell: float
    heights: Floats


def floor_under(made: AnatomyNetwork) -> Floor:
    """Return the floor that the strands' feet are in, and that lies below all tubes, mm."""
    x0, y0, cell, columns, rows = -40.0, -66.0, 1.5, 104, 96
    x = x0 + cell * np.arange(columns)
    y = (y0 + cell * np.arange(rows))[:, None]
    far = -8.5 + 0.9 * np.sin(0.21 * x + 0.1 * y) + 0.7 * np.sin(0.17 * y - 0.3 + 0.05 * x)
    # It rises to the liver's hilum, and sinks towards the duodenum.
    far = far + 14.0 / (1.0 + np.exp(-(x - 0.25 * y - 74.0) / 5.0))
    far = far - 3.0 / (1.0 + np.exp((x - 2.0) / 5.0))
    strands = made.strands
    toward = np.array([each.toward is not None for each in made.anatomy.layer])
    below = (strands.to < 0) & ~toward[made.layers]
    weight = np.full((rows, columns), 0.35)
    heights = 0.35 * far
    for fx, fy, fz in strands.feet[below]:
        near = np.exp(-((x - fx) ** 2 + (y - fy) ** 2) / (2.0 * 3.0**2))
        weight += near
        heights += near * fz
    heights /= weight
    for tube in made.anatomy.tube:
        if tube.kind == "organ":
            continue
        beam = made.network.tubes[tube.name]
        for place, radius in zip(beam.places, beam.radius, strict=True):
            off = np.sqrt((x - place[0]) ** 2 + (y - place[1]) ** 2)
            deepest = place[2] - radius - 0.8 + 0.35 * np.maximum(off - radius, 0.0) ** 2
            heights = np.minimum(heights, deepest)
    return Floor(x0, y0, cell, heights)


def working_place(made: AnatomyNetwork) -> Floats:
    """(3,) the middle of the hepatocystic triangle, mm: what a scope looks at first."""
    tubes = made.network.tubes
    kinds = {tube.name: tube.kind for tube in made.anatomy.tube}
    # The ends in the gallbladder of the first duct and the first artery that enter it.
    entering: dict[str, tuple[str, int]] = {}
    for join in made.anatomy.join:
        if kinds[join.to] == "organ":
            entering.setdefault(kinds[join.tube], (join.tube, join.end))
        elif kinds[join.tube] == "organ" and isinstance(join.at_mm, str):
            entering.setdefault(kinds[join.to], (join.to, int(join.at_mm == "end")))
    if "duct" not in entering:
        return np.concatenate([beam.places for beam in tubes.values()]).mean(axis=0)
    duct, end = entering["duct"]
    artery, vessel_end = entering.get("artery", entering["duct"])
    neck, junction = tubes[duct].places[-end], tubes[duct].places[end - 1]
    origin = tubes[artery].places[vessel_end - 1]
    return 0.45 * neck + 0.25 * junction + 0.3 * origin + np.array([1.5, 0.0, 0.0])


def strand_table(made: AnatomyNetwork, bed: BeamOnBed) -> Floats:
    """Return what the page knows of the strands, in the order of the frames, (S, 9)."""
    # The node and the arm, mm in its frame, of either end, -1 and the place of the foot on a bed;
    # and how much of the covering sheet goes with the strand.
    state = bed.state
    # Of each node first those to the bed, then those between pairs of nodes.
    own: Ints = np.arange(state.x.shape[0], dtype=np.int64)
    groups = np.concatenate([np.stack([own, np.full(own.size, -1)], axis=1), state.pair[:, :2]])
    nodes = np.repeat(groups, np.diff(state.first), axis=0).T
    arms = state.strand[kernels.ARM_X : kernels.ARM_Z + 1]
    feet = state.strand[kernels.FOOT_X : kernels.FOOT_Z + 1]
    sheets = [IN_SHEET.get(each.sheet or "", NOT_IN_SHEET) for each in made.anatomy.layer]
    in_sheet = np.array(sheets)[made.layers][bed.order]
    return np.stack([nodes[0], *arms, nodes[1], *feet, in_sheet], axis=1)


def film_runs(made: AnatomyNetwork, bed: BeamOnBed) -> tuple[Ints, Ints]:
    """Return strands in runs along tubes, and (F, 2) films from a place in them to a later one."""
    # A film joins strands some `FILM_MM` apart, and lies over half of the last one: between next
    # neighbours, some tenths of a mm apart, it would be hair. Each layer has three bands of angles
    # about its tube.
    strands, layers = bed.strands, made.layers
    stored = np.empty(strands.count, np.int64)
    stored[bed.order] = np.arange(strands.count)
    runs: list[int] = []
    films: list[tuple[int, int]] = []
    for layer in range(len(made.anatomy.layer)):
        mine = np.flatnonzero(layers == layer)
        if mine.size < 7:
            continue
        tube = list(made.network.tubes.values())[int(strands.tubes[mine[0]])]
        at = strands.stations[mine]
        axis = np.stack([np.interp(at, tube.stations, tube.places[:, k]) for k in range(3)], axis=1)
        out = strands.ends[mine] - axis
        angle = np.arctan2(out[:, 1], -out[:, 2])
        band = np.digitize(angle, np.quantile(angle, [0.33, 0.67]))
        for number in range(3):
            run = mine[band == number]
            run = run[np.argsort(strands.stations[run], kind="stable")]
            first = len(runs)
            along: Floats = strands.stations[run]
            ordered: list[int] = stored[run].tolist()
            runs += ordered
            i = 0
            while i < run.size - 1:
                j = min(max(int((along < along[i] + FILM_MM).sum()), i + 1), run.size - 1)
                if along[j] - along[i] < WIDEST_FILM_MM:
                    films.append((first + i, first + j))
                i = max(i + 1, (i + j) // 2)
    return np.array(runs, np.int64), np.array(films, np.int64).reshape(-1, 2)
