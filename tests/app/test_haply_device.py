"""Our driver of Haply's service against services that do well and badly. None of them hangs it."""

import json
import socket
from collections.abc import Callable, Sequence
from importlib.metadata import EntryPoint
from typing import Any, cast

import haply_pages as pages
import numpy as np
import pytest
from websockets.frames import Frame, Opcode
from websockets.http11 import Request
from websockets.server import ServerProtocol

from app.haptics import haptic_run
from app.haptics.device import (
    Device,
    DeviceError,
    DeviceOptions,
    DeviceState,
    WaitingDevice,
    device_names,
    open_device,
)
from app.haptics.hand import HandScript
from app.haptics.haply_device import HaplyDevice

Answer = Callable[[int, bytes], Sequence[str | bytes | float] | None]
"""What a service sends for a message, the first of which has the number 0; a number is a pause
before what follows, s, and None closes."""


def inventory(page: str = pages.INVENTORY_35) -> dict[str, Any]:
    return json.loads(page)


def state(z: float = 0.15, **others: Any) -> str:
    message = inventory()
    for each in message["inverse3"]:
        del each["config"]
        each["state"]["cursor_position"]["z"] = z
    return json.dumps({**message, **others})


class Service:
    """A service and the driver's socket to it, in one thread, with the clock of both.

    Time passes only while the driver waits, and what the service answers comes `ANSWERS_IN` later.
    """

    ANSWERS_IN = 2e-4

    def __init__(self, answer: Answer, first: str = pages.INVENTORY_35) -> None:
        self.now = 100.0
        self.heard: list[bytes] = []
        self.closed = False
        self._answer, self._first = answer, first
        self._protocol = ServerProtocol()
        self._arriving: list[tuple[float, bytes]] = []
        self._patience = 0.0

    def sendall(self, data: bytes) -> None:
        protocol, when = self._protocol, self.now + self.ANSWERS_IN
        protocol.receive_data(data)
        for event in protocol.events_received():
            if isinstance(event, Request):
                protocol.send_response(protocol.accept(event))
                protocol.send_text(self._first.encode())
            elif isinstance(event, Frame) and event.opcode in (Opcode.TEXT, Opcode.BINARY):
                self.heard.append(bytes(event.data))
                answers = self._answer(len(self.heard) - 1, bytes(event.data))
                if answers is None:
                    protocol.send_close(1000)
                for each in answers or ():
                    if isinstance(each, str):
                        protocol.send_text(each.encode())
                    elif isinstance(each, bytes):
                        protocol.send_binary(each)
                    else:
                        when += each
        if content := b"".join(protocol.data_to_send()):
            self._arriving.append((when, content))

    def recv(self, most: int) -> bytes:
        if not self._arriving or self._arriving[0][0] > self.now + self._patience:
            self.now += self._patience
            raise TimeoutError
        when, content = self._arriving.pop(0)
        self.now = max(self.now, when)
        assert len(content) <= most
        return content

    def fragments(self, message: str) -> bytes:
        protocol, content = self._protocol, message.encode()
        protocol.send_text(content[:30], fin=False)
        protocol.send_continuation(content[30:], fin=True)
        return b"".join(protocol.data_to_send())

    def settimeout(self, seconds: float) -> None:
        self._patience = seconds

    def setsockopt(self, *_: int) -> None: ...

    def shutdown(self, how: int) -> None:
        assert how == socket.SHUT_WR
        self._arriving.append((self.now + self.ANSWERS_IN, b""))

    def close(self) -> None:
        assert not self._arriving  # what is unread would reset the connection
        self.closed = True

    def opened(self, period: float = 1e-3, number: int = 0) -> HaplyDevice:
        return HaplyDevice(
            DeviceOptions(ADDRESS, period, number=number), clock=lambda: self.now,
            connect=lambda *_: cast(socket.socket, self),
        )  # fmt: skip


ADDRESS = "ws://127.0.0.1:10001"
STILL = np.zeros(3)


@pytest.mark.parametrize(
    ("page", "wanted"),
    [(pages.INVENTORY_35, pages.FORCE_35), (pages.INVENTORY_31, pages.FORCE_31)],
)
def test_the_profile_goes_first_and_forces_are_the_published_ones(page: str, wanted: bytes) -> None:
    name = inventory(page)["inverse3"][0]["device_id"].encode()
    force = np.array([0.0, 3.0, 3.0] if b"values" in wanted else [0.0, 0.0, 1.5])
    answer = state().replace("049D", name.decode())
    service = Service(lambda *_: [answer], page)
    device, into = service.opened(), DeviceState()
    assert device.exchange(STILL, into)
    assert device.exchange(force, into)
    assert into.position.tolist() == [0.0, -0.12, 0.15]
    device.close()
    assert service.closed
    first, second, last = service.heard
    assert b'"session":{"configure":{"profile":{"name":' in first
    assert second == wanted.replace(b"049D", name)
    assert json.loads(last)["inverse3"][0]["commands"]["set_cursor_force"].popitem()[1] == {
        "x": 0.0, "y": 0.0, "z": 0.0,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("bad", "says"),
    [
        ("{", "not a message"),
        ("[1]", "not a message"),
        ('{"inverse3": [{"device_id": "049D", "more": ' + "[" * 9000, "not a message"),
        (b"\xff\x00", "not a message"),
        (state().replace('"z": 0.15', '"z": 1e999'), "not a message|no place"),
        (state().replace('"z": 0.15', '"z": null'), "not a message"),
        (state().replace("049D", "0000"), "without 049D"),
        (json.dumps({"session_id": 7}), "without 049D"),
        (state(z=40.0), "a jump"),
    ],
)
def test_a_state_that_is_none_is_left_and_said(bad: str | bytes, says: str) -> None:
    service = Service(lambda number, _: [bad if number == 1 else state(0.15 + 1e-4 * number)])
    device, into = service.opened(), DeviceState()
    assert device.exchange(STILL, into)
    assert not device.exchange(STILL, into)
    output = device.trouble() or ""
    assert any(word in output for word in says.split("|")), output
    assert device.trouble() is None
    assert into.position[2] == 0.15
    assert any(device.exchange(STILL, into) for _ in range(2))  # back from a jump is another one
    assert into.position[2] == pytest.approx(0.15 + 1e-4 * (len(service.heard) - 1))


def test_the_button_of_a_wired_grip_and_states_that_leave_out_what_is_usual_are_read() -> None:
    message = json.loads(state())
    message["verse_grip"] = [json.loads(pages.WIRED_GRIP)]
    grip, reported = message["verse_grip"][0]["state"], message["inverse3"][0]["state"]
    reported["transform"] = {}  # its members are left out where they are the identity
    del reported["current_angular_torques"], reported["body_orientation"]

    def answer(number: int, _: bytes) -> list[str]:
        grip["button"] = number % 2 == 1
        return [json.dumps(message)]

    device, into = Service(answer).opened(), DeviceState()
    pressed: list[int] = []
    for _ in range(3):
        assert device.exchange(STILL, into)
        pressed.append(into.buttons)
    assert pressed == [0, 1, 0]


def test_the_second_device_of_a_service_has_its_own_force_and_grip() -> None:
    both = inventory()
    second = json.loads(json.dumps(both["inverse3"][0]).replace("049D", "04BA"))
    second["state"]["cursor_position"]["z"] = 0.2
    both["inverse3"].append(second)
    both["wireless_verse_grip"] = [
        {"device_id": name, "state": {"buttons": {"a": name == "61548", "b": False, "c": False}}}
        for name in ("61547", "61548")
    ]
    for number, name, place, buttons in ((0, "049D", 0.15, 0), (1, "04BA", 0.2, 1)):
        service, into = Service(lambda *_: [json.dumps(both)], json.dumps(both)), DeviceState()
        device = service.opened(number=number)
        assert name in device.name
        assert device.exchange(STILL, into)
        assert (into.position[2], into.buttons) == (place, buttons)
        assert [each["device_id"] for each in json.loads(service.heard[0])["inverse3"]] == [name]
        device.close()
    with pytest.raises(DeviceError, match="has 1 Inverse3 connected, not 2"):
        Service(lambda *_: []).opened(number=1)


def test_devices_of_one_service_are_opened_one_after_the_other(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[tuple[str, str, int]] = []

    def opened(name: str, options: DeviceOptions) -> Device:
        asked.append((name, options.address, options.number))
        return cast(Device, None)

    monkeypatch.setattr(haptic_run, "open_device", opened)
    other = "ws://127.0.0.1:10002"
    named = [("haply", ADDRESS), ("haply", other), ("haply", ADDRESS), ("virtual", ADDRESS)]
    with haptic_run.opened_devices([(name, DeviceOptions(at, 1e-3)) for name, at in named]):
        assert [number for _, _, number in asked] == [0, 0, 1, 0]


def forces_heard(service: Service) -> list[float]:
    commands = [json.loads(each)["inverse3"][0]["commands"] for each in service.heard]
    return [each["set_cursor_force"]["vector"]["z"] for each in commands]


def test_a_late_answer_is_no_state_and_what_is_sent_meanwhile_has_no_force() -> None:
    service = Service(lambda number, _: [0.06, state(0.2)] if number == 1 else [state()])
    device, into = service.opened(), DeviceState()
    force = np.array([0.0, 0.0, 1.0])
    assert device.exchange(STILL, into)
    begun = service.now
    assert not device.exchange(force, into)
    assert device.trouble() == "no state within 4 ms"
    assert service.now - begun == pytest.approx(0.004)  # four periods, and no longer
    fresh = [device.exchange(force, into) for _ in range(25)]
    assert into.position[2] == 0.15
    assert not any(fresh[:14])  # until it came, after 60 ms
    assert fresh[-1]
    # One with the force before it was late, none until there is a state in time again.
    assert forces_heard(service)[:6] == [0.0, 1.0, 0.0, 0.0, 1.0, 1.0]


def test_a_missing_answer_ends_the_force_until_it_is_given_up() -> None:
    service = Service(lambda number, _: [] if number == 1 else [state()])
    device, into = service.opened(), DeviceState()
    force = np.array([0.0, 0.0, 1.0])
    assert device.exchange(STILL, into)
    begun = service.now
    while not device.exchange(force, into):
        assert service.now - begun < 1.0
    assert 0.25 < service.now - begun < 0.3
    assert forces_heard(service) == [0.0, 1.0, 0.0, 0.0]
    assert device.exchange(force, into)
    assert forces_heard(service)[4:] == [1.0]


def test_no_answer_at_all_is_no_hang_and_no_force() -> None:
    service = Service(lambda number, _: [] if number else [state()])
    device, into = service.opened(), DeviceState()
    assert device.exchange(STILL, into)
    begun, output = service.now, list[str | None]()
    for _ in range(250):
        assert not device.exchange(np.array([0.0, 0.0, 1.0]), into)
        output.append(device.trouble())
    assert service.now - begun < 250 * 0.0042
    assert set(output) == {"no state within 4 ms"}
    assert forces_heard(service)[1] == 1.0
    assert not any(forces_heard(service)[2:])


def test_the_time_in_which_an_answer_comes_can_be_used() -> None:
    service = Service(lambda *_: [state()])
    device, used = service.opened(), list[tuple[int, float]]()
    assert isinstance(device, WaitingDevice)
    device.meanwhile = lambda: used.append((len(service.heard), service.now))
    begun = service.now
    assert device.exchange(STILL, DeviceState())
    assert used == [(1, begun)]
    assert service.now > begun


def test_a_message_in_fragments_is_one_and_nothing_is_unread_at_the_end() -> None:
    service = Service(lambda *_: [state(), state()])
    device, into = service.opened(), DeviceState()
    assert device.exchange(STILL, into)
    whole = service.fragments(state(0.1501))
    assert device._messages(whole[:9]) == []
    assert device._messages(whole[9:]) == [state(0.1501).encode()]
    device.close()
    assert forces_heard(service)[-1] == 0.0
    assert service.closed


def test_states_in_another_order_and_ones_that_nobody_asked_for() -> None:
    other = state()
    both = json.loads(other)
    stranger = json.loads(other)["inverse3"][0]
    stranger["device_id"], stranger["state"]["cursor_position"]["z"] = "FFFF", 0.3
    both["inverse3"].insert(0, stranger)
    unasked = json.dumps(both).replace("0.15", "0.151")
    service = Service(lambda n, _: [json.dumps(both), *([unasked] if n == 0 else [])])
    device, into = service.opened(), DeviceState()
    assert device.exchange(STILL, into)
    assert device.trouble() == "a state that answers no message"
    assert into.position[2] == 0.15
    assert device.exchange(STILL, into)
    assert into.position[2] == 0.15
    device.close()


def test_a_service_that_goes_away_ends_it_with_its_name() -> None:
    service = Service(lambda n, _: [state()] if n == 0 else None)
    device, into = service.opened(), DeviceState()
    assert device.exchange(STILL, into)
    with pytest.raises(DeviceError, match=f"{ADDRESS} has gone"):
        device.exchange(STILL, into)
    device.close()


def test_what_is_no_service_is_said_before_anything_is_felt() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        with pytest.raises(DeviceError, match="serve-virtual"):
            HaplyDevice(DeviceOptions(f"ws://127.0.0.1:{port}", 0.001))
    for first, says in ((json.dumps({"inverse3": []}), "no Inverse3"), ("hello", "not a message")):
        with pytest.raises(DeviceError, match=says):
            Service(lambda *_: [], first).opened()


def opened_by_zero(options: DeviceOptions) -> object:
    """A driver with a fault of its own."""
    return options.number / 0


def nothing(_: DeviceOptions) -> None:
    """A driver that forgets its device."""


def test_devices_are_found_by_their_entry_points(monkeypatch: pytest.MonkeyPatch) -> None:
    assert {"haply", "force-dimension", "virtual"} <= set(device_names())
    with pytest.raises(DeviceError, match=r"there are: .*virtual"):
        open_device("spoon", DeviceOptions("", 0.001))
    broken = EntryPoint("broken", "app.haptics.device:open_nothing", "bluntdissect.haptics")
    with monkeypatch.context() as patched:
        patched.setattr("importlib.metadata.entry_points", lambda group: [broken])
        with pytest.raises(DeviceError, match=r"open_nothing, cannot be loaded: .*open_nothing"):
            open_device("broken", DeviceOptions("", 0.001))
        # A fault of the driver's own is named with its place; one that gives nothing is none.
        fails = EntryPoint("fails", f"{__name__}:opened_by_zero", "bluntdissect.haptics")
        patched.setattr("importlib.metadata.entry_points", lambda group: [fails])
        says = r"the driver of fails failed: ZeroDivisionError: .*test_haply_device.py, line \d+\)"
        with pytest.raises(DeviceError, match=says):
            open_device("fails", DeviceOptions("", 0.001))
        empty = EntryPoint("empty", f"{__name__}:nothing", "bluntdissect.haptics")
        patched.setattr("importlib.metadata.entry_points", lambda group: [empty])
        with pytest.raises(DeviceError, match=r"empty, .*:nothing, returned no device"):
            open_device("empty", DeviceOptions("", 0.001))
    device = open_device("virtual", DeviceOptions("", 0.001, HandScript()))
    into = DeviceState()
    assert device.exchange(np.zeros(3), into)
    assert device.limits.force == 10.0


def test_a_missing_sdk_is_said_clearly() -> None:
    with pytest.raises(DeviceError, match="install"):
        open_device("force-dimension", DeviceOptions("", 0.001))
