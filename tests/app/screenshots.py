"""Take the pictures in docs/: `make screenshots`. Needs Chromium, as the browser tests do."""

import sys
import time
from pathlib import Path

import numpy as np
from browser import (
    PATIENCE,
    TrainerPage,
    close_browser,
    newest,
    newest_dissection,
    running_browser,
    trainer_page,
)
from playwright.sync_api import Browser, expect
from simulated import phantom

from app.simulation import CAREFUL, Session, do_exercise
from app.trainer.server.trainer import Trainer

SIZES = {"wide": (1440, 900), "small": (1024, 768), "phone": (390, 844)}


def close_hint(tab: TrainerPage) -> None:
    """Close what is said of a browser that draws in software, and hide hints of the mouse."""
    close = tab.page.get_by_role("alert").filter(has_text="Software WebGL").get_by_role("button")
    if close.count():
        close.first.click()
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


def take_comparison(tab: TrainerPage, folder: Path) -> None:
    """Take the picture of a ghost and the chain."""
    tab.open("Compare")
    tab.choose("Ghost", "Exact beam, shear, neo-Hookean")
    tab.tick("Chain")
    tab.page.get_by_test_id("chain").wait_for()
    take(tab, folder / "trainer-compare.jpg")
    tab.tick("Chain")
    tab.choose("Ghost", "None")


def take_exercise(tab: TrainerPage, session: Session, folder: Path) -> None:
    """Do an exercise, and take the pictures of its result and of its replay."""
    tab.open("Learn")
    tab.choose("Exercise", "Approach the break")
    tab.press("Start")
    tab.page.get_by_test_id("exercise-state").wait_for()
    do_exercise(session, CAREFUL)
    tab.page.get_by_test_id("outcome").wait_for()
    take(tab, folder / "trainer-result.jpg")
    tab.press("Watch it again")
    tab.slide("Time (s)", 1.0)
    take(tab, folder / "trainer-replay.jpg")
    tab.press("Leave the replay")
    tab.open("Train")


def take_dissection(trainer: Trainer, browser: Browser, size: str, folder: Path) -> None:
    """Take pictures of a duct that a hook has half freed, with a dissector behind it."""
    width, height = SIZES[size]
    with trainer_page(browser, trainer.address, width=width, height=height) as tab:
        state = newest_dissection(trainer).state
        session = state.session
        place = session.grab(0, 20.0)
        assert place is not None
        session.move_hand(0, place + np.array([0.0, 0.0, 7.0]))
        state.choose_instrument(1, "dissector")
        behind = session.duct.hands[1].place
        session.move_hand(1, np.array([32.0, 4.0, behind[2]]))
        tab.wait_until(lambda: session.duct.hands[1].arrived)
        session.open_jaws(1, 8.0)
        tab.wait_until(lambda: all(hand.arrived for hand in session.duct.hands))
        name = "" if size == "wide" else f"-{size}"
        take(tab, folder / f"trainer-dissect{name}.jpg")
        if size == "wide":
            tab.press("Freed")
            take(tab, folder / "trainer-freed.jpg")


def main(folder: Path) -> None:
    """Take a picture of each state and size."""
    folder.mkdir(parents=True, exist_ok=True)
    trainer = Trainer(phantom(), port=0)
    try:
        with running_browser(drawing=True) as browser:
            for size, (width, height) in SIZES.items():
                take_dissection(trainer, browser, size, folder)
                with trainer_page(
                    browser, trainer.address, width=width, height=height, query="&mode=pull"
                ) as tab:
                    if size == "wide":
                        take(tab, folder / "trainer-rest.jpg")
                        tab.open("Model")
                        tab.tick("Points")
                        take(tab, folder / "trainer-model.jpg")
                        tab.tick("Points")
                        tab.open("Train")
                    tab.slide("Force F (N)", 3.0)
                    tab.wait_for_force(3.0)
                    name = "pulled" if size == "wide" else f"pulled-{size}"
                    take(tab, folder / f"trainer-{name}.jpg")
                    if size != "small":
                        tab.page.keyboard.press("Escape")
                        tab.tick("Stress (H)")
                        name = "heat" if size == "wide" else f"heat-{size}"
                        take(tab, folder / f"trainer-{name}.jpg")
                        tab.tick("Stress (H)")
                    if size == "wide":
                        take_comparison(tab, folder)
                        take_exercise(tab, newest(trainer).session, folder)
                        tab.slide("Force F (N)", 3.7)
                        tab.wait_for_phase("torn")
                        take(tab, folder / "trainer-torn.jpg")
    finally:
        close_browser()
        trainer.stop()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
