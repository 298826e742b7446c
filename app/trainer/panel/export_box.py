"""Export: what is on the screen, as a file for other tools."""

import viser

from app.trainer.client.pull_state import PullState
from app.trainer.pages.downloads import SUFFIXES, download
from app.trainer.panel.controls import on_click

__all__ = ["ExportBox"]


class ExportBox:
    """A choice of file type and a button that sends the file."""

    def __init__(self, gui: viser.GuiApi, state: PullState) -> None:
        self._state = state
        self._suffixes = {label: suffix for suffix, label in SUFFIXES.items()}
        self._kind = gui.add_dropdown(
            "Export as", tuple(self._suffixes), hint="The duct as it is now, in a file"
        )
        button = gui.add_button("Download file", icon=viser.Icon.DOWNLOAD, color="gray")
        on_click(button, self._send)

    def _send(self) -> None:
        state, suffix = self._state, self._suffixes.get(self._kind.value)
        if suffix is not None:
            state.attempt("Writing the file.", lambda: self._send_file(suffix))

    def _send_file(self, suffix: str) -> None:
        state = self._state
        file = download(state.shown, suffix)
        state.client.send_file_download(file.name, file.content, save_immediately=True)
