"""A class at work: a teacher and trainees in real pages, and who gets in where."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from axe import faults
from browser import PATIENCE, TrainerPage, new_context, trainer_page
from playwright.sync_api import Browser, Page, expect
from program import free_port
from simulated import phantom
from test_guard import UPGRADE, Answer

from app.anatomy import drawn_anatomy
from app.classroom.course import default_course
from app.classroom.exercise_file import template
from app.classroom.store import ClassStore
from app.trainer.classroom.lesson import Lesson
from app.trainer.classroom.teacher_page import TeacherPage
from app.trainer.server.trainer import Trainer

OWN = {"Host": "localhost:PORT"}
MOST_TABS = 120
PATHS = (
    "/class", "/class/", "/class/live", "/class/results", "/class/results.csv",
    "/class/results.json", "/class/course", "/class/report",
    "/class/run?id=x", "/class/teacher.js", "/class/x",
)  # fmt: skip


def opened(path: Path, port: int) -> Trainer:
    store = ClassStore(path)
    return Trainer(phantom(), port=port, look="plain", lesson=Lesson(store, phantom()))


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("class") / "surgery-3a.sqlite"
    ClassStore.new(path, "Surgery <3A>").close()
    return path


@pytest.fixture(scope="module")
def running(path: Path) -> Iterator[Trainer]:
    trainer = opened(path, free_port())
    trainer.warm_up.wait("bed")
    yield trainer
    trainer.stop()


def lesson_of(trainer: Trainer) -> Lesson:
    assert trainer._lesson is not None
    return trainer._lesson


def cookie(trainer: Trainer, link: str | None) -> str:
    assert link is not None
    entered = Answer(trainer.port, OWN, "/?" + link.partition("?")[2])
    assert entered.status == 200
    return entered.headers["Set-Cookie"].partition(";")[0]


@pytest.mark.parametrize("asked_path", PATHS)
@pytest.mark.parametrize("kind", [{}, UPGRADE], ids=["page", "websocket"])
def test_a_trainee_s_link_opens_nothing_of_the_teacher_s(
    running: Trainer, asked_path: str, kind: dict[str, str]
) -> None:
    trainee, teacher = cookie(running, running.link), cookie(running, running.teacher_link)
    assert trainee.partition("=")[0] + "-teacher" == teacher.partition("=")[0]
    posing = f"{teacher.partition('=')[0]}={trainee.partition('=')[2]}"
    token = running.link.partition("=")[2]
    for headers in ({}, {"Cookie": trainee}, {"Cookie": posing},
                    {"Cookie": trainee, "Authorization": f"Bearer {token}"}):  # fmt: skip
        answer = Answer(running.port, OWN | kind | headers, asked_path)
        assert answer.status == 403, headers
        assert "Surgery" not in answer.text
    foreign = OWN | kind | {"Cookie": teacher, "Origin": "http://attacker.example"}
    assert Answer(running.port, foreign, asked_path).status == 403
    answer = Answer(running.port, OWN | {"Cookie": f"{trainee}; {teacher}"}, asked_path)
    assert answer.status in (200, 307, 404)
    assert running.link != running.teacher_link
    assert running.teacher_link is not None
    assert token not in running.teacher_link


def test_the_teacher_s_page_runs_no_script_but_its_own(running: Trainer) -> None:
    teacher = {"Cookie": cookie(running, running.teacher_link)}
    page = Answer(running.port, OWN | teacher, "/class/")
    assert "script-src 'self';" in page.headers["Content-Security-Policy"]
    assert "default-src 'none'" in page.headers["Content-Security-Policy"]
    assert page.headers["Cache-Control"] == "no-store"
    assert "Surgery &lt;3A&gt;" in page.text
    assert "<3A>" not in page.text
    assert Answer(running.port, OWN | teacher, "/class").headers["Location"] == "class/"


def test_a_command_that_is_none_is_refused_in_words(running: Trainer) -> None:
    page = TeacherPage(lesson_of(running), lambda: running.link)
    for text in ("", "{", "[]", '{"type": "hello"}', '{"type": "delete"}', "x" * 60_000,
                 '{"type": "delete", "person": "x"}', '{"type": "start"}',
                 '{"type": "standing", "shown": 2}', '{"type": "assign", "text": "x"}',
                 '{"type": "start", "more": 1}'):  # fmt: skip
        assert set(json.loads(page._done(text))) == {"refused"}, text


class Trainee:
    """A trainee's page of the class."""

    def __init__(self, page: TrainerPage) -> None:
        self.trainer, self.page = page, page.page

    def join(self, name: str) -> None:
        self.trainer.row("Your name").locator("input").fill(name)
        self.trainer.press("Join the class")
        expect(self.page.get_by_test_id("class-name")).to_have_text(name)

    def shown(self, what: str) -> None:
        expect(self.page.get_by_test_id("class-last")).to_contain_text(what)

    def reach(self, name: str) -> None:
        """Go to what has a name by the tabulator alone, as who has no mouse."""
        expect(self.page.get_by_role("button", name=name, exact=True).last).to_be_enabled()
        there = "(document.activeElement.ariaLabel || document.activeElement.textContent)"
        for _ in range(MOST_TABS):
            self.page.keyboard.press("Tab")
            if self.page.evaluate(f"{there}.trim()") == name:
                return
        raise AssertionError(f"no way by keys to {name}")

    def press_by_keys(self, name: str) -> None:
        self.reach(name)
        self.page.keyboard.press("Enter")

    def lift(self, steps: int, *, by_mouse: bool = True) -> None:
        """Take the duct in the middle by the hook and lift it by keys, half a millimetre each.

        In a window's exercise the dissector is led first, and X goes on to the hook.
        """
        if by_mouse:
            self.page.mouse.click(300, 500)  # from the field of the name to the picture
        for key in ["x", "g", *["ArrowUp"] * steps]:
            self.page.keyboard.press(key)


def teacher_page(browser: Browser, trainer: Trainer) -> Page:
    page = new_context(browser).new_page()
    page.set_default_timeout(PATIENCE)
    assert trainer.teacher_link is not None
    page.goto(trainer.teacher_link)
    expect(page.locator("#connection")).to_have_text("Live")
    assert page.url.endswith("/class/")  # no token in the address
    return page


COURSE = """
id = "two"
title = "Two levels"
version = 1
[[level]]
id = "window"
title = "Open <it>"
step = "Open a window."
goal = "window"
passes = 1
[[level]]
id = "front"
title = "The front"
step = "Follow it."
goal = "follow_front"
needs = ["window"]
"""


def test_a_level_is_begun_failed_and_begun_again_on_another_bed_by_keys(
    browser: Browser, running: Trainer
) -> None:
    """From the joined class on no mouse is used; it does not pass the level, nor ask for a show."""
    lesson = lesson_of(running)
    lesson.choose_course(COURSE)
    token = running.link.partition("token=")[2]
    with trainer_page(browser, running.address, query=f"&token={token}") as page:
        cas = Trainee(page)
        assert not cas.page.get_by_test_id("class-levels").is_visible()
        cas.join("Cas")
        levels = cas.page.get_by_test_id("class-levels")
        expect(levels).to_contain_text("Level 1 of 2: Open <it>. 0 of 1 passed in a row.")
        expect(cas.page.get_by_test_id("class-exercise")).to_have_text("Open a window.")
        cas.press_by_keys("Start the next try")
        expect(cas.page.get_by_test_id("exercise-state")).to_contain_text("Ready")
        cas.lift(14, by_mouse=False)
        cas.shown("Failed.")
        expect(levels).to_contain_text("Last:")
        (kept,) = [each for each in lesson.store.runs() if each.finished]
        assert (kept.level, kept.seed, kept.passed, kept.title) == ("window", 1, False, "Open <it>")
        assert json.loads(kept.incidents or "")
        cas.press_by_keys("Close")
        expect(cas.page.get_by_role("dialog")).to_be_hidden()
        # The next try is another bed.
        cas.press_by_keys("Start the next try")
        expect(cas.page.get_by_test_id("exercise-state")).to_contain_text("Ready")
        (person,) = lesson.store.people()
        view = next(each.view for each in lesson._all())
        exercise = view.session.run.exercise
        assert exercise is not None
        assert exercise.opening is not None
        assert exercise.opening.bed_seed == 2
        # It goes on in a page that is loaded again; in a new tab it cannot, and has failed.
        cas.lift(1, by_mouse=False)
        page.wait_until(lambda: not all(each.finished for each in lesson.store.runs()))
        cas.page.reload()
        expect(cas.page.get_by_test_id("exercise-state")).to_contain_text("of 120 s")
        expect(levels).to_contain_text("Last:")
        expect(levels).not_to_contain_text("It was cut short.")
        cas.page.evaluate("sessionStorage.clear()")
        cas.page.reload()
        expect(levels).to_contain_text("0 of 1 passed in a row.Last: It was cut short.")
        cas.press_by_keys("Start the next try")
        expect(cas.page.get_by_test_id("exercise-state")).to_contain_text("Ready")
        (view,) = [each.view for each in lesson._all()]
        assert view.session.run.exercise is not None
        assert view.session.run.exercise.opening is not None
        assert view.session.run.exercise.opening.bed_seed == 3
        # The teacher sets the other level for all.
        lesson.set_level("front", None)
        expect(levels).to_contain_text("Level 2 of 2: The front.")
        lesson.set_level(None, person.id)
        expect(levels).to_contain_text("Level 1 of 2")
        lesson.delete(person.id)
        expect(levels).to_be_hidden()
        lesson.choose_course(None)


STEADY = COURSE.replace('"Open <it>"', '"A steady hand"').replace('"window"', '"hold_stretch"')


def test_a_level_is_shown_failed_tried_again_and_passed_and_the_teacher_sees_it(
    browser: Browser, running: Trainer
) -> None:
    lesson = lesson_of(running)
    lesson.choose_course(STEADY)
    teacher = teacher_page(browser, running)
    token = running.link.partition("token=")[2]
    with trainer_page(browser, running.address, query=f"&token={token}") as tab:
        dan, page = Trainee(tab), tab.page
        dan.join("Dan")
        levels = page.get_by_test_id("class-levels")
        expect(levels).to_contain_text("Level 1 of 2: A steady hand. 0 of 1 passed in a row.")
        tab.press("Start the next try")
        state = page.get_by_test_id("exercise-state")
        expect(state).to_contain_text("Ready")
        (view,) = [each.view for each in lesson._all()]

        tab.press("Show me")
        tab.wait_until(lambda: view.state.playback is not None)
        tab.press("Leave the replay")
        tab.wait_until(lambda: view.state.playback is None)
        expect(state).to_contain_text("Ready")

        # Far too fast: the result names it, and so does the teacher's page.
        assert view.session.grab(0, view.session.task_grasp) is not None
        view.session.lift(12.0)
        expect(page.get_by_test_id("outcome")).to_contain_text("you pulled at")
        expect(page.get_by_test_id("next-time")).to_contain_text("Lift at half that speed")
        expect(page.get_by_test_id("error").first).to_contain_text("you pulled at")
        grid = teacher.locator("#progress table.grid tbody tr", has_text="Dan")
        expect(grid.locator("td.now")).to_contain_text("0 of 1")
        assert [each.passed for each in lesson.store.runs()] == [False]

        # Practice on the same duct, half a millimetre each once the last one has arrived.
        tab.press("Try again")
        expect(state).to_contain_text("Ready")
        assert view.session.grab(0, view.session.task_grasp) is not None
        for step in range(1, 40):
            view.session.lift(0.5 * step)
            tab.wait_until(lambda far=0.5 * step: view.session.reading().deflection > far - 0.05)
            if view.session.run.standing.startswith("keep it"):
                break
        expect(page.get_by_test_id("outcome")).to_contain_text("Kept there for 3 s")
        expect(page.get_by_test_id("error")).to_have_count(0)
        # The result leads on as the card does.
        onward = page.get_by_role("dialog").get_by_role("button", name="Start the next try")
        expect(onward).to_be_visible()
        page.get_by_role("button", name="Close", exact=True).last.click()
        assert [each.passed for each in lesson.store.runs()] == [False, True]
        expect(levels).to_contain_text("Level 2 of 2: The front.")
        expect(grid.locator("td.mastered")).to_have_count(1)
        (person,) = lesson.store.people()
        lesson.delete(person.id)
        lesson.choose_course(None)
    teacher.close()


@pytest.mark.long  # two tries at half a millimetre a key
def test_the_first_level_of_the_course_is_mastered_by_keys_alone(
    browser: Browser, running: Trainer
) -> None:
    """From the name that is typed to the second level; no mouse, and nothing but the page acts."""
    lesson = lesson_of(running)
    lesson.choose_course(default_course())
    token = running.link.partition("token=")[2]
    with trainer_page(browser, running.address, query=f"&token={token}") as tab:
        eve, page = Trainee(tab), tab.page
        field = tab.row("Your name").locator("input")
        expect(field).to_be_visible()
        for _ in range(MOST_TABS):
            page.keyboard.press("Tab")
            if field.evaluate("input => input === document.activeElement"):
                break
        page.keyboard.type("Eve")
        eve.press_by_keys("Join the class")
        expect(page.get_by_test_id("class-name")).to_have_text("Eve")
        levels, state = page.get_by_test_id("class-levels"), page.get_by_test_id("exercise-state")
        outcome, dialog = page.get_by_test_id("outcome"), page.get_by_role("dialog")
        for number in range(2):
            expect(levels).to_contain_text(
                f"Level 1 of 8: Where the break is. {number} of 2 passed"
            )
            eve.press_by_keys("Start the next try")
            expect(dialog).to_be_hidden()
            expect(state).to_contain_text("Ready")
            (view,) = [each.view for each in lesson._all()]
            session = view.session
            assert session.run.exercise is not None
            page.keyboard.press("g")
            tab.wait_until(lambda session=session: session.reading().held)
            for step in range(1, 100):
                page.keyboard.press("ArrowUp")
                tab.wait_until(
                    lambda far=0.5 * step, session=session: (
                        session.reading().deflection > far - 0.05
                    )
                )
                if session.run.standing.startswith("keep it"):
                    break
            expect(outcome).to_have_attribute("data-outcome", "Passed")
        assert [(each.level, each.passed) for each in lesson.store.runs()] == [
            ("approach", True), ("approach", True)
        ]  # fmt: skip
        eve.press_by_keys("Close")
        expect(levels).to_contain_text("Level 2 of 8: A steady hand. 0 of 2 passed in a row.")
        (person,) = lesson.store.people()
        lesson.delete(person.id)
        lesson.choose_course(None)


def test_a_lesson_from_the_first_name_to_the_restart(
    browser: Browser, path: Path, running: Trainer
) -> None:
    token = running.link.partition("token=")[2]
    lesson, port = lesson_of(running), running.port
    teacher = teacher_page(browser, running)
    errors: list[str] = []
    teacher.on("pageerror", lambda error: errors.append(str(error)))
    with (
        trainer_page(browser, running.address, query=f"&token={token}") as first,
        trainer_page(browser, running.address, query=f"&token={token}") as second,
    ):
        ann, ben = Trainee(first), Trainee(second)
        expect(teacher.locator("#count")).to_contain_text("2 without a name")
        ann.join("Ann")
        ben.join("<b>Ben</b>")
        rows = teacher.locator("#people tbody tr")
        expect(rows).to_have_count(2)
        expect(rows.nth(1).locator("td").first).to_have_text("<b>Ben</b>")
        expect(rows.first.locator(".bar b")).to_have_text("100 %")

        teacher.locator("#advanced summary").click()
        teacher.locator("#text").fill(template("window").replace("Open a window", "One <i>"))
        teacher.locator("#assign").click()
        expect(teacher.locator("#now h3")).to_contain_text("One <i>")
        assert not ann.page.get_by_test_id("class-exercise").is_visible()
        teacher.locator("#start").click()
        for each in (ann, ben):
            exercise = each.page.get_by_test_id("class-exercise")
            expect(exercise).to_contain_text("One <i>")
            expect(each.page.get_by_test_id("exercise-state")).to_contain_text("Ready")

        # Ann lifts the duct, which this exercise forbids; what she did is saved, then said: that it
        # was too far, or too fast, where the keys come quickly one after the other.
        ann.lift(14)
        ann.shown("Failed.")
        expect(ann.page.get_by_test_id("class-saved")).to_contain_text("Saved")
        (kept,) = [each for each in lesson.store.runs() if each.finished]
        assert (kept.passed, kept.title) == (False, "One <i>")
        expect(teacher.locator("#found tbody tr")).to_have_count(1)
        expect(teacher.locator("#found")).to_contain_text("0 of 1 passed")
        assert teacher.locator("#found i").count() == 0
        assert not ann.page.get_by_test_id("class-standing").is_visible()
        teacher.locator("#standing").check()
        expect(ann.page.get_by_test_id("class-standing")).to_contain_text("0 of 1")
        assert not ben.page.get_by_test_id("class-standing").is_visible()  # no try yet

        # The run again, and Ben's duct live; a trainee who asks for them gets neither.
        replay = teacher.get_by_role("link", name="Replay").get_attribute("href") or ""
        watch = rows.nth(1).get_by_role("link", name="Watch").get_attribute("href") or ""
        for asked_for, word in ((replay, "Replay"), (watch, "Live")):
            address = f"{running.address}/{asked_for.removeprefix('../')}"
            looking = teacher.context.new_page()
            looking.goto(address)
            expect(looking.get_by_test_id("readout")).to_contain_text(word)
            looking.close()
            looking = ann.page.context.new_page()
            looking.goto(address)
            readout = looking.get_by_test_id("readout")
            expect(readout).to_contain_text("100")
            assert word not in (readout.text_content() or "")
            looking.close()

        # Ben has begun when the trainer stops.
        ben.lift(2)
        expect(rows.nth(1)).to_contain_text("of 120 s")
        # It is saved as it goes on, which a kill would leave.
        second.wait_until(lambda: not all(each.finished for each in lesson.store.runs()))
        running.stop()
        (cut,) = [each for each in ClassStore(path).runs() if not each.finished]
        assert json.loads(cut.measures)["time_s"] > 0.0
        again = opened(path, port)
        try:
            expect(teacher.locator("#connection")).to_have_text("Live")
            ben.shown("One <i> was cut short")
            ann.shown("Your last run, One <i>, failed at")
            expect(ann.page.get_by_test_id("class-name")).to_have_text("Ann")
            # Ben has not finished it: it is on his duct again. Ann has.
            expect(ben.page.get_by_test_id("exercise-state")).to_contain_text("Ready")
            assert not ann.page.get_by_test_id("exercise-state").is_visible()

            rows.first.get_by_role("button", name="Delete").click()
            teacher.get_by_role("dialog").get_by_role("button", name="Delete").click()
            expect(rows).to_have_count(1)
            expect(ann.trainer.row("Your name")).to_be_visible()
            assert {each.person_id for each in lesson_of(again).store.runs()} == {cut.person_id}
            teacher.locator("#stop").click()
            expect(ben.page.get_by_test_id("exercise-state")).to_be_hidden()
            again.stop()  # it waits for no page: they are open still
        finally:
            again.stop()
    assert not errors, errors


@pytest.mark.long  # two pages of the scope
def test_a_level_at_an_anatomy_opens_the_scope_and_is_watched_and_replayed_there(
    browser: Browser, tmp_path: Path
) -> None:
    path = tmp_path / "class.sqlite"
    store = ClassStore.new(path, "Surgery 3B")
    store.course = default_course()
    store.close()
    trainer = opened(path, free_port())
    trainer.warm_up.wait("calot")
    lesson, token = lesson_of(trainer), trainer.link.partition("token=")[2]
    try:
        teacher = teacher_page(browser, trainer)
        with trainer_page(browser, trainer.address, query=f"&token={token}") as page:
            ann = Trainee(page)
            ann.join("Ann")
            lesson.set_level("bleeding", None)
            levels = ann.page.get_by_test_id("class-levels")
            expect(levels).to_contain_text("Level 7 of 8: Stop a bleeding. 0 of 3 passed")
            assert faults(ann.page, "course") == []
            ann.trainer.press("Start the next try")
            expect(ann.page.get_by_test_id("exercise-state")).to_contain_text("Ready")
            (view,) = [each.view for each in lesson._all()]
            assert view.session.specimen.anatomy == drawn_anatomy(1)
            assert view.session.tissue.hands[1].instrument == "clip applier"
            expect(ann.page.get_by_test_id("class-exercise")).to_contain_text("clip that artery")
            assert faults(ann.page, "level at an anatomy") == []
            page.press("Stop")  # before it has begun: no try
            ann.trainer.press("Start the next try")
            expect(ann.page.get_by_test_id("exercise-state")).to_contain_text("Ready")
            ann.page.mouse.click(300, 500)
            ann.page.keyboard.press("x")
            ann.page.keyboard.press("ArrowUp")
            expect(teacher.locator("#people")).to_contain_text("Stop a bleeding: ")
            expect(ann.page.get_by_test_id("exercise-state")).to_contain_text("It bleeds")
            page.wait_until(lambda: (view.session.metrics()["blood_lost_ml"] or 0.0) > 0.0)
            page.press("Stop")
            page.wait_until(lambda: any(each.finished for each in lesson.store.runs()))
            (kept,) = lesson.store.runs()
            assert (kept.level, kept.seed, kept.mode, kept.passed) == (
                "bleeding", 1, "anatomy", None
            )  # fmt: skip
            assert json.loads(kept.measures)["blood_lost_ml"] > 0.0
            (person,) = lesson.store.people()
            for word, asked_for in (("replay", kept.id), ("watch", person.id)):
                looking = teacher.context.new_page()
                looking.goto(f"{trainer.address}/?{word}={asked_for}")
                looking.wait_for_function("() => window.bluntdissectScope?.picture?.drawn > 2")
                expect(looking.get_by_test_id("readout")).to_be_visible()
                if word == "replay":
                    expect(looking.get_by_role("button", name="Leave the replay")).to_be_visible()
                    looking.close()
            # The teacher sets an exercise there for all.
            lesson.assign(template("critical_view").replace('"normal"', '"artery-outside"'))
            lesson.start()
            expect(ann.page.get_by_test_id("exercise-state")).to_contain_text("Ready")
            there = view.session.specimen.anatomy
            assert there is not None
            assert there.name == "artery-outside"
            # Who watches sees the other anatomy, whose nodes are others.
            looking.wait_for_function(
                "count => bluntdissectScope.picture?.given?.nodes === count"
                " && bluntdissectScope.picture.drawn > 2",
                arg=len(view.session.spatial.beam.places),
            )
    finally:
        trainer.stop()
