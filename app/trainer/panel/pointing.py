"""What an exercise asks to be pointed at: a row of structures, each marked or not."""

import html
from functools import partial

import viser

from app.simulation import STRUCTURES
from app.trainer.client.page_state import PageState
from app.trainer.client.scope_lead import ScopeLead
from app.trainer.panel.controls import command, set_if_changed
from app.trainer.viser_bridge.private_api import page_number

HINT = "Choose it, then press it in the picture; by keys: the arrows move the cross, G marks (K)"
UNSAFE = "Too little is seen to tell them apart (U)"


class Pointing:
    """The row of what is to be pointed at; hidden while nothing is."""

    def __init__(self, gui: viser.GuiApi, state: PageState, lead: ScopeLead) -> None:
        self._state, self._lead = state, lead
        self._numbers = {
            each: page_number(
                command(
                    gui,
                    f"Point at the {each}",
                    HINT,
                    partial(lead.pointer.choose, each),
                    slow=False,
                )
            )
            for each in STRUCTURES
        }
        self._unsafe = page_number(
            command(gui, "Not yet safe to tell", UNSAFE, lead.pointer.call_unsafe, slow=False)
        )
        self._row = gui.add_html("", visible=False)

    def show(self) -> None:
        """Show what is marked, and what the pointer marks now."""
        lead, tissue = self._lead, self._state.session.spatial
        asked = lead.asked.structures
        set_if_changed(self._row, visible=bool(asked))
        if not asked:
            return
        marked = {each.structure for each in tissue.marks}
        buttons = [
            _button(
                self._numbers[each], "\N{CHECK MARK} " * (each in marked) + each.capitalize(), HINT,
                pressed=each == lead.pointer.structure,
            )
            for each in asked
        ]  # fmt: skip
        exercise = self._state.session.run.exercise
        if exercise is not None and exercise.looks_only:
            buttons.append(_button(self._unsafe, "Not yet safe", UNSAFE, pressed=False))
        content = (
            "<div class='bd-choice bd-points' role='group' aria-label='Point at' "
            f"data-testid='point-at'><span>Point at</span><div>{''.join(buttons)}</div></div>"
        )
        set_if_changed(self._row, content=content)


def _button(number: str, text: str, hint: str, *, pressed: bool) -> str:
    return (
        f"<button type='button' data-command='{number}' title='{html.escape(hint, quote=True)}' "
        f"aria-pressed='{'true' if pressed else 'false'}'>{html.escape(text)}</button>"
    )
