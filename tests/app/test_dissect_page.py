"""A duct in its bed in a real browser: hands, read-out, tear, bed, and the page's two modes."""

import itertools
import re
import threading
from collections.abc import Callable, Iterator
from itertools import chain, repeat
from typing import Literal

import numpy as np
import pytest
from axe import faults
from browser import TrainerPage, catch_up, newest, newest_dissection, stop_time, trainer_page
from playwright.sync_api import Browser, expect
from projection import picture_points
from simulated import bed_exercises, bed_session, phantom

from app.simulation import (
    ERROR_CLASSES,
    MANNERS,
    Feedback,
    Hand,
    Incident,
    Outcome,
    Replay,
    Series,
    Session,
    bed_named,
    cause_of,
    perform,
)
from app.trainer.client.page_state import NUDGE
from app.trainer.client.replay_playback import LivePlayback, ReplayPlayback
from app.trainer.panel.debrief import next_time
from app.trainer.panel.page_panel import PagePanel
from app.trainer.scene import drag_proxy
from app.trainer.scene.tissue_scene import TissueScene
from app.trainer.server.trainer import Trainer
from app.trainer.stage.camera import Viewpoint
from app.trainer.view.page_view import PageView


@pytest.fixture(scope="module")
def dissections() -> Iterator[Trainer]:
    """A trainer as it starts by itself, in the plain look."""
    running = Trainer(phantom(), port=0, look="plain")
    running.warm_up.wait("bed")
    yield running
    running.stop()


def pixel(tab: TrainerPage, view: PageView, place: np.ndarray) -> tuple[float, float]:
    """Where a place of the duct's frame is in the window, px."""
    canvas = tab.page.locator("canvas[data-engine]").bounding_box()
    assert canvas is not None
    camera = view.client.camera
    seen = Viewpoint(camera.position, camera.look_at, camera.up_direction, camera.fov)
    aspect = canvas["width"] / canvas["height"]
    right, up = picture_points(seen, place[None], aspect)[0]
    return (
        canvas["x"] + 0.5 * (1.0 + right) * canvas["width"],
        canvas["y"] + 0.5 * (1.0 - up) * canvas["height"],
    )


def drag(
    tab: TrainerPage,
    trainer: Trainer,
    view: PageView,
    place: np.ndarray,
    direction: tuple[float, float],
    button: Literal["left", "right"] = "left",
) -> None:
    """Press at a place of the duct's frame and move the mouse by pixels, without letting go."""
    tab.wait_for_node("grip")
    tab.wait_for_camera(view)
    catch_up(tab, trainer, view.client)  # what was there before could be taken in its place
    start = pixel(tab, view, place)
    mouse = tab.page.mouse
    tab.aim(start)
    mouse.down(button=button)
    for step in range(1, 9):
        mouse.move(start[0] + direction[0] * step / 8, start[1] + direction[1] * step / 8)
        tab.next_picture()


REACHED = """() => {
    window.reached = [];
    document.documentElement.addEventListener("keydown", ({key, timeStamp}) => {
        window.reached.push([key, timeStamp]);
    });
}"""
"""Keeps keys, and when in ms, that are not stopped on their way to what acts on them."""
LINES = """name => {
    let found = null;
    window.__viserMutable.nodeRefFromName[name].traverse(node => {
        if (node.geometry?.attributes.instanceStart) found = node.geometry.attributes;
    });
    return Array.from(found.instanceStart.data.array);
}"""
"""Start and end, mm, of each line of a node, as the page draws it."""


def still(session: Session) -> bool:
    """Whether both hands are where they are wanted."""
    return all(hand.arrived for hand in session.spatial.hands)


def playback(view: PageView) -> ReplayPlayback | LivePlayback:
    found = view.state.playback
    assert found is not None
    return found


def offered(view: PageView) -> bool:
    """Whether the page offers its exercises."""
    panel = view._panel
    assert isinstance(panel, PagePanel)
    return bool(panel.exercises._offered)


def aside(view: PageView, station: float) -> np.ndarray:
    """A place of the duct's wall that the viewer sees and no instrument covers."""
    radius = view.session.tissue.dissection.organ.mean_radius
    return np.array([station, -0.7 * radius, 0.0])


def test_a_drag_lifts_the_duct_off_its_bed_and_the_read_out_tells_what_it_cost(
    browser: Browser, dissections: Trainer
) -> None:
    with trainer_page(browser, dissections.address) as tab:
        view = newest_dissection(dissections)
        session = view.session
        drag(tab, dissections, view, aside(view, 20.0), (0.0, -70.0))
        tab.wait_until(lambda: session.reading().broken > 20 and still(session))
        assert session.reading().torn_at is None
        assert session.reading().holding == (True, False)
        node = session.spatial.hands[0].node
        assert session.spatial.beam.stations[node] == pytest.approx(20.0, abs=1.5)
        # Up in the picture is straight up off the bed, though the camera looks down on it.
        across, up = session.spatial.hands[0].target[1:]
        assert up > 3.0
        assert across == pytest.approx(0.0, abs=0.05)

        def shown() -> None:
            reading = session.reading()
            for name, value in {
                "distance-to-break": reading.distance_to_break,
                "freed-mm": reading.freed,
                "parted": reading.broken,
                "peak": reading.peak_stress_ratio,
                "worst-mm": reading.check.station,
                "force-left-n": np.linalg.norm(reading.forces[0]),
                "force-right-n": 0.0,
                "into-strands-mj": reading.energy.dissipated,
                "work-mj": reading.energy.work,
            }.items():
                assert tab.figure(name) == pytest.approx(value, rel=1e-4, abs=1e-9), name
            ((ago, left, right, distance, limit),) = tab.charts()
            assert ago[-1] == 0.0
            assert len(ago) > 5
            assert left[-1] == pytest.approx(np.linalg.norm(reading.forces[0]), rel=1e-4)
            assert set(right) == {0.0}
            assert distance[-1] == pytest.approx(100.0 * reading.distance_to_break, rel=1e-4)
            assert set(limit) == {None}

        tab.eventually(shown)
        reading = session.reading()
        assert reading.torn_at is None
        assert reading.forces[0][2] > 0.1
        expect(tab.readout).to_contain_text(f"of {reading.strands}")

        # The hook lets go with the mouse; what has parted stays parted.
        tab.page.mouse.up()
        tab.wait_until(lambda: session.reading().holding == (False, False))
        tab.wait_until(lambda: session.reading().stress_ratio < 0.3)
        parted = session.reading().broken
        assert parted >= reading.broken
        assert session.reading().peak_stress_ratio >= reading.peak_stress_ratio

        # It takes hold again elsewhere, and is led along the duct.
        drag(tab, dissections, view, aside(view, 32.0), (25.0, -25.0))
        tab.wait_until(lambda: session.reading().holding == (True, False))
        assert session.spatial.held_at(0) == pytest.approx(32.0, abs=1.5)
        tab.wait_until(lambda: session.spatial.hands[0].place[0] > 33.0)
        assert session.reading().broken >= parted
        assert float(session.reading().forces[0][0]) > 0.0
        tab.page.mouse.up()
        tab.wait_until(lambda: session.reading().holding == (False, False))
        tab.tick("Plot")
        tab.wait_until(lambda: not tab.charts())


def test_a_grasper_stays_where_it_is_left_until_it_is_told_to_let_go(
    browser: Browser, dissections: Trainer
) -> None:
    with trainer_page(browser, dissections.address) as tab:
        view = newest_dissection(dissections)
        session, page = view.session, tab.page
        page.keyboard.press("x")  # the right hand, which has a grasper
        tab.wait_until(lambda: view.state.hand == 1)
        drag(tab, dissections, view, aside(view, 36.0), (0.0, -60.0))
        tab.wait_until(lambda: session.reading().forces[1][2] > 0.1)
        tab.wait_until(lambda: still(session) and session.spatial.hands[1].place[2] > 1.0)
        page.mouse.up()
        tab.wait_until(lambda: view.state._dragged is None and still(session))
        assert session.reading().holding == (False, True)
        left = session.spatial.hands[1].place.copy()
        assert left[2] > 1.0
        # The other hand works meanwhile.
        page.keyboard.press("x")
        tab.wait_until(lambda: view.state.hand == 0)
        drag(tab, dissections, view, aside(view, 12.0), (0.0, -50.0))
        tab.wait_until(lambda: session.reading().holding == (True, True))
        page.mouse.up()
        tab.wait_until(lambda: session.reading().holding == (False, True))
        tab.wait_until(lambda: view.state._dragged is None)
        np.testing.assert_array_equal(session.spatial.hands[1].place, left)
        # Two buttons stand in a row, with all their words, and leave room for the plot.
        let_go = page.get_by_role("button", name="Right hand: let go")
        words = let_go.locator(".mantine-Button-label")
        assert words.evaluate("label => label.scrollWidth <= label.clientWidth")
        middle = "each => (box => box.top + 0.5 * box.height)(each.getBoundingClientRect())"
        pause, reset = (page.get_by_role("button", name=each) for each in ("Pause", "Reset"))
        assert pause.evaluate(middle) == reset.evaluate(middle)
        assert page.locator(".uplot").evaluate(middle) < 800.0
        tab.press("Right hand: let go")
        tab.wait_until(lambda: session.reading().holding == (False, False))


def test_keys_lead_the_hand_and_open_the_jaws(browser: Browser, dissections: Trainer) -> None:
    with trainer_page(browser, dissections.address) as tab:
        view = newest_dissection(dissections)
        session, keyboard = view.session, tab.page.keyboard
        camera = view.client.camera.position.copy()

        def hand() -> Hand:
            return session.spatial.hands[0]

        before = hand().target.copy()
        for key, times in (("ArrowRight", 3), ("ArrowUp", 2), ("Shift+ArrowUp", 4)):
            for _ in range(times):
                keyboard.press(key)
        wanted = before + NUDGE * np.array([3.0, 4.0, 2.0])
        tab.wait_until(lambda: np.allclose(hand().target, wanted))
        keyboard.press("ArrowLeft")
        keyboard.press("ArrowDown")
        keyboard.press("Shift+ArrowDown")
        tab.wait_until(lambda: np.allclose(hand().target, wanted - NUDGE))
        np.testing.assert_allclose(view.client.camera.position, camera)

        keyboard.press("g")
        tab.wait_until(lambda: session.reading().holding[0])
        keyboard.press("g")
        tab.wait_until(lambda: not session.reading().holding[0])

        keyboard.press("o")
        expect(tab.page.get_by_text("Only a dissector opens")).to_be_visible()
        for _ in range(2):
            keyboard.press("n")
        tab.wait_until(lambda: session.spatial.hands[0].instrument == "dissector")
        for _ in range(5):
            keyboard.press("o")
        tab.wait_until(lambda: hand().target_opening == 10.0 * NUDGE)
        keyboard.press("c")
        tab.wait_until(lambda: tab.slider("Jaws (mm)") == 8.0 * NUDGE)

        # Held down, keys of the jaws act evenly, and others once.
        tab.page.evaluate(REACHED)
        for key in ("o", "x"):
            for _ in range(30):
                keyboard.down(key)
            keyboard.up(key)
        reached = tab.page.evaluate("window.reached")
        opened = [at for key, at in reached if key == "o"]
        assert len(reached) == len(opened) + 1
        assert all(b - a >= 120.0 for a, b in itertools.pairwise(opened))
        tab.wait_until(lambda: hand().target_opening == 8.0 * NUDGE + len(opened))
        tab.wait_until(lambda: view.state.hand == 1)
        keyboard.press("x")
        tab.wait_until(lambda: view.state.hand == 0)
        session.open_jaws(0, 8.0 * NUDGE)  # however often it was
        tab.wait_until(lambda: still(session) and tab.slider("Jaws (mm)") == 8.0 * NUDGE)
        # Behind the duct, opening frees it, at a fraction of what its wall bears.
        session.move_hand(0, hand().place + np.array([0.0, 25.0, 0.0]))
        tab.wait_until(lambda: still(session))
        tab.slide("Jaws (mm)", 16.0)
        tab.wait_until(lambda: session.reading().broken > 60)
        assert session.reading().peak_stress_ratio < 0.3


def test_pause_and_colours_and_a_torn_duct_is_told_and_a_reset_makes_all_whole(
    browser: Browser, dissections: Trainer
) -> None:
    with trainer_page(browser, dissections.address) as tab:
        view = newest_dissection(dissections)
        tab.page.keyboard.press("p")
        tab.wait_until(lambda: view.state.paused)
        expect(tab.readout).to_contain_text("Paused: safe")
        tab.press("Go on (P)")
        tab.wait_until(lambda: not view.state.paused)
        stress = tab.page.get_by_test_id("heat-legend")
        freed = tab.page.get_by_test_id("freed-legend")
        tab.page.keyboard.press("h")
        expect(stress).to_be_visible()
        expect(tab.page.get_by_role("button", name="Stress", exact=True)).to_have_attribute(
            "aria-pressed", "true"
        )
        tab.press("Freed")
        expect(freed).to_be_visible()
        expect(stress).to_have_count(0)
        tab.press("Tissue")
        expect(freed).to_have_count(0)

        session = view.session
        place = session.grab(0, 25.0)
        assert place is not None
        session.move_hand(0, place + np.array([0.0, 0.0, 40.0]))
        tab.wait_for_phase("torn")
        at = session.reading().torn_at
        notice = tab.page.get_by_text(f"It tore {at:.1f} mm from the left clamp", exact=False)
        expect(notice).to_be_visible()
        expect(tab.readout).to_contain_text("torn")
        tab.wait_for_node("first_piece")
        tab.page.keyboard.press("g")  # nothing can be held now
        expect(tab.page.get_by_text("A torn duct holds no pull")).to_be_visible()
        tab.press("Reset (R)")
        tab.wait_for_phase("intact")
        expect(notice).to_have_count(0)
        reading = session.reading()
        assert (reading.broken, reading.freed, reading.peak_stress_ratio) == (0, 0.0, 0.0)
        tab.wait_for_node("skin")


def test_the_address_says_what_a_page_opens_on_and_a_bed_is_chosen_with_source_and_number(
    browser: Browser, dissections: Trainer
) -> None:
    with trainer_page(browser, dissections.address, query="&scene=free") as tab:
        expect(tab.page.get_by_role("tab", name="Compare")).to_be_visible()
        newest(dissections)
        tab.press("A duct in its bed")
        view = newest_dissection(dissections)
        session, firm = view.session, bed_named("firm")
        tab.open("Model")
        tab.choose("Bed", firm.title)
        tab.wait_until(lambda: session.spatial.bed == firm)
        expect(tab.page.get_by_text(firm.source.split(",")[0])).to_be_visible()
        expect(tab.page.get_by_text(f"Confidence: {firm.confidence}").first).to_be_visible()
        tab.slide("Bed's number", 7)
        tab.wait_until(lambda: session.specimen.bed_seed == 7)
        same = bed_session(phantom(), bed=firm, bed_seed=7)
        np.testing.assert_array_equal(
            session.spatial.beam.strands.stations, same.spatial.beam.strands.stations
        )
        expect(tab.page.get_by_test_id("duct")).to_contain_text(f"{firm.title}, bed 7")
        band = tab.readout.get_by_test_id("band")
        expect(band).to_have_count(0)
        tab.tick("90 % band")
        expect(band).to_contain_text("100 to 100 %, 90 % of ducts")  # at rest
        expect(tab.row("90 % band").locator("input")).to_be_checked()


def test_the_page_changes_between_dissect_and_pull_and_a_reload_finds_both(
    browser: Browser, dissections: Trainer
) -> None:
    with trainer_page(browser, dissections.address) as tab:
        session = newest_dissection(dissections).session
        tab.page.evaluate("window.before = true")
        place = session.grab(0, 20.0)
        assert place is not None
        session.move_hand(0, place + np.array([0.0, 0.0, 5.0]))
        tab.wait_until(lambda: still(session) and session.reading().broken > 0)
        parted = session.reading().broken

        tab.press("A free duct")
        tab.page.get_by_role("tab", name="Compare").wait_for()
        tab.wait_for_node("skin")
        pull = newest(dissections).session
        tab.slide("Force F (N)", 1.5)
        tab.wait_for_force(1.5)
        assert session.reading().broken == parted  # no time goes by for what is not shown
        assert tab.page.evaluate("window.before")  # it is the same page

        tab.page.reload()
        tab.wait_for_node("skin")
        tab.wait_for_force(1.5)
        assert newest(dissections).session is pull
        tab.press("A duct in its bed")
        assert newest_dissection(dissections).session is session
        tab.wait_until(lambda: tab.figure("parted") == parted)

        tab.page.reload()
        tab.page.get_by_role("button", name="Swab").first.wait_for()
        tab.wait_until(lambda: tab.figure("parted") == parted)
        assert newest_dissection(dissections).session is session


def test_shift_and_the_right_button_move_into_the_picture_and_a_finger_in_its_plane(
    browser: Browser, dissections: Trainer, monkeypatch: pytest.MonkeyPatch
) -> None:
    with trainer_page(browser, dissections.address) as tab:
        view = newest_dissection(dissections)
        session, page = view.session, tab.page

        def target() -> np.ndarray:
            return session.spatial.hands[0].target

        def held() -> bool:
            return session.reading().holding[0]

        page.keyboard.down("Shift")
        drag(tab, dissections, view, aside(view, 20.0), (0.0, -30.0))
        tab.wait_until(lambda: target()[1] > 0.8)
        assert target()[2] == pytest.approx(0.0, abs=0.2)
        # Without Shift the same drag goes on, now straight up off the bed; a page that draws
        # slowly takes its time to begin again.
        monkeypatch.setattr(drag_proxy, "SWITCH_SECONDS", 60.0)
        page.keyboard.up("Shift")
        # The page may begin it only at a move, from where the mouse is then.
        here = pixel(tab, view, target().copy())
        heights = chain(range(2, 60, 2), repeat(60))

        def risen() -> bool:
            page.mouse.move(here[0], here[1] - next(heights))
            return target()[2] > 0.5

        tab.wait_until(risen)
        assert held()
        monkeypatch.undo()
        page.mouse.up()
        tab.wait_until(lambda: not held())

        view.state.reset()
        drag(tab, dissections, view, aside(view, 20.0), (0.0, -30.0), button="right")
        tab.wait_until(lambda: held() and target()[1] > 0.8)
        assert target()[2] == pytest.approx(0.0, abs=0.2)
        page.mouse.up(button="right")
        tab.wait_until(lambda: not held())

        # So do drags without either, if the box says so.
        view.state.reset()
        tab.tick("Into the picture")
        tab.wait_until(lambda: view.state.into_picture)
        drag(tab, dissections, view, aside(view, 20.0), (0.0, -30.0))
        tab.wait_until(lambda: held() and target()[1] > 0.8)
        page.mouse.up()
        tab.tick("Into the picture")
        tab.wait_until(lambda: not view.state.into_picture and not held())

        view.state.reset()
        tab.wait_for_camera(view)
        catch_up(tab, dissections, view.client)
        camera = view.client.camera.position.copy()
        finger = page.context.new_cdp_session(page)
        x, y = pixel(tab, view, aside(view, 20.0))
        tab.aim((x, y))  # the duct is there again
        for step in range(9):
            kind = "touchMove" if step else "touchStart"
            points = [{"x": x, "y": y - 5.0 * step}]
            finger.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
            tab.next_picture()
        tab.wait_until(lambda: held() and target()[2] > 0.5)
        finger.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
        tab.wait_until(lambda: not held())
        np.testing.assert_allclose(view.client.camera.position, camera)


def test_an_exercise_is_done_judged_measured_and_replayed(
    browser: Browser, dissections: Trainer
) -> None:
    with trainer_page(browser, dissections.address) as tab:
        view = newest_dissection(dissections)
        session, page = view.session, tab.page
        tab.open("Learn")
        tab.wait_until(lambda: offered(view))
        exercise = next(iter(bed_exercises(session)))
        tab.choose("Exercise", exercise.title)
        tab.choose("Feedback", "Only in the result")
        view.state.show(colours="stress")
        tab.press("Start")
        expect(page.get_by_test_id("exercise-state")).to_contain_text("first touch")
        expect(page.get_by_test_id("task")).to_contain_text(exercise.caution)
        # Figures that are hidden are hidden everywhere, and no exercise is left by the way.
        tab.open("Train")
        page.locator("[data-testid=readout][data-hidden='1']").wait_for()
        expect(page.get_by_test_id("heat-legend")).to_have_count(0)
        tab.wait_until(lambda: not tab.charts())
        tab.press("A free duct")
        expect(page.get_by_text("An exercise goes on until it is over")).to_be_visible()
        assert newest_dissection(dissections) is view
        stop_time(tab, dissections, view)  # it goes by the hands' own ticks
        perform(session, MANNERS[exercise.name]["good"])
        outcome = page.get_by_test_id("outcome")
        outcome.wait_for()
        assert outcome.get_attribute("data-outcome") == "Passed"
        kept = view.state.last_run
        assert kept is not None
        expect(page.get_by_test_id("errors")).to_have_text("No errors were found in this run.")
        tab.open("Measures")
        row = page.locator("[data-measure=freed_mm]")
        assert float(row.get_attribute("data-value") or "nan") == kept.metrics["freed_mm"]
        # The script's own hands are the expert's: every figure beside is the same.
        expect(page.get_by_test_id("measures")).to_contain_text("expert")
        tried, expert = row.locator("td").all_inner_texts()[1:3]
        assert tried == expert
        tab.open("Over time")

        def charts() -> list[list[list[float | None]]]:
            """The result's: the one that goes on beside the dissection ends at 0 s ago."""
            return [rows for rows in tab.charts() if rows[0][-1]]

        tab.wait_until(lambda: len(charts()) == 3)
        distance, forces, freed = charts()
        assert freed[1][-1] == kept.metrics["freed_mm"]
        assert [len(rows) for rows in (distance, forces)] == [5, 6]
        assert forces[0][-1] == pytest.approx(kept.metrics["time_s"])
        assert distance[-1][0] == pytest.approx(
            100.0 * (1.0 - exercise.limit_of["peak_stress_ratio"])
        )
        tab.press("Watch it again")
        tab.wait_until(lambda: tab.slider("Time (s)") > 1.0)  # its end is known, too
        playback(view).pause()  # while it plays the field is written thirty times a second
        tab.wait_until(lambda: tab.slider("Time (s)") == round(playback(view).time, 2))
        tab.slide("Time (s)", 1e4)
        tab.wait_until(lambda: tab.figure("parted") == kept.metrics["strands_broken"])
        expect(tab.readout).to_contain_text("Replay")
        tab.press("Leave the replay")
        tab.wait_until(lambda: view.state.playback is None)
        # What was passed leads on to what is listed below it.
        following = bed_exercises(session)[1]
        tab.open("Learn")
        tab.press("Result of the last run")
        tab.press(f"Next: {following.title}")
        expect(page.get_by_test_id("task")).to_contain_text(following.caution)
        assert session.run.exercise == following


def test_a_ring_is_where_the_dissector_is_to_be_led(browser: Browser, dissections: Trainer) -> None:
    with trainer_page(browser, dissections.address) as tab:
        view = newest_dissection(dissections)
        session = view.session
        exercise = next(e for e in bed_exercises(session) if e.name == "window")
        view.state.start_exercise(exercise, Feedback.CONTINUOUS)
        tab.wait_for_path("/bed/move")

        def drawn() -> bool:
            """Whether the ring is round where it is asked for, and the line comes from the tip."""
            asked = session.holding
            if asked is None or asked.move.to is None:
                return False
            lines = np.array(tab.page.evaluate(LINES, "/bed/move")).reshape(-1, 6)
            ring, line = lines[:-1], lines[-1]
            tip = session.spatial.hands[1].place
            return np.allclose(ring[:, :3].mean(axis=0), asked.move.to, atol=1e-3) and np.allclose(
                line, [*tip, *asked.move.to], atol=1e-3
            )

        tab.wait_until(drawn)
        session.move_hand(1, session.spatial.hands[1].place + np.array([6.0, 0.0, 0.0]))
        tab.wait_until(lambda: still(session) and drawn())


def test_a_result_is_there_before_its_run_is_replayed(
    browser: Browser, dissections: Trainer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What the run itself has told needs no replay; what is closed is computed no further."""
    may_go_on, whole = threading.Event(), Replay.series

    def held(replay: Replay, look: Callable[[int], object] = lambda _: None) -> Series:
        may_go_on.wait()
        return whole(replay, look)

    def at_work() -> int:
        return dissections._workers.results.tasks_ahead_of(None)

    monkeypatch.setattr(Replay, "series", held)
    with trainer_page(browser, dissections.address) as tab:
        view = newest_dissection(dissections)
        session, page, dialog = view.session, tab.page, tab.page.get_by_role("dialog")
        exercise = next(e for e in bed_exercises(session) if e.name == "follow_front")
        view.state.start_exercise(exercise, Feedback.SUMMARY)
        stop_time(tab, dissections, view)
        perform(session, MANNERS["follow_front"]["clumsy"])
        page.get_by_test_id("outcome").wait_for()
        expect(page.get_by_test_id("error")).to_have_count(len(session.run.incidents()))
        waits = page.get_by_test_id("debrief").get_by_text("comes once the run is replayed")
        expect(waits).to_be_visible()
        dialog.get_by_role("tab", name="Measures").click()
        expect(dialog.get_by_role("button", name="Download CSV")).to_be_disabled()
        expect(dialog.get_by_role("button", name="Download JSON")).to_be_enabled()
        dialog.get_by_role("tab", name="Over time").click()
        expect(dialog).to_contain_text("The run is replayed for this")
        page.keyboard.press("Escape")
        expect(dialog).to_have_count(0)
        assert at_work() == 1
        may_go_on.set()
        tab.wait_until(lambda: at_work() == 0)
        tab.open("Learn")
        tab.press("Result of the last run")
        expect(page.get_by_test_id("timeline")).to_be_visible()
        expect(waits).to_have_count(0)
        expect(page.get_by_test_id("debrief-numbers")).to_contain_text("scripted expert")
        expect(dialog.get_by_role("button", name="Show me")).to_be_enabled()
        dialog.get_by_role("tab", name="Measures").click()
        expect(dialog.get_by_role("button", name="Download CSV")).to_be_enabled()
        page.keyboard.press("Escape")


def test_a_debrief_names_each_error_and_plays_its_moment_and_show_me_a_good_hand(
    browser: Browser, dissections: Trainer
) -> None:
    with trainer_page(browser, dissections.address, height=800) as tab:
        view = newest_dissection(dissections)
        session, page = view.session, tab.page
        exercise = next(e for e in bed_exercises(session) if e.name == "follow_front")
        tab.open("Learn")
        tab.wait_until(lambda: offered(view))
        tab.choose("Exercise", exercise.title)
        tab.press("Show me")
        tab.wait_until(lambda: view.state.playback is not None)
        shown = playback(view)
        assert isinstance(shown, ReplayPlayback)
        shown.seek(shown.duration)
        tab.wait_until(lambda: shown.at_end)
        outcome = shown.session.run.outcome
        assert outcome is not None
        assert outcome.passed
        assert not session.run.started, "it is another session that is shown"
        tab.press("Leave the replay")
        tab.wait_until(lambda: view.state.playback is None)

        view.state.start_exercise(exercise, Feedback.SUMMARY)
        stop_time(tab, dissections, view)
        perform(session, MANNERS["follow_front"]["clumsy"])
        page.get_by_test_id("outcome").wait_for()
        found = session.run.incidents()
        assert found[0].error == "behind_front"
        reported = page.get_by_test_id("error")
        expect(reported).to_have_count(len(found))
        expect(reported.first).to_contain_text(found[0].sentence)
        expect(reported.first).to_contain_text("left hand, at ")
        expect(page.get_by_test_id("timeline").locator("rect")).to_have_count(len(found))
        expect(page.get_by_test_id("debrief-numbers")).to_contain_text("scripted expert")
        instead = ERROR_CLASSES["behind_front"].instead.format(**found[0].values)
        expect(page.get_by_test_id("next-time")).to_have_text(f"Next time: {instead}")
        # All of it is on one screen, and nothing in it is against the rules of accessibility.
        room = page.get_by_role("dialog").bounding_box()
        assert room is not None
        assert 0.0 <= room["y"] < room["y"] + room["height"] <= 800.0
        assert faults(page, "debrief") == []
        # No hand moves the duct under its result.
        there = session.spatial.hands[1].target.tolist()
        view.state.choose_hand(1)
        view.state.nudge(np.array([0.0, 5.0, 0.0]))
        assert session.spatial.hands[1].target.tolist() == there
        page.get_by_role(
            "button", name=f"1. Held behind the front, {found[0].start_s:.1f} s"
        ).click()
        tab.wait_until(lambda: view.state.playback is not None)
        playback(view).pause()
        at = found[0].start_s
        assert max(at - 1.0, 0.0) <= playback(view).time <= session.run.seconds
        tab.wait_until(lambda: tab.slider("Time (s)") == round(playback(view).time, 2))
        tab.slide("Time (s)", at)
        expect(page.get_by_test_id("replayed-error")).to_contain_text(found[0].sentence)
        # The hand that made it is marked where it is then, and no longer once the replay is left.
        assert isinstance(view._scene, TissueScene)
        annotations = view._scene._annotations
        tab.wait_until(lambda: annotations._lit is not None and annotations._lit.visible)
        lit, erring = annotations._lit, playback(view).session.tissue.hands[found[0].hand or 0]
        assert lit is not None
        assert lit._label.text == "This left hand"
        tab.wait_until(lambda: np.allclose(lit._frame.position, erring.place))
        tab.press("Leave the replay")
        tab.wait_until(lambda: view.state.playback is None)
        tab.wait_until(lambda: not lit.visible)
        # The scripted expert where he has freed as much.
        tab.open("Learn")
        tab.press("Result of the last run")
        expect(page.get_by_role("dialog")).to_have_count(1)
        # The end of a run may open it at the same time: then one dialog is left, which is alive.
        kept = view.state.last_run
        assert kept is not None
        view._panel.exercises.show_result(kept, view.state.last_errors)
        expect(page.get_by_role("dialog")).to_have_count(1)
        page.get_by_role("button", name="Expert there").first.click()
        tab.wait_until(lambda: view.state.playback is not None)
        expert = playback(view)
        expert.pause()
        assert isinstance(expert, ReplayPlayback)
        assert expert.session.run.exercise == exercise
        assert expert.session.tissue.reading().freed <= session.reading().freed + 2.0
        tab.press("Leave the replay")
        tab.wait_until(lambda: view.state.playback is None)


def test_the_next_try_is_told_by_what_failed_it_else_by_the_commonest_error_or_the_limit() -> None:
    session = bed_session(phantom(), vertices=300)
    exercise = next(e for e in bed_exercises(session) if e.name == "window")

    def error(key: str, at: float) -> Incident:
        return Incident(
            key, at, at, 0, 0, 20.0, "none", {"speed_limit_mm_per_s": 10.0, "front_mm": 45.0}
        )

    fast, lean = error("fast_in_tissue", 1.0), error("leaning", 2.0)
    straight = "Lead it back over where it was held at rest, and pull straight off the bed."
    metrics = {"peak_stress_ratio": 0.99}
    failed = Outcome(False, "Too far.")
    assert next_time(exercise, failed, metrics, [[fast], [lean, lean, lean], [fast]]) == (
        "Go in slowly, below 10 mm/s you can stop in time, and then spread. "
        "That was an error in 2 of 3 tries."
    )
    assert next_time(exercise, failed, metrics, [[], [lean]]) == straight
    slip = error("hold_slipped", 1.0)  # a result, which stands before them in the table
    assert next_time(exercise, failed, metrics, [[slip, lean]]) == straight
    # What failed it stands before what was commoner, and that before what was in more tries.
    many = [[fast], [lean, lean, fast]]
    assert next_time(exercise, failed, metrics, many).startswith(straight)
    assert next_time(exercise, failed, metrics, many, fast).startswith("Go in slowly")
    torn = Incident("tear", 3.0, 3.0, 1, 0, 20.0, "injury", {"instead": "Close the jaws."})
    assert cause_of([fast, torn], 3.0) == torn
    assert next_time(exercise, failed, metrics, [[fast, torn]], torn) == "Close the jaws."
    assert next_time(exercise, failed, metrics, [[torn]], torn) == "Close the jaws."
    alone = next_time(exercise, failed, metrics, [[error("tear", 3.0)]])
    assert re.fullmatch(r"The wall never past \d+ % of its break\.", alone)
    in_time = next_time(exercise, failed, {}, [[]])
    assert in_time.startswith("Do what the line Next asks for")
    # What an earlier try did wrong is no cause of this one's.
    assert next_time(exercise, failed, {}, [[lean], []]) == in_time
    assert "no luck" in next_time(exercise, Outcome(True, "Freed."), {}, [[]])
