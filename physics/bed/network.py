"""Tubes that join: a network of beams, and the order in which its nodes are eliminated."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from physics.bed.space_beam import SpaceBeam
from physics.quantity import finite, positive

Ints = NDArray[np.int64]

# Of a tube's length, how far off a node or a place may be and still be the one that is meant; mm,
# how far an end may be from what it joins.
NEAR, MEETS = 1e-6, 1e-3


@dataclass(frozen=True, slots=True)
class Join:
    """An end of a tube fixed to a place of another one: there they move and turn as one."""

    tube: str
    end: int  # 0 the first, 1 the second
    to: str  # a tube that stands earlier in the network
    at: float  # mm from that one's first end; it has a node there
    stiffness: float = 1.0  # factor on the first element's: an elastic joint below 1
    face: float = 0.0  # mm along the tube to that one's wall: before it no stress is judged


@dataclass(frozen=True, eq=False)
class Network:
    """Tubes by their names, and where their ends join.

    A tube joins one that stands earlier; both its ends may join, which makes a loop. An end that
    joins is `free` otherwise. A single beam is a network of one.

    Attributes
    ----------
    tubes
        Beams at rest.
    joins
        Which ends join what.
    touching
        Gap at rest, mm, up to which nodes of tubes that touch are solved for together; the others
        move as if what they touch stood still, by which equilibria are found slowly. Tubes pass
        through one another when None.
    """

    tubes: Mapping[str, SpaceBeam]
    joins: Sequence[Join] = ()
    touching: float | None = None

    def __post_init__(self) -> None:
        if not self.tubes:
            raise ValueError("a network needs a tube")
        object.__setattr__(self, "tubes", dict(self.tubes))
        object.__setattr__(self, "joins", tuple(self.joins))
        if len({each.fibres is None for each in self.tubes.values()}) > 1:
            raise ValueError("the walls of a network's tubes must all have the same law")
        names, seen = list(self.tubes), set[tuple[str, int]]()
        for join in self.joins:
            for name in (join.tube, join.to):
                if name not in self.tubes:
                    raise ValueError(f"there is no tube {name!r}: {', '.join(names)}")
            if names.index(join.to) >= names.index(join.tube):
                raise ValueError(f"tube {join.tube} joins {join.to}, which must stand before it")
            if join.end not in (0, 1):
                raise ValueError(f"end of tube {join.tube} must be 0 or 1, got {join.end}")
            if (join.tube, join.end) in seen:
                raise ValueError(f"end {join.end} of tube {join.tube} joins twice")
            seen.add((join.tube, join.end))
            positive(join.stiffness, f"stiffness where {join.tube} joins {join.to}", "")
            if not 0.0 <= join.face < self.tubes[join.tube].span:
                raise ValueError(
                    f"wall that tube {join.tube} joins must be from 0 to "
                    f"{self.tubes[join.tube].span:g} mm along it, got {join.face:g} mm"
                )
            if self.tubes[join.tube].ends[join.end] != "free":
                raise ValueError(
                    f"end {join.end} of tube {join.tube} joins {join.to} and is "
                    f"{self.tubes[join.tube].ends[join.end]} as well: leave it free"
                )
            place = self.tubes[join.tube].places[-join.end]
            away = place - self.tubes[join.to].places[self.joined_node(join)]
            if np.sqrt((away**2).sum()) > MEETS:
                raise ValueError(
                    f"end {join.end} of tube {join.tube} is {np.sqrt((away**2).sum()):.3g} mm away "
                    f"from {join.to} at {join.at:g} mm, which it joins"
                )

    def joined_node(self, join: Join) -> int:
        """Return the number of the node that a join is at, among those of the tube it joins."""
        to = self.tubes[join.to]
        at = finite(join.at, f"place where {join.tube} joins {join.to}", "mm")
        node = int(np.argmin(np.abs(to.stations - at)))
        if abs(to.stations[node] - at) > NEAR * to.span:
            raise ValueError(
                f"tube {join.tube} joins {join.to} at {at:g} mm, where that has no node: the "
                f"nearest is at {to.stations[node]:g} mm"
            )
        return node

    @property
    def span(self) -> float:
        """Length of the longest tube, mm."""
        return max(each.span for each in self.tubes.values())

    def numbered(self) -> list[Ints]:
        """Return the nodes of each tube along it, numbered tube by tube; joined ends share one."""
        out: dict[str, Ints] = {}
        count = 0
        for name, tube in self.tubes.items():
            nodes = np.full(tube.stations.size, -1, dtype=np.int64)
            for join in self.joins:
                if join.tube == name:
                    nodes[-join.end] = out[join.to][self.joined_node(join)]
            new = nodes < 0
            nodes[new] = count + np.arange(int(new.sum()))
            count += int(new.sum())
            out[name] = nodes
        return list(out.values())


@dataclass(frozen=True, slots=True)
class Elimination:
    """An order in which a symmetric matrix's rows are eliminated, and its blocks above them.

    The next is always a row with the fewest blocks left, of those the first: along one branch that
    is one row after the other, a tree gets no further blocks, and a ring one a row.
    """

    order: Ints  # (N,) rows as they are eliminated
    first: Ints  # (N + 1,) number of the first block of each, in that order
    columns: Ints  # (B,) of the blocks: places in that order, growing within a row
    # (P,) of all pairs of blocks of a row, one row after the other, the block that their product
    # is taken from
    products: Ints

    @classmethod
    @lru_cache(maxsize=16)
    def of(cls, rows: int, pairs: frozenset[tuple[int, int]]) -> "Elimination":
        """Return that of a matrix with blocks at some pairs of rows; beds of a duct share it."""
        near: list[set[int]] = [set() for _ in range(rows)]
        for i, j in pairs:
            near[i].add(j)
            near[j].add(i)
        left, order = set(range(rows)), list[int]()
        while left:
            row = min(left, key=lambda i: (len(near[i]), i))
            left.discard(row)
            order.append(row)
            for i in near[row]:
                near[i] |= near[row]
                near[i] -= {i, row}
        at = np.empty(rows, dtype=np.int64)
        at[order] = np.arange(rows)
        columns = [sorted(int(at[j]) for j in near[i]) for i in order]
        first = np.concatenate([[0], np.cumsum([len(each) for each in columns])]).astype(np.int64)
        block = {
            (i, j): int(first[i]) + k for i, each in enumerate(columns) for k, j in enumerate(each)
        }
        products = [
            block[j, each[b]]
            for each in columns
            for a, j in enumerate(each)
            for b in range(a + 1, len(each))
        ]
        flat = [j for each in columns for j in each]
        return cls(
            np.array(order, dtype=np.int64),
            first,
            np.array(flat, dtype=np.int64),
            np.array(products, dtype=np.int64),
        )

    def block(self, i: int, j: int) -> int:
        """Return the number of the block of two places in the order, -1 where there is none."""
        i, j = min(i, j), max(i, j)
        row = self.columns[self.first[i] : self.first[i + 1]]
        k = int(np.searchsorted(row, j))
        return int(self.first[i]) + k if k < row.size and row[k] == j else -1
