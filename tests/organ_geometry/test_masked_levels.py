"""Quantiles of the levels in a mask are those of its pixels."""

import numpy as np
import pytest

from organ_geometry.contours.masked_levels import (
    MANY_PIXELS,
    level_exceeded,
    median_change,
    median_where,
)

RNG = np.random.default_rng(8)


@pytest.mark.parametrize("side", [3, 20, 44])
def test_few_pixels_have_the_exact_quantiles(side: int) -> None:
    levels = RNG.normal(size=(side, side + 1)).astype(np.float32)
    mask = np.where(RNG.random(levels.shape) < 0.5, np.uint8(255), np.uint8(0))
    mask[0, 0] = 1
    inside = levels[mask > 0]
    assert median_where(levels, mask) == (pytest.approx(np.median(inside)), len(inside))
    for fraction in (0.0, 0.1, 0.75, 1.0):
        expected = np.quantile(inside, 1.0 - fraction)
        assert level_exceeded(levels, mask, fraction) == pytest.approx(expected, abs=1e-6)
    others = RNG.normal(size=levels.shape).astype(np.float32)
    assert median_change(levels, others) == pytest.approx(np.median(np.abs(levels - others)))


def test_many_pixels_are_thinned_out_over_all_of_the_mask() -> None:
    # A slope: its median is the middle of the mask, to the distance of the pixels taken.
    levels = np.arange(400 * 300, dtype=np.float32).reshape(400, 300)
    mask = np.zeros(levels.shape, dtype=np.uint8)
    mask[100:300] = 1
    median, count = median_where(levels, mask)
    assert count == 200 * 300
    assert median == pytest.approx(levels[mask > 0].mean(), abs=count / MANY_PIXELS)
    assert median_change(levels, 0.0 * levels) == pytest.approx(levels.mean(), abs=120)


def test_an_empty_mask_has_no_median() -> None:
    median, count = median_where(np.zeros((4, 5), np.float32), np.zeros((4, 5), np.uint8))
    assert np.isnan(median)
    assert count == 0
