"""A dialog: a page over the trainer that can always be closed."""

from collections.abc import Callable
from typing import Self

import viser

from app.trainer.panel.controls import on_click
from app.trainer.viser_bridge.page import closer_html

__all__ = ["Dialog"]


class Dialog:
    """A dialog with a closing button in its corner, which Escape and a click beside it press.

    As a context it takes the widgets added to it; `closed` is called however it was closed.
    """

    def __init__(
        self, gui: viser.GuiApi, title: str, *, closed: Callable[[], object] = lambda: None
    ) -> None:
        self._closed = closed
        self._modal = gui.add_modal(title)
        with self._modal:
            gui.add_html(closer_html())
            on_click(gui.add_button("Close", icon=viser.Icon.X, color="gray"), self.close)

    def __enter__(self) -> Self:
        self._modal.__enter__()
        return self

    def __exit__(self, *_: object) -> None:
        self._modal.__exit__()  # pyright: ignore[reportUnknownMemberType]

    def close(self) -> None:
        """Close it, if it is open."""
        if not self._modal.closed:
            self._modal.close()
            self._closed()
