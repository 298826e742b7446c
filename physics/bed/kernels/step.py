"""A Newton step: from where it begins, how far it goes, and how steeply the energy falls."""

import math

from physics.bed.kernels.state import State, copy_rows
from physics.bed.kernels.vectors import Floats, inner

TURN_LIMIT = 0.5
"""Largest rotation of a node in one Newton step, rad: beyond it the quadratic model of the energy
is far off, and Gibbs vectors grow without bound as neighbours come to be half a turn apart."""


@inner
def keep_shape(x_kept: Floats, x: Floats, q_kept: Floats, q: Floats) -> None:
    """Save places and rotations for `move`."""
    copy_rows(x_kept, x)
    copy_rows(q_kept, q)


@inner
def move(s: State, fraction: float) -> None:
    """Move from the saved places and rotations by a fraction of the step."""
    for n in range(s.x.shape[0]):
        for r in range(3):
            s.x[n, r] = s.x_kept[n, r] + fraction * s.step[n, r]
        a = 0.5 * fraction * s.step[n, 3]
        b = 0.5 * fraction * s.step[n, 4]
        c = 0.5 * fraction * s.step[n, 5]
        w, x, y, z = s.q_kept[n, 0], s.q_kept[n, 1], s.q_kept[n, 2], s.q_kept[n, 3]
        q0 = w - a * x - b * y - c * z
        q1 = x + a * w + b * z - c * y
        q2 = y + b * w + c * x - a * z
        q3 = z + c * w + a * y - b * x
        f = 1.0 / math.sqrt(q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3)
        s.q[n, 0], s.q[n, 1], s.q[n, 2], s.q[n, 3] = f * q0, f * q1, f * q2, f * q3


@inner
def largest(s: State, first: int) -> float:
    """Return the largest displacement of a node in the step, mm (0), or rotation, rad (3)."""
    most = 0.0
    for n in range(s.x.shape[0]):
        v = s.step[n, first] ** 2 + s.step[n, first + 1] ** 2 + s.step[n, first + 2] ** 2
        most = max(most, v)
    return math.sqrt(most)


@inner
def slope_along(s: State) -> float:
    """Return the change of the energy along the step, mJ."""
    slope = 0.0
    for n in range(s.x.shape[0]):
        for r in range(6):
            if not (s.held[n] >> r) & 1:
                slope += s.g[n, r] * s.step[n, r]
    return slope
