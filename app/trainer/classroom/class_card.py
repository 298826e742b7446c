"""What a trainee sees of the class: the name, what is set, and whether results are saved."""

import html
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import viser

from app.classroom.progress import LevelStanding
from app.classroom.report import standing_svg
from app.classroom.results import Standing
from app.classroom.store import LONGEST_NAME
from app.trainer.panel.controls import note, on_click, set_if_changed
from app.trainer.panel.frame import START_TRY

STATES = {
    "locked": "not open yet",
    "open": "open",
    "mastered": "mastered",
    "due": "to be shown again",
}
COLOURS = {
    "locked": "background:#8884", "open": "background:#8888", "mastered": "background:#1f9d8b",
    "due": "background:#e69f00", "next": "background:#4aa3ff",
}  # fmt: skip

# s after which what was typed before a click has come: the page sends a field's text a moment after
# the last key.
TYPED_SECONDS = 0.2
FIRST = -10.0
"""Order of the card, above all else of the panel."""
START = "Do the class's exercise"
WHY_A_NAME = (
    "Your teacher sees your name, your duct and your results. Nothing is kept before you join; "
    "your teacher can delete all that is kept of you."
)


@dataclass(frozen=True, slots=True)
class Card:
    """What the card says; `name` is None for who has not joined."""

    title: str
    name: str | None
    exercise: str  # of what is set title and text, of a level what to do, as HTML; empty without
    can_start: bool
    saved: str
    last: str  # the last result, or what is gone
    standing: Standing | None
    levels: Sequence[LevelStanding] = ()  # of the course; empty while an exercise is set
    level: LevelStanding | None = None  # of it, the one that comes next


def stair(levels: Sequence[LevelStanding], now: LevelStanding | None) -> str:
    """Return where one stands in a course, as HTML: a stair of its levels, and the one to do."""
    done = sum(each.mastered_at is not None for each in levels)
    steps = "".join(
        f"<span title='{html.escape(each.title)}: {STATES[each.state]}' style='"
        f"display:inline-block;width:{78 / len(levels):.1f}%;margin:0 2px 0 0;"
        f"vertical-align:bottom;border-radius:2px;"
        f"height:{6 + 22 * place / len(levels):.0f}px;"
        f"{COLOURS['next' if each is now else each.state]}'></span>"
        for place, each in enumerate(levels)
    )
    lines = [
        f"<span role='img' aria-label='{done} of {len(levels)} levels mastered' "
        f"style='display:block;height:30px'>{steps}</span>"
    ]
    if now is None:
        lines.append("All levels are mastered. They come again after some weeks.")
    else:
        number = 1 + next(place for place, each in enumerate(levels) if each is now)
        lines.append(
            f"Level {number} of {len(levels)}: <b>{html.escape(now.title)}</b>. "
            + (
                "It was mastered; one pass shows that it is kept."
                if now.state == "due"
                else f"{now.row} of {now.passes} passed in a row."
            )
        )
        if now.last:
            lines.append(f"<br>Last: {html.escape(now.last)}")
        if now.seed is not None:
            lines.append("<br>Each try is another case. <i>Try again</i> is practice on the same.")
    return "".join(lines)


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
            self._start = gui.add_button(START, icon=viser.Icon.PLAYER_PLAY, visible=False)
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
        lines = [note(f"{who}{html.escape(card.title)}", "class-title")]
        if new:
            lines.append(note(WHY_A_NAME))
        if card.levels and not new:
            lines.append(note(stair(card.levels, card.level), "class-levels"))
        if card.exercise and not new:
            lines.append(note(card.exercise, "class-exercise"))
        set_if_changed(self._text, content="".join(lines))
        set_if_changed(self._name, visible=new)
        set_if_changed(self._join, visible=new)
        label = START if card.level is None else START_TRY
        set_if_changed(self._start, visible=not new and card.can_start, label=label)
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
