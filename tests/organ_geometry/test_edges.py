"""Edges of drawn sections come out where they were drawn."""

from collections.abc import Callable

import numpy as np
import pytest
from drawn_stack import traced_edges, traced_image
from numpy.typing import NDArray

from organ_geometry.contours.edge_curve import NoEdgeFound
from organ_geometry.contours.edges import BORDER_PROBLEM, as_grey, find_polarity
from organ_geometry.contours.trace_options import Polarity

Cover = Callable[..., NDArray[np.float64]]

SHAPE = (128, 140)
CENTRE = (68.3, 60.7)
# What a section must give at least; a mask's pixel steps average out to about half of it.
RADIUS_TOLERANCE_PX = 0.1
# Without pixel steps and noise only the correction for blur is left, exact to second order.
CLEAN_TOLERANCE_PX = 0.02
NOISE = 15.0


def drawn(
    cover: NDArray[np.float64], polarity: str, kind: str, depth: type[np.unsignedinteger]
) -> NDArray[np.unsignedinteger]:
    """An image of what is covered: 255 on 0 for a mask, else 180 on 60 with noise."""
    if kind == "mask":
        grey = 255.0 * (cover >= 0.5)
    elif kind == "clean":
        grey = 60.0 + 120.0 * cover
    else:
        grey = 60.0 + 120.0 * cover + np.random.default_rng(5).normal(0.0, NOISE, cover.shape)
    if polarity == "dark":
        grey = 255.0 - grey
    grey = np.clip(grey, 0.0, 255.0)
    return np.round(grey * (257.0 if depth is np.uint16 else 1.0)).astype(depth)


def fitted_radii(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Centre and half axes of the upright ellipse nearest to points."""
    x, y = points.T
    basis = np.stack([x * x, x, y * y, y], axis=1)
    a, b, c, d = np.linalg.lstsq(basis, np.ones(len(x)))[0]
    scale = 1.0 + b * b / (4.0 * a) + d * d / (4.0 * c)
    return np.array([-b / (2 * a), -d / (2 * c), np.sqrt(scale / a), np.sqrt(scale / c)])


@pytest.mark.parametrize("depth", [np.uint8, np.uint16])
@pytest.mark.parametrize("kind", ["mask", "clean", "noisy"])
@pytest.mark.parametrize("polarity", ["bright", "dark"])
@pytest.mark.parametrize("radii", [(31.0, 31.0), (12.4, 12.4), (50.0, 21.0), (20.0, 33.3)])
def test_an_ellipse_has_the_size_it_was_drawn_with(
    cover: Cover,
    radii: tuple[float, float],
    polarity: str,
    kind: str,
    depth: type[np.unsignedinteger],
) -> None:
    image = drawn(cover(SHAPE, CENTRE, radii), polarity, kind, depth)
    before = image.copy()
    traced = traced_image(image)
    (edges,) = traced.sections
    tolerance = CLEAN_TOLERANCE_PX if kind == "clean" else RADIUS_TOLERANCE_PX
    np.testing.assert_allclose(fitted_radii(edges.outer), [*CENTRE, *radii], atol=tolerance)
    assert traced.polarity == polarity
    assert edges.lumen is None
    assert not edges.other_component
    assert not edges.carried
    np.testing.assert_array_equal(image, before)


@pytest.mark.parametrize("kind", ["mask", "clean", "noisy"])
@pytest.mark.parametrize("polarity", ["bright", "dark"])
@pytest.mark.parametrize("wall", [10.0, 5.0, 3.0])
def test_a_ring_has_the_walls_it_was_drawn_with(
    cover: Cover, wall: float, polarity: str, kind: str
) -> None:
    ring = cover(SHAPE, CENTRE, (31.0, 31.0)) - cover(SHAPE, CENTRE, (31.0 - wall, 31.0 - wall))
    traced = traced_image(drawn(ring, polarity, kind, np.uint8))
    (edges,) = traced.sections
    assert edges.lumen is not None
    assert traced.polarity == polarity
    inner = 31.0 - wall
    np.testing.assert_allclose(
        fitted_radii(edges.outer), [*CENTRE, 31.0, 31.0], atol=RADIUS_TOLERANCE_PX
    )
    np.testing.assert_allclose(
        fitted_radii(edges.lumen), [*CENTRE, inner, inner], atol=RADIUS_TOLERANCE_PX
    )


@pytest.mark.parametrize("lumen_level", [20.0, 90.0, 140.0])
def test_a_lumen_of_another_level_than_the_background_has_its_own_half_height(
    cover: Cover, lumen_level: float
) -> None:
    outer, inner = cover(SHAPE, CENTRE, (33.0, 33.0)), cover(SHAPE, CENTRE, (25.0, 25.0))
    image = np.round(60.0 + 140.0 * outer + (lumen_level - 200.0) * inner).astype(np.uint8)
    traced = traced_image(image)
    (edges,) = traced.sections
    assert traced.polarity == "bright"
    assert edges.lumen is not None
    np.testing.assert_allclose(
        fitted_radii(edges.outer), [*CENTRE, 33.0, 33.0], atol=CLEAN_TOLERANCE_PX
    )
    np.testing.assert_allclose(
        fitted_radii(edges.lumen), [*CENTRE, 25.0, 25.0], atol=CLEAN_TOLERANCE_PX
    )
    # Grey levels are rounded to whole numbers.
    assert edges.threshold == pytest.approx(130.0, abs=0.5)


def test_a_hole_too_small_for_a_lumen_is_filled(cover: Cover) -> None:
    grey = cover(SHAPE, CENTRE, (30.0, 30.0)) - cover(SHAPE, CENTRE, (4.0, 4.0))
    edges = traced_edges(drawn(grey, "bright", "clean", np.uint8))
    assert edges.lumen is None


def test_an_open_ring_has_no_lumen(cover: Cover) -> None:
    ring = cover(SHAPE, CENTRE, (31.0, 31.0)) - cover(SHAPE, CENTRE, (25.0, 25.0))
    ring[60:, 60:76] = 0.0
    assert traced_edges(drawn(ring, "bright", "clean", np.uint8)).lumen is None


def test_the_largest_component_is_the_organ(cover: Cover) -> None:
    speck = cover(SHAPE, (15.0, 15.0), (8.0, 8.0))
    image = drawn(cover(SHAPE, CENTRE, (20.0, 20.0)) + speck, "bright", "noisy", np.uint8)
    edges = traced_edges(image)
    np.testing.assert_allclose(
        fitted_radii(edges.outer), [*CENTRE, 20.0, 20.0], atol=RADIUS_TOLERANCE_PX
    )
    assert edges.other_component


@pytest.mark.parametrize("turns", range(4))
@pytest.mark.parametrize(("gap", "touches"), [(-1.0, True), (2.0, False)])
def test_an_organ_at_any_border_is_refused(
    cover: Cover, turns: int, gap: float, touches: bool
) -> None:
    image = drawn(cover((64, 64), (32.0, 14.5 + gap), (15.0, 15.0)), "bright", "mask", np.uint8)
    traced = traced_image(np.rot90(image, turns).copy(), polarity="bright")
    assert traced.problems == ({0: BORDER_PROBLEM} if touches else {})
    assert len(traced.sections) == (not touches)


@pytest.mark.parametrize("polarity", ["auto", "bright", "dark"])
def test_nothing_is_found_in_an_even_image(polarity: Polarity) -> None:
    with pytest.raises(NoEdgeFound, match="nothing stands out"):
        traced_edges(np.full(SHAPE, 77, dtype=np.uint8), polarity=polarity)


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("polarity", ["auto", "bright", "dark"])
def test_nothing_is_found_in_noise(polarity: Polarity, seed: int) -> None:
    noise = np.random.default_rng(seed).normal(100.0, NOISE, SHAPE)
    with pytest.raises(NoEdgeFound):
        traced_edges(np.round(noise).astype(np.uint8), polarity=polarity)


def test_a_speck_is_no_organ() -> None:
    image = np.zeros(SHAPE, dtype=np.uint8)
    image[60:62, 60:62] = 255
    with pytest.raises(NoEdgeFound):
        traced_edges(image)


def test_images_without_an_organ_do_not_decide_the_polarity(cover: Cover) -> None:
    dark = drawn(cover(SHAPE, CENTRE, (20.0, 20.0)), "dark", "clean", np.uint8)
    empty = np.full(SHAPE, 195, dtype=np.uint8)
    assert find_polarity([empty, dark, empty]) == "dark"


@pytest.mark.parametrize(
    "image",
    [np.zeros((4, 4, 3), np.uint8), np.zeros((0, 4), np.uint8), np.zeros((4, 4), np.float32)],
)
def test_what_is_no_grey_image_is_refused(image: NDArray[np.uint8]) -> None:
    with pytest.raises(ValueError, match=r"image must be \(H, W\) grey levels of 8 or 16 bit"):
        as_grey(image)


def test_an_unknown_polarity_is_refused() -> None:
    with pytest.raises(ValueError, match="polarity must be auto, bright or dark, not 'grey'"):
        traced_edges(np.zeros((4, 4), np.uint8), polarity="grey")


@pytest.mark.parametrize("pixel_size", [(1e-6, 1000.0), (1000.0, 1e-6)])
def test_blur_does_not_follow_pixels_of_any_shape(
    cover: Cover, pixel_size: tuple[float, float]
) -> None:
    image = drawn(cover(SHAPE, CENTRE, (30.0, 30.0)), "bright", "clean", np.uint8)
    edges = traced_edges(image, pixel_size=pixel_size)
    np.testing.assert_allclose(fitted_radii(edges.outer), [*CENTRE, 30.0, 30.0], atol=0.2)
