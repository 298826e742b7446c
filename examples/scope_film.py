"""Film scripted hands at an anatomy through the laparoscope, by a headless Chromium.

python examples/scope_film.py docs/images/scope.webp [assets/scripts/hasty.toml]

It needs what the browser's tests need: pip install 'bluntdissect[test]', and a Chromium.
"""

import io
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import viser
from PIL import Image
from playwright.sync_api import Page, sync_playwright
from playwright.sync_api import TimeoutError as Late

from app.anatomy import anatomy_named, anatomy_network
from app.simulation import Replay, Session, Specimen, performed, read_script
from app.trainer.client.page_state import PageState
from app.trainer.client.scope_lead import ScopeLead
from app.trainer.client.workers import Workers
from app.trainer.scope.held_scope import HeldScope
from app.trainer.scope.scope_scene import ScopeScene
from app.trainer.viser_bridge.page import prepare_page

ROOT = Path(__file__).parents[1]
SIZE, RATE, FIRST, LAST = 340, 5, 1.6, 5.2
"""Dots of the sides, pictures a second, and seconds of the run from which to which."""
QUALITY = 55
HIDDEN = "body *:not(:has(canvas)):not(canvas):not(.bd-scope-frame)"
PATIENCE = 8000.0
"""ms that a picture is waited for."""
SOFTWARE = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")


def run_of(script: Path) -> Replay:
    """Return a replay of what a script does at the usual anatomy."""
    session = Session(Specimen.of_anatomy(anatomy_named("normal")), vertices=300)
    performed(read_script(script), session)
    return Replay(session.run_file().log, session.tissue.dissection.organ)


@contextmanager
def opened(address: str) -> Iterator[Page]:
    """Open a page that shows the picture alone."""
    with sync_playwright() as driver:
        browser = driver.chromium.launch(
            executable_path="/usr/bin/chromium", args=["--no-sandbox", *SOFTWARE]
        )
        page = browser.new_page(viewport={"width": SIZE, "height": SIZE}, device_scale_factor=1)
        page.set_default_timeout(300_000)
        page.goto(f"{address}/?fixedDpr=1&hideGuiPanel")
        page.wait_for_function("() => window.bluntdissectScope?.picture?.state?.frames > 0")
        page.add_style_tag(content=f"{HIDDEN} {{ visibility: hidden !important }}")
        yield page
        browser.close()


def film(replay: Replay) -> list[Image.Image]:
    """Return the pictures of a run."""
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    held = HeldScope(anatomy_network(anatomy_named("normal")))
    workers, shown = Workers(), list[ScopeScene]()

    @server.on_client_connect
    def _(client: viser.ClientHandle) -> None:
        prepare_page(client)
        lead = ScopeLead(PageState(client, replay.session, workers), held)
        shown.append(ScopeScene(client, replay.session, "full", held, lead))

    pictures: list[Image.Image] = []
    with opened(f"http://127.0.0.1:{server.get_port()}") as page:
        for number in range(round(FIRST * RATE), round(LAST * RATE)):
            replay.seek(number / RATE)
            held.advance([hand.place for hand in replay.session.spatial.hands])
            before = page.evaluate("() => bluntdissectScope.picture.state.frames")
            shown[0].draw(replay.session.reading())
            with suppress(Late):  # where nothing has moved, nothing is sent
                page.wait_for_function(
                    "n => bluntdissectScope.picture.state.frames > n", arg=before, timeout=PATIENCE
                )
            data = page.screenshot(clip={"x": 0, "y": 0, "width": SIZE, "height": SIZE})
            pictures.append(Image.open(io.BytesIO(data)).convert("RGB"))
    server.stop()
    workers.stop()
    return pictures


if __name__ == "__main__":
    output = Path(sys.argv[1])
    script = Path(sys.argv[2]) if len(sys.argv) > 2 else ROOT / "assets" / "scripts" / "hasty.toml"
    first, *rest = film(run_of(script))
    first.save(
        output, save_all=True, append_images=rest, duration=1000 // RATE, loop=0, quality=QUALITY
    )
