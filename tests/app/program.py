"""The program `bluntdissect`, run as a process."""

import subprocess
import sys
from collections.abc import Sequence

ENTRY = "from app.command_line import main; main()"
"""What the installed script runs."""


def command(*arguments: object, entry: str = ENTRY) -> list[str]:
    """The command line of a process that runs the program."""
    return [sys.executable, "-c", entry, *map(str, arguments)]


def run(*arguments: object, seconds: float = 120.0) -> subprocess.CompletedProcess[str]:
    """Run the program to its end."""
    return subprocess.run(
        command(*arguments), capture_output=True, text=True, timeout=seconds, check=False
    )


def refused(arguments: Sequence[object]) -> str:
    """Run the program with wrong input and return its one line on stderr."""
    done = run(*arguments)
    assert done.returncode == 2, (done.returncode, done.stdout, done.stderr)
    assert done.stdout == ""
    lines = done.stderr.splitlines()
    assert len(lines) == 1, done.stderr
    assert lines[0].startswith("bluntdissect: ")
    return lines[0]
