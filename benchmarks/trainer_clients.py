"""Frames a second that the trainer's clients receive, and what that takes of a processor.

Clients are websocket connections that speak viser's protocol, without a picture: they move the
force slider as a trainee would and count the frames of the duct that come back. The trainer runs
as a process of its own, whose processor time is read from outside.
"""

import asyncio
import subprocess
import sys
import time
from typing import Any

import msgspec
import psutil
import viser
import websockets.asyncio.client
import zstandard

__all__ = ["client_figures"]

CLIENTS = (1, 8)
SECONDS = 10.0
FIRST_SECONDS, MOST_FIRST, COMPILING = 2.0, 30, 50.0
"""A first client pulls for so long, again and again, until the trainer takes less than so many % of
a core: then nothing is being compiled any more."""
SLIDER_SECONDS = 0.1
"""A hand moves a slider this often."""
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


async def _one_client(address: str, seconds: float) -> float:
    encode = msgspec.msgpack.encode
    async with websockets.asyncio.client.connect(
        address.replace("http", "ws", 1),
        subprotocols=[websockets.Subprotocol(f"viser-v{viser.__version__}")],
        max_size=None,
        compression=None,
    ) as connection:
        await connection.send(encode(CAMERA))
        slider = ""
        while not slider:
            for message in _messages(await connection.recv()):
                if message["type"] == "GuiSliderMessage" and message["props"]["label"].startswith(
                    "Force"
                ):
                    slider = message["uuid"]

        async def pull() -> None:
            force = 0.0
            while True:
                force = 3.2 - force
                update = {"type": "GuiUpdateMessage", "uuid": slider, "updates": {"value": force}}
                await connection.send(encode(update))
                await asyncio.sleep(SLIDER_SECONDS)

        hand = asyncio.create_task(pull())
        frames, start = 0, time.perf_counter()
        while time.perf_counter() - start < seconds:
            frames += sum(
                message["type"] == "SceneNodeUpdateMessage" and message["name"] == "/organ/skin"
                for message in _messages(await connection.recv())
            )
        hand.cancel()
        return frames / (time.perf_counter() - start)


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
        `processor_percent_<n>`, % of one core, for n clients.

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
