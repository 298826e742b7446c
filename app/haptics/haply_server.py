"""Haply's Inverse service with a simulated device behind it: for clients that have no hardware.

The device is brought up to the present whenever a message comes, under the force that held until
then. It answers each message with one state, whatever was in it, as the published service does; an
invalid message moves nothing and is reported once. ``GET /devices`` and ``GET /version`` answer on
the same port.
"""

import asyncio
import http
import logging
import time
from collections.abc import Callable
from urllib.parse import urlsplit

import msgspec
import numpy as np
from msgspec import UNSET
from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from app.haptics.hand import HandScript
from app.haptics.haply_messages import (
    ClientMessage,
    Grip,
    GripState,
    Inverse,
    InverseConfig,
    InverseState,
    InverseStatus,
    ProtocolError,
    ServiceMessage,
    Vector,
    read_client_message,
)
from app.haptics.simulated_device import STEP, SimulatedDevice

# Longest time, s, simulated between two messages: the rest of a longer pause is skipped.
MOST_SECONDS = 0.25
# Preset of a workspace whose origin is in the middle of the device's reach.
CENTRED = "arm_front_centered"
# Stiffness, N/m, and damping, N s/m, that pull a cursor to its target.
PULL_TO_PLACE, DAMP_TO_PLACE = 500.0, 15.0
CLOSE_SECONDS = 0.5
"""Time, s, in which a client must answer that the service closes."""
VERSION = b'{"project_name":"bluntdissect virtual device","project_version":"3.5.0.0"}'
SILENT = logging.Logger("bluntdissect.haptics", logging.CRITICAL + 1)


class VirtualService:
    """The state and the answers of the service, without a socket; `clock` is monotonic, s."""

    def __init__(self, script: HandScript, clock: Callable[[], float] = time.monotonic) -> None:
        self._script, self._clock = script, clock
        self._device = SimulatedDevice(script)
        self._force = Vector()
        self._place: Vector | None = None
        self._origin = np.zeros(3)
        self._preset = "defaults"
        self._started = False
        self._commanded = self._advanced = 0.0
        self._encoder = msgspec.json.Encoder()
        SimulatedDevice(script).advance(1, np.zeros(3))  # compiled before anybody waits for it

    def begin(self) -> None:
        """Let a client find the hand at the start of its path."""
        self._device = SimulatedDevice(self._script)
        self._started, self._force, self._place = False, Vector(), None
        self._origin[:], self._preset = 0.0, "defaults"

    def inventory(self, session: int) -> bytes:
        """Return the message with which a connection begins."""
        return self._encoder.encode(self._message(session, introduced=True))

    def answer(self, content: bytes | str, session: int) -> bytes:
        """Carry out a message and return the one state that answers it."""
        try:
            message = read_client_message(content)
        except ProtocolError:
            self._bring_up()
            self._force, self._place = Vector(), None
            raise
        self._bring_up()
        introduced = self._obey(message)
        return self._encoder.encode(self._message(session, introduced=introduced))

    def state(self, session: int) -> bytes:
        """Return the present state."""
        return self._encoder.encode(self._message(session, introduced=False))

    def leave(self) -> None:
        """Set the force to zero: the client has gone."""
        self._bring_up()
        self._force, self._place = Vector(), None

    def _bring_up(self) -> None:
        """Simulate the time since the last message."""
        now = self._clock()
        if not self._started:
            self._started, self._advanced, self._commanded = True, now, now
            return
        if now - self._advanced > MOST_SECONDS:
            self._advanced = now - MOST_SECONDS
        hold = self._commanded + 1e-3 * self._script.device.hold_ms
        while (steps := int((now - self._advanced) / STEP)) > 0:
            held = self._advanced < hold
            # A place is led to in steps of a millisecond, the force follows the cursor.
            if held:
                steps = min(steps, max(1, int((hold - self._advanced) / STEP)))
            if self._place is not None:
                steps = min(steps, 10)
            self._device.advance(steps, self._acting() if held else np.zeros(3))
            self._advanced += steps * STEP

    def _acting(self) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        place, device = self._place, self._device
        if place is None:
            return np.array([self._force.x, self._force.y, self._force.z])
        goal = np.array([place.x, place.y, place.z]) + self._origin
        return PULL_TO_PLACE * (goal - device.position) - DAMP_TO_PLACE * device.velocity

    def _obey(self, message: ClientMessage) -> bool:
        """Carry out a message; return whether configs are requested in the answer."""
        force, place = Vector(), None
        for each in message.inverse3 or ():
            if each.device_id != self._script.device.device_id:
                continue
            if each.preset is not None:
                self._preset = each.preset
                middle = self._script.device.start_m if self._preset == CENTRED else (0.0,) * 3
                self._origin[:] = middle
            if each.commands is UNSET:
                continue
            given = each.commands.set_cursor_force
            if given is not UNSET and given.force is not UNSET:
                force = given.force
            led = each.commands.set_cursor_position
            if led is not UNSET and led.place is not UNSET:
                place = led.place
        self._force, self._place, self._commanded = force, place, self._clock()
        session = message.session
        return session is not UNSET and session.force_render_full_state is not UNSET

    def _message(self, session: int, *, introduced: bool) -> ServiceMessage:
        hardware, device = self._script.device, self._device
        old = hardware.protocol == "3.1"
        state = InverseState(_vector(device.position - self._origin), _vector(device.velocity))
        driven = state.driven(self._force, self._place, _vector(device.acting))
        if old:
            state.mode = driven.control_mode
        status = InverseStatus(in_use=driven.control_mode != "idle")
        inverse = Inverse(hardware.device_id, UNSET, state if old else driven, status)
        grip = Grip(hardware.grip_id, UNSET, GripState.with_pressed(device.pressed))
        if introduced:
            name, version = hardware.device_id, hardware.protocol
            inverse.config = InverseConfig.simulated(name, version, self._preset)
            grip = grip.introduced()
        return ServiceMessage(UNSET if old else session, [inverse], [grip])

    def devices(self) -> bytes:
        """Return the answer to GET /devices."""
        message = msgspec.to_builtins(self._message(0, introduced=True))
        message.pop("session_id", None)
        return self._encoder.encode({**message, "verse_grip": []})


def _vector(array: np.ndarray[tuple[int], np.dtype[np.float64]]) -> Vector:
    return Vector(*array.tolist())


class HaplyServer:
    """The service on a socket of this machine, one event loop for all of its clients."""

    def __init__(self, script: HandScript, say: Callable[[str], None] = print) -> None:
        self._service = VirtualService(script)
        self._say = say
        self._sessions = self._open = 0

    async def start(self, host: str, port: int) -> Server:
        """Serve."""
        return await serve(
            self._attend,
            host,
            port,
            process_request=self._http,
            compression=None,
            ping_interval=None,
            close_timeout=CLOSE_SECONDS,
            logger=SILENT,
        )

    def run(self, host: str, port: int, ready: Callable[[int], None]) -> None:
        """Serve until the process is told to end."""

        async def forever() -> None:
            async with await self.start(host, port) as server:
                ready(next(iter(server.sockets)).getsockname()[1])
                await asyncio.get_running_loop().create_future()

        asyncio.run(forever())

    def _http(self, connection: ServerConnection, request: Request) -> Response | None:
        if request.headers.get("Upgrade", "").lower() == "websocket":
            return None
        path = urlsplit(request.path).path
        found = {"/devices": self._service.devices(), "/version": VERSION}.get(path)
        if found is None:
            return connection.respond(http.HTTPStatus.NOT_FOUND, "no such page\n")
        headers = Headers(
            [("Content-Type", "application/json"), ("Content-Length", str(len(found)))]
        )
        return Response(200, "OK", headers, found)

    async def _attend(self, connection: ServerConnection) -> None:
        service = self._service
        self._sessions += 1
        session, faults = self._sessions, 0
        if not self._open:
            service.begin()
        self._open += 1
        self._say(f"client {session} has come")
        try:
            await connection.send(service.inventory(session), text=True)
            async for content in connection:
                try:
                    answer = service.answer(content, session)
                except ProtocolError as error:
                    answer, faults = service.state(session), faults + 1
                    if faults == 1:
                        self._say(f"client {session}: {error}; it gets states and no force")
                await connection.send(answer, text=True)
        except ConnectionClosed:
            pass
        finally:
            self._open -= 1
            service.leave()
            self._say(f"client {session} has gone")
