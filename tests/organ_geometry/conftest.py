"""Drawn sections of known size, and stacks of them."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from organ_geometry.curves.half_curves import fit_half_curves
from organ_geometry.organ import Organ

# Samples along each side of a pixel: coverage is then known to better than 1/100 of a pixel.
SAMPLES = 8


def ellipse_cover(
    shape: tuple[int, int],
    centre: tuple[float, float],
    radii: tuple[float, float],
    samples: int = SAMPLES,
) -> NDArray[np.float64]:
    """The share of each pixel, of H rows and W columns, inside an ellipse, sizes in px."""
    offsets = (np.arange(samples) + 0.5) / samples - 0.5
    y = (np.arange(shape[0])[:, None] + offsets).reshape(-1, 1)
    x = (np.arange(shape[1])[:, None] + offsets).reshape(1, -1)
    inside = ((x - centre[0]) / radii[0]) ** 2 + ((y - centre[1]) / radii[1]) ** 2 < 1.0
    return inside.reshape(shape[0], samples, shape[1], samples).mean(axis=(1, 3))


@pytest.fixture
def cover() -> Callable[..., NDArray[np.float64]]:
    return ellipse_cover


@pytest.fixture
def write_stack(tmp_path: Path) -> Callable[..., Path]:
    """Writes images, and a spacing.json if one is given, to a new folder."""

    def write(
        images: Sequence[NDArray[Any]],
        spacing: dict[str, Any] | None = None,
        suffix: str = ".png",
        names: Sequence[str] | None = None,
    ) -> Path:
        folder = tmp_path / "stack"
        folder.mkdir()
        for index, image in enumerate(images):
            name = f"slice_{index}" if names is None else names[index]
            assert cv2.imwrite(str(folder / f"{name}{suffix}"), image)
        if spacing is not None:
            (folder / "spacing.json").write_text(json.dumps(spacing))
        return folder

    return write


@pytest.fixture
def make_tube() -> Callable[..., Organ]:
    """Makes straight organs along +x of circular sections, a key section each."""

    def circle_row(radius: float) -> NDArray[np.float64]:
        angles = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
        return fit_half_curves(radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)).as_row()

    def make(
        radii: Sequence[float], inner: Sequence[float] | None = None, length: float = 10.0
    ) -> Organ:
        count = len(radii)
        axis = np.zeros((count, 3))
        axis[:, 0] = np.linspace(0.0, length, count)
        frame = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
        return Organ(
            axis=axis,
            frames=np.broadcast_to(frame, (count, 3, 3)),
            keys=np.arange(count),
            outer=np.array([circle_row(radius) for radius in radii]),
            lumen=None if inner is None else np.array([circle_row(radius) for radius in inner]),
        )

    return make
