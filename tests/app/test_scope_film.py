"""A film of a run at an anatomy, by the command: as the scope's camera saw it, from its start."""

import math
from pathlib import Path

import cv2
import numpy as np
import pytest
from browser import chromium
from program import printed, run_process

from app.anatomy import anatomy_named, anatomy_network
from app.simulation import FEW, FIELD_OF_VIEW, Session, Specimen, run_json
from app.trainer.scope.held_scope import HeldScope
from app.trainer.scope.pose import OBLIQUE

ROUND = 0.55
"""Of a film's sides: the radius of its round picture, which is a little cut."""


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> list[np.ndarray]:
    """Return a film's first and last picture, (H, W, 3) red, green and blue, of a torn artery."""
    chromium()
    folder = tmp_path_factory.mktemp("film")
    kept, film = folder / "hasty.json", folder / "hasty.webp"
    script = Path(__file__).parents[2] / "assets" / "scripts" / "hasty.toml"
    printed("perform", script, "--anatomy", "normal", "-o", kept)
    done = run_process("replay", kept, "-o", film, "--frames", 2)  # its driver wants its own loop
    assert done.returncode == 0, done.stderr
    read, found = cv2.imreadanimation(str(film))
    assert read
    return [each[..., 2::-1].astype(float) for each in found.frames]


def test_a_film_begins_with_the_covered_triangle_and_ends_in_blood(
    pictures: list[np.ndarray],
) -> None:
    assert len(pictures) == 2
    for each in pictures:
        high, wide, _ = each.shape
        assert high == wide
        assert each[: high // 16, : wide // 16].max() < 30.0, "the picture is round"
    first, last = (each[each.shape[0] // 4 : -each.shape[0] // 4] for each in pictures)
    assert first.mean() > 60.0, "fat in the scope's light"
    assert first.std() > 25.0
    red = [(each[..., 0] > 2.5 * each[..., 1]).mean() for each in (first, last)]
    assert red[1] > red[0] + 0.03


def test_a_film_of_an_oblique_scope_looks_aside(tmp_path: Path) -> None:
    """The gallbladder is where the pose's algebra has it; a straight scope sees the liver there.

    So it is from the first picture on: a run begins with the view as it is held.
    """
    chromium()
    anatomy = anatomy_named("normal")
    session = Session(Specimen.of_anatomy(anatomy), vertices=FEW)
    held = HeldScope(anatomy_network(anatomy))
    held.change()
    assert held.scope.angle == OBLIQUE
    session.look_from(held.view)
    session.open_jaws(1, 1.0)
    session.advance(5)
    kept, film = tmp_path / "run.json", tmp_path / "run.webm"
    kept.write_bytes(run_json(session.run_file()))
    done = run_process("replay", kept, "-o", film, "--frames", 2)
    assert done.returncode == 0, done.stderr
    read = cv2.VideoCapture(str(film))
    place = session.spatial.beam.places_at(np.array([20.0]), "gallbladder")[0]
    camera = held.camera
    right, up, back = camera.axes.T @ (place + 8.0 * camera.axes[:, 2] - camera.tip)
    for _ in range(2):
        there, found = read.read()
        assert there
        picture = found[..., ::-1].astype(float)
        dots = ROUND * len(picture) / (-back * math.tan(0.5 * FIELD_OF_VIEW))
        x, y = round(0.5 * len(picture) + dots * right), round(0.5 * len(picture) - dots * up)
        red, green, _ = picture[y - 2 : y + 3, x - 2 : x + 3].mean(axis=(0, 1))
        assert green > 60.0
        assert red < 1.1 * green, "the liver's is twice as red"
