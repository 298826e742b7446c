"""The simulated device, its hand, and Haply's messages as it serves them."""

import asyncio
import json
import urllib.request
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import haply_pages as pages
import msgspec
import numpy as np
import pytest
from program import LONGEST
from websockets.asyncio.client import connect

from app.haptics.hand import HandScript, SimulatedHand, SimulatedHardware, Waypoint, read_hand
from app.haptics.haply_messages import (
    ClientMessage,
    ProtocolError,
    Vector,
    read_client_message,
    read_service_message,
    websocket_address,
)
from app.haptics.haply_server import HaplyServer, VirtualService
from app.haptics.simulated_device import STEP, SimulatedDevice

START = (0.0, -0.12, 0.15)


def compact(content: str | bytes) -> bytes:
    """The same JSON without blanks, its numbers as floats: 0 and 0.0 are one number there."""
    return json.dumps(json.loads(content, parse_int=float), separators=(",", ":")).encode()


@pytest.mark.parametrize("page", [pages.INVENTORY_35, pages.INVENTORY_31])
def test_a_published_inventory_is_read_and_written_byte_for_byte(page: str) -> None:
    assert compact(msgspec.json.encode(read_service_message(page))) == compact(page)


def test_our_commands_are_the_published_ones_byte_for_byte() -> None:
    of_force = ClientMessage.of_force
    assert msgspec.json.encode(of_force("049D", Vector(0.0, 3.0, 3.0), "3.1")) == pages.FORCE_31
    assert msgspec.json.encode(of_force("049D", Vector(z=1.5), "3.5")) == pages.FORCE_35
    first = of_force("049D", Vector(), "3.5", profile="co.haply.inverse.tutorials:print-inverse3")
    assert msgspec.json.encode(first) == pages.PROFILE_35


@pytest.mark.parametrize("page", [pages.FORCE_31, pages.FORCE_35, pages.PROFILE_35, pages.PLACE_35])
def test_a_published_command_is_read_whole(page: bytes) -> None:
    assert msgspec.json.encode(read_client_message(page)) == page


@pytest.mark.parametrize("page", [pages.QUICK_35, *pages.OTHERS_35])
def test_a_published_command_without_a_force_is_answered_and_moves_nothing(page: bytes) -> None:
    virtual, clock = service(force_rate_limit_N_per_s=1e6)
    virtual.answer(page, 1)
    clock.now += 0.005
    state = decoded(virtual.answer(page, 1))["inverse3"][0]["state"]
    assert state["cursor_position"] == dict(zip("xyz", START, strict=True))
    assert state["control_mode"] == "idle"


class Clock:
    """A clock that goes when it is told to."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


def service(**hardware: Any) -> tuple[VirtualService, Clock]:
    clock = Clock()
    free = SimulatedHand(stiffness_N_per_m=0.0, damping_N_s_per_m=0.0)
    script = HandScript(device=SimulatedHardware(**hardware), hand=free)
    return VirtualService(script, clock), clock


def decoded(content: bytes) -> dict[str, Any]:
    return json.loads(content)


@pytest.mark.parametrize(("version", "page"), [("3.5", pages.INVENTORY_35),
                                              ("3.1", pages.INVENTORY_31)])  # fmt: skip
def test_the_virtual_inventory_has_the_published_members(version: str, page: str) -> None:
    def members(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: members(each) for key, each in value.items()}
        return type(value) if not isinstance(value, int | float) else float

    virtual, _ = service(protocol=version)
    made, published = decoded(virtual.inventory(7)), json.loads(page)
    assert members(made["inverse3"][0]) == members(published["inverse3"][0])
    assert made.get("session_id") == published.get("session_id")
    assert list(made["inverse3"][0]["state"]) == list(published["inverse3"][0]["state"])
    later = decoded(virtual.answer(pages.FORCE_35, 7))["inverse3"][0]
    assert "config" not in later
    assert {"state", "status"} <= later.keys()


def test_a_force_holds_for_one_message_and_moves_the_mass_as_newton_says() -> None:
    virtual, clock = service(
        damping_N_s_per_m=0.0, mass_kg=0.15, hold_ms=20.0, force_rate_limit_N_per_s=1e6
    )
    virtual.answer(pages.FORCE_35, 1)
    clock.now += 0.010
    moved = decoded(virtual.answer(pages.FORCE_35, 1))["inverse3"][0]["state"]
    assert moved["cursor_position"]["z"] - 0.15 == pytest.approx(0.5 * 1.5 / 0.15 * 0.01**2)
    assert moved["cursor_velocity"]["z"] == pytest.approx(1.5 / 0.15 * 0.01)
    assert moved["current_cursor_force"]["z"] == 1.5
    # A client that falls silent drives no longer than the hold.
    clock.now += 0.2
    late = decoded(virtual.answer(b"{}", 1))["inverse3"][0]["state"]
    assert late["cursor_velocity"]["z"] == pytest.approx(1.5 / 0.15 * 0.03)
    clock.now += 0.01
    assert decoded(virtual.answer(b"{}", 1))["inverse3"][0]["state"]["control_mode"] == "idle"


def test_values_and_vector_are_one_force_and_another_device_gets_none() -> None:
    for content in (pages.FORCE_35, pages.FORCE_35.replace(b"vector", b"values")):
        virtual, clock = service(force_rate_limit_N_per_s=1e6)
        virtual.answer(content, 1)
        clock.now += 0.001
        state = decoded(virtual.answer(content, 1))["inverse3"][0]["state"]
        assert state["current_cursor_force"] == {
            "x": 0.0, "y": 0.0, "z": 1.5,
        }  # fmt: skip
    virtual, clock = service()
    virtual.answer(pages.FORCE_35.replace(b"049D", b"0000"), 1)
    clock.now += 0.01
    assert decoded(virtual.state(1))["inverse3"][0]["state"]["current_cursor_force"]["z"] == 0.0


@pytest.mark.parametrize(
    "content",
    [
        b"", b"{", b"[]", b"null", b'"force"', b"\xff\xfe", b'{"inverse3":{}}',
        b'{"inverse3":[{"commands":{}}]}', b'{"more":' + b"[" * 9000,
        pages.FORCE_35.replace(b"1.5", b'"1.5"'), pages.FORCE_35.replace(b"1.5", b"1e999"),
    ],
)  # fmt: skip
def test_what_is_no_message_takes_the_force_away_and_is_still_answered(content: bytes) -> None:
    virtual, clock = service(force_rate_limit_N_per_s=1e6)
    virtual.answer(pages.FORCE_35, 1)
    clock.now += 0.002
    with pytest.raises(ProtocolError, match="message"):
        virtual.answer(content, 1)
    clock.now += 0.002
    virtual.answer(b"{}", 1)
    assert decoded(virtual.state(1))["inverse3"][0]["state"]["current_cursor_force"]["z"] == 0.0


def test_a_cursor_is_led_to_a_place_and_a_preset_moves_the_origin() -> None:
    virtual, clock = service()
    place = pages.PLACE_35.replace(b"0.15", b"0.16")
    for _ in range(2000):
        virtual.answer(place, 1)
        clock.now += 0.001
    assert decoded(virtual.state(1))["inverse3"][0]["state"]["cursor_position"][
        "z"
    ] == pytest.approx(0.16, abs=1e-4)
    virtual, _ = service()
    centred = (
        b'{"session":{"force_render_full_state":{}},"inverse3":[{"device_id":"049D",'
        b'"configure":{"preset":{"preset":"arm_front_centered"}}}]}'
    )
    answer = decoded(virtual.answer(centred, 1))["inverse3"][0]
    assert answer["config"]["preset"] == "arm_front_centered"
    assert answer["state"]["cursor_position"] == {"x": 0.0, "y": 0.0, "z": 0.0}


def test_a_socket_gives_one_inventory_one_state_a_message_and_the_list_of_devices() -> None:
    script = HandScript(path=(Waypoint(0.0, (0.0, 0.0, 0.0), ("a", "c")),))
    message: list[str] = []

    async def talk() -> None:
        async with await HaplyServer(script, message.append).start("127.0.0.1", 0) as server:
            port = next(iter(server.sockets)).getsockname()[1]
            async with connect(f"ws://127.0.0.1:{port}", open_timeout=LONGEST) as client:
                first = json.loads(await client.recv())
                assert first["inverse3"][0]["config"]["handedness"] == "right"
                await client.send("{")
                await client.send(pages.FORCE_31)  # as bytes, as the published samples do
                await client.send("{")
                answers = [json.loads(await client.recv()) for _ in range(3)]
                grip = answers[-1]["wireless_verse_grip"][0]["state"]
                assert grip["buttons"] == {"a": True, "b": False, "c": True}
                with pytest.raises(TimeoutError):
                    await asyncio.wait_for(client.recv(), 0.05)

            def get() -> dict[str, Any]:
                with urllib.request.urlopen(f"http://127.0.0.1:{port}/devices") as page:
                    return json.load(page)

            devices = await asyncio.to_thread(get)
            assert [each["device_id"] for each in devices["inverse3"]] == ["049D"]
            assert devices["verse_grip"] == []

    # The browser of other tests has a loop in this thread.
    with ThreadPoolExecutor(1) as elsewhere:
        elsewhere.submit(asyncio.run, talk()).result()
    assert [line for line in message if "not a message" in line] == [message[1]]


def test_the_energies_of_a_simulated_device_close() -> None:
    script = HandScript(
        device=SimulatedHardware(latency_ms=2.0),
        hand=SimulatedHand(reaction_delay_ms=5.0, damping_N_s_per_m=6.0, tremor_mm=0.2),
        path=(Waypoint(0.1, (0.0, 0.0, 0.0)), Waypoint(0.5, (3.0, -2.0, 10.0))),
        repeats=True,
    )
    device = SimulatedDevice(script)
    start = np.array(START)
    for _ in range(1500):
        device.advance(10, 200.0 * (start - device.position))
        by_hand, by_motors, by_friction = device.work
        energy = 0.5 * script.device.mass_kg * float(device.velocity @ device.velocity)
        assert by_hand + by_motors + by_friction == pytest.approx(energy, abs=1e-13)
    by_hand, by_motors, _ = device.work
    assert by_hand > 1e-3
    assert by_motors < -1e-4


def test_a_delay_is_as_long_as_it_says_and_a_run_is_the_same_to_the_bit() -> None:
    def first_motion(**hardware: Any) -> float:
        still = SimulatedHand(stiffness_N_per_m=0.0, damping_N_s_per_m=0.0)
        device = SimulatedDevice(HandScript(device=SimulatedHardware(**hardware), hand=still))
        steps = 0
        while device.position[2] == START[2]:
            device.advance(1, np.array([0.0, 0.0, 1.0]))
            steps += 1
        return steps * STEP

    assert first_motion(latency_ms=5.0) - first_motion() == pytest.approx(0.005)
    script = HandScript(hand=SimulatedHand(tremor_mm=0.3, seed=4))
    positions: list[bytes] = []
    for steps in (1, 7):
        device = SimulatedDevice(script)
        for _ in range(700 // steps):
            device.advance(steps, np.array([0.1, 0.2, 0.3]))
        positions.append(device.position.tobytes())
    assert positions[0] == positions[1]


def test_a_hand_is_read_from_its_file_or_refused_by_name(tmp_path: Path) -> None:
    file = tmp_path / "hand.toml"
    file.write_text('repeats = true\n[hand]\nstiffness_N_per_m = 700\n[[path]]\ntime_s = 1\n'
                    'offset_mm = [0, 0, 5]\nbuttons = ["b"]\n')  # fmt: skip
    script = read_hand(file)
    assert script.hand.stiffness_N_per_m == 700.0
    assert script.path[0].pressed == 2
    for wrong, says in (
        ("[hand]\nstiffness = 1\n", "stiffness"),
        ("[device]\nmass_kg = 0\n", "mass_kg"),
        ("[device]\nmass_kg = nan\n", "mass_kg"),
        ("[device]\nstart_m = [0, 0, inf]\n", "start_m"),
        ("[[path]]\ntime_s = 1\noffset_mm = [0, nan, 0]\n", "offset_mm"),
        ("[[path]]\ntime_s = 1\noffset_mm = [0,0,0]\n" * 2, "must grow"),
        ("[hand", "no hand"),
    ):
        file.write_text(wrong)
        with pytest.raises(ValueError, match=says):
            read_hand(file)
    file.write_bytes(b"#" * 1_000_001)
    with pytest.raises(ValueError, match="is no hand: it has more than 1,000,000 bytes"):
        read_hand(file)
    with pytest.raises(ValueError, match="cannot read"):
        read_hand(tmp_path / "none.toml")


def test_an_address_is_host_and_port() -> None:
    assert websocket_address("ws://127.0.0.1:10001") == ("127.0.0.1", 10001)
    for wrong in ("127.0.0.1:1", "http://a:1", "ws://a", "ws://a:99999", "ws://:1"):
        with pytest.raises(ValueError, match="ws://127"):
            websocket_address(wrong)
