"""Clients that misbehave on loopback, bounded in count and time, and what they cost another."""

import asyncio
import multiprocessing
import socket
import time
from collections.abc import Awaitable, Callable
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack, suppress

import msgspec
from websockets.exceptions import ConnectionClosed

from benchmarks.page_protocol import CAMERA, Page, connected, hand_forces

FLOOD = 3000  # messages
HEAVY = 5 * [40_000_000]  # bytes
SILENT, MUTE = 300, 60


async def flood(address: str) -> None:
    """Move one's own slider as fast as the server reads."""
    async with connected(address) as connection:
        page = Page(connection)
        await page.open()
        reading = asyncio.create_task(_read_all(page))
        with suppress(ConnectionClosed):
            for _, force in zip(range(FLOOD), hand_forces(), strict=False):
                await page.pull_with(force)
        reading.cancel()


async def _read_all(page: Page) -> None:
    with suppress(ConnectionClosed):
        while True:
            await page.messages()


async def heavy_messages(address: str) -> None:
    """Send arrays of nils, which take ten times their bytes when they are decoded."""
    for size in HEAVY:
        with suppress(ConnectionClosed, AttributeError):  # websockets' own, of two ends at once
            async with connected(address) as connection:
                await connection.send(b"\xdd" + size.to_bytes(4, "big") + size * b"\xc0")
                await connection.wait_closed()


async def silent_sockets(address: str, seconds: float = 2.0) -> None:
    """Open connections and say nothing."""
    host, port = address.removeprefix("http://").split(":")
    with ExitStack() as opened:
        for _ in range(SILENT):
            with suppress(OSError):
                opened.enter_context(socket.create_connection((host, int(port))))
            await asyncio.sleep(0)
        await asyncio.sleep(seconds)


async def mute_pages(address: str, seconds: float = 2.0) -> None:
    """Open pages that never answer what they are asked."""

    async def mute() -> None:
        with suppress(Exception):  # it is refused in any of many ways
            async with connected(address) as connection:
                await connection.send(msgspec.msgpack.encode(CAMERA))
                await asyncio.sleep(seconds)

    await asyncio.gather(*(mute() for _ in range(MUTE)))


ATTACKS: dict[str, Callable[[str], Awaitable[None]]] = {
    "a flood of messages": flood,
    "five messages of 40 MB": heavy_messages,
    "300 silent connections": silent_sockets,
    "60 mute pages": mute_pages,
}


async def frames_each_second(page: Page, seconds: float) -> float:
    """Return the frames a second that a page gets while its slider is moved 20 times a second."""

    async def move() -> None:
        for force in hand_forces():
            await page.pull_with(force)
            await asyncio.sleep(0.05)

    moving = asyncio.create_task(move())
    frames, start = 0, time.monotonic()
    with suppress(TimeoutError):
        async with asyncio.timeout(seconds):
            while True:
                frames += await page.frames()
    moving.cancel()
    return frames / (time.monotonic() - start)


def kept_fraction(address: str, attack: str, seconds: float = 3.0) -> float:
    """Return the share of its frames that a page keeps while an attack runs in a process."""

    async def witness(hostile: ProcessPoolExecutor) -> float:
        async with connected(address) as connection:
            page = Page(connection)
            await page.open()
            hostile.submit(time.monotonic).result()  # the process is there
            quiet = await frames_each_second(page, seconds)
            done = hostile.submit(run_attack, address, attack, seconds)
            attacked = await frames_each_second(page, seconds)
            done.result()
            if quiet == 0.0:
                raise RuntimeError(f"no frame came in {seconds:g} s of peace")
            return attacked / quiet

    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as hostile:
        return asyncio.run(witness(hostile))


def run_attack(address: str, attack: str, seconds: float) -> None:
    """Run an attack for so long at most."""

    async def bounded() -> None:
        with suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                await ATTACKS[attack](address)

    asyncio.run(bounded())
