"""What tests of several packages share."""

import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

# Scripts of `make soak` and `make screenshots`; one needs a fuzzer that only the former installs.
SCRIPTS = ("soak", "kill_fuzz", "file_fuzz", "screenshots", "film")
collect_ignore = [f"app/{name}.py" for name in SCRIPTS]
COMPILE = ("bed", "closed_forms", "many", "exact", "two_grasps")
"""Tests of physics that compile the kernels on which all others wait."""

# A machine may be busy.
settings.register_profile("without deadline", deadline=None)
settings.load_profile("without deadline")

# A shell's background job ignores interrupts, and what it starts would too.
signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Let one process compile the bed and the other the exact beam, before they share both."""
    first = {f"test_{name}.py": rank for rank, name in enumerate(COMPILE)}
    items.sort(key=lambda item: first.get(item.path.name, len(first)))


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
