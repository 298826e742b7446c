"""Building an organ in the page, in a real browser."""

import io
import re
import time
import zipfile
from pathlib import Path

import cv2
import numpy as np
import pytest
from browser import PATIENCE, TrainerPage, newest, trainer_page
from playwright.sync_api import Browser, expect
from program import LONGEST
from simulated import phantom

from app.simulation import Phase
from app.trainer.panel.page_panel import PagePanel
from app.trainer.server.trainer import Trainer
from assets import BILE_DUCT_PHANTOM
from organ_geometry import Promise
from organ_geometry.images.stack_reader import read_image_stack
from organ_geometry.organ_builder import build_organ


def downloaded(tab: TrainerPage) -> tuple[str, bytes]:
    with tab.page.expect_download() as waiting:
        tab.press("Download .organ")
    return waiting.value.suggested_filename, Path(waiting.value.path()).read_bytes()


def test_the_phantom_is_built_practised_on_and_downloaded(
    browser: Browser, trainer: Trainer
) -> None:
    with trainer_page(browser, trainer.address, width=1440, height=900) as tab:
        view = newest(trainer)
        session = view.session
        tab.open("Build")
        assert trainer._workers.builder._thread is None
        tab.press("Use the built-in phantom")
        result = tab.page.get_by_test_id("build-result")
        expect(result).to_contain_text("128 in, 128 found, 10 kept", timeout=3 * PATIENCE)
        expect(result).to_have_attribute(
            "data-bytes", str(len(phantom().encoded)), timeout=PATIENCE
        )
        caption = tab.page.get_by_test_id("build-caption")
        expect(caption).to_contain_text("section_064.png: ▬ outer edge ▬ lumen")
        tab.slide("Image", 3)
        expect(caption).to_contain_text("section_003.png")
        assert downloaded(tab) == ("bile_duct_phantom.organ", phantom().encoded)

        tab.slide("Threshold (px)", 1.6)
        expect(result).to_have_attribute("data-tolerance-mm", "0.19921875")
        coarse = build_organ(
            read_image_stack(BILE_DUCT_PHANTOM), promise=Promise(tolerance_px=1.6)
        ).organ.encoded
        assert len(coarse) < len(phantom().encoded)
        assert downloaded(tab) == ("bile_duct_phantom.organ", coarse)

        session.set_target_force(2.0)
        before = session.drawn.shape
        tab.press("Practise on it")
        tab.wait_until(lambda: session.tissue.dissection.organ.encoded == coarse)
        tab.wait_until(lambda: session.drawn.shape > before)
        assert not session.run.started
        assert session.planar.grasper.slider_force == 0.0
        tab.open("Train")
        tab.slide("Force F (N)", 1.0)  # its own hollow sections tear at 1.8 N
        tab.wait_for_force(1.0)
        skin = session.drawn.surfaces[0].skin
        wall = skin.wall_size
        tab.wait_until(lambda: tab.vertices("skin").shape == (wall, 3))
        tab.page.keyboard.press("Escape")
        view.state.ramp_to_tear()
        tab.wait_for_phase("torn")
        assert session.reading().phase is Phase.TORN


def test_a_short_organ_that_is_sent_is_practised_on_with_a_preset_that_fits(
    browser: Browser, trainer: Trainer, tmp_path: Path
) -> None:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        for path in sorted(BILE_DUCT_PHANTOM.glob("*.png"))[:20]:
            archive.write(path, f"scan/{path.name}")
    sent = tmp_path / "short duct.zip"
    sent.write_bytes(content.getvalue())
    with trainer_page(browser, trainer.address) as tab:
        view = newest(trainer)
        tab.open("Build")
        status = tab.page.get_by_test_id("build-status")
        chooser = tab.page.locator("input[type=file]").last
        for wrong, message in ((b"no zip", "this cannot be read: send a zip"), (b"", "send a zip")):
            (tmp_path / "wrong.zip").write_bytes(wrong)
            chooser.set_input_files(tmp_path / "wrong.zip")
            expect(status).to_contain_text(message)
            notice = tab.page.get_by_role("alert").filter(has_text="Not possible")
            expect(notice.first).to_contain_text(message)
        again = tab.page.get_by_role("button", name="Read them with these sizes")
        expect(again).to_have_count(0)
        place, button = status.bounding_box(), tab.page.get_by_role("button", name="Open images")
        below = button.bounding_box()
        assert place is not None
        assert below is not None
        assert place["y"] < below["y"]  # in sight, whatever is below
        chooser.set_input_files(sent)
        expect(status).to_contain_text(
            "give the pixel size and the slice distance", timeout=PATIENCE
        )
        tab.slide("Pixel (mm)", 0.125)
        tab.slide("Slice distance (mm)", 0.4)
        tab.press("Read them with these sizes")
        result = tab.page.get_by_test_id("build-result")
        expect(result).to_contain_text("20 in, 20 found")
        expect(result).to_contain_text(
            re.compile("too short or too thick to be clamped as .*thesis", re.I), timeout=PATIENCE
        )
        tab.slide("Threshold (px)", 0.1)
        expect(status).to_contain_text("the smallest that can is", timeout=3 * PATIENCE)
        expect(result).to_have_count(0)
        tab.slide("Threshold (px)", 1.6)
        expect(result).to_have_attribute("data-tolerance-mm", "0.19921875")
        panel = view._panel
        assert isinstance(panel, PagePanel)
        folder = panel._build._bench._folder
        assert folder is not None
        place = Path(folder.name)
        assert place.is_dir()
        tab.press("Practise on it")
        session = view.session
        tab.wait_until(
            lambda: session.tissue.dissection.organ.length == pytest.approx(7.6, abs=0.1)
        )
        tab.open("Model")
        tab.wait_until(lambda: panel._model._preset.value == "Own sections, assumed tissue")
        titles = tuple(preset.title for preset in session.presets_offered())
        assert panel._model._preset.options == titles
        tab.open("Train")
        tab.slide("Force F (N)", 1.0)
        tab.wait_for_force(1.0)
    wait_until_gone(place)


def two_tubes(path: Path) -> Path:
    """A zip of eight images of a wide tube about (20, 24) and a thin one about (52, 10)."""
    image = np.random.default_rng(2).integers(20, 60, (48, 64)).astype(np.uint8)
    cv2.circle(image, (20, 24), 14, 200, -1)
    cv2.circle(image, (52, 10), 6, 200, -1)
    content = cv2.imencode(".png", image)[1].tobytes()
    with zipfile.ZipFile(path, "w") as archive:
        for number in range(8):
            archive.writestr(f"scan/{number}.png", content)
        archive.writestr(
            "scan/spacing.json", '{"pixel_spacing_mm": 0.5, "slice_spacing_mm": 5, "units": "mm"}'
        )
    return path


@pytest.mark.parametrize(
    ("width", "height"), [(390, 844), pytest.param(1280, 800, marks=pytest.mark.long)]
)
def test_an_organ_that_is_probably_another_is_asked_about_and_a_click_says_which_is_meant(
    browser: Browser, trainer: Trainer, tmp_path: Path, width: int, height: int
) -> None:
    with trainer_page(browser, trainer.address, width=width, height=height) as tab:
        session = newest(trainer).session
        shipped = session.tissue.dissection.organ
        tab.open("Build")
        page = tab.page
        with page.expect_file_chooser() as chosen:
            tab.press("Open images")
        chosen.value.set_files(two_tubes(tmp_path / "scan.zip"))
        result = page.get_by_test_id("build-result")
        expect(result).to_have_attribute("data-doubts", "1")
        doubts = result.get_by_test_id("build-doubts")
        expect(doubts).to_contain_text("Probably another organ than the one wanted")
        expect(doubts).to_contain_text("8 of 8 sections show another part")

        # Its button is not the one that stands out, and nothing is practised on before a yes.
        def color(name: str) -> str:
            button = page.get_by_role("button", name=name, exact=True)
            return button.evaluate("each => getComputedStyle(each).backgroundColor")

        tab.wait_until(lambda: color("Practise on it") == color("Download .organ"))
        tab.press("Practise on it")
        dialog = page.get_by_role("dialog")
        expect(dialog).to_contain_text("8 of 8 sections show another part")
        dialog.get_by_role("button", name="Back to the images").click()
        expect(dialog).to_have_count(0)
        assert session.tissue.dissection.organ is shipped
        tab.press("Practise on it")
        dialog.get_by_role("button", name="Practise on it all the same").click()
        tab.wait_until(
            lambda: session.tissue.dissection.organ.mean_radius == pytest.approx(7.1, abs=0.1)
        )

        image = page.get_by_test_id("build-image")
        box = image.bounding_box()
        assert box is not None
        image.click(position={"x": 52.5 / 64 * box["width"], "y": 10.5 / 48 * box["height"]})
        expect(result).to_have_attribute("data-doubts", "0")
        expect(result).to_contain_text("8 in, 8 found")
        tab.wait_until(lambda: color("Practise on it") != color("Download .organ"))
        expect(tab.row("Point").locator("input")).to_have_value("52,10,4")
        tab.press("Practise on it")
        tab.wait_until(
            lambda: session.tissue.dissection.organ.mean_radius == pytest.approx(3.1, abs=0.1)
        )

        # The first image is left out, and all are looked at again by the button.
        page.get_by_text("Look only here", exact=True).first.click()
        tab.row("Images").locator("input").fill("1-7")
        expect(result).to_contain_text("7 in, 7 found")
        tab.press("Look everywhere")
        expect(result).to_have_attribute("data-doubts", "1")
        expect(result).to_contain_text("8 in, 8 found")


def wait_until_gone(place: Path) -> None:
    """What a client has sent is removed when its page is closed."""
    end = time.monotonic() + LONGEST
    while place.exists():
        assert time.monotonic() < end, "it is still there"
        time.sleep(0.05)
