"""What tests of several packages share."""

import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

import kernel_cache  # noqa: F401  (before any numba, which reads then what this sets)

# Scripts of `make soak` and `make screenshots`; one needs a fuzzer that only the former installs.
SCRIPTS = ("soak", "kill_fuzz", "file_fuzz", "screenshots", "film")
collect_ignore = [f"app/{name}.py" for name in SCRIPTS]
COMPILE = ("bed", "closed_forms", "many", "exact", "two_grasps")
"""Tests of physics that compile the kernels on which all others wait."""
QUICK = ("physics", "organ_geometry", "assets")
"""Folders of the quick lane, `-m quick`; to it belong tests of `app` that need sessions only."""

# A machine may be busy.
settings.register_profile("without deadline", deadline=None)
settings.load_profile("without deadline")

# A shell's background job ignores interrupts, and what it starts would too.
signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the quick lane, and let one process compile the bed and the other the exact beam."""
    for item in items:
        if _is_quick(item):
            item.add_marker("quick")
    first = {f"test_{name}.py": rank for rank, name in enumerate(COMPILE)}
    items.sort(key=lambda item: first.get(item.path.name, len(first)))


def _is_quick(item: pytest.Item) -> bool:
    """Whether a test needs neither a page nor another process, and little time."""
    folder = item.path.relative_to(item.config.rootpath).parts[:-1]
    if item.get_closest_marker("slow") or item.get_closest_marker("long"):
        return False
    return any(each in QUICK for each in folder[:2]) or (
        folder == ("tests", "app") and _needs_sessions_only(item)
    )


def _needs_sessions_only(item: pytest.Item) -> bool:
    """Whether a test's file imports of `app` only what simulates, and commands to it."""
    imported = {
        str(getattr(each, "__module__", None) or getattr(each, "__name__", ""))
        for each in vars(getattr(item, "module", item)).values()
    }
    of_app = {".".join(name.split(".")[:2]) for name in imported if name.startswith("app.")}
    return {"app.simulation"} <= of_app <= {
        "app.simulation",
        "app.command_line",
    } and not imported & {"browser", "subprocess"}


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """The folder of real sections, which is not part of the repository."""
    named = os.environ.get("BLUNTDISSECT_DATA")
    folder = Path(named) if named else Path(__file__).parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"real sections are not here: no folder {folder}; set BLUNTDISSECT_DATA")
    return folder


@pytest.fixture(scope="session", autouse=True)
def _browser_ends() -> Iterator[None]:
    """The browser is shared by all tests that need one."""
    yield
    if (shared := sys.modules.get("browser")) is not None:
        shared.close_browser()
