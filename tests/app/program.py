"""The program `bluntdissect`, run in this process or, where that is the subject, in its own."""

import contextlib
import io
import os
import random
import re
import shlex
import signal
import socket
import subprocess
import sys
import threading
import urllib.request
from collections.abc import Iterator, Sequence
from typing import TextIO
from unittest.mock import patch

import pytest

from app.command_line import main

LONGEST = 180.0
"""s that a test waits for what comes in a moment, but on a machine that is slow and busy."""
ENTRY = "from app.command_line import main; main()"
"""What the installed script runs."""


def command(*arguments: object, entry: str = ENTRY) -> list[str]:
    """The command line of a process that runs the program."""
    return [sys.executable, "-c", entry, *map(str, arguments)]


class _OfThisThread(io.StringIO):
    """What one thread writes; others (a test's trainer) write to the screen."""

    def __init__(self, screen: TextIO) -> None:
        super().__init__()
        self._screen = screen
        self._thread = threading.get_ident()

    def write(self, text: str, /) -> int:
        mine = threading.get_ident() == self._thread
        return super().write(text) if mine else self._screen.write(text)


def run(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Run the program to its end in this process, from `main` to the status it exits with."""
    line = ["bluntdissect", *map(str, arguments)]
    out, err = _OfThisThread(sys.stdout), _OfThisThread(sys.stderr)
    with (
        patch.object(sys, "argv", line),
        # It would have this process, and all tests after this one, go before other processes.
        patch.object(os, "sched_setscheduler", side_effect=PermissionError, create=True),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        pytest.raises(SystemExit) as ended,
    ):
        main()
    status = ended.value.code
    assert isinstance(status, int)
    return subprocess.CompletedProcess(line, status, out.getvalue(), err.getvalue())


def printed(*arguments: object) -> str:
    """What the program prints on the screen, run in this process without an error."""
    done = run(*arguments)
    assert done.returncode == 0, done.stderr
    return done.stdout


def run_process(*arguments: object, seconds: float = 600.0) -> subprocess.CompletedProcess[str]:
    """Run the program to its end in a process of its own."""
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


def free_port() -> int:
    """A port that nobody has, of those that the system gives nobody for a connection.

    What a socket on port 0 was given may be given to another before it is used.
    """
    while True:
        port = random.randrange(15_000, 30_000)
        with contextlib.suppress(OSError), socket.create_server(("127.0.0.1", port)):
            return port


@contextlib.contextmanager
def started(*arguments: object, entry: str = ENTRY) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """A trainer's process and the address that it prints."""
    with subprocess.Popen(
        command("trainer", *arguments, entry=entry),
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        try:
            assert process.stdout is not None
            line = process.stdout.readline()
            found = re.search(r"http://\S+", line)
            assert found is not None, line
            yield process, found.group()
        finally:
            process.kill()


def blocks(text: str, kind: str) -> list[str]:
    """The fenced blocks of a page in one language."""
    return re.findall(rf"^```{kind}\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)


def commands(text: str, program: str) -> list[list[str]]:
    """The words after the program's name, of each of its lines in a page."""
    lines = "\n".join(blocks(text, "sh")).splitlines()
    split = [shlex.split(line, comments=True) for line in lines]
    return [words[1:] for words in split if words and words[0] == program]


def serves_a_class(words: list[str]) -> None:
    """Check that a class can be opened by its links, and ends when told to."""
    with subprocess.Popen(
        command(*words, "--port", "0"), stdout=subprocess.PIPE, text=True
    ) as process:  # fmt: skip
        try:
            assert process.stdout is not None
            for who, place in (("Teacher", "./class/"), ("Trainees", "./")):
                printed = process.stdout.readline()
                assert printed.startswith(f"{who}: http://127.0.0.1:"), printed
                with urllib.request.urlopen(printed.split()[1]) as answer:
                    assert f"url={place}" in answer.read().decode()
            process.send_signal(signal.SIGTERM)
            assert process.wait(LONGEST) == 0
        finally:
            process.kill()
