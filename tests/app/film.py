"""Take the film in docs/images: `make screenshots`. Needs Chromium, as the browser tests do."""

import io
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from browser import TrainerPage, close_browser, newest_dissection, running_browser, trainer_page
from PIL import Image
from screenshots import close_hint
from simulated import phantom

from app.trainer.client.page_state import PageState
from app.trainer.server.trainer import Trainer

SIZE = (1240, 760)
SCENE = (0, 40, 880, 760)  # Without the panel and the page's head
WIDTH = 640
DOTS = 0.8
"""A pixel of the page: the film has fewer."""
FRAME_MS = 90


def frames(tab: TrainerPage, state: PageState) -> Iterator[Image.Image]:
    """Lift the duct with a hook and spread its bed with a dissector, a picture at each step."""
    session = state.session

    def shown(place: np.ndarray, hand: int) -> Image.Image:
        session.move_hand(hand, place)
        return taken()

    def taken() -> Image.Image:
        tab.wait_until(lambda: all(hand.arrived for hand in session.spatial.hands))
        tab.page.wait_for_timeout(150)
        whole = Image.open(io.BytesIO(tab.page.screenshot())).convert("RGB").crop(SCENE)
        return whole.resize((WIDTH, WIDTH * whole.height // whole.width), Image.Resampling.LANCZOS)

    place = session.grab(0, 20.0)
    assert place is not None
    for lift in np.linspace(0.0, 7.0, 24):
        yield shown(place + np.array([0.0, 0.0, lift]), 0)
    state.choose_instrument(1, "dissector")
    behind = session.spatial.hands[1].place[2]
    for across in np.linspace(14.0, 4.0, 8):
        yield shown(np.array([32.0, across, behind]), 1)
    for jaws in np.linspace(0.0, 9.0, 12):
        session.open_jaws(1, jaws)
        yield taken()


def main(path: Path) -> None:
    """Write the film as an animated WebP."""
    trainer = Trainer(phantom(), port=0)
    try:
        with (
            running_browser(drawing=True) as browser,
            trainer_page(browser, trainer.address, width=SIZE[0], height=SIZE[1], dots=DOTS) as tab,
        ):
            close_hint(tab.page)
            first, *others = frames(tab, newest_dissection(trainer).state)
            durations = [FRAME_MS] * len(others) + [1500]
            first.save(
                path, save_all=True, append_images=others, duration=durations, loop=0, quality=72
            )
    finally:
        close_browser()
        trainer.stop()
    print(path)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
