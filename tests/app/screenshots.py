"""Take the pictures in docs/: `make screenshots`. Needs Chromium, as the browser tests do."""

import io
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from unittest.mock import patch

import numpy as np
from browser import (
    PATIENCE,
    TrainerPage,
    close_browser,
    newest_dissection,
    running_browser,
    trainer_page,
)
from PIL import Image
from playwright.sync_api import Browser, Page, expect
from program import run
from simulated import bed_exercises, phantom
from test_class_page import Trainee, opened, teacher_page

from app.classroom.exercise_file import template
from app.classroom.store import ClassStore
from app.simulation import MANNERS, Feedback, perform
from app.trainer.server.trainer import Trainer
from assets import BILE_DUCT

WIDE, PHONE = (1440, 900), (390, 844)
SMALL = 1280, 800


def close_hint(page: Page) -> None:
    """Close what is said of a browser that draws in software, and hide hints of the mouse."""
    close = page.get_by_role("alert").filter(has_text="Software WebGL").get_by_role("button")
    if close.count():
        close.first.dispatch_event("click")  # a page that draws slowly takes long to stand still
        expect(close).to_have_count(0)
    page.mouse.move(2.0, 2.0)  # a hint would cover what is beside it


def take(tab: TrainerPage, path: Path) -> None:
    """Wait until the picture stands still, and keep it."""
    close_hint(tab.page)
    take_page(tab.page, path)


def take_page(page: Page, path: Path) -> None:
    """Take the picture of any page once it stands still."""
    last = b""
    for _ in range(40):
        time.sleep(1.0)
        now = page.screenshot(type="png", timeout=5.0 * PATIENCE)
        if now == last:
            break
        last = now
    save(last, path)


def take_moving(tab: TrainerPage, path: Path) -> None:
    """Keep the picture of a page that never stands still: vessels pulse."""
    close_hint(tab.page)
    tab.next_picture()
    save(tab.page.screenshot(type="png", timeout=5.0 * PATIENCE), path)


def save(png: bytes, path: Path) -> None:
    """Save a picture, and print where."""
    Image.open(io.BytesIO(png)).convert("RGB").save(path, quality=82)
    print(path)


def take_result(trainer: Trainer, browser: Browser, folder: Path) -> None:
    """Have good hands do an exercise, and take the picture of its result."""
    with trainer_page(browser, trainer.address, width=WIDE[0], height=WIDE[1]) as tab:
        close_hint(tab.page)  # the result will lie over it
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


def take_tabs(trainer: Trainer, browser: Browser, folder: Path) -> None:
    """Take the tabs of a duct: an organ being built, theories compared, the model."""
    width, height = SMALL
    with trainer_page(
        browser, trainer.address, width=width, height=height, query="&scene=free"
    ) as tab:
        tab.slide("Force F (N)", 2.0)
        tab.wait_for_force(2.0)
        tab.open("Compare")
        tab.choose("Ghost", "String (very large deflection)")
        take(tab, folder / "page-compare.webp")
        tab.open("Model")
        take(tab, folder / "page-model.webp")
        tab.open("Build")
        tab.press("Use the built-in phantom")
        expect(tab.page.get_by_test_id("build-result")).to_contain_text("10 kept")
        take(tab, folder / "page-build.webp")


def take_scope(trainer: Trainer, browser: Browser, folder: Path) -> None:
    """Take the page of Calot's triangle, and a picture whose structures are asked for."""
    width, height = SMALL
    with trainer_page(
        browser, trainer.address, width=width, height=height, query="&scene=calot",
        node="/scope/state",
    ) as tab:  # fmt: skip
        take_moving(tab, folder / "page-calot.webp")
        tab.open("Learn")
        tab.choose("Exercise", "Who is who")
        tab.press("Start")
        expect(tab.page.get_by_test_id("exercise-state")).to_be_visible()
        take_moving(tab, folder / "page-who-is-who.webp")


def take_class(browser: Browser, folder: Path, work: Path) -> None:
    """Take a teacher's page and a trainee's, after a try."""
    ClassStore.new(work / "class.sqlite", "Surgery 3A").close()
    trainer = opened(work / "class.sqlite", 0)
    trainer.warm_up.wait("bed")
    token = trainer.link.partition("token=")[2]
    width, height = SMALL
    try:
        teacher = teacher_page(browser, trainer)
        with trainer_page(
            browser, trainer.address, width=width, height=height, query=f"&token={token}"
        ) as tab:
            trainee = Trainee(tab)
            trainee.join("Ann")
            teacher.locator("#advanced summary").click()
            teacher.locator("#text").fill(template("window"))
            teacher.locator("#assign").click()
            teacher.locator("#start").click()
            expect(tab.page.get_by_test_id("exercise-state")).to_contain_text("Ready")
            trainee.lift(14)
            trainee.shown("Failed.")
            tab.page.keyboard.press("Escape")
            take(tab, folder / "page-trainee.webp")
            expect(teacher.locator("#found tbody tr")).to_have_count(1)
            take_page(teacher, folder / "page-teacher.webp")
        teacher.context.close()
    finally:
        trainer.stop()


def take_case(browser: Browser, folder: Path, work: Path) -> None:
    """Take the page on which tubes of a segmentation are chosen."""
    assert run("anatomy", "normal", "--voxels", work / "labels.seg.nrrd").returncode == 0
    width, height = SMALL

    def serve(start: Callable[[], Trainer], _: object) -> None:
        trainer = start()
        try:
            trainer.warm_up.wait("calot")
            with trainer_page(
                browser, trainer.link, width=width, height=height, node="/scope/state"
            ) as tab:
                tab.page.get_by_test_id("case-picture").wait_for()
                take(tab, folder / "page-case.webp")
        finally:
            trainer.stop()

    words = ["--labels", work / "labels.seg.nrrd", "-o", work / "case", "--build-page"]
    with patch("app.command_line.serving.serve", serve):
        done = run("anatomy", *words, "--port", 0)
    assert done.returncode == 0, done.stderr


def take_player(browser: Browser, folder: Path, work: Path) -> None:
    """Take the page that plays an organ by itself."""
    done = run("export", BILE_DUCT, "--force", 3.0, "--html", work / "pull.html")
    assert done.returncode == 0, done.stderr
    page = browser.new_page(viewport={"width": SMALL[0], "height": SMALL[1]})
    page.goto((work / "pull.html").as_uri())
    page.wait_for_function("() => window.__viserMutable?.scene", timeout=PATIENCE)
    page.wait_for_timeout(12_000)  # into the pull, drawn by a processor
    close_hint(page)
    save(page.screenshot(timeout=5.0 * PATIENCE), folder / "page-player.webp")


def main(folder: Path, *only: str) -> None:
    """Take the pictures that the documents show; or only some kinds of them."""
    pages = folder / "gallery"
    pages.mkdir(parents=True, exist_ok=True)
    trainer = Trainer(phantom(), port=0)
    with tempfile.TemporaryDirectory() as name, running_browser(drawing=True) as browser:
        work = Path(name)
        kinds: dict[str, Callable[[], None]] = {
            "result": lambda: take_result(trainer, browser, folder),
            "pull": lambda: take_pull(trainer, browser, folder),
            "phone": lambda: take_dissection(trainer, browser, folder, phone=True),
            "dissection": lambda: take_dissection(trainer, browser, folder, phone=False),
            "tabs": lambda: take_tabs(trainer, browser, pages),
            "scope": lambda: take_scope(trainer, browser, pages),
            "class": lambda: take_class(browser, pages, work),
            "case": lambda: take_case(browser, pages, work),
            "player": lambda: take_player(browser, pages, work),
        }
        try:
            for kind in only or kinds:
                kinds[kind]()
        finally:
            close_browser()
            trainer.stop()


if __name__ == "__main__":
    main(Path(sys.argv[1]), *sys.argv[2:])
