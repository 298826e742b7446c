"""Where the elements of the exact beam end, in parts of its span."""

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from kernel_cache import njit
from physics.beam import Beam
from physics.exact.state import KERNEL

LAYER = 3.0
"""End spacing of the mesh in radii of gyration, times the number of elements of a part.

A taut beam bends in layers at its clamps and its grasp that are as long as its radius of gyration
over the root of its strain."""


def element_bounds(beam: Beam, ends: list[float], count: int) -> NDArray[np.float64]:
    """Return the bounds of `count` elements on each part between two `ends`, parts of the span."""
    area, second_moment = beam.mean_section
    gyration = math.sqrt(second_moment / area) / beam.span
    bounds = np.zeros(1)
    for first, last in itertools.pairwise(ends):
        piece = first + _graded(count, last - first, gyration)
        if last == 1.0:  # measured from its clamp, as the first piece from its own
            piece = 1.0 - _graded(count, last - first, gyration)[::-1]
        bounds = np.concatenate([bounds, piece[1:]])
    return _at_steps(bounds, count, beam)


def _at_steps(bounds: NDArray[np.float64], count: int, beam: Beam) -> NDArray[np.float64]:
    """Return the bounds drawn so that one of them lies at each step of the sections."""
    # Across a step the curvature jumps, which an element's curve cannot follow. The bounds at the
    # clamps and the grasps, every `count`-th, stay; a part with more steps than bounds is left.
    if beam.is_constant:
        return bounds
    steps = np.unique(beam.key_stations[1:][np.diff(beam.key_stations) == 0.0]) / beam.span
    anchors: list[int] = [0]
    places: list[float] = [0.0]
    for first in range(0, bounds.size - 1, count):
        last = first + count
        inside = steps[(steps > bounds[first]) & (steps < bounds[last])]
        if inside.size < last - first:
            for k, step in enumerate(inside):
                nearest = int(np.argmin(np.abs(bounds - step)))
                anchors.append(min(max(nearest, anchors[-1] + 1), last - inside.size + k))
                places.append(float(step))
        anchors.append(last)
        places.append(float(bounds[last]))
    return np.interp(bounds, bounds[anchors], places)


def _graded(count: int, length: float, gyration: float) -> NDArray[np.float64]:
    """Return the (count + 1,) ends of the elements of a part, graded towards both its ends."""
    # Graded by tanh, a smooth map of an even mesh, so that the order of the error stays.
    even = np.linspace(-1.0, 1.0, count + 1)
    end_slope = min(LAYER * gyration / length, 1.0)
    b = steepness(end_slope)
    graded = np.tanh(b * even) / math.tanh(b) if b > 0.0 else even
    bounds = 0.5 * length * (1.0 + graded)
    bounds[0], bounds[-1] = 0.0, length
    return bounds


@njit(**KERNEL)
def steepness(end_slope: float) -> float:
    """Return the b for which tanh(b u)/tanh(b) has that slope at its ends, at most 1."""
    low, high = 0.0, 6.0
    if end_slope >= 1.0:
        return 0.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        if 2.0 * middle / math.sinh(2.0 * middle) > end_slope:
            low = middle
        else:
            high = middle
    return low
