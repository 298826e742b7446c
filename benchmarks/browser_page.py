"""A trainee's browser: bytes and time to the first picture, response times, frames.

The page is opened in headless Chromium, which draws in software: a machine with a graphics
processor draws more pictures from the same bytes. Run by itself, as it needs Chromium and
playwright: ``python -m benchmarks.browser_page``.
"""

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from shutil import which
from typing import Any

import numpy as np
from playwright.sync_api import Page, sync_playwright

from benchmarks.trainer_clients import machine_speed

LOOKS = ("full", "plain")
SWITCHES = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader"]
SWITCHES += ["--enable-unsafe-swiftshader", "--disable-dev-shm-usage"]
PATIENCE_MS = 120_000
ANSWERS = 20
PULLING_SECONDS = 10.0

PRESENT = "() => window.__viserMutable?.nodeRefFromName?.['/organ/skin']"
# From a key on the force slider to the read-out that shows another force, ms.
_ANSWER = """
(key) => new Promise((done) => {
  const readout = () => document.querySelector("[data-testid='readout']");
  const slider = [...document.querySelectorAll("[role='slider']")].find(
    (one) => (one.getAttribute('aria-label') ?? '').startsWith('Force'));
  const before = readout().dataset.forceN, start = performance.now();
  const look = () => readout().dataset.forceN !== before
    ? done(performance.now() - start) : setTimeout(look, 1);
  slider.focus();
  slider.dispatchEvent(new KeyboardEvent('keydown', {key, code: key, bubbles: true}));
  look();
})
"""
PICTURES = """
(seconds) => new Promise((done) => {
  let pictures = 0;
  const start = performance.now();
  const draw = (now) => {
    pictures += 1;
    now - start < 1000 * seconds ? requestAnimationFrame(draw)
                                 : done(1000 * pictures / (now - start));
  };
  requestAnimationFrame(draw);
})
"""


def chromium() -> str:
    """Return where the system's Chromium is."""
    found = which("chromium") or which("chromium-browser") or which("google-chrome")
    if found is None:
        raise FileNotFoundError("no Chromium here (Debian: apt install chromium)")
    return found


@contextmanager
def browser_page() -> Iterator[Page]:
    """Open an empty page in headless Chromium."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium(), args=SWITCHES)
        try:
            page = browser.new_page(viewport={"width": 1280, "height": 800})
            page.set_default_timeout(PATIENCE_MS)
            yield page
        finally:
            browser.close()


@contextmanager
def served(*command: str | Path, **options: Any) -> Iterator[tuple[str, int]]:
    """Run a trainer's program until it is left; give its address and the process's number."""
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, **options) as process:
        try:
            assert process.stdout is not None
            line = next(line for line in process.stdout if "http://" in line)
            yield line[line.index("http://") :].split()[0], process.pid
        finally:
            process.terminate()


def until_drawn(page: Page, timeout: float = PATIENCE_MS) -> None:
    """Wait until a page has drawn its duct."""
    page.wait_for_function(PRESENT, timeout=timeout)
    page.evaluate("() => new Promise((done) => requestAnimationFrame(() => done()))")


def _counted(page: Page, address: str) -> dict[str, float]:
    """Open the trainer and return the bytes and the time until its duct is drawn."""
    sizes = {"http": 0, "socket": 0}
    client = page.context.new_cdp_session(page)
    client.send("Network.enable")

    def add(where: str, size: float) -> None:
        sizes[where] += int(size)

    client.on("Network.loadingFinished", lambda event: add("http", event["encodedDataLength"]))
    page.on(
        "websocket",
        lambda socket: socket.on("framereceived", lambda frame: add("socket", len(frame))),
    )
    start = time.perf_counter()
    page.goto(f"{address}/?fixedDpr=1")
    until_drawn(page)
    return {
        "first_picture_s": time.perf_counter() - start,
        "page_kb": sizes["http"] / 1e3,
        "scene_kb": sizes["socket"] / 1e3,
    }


def page_figures(look: str) -> dict[str, float]:
    """Return the figures of one page in a look."""
    program = [sys.executable, "-c", "from app.command_line import main; main()", "trainer"]
    with (
        served(*program, "--port", "0", "--mode", "pull", "--look", look) as (address, _),
        browser_page() as page,
    ):
        figures = _counted(page, address)
        page.get_by_role("dialog").get_by_role("button", name="Start").click()
        answers: list[Any] = []
        for number in range(ANSWERS):
            answers.append(page.evaluate(_ANSWER, "ArrowRight" if number % 2 else "ArrowUp"))
            page.wait_for_timeout(300)
        figures["answer_ms"] = float(np.median(answers))
        figures["answer_ms_95"] = float(np.percentile(answers, 95))
        slider = page.get_by_role("slider", name="Force")
        slider.focus()
        page.evaluate(
            f"() => {{ window.bdPictures = ({PICTURES})({PULLING_SECONDS}); }}",
        )
        end = time.perf_counter() + PULLING_SECONDS
        while time.perf_counter() < end:
            for key in ("ArrowRight", "ArrowLeft"):
                for _ in range(5):
                    page.keyboard.press(key)
        figures["pictures_per_second"] = float(page.evaluate("() => window.bdPictures"))
        return figures


def main() -> None:
    """Measure each look, and print the figures as JSON with the machine's speed beside."""
    print(json.dumps(machine_speed() | {look: page_figures(look) for look in LOOKS}, indent=2))


if __name__ == "__main__":
    main()
