"""A dialog: a page over the trainer that can always be closed."""

from collections.abc import Callable, Generator
from contextlib import contextmanager

import viser

from app.trainer.panel.controls import on_click
from app.trainer.viser_bridge.page import closer_html


@contextmanager
def dialog(
    gui: viser.GuiApi, title: str, *, closed: Callable[[], object] = lambda: None
) -> Generator[Callable[[], None]]:
    """Open a dialog for the widgets added meanwhile, and give what closes it.

    It has a closing button in its corner, which Escape and a click beside it press; `closed` is
    called however it was closed.
    """
    modal = gui.add_modal(title)

    def close() -> None:
        if not modal.closed:
            modal.close()
            closed()

    with modal:
        gui.add_html(closer_html())
        on_click(gui.add_button("Close", icon=viser.Icon.X, color="gray"), close)
        yield close
