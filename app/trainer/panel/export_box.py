"""Export: what is on the screen, as a file for other tools."""

from collections.abc import Callable, Mapping

import viser

from app.trainer.client.client_state import ClientState
from app.trainer.pages.downloads import Download
from app.trainer.panel.controls import on_click

__all__ = ["add_export"]


def add_export(
    gui: viser.GuiApi,
    state: ClientState,
    suffixes: Mapping[str, str],
    make: Callable[[str], Download],
    hint: str,
) -> None:
    """Add a choice of file type, and a button that sends the file that `make` makes of a suffix."""
    by_label = {label: suffix for suffix, label in suffixes.items()}
    kind = gui.add_dropdown("Export as", tuple(by_label), hint=hint)
    button = gui.add_button("Download file", icon=viser.Icon.DOWNLOAD, color="gray")

    def send() -> None:
        suffix = by_label.get(kind.value)
        if suffix is not None:
            state.attempt("Writing the file.", lambda: state.send_file(*make(suffix)))

    on_click(button, send)
