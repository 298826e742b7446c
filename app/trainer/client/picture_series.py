"""The ten pictures of *Who is who*, one after another, and what came of each."""

from dataclasses import dataclass, field

from app.simulation import Exercise, Outcome

PICTURES = (12, 14, 4, 41, 32, 22, 5, 20, 10, 3)
"""Seeds of the anatomies that are drawn for them: five open, three half open, two covered. Of the
open ones two have a short cystic duct, one of them a common duct that is drawn out by traction;
one a parallel duct and one two arteries (`EXPOSED` and `TRACTION_MM` in `exercise_limits`)."""


@dataclass(slots=True)
class PictureSeries:
    """How far somebody has come with the pictures."""

    exercise: Exercise | None = None  # of the picture that is shown
    answers: list[Outcome] = field(default_factory=list[Outcome])

    @property
    def seed(self) -> int:
        """Of the next picture."""
        return PICTURES[len(self.answers)]

    @property
    def over(self) -> bool:
        """Whether all have been answered."""
        return len(self.answers) == len(PICTURES)

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
        return f"{done}." if self.over else f"{done} so far, of {len(PICTURES)}."
