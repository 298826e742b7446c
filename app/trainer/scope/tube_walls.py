"""The tubes' walls as the page draws them: distances from the curve that it lays through nodes.

Along a tube the page has a Catmull-Rom curve through its nodes, and round it angles from "up",
which turns with the nodes. A wall is a grid of distances from that curve at rest, so that the
surface of an organ, or a round one, follows the nodes.
"""

import numpy as np
from numpy.typing import NDArray

from app.simulation import Dissection
from physics.bed import SpaceBeam

Floats = NDArray[np.float64]

RINGS, SIDES = 3, 18
"""Of a wall's grid: rings an element, and places round the tube."""
# Outline points of a section, from which the places between are taken.
_OUTLINE = 72
# `up` is another direction where the tube runs along it, as in page/state.js.
_STEEP = 0.2


def round_wall(rows: Floats) -> Floats:
    """Return the wall of (n, 4) places and radii, mm, as `tube_wall`."""
    curve, _ = _curve(rows)
    return np.repeat(curve[:, 3:], SIDES, axis=1)


def tube_wall(dissection: Dissection, rest: SpaceBeam, joined: tuple[bool, bool]) -> Floats:
    """Return (R, SIDES) distances from a tube's curve to its surface at rest, mm.

    Parameters
    ----------
    dissection
        The surface, and the frame in which the beam lies.
    rest
        The beam at rest.
    joined
        Which of its ends join another tube, whose frame their node has.

    Returns
    -------
    Floats
        For `RINGS` rings in each element and one at the end.
    """
    organ = dissection.organ
    curve, along = _curve(np.column_stack([rest.places, rest.radius]))
    middles, along = curve[:, :3], along[:, :3]
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    up = _spread(_up(rest, joined))
    up = up - along * (up * along).sum(axis=1, keepdims=True)
    up = up / np.linalg.norm(up, axis=1, keepdims=True)
    side = np.cross(along, up)
    first, last = dissection.clamps
    stations = first + (last - first) / rest.span * _spread(rest.stations[:, np.newaxis])[:, 0]
    # The section that has the curve's point in its plane.
    off = middles - dissection.in_frame(organ.axis_at(stations))
    stations = np.clip(stations + (off * along).sum(axis=1), first, last)
    round_it = np.linspace(0.0, 2.0 * np.pi, _OUTLINE, endpoint=False)
    places = organ.surface(np.repeat(stations, _OUTLINE), np.tile(round_it, len(stations)))
    away = dissection.in_frame(places).reshape(-1, _OUTLINE, 3) - middles[:, np.newaxis]
    x, y = ((away * each[:, np.newaxis]).sum(axis=2) for each in (up, side))
    angles, distances = np.arctan2(y, x), np.hypot(x, y)
    wanted = np.linspace(0.0, 2.0 * np.pi, SIDES, endpoint=False)
    rows: list[Floats] = [
        np.interp(wanted, angle, distance, period=2.0 * np.pi)
        for angle, distance in zip(angles, distances, strict=True)
    ]
    return np.stack(rows)


def _up(rest: SpaceBeam, joined: tuple[bool, bool]) -> Floats:
    """Return (n, 3) what is up in the cross-section at each node, as page/state.js finds it."""
    count = len(rest.places)
    own = np.arange(count)
    own[0] += joined[0]
    own[-1] -= joined[1]
    w, x, y, z = rest.rotations[own].T
    up = np.stack(
        [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)], axis=1
    )
    ends = np.clip(np.stack([np.arange(count) - 1, np.arange(count) + 1]), 0, count - 1)
    along = rest.places[ends[1]] - rest.places[ends[0]]
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    across = up - along * (up * along).sum(axis=1, keepdims=True)
    steep = np.linalg.norm(across, axis=1) < _STEEP
    across[steep] = np.cross(along[steep], (0.0, 1.0, 0.0))
    return across / np.linalg.norm(across, axis=1, keepdims=True)


def _rings(count: int) -> tuple[NDArray[np.intp], Floats]:
    """Return (R,) elements and (R, 1) places in them, 0 to 1, of a tube of some nodes."""
    at = np.arange(RINGS * (count - 1) + 1) / RINGS
    element = np.minimum(at.astype(np.intp), count - 2)
    return element, (at - element)[:, np.newaxis]


def _spread(rows: Floats) -> Floats:
    """Return (R, C) rows of nodes at the rings, linear between nodes."""
    i, t = _rings(len(rows))
    return (1.0 - t) * rows[i] + t * rows[i + 1]


def _curve(rows: Floats) -> tuple[Floats, Floats]:
    """Return (R, C) points of the page's curve through rows of nodes, and its slopes."""
    # As in page/tube.vert.glsl: beyond its ends it goes on straight.
    whole = np.concatenate([[2.0 * rows[0] - rows[1]], rows, [2.0 * rows[-1] - rows[-2]]])
    i, t = _rings(len(rows))
    a, b, c, d = (whole[i + k] for k in range(4))
    bend, twist = 2.0 * a - 5.0 * b + 4.0 * c - d, 3.0 * b - a - 3.0 * c + d
    points = 0.5 * (2.0 * b + (c - a) * t + bend * t**2 + twist * t**3)
    slopes = 0.5 * ((c - a) + 2.0 * bend * t + 3.0 * twist * t**2)
    return points, slopes
