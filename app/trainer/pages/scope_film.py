"""Films of a run at an anatomy as its scope's camera saw it, drawn by a headless browser."""

import shutil
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
import viser
from numpy.typing import NDArray

from app.anatomy import anatomy_network
from app.simulation import TICKS_PER_SECOND, Replay
from app.trainer.pages.scope_player import follow
from app.trainer.scope.drawn_tissue import draw_tissue, picture_of
from app.trainer.scope.held_scope import HeldScope
from app.trainer.viser_bridge.page import prepare_page
from app.trainer.viser_bridge.private_api import start_server, stop_server

Dots = NDArray[np.uint8]

RATE = 10
"""Pictures a second of a film."""
MOST_PICTURES = 200
"""Of a film: twenty seconds. A longer run is shown faster."""
SIDE = 480
"""Dots of a film's sides."""
QUALITY = 75
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
HIDDEN = (
    "body *:not(:has(canvas), canvas, .bd-scope-frame, .bd-scope-lens)"
    " { visibility: hidden !important }"
)
READY = "() => document.documentElement.classList.add('bd-ready')"
"""Uncovers a page, which for its first 15 s would be covered until something is laid over it."""
DRAWN = "() => [bluntdissectScope.picture.state.frames, bluntdissectScope.picture.drawn]"
SOFTWARE = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
NO_BROWSER = (
    "a film is drawn by a browser, and none could be started: pip install 'bluntdissect[film]', "
    "and install Chromium (Debian: apt install chromium; elsewhere: playwright install chromium)"
)


@contextmanager
def filmed(replay: Replay, held: HeldScope, size: tuple[int, int]) -> Generator[Callable[[], Dots]]:
    """Give a function that takes a picture, (H, W, 3) blue, green and red, of a replay as it is.

    Parameters
    ----------
    replay, held
        What is seen, and the scope through which.
    size
        Width and height, dots.

    Raises
    ------
    ValueError
        If there is no browser.
    """
    try:
        from playwright.sync_api import Error, sync_playwright
    except ImportError as error:
        raise ValueError(NO_BROWSER) from error
    server = start_server("127.0.0.1", 0, lambda _, __: None)
    pages: list[viser.ClientHandle] = []

    @server.on_client_connect
    def _(client: viser.ClientHandle) -> None:  # pyright: ignore[reportUnusedFunction]
        prepare_page(client)
        pages.append(client)

    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    width, height = size
    try:
        with sync_playwright() as driver:
            try:
                browser = driver.chromium.launch(
                    executable_path=found, args=["--no-sandbox", *SOFTWARE]
                )
            except Error as error:
                raise ValueError(NO_BROWSER) from error
            page = browser.new_page(
                viewport={"width": width, "height": height}, device_scale_factor=1
            )
            page.set_default_timeout(300_000)
            page.goto(f"http://127.0.0.1:{server.get_port()}/?fixedDpr=1&hideGuiPanel")
            page.wait_for_function("() => window.__viserMutable?.scene")
            while not pages:
                page.wait_for_timeout(50)
            tissue = replay.session.spatial
            picture = picture_of(pages[0].scene, held.made, tissue, held.scope)
            draw_tissue(picture, tissue, held)
            page.wait_for_function(
                "() => window.bluntdissectScope?.picture?.state?.frames > 0"
                " && bluntdissectScope.picture.drawn > 0"
            )
            page.add_style_tag(content=HIDDEN)
            page.evaluate(READY)

            def take() -> Dots:
                before = page.evaluate(DRAWN)
                if draw_tissue(picture, tissue, held):
                    page.wait_for_function(
                        "([n, m]) => bluntdissectScope.picture.state.frames > n"
                        " && bluntdissectScope.picture.drawn > m",
                        arg=before,
                    )
                shot = np.frombuffer(page.screenshot(), np.uint8)
                return np.asarray(cv2.imdecode(shot, cv2.IMREAD_COLOR), dtype=np.uint8)

            yield take
            browser.close()
    finally:
        stop_server(server)


def write_film(replay: Replay, path: Path, *, pictures: int | None = None, side: int = SIDE) -> int:
    """Write a run at an anatomy as a film.

    Parameters
    ----------
    replay
        The run.
    path
        A .webm or .webp file.
    pictures
        How many: by default `RATE` a second, at most `MOST_PICTURES`.
    side
        Dots of the film's sides.

    Returns
    -------
    int
        How many pictures it has.

    Raises
    ------
    ValueError
        If there is no browser that draws it, or the file cannot be written.
    """
    anatomy = replay.session.specimen.anatomy
    if anatomy is None:
        raise ValueError("a film is of a run at an anatomy")
    held = HeldScope(anatomy_network(anatomy))
    last = replay.ticks
    count = pictures or min(MOST_PICTURES, max(2, last * RATE // TICKS_PER_SECOND))
    at, out = 0, list[Dots]()
    with filmed(replay, held, (side, side)) as take:
        for tick in np.rint(np.linspace(0.0, last, count)).astype(int).tolist():
            replay.seek_tick(tick)
            follow(held, replay.session, tick - at)
            at = tick
            out.append(take())
    _write(path, out)
    return len(out)


def _write(path: Path, pictures: list[Dots]) -> None:
    if path.suffix.lower() == ".webp":
        film = cv2.Animation()
        film.frames = pictures
        film.durations = [1000 // RATE] * len(pictures)
        if not cv2.imwriteanimation(str(path), film, [cv2.IMWRITE_WEBP_QUALITY, QUALITY]):
            raise ValueError(f"cannot write {path}")
        return
    height, width = pictures[0].shape[:2]
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"VP80"), RATE, (width, height))
    if not writer.isOpened():
        raise ValueError(f"cannot write {path}: this OpenCV has no WebM; take a .webp")
    for each in pictures:
        writer.write(each)
    writer.release()
