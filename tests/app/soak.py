"""Attack a trainer on loopback, bounded in count and time, and write down what came of it.

`make soak` runs it and writes the figures, with date and versions, into docs/reliability.md;
`make soak ARGS=0.1` has a tenth of the messages, requests and pages.
"""

import asyncio
import itertools
import os
import platform
import random
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib.metadata import version
from pathlib import Path
from typing import Any

import msgspec
import psutil
import viser
from class_saver import check_killed, killed_while_saving
from hostile import ATTACKS, kept_share
from program import command

from app.classroom.store import ClassStore
from app.trainer.server.bounds import Bounds
from benchmarks.page_protocol import CAMERA, Page, connected

FIGURES = Path(__file__).parents[2] / "docs" / "reliability.md"
MARK = "<!-- figures: all below is written by `make soak` -->\n"
ENCODE = msgspec.msgpack.encode
SCALE = float(sys.argv[1]) if len(sys.argv) > 1 else 1.0
ORIGINS, HOSTS = 60, 60
MESSAGES, REQUESTS, PAGES = (round(SCALE * most) for most in (10_000, 10_000, 200))
KILLS = round(SCALE * 100)
KILLS, FILES = round(SCALE * 200), round(SCALE * 4000)
PER_PAGE = 300  # Hostile messages of a page; what closes it is sent last
SEED = 15


class Running:
    """A trainer's process, its address and its log."""

    def __init__(self, process: "subprocess.Popen[str]", address: str, log: Path) -> None:
        self.address, self._log = address, log
        self.port = int(address.rpartition(":")[2])
        self._process = psutil.Process(process.pid)

    def memory(self) -> float:
        """Return the resident memory, MB, as the system counts it."""
        return self._process.memory_info().rss / 1e6

    def files(self) -> int:
        """Return how many files and sockets are open."""
        return self._process.num_fds()

    def tracebacks(self) -> int:
        """Return how many tracebacks there are in the log."""
        return self._log.read_text(errors="replace").count("Traceback")

    def log_bytes(self) -> int:
        """Return the log's size."""
        return self._log.stat().st_size


@contextmanager
def trainer(*options: object) -> Iterator[Running]:
    """Run a trainer in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder, "log")
        with (
            log.open("w") as errors,
            subprocess.Popen(
                command("trainer", "--port", 0, "--look", "plain", "--mode", "pull", *options),
                stdout=subprocess.PIPE, stderr=errors, text=True,
            ) as process,
        ):  # fmt: skip
            try:
                assert process.stdout is not None
                address = process.stdout.readline().split()[-1]
                yield Running(process, address, log)
            finally:
                process.terminate()


def status(port: int, request: bytes) -> int:
    """Return the status of the answer to a request, 0 where the connection was just closed."""
    with socket.create_connection(("127.0.0.1", port), timeout=15.0) as opened:
        try:
            opened.sendall(request)
            first = opened.recv(4096)
        except ConnectionError:
            return 0
    return int(first[9:12]) if first.startswith(b"HTTP/1.1 ") else 0


def upgrade(host: str, origin: str = "") -> bytes:
    """Return the request of a websocket."""
    lines = [
        "GET / HTTP/1.1", f"Host: {host}", "Upgrade: websocket", "Connection: Upgrade",
        "Sec-WebSocket-Version: 13", "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
        f"Sec-WebSocket-Protocol: viser-v{viser.__version__}",
        *([f"Origin: {origin}"] if origin else []),
    ]  # fmt: skip
    return "\r\n".join([*lines, "", ""]).encode()


def foreign(running: Running) -> Iterator[tuple[str, str]]:
    """Ask as pages of other sites, and by names that lead here."""
    own = f"localhost:{running.port}"
    origins = [
        status(running.port, upgrade(own, f"http://site{number}.example"))
        for number in range(ORIGINS)
    ]
    yield "foreign origins refused", f"{origins.count(403)} of {ORIGINS}"
    plain = b"GET / HTTP/1.1\r\nHost: site.example\r\n\r\n"
    names = [status(running.port, upgrade(f"site{number}.example")) for number in range(HOSTS)]
    names += [status(running.port, plain) for _ in range(HOSTS)]
    yield "foreign hosts refused", f"{names.count(403)} of {2 * HOSTS}"


def any_value(chance: random.Random) -> Any:
    """Return a value of any type and size."""
    return chance.choice(
        [
            None, True, 0, -1, 2**63 - 1, 1e300, float("nan"), float("inf"), "", "text", "é" * 999,
            [], [1, 2], [[[]]], {}, {"a": {}}, b"", b"\0" * 99, "a" * 99_999, "<script>", "../..",
        ]
    )  # fmt: skip


async def hostile_messages(running: Running, count: int) -> Counter[str]:
    """Send wrong values to a page's widgets, then a message that no page sends."""
    chance, ends = random.Random(SEED), Counter[str]()
    sent, update = 0, CAMERA
    while sent < count:
        async with connected(running.address) as connection:
            page = Page(connection)
            await page.open()
            reading = asyncio.create_task(_widgets(page))
            await asyncio.sleep(0.5)
            widgets = reading.result() if reading.done() else []
            reading.cancel()
            drain = asyncio.create_task(_drain(page))
            for _ in range(PER_PAGE - 1):
                values = [True, 0, -1, 1e300, float("nan"), float("inf"), "", "text", [], [1, 2]]
                update = {
                    "type": "GuiUpdateMessage",
                    "uuid": chance.choice([*widgets, page._slider, page._reset, "none"]),
                    "updates": {"value": chance.choice([None, *values])},
                }
                with suppress(Exception):
                    await connection.send(ENCODE(update))
                    sent += 1
            raw = chance.randbytes(chance.randrange(200))
            message = dict(chance.choice([CAMERA, update]))
            message[chance.choice([*message, "more"])] = any_value(chance)
            with suppress(Exception):
                await connection.send(chance.choice([raw, ENCODE(message)]))
                sent += 1
            with suppress(TimeoutError):
                async with asyncio.timeout(10.0):
                    await connection.wait_closed()
            ends[str(connection.close_code)] += 1
            drain.cancel()
    return ends


async def _widgets(page: Page) -> list[str]:
    found: list[str] = []
    with suppress(TimeoutError):
        async with asyncio.timeout(0.4):
            while True:
                found += [each["uuid"] for each in await page.messages() if "uuid" in each]
    return found


async def _drain(page: Page) -> None:
    with suppress(Exception):
        while True:
            await page.messages()


def hostile_requests(running: Running, count: int) -> Counter[int]:
    """Send requests that no browser sends."""
    chance, answers = random.Random(SEED), Counter[int]()
    own = f"Host: localhost:{running.port}\r\n".encode()
    for _ in range(count):
        path = chance.choice(
            [
                b"/" + b"a" * chance.randrange(3000), b"/../../etc/passwd", b"/%2e%2e/%2e%2e/etc",
                b"/%00", b"//", b"/a%", b"/" + chance.randbytes(20).replace(b"\n", b""),
                b"/index.html/x", b"*", b"http://site.example/", b"/?token=" + b"a" * 50,
                b"/metrics",
            ]
        )  # fmt: skip
        line = chance.choice([b"GET ", b"POST ", b"", b"PUT ", b"\0", b"get "]) + path
        line += chance.choice([b" HTTP/1.1\r\n"] * 4 + [b" HTTP/9.9\r\n", b"\r\n", b""])
        more = chance.choice(
            [
                b"", b"Host: b\r\n", b"Origin: null\r\n", b"Content-Length: -1\r\n",
                b": \r\n",
                b"A: " + b"a" * chance.randrange(20_000) + b"\r\n", b"A: b\r\n" * 300,
                b"Upgrade: websocket\r\n",
                b"Transfer-Encoding: chunked\r\n", b"\xff\xfe: \xff\r\n",
            ]
        )  # fmt: skip
        if path in (b"//", b"/?token=" + b"a" * 50) and line.startswith(b"GET "):
            more += b"Origin: http://site.example\r\n"  # else it is the page itself
        answers[status(running.port, line + own + more + b"\r\n")] += 1
    return answers


async def _visits(address: str, count: int) -> None:
    for _ in range(count):
        async with connected(address) as connection:
            await Page(connection).open()


async def _opening(address: str) -> float:
    start = time.monotonic()
    async with connected(address) as connection:
        await Page(connection).open()
    return time.monotonic() - start


def killed_class() -> tuple[str, str]:
    """Kill a process that saves a class's results, again and again."""
    chance, acknowledged = random.Random(SEED), set[str]()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "class.sqlite"
        ClassStore.new(path, "Killed").close()
        for _ in range(KILLS):
            acknowledged |= killed_while_saving(path, chance.uniform(0.0, 0.3))
            check_killed(path, acknowledged)
        size = path.stat().st_size / 1e6
    return (
        "kills of a class that saves results",
        f"{KILLS}: {len(acknowledged):,} results acknowledged, none lost, {size:.0f} MB, sound",
    )


def soak() -> Iterator[tuple[str, str]]:
    """Give each figure with its name."""
    yield killed_class()
    # An address would otherwise open a page each half second only.
    with trainer("--most-per-address", 10**6) as running:
        yield from foreign(running)
        # As many sessions as are kept, so that no later page adds to them.
        asyncio.run(_visits(running.address, Bounds().most_clients + 16))
        memory, files = running.memory(), running.files()
        start, before = time.monotonic(), running.tracebacks()
        ends = asyncio.run(hostile_messages(running, MESSAGES))
        yield (
            "hostile websocket messages",
            f"{MESSAGES:,} of {sum(ends.values())} pages in {time.monotonic() - start:.0f} s: "
            f"{running.tracebacks() - before} tracebacks, "
            f"{running.memory() - memory:+.0f} MB, log {running.log_bytes():,} bytes, pages ended "
            f"with {_counted(ends)}",
        )
        memory, before = running.memory(), running.tracebacks()
        answers = hostile_requests(running, REQUESTS)
        yield (
            "hostile HTTP requests",
            f"{REQUESTS:,}: {_counted(answers)} (0 is closed without an answer), "
            f"{running.tracebacks() - before} tracebacks, {running.memory() - memory:+.0f} MB",
        )
        memory = running.memory()
        asyncio.run(_visits(running.address, PAGES))
        time.sleep(1.0)
        yield (
            "pages opened and closed",
            f"{PAGES}: {running.memory() - memory:+.0f} MB (64 sessions are kept ten minutes), "
            f"open files {files} before all of this, {running.files()} now",
        )
    with trainer() as running:
        for name in ATTACKS:
            shares = [kept_share(running.address, name) for _ in range(3)]
            yield (
                f"{name}: a neighbour keeps of its frames",
                f"{statistics.median(shares):.0%} (of three, {min(shares):.0%} to "
                f"{max(shares):.0%}); a page then opens in "
                f"{asyncio.run(_opening(running.address)):.2f} s",
            )


def files() -> Iterator[tuple[str, str]]:
    """Kill what writes files, and mutate files that are read, each in processes of their own."""
    yield "kill -9", _last_line("kill_fuzz.py", KILLS)
    for kind in ("organ", "run", "preset", "image", "spacing"):
        yield f"{kind} files mutated by atheris", _last_line("file_fuzz.py", kind, FILES)


def _last_line(script: str, *arguments: object) -> str:
    line = [sys.executable, str(Path(__file__).with_name(script)), *map(str, arguments)]
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    if done.returncode:
        return f"**failed**: {' '.join(done.stderr.split()[-20:])}"
    return done.stdout.strip().splitlines()[-1]


def _counted(counts: Counter[Any]) -> str:
    return ", ".join(f"{count:,} x {what}" for what, count in sorted(counts.items(), key=str))


def main() -> None:
    """Write the figures."""
    versions = ", ".join(f"{name} {version(name)}" for name in ("viser", "websockets", "msgspec"))
    head = (
        f"{time.strftime('%Y-%m-%d', time.gmtime())}, Python {platform.python_version()}, "
        f"{versions}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f} at the start.\n\n"
        "| what | result |\n|---|---|\n"
    )
    rows: list[str] = []
    for name, result in itertools.chain(soak(), files()):
        print(f"{name}: {result}", flush=True)
        rows.append(f"| {name} | {result} |\n")
    text = FIGURES.read_text(encoding="utf-8").partition(MARK)[0]
    FIGURES.write_text(f"{text}{MARK}\n{head}{''.join(rows)}", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
