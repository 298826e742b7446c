"""Export: what is on the screen, as a file for other tools."""

from collections.abc import Callable, Mapping
from typing import Any

import viser

from app.trainer.client.client_state import ClientState
from app.trainer.pages.downloads import Download
from app.trainer.panel.controls import on_click

__all__ = ["ExportBox"]


class ExportBox:
    """A choice of file type and a button that sends the file that `make` returns for a suffix."""

    def __init__(
        self,
        gui: viser.GuiApi,
        state: ClientState[Any, Any],
        suffixes: Mapping[str, str],
        make: Callable[[str], Download],
        hint: str,
    ) -> None:
        self._state, self._make = state, make
        self._suffixes = {label: suffix for suffix, label in suffixes.items()}
        self._kind = gui.add_dropdown("Export as", tuple(self._suffixes), hint=hint)
        button = gui.add_button("Download file", icon=viser.Icon.DOWNLOAD, color="gray")
        on_click(button, self._send)

    def _send(self) -> None:
        make, suffix = self._make, self._suffixes.get(self._kind.value)
        if suffix is not None:
            self._state.attempt("Writing the file.", lambda: self._state.send_file(*make(suffix)))
