"""Whole numbers of an organ chosen point by point: few bits, every slice within its limit.

An edge point's distance to a decoded organ changes, to first order, with the signals of the section
it lies in and with where the axis is there, and those with the stored numbers. So every slice's
mean squared distance is a sum of squares in the numbers, and the numbers can be changed one after
the other for the fewest bits that leave no slice beyond its limit.
"""

import math
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from organ_geometry.curves.key_blend import KeyBlend
from organ_geometry.encoder.bit_costs import bend_prices, first_prices, learned_prices
from organ_geometry.encoder.jacobian import EdgePoints, PointShares
from organ_geometry.encoder.key_lattice import nearest_differences
from organ_geometry.encoder.penalties import Aim
from organ_geometry.encoder.section_encoder import CodedSections
from organ_geometry.organ_file.key_order import differences_to_values

KEY_PRICE = 6.0
"""Bits of a key section, its numbers apart."""
_ROUNDS, _SWEEPS, _TRIAL_SWEEPS = 3, 4, 2
_FARTHEST, _FARTHEST_BEND = 8, 2
_OPTIONS = 6
_MOVES = (-1, 1, -2, 2, -4, 4)
# How many keys to both sides of a move are changed with it, on trial.
_NEAR = 2
_PASSES, _SILENCINGS = 2, 3
_PAYS = 0.5
_DEAD_ZONE = 0.6
_NOWHERE = np.zeros(0, dtype=np.intp)
_NO_BENDS = PointShares(_NOWHERE, _NOWHERE, _NOWHERE, np.zeros(0))


@dataclass(frozen=True, slots=True, eq=False)
class OrganNumbers:
    """Numbers of an organ that are chosen together.

    Attributes
    ----------
    sections
        What is stored of the sections.
    bends
        (B, 3) stored differences of the axis's keys.
    """

    sections: CodedSections
    bends: NDArray[np.int64]


@dataclass(slots=True, eq=False)
class _State:
    """Numbers, and what they are foreseen to give.

    Attributes
    ----------
    keys, stored
        (K,) and (W, K, 16), as in `CodedSections`.
    bends
        (3 B,) stored differences of the axis's keys.
    away
        (N,) distances of the points, mm.
    errors
        (S,) mean square distance of each slice in squared limits.
    """

    keys: NDArray[np.intp]
    stored: NDArray[np.int64]
    bends: NDArray[np.int64]
    away: NDArray[np.float64]
    errors: NDArray[np.float64]


class SliceDescent:
    """Lowers what an organ's numbers cost.

    Parameters
    ----------
    points
        Edge points of all slices.
    numbers
        The numbers to begin with.
    steps
        (16,) steps of the signals, mm.
    limits
        (S,) RMS distance that each slice may have, mm.
    measured
        (S,) RMS distance that each slice has now, by all its points, mm.
    aim
        What errors cost.
    free_axis
        Whether the axis may be bent.

    Attributes
    ----------
    foreseen
        The largest RMS distance of a slice, in limits, that the numbers last returned will have.
    """

    def __init__(
        self,
        points: EdgePoints,
        numbers: OrganNumbers,
        steps: NDArray[np.float64],
        limits: NDArray[np.float64],
        measured: NDArray[np.float64],
        aim: Aim,
        *,
        free_axis: bool,
    ) -> None:
        sections = numbers.sections
        self._points, self._steps = points, steps
        away, self._changes = points.distances(sections.keys, sections.stored, steps)
        self._bent = points.bent(self._changes[0]) if free_axis else _NO_BENDS
        self._weights = points.weights / limits[points.slices] ** 2
        self._aim = np.array([aim.everywhere, aim.beyond, aim.margin])
        self._prices = np.stack([
            np.stack([first_prices(), learned_prices(wall)]) for wall in sections.stored
        ])  # fmt: skip
        self._bend_prices = bend_prices(numbers.bends)
        bends = numbers.bends.ravel()
        self._range = bends - _FARTHEST_BEND, bends + _FARTHEST_BEND
        self._shape = numbers.bends.shape
        self._state = _State(
            sections.keys, sections.stored.copy(), bends.copy(), away, (measured / limits) ** 2
        )
        self.foreseen = math.sqrt(float(self._state.errors.max()))

    def lowered(self, *, move_keys: bool = False) -> OrganNumbers:
        """Return numbers of lower cost."""
        self._descend(self._state)
        if move_keys:
            for _ in range(_PASSES):
                if not self._move_keys():
                    break
            self._descend(self._state)
        state = self._state = self._without_silent_keys(self._state)
        self.foreseen = math.sqrt(max(0.0, float(state.errors.max())))
        return OrganNumbers(
            CodedSections(state.keys, np.ascontiguousarray(state.stored)),
            state.bends.reshape(self._shape),
        )

    def _descend(self, state: _State, trial: int | None = None) -> None:
        """Change a state's numbers, not its keys, for less cost; on trial those of some keys."""
        shares = self._points.shares(state.keys)
        slices, weights = self._points.slices, self._weights
        lowest, highest = self._range
        start, stop, bends = 0, len(state.keys), len(self._bent.first)
        if trial is not None:
            start, stop, bends = max(0, trial - _NEAR), min(stop, trial + _NEAR + 1), 0
        for _ in range(_ROUNDS if trial is None else 1):
            moved = _descend(
                shares.weights, shares.start, shares.first, shares.last, self._changes,
                self._steps, slices, weights, state.away, state.errors, state.stored,
                self._prices, start, stop, self._bent.weights, self._bent.start,
                self._bent.first, self._bent.last, state.bends[:bends], self._bend_prices,
                lowest, highest, self._aim, _SWEEPS if trial is None else _TRIAL_SWEEPS,
            )  # fmt: skip
            moved += _drop_keys(
                shares.weights, shares.start, shares.first, shares.last, self._changes,
                self._steps, slices, weights, state.away, state.errors, state.stored,
                self._prices, KEY_PRICE, self._aim,
            )  # fmt: skip
            if not moved:
                break

    def _move_keys(self) -> bool:
        """Leave out, move and add key sections, one after the other, where that lowers the cost."""
        self._state = self._without_silent_keys(self._state)
        cost = self._cost(self._state)
        moved = False
        place = 1
        while place < len(self._state.keys):
            for keys in _neighbours(self._state.keys, place):
                trial = self._with_keys(self._state, keys)
                self._descend(trial, place)
                trial_cost = self._cost(trial)
                if trial_cost < cost - _PAYS:
                    self._state, moved = self._without_silent_keys(trial), True
                    cost = self._cost(self._state)
                    break
            place += 1
        return moved

    def _with_keys(self, state: _State, keys: NDArray[np.intp]) -> _State:
        """Return a state of other keys, at which the signals are nearly the same."""
        here, there = differences_to_values(state.keys), differences_to_values(keys)
        stored: list[NDArray[np.int64]] = []
        away = state.away.copy()
        for wall, changes in zip(state.stored, self._changes, strict=True):
            values = here @ wall
            moved = KeyBlend.at(keys, state.keys).of(values)
            numbers = nearest_differences(moved, keys, _DEAD_ZONE)
            stored.append(numbers)
            before = self._points.signals(state.keys, values * self._steps)
            after = self._points.signals(keys, (there @ numbers) * self._steps)
            away += np.einsum("jn,nj->n", changes, after - before)
        points = self._points
        errors = state.errors + np.bincount(
            points.slices, self._weights * (away**2 - state.away**2), len(state.errors)
        )
        return _State(keys, np.stack(stored), state.bends.copy(), away, errors)

    def _without_silent_keys(self, state: _State) -> _State:
        """Return a state without the keys of which all numbers are zero, where it costs less."""
        # They do say something: that signals go through the line between other keys there.
        for _ in range(_SILENCINGS):
            used = np.asarray((state.stored != 0).any(axis=(0, 2)))
            used[[0, -1]] = True
            if used.all():
                break
            trial = self._with_keys(state, state.keys[used])
            self._descend(trial)
            if self._cost(trial) > self._cost(state):
                break
            state = trial
        return state

    def _cost(self, state: _State) -> float:
        """Return what a state costs, bits."""
        return _total_cost(
            state.stored, self._prices, KEY_PRICE, state.bends, self._bend_prices, state.errors,
            self._aim,
        )  # fmt: skip


def _neighbours(keys: NDArray[np.intp], place: int) -> list[NDArray[np.intp]]:
    """Return keys that differ from given ones at a place: one less, one moved, one more before."""
    found: list[NDArray[np.intp]] = []
    here, before = int(keys[place]), int(keys[place - 1])
    if place < len(keys) - 1:
        found.append(np.delete(keys, place))
        for move in _MOVES:
            if before < here + move < keys[place + 1]:
                other = keys.copy()
                other[place] += move
                found.append(other)
    if here - before > 1:
        found.append(np.insert(keys, place, (before + here) // 2))
    return found


@numba.njit(cache=True)
def _cost(error: float, aim: NDArray[np.float64]) -> float:
    over = error - aim[2]
    return aim[0] * error + (aim[1] * over * over if over > 0.0 else 0.0)


@numba.njit(cache=True)
def _bits(table: NDArray[np.float64], size: int) -> float:
    most = len(table) - 1
    return table[size] if size <= most else table[most] + 2.0 * math.log2(size / most)


@numba.njit(cache=True)
def _total_cost(
    numbers: NDArray[np.int64],
    prices: NDArray[np.float64],
    key_price: float,
    bends: NDArray[np.int64],
    of_bends: NDArray[np.float64],
    errors: NDArray[np.float64],
    aim: NDArray[np.float64],
) -> float:
    """Return the bits of all numbers, and what the slices' errors cost."""
    walls, keys, kinds = numbers.shape
    total = 0.0
    for k in range(keys):
        for w in range(walls):
            for j in range(kinds):
                total += _bits(prices[w, 0 if k == 0 else 1, j], abs(numbers[w, k, j]))
        total += key_price if 0 < k < keys - 1 else 0.0
    for i in range(len(bends)):
        total += _bits(of_bends[i], abs(bends[i]))
    for s in range(len(errors)):
        total += _cost(errors[s], aim)
    return total


@numba.njit(cache=True)
def _chosen(
    now: int,
    lowest: int,
    highest: int,
    effect: NDArray[np.float64],
    p0: int,
    p1: int,
    slices: NDArray[np.intp],
    weights: NDArray[np.float64],
    away: NDArray[np.float64],
    errors: NDArray[np.float64],
    table: NDArray[np.float64],
    aim: NDArray[np.float64],
    lin: NDArray[np.float64],
    quad: NDArray[np.float64],
    options: NDArray[np.int64],
) -> int:
    """Return the best choice of one number, and change errors and distances accordingly."""
    s0, s1 = slices[p0], slices[p1 - 1] + 1
    for s in range(s0, s1):
        lin[s] = quad[s] = 0.0
    for p in range(p0, p1):
        a = effect[p]
        weighted = weights[p] * a
        lin[slices[p]] += weighted * away[p]
        quad[slices[p]] += weighted * a
    force, stiff, cost0 = 0.0, 1e-12, 0.0
    for s in range(s0, s1):
        over = errors[s] - aim[2]
        slope = aim[0] + (2.0 * aim[1] * over if over > 0.0 else 0.0)
        force += slope * lin[s]
        stiff += (slope + 1e-3) * quad[s]
        cost0 += _cost(errors[s], aim)
    wanted = now - force / stiff
    wanted = min(max(wanted, float(lowest)), float(highest))
    floor = int(np.floor(wanted))
    options[0] = 0
    options[1] = now - 1
    options[2] = now + 1
    options[3] = floor
    options[4] = floor + 1
    options[5] = (floor + now) // 2
    best, choice = cost0 + _bits(table, abs(now)), now
    for o in range(len(options)):
        number = options[o]
        if number == now or (o > 2 and abs(number - now) <= 1):
            continue
        if number < lowest or number > highest:
            continue
        delta = number - now
        cost = _bits(table, abs(number))
        if cost >= best:
            continue
        for s in range(s0, s1):
            cost += _cost(errors[s] + delta * (2.0 * lin[s] + delta * quad[s]), aim)
        if cost < best - 1e-9:
            best, choice = cost, number
    if choice != now:
        delta = choice - now
        for s in range(s0, s1):
            errors[s] += delta * (2.0 * lin[s] + delta * quad[s])
        for p in range(p0, p1):
            away[p] += delta * effect[p]
    return choice


@numba.njit(cache=True)
def _descend(
    shares: NDArray[np.float64],
    begins: NDArray[np.intp],
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
    start: int,
    stop: int,
    bent: NDArray[np.float64],
    bent_begins: NDArray[np.intp],
    bent_first: NDArray[np.intp],
    bent_last: NDArray[np.intp],
    bends: NDArray[np.int64],
    of_bends: NDArray[np.float64],
    lowest: NDArray[np.int64],
    highest: NDArray[np.int64],
    aim: NDArray[np.float64],
    sweeps: int,
) -> int:
    """Change numbers one after the other for the least cost, and return how many changed."""
    walls, _, kinds = numbers.shape
    lin = np.zeros(len(errors))
    quad = np.zeros(len(errors))
    effect = np.empty(len(away))
    options = np.empty(_OPTIONS, np.int64)
    total = 0
    for _ in range(sweeps):
        changed = 0
        for i in range(len(bends)):
            p0, p1 = bent_first[i], bent_last[i]
            if p1 <= p0:
                continue
            at = bent_begins[i] - p0
            for p in range(p0, p1):
                effect[p] = bent[at + p]
            now = bends[i]
            choice = _chosen(
                now, lowest[i], highest[i], effect, p0, p1, slices, weights, away, errors,
                of_bends[i], aim, lin, quad, options,
            )  # fmt: skip
            if choice != now:
                changed += 1
                bends[i] = choice
        for k in range(start, stop):
            row = 0 if k == 0 else 1
            p0, p1 = first[k], last[k]
            if p1 <= p0:
                continue
            at = begins[k] - p0
            for w in range(walls):
                for j in range(kinds):
                    step = steps[j]
                    for p in range(p0, p1):
                        effect[p] = shares[at + p] * changes[w, j, p] * step
                    now = numbers[w, k, j]
                    choice = _chosen(
                        now, now - _FARTHEST, now + _FARTHEST + 1, effect, p0, p1, slices, weights,
                        away, errors, prices[w, row, j], aim, lin, quad, options,
                    )  # fmt: skip
                    if choice != now:
                        changed += 1
                        numbers[w, k, j] = choice
        total += changed
        if changed == 0:
            break
    return total


@numba.njit(cache=True)
def _drop_keys(
    shares: NDArray[np.float64],
    begins: NDArray[np.intp],
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
    """Set all numbers of keys to zero where that pays, the keys left out; return of how many."""
    walls, keys, kinds = numbers.shape
    dropped = 0
    trial = np.empty(len(away))
    for k in range(1, keys - 1):
        p0, p1 = first[k], last[k]
        if p1 <= p0:
            continue
        s0, s1 = slices[p0], slices[p1 - 1] + 1
        at = begins[k] - p0
        saved, used = key_price, 0
        for p in range(p0, p1):
            trial[p] = away[p]
        for w in range(walls):
            for j in range(kinds):
                number = numbers[w, k, j]
                if number != 0:
                    used += 1
                    table = prices[w, 1, j]
                    saved += _bits(table, abs(number)) - table[0]
                    for p in range(p0, p1):
                        trial[p] -= number * shares[at + p] * changes[w, j, p] * steps[j]
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
                for j in range(kinds):
                    numbers[w, k, j] = 0
    return dropped
