"""Whether an organ's lumen lies inside its outer boundary."""

import numba
import numpy as np
from numpy.typing import NDArray

from organ_geometry.curves.half_curves import closed_outlines
from organ_geometry.curves.outline_distance import foot_on_side
from organ_geometry.organ import Organ

_CORNERS = 96


def thinnest_walls(organ: Organ) -> NDArray[np.float64]:
    """Return the thinnest wall of each section of a hollow organ."""
    stations = organ.stations
    return _thinnest(
        closed_outlines(organ.rows_at(stations), _CORNERS),
        closed_outlines(organ.rows_at(stations, "lumen"), _CORNERS),
    )


@numba.njit(cache=True)
def _thinnest(outer: NDArray[np.float64], lumen: NDArray[np.float64]) -> NDArray[np.float64]:
    thinnest = np.full(len(outer), np.inf)
    for s in range(len(outer)):
        for p in range(lumen.shape[1]):
            x, y = lumen[s, p, 0], lumen[s, p, 1]
            inside = False
            best = np.inf
            x0, y0 = outer[s, -1, 0], outer[s, -1, 1]
            for c in range(outer.shape[1]):
                x1, y1 = outer[s, c, 0], outer[s, c, 1]
                if (y0 > y) != (y1 > y) and x < x0 + (y - y0) / (y1 - y0) * (x1 - x0):
                    inside = not inside
                best = min(best, foot_on_side(x0, y0, x1, y1, x, y)[0])
                x0, y0 = x1, y1
            away = np.sqrt(best)
            thinnest[s] = min(thinnest[s], away if inside else -away)
    return thinnest
