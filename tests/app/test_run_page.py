"""Pages of recorded runs: they load, and play what the session drew."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from browser import playing
from simulated import phantom, pull_session
from test_html_player import AT_TOP, LARGEST

from app.export.recorded_run import RecordedRun
from app.simulation import PIECES, TICK_SECONDS
from app.trainer.pages.html_player import REST_SECONDS, run_page
from organ_geometry.mesh.skin import organ_skin

EDGE_LENGTH = 1.5
FIRST_TICK, SEEN_TICK = 10, 25


def run(*, torn: bool = True) -> RecordedRun:
    session = pull_session(phantom(), vertices=300)
    session.grab(0, 20.0)
    session.lift(6.0)
    session.advance(FIRST_TICK)
    session.lift(3.0)
    session.advance(20)
    if torn:
        session.set_target_force(session.planar.force_limit)
        while not session.run.over:
            session.advance()
    return RecordedRun.of_log(session.run_file().log, phantom(), frames=2000)


def test_page_plays_a_run_and_its_tear(tmp_path: Path) -> None:
    recorded = run()
    path = tmp_path / "run.html"
    path.write_text(run_page(recorded, edge_length=EDGE_LENGTH))
    assert path.stat().st_size < LARGEST
    motion, driving = recorded.motion, recorded.dissection.driving
    with playing(path) as player:
        about = player.page.locator("#about")
        assert "A recorded run of" in (about.text_content() or "")
        assert "it tore at" in (about.text_content() or "")
        skin = organ_skin(recorded.dissection.organ, edge_length=EDGE_LENGTH)
        bound = skin.bound_to(driving)
        moved = bound.deform(motion.transforms[SEEN_TICK], skin.vertices.copy())
        pieces = recorded.pieces(edge_length=EDGE_LENGTH)
        assert pieces is not None
        # The first piece is a stump between the clamp's jaws, which flatten it.
        lying = float(pieces[1].open(2.0, pieces[1].skin.vertices.copy())[:, 2].max())
        for time, names, top in (
            (SEEN_TICK * TICK_SECONDS, {"organ"}, float(moved[:, 2].max())),
            (float(motion.times[-1]), set(PIECES), lying),
        ):
            player.wait_at(
                REST_SECONDS + time + 0.01,
                lambda drawn, names=names, top=top: (
                    drawn.tops.keys() == names
                    and drawn.tops[max(names)] == pytest.approx(top, abs=AT_TOP)
                ),
            )


def test_a_page_of_a_whole_run_says_nothing_of_a_tear() -> None:
    page = run_page(run(torn=False), edge_length=2.0)
    assert "A recorded run of 1.0 s" in page
    assert "it tore" not in page
    assert "drawn, not computed" not in page


def test_keys_that_make_a_page_too_large_are_refused() -> None:
    recorded = run(torn=False)
    motion = recorded.motion
    many = 1000
    long = replace(
        motion,
        times=np.arange(many) * TICK_SECONDS,
        transforms=np.repeat(motion.transforms[:1], many, axis=0),
        fronts=np.full(many, -1.0),
        readings=motion.readings[:1] * many,
    )
    with pytest.raises(ValueError, match=r"a page holds at most .* take fewer frames"):
        run_page(replace(recorded, motion=long), edge_length=0.7)
