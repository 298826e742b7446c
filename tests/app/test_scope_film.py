"""A film of a run at an anatomy, by the command: as the scope's camera saw it, from its start."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from browser import chromium
from program import printed, run_process


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
