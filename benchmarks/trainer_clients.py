"""Frames a second that the trainer's clients receive, how late they are, and what that takes.

Clients are websocket connections that speak viser's protocol, without a picture: they move the
force slider as a trainee would and count the frames of the duct that come back. One more client
waits for the duct's answer to each of its moves. The trainer runs as a process of its own, whose
processor time is read from outside.
"""

import asyncio
import subprocess
import sys
import time
from typing import Any

import msgspec
import numpy as np
import psutil
import viser
import websockets.asyncio.client
import zstandard

__all__ = ["client_figures"]

CLIENTS = (1, 8, 16)
SECONDS = 10.0
FIRST_SECONDS, MOST_FIRST, COMPILING = 2.0, 30, 50.0
"""A first client pulls for so long, again and again, until the trainer takes less than so many % of
a core: then nothing is being compiled any more."""
SLIDER_SECONDS = 0.1
"""A hand moves a slider this often."""
LATENCY_MOVES = 60
"""Moves of the slider whose answers are waited for."""
STILL_SECONDS = 0.15
"""A duct that sends nothing for so long has come to rest."""
CAMERA: dict[str, Any] = {
    "type": "ViewerCameraMessage",
    "wxyz": (1.0, 0.0, 0.0, 0.0),
    "position": (25.0, -70.0, 52.0),
    "fov": 0.6,
    "near": 0.1,
    "far": 1000.0,
    "image_height": 800,
    "image_width": 1280,
    "look_at": (25.0, 3.0, 0.0),
    "up_direction": (0.0, 0.0, 1.0),
}


async def frames_per_second(address: str, clients: int, seconds: float) -> list[float]:
    """Return the frames of the duct that each of some clients receives in a time, 1/s."""
    return await asyncio.gather(*(_one_client(address, seconds) for _ in range(clients)))


def _connected(address: str) -> websockets.asyncio.client.connect:
    return websockets.asyncio.client.connect(
        address.replace("http", "ws", 1),
        subprotocols=[websockets.Subprotocol(f"viser-v{viser.__version__}")],
        max_size=None,
        compression=None,
    )


async def _slider(connection: websockets.asyncio.client.ClientConnection) -> str:
    """Say that a page is there, and return the force slider that it is sent."""
    await connection.send(msgspec.msgpack.encode(CAMERA))
    while True:
        for message in _messages(await connection.recv()):
            kind = message["type"]
            if kind == "GuiSliderMessage" and message["props"]["label"].startswith("Force"):
                return message["uuid"]
            if kind == "LocalStorageGetItemRequestMessage":  # a browser that keeps nothing
                answer = {
                    "type": "LocalStorageGetItemResponseMessage",
                    "request_uuid": message["request_uuid"],
                    "value": None,
                    "error": None,
                }
                await connection.send(msgspec.msgpack.encode(answer))


def _move(slider: str, force: float) -> bytes:
    update = {"type": "GuiUpdateMessage", "uuid": slider, "updates": {"value": force}}
    return msgspec.msgpack.encode(update)


def _frames(raw: str | bytes) -> int:
    """Return how often the duct's vertices are in one websocket frame."""
    return sum(
        message["type"] == "SceneNodeUpdateMessage" and message["name"] == "/organ/skin"
        for message in _messages(raw)
    )


async def _one_client(address: str, seconds: float) -> float:
    async with _connected(address) as connection:
        slider = await _slider(connection)

        async def pull() -> None:
            force = 0.0
            while True:
                force = 3.2 - force
                await connection.send(_move(slider, force))
                await asyncio.sleep(SLIDER_SECONDS)

        hand = asyncio.create_task(pull())
        frames, start = 0, time.perf_counter()
        while time.perf_counter() - start < seconds:
            frames += _frames(await connection.recv())
        hand.cancel()
        return frames / (time.perf_counter() - start)


async def answer_seconds(address: str, moves: int) -> list[float]:
    """Return how long after each move of the slider the duct's next vertices come, s."""
    async with _connected(address) as connection:
        slider = await _slider(connection)
        seconds: list[float] = []
        for move in range(moves):
            try:
                while True:  # until it is at rest
                    await asyncio.wait_for(connection.recv(), STILL_SECONDS)
            except TimeoutError:
                pass
            start = time.perf_counter()
            await connection.send(_move(slider, 0.5 + 0.1 * (move % 2)))
            while not _frames(await connection.recv()):
                pass
            seconds.append(time.perf_counter() - start)
        return seconds


def _messages(raw: str | bytes) -> list[dict[str, Any]]:
    """Return the messages of one websocket frame, without their arrays."""
    assert isinstance(raw, bytes)
    packed = int.from_bytes(raw[8:16], "little")
    content = zstandard.ZstdDecompressor().decompress(raw[16 : 16 + packed])
    return msgspec.msgpack.decode(content)["messages"]


def client_figures() -> dict[str, float]:
    """Return the frames a second of each number of clients, and the share of a core they take.

    Returns
    -------
    dict[str, float]
        `frames_per_second_<n>`, of the client that has fewest, 1/s, and
        `processor_percent_<n>`, % of one core, for n clients; `answer_ms_95`, ms from a move of
        the slider to the duct's vertices, at the 95th percentile.

    Raises
    ------
    RuntimeError
        If the trainer does not start.
    """
    figures: dict[str, float] = {}
    # A client that leaves while it is being drawn is a warning of viser's, here by intent.
    program = "from app.command_line import main; main()"
    command = [sys.executable, "-W", "ignore::UserWarning", "-c", program]
    with subprocess.Popen(
        [*command, "trainer", "--port", "0"], stdout=subprocess.PIPE, text=True
    ) as process:
        try:
            words = process.stdout.readline().split() if process.stdout else []
            if not words:
                raise RuntimeError("the trainer did not start")
            server = psutil.Process(process.pid)
            for _ in range(MOST_FIRST):
                if _served(server, words[-1], 1, FIRST_SECONDS)[1] < COMPILING:
                    break
            answers = asyncio.run(answer_seconds(words[-1], LATENCY_MOVES))
            figures["answer_ms_95"] = 1e3 * float(np.percentile(answers, 95))
            for clients in CLIENTS:
                rate, percent = _served(server, words[-1], clients, SECONDS)
                figures[f"frames_per_second_{clients}"] = rate
                figures[f"processor_percent_{clients}"] = percent
        finally:
            process.terminate()
    return figures


def _served(
    server: psutil.Process, address: str, clients: int, seconds: float
) -> tuple[float, float]:
    """Return the frames a second of the client that has fewest, and the % of a core they take."""
    before = server.cpu_times()
    start = time.perf_counter()
    rates = asyncio.run(frames_per_second(address, clients, seconds))
    elapsed = time.perf_counter() - start
    after = server.cpu_times()
    busy = after.user + after.system - before.user - before.system
    return min(rates), 100.0 * busy / elapsed
