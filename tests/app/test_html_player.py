"""The player: one file that plays in a browser, with nothing behind it."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from browser import RADIUS, playing
from simulated import phantom

from app.export.bed_export import BedExport
from app.export.pull_export import PAGE_KEYS, PullExport
from app.simulation import PIECES, SETTLED_SECONDS, Dissection, Specimen, bed_named, preset_named
from app.trainer.pages.html_player import REST_SECONDS, export_page, page_edge_length
from app.trainer.viser_bridge.recording import recording_page
from organ_geometry.mesh.skin import organ_skin
from physics import Cubic

AT_TOP = 0.4
"""How near the top of a surface must be to the skin's, mm: the wire raises the wall beside it."""
LARGEST = 3_000_000
"""Bytes of a page that can still be sent by mail."""


def order() -> PullExport:
    specimen = Specimen(preset_named("thesis-bile-duct"), phantom(), theory=Cubic())
    edge_length = 1.5 * page_edge_length(phantom())
    return PullExport(specimen, 0.5 * specimen.beam.span, edge_length=edge_length)


def top_of(dissection: Dissection, vertices: np.ndarray) -> float:
    """How high a surface of the shipped duct reaches, mm: it lies along x and is pulled along z."""
    assert np.array_equal(dissection.frame, np.eye(3))
    return float(vertices[:, 2].max())


@pytest.mark.long  # twice through in software
def test_page_plays_pull_and_tear_the_same_each_time_through(tmp_path: Path) -> None:
    wanted = order()
    dissection, event = wanted.dissection, wanted.break_event
    assert event is not None
    path = tmp_path / "player.html"
    path.write_text(export_page(wanted, edge_length=wanted.edge_length))
    assert path.stat().st_size < LARGEST
    with playing(path) as player:
        page = player.page
        for number, pictures in enumerate(player.passes(2)):
            heights: list[float] = []
            for drawn in pictures:
                assert drawn.lights == ["AmbientLight", "PointLight", "SpotLight"], drawn
                assert not drawn.around, drawn
                assert drawn.fog == pictures[0].fog, drawn
                lifted = re.search(r"lifted ([\d.]+) mm", drawn.caption)
                assert drawn.tops.keys() <= ({"organ"} if lifted else set(PIECES)), drawn
                height = float(lifted[1]) if lifted else event.deflection
                assert height - 0.1 < drawn.hook < height + 2.7 * RADIUS, drawn
                if lifted:
                    assert drawn.hook < height + 0.3 * RADIUS, drawn
                heights.append(height)
            assert heights == sorted(heights), number
            assert pictures[-1].caption == "F 0 N   torn in two", number
            assert pictures[-1].tops.keys() == set(PIECES), number

        skin = organ_skin(dissection.organ, edge_length=wanted.edge_length)
        pull = wanted.pull(PAGE_KEYS)
        bound = skin.bound_to(dissection.driving)
        lying = [
            top_of(dissection, piece.open(2.0, piece.skin.vertices.copy()))
            for piece in dissection.torn_at(event.check, edge_length=wanted.edge_length)
        ]
        rest = top_of(dissection, skin.vertices)
        pulled = top_of(dissection, bound.deform(pull.transforms[-2], skin.vertices.copy()))
        assert pulled > rest + 10.0
        before_tear = REST_SECONDS + float(pull.times[-2]) + 0.02
        after = REST_SECONDS + float(pull.times[-1]) + SETTLED_SECONDS + 0.02
        for time, tops, words in (
            (before_tear, {"organ": pulled}, "distance to break"),
            (after, dict(zip(PIECES, lying, strict=True)), "torn in two"),
            (0.5 * REST_SECONDS, {"organ": rest}, "lifted 0.0 mm"),  # and back
        ):
            player.wait_at(
                time,
                lambda drawn, tops=tops, words=words: (
                    words in drawn.caption and drawn.tops == pytest.approx(tops, abs=AT_TOP)
                ),
            )
        about = page.locator("#about")
        assert "Not clinically validated, not a medical device." in about.inner_text()
        assert "Forces in N" not in about.inner_text()
        page.set_viewport_size({"width": 960, "height": 600})
        assert "Forces in N, lengths in mm." in about.inner_text()
        assert dissection.preset.title in about.inner_text()
        assert page.title() == dissection.preset.title


def test_a_force_below_the_break_is_pulled_to_and_not_torn() -> None:
    wanted = replace(order(), force=2.0)
    assert len(export_page(wanted, edge_length=wanted.edge_length)) < len(
        export_page(order(), edge_length=order().edge_length)
    )


def test_edges_that_make_a_page_too_large_are_refused() -> None:
    with pytest.raises(ValueError, match="a page holds at most 12,000"):
        export_page(order(), edge_length=0.3)


def test_titles_are_text() -> None:
    page = "<head><title>Viser</title></head><body><script>'</body>'</script></body>"
    titled = recording_page(page, "<b>A & B</b>", ["1 < 2"], distance=90.0, aspect=1.6)
    assert "<title>&lt;b&gt;A &amp; B&lt;/b&gt;</title>" in titled
    assert '<p class="note">1 &lt; 2</p>' in titled
    assert titled.index("</script>") < titled.index('<div id="about"') < titled.rindex("</body>")


def test_a_page_plays_how_a_duct_is_freed_and_torn(tmp_path: Path) -> None:
    specimen = Specimen(preset_named("thesis-bile-duct"), phantom(), bed_named("inflamed"))
    path = ((0.0, 0.0, 14.0),)
    wanted = BedExport(specimen, 25.4, path, steps=20, elements=40, strands=150)
    page_file = tmp_path / "torn.html"
    page_file.write_text(export_page(wanted, edge_length=page_edge_length(phantom())))
    motion = wanted.motion
    assert motion.bed is not None
    with playing(page_file) as player:
        (pictures,) = player.passes(1)
        player.wait_at(
            0.5 * REST_SECONDS,
            lambda drawn: drawn.parted == 0 and "freed 0.0 mm" in drawn.caption,
        )
    freed = [re.search(r"freed ([\d.]+) mm", drawn.caption) for drawn in pictures]
    lengths = [float(found[1]) for found in freed if found]
    assert lengths == sorted(lengths)
    assert lengths[-1] > 5.0
    assert pictures[-1].parted == int((motion.bed.damage[-1] >= 1.0).sum())
    assert pictures[-1].tops.keys() == set(PIECES)
    assert pictures[-1].caption == "F 0 N   torn in two"
    assert "and tears it at 25.4 mm" in page_file.read_text()


def test_a_page_of_a_duct_in_its_bed_says_which_and_can_be_sent() -> None:
    specimen = Specimen(preset_named("thesis-bile-duct"), phantom(), bed_named("loose"))
    edge_length = page_edge_length(phantom())
    few, many = (
        export_page(
            BedExport(
                specimen,
                25.4,
                ((0.0, 0.0, 8.0),),
                steps=8,
                elements=20,
                strands=count,
            ),
            edge_length=edge_length,
        )
        for count in (40, 600)
    )
    assert "50.8 mm between the clamps in a bed, loose areolar tissue; a hook frees it" in many
    assert len(few) + 10_000 < len(many) < LARGEST
