"""What the trainer takes from viser without its leave: each test says what another viser broke."""

import asyncio
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import msgspec
import pytest
import viser

from app.trainer.viser_bridge import close_silent
from benchmarks.page_protocol import CAMERA, connected


@pytest.fixture
def server() -> Iterator[viser.ViserServer]:
    running = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    yield running
    running.stop()


def test_who_says_nothing_is_closed_the_second_time_and_who_speaks_is_not(
    server: viser.ViserServer,
) -> None:
    async def both() -> None:
        address = f"http://127.0.0.1:{server.get_port()}"
        async with connected(address) as silent, connected(address) as speaking:
            await speaking.send(msgspec.msgpack.encode(CAMERA))
            while len(server.get_clients()) < 1:
                await asyncio.sleep(0.01)
            suspects = close_silent(server, set())
            assert len(suspects) == 1
            assert not suspects & server.get_clients().keys()
            await speaking.send(msgspec.msgpack.encode(CAMERA))
            assert close_silent(server, suspects) == set()
            await silent.wait_closed()
            await (await speaking.ping())
            assert len(server.get_clients()) == 1
            while close_silent(server, set()):  # until the server has seen that it is closed
                await asyncio.sleep(0.01)

    # In a thread of its own: playwright's loop may be running in this one.
    with ThreadPoolExecutor(1) as pool:
        pool.submit(lambda: asyncio.run(asyncio.wait_for(both(), 60.0))).result()
