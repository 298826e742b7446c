"""Distances that are looked for only where they can be are those of all sides, to the last bit."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from organ_geometry.contours.contour import even_points
from organ_geometry.curves.half_curves import (
    closed_outlines,
    fit_half_curves,
)
from organ_geometry.curves.outline_distance import outline_distances, polygon_distances
from organ_geometry.surface_distance import LocatedPoints


def rows_and_points(seed: int, spread: float) -> tuple[np.ndarray, np.ndarray]:
    """Half-curves of any shape, and points on them, near them and far away."""
    rng = np.random.default_rng(seed)
    rows = rng.normal(0.0, spread, (2, 16))
    rows[:, 1] = rng.uniform(0.05, 3.0, 2)
    rows[:, 2] -= 1.0
    rows[:, 9] += 1.0
    corners = closed_outlines(rows, 96)
    on = corners[0][rng.integers(0, 96, 60)]
    between = 0.5 * (corners[0] + np.roll(corners[0], 1, axis=0))
    far = rng.normal(0.0, 4.0, (40, 2))
    return rows, np.concatenate([on, between, on + rng.normal(0.0, 0.05, on.shape), far])


@settings(deadline=None)
@given(seed=st.integers(0, 2**32 - 1), spread=st.sampled_from([0.0, 0.1, 0.5, 2.0]))
def test_distances_to_an_outline_are_those_to_its_polygon(seed: int, spread: float) -> None:
    rows, points = rows_and_points(seed, spread)
    corners = closed_outlines(rows, 96)[0]
    np.testing.assert_array_equal(
        outline_distances(points, corners), polygon_distances(points, corners)
    )


@settings(deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    spread=st.sampled_from([0.0, 0.1, 0.5]),
    fraction=st.sampled_from([0.0, 0.25, 0.5]),
)
def test_distances_between_two_outlines_are_those_to_the_one_between(
    seed: int, spread: float, fraction: float
) -> None:
    rows, points = rows_and_points(seed, spread)
    count = len(points)
    located = LocatedPoints(
        np.zeros(count, dtype=np.intp), np.full(count, fraction), points, np.zeros(count)
    )
    corners = closed_outlines(rows, 96)
    between = corners[0] * (1.0 - fraction) + corners[1] * fraction
    np.testing.assert_array_equal(located.distances(rows), polygon_distances(points, between))


def test_what_lies_beyond_an_end_counts_with_the_distance() -> None:
    rows, points = rows_and_points(3, 0.1)
    count = len(points)
    located = LocatedPoints(
        np.zeros(count, dtype=np.intp), np.zeros(count), points, np.full(count, 4.0)
    )
    away = polygon_distances(points, closed_outlines(rows, 96)[0])
    np.testing.assert_allclose(located.distances(rows), np.hypot(away, 4.0), rtol=1e-14)


@pytest.mark.parametrize("count", [40, 400])
def test_a_fit_is_the_least_squares_one(count: int) -> None:
    # No other coefficients near those found come nearer, by their own measure: weighted y.
    turn = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    boundary = np.stack([2.0 * np.cos(turn), np.sin(turn) + 0.2 * np.sin(3.0 * turn)], axis=1)
    curves = fit_half_curves(boundary)
    after, before = np.roll(boundary, -1, axis=0), np.roll(boundary, 1, axis=0)
    chords = after - before
    lengths = np.linalg.norm(after - boundary, axis=1) + np.linalg.norm(boundary - before, axis=1)
    weights = (chords[:, 0] / np.linalg.norm(chords, axis=1)) ** 2 * lengths
    u = (boundary[:, 0] - curves.middle) / curves.half_width
    basis = np.polynomial.chebyshev.chebvander(u, 6)
    for half, inside in (
        (curves.bottom, turn <= np.pi),
        (curves.top, (turn >= np.pi) | (turn == 0)),
    ):
        rest = boundary[inside, 1] - basis[inside] @ half
        slopes = basis[inside].T @ (weights[inside] * rest)
        np.testing.assert_allclose(slopes, 0.0, atol=1e-10)


def test_points_that_do_not_tell_coefficients_apart_make_a_curve_all_the_same() -> None:
    # Few different x: a staircase of four treads.
    steps = np.array(
        [[0, 0], [1, 0], [1, 1], [2, 1], [2, 0], [3, 0], [3, -2], [0, -2]], dtype=float
    )
    curves = fit_half_curves(even_points(steps, 16))
    assert np.isfinite(curves.as_row()).all()
