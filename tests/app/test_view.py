"""A view that nobody can lose, a duct that a tab keeps, dialogs that close, a page for everyone."""

import re
from itertools import pairwise, product

import numpy as np
import pytest
from axe import no_faults
from browser import (
    CAMERA_NEAR,
    RADIUS,
    TrainerPage,
    _newest,
    newest,
    settle,
    stage_pixel,
    stands_still,
    trainer_page,
)
from playwright.sync_api import Browser, Page, expect

from app.simulation import Session
from app.trainer.client.practice import SCENES, SceneName
from app.trainer.server.trainer import Trainer


def drag(tab: TrainerPage, start: tuple[float, float], end: tuple[float, float]) -> None:
    tab.page.mouse.move(*start)
    for step in np.linspace(0.1, 1.0, 8):
        tab.page.mouse.move(*(np.array(start) + step * np.subtract(end, start)))
        tab.next_picture()


@pytest.mark.long  # the camera comes to rest in software
def test_view_stays_above_the_bed_and_comes_home(browser: Browser, trainer: Trainer) -> None:
    with trainer_page(browser, trainer.address, width=900, height=600) as tab:
        page, mouse = tab.page, tab.page.mouse
        view = newest(trainer)
        at_home = tab.wait_for_camera(view, free=True)
        page.keyboard.down("a")  # viser walks by letters
        for _ in range(20):
            tab.next_picture()
        page.keyboard.up("a")
        np.testing.assert_allclose(tab.rest(), at_home, atol=CAMERA_NEAR)
        exits = (
            lambda: tab.press("View home (V)"),
            lambda: page.keyboard.press("v"),
            lambda: tab.press("Reset (R)"),
        )
        for go_home in exits:
            for button in ("left", "right"):
                mouse.move(60, 500)
                mouse.down(button=button)
                drag(tab, (60, 500), (480, 80))
                mouse.up(button=button)
            for _ in range(25):
                mouse.wheel(0, -400)
            place, target = tab.rest()
            assert np.linalg.norm(place - at_home[0]) > 10.0
            assert place[2] >= 2.0 * RADIUS - 0.01
            assert np.linalg.norm(place - target) >= 6.0 * RADIUS - 0.01
            assert np.all(target >= (-5.2, -5.2, -RADIUS - 0.1))
            assert np.all(target <= (56.0, 5.2, 25.5))
            go_home()
            home = tab.wait_for_camera(view, free=True)
            np.testing.assert_allclose(home, at_home, atol=CAMERA_NEAR)


def test_a_press_beside_the_duct_takes_it_and_a_finger_is_wider_than_a_mouse(
    browser: Browser, trainer: Trainer
) -> None:
    with trainer_page(browser, trainer.address, width=900, height=600) as tab:
        page, session = tab.page, newest(trainer).session
        tab.wait_for_node("grip")
        at_home = tab.wait_for_camera(newest(trainer), free=True)
        x, middle = stage_pixel(tab, (15.0, 0.0, 0.0))
        edge = stage_pixel(tab, (15.0, 0.6 * RADIUS, 0.8 * RADIUS))[1]  # as the duct is seen
        tab.aim((x, edge))
        reach = {
            kind: page.evaluate(
                """([x, y, pointerType]) => {
                    const canvas = window.__viserMutable.canvas;
                    let far = 0;
                    for (let away = 0; away < 90; away++) {
                        canvas.dispatchEvent(new PointerEvent("pointermove", {
                            clientX: x, clientY: y - away, bubbles: true, pointerType}));
                        if (getComputedStyle(canvas).cursor === "pointer") far = away;
                    }
                    return far;
                }""",
                [x, edge, kind],
            )
            for kind in ("mouse", "touch")
        }
        assert 4 <= reach["mouse"] <= 20
        assert 16 <= reach["touch"] <= 34  # and as much on the other side: a finger's width
        tab.aim((x, edge - 4.0))
        page.mouse.down()
        drag(tab, (x, edge - 4.0), (x, edge - 40.0))
        tab.wait_until(lambda: session.reading().by_hand)
        line = page.evaluate(
            "() => { const found = window.__viserMutable.scene.children"
            ".find(child => child.line && child.cone);"
            " return [found.visible, found.line.visible, found.cone.visible]; }"
        )
        page.mouse.up()
        assert line == [True, False, False]  # viser's line is drawn to every hand
        np.testing.assert_allclose(tab.rest(), at_home, atol=1e-3)

        page.keyboard.press("t")
        tab.wait_for_phase("torn")
        tab.wait_until(lambda: stands_still(session))  # the pieces have stopped swinging
        stump = stage_pixel(tab, (42.0, 0.0, 0.0))
        tab.aim(stump)
        page.mouse.down()
        drag(tab, stump, (stump[0], middle - 60.0))
        page.mouse.up()
        expect(page.get_by_text("A torn duct holds no pull")).to_have_count(1)
        np.testing.assert_allclose(tab.rest(), at_home, atol=1e-3)


def test_a_second_tab_leaves_the_first_its_duct(browser: Browser, trainer: Trainer) -> None:
    with trainer_page(browser, trainer.address, width=640, height=480) as tab:
        tab.slide("Force F (N)", 1.5)
        tab.wait_for_force(1.5)
        first = newest(trainer)
        second = tab.page.context.new_page()
        second.goto(f"{trainer.address}/?fixedDpr=1")
        tab.wait_until(lambda: newest(trainer) is not first)
        assert newest(trainer).session is not first.session
        second.close()
        tab.wait_until(lambda: len(trainer.frames) == 1)
        tab.page.reload()
        tab.wait_for_force(1.5)
        tab.wait_until(lambda: newest(trainer) is not first)
        assert newest(trainer).session is first.session


@pytest.mark.parametrize("size", [(1024, 560), (390, 844)])
def test_dialogs_close_in_every_way_and_nothing_covers_them(
    browser: Browser, trainer: Trainer, size: tuple[int, int]
) -> None:
    width, height = size
    with trainer_page(
        browser, trainer.address, width=width, height=height, first_minute=True
    ) as tab:
        page, dialog = tab.page, tab.page.get_by_role("dialog")
        dialog.wait_for()
        page.keyboard.press("Escape")
        expect(dialog).to_have_count(0)
        newest(trainer).state.refuse("A notice that lies over the picture, and over no dialog.")
        tab.press("Help")
        dialog.wait_for()
        cross = dialog.get_by_role("button", name="Close", exact=True)

        def stands() -> None:
            """At the end of its text, once it has come in."""
            dialog.evaluate("dialog => { dialog.scrollTop = dialog.scrollHeight; }")
            place, frame = cross.bounding_box(), dialog.bounding_box()
            assert place is not None
            assert frame is not None
            assert place["width"] >= 24.0
            assert place["height"] >= 24.0
            assert place["y"] >= 0.0
            assert place["x"] + place["width"] <= width
            assert frame["y"] + frame["height"] <= height
            assert page.evaluate(
                """frame => {
                    const inside = [];
                    for (const right of [0.05, 0.5, 0.95]) for (const down of [0.02, 0.5, 0.98])
                        inside.push(document.elementFromPoint(
                            frame.x + right * frame.width, frame.y + down * frame.height));
                    return inside.every(element => element?.closest("[role=dialog]"));
                }""",
                frame,
            )

        tab.eventually(stands)
        cross.click()
        expect(dialog).to_have_count(0)
        tab.press("Help")
        dialog.wait_for()
        # What lies beside it comes in with it, and takes the press once it is there.
        beside = "y => document.elementFromPoint(4, y)?.closest('.mantine-Modal-root')"
        page.wait_for_function(beside, arg=height // 2)
        page.mouse.click(4, height // 2)
        expect(dialog).to_have_count(0)


@pytest.mark.parametrize("widths", [(320, 390), (1280,)], ids=["phone", "desk"])
def test_tabs_stand_in_one_row_with_any_font(
    browser: Browser, trainer: Trainer, widths: tuple[int, ...]
) -> None:
    with trainer_page(browser, trainer.address, width=widths[0], height=700) as tab:
        for width, font in product(widths, ("inherit", "DejaVu Sans Mono")):
            tab.page.set_viewport_size({"width": width, "height": 700})
            tab.page.add_style_tag(content=f"[role=tab] * {{font-family:{font!r}!important}}")
            tab.open("Train")

            def in_one_row() -> None:
                tabs = [each.bounding_box() for each in tab.page.get_by_role("tab").all()]
                boxes = [each for each in tabs if each is not None]
                assert len(boxes) == 6
                assert len({each["y"] for each in boxes}) == 1
                for left, right in pairwise(boxes):
                    assert left["x"] + left["width"] <= right["x"] + 0.5

            tab.eventually(in_one_row)
            tab.open("Model")  # brought into view where the row scrolls
            expect(tab.page.get_by_role("tab", name="Model")).to_have_attribute(
                "aria-selected", "true"
            )
        expect(tab.page.locator(".tabler-icon-adjustments")).to_be_hidden()  # viser's settings


STARTS: dict[SceneName, tuple[str, ...]] = {"calot": ("x", "ArrowUp"), "bed": ("g", "ArrowUp")}
"""Keys by which a hand begins a run."""


@pytest.mark.parametrize(
    "scene", ["calot", *(pytest.param(each, marks=pytest.mark.long) for each in ("bed", "free"))]
)
def test_axe_finds_nothing_on_any_tab_or_dialog(
    browser: Browser, trainer: Trainer, scene: SceneName
) -> None:
    with trainer_page(browser, trainer.address, first_minute=True) as tab:
        page, dialog = tab.page, tab.page.get_by_role("dialog")
        no_faults(tab, "first minute")
        expect(dialog.get_by_role("button", name="Begin")).to_be_focused()
        page.keyboard.press("Escape")
        expect(dialog).to_have_count(0)
        if scene != "free":
            tab.press(SCENES[scene].label)
        view = _newest(trainer, scene)
        tabs = page.get_by_role("tab")
        expect(tabs).to_have_count(3 if scene == "calot" else 6)
        for name in (*tabs.all_text_contents()[1:], "Train"):
            tab.open(name)
            no_faults(tab, name)
        tab.press("Help")
        dialog.wait_for()
        no_faults(tab, "Help")
        page.keyboard.press("Escape")
        expect(dialog).to_have_count(0)
        page.keyboard.press("h")
        if scene == "free":
            page.keyboard.press("t")
            tab.wait_for_phase("torn")
            no_faults(tab, "torn, in the colours of its stress")
        else:
            for key in STARTS[scene]:
                page.keyboard.press(key)
            tab.wait_until(lambda: view.session.run.started)
            page.keyboard.press("r")
        tab.open("Learn")
        tab.press("Result of the last run")
        dialog.wait_for()
        for name in dialog.get_by_role("tab").all_text_contents():
            dialog.get_by_role("tab", name=name).click()
            no_faults(tab, f"Result, {name}")
        page.keyboard.press("Escape")
        expect(dialog).to_have_count(0)


@pytest.mark.long  # axe-core reads whole pages
def test_axe_finds_nothing_in_a_series_of_pictures(browser: Browser, trainer: Trainer) -> None:
    with trainer_page(browser, trainer.address) as tab:
        page, dialog = tab.page, tab.page.get_by_role("dialog")
        tab.press(SCENES["calot"].label)
        view = _newest(trainer, "calot")
        tab.open("Learn")
        expect(page.get_by_role("button", name="Start", exact=True)).to_be_enabled()
        tab.choose("Exercise", "Who is who")
        tab.press("Start")
        tab.wait_until(lambda: view.state.in_exercise)
        no_faults(tab, "a picture")
        tab.press("Not yet safe")
        dialog.wait_for()
        for name in dialog.get_by_role("tab").all_text_contents():
            dialog.get_by_role("tab", name=name).click()
            no_faults(tab, f"Result of a picture, {name}")


def message(tab: TrainerPage) -> str:
    return tab.page.locator("#bd-status").text_content() or ""


def test_arrows_pull_by_percents_letters_can_rest_and_only_changes_are_said(
    browser: Browser, trainer: Trainer
) -> None:
    with trainer_page(browser, trainer.address) as tab:
        page, session = tab.page, newest(trainer).session
        event = session.reading().breaks_at
        assert event is not None
        expect(tab.readout).not_to_have_attribute("role", re.compile("status|alert"))
        expect(page.locator("[aria-live], [role=status], [role=log]")).to_have_count(1)
        slider = page.get_by_role("slider", name="Force F (N)")
        slider.focus()
        still = tab.rest()
        for keys, percent in (
            (["ArrowRight"] * 3, 3.0),
            (["Shift+ArrowUp"] * 4, 3.4),
            (["ArrowLeft", "Shift+ArrowDown"], 2.3),
        ):
            for key in keys:
                page.keyboard.press(key)
            wanted = 0.01 * percent * event.force
            tab.wait_until(lambda force=wanted: _wished(session) == pytest.approx(force, abs=6e-4))
        np.testing.assert_array_equal(tab.rest(), still)  # the arrows are the slider's own
        tab.wait_until(lambda: message(tab) == "Safe")
        tab.slide("Force F (N)", round(0.7 * event.force, 3))
        tab.wait_until(lambda: message(tab) == "Careful")

        tab.press("Help")
        tab.tick("Letter keys")
        tab.wait_until(lambda: kept(tab, "letter-keys") == "off")
        page.keyboard.press("Escape")
        expect(page.get_by_role("dialog")).to_have_count(0)
        page.keyboard.press("r")
        settle(tab, trainer, newest(trainer).client)
        assert _wished(session) > 2.0
        tab.press("Help")
        expect(page.get_by_role("checkbox", name="Letter keys")).not_to_be_checked()
        tab.tick("Letter keys")
        tab.wait_until(lambda: kept(tab, "letter-keys") == "on")
        page.keyboard.press("Escape")
        expect(page.get_by_role("dialog")).to_have_count(0)
        page.keyboard.press("r")
        tab.wait_until(lambda: message(tab) == "Safe")


def kept(tab: TrainerPage, name: str) -> str | None:
    """What the browser has stored for the trainer."""
    return tab.page.evaluate("name => localStorage.getItem('viser-user:' + name)", name)


def _wished(session: Session) -> float:
    return session.planar.grasper.slider_force


SMALL = """() => [...document.querySelectorAll(
        "button, input:not([type=hidden]):not([type=file]), [role=slider], [role=tab],"
        + " summary")]
    .filter(element => element.checkVisibility({visibilityProperty: true})
        && !element.closest("[inert]") && element.offsetWidth)
    .filter(element => {
        const box = element.getBoundingClientRect();
        const more = getComputedStyle(element, "::after");
        const wide = box.width - 2 * (parseFloat(more.left) || 0);
        const high = box.height - 2 * (parseFloat(more.top) || 0);
        return Math.min(wide, high) < 23.9;
    }).map(element => element.outerHTML.slice(0, 160))"""


def no_small_target(page: Page, where: str) -> None:
    assert page.evaluate(SMALL) == [], where


def test_targets_are_large_enough_and_motion_is_reduced_where_that_is_wanted(
    browser: Browser, trainer: Trainer
) -> None:
    with trainer_page(browser, trainer.address) as tab:
        page = tab.page
        page.emulate_media(reduced_motion="reduce")
        for name in ("Train", "Learn", "Compare", "Replay", "Build", "Model"):
            tab.open(name)
            tab.eventually(lambda name=name: no_small_target(page, name), 30.0)
        moving = page.evaluate(
            """() => [...document.querySelectorAll("*")].filter(element =>
                getComputedStyle(element).transitionDuration.split(",")
                    .some(each => parseFloat(each) > 0.001)).length"""
        )
        assert moving == 0
