"""Our driver of Haply's service against services that do well and badly. None of them hangs it."""

import json
import socket
import threading
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from importlib.metadata import EntryPoint
from typing import Any

import haply_pages as pages
import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import ServerConnection, serve

from app.haptics.device import DeviceError, DeviceOptions, DeviceState, device_names, open_device
from app.haptics.hand import HandScript
from app.haptics.haply_device import HaplyDevice

Answer = Callable[[int, str | bytes], Sequence[str | bytes] | None]
"""What a service sends for a message, the first of which has the number 0; None closes."""


def inventory(page: str = pages.INVENTORY_35) -> dict[str, Any]:
    return json.loads(page)


def state(z: float = 0.15, **others: Any) -> str:
    message = inventory()
    for each in message["inverse3"]:
        del each["config"]
        each["state"]["cursor_position"]["z"] = z
    return json.dumps({**message, **others})


@contextmanager
def service(answer: Answer, first: str = pages.INVENTORY_35) -> Generator[tuple[str, list[Any]]]:
    """A service of ours; gives its address and what it gets."""
    heard: list[str | bytes] = []

    def attend(connection: ServerConnection) -> None:
        try:
            connection.send(first)
            for number, content in enumerate(connection):
                heard.append(content)
                answers = answer(number, content)
                if answers is None:
                    return
                for each in answers:
                    connection.send(each)
        except ConnectionClosed:
            pass

    with serve(attend, "127.0.0.1", 0, compression=None) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield f"ws://127.0.0.1:{server.socket.getsockname()[1]}", heard
        finally:
            server.shutdown()
            thread.join()


def opened(address: str) -> HaplyDevice:
    # A period so long that a loaded machine's pauses are not taken for the service's.
    return HaplyDevice(DeviceOptions(address, 0.5))


@pytest.mark.parametrize(
    ("page", "wanted"),
    [(pages.INVENTORY_35, pages.FORCE_35), (pages.INVENTORY_31, pages.FORCE_31)],
)
def test_the_profile_goes_first_and_forces_are_the_published_ones(page: str, wanted: bytes) -> None:
    name = inventory(page)["inverse3"][0]["device_id"].encode()
    force = np.array([0.0, 3.0, 3.0] if b"values" in wanted else [0.0, 0.0, 1.5])
    answer = state().replace("049D", name.decode())
    with service(lambda *_: [answer], page) as (address, heard):
        device, into = opened(address), DeviceState()
        assert device.exchange(np.zeros(3), into)
        assert device.exchange(force, into)
        assert into.position.tolist() == [0.0, -0.12, 0.15]
        device.close()
        end = time.monotonic() + 10.0
        while len(heard) < 3 and time.monotonic() < end:  # the service hears it in its own thread
            time.sleep(0.01)
    first, second, last = [each.encode() if isinstance(each, str) else each for each in heard]
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
        (b"\xff\x00", "not a message"),
        (state().replace('"z": 0.15', '"z": 1e999'), "not a message|no place"),
        (state().replace('"z": 0.15', '"z": null'), "not a message"),
        (state().replace("049D", "0000"), "without 049D"),
        (json.dumps({"session_id": 7}), "without 049D"),
        (state(z=40.0), "a jump"),
    ],
)
def test_a_state_that_is_none_is_left_and_said(bad: str | bytes, says: str) -> None:
    spoilt = threading.Event()

    def answer(number: int, _: str | bytes) -> list[str | bytes]:
        return [bad if spoilt.is_set() else state(0.15 + 1e-4 * min(number, 50))]

    with service(answer) as (address, _):
        device, into = opened(address), DeviceState()
        try:
            # On a busy machine a state is late at times, and is not taken.
            assert any(device.exchange(np.zeros(3), into) for _ in range(50))
            place, said = into.position[2], ""
            spoilt.set()
            for _ in range(50):
                assert not device.exchange(np.zeros(3), into)
                said = device.trouble() or ""
                if any(word in said for word in says.split("|")):
                    break
            assert any(word in said for word in says.split("|")), said
            assert into.position[2] == place
            spoilt.clear()
            assert any(device.exchange(np.zeros(3), into) for _ in range(50))
        finally:
            device.close()


def test_late_and_missing_answers_give_no_state_no_hang_and_no_force() -> None:
    def answer(number: int, _: str | bytes) -> list[str | bytes]:
        if number == 1:
            time.sleep(0.06)
        return [] if number == 2 else [state(0.15 + 1e-3 * number)]

    with service(answer) as (address, heard):
        device, into = HaplyDevice(DeviceOptions(address, 0.001)), DeviceState()
        force = np.array([0.0, 0.0, 1.0])
        while not device.exchange(np.zeros(3), into):
            pass
        begun = time.perf_counter()
        assert not device.exchange(force, into)  # answered too late
        assert time.perf_counter() - begun < 0.05
        fresh: list[bool] = []
        while len(fresh) < 60 and not (fresh and fresh[-1]):
            fresh.append(device.exchange(force, into))
        assert into.position[2] == 0.15 or fresh[-1]
        for _ in range(30):
            device.exchange(force, into)
        device.close()
    # What is sent to a service that is behind has no force in it.
    sent = [json.loads(each)["inverse3"][0]["commands"]["set_cursor_force"]["vector"]["z"]
            for each in heard]  # fmt: skip
    assert sent[1] == 1.0
    assert sent[2] == 0.0


def test_states_in_another_order_and_ones_that_nobody_asked_for() -> None:
    other = state()
    both = json.loads(other)
    stranger = json.loads(other)["inverse3"][0]
    stranger["device_id"], stranger["state"]["cursor_position"]["z"] = "FFFF", 0.3
    both["inverse3"].insert(0, stranger)

    with service(lambda n, _: [json.dumps(both)] * (2 if n == 0 else 1)) as (address, _):
        device, into = opened(address), DeviceState()
        assert device.exchange(np.zeros(3), into)
        time.sleep(0.05)
        assert device.exchange(np.zeros(3), into)
        assert into.position[2] == 0.15
        device.close()


def test_a_service_that_goes_away_ends_it_with_its_name() -> None:
    into = DeviceState()
    with service(lambda n, _: [state()] if n == 0 else None) as (address, _):
        device = opened(address)
        assert device.exchange(np.zeros(3), into)
        with pytest.raises(DeviceError, match=f"{address} has gone"):
            device.exchange(np.zeros(3), into)
        device.close()


def test_what_is_no_service_is_said_before_anything_is_felt() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        with pytest.raises(DeviceError, match="serve-virtual"):
            opened(f"ws://127.0.0.1:{port}")
    for first, says in ((json.dumps({"inverse3": []}), "no Inverse3"), ("hello", "not a message")):
        with service(lambda *_: [], first) as (address, _), pytest.raises(DeviceError, match=says):
            opened(address)


def test_devices_are_found_by_their_entry_points(monkeypatch: pytest.MonkeyPatch) -> None:
    assert {"haply", "force-dimension", "virtual"} <= set(device_names())
    with pytest.raises(DeviceError, match=r"there are: .*virtual"):
        open_device("spoon", DeviceOptions("", 0.001))
    broken = EntryPoint("broken", "app.haptics.device:open_nothing", "bluntdissect.haptics")
    with monkeypatch.context() as patched:
        patched.setattr("importlib.metadata.entry_points", lambda group: [broken])
        with pytest.raises(DeviceError, match=r"open_nothing, cannot be loaded: .*open_nothing"):
            open_device("broken", DeviceOptions("", 0.001))
    device = open_device("virtual", DeviceOptions("", 0.001, HandScript()))
    into = DeviceState()
    assert device.exchange(np.zeros(3), into)
    assert device.limits.force == 10.0


def test_a_missing_sdk_is_said_clearly() -> None:
    with pytest.raises(DeviceError, match="install"):
        open_device("force-dimension", DeviceOptions("", 0.001))
