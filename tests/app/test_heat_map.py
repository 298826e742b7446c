"""The heat map: cividis from none to the threshold, and the page shows the colours of its key."""

import re
import time
from threading import Thread

import cv2
import numpy as np
import pytest
from browser import PATIENCE, TrainerPage, newest, scene_of, trainer_page
from hypothesis import assume, given
from hypothesis import strategies as st
from playwright.sync_api import Browser, FloatRect
from projection import picture_points
from simulated import phantom

from app.trainer.server.trainer import Trainer
from app.trainer.stage.camera import TOWARDS_VIEWER, viewpoint
from app.trainer.stage.clamps import STUB
from app.trainer.stage.heat_map import heat_legend_html
from app.trainer.stage.lighting import Look
from app.trainer.stage.refined_surface import DARKEST
from app.trainer.stage.tone import color_table, light_for, light_table, shown_color

LEVELS = np.arange(256, dtype=np.uint8)[:, None]
CIVIDIS = cv2.applyColorMap(LEVELS, cv2.COLORMAP_CIVIDIS)[:, 0, ::-1].astype(int)
EXACT = 232
"""Levels of the map that the page's tone curve has; beyond, its yellow is paler."""
STUB_RINGS = len(STUB)
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
    assume(light.min() > 0.0 and max(color) < 250)
    np.testing.assert_allclose(shown_color(light), color, atol=0.5)


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


@pytest.mark.parametrize("look", ["plain", pytest.param("full", marks=pytest.mark.long)])
def test_page_shows_the_colour_of_the_stress(
    drawing_browser: Browser, monkeypatch: pytest.MonkeyPatch, look: Look
) -> None:
    trainer = Trainer(phantom(), port=0, scene="free", look=look)
    try:
        with trainer_page(drawing_browser, trainer.address, width=900, height=600, dots=0.5) as tab:
            view = newest(trainer)
            session = view.session
            # The trainer has drawn the duct at rest, and draws it no more.
            tab.wait_until(lambda: view.frames and not view._undrawn)
            (surface,) = session.drawn.surfaces
            skin = surface.skin

            def draw(fractions: np.ndarray) -> None:
                # Not in this thread: playwright's loop runs in it.
                stress = [fractions.astype(np.float32)]
                monkeypatch.setattr(scene_of(view), "values", lambda colours: stress)
                drawing = Thread(target=view._scene.draw, args=(session.reading(), "stress"))
                drawing.start()
                drawing.join()

            for fraction in (0.1, 0.5, 0.85):
                draw(np.full(len(skin.vertices), fraction))
                wanted = color_table()[round(fraction * 255)].astype(int)
                _wait_for_color(tab, wanted)
            fractions = np.random.default_rng(5).uniform(-0.5, 1.5, len(skin.vertices))
            fraction = np.clip(skin.grid(fractions), 0.0, 1.0)
            node = "/organ/skin" if look == "full" else "/organ/skin_stress"
            viewer = session.tissue.dissection.frame @ TOWARDS_VIEWER
            draw(fractions)

            def lit() -> None:
                light, normals = _drawn_light(tab, node, viewer)
                inner = slice(STUB_RINGS, STUB_RINGS + skin.rings)
                place = 255.0 * fraction
                table = [np.interp(place, np.arange(256), light_table()[:, i]) for i in range(3)]
                turn = np.clip((1.0 - np.clip(normals[inner], 0.0, None)) / 0.75, 0.0, 1.0)
                expected = np.stack(table, axis=-1) * (1.0 - (1.0 - DARKEST) * turn**2)[..., None]
                np.testing.assert_allclose(light[inner], expected, atol=2e-5)
                assert normals[inner].max() > 0.99  # some face the viewer, and some do not
                assert turn.max() == 1.0
                # In the clamps nobody has computed any.
                assert np.ptp(light[: STUB_RINGS - 1].reshape(-1, 3), axis=0).max() == 0.0

            tab.eventually(lit)
    finally:
        trainer.stop()


def _drawn_light(tab: TrainerPage, node: str, viewer: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Light that the page draws a streamed surface's outer rings in, and how they face a viewer."""
    found = tab.page.evaluate(
        """name => {
            const { mesh, columns, grids } = window.bluntdissectSurfaces.surfaces.get(name);
            const of = kind => Array.from(mesh.geometry.attributes[kind].array)
                .slice(0, 3 * grids[0].rows * columns);
            return { shape: [grids[0].rows, columns, 3], color: of("color"), normal: of("normal") };
        }""",
        node,
    )
    # Each second point of each second row is one that was streamed.
    color, normal = (
        np.reshape(found[kind], found["shape"])[::2, :-1:2] for kind in ("color", "normal")
    )
    return color, normal @ viewer / np.linalg.norm(viewer)


def _wait_for_color(tab: TrainerPage, wanted: np.ndarray) -> None:
    """Wait until the duct shows a colour a quarter of the span from the clamp."""
    canvas = tab.page.locator("canvas[data-engine]").bounding_box()
    assert canvas is not None
    aspect = canvas["width"] / canvas["height"]
    view = viewpoint(50.8, 4.4453, aspect)
    point = np.array([[16.0, 0.0, 0.0]]) + 4.4453 * TOWARDS_VIEWER
    right, up = picture_points(view, point, aspect)[0]
    column = round(canvas["x"] + 0.5 * (1.0 + right) * canvas["width"])
    row = round(canvas["y"] + 0.5 * (1.0 - up) * canvas["height"])
    around: FloatRect = {"x": column - 1, "y": row - 1, "width": 3, "height": 3}
    end = time.monotonic() + PATIENCE / 1000
    while True:
        content = np.frombuffer(tab.page.screenshot(clip=around), np.uint8)
        picture = cv2.imdecode(content, cv2.IMREAD_COLOR)
        assert picture is not None
        shown = picture.mean(axis=(0, 1))[::-1]
        if np.abs(shown - wanted).max() <= SCREEN:
            return
        assert time.monotonic() < end, f"the page shows {shown.round()}, the key says {wanted}"
        tab.page.wait_for_timeout(200)
