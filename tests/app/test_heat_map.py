"""The heat map: cividis from none to the threshold, and the page shows the colours of its key."""

import re
import time
from threading import Thread

import cv2
import numpy as np
import pytest
from browser import TrainerPage, trainer_page
from hypothesis import given, settings
from hypothesis import strategies as st
from playwright.sync_api import Browser
from simulated import phantom

from app.trainer.server.trainer import Trainer
from app.trainer.stage.camera import TOWARDS_VIEWER, viewpoint
from app.trainer.stage.heat_map import DARKEST, heat_colors, heat_legend_html
from app.trainer.stage.tone import color_table, light_for, light_table, shown_color

LEVELS = np.arange(256, dtype=np.uint8)[:, None]
CIVIDIS = cv2.applyColorMap(LEVELS, cv2.COLORMAP_CIVIDIS)[:, 0, ::-1].astype(int)
EXACT = 232
"""Levels of the map that the page's tone curve has; beyond, its yellow is paler."""
SCREEN = 5
"""Of 255: what is lost between the key and a picture of the page, where the wall faces the viewer
to some degrees."""


def test_colours_are_cividis_as_far_as_the_page_has_them() -> None:
    assert np.abs(color_table()[:EXACT].astype(int) - CIVIDIS[:EXACT]).max() <= 1
    lightness = color_table() @ np.array([0.2126, 0.7152, 0.0722])
    assert np.all(np.diff(lightness) > -0.5)  # a level's rounding


@given(st.tuples(*[st.integers(0, 255)] * 3))
def test_tone_curve_is_inverted(color: tuple[int, int, int]) -> None:
    light = light_for(color)
    if light.min() > 0.0 and max(color) < 250:
        np.testing.assert_allclose(shown_color(light), color, atol=0.5)


@given(st.lists(st.floats(-0.5, 1.5), min_size=1, max_size=50))
@settings(deadline=None)
def test_surface_that_faces_the_viewer_has_the_colours_of_the_stress(shares: list[float]) -> None:
    share = np.array(shares)
    normals = np.tile(np.array([0.0, -0.8, 0.6], np.float32), (share.size, 1))
    out = np.empty((share.size, 3), np.float32)
    heat_colors(share, normals, np.array([0.0, -0.8, 0.6]), out)
    place = np.clip(share, 0.0, 1.0) * 255.0
    expected = np.stack([np.interp(place, np.arange(256), light_table()[:, i]) for i in range(3)])
    np.testing.assert_allclose(out, expected.T, rtol=1e-5, atol=1e-6)
    heat_colors(share, -normals, np.array([0.0, -0.8, 0.6]), out)
    np.testing.assert_allclose(out, DARKEST * expected.T, rtol=1e-5, atol=1e-6)


def test_key_has_the_same_colours_unit_and_break() -> None:
    key = heat_legend_html(0.2106)
    stops = np.array(
        [list(map(int, stop)) for stop in re.findall(r"rgb\((\d+),(\d+),(\d+)\)", key)]
    )
    assert len(stops) > 16
    assert (stops[0] == color_table()[0]).all()
    assert (stops[-1] == color_table()[-1]).all()
    table = set(map(tuple, color_table().astype(int).tolist()))
    assert set(map(tuple, stops.tolist())) <= table
    assert "breaks at 211 kPa" in key
    assert "cividis" in key
    for bad in (0.0, -1.0, float("nan")):
        with pytest.raises(ValueError, match="threshold must be above 0 MPa"):
            heat_legend_html(bad)


def test_page_shows_the_colour_of_the_stress(drawing_browser: Browser) -> None:
    trainer = Trainer(phantom(), port=0, look="plain")
    try:
        with trainer_page(drawing_browser, trainer.address, width=900, height=600) as tab:
            (view,) = trainer._views.values()
            scene, session = view._scene, view.session
            (surface,) = session.surfaces
            scene.set_heat(True)
            for share in (0.1, 0.5, 0.85):
                stress = [np.full(len(surface.skin.vertices), share)]
                # Not in this thread: playwright's loop runs in it.
                drawing = Thread(target=lambda s=stress: scene.draw(session.reading(), s))
                drawing.start()
                drawing.join()
                wanted = color_table()[round(share * 255)].astype(int)
                _wait_for_color(tab, wanted)
    finally:
        trainer.stop()


def _wait_for_color(tab: TrainerPage, wanted: np.ndarray) -> None:
    """Wait until the duct shows a colour a quarter of the span from the clamp."""
    canvas = tab.page.locator("canvas[data-engine]").bounding_box()
    assert canvas is not None
    aspect = canvas["width"] / canvas["height"]
    view = viewpoint(50.8, 4.4453, aspect)
    point = np.array([[16.0, 0.0, 0.0]]) + 4.4453 * TOWARDS_VIEWER
    right, up = view.picture_points(point, aspect)[0]
    column = round(canvas["x"] + 0.5 * (1.0 + right) * canvas["width"])
    row = round(canvas["y"] + 0.5 * (1.0 - up) * canvas["height"])
    shown = np.zeros(3)
    for _ in range(40):
        picture = cv2.imdecode(np.frombuffer(tab.page.screenshot(), np.uint8), cv2.IMREAD_COLOR)
        assert picture is not None
        shown = picture[row - 1 : row + 2, column - 1 : column + 2].mean(axis=(0, 1))[::-1]
        if np.abs(shown - wanted).max() <= SCREEN:
            return
        time.sleep(0.5)
    raise AssertionError(f"the page shows {shown.round()}, the key says {wanted}")
