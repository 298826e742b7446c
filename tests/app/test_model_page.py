"""Which organ is solved and how, and figures of one's own, in a real browser."""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from browser import PATIENCE, TrainerPage, newest, trainer_page
from playwright.sync_api import Browser, expect
from program import printed

from app.simulation import OrganBeam, Spread, read_preset
from app.trainer.server.trainer import Trainer
from organ_geometry.organ_file import read_organ
from physics import THEORIES


@pytest.fixture(scope="module")
def own_trainer(tube_file: Path) -> Iterator[Trainer]:
    running = Trainer(read_organ(tube_file), port=0, scene="free", look="plain")
    yield running
    running.stop()


def solved(*arguments: object) -> dict[str, float]:
    return json.loads(printed("solve", *arguments, "--json"))


def saved(tab: TrainerPage) -> Path:
    with tab.page.expect_download() as waiting:
        tab.press("Save preset")
    path = Path(waiting.value.path())
    return path.rename(path.with_suffix(".toml"))


def test_the_readout_says_which_organ_and_section_are_solved_and_each_theory_s_threshold(
    browser: Browser, trainer: Trainer
) -> None:
    with trainer_page(browser, trainer.address, height=1100) as tab:
        duct = tab.page.get_by_test_id("duct")
        expect(duct).to_contain_text("bile_duct_phantom: hollow, 50.83 mm long, 8.91 mm thick")
        expect(duct).to_contain_text("a full round bar, 50.8 mm between the clamps, 8.89 mm thick")
        expect(duct).to_contain_text("not the organ's own hollow sections")
        expect(duct).to_contain_text("a break at 3.55858 N at mid-span; T is the stress that each")
        tab.open("Model")
        table = tab.page.get_by_test_id("thresholds")
        expect(table).to_contain_text("Exact beam")
        rows = table.locator("tr").all_inner_texts()[1:]
        assert len(rows) == 5
        # One break is given, so all break alike, each at a stress of its own.
        assert {row.split("\t")[2] for row in rows} == {"3.56"}
        thresholds = [row.split("\t")[1] for row in rows]
        assert thresholds[0] == "211"
        assert len(set(thresholds)) > 3
        assert np.isfinite([float(each) for each in thresholds]).all()
        tab.choose("Duct", "Own sections, assumed tissue")
        expect(duct).to_contain_text("the organ's own hollow sections, the weakest one, 50.83")
        expect(duct).to_contain_text("a nominal stress of 211.5 kPa, which is T in every theory")
        expect(duct).to_have_attribute("data-own-sections", "1")
        found = solved("--preset", "assumed-duct", "--force", 1)
        expect(tab.readout).to_have_attribute("data-breaks-at-n", f"{found['breaks_at_N']:.6g}")
        tab.slide("Threshold (kPa)", 150.0)
        expect(duct).to_contain_text("T moved by you from 211.5 kPa")


def test_an_organ_that_is_practised_on_is_solved_as_its_own(
    browser: Browser, trainer: Trainer, tube_file: Path
) -> None:
    """The thesis's 50.8 mm and 3.56 N are not those of an organ of 58 mm."""
    with trainer_page(browser, trainer.address) as tab:
        view = newest(trainer)
        assert view.session.tissue.dissection.preset.name == "thesis-bile-duct"
        view.state.practise_on(read_organ(tube_file))
        duct = tab.page.get_by_test_id("duct")
        expect(duct).to_contain_text("hollow, 58")
        expect(duct).to_contain_text("the organ's own hollow sections")
        expect(duct).not_to_contain_text("50.8")
        found = solved("--organ", tube_file, "--force", 0.1)
        expect(tab.readout).to_have_attribute("data-breaks-at-n", f"{found['breaks_at_N']:.6g}")
        assert view.session.tissue.dissection.clamps == (
            0.0,
            view.session.tissue.dissection.organ.length,
        )
        # The bar can still be had, and then says what it is.
        tab.open("Model")
        tab.choose("Duct", "Bile duct of the thesis")
        expect(duct).to_contain_text("not the organ's own hollow sections")
        expect(duct).to_have_attribute("data-own-sections", "0")


@pytest.mark.parametrize(
    "label", ["Exact beam", pytest.param("Cubic beam (Rayleigh)", marks=pytest.mark.long)]
)
def test_page_and_solve_show_the_same_digits(
    browser: Browser, own_trainer: Trainer, tube_file: Path, label: str
) -> None:
    name = {"Cubic beam (Rayleigh)": "cubic", "Exact beam": "exact"}[label]
    with trainer_page(browser, own_trainer.address) as tab:
        tab.open("Compare")
        tab.choose("Theory", label)
        session = newest(own_trainer).session
        tab.wait_until(lambda: session.planar.theory == THEORIES[name]())
        tab.open("Train")
        tab.slide("Force F (N)", 0.4)
        tab.wait_for_force(0.4)
        given = ("--organ", tube_file, "--theory", name, "--force", 0.4)
        found = solved(*given)
        for shown, of, scale in (
            ("deflection-mm", "deflection_mm", 1.0),
            ("normal-stress-kpa", "normal_stress_MPa", 1e3),
            ("bending-stress-kpa", "bending_stress_MPa", 1e3),
            ("threshold-kpa", "threshold_MPa", 1e3),
            ("distance-to-break", "distance_to_break", 1.0),
            ("breaks-at-n", "breaks_at_N", 1.0),
        ):
            expect(tab.readout).to_have_attribute(f"data-{shown}", f"{scale * found[of]:.6g}")
        words = printed("solve", *given)
        assert f"{tab.figure('threshold-kpa'):.6g} kPa" in words
        assert f"{tab.figure('breaks-at-n'):.6g} N" in words
        # Beside the distance, the band of ducts whose tissue differs.
        tab.open("Model")
        tab.tick("90 % band")
        band = tab.readout.get_by_test_id("band")
        band.wait_for()  # with the preset's own factors
        tab.slide("Modulus factor", 1.2)
        low, high = Spread(1.2, Spread.of(session.tissue.dissection.preset).strength_factor).band(
            found["distance_to_break"]
        )
        expect(band).to_have_attribute("data-low", f"{low:.6g}")
        expect(band).to_have_attribute("data-high", f"{high:.6g}")
        expect(band).to_contain_text(f"{100 * low:.0f} to {100 * high:.0f} %, 90 % of ducts")


def test_figures_that_are_typed_show_what_changes_and_go_through_a_file(
    browser: Browser, own_trainer: Trainer, tube_file: Path
) -> None:
    with trainer_page(browser, own_trainer.address, height=1100) as tab:
        session = newest(own_trainer).session
        before = session.reading().breaks_at
        assert before is not None
        tab.open("Model")
        figures, use = (
            tab.page.get_by_test_id("figures"),
            tab.page.get_by_role("button", name="Use these figures"),
        )
        expect(figures).to_have_attribute("data-own", "0")
        expect(use).to_be_disabled()
        tab.slide("Modulus E (kPa)", 620.528)
        tab.slide("Strength (kPa)", 423.0)
        # Twice the modulus and the strength: twice the force, at once and before it is taken.
        expect(figures).to_have_attribute(
            "data-breaks-at-n", f"{2.0 * before.force:.6g}", timeout=PATIENCE
        )
        expect(figures).to_contain_text("Yours: modulus, strength.")
        assert session.reading().breaks_at == before
        tab.slide("Poisson's ratio", 0.4)
        tab.slide("Wall (mm)", 0.8)
        tab.slide("First clamp (mm)", 4.0)
        tab.slide("Second clamp (mm)", 54.5)
        expect(figures).to_have_attribute("data-own", "5")
        expect(figures).to_contain_text("50.5")  # both clamps have come
        expect(use).to_be_enabled()
        file = saved(tab)
        preset = read_preset(file.read_bytes(), "mine")
        assert preset.modulus_MPa == pytest.approx(0.620528)
        assert isinstance(preset.beam, OrganBeam)
        assert preset.beam.wall_mm == 0.8
        assert preset.beam.clamps_mm == (4.0, 54.5)
        assert preset.source.startswith("Yours: modulus, Poisson's ratio, strength, wall, clamps.")
        tab.press("Use these figures")
        tab.wait_until(lambda: session.tissue.dissection.preset == preset)
        assert session.tissue.dissection.clamps == (4.0, 54.5)
        found = solved("--organ", tube_file, "--preset", file, "--force", 0.1)
        expect(tab.readout).to_have_attribute("data-breaks-at-n", f"{found['breaks_at_N']:.6g}")
        duct = tab.page.get_by_test_id("duct")
        expect(duct).to_contain_text("outline with a wall of 0.8 mm")
        # Another preset, and back from the file.
        tab.choose("Duct", "Own sections, assumed tissue")
        tab.wait_until(lambda: session.tissue.dissection.preset.ships)
        wall = tab.row("Wall (mm)").locator("input:not([type=hidden])")
        expect(wall).not_to_have_value("0.8")
        tab.page.locator("input[type=file]").last.set_input_files(file)
        tab.wait_until(lambda: session.tissue.dissection.preset == preset)
        expect(wall).to_have_value("0.8")  # from here on the trainer writes no field any more
        expect(duct).to_contain_text("outline with a wall of 0.8 mm")
        # What cannot be is printed, and not taken.
        tab.slide("Wall (mm)", 9.0)
        wrong = tab.page.get_by_test_id("figures-wrong")
        expect(wrong).to_contain_text("a wall of 9 mm is thicker than the organ")
        expect(use).to_be_disabled()
        bad = file.with_name("bad.toml")
        bad.write_text("[[preset]]\nname = 'x'\n")
        tab.page.locator("input[type=file]").last.set_input_files(bad)
        notice = tab.page.get_by_role("alert").filter(has_text="Not possible")
        expect(notice.first).to_contain_text("bad.toml is no preset")
        assert session.tissue.dissection.preset == preset
