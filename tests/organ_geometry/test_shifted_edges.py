"""Edges moved out or in: circles by just so much, and masks to where they were cut from."""

import json
import math
from pathlib import Path

import cv2
import numpy as np
import pytest

from organ_geometry import TraceOptions
from organ_geometry.contours.edge_curve import enclosed_area
from organ_geometry.contours.organ_tracing import trace_organ
from organ_geometry.contours.traced_organ import NothingLeft, TracedSection
from organ_geometry.images.stack_reader import read_image_stack
from organ_geometry.organ_builder import build_organ

SQUARE = np.array([1.0, 1.0])
# An edge at an angle t to the pixels is (cos t - sin t) / 4 too far out, on average so much.
HALF_OF_FOUR_SAMPLES_PX = (math.sqrt(2.0) - 1.0) / math.pi


def ring(radius: float, *, clockwise: bool = False) -> np.ndarray:
    turn = np.linspace(0.0, 2.0 * np.pi, 200, endpoint=False) * (-1 if clockwise else 1)
    return 40.0 + radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)


def radius_of(points: np.ndarray) -> float:
    return math.sqrt(enclosed_area(points) / math.pi)


def section(outer: np.ndarray, lumen: np.ndarray | None = None) -> TracedSection:
    return TracedSection(0, outer, lumen, other_component=False, threshold=0.5)


@pytest.mark.parametrize("clockwise", [False, True])
@pytest.mark.parametrize("shift", [-3.0, 0.0, 2.0])
def test_a_ring_s_wall_grows_on_both_sides(shift: float, clockwise: bool) -> None:
    wall = section(ring(20.0, clockwise=clockwise), ring(10.0, clockwise=not clockwise))
    moved = wall.grown(shift, SQUARE)
    assert moved.lumen is not None
    radii = np.linalg.norm(moved.outer - 40.0, axis=1)
    np.testing.assert_allclose(radii, 20.0 + shift, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(moved.lumen - 40.0, axis=1), 10.0 - shift, atol=1e-9)


def test_the_shift_is_as_long_in_pixels_of_any_shape() -> None:
    pixel = np.array([0.5, 0.2])
    moved = section(ring(20.0) / pixel).grown(1.0, pixel)
    np.testing.assert_allclose(np.linalg.norm(moved.outer * pixel - 40.0, axis=1), 21.0, atol=1e-9)


def test_an_edge_is_not_moved_into_nothing() -> None:
    with pytest.raises(NothingLeft, match=r"edge of 20 mm radius cannot be moved in by 11 mm"):
        section(ring(20.0)).grown(-11.0, SQUARE)
    with pytest.raises(NothingLeft, match=r"edge of 5 mm radius cannot be moved in by 4 mm"):
        section(ring(20.0), ring(5.0)).grown(4.0, SQUARE)


@pytest.fixture(scope="module")
def masks(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Masks of a cylinder, a pixel set where two of its 2 x 2 samples are inside."""
    folder = tmp_path_factory.mktemp("masks")
    places = (np.arange(256) + 0.5) / 2.0 - 0.5
    for index in range(12):
        middle = 64.0 + np.array([0.37, -0.21]) * index
        inside = np.hypot(places - middle[0], places[:, np.newaxis] - middle[1]) < 40.0
        samples = inside.reshape(128, 2, 128, 2).sum(axis=(1, 3))
        cv2.imwrite(str(folder / f"{index:02d}.png"), np.where(samples >= 2, 255, 0))
    spacing = {"pixel_spacing_mm": [1.0, 1.0], "slice_spacing_mm": 4.0}
    (folder / "spacing.json").write_text(json.dumps(spacing), encoding="utf-8")
    return folder


def test_masks_that_are_an_eighth_of_a_pixel_too_large_are_put_right(masks: Path) -> None:
    found = trace_organ(read_image_stack(masks)).sections
    off = np.mean([radius_of(one.outer) for one in found]) - 40.0
    assert off == pytest.approx(HALF_OF_FOUR_SAMPLES_PX, abs=0.02)
    moved = [one.grown(-HALF_OF_FOUR_SAMPLES_PX, SQUARE) for one in found]
    assert np.mean([radius_of(one.outer) for one in moved]) == pytest.approx(40.0, abs=0.02)


def test_an_organ_s_edges_are_moved_and_that_is_said(masks: Path) -> None:
    stack = read_image_stack(masks)
    plain, larger = (build_organ(stack, TraceOptions(edge_shift_mm=shift)) for shift in (0.0, 2.5))
    grown = larger.organ.mean_radius - plain.organ.mean_radius
    assert grown == pytest.approx(2.5, abs=0.3)
    assert "edges are moved out by 2.5 mm, as asked" in larger.notes
    assert not any("moved" in note for note in plain.notes)
    with pytest.raises(ValueError, match="shift must be a length, not nan mm"):
        build_organ(stack, TraceOptions(edge_shift_mm=math.nan))
    with pytest.raises(ValueError, match=r"0 of 12 images .* cannot be moved in by 30 mm"):
        build_organ(stack, TraceOptions(edge_shift_mm=-30.0))
