"""Take the pictures in docs/: `make screenshots`. Needs Chromium, as the browser tests do."""

import sys
import time
from pathlib import Path

import numpy as np
from browser import (
    PATIENCE,
    TrainerPage,
    close_browser,
    newest_dissection,
    running_browser,
    trainer_page,
)
from playwright.sync_api import Browser, expect
from simulated import bed_exercises, phantom

from app.simulation import MANNERS, Feedback, perform
from app.trainer.server.trainer import Trainer

WIDE, PHONE = (1440, 900), (390, 844)


def close_hint(tab: TrainerPage) -> None:
    """Close what is said of a browser that draws in software, and hide hints of the mouse."""
    close = tab.page.get_by_role("alert").filter(has_text="Software WebGL").get_by_role("button")
    if close.count():
        close.first.dispatch_event("click")  # a page that draws slowly takes long to stand still
        expect(close).to_have_count(0)
    tab.page.mouse.move(2.0, 2.0)  # a hint would cover what is beside it


def take(tab: TrainerPage, path: Path) -> None:
    """Wait until the picture stands still, and keep it."""
    close_hint(tab)
    last = b""
    for _ in range(40):
        time.sleep(1.0)
        now = tab.page.screenshot(type="jpeg", quality=88, timeout=5.0 * PATIENCE)
        if now == last:
            break
        last = now
    path.write_bytes(last)
    print(path)


def take_result(trainer: Trainer, browser: Browser, folder: Path) -> None:
    """Have good hands do an exercise, and take the picture of its result."""
    with trainer_page(browser, trainer.address, width=WIDE[0], height=WIDE[1]) as tab:
        close_hint(tab)  # the result will lie over it
        state = newest_dissection(trainer).state
        session = state.session
        state.start_exercise(bed_exercises(session)[0], Feedback.CONTINUOUS)
        perform(session, MANNERS["window"]["good"])
        tab.page.get_by_test_id("outcome").wait_for()
        tab.page.get_by_role("tab", name="Over time").click()
        take(tab, folder / "trainer-result.jpg")


def take_dissection(trainer: Trainer, browser: Browser, folder: Path, *, phone: bool) -> None:
    """Take pictures of a duct that a hook has half freed, with a dissector behind it."""
    width, height = PHONE if phone else WIDE
    with trainer_page(browser, trainer.address, width=width, height=height) as tab:
        state = newest_dissection(trainer).state
        session = state.session
        place = session.grab(0, 20.0)
        assert place is not None
        session.move_hand(0, place + np.array([0.0, 0.0, 7.0]))
        state.choose_instrument(1, "dissector")
        behind = session.spatial.hands[1].place
        session.move_hand(1, np.array([32.0, 4.0, behind[2]]))
        tab.wait_until(lambda: session.spatial.hands[1].arrived)
        session.open_jaws(1, 8.0)
        tab.wait_until(lambda: all(hand.arrived for hand in session.spatial.hands))
        take(tab, folder / f"trainer-dissect{'-phone' if phone else ''}.jpg")
        if not phone:
            tab.press("Freed")
            take(tab, folder / "trainer-freed.jpg")


def take_pull(trainer: Trainer, browser: Browser, folder: Path) -> None:
    """Take the picture of a pull in the colours of its stress."""
    width, height = WIDE
    with trainer_page(
        browser, trainer.address, width=width, height=height, query="&scene=free"
    ) as tab:
        tab.slide("Force F (N)", 3.0)
        tab.wait_for_force(3.0)
        tab.page.keyboard.press("Escape")
        tab.press("Stress")
        take(tab, folder / "trainer-heat.jpg")


def main(folder: Path) -> None:
    """Take the pictures that the documents show."""
    folder.mkdir(parents=True, exist_ok=True)
    trainer = Trainer(phantom(), port=0)
    try:
        with running_browser(drawing=True) as browser:
            take_result(trainer, browser, folder)
            take_pull(trainer, browser, folder)
            for phone in (True, False):
                take_dissection(trainer, browser, folder, phone=phone)
    finally:
        close_browser()
        trainer.stop()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
