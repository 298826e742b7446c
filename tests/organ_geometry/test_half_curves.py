"""Half-curves give back what they can hold, and come near to what they cannot."""

import numpy as np
import pytest
from numpy.polynomial import chebyshev
from numpy.typing import NDArray
from tubes import of_row

from organ_geometry.curves.half_curves import (
    RANGE_FRACTION,
    ROW_SIZE,
    HalfCurves,
    NotSingleValued,
    closed_outlines,
    fit_half_curves,
    outline_points,
)
from organ_geometry.curves.outline_distance import polygon_distances

# Sums of a few hundred products of numbers around one.
ROUNDING = 1e-10
# A circle's distance to two free polynomials of degree six, weighted along the normal: 0.30 % of
# the radius is published for this fit; forced ends would give above 1.3 %.
CIRCLE_RMS_FRACTION = 0.0035


def circle(radius: float, count: int = 720) -> NDArray[np.float64]:
    angles = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    return radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)


def sextic_boundary(top: NDArray[np.float64], bottom: NDArray[np.float64]) -> NDArray[np.float64]:
    """A closed boundary of two polynomials over x from 1 to 5."""
    u = np.linspace(-1.0, 1.0, 200)
    upper = np.stack([3.0 + 2.0 * u, chebyshev.chebval(u, top)], axis=1)
    lower = np.stack([3.0 + 2.0 * u, chebyshev.chebval(u, bottom)], axis=1)
    return np.concatenate([upper, lower[::-1]]).astype(np.float64)


TOP = np.array([-2.0, 0.1, 0.9, -0.1, 0.12, 0.03, 0.05])
BOTTOM = np.array([1.8, 0.2, -0.8, 0.07, -0.1, 0.02, -0.04])


@pytest.mark.parametrize("turned", [False, True], ids=["one sense", "other sense"])
@pytest.mark.parametrize("start", [0, 57, 200, 311])
def test_a_curve_of_degree_six_is_given_back(turned: bool, start: int) -> None:
    boundary = np.roll(sextic_boundary(TOP, BOTTOM), start, axis=0)
    before = boundary.copy()
    curves = fit_half_curves(boundary[::-1] if turned else boundary)
    u = np.linspace(-1.0, 1.0, 11)
    x = 3.0 + 2.0 * u
    own = (x - curves.middle) / curves.half_width
    np.testing.assert_allclose(
        chebyshev.chebval(own, curves.top), chebyshev.chebval(u, TOP), atol=ROUNDING
    )
    np.testing.assert_allclose(
        chebyshev.chebval(own, curves.bottom), chebyshev.chebval(u, BOTTOM), atol=ROUNDING
    )
    assert curves.middle == pytest.approx(3.0)
    assert curves.half_width == pytest.approx(2.0 * RANGE_FRACTION)
    np.testing.assert_array_equal(boundary, before)


def test_a_circle_is_fitted_to_the_floor_of_degree_six() -> None:
    curves = fit_half_curves(circle(3.0))
    distances = curves.distances(circle(3.0))
    assert np.sqrt(np.mean(distances**2)) < CIRCLE_RMS_FRACTION * 3.0
    # Up and down are the same, so are left and right.
    np.testing.assert_allclose(curves.top, -curves.bottom, atol=ROUNDING)
    np.testing.assert_allclose(curves.top[1::2], 0.0, atol=ROUNDING)


def test_crowded_points_do_not_pull_the_fit() -> None:
    angles = np.sort(np.concatenate([np.linspace(0, 2 * np.pi, 400), np.linspace(0.5, 1.0, 600)]))
    crowded = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    even = fit_half_curves(circle(1.0)).as_row()
    # With every point counted alike, the crowd moves the fit by 0.005.
    np.testing.assert_allclose(fit_half_curves(crowded).as_row(), even, atol=2e-4)


def test_few_points_make_a_boundary_too() -> None:
    octagon = circle(2.0, 8)
    curves = fit_half_curves(octagon)
    # Corners of 45 degrees, which no curve of degree six follows.
    assert curves.distances(octagon).max() < 0.1


def test_a_curve_that_runs_away_without_points_is_refused() -> None:
    # Of the upper half only the left end is there: degree six leaves it for anywhere.
    x, y = circle(1.0).T
    arc = circle(1.0)[~((y < 0.0) & (x > -0.5))]
    with pytest.raises(NotSingleValued, match="the edge is not single-valued, one top and one"):
        fit_half_curves(arc)


def test_the_outline_runs_like_atan2() -> None:
    curves = fit_half_curves(circle(2.0) + np.array([0.5, -0.3]))
    angles = np.radians([0.0, 90.0, 180.0, 270.0])
    x, y = outline_points(np.broadcast_to(curves.as_row(), (4, ROW_SIZE)), angles).T
    np.testing.assert_allclose(x, [0.5 + 2 * RANGE_FRACTION, 0.5, 0.5 - 2 * RANGE_FRACTION, 0.5])
    # y runs down the image: a quarter turn from x is the bottom.
    assert y[1] == pytest.approx(1.7, abs=2 * 0.01)
    assert y[3] == pytest.approx(-2.3, abs=2 * 0.01)


def test_outline_points_agree_with_numpys_chebyshev_series() -> None:
    rng = np.random.default_rng(2)
    rows = rng.normal(size=(50, ROW_SIZE))
    rows[:, 1] = rng.uniform(0.5, 2.0, 50)
    angles = rng.uniform(-7.0, 7.0, 50)
    points = outline_points(rows, angles)
    for row, angle, point in zip(rows, angles, points, strict=True):
        half = row[9:] if np.sin(angle) >= 0.0 else row[2:9]
        expected = [row[0] + row[1] * np.cos(angle), chebyshev.chebval(np.cos(angle), half)]
        np.testing.assert_allclose(point, expected, atol=ROUNDING)


def test_a_row_comes_back() -> None:
    row = fit_half_curves(sextic_boundary(TOP, BOTTOM)).as_row()
    np.testing.assert_array_equal(of_row(row).as_row(), row)


def test_distances_count_the_upright_ends() -> None:
    # A rectangle: two level lines, closed by segments of length 2.
    row = np.zeros(ROW_SIZE)
    row[1], row[2], row[9] = 3.0, -1.0, 1.0
    points = np.array([[0.0, 0.0], [0.0, 2.5], [4.0, 0.5], [-3.0, 0.0], [5.0, 3.0], [2.5, 0.2]])
    np.testing.assert_allclose(
        of_row(row).distances(points),
        [1.0, 1.5, 1.0, 0.0, np.hypot(2.0, 2.0), 0.5],
        atol=ROUNDING,
    )


def test_a_closed_outline_holds_both_ends_and_turns_one_way() -> None:
    row = fit_half_curves(circle(1.0)).as_row()
    outline = closed_outlines(row[np.newaxis], 64)[0]
    assert outline.shape == (64, 2)
    np.testing.assert_allclose(
        outline[[0, 31, 32, 63], 0], RANGE_FRACTION * np.array([1, -1, -1, 1])
    )
    after = np.roll(outline, -1, axis=0)
    cross = outline[:, 0] * after[:, 1] - outline[:, 1] * after[:, 0]
    assert (cross > 0.0).all()


def test_polygon_distances_of_a_square() -> None:
    square = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])
    points = np.array([[1.0, 1.0], [3.0, 3.0], [-1.0, 0.5], [2.0, 1.0]])
    np.testing.assert_allclose(polygon_distances(points, square), [1.0, np.sqrt(2.0), 1.0, 0.0])


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (np.zeros((2, 2)), r"shape \(N, 2\) with three or more points"),
        (np.zeros((5, 3)), r"shape \(N, 2\) with three or more points"),
        (np.full((5, 2), np.nan), "must be finite"),
        (np.array([[1.0, 0.0], [1.0, 1.0], [1.0, 2.0]]), "width above 0 mm, not 0 mm"),
    ],
)
def test_points_without_a_boundary_are_refused(points: NDArray[np.float64], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        fit_half_curves(points)


def test_rows_without_a_boundary_are_refused() -> None:
    with pytest.raises(ValueError, match="half width above 0 mm"):
        HalfCurves(0.0, 0.0, np.zeros(7), np.zeros(7))
    with pytest.raises(ValueError, match="top must be 7 finite coefficients"):
        HalfCurves(0.0, 1.0, np.full(7, np.inf), np.zeros(7))
