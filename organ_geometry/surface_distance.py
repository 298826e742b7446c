"""How far points are from an organ's walls."""

import numba
import numpy as np
from numpy.typing import NDArray

from organ_geometry.half_curves import closed_outlines
from organ_geometry.organ import Organ, Wall

_HALF_CORNERS = 48


def wall_distances(
    organ: Organ, points: NDArray[np.float64], near: NDArray[np.float64], wall: Wall = "outer"
) -> NDArray[np.float64]:
    """Return how far points are from a wall of an organ, measured in the sections they lie in.

    The section of a point is the nearest one to its guess whose plane the point lies in; a point
    beyond an end counts its way to the end's plane too. The distance within a section is never
    smaller than the distance in space.

    Parameters
    ----------
    organ
        The organ.
    points
        (N, 3) points, mm.
    near
        (N,) guesses of their stations, mm.
    wall
        Which wall.

    Returns
    -------
    NDArray[np.float64]
        (N,) distances, mm.
    """
    outlines = closed_outlines(organ.rows_at(organ.stations, wall), 2 * _HALF_CORNERS)
    step = organ.length / (len(organ.axis) - 1)
    return _section_distances(
        np.ascontiguousarray(points),
        np.asarray(near, dtype=np.float64) / step,
        organ.axis,
        organ.frames,
        outlines,
    )


@numba.njit(cache=True)
def _section_distances(
    points: NDArray[np.float64],
    near: NDArray[np.float64],
    axis: NDArray[np.float64],
    frames: NDArray[np.float64],
    outlines: NDArray[np.float64],
) -> NDArray[np.float64]:
    sections, corners = outlines.shape[0], outlines.shape[1]
    distances = np.empty(len(points))
    for i in range(len(points)):
        p0, p1, p2 = points[i, 0], points[i, 1], points[i, 2]
        # Walk from the guess to the pair of sections whose planes enclose the point.
        k = min(max(int(near[i]), 0), sections - 2)
        way = 0
        low = high = 0.0
        for _ in range(sections):
            low = (
                (p0 - axis[k, 0]) * frames[k, 0, 2]
                + (p1 - axis[k, 1]) * frames[k, 1, 2]
                + (p2 - axis[k, 2]) * frames[k, 2, 2]
            )
            high = (
                (p0 - axis[k + 1, 0]) * frames[k + 1, 0, 2]
                + (p1 - axis[k + 1, 1]) * frames[k + 1, 1, 2]
                + (p2 - axis[k + 1, 2]) * frames[k + 1, 2, 2]
            )
            if high > 0.0 and way >= 0 and k < sections - 2:
                k += 1
                way = 1
            elif low < 0.0 and way <= 0 and k > 0:
                k -= 1
                way = -1
            else:
                break
        share = low / (low - high) if low != high else 0.0
        share = min(max(share, 0.0), 1.0)
        beyond = 0.0
        if k == 0 and low < 0.0:
            beyond = -low
        elif k == sections - 2 and high > 0.0:
            beyond = high
        x = y = 0.0
        for c in range(3):
            away = points[i, c] - axis[k, c] * (1.0 - share) - axis[k + 1, c] * share
            x += away * (frames[k, c, 0] * (1.0 - share) + frames[k + 1, c, 0] * share)
            y += away * (frames[k, c, 1] * (1.0 - share) + frames[k + 1, c, 1] * share)
        best = np.inf
        x0 = outlines[k, -1, 0] * (1.0 - share) + outlines[k + 1, -1, 0] * share
        y0 = outlines[k, -1, 1] * (1.0 - share) + outlines[k + 1, -1, 1] * share
        for c in range(corners):
            x1 = outlines[k, c, 0] * (1.0 - share) + outlines[k + 1, c, 0] * share
            y1 = outlines[k, c, 1] * (1.0 - share) + outlines[k + 1, c, 1] * share
            sx, sy, tx, ty = x1 - x0, y1 - y0, x - x0, y - y0
            squared = sx * sx + sy * sy
            part = 0.0
            if squared > 0.0:
                part = min(max((tx * sx + ty * sy) / squared, 0.0), 1.0)
            tx -= part * sx
            ty -= part * sy
            best = min(best, tx * tx + ty * ty)
            x0, y0 = x1, y1
        distances[i] = np.sqrt(best + beyond * beyond)
    return distances
