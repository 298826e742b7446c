"""The picture through the scope in a real browser: its pose, and what its pixels show."""

import io
import math
import re
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import cast

import numpy as np
import pytest
from axe import no_faults
from browser import (
    AFTER_ITS_LAST,
    TrainerPage,
    _newest,
    pass_ticks,
    stop_time,
    trainer_page,
)
from numpy.testing import assert_allclose
from PIL import Image
from playwright.sync_api import Browser, expect
from simulated import phantom

from app.simulation import TROCARS, Feedback, Replay, Safety, exercise_at, performed, read_script
from app.simulation.exercises.critical_view import Part
from app.simulation.scripts.performance import Script, Step
from app.trainer.client.replay_playback import ReplayPlayback
from app.trainer.client.scope_lead import NOTCH_MM, ONLY_THROUGH_SCOPE
from app.trainer.panel.replay_tab import AFTER_EXERCISE, NO_RUN
from app.trainer.panel.scope_panel import GOAL, HOW, TURN
from app.trainer.scope.drawn_tissue import _roll
from app.trainer.scope.pose import OBLIQUE, Camera
from app.trainer.server.trainer import Trainer
from app.trainer.view.page_view import PageView
from app.trainer.view.scope_scene import ScopeScene
from assets import SCRIPTS
from benchmarks.picture_cost import MEASURED

POSE = """() => { const p = window.bluntdissectScope?.picture, q = p?.pose;
    return q && [q.tip, q.right, q.up, q.back, [p.high, p.pivotError, p.drawn]]; }"""

# One gamepad, its left stick so far to the right and some buttons down.
GAMEPAD = """([right, down]) => { navigator.getGamepads = () => [{ connected: true,
    mapping: "standard", axes: [right, 0, 0, 0],
    buttons: Array.from({ length: 17 }, (_, i) => ({ pressed: down.includes(i) })) }]; }"""
POOLS = """() => { const sheet = bluntdissectScope.picture.sheet;
    return [sheet.blood.reduce((sum, w) => sum + w, 0) * sheet.cell ** 2, sheet.volumes.blood]; }"""

# Whether what is put into a picture that is being drawn stands where all else does.
IN_PLACE = """() => { const p = bluntdissectScope.picture, { geometry, material } = p.floor;
    const mesh = p.put(geometry, material), { matrixWorld, matrix } = mesh;
    p.meshes.pop();
    p.group.remove(mesh);
    return matrixWorld.equals(p.group.matrixWorld) && !matrixWorld.equals(matrix); }"""

# How bright the covering sheet is beside the duodenum, and far from all organs.
SHADES = """() => { const sheet = bluntdissectScope.picture.sheet;
    return [[13, 30], [20, -50]].map(([x, y]) => sheet.cavity[sheet.cellAt(x, y)]); }"""

NOTCHES = """count => { const canvas = document.elementFromPoint(300, 280);
    for (let k = 0; k < count; k++) canvas.dispatchEvent(
        new WheelEvent("wheel", { deltaY: -100, bubbles: true, cancelable: true })); }"""

# Keeps what the page says of pointer, wheel and gamepad.
LISTEN = """() => { const page = window.__viserMutable, send = page.sendMessage;
    window.heard = [];
    page.sendMessage = message => { const value = message.updates?.value;
        if (/^[0-9]+ [a-z]/.test(value)) window.heard.push(value.split(" ").slice(1));
        send(message); }; }"""

# A browser writes pictures of these kinds, and else PNG.
WITHOUT = """kinds => { const page = HTMLCanvasElement.prototype;
    const write = page.writes ??= page.toDataURL;
    page.toDataURL = function (kind, ...rest) {
        return write.call(this, kinds.includes(kind) ? kind : "image/png", ...rest); }; }"""

# Turns of a wheel, each at a time, ms.
TURNS = """turns => { const canvas = document.elementFromPoint(300, 280);
    window.heard.length = 0;
    for (const { at, ...given } of turns) {
        const event = new WheelEvent("wheel", { bubbles: true, cancelable: true, ...given });
        Object.defineProperty(event, "timeStamp", { value: at });
        canvas.dispatchEvent(event);
    } }"""
Heard = list[list[str]]


@pytest.fixture(scope="module")
def calot() -> Iterator[Trainer]:
    running = Trainer(phantom(), port=0, scene="calot", look="plain")
    running.warm_up.wait("calot")
    yield running
    running.stop()


class ScopePage:
    """A page that shows the picture through the scope."""

    def __init__(self, tab: TrainerPage, view: PageView) -> None:
        self.tab, self.view = tab, view
        tab.page.wait_for_function("() => window.bluntdissectScope?.picture?.drawn > 2")

    @property
    def camera(self) -> Camera:
        return cast(ScopeScene, self.view._scene)._held.camera

    def pose(self) -> np.ndarray:
        """(5, 3) tip, right, up and back of the page's camera; height at 1 mm, error, pictures."""
        # The picture is made anew for another scope, and has no pose meanwhile.
        return np.array(self.tab.page.wait_for_function(POSE).json_value())

    def check_pose(self) -> None:
        """The page's camera is where the scope's algebra says, and its shafts pass their pivots."""
        page, camera = self.pose(), self.camera
        assert page[0] == pytest.approx(camera.tip, abs=1e-3)  # float32 of some 150 mm
        assert np.abs(page[1:4].T - camera.axes).max() <= 1e-6
        assert page[4, 1] <= 0.01

    def pixels(self) -> np.ndarray:
        """(H, W, 3) what the picture's canvas shows, once what has come is drawn."""
        before = self.pose()[4, 2]
        self.tab.page.evaluate("() => window.dispatchEvent(new Event('resize'))")
        self.tab.page.wait_for_function("n => bluntdissectScope.picture.drawn > n", arg=before)
        box = self.tab.page.evaluate(
            "() => { const b = document.querySelector('canvas').getBoundingClientRect();"
            " return { x: b.x, y: b.y, width: b.width, height: b.height }; }"
        )
        shot = self.tab.page.screenshot(clip=box)
        return np.array(Image.open(io.BytesIO(shot)).convert("RGB"), dtype=float)

    def seen_at(self, place: np.ndarray, columns: float, rows: float) -> tuple[float, float]:
        """Return where a place, (3,) mm, is seen in a picture of so many pixels."""
        right, up, back = self.camera.axes.T @ (place - self.camera.tip)
        high = self.pose()[4, 0]
        x = 0.5 * columns * (1.0 - right / (back * high) * rows / columns)
        return x, 0.5 * rows * (1.0 + up / (back * high))

    def click(self, place: np.ndarray) -> None:
        """Click where a place, (3,) mm, is seen."""
        box = self.tab.page.locator("canvas").first.bounding_box()
        assert box is not None
        x, y = self.seen_at(place, box["width"], box["height"])
        self.tab.page.mouse.click(box["x"] + x, box["y"] + y)

    def at(self, picture: np.ndarray, place: np.ndarray) -> np.ndarray:
        """(3,) mean colour of the 5 x 5 pixels where a place, (3,) mm, is seen."""
        rows, columns = picture.shape[:2]
        x, y = self.seen_at(place, columns, rows)
        return picture[round(y) - 2 : round(y) + 3, round(x) - 2 : round(x) + 3].mean(axis=(0, 1))


@contextmanager
def scope_page(
    browser: Browser, calot: Trainer, width: int = 900, height: int = 560
) -> Iterator[ScopePage]:
    """A page with the picture, begun, which no message covers."""
    with trainer_page(
        browser, calot.address, width=width, height=height, first_minute=True, node="/scope/state"
    ) as tab:
        expect(tab.page.get_by_role("dialog").get_by_role("button", name="Begin")).to_be_focused()
        tab.start()
        tab.page.add_style_tag(content=".mantine-Notifications-root { display: none }")
        yield ScopePage(tab, _newest(calot, "calot"))


def red(colour: np.ndarray) -> np.ndarray:
    """Return how many times redder than green a colour is."""
    return colour[..., 0] / np.maximum(colour[..., 1], 8.0)


def test_the_picture_is_what_the_scope_sees(calot: Trainer, drawing_browser: Browser) -> None:
    """A bile-coloured gallbladder, pale fat, a red liver, black corners; then blood, that grows."""
    with scope_page(drawing_browser, calot) as page:
        tab, view = page.tab, page.view
        tab.eventually(page.check_pose)
        assert tab.page.evaluate(IN_PLACE)
        # Given back, the scope is seen to come home, though nothing else moves; and a checkbox that
        # was clicked keeps no keys.
        home = page.pose()
        tab.page.get_by_label("Mark what is next").click()
        tab.page.keyboard.press("y")
        scope = tab.page.get_by_role("button", name="Scope", exact=True)
        expect(scope).to_have_attribute("aria-pressed", "true")
        tab.page.mouse.move(300, 280)
        tab.page.mouse.down()
        tab.page.mouse.move(360, 320)
        tab.page.mouse.up()
        tab.wait_until(lambda: bool(np.abs(page.pose()[:4] - home[:4]).max() > 0.1))
        tab.page.keyboard.press("v")
        tab.wait_until(lambda: bool(np.abs(page.pose()[:4] - home[:4]).max() < 1e-3))
        expect(scope).to_have_attribute("aria-pressed", "false")  # the hand is led again, too
        picture = page.pixels()
        for corner in (picture[:6, :6], picture[:6, -6:], picture[-6:, :6], picture[-6:, -6:]):
            assert corner.max() < 12.0
        tissue = view.session.spatial
        bladder = tissue.beam.places_at(np.array([12.0]), "gallbladder")[0]
        wall = page.at(picture, bladder + 8.0 * page.camera.axes[:, 2])
        assert wall.max() > 60.0
        assert red(wall) < 1.35
        liver = page.at(picture, np.array([79.0, 20.0, 16.0]))
        assert red(liver) > 1.6
        before = int(((red(picture) > 3.0) & (picture[..., 0] > 50.0)).sum())
        artery = tissue.tubes.names.index("artery")
        with view.session.lock:
            view.session.open_jaws(1, 1.0)  # which begins a run, with all made whole
            tissue.beam.tear(9.0, "artery")
            tissue._note("tear", artery, 9.0, None)

        def bled() -> bool:
            now = page.pixels()
            return int(((red(now) > 3.0) & (now[..., 0] > 50.0)).sum()) > before + 300

        tab.wait_until(bled, 60.0)
        drawn, computed = tab.page.evaluate(POOLS)
        assert drawn == pytest.approx(computed, rel=1e-3)
        # Its jet has soiled the lens, which is wiped.
        lens = page.tab.page.locator(".bd-scope-lens")
        tab.wait_until(lambda: tissue.lens.soil > 0.0, 30.0)
        expect(lens).to_be_visible()
        tab.page.keyboard.press("b")
        tab.wait_until(
            lambda: any(each.kind == "wipe" for each in view.session.run_file().log.inputs)
        )
        view.state.reset()
        tab.wait_until(lambda: tab.page.evaluate(POOLS) == [0, 0], 60.0)
        expect(lens).to_be_hidden()
        # A wall near its break is named in the picture and in the panel, until it is let go.
        warning = tab.page.locator(".bd-scope-warning")
        expect(warning).to_be_hidden()
        lift = Step(do="lead", by_mm=(0.0, 0.0, 12.0), speed_mm_per_s=8.0, stop_at=0.92)
        with view.session.lock:
            performed(Script(step=[Step(do="grab", tube="artery", at_mm=12.0), lift]), view.session)
        expect(warning).to_have_text(re.compile("^cystic artery: over [89][05] % of its break$"))
        expect(tab.readout).to_contain_text("cystic artery, ")
        view.state.reset()
        expect(warning).to_be_hidden()
        # Arrows go on to lead the tip after a tab was clicked; a tab that keys come to takes them.
        learn = tab.page.get_by_role("tab", name="Learn")
        for come, chosen in ((learn.click, "Learn"), (learn.focus, "Replay")):
            come()
            if chosen == "Replay":
                expect(learn).to_be_focused()
            tab.page.keyboard.press("ArrowRight")
            expect(tab.page.get_by_role("tab", name=chosen)).to_have_attribute(
                "aria-selected", "true"
            )
        tab.page.get_by_role("tab", name="Train").click()
        # A notch of the wheel is a small step, one that follows quickly a large one.
        # It goes along the shaft.
        start = view.session.spatial.hands[0].place.copy()
        shaft = TROCARS[0].shaft(start)
        tab.page.evaluate(NOTCHES, 3)

        end = start - 10.5 * shaft
        tab.wait_until(lambda: math.dist(view.session.spatial.hands[0].place, end) < 0.5)
        # It goes on from where the tip was led, wherever that is drawn meanwhile.
        tab.page.mouse.click(400, 250)
        tab.page.evaluate(NOTCHES, 2)

        def is_where_it_was_pressed() -> None:
            place, camera = view.session.spatial.hands[0].place, page.camera
            place = place + 6.0 * TROCARS[0].shaft(place)  # four notches back
            box = tab.page.locator("canvas").first.bounding_box()
            assert box is not None
            right, up, back = camera.axes.T @ (place - camera.tip)
            dots = 0.5 * box["height"] / (back * page.pose()[4, 0])
            x, y = 0.5 * box["width"] - dots * right, 0.5 * box["height"] + dots * up
            assert (box["x"] + x, box["y"] + y) == pytest.approx((400, 250), abs=3.0)

        tab.eventually(is_where_it_was_pressed)
        # The oblique scope looks from where its algebra says.
        tab.page.keyboard.press("z")
        tab.wait_until(lambda: page.camera.shaft @ page.camera.axes[:, 2] > -0.9)
        tab.eventually(page.check_pose)

        def aside() -> float:
            """How far the left tip is to the right in the picture, mm."""
            hand = view.session.spatial.hands[0]
            return float(hand.place @ page.camera.axes[:, 0])

        start = aside()
        tab.page.evaluate(GAMEPAD, [1.0, []])
        tab.wait_until(lambda: aside() > start + 2.0)
        tab.page.evaluate(GAMEPAD, [0.0, [1]])  # which goes on to the right hand
        tab.wait_until(lambda: view.state.hand == 1)
        # Led by its handle, a tip goes the other way than the mouse.
        for key, name in (("x", "Left hand"), ("t", "Handle")):
            tab.page.keyboard.press(key)
            # The page's pointer knows it before the panel shows it.
            chosen = tab.page.get_by_role("button", name=name, exact=True)
            expect(chosen).to_have_attribute("aria-pressed", "true")
        start = aside()
        tab.page.mouse.move(300, 280)
        tab.page.mouse.down()
        tab.page.mouse.move(360, 280)
        tab.page.mouse.up()
        tab.wait_until(lambda: aside() < start - 2.0)


def wheel_turns(at: float, count: int, every: float, **given: float) -> list[dict[str, float]]:
    """Return so many turns of a wheel, ms apart."""
    return [{"at": at + every * number, **given} for number in range(count)]


def test_a_wheel_goes_by_notches_a_trackpad_by_its_fingers_and_a_stick_stops(
    calot: Trainer, browser: Browser
) -> None:
    """Both by `deltaY`; a trackpad's pinch is a wheel with Ctrl, and no notches follow quickly."""
    with scope_page(browser, calot) as page:
        tab = page.tab
        tab.page.evaluate(LISTEN)

        def heard(kind: str) -> list[list[float]]:
            found = cast(Heard, tab.page.evaluate("() => window.heard"))
            return [list(map(float, numbers)) for each, *numbers in found if each == kind]

        small = wheel_turns(2e6, 30, 16.0, deltaY=-4.0)
        flick = [
            *wheel_turns(3e6, 1, 0.0, deltaY=-10.0),
            *wheel_turns(3e6 + 16, 2, 16, deltaY=-150),
        ]
        for turns, notches in (
            (wheel_turns(1e6, 3, 50.0, deltaY=-100.0), 1 + 3 + 3),
            (wheel_turns(1.1e6, 2, 500.0, deltaY=120.0), -2),
            (wheel_turns(1.2e6, 1, 0.0, deltaY=-80.0), 1),
            (wheel_turns(1.3e6, 2, 50.0, deltaY=-3.0, deltaMode=1), 1 + 3),
            (small, 1.2),
            (flick, 3.1),
            (wheel_turns(4e6, 10, 16.0, deltaY=-2.0, ctrlKey=True), 10 * 0.02 * 150 / 6),
            (wheel_turns(5e6, 1, 0.0, deltaY=-100.0, ctrlKey=True), 1),
            (wheel_turns(6e6, 9, 16.0, deltaX=-50.0), 0),
        ):
            tab.page.evaluate(TURNS, turns)
            tab.page.evaluate(AFTER_ITS_LAST)

            def led(wanted: float = notches) -> None:
                assert_allclose(sum(map(sum, heard("wheel"))), wanted, atol=2e-3)

            tab.eventually(led)
            assert heard("scope") == []
        for given, cable, head in (
            ({"deltaY": 100.0, "shiftKey": True}, 0.12, 0.0),
            ({"deltaX": -100.0, "shiftKey": True}, -0.12, 0.0),
            ({"deltaY": 100.0, "altKey": True}, 0.0, 0.12),
            ({"deltaY": -100.0, "altKey": True}, 0.0, -0.12),
        ):
            tab.page.evaluate(TURNS, wheel_turns(7e6, 1, 0.0, **given))
            moved = [[0.0, 0.0, 0.0, cable, head]]
            tab.eventually(lambda moved=moved: assert_allclose(heard("scope"), moved))
            assert heard("wheel") == []
        # A gamepad's stick says once that it has come back to rest.
        tab.page.evaluate(GAMEPAD, [1.0, []])
        tab.wait_until(lambda: len(heard("nudge")) > 2)
        tab.page.evaluate(GAMEPAD, [0.0, []])
        tab.wait_until(lambda: heard("rest"))
        tab.page.evaluate(GAMEPAD, [0.0, [1]])
        tab.wait_until(lambda: heard("hand"))
        assert len(heard("rest")) == 1
        # Its cross rolls the camera's head for as long as it is pressed.
        for button, side in ((15, 1.0), (14, -1.0)):
            tab.page.evaluate("() => { window.heard.length = 0; }")
            tab.page.evaluate(GAMEPAD, [0.0, [button]])
            tab.wait_until(lambda: len(heard("scope")) > 2)
            tab.page.evaluate(GAMEPAD, [0.0, []])
            for *others, head in heard("scope"):
                assert others == [0.0] * 4
                assert side * head > 0.0
        tab.page.evaluate("() => { navigator.getGamepads = () => []; }")


def test_the_camera_s_head_is_rolled_by_keys_and_a_replay_has_the_horizon(
    calot: Trainer, browser: Browser
) -> None:
    """By a trainee who leads a hand; what the middle shows stays there, turned by as much."""
    with scope_page(browser, calot) as page:
        tab, view = page.tab, page.view
        lead, session = view._lead, view.session
        assert lead is not None
        session.open_jaws(1, 1.0)  # which begins a run
        before, pose, turned = page.camera, lead.held.pose, 0
        for key, times in (("Shift+L", 3), ("Shift+J", 5)):
            turned += times if key == "Shift+L" else -times
            for _ in range(times):
                tab.page.keyboard.press(key)
            angle = turned * TURN
            tab.wait_until(lambda angle=angle: abs(lead.held.pose.head - angle) < 1e-9)
            tab.eventually(page.check_pose)
            now = page.camera
            assert now.tip == pytest.approx(before.tip, abs=1e-12)
            right, up = (before.axes.T @ now.axes)[:2, :2].T
            # A head that turns clockwise has its up towards the right.
            assert up == pytest.approx([math.sin(angle), math.cos(angle)])
            assert right == pytest.approx([math.cos(angle), -math.sin(angle)])
        assert lead.held.pose == replace(pose, head=lead.held.pose.head)
        assert not lead.held.assisted
        assert not lead.leads_scope
        tab.wait_until(lambda: session.spatial.pose[6:11] == lead.held.pose.numbers)
        run = session.run_file()
        assert 0.0 < run.metrics["horizon_deg"] <= math.degrees(3 * TURN)
        again = Replay(run.log, session.spatial.dissection.organ)
        again.seek_tick(run.log.ticks)
        assert again.session.spatial.pose == session.spatial.pose
        assert run.agrees_with(again.run_file())


def test_two_fingers_take_back_what_the_first_began_and_lead_in_depth(
    calot: Trainer, browser: Browser
) -> None:
    with scope_page(browser, calot) as page:
        tab, view = page.tab, page.view
        hand = view.session.spatial.hands[0]
        start = hand.place.copy()
        shaft = TROCARS[0].shaft(start)
        tab.page.evaluate(LISTEN)
        touch = tab.page.context.new_cdp_session(tab.page)
        at = time.time()

        def touched(kind: str, **fingers: tuple[float, float]) -> None:
            nonlocal at
            at += 0.05
            points = [
                {"x": x, "y": y, "id": ("first", "second").index(name)}
                for name, (x, y) in fingers.items()
            ]
            asked = {"type": kind, "touchPoints": points, "timestamp": at}
            touch.send("Input.dispatchTouchEvent", asked)

        def heard() -> list[str]:
            return [each[0] for each in cast(Heard, tab.page.evaluate("() => window.heard"))]

        touched("touchStart", first=(300, 280))
        touched("touchMove", first=(330, 280))
        tab.wait_until(lambda: heard() == ["press", "drag"])
        touched("touchStart", second=(390, 280))
        touched("touchMove", second=(420, 280))
        tab.wait_until(lambda: heard() == ["press", "drag", "back", "wheel"])
        # The finger that is left leads nothing.
        touched("touchEnd", first=(330, 280))
        touched("touchMove", second=(440, 300))
        touched("touchMove", second=(460, 320))
        touched("touchEnd", second=(460, 320))
        tab.wait_until(lambda: heard()[-1] == "stop")
        assert heard() == ["press", "drag", "back", "wheel", "stop"]
        end = start - 30 / 6 * NOTCH_MM * shaft
        tab.eventually(lambda: assert_allclose(hand.place, end, atol=0.05))
        # A new touch leads again, and a second finger that comes late only ends that.
        touched("touchStart", first=(300, 280))
        at += 1.0
        touched("touchStart", second=(390, 280))
        touched("touchEnd")
        tab.wait_until(lambda: heard()[5:] == ["press", "stop", "stop"])


def test_a_replay_is_seen_as_it_was_and_one_s_own_scope_stays_as_it_was(
    calot: Trainer, browser: Browser
) -> None:
    """Though the trainee held the scope then, and holds it elsewhere now."""
    with scope_page(browser, calot) as page:
        tab, view = page.tab, page.view
        lead, session = view._lead, view.session
        assert lead is not None
        own = lead.held
        session.open_jaws(1, 1.0)  # which begins a run
        lead.change_scope()
        lead.move_scope(pan=0.1, tilt=-0.05)
        tab.wait_until(lambda: session.spatial.pose[6:12] == (*own.pose.numbers, OBLIQUE))
        then = own.pose
        session.open_jaws(1, 2.0)
        run = session.run_file()
        lead.change_scope()
        lead.move_scope(depth=20.0)
        now = own.pose
        tab.wait_until(lambda: session.spatial.pose[6:12] == (*now.numbers, 0.0))
        inputs = len(session.run_file().log.inputs)
        view.state.start_replay(run)
        tab.wait_until(lambda: view.state.playback is not None)
        playback = view.state.playback
        assert playback is not None
        playback.pause()
        playback.seek(playback.duration)

        def is_as_it_was() -> None:
            seen = lead.held
            assert playback.at_end
            assert (seen.pose, seen.scope.angle) == (then, OBLIQUE)
            page.check_pose()

        tab.eventually(is_as_it_was)
        # Moved, it looks elsewhere, until V goes on with the run's.
        lead.move_scope(pan=-0.3)
        pass_ticks(tab, calot)
        assert lead.held.pose == then.moved(pan=-0.3)
        tab.eventually(page.check_pose)
        tab.page.keyboard.press("v")
        tab.eventually(is_as_it_was)
        view.state.leave_replay()
        tab.wait_until(lambda: lead.held is own)
        assert (own.pose, own.scope.angle, own.assisted) == (now, 0.0, False)
        tab.eventually(page.check_pose)
        assert len(session.run_file().log.inputs) == inputs, "nothing of the replay's is logged"


# What a picture costs, beside the calls and triangles that WebGL was asked to draw for all of them.
COUNTED = """async () => { const gl = WebGL2RenderingContext.prototype, TRIANGLES = 4;
    const asked = [0, 0];
    const count = (name, size, times) => { const draw = gl[name];
        gl[name] = function (...given) {
            asked[0]++;
            if (given[0] === TRIANGLES) asked[1] += given[size] / 3 * (given[times] ?? 1);
            draw.apply(this, given); }; };
    count("drawElements", 1); count("drawArrays", 2);
    count("drawElementsInstanced", 1, 4); count("drawArraysInstanced", 2, 3);
    return [await (MEASURED)(0), ...asked]; }""".replace("MEASURED", MEASURED)


def test_the_cost_of_a_picture_is_what_webgl_is_asked_to_draw(
    calot: Trainer, drawing_browser: Browser
) -> None:
    with scope_page(drawing_browser, calot) as shown:
        cost, calls, triangles = shown.tab.page.evaluate(COUNTED)
        assert cost["pictures"] >= 6
        assert calls == cost["pictures"] * cost["calls"]
        assert triangles == cost["pictures"] * cost["triangles"]


FREE = "() => window.bluntdissectScope?.free === true"


def test_a_free_camera_looks_from_elsewhere_and_the_scope_stays_as_it_is(
    calot: Trainer, drawing_browser: Browser
) -> None:
    """The run knows nothing of it, and an exercise is seen through the scope only."""
    with scope_page(drawing_browser, calot) as page:
        tab, view, keys = page.tab, page.view, page.tab.page.keyboard
        lead, session = view._lead, view.session
        assert lead is not None
        assert session.specimen.anatomy is not None
        exercise = exercise_at(session.specimen.anatomy, "critical_view")
        assert exercise is not None
        session.open_jaws(1, 1.0)  # which begins a run
        tab.wait_until(lambda: not session.tissue.moving)
        logged = session.spatial.pose
        assert logged[6:11] == lead.held.pose.numbers
        inputs = session.run_file().log.inputs
        posed, through = page.pose()[:4], page.pixels()

        def is_through_scope() -> None:
            assert_allclose(tab.camera()[0], page.camera.tip, atol=1e-3)
            assert not tab.page.evaluate(FREE)

        def corners(picture: np.ndarray) -> np.ndarray:
            return picture[[5, 5, -5, -5], [5, -5, 5, -5]].max(axis=1)

        is_through_scope()
        assert corners(through).max() == 0.0  # it is round
        keys.press("Shift+V")
        tab.page.wait_for_function(FREE)
        assert_allclose(tab.rest()[0], page.camera.tip, atol=1e-3)
        free = page.pixels()
        assert corners(free).min() > 0.0, "it fills the window"
        box = tab.page.locator("canvas").first.bounding_box()
        assert box is not None
        x, y = box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"]
        tab.page.mouse.move(x, y)
        tab.page.mouse.down()
        tab.page.mouse.move(x + 120, y + 20, steps=4)
        tab.page.mouse.up()
        turned = tab.rest()
        assert math.dist(turned[0], page.camera.tip) > 20.0
        assert np.abs(page.pixels() - free).mean() > 10.0
        assert_allclose(page.pose()[:4], posed, atol=0.0)
        page.check_pose()
        assert session.spatial.pose == logged
        assert session.run_file().log.inputs == inputs
        keys.press("Shift+V")
        tab.eventually(is_through_scope)
        assert_allclose(page.pose()[:4], posed, atol=0.0)
        # The camera's head brightens it step by step.
        tab.eventually(lambda: assert_allclose(page.pixels(), through, atol=2.0))

        # A replay may be looked at so, and the run of an exercise may not.
        view.state.start_replay(session.run_file())
        tab.wait_until(lambda: view.state.playback is not None)
        keys.press("Shift+V")
        tab.page.wait_for_function(FREE)
        view.state.leave_replay()
        view.state.start_exercise(exercise, Feedback.CONTINUOUS)
        tab.eventually(is_through_scope)
        keys.press("Shift+V")
        refused = tab.page.get_by_text(ONLY_THROUGH_SCOPE)
        refused.wait_for(state="attached")
        is_through_scope()
        assert not lead.free_camera


@pytest.mark.parametrize(
    "size", [(390, 844), pytest.param((640, 400), marks=pytest.mark.long)],
    ids=["phone", "zoomed to 200 %"],
)  # fmt: skip
def test_the_panel_at_an_anatomy_is_for_everyone(
    calot: Trainer, drawing_browser: Browser, size: tuple[int, int]
) -> None:
    """Nothing serious for axe-core on a small page, which is not cut."""
    width, height = size
    with scope_page(drawing_browser, calot, width, height) as shown:
        tab, page, dialog = shown.tab, shown.tab.page, shown.tab.page.get_by_role("dialog")
        tabs = page.get_by_role("tablist")

        def room_to_work() -> bool:
            row = tabs.bounding_box()
            return row is not None and row["y"] + row["height"] < 0.75 * height

        tab.wait_until(room_to_work)  # below the tabs, when the panel has unfolded
        for name in ("Learn", "Replay", "Train"):
            tab.open(name)
            no_faults(tab, name)
        # What is said of an instrument is of one to four lines, and nothing below it moves.
        tops: set[float] = set()
        state = shown.view.state
        for each in ("hook", "dissector", "clip applier", "suction", "grasper"):
            state.choose_instrument(0, each)
            expect(page.get_by_test_id("how")).to_have_text(HOW[each])
            place = page.get_by_role("button", name="Photograph").bounding_box()
            assert place is not None
            tops.add(place["y"])
        assert len(tops) == 1
        tab.press("Help")
        dialog.wait_for()
        no_faults(tab, "Help")
        page.keyboard.press("Escape")
        wide = page.evaluate("() => document.scrollingElement.scrollWidth")
        assert wide <= width
        # A press in the middle of what the panel leaves of the picture leads the tip there.
        expect(dialog).to_have_count(0)
        box = page.locator("canvas").first.bounding_box()
        assert box is not None
        covered = page.evaluate("() => bluntdissectScope.picture.covered")
        assert (covered > 0.3) == (width < 400)
        middle = box["x"] + box["width"] / 2, box["y"] + box["height"] * (1 - covered) / 2
        page.mouse.move(*middle)
        page.mouse.down()
        hand = shown.view.session.spatial.hands[0]
        tab.wait_until(lambda: shown.camera.seen(hand.place)[0] < 0.1)
        page.mouse.up()


def test_show_me_plays_the_recorded_critical_view_and_a_try_goes_on_in_a_page_loaded_anew(
    calot: Trainer, browser: Browser
) -> None:
    """The former begins at its start, and not once its five minutes have been computed."""
    with scope_page(browser, calot) as page:
        tab, view = page.tab, page.view
        tab.open("Learn")
        tab.choose("Exercise", "Critical view")
        tab.press("Show me")
        tab.wait_until(lambda: view.state.playback is not None)
        playback = view.state.playback
        assert isinstance(playback, ReplayPlayback)
        assert playback.time < 0.5 * playback.duration
        assert playback.duration > 300.0
        assert playback.session.run.exercise is not None
        assert playback.session.run.exercise.name == "critical_view"
        # Its hands work in the picture, as fast as is chosen.
        tab.choose("Speed", "16×")
        tab.wait_until(lambda: playback.session.reading().broken > 10)
        assert playback.speed == 16
        assert playback.session.spatial.hands[1].instrument == "right angle"
        tab.press("Leave the replay")
        tab.wait_until(lambda: view.state.playback is None)
        # A try goes on in a page that is loaded anew, with the hand that was led and the picture
        # that was chosen, and it says so.
        tab.press("Start")
        tab.wait_until(lambda: view.state.in_exercise)
        assert view.state.hand == 1
        view.state.show(plain=True)
        view.session.open_jaws(1, 2.0)
        tab.wait_until(lambda: view.session.run.started)
        tab.page.reload()
        tab.wait_until(lambda: _newest(calot, "calot") is not view)
        again = _newest(calot, "calot")
        assert again.session is view.session
        note = tab.page.get_by_text("Your try goes on")
        expect(note).to_be_visible()
        assert again.state.in_exercise
        assert again.state.hand == 1
        assert again.state.plain
        again.state.show(plain=False)
        expect(note).to_be_hidden()  # by itself


def test_a_failed_try_names_its_cause_first_stands_still_and_is_begun_anew(
    calot: Trainer, browser: Browser
) -> None:
    with scope_page(browser, calot, height=800) as shown:
        tab, view, page = shown.tab, shown.view, shown.tab.page
        session, lead = view.session, view._lead
        assert lead is not None
        tab.open("Learn")
        tab.press("Show me")
        # What hands do stands below the picture.
        caption = page.get_by_test_id("caption")
        expect(caption).to_contain_text("The right angle")
        expect(caption).to_contain_text("0 of 6 points, 3 asked")
        playback = view.state.playback
        assert playback is not None
        tab.choose("Speed", "16×")
        tab.wait_until(lambda: playback.session.run.progress > 0.0)
        tab.press("Leave the replay")
        learn = page.get_by_role("tab", name="Learn", exact=True)
        expect(learn).to_have_attribute("aria-selected", "true")
        tab.press("Start")
        tab.wait_until(lambda: session.run.exercise is not None)
        lead.choose(1)
        lead.use_instrument()  # its jaws are still led apart when the try is over
        stop_time(tab, calot, view)
        performed(read_script(SCRIPTS / "hasty.toml"), session)
        outcome, dialog = page.get_by_test_id("outcome"), page.get_by_role("dialog")
        expect(outcome).to_contain_text("as the jaws of the dissector opened against it")
        expect(page.get_by_test_id("standing")).to_contain_text("0 of 6 points, 3 asked; ")
        first = page.get_by_test_id("error").first
        expect(first.get_by_role("button", name="1. A tube tore")).to_be_visible()
        expect(page.get_by_test_id("next-time")).to_contain_text("Close the jaws, draw back")
        # Nothing breaks or is lost beside the result: both have the same numbers.
        metrics, figures = session.metrics(), page.get_by_test_id("readout")
        ticks, view.state.paused = session.spatial.ticks, False
        pass_ticks(tab, calot, 30)
        assert session.spatial.ticks == ticks
        assert session.reading().broken == metrics["strands_broken"]
        expect(figures).to_have_attribute("data-broken", str(metrics["strands_broken"]))
        dialog.get_by_role("tab", name="Measures").click()
        torn = page.get_by_test_id("tear-measure")
        expect(torn).to_contain_text("mm from the first end of the cystic artery.")
        room = dialog.bounding_box()
        assert room is not None
        assert 0.0 <= room["y"] < room["y"] + room["height"] <= 800.0
        tab.press("Try again")
        state = page.get_by_test_id("exercise-state")
        expect(state).to_contain_text("Ready. Time runs from your first touch.")
        pass_ticks(tab, calot, 30)
        assert not session.run.started
        assert [hand.opening for hand in session.spatial.hands] == [0.0, 0.0]
        assert view.state.hand == 1  # the first that is asked for something
        # During a try *Show me* says why it is not offered.
        session.open_jaws(1, 2.0)
        shown = page.get_by_role("button", name="Show me, once this try is over")
        expect(shown).to_be_disabled()
        # A key that is pressed by mistake ends no try.
        page.keyboard.press("r")
        expect(page.get_by_text("Reset once more if you mean it.")).to_have_count(1)
        assert session.run.started
        page.keyboard.press("r")
        tab.wait_until(lambda: session.run.exercise is None)
        tab.press("Start")
        tab.wait_until(lambda: session.run.exercise is not None)
        session.open_jaws(1, 2.0)
        tab.press("Stop")
        expect(outcome).to_have_attribute("data-outcome", "Not judged")
        expect(page.get_by_test_id("standing")).to_contain_text("triangle, 0 of 2: 0 % free, 60 %")


LIT = """() => [bluntdissectScope.lit ?? null, bluntdissectScope.picture.meshes.filter(
    mesh => mesh.visible && mesh.material.uniforms.uLit?.value === 1).length]"""


def test_the_hand_that_made_an_error_is_lit_when_its_moment_is_played(
    calot: Trainer, drawing_browser: Browser
) -> None:
    with scope_page(drawing_browser, calot, height=800) as shown:
        tab, view, page = shown.tab, shown.view, shown.tab.page
        stop_time(tab, calot, view)
        performed(read_script(SCRIPTS / "hasty.toml"), view.session)
        run, incidents = view.session.run_file(), view.session.run.incidents()
        error = next(each for each in incidents if each.hand is not None)
        quiet = error.start_s - 1.5  # before it is played
        assert not [each for each in incidents if each.start_s - 1.0 <= quiet <= each.end_s + 1.0]
        assert page.evaluate(LIT) == [None, 0]
        view.state.start_replay(run, error.start_s - 0.9, incidents)
        playback = view.state.playback
        assert playback is not None
        playback.pause()
        pieces = {"hook": 2, "swab": 2, "suction": 2}.get(
            view.session.spatial.hands[error.hand or 0].instrument, 3
        )  # a shaft, and a jaw or two
        tab.wait_until(lambda: page.evaluate(LIT) == [error.hand, pieces])
        playback.seek(quiet)
        tab.wait_until(lambda: page.evaluate(LIT) == [None, 0])
        playback.seek(error.start_s)
        tab.wait_until(lambda: page.evaluate(LIT) == [error.hand, pieces])
        # It is far brighter than it else is, in the plain look too, and the other hand is not.
        lit = shown.pixels()
        page.evaluate("() => bluntdissectScope.light(null)")
        brighter = (lit - shown.pixels()).mean(axis=2)
        assert (brighter > 60.0).mean() > 0.01
        others = np.array_split(brighter, 3, axis=1)[(error.hand or 0) - 1]
        assert np.abs(others).max() < 10.0
        view.state.leave_replay()
        tab.wait_until(lambda: page.evaluate(LIT) == [None, 0])


def test_structures_are_pointed_at_by_keys_and_mouse_and_photographed(
    calot: Trainer, drawing_browser: Browser
) -> None:
    with scope_page(drawing_browser, calot) as page:
        tab, view = page.tab, page.view
        tissue = view.session.spatial
        anatomy = view.session.specimen.anatomy
        assert anatomy is not None
        exercise = exercise_at(anatomy, "who_is_who")
        assert exercise is not None
        view.state.start_exercise(exercise, Feedback.CONTINUOUS)
        # The photograph is a picture of what is seen, with its black corners.
        tab.page.keyboard.press("h")
        tab.wait_until(lambda: len(view.state.photographs) == 1, 60.0)
        taken = Image.open(io.BytesIO(view.state.photographs[0])).convert("RGB")
        assert taken.size == (480, 480)
        assert max(taken.getpixel((3, 3))) < 12  # pyright: ignore
        assert max(taken.getpixel((240, 240))) > 60  # pyright: ignore
        # A browser that cannot write WebP sends JPEG, and one that cannot do that either a PNG, so
        # small that it is taken.
        for kind in ("JPEG", "PNG"):
            tab.page.evaluate(WITHOUT, [] if kind == "PNG" else ["image/jpeg"])
            tab.page.keyboard.press("h")

            def is_of_it(wanted: str = kind) -> None:
                taken = Image.open(io.BytesIO(view.state.photographs[-1]))
                assert taken.format == wanted

            tab.eventually(is_of_it, 60.0)
            taken = Image.open(io.BytesIO(view.state.photographs[-1])).convert("RGB")
            side = taken.width
            assert taken.height == side
            assert side == 480 if kind == "JPEG" else 150 < side < 400
            assert max(taken.getpixel((3, 3))) < 12  # pyright: ignore
            assert max(taken.getpixel((side // 2, side // 2))) > 60  # pyright: ignore
        # By keys: the arrows move the cross to the gallbladder, and G marks.
        tab.page.keyboard.press("k")
        row = tab.page.get_by_test_id("point-at")
        expect(row.get_by_role("button", name="Cystic duct")).to_have_attribute(
            "aria-pressed", "true"
        )
        expect(row.get_by_role("button", name="Not yet safe")).to_be_visible()
        place = tissue.beam.places_at(np.array([14.0]), "gallbladder")[0]
        right, up, back = page.camera.axes.T @ (place - page.camera.tip)
        for across, keys in ((right, ("ArrowRight", "ArrowLeft")), (up, ("ArrowUp", "ArrowDown"))):
            at = across / -back / np.tan(np.pi / 6.0)
            for _ in range(round(abs(at) / 0.03)):
                tab.page.keyboard.press(keys[int(at < 0.0)])
        tab.page.keyboard.press("g")
        tab.wait_until(lambda: bool(tissue.marks))
        assert (tissue.marks[0].structure, tissue.marks[0].tube) == ("cystic duct", "gallbladder")
        # By mouse: the next structure is marked where it is pressed.
        pressed = row.get_by_role("button", name="Cystic artery")
        expect(pressed).to_have_attribute("aria-pressed", "true")
        box = tab.page.locator("canvas").first.bounding_box()
        cross = tab.page.locator(".bd-scope-cross").bounding_box()
        assert box is not None
        assert cross is not None
        tab.page.mouse.click(cross["x"] + cross["width"] / 2, cross["y"] + cross["height"] / 2)
        tab.wait_until(lambda: len(tissue.marks) == 2)
        assert tissue.marks[1].tube == "gallbladder"
        tab.page.keyboard.press("u")
        result = tab.page.get_by_role("dialog")
        result.wait_for()
        expect(result).to_contain_text("took the gallbladder for the cystic artery")


def test_the_score_of_who_is_who_is_kept_in_a_page_loaded_anew(
    calot: Trainer, browser: Browser
) -> None:
    with scope_page(browser, calot) as page:
        tab, view = page.tab, page.view
        view._practice.series.random = np.random.default_rng(1)
        view._practice.series.begin_anew()
        seeds = view._practice.series.seeds
        score = tab.page.get_by_test_id("score")
        before = view.session.specimen.anatomy
        assert before is not None
        for number in (1, 2):
            tab.open("Learn")
            tab.choose("Exercise", "Who is who")
            tab.press("Start")
            tab.wait_until(lambda: _newest(calot, "calot").state.in_exercise)
            view = _newest(calot, "calot")
            anatomy = view.session.specimen.anatomy
            assert anatomy is not None
            assert anatomy.seed == seeds[number - 1]
            tab.press("Not yet safe")
            expect(score).to_contain_text(f"of {number} pictures right so far, of 10.")
            tab.page.reload()
            tab.wait_until(lambda left=view: _newest(calot, "calot") is not left)
            # Reset, and another exercise, go on at the anatomy of before the pictures.
            expect(tab.page.get_by_test_id("goal")).to_be_visible()
            if number == 1:
                tab.page.keyboard.press("r")
            else:
                tab.open("Learn")
                tab.choose("Exercise", "First view")
                tab.press("Start")
            tab.wait_until(lambda: _newest(calot, "calot").session.specimen.anatomy == before)
        tab.wait_until(lambda: _newest(calot, "calot").state.in_exercise)
        view = _newest(calot, "calot")
        assert view.session.run.exercise is not None
        assert view.session.run.exercise.name == "first_view"
        assert len(view.state.series.answers) == 2


def test_a_page_that_draws_slowly_gets_the_simple_picture_by_itself(
    browser: Browser, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.trainer.view.page_view.LEAST_PICTURES", 1000.0)  # none draws as many
    running = Trainer(phantom(), port=0, scene="calot", look="auto")
    try:
        running.warm_up.wait("calot")
        with scope_page(browser, running, 480, 360) as page:
            box = page.tab.page.get_by_role("checkbox", name="Simple picture")
            expect(box).to_be_checked()
            page.tab.wait_until(lambda: page.view.state.plain)
    finally:
        running.stop()


def test_an_exercise_asks_for_what_comes_next_and_counts_its_points(
    calot: Trainer, browser: Browser
) -> None:
    """In one line that nothing moves for, to a screen reader too, until all points are there."""
    with scope_page(browser, calot) as page:
        tab, view = page.tab, page.view
        session, lead = view.session, view._lead
        assert lead is not None
        goal, asks = (tab.page.get_by_test_id(each) for each in ("goal", "next"))
        tabs = tab.page.get_by_role("tablist")
        expect(goal).to_have_text(GOAL)
        # A run that is not there yet, or is still judged, is not replayed: the page says why.
        replay = tab.page.get_by_role("button", name="Replay this run")
        tab.open("Replay")
        expect(tab.page.get_by_text(NO_RUN)).to_be_visible()
        expect(replay).to_be_disabled()
        tab.open("Learn")
        tab.choose("Exercise", "First view")
        tab.press("Start")
        expect(asks).to_contain_text("Next: part the tissue between cystic duct and common duct")
        place = tabs.bounding_box()
        # Who leads the other hand, or has another instrument, is told the key.
        for key, other in (("x", "(X leads it.)"), ("n", "(N takes it.)")):
            expect(asks).not_to_contain_text(other)
            tab.page.keyboard.press(key)
            expect(asks).to_contain_text(other)
            assert tabs.bounding_box() == place
            tab.page.keyboard.press(key)
        expect(asks).not_to_contain_text("(N takes it.)")
        tab.open("Replay")
        expect(tab.page.get_by_text(AFTER_EXERCISE)).to_be_visible()
        expect(replay).to_be_disabled()
        tab.open("Learn")
        session.open_jaws(1, 0.1)  # with which the run begins
        session.open_jaws(1, 0.0)
        # What the hands part is parted here at once: the long tests have hands.
        state = tab.page.get_by_test_id("exercise-state")
        expect(state).to_contain_text("0 of 6 points")
        parts: list[tuple[Part, str]] = [
            ("triangle", "take hold of the gallbladder"),
            ("plate", ""),
        ]
        for part, asked in parts:
            safety = Safety(session.spatial)
            strands = np.flatnonzero(safety.lacking(part))[: -20 if asked else None]
            with session.lock:
                session.spatial.beam.detach(
                    np.isin(np.arange(safety.tissue.beam.order.size), strands)
                )
            # While nothing moves, nothing is judged.
            tip = session.spatial.hands[1].place
            session.move_hand(1, tip + 40.0 * TROCARS[1].shaft(tip))
            if not asked:
                break
            expect(asks).to_contain_text(asked)
            expect(tab.page.get_by_role("status")).to_contain_text(asked)
            expect(state).to_contain_text("2 of 6 points")
            assert tabs.bounding_box() == place
            # By a key, or clicked, the tip goes there by itself, and takes hold there.
            lead.choose(0)
            tab.page.keyboard.press("i")
            tab.wait_until(lambda: lead.asked.in_ring and lead._seeks is None, 60.0)
            for _ in range(6):
                tab.page.keyboard.press("Shift+ArrowDown")
            tab.wait_until(lambda: not lead.asked.in_ring, 60.0)
            step = lead.asked.step
            assert step is not None
            assert step.place is not None
            page.click(np.array(step.place))
            tab.wait_until(lambda: lead.asked.in_ring, 60.0)
            tab.page.keyboard.press("g")
            expect(asks).to_contain_text("draw the gallbladder off the liver")
        tab.wait_until(lambda: session.run.over, 60.0)
        expect(tab.page.get_by_role("dialog")).to_contain_text("Reached 3 of 6 points")
        expect(goal).to_have_text(GOAL)


def test_a_right_angle_s_tip_is_turned_by_keys_and_buttons(
    calot: Trainer, drawing_browser: Browser
) -> None:
    """The picture shows it, and the run logs each turn."""
    with scope_page(drawing_browser, calot) as page:
        tab, session = page.tab, page.view.session
        tab.press("Right hand")
        tab.choose("Right hand", "right angle")
        tab.wait_until(lambda: session.spatial.hands[1].instrument == "right angle")
        hand = session.spatial.hands[1]
        # Keys are keys again, and not letters of the list that was chosen from.
        tab.wait_until(lambda: tab.page.evaluate("() => document.activeElement === document.body"))

        def drawn() -> float:
            return tab.page.evaluate("() => bluntdissectScope.picture.state.hand(1).roll")

        def turned_to(angle: float) -> None:
            """Wait until the tip is drawn turned by an angle, rad, from where it began."""
            tab.wait_until(lambda: abs(math.remainder(drawn() - begun - angle, math.tau)) < 0.01)

        # It is bent off its shaft by then.
        tab.wait_until(lambda: abs(float(TROCARS[1].shaft(hand.place) @ np.array(hand.aim))) < 1e-6)
        tab.wait_until(lambda: abs(drawn() - _roll(TROCARS[1], hand)) < 1e-4)
        begun, before = drawn(), page.pixels()
        for _ in range(3):
            tab.page.keyboard.press("l")
        turned_to(3 * TURN)
        assert (np.abs(page.pixels() - before).max(axis=2) > 40.0).sum() > 100
        for _ in range(2):
            tab.page.keyboard.press("j")
        turned_to(TURN)
        row = tab.page.get_by_role("group", name="Turn")
        for name, angle in (("Left", 0.0), ("Left", -TURN), ("Right", 0.0)):
            row.get_by_role("button", name=name, exact=True).click()
            turned_to(angle)
        kept = session.run_file()
        turns = [each for each in kept.log.inputs if each.kind == "aim" and each.hand == 1]
        assert len(turns) >= 8
        replay = Replay(kept.log, session.tissue.dissection.organ)
        replay.seek(replay.duration)
        assert replay.session.spatial.hands[1].aim == hand.aim


# Frames are read no more; of the artery alone, pulled apart at its torn element, the place of a
# node, and both ends; `drawn` is whether it is drawn at all.
TORN_APART = """drawn => { const p = bluntdissectScope.picture, { state } = p;
    const number = p.tubes.findIndex(each => each.tube.name === "artery");
    const { tube, uniforms } = p.tubes[number], torn = Math.floor(tube.count / 2);
    const at = i => state.rows.subarray(4 * (tube.first + i), 4 * (tube.first + i) + 3);
    if (state.head[60] !== number + 1) {
        state.take = () => { state.frames++; };
        state.head = state.head.slice();
        state.head.set([number + 1, torn], 60);
        for (let i = torn + 1; i < tube.count; i++) at(i)[1] += 14;
        state.nodeTexture.needsUpdate = true;
    }
    p.version = -1;
    for (const mesh of p.meshes) mesh.visible = drawn && mesh.material.uniforms === uniforms;
    const beyond = (a, b) => Array.from(a, (x, k) => x + 0.38 * (x - b[k]));
    return [Array.from(at(torn - 1)), beyond(at(torn), at(torn - 1)),
        beyond(at(torn + 1), at(torn + 2))]; }"""

# How many lumps hang while all is whole, once what is near the artery's middle has parted, and
# again; and how far each is from the axis of the tube that is nearest, less that one's radius, mm.
LUMPS = """() => { const { state, sheet } = bluntdissectScope.picture;
    const hung = () => { sheet.drape(state); const all = new bluntdissectScope.Lumps(sheet);
        all.hang(sheet); return [...all.places.subarray(0, 4 * all.count)]; };
    state.take = () => { state.frames++; };
    const artery = state.tubes.find(each => each.name === "artery");
    const tubes = state.tubes.filter(each => !each.bare);
    const [x, y] = state.at(artery, artery.count / 2), whole = hung().length / 4;
    for (let i = 0; i < state.count; i++)
        if (Math.hypot(state.ends[8 * i] - x, state.ends[8 * i + 1] - y) < 14) state.parted[i] = 1;
    const first = hung(), second = hung(), off = [];
    for (let n = 0; n < first.length; n += 4) off.push(Math.min(...tubes.flatMap(tube =>
        Array.from({ length: 4 * tube.count }, (_, s) => state.at(tube, s / 4)).map(
            ([a, b, , r]) => Math.hypot(a - first[n], b - first[n + 1]) - r))));
    return [whole, first, second, off]; }"""
PARTED = (
    """() => { const p = bluntdissectScope.picture; p.state.parted.fill(1); p.stale = true; }"""
)


def test_what_fat_covered_is_seen_and_lumps_hang_at_its_rim(
    calot: Trainer, drawing_browser: Browser
) -> None:
    """By the strands alone: none while all are whole, and the same whenever the same have parted;
    none lies on a tube, whose pixels are seen."""
    with scope_page(drawing_browser, calot) as page:
        beam = page.view.session.spatial.beam

        def redness() -> float:
            """Of the pixels where the artery is."""
            picture, places = page.pixels(), beam.places_at(np.arange(6.0, 16.0), "artery")
            toward = page.camera.axes[:, 2]  # its wall is 1 mm before its axis
            return float(np.median([red(page.at(picture, each + toward)) for each in places]))

        beside, far = page.tab.page.evaluate(SHADES)
        assert beside < 0.7
        assert far > 0.9
        before = redness()
        whole, first, second, off = page.tab.page.evaluate(LUMPS)
        assert whole == 0
        assert len(first) > 4 * 10
        assert first == second
        assert min(off) > 1.0  # mm
        page.tab.page.evaluate(PARTED)
        page.tab.wait_until(lambda: redness() > 1.3 * before, 60.0)


def test_nothing_is_drawn_between_the_ends_of_a_torn_tube(
    calot: Trainer, drawing_browser: Browser
) -> None:
    """Its wall, which is one surface, does not span the gap, however far they are drawn apart."""
    with scope_page(drawing_browser, calot) as page:
        node, one, other = np.array(page.tab.page.evaluate(TORN_APART, True))
        drawn = page.pixels()
        page.tab.page.evaluate(TORN_APART, False)
        empty = page.pixels()
        assert np.abs(page.at(drawn, node) - page.at(empty, node)).max() > 30.0
        assert math.dist(one, other) > 5.0
        for part in np.linspace(0.25, 0.75, 6):
            place = one + part * (other - one)
            assert np.abs(page.at(drawn, place) - page.at(empty, place)).max() < 2.0
