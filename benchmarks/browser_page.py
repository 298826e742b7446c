"""A trainee's browser: headless Chromium, which draws in software."""

import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from shutil import which
from typing import Any

from playwright.sync_api import Page, sync_playwright

SWITCHES = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader"]
SWITCHES += ["--enable-unsafe-swiftshader", "--disable-dev-shm-usage"]
PATIENCE_MS = 120_000

PRESENT = "() => window.__viserMutable?.nodeRefFromName?.['/organ/skin']"
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
