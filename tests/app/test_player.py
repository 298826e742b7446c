"""The player: one file that plays in a browser, with nothing behind it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from browser import PATIENCE, running_browser, wait_shown
from simulated import phantom

from app.export.motion import pull_motion
from app.export.order import Order
from app.simulation.dissection import Dissection
from app.simulation.preset import preset_named
from app.simulation.tear_course import SETTLED_SECONDS
from app.trainer.page_text import titled_page
from app.trainer.player import PULL_KEYS, REST_SECONDS, order_page, page_edge_length
from organ_geometry.mesh.skin import organ_skin
from physics import Cubic

LARGEST = 3_000_000
"""Bytes of a page that can still be sent by mail."""


def order() -> Order:
    dissection = Dissection.of(phantom(), preset_named("thesis-bile-duct"))
    edge_length = 1.5 * page_edge_length(dissection.organ)
    return Order(dissection, Cubic(), 0.5 * dissection.beam.span, edge_length=edge_length)


def test_page_plays_pull_and_tear_by_itself(tmp_path: Path) -> None:
    wanted = order()
    path = tmp_path / "player.html"
    path.write_text(order_page(wanted))
    assert path.stat().st_size < LARGEST
    errors: list[str] = []
    requests: list[str] = []
    with running_browser() as browser:
        page = browser.new_page(viewport={"width": 960, "height": 600})
        page.set_default_timeout(PATIENCE)
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.on("request", lambda request: requests.append(request.url))
        page.goto(f"{path.as_uri()}?fixedDpr=1")
        about = page.locator("#about")
        about.wait_for()
        assert "Not clinically validated, not a medical device." in about.inner_text()
        assert wanted.dissection.preset.title in about.inner_text()
        assert "a full round bar, 50.8 mm between the clamps" in about.inner_text()
        assert "Forces in N, lengths in mm." in about.inner_text()
        page.set_viewport_size({"width": 480, "height": 300})  # a small picture is drawn sooner
        assert "Forces in N" not in about.inner_text()
        assert "Not clinically validated, not a medical device." in about.inner_text()
        assert page.title() == wanted.dissection.preset.title
        skin = organ_skin(wanted.dissection.organ, edge_length=wanted.edge_length)
        used = np.unique(skin.faces[: skin.outer_faces])
        wait_shown(page, 0.5 * REST_SECONDS, skin.vertices[used])
        pull = pull_motion(
            wanted.dissection,
            wanted.theory,
            grasp=wanted.grasp,
            force=wanted.last_force(),
            frames=PULL_KEYS,
        )
        bound = skin.bound_to(wanted.dissection.driving)
        moved = bound.deform(pull.transforms[-2], skin.vertices.copy())[used]
        time = REST_SECONDS + float(pull.times[-2]) + 0.02
        wait_shown(page, time, moved)
        event = wanted.break_event
        assert event is not None
        piece = wanted.dissection.torn_at(event.check, edge_length=wanted.edge_length)[0]
        outer = np.unique(piece.skin.faces[: piece.skin.outer_faces])
        lying = piece.open(2.0, piece.skin.vertices.copy())[outer]
        time = REST_SECONDS + float(pull.times[-1]) + SETTLED_SECONDS + 0.02
        wait_shown(page, time, lying)
    assert not errors, errors
    assert all(url.startswith(("file:", "data:", "blob:")) for url in requests), requests


def test_a_force_below_the_break_is_pulled_to_and_not_torn() -> None:
    wanted = replace(order(), force=2.0)
    assert len(order_page(wanted)) < len(order_page(order()))


def test_edges_that_make_a_page_too_large_are_refused() -> None:
    with pytest.raises(ValueError, match="a page holds at most 12,000"):
        order_page(replace(order(), edge_length=0.3))


def test_titles_are_text() -> None:
    page = "<head><title>Viser</title></head><body><script>'</body>'</script></body>"
    titled = titled_page(page, "<b>A & B</b>", ["1 < 2"])
    assert "<title>&lt;b&gt;A &amp; B&lt;/b&gt;</title>" in titled
    assert "<p>1 &lt; 2</p>" in titled
    assert titled.index("</script>") < titled.index('<div id="about">') < titled.rindex("</body>")
