"""A real browser for tests: the system's Chromium, headless, driven through its pages."""

import os
import shutil
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from numpy.testing import assert_allclose
from playwright.sync_api import (
    Browser,
    BrowserContext,
    Error,
    Locator,
    Page,
    Playwright,
    Request,
    expect,
    sync_playwright,
)
from projection import picture_points
from viser import ClientHandle

from app.simulation import Session
from app.trainer.scene.tissue_scene import TissueScene
from app.trainer.server.trainer import Trainer
from app.trainer.stage.camera import viewpoint
from app.trainer.view.page_view import PageView
from app.trainer.viser_bridge.page import run_in_page

CAMERA = """() => {
    const camera = window.__viserMutable.cameraControl, at = camera.camera.position.clone();
    const world = window.__viserMutable.nodeRefFromName[''].matrixWorld.clone().invert();
    const place = camera.camera.position.clone().applyMatrix4(world).toArray();
    return [...place, ...camera.getTarget(at).applyMatrix4(world).toArray()];
}"""
RESTS = """() => new Promise(done => {
    const camera = %s;
    let before = [], same = 0;
    const look = () => {
        const now = camera();
        same = now.every((x, k) => x === before[k]) ? same + 1 : 0;
        before = now;
        if (same > 20) done(now); else requestAnimationFrame(look);
    };
    look();
})"""
CAMERA_NEAR = 0.5
"""mm: the picture's shape is told in whole pixels, and the camera follows it."""

SWITCHES = [
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-dev-shm-usage",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
]
UNDRAWN_SWITCHES = ["--disable-gpu-compositing", "--disable-gpu-rasterization"]
"""The processor lays out text faster than it imitates a GPU that does."""
DRAWS_NOTHING = """{
    const context = WebGL2RenderingContext.prototype;
    for (const name of ["blitFramebuffer", "bufferData", "bufferSubData", "clear", "compileShader",
            "drawArrays", "drawArraysInstanced", "drawElements", "drawElementsInstanced",
            "drawRangeElements", "generateMipmap", "linkProgram", "renderbufferStorage",
            "renderbufferStorageMultisample", "texImage2D", "texImage3D", "texStorage2D",
            "texStorage3D", "texSubImage2D", "texSubImage3D", "useProgram"])
        context[name] = () => {};
    context.getProgramParameter = (program, asked) =>
        asked !== context.ACTIVE_UNIFORMS && asked !== context.ACTIVE_ATTRIBUTES;
}"""
"""For pages of which nobody looks at a pixel of the scene: two thirds of a test's time is the
drawing in software. A shader is as one that uses nothing, and what would be drawn with is not sent
to the imitated GPU. All else of the page runs as it does for a user."""
RADIUS = 4.445
"""Of the shipped duct as it is drawn, as thick as the thesis's bar, mm."""
PATIENCE = 180_000
"""ms: software rendering on two busy cores, and a theory that waits in the background until kernels
are compiled that other pages need. It is waited for conditions, which mostly come at once: that a
test waits for long is only seen when it fails."""
AFTER_ITS_LAST = "() => new Promise(done => setTimeout(done, 60))"
"""Ends when the page has sent what was typed or moved in it: of all fields together viser sends one
value in 50 ms, the last, and it is the page that counts them."""
expect.set_options(timeout=PATIENCE)


def chromium() -> Path:
    """The system's Chromium; without one the test skips, or fails where one is required."""
    named = os.environ.get("CHROMIUM")
    names = [named] if named else ["chromium", "chromium-browser", "google-chrome"]
    for name in names:
        found = shutil.which(name)
        if found:
            return Path(found)
    reason = f"no browser found ({', '.join(names)}): install chromium, or set CHROMIUM to one"
    if os.environ.get("REQUIRE_BROWSER") == "1":
        pytest.fail(reason)
    pytest.skip(reason)


class _Shared:
    """The browsers of this process, from their first use until `close_browser`."""

    playwright: Playwright | None = None
    browsers: ClassVar[dict[bool, Browser]] = {}
    idle: ClassVar[list[Page]] = []


@contextmanager
def running_browser(*, drawing: bool) -> Iterator[Browser]:
    """A headless Chromium; what is opened in it is closed at the end, and it runs on.

    One that is not `drawing` shows text and panels only: see `new_context`.
    """
    if drawing not in _Shared.browsers:
        executable = chromium()
        if _Shared.playwright is None:
            _Shared.playwright = sync_playwright().start()
        _Shared.browsers[drawing] = _Shared.playwright.chromium.launch(
            executable_path=executable,
            headless=True,
            args=SWITCHES if drawing else SWITCHES + UNDRAWN_SWITCHES,
        )
    running = _Shared.browsers[drawing]
    before = list(running.contexts)
    try:
        yield running
    finally:
        for context in running.contexts:
            if context not in before:
                context.close()


def new_context(browser: Browser, width: int = 1280, height: int = 800) -> BrowserContext:
    """Tabs that share nothing with others; they draw if the browser does."""
    context = browser.new_context(viewport={"width": width, "height": height})
    context.set_default_timeout(PATIENCE)
    if browser is not _Shared.browsers.get(True):
        context.add_init_script(DRAWS_NOTHING)
    return context


def close_browser() -> None:
    """End the browsers, if there are any."""
    for running in _Shared.browsers.values():
        running.close()
    _Shared.browsers.clear()
    _Shared.idle.clear()
    if _Shared.playwright is not None:
        _Shared.playwright.stop()
    _Shared.playwright = None


@contextmanager
def trainer_page(
    browser: Browser,
    address: str,
    *,
    width: int = 1280,
    height: int = 800,
    first_minute: bool = False,
    query: str = "",
    dots: float = 1.0,
    node: str = "/organ/skin",
) -> Iterator["TrainerPage"]:
    """A tab of its own on the trainer, with the duct in it; fails on any error in the page.

    The first minute's lines are dismissed unless they are wanted. The scene is drawn with so many
    dots a pixel along each side: fewer cost a processor that draws less.
    """
    page = _empty_page(browser, width, height)
    errors: list[str] = []
    requests: list[str] = []

    def note_error(error: Error) -> None:
        errors.append(str(error))

    def note_request(request: Request) -> None:
        requests.append(request.url)

    page.on("pageerror", note_error)
    page.on("request", note_request)
    try:
        page.goto(f"{address}/?fixedDpr={dots:g}{query}")
        trainer = TrainerPage(page)
        trainer.wait_for_path(node)  # it may be compiling yet
        page.locator("#bd-cover").wait_for(state="detached")
        if not first_minute:
            trainer.start()
        yield trainer
        assert not errors, errors
        elsewhere = [
            url
            for url in requests
            if not url.startswith((address, address.replace("http", "ws", 1), "data:", "blob:"))
        ]
        assert not elsewhere, elsewhere
    except BaseException:
        page.context.close()
        raise
    page.remove_listener("pageerror", note_error)
    page.remove_listener("request", note_request)
    _leave(page)


def _empty_page(browser: Browser, width: int, height: int) -> Page:
    """A tab that knows nothing of a trainer, left by a test if one was.

    The trainer's program, of megabytes, is compiled once in a tab and not for each test.
    """
    for page in _Shared.idle:
        if page.context.browser is browser and not page.is_closed():
            _Shared.idle.remove(page)
            page.set_viewport_size({"width": width, "height": height})
            return page
    return new_context(browser, width, height).new_page()


def _leave(page: Page) -> None:
    """Keep a tab for other tests, which find nothing of this one; close it if it has others.

    One that draws is closed: the memory of its pictures is given back only then.
    """
    drawing = page.context.browser is _Shared.browsers.get(True)
    if drawing or len(page.context.pages) > 1:
        page.context.close()
        return
    page.mouse.move(0, 0)
    page.emulate_media(reduced_motion="null")
    page.evaluate("() => { localStorage.clear(); sessionStorage.clear(); }")
    page.goto("about:blank")
    page.context.clear_cookies()
    _Shared.idle.append(page)


class TrainerPage:
    """What a trainee sees and can touch in one tab."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.readout = page.get_by_test_id("readout")

    def start(self) -> None:
        """Dismiss the first minute's lines."""
        lines = self.page.get_by_test_id("first-minute")
        lines.wait_for()
        # Not `click`: it waits for two pictures alike, which take long in software.
        start = self.page.get_by_role("dialog").get_by_role("button", name="Begin")
        start.dispatch_event("click")
        lines.wait_for(state="detached")

    def wait_until(self, condition: Callable[[], object], seconds: float = PATIENCE / 1000) -> None:
        """Wait until something comes true, while the page goes on."""
        end = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < end, "it has not come true in time"
            self.page.wait_for_timeout(50)

    def eventually(self, check: Callable[[], object], seconds: float = PATIENCE / 1000) -> None:
        """Repeat a check until it holds; at the end it says itself what is wrong.

        Read-out and scene come in messages and are drawn by parts of the page that know nothing of
        each other: what one shows is not yet what the other shows.
        """
        end = time.monotonic() + seconds
        while True:
            try:
                check()
            except AssertionError:
                if time.monotonic() > end:
                    raise
            else:
                return
            self.page.wait_for_timeout(50)

    def next_picture(self) -> None:
        """Wait until the page has drawn a picture of all that has come to it."""
        self.page.evaluate(
            "() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"
        )

    def camera(self) -> np.ndarray:
        """(2, 3) where the page's camera is and what it looks at, mm on the stage."""
        return np.array(self.page.evaluate(CAMERA)).reshape(2, 3)

    def wait_for_camera(self, view: PageView, *, free: bool = False) -> np.ndarray:
        """Wait until the page shows the whole duct, and the trainer knows it; return `camera`.

        Until a moment later the trainer would put a camera back that has moved: `free` waits for
        that too.
        """

        def at_home() -> None:
            stage, reported = scene_of(view)._stage, view.client.camera
            assert stage is not None, "there is no stage"
            assert stage._arrived, "the page has not reported the camera that it was sent"
            if stage._looked_around:  # so seems a page that sets its own camera only now
                view.state.bring_home()
                raise AssertionError("the page has moved its camera")
            settled = time.monotonic() - stage._framed_at > stage._settling_time
            assert settled or not free, "the trainer would put a moved camera back"
            place, wanted = self.camera(), stage._viewpoint(reported.aspect)
            assert_allclose(place, [wanted.position, wanted.look_at], atol=CAMERA_NEAR)
            assert_allclose(place, [reported.position, reported.look_at], atol=1e-3)

        self.eventually(at_home)
        return self.camera()

    def rest(self) -> np.ndarray:
        """Wait until the camera stands still from picture to picture; return `camera`."""
        return np.array(self.page.evaluate(RESTS % CAMERA)).reshape(2, 3)

    def wait_for_disabled(self, label: str) -> None:
        """Wait until a slider takes nothing any more."""
        thumb = self.row(label).locator("[role=slider]")
        expect(thumb).to_have_attribute("aria-disabled", "true")

    def aim(self, place: tuple[float, float]) -> None:
        """Move the mouse to a pixel until the page has seen that it can take hold there."""

        def seen() -> bool:
            self.page.mouse.move(place[0] + 0.5, place[1])
            self.page.mouse.move(*place)
            return self.page.evaluate(
                "() => getComputedStyle(window.__viserMutable.canvas).cursor === 'pointer'"
            )

        self.wait_until(seen)

    def open(self, tab: str) -> None:
        """Open a tab of the panel."""
        self.page.get_by_role("tab", name=tab, exact=True).click()

    def row(self, label: str) -> Locator:
        """A label and its inputs."""
        return self.page.get_by_text(label, exact=True).locator(
            "xpath=ancestor::*[contains(@class, 'Flex-root')][1]"
        )

    def choose(self, label: str, option: str) -> None:
        """Choose from a dropdown."""
        row = self.row(label)
        row.locator("input:not([type=hidden])").click()
        self.page.get_by_role("option", name=option, exact=True).click()

    def tick(self, label: str) -> None:
        """Tick or untick a checkbox, and wait until it is drawn so: a busy page is late."""
        box = self.row(label).locator("input[type=checkbox]")
        ticked = box.is_checked()
        box.click()
        expect(box).to_be_checked(checked=not ticked)

    def slider(self, label: str) -> float:
        """What a slider's number field shows."""
        row = self.row(label)
        return float(row.locator("input:not([type=hidden])").input_value())

    def charts(self) -> list[list[list[float | None]]]:
        """The data of the charts that are drawn."""
        return self.page.evaluate(
            "() => Object.values(window.__viserTestpoints.uplots).filter(plot => plot.chart)"
            ".map(plot => plot.chart.data.map(row => Array.from(row,"
            " value => Number.isFinite(value) ? value : null)))"
        )

    def press(self, button: str) -> None:
        """Press a button by its whole name."""
        self.page.get_by_role("button", name=button, exact=True).click()

    def wait_for_node(self, name: str, patience: float = PATIENCE) -> None:
        """Wait, at most so many ms, until a part of the organ is in the scene."""
        self.wait_for_path(f"/organ/{name}", patience)

    def wait_for_path(self, path: str, patience: float = PATIENCE) -> None:
        """Wait, at most so many ms, until something is in the scene."""
        self.page.wait_for_function(
            "path => window.__viserMutable?.nodeRefFromName?.[path]", arg=path, timeout=patience
        )

    def nodes(self) -> set[str]:
        """Names of the parts of the organ in the scene."""
        names = self.page.evaluate(
            "() => Object.entries(window.__viserMutable.nodeRefFromName)"
            ".filter(([name, node]) => name.startsWith('/organ/') && node)"
            ".map(([name]) => name.slice(7))"
        )
        return set(names)

    def vertices(self, name: str) -> np.ndarray:
        """(V, 3) vertices of a part of the organ as the page draws them, mm."""
        flat = self.page.evaluate(
            """name => {
                let mesh = null;
                window.__viserMutable.nodeRefFromName['/organ/' + name].traverse(node => {
                    if (!mesh && node.isMesh) mesh = node;
                });
                return Array.from(mesh.geometry.attributes.position.array);
            }""",
            name,
        )
        return np.array(flat).reshape(-1, 3)

    def slide(self, label: str, value: float) -> None:
        """Type a value into a slider's number field."""
        row = self.row(label)
        field = row.locator("input:not([type=hidden])")
        field.fill(str(value))
        field.press("Enter")
        self.page.evaluate(AFTER_ITS_LAST)

    def figure(self, name: str) -> float:
        """A figure of the read-out, by its data attribute."""
        return float(self.readout.get_attribute(f"data-{name}") or "nan")

    def wait_for_phase(self, phase: str) -> None:
        """Wait until the read-out shows a phase."""
        self.page.locator(f"[data-testid=readout][data-phase={phase}]").wait_for()

    def wait_for_force(self, force: float) -> None:
        """Wait until the read-out shows a force, N."""
        self.page.locator(f"[data-testid=readout][data-force-n='{force:.6g}']").wait_for()


def scene_of(view: PageView) -> TissueScene:
    """What draws the tissue of a page."""
    assert isinstance(view._scene, TissueScene)
    return view._scene


def newest(trainer: Trainer) -> PageView:
    """What the client that came last sees of a free duct."""
    return _newest(trainer, "free")


def newest_dissection(trainer: Trainer) -> PageView:
    """What the client that came last sees of a duct in its bed."""
    return _newest(trainer, "bed")


def _newest(trainer: Trainer, scene: str) -> PageView:
    """Wait for the client's view: a page shows parts of it before the trainer has it whole."""
    end = time.monotonic() + PATIENCE / 1000
    while True:
        number = max(trainer._server.get_clients(), default=None)
        found = None if number is None else trainer._views.get(number)
        if found is not None and found.scene == scene:
            return found
        assert time.monotonic() < end, f"the newest client shows {found and found.scene}"
        time.sleep(0.02)


def stands_still(session: Session) -> bool:
    """Whether nothing moves any more, or is going to."""
    return not session.tissue.moving


def pass_ticks(tab: TrainerPage, trainer: Trainer, count: int = 2) -> None:
    """Wait until the trainer has begun so many ticks more, while the page goes on."""
    until = trainer.timer.ticks + count
    tab.wait_until(lambda: trainer.timer.ticks >= until)


def stop_time(tab: TrainerPage, trainer: Trainer, view: PageView) -> None:
    """Stop a session's time; at the end no tick that began before is at it, and a test may be."""
    view.state.paused = True
    pass_ticks(tab, trainer)


def settle(tab: TrainerPage, trainer: Trainer, client: ClientHandle) -> None:
    """Wait until all that a page has sent is taken, and the page has all that came of it.

    For what is to have no effect: one that it had would be seen then.
    """
    tab.page.evaluate(AFTER_ITS_LAST)
    # Messages of a page keep their order, and so do those to it. In a thread of its own:
    # playwright's loop may be running in this one.
    with ThreadPoolExecutor(1) as pool:
        pool.submit(client.local_storage.get_item, "nothing", PATIENCE / 1000).result()
    catch_up(tab, trainer, client, ticks=15)  # a panel is told five times a second


def catch_up(tab: TrainerPage, trainer: Trainer, client: ClientHandle, ticks: int = 2) -> None:
    """Wait for some ticks, and until the page has drawn all that was sent to it until then."""
    pass_ticks(tab, trainer, ticks)
    number = trainer.timer.ticks
    run_in_page(client.scene, f"window.caughtUp = {number};")
    tab.page.wait_for_function(f"() => window.caughtUp === {number}")
    tab.next_picture()


def stage_pixel(tab: TrainerPage, point: tuple[float, ...]) -> tuple[float, float]:
    """Where a place of the stage with the shipped duct is in the window, px."""
    canvas = tab.page.locator("canvas[data-engine]").bounding_box()
    assert canvas is not None
    aspect = canvas["width"] / canvas["height"]
    points = np.array([point], np.float64)
    right, up = picture_points(viewpoint(50.8, RADIUS, aspect), points, aspect)[0]
    return (
        canvas["x"] + 0.5 * (1.0 + right) * canvas["width"],
        canvas["y"] + 0.5 * (1.0 - up) * canvas["height"],
    )


DRAWN = """(function start() {
    const scene = window.__viserMutable?.scene;
    if (!scene) return requestAnimationFrame(start);
    window.drawn = [];
    scene.onAfterRender = () => {
        const nodes = window.__viserMutable.nodeRefFromName;
        const tops = {};
        for (const name of ['organ', 'first_piece', 'second_piece']) {
            const node = nodes['/organ/' + name];
            let shown = Boolean(node);
            for (let above = node; above; above = above.parent) shown = shown && above.visible;
            if (shown) node.traverse(child => {
                const places = child.isMesh && child.geometry.attributes.position?.array;
                for (let z = 2; places && z < places.length; z += 3)
                    tops[name] = Math.max(tops[name] ?? -Infinity, places[z]);
            });
        }
        let parted = null;
        nodes['/bed/strands']?.traverse(child => {
            if (parted !== null || !child.isMesh) return;
            parted = 0;
            const numbers = child.geometry.attributes.position.array;
            for (let k = 3; k < numbers.length; k += 5) parted += numbers[k] === -9;
        });
        const lights = [];
        scene.traverseVisible(node => { if (node.isLight) lights.push(node.type); });
        const hook = nodes['/stage/hook'];
        if (hook) window.drawn.push({
            clock: Number(document.querySelector('input')?.value ?? NaN),
            caption: document.getElementById('caption').textContent,
            tops, hook: hook.position.z, lights: lights.sort(),
            around: Boolean(scene.environment), fog: scene.fog?.near ?? null, parted,
        });
    };
})()"""
"""Keeps what a player's page shows in each picture that it draws: caption, heights of the surfaces
that are seen and of the hook, mm, and what lights them."""


@dataclass(frozen=True)
class Drawn:
    """One picture that a player's page has drawn."""

    clock: float
    caption: str
    tops: dict[str, float]
    hook: float
    lights: list[str]
    around: bool
    fog: float | None
    parted: int | None  # strands of a bed, as they are streamed


@contextmanager
def playing(path: Path) -> Iterator["PlayerPage"]:
    """A page that plays by itself: without an error, and it asks for nothing from elsewhere."""
    errors: list[str] = []
    requests: list[str] = []
    with running_browser(drawing=False) as browser:
        page = new_context(browser, 480, 300).new_page()
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.on("request", lambda request: requests.append(request.url))
        yield PlayerPage(page, path)
    assert not errors, errors
    assert all(url.startswith(("file:", "data:", "blob:")) for url in requests), requests


class PlayerPage:
    """A page that plays by itself."""

    def __init__(self, page: Page, path: Path) -> None:
        self.page = page
        page.add_init_script(DRAWN)
        page.goto(f"{path.as_uri()}?fixedDpr=1")
        page.locator("#about").wait_for()

    def drawn(self) -> list[Drawn]:
        """What has been drawn so far, picture by picture."""
        return [Drawn(**each) for each in self.page.evaluate("() => window.drawn ?? []")]

    def passes(self, count: int) -> list[list[Drawn]]:
        """What is drawn in the first times through, each picture by picture.

        One begins where the organ is whole again. The clock tells nothing: its digits and the scene
        change in different pictures. A scene that is cleared, before each, is not kept.
        """
        until = time.monotonic() + 3.0 * PATIENCE / 1000.0
        while time.monotonic() < until:
            self.page.wait_for_timeout(500)
            pictures = [picture for picture in self.drawn() if picture.tops]
            whole = [picture.tops.keys() == {"organ"} for picture in pictures]
            starts = [
                number
                for number, (before, now) in enumerate(pairwise([False, *whole]))
                if now and not before
            ]
            if len(starts) > count:
                return [pictures[first:last] for first, last in pairwise(starts)][:count]
        pytest.fail("the page has not played so often")

    def wait_at(self, moment: float, fits: Callable[[Drawn], bool]) -> None:
        """Go to a time, s, where it stops, and wait for a picture as it should be."""
        before = len(self.drawn())
        clock = self.page.locator("input").first
        clock.fill(f"{moment:.2f}")
        until = time.monotonic() + 2.0 * PATIENCE / 1000.0
        while time.monotonic() < until:
            self.page.wait_for_timeout(200)
            pictures = self.drawn()[before:]
            if any(fits(picture) for picture in pictures):
                return
            # While it still plays, the field may be drawn anew between two of the digits.
            if pictures and abs(pictures[-1].clock - moment) > 0.06:
                clock.fill(f"{moment:.2f}")
        pytest.fail(f"at {moment:.2f} s there is {self.drawn()[-1:]}")
