"""The page that viser makes of a recording: its light, and the text over its picture."""

import html
import json
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from http import HTTPStatus
from pathlib import Path

import viser

from app.trainer.viser_bridge.page import file_text, run_in_page
from app.trainer.viser_bridge.private_api import start_server, stop_server

_HERE = Path(__file__).parent


@contextmanager
def unseen_server() -> Generator[viser.ViserServer]:
    """Run a server for its scene alone, which viser has not without: nobody gets in."""
    server = start_server(
        "127.0.0.1", 0, lambda visitor, _: visitor.respond(HTTPStatus.FORBIDDEN, "No page here.\n")
    )
    try:
        yield server
    finally:
        stop_server(server)


def write_caption(server: viser.ViserServer, words: str) -> None:
    """Write into the `caption` line of a recording's page.

    Not a label of viser's: those are drawn in the scene, where no screen reader finds them and text
    over the picture hides them.
    """
    run_in_page(
        server.scene, f"document.getElementById('caption').textContent = {json.dumps(words)}"
    )


def recording_page(
    page: str, title: str, notes: Sequence[str], *, distance: float, aspect: float
) -> str:
    """Return viser's page of a recording with steady light, and with a title and notes over it."""
    # The camera's distance, mm, shows the whole in a window of this width by height.
    shown = html.escape(title)
    lines = "\n".join(f'<p class="note">{html.escape(note)}</p>' for note in notes)
    overlay = file_text(_HERE / "recording.html").replace("@distance", f"{distance:.6g}")
    overlay = overlay.replace("@aspect", f"{aspect:.6g}")
    overlay = overlay.replace("@title", shown).replace("@notes", lines)
    # The page's script contains such tags as text; the head's is the first, the body's the last.
    before, after = page.split("<title>", 1)
    rest = after.split("</title>", 1)[1]
    head, rest = rest.split("</head>", 1)
    body, end = rest.rsplit("</body>", 1)
    script = f"<script>{file_text(_HERE / 'recording.js')}</script>"
    return f"{before}<title>{shown}</title>{head}{script}</head>{body}{overlay}</body>{end}"
