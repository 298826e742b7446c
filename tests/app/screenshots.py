"""Take the pictures in docs/: `make screenshots`. Needs Chromium, as the browser tests do."""

import sys
import time
from pathlib import Path

from browser import TrainerPage, running_browser, trainer_page
from playwright.sync_api import expect
from simulated import phantom

from app.trainer.server import Trainer

SIZES = {"wide": (1440, 900), "small": (1024, 768), "phone": (390, 844)}


def take(tab: TrainerPage, path: Path) -> None:
    """Wait until the picture stands still, and keep it."""
    close = tab.page.get_by_role("alert").filter(has_text="Software WebGL").get_by_role("button")
    if close.count():
        close.first.click()
        expect(close).to_have_count(0)
    last = b""
    for _ in range(40):
        time.sleep(1.0)
        now = tab.page.screenshot(type="jpeg", quality=88)
        if now == last:
            break
        last = now
    path.write_bytes(last)
    print(path)


def main(folder: Path) -> None:
    """Take a picture of each state and size."""
    folder.mkdir(parents=True, exist_ok=True)
    trainer = Trainer(phantom(), port=0)
    try:
        with running_browser() as browser:
            for size, (width, height) in SIZES.items():
                with trainer_page(browser, trainer.address, width=width, height=height) as tab:
                    if size == "wide":
                        take(tab, folder / "trainer-rest.jpg")
                        tab.page.get_by_role("tab", name="Model").click()
                        take(tab, folder / "trainer-model.jpg")
                        tab.page.get_by_role("tab", name="Train").click()
                    tab.slide("Force F (N)", 3.0)
                    tab.wait_for_force(3.0)
                    name = "pulled" if size == "wide" else f"pulled-{size}"
                    take(tab, folder / f"trainer-{name}.jpg")
                    if size == "wide":
                        tab.slide("Force F (N)", 3.7)
                        tab.wait_for_phase("torn")
                        take(tab, folder / "trainer-torn.jpg")
    finally:
        trainer.stop()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
