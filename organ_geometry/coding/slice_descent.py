"""Whole numbers of sections chosen point by point: few bits, and every slice within its tolerance.

An edge point's distance to a decoded organ changes, to first order, with the signals of the section
it lies in, and those with the stored numbers. So every slice's mean squared distance is a sum of
squares in the numbers, and the numbers can be changed one after the other for the fewest bits that
leave no slice beyond its tolerance.
"""

import math
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from organ_geometry.coding.edge_changes import EdgePoints
from organ_geometry.coding.number_prices import first_prices, learned_prices

KEY_PRICE = 6.0
"""Bits of a key section, its numbers apart."""
_ROUNDS, _SWEEPS = 3, 4


@dataclass(frozen=True, slots=True)
class Aim:
    """What errors cost, in bits; a slice's error is its mean square in squared tolerances.

    Attributes
    ----------
    everywhere
        Bits for an error of one.
    beyond
        Bits for the square of what an error has beyond the margin.
    margin
        Error up to which a slice is well kept.
    """

    everywhere: float
    beyond: float
    margin: float


def fewer_bits(
    points: EdgePoints,
    keys: NDArray[np.intp],
    stored: NDArray[np.int64],
    steps: NDArray[np.float64],
    limits: NDArray[np.float64],
    measured: NDArray[np.float64],
    aim: Aim,
) -> tuple[NDArray[np.intp], NDArray[np.int64]]:
    """Return key sections and stored numbers of lower cost.

    Parameters
    ----------
    points
        Edge points of all slices.
    keys
        (K,) key sections.
    stored
        (W, K, 16) stored numbers, of the outer boundary and then of the lumen.
    steps
        (16,) steps of the signals, mm.
    limits
        (S,) RMS distance that each slice may have, mm.
    measured
        (S,) RMS distance that each slice has now, by all its points, mm.
    aim
        What errors cost.

    Returns
    -------
    tuple[NDArray[np.intp], NDArray[np.int64]]
        Key sections and stored numbers.
    """
    shares = points.shares(keys)
    away, changes = points.distances(keys, stored, steps)
    touched = shares != 0.0
    first = np.asarray(touched.argmax(axis=1), dtype=np.intp)
    last = np.asarray(shares.shape[1] - touched[:, ::-1].argmax(axis=1), dtype=np.intp)
    last = np.where(touched.any(axis=1), last, first)
    weights = points.weights / limits[points.slices] ** 2
    errors = (measured / limits) ** 2
    numbers = stored.copy()
    prices = np.stack([np.stack([first_prices(), learned_prices(wall)]) for wall in stored])
    costs = np.array([aim.everywhere, aim.beyond, aim.margin])
    for _ in range(_ROUNDS):
        moved = _descend(
            shares, first, last, changes, steps, points.slices, weights, away, errors, numbers,
            prices, KEY_PRICE, costs, _SWEEPS,
        )  # fmt: skip
        moved += _drop_keys(
            shares, first, last, changes, steps, points.slices, weights, away, errors, numbers,
            prices, KEY_PRICE, costs,
        )  # fmt: skip
        if not moved:
            break
    used = np.asarray((numbers != 0).any(axis=(0, 2)))
    used[[0, -1]] = True
    return keys[used], np.ascontiguousarray(numbers[:, used])


@numba.njit(cache=True)
def _cost(error: float, aim: NDArray[np.float64]) -> float:
    over = error - aim[2]
    return aim[0] * error + (aim[1] * over * over if over > 0.0 else 0.0)


@numba.njit(cache=True)
def _bits(table: NDArray[np.float64], size: int) -> float:
    most = len(table) - 1
    return table[size] if size <= most else table[most] + 2.0 * math.log2(size / most)


@numba.njit(cache=True)
def _descend(
    shares: NDArray[np.float64],
    first: NDArray[np.intp],
    last: NDArray[np.intp],
    changes: NDArray[np.float64],
    steps: NDArray[np.float64],
    slices: NDArray[np.intp],
    weights: NDArray[np.float64],
    away: NDArray[np.float64],
    errors: NDArray[np.float64],
    numbers: NDArray[np.int64],
    prices: NDArray[np.float64],
    key_price: float,
    aim: NDArray[np.float64],
    sweeps: int,
) -> int:
    """Change numbers one after the other for the least cost, and return how many changed."""
    walls, keys, kinds = numbers.shape
    lin = np.zeros(len(errors))
    quad = np.zeros(len(errors))
    total = 0
    options = np.empty(8, np.int64)
    for _ in range(sweeps):
        changed = 0
        for k in range(keys):
            inner = 0 < k < keys - 1
            row = 0 if k == 0 else 1
            p0, p1 = first[k], last[k]
            if p1 <= p0:
                continue
            s0, s1 = slices[p0], slices[p1 - 1] + 1
            used = 0
            for w in range(walls):
                for j in range(kinds):
                    if numbers[w, k, j] != 0:
                        used += 1
            for w in range(walls):
                for j in range(kinds):
                    for s in range(s0, s1):
                        lin[s] = quad[s] = 0.0
                    step = steps[j]
                    for p in range(p0, p1):
                        a = shares[k, p] * changes[w, j, p] * step
                        lin[slices[p]] += weights[p] * away[p] * a
                        quad[slices[p]] += weights[p] * a * a
                    now = numbers[w, k, j]
                    force, stiff, cost0 = 0.0, 1e-12, 0.0
                    for s in range(s0, s1):
                        over = errors[s] - aim[2]
                        slope = aim[0] + (2.0 * aim[1] * over if over > 0.0 else 0.0)
                        force += slope * lin[s]
                        stiff += (slope + 1e-3) * quad[s]
                        cost0 += _cost(errors[s], aim)
                    wanted = now - force / stiff
                    wanted = min(max(wanted, now - 8.0), now + 8.0)
                    floor = int(np.floor(wanted))
                    options[0] = 0
                    options[1] = now - 1
                    options[2] = now + 1
                    options[3] = floor
                    options[4] = floor + 1
                    options[5] = (floor + now) // 2
                    table = prices[w, row, j]
                    bits = _bits(table, abs(now))
                    if inner and now != 0 and used == 1:
                        bits += key_price
                    best, choice = cost0 + bits, now
                    for o in range(6):
                        number = options[o]
                        if number == now or (o > 2 and abs(number - now) <= 1):
                            continue
                        delta = number - now
                        cost = _bits(table, abs(number))
                        if inner and number != 0 and (used == 0 or (used == 1 and now != 0)):
                            cost += key_price
                        if cost >= best:
                            continue
                        for s in range(s0, s1):
                            cost += _cost(errors[s] + delta * (2.0 * lin[s] + delta * quad[s]), aim)
                        if cost < best - 1e-9:
                            best, choice = cost, number
                    if choice != now:
                        changed += 1
                        delta = choice - now
                        for s in range(s0, s1):
                            errors[s] += delta * (2.0 * lin[s] + delta * quad[s])
                        for p in range(p0, p1):
                            away[p] += delta * shares[k, p] * changes[w, j, p] * step
                        used += (1 if choice != 0 else 0) - (1 if now != 0 else 0)
                        numbers[w, k, j] = choice
        total += changed
        if changed == 0:
            break
    return total


@numba.njit(cache=True)
def _drop_keys(
    shares: NDArray[np.float64],
    first: NDArray[np.intp],
    last: NDArray[np.intp],
    changes: NDArray[np.float64],
    steps: NDArray[np.float64],
    slices: NDArray[np.intp],
    weights: NDArray[np.float64],
    away: NDArray[np.float64],
    errors: NDArray[np.float64],
    numbers: NDArray[np.int64],
    prices: NDArray[np.float64],
    key_price: float,
    aim: NDArray[np.float64],
) -> int:
    """Set all numbers of keys to zero where that lowers the cost, and return of how many."""
    walls, keys = numbers.shape[0], numbers.shape[1]
    dropped = 0
    trial = np.empty(len(away))
    for k in range(1, keys - 1):
        p0, p1 = first[k], last[k]
        if p1 <= p0:
            continue
        s0, s1 = slices[p0], slices[p1 - 1] + 1
        saved, used = key_price, 0
        for p in range(p0, p1):
            trial[p] = away[p]
        for w in range(walls):
            for j in range(16):
                number = numbers[w, k, j]
                if number != 0:
                    used += 1
                    table = prices[w, 1, j]
                    saved += _bits(table, abs(number)) - table[0]
                    for p in range(p0, p1):
                        trial[p] -= number * shares[k, p] * changes[w, j, p] * steps[j]
        if used == 0:
            continue
        cost = 0.0
        after = np.zeros(s1 - s0)
        for p in range(p0, p1):
            after[slices[p] - s0] += weights[p] * (trial[p] * trial[p] - away[p] * away[p])
        for s in range(s0, s1):
            cost += _cost(errors[s] + after[s - s0], aim)
            cost -= _cost(errors[s], aim)
        if cost < saved:
            dropped += 1
            for s in range(s0, s1):
                errors[s] += after[s - s0]
            for p in range(p0, p1):
                away[p] = trial[p]
            for w in range(walls):
                for j in range(16):
                    numbers[w, k, j] = 0
    return dropped
