"""A page without a picture: a websocket connection that speaks viser's protocol."""

import itertools
import urllib.request
from collections.abc import Iterator
from typing import Any

import msgspec
import viser
import websockets.asyncio.client
import zstandard

# What a page's own slider is called, of a pull and of a dissection.
SLIDERS = ("Force", "Jaws")
DRAWN = ("/organ/skin", "/scope/state")
"""The nodes that tissue is drawn by."""
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


def cookie_of(link: str) -> str:
    """Return the cookie that a link gives a browser."""
    with urllib.request.urlopen(link) as answer:
        return answer.headers["Set-Cookie"].partition(";")[0]


def connected(address: str, cookie: str = "") -> websockets.asyncio.client.connect:
    """Return a connection to a trainer, to be entered."""
    return websockets.asyncio.client.connect(
        address.replace("http", "ws", 1),
        subprotocols=[websockets.Subprotocol(f"viser-v{viser.__version__}")],
        max_size=None,
        compression=None,
        additional_headers={"Cookie": cookie} if cookie else None,
    )


def teacher_connected(address: str, cookie: str) -> websockets.asyncio.client.connect:
    """Return a connection as the teacher's page of a class has, to be entered."""
    return websockets.asyncio.client.connect(
        f"{address.replace('http', 'ws', 1)}/class/live",
        max_size=None,
        origin=websockets.Origin(address),
        additional_headers={"Cookie": cookie},
    )


class Page:
    """The messages of a browser's page."""

    def __init__(self, connection: websockets.asyncio.client.ClientConnection) -> None:
        self._connection = connection
        self._slider = self._pointer = self._reset = ""
        self._words = 0  # that the pointer has told
        self._owner: str | None = None  # of the mesh by which the duct is dragged
        self._held = False
        self._unpack = zstandard.ZstdDecompressor()

    async def open(self, mode: str | None = None, name: str | None = None) -> None:
        """Say that a page is there, and wait for what it is led by and its reset button.

        Its address asks for a `mode`, if one is given; in a class it joins with a `name`.
        """
        await self._send(CAMERA)
        field = join = ""
        while not (
            (self._slider or self._pointer) and self._reset and (name is None or (field and join))
        ):
            for message in await self.messages():
                kind = message["type"]
                label = message.get("props", {}).get("label")
                self._pointer = message["uuid"] if label == "Pointer" else self._pointer
                field = message["uuid"] if label == "Your name" else field
                join = message["uuid"] if label == "Join the class" else join
                if kind == "GuiSliderMessage" and message["props"]["label"].startswith(SLIDERS):
                    self._slider = message["uuid"]
                if message.get("name") == "/organ/grip" and "owner" in message:
                    self._owner = message["owner"]
                if kind == "GuiButtonMessage" and message["props"]["label"].startswith("Reset"):
                    self._reset = message["uuid"]
                if kind == "LocalStorageGetItemRequestMessage":  # a browser that keeps nothing
                    answer = {
                        "type": "LocalStorageGetItemResponseMessage",
                        "request_uuid": message["request_uuid"],
                        "value": mode,
                        "error": None,
                    }
                    await self._send(answer)
        if name is not None:
            await self._update(field, name)
            await self._update(join, True)

    async def pull_with(self, force: float) -> None:
        """Move the force slider."""
        await self._update(self._slider, force)

    async def point(self, words: str) -> None:
        """Tell what the pointer does in the scope's picture."""
        self._words += 1
        await self._update(self._pointer, f"{self._words} {words}")

    async def drag(self, displacement: tuple[float, float, float]) -> None:
        """Lead the hand that holds the duct's middle to a place, mm from where it took hold."""
        start = CAMERA["look_at"]
        for phase in ("update",) if self._held else ("start", "update"):
            end = (
                start
                if phase == "start"
                else tuple(map(sum, zip(start, displacement, strict=True)))
            )
            message: dict[str, Any] = {
                "type": "SceneNodeDragMessage",
                "phase": phase,
                "name": "/organ/grip",
                "instance_index": None,
                "start_position": start,
                "start_screen_pos": (0.5, 0.5),
                "end_position": end,
                "end_screen_pos": (0.5, 0.5),
                "button": "left",
                "modifier": None,
                "owner": self._owner,
            }
            await self._send(message)
        self._held = True

    async def messages(self) -> list[dict[str, Any]]:
        """Return the messages of the next websocket frame, without their arrays."""
        raw = await self._connection.recv()
        assert isinstance(raw, bytes)
        packed = int.from_bytes(raw[8:16], "little")
        content = self._unpack.decompress(raw[16 : 16 + packed])
        return msgspec.msgpack.decode(content)["messages"]

    async def frames(self) -> int:
        """Return how often the tissue's picture is in the next websocket frame."""
        return sum(
            message["type"] == "SceneNodeUpdateMessage" and message["name"] in DRAWN
            for message in await self.messages()
        )

    async def _update(self, widget: str, value: float | str) -> None:
        update = {"type": "GuiUpdateMessage", "uuid": widget, "updates": {"value": value}}
        await self._send(update)

    async def _send(self, message: dict[str, Any]) -> None:
        await self._connection.send(msgspec.msgpack.encode(message))


def hand_forces() -> Iterator[float]:
    """Return successive slider forces, N, that keep the duct moving."""
    return itertools.cycle([3.2, 3.19, 3.2, 3.19, 3.2, 0.0, 0.01, 0.0, 0.01, 0.0])
