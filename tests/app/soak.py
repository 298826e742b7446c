"""Attack a trainer on loopback, bounded in count and time, and write down what came of it.

`make soak` runs it and writes each figure, with its date and the load, into docs/reliability.md;
`make soak ARGS="--scale 0.1"` has a tenth of all counts and times, `ARGS="requests clients"` those
parts only.
"""

import argparse
import asyncio
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
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from importlib.metadata import version
from pathlib import Path
from typing import Any

import msgspec
import psutil
import viser
from bombs import MEGABYTES, SECONDS, used_bombs
from class_saver import check_killed, killed_while_saving
from hostile import ATTACKS, kept_fraction
from program import command

from app.classroom.store import ClassStore
from app.trainer.connections.bounds import Bounds
from app.trainer.server.trainer import EXPIRY_SECONDS
from benchmarks.page_protocol import CAMERA, Page, connected
from benchmarks.served_trainer import served_trainer
from benchmarks.trainer_clients import Mix, counted

FIGURES = Path(__file__).parents[2] / "docs" / "reliability.md"
ENCODE = msgspec.msgpack.encode
ORIGINS, HOSTS = 60, 60
MESSAGES, REQUESTS, PAGES, KILLS, CLASS_KILLS, FILES = 10_000, 10_000, 1000, 200, 100, 4000
CLIENTS, CLIENT_SECONDS = 32, 600.0
PER_PAGE = 300  # Hostile messages of a page; what closes it is sent last
SEED = 15


class Running:
    """A trainer's process, its address and its log."""

    def __init__(self, process: "subprocess.Popen[str]", address: str, log: Path) -> None:
        self.address, self._log = address, log
        self.port = int(address.rpartition(":")[2])
        self._process = psutil.Process(process.pid)

    def memory(self) -> float:
        """Return the resident memory, MB, once what is free has been given back."""
        time.sleep(1.2 * EXPIRY_SECONDS)
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


@contextmanager
def crowded_trainer() -> Iterator[Running]:
    """Run a trainer that has as many sessions as it keeps, so that no later page adds to them."""
    # An address would otherwise open a page each half second only.
    with trainer("--most-per-address", 10**6) as running:
        asyncio.run(_visits(running.address, Bounds().most_clients + 16))
        yield running


def origins(scale: float) -> Iterator[tuple[str, str]]:
    """Ask from elsewhere."""
    del scale
    with trainer() as running:
        yield from foreign(running)


def messages(scale: float) -> Iterator[tuple[str, str]]:
    """Send hostile messages."""
    count = round(scale * MESSAGES)
    with crowded_trainer() as running:
        memory, start = running.memory(), time.monotonic()
        ends = asyncio.run(hostile_messages(running, count))
        yield (
            "hostile websocket messages",
            f"{count:,} of {sum(ends.values())} pages in {time.monotonic() - start:.0f} s: "
            f"{running.tracebacks()} tracebacks, {running.memory() - memory:+.0f} MB, log "
            f"{running.log_bytes():,} bytes, pages ended with {_counted(ends)}",
        )


def requests(scale: float) -> Iterator[tuple[str, str]]:
    """Send hostile requests."""
    count = round(scale * REQUESTS)
    with crowded_trainer() as running:
        memory = running.memory()
        answers = hostile_requests(running, count)
        yield (
            "hostile HTTP requests",
            f"{count:,}: {_counted(answers)} (0 is closed without an answer), "
            f"{running.tracebacks()} tracebacks, {running.memory() - memory:+.0f} MB",
        )


def connects(scale: float) -> Iterator[tuple[str, str]]:
    """Open pages and leave."""
    count = round(scale * PAGES)
    with crowded_trainer() as running:
        memory, files = running.memory(), running.files()
        asyncio.run(_visits(running.address, count))
        time.sleep(1.0)
        yield (
            "pages opened and closed",
            f"{count:,}: {running.memory() - memory:+.0f} MB, open files {files} before, "
            f"{running.files()} after",
        )


def neighbours(scale: float) -> Iterator[tuple[str, str]]:
    """Have others misbehave beside a page."""
    times = max(1, round(3 * scale))
    with trainer() as running:
        for name in ATTACKS:
            fractions = [kept_fraction(running.address, name) for _ in range(times)]
            yield (
                f"{name}: a neighbour keeps of its frames",
                f"{statistics.median(fractions):.0%} (of {times}, {min(fractions):.0%} to "
                f"{max(fractions):.0%}); a page then opens in "
                f"{asyncio.run(_opening(running.address)):.2f} s",
            )


def bombs(scale: float) -> Iterator[tuple[str, str]]:
    """Send archives and images that are larger than they look."""
    del scale
    used = list(used_bombs())
    slow = [
        f"{kind} takes {seconds:.0f} s" for kind, _, seconds, _ in used if not seconds <= SECONDS
    ]
    most = max(each[3] for each in used)
    slow += [f"over {MEGABYTES:.0f} MB"] if most > MEGABYTES else []
    yield (
        "archive and image bombs",
        f"{len(used)}: {sum(bool(words) for _, words, _, _ in used)} refused in words, "
        f"{sum(not words for _, words, _, _ in used)} taken, "
        f"{sum(words.startswith('FAULT') for _, words, _, _ in used)} faults; slowest "
        f"{max(each[2] for each in used):.0f} s of processor, {most:.0f} MB at most"
        f"{''.join(f'; {each}' for each in slow)}",
    )


def kills(scale: float) -> Iterator[tuple[str, str]]:
    """Kill what writes files, and a process that saves a class's results."""
    yield "kill -9", _last_line("kill_fuzz.py", round(scale * KILLS))
    chance, acknowledged, count = random.Random(SEED), set[str](), round(scale * CLASS_KILLS)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "class.sqlite"
        ClassStore.new(path, "Killed").close()
        for _ in range(count):
            acknowledged |= killed_while_saving(path, chance.uniform(0.0, 0.3))
            check_killed(path, acknowledged)
    yield (
        "kill -9 of a class that saves",
        f"{count}: {len(acknowledged):,} results acknowledged, none lost, the file sound",
    )


def files(scale: float) -> Iterator[tuple[str, str]]:
    """Mutate files that are read, each kind in a process of its own."""
    for kind in ("organ", "run", "preset", "image", "spacing", "exercise"):
        yield (
            f"{kind} files mutated by atheris",
            _last_line("file_fuzz.py", kind, round(scale * FILES)),
        )


def clients(scale: float) -> Iterator[tuple[str, str]]:
    """Have many at work."""
    mixes: tuple[Mix, ...] = ("pull", "dissect", "class")
    for mix in mixes:
        with served_trainer(of_class=mix == "class") as served:
            found = asyncio.run(counted(served, CLIENTS, scale * CLIENT_SECONDS, mix))
        of = {name.removesuffix(f"_{CLIENTS}"): value for name, value in found.items()}
        yield (
            f"{CLIENTS} clients: {mix}",
            f"{scale * CLIENT_SECONDS:.0f} s: {of['steps_per_second']:.1f} steps/s, at least "
            f"{of['drawn_per_second']:.1f} pictures/s drawn and {of['frames_per_second']:.1f} "
            f"come, longest gap {of['longest_gap_ms']:.0f} ms, {of['processor_percent']:.0f} % of "
            f"a core and {of['clients_processor_percent']:.0f} % for the clients, "
            f"{of['resident_mb']:.0f} MB, {of['memory_grown_percent']:+.1f} % after the first "
            "minute",
        )


CAMPAIGNS: dict[str, Callable[[float], Iterator[tuple[str, str]]]] = {
    each.__name__: each
    for each in (
        origins, messages, requests, connects, neighbours, bombs, kills, files, clients,
    )
}  # fmt: skip


def _last_line(script: str, *arguments: object) -> str:
    line = [sys.executable, str(Path(__file__).with_name(script)), *map(str, arguments)]
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    if done.returncode:
        return f"**failed**: {' '.join(done.stderr.split()[-20:])}"
    return done.stdout.strip().splitlines()[-1]


def _counted(counts: Counter[Any]) -> str:
    return ", ".join(f"{count:,} x {what}" for what, count in sorted(counts.items(), key=str))


def written(text: str, name: str, result: str, when: str) -> str:
    """Return the page with a row of the table, in place of the one of that name."""
    row = f"| {name} | {result} | {when} |"
    lines = text.rstrip("\n").split("\n")
    place = [number for number, line in enumerate(lines) if line.startswith(f"| {name} |")]
    if place:
        lines[place[0]] = row
    else:
        lines.append(row)
    return "\n".join([*lines, ""])


def main() -> None:
    """Write the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(CAMPAIGNS)}")
    parser.add_argument("--scale", type=float, default=1.0)
    parser.add_argument("--dry", action="store_true", help="write nothing down")
    chosen = parser.parse_args()
    if unknown := set(chosen.parts) - set(CAMPAIGNS):
        parser.error(
            f"there is no part {', '.join(sorted(unknown))}; there are {', '.join(CAMPAIGNS)}"
        )
    versions = ", ".join(f"{name} {version(name)}" for name in ("viser", "websockets", "msgspec"))
    print(f"Python {platform.python_version()}, {versions}, {os.cpu_count()} cores")
    for campaign in chosen.parts or CAMPAIGNS:
        begun = time.monotonic()
        for name, result in CAMPAIGNS[campaign](chosen.scale):
            when = f"{time.strftime('%Y-%m-%d', time.gmtime())}, load {os.getloadavg()[0]:.0f}"
            print(f"{name}: {result} ({when})", flush=True)
            if not chosen.dry:
                text = FIGURES.read_text(encoding="utf-8")
                FIGURES.write_text(written(text, name, result, when), encoding="utf-8")
        print(f"[{campaign}: {time.monotonic() - begun:.0f} s]", flush=True)


if __name__ == "__main__":
    sys.exit(main())
