"""Export: what is on the screen and what was done, as files for other tools."""

from collections.abc import Callable

import viser

from app.trainer.client.page_state import PageState
from app.trainer.pages.downloads import (
    PLAYED_SUFFIXES,
    RUN_SUFFIXES,
    SUFFIXES,
    Download,
    download,
    run_download,
)
from app.trainer.panel.controls import on_click


def add_export(gui: viser.GuiApi, state: PageState) -> None:
    """Add a choice of file, and a button that sends it."""
    most = state.workers.export_vertices

    def now(suffix: str) -> Download:
        return download(state.shown, suffix, most)

    def run(suffix: str) -> Download:
        state.require_no_exercise()
        organ = state.session.tissue.dissection.organ
        return run_download(state.run_at_hand(), organ, suffix, most)

    # A theory gives the whole pull to where the duct is now; any run can be played.
    files: dict[str, tuple[Callable[[str], Download], str]] = {}
    if state.in_plane:
        files |= {label: (now, suffix) for suffix, label in SUFFIXES.items()}
    runs = PLAYED_SUFFIXES if state.in_plane else RUN_SUFFIXES
    files |= {label: (run, suffix) for suffix, label in runs.items()}
    kind = gui.add_dropdown(
        "Export as", tuple(files), hint="The duct as it is now, or the run from its first touch on"
    )
    button = gui.add_button("Download file", icon=viser.Icon.DOWNLOAD, color="gray")

    def send() -> None:
        if kind.value in files:
            make, suffix = files[kind.value]
            state.attempt("Writing the file.", lambda: state.send_file(*make(suffix)))

    on_click(button, send)
