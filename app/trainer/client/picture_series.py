"""The pictures of *Who is who*, ten a round, one after another, and what came of each."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from app.anatomy import Anatomy
from app.simulation import Exercise, Outcome


class Kind(NamedTuple):
    """A kind of picture: how many a round has, and the seeds of anatomies that are drawn for it."""

    number: int
    seeds: tuple[int, ...]


KINDS: Mapping[str, Kind] = {
    "covered": Kind(2, (3, 6, 9, 12, 15, 18, 21, 27, 30, 36, 42, 54, 57, 60, 66, 69, 72, 75, 78)),
    "half open": Kind(
        3, (4, 10, 13, 16, 19, 22, 25, 28, 31, 34, 37, 46, 49, 55, 58, 67, 70, 73, 79)
    ),
    "short cystic duct": Kind(1, (20, 41, 65, 173)),
    "drawn-out common duct": Kind(1, (11, 47, 53, 143, 149, 155, 209, 215)),
    "parallel duct": Kind(1, (14, 125, 128, 233)),
    "two arteries": Kind(1, (80, 242, 254)),
    "open": Kind(1, (2, 5, 8, 23, 26, 44, 62, 71, 74, 83, 92, 95, 116, 131, 134, 146)),
}
"""Half open and covered pictures are not safe to tell; the others are open, four with a trap."""
PICTURES = sum(kind.number for kind in KINDS.values())
"""Of a round."""


@dataclass(slots=True)
class PictureSeries:
    """How far somebody has come with a round of pictures, which `random` draws."""

    random: np.random.Generator = field(default_factory=np.random.default_rng)
    exercise: Exercise | None = None  # of the picture that is shown
    answers: list[Outcome] = field(default_factory=list[Outcome])
    seeds: list[int] = field(default_factory=list[int])  # of the round
    anatomy: Anatomy | None = None  # of the last picture
    before: Anatomy | None = None  # shown before the first picture

    def __post_init__(self) -> None:
        """Draw the first round."""
        self.begin_anew()

    def begin_anew(self) -> None:
        """Draw another round, none of whose pictures the last one had."""
        before = set(self.seeds)
        drawn = [
            self.random.choice(sorted({*kind.seeds} - before), kind.number, replace=False)
            for kind in KINDS.values()
        ]
        self.seeds = self.random.permutation(np.concatenate(drawn)).tolist()
        self.answers = []

    @property
    def seed(self) -> int:
        """Of the next picture."""
        return self.seeds[len(self.answers)]

    @property
    def over(self) -> bool:
        """Whether all have been answered."""
        return len(self.answers) == PICTURES

    def take(self, exercise: Exercise | None, outcome: Outcome | None) -> None:
        """Take an answer, if it is of the picture that is shown."""
        if outcome is not None and exercise is not None and exercise == self.exercise:
            self.answers.append(outcome)
            self.exercise = None

    @property
    def score(self) -> str:
        """How many were right, in words."""
        right = sum(each.passed for each in self.answers)
        done = f"{right} of {len(self.answers)} pictures right"
        return f"{done}." if self.over else f"{done} so far, of {PICTURES}."
