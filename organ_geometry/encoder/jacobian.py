"""How edge points' distances change with an organ's integers, to first order.

    e_p   distance of edge point p to the decoded outline of its section, mm
    f_p   its foot on the outline, at u = cos t of the half-curves; n_p the unit normal there,
          from the foot to the point
    c_j   shape coefficients of that section: half width a, middle e, s_0 .. s_6, d_0 .. d_6, mm
    C_jp  de_p / dc_j
    b_rp  weight of the stored difference r of a coefficient in the section of point p
    A_pi  de_p / dq_i = b_rp C_jp step_j for the integer i, difference r of coefficient j

The distance changes by what moves the foot along the normal; how the foot glides along the outline
does not count, to first order. The foot of coefficients is (e + a u, sum of (d_k +- h_k) U_k(u))
with h_k = s_k + a g_k (g the half-circle), so that, on the half of sign h = +-1,

    C_a = -(n_x u + h n_y sum g_k U_k(u)),  C_e = -n_x,  C_sk = -h n_y U_k(u),  C_dk = -n_y U_k(u)

Between the two halves, on the upright sides, h goes from one to the other.

b is banded, because a key section has to do with few pieces around it: `Bands` keeps, for each row,
the first point that it has to do with, the one after the last, and the weights between.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kernel_cache import njit
from organ_geometry.curves.half_curves import closed_outlines
from organ_geometry.curves.key_blend import KeyBlend
from organ_geometry.encoder.coordinate_descent import Bands
from organ_geometry.organ_file.coefficients import (
    ASIDE,
    CIRCLE,
    SIGNALS,
    SKEW,
    SYMMETRIC,
    WIDTH,
    second_kind,
    signals_to_rows,
)
from organ_geometry.organ_file.key_order import differences_to_values
from organ_geometry.surface_distance import OUTLINE_CORNERS, LocatedPoints


@dataclass(frozen=True, slots=True, eq=False)
class EdgeJacobian:
    """A part of the edge points p of every slice s, located in the sections of one axis."""

    slices: NDArray[np.intp]  # (N,) s of each point, growing
    lumen: NDArray[np.bool_]  # (N,) on the lumen's edge, else on the outer one
    points: LocatedPoints  # piece of the axis and place across it
    # (N,) where their sections are, in pieces between candidates for key sections.
    at: NDArray[np.float64]
    weights: NDArray[np.float64]  # (N,) weight of each point's squared distance in its slice's mean
    # Of a reader's axis, and between candidates for key sections, which divide them.
    pieces: int
    candidates: int

    @classmethod
    def of(
        cls,
        walls: Sequence[tuple[LocatedPoints, NDArray[np.intp]]],
        count: int,
        pieces: int,
        candidates: int,
        most: int,
    ) -> "EdgeJacobian":
        """Return the Jacobian at about `most` edge points a wall of each of `count` slices."""
        # Each wall comes with the slice of each of its points.
        located_points: list[LocatedPoints] = []
        tables: list[NDArray[np.float64]] = []
        for wall, (located, section) in enumerate(walls):
            points = np.bincount(section, minlength=count)
            starts = np.cumsum(points) - points
            number = np.arange(len(section)) - starts[section]
            # Every so many-th point of an edge; each stands for as many as were left out.
            some = np.flatnonzero(number % np.maximum(1, points // most)[section] == 0)
            taken = np.bincount(section[some], minlength=count)
            stands_for = (points / np.maximum(taken, 1))[section[some]]
            located_points.append(located.chosen(some))
            tables.append(np.stack([section[some], np.full(len(some), wall), stands_for]))
        # (3, N): slice, wall, and how many points each stands for.
        table = np.concatenate(tables, axis=1)
        # By slices, both walls of one after the other: descent adds up D slice by slice.
        order = np.argsort(table[0], kind="stable")
        slices = table[0, order].astype(np.intp)
        stands_for = table[2, order]
        points = LocatedPoints.joined(located_points).chosen(order)
        return cls(
            slices=slices,
            lumen=table[1, order] > 0.0,
            points=points,
            at=(points.piece + points.fraction) * (candidates / pieces),
            # One in all of a slice, so that D is the mean of its points.
            weights=stands_for / np.bincount(slices, stands_for, count)[slices],
            pieces=pieces,
            candidates=candidates,
        )

    def of_slices(self, slices: NDArray[np.intp]) -> "EdgeJacobian":
        """Return the Jacobian of some slices, growing, which are numbered anew."""
        number = np.full(int(self.slices[-1]) + 1, -1, dtype=np.intp)
        number[slices] = np.arange(len(slices))
        some = np.flatnonzero(number[self.slices] >= 0)
        return EdgeJacobian(
            slices=number[self.slices[some]],
            lumen=self.lumen[some],
            points=self.points.chosen(some),
            at=self.at[some],
            weights=self.weights[some],
            pieces=self.pieces,
            candidates=self.candidates,
        )

    def blend(self, keys: NDArray[np.intp]) -> KeyBlend:
        """Return the weights of the (K,) key sections in the points' sections."""
        return KeyBlend.at(self.at, keys)

    def key_bands(self, values: NDArray[np.float64], blend: KeyBlend) -> Bands:
        """Return the weights b of the key sections' stored differences in the points."""
        # (K, K) values at key sections are those that their stored differences give.
        return Bands(*_key_bands(np.ascontiguousarray(values.T), blend.before, blend.weights))

    def linearised(
        self, keys: NDArray[np.intp], stored: NDArray[np.int64], steps: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return (N,) distances e, mm, and their (W, 16, N) changes C by walls' coefficients."""
        # (W, K, 16) integers are stored, of the outer boundary and then of the lumen, whose own are
        # what it differs by; (16,) steps are in mm.
        values = differences_to_values(keys)
        # Keys are numbers of candidates; a reader's axis has several pieces from one to the next.
        finer = self.pieces // self.candidates
        blend = KeyBlend.at(np.arange(self.pieces + 1), keys * finer)
        signals = np.zeros((len(keys), SIGNALS))
        distances = np.empty(len(self.slices))
        changes = np.empty((SIGNALS, len(self.slices)))
        for wall, own in enumerate(stored):
            signals = signals + (values @ own) * steps
            some = np.flatnonzero(self.lumen == (wall > 0))
            # The outlines that a reader has, so that distances are those that will be evaluated.
            outlines = closed_outlines(blend.of(signals_to_rows(signals)), OUTLINE_CORNERS)
            distances[some], changes[:, some] = _changes(self.points.chosen(some), outlines)
        # The lumen stores its difference from the outer boundary: the latter's changes move both.
        walls = [changes] if len(stored) == 1 else [changes, changes * self.lumen]
        return distances, np.stack(walls)


def _changes(
    points: LocatedPoints, outlines: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return (N,) distances e of points to their outlines and (16, N) their changes C."""
    squared, ends, located_points = points.feet(outlines)
    # Outlines are polygons of corners at equal steps of t, u = cos t, once around.
    half = OUTLINE_CORNERS // 2
    corners = np.cos(np.linspace(0.0, np.pi, half))
    # u and the sign h at each corner: along the bottom half (+) and back along the top one (-).
    at_corner = np.concatenate([corners, corners[::-1]])
    sign = np.repeat([1.0, -1.0], half)
    before = ends - 1
    u = at_corner[before] + located_points * (at_corner[ends] - at_corner[before])
    h = sign[before] + located_points * (sign[ends] - sign[before])
    fraction = points.fraction[:, np.newaxis]
    first, last = (
        outlines[points.piece, corner] * (1.0 - fraction)
        + outlines[points.piece + 1, corner] * fraction
        for corner in (before, ends)
    )
    side = last - first
    normal = points.place - (first + located_points[:, np.newaxis] * side)
    distances = np.sqrt(squared)
    # A point on the outline has no way to its foot: there the side's own normal is as good.
    on = distances <= 1e-9 * np.abs(outlines).max()
    normal[on] = np.stack([side[on, 1], -side[on, 0]], axis=1)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), np.finfo(np.float64).tiny)
    x, y = normal.T
    basis = second_kind(u).T
    changes = np.empty((SIGNALS, len(u)))
    changes[WIDTH] = -(x * u + y * h * (CIRCLE @ basis))
    changes[ASIDE] = -x
    changes[SYMMETRIC] = -y * h * basis
    changes[SKEW] = -y * basis
    return distances, changes


@njit(cache=True)
def _key_bands(
    values: NDArray[np.float64], before: NDArray[np.intp], blend: NDArray[np.float64]
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp], NDArray[np.float64]]:
    """Return the fields of the key sections' `Bands`."""
    # values[k, j] is what a difference of one at key k gives at key j; a point between the keys
    # before[p] and before[p] + 1 has the weights blend[p] of four keys from before[p] - 1 on.
    keys, points = len(values), len(before)
    # The first and the last point between two keys, and from there the range of every key.
    low, high = np.full(keys, points, np.intp), np.zeros(keys, np.intp)
    for p in range(points):
        low[before[p]] = min(low[before[p]], p)
        high[before[p]] = p + 1
    first, last = np.zeros(keys, np.intp), np.zeros(keys, np.intp)
    start = np.zeros(keys, np.intp)
    total = 0
    for k in range(keys):
        p0, p1 = points, 0
        for i in range(keys - 1):
            # Points between keys i and i + 1 blend the values of keys i - 1 to i + 2.
            for j in range(max(i - 1, 0), min(i + 3, keys)):
                if values[k, j] != 0.0:
                    p0, p1 = min(p0, low[i]), max(p1, high[i])
        first[k], last[k], start[k] = p0, max(p0, p1), total
        total += last[k] - p0
    weights = np.empty(total)
    for k in range(keys):
        for p in range(first[k], last[k]):
            weight = 0.0
            for column in range(4):
                j = before[p] + column - 1
                if 0 <= j < keys:
                    weight += values[k, j] * blend[p, column]
            weights[start[k] + p - first[k]] = weight
    return first, last, start, weights
