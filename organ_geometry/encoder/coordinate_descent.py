"""Coordinate descent on integers: fewest bits, every section within its limit.

Minimised, over integers q_i, is the rate plus what errors cost, both in bits,

    J(q) = sum_i r_i(|q_i|) + sum_s phi(D_s),   phi(D) = slope D + wall max(0, D - margin)^2

    e_p   residual of point p, linear in q: de_p/dq_i = A_pi = b_rp C_cp step_i
    D_s   sum of w_p e_p^2 over the points of section s; 1 is its limit
    r_i   bits of a size, from a table of 13 (`costs`)
    b_r   row r of `Bands`, C_c row c of `changes`, one of each for an integer

A change of q_i by d takes e_p to e_p + d A_pi and every D_s that it touches to D_s + d (2 l_s +
d k_s), with l_s = sum w A e and k_s = sum w A^2: the errors of any number of choices cost one pass
over the points. So each integer is compared at a few values, with the optimum of the quadratic
through the current slopes among them, and set to the cheapest; e and D follow. Passes are repeated
until nothing changes. It is the same for all that is quantised here: an axis's bends to its
centroids, coefficients to one boundary's fit, and those of all key sections to the edges.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kernel_cache import njit
from organ_geometry.encoder.settings import Penalty

ANYWHERE = 2**40
"""A reach that bounds no integer: the file holds sizes below 2^48."""


class Bands(NamedTuple):
    """Rows of weights b, each of a range of points."""

    # (R,): row r has the points first[r] to last[r] - 1.
    first: NDArray[np.intp]
    last: NDArray[np.intp]
    start: NDArray[np.intp]  # (R,) where the weights of a row begin
    weights: NDArray[np.float64]  # b_rp of all rows, one after the other


class Residuals(NamedTuple):
    """Points and their sections; a descent changes the last two fields."""

    sections: NDArray[np.intp]  # (N,) section of each point, growing
    weights: NDArray[np.float64]  # (N,) w_p, weight of e_p^2 in its section's D
    residuals: NDArray[np.float64]  # (N,) e_p
    errors: NDArray[np.float64]  # (S,) D_s, measured by more points in `Refinement`


class Coordinates(NamedTuple):
    """The effect of each of M integers on the points, and its cost."""

    # (M,) r and c: integer i moves point p by A_pi = b_rp C_cp step_i.
    row: NDArray[np.intp]
    change: NDArray[np.intp]
    step: NDArray[np.float64]  # (M,) step_i
    bits: NDArray[np.float64]  # (M, 13) r_i of sizes 0 to 12; larger ones are extrapolated


def dense_bands(columns: NDArray[np.float64]) -> Bands:
    """Return a dense (N, R) matrix's columns as rows, without the zeros at both ends."""
    used = columns != 0.0
    there = used.any(axis=0)
    first = np.where(there, used.argmax(axis=0), 0)
    last = np.where(there, len(columns) - used[::-1].argmax(axis=0), 0)
    rows = [
        columns[begin:end, row] for row, (begin, end) in enumerate(zip(first, last, strict=True))
    ]
    start = np.cumsum(last - first) - (last - first)
    return Bands(first, last, start, np.concatenate(rows))


def penalty_row(penalty: Penalty) -> NDArray[np.float64]:
    """Return a penalty as kernels take it: slope, wall, margin."""
    return np.array([penalty.slope, penalty.wall, penalty.margin])


@njit(cache=True)
def _phi(error: float, penalty: NDArray[np.float64]) -> float:
    over = error - penalty[2]
    return penalty[0] * error + (penalty[1] * over * over if over > 0.0 else 0.0)


@njit(cache=True)
def _bits(table: NDArray[np.float64], size: int) -> float:
    # Beyond the table a size costs two bits more per doubling: a unary digit and a plain one.
    most = len(table) - 1
    return table[size] if size <= most else table[most] + 2.0 * math.log2(size / most)


@njit(cache=True)
def descend(
    integers: NDArray[np.int64],
    coordinates: Coordinates,
    bands: Bands,
    changes: NDArray[np.float64],
    points: Residuals,
    penalty: NDArray[np.float64],
    ranges: NDArray[np.intp],
    reach: int,
    passes: int,
) -> int:
    """Change integers one after the other for the least J, and return how many changed."""
    # Changed are q_i of each [begin, end) of (G, 2) ranges, by `reach` at once at most, and with
    # them e_p and D_s of the points, in place; `passes` bounds the rounds over all of them.
    # Integers follow one another along the organ, so that a pass carries an error made by one on to
    # its neighbours, as in Gauss-Seidel iteration.
    row, change, step, bits = coordinates
    first, last, start, weights = bands
    sections, fractions, residuals, errors = points
    effect = np.empty(len(residuals))  # A_pi of one integer
    linear = np.zeros(len(errors))  # l_s
    quadratic = np.zeros(len(errors))  # k_s
    options = np.empty(6, np.int64)
    total = 0
    for _ in range(passes):
        changed = 0
        for g in range(len(ranges)):
            for i in range(ranges[g, 0], ranges[g, 1]):
                r = row[i]
                p0, p1 = first[r], last[r]
                if p1 <= p0:
                    continue
                # Points are sorted by section, so that the integer touches sections s0 to s1 - 1.
                s0, s1 = sections[p0], sections[p1 - 1] + 1
                for s in range(s0, s1):
                    linear[s] = quadratic[s] = 0.0
                at = start[r] - p0
                for p in range(p0, p1):
                    a = weights[at + p] * changes[change[i], p] * step[i]
                    effect[p] = a
                    weighted = fractions[p] * a
                    linear[sections[p]] += weighted * residuals[p]
                    quadratic[sections[p]] += weighted * a
                # Newton's step of sum phi, of which the wall's own curvature is left out: the sum's
                # slope along q is 2 force, its curvature about 2 stiff. A little of every section's
                # k keeps it apart from zero where phi is flat.
                force, stiff, cost = 0.0, 1e-12, 0.0
                for s in range(s0, s1):
                    over = errors[s] - penalty[2]
                    slope = penalty[0] + (2.0 * penalty[1] * over if over > 0.0 else 0.0)
                    force += slope * linear[s]
                    stiff += (slope + 1e-3) * quadratic[s]
                    cost += _phi(errors[s], penalty)
                now = integers[i]
                low, high = now - reach, now + reach + 1
                wanted = min(max(now - force / stiff, float(low)), float(high))
                floor = int(np.floor(wanted))
                # Zero first: it is the cheapest, and what is not cheaper than the best so far in
                # bits alone is not looked at. Then both neighbours, and both roundings of the
                # optimum.
                options[0] = 0
                options[1] = now - 1
                options[2] = now + 1
                options[3] = floor
                options[4] = floor + 1
                # Half way there, because a wall in between may stand against the whole.
                options[5] = (floor + now) // 2
                best, choice = cost + _bits(bits[i], abs(now)), now
                for o in range(len(options)):
                    integer = options[o]
                    # The neighbours have been tried as 1 and 2.
                    if integer == now or (o > 2 and abs(integer - now) <= 1):
                        continue
                    if integer < low or integer > high:
                        continue
                    delta = integer - now
                    cost = _bits(bits[i], abs(integer))
                    if cost >= best:  # phi is never negative
                        continue
                    for s in range(s0, s1):
                        cost += _phi(
                            errors[s] + delta * (2.0 * linear[s] + delta * quadratic[s]), penalty
                        )
                    # What gains less than rounding is no gain: passes must come to an end.
                    if cost < best - 1e-9:
                        best, choice = cost, integer
                if choice != now:
                    changed += 1
                    delta = choice - now
                    integers[i] = choice
                    for s in range(s0, s1):
                        errors[s] += delta * (2.0 * linear[s] + delta * quadratic[s])
                    for p in range(p0, p1):
                        residuals[p] += delta * effect[p]
        total += changed
        if changed == 0:
            break
    return total


@njit(cache=True)
def zero_groups(
    integers: NDArray[np.int64],
    coordinates: Coordinates,
    bands: Bands,
    changes: NDArray[np.float64],
    points: Residuals,
    penalty: NDArray[np.float64],
    groups: NDArray[np.intp],
    own_bits: float,
) -> int:
    """Set all integers of a group to zero where that lowers J, and return of how many groups."""
    # A group is a range [begin, end) of integers of one row; its own bits are saved with it. One by
    # one they would not go: each alone costs more error than it saves bits.
    row, change, step, bits = coordinates
    first, last, start, weights = bands
    sections, fractions, residuals, errors = points
    trial = np.empty(len(residuals))  # e_p without the group
    after = np.zeros(len(errors))  # change of D_s
    zeroed = 0
    for g in range(len(groups)):
        begin, end = groups[g, 0], groups[g, 1]
        r = row[begin]
        p0, p1 = first[r], last[r]
        if p1 <= p0:
            continue
        s0, s1 = sections[p0], sections[p1 - 1] + 1
        at = start[r] - p0
        saved, used = own_bits, 0  # bits that zeros save, and how many are not zero yet
        for p in range(p0, p1):
            trial[p] = residuals[p]
        for i in range(begin, end):
            integer = integers[i]
            if integer != 0:
                used += 1
                saved += _bits(bits[i], abs(integer)) - bits[i, 0]
                for p in range(p0, p1):
                    trial[p] -= integer * weights[at + p] * changes[change[i], p] * step[i]
        if used == 0:
            continue
        for s in range(s0, s1):
            after[s] = 0.0
        for p in range(p0, p1):
            after[sections[p]] += fractions[p] * (trial[p] * trial[p] - residuals[p] * residuals[p])
        cost = 0.0
        for s in range(s0, s1):
            cost += _phi(errors[s] + after[s], penalty) - _phi(errors[s], penalty)
        if cost < saved:
            zeroed += 1
            for s in range(s0, s1):
                errors[s] += after[s]
            for p in range(p0, p1):
                residuals[p] = trial[p]
            for i in range(begin, end):
                integers[i] = 0
    return zeroed
