"""Organs of one's own for tests: round bars and tubes, drawn as images and built by the command."""

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from program import printed

from assets import BILE_DUCT_PHANTOM

IMAGES, DISTANCE = 30, 2.0
"""Sections, and mm between them."""


def drawn_bar(folder: Path, diameter: float, bore: float = 0.0) -> Path:
    """Images of an even round bar or tube, 64 pixels thick, edges blurred over one."""
    folder.mkdir(parents=True)
    pixel, size = diameter / 64.0, 96
    y, x = np.mgrid[:size, :size] - 0.5 * (size - 1)
    away = np.hypot(x, y) * pixel
    inside = np.clip((0.5 * diameter - away) / pixel + 0.5, 0.0, 1.0)
    inside -= np.clip((0.5 * bore - away) / pixel + 0.5, 0.0, 1.0) if bore else 0.0
    for number in range(IMAGES):
        cv2.imwrite(str(folder / f"{number:03d}.png"), (20.0 + 200.0 * inside).astype(np.uint8))
    (folder / "spacing.json").write_text(
        f'{{"pixel_spacing_mm": [{pixel}, {pixel}], "slice_spacing_mm": {DISTANCE}}}'
    )
    return folder


def phantom_start(folder: Path, count: int) -> Path:
    """The first images of the phantom: an eighth of them is built in an eighth of the time."""
    folder.mkdir()
    for path in [
        *sorted(BILE_DUCT_PHANTOM.glob("*.png"))[:count],
        BILE_DUCT_PHANTOM / "spacing.json",
    ]:
        shutil.copy(path, folder)
    return folder


def built_bar(folder: Path, diameter: float, bore: float = 0.0) -> Path:
    """The organ file that `compress` makes of a drawn bar."""
    organ = folder / f"bar_{diameter:g}_{bore:g}.organ"
    images = drawn_bar(folder / organ.stem, diameter, bore)
    printed("compress", images, "-o", organ, "--tolerance-px", 0.2)
    return organ


@pytest.fixture(scope="session")
def tube_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A hollow organ of one's own: 8 mm thick, a bore of 5 mm, 58 mm long."""
    return built_bar(tmp_path_factory.mktemp("tube"), 8.0, 5.0)
