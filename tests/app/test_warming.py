"""Warming: what a trainee can do compiles nothing more, in a tick or while they wait."""

import os
import subprocess
import sys
from pathlib import Path

TESTS = Path(__file__).parent


def test_nothing_is_compiled_after_the_warming() -> None:
    """In a process of its own: this one has compiled for other tests."""
    run = subprocess.run(
        [sys.executable, TESTS / "compiled.py"],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "PYTHONPATH": str(TESTS.parents[1])},
    )
    said = [line for line in run.stdout.splitlines() if line.startswith(("compiled", "done"))]
    assert said == ["done"]
