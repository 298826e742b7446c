"""Haply's Inverse3 through its service: one message out, one state in, in the loop's own thread.

The websocket protocol is the library's, without its threads: between the loop and the wire there is
nothing but a socket. States answer messages in their order, so that each is known to be as old as
the message that it answers; one that is late is read and left.
"""

import socket
import time
from collections import deque
from collections.abc import Callable

import msgspec
import numpy as np
from msgspec import UNSET
from numpy.typing import NDArray
from websockets.client import ClientProtocol
from websockets.exceptions import InvalidHandshake, WebSocketException
from websockets.frames import DATA_OPCODES, Frame
from websockets.protocol import State
from websockets.uri import parse_uri

from app.haptics.device import DeviceError, DeviceLimits, DeviceOptions, DeviceState
from app.haptics.haply_messages import (
    ClientMessage,
    ProtocolError,
    ServiceMessage,
    Vector,
    Version,
    read_service_message,
    websocket_address,
)

PROFILE = "org.bluntdissect:duct"
LIMITS = DeviceLimits(force=8.0, force_rate=200.0, damping=0.5, delay=1e-3)
"""An Inverse3 gives 10 N at its peak; its friction is not published, 0.5 N s/m is assumed. The
force that answers a state leaves with the next message; the device's own delay is not known."""
CONNECT_SECONDS = 3.0
# Age, s, of a message beyond which the state that answers it is ignored.
STALE_SECONDS = 0.02
LOST_SECONDS = 0.25
"""Time, s, after which an answer is not waited for any more."""
SLACK = 5e-3
"""Jump, m, that counts as motion at any speed."""
CLOSE_SECONDS = 0.1
"""Time, s, that a service has to take in the last message."""


class HaplyDevice:
    """An Inverse3 behind an open connection; `version` is that of the service's messages.

    `clock`, s, and `connect` are what time and connections are taken from. `meanwhile` is as
    `WaitingDevice` has it.
    """

    def __init__(
        self,
        options: DeviceOptions,
        *,
        clock: Callable[[], float] = time.perf_counter,
        connect: Callable[[tuple[str, int], float], socket.socket] = socket.create_connection,
    ) -> None:
        self._clock = clock
        self.meanwhile: Callable[[], None] = lambda: None
        host, port = websocket_address(options.address)
        self._address, self._number = options.address, options.number
        self._patience = min(STALE_SECONDS, 4.0 * options.period)
        self._sent: deque[float] = deque()
        self._behind = False
        self._fragments: list[bytes] = []  # of a message in fragments
        self._trouble: str | None = None
        self._last: Vector | None = None
        self._last_time = 0.0
        self._profile: str | None = PROFILE
        self._encoder = msgspec.json.Encoder()
        try:
            self._socket = connect((host, port), CONNECT_SECONDS)
        except OSError as error:
            why = (error.strerror or str(error)).lower()
            raise DeviceError(
                f"no service of Haply's answers at {options.address}: {why}; start it, or a "
                f"virtual one with `bluntdissect haptics --serve-virtual`"
            ) from error
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        try:
            self._protocol = self._connected()
            message = self._inventory()
        except BaseException:
            self._socket.close()
            raise
        self.version: Version = "3.1" if message.session_id is UNSET else "3.5"
        inverse, grips = message.inverse3[self._number], message.wireless_verse_grip
        self._id = inverse.device_id
        self._message = ClientMessage.of_force(self._id, Vector(), self.version)
        self._grip = grips[self._number].device_id if len(grips) > self._number else ""
        kind = "Inverse3" if inverse.config is UNSET else inverse.config.type
        self.name = f"Haply {kind} {self._id}, messages of {self.version}"
        self.limits = LIMITS

    def exchange(self, force: NDArray[np.float64], state: DeviceState) -> bool:
        """Send a force and wait for the state that answers it; see `Device`."""
        now = self._clock()
        # A service that is behind is told that there is no force, and then left alone.
        waited = now - self._sent[-1] if self._sent else 0.0
        if self._behind and waited > LOST_SECONDS:
            self._sent.clear()
        if not self._sent:
            self._send(*(0.0 * force if self._behind else force).tolist())
            self._behind = False
        elif not self._behind and waited > STALE_SECONDS:
            self._send(0.0, 0.0, 0.0)
            self._behind = True
        self.meanwhile()
        deadline = now + self._patience
        while True:
            try:
                self._socket.settimeout(max(deadline - self._clock(), 1e-5))
                content = self._socket.recv(65536)
            except TimeoutError:
                self._trouble = f"no state within {1e3 * self._patience:g} ms"
                return False
            except OSError as error:
                raise self._gone(str(error)) from error
            if not content:
                raise self._gone("it closed the connection")
            taken = False
            for message in self._messages(content):
                taken |= self._take(message, state)
            if taken:
                return True
            # Whatever came answers what was sent: nothing more will.
            if not self._sent or self._clock() > deadline:
                return False

    def trouble(self) -> str | None:
        """Return what was wrong last; see `Device`."""
        line, self._trouble = self._trouble, None
        return line

    def close(self) -> None:
        """Send no force, in a message of its own, and close; see `Device`."""
        try:
            self._socket.settimeout(CLOSE_SECONDS)
            self._send(0.0, 0.0, 0.0)
            self._protocol.send_close(1000)
            self._flush()
            # A socket closed with something unread resets the connection, and the service may never
            # read what it was sent.
            self._socket.shutdown(socket.SHUT_WR)
            deadline = self._clock() + CLOSE_SECONDS
            while self._clock() < deadline and self._socket.recv(65536):
                pass
        except (OSError, DeviceError, WebSocketException):
            pass  # there is nobody to tell
        finally:
            self._socket.close()

    def _connected(self) -> ClientProtocol:
        """Shake hands."""
        protocol = ClientProtocol(parse_uri(self._address), max_size=2**20)
        protocol.send_request(protocol.connect())
        deadline = self._clock() + CONNECT_SECONDS
        try:
            for data in protocol.data_to_send():
                self._socket.sendall(data)
            while protocol.state is State.CONNECTING and protocol.handshake_exc is None:
                if (patience := deadline - self._clock()) <= 0.0:
                    raise TimeoutError("timed out")
                self._socket.settimeout(patience)
                content = self._socket.recv(65536)
                protocol.receive_data(content) if content else protocol.receive_eof()
        except (OSError, InvalidHandshake) as error:
            raise DeviceError(f"no websocket answers at {self._address}: {error}") from error
        if protocol.handshake_exc is not None:
            raise DeviceError(f"no websocket answers at {self._address}: {protocol.handshake_exc}")
        return protocol

    def _inventory(self) -> ServiceMessage:
        """Wait for the first message, with a device in it."""
        deadline = self._clock() + CONNECT_SECONDS
        content = b""  # it may have come with the handshake
        while (patience := deadline - self._clock()) > 0.0:
            for each in self._messages(content):
                try:
                    message = read_service_message(each)
                except ProtocolError as error:
                    raise DeviceError(f"{self._address}: {error}") from error
                if (found := len(message.inverse3)) <= self._number:
                    wanted = f", not {self._number + 1}" if found else ""
                    raise DeviceError(
                        f"the service at {self._address} has {found or 'no'} Inverse3 "
                        f"connected{wanted}"
                    )
                return message
            try:
                self._socket.settimeout(patience)
                content = self._socket.recv(65536)
            except TimeoutError:
                break
            except OSError as error:
                raise self._gone(str(error)) from error
            if not content:
                raise self._gone("it closed the connection")
        raise DeviceError(f"the service at {self._address} sends no inventory of its devices")

    def _send(self, x: float, y: float, z: float) -> None:
        message = ClientMessage.of_force(self._id, Vector(x, y, z), self.version,
                                         profile=self._profile)  # fmt: skip
        self._profile = None
        self._protocol.send_text(self._encoder.encode(message))
        self._flush()
        self._sent.append(self._clock())

    def _flush(self) -> None:
        try:
            for data in self._protocol.data_to_send():
                self._socket.sendall(data)
        except OSError as error:
            raise self._gone(str(error)) from error

    def _messages(self, content: bytes) -> list[bytes]:
        """Return the messages that are whole with what has arrived."""
        protocol, messages = self._protocol, list[bytes]()
        if content:
            protocol.receive_data(content)
        for event in protocol.events_received():
            if isinstance(event, Frame) and event.opcode in DATA_OPCODES:
                self._fragments.append(bytes(event.data))
                if event.fin:
                    messages.append(b"".join(self._fragments))
                    self._fragments.clear()
        self._flush()  # of what a ping asks for
        if protocol.state is not State.OPEN:
            if protocol.parser_exc is not None:
                raise self._gone(f"it sent what cannot be read, {protocol.parser_exc}")
            raise self._gone(f"it closed the connection, {protocol.close_rcvd}")
        return messages

    def _take(self, content: bytes, state: DeviceState) -> bool:
        now = self._clock()
        if not self._sent:
            self._trouble = "a state that answers no message"
            return False
        asked = self._sent.popleft()
        try:
            message = read_service_message(content)
        except ProtocolError as error:
            self._trouble = str(error)
            return False
        found = [each for each in message.inverse3 if each.device_id == self._id]
        if not found or found[0].state is UNSET:
            self._trouble = f"a state without {self._id}"
            return False
        if now - asked > STALE_SECONDS:
            self._trouble = f"a state over {1e3 * STALE_SECONDS:g} ms late"
            return False
        place, speed = found[0].state.cursor_position, found[0].state.cursor_velocity
        if self._last is not None:
            distance = max(abs(place.x - self._last.x), abs(place.y - self._last.y),
                      abs(place.z - self._last.z))  # fmt: skip
            if distance > SLACK + self.limits.speed * (now - self._last_time):
                self._trouble = "a jump"
                self._last, self._last_time = place, now
                return False
        self._last, self._last_time = place, now
        state.position[0], state.position[1], state.position[2] = place.x, place.y, place.z
        state.velocity[0], state.velocity[1], state.velocity[2] = speed.x, speed.y, speed.z
        for grip in message.wireless_verse_grip:
            if grip.device_id == self._grip and grip.state is not UNSET:
                state.buttons = grip.state.pressed
        for wired in (message.verse_grip or ())[self._number : self._number + 1]:
            if not self._grip and wired.state is not UNSET:
                state.buttons = int(wired.state.button)
        return True

    def _gone(self, why: str) -> DeviceError:
        return DeviceError(f"the service at {self._address} has gone: {why.lower()}")


def open_haply(options: DeviceOptions) -> HaplyDevice:
    """Return an Inverse3 of a service, with the VerseGrip of the same place in its list."""
    return HaplyDevice(options)
