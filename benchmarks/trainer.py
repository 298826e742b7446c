"""What the trainer costs: one step of a session, and frames a second that clients receive.

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
import numpy as np
import psutil
import viser
import websockets.asyncio.client
import zstandard

from app.command_line.load import shipped_organ
from app.simulation.session import Session

SECONDS = 10.0
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


def step_microseconds() -> dict[str, float]:
    """Return the median time of one step of a pulled session, us, whole and in its parts."""
    session = Session(shipped_organ())
    dissection = session.dissection
    limit = 0.6 * session.force_limit

    def timed(times: list[float], force: float) -> None:
        session.set_force(force)
        while True:
            start = time.perf_counter()
            moved = session.step(1.0 / 30.0)
            if not moved:
                return
            times.append(time.perf_counter() - start)

    timed([], limit)
    steps: list[float] = []
    for _ in range(40):
        timed(steps, 0.0)
        timed(steps, limit)
    surface = session.surfaces[0]
    bound = surface.skin.bound_to(dissection.driving)
    transforms = dissection.rest_transforms()
    out = np.empty_like(surface.vertices)
    skins: list[float] = []
    for _ in range(2000):
        start = time.perf_counter()
        bound.deform(transforms, out)
        skins.append(time.perf_counter() - start)
    return {
        "vertices": float(len(out)),
        "step_us": 1e6 * float(np.median(steps)),
        "skin_us": 1e6 * float(np.median(skins)),
    }


async def frames_per_second(address: str, clients: int) -> list[float]:
    """Return the frames of the duct that each of some clients receives, 1/s."""
    return await asyncio.gather(*(_one_client(address) for _ in range(clients)))


async def _one_client(address: str) -> float:
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
        while time.perf_counter() - start < SECONDS:
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


def main() -> None:
    """Print the figures."""
    step = step_microseconds()
    print(f"skin of {step['vertices']:.0f} vertices: {step['skin_us']:.0f} us a frame")
    print(f"one step (beam, criterion and skin): {step['step_us']:.0f} us")
    command = [sys.executable, "-c", "from app.command_line import main; main()"]
    with subprocess.Popen(
        [*command, "trainer", "--port", "0"], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        address = process.stdout.readline().split()[-1]
        server = psutil.Process(process.pid)
        for clients in (1, 8):
            before = server.cpu_times()
            start = time.perf_counter()
            rates = asyncio.run(frames_per_second(address, clients))
            elapsed = time.perf_counter() - start
            after = server.cpu_times()
            busy = (after.user + after.system - before.user - before.system) / elapsed
            print(
                f"{clients} client{'s' if clients > 1 else ''}: {min(rates):.1f} to "
                f"{max(rates):.1f} frames a second each, {100.0 * busy:.0f} % of one core"
            )
        process.terminate()


if __name__ == "__main__":
    main()
