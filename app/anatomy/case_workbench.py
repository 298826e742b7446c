"""A case on which tubes, joins and ends are chosen before it is practised on."""

import threading
from collections.abc import Callable
from pathlib import Path

import msgspec

from app.anatomy.anatomy_geometry import tube_lines
from app.anatomy.figure import anatomy_figure
from app.anatomy.patient_case import (
    CaseBuilder,
    CaseChoices,
    TubeEndName,
    write_case,
)
from physics.bed import End

# Of the picture, beside the panel's fields.
_INCHES = (4.4, 6.0)


class CaseWorkbench:
    """One case, as it is now; a choice that cannot be leaves it as it was.

    Its methods may be called from any thread.

    Parameters
    ----------
    builder
        The tubes that were found.
    folder
        Where the case is saved.
    choices
        What it begins with.
    done
        Called when a tube is made of those.
    """

    def __init__(
        self,
        builder: CaseBuilder,
        folder: Path,
        choices: CaseChoices,
        *,
        done: Callable[[], object] = lambda: None,
    ) -> None:
        self._builder, self.folder = builder, folder
        self._lock = threading.Lock()
        self.choices, self.case = choices, builder.build(choices, done=done)
        self.practised = False
        """Whether it has been shown as it is now."""

    @property
    def tubes(self) -> tuple[str, ...]:
        """Names of all tubes that were found, those left out among them."""
        return tuple(self._builder.kinds)

    @property
    def takes_artery(self) -> bool:
        """Whether a cystic artery can be drawn in."""
        return self._builder.takes_artery

    def end(self, name: TubeEndName) -> str:
        """Return how an end is held, or "joins" and the tube that it joins."""
        tube, end = name
        for join in self.case.anatomy.join:
            if (join.tube, join.end) == name:
                return f"joins {join.to}"
        return self.case.anatomy.tube_named(tube).ends[end]

    def leave_out(self, tube: str, out: bool) -> None:
        """Leave a tube out, or take it in again."""
        without = self.choices.without
        self._choose(without=without | {tube} if out else without - {tube})

    def join(self, name: TubeEndName, to: str) -> None:
        """Let an end join another tube."""
        self._choose(joins={**self.choices.joins, name: to})

    def hold(self, name: TubeEndName, how: End) -> None:
        """Let an end join no tube and be held in another way."""
        self._choose(
            joins={**self.choices.joins, name: None}, held={**self.choices.held, name: how}
        )

    def draw_artery(self, wanted: bool) -> None:
        """Draw in a cystic artery, assumed, or none."""
        self._choose(draw_artery=wanted)

    def save(self) -> list[Path]:
        """Write the case into its folder and return the files."""
        return write_case(self.case.anatomy, self.folder)

    def picture(self, marked: str | None) -> bytes:
        """Return a picture of the tubes and joins as PNG; the ends of one tube are marked."""
        anatomy = self.case.anatomy
        lines = tube_lines(anatomy)
        return anatomy_figure(anatomy, lines, "png", inches=_INCHES, marked=marked)

    def _choose(self, **changed: object) -> None:
        with self._lock:
            choices = msgspec.structs.replace(self.choices, **changed)
            self.case = self._builder.build(choices)
            self.choices, self.practised = choices, False
