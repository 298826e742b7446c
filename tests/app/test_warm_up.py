"""Warming: what a trainee can do compiles nothing more, in a tick or while they wait."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import viser

from app.trainer.server import warm_up

TESTS = Path(__file__).parent


def test_every_icon_of_the_panel_is_read_ahead() -> None:
    source = Path(warm_up.__file__).parent.parent
    used = {
        name
        for path in (source / "panel").glob("*.py")
        for name in re.findall(r"viser\.Icon\.(\w+)", path.read_text("utf-8"))
    }
    assert {getattr(viser.Icon, name) for name in used} == set(warm_up.ICONS)


@pytest.mark.long  # a process of its own
def test_nothing_is_compiled_after_the_warming() -> None:
    """In a process of its own: this one has compiled for other tests."""
    run = subprocess.run(
        [sys.executable, TESTS / "compiled.py"],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "PYTHONPATH": str(TESTS.parents[1])},
    )
    message = [line for line in run.stdout.splitlines() if line.startswith(("compiled", "done"))]
    assert message == ["done"]
