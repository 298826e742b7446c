"""The teacher's page of a class with a course: need, grid, curves, levels, forms."""

import io
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import msgspec
import pytest
from axe import faults
from browser import PATIENCE, new_context
from class_runs import record
from PIL import Image
from playwright.sync_api import Browser, Page, expect
from program import free_port
from simulated import phantom

from app.classroom.course import default_course
from app.classroom.exercise_file import read_exercise
from app.classroom.store import ClassStore, RunRecord
from app.trainer.classroom.lesson import Lesson
from app.trainer.server.trainer import Trainer

INCIDENT = {
    "error": "ahead_of_front", "start_s": 0.1, "end_s": 0.6, "hand": 0, "tube": 0,
    "station_mm": 25.4, "consequence": "none", "values": {"x": 30.0, "d": 9.0, "front": 40.0},
}  # fmt: skip


def tried(person: str, level: str, seed: int | None, day: float, *, incidents: int) -> RunRecord:
    """A try of some days ago, which passed if there were no incidents."""
    passed = incidents == 0
    at = datetime.now(UTC) - timedelta(days=day)
    return replace(
        record(person, passed=passed, reason="Reached." if passed else "Held ahead."),
        level=level, seed=seed, started_at=at.isoformat(timespec="seconds"), title=level,
        incidents=msgspec.json.encode([INCIDENT] * incidents).decode(),
    )  # fmt: skip


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Trainer]:
    store = ClassStore.new(tmp_path_factory.mktemp("class") / "c.sqlite", "Surgery <3A>")
    store.course = default_course()
    ann, ben, cas = (store.name_person(name, name) for name in ("Ann", "<b>Ben</b>", "Cas"))
    for number, level in enumerate(("approach", "hold", "gentle")):
        for person in (ann, ben):
            for more in range(2):
                day = 9.0 - number - 0.1 * more
                store.save(tried(person.id, level, None, day, incidents=0))
    for number, incidents in enumerate((8, 5, 3, 2, 1, 1, 1, 0)):
        day = 3.0 - 0.1 * number
        store.save(tried(ben.id, "window", 1 + number, day, incidents=incidents))
    for number in range(3):
        store.save(tried(ann.id, "window", 1 + number, 2.0 - 0.1 * number, incidents=0))
    store.save(tried(cas.id, "approach", None, 9.0, incidents=0))
    trainer = Trainer(phantom(), port=free_port(), look="plain", lesson=Lesson(store, phantom()))
    trainer.warm_up.wait("bed")
    yield trainer
    trainer.stop()


@pytest.fixture
def teacher(browser: Browser, running: Trainer) -> Iterator[Page]:
    page = new_context(browser).new_page()
    page.set_default_timeout(PATIENCE)
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    assert running.teacher_link is not None
    page.goto(running.teacher_link)
    expect(page.locator("#connection")).to_have_text("Live")
    yield page
    page.close()
    assert not errors


def test_rows_by_need_and_a_grid_of_people_and_levels(teacher: Page, running: Trainer) -> None:
    progress = teacher.locator("#progress")
    rows = progress.locator("table.grid tbody tr")
    expect(rows).to_have_count(3)
    needs = progress.locator("table.needs tbody tr")
    expect(needs.first).to_contain_text("<b>Ben</b>")
    expect(needs.first).to_contain_text("7 of 8 tries at 'Spread, do not stir' did not pass")
    expect(needs.nth(1)).to_contain_text("Cas")
    expect(needs.nth(1)).to_contain_text("No try for 9 days.")
    # Who needs help comes first, with what comes next framed.
    expect(rows.first).to_contain_text("<b>Ben</b>")
    expect(rows.first.locator("td.now")).to_contain_text("1 of 3")
    ann = rows.filter(has_text="Ann")
    expect(ann.locator("td.mastered")).to_have_count(4)
    expect(ann.locator("td.now")).to_contain_text("0 of 3")
    progress.locator("details.curves summary").click()
    curve = progress.locator("details.curves tr", has_text="Ben").locator("svg").first
    label = curve.get_attribute("aria-label") or ""
    assert label.startswith("Incidents of 8 tries, the first 8, the last 0; it leads to ")
    assert curve.locator("polyline").count() == 1
    for width, height in ((390, 844), (640, 400), (1280, 800)):
        teacher.set_viewport_size({"width": width, "height": height})
        assert faults(teacher, f"teacher, {width} wide") == []
        assert teacher.evaluate("() => document.scrollingElement.scrollWidth") <= width
        # Why somebody needs help is read without moving it sideways.
        box = needs.first.bounding_box()
        assert box is not None
        assert box["x"] + box["width"] <= width
    # A level for one, and for all.
    store = running._lesson.store if running._lesson else None
    assert store is not None
    ann.get_by_label("Level of Ann").select_option("scar")
    expect(teacher.locator("#notice")).to_have_text("Set.")
    assert {each.name: each.level for each in store.people()}["Ann"] == "scar"
    expect(rows.filter(has_text="Ann").locator("td.now")).to_have_count(1)
    teacher.get_by_label("Level for all").select_option("front")
    expect(rows.first.get_by_label("Level of")).to_have_value("front")
    assert {each.level for each in store.people()} == {"front"}


def test_an_exercise_is_set_by_fields(teacher: Page, running: Trainer) -> None:
    form = teacher.locator("#form")
    expect(form).to_be_visible()  # as no exercise is set
    form.locator("#goal").select_option("follow_front")
    form.get_by_label("Title").fill('Slow "front"')
    form.locator("#bed").select_option("loose")
    form.get_by_text("Limits").click()
    form.locator("[data-goal=follow_front]").get_by_label("Peak stress at most").fill("60")
    form.locator("[data-goal=follow_front]").get_by_label("Time, s").fill("75")
    form.get_by_text("Errors that fail it").click()
    form.get_by_label("Pulled sideways").fill("2")
    assert faults(teacher, "teacher") == []
    teacher.locator("#assign").click()
    expect(teacher.locator("#now h3")).to_contain_text('Slow "front"')
    assert running._lesson is not None
    current = running._lesson.assignment
    assert current is not None
    exercise = current[1].exercise
    assert (exercise.name, exercise.time_limit_s) == ("follow_front", 75.0)
    assert exercise.opening is not None
    assert exercise.opening.bed == "loose"
    assert exercise.limit_of["peak_stress_ratio"] == 0.6
    assert exercise.errors["leaning"] == 2
    # A page that is opened now shows it, and changes of it only what is changed there.
    running._lesson.assign(
        current[0].text.replace("[duct]", '[duct]\npreset = "thesis-bile-duct"\nrelaxes = true')
    )
    teacher.reload()
    teacher.get_by_text("Choose an exercise").click()
    expect(form.locator("#goal")).to_have_value("follow_front")
    expect(form.get_by_label("Title")).to_have_value('Slow "front"')
    expect(form.locator("#bed")).to_have_value("loose")
    form.get_by_text("Limits").click()
    fields = form.locator("[data-goal=follow_front]")
    expect(fields.get_by_label("Peak stress at most")).to_have_value("60")
    expect(fields.get_by_label("Time, s")).to_have_value("75")
    form.get_by_text("Errors that fail it").click()
    expect(form.get_by_label("Pulled sideways")).to_have_value("2")
    fields.get_by_label("Time, s").fill("80")
    current = running._lesson.assignment
    assert current is not None
    before = read_exercise(current[0].text)
    teacher.locator("#assign").click()
    expect(teacher.locator("#notice")).to_contain_text("is set. Start it")
    current = running._lesson.assignment
    assert current is not None
    after = read_exercise(current[0].text)
    assert after == msgspec.structs.replace(before, limits=before.limits | {"time_limit_s": 80})
    assert (after.duct.preset, after.duct.relaxes) == ("thesis-bile-duct", True)
    # A free duct has no bed, and a wrong number is told.
    teacher.get_by_text("Choose an exercise").click()  # it has closed: the exercise is set
    form.locator("#goal").select_option("hold_stretch")
    expect(form.locator("#bed")).to_be_hidden()
    form.locator("[data-goal=hold_stretch]").get_by_label("Time, s").fill("0")
    teacher.locator("#assign").click()
    expect(teacher.locator("#notice")).to_contain_text("time_limit_s must be")


def test_a_course_s_file_and_a_record_store_are_advanced(teacher: Page) -> None:
    course = teacher.locator("#course")
    course.get_by_text("Advanced").click()
    text = course.get_by_label("Course file (TOML)")
    text.fill(text.input_value().replace('goal = "window"', 'goal = "windows"'))
    course.get_by_role("button", name="Set this course").click()
    expect(teacher.locator("#notice")).to_contain_text("this is no course")
    expect(teacher.locator("#notice")).to_contain_text("(line ")
    teacher.locator("#sending summary").click()
    teacher.get_by_label("Address").fill("http://lrs.example.org/xapi")
    teacher.get_by_label("Key").fill("k")
    teacher.get_by_label("Secret").fill("s")
    assert faults(teacher, "teacher") == []
    teacher.get_by_role("button", name="Send results").click()
    expect(teacher.locator("#notice")).to_contain_text("must begin with https")
    course.get_by_role("button", name="No course").click()
    expect(teacher.locator("#no-course")).to_be_visible()
    expect(teacher.locator("#all-levels")).to_be_hidden()
    teacher.locator("#give-course").click()
    expect(course.locator("table.grid")).to_be_visible()


def test_points_for_a_photograph_are_kept_as_they_are_chosen(
    teacher: Page, running: Trainer
) -> None:
    assert running._lesson is not None
    store = running._lesson.store
    run = record(store.people()[0].id, passed=True)
    store.save(run)
    picture = io.BytesIO()
    Image.new("RGB", (40, 30), (140, 60, 40)).save(picture, "WEBP")
    store.keep_photographs(run.id, [picture.getvalue()])
    for given in ("0", "6", ""):
        teacher.reload()
        teacher.get_by_text("Photographs for the record").click()
        expect(teacher.locator("figure img")).to_have_js_property("naturalWidth", 40)
        choice = teacher.get_by_label("yours")
        assert choice.locator("option").all_text_contents() == ["none", *map(str, range(7))]
        choice.select_option(given)
        expect(teacher.locator("#notice")).to_contain_text("Kept beside the computed points.")
        assert store.ratings() == ({run.id: int(given)} if given else {})
    assert faults(teacher, "teacher") == []
