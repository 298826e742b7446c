"""Refinement of an organ's integers: fewer bits, every slice within its limit.

All integers of an encoding's key sections are chosen together by coordinate descent on the
distances linearised about the encoding (`jacobian`, `coordinate_descent`): the least J = R + sum of
phi(D_s). The axis stays. A slice is a section as it was imaged.

    e_p   = e0_p + sum of A_pi q_i, linear in the integers: e0 is what no integers would leave
    w_p   share of p in its slice's mean, over limit_s^2: D_s = sum of w_p e_p^2 is 1 at the limit
    D_s   = D0_s + sum of w_p e_p^2 over the points chosen: D0 is what all edge points measured more

Key sections go where all their integers are zero and where that costs less. With full effort they
are also moved, left out and put between others one by one: a greedy search over sets of keys, each
trial by a short descent of the keys nearby. Integers are in one row: for each key section the 16 of
the outer boundary and the 16 of the lumen.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from organ_geometry.curves.key_blend import KeyBlend
from organ_geometry.encoder.coordinate_descent import (
    Bands,
    Coordinates,
    Residuals,
    descend,
    penalty_row,
    zero_groups,
)
from organ_geometry.encoder.costs import (
    first_bits,
    learned_bits,
    total_bits,
    total_penalty,
)
from organ_geometry.encoder.jacobian import EdgeJacobian
from organ_geometry.encoder.section_encoder import KeySections, nearest_differences
from organ_geometry.encoder.settings import EncoderSettings, Penalty
from organ_geometry.organ_file.coefficients import SIGNALS
from organ_geometry.organ_file.key_order import differences_to_values


@dataclass(slots=True, eq=False)
class _State:
    """Integers, with the distances and errors predicted for them."""

    keys: NDArray[np.intp]  # (K,) key sections
    # (16 W K,) of each key section those of the outer boundary and then of the lumen.
    integers: NDArray[np.int64]
    values: NDArray[np.float64]  # (K, K) matrix of `differences_to_values`
    bands: Bands
    residuals: NDArray[np.float64]  # (N,) distances of the points, mm
    errors: NDArray[np.float64]  # (S,) D of each slice


class Refinement:
    """Lowers the cost of an encoding's integers."""

    def __init__(
        self,
        jacobian: EdgeJacobian,
        sections: KeySections,  # Where descent begins
        steps: NDArray[np.float64],  # (16,) steps of the coefficients, mm
        limits: NDArray[np.float64],  # (S,) RMS distance that each slice may have, mm
        measured: NDArray[np.float64],
        penalty: Penalty,
        settings: EncoderSettings,
    ) -> None:
        # (S,) measured RMS distances are of all edge points, mm; the Jacobian has a part of them.
        self._jacobian, self._steps, self._settings = jacobian, steps, settings
        self._penalty, self._row = penalty, penalty_row(penalty)
        # C is linearised once, about the integers given.
        residuals, changes = jacobian.linearised(sections.keys, sections.stored, steps)
        self._walls = len(sections.stored)
        self._changes = np.concatenate(changes)  # Rows of C: those of the walls' coefficients
        self._weights = jacobian.weights / limits[jacobian.slices] ** 2
        self._left = np.zeros(len(residuals))  # e0
        self._unseen = np.zeros(len(limits))  # D0
        linear = self._state_of(sections.keys, sections.stored)
        self._left = residuals - linear.residuals
        self._unseen = (measured / limits) ** 2 - self._errors(residuals)
        # The first key section's integers have bits of their own.
        self._bits = np.stack([
            np.concatenate([first_bits() for _ in sections.stored]),
            np.concatenate([learned_bits(wall) for wall in sections.stored]),
        ])  # fmt: skip
        # Tables are learned from the encoding given, and stay: they are the prices of this round.
        self._state = self._state_of(sections.keys, sections.stored)

    def refined(self, *, move_keys: bool = False) -> KeySections:
        """Return integers of lower cost, without key sections that are not worth their bits."""
        self._descend(self._state)
        if move_keys:
            # A second pass finds what the first one's moves have made worth while.
            for _ in range(2):
                if not self._move_keys():
                    break
            self._descend(self._state)
        state = self._state = self._without_zero_keys(self._state)
        return KeySections(state.keys, np.ascontiguousarray(self._stored(state)))

    def _stored(self, state: _State) -> NDArray[np.int64]:
        """Return a state's (W, K, 16) integers of key sections, as a view."""
        stored = state.integers.reshape(len(state.keys), self._walls, SIGNALS)
        return stored.transpose(1, 0, 2)

    def _coordinates(self, keys: int) -> Coordinates:
        """Return effect and cost of each integer, with so many key sections."""
        # Integers of a key section share its row b, and have a row of C each.
        block = self._walls * SIGNALS
        return Coordinates(
            row=np.arange(keys * block) // block,
            change=np.tile(np.arange(block), keys),
            step=np.tile(self._steps, keys * self._walls),
            bits=self._tables(keys),
        )

    def _tables(self, keys: int) -> NDArray[np.float64]:
        first, others = self._bits
        return np.concatenate([first, np.tile(others, (keys - 1, 1))])

    def _descend(self, state: _State, trial: int | None = None) -> None:
        """Lower a state's cost with its key sections fixed; on trial only near one of them."""
        count = len(state.keys)
        coordinates = self._coordinates(count)
        points = Residuals(self._jacobian.slices, self._weights, state.residuals, state.errors)
        starts = self._walls * SIGNALS * np.arange(count + 1)
        begin, end = 0, count
        if trial is not None:
            # What a move changes is taken up by the two key sections to both its sides.
            begin, end = max(0, trial - 2), min(count, trial + 3)
        ranges = np.array([[starts[begin], starts[end]]])
        # The first and the last key section are always stored: no groups of theirs.
        groups = np.stack([starts[1:-2], starts[2:-1]], axis=1)
        # Zeroed key sections let others change, and the other way round.
        for _ in range(3 if trial is None else 1):
            moved = descend(
                state.integers, coordinates, state.bands, self._changes, points, self._row, ranges,
                # Distances are linear nearby only: no integer goes farther than this at once.
                8, 4 if trial is None else 2,
            )  # fmt: skip
            moved += zero_groups(
                state.integers, coordinates, state.bands, self._changes, points, self._row, groups,
                self._settings.key_own_bits,
            )  # fmt: skip
            if not moved:
                break

    def _move_keys(self) -> bool:
        """Leave out, move and add key sections, one after the other, where that lowers the cost."""
        self._state = self._without_zero_keys(self._state)
        # The first change that pays is taken, and its place is looked at no more in this pass.
        cost = self._cost(self._state)
        moved = False
        place = 1
        while place < len(self._state.keys):
            for keys in _neighbours(self._state.keys, place):
                trial = self._with_keys(self._state, keys)
                self._descend(trial, place)
                # Costs are predictions: what gains less may lose when it is encoded.
                if self._cost(trial) < cost - self._settings.moved_bits:
                    self._state, moved = self._without_zero_keys(trial), True
                    cost = self._cost(self._state)
                    break
            place += 1
        return moved

    def _state_of(self, keys: NDArray[np.intp], stored: NDArray[np.int64]) -> _State:
        """Return the state of some key sections with (W, K, 16) integers."""
        values = differences_to_values(keys)
        blend = self._jacobian.blend(keys)
        residuals = self._left.copy()
        for changes, own in zip(np.split(self._changes, self._walls), stored, strict=True):
            signals = blend.of((values @ own) * self._steps)
            residuals += np.einsum("jn,nj->n", changes, signals)
        return _State(
            keys,
            stored.transpose(1, 0, 2).flatten(),
            values,
            self._jacobian.key_bands(values, blend),
            residuals,
            self._unseen + self._errors(residuals),
        )

    def _errors(self, residuals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the part of each slice's D that the chosen points make."""
        # Beside `_unseen`, which a descent cannot change.
        errors = np.bincount(self._jacobian.slices, self._weights * residuals**2, len(self._unseen))
        return np.asarray(errors, dtype=np.float64)

    def _with_keys(self, state: _State, keys: NDArray[np.intp]) -> _State:
        """Return a state of other key sections, with nearly the same coefficients between them."""
        # The old blend's values at the new keys, rounded again.
        blend, dead = KeyBlend.at(keys, state.keys), self._settings.dead_zone
        stored = [
            nearest_differences(blend.of(state.values @ own), keys, dead)
            for own in self._stored(state)
        ]
        return self._state_of(keys, np.stack(stored))

    def _without_zero_keys(self, state: _State) -> _State:
        """Return a state without the keys of which all integers are zero, where it costs less."""
        # A key of zeros still has an effect: the blend passes through the line between its
        # neighbours there. Without it the blend changes, and further keys may become zero.
        for _ in range(3):
            used = np.asarray((self._stored(state) != 0).any(axis=(0, 2)))
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
        keys = len(state.keys)
        return (
            total_bits(self._tables(keys), state.integers)
            + self._settings.key_own_bits * (keys - 2)
            + total_penalty(self._penalty, state.errors)
        )


def _neighbours(keys: NDArray[np.intp], place: int) -> list[NDArray[np.intp]]:
    """Return keys that differ from given ones at a place: one less, one moved, one more before."""
    found: list[NDArray[np.intp]] = []
    here, before = int(keys[place]), int(keys[place - 1])
    if place < len(keys) - 1:
        found.append(np.delete(keys, place))
        # Nearest first, in candidates; farther ones are reached by several passes.
        for move in (-1, 1, -2, 2, -4, 4):
            if before < here + move < keys[place + 1]:
                other = keys.copy()
                other[place] += move
                found.append(other)
    if here - before > 1:
        # Half-way to the key section before; from there later passes move it.
        found.append(np.insert(keys, place, (before + here) // 2))
    return found
