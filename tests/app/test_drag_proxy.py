"""A real mouse drags duct and hook: places in order, under the mouse, with the camera still."""

import numpy as np
import pytest
from browser import RADIUS, newest, stage_pixel, trainer_page
from playwright.sync_api import Browser

from app.trainer.scene.drag_proxy import Hold
from app.trainer.server.trainer import Trainer

PIXELS = 3.0
"""How far the hand may be from the mouse in the picture: its last move and the page's rounding."""


@pytest.mark.parametrize(
    ("grip", "station"),
    [((16.0, -0.8 * RADIUS, 0.6 * RADIUS), 16.0), ((25.4, RADIUS, 1.4 * RADIUS), None)],
    ids=["duct", "hook"],
)
def test_drag_gives_places_under_the_mouse_and_leaves_the_camera(
    browser: Browser,
    trainer: Trainer,
    grip: tuple[float, float, float],
    station: float | None,
) -> None:
    with trainer_page(browser, trainer.address, width=900, height=600) as tab:
        view = newest(trainer)
        holds: list[Hold] = []
        phases: list[str] = []

        def record(phase: str, hold: Hold | None = None) -> None:
            phases.append(phase)
            if hold is not None:
                holds.append(hold)

        view._scene.let_drag(
            lambda hold: record("grabbed", hold),
            lambda hold: record("moved", hold),
            lambda: record("released"),
        )
        tab.wait_for_node("grip")
        tab.wait_for_camera(view)
        still = view.client.camera.position.copy()
        start = stage_pixel(tab, grip)
        mouse = tab.page.mouse
        tab.aim(start)
        mouse.down()
        for step in range(1, 9):
            came = len(phases)
            mouse.move(start[0] + 3.0 * step, start[1] - 9.0 * step)
            tab.wait_until(lambda came=came: len(phases) > came)

        def arrived() -> bool:
            end = stage_pixel(tab, tuple(holds[-1].place))
            return np.hypot(end[0] - start[0] - 24.0, end[1] - start[1] + 72.0) < PIXELS

        tab.wait_until(lambda: len(holds) > 3 and arrived())
        mouse.up()
        tab.wait_until(lambda: "released" in phases)

        assert phases[0] == "grabbed"
        assert phases[-1] == "released"
        assert phases.count("grabbed") == phases.count("released") == 1
        if station is None:
            assert holds[0].station is None
        else:
            assert holds[0].station == pytest.approx(station, abs=0.6)
        assert all(hold.station == holds[0].station for hold in holds)
        places = np.array([hold.place for hold in holds])
        heights = places[:, 2]
        assert np.all(np.diff(heights) >= -1e-9)
        assert np.all(np.diff(places[:, 0]) >= -1e-9)
        assert heights[-1] - heights[0] > 3.0
        # In the plane of the pull, and where the mouse is.
        np.testing.assert_allclose(places[:, 1], holds[0].start[1], atol=0.02)
        assert arrived()
        np.testing.assert_array_equal(view.client.camera.position, still)
