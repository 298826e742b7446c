"""What a trainee sees of the class: the name, what is set, and whether results are saved."""

import html
import time
from collections.abc import Callable
from dataclasses import dataclass

import viser

from app.classroom.report import standing_svg
from app.classroom.results import Standing
from app.classroom.store import LONGEST_NAME
from app.trainer.panel.controls import note, on_click, set_if_changed

__all__ = ["Card", "ClassCard"]

# s after which what was typed before a click has come: the page sends a field's text a moment after
# the last key.
TYPED_SECONDS = 0.2
FIRST = -10.0
"""Order of the card, above all else of the panel."""
WHY_A_NAME = (
    "Your teacher sees your name, your duct and your results. Nothing is kept before you join; "
    "your teacher can delete all that is kept of you."
)


@dataclass(frozen=True, slots=True)
class Card:
    """What the card says; `name` is None for who has not joined."""

    title: str
    name: str | None
    exercise: str  # title and text of what is set, as HTML; empty without
    can_start: bool
    saved: str
    last: str  # the last result, or what is gone
    standing: Standing | None


class ClassCard:
    """The card of one page."""

    def __init__(
        self, gui: viser.GuiApi, join: Callable[[str], object], start: Callable[[], object]
    ) -> None:
        self._folder = gui.add_folder("Class", order=FIRST)
        with self._folder:
            self._text = gui.add_html("")
            self._name = gui.add_text("Your name", "", visible=False)
            self._join = gui.add_button("Join the class", visible=False)
            self._start = gui.add_button(
                "Do the class's exercise", icon=viser.Icon.PLAYER_PLAY, visible=False
            )
            self._below = gui.add_html("", visible=False)

        def join_as_typed() -> None:
            time.sleep(TYPED_SECONDS)
            join(str(self._name.value)[: 4 * LONGEST_NAME])

        on_click(self._join, join_as_typed)
        on_click(self._start, start)

    def show(self, card: Card) -> None:
        """Show a card."""
        new = card.name is None
        who = "" if new else f"<b data-testid='class-name'>{html.escape(card.name or '')}</b> · "
        parts = [note(f"{who}{html.escape(card.title)}", "class-title")]
        if new:
            parts.append(note(WHY_A_NAME))
        elif card.exercise:
            parts.append(note(card.exercise, "class-exercise"))
        set_if_changed(self._text, content="".join(parts))
        set_if_changed(self._name, visible=new)
        set_if_changed(self._join, visible=new)
        set_if_changed(self._start, visible=not new and card.can_start)
        below = [
            note(html.escape(text), test)
            for text, test in ((card.last, "class-last"), (card.saved, "class-saved"))
            if text and not new
        ]
        if (where := card.standing) is not None and not new:
            below.append(
                note(
                    f"{where.passed} of {where.tried} have passed. You are the bright mark."
                    f"{standing_svg(where)}",
                    "class-standing",
                )
            )
        set_if_changed(self._below, content="".join(below), visible=bool(below))
