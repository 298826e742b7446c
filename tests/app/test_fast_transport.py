"""What replaces viser's transport sends what viser would send, and a page works without it too."""

import asyncio
import re
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
import viser
import zstandard
from browser import trainer_page
from playwright.sync_api import Browser
from program import ENTRY, LONGEST, started

from app.trainer.viser_bridge import fast_transport
from app.trainer.viser_bridge.fast_transport import place_node, stream
from benchmarks.page_protocol import CAMERA, Page, connected
from physics import Beam, Cubic

DUCT = Beam.round(span=50.8, diameter=8.89, modulus=0.310264, poisson_ratio=0.3)
FORCE = 1.0  # N
PLAIN = (
    """
import app.trainer.server.trainer
from viser.infra import _infra
assert _infra._message_producer.__module__ == "viser.infra._infra"
assert _infra._message_consumer.__module__ == "viser.infra._infra"
"""
    + ENTRY
)

of_the_replacement = pytest.mark.skipif(
    not fast_transport.ON, reason="viser's own transport is at work: BLUNTDISSECT_PLAIN_VISER=1"
)


def test_a_page_pulls_a_duct_without_the_transport_replaced(
    browser: Browser, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("BLUNTDISSECT_PLAIN_VISER", "1")
    deflection = Cubic().pull(DUCT, 25.4).to_force(FORCE).deflection
    with (
        started("--port", 0, "--look", "plain", "--mode", "pull", entry=PLAIN) as (_, address),
        trainer_page(browser, address) as tab,
    ):
        rest = tab.vertices("skin")
        middle = (np.abs(rest[:, 0] - 25.4) < 0.6) & (rest[:, 2] > 4.0)
        tab.slide("Force F (N)", FORCE)
        tab.wait_for_force(FORCE)

        def arrived() -> None:
            assert tab.figure("deflection-mm") == pytest.approx(deflection, rel=1e-3)
            # The ring next to the grasp is a quarter of a millimetre off it at most.
            risen = (tab.vertices("skin") - rest)[middle, 2]
            assert risen.max() == pytest.approx(deflection, rel=5e-3)

        tab.eventually(arrived)


@pytest.mark.parametrize("name", ["lost_wake_up", "split_block"])
def test_faults_of_viser_are_there_as_they_are_written_down(name: str) -> None:
    page = (Path(__file__).parents[2] / "docs" / "viser-faults.md").read_text(encoding="utf-8")
    (printed,) = re.findall(rf"`{name}\.py`[^;]*?prints ([^;]*);", page)
    program = Path(__file__).parent / "viser_faults" / f"{name}.py"
    done = subprocess.run(
        [sys.executable, program], capture_output=True, text=True, timeout=LONGEST, check=True
    )
    assert done.stdout.splitlines() == re.findall(r"`([^`]*)`", printed)


@of_the_replacement
def test_what_is_streamed_comes_as_viser_would_send_it(server: viser.ViserServer) -> None:
    places = np.arange(9, dtype=np.float32).reshape(3, 3)
    mesh = server.scene.add_mesh_simple("/mesh", places, np.array([[0, 1, 2]], np.uint32))
    label = server.scene.add_label("/label", "before")
    buffer = server._websock_server._broadcast_buffer

    def queued(act: Callable[[], None]) -> list[Any]:
        before = buffer.message_counter
        act()
        return [buffer.message_from_id[each] for each in range(before, buffer.message_counter)]

    def streamed(up: float) -> None:
        for _ in range(2):  # once, as it does not differ then
            stream(mesh, "vertices", places + np.float32(up))
            stream(label, "text", f"{up}")
            place_node(label, up, 0.0, 0.0)

    def assigned(up: float) -> None:
        mesh.vertices, label.text = places + np.float32(up), f"{up}"
        label.position = np.array([up, 0.0, 0.0])

    def keys(messages: list[Any]) -> list[Any]:
        return [(type(one), one.redundancy_key(), one.owner) for one in messages]

    ours = queued(lambda: streamed(1.0))
    with server.atomic():  # as pictures are drawn
        together = keys(queued(lambda: streamed(1.5)))
        held = len(buffer.message_from_id)
        visers = queued(lambda: assigned(2.0))
        assert len(buffer.message_from_id) == held  # each in place of what has not gone out yet
        again = queued(lambda: streamed(2.0))
    assert keys(ours) == together == keys(visers)
    assert again == []
    np.testing.assert_array_equal(mesh.vertices, places + 2.0)
    arrays: list[memoryview] = []
    wanted = [each.as_serializable_dict(arrays) for each in visers]
    sent = fast_transport._packed(visers, zstandard.ZstdCompressor(level=1).compress)
    size, packed = (int.from_bytes(sent[8 * index :][:8], "little") for index in range(2))
    content = zstandard.ZstdDecompressor().decompress(sent[16 : 16 + packed])
    assert len(content) == size
    reported = msgspec.msgpack.decode(content)
    assert msgspec.msgpack.encode(reported["messages"], order="sorted") == msgspec.msgpack.encode(
        wanted, order="sorted"
    )
    assert reported["binaryBufferLengths"] == [each.nbytes for each in arrays] == [36]
    assert sent[-(-(16 + packed) // 8) * 8 :] == bytes(arrays[0])


@of_the_replacement
def test_the_trainer_packs_its_pages_messages_itself(
    server: viser.ViserServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    windows: list[Any] = []
    pack = fast_transport._packed

    def packed(messages: Any, compress: Any) -> bytes:
        windows.append(messages)
        return pack(messages, compress)

    monkeypatch.setattr(fast_transport, "_packed", packed)

    async def page() -> None:
        async with connected(f"http://127.0.0.1:{server.get_port()}") as connection:
            await connection.send(msgspec.msgpack.encode(CAMERA))
            while not (clients := server.get_clients()):
                await asyncio.sleep(0.01)
            with clients[0].atomic():
                for number in range(300):  # more than one frame takes
                    clients[0].scene.add_frame(f"/frame_{number}")
            reader, named = Page(connection), dict[str, None]()
            while len(named) < 300:
                each = await reader.messages()
                names = (one.get("name", "") for one in each)
                named |= {name: None for name in names if name.startswith("/frame_")}
            assert [*named] == [f"/frame_{number}" for number in range(300)]

    with ThreadPoolExecutor(1) as pool:
        pool.submit(lambda: asyncio.run(asyncio.wait_for(page(), LONGEST))).result()
    assert len(windows) > 1


@of_the_replacement
def test_no_other_thread_sets_the_event_that_wakes_a_page() -> None:
    async def both() -> None:
        event = fast_transport._LoopEvent()
        await asyncio.to_thread(event.set)
        assert not event.is_set()
        asyncio.get_running_loop().call_soon(event.set)
        await event.wait()

    with ThreadPoolExecutor(1) as pool:
        pool.submit(lambda: asyncio.run(asyncio.wait_for(both(), LONGEST))).result()
