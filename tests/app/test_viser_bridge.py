"""What the trainer takes from viser without its leave: each test says what another viser broke."""

import asyncio
import re
import socket
import warnings
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import msgspec
import pytest
import viser
import websockets.asyncio.server
from browser import new_context, newest, trainer_page
from playwright.sync_api import Browser
from program import LONGEST
from viser import _messages
from viser._icons import svg_from_icon
from viser.infra import _infra
from websockets.asyncio.server import ServerConnection

from app.trainer import viser_bridge
from app.trainer.connections.guard import Guard
from app.trainer.server.trainer import Trainer
from app.trainer.server.warm_up import ICONS
from app.trainer.viser_bridge import private_api
from app.trainer.viser_bridge.page import (
    kept_by_tab,
    prepare_page,
    run_in_page,
    tab_keeps,
    watch_pace,
)
from app.trainer.viser_bridge.private_api import (
    close_page,
    page_of,
    start_server,
    stop_server,
)
from app.trainer.viser_bridge.recording import recording_page
from benchmarks.page_protocol import CAMERA, connected


def test_a_connection_leads_to_its_page_and_a_page_can_be_closed(
    server: viser.ViserServer,
) -> None:
    async def both() -> None:
        address = f"http://127.0.0.1:{server.get_port()}"
        async with connected(address) as silent, connected(address) as speaking:
            await speaking.send(msgspec.msgpack.encode(CAMERA))
            while not (clients := server.get_clients()):
                await asyncio.sleep(0.01)
            (number,) = clients
            live = server._websock_server._live_connections
            pages = [page_of(server, each) for each in dict(live).values()]
            assert {None if page is None else page.client_id for page in pages} == {None, number}
            close_page(server, number, "for a test")
            await speaking.wait_closed()
            assert speaking.close_reason == "for a test"
            await (await silent.ping())
            close_page(server, number, "it has gone already")

    # In a thread of its own: playwright's loop may be running in this one.
    with ThreadPoolExecutor(1) as pool:
        pool.submit(lambda: asyncio.run(asyncio.wait_for(both(), LONGEST))).result()


def test_what_is_sent_to_a_page_that_has_left_warns_nobody() -> None:
    async def page_left() -> viser.ClientHandle:
        async with connected(f"http://127.0.0.1:{running.get_port()}") as page:
            await page.send(msgspec.msgpack.encode(CAMERA))
            while not (clients := running.get_clients()):
                await asyncio.sleep(0.01)
            (client,) = clients.values()
            slider = client.gui.add_slider("Force", 0.0, 1.0, 0.1, 0.0)
        while running.get_clients():
            await asyncio.sleep(0.01)
        slider.value = 0.5
        client.scene.add_frame("/left")
        return client

    # Filters are the process's: here they are put back, as when another thread has compiled.
    with warnings.catch_warnings():
        running = start_server("127.0.0.1", 0, Guard("127.0.0.1"))
    try:
        with warnings.catch_warnings(), ThreadPoolExecutor(1) as pool:
            warnings.simplefilter("error")
            left = pool.submit(lambda: asyncio.run(asyncio.wait_for(page_left(), LONGEST)))
            buffer = left.result().gui._websock_interface.get_message_buffer()
        assert buffer.done
        assert len(buffer.message_from_id) > 0
    finally:
        stop_server(running)


def test_nobody_can_ask_for_a_public_tunnel(trainer: Trainer) -> None:
    handlers = trainer._server._websock_server._incoming_handlers
    assert _messages.ViewerCameraMessage not in handlers  # it is the clients' own
    assert _messages.ShareUrlRequest not in handlers
    assert _messages.ShareUrlDisconnect not in handlers


def test_nothing_that_a_page_sends_is_kept_for_all_others(trainer: Trainer) -> None:
    handlers = trainer._server._websock_server._incoming_handlers
    assert _messages.GuiUpdateMessage in handlers
    assert _messages.GuiFormDirtyMessage not in handlers
    assert _messages.GuiFormSubmitMessage not in handlers


def test_a_viser_that_opens_its_socket_elsewhere_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    ports: list[int] = []

    def serve(*arguments: Any, **options: Any) -> Any:
        return genuine(*arguments, **options)

    genuine = websockets.asyncio.server.serve
    unguarded = SimpleNamespace(
        server=SimpleNamespace(serve=serve, ServerConnection=ServerConnection)
    )
    monkeypatch.setattr(
        _infra, "websockets", SimpleNamespace(**{**vars(websockets), "asyncio": unguarded})
    )
    stop = private_api.stop_server

    def stopped(server: viser.ViserServer) -> None:
        ports.append(server.get_port())
        stop(server)

    monkeypatch.setattr(private_api, "stop_server", stopped)
    with pytest.raises(RuntimeError, match="no guard can stand"):
        start_server("127.0.0.1", 0, Guard("127.0.0.1"))
    with pytest.raises(ConnectionRefusedError), socket.create_connection(("127.0.0.1", ports[0])):
        pass
    assert websockets.asyncio.server.serve is genuine


def test_icons_are_read_where_viser_reads_them() -> None:
    assert all("<svg" in svg_from_icon(icon) for icon in ICONS)


def test_a_recording_s_page_has_the_places_where_light_and_text_go(
    server: viser.ViserServer,
) -> None:
    page = server.get_scene_serializer().as_html()
    written = recording_page(page, "A title", ["a note"], distance=90.0, aspect=1.6)
    head, body = written.split("<body", 1)
    assert head.count("<title>A title</title>") == 1
    assert "isDirectionalLight" in head.rsplit("<script>", 1)[1]
    assert body.rsplit("</body>", 1)[0].rstrip().endswith("</div>")
    for line in ("<h1>A title</h1>", '<p class="note">a note</p>', '<p id="caption">'):
        assert body.count(line) == 1
    assert len(written) - len(page) < 4000  # nothing of viser's is lost or doubled


def test_a_recording_s_page_shows_its_whole_width_in_any_window(browser: Browser) -> None:
    page = new_context(browser).new_page()
    page.set_content('<div id="about" data-distance="100" data-aspect="2"></div>')
    script = Path(viser_bridge.__file__).with_name("recording.js").read_text(encoding="utf-8")
    page.evaluate(
        """script => {
            const scene = {fog: {near: 10, far: 20}, onBeforeRender() {}, traverse() {}};
            const cameraControl = {
                distance: 100, maxDistance: 150, dollyTo(distance) { this.distance = distance; },
            };
            window.__viserMutable = {scene, cameraControl};
            window.eval(script);
            window.shown = aspect => {
                scene.onBeforeRender(null, scene, {aspect});
                return [cameraControl.distance, scene.fog.near, scene.fog.far];
            };
        }""",
        script,
    )
    assert page.evaluate("shown(2.2)") == [100, 10, 20]
    assert page.evaluate("shown(0.5)") == [400, 40, 80]
    assert page.evaluate("__viserMutable.cameraControl.maxDistance") >= 400
    page.evaluate("__viserMutable.cameraControl.distance = 100")  # viser starts over
    assert page.evaluate("shown(0.5)") == [400, 40, 80]
    page.evaluate("__viserMutable.cameraControl.distance = 250")  # the reader comes nearer
    assert page.evaluate("shown(0.5)") == [250, 40, 80]
    assert page.evaluate("shown(1.8)") == [100, 10, 20]
    page.context.close()


def test_a_page_runs_scripts_says_that_it_is_slow_and_keeps_a_text_of_its_own(
    browser: Browser, trainer: Trainer
) -> None:
    with trainer_page(browser, trainer.address, width=640, height=480) as tab:
        client = newest(trainer).client
        run_in_page(
            client.scene,
            "window.found = [viewer.scene().isScene, viewer.node('/organ').isObject3D,"
            " viewer.node('/nowhere') === undefined];",
        )
        tab.page.wait_for_function("() => window.found")
        assert tab.page.evaluate("window.found") == [True, True, True]
        # Where viser says that it draws in software, the remedy is named.
        watch_pace(client, least=5.0, command=None, remedy="Take the simple picture.")
        notice = tab.page.get_by_text(re.compile("software mode.* Take the simple picture"))
        notice.wait_for()
        # In a thread of its own: playwright's page answers while this one waits.
        with ThreadPoolExecutor(1) as pool:
            tab_keeps(client, "a text")
            prepare_page(client)  # again, as after a connection that was lost
            assert pool.submit(kept_by_tab, client).result() == "a text"


def test_viser_prints_nothing(capfd: pytest.CaptureFixture[str]) -> None:
    stop_server(start_server("127.0.0.1", 0, Guard("127.0.0.1")))
    assert capfd.readouterr().out == ""


def test_commands_and_sliders_have_the_numbers_by_which_the_page_knows_them(
    server: viser.ViserServer,
) -> None:
    command = server.gui.add_command("command")
    slider = server.gui.add_slider("slider", min=0.0, max=1.0, step=0.1, initial_value=0.0)
    slider.step, slider.precision = 0.01, 2
    assert isinstance(command._impl.uuid, str)
    assert isinstance(slider._impl.uuid, str)


MISSING = """wanted => {
    const viewer = window.__viserMutable, camera = viewer.cameraControl;
    const there = {
        "viser runs scripts": window.bluntdissect,
        "scene and root": viewer.scene && viewer.nodeRefFromName[""]?.matrixWorld,
        "canvases": viewer.canvas && viewer.canvas2d?.parentElement,
        "messages": viewer.sendMessage,
        "pictures": viewer.requestRender && viewer.scene.onAfterRender
            && viewer.scene.onBeforeRender,
        "camera": camera?.setBoundary && camera.rotatePolarTo && camera.getTarget
            && camera.addEventListener && camera.camera.up && camera.polarAngle,
        "line to a hand": viewer.scene.children.some(each => each.line && each.cone),
        "plots": Object.values(window.__viserTestpoints.uplots)
            .every(plot => plot.chart.root && plot.chart.axes),
    };
    for (const selector of wanted)
        there[selector] = document.querySelector(selector);
    return Object.keys(there).filter(name => !there[name]);
}"""
"""Returns what of viser's page is not there."""


@pytest.mark.parametrize("phone", [False, True])
def test_page_has_what_its_style_and_script_lean_on(
    browser: Browser, trainer: Trainer, phone: bool
) -> None:
    width, height = (390, 844) if phone else (1280, 800)
    with trainer_page(browser, trainer.address, width=width, height=height) as tab:
        tab.press("Help")
        tab.page.get_by_role("dialog").wait_for()
        wanted = [
            ".mantine-Notifications-root",
            ".mantine-Flex-root > .mantine-Slider-root[id] [role=slider][aria-valuenow]",
            ".mantine-Flex-root > .mantine-NumberInput-root .mantine-NumberInput-input",
            "label[for]",
            "[role=tablist] > [role=tab]",
            ".tabler-icon-list-search",
            ".mantine-ActionIcon-root .tabler-icon-adjustments",
            ".mantine-Modal-root .mantine-Modal-content[role=dialog] .mantine-Modal-body",
            ":has(> .bd-closer) + * button .mantine-Button-section",
            ".mantine-Checkbox-root",
            *(
                [".mantine-Paper-root [style*='width: 20em']"]
                if phone
                else ["[data-dock-tab]", "[data-dock-region-collapse]"]
            ),
        ]

        def nothing_is_missing() -> None:
            assert tab.page.evaluate(MISSING, wanted) == []

        # Icons come in files of their own.
        tab.eventually(nothing_is_missing)
