"""The trainer's page in a real browser: pull by hand, see, compare, learn, replay, first minute."""

import re
from pathlib import Path

import numpy as np
import pytest
from browser import (
    PATIENCE,
    RADIUS,
    TrainerPage,
    new_context,
    newest,
    pass_ticks,
    scene_of,
    settle,
    stage_pixel,
    stands_still,
    stop_time,
    trainer_page,
)
from playwright.sync_api import Browser, Download, Locator, expect
from simulated import phantom, pull, pull_session

from app.simulation import (
    CAREFUL,
    Exercise,
    Feedback,
    Phase,
    Replay,
    Stay,
    exercises_offered,
    perform,
    run_json,
)
from app.simulation.scripts.scripted_hands import HASTY
from app.trainer.client.page_state import HAND_ONLY
from app.trainer.client.workers import EXPORT_VERTICES
from app.trainer.connections.bounds import Bounds
from app.trainer.pages.downloads import SUFFIXES, download
from app.trainer.panel.force_curve import ansys_points
from app.trainer.server.trainer import Trainer
from app.validation.thesis_tables import INCH, LBF, TABLE_6_3
from physics import Beam, Cubic, Exact

DUCT = Beam.round(span=50.8, diameter=8.89, modulus=0.310264, poisson_ratio=0.3)


def seen(tab: TrainerPage, name: str) -> bool:
    """Whether a part of the organ is drawn."""
    return tab.page.evaluate(
        "name => { const node = window.__viserMutable.nodeRefFromName['/organ/' + name];"
        " return !!node && node.visible; }",
        name,
    )


def test_duct_is_pulled_by_hand_and_springs_back(browser: Browser, trainer: Trainer) -> None:
    with trainer_page(browser, trainer.address) as tab:
        session = newest(trainer).session
        tab.wait_for_node("grip")
        tab.wait_for_camera(newest(trainer))
        start = stage_pixel(tab, (25.4 + 6.0, -0.8 * RADIUS, 0.6 * RADIUS))
        mouse = tab.page.mouse
        tab.aim(start)
        mouse.down()
        for step in range(1, 7):
            mouse.move(start[0], start[1] - 14.0 * step)
            tab.next_picture()
        tab.wait_until(lambda: session.reading().by_hand and session.reading().deflection > 2.0)
        # The hand sets the displacement where it has taken hold, the beam answers with the force.
        assert session.planar.grasp == pytest.approx(31.4, abs=0.7)

        def answered() -> None:
            deflection = session.reading().deflection
            force = Cubic().pull(DUCT, session.planar.grasp).to_deflection(deflection).force
            assert tab.figure("force-n") == pytest.approx(force, rel=1e-4)
            assert tab.slider("Force F (N)") == pytest.approx(force, abs=0.011)
            assert tab.slider("Grasp (mm)") == pytest.approx(session.planar.grasp, abs=0.051)
            assert seen(tab, "force_0")
            assert tab.page.get_by_text(f"{force:.2f} N", exact=True).is_visible()

        tab.eventually(answered)
        mouse.up()
        tab.wait_for_force(0.0)
        tab.wait_until(lambda: session.reading().deflection == 0.0)
        tab.wait_until(lambda: tab.slider("Force F (N)") == 0.0)
        tab.wait_until(lambda: not seen(tab, "force_0"))


def force_field(tab: TrainerPage) -> Locator:
    """The force's number field."""
    row = tab.page.get_by_text("Force F (N)", exact=True).locator(
        "xpath=ancestor::*[contains(@class, 'Flex-root')][1]"
    )
    return row.locator("input:not([type=hidden])")


@pytest.mark.long  # waits for many figures
def test_force_field_takes_a_wish_at_any_time_and_shows_what_acts(
    browser: Browser, trainer: Trainer
) -> None:
    with trainer_page(browser, trainer.address, width=1024, height=768) as tab:
        session = newest(trainer).session
        field = force_field(tab)
        # After the field was set by a reset: a text without a key, as from a clipboard.
        for force in (3.2, 2.5):
            tab.slide("Force F (N)", force)
            tab.wait_for_force(force)
            tab.press("Reset (R)")
            tab.wait_for_force(0.0)
            expect(field).to_have_value("0")
        for typed, force in (("2", 2.0), ("abc", 2.0), ("-", 2.0), ("-1", 0.0), ("1", 1.0)):
            field.click(click_count=3)
            tab.page.keyboard.type(typed)
            tab.page.keyboard.press("Enter")
            expect(field).to_have_value(f"{force:g}")
            tab.wait_for_force(force)
            expect(field).not_to_be_focused()
        # A scroll bar has room beside the field.
        place = field.bounding_box()
        bar = tab.page.locator(".mantine-ScrollArea-scrollbar[data-orientation=vertical]").first
        beside = bar.bounding_box()
        assert place is not None
        assert beside is not None
        assert place["x"] + place["width"] < beside["x"]
        # A torn duct keeps the place of its inputs, which take nothing.
        pause = tab.page.get_by_role("button", name="Pause (P)")
        before = pause.bounding_box()
        tab.slide("Force F (N)", 3.7)
        tab.wait_for_phase("torn")
        expect(field).to_have_value("0")
        tab.wait_for_disabled("Force F (N)")
        tab.wait_until(lambda: pause.bounding_box() == before)
        field.focus()
        expect(field).not_to_be_focused()
        assert session.planar.grasper.slider_force == 0.0


def test_a_wish_made_after_a_result_is_not_taken_back(browser: Browser, trainer: Trainer) -> None:
    with trainer_page(browser, trainer.address) as tab:
        view = newest(trainer)
        session = view.session
        near = Exercise("near", "Near", Stay("distance_to_break", 0.0, 0.9, 0.1))
        session.start_exercise(near, inputs="any")
        view.state.set_target_force(2.0)
        tab.wait_until(lambda: session.run.over)
        tab.page.get_by_test_id("outcome").wait_for()
        tab.page.get_by_role("dialog").get_by_role("button", name="Close").click()
        expect(tab.page.get_by_role("dialog")).to_have_count(0)
        tab.slide("Force F (N)", 2.5)
        tab.wait_for_force(2.5)
        settle(tab, trainer, view.client)
        assert session.planar.grasper.slider_force == 2.5
        assert tab.slider("Force F (N)") == 2.5


def test_keys_pull_pause_colour_and_reset(browser: Browser, trainer: Trainer) -> None:
    with trainer_page(browser, trainer.address) as tab:
        view = newest(trainer)
        session, keyboard = view.session, tab.page.keyboard
        legend = tab.page.get_by_test_id("heat-legend")
        expect(legend).to_have_count(0)
        keyboard.press("h")
        expect(legend).to_be_visible()
        expect(legend).to_contain_text("breaks at 211 kPa")
        tab.wait_until(lambda: seen(tab, "skin_stress") and not seen(tab, "skin"))

        tab.slide("Force F (N)", 3.0)
        tab.wait_for_force(3.0)
        tab.open("Train")  # out of the number field, where keys are figures
        keyboard.press("p")
        tab.wait_until(lambda: view.state.paused)
        expect(tab.readout).to_contain_text("Paused")
        pass_ticks(tab, trainer)
        tab.slide("Force F (N)", 1.0)
        tab.wait_until(lambda: session.planar.grasper.slider_force == 1.0)
        held = session.reading()
        assert held.force == 3.0
        assert held.phase is Phase.INTACT
        fractions = [each.copy() for each in scene_of(view).values("stress")]
        wanted = session.stress(np.empty_like(fractions[0])) / session.tissue.threshold
        np.testing.assert_array_equal(fractions[0], wanted)
        assert fractions[0].max() == pytest.approx(1.0 - held.check.distance_to_break, abs=0.05)
        settle(tab, trainer, view.client)
        assert session.reading() == held

        tab.open("Model")
        tab.slide("Threshold (kPa)", 250.0)
        tab.open("Train")
        keyboard.press("p")
        tab.wait_for_force(1.0)
        tab.page.locator("[data-testid=heat-legend][data-threshold-kpa='250']").wait_for()
        tab.page.locator("[data-testid=readout][data-threshold-kpa='250']").wait_for()
        keyboard.press("t")  # to the tear that is farther off now
        tab.wait_for_phase("torn")
        tab.wait_until(lambda: seen(tab, "first_piece_stress"))
        keyboard.press("r")
        tab.wait_for_phase("intact")
        keyboard.press("h")
        expect(legend).to_have_count(0)
        tab.wait_until(lambda: seen(tab, "skin"))


def test_plot_has_the_cubic_the_exact_beam_and_the_points_of_ansys(
    browser: Browser, trainer: Trainer
) -> None:
    beam = pull_session(phantom()).tissue.dissection.beam
    points = ansys_points(beam, 25.4)
    assert points is not None
    first = TABLE_6_3.rows[0]
    assert (points[0][0], points[1][0]) == (first[2] * INCH, 2.0 * first[0] * LBF)
    assert len(points[0]) == len(TABLE_6_3.rows)
    assert ansys_points(beam, 20.0) is None
    assert ansys_points(Beam.round(span=50.0, diameter=8.0, modulus=0.3), 25.0) is None

    with trainer_page(browser, trainer.address) as tab:
        tab.open("Compare")
        tab.choose("Theory", "Finite elements (the thesis's reference)")
        tab.wait_until(lambda: newest(trainer).session.planar.theory.name == "fem")
        tab.open("Train")
        key = tab.page.get_by_test_id("plot-key")
        expect(key).to_contain_text("exact beam")
        expect(key).to_contain_text("thesis's cubic")  # now that another theory is chosen

        def marked_as_drawn() -> None:
            """The key's marks are drawn as the curves are."""
            marks: dict[str, bool] = key.evaluate(
                "key => Object.fromEntries([...key.children].map("
                "each => [each.innerText, each.innerHTML.includes('repeating')]))"
            )
            drawn: dict[str, bool] = tab.page.evaluate(
                "() => Object.fromEntries(Object.values(window.__viserTestpoints.uplots)[0].chart"
                ".series.slice(1).map(each => [each.label, !!each.dash]))"
            )
            drawn.pop("goal")  # of an exercise; there is none
            assert marks == drawn
            assert not marks["this pull"]
            assert marks["exact beam"]

        tab.eventually(marked_as_drawn)
        # And these not to whole pixels.
        aligned: list[float] = tab.page.evaluate(
            "() => Object.values(window.__viserTestpoints.uplots)[0].chart.series.slice(1, 6)"
            ".map(each => each.pxAlign)"
        )
        assert aligned == [0.0] * 5
        expect(tab.page.get_by_test_id("plot-key")).to_contain_text("ANSYS")
        tab.wait_until(lambda: all(any(tab.charts()[0][row]) for row in (4, 5, 6)))
        x, _, _, _, cubic, exact, ansys, goal = tab.charts()[0]
        assert not any(goal)
        shown = {a: b for a, b in zip(x, ansys, strict=True) if b is not None}
        assert shown == pytest.approx(
            {a: b for a, b in zip(*points, strict=True) if a <= x[-1]}, rel=1e-6
        )
        for theory, curve in ((Cubic(), cubic), (Exact(), exact)):
            for deflection, force in list(zip(x, curve, strict=True))[5:60:10]:
                assert deflection is not None
                assert force == pytest.approx(
                    theory.pull(beam, 25.4).to_deflection(deflection).force, rel=5e-3
                )


def test_theories_are_compared_while_pulling(browser: Browser, trainer: Trainer) -> None:
    with trainer_page(browser, trainer.address) as tab:
        session = newest(trainer).session
        tab.slide("Force F (N)", 2.0)
        tab.wait_for_force(2.0)
        tab.open("Compare")
        tab.choose("Ghost", "Exact beam")
        ghost = tab.page.get_by_test_id("ghost")
        ghost.wait_for()
        exact, cubic = (
            Exact().pull(DUCT, 25.4).to_force(2.0).deflection,
            Cubic().pull(DUCT, 25.4).to_force(2.0).deflection,
        )

        def difference(of: str) -> float:
            return float(ghost.get_attribute(f"data-{of}") or "nan")

        wanted = pytest.approx(exact - cubic, rel=1e-4)
        tab.wait_until(lambda: difference("deflection-difference-mm") == wanted)
        assert difference("force-difference-n") == 0.0
        tab.wait_until(lambda: seen(tab, "ghost"))

        tab.choose("Theory", "Exact beam")
        tab.wait_until(lambda: session.planar.theory == Exact())
        tab.wait_until(lambda: tab.figure("deflection-mm") == pytest.approx(exact, rel=1e-5))
        tab.choose("Ghost", "None")
        expect(ghost).to_have_count(0)
        tab.wait_until(lambda: not seen(tab, "ghost"))

        tab.tick("Chain")
        tab.wait_until(lambda: session.chain is not None and seen(tab, "chain/nodes"))
        expect(tab.page.get_by_test_id("chain")).to_contain_text("N at")
        tab.tick("Chain")
        tab.wait_until(lambda: session.chain is None and not seen(tab, "chain/nodes"))

        tab.open("Model")
        tab.tick("Points")
        tab.wait_until(lambda: seen(tab, "overlay/driving_points"))

        # What is on the screen, by the code that the command line exports with.
        tab.open("Replay")
        tab.choose("Export as", SUFFIXES[".stl"])
        shown = download(session, ".stl", EXPORT_VERTICES).content
        assert downloaded(tab, "Download file") == shown


def test_exercise_is_done_judged_and_downloaded_and_replayed(
    browser: Browser, trainer: Trainer, tmp_path: Path
) -> None:
    with trainer_page(browser, trainer.address) as tab:
        view = newest(trainer)
        session = view.session
        view.state.exercise_inputs = "any"  # as by `trainer --exercise-inputs any`
        rest = tab.vertices("skin")
        tab.open("Learn")
        task = tab.page.get_by_test_id("task")
        expect(task).to_contain_text("Lift the duct")
        tab.choose("Exercise", "Approach the break")
        expect(task).to_contain_text("15 % or less")
        expect(task).to_contain_text("Do not tear the duct.")
        tab.press("Start")
        expect(tab.page.get_by_test_id("exercise-state")).to_contain_text("first touch")
        tab.open("Train")
        tab.slide("Force F (N)", 0.4)
        tab.wait_for_force(0.4)
        # A leap near the break fails it. Time goes by the test's own ticks: the exercise has 60 s.
        stop_time(tab, trainer, view)
        for tick in range(1, 301):
            session.set_target_force(0.4 + 2.5 * tick / 300.0)
            session.advance()
        session.advance(60)  # the goal is to stay there for 1 s
        view.state.paused = False
        outcome = tab.page.get_by_test_id("outcome")
        outcome.wait_for()
        assert outcome.get_attribute("data-outcome") == "Passed"
        expect(tab.page.get_by_test_id("remark")).to_contain_text("Sliders and keys were allowed")
        run = view.state.last_run
        assert run is not None
        assert run.outcome is not None
        assert run.outcome.passed
        tab.open("Measures")
        tab.wait_until(lambda: len(run_measures(tab)) == 12)
        for name, value in run_measures(tab).items():
            assert value == run.metrics[name], name

        assert downloaded(tab, "Download JSON") == run_json(run)
        name = downloaded_name(tab, "Download CSV")
        assert re.fullmatch(r"approach-the-break-\d{4}-\d\d-\d\d-\d{6}\.csv", name)
        again = Replay(run.log, phantom(), vertices=300)
        assert downloaded(tab, "Download CSV") == again.series().csv().encode()
        tab.page.get_by_role("tab", name="Over time").click()
        tab.wait_until(lambda: len(over_time(tab)) == 2)
        distance, force = over_time(tab)
        again.seek_tick(run.log.ticks)
        assert force[0][-1] == pytest.approx(run.log.ticks / 30.0, rel=1e-15)
        assert force[1][-1] == again.session.reading().force
        assert [distance[2][0], distance[3][0]] == [15.0, 0.0]  # the goal: the margin

        # Replay it: at its end the page shows what the run has shown, and then the live duct.
        tab.wait_until(lambda: stands_still(session))  # it has sprung back
        live = session.reading()
        tab.press("Watch it again")
        expect(tab.page.get_by_text("Time (s)", exact=True)).to_be_visible(timeout=PATIENCE)
        tab.wait_until(lambda: view.state.playback is not None)
        playback = view.state.playback
        assert playback is not None
        tab.wait_until(lambda: tab.slider("Time (s)") > 0.0)  # from 0 to 0 is no jump
        playback.pause()  # while it plays the field is written thirty times a second
        tab.wait_until(lambda: tab.slider("Time (s)") == round(playback.time, 2))
        tab.slide("Time (s)", 0.0)
        tab.wait_until(lambda: playback.time < 0.02)
        tab.wait_until(lambda: apart(tab, rest) < 0.01)
        tab.slide("Time (s)", round(0.5 * run.log.ticks / 30.0, 2))
        tab.wait_until(lambda: abs(playback.time - 0.5 * run.log.ticks / 30.0) < 0.02)
        tab.slide("Time (s)", 100.0)
        tab.wait_until(lambda: playback.at_end)
        last = again.session.reading()
        tab.wait_until(lambda: tab.figure("force-n") == pytest.approx(last.force, rel=1e-5))
        assert tab.figure("deflection-mm") == pytest.approx(last.deflection, rel=1e-5)
        assert playback.session.metrics() == run.metrics
        tab.wait_until(lambda: apart(tab, rest) > 0.5)
        tab.press("Leave the replay")
        tab.wait_for_force(live.force)
        assert session.reading() == live

        # The file that was downloaded is opened again, from where it was begun.
        tab.open("Replay")
        file = tmp_path / "run.json"
        file.write_bytes(run_json(run))
        tab.page.locator("input[type=file]").set_input_files(file)
        tab.wait_until(lambda: view.state.playback is not None)
        opened = view.state.playback
        assert opened is not None
        tab.choose("Speed", "16×")
        tab.wait_until(lambda: opened.at_end)  # by the trainer's clock: nobody else moves it
        assert opened.session.metrics() == run.metrics
        assert opened.session.run.outcome == run.outcome
        tab.press("Leave the replay")
        file.write_text("{}")
        tab.wait_until(lambda: tab.page.locator("input[type=file]").count() > 0)
        tab.page.locator("input[type=file]").set_input_files(file)
        expect(tab.page.get_by_text(re.compile("not a run of bluntdissect"))).to_be_visible()


def over_time(tab: TrainerPage) -> list[list[list[float | None]]]:
    """The charts of a result: rows of time, values, the goal's two ends and the limit."""
    return [rows for rows in tab.charts() if len(rows) == 5]


def test_only_the_hand_passes_an_exercise_and_its_goal_is_seen(
    browser: Browser, trainer: Trainer
) -> None:
    with trainer_page(browser, trainer.address) as tab:
        view = newest(trainer)
        session = view.session
        gentle = exercises_offered(session)[2]
        stay = gentle.goal
        assert isinstance(stay, Stay)
        tab.open("Learn")
        tab.choose("Exercise", "Dissect gently")
        expect(tab.page.get_by_test_id("task")).to_contain_text("your hand only")
        tab.press("Start")
        state = tab.page.get_by_test_id("exercise-state")
        expect(state).to_contain_text("Lift 1 of 3: into the band")
        # Key T, sliders and typed forces come to nothing, and say so.
        tab.page.keyboard.press("t")
        refusal = tab.page.get_by_role("alert").filter(has_text=HAND_ONLY)
        expect(refusal).to_be_visible()
        tab.open("Train")
        expect(tab.page.get_by_test_id("hand-only")).to_be_visible()
        field = force_field(tab)
        tab.wait_for_disabled("Force F (N)")
        field.focus()
        expect(field).not_to_be_focused()
        settle(tab, trainer, view.client)
        assert not session.run.started
        assert session.reading().force == 0.0

        # The goal: in the picture over the duct's upper edge, and in the plot.
        tab.wait_until(lambda: seen(tab, "goal/area"))

        def over_the_duct() -> None:
            band, rest = tab.vertices("goal/area"), tab.vertices("skin")
            near = np.abs(rest[:, 0] - band[:, 0].mean()) < 3.0
            height = band[:, 2].max() - rest[near, 2].max()
            assert height == pytest.approx(stay.high, abs=0.5)
            assert np.ptp(band[:, 2]) == pytest.approx(stay.high - stay.low, abs=1e-3)

        tab.eventually(over_the_duct)
        tab.wait_until(lambda: any(tab.charts()[0][7]))
        x, *_, goal = tab.charts()[0]
        there = [at for at, value in zip(x, goal, strict=True) if value]
        assert (there[0], there[-1]) == pytest.approx((stay.low, stay.high), rel=1e-6)

        # Held, it counts down: at the goal and in the tab. Time goes by the test's own ticks.
        tab.open("Learn")
        stop_time(tab, trainer, view)
        run = session.run
        middle = 0.5 * (stay.low + stay.high)
        session.grab(0, session.planar.grasp)
        for tick in range(1, 46):
            session.lift(middle * tick / 45.0)
            session.advance()
        found = []
        while "s to go" in run.standing:
            expect(state).to_contain_text(run.standing)
            goal = scene_of(view)._annotations._goal
            assert goal is not None
            tab.wait_until(lambda goal=goal: goal._label.text == run.standing)
            found.append(run.standing)
            session.advance(9)
        assert len(set(found)) >= 2
        assert found == sorted(found, reverse=True)
        expect(state).to_contain_text("Lift 1 of 3: lead it back")

        # Loaded anew in the middle of it, it is an exercise still.
        tab.page.reload()
        tab.wait_for_node("skin")
        tab.wait_until(lambda: newest(trainer) is not view)
        view = newest(trainer)
        assert view.session.run is run
        assert run.going
        view.state.paused = True  # a slow page has as much time
        learn = tab.page.get_by_role("tab", name="Learn")
        expect(learn).to_have_attribute("aria-selected", "true")
        expect(tab.page.get_by_test_id("task")).to_contain_text("Dissect gently")
        expect(tab.page.get_by_role("button", name="Stop", exact=True)).to_be_visible()
        expect(state).to_contain_text("of 90 s")
        tab.wait_until(lambda: seen(tab, "goal/area"))
        tab.press("Stop")
        outcome = tab.page.get_by_test_id("outcome")
        expect(outcome).to_have_attribute("data-outcome", "Not judged")
        tab.page.get_by_role("dialog").get_by_role("button", name="Close").click()
        expect(outcome).to_have_count(0)
        tab.wait_until(lambda: not seen(tab, "goal/area"))


def test_a_result_stands_beside_earlier_tries_and_a_scripted_expert(
    browser: Browser, trainer: Trainer
) -> None:
    with trainer_page(browser, trainer.address, width=900, height=700) as tab:
        view = newest(trainer)
        session, state = view.session, view.state
        gentle = exercises_offered(session)[2]
        outcome = tab.page.get_by_test_id("outcome")
        table = tab.page.get_by_test_id("measures")
        for manner, word, heads in (
            (HASTY, "Not passed", ["this try", "expert", "limit"]),
            (CAREFUL, "Passed", ["this try", "try 1", "expert", "limit"]),
        ):
            state.start_exercise(gentle, Feedback.CONTINUOUS)
            stop_time(tab, trainer, view)  # time goes by the hand's own ticks
            perform(session, manner)
            expect(outcome).to_have_attribute("data-outcome", word)
            tab.open("Measures")
            # The expert's comes once it is made.
            better = "↓ lower, ↑ higher is better"
            expect(table.locator("th")).to_have_text([better, *heads])
            cells = table.locator("[data-measure=smoothness] td").all_inner_texts()
            if manner is HASTY:
                assert cells[1] == "too short"
                tab.page.get_by_role("dialog").get_by_role("button", name="Close").click()
                expect(outcome).to_have_count(0)
        # Which way each measure is better; a limit beside what it limits.
        better = table.locator("[data-better]").evaluate_all(
            "rows => Object.fromEntries(rows.map(row => [row.dataset.measure, row.dataset.better]))"
        )
        assert {name for name, direction in better.items() if direction == "higher"} == {
            "economy_of_motion",
            "smoothness",
            "smallest_distance_to_break",
        }
        assert {name for name, direction in better.items() if direction == ""} == {
            "time_in_tissue_s"
        }
        row = table.locator("[data-measure=maximum_loading_rate_N_per_s] td")
        stay = gentle.goal
        assert isinstance(stay, Stay)
        cells = row.all_inner_texts()
        rate_limit = gentle.limit_of["maximum_loading_rate_N_per_s"]
        assert cells[4] == f"{rate_limit:.2f}"
        careful, hasty = float(cells[1]), float(cells[2])
        assert hasty > rate_limit > careful

        tab.page.get_by_role("tab", name="Over time").click()
        tab.wait_until(lambda: len(over_time(tab)) == 4)
        deflection, distance, force, rate = over_time(tab)
        assert [deflection[2][0], deflection[3][0]] == [stay.high, stay.low]
        assert force[4][0] == gentle.limit_of["maximum_force_N"]
        assert rate[4][0] == rate_limit
        assert state.last_run is not None
        fastest = state.last_run.metrics["maximum_loading_rate_N_per_s"]
        assert max(one for one in rate[1] if one is not None) == fastest
        assert distance[4][0] == 100.0 * gentle.limit_of["smallest_distance_to_break"]
        tab.press("Watch it again")
        replay = tab.page.get_by_role("tab", name="Replay")
        expect(replay).to_have_attribute("aria-selected", "true")
        tab.press("Pause")
        expect(tab.page.get_by_text("Time (s)", exact=True)).to_be_visible()
        tab.wait_until(lambda: seen(tab, "goal/area"))  # what the run was about
        tab.press("Leave the replay")
        tab.wait_until(lambda: state.playback is None)


def apart(tab: TrainerPage, before: np.ndarray) -> float:
    """How far the page draws the duct from where it was, mm."""
    return float(np.abs(tab.vertices("skin") - before).max())


def run_measures(tab: TrainerPage) -> dict[str, float | None]:
    """The measures in full, as the result page carries them."""
    rows: list[list[str]] = tab.page.evaluate(
        "() => [...document.querySelectorAll('[data-measure]')]"
        ".map(row => [row.dataset.measure, row.dataset.value])"
    )
    return {name: float(value) if value else None for name, value in rows}


def downloading(tab: TrainerPage, button: str) -> Download:
    """The download that a button starts."""
    with tab.page.expect_download() as expected:
        tab.page.get_by_role("button", name=button, exact=True).click()
    return expected.value


def downloaded(tab: TrainerPage, button: str) -> bytes:
    """What a button downloads."""
    return Path(downloading(tab, button).path()).read_bytes()


def downloaded_name(tab: TrainerPage, button: str) -> str:
    """What the file is called that a button downloads."""
    return downloading(tab, button).suggested_filename


def test_hidden_feedback_is_hidden_everywhere(browser: Browser, trainer: Trainer) -> None:
    with trainer_page(browser, trainer.address) as tab:
        view = newest(trainer)
        session = view.session
        tab.page.evaluate(
            "() => { const viewer = window.__viserMutable; const send = viewer.sendMessage;"
            " viewer.sendMessage = message => {"
            "  if (message.type === 'GuiUpdateMessage') window.__update ??= message;"
            "  send(message); }; }"
        )
        tab.open("Model")
        tab.slide("Threshold (kPa)", 300.0)
        tab.wait_until(lambda: session.tissue.threshold == pytest.approx(0.3))
        tab.open("Learn")
        tab.page.keyboard.press("h")
        tab.page.get_by_test_id("heat-legend").wait_for()
        tab.choose("Feedback", "Only in the result")
        tab.press("Start")
        hidden = tab.page.locator("[data-testid=readout][data-hidden='1']")
        hidden.wait_for()
        assert session.run.feedback is Feedback.SUMMARY
        tab.wait_until(lambda: seen(tab, "goal/area"))  # it is the task, and no figure
        expect(tab.page.get_by_test_id("heat-legend")).to_have_count(0)
        tab.open("Train")
        expect(tab.page.get_by_text("Force F (N)", exact=True)).to_have_count(0)
        expect(tab.page.get_by_test_id("plot-key")).to_have_count(0)
        session.grab(0, 25.4)
        session.lift(6.0)
        tab.wait_until(lambda: session.reading().deflection > 5.9)
        settle(tab, trainer, view.client)
        tab.wait_until(lambda: seen(tab, "skin") and not seen(tab, "skin_stress"))
        assert not seen(tab, "force_0")
        assert tab.readout.get_attribute("data-force-n") is None
        words = tab.page.locator("body").inner_text()
        for figure in (session.reading().force, session.reading().deflection):
            assert f"{figure:.2f}" not in words
        # Time cannot be held, and the slider that is hidden is not taken from a browser.
        tab.page.keyboard.press("p")
        assert not view.state.paused
        threshold = session.tissue.threshold
        tab.page.evaluate(
            "() => window.__viserMutable.sendMessage({...window.__update, updates: {value: 400}})"
        )
        settle(tab, trainer, view.client)
        assert session.tissue.threshold == threshold
        tab.open("Learn")
        tab.press("Stop")
        outcome = tab.page.get_by_test_id("outcome")
        outcome.wait_for()
        assert outcome.get_attribute("data-outcome") == "Not judged"
        tab.page.get_by_role("dialog").get_by_role("button", name="Close").click()
        tab.wait_until(lambda: tab.figure("distance-to-break") == 1.0)


def test_fading_feedback_comes_and_goes_and_is_gone_after_half_a_minute(
    browser: Browser, trainer: Trainer
) -> None:
    with trainer_page(browser, trainer.address, width=900, height=600) as tab:
        view = newest(trainer)
        session, state = view.session, view.state
        hidden = tab.page.locator("[data-testid=readout][data-hidden='1']")
        tab.open("Learn")
        tab.choose("Feedback", "Fading, gone after 30 s")
        tab.press("Start")
        tab.page.get_by_test_id("exercise-state").wait_for()
        assert session.run.feedback is Feedback.FADING
        expect(hidden).to_have_count(0)  # nothing is hidden before the first pull
        stop_time(tab, trainer, view)  # it goes by the test's own ticks
        session.grab(0, 25.4)
        session.lift(2.0)

        def shown_until(seconds: float) -> list[bool]:
            """Whether figures are shown, from change to change, as the page follows."""
            course: list[bool] = []
            while session.run.seconds < seconds:
                session.advance(9)
                if not course or state.figures_visible != course[-1]:
                    course.append(state.figures_visible)
                    tab.wait_until(lambda: hidden.is_visible() is not course[-1])
            return course

        # From 12 s to 18 s the figures are shown for 1.8 s and 1.5 s, and hidden after each.
        session.advance(12 * 30)
        assert shown_until(17.6) == [True, False, True, False]
        session.advance(30 * 30 - session.run.ticks)
        tab.wait_until(hidden.is_visible)
        assert shown_until(39.0) == [False]
        tab.press("Stop")
        outcome = tab.page.get_by_test_id("outcome")
        outcome.wait_for()
        tab.page.get_by_role("dialog").get_by_role("button", name="Close").click()
        expect(hidden).to_have_count(0)


def test_first_minute_and_reload_keep_the_run(browser: Browser, trainer: Trainer) -> None:
    with trainer_page(browser, trainer.address, first_minute=True) as tab:
        lines = tab.page.get_by_test_id("first-minute")
        expect(lines.locator("li")).to_have_count(3)
        tab.start()
        view = newest(trainer)
        tab.slide("Force F (N)", 1.5)
        tab.wait_for_force(1.5)
        sessions = len(trainer._kept)
        ticks = view.session.run.ticks
        tab.page.reload()
        tab.wait_for_node("skin")
        tab.wait_for_force(1.5)
        tab.wait_until(lambda: newest(trainer) is not view)
        assert newest(trainer).session is view.session
        assert len(trainer._kept) <= sessions  # those left long ago may have expired
        assert view.session.run.ticks >= ticks
        assert tab.slider("Force F (N)") == 1.5
        expect(lines).to_have_count(0)  # it has been read
        tab.press("Help")
        expect(tab.page.get_by_role("dialog")).to_contain_text("Ramp to tear")
        expect(lines.locator("li")).to_have_count(3)
        tab.page.get_by_role("dialog").get_by_role("button", name="Close").click()
        expect(lines).to_have_count(0)


def test_panel_leaves_the_duct_free_on_a_phone(browser: Browser, trainer: Trainer) -> None:
    with trainer_page(browser, trainer.address, width=390, height=844) as tab:
        disclaimer = tab.page.get_by_test_id("disclaimer")
        expect(disclaimer).to_be_visible()
        expect(disclaimer).to_have_text("Not clinically validated, not a medical device.")
        tab.wait_for_camera(newest(trainer))

        def below_the_duct() -> None:
            _, bottom = stage_pixel(tab, (25.4, 0.0, -RADIUS))
            panel = tab.readout.bounding_box()
            assert panel is not None
            assert bottom < panel["y"]
            assert panel["width"] > 360.0

        tab.eventually(below_the_duct)
        _, top = stage_pixel(tab, (25.4, 0.0, RADIUS))
        for name in ("Normal stress", "Bending stress", "Threshold T"):
            expect(tab.readout.get_by_text(name)).to_be_visible()
        tabs = [each.bounding_box() for each in tab.page.get_by_role("tab").all()]
        assert len({each["y"] for each in tabs if each is not None}) == 1
        assert all(each["height"] >= 40.0 for each in tabs if each is not None)
        tab.page.keyboard.press("h")
        legend = tab.page.get_by_test_id("heat-legend")
        expect(legend).to_be_visible()
        place = legend.bounding_box()
        assert place is not None
        assert place["y"] + place["height"] < top  # over the picture, above the duct
        reset = tab.page.get_by_role("button", name="Reset (R)").bounding_box()
        assert reset is not None
        assert reset["y"] + reset["height"] <= 844.0


def test_full_house_is_said_and_a_teacher_s_choice_reaches_each_page(browser: Browser) -> None:
    trainer = Trainer(
        phantom(),
        port=0,
        scene="free",
        look="plain",
        bounds=Bounds(most_clients=1),
        exercise_inputs="any",
    )
    try:
        with trainer_page(browser, trainer.address) as tab:
            tab.open("Learn")
            expect(tab.page.get_by_test_id("task")).to_contain_text("your teacher lets them count")
            assert newest(trainer).state.exercise_inputs == "any"
            context = new_context(browser)
            page = context.new_page()
            page.goto(f"{trainer.address}/?fixedDpr=1")
            expect(page.get_by_text(re.compile("1 trainees are at work"))).to_be_visible(
                timeout=PATIENCE
            )
            context.close()
    finally:
        trainer.stop()


def test_pages_open_on_a_run_that_the_trainer_is_started_with(browser: Browser) -> None:
    session = pull_session(phantom(), vertices=300)
    pull(session, 2.0)
    run = session.run_file()
    trainer = Trainer(phantom(), port=0, scene="free", look="plain", replay=run)
    try:
        with trainer_page(browser, trainer.address, first_minute=True) as tab:
            tab.wait_until(lambda: newest(trainer).state.playback)
            playback = newest(trainer).state.playback
            assert playback is not None
            expect(tab.page.get_by_role("tab", name="Replay")).to_have_attribute(
                "aria-selected", "true"
            )
            tab.wait_until(lambda: playback.at_end)
            assert playback.session.metrics() == run.metrics
            tab.press("Leave the replay")
            tab.wait_until(lambda: newest(trainer).state.playback is None)
            assert newest(trainer).state.session.reading().phase is Phase.INTACT
    finally:
        trainer.stop()
