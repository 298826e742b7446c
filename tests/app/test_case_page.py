"""A case is chosen in the page: tubes left out, joins and ends, saved and practised on."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from unittest.mock import patch

import pytest
from browser import TrainerPage, _newest, trainer_page
from drawn_labels import Drawn, drawn_volume, write
from playwright.sync_api import Browser
from program import LONGEST, refused, run

from app.anatomy import CaseBuilder, CaseChoices, CaseWorkbench, read_anatomy
from app.anatomy.patient_case import NamedLabel
from app.trainer.server.trainer import Trainer
from organ_geometry import read_organ

pytest.importorskip("SimpleITK")

NAMES = {
    1: "common duct", 2: "cystic duct", 3: "gallbladder", 4: "right hepatic artery",
}  # fmt: skip
# x to the left, y to the back, z to the head; the cystic duct joins at 24 mm of the common one.
TUBES = {
    1: Drawn((0.0, 0.0, 0.0), (0.0, 0.0, 50.0), 3.0),
    2: Drawn((0.0, 0.0, 24.0), (-18.0, 0.0, 34.0), 2.0),
    3: Drawn((-18.0, 0.0, 34.0), (-44.0, 0.0, 46.0), 6.0),
    4: Drawn((-4.0, 10.0, 28.0), (-22.0, 10.0, 52.0), 2.0),
}


@pytest.fixture(scope="module")
def workbench(tmp_path_factory: pytest.TempPathFactory) -> CaseWorkbench:
    named = {label: NamedLabel(name) for label, name in NAMES.items()}
    builder = CaseBuilder(drawn_volume(TUBES, 1.0), named, "drawn")
    return CaseWorkbench(builder, tmp_path_factory.mktemp("case"), CaseChoices())


def joins(case: CaseWorkbench) -> dict[tuple[str, int], str]:
    return {(join.tube, join.end): join.to for join in case.case.anatomy.join}


@pytest.mark.long  # a case is built at each choice
def test_choices_change_what_they_name_and_nothing_else(workbench: CaseWorkbench) -> None:
    """A join taken away and given back, a tube left out and taken in: the same to the byte."""
    case = workbench
    found, before = joins(case), case.case.anatomy
    assert found == {("cystic_duct", 0): "common_duct", ("cystic_duct", 1): "gallbladder"}
    case.hold(("cystic_duct", 0), "pinned")
    assert joins(case) == {("cystic_duct", 1): "gallbladder"}
    assert case.end(("cystic_duct", 0)) == "pinned"
    # The common duct is what it was, and the cystic one ends where its label does.
    cut = case.case.anatomy
    assert cut.tube_named("common_duct").organ == before.tube_named("common_duct").organ
    assert cut.tube_named("cystic_duct").organ != before.tube_named("cystic_duct").organ
    case.join(("cystic_duct", 0), "common_duct")
    again = case.case.anatomy
    assert joins(case) == found
    assert again.tube == before.tube
    case.leave_out("gallbladder", True)
    assert [tube.name for tube in case.case.anatomy.tube] == [
        "common_duct", "cystic_duct", "right_hepatic_artery",
    ]  # fmt: skip
    assert "gallbladder" in case.case.left_out
    assert case.case.anatomy.tube_named("cystic_duct").ends == ("joined", "clamped")
    case.leave_out("gallbladder", False)
    assert case.case.anatomy.tube == before.tube


def test_an_artery_is_drawn_in_and_an_end_joined_that_did_not(workbench: CaseWorkbench) -> None:
    case = workbench
    assert case.takes_artery
    case.draw_artery(True)
    artery = case.case.anatomy.tube_named("cystic_artery")
    assert (artery.confidence, artery.ends) == ("assumed", ("joined", "joined"))
    case.draw_artery(False)
    # The artery's end 1 is led to the gallbladder, wherever that is.
    case.join(("right_hepatic_artery", 1), "gallbladder")
    assert joins(case)["right_hepatic_artery", 1] == "gallbladder"
    case.hold(("right_hepatic_artery", 1), "clamped")


def test_what_cannot_be_leaves_the_case_as_it_was(workbench: CaseWorkbench) -> None:
    case = workbench
    before, choices = case.case, case.choices
    everything = CaseChoices(without=frozenset(case.tubes))
    with pytest.raises(ValueError, match="every tube is left out"):
        CaseWorkbench(case._builder, case.folder, everything)
    for tube in case.tubes[1:]:
        case.leave_out(tube, True)
    with pytest.raises(ValueError, match="every tube is left out"):
        case.leave_out(case.tubes[0], True)
    assert len(case.case.anatomy.tube) == 1
    for tube in case.tubes[1:]:
        case.leave_out(tube, False)
    assert case.choices == choices
    assert case.case.anatomy == before.anatomy


def standing(tab: TrainerPage) -> tuple[str | None, str | None]:
    """How many joins and tubes the page says that there are."""
    found = tab.page.get_by_test_id("case-standing")
    return found.get_attribute("data-joins"), found.get_attribute("data-tubes")


def field(tab: TrainerPage, label: str) -> str:
    """What a dropdown shows."""
    return tab.row(label).locator("input:not([type=hidden])").input_value()


def test_a_case_is_built_saved_and_practised_on_in_the_page(
    browser: Browser, tmp_path: Path
) -> None:
    labels = write(drawn_volume(TUBES, 1.0), tmp_path / "labels.nii.gz")
    (tmp_path / "names.json").write_text(json.dumps(NAMES))
    folder = tmp_path / "case"
    message: list[str] = []

    def serve(start: Callable[[], Trainer], say: Callable[[Trainer], object]) -> None:
        running = start()
        try:
            say(running)
            running.warm_up.wait("calot")
            with trainer_page(browser, running.link, first_minute=True, node="/scope/state") as tab:
                use_the_page(tab, folder)
                message.append(_newest(running, "calot").session.specimen.dissection.organ.name)
        finally:
            running.stop()

    words = ["--labels", labels, "--names", tmp_path / "names.json", "-o", folder, "--build-page"]
    with patch("app.command_line.serving.serve", serve):
        done = run("anatomy", *words, "--port", 0)
    assert done.returncode == 0, done.stderr
    assert re.fullmatch(r"The case is ready: http://127\.0\.0\.1:\d+\n", done.stdout)
    assert message == ["common_duct"]
    anatomy = read_anatomy(folder / "anatomy.toml")
    assert [tube.name for tube in anatomy.tube] == ["common_duct", "gallbladder", "cystic_duct"]
    for tube in anatomy.tube:
        assert read_organ(folder / f"{tube.name}.organ").length > 10.0


def use_the_page(tab: TrainerPage, folder: Path) -> None:
    """Leave a tube out, take a join away and give it back, save, and practise."""
    tab.start()
    picture = tab.page.get_by_test_id("case-picture")
    picture.wait_for()
    assert "cystic_duct joins gallbladder" in (picture.get_attribute("alt") or "")
    assert standing(tab) == ("2", "4")
    tab.choose("Tube", "right_hepatic_artery")
    tab.wait_until(lambda: field(tab, "End 1") == "clamped", LONGEST)
    tab.tick("Part of the case")
    tab.wait_until(lambda: standing(tab) == ("2", "3"), LONGEST)
    tab.choose("Tube", "cystic_duct")
    tab.wait_until(lambda: field(tab, "End 1") == "joins gallbladder", LONGEST)
    tab.choose("End 1", "clamped")
    tab.wait_until(lambda: standing(tab) == ("1", "3"), LONGEST)
    tab.choose("End 1", "joins gallbladder")
    tab.wait_until(lambda: standing(tab) == ("2", "3"), LONGEST)
    tab.press("Save the case")
    saved = tab.page.get_by_test_id("case-saved")
    saved.wait_for()
    assert saved.inner_text() == f"4 files are in {folder}."
    tab.press("Practise on it")
    # The panel is made anew and opens on Train; the case is what is in hand.
    tab.page.get_by_role("tab", name="Train", selected=True).wait_for()
    assert field(tab, "Anatomy") == "case, own"


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["normal", "--build-page"], "--build-page goes with --labels"),
        (["--labels", "x.nrrd", "--build-page"], "--labels needs -o"),
        (["--labels", "x.nrrd", "-o", "case", "--build-page", "--port", "-1"], "--port must be"),
        (["--labels", "x.nrrd", "-o", "case", "--build-page"], "there is no volume of labels"),
    ],
)
def test_a_page_that_cannot_be_is_refused(words: list[object], says: str) -> None:
    assert says in refused(["anatomy", *words])
