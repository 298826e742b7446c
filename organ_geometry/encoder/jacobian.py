"""Edge points of slices, and how their distances to an organ change with its sections' signals.

To first order a point's distance changes by what moves its foot on the outline along the normal
there: the half-curves at the foot's u, the half width and the middle. The foot's own way along the
outline does not count.
"""

import math
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from organ_geometry.curves.key_blend import KeyBlend
from organ_geometry.curves.outline_distance import FURTHER, foot_on_side, nearest_column
from organ_geometry.encoder.axis_sampling import BendMoves, OrganCut
from organ_geometry.organ_file.coefficients import ASIDE, CIRCLE, SKEW
from organ_geometry.organ_file.key_order import differences_to_values

_HALF_CORNERS = 48
_U = np.cos(np.linspace(0.0, np.pi, _HALF_CORNERS))
_POINTS = 36
_DIED_AWAY = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class PointShares:
    """What stored numbers have to do with points, where it is anything.

    Attributes
    ----------
    first, last
        (K,) the first point that a number has to do with, and the one after the last.
    start
        (K,) where its weights begin.
    weights
        Weights of all points from the first to the last, number by number.
    """

    first: NDArray[np.intp]
    last: NDArray[np.intp]
    start: NDArray[np.intp]
    weights: NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class EdgePoints:
    """Some edge points of every slice, in the sections of one axis that they lie in.

    Attributes
    ----------
    slices
        (N,) slice of each point, growing.
    lumen
        (N,) whether it lies on the lumen's edge.
    place
        (N, 2) where it is in its section, mm.
    at
        (N,) where its section is, in pieces between candidates for key sections.
    weights
        (N,) weight of its squared distance in its slice's mean.
    piece, share
        (N,) the piece of a reader's axis that it lies in, and how far along it.
    bends
        How the axis there moves with its bends.
    """

    slices: NDArray[np.intp]
    lumen: NDArray[np.bool_]
    place: NDArray[np.float64]
    at: NDArray[np.float64]
    weights: NDArray[np.float64]
    piece: NDArray[np.intp]
    share: NDArray[np.float64]
    bends: BendMoves

    @classmethod
    def of(cls, cut: OrganCut, most: int = _POINTS) -> "EdgePoints":
        """Return points of a cut's slices."""
        count = len(cut.places)
        parts: list[tuple[NDArray[np.float64], ...]] = []
        for wall, (located, section) in enumerate(cut.edges):
            points = np.bincount(section, minlength=count)
            starts = np.cumsum(points) - points
            number = np.arange(len(section)) - starts[section]
            some = np.flatnonzero(number % np.maximum(1, points // most)[section] == 0)
            taken = np.bincount(section[some], minlength=count)
            at = (located.piece[some] + located.share[some]) * (cut.candidates / cut.pieces)
            stands_for = (points / np.maximum(taken, 1))[section[some]]
            parts.append((
                section[some].astype(np.float64), np.full(len(some), float(wall)), at, stands_for,
                located.place[some, 0], located.place[some, 1],
            ))  # fmt: skip
        table = np.concatenate([np.stack(part) for part in parts], axis=1)
        table = table[:, np.argsort(table[0], kind="stable")]
        slices = table[0].astype(np.intp)
        weights = table[3] / np.bincount(slices, table[3], count)[slices]
        finer = table[2] * (cut.pieces / cut.candidates)
        piece = np.minimum(finer.astype(np.intp), cut.pieces - 1)
        return cls(
            slices=slices,
            lumen=table[1] > 0.0,
            place=np.ascontiguousarray(table[4:].T),
            at=table[2],
            weights=weights,
            piece=piece,
            share=finer - piece,
            bends=cut.bend_moves(),
        )

    def of_slices(self, slices: NDArray[np.intp]) -> "EdgePoints":
        """Return the points of some slices, which are numbered anew.

        Parameters
        ----------
        slices
            (C,) the slices, growing.

        Returns
        -------
        EdgePoints
            Their points.
        """
        number = np.full(int(self.slices[-1]) + 1, -1, dtype=np.intp)
        number[slices] = np.arange(len(slices))
        some = number[self.slices] >= 0
        return EdgePoints(
            slices=number[self.slices[some]],
            lumen=self.lumen[some],
            place=self.place[some],
            at=self.at[some],
            weights=self.weights[some],
            piece=self.piece[some],
            share=self.share[some],
            bends=self.bends,
        )

    def shares(self, keys: NDArray[np.intp]) -> PointShares:
        """Return the weights of stored differences in the points' signals.

        Parameters
        ----------
        keys
            (K,) key sections.

        Returns
        -------
        PointShares
            The weights.
        """
        values = np.ascontiguousarray(differences_to_values(keys).T)
        blend = KeyBlend.at(self.at, keys)
        return PointShares(*_key_shares(values, blend.before, blend.weights))

    def distances(
        self, keys: NDArray[np.intp], stored: NDArray[np.int64], steps: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the points' distances, and how they change with the walls' signals.

        Parameters
        ----------
        keys
            (K,) key sections.
        stored
            (W, K, 16) stored differences, of the outer boundary and then of the lumen.
        steps
            (16,) steps of the signals, mm.

        Returns
        -------
        tuple[NDArray[np.float64], NDArray[np.float64]]
            (N,) distances, mm, and (W, 16, N) their changes with the signals of each wall.
        """
        values = differences_to_values(keys)
        lumen = self.lumen
        signals = self.signals(keys, (values @ stored[0]) * steps)
        if len(stored) > 1:
            own = self.signals(keys, (values @ stored[1]) * steps)
            signals += own * lumen[:, np.newaxis]
        away, changes = _linearised(self.place, signals, CIRCLE, _U)
        walls = [changes] if len(stored) == 1 else [changes, changes * lumen]
        return away, np.stack(walls)

    def signals(self, keys: NDArray[np.intp], values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a wall's signals in the points' sections.

        Parameters
        ----------
        keys
            (K,) key sections.
        values
            (K, 16) the signals there, mm.

        Returns
        -------
        NDArray[np.float64]
            (N, 16) signals, mm.
        """
        return KeyBlend.at(self.at, keys).of(values)

    def bent(self, changes: NDArray[np.float64]) -> PointShares:
        """Return how the points' distances change with the axis's bends.

        Parameters
        ----------
        changes
            (16, N) how they change with the signals of the outer boundary, as `distances` has it.

        Returns
        -------
        PointShares
            The changes, mm, for each key of the axis and each of its three ways in turn.
        """
        aside, up = changes[ASIDE], changes[SKEW][0]
        moves = self.bends
        return PointShares(*_bent(moves.weights, moves.across, self.piece, self.share, aside, up))


@numba.njit(cache=True)
def _key_shares(
    values: NDArray[np.float64], before: NDArray[np.intp], blend: NDArray[np.float64]
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp], NDArray[np.float64]]:
    """Return what `PointShares` holds, from the (K, K) values that each difference gives."""
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


@numba.njit(cache=True)
def _bent(
    weights: NDArray[np.float64],
    across: NDArray[np.float64],
    piece: NDArray[np.intp],
    share: NDArray[np.float64],
    aside: NDArray[np.float64],
    up: NDArray[np.float64],
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp], NDArray[np.float64]]:
    """Return what `PointShares` holds of all bends; those of the two ends have to do with none."""
    sections, keys = weights.shape
    points = len(piece)
    first, last = np.zeros(3 * keys, np.intp), np.zeros(3 * keys, np.intp)
    start = np.zeros(3 * keys, np.intp)
    total = 0
    for k in range(1, keys - 1):
        largest = 0.0
        for i in range(sections):
            largest = max(largest, abs(weights[i, k]))
        low, high = sections, 0
        for i in range(sections):
            # A cubic's bends die away along it.
            if abs(weights[i, k]) > _DIED_AWAY * largest:
                low, high = min(low, i), i
        p0, p1 = points, 0
        for p in range(points):
            if low - 1 <= piece[p] <= high:
                p0, p1 = min(p0, p), p + 1
        for way in range(3):
            row = 3 * k + way
            first[row], last[row], start[row] = p0, max(p0, p1), total
            total += last[row] - p0
    changes = np.empty(total)
    for k in range(1, keys - 1):
        for p in range(first[3 * k], last[3 * k]):
            i, part = piece[p], share[p]
            weight = weights[i, k] * (1.0 - part) + weights[i + 1, k] * part
            for way in range(3):
                x = across[i, way, 0] * (1.0 - part) + across[i + 1, way, 0] * part
                y = across[i, way, 1] * (1.0 - part) + across[i + 1, way, 1] * part
                row = 3 * k + way
                changes[start[row] + p - first[row]] = weight * (x * aside[p] + y * up[p])
    return first, last, start, changes


@numba.njit(cache=True)
def _linearised(
    places: NDArray[np.float64],
    signals: NDArray[np.float64],
    circle: NDArray[np.float64],
    corners: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return distances of points to outlines, and how they change with the outlines' signals."""
    count, half = len(places), len(corners)
    total = 2 * half
    away = np.empty(count)
    changes = np.empty((16, count))
    basis = np.empty((half, 7))
    round_half = np.zeros(half)
    for c in range(half):
        u = corners[c]
        basis[c, 0] = 1.0
        basis[c, 1] = 2.0 * u
        for k in range(2, 7):
            basis[c, k] = 2.0 * u * basis[c, k - 1] - basis[c, k - 2]
        for k in range(7):
            round_half[c] += circle[k] * basis[c, k]
    xs, ys = np.empty(total), np.empty(total)
    known = np.empty(half, np.bool_)
    unit = np.empty(7)
    for p in range(count):
        a, e = signals[p, 0], signals[p, 1]
        for c in range(half):
            xs[c] = xs[total - 1 - c] = e + a * corners[c]
        known[:] = False
        px, py = places[p, 0], places[p, 1]
        best, at, part = np.inf, total, 0.0
        # From the point's column to both sides, until one is further away than what was found.
        start = nearest_column(px, xs[0], xs[half - 1], half - 1)
        for way in range(-1, 2, 2):
            column = start if way > 0 else start - 1
            while 0 <= column < half - 1:
                off = way * (px - xs[column if way > 0 else column + 1])
                if off > 0.0 and off * off > FURTHER * best:
                    break
                for c in range(column, column + 2):
                    if not known[c]:
                        _set_corner(signals[p], round_half, basis, c, ys)
                        known[c] = True
                for c in (column + 1, total - 1 - column):
                    near, share = _side(xs, ys, c, px, py)
                    if near < best or (near == best and c < at):
                        best, at, part = near, c, share
                column += way
        for c in (0, half):
            if (px - xs[c]) ** 2 <= FURTHER * best:
                corner = c if c == 0 else half - 1
                if not known[corner]:
                    _set_corner(signals[p], round_half, basis, corner, ys)
                    known[corner] = True
                near, share = _side(xs, ys, c, px, py)
                if near < best or (near == best and c < at):
                    best, at, part = near, c, share
        before = at - 1 if at > 0 else total - 1
        u0 = corners[before] if before < half else corners[total - 1 - before]
        u1 = corners[at] if at < half else corners[total - 1 - at]
        side0 = 1.0 if before < half else -1.0
        side1 = 1.0 if at < half else -1.0
        u = u0 + part * (u1 - u0)
        side = side0 + part * (side1 - side0)
        nx = px - (xs[before] + part * (xs[at] - xs[before]))
        ny = py - (ys[before] + part * (ys[at] - ys[before]))
        size = math.sqrt(best)
        if size > 1e-9 * abs(a):
            nx, ny = nx / size, ny / size
        else:
            nx, ny = ys[at] - ys[before], xs[before] - xs[at]
            length = max(math.hypot(nx, ny), 1e-300)
            nx, ny = nx / length, ny / length
        away[p] = size
        unit[0] = 1.0
        unit[1] = 2.0 * u
        for k in range(2, 7):
            unit[k] = 2.0 * u * unit[k - 1] - unit[k - 2]
        bulge = 0.0
        for k in range(7):
            bulge += circle[k] * unit[k]
            changes[2 + k, p] = -ny * side * unit[k]
            changes[9 + k, p] = -ny * unit[k]
        changes[0, p] = -(nx * u + ny * side * bulge)
        changes[1, p] = -nx
    return away, changes


@numba.njit(cache=True)
def _set_corner(
    signals: NDArray[np.float64],
    round_half: NDArray[np.float64],
    basis: NDArray[np.float64],
    corner: int,
    ys: NDArray[np.float64],
) -> None:
    """Set the y of an outline's two corners at one x."""
    up = signals[0] * round_half[corner]
    middle = 0.0
    for k in range(7):
        up += signals[2 + k] * basis[corner, k]
        middle += signals[9 + k] * basis[corner, k]
    ys[corner] = middle + up
    ys[len(ys) - 1 - corner] = middle - up


@numba.njit(cache=True)
def _side(
    xs: NDArray[np.float64], ys: NDArray[np.float64], corner: int, x: float, y: float
) -> tuple[float, float]:
    """Return a point's squared distance to the side that ends at a corner, and its foot's share."""
    before = corner - 1 if corner > 0 else len(xs) - 1
    return foot_on_side(xs[before], ys[before], xs[corner], ys[corner], x, y)
