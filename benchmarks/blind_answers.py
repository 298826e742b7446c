"""Answers *Who is who* by rules that look at no anatomy.

A picture is seen through the scope as the page holds it first. A rule always says that it is not
yet safe to tell, or names tubes: by lot, at the same three places of every picture, or by an order,
as the second from the left. Of the rules of a family all are tried. The best is kept, as somebody
learns it who has seen all answers; beside it stands how it fares at pictures that it was not chosen
by. Only of open pictures is anything to be named: a stage can be told without any anatomy.
"""

import math
from functools import cache
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from app.anatomy import anatomy_network, drawn_anatomy
from app.simulation import (
    FEW,
    FIELD_OF_VIEW,
    STRUCTURES,
    Exercise,
    Safety,
    Session,
    Specimen,
    exercise_at,
    pointed_at,
)
from app.trainer.client.picture_series import KINDS, PICTURES
from app.trainer.scope.held_scope import HeldScope

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]

GRID, RANKS, DRAWS = 21, 6, 10_000
"""Places across a picture that are pointed at; first tubes of an order that are taken; answers that
are drawn by lot of each picture."""
ORDERS = ("leftmost", "rightmost", "lowest", "uppermost", "nearest", "most seen", "middlemost")


class Picture(NamedTuple):
    """A picture, and what is seen of it."""

    kind: str
    session: Session
    exercise: Exercise
    places: Ints  # (GRID * GRID,) the tube that is seen first at each place, -1 where none is
    orders: Ints  # (len(ORDERS), RANKS) tubes by order, -1 where there are no more
    right: Bools  # (3, tubes + 1) whether a tube is the structure; the last of a row: none is there

    @property
    def weight(self) -> float:
        """How often a round has it."""
        kind = KINDS[self.kind]
        return kind.number / len(kind.seeds)

    def passes(self, *tubes: int) -> bool:
        """Name tubes, or say that it is not yet safe with none; return whether that is right."""
        session = self.session
        session.start_exercise(self.exercise)
        for structure, tube in zip(STRUCTURES, tubes, strict=False):
            session.mark(structure, tube, 0.0)
        if not tubes:
            session.call_unsafe()
        session.advance()
        return session.run.outcome is not None and session.run.outcome.passed


@cache
def pictures() -> tuple[Picture, ...]:
    """Return all pictures of the page."""
    return tuple(_picture(name, seed) for name, kind in KINDS.items() for seed in kind.seeds)


def _picture(kind: str, seed: int) -> Picture:
    anatomy = drawn_anatomy(seed)
    session = Session(Specimen.of_anatomy(anatomy), vertices=FEW, watched=False)
    exercise = exercise_at(anatomy, "who_is_who")
    assert exercise is not None
    session.start_exercise(exercise)
    tissue = session.spatial
    names, camera = tissue.tubes.names, HeldScope(anatomy_network(anatomy)).camera
    wide, across = math.tan(0.5 * FIELD_OF_VIEW), np.linspace(-0.95, 0.95, GRID)
    places = np.full(GRID * GRID, -1)
    seen: dict[int, list[tuple[float, float, float]]] = {}
    for at, (up, right) in enumerate(product(across, across)):
        if math.hypot(up, right) > 1.0:  # the picture is round
            continue
        ray = camera.axes @ np.array([wide * right, wide * up, -1.0])
        found = pointed_at(tissue.beam, camera.tip, ray)
        if found is not None:
            tube, station = found
            place = tissue.beam.places_at(np.array([station]), names[tube])[0]
            places[at] = tube
            seen.setdefault(tube, []).append((right, up, camera.seen(place)[1]))
    keys: dict[int, tuple[float, ...]] = {}
    for tube, spots in seen.items():
        x, y, deep = np.array(spots).T
        middle = np.hypot(x, y).min()
        keys[tube] = x.min(), -x.max(), y.min(), -y.max(), deep.min(), -x.size, middle
    orders = np.full((len(ORDERS), RANKS), -1)
    for number, row in enumerate(orders):
        first = sorted(keys, key=lambda tube: keys[tube][number])[:RANKS]
        row[: len(first)] = first
    is_right = np.zeros((len(STRUCTURES), len(names) + 1), dtype=np.bool_)
    for row, structure in zip(is_right, STRUCTURES, strict=True):
        row[[names.index(name) for name in Safety(tissue).tubes_of[structure]]] = True
    return Picture(kind, session, exercise, places, orders, is_right)


class _Rules:
    """All rules that take each structure by one of some choices, (C, P) tubes in each picture."""

    def __init__(self, choices: Ints) -> None:
        self._choices = choices
        self._ways: list[tuple[Bools, Ints]] = []  # those that differ, and which choices they are
        for structure in range(len(STRUCTURES)):
            rows = zip(pictures(), choices.T, strict=True)
            right = np.array([each.right[structure][row] for each, row in rows]).T
            self._ways.append(np.unique(right, axis=0, return_index=True))

    def best(self, weights: Floats) -> tuple[Ints, Bools]:
        """Return the (3, P) tubes of the rule that names most by (P,) weights, and its hits."""
        (one, first), (two, second), (three, third) = self._ways
        most, found = -1.0, (0, 0, 0)
        for i, row in enumerate(one):
            named = ((two & row) * weights) @ three.T.astype(np.float64)
            j, k = divmod(int(named.argmax()), len(three))
            if named[j, k] > most:
                most, found = float(named[j, k]), (i, j, k)
        i, j, k = found
        return self._choices[[first[i], second[j], third[k]]], one[i] & two[j] & three[k]

    def at_others(self, weights: Floats) -> float:
        """Return what is named of each picture by the best rule of all the others."""
        total = 0.0
        for at in np.flatnonzero(weights):
            others = weights.copy()
            others[at] = 0.0
            total += float(weights[at] * self.best(others)[1][at])
        return total


def by_lot(picture: Picture) -> float:
    """Return how often three tubes that are drawn of all that are seen are the right ones."""
    tubes = np.unique(picture.places[picture.places >= 0])
    draw = np.random.default_rng(1).random((DRAWS, tubes.size))
    three = tubes[draw.argsort(axis=1)[:, : len(STRUCTURES)]]
    rows = zip(picture.right, three.T, strict=True)
    return float(np.all([right[taken] for right, taken in rows], axis=0).mean())


def measure_blind_answers(console: Console) -> dict[str, Any]:
    """Print and return how many of a round's pictures blind rules answer rightly, in the mean."""
    with console.status("Pictures ..."):
        all_of = pictures()
    unsafe = np.array([each.passes() for each in all_of])
    weights = np.array([each.weight for each in all_of])
    to_name = weights * ~unsafe
    by_order = np.stack([each.orders for each in all_of], axis=-1)
    families = {name: by_order[i] for i, name in enumerate(ORDERS)}
    families["any orders"] = by_order.reshape(-1, len(all_of))
    families["three places"] = np.stack([each.places for each in all_of], axis=-1)
    figures: dict[str, Any] = {
        "pictures": len(all_of),
        "to be named": float(to_name.sum()),
        "not yet safe": float((weights * unsafe).sum()),
        "by lot": float(sum(to_name * [by_lot(each) for each in all_of])),
    }
    lines = [
        f"{len(all_of)} pictures; right of a round's {PICTURES}, in the mean:",
        f"  not yet safe, always: {figures['not yet safe']:.2f}",
        f"  by lot: {figures['by lot']:.2f}",
    ]
    for name, choices in families.items():
        rules = _Rules(choices)
        tubes, _ = rules.best(to_name)
        right = [each.passes(*row) for each, row in zip(all_of, tubes.T.tolist(), strict=True)]
        named, others = float((weights * right).sum()), rules.at_others(to_name)
        figures[name] = {"named": named, "at others": others}
        lines.append(f"  {name}: {named:.2f} by the best, {others:.2f} at pictures not chosen by")
    for line in lines:
        console.print(line, highlight=False)
    return figures
