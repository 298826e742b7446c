"""From `pip install` of the wheel to the first picture of the trainer, and where the seconds go.

In an environment of its own, with nothing cached: neither packages nor compiled code. Needs
Chromium and playwright, and the network for the packages: ``python -m benchmarks.first_picture``.
"""

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
import venv
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import psutil
from playwright.sync_api import sync_playwright

from benchmarks.browser_page import PRESENT, SWITCHES, chromium

ROOT = Path(__file__).parents[1]
PATIENCE_MS = 900_000
"""A busy machine may compile for minutes."""


@contextmanager
def _timed(figures: dict[str, float], name: str) -> Iterator[None]:
    started = time.perf_counter()
    yield
    figures[f"{name}_s"] = time.perf_counter() - started


def _pip(*words: str | Path) -> None:
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "-q", *words]
    subprocess.run(pip, check=True)


def _opened(program: Path, cache: Path, figures: dict[str, float], which_start: str) -> None:
    """Start the trainer and open its page, until its duct is drawn."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium(), args=SWITCHES)
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        with _timed(figures, f"{which_start}_address"):
            trainer = subprocess.Popen(
                [program, "trainer", "--port", "0"], stdout=subprocess.PIPE, text=True,
                cwd=cache, env=os.environ | {"NUMBA_CACHE_DIR": str(cache)},
            )  # fmt: skip
            assert trainer.stdout is not None
            line = next(line for line in trainer.stdout if "http://" in line)
        try:
            with _timed(figures, f"{which_start}_page"):
                page.goto(line[line.index("http://") :].split()[0])
                page.wait_for_function(PRESENT, timeout=PATIENCE_MS)
                page.evaluate("() => new Promise((done) => requestAnimationFrame(() => done()))")
            times = psutil.Process(trainer.pid).cpu_times()
            figures[f"{which_start}_trainer_processor_s"] = times.user + times.system
        finally:
            trainer.terminate()
            trainer.wait()
        browser.close()


def main() -> None:
    """Install, start twice, and print the figures as JSON."""
    figures: dict[str, float] = {}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with tempfile.TemporaryDirectory() as place:
        folder, environment = Path(place), Path(place, "environment")
        cache = folder / "compiled"
        cache.mkdir()
        with _timed(figures, "build_wheel"):
            _pip("wheel", "--no-deps", "-w", folder, ROOT)
        (wheel,) = folder.glob("*.whl")
        with _timed(figures, "make_environment"):
            venv.create(environment)
        with _timed(figures, "pip_install"):
            _pip("--python", environment / "bin" / "python", "install", "--no-cache-dir", wheel)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        figures["to_here_processor_s"] = (
            after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        )
        program = environment / "bin" / "bluntdissect"
        for each in ("first", "second"):
            _opened(program, cache, figures, each)
        figures["installed_mb"] = 1e-6 * sum(
            file.stat().st_size for file in environment.rglob("*") if file.is_file()
        )
    parts = ("pip_install_s", "first_address_s", "first_page_s")
    figures["pip_install_to_picture_s"] = sum(figures[part] for part in parts)
    print(json.dumps(figures, indent=2))


if __name__ == "__main__":
    main()
