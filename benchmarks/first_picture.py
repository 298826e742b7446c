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
from contextlib import ExitStack, contextmanager
from pathlib import Path

import psutil

from benchmarks.browser_page import browser_page, served, until_drawn

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
    environment = os.environ | {"NUMBA_CACHE_DIR": str(cache)}
    with browser_page() as page, ExitStack() as running:
        with _timed(figures, f"{which_start}_address"):
            address, number = running.enter_context(
                served(program, "trainer", "--port", "0", cwd=cache, env=environment)
            )
        with _timed(figures, f"{which_start}_page"):
            page.goto(address)
            until_drawn(page, PATIENCE_MS)
        times = psutil.Process(number).cpu_times()
        figures[f"{which_start}_trainer_processor_s"] = times.user + times.system


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
    stages = ("pip_install_s", "first_address_s", "first_page_s")
    figures["pip_install_to_picture_s"] = sum(figures[stage] for stage in stages)
    print(json.dumps(figures, indent=2))


if __name__ == "__main__":
    main()
