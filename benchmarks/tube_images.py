"""Images of a bent tube in noise, drawn for timing: any number, the same everywhere."""

import json
import os
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

SIDE = 512
"""Rows and columns of an image."""

INSIDE, OUTSIDE, NOISE = 180.0, 60.0, 6.0
LEVEL = 0.5 * (INSIDE + OUTSIDE)
"""Grey level half way between tube and background."""

RADIUS, SWAY, PERIOD = 60.0, 40.0, 400
SMOOTH = 2 * PERIOD
"""Images after which the tube is where it was."""

PIXEL_MM, STEP_MM = 0.1, 0.1


def draw_tube_images(folder: Path, count: int, distinct: int | None = None) -> None:
    """Write a stack of PNG images of a bent tube, with its spacing."""
    folder.mkdir(parents=True)
    distinct = count if distinct is None else min(distinct, count)
    rng = np.random.default_rng(512)
    for index in range(count):
        path = folder / f"slice_{index:05d}.png"
        drawn = index % distinct
        if drawn == index:
            cv2.imwrite(str(path), tube_image(index, rng), [cv2.IMWRITE_PNG_COMPRESSION, 1])
        else:
            os.link(folder / f"slice_{drawn:05d}.png", path)
    spacing = {"pixel_spacing_mm": [PIXEL_MM, PIXEL_MM], "slice_spacing_mm": STEP_MM}
    (folder / "spacing.json").write_text(json.dumps(spacing), encoding="utf-8")


def tube_image(index: int, rng: np.random.Generator) -> NDArray[np.uint8]:
    """Return one section: a disc with an anti-aliased edge, in noise."""
    turn = 2.0 * np.pi * index / PERIOD
    middle = 0.5 * (SIDE - 1.0) + SWAY * np.array([np.sin(turn), np.cos(0.5 * turn)])
    places = np.arange(SIDE)
    away = np.hypot(places - middle[0], places[:, np.newaxis] - middle[1])
    radius = RADIUS + 10.0 * np.sin(3.0 * turn)
    cover = np.clip(radius - away + 0.5, 0.0, 1.0)
    grey = OUTSIDE + (INSIDE - OUTSIDE) * cover + rng.normal(0.0, NOISE, cover.shape)
    return np.clip(np.rint(grey), 0.0, 255.0).astype(np.uint8)
